//! Figures 1 to 16 of Pan & Wu, *Underwater Doppler Navigation with Self-calibration*, Journal of
//! Navigation 69 (2016) 295-312, from the histories of its two runs.
//!
//! The axes are the paper's: x forward, y up, z right, with roll about x, yaw about y and pitch
//! about z. navfuse uses forward, right, down. So quantities about or along the paper's y axis are
//! navfuse's third component with the opposite sign.

use crate::history::{BlockHistory, RunHistory};
use crate::page::{document, picture};
use crate::plots::{
    beside, channel, convergence, curve, error, label, normalised_panel, over_time, profile, tracks,
};
use crate::results::Standard;
use crate::sensors::SensorHistory;
use maud::html;
use navfuse_figures::{Axis, Curve, Figure, FigureError, Look, Panel};

/// Axes of the paper: the name, the component of navfuse, and the sign.
const AXES: [(&str, usize, f64); 3] =
    [("x, forward", 0, 1.0), ("y, up", 2, -1.0), ("z, right", 1, 1.0)];
/// Angles of the paper about these axes.
const ANGLES: [(&str, usize, f64); 3] = [
    ("roll, about x forward", 0, 1.0),
    ("yaw, about y up", 2, -1.0),
    ("pitch, about z right", 1, 1.0),
];

/// Captions of the paper, from Figure 1 on.
pub const CAPTIONS: [&str; 16] = [
    "Moving trajectory of the underwater vehicle (3D run: in blue, 2D run: in red).",
    "Profile of DVL outputs with specific time tag.",
    "Profile of IMU gyroscope/accelerometer outputs with specific time tag.",
    "DVL scale factor estimate by ideal observer IO-DVLC.",
    "DVL misalignment angle estimate by ideal observer IO-DVLC (unit: degree).",
    "DVL scale factor estimate and standard variance by EKF.",
    "DVL misalignment angle estimate and standard variance by EKF (unit: °).",
    "Gyroscope bias estimate and standard variance by EKF (unit: °/h).",
    "Accelerometer bias estimate and standard variance by EKF (unit: micro g).",
    "Attitude error and standard variance by EKF (unit: °).",
    "Horizontal position error and standard variance of position estimate by EKF (unit: metre).",
    "Normalised standard variances for attitude, inertial sensor bias, DVL scale factor and \
     misalignment angles.",
    "DVL scale factor estimate by EKF in 2D run.",
    "DVL misalignment angle estimate by EKF in 2D run (unit: °).",
    "Attitude error and standard variance by EKF in 2D run (unit: °).",
    "Horizontal position error and standard variance of position estimate by EKF in 2D run (unit: \
     metre).",
];

/// Histories of the two runs.
#[derive(Clone, Debug)]
pub struct Runs {
    /// Run with the descent and the ascent.
    pub three: RunHistory,
    /// Run without them.
    pub two: RunHistory,
    /// Results of ideal observers on the samples of the 3D run; Figures 4 and 5 need at least one.
    pub observers: Vec<Observer>,
}

/// Result of an ideal observer.
#[derive(Clone, Debug, PartialEq)]
pub struct Observer {
    /// Name, such as `as printed`.
    pub name: String,
    /// Time (s), scale factor, and roll, pitch and yaw (deg) of the DVL about forward, right, down.
    pub steps: Vec<(f64, [f64; 4])>,
}

/// Error of a run that lacks a block or sensor of the paper's runs.
#[derive(Debug, thiserror::Error)]
#[error(
    "the run {run:?} has no {what}: Figures 1 to 16 are of the scenarios pan-wu-3d and pan-wu-2d"
)]
pub struct Missing {
    /// Name of the scenario.
    pub run: String,
    /// Missing block or sensor.
    pub what: &'static str,
}

/// Plots the figures, each with its number in the paper.
///
/// # Errors
/// Returns an error if a run lacks the states and sensors of the paper.
pub fn figures(runs: &Runs) -> Result<Vec<(usize, Figure)>, Missing> {
    let Runs { three, two, observers } = runs;
    let figure = |number: usize, columns: usize, title: &str, panels: Vec<Panel>| {
        let title = format!("Figure {number}: {title}");
        (number, Figure { name: format!("figure-{number:02}"), title, columns, panels })
    };
    let mut figures = vec![
        figure(1, 2, "trajectory", trajectory(three, two)?),
        figure(2, 3, "DVL outputs, 3D run", profiles(sensor(three, "dvl")?, &[0])),
        figure(
            3,
            3,
            "gyroscope and accelerometer outputs, 3D run",
            profiles(sensor(three, "imu")?, &[0, 3]),
        ),
        figure(6, 2, "DVL scale factor by the EKF, 3D run", scale(three)?),
        figure(7, 3, "DVL misalignment by the EKF, 3D run", misalignment(three)?),
        figure(
            8,
            3,
            "gyroscope bias by the EKF, 3D run",
            estimates(block(three, "ins.gyro_bias")?, AXES),
        ),
        figure(
            9,
            3,
            "accelerometer bias by the EKF, 3D run",
            estimates(block(three, "ins.accel_bias")?, AXES),
        ),
        figure(10, 3, "attitude error by the EKF, 3D run", attitude(three)?),
        figure(11, 2, "horizontal position error by the EKF, 3D run", position(three)?),
        figure(12, 2, "normalised standard deviations, 3D run", normalised(three)?),
        figure(13, 2, "DVL scale factor by the EKF, 2D run", scale(two)?),
        figure(14, 3, "DVL misalignment by the EKF, 2D run", misalignment(two)?),
        figure(15, 3, "attitude error by the EKF, 2D run", attitude(two)?),
        figure(16, 2, "horizontal position error by the EKF, 2D run", position(two)?),
    ];
    if !observers.is_empty() {
        let (scale, angles) = observed(three, observers)?;
        figures.insert(
            3,
            figure(4, 1, "DVL scale factor by the ideal observer IO-DVLC, 3D run", vec![scale]),
        );
        figures.insert(
            4,
            figure(5, 3, "DVL misalignment by the ideal observer IO-DVLC, 3D run", angles),
        );
    }
    Ok(figures)
}

/// Half ranges of the plotted scale factor and angles (deg) about the truth. The first samples of a
/// segment hold hardly any information, so their estimates may lie outside.
const OBSERVED: [f64; 2] = [0.05, 3.0];

/// Plots the observers' scale factor and angles with the truth.
fn observed(run: &RunHistory, observers: &[Observer]) -> Result<(Panel, Vec<Panel>), Missing> {
    let panel =
        |title: &str, block: &BlockHistory, (k, sign): (usize, f64), place: usize, about: f64| {
            let last = &block.last;
            let truth = sign * (last.estimate[k] - last.error.get(k).copied().unwrap_or(f64::NAN));
            // from the end of the rest on, as for the filter: nothing is observable before
            let steps = |o: &'_ Observer| {
                o.steps.iter().copied().filter(|s| s.0 >= block.first.time).collect::<Vec<_>>()
            };
            let times = || observers.iter().flat_map(|o| steps(o).into_iter().map(|s| s.0));
            let mut curves = vec![curve("truth", Look::Truth, times().map(|t| [t, truth]))];
            curves[0].points.sort_by(|a, b| a[0].total_cmp(&b[0]));
            curves.extend(observers.iter().enumerate().map(|(number, o)| {
                curve(
                    &o.name,
                    Look::Data(1 - number.min(1)),
                    steps(o).iter().map(|s| [s.0, sign * s.1[place]]),
                )
            }));
            let y = Axis::linear(label("", &block.unit)).within([truth - about, truth + about]);
            over_time(title, y, curves, Vec::new())
        };
    let (scale, angles) = (block(run, "dvl.scale")?, block(run, "dvl.misalignment")?);
    let of_angles =
        ANGLES.map(|(name, k, sign)| panel(name, angles, (k, sign), k + 1, OBSERVED[1]));
    Ok((panel("scale factor k", scale, (0, 1.0), 0, OBSERVED[0]), of_angles.into()))
}

fn block<'a>(run: &'a RunHistory, name: &'static str) -> Result<&'a BlockHistory, Missing> {
    run.block(name).ok_or_else(|| Missing { run: run.name.clone(), what: name })
}

fn sensor<'a>(run: &'a RunHistory, name: &'static str) -> Result<&'a SensorHistory, Missing> {
    run.sensor(name)
        .filter(|s| s.read > 0)
        .ok_or_else(|| Missing { run: run.name.clone(), what: name })
}

/// Plots the true tracks of both runs, on the map and as heights over time.
fn trajectory(three: &RunHistory, two: &RunHistory) -> Result<Vec<Panel>, Missing> {
    let (mut map, mut height) = (Vec::new(), Vec::new());
    for (name, look, run) in [("3D run", Look::Data(0), three), ("2D run", Look::Data(1), two)] {
        let (_, truth) = tracks(block(run, "ins.position")?);
        map.push(curve(name, look, truth.iter().map(|(_, p)| [p[1], p[0]])));
        height.push(curve(name, look, truth.iter().map(|(t, p)| [*t, -p[2]])));
    }
    let map = Panel {
        title: "from above".into(),
        x: Axis::map("east [m]"),
        y: Axis::map("north [m]"),
        curves: map,
        bands: Vec::new(),
    };
    Ok(vec![map, over_time("from the side", Axis::linear("up [m]"), height, Vec::new())])
}

/// Plots three channels each, from the given channels on, along the paper's axes.
fn profiles(sensor: &SensorHistory, from: &[usize]) -> Vec<Panel> {
    let channels =
        from.iter().flat_map(|first| AXES.map(|(name, k, sign)| (name, first + k, sign)));
    let panel = |(axis, k, sign): (&str, usize, f64)| {
        let column = sensor.channels.get(k).map_or("", String::as_str);
        let (name, unit, factor) = channel(column);
        let of = column.split('_').next().unwrap_or_default();
        let what = [("vel", "velocity"), ("gyro", "angular rate"), ("accel", "specific force")]
            .into_iter()
            .find_map(|(short, long)| (short == of).then_some(long))
            .unwrap_or(&name);
        let points = profile(sensor, k).map(|[t, v]| [t, sign * factor * v]);
        let curves = vec![curve("", Look::Data(0), points)];
        over_time(format!("{what} {axis}"), Axis::linear(label("", &unit)), curves, Vec::new())
    };
    channels.map(panel).collect()
}

fn scale(run: &RunHistory) -> Result<Vec<Panel>, Missing> {
    let k = block(run, "dvl.scale")?;
    Ok([beside(k, 0, 1.0, Standard::Truth), convergence(k, 0, Standard::Truth)]
        .map(|p| named(p, "scale factor k"))
        .into())
}

fn misalignment(run: &RunHistory) -> Result<Vec<Panel>, Missing> {
    Ok(estimates(block(run, "dvl.misalignment")?, ANGLES))
}

/// Plots estimates with the truth, and below them their convergence.
fn estimates(block: &BlockHistory, axes: [(&str, usize, f64); 3]) -> Vec<Panel> {
    let above = axes.map(|(name, k, sign)| named(beside(block, k, sign, Standard::Truth), name));
    above
        .into_iter()
        .chain(axes.map(|(name, k, _)| named(convergence(block, k, Standard::Truth), name)))
        .collect()
}

fn attitude(run: &RunHistory) -> Result<Vec<Panel>, Missing> {
    let attitude = block(run, "ins.attitude")?;
    let above =
        ANGLES.map(|(name, k, sign)| named(error(attitude, k, sign, Standard::Truth), name));
    Ok(above
        .into_iter()
        .chain(ANGLES.map(|(name, k, _)| named(convergence(attitude, k, Standard::Truth), name)))
        .collect())
}

fn position(run: &RunHistory) -> Result<Vec<Panel>, Missing> {
    let position = block(run, "ins.position")?;
    let axes = [("north", 0), ("east", 1)];
    let above = axes.map(|(name, k)| named(error(position, k, 1.0, Standard::Truth), name));
    Ok(above
        .into_iter()
        .chain(axes.map(|(name, k)| named(convergence(position, k, Standard::Truth), name)))
        .collect())
}

fn normalised(run: &RunHistory) -> Result<Vec<Panel>, Missing> {
    let panel = |title: &str, name: &'static str, names: [(&str, usize, f64); 3]| {
        let panel = normalised_panel(block(run, name)?, &names.map(|n| n.1));
        let curves = panel
            .curves
            .into_iter()
            .zip(names)
            .map(|(c, n)| Curve { name: n.0.into(), ..c })
            .collect();
        Ok(Panel { title: title.into(), curves, ..panel })
    };
    let mut dvl = panel("DVL scale factor and misalignment", "dvl.misalignment", ANGLES)?;
    let k = normalised_panel(block(run, "dvl.scale")?, &[0]).curves;
    dvl.curves.extend(k.into_iter().map(|c| Curve {
        name: "scale factor".into(),
        look: Look::Data(3),
        ..c
    }));
    Ok(vec![
        panel("attitude", "ins.attitude", ANGLES)?,
        panel("gyroscope bias", "ins.gyro_bias", AXES)?,
        panel("accelerometer bias", "ins.accel_bias", AXES)?,
        dvl,
    ])
}

fn named(panel: Panel, title: &str) -> Panel {
    Panel { title: title.into(), ..panel }
}

/// Creates a page of all figures, each with the paper's caption.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(figures: &[(usize, Figure)]) -> Result<String, FigureError> {
    let body = html! {
        header {
            h1 { "Figures of Pan & Wu (2016)" }
            p {
                "Pan & Wu, " i { "Underwater Doppler Navigation with Self-calibration" }
                ", Journal of Navigation 69 (2016) 295-312, reproduced from runs of the scenarios \
                 pan-wu-3d and pan-wu-2d. The paper's caption is below each figure."
            }
            p.note {
                "The axes follow the paper: x forward, y up, z right; roll about x, yaw \
                 about y, pitch about z. navfuse uses forward, right, down: quantities about or \
                 along the paper's y axis are navfuse's third component with the opposite sign. \
                 The paper's standard variance is the standard deviation, 1-sigma. The filter \
                 starts at 600 s, after the static alignment."
            }
        }
        main {
            @for (number, figure) in figures {
                @let caption = CAPTIONS.get(number.wrapping_sub(1)).copied().unwrap_or_default();
                (picture(figure, &html! { "Figure " (number) ". " (caption) })?)
            }
        }
    };
    Ok(document("Figures of Pan & Wu (2016)", &body))
}
