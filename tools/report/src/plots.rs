//! Figures of any run.

use crate::history::{BlockHistory, Row, RunHistory, displacement};
use crate::innovations::{WIDE, usual};
use crate::results::Standard;
use crate::sensors::SensorHistory;
use navfuse_core::units::Unit;
use navfuse_core::units::sample::words;
use navfuse_figures::{Axis, Band, Curve, Figure, Look, Panel};
use std::borrow::Cow;

/// Creates a curve.
pub(crate) fn curve(name: &str, look: Look, points: impl Iterator<Item = [f64; 2]>) -> Curve {
    Curve { name: name.into(), look, points: points.collect() }
}

/// Creates a panel over time.
pub(crate) fn over_time(
    title: impl Into<String>,
    y: Axis,
    curves: Vec<Curve>,
    bands: Vec<Band>,
) -> Panel {
    Panel { title: title.into(), x: Axis::time(), y, curves, bands }
}

/// Creates a label with a unit.
pub(crate) fn label(what: &str, unit: &str) -> String {
    match (what.is_empty(), unit.is_empty()) {
        (_, true) => what.to_owned(),
        (true, false) => format!("[{unit}]"),
        (false, false) => format!("{what} [{unit}]"),
    }
}

/// Times and positions north, east, down (m) from the first position.
pub(crate) type Places = Vec<(f64, [f64; 3])>;

/// Returns the tracks of the estimate and of the truth, relative to the first true position, or to
/// the first estimate if no truth is known.
pub(crate) fn tracks(position: &BlockHistory) -> (Places, Places) {
    tracks_from(position, &position.first)
}

/// Returns the tracks of the estimate and of the truth, relative to the position of a row, the true
/// one if it is known.
pub(crate) fn tracks_from(position: &BlockHistory, start: &Row) -> (Places, Places) {
    let origin = &start.estimate;
    let off = start.error.first_chunk::<3>().copied().unwrap_or_default();
    let place = |r: &Row| {
        let from = displacement(&r.estimate, origin);
        std::array::from_fn(|k| from[k] + off[k])
    };
    let estimate = position.shown().map(|r| (r.time, place(r)));
    let truth = position.shown().filter_map(|r| {
        let (place, error): ([f64; 3], _) = (place(r), r.error.first_chunk::<3>()?);
        Some((r.time, std::array::from_fn(|k| place[k] - error[k])))
    });
    (estimate.collect(), truth.collect())
}

/// Plots the track on a map and its height over time; `None` without a position.
pub fn trajectory(history: &RunHistory) -> Option<Figure> {
    let position = history.position()?;
    let tracks = tracks(position);
    let (estimate, truth) = &tracks;
    let known = history.standard().word();
    let both = [(known, Look::Truth, truth), ("estimate", Look::Data(0), estimate)];
    let both = || both.iter().filter(|(_, _, track)| !track.is_empty());
    let map = Panel {
        title: "track from the start".into(),
        x: Axis::map("east [m]"),
        y: Axis::map("north [m]"),
        curves: both()
            .map(|(n, look, t)| curve(n, *look, t.iter().map(|(_, p)| [p[1], p[0]])))
            .collect(),
        bands: Vec::new(),
    };
    let start = &position.first;
    let zero = start.estimate.get(2)? + start.error.get(2).copied().unwrap_or_default();
    let curves = both()
        .map(|(n, look, t)| curve(n, *look, t.iter().map(|(time, p)| [*time, zero - p[2]])))
        .collect();
    let axis = Axis::linear("height [m]");
    let axis = match heights(position, &tracks) {
        Some([low, high]) => axis.within([zero - high, zero - low]),
        None => axis,
    };
    let height = over_time("height", axis, curves, Vec::new());
    Some(Figure {
        name: "trajectory".into(),
        title: String::new(),
        columns: 2,
        panels: vec![map, height],
    })
}

/// The range of the depths on two tracks, with a margin: the estimates of a wide prior, such as the first
/// one, do not flatten the others.
pub(crate) fn heights(
    position: &BlockHistory,
    (estimate, truth): &(Places, Places),
) -> Option<[f64; 2]> {
    let sigma = |row: &Row| row.sigma.get(2).copied().unwrap_or(f64::NAN);
    let most = WIDE * usual(position.shown().map(sigma))?;
    let settled = estimate.iter().zip(position.shown()).filter(|(_, row)| sigma(row) <= most);
    let depths = settled.map(|(place, _)| place).chain(truth).map(|(_, place)| place[2]);
    let start = [f64::INFINITY, f64::NEG_INFINITY];
    let [low, high] = depths.fold(start, |[low, high], down| [low.min(down), high.max(down)]);
    let margin = 0.04 * (high - low);
    Some([low - margin, high + margin])
}

/// Plots the estimate of a block against the truth or the reference. Above: a constant with its bounds of 3 sigma
/// and the truth, or the error of a block that moves. Below: sigma and error on a logarithmic
/// scale. `None` for a fixed block.
pub fn state(block: &BlockHistory, standard: Standard) -> Option<Figure> {
    if !block.uncertain() {
        return None;
    }
    let n = block.components.len();
    let constant = block.constant();
    let value = |k| match constant {
        true => close(block, k, beside(block, k, 1.0, standard)),
        false => settled(block, k, error(block, k, 1.0, standard)),
    };
    // few components: two rows; one or many: the two panels of each component side by side
    let (columns, panels): (usize, Vec<Panel>) = if (2..=4).contains(&n) {
        let below = (0..n).map(|k| convergence(block, k, standard));
        (n, (0..n).map(value).chain(below).collect())
    } else {
        (2, (0..n).flat_map(|k| [value(k), convergence(block, k, standard)]).collect())
    };
    Some(Figure { name: format!("state-{}", block.name), title: String::new(), columns, panels })
}

/// Plots a component with its bounds of 3 sigma, and its truth or reference if it is known. `sign` is
/// -1 for an axis that is shown with the opposite sign.
pub(crate) fn beside(block: &BlockHistory, k: usize, sign: f64, standard: Standard) -> Panel {
    let value = |r: &Row| sign * r.estimate[k];
    let bounds =
        block.shown().map(|r| [r.time, value(r) - 3.0 * r.sigma[k], value(r) + 3.0 * r.sigma[k]]);
    let truth = block.shown().filter(|r| !r.error.is_empty());
    let mut curves =
        vec![curve("estimate", Look::Data(0), block.shown().map(|r| [r.time, value(r)]))];
    if block.compared.is_some() {
        let truth = truth.map(|r| [r.time, value(r) - sign * r.error[k]]);
        curves.insert(0, curve(standard.word(), Look::Truth, truth));
    }
    let bands = vec![Band { name: "±3 sigma".into(), points: bounds.collect() }];
    over_time(block.component(k), Axis::linear(label("", &block.unit)), curves, bands)
}

/// Restricts a panel to the final value; see [`close_range`].
fn close(block: &BlockHistory, k: usize, panel: Panel) -> Panel {
    match close_range(block, k) {
        Some(range) => Panel { y: panel.y.within(range), ..panel },
        None => panel,
    }
}

/// The range about the final value of a component: 12 final sigmas to each side, and all estimates
/// and truths of the second half of the run. `None` if this range is hardly smaller than that of the
/// whole run with its bounds of 3 sigma.
pub(crate) fn close_range(block: &BlockHistory, k: usize) -> Option<[f64; 2]> {
    let half = 0.5 * (block.first.time + block.last.time);
    let (end, sigma) = (block.last.estimate[k], block.last.sigma[k]);
    let truth = |r: &Row| r.error.get(k).map_or(f64::NAN, |e| r.estimate[k] - e);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        values.fold(start, |[low, high], v| [low.min(v), high.max(v)])
    };
    let later = block.shown().filter(|r| r.time >= half);
    let ends = [end - 12.0 * sigma, end + 12.0 * sigma];
    let near = later.flat_map(|r| [r.estimate[k], truth(r)]).chain(ends);
    let [low, high] = range(&mut near.into_iter());
    let all = block.shown().flat_map(|r| {
        [r.estimate[k] - 3.0 * r.sigma[k], r.estimate[k] + 3.0 * r.sigma[k], truth(r)]
    });
    let [least, most] = range(&mut all.into_iter());
    (high - low < 0.8 * (most - least)).then_some([low, high])
}

/// Plots the error of a component with its bounds of 3 sigma; without a truth, the estimate with
/// these bounds.
pub(crate) fn error(block: &BlockHistory, k: usize, sign: f64, standard: Standard) -> Panel {
    if block.compared.is_none() {
        return match block.geodetic {
            true => displaced(block, k),
            false => beside(block, k, sign, standard),
        };
    }
    let bounds = block.shown().map(|r| [r.time, -3.0 * r.sigma[k], 3.0 * r.sigma[k]]);
    let error = block.shown().filter(|r| !r.error.is_empty()).map(|r| [r.time, sign * r.error[k]]);
    let bands = vec![Band { name: "±3 sigma".into(), points: bounds.collect() }];
    let title = format!("{} {}", block.name, block.axis(k));
    let curves = vec![curve(standard.difference(), Look::Data(0), error)];
    over_time(title, Axis::linear(label(standard.difference(), &block.unit)), curves, bands)
}

/// Restricts the panel of an error to the error and its bounds behind the first tenth of the run: a
/// wide prior would flatten the rest. The panel of its magnitude shows the beginning.
fn settled(block: &BlockHistory, k: usize, panel: Panel) -> Panel {
    if block.compared.is_none() {
        return panel;
    }
    let [first, last] = [block.first.time, block.last.time];
    let later = block.shown().filter(|r| r.time >= first + 0.1 * (last - first));
    let size = |r: &Row| r.error.get(k).map_or(0.0, |e| e.abs()).max(3.0 * r.sigma[k]);
    let size = 1.05 * later.map(size).fold(0.0, f64::max);
    Panel { y: panel.y.within([-size, size]), ..panel }
}

/// Plots a component of a position relative to its first value.
fn displaced(block: &BlockHistory, k: usize) -> Panel {
    let place = |r: &Row| displacement(&r.estimate, &block.first.estimate)[k];
    let bounds =
        block.shown().map(|r| [r.time, place(r) - 3.0 * r.sigma[k], place(r) + 3.0 * r.sigma[k]]);
    let bands = vec![Band { name: "±3 sigma".into(), points: bounds.collect() }];
    let curves = vec![curve("estimate", Look::Data(0), block.shown().map(|r| [r.time, place(r)]))];
    over_time(
        format!("{} {}", block.name, block.axis(k)),
        Axis::linear("relative to the start [m]"),
        curves,
        bands,
    )
}

/// Plots sigma and the magnitude of the error of a component on a logarithmic scale.
pub(crate) fn convergence(block: &BlockHistory, k: usize, standard: Standard) -> Panel {
    let sigma = || block.shown().map(|r| [r.time, r.sigma[k]]);
    let error = block.shown().filter(|r| !r.error.is_empty()).map(|r| [r.time, r.error[k].abs()]);
    let mut curves = vec![curve("1-sigma", Look::Sigma, sigma())];
    if block.compared.is_some() {
        let name = match standard {
            Standard::Truth => "magnitude of the error",
            Standard::Reference => "distance from the reference",
        };
        curves.insert(0, curve(name, Look::Data(0), error));
    }
    // the logarithm of an error near zero is unbounded: cut it off well below sigma
    let least = sigma().map(|p| p[1]).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
    let most = curves.iter().flat_map(|c| c.points.iter().map(|p| p[1])).fold(0.0, f64::max);
    let y = Axis::logarithmic(label("", &block.unit)).within([least / 20.0, 1.3 * most]);
    let y = if block.compared.is_some() { y } else { Axis { limits: None, ..y } };
    over_time("", y, curves, Vec::new())
}

/// Plots every component's sigma relative to its prior, one panel per block. A curve falls from the
/// time on at which the run begins to determine the state; a smoothed curve is low from the start.
pub fn normalised(history: &RunHistory) -> Figure {
    let blocks = history.blocks.iter().filter(|b| b.uncertain());
    let panels = blocks.map(|b| normalised_panel(b, &(0..b.components.len()).collect::<Vec<_>>()));
    Figure {
        name: "observability".into(),
        title: String::new(),
        columns: 3,
        panels: panels.collect(),
    }
}

/// Plots the normalised sigma of some components of a block.
pub(crate) fn normalised_panel(block: &BlockHistory, components: &[usize]) -> Panel {
    let curves = components.iter().enumerate().map(|(place, &k)| {
        let prior = block.prior().sigma[k];
        curve(block.axis(k), Look::Data(place), block.shown().map(|r| [r.time, r.sigma[k] / prior]))
    });
    over_time(
        block.name.as_str(),
        Axis::logarithmic("sigma / prior sigma"),
        curves.collect(),
        Vec::new(),
    )
}

/// Plots the samples of a sensor, one panel per channel, as ranges if there are too many samples.
pub fn samples(sensor: &SensorHistory) -> Figure {
    let panels: Vec<Panel> = (0..sensor.channels.len())
        .map(|k| {
            let (name, unit, factor) = channel(&sensor.channels[k]);
            let points = profile(sensor, k).map(|[t, v]| [t, factor * v]);
            over_time(
                name,
                Axis::linear(label("", &unit)),
                vec![curve("", Look::Data(0), points)],
                Vec::new(),
            )
        })
        .collect();
    let columns = panels.len().clamp(1, 3);
    Figure { name: format!("samples-{}", sensor.name), title: String::new(), columns, panels }
}

/// Returns a channel over time, SI: the smallest and the largest sample of each row, in alternating
/// order.
pub(crate) fn profile(sensor: &SensorHistory, k: usize) -> impl Iterator<Item = [f64; 2]> + '_ {
    let dense = sensor.samples.each() > 1;
    sensor.samples.rows().iter().enumerate().flat_map(move |(row, e)| {
        let (first, second) =
            if row % 2 == 0 { (e.low[k], e.high[k]) } else { (e.high[k], e.low[k]) };
        let second = (dense && first != second).then_some([e.time, second]);
        [Some([e.time, first]), second].into_iter().flatten()
    })
}

/// Returns the name of a channel, its display unit, and the factor from SI to that unit.
pub fn channel(column: &str) -> (String, Cow<'static, str>, f64) {
    let split = column.rsplit_once('_').and_then(|(name, unit)| Some((name, Unit::si(unit).ok()?)));
    let Some((name, unit)) = split else { return (words(column), "".into(), 1.0) };
    let (unit, factor) = unit.shown();
    (words(name), unit, factor)
}
