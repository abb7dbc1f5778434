//! Figures of several runs: their curves one over another, and the differences from the first run.

use super::apart::{SAME, difference};
use super::{Run, between, estimated, look, title, union};
use crate::history::{BlockHistory, Row};
use crate::innovations::mean_nis;
use crate::plots::{close_range, curve, heights, label, over_time, tracks_from};
use navfuse_figures::{Axis, Band, Curve, Figure, Look, Panel, Track, TrackPoint};

/// Length of a degree of latitude, m, near enough for the few metres of an error on a map.
const METRES_PER_DEGREE: f64 = 111_200.0;

/// Plots several runs: track, states with their differences from the first run, and mean NIS.
pub fn figures(runs: &[Run]) -> Vec<Figure> {
    let states = estimated(runs).into_iter().filter_map(|name| state(runs, name));
    let sensors = runs.iter().flat_map(|run| &run.history.sensors);
    let measuring =
        union(sensors.filter(|s| s.updates.outcomes.accepted > 0).map(|s| s.name.as_str()));
    let nis = measuring.into_iter().map(|name| nis(runs, name));
    track(runs).into_iter().chain(states).chain(nis).collect()
}

/// The tracks of the runs from the start of the first one, and the first known true track.
pub fn tracks(runs: &[Run]) -> Vec<Track> {
    let Some(start) = runs.iter().find_map(|run| run.history.position()).map(|p| &p.first) else {
        return Vec::new();
    };
    let mut tracks = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        let Some(position) = run.history.position() else { continue };
        let (estimate, truth) = tracks_from(position, start);
        let geographic = |r: &Row| Some([*r.estimate.first()?, *r.estimate.get(1)?]);
        let angles: Vec<&Row> =
            run.history.attitude().map_or_else(Vec::new, |b| b.shown().collect());
        let turned = |time: f64| {
            let row = angles.get(angles.partition_point(|r| r.time < time - SAME))?;
            row.estimate.first_chunk::<3>().copied()
        };
        let points = estimate.iter().zip(position.shown()).filter_map(|((time, place), row)| {
            Some(TrackPoint {
                time: *time,
                north_east_down: *place,
                latitude_longitude: geographic(row)?,
                roll_pitch_yaw: turned(*time),
            })
        });
        let points: Vec<TrackPoint> = points.collect();
        if tracks.iter().all(|t: &Track| t.look != Look::Truth) && !truth.is_empty() {
            // the true place on the map: the estimate less its error, in degrees at that latitude
            let mut estimates = points.iter();
            let truth = truth.iter().filter_map(|(time, place)| {
                let near = estimates.find(|p| p.time >= *time - SAME)?;
                let [north, east] = [0, 1].map(|j| near.north_east_down[j] - place[j]);
                let [latitude, longitude] = near.latitude_longitude;
                let shrunk = latitude.to_radians().cos();
                let degree = METRES_PER_DEGREE;
                let latitude_longitude =
                    [latitude - north / degree, longitude - east / (degree * shrunk)];
                Some(TrackPoint {
                    latitude_longitude,
                    roll_pitch_yaw: None,
                    time: *time,
                    north_east_down: *place,
                })
            });
            let name = run.history.standard().word().to_owned();
            let points = truth.collect();
            tracks.insert(0, Track { name, look: Look::Truth, points });
        }
        tracks.push(Track { name: run.letter.clone(), look: look(k), points });
    }
    tracks
}

/// The tracks on a map and the heights over time, relative to the start of the first run.
fn track(runs: &[Run]) -> Option<Figure> {
    let start = &runs.iter().find_map(|run| run.history.position())?.first;
    let tracks: Vec<_> = (runs.iter().enumerate())
        .filter_map(|(k, run)| Some((k, run, tracks_from(run.history.position()?, start))))
        .collect();
    let overlay = |point: &dyn Fn(f64, [f64; 3]) -> [f64; 2]| -> Vec<Curve> {
        let truth = tracks.iter().find(|(.., (_, truth))| !truth.is_empty());
        let truth = truth.map(|(_, run, (_, truth))| {
            curve(
                run.history.standard().word(),
                Look::Truth,
                truth.iter().map(|(t, p)| point(*t, *p)),
            )
        });
        let estimates = tracks.iter().map(|(k, run, (estimate, _))| {
            curve(&run.letter, look(*k), estimate.iter().map(|(t, p)| point(*t, *p)))
        });
        truth.into_iter().chain(estimates).collect()
    };
    let map = Panel {
        title: "track from the start of the first run".into(),
        x: Axis::map("east [m]"),
        y: Axis::map("north [m]"),
        curves: overlay(&|_, p| [p[1], p[0]]),
        bands: Vec::new(),
    };
    let ranges = tracks.iter().filter_map(|(_, run, tracks)| {
        heights(run.history.position()?, tracks).map(|[low, high]| [-high, -low])
    });
    let axis = Axis::linear("up [m]");
    let axis = match ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]) {
        Some(range) => axis.within(range),
        None => axis,
    };
    let up = overlay(&|t, p| [t, -p[2]]);
    let height = over_time("height above the start", axis, up, Vec::new());
    Some(figure("trajectory".into(), "Trajectory", 2, vec![map, height]))
}

/// A block: above the values, in the middle the differences from the first run, below the sigmas.
fn state(runs: &[Run], name: &str) -> Option<Figure> {
    let blocks: Vec<(usize, &Run, &BlockHistory)> = (runs.iter().enumerate())
        .filter_map(|(k, run)| Some((k, run, run.history.block(name)?)))
        .filter(|(.., block)| block.uncertain())
        .collect();
    let n = blocks.first()?.2.components.len();
    let kinds: [&dyn Fn(usize) -> Option<Panel>; 3] =
        [&|k| Some(values(&blocks, k)), &|k| differences(&blocks, k), &|k| {
            Some(sigmas(&blocks, k))
        }];
    // few components: a column for each; many: a row for each
    let (columns, panels): (usize, Vec<Panel>) = if n <= 4 {
        (n, kinds.iter().flat_map(|kind| (0..n).filter_map(kind)).collect())
    } else {
        let there = kinds.iter().filter(|kind| kind(0).is_some()).count();
        (there, (0..n).flat_map(|k| kinds.iter().filter_map(move |kind| kind(k))).collect())
    };
    Some(figure(format!("state-{name}"), name, columns, panels))
}

/// The errors of a component, or the estimates of a constant and of a state without truth.
fn values(blocks: &[(usize, &Run, &BlockHistory)], k: usize) -> Panel {
    let model = blocks[0].2;
    let errors = !model.constant() && blocks.iter().all(|(.., b)| b.compared.is_some());
    let start = &model.first.estimate;
    let value = |r: &Row| match (errors, model.geodetic) {
        (true, _) => r.error.get(k).copied(),
        (false, true) => between(model, &r.estimate, start, k),
        (false, false) => r.estimate.get(k).copied(),
    };
    let mut curves: Vec<Curve> = blocks
        .iter()
        .map(|(i, run, b)| {
            let points = b.shown().filter_map(|r| Some([r.time, value(r)?]));
            curve(&run.letter, look(*i), points)
        })
        .collect();
    if model.constant() && model.compared.is_some() {
        let truth = model.shown().filter(|r| !r.error.is_empty());
        let truth = truth.map(|r| [r.time, r.estimate[k] - r.error[k]]);
        curves.insert(0, curve(blocks[0].1.history.standard().word(), Look::Truth, truth));
    }
    let what = match (errors, model.geodetic) {
        (true, _) => "error",
        (false, true) => "from the start",
        (false, false) => "",
    };
    let panel =
        over_time(title(model, k), Axis::linear(label(what, &model.unit)), curves, Vec::new());
    if !model.constant() {
        return panel;
    }
    let ranges = blocks.iter().filter_map(|(.., b)| close_range(b, k));
    let range = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    match range {
        Some(range) => Panel { y: panel.y.within(range), ..panel },
        None => panel,
    }
}

/// The differences of a component from the first run with their bounds of 3 sigma; none where no
/// run has times in common with the first one.
fn differences(blocks: &[(usize, &Run, &BlockHistory)], k: usize) -> Option<Panel> {
    let (first, others) = blocks.split_first()?;
    let mut curves = Vec::new();
    let mut bands = Vec::new();
    for (i, run, block) in others {
        let points = difference(block, first.2, k);
        if points.is_empty() {
            continue;
        }
        let name = format!("{} - {}", run.letter, first.1.letter);
        curves.push(curve(&name, look(*i), points.iter().map(|p| [p[0], p[1]])));
        bands.push(Band {
            name: "±3 sigma, independent".into(),
            points: points.iter().map(|[t, _, s]| [*t, -3.0 * s, 3.0 * s]).collect(),
        });
    }
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m, v| v.abs().max(m));
    let difference = largest(&mut curves.iter().flat_map(|c| c.points.iter().map(|p| p[1])));
    let bound = largest(&mut bands.iter().flat_map(|b| b.points.iter().map(|p| p[2])));
    // a band that is much wider would make the difference a flat line
    let shown = bound.min(difference.mul_add(4.0, 0.05 * bound));
    let limits = [-1.05 * shown.max(difference), 1.05 * shown.max(difference)];
    let y = Axis::linear(label("difference", &first.2.unit)).within(limits);
    bands.truncate(1);
    (!curves.is_empty()).then(|| over_time("", y, curves, bands))
}

/// The sigmas of a component on a logarithmic scale.
fn sigmas(blocks: &[(usize, &Run, &BlockHistory)], k: usize) -> Panel {
    let curves = blocks.iter().map(|(i, run, b)| {
        let points = b.shown().filter_map(|r| Some([r.time, *r.sigma.get(k)?]));
        curve(&run.letter, look(*i), points)
    });
    let y = Axis::logarithmic(label("1-sigma", &blocks[0].2.unit));
    over_time("", y, curves.collect(), Vec::new())
}

/// The mean NIS of a sensor over time with the 95 % band of the first run that has it.
fn nis(runs: &[Run], name: &str) -> Figure {
    let mut curves = Vec::new();
    let mut bands = Vec::new();
    for (k, run) in runs.iter().enumerate() {
        let Some(sensor) = run.history.sensor(name) else { continue };
        let (mean, edges) = mean_nis(sensor.updates.consistency.rows());
        if bands.is_empty() && !mean.is_empty() {
            bands.push(Band { name: "95 % band".into(), points: edges });
        }
        curves.push(curve(&run.letter, look(k), mean.into_iter()));
    }
    let panel = over_time("", Axis::linear("mean NIS per channel"), curves, bands);
    figure(format!("nis-{name}"), &format!("NIS of {name}"), 1, vec![panel])
}

fn figure(name: String, title: &str, columns: usize, panels: Vec<Panel>) -> Figure {
    Figure { name, title: title.into(), columns, panels }
}
