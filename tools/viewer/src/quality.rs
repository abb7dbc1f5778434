//! The tab *Quality*, which needs no truth: the distribution and the correlation of the innovations of each
//! sensor, of a smoothed run the filter against the smoother and the estimate from before a time against that
//! from after it, and the share of each sensor in the information about each state.

use navfuse_core::model::record::{Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::units::time::Time;
use navfuse_figures::Panel;
use navfuse_observability::{Shares, StateShares};
use navfuse_report::quality::Opposed;
use navfuse_report::{Recorder, Residuals, quality};
use navfuse_rerun::re_sdk::EntityPath;
use navfuse_rerun::re_sdk::blueprint::{ContainerLike, Grid, Tabs, Vertical};
use navfuse_rerun::re_sdk_types::archetypes::BarChart;
use navfuse_rerun::style::{BOUND, Colour, MARK, axis as colour, label, path};
use navfuse_rerun::{Layout, Recording, Series, Tab};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Width of the mark of an expected number, as a share of its bar.
const EXPECTED: f64 = 0.15;
/// Number of plots beside one another, and greatest number of blocks on a page.
const COLUMNS: usize = 3;
const BLOCKS: usize = 9;
/// Number of plots of shares beside one another, and greatest number of them on a page.
const NARROW: usize = 4;
const SHARES: usize = 12;
/// Number of rows of a plot of the separation.
const ROWS: usize = 500;
/// Bounds of the separation, and its least range, in sigma.
const BOUNDS: f64 = 3.0;
const LEAST: f64 = 4.0;

/// The name of a channel, and its innovations over their sigma.
type Channel = (String, Residuals);

/// The innovations of a sensor.
struct Sensor {
    name: String,
    /// Set for one that corrects the state.
    measures: bool,
    channels: Vec<Channel>,
}

/// Follows the quality of a run.
#[derive(Default)]
pub struct Quality {
    sensors: Vec<Sensor>,
    /// The estimates of filter and smoother, of a run that is smoothed.
    estimates: Option<Recorder>,
    /// The separation of each block, once the run is over.
    separation: Vec<Separation>,
    /// Forward against backward, once the run is over.
    opposed: Vec<Opposed>,
    /// What the tab *Observability* hands over at the end of the run.
    shares: Arc<OnceLock<Shares>>,
    over: bool,
}

impl Quality {
    /// A tab that shows those shares once they are known.
    pub fn with_shares(shares: Arc<OnceLock<Shares>>) -> Self {
        Self { shares, ..Self::default() }
    }

    fn update(&mut self, update: &UpdateRecord<'_>) {
        let Some(sensor) = self.sensors.get_mut(update.sensor.0) else { return };
        if !matches!(update.outcome, Outcome::Accepted | Outcome::Gated) {
            return;
        }
        for (k, innovation, sigma) in update.channels() {
            if let Some((_, all)) = sensor.channels.get_mut(k) {
                all.push(innovation / sigma);
            }
        }
    }

    /// The sensors that have figures, each with its channels.
    fn shown(&self) -> impl Iterator<Item = (&Sensor, Vec<(usize, &Channel)>)> {
        let sensors = self.sensors.iter().filter(|sensor| sensor.measures);
        sensors.map(|sensor| (sensor, sensor.known())).filter(|(_, known)| !known.is_empty())
    }
}

impl Sensor {
    /// The channels with enough innovations, each with its place.
    fn known(&self) -> Vec<(usize, &Channel)> {
        self.channels.iter().enumerate().filter(|(_, (_, all))| all.suffice()).collect()
    }
}

/// Writes bars: their left edges, their heights, and the width of all.
fn bars(
    recording: &Recording,
    (parts, colour): (&[&str], Colour),
    (bars, width): (&[[f64; 2]], f64),
) -> Result<(), StreamError> {
    let of = |k: usize| bars.iter().map(|bar| bar[k]).collect::<Vec<f64>>();
    let chart = BarChart::new(of(1))
        .with_abscissa(of(0))
        .with_widths(vec![width as f32; bars.len()])
        .with_color(colour);
    recording.log_static(&path(parts), &chart)
}

/// Writes the histogram and the autocorrelation of a channel.
fn write_channel(
    recording: &Recording,
    (sensor, channel, k): (&str, &str, usize),
    all: &Residuals,
) -> Result<(), StreamError> {
    let entity =
        |figure: &'static str, leaf: &'static str| ["quality", sensor, channel, figure, leaf];
    let (seen, band, expected) = (colour(k), BOUND, MARK);
    let histogram: Vec<_> = all.distribution().collect();
    let width = histogram.first().map_or(1.0, |bar| bar.edges[1] - bar.edges[0]);
    // a percentage has at most two digits, so that the viewer labels several of its ticks
    let percent = |share: f64| 100.0 * share;
    let of_all = |seen: f64| percent(seen / all.count().max(1) as f64);
    let shares = histogram.iter().map(|bar| [bar.edges[0], of_all(bar.seen as f64)]);
    let shares: Vec<_> = shares.collect();
    bars(recording, (&entity("distribution", "seen"), seen), (&shares, width))?;
    let thin = EXPECTED * width;
    let beside = 0.5 * (width - thin);
    let normal = histogram.iter().map(|bar| [bar.edges[0] + beside, percent(bar.probability)]);
    let normal: Vec<_> = normal.collect();
    bars(recording, (&entity("distribution", "expected"), expected), (&normal, thin))?;
    // a bar around its lag
    let lag = |k: usize| k as f64 + 0.5;
    let values: Vec<_> = all.autocorrelation().enumerate().map(|(k, v)| [lag(k), v]).collect();
    bars(recording, (&entity("autocorrelation", "seen"), seen), (&values, 1.0))?;
    let edges = |sign: f64| (0..values.len()).map(move |k| [lag(k), sign * all.band()]);
    let both: Vec<_> = edges(1.0).chain(edges(-1.0)).collect();
    bars(recording, (&entity("autocorrelation", "chance"), band), (&both, 1.0))
}

/// The separation of the components of a block.
struct Separation {
    block: String,
    components: Vec<String>,
    /// Time, and the separation of each component, sigma; NaN where there is none.
    rows: Vec<(Time, Vec<f64>)>,
}

impl Separation {
    /// The rows of a plot: of each component the largest value of stretches of equal length.
    fn of(panel: &Panel) -> Self {
        let count = panel.curves.len();
        let mut all: BTreeMap<Time, Vec<f64>> = BTreeMap::new();
        for (k, curve) in panel.curves.iter().enumerate() {
            for [time, value] in &curve.points {
                if let Some(time) = Time::from_seconds(*time) {
                    all.entry(time).or_insert_with(|| vec![f64::NAN; count])[k] = *value;
                }
            }
        }
        let all: Vec<(Time, Vec<f64>)> = all.into_iter().collect();
        let row = |stretch: &[(Time, Vec<f64>)]| {
            let of = |k: usize| stretch.iter().map(move |row| row.1[k]);
            let larger = |a: f64, b: f64| if b.abs() > a.abs() || a.is_nan() { b } else { a };
            let values = (0..count).map(|k| of(k).fold(f64::NAN, larger)).collect();
            (stretch[0].0, values)
        };
        let rows = all.chunks(all.len().div_ceil(ROWS).max(1)).map(row).collect();
        let components = panel.curves.iter().map(|curve| curve.name.clone()).collect();
        Self { block: panel.title.clone(), components, rows }
    }

    fn entity(&self) -> EntityPath {
        path(&["quality", "separation", &self.block])
    }

    /// Writes the lines and their bounds.
    fn write(&self, recording: &Recording) -> Result<(), StreamError> {
        let bound = || (format!("±{BOUNDS}"), BOUND, 1.2);
        let line = |(k, name): (usize, &String)| (name.clone(), colour(k), 1.8);
        let lines = self.components.iter().enumerate().map(line).chain([bound(), bound()]);
        let mut series = Series::lines(self.entity(), &lines.collect::<Vec<_>>());
        for (time, values) in &self.rows {
            series.push(recording, *time, &[values, &[BOUNDS, -BOUNDS][..]].concat())?;
        }
        series.flush(recording)
    }

    fn plot(&self, layout: &mut Layout) -> ContainerLike {
        let names = self.components.iter().map(String::as_str).chain(["±3"]);
        let of = |(time, values): &(Time, Vec<f64>)| {
            let time = time.seconds();
            let all = values.iter().copied().chain([BOUNDS, -BOUNDS]);
            all.map(|value| [time, value]).collect::<Vec<_>>()
        };
        let points: Vec<_> = self.rows.iter().flat_map(of).collect();
        let size = points.iter().map(|p| p[1].abs()).fold(LEAST, f64::max);
        let names: Vec<&str> = names.collect();
        let range = layout.legend_beside(&names, &points, COLUMNS, [-size, size]);
        let contents = [format!("+ {}", self.entity())];
        layout.plot(&format!("{} [sigma]", self.block), &contents, Some(range))
    }
}

/// Writes forward minus backward of a component, and the bounds of 3 sigma.
fn write_opposed(recording: &Recording, all: &Opposed) -> Result<(), StreamError> {
    let line = (all.component.clone(), colour(all.place), 1.8);
    let entity = path(&["quality", "opposed", &all.name]);
    let mut series = Series::between(entity, line, ("±3σ", BOUND));
    let step = all.points.len().div_ceil(ROWS).max(1);
    let points = all.points.iter().enumerate();
    let kept = points.filter(|(k, point)| k.is_multiple_of(step) || point[1].is_nan());
    for (_, [time, difference, sigma]) in kept {
        if let Some(time) = Time::from_seconds(*time) {
            series.push(recording, time, &[*difference, 3.0 * sigma, -3.0 * sigma])?;
        }
    }
    series.flush(recording)
}

/// Writes the shares in the information about a state.
fn write_shares(
    recording: &Recording,
    sensors: &[String],
    state: &StateShares,
) -> Result<(), StreamError> {
    let line = |(k, name): (usize, &String)| (name.clone(), colour(k), 2.0);
    let lines: Vec<_> = sensors.iter().enumerate().map(line).collect();
    let mut series = Series::lines(path(&["quality", "information", &state.title]), &lines);
    for (time, shares) in &state.rows {
        if let Some(time) = Time::from_seconds(*time) {
            series.push(recording, time, shares)?;
        }
    }
    series.flush(recording)
}

impl Tab for Quality {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::FILTERED | Wants::UPDATES
    }

    fn start(&mut self, run: &RunInfo, _: &Recording) -> Result<(), StreamError> {
        let sensor = |info: &navfuse_core::model::sensor::SensorInfo| Sensor {
            name: info.name.clone(),
            measures: info.purpose == Purpose::Measurement,
            channels: (info.channels.iter())
                .map(|channel| (quality::channel(&channel.column()), Residuals::default()))
                .collect(),
        };
        self.sensors = run.sensors.iter().map(sensor).collect();
        self.estimates = run.smoothed.then(Recorder::default);
        self.estimates.as_mut().map_or(Ok(()), |recorder| recorder.start(run))
    }

    fn take(&mut self, record: &Record<'_>, _: &Recording) -> Result<(), StreamError> {
        match (record, &mut self.estimates) {
            (Record::Update(update), _) => self.update(update),
            (Record::Epoch(_) | Record::Filtered(_), Some(recorder)) => recorder.take(record)?,
            _ => {}
        }
        Ok(())
    }

    fn finish(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.over = true;
        for (sensor, channels) in self.shown() {
            for (k, (name, all)) in channels {
                write_channel(recording, (&sensor.name, name, k), all)?;
            }
        }
        let history = self.estimates.take().map(Recorder::into_history);
        let blocks = || history.iter().flat_map(|history| &history.blocks);
        let figure = quality::separation(blocks());
        let panels = figure.map(|figure| figure.panels).unwrap_or_default();
        self.separation = panels.iter().map(Separation::of).collect();
        self.separation.iter().try_for_each(|block| block.write(recording))?;
        // the first states are those of the vehicle
        self.opposed = quality::opposed(blocks());
        self.opposed.truncate(BLOCKS);
        self.opposed.iter().try_for_each(|all| write_opposed(recording, all))?;
        let Some(shares) = self.shares.get() else { return Ok(()) };
        let mut states = shares.states.iter();
        states.try_for_each(|state| write_shares(recording, &shares.sensors, state))
    }

    fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
        let mut tabs: Vec<ContainerLike> = Vec::new();
        for (page, blocks) in self.separation.chunks(BLOCKS).enumerate() {
            layout.rows = blocks.len().div_ceil(COLUMNS);
            let plots = blocks.iter().map(|block| block.plot(layout)).collect();
            tabs.push(page_of("Filter - smoothed", page, (plots, COLUMNS)));
        }
        if !self.opposed.is_empty() {
            layout.rows = self.opposed.len().div_ceil(COLUMNS);
            let plots = self.opposed.iter().map(|all| plot_opposed(layout, all)).collect();
            tabs.push(page_of("Forward - backward", 0, (plots, COLUMNS)));
        }
        for (sensor, channels) in self.shown().filter(|_| self.over) {
            let mut rows = Vec::new();
            // four beams fit beside one another
            let columns = if channels.len() == COLUMNS + 1 { channels.len() } else { COLUMNS };
            for row in channels.chunks(columns) {
                for (figure, title) in [
                    ("distribution", ", ±5 sigma [%]; white: normal"),
                    ("autocorrelation", ", correlation by lag; grey: chance"),
                ] {
                    let views = row.iter().map(|(_, (name, _))| {
                        let origin = path(&["quality", &sensor.name, name, figure]);
                        layout.bars(&format!("{name}{title}"), &origin)
                    });
                    let views: Vec<ContainerLike> = views.collect();
                    let columns = views.len() as u32;
                    rows.push(Grid::new(views).with_grid_columns(columns).into());
                }
            }
            tabs.push(Vertical::new(rows).with_name(sensor.name.as_str()).into());
        }
        if let Some(shares) = self.shares.get() {
            for (page, states) in shares.states.chunks(SHARES).enumerate() {
                layout.rows = states.len().div_ceil(NARROW);
                let plots = states.iter().enumerate().map(|(k, state)| {
                    // one legend explains them all: room for it would flatten the others
                    plot_shares(layout, (&shares.sensors, k == 0), state)
                });
                let plots = plots.collect();
                tabs.push(page_of("Share of the information", page, (plots, NARROW)));
            }
        }
        (!tabs.is_empty()).then(|| Tabs::new(tabs).with_name("Quality").into())
    }
}

/// A page of plots, that many beside one another.
fn page_of(
    name: &str,
    page: usize,
    (plots, columns): (Vec<ContainerLike>, usize),
) -> ContainerLike {
    let name = if page == 0 { name.to_owned() } else { format!("{name}, continued") };
    Grid::new(plots).with_grid_columns(columns as u32).with_name(name).into()
}

/// The plot of forward minus backward of a component.
fn plot_opposed(layout: &mut Layout, all: &Opposed) -> ContainerLike {
    let sizes = all.points.iter().map(|[_, difference, sigma]| difference.abs().max(3.0 * sigma));
    let size = sizes.fold(0.0, f64::max);
    let lines = |[time, difference, sigma]: &[f64; 3]| {
        [*difference, 3.0 * sigma, -3.0 * sigma].map(|value| [*time, value])
    };
    let points: Vec<_> = all.points.iter().flat_map(lines).collect();
    let names = [all.component.as_str(), "±3σ"];
    let range = layout.legend_beside(&names, &points, COLUMNS, [-size, size]);
    let contents = [format!("+ {}", path(&["quality", "opposed", &all.name]))];
    layout.plot(&label(&all.name, &all.unit), &contents, Some(range))
}

/// The plot of the shares in the information about a state.
fn plot_shares(
    layout: &mut Layout,
    (sensors, legend): (&[String], bool),
    state: &StateShares,
) -> ContainerLike {
    let of = |(time, shares): &(f64, Vec<f64>)| {
        let time = *time;
        shares.iter().map(|share| [time, *share]).collect::<Vec<_>>()
    };
    let points: Vec<_> = state.rows.iter().flat_map(of).collect();
    let names: Vec<&str> = sensors.iter().map(String::as_str).collect();
    // with its margin the range has a tick at every tenth, in three rows too
    let range = [0.02, 0.98];
    let with_legend = layout.legend_beside(&names, &points, NARROW, range);
    layout.legend &= legend;
    let contents = [format!("+ {}", path(&["quality", "information", &state.title]))];
    layout.plot(&state.title, &contents, Some(if legend { with_legend } else { range }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_figures::{Axis, Curve, Look};

    #[test]
    fn a_thinned_separation_keeps_the_largest_values_of_each_component() {
        let curve = |name: &str, at: usize, value: f64| {
            let mut points: Vec<[f64; 2]> = (0..2000).map(|k| [f64::from(k), 1e-3]).collect();
            points[at][1] = value;
            Curve { name: name.into(), look: Look::Data(0), points }
        };
        let curves = vec![curve("x", 1234, -7.0), curve("y", 17, 5.0)];
        let (x, y) = (Axis::time(), Axis::linear(""));
        let panel = Panel { title: "ins.velocity".into(), x, y, curves, bands: Vec::new() };
        let thin = Separation::of(&panel).rows;
        assert_eq!(thin.len(), ROWS);
        let at = |time: f64| &thin.iter().find(|row| row.0.seconds() == time).unwrap().1;
        assert_eq!((at(1232.0)[0], at(16.0)[1]), (-7.0, 5.0));
        let empty = Panel { curves: Vec::new(), ..panel };
        assert!(Separation::of(&empty).rows.is_empty());
    }
}
