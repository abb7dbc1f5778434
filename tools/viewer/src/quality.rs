//! The tab *Quality*, which needs no truth: the distribution and the correlation of the innovations of each
//! sensor, and of a smoothed run the filter against the smoother.

use navfuse_core::model::record::{Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::units::time::Time;
use navfuse_figures::Panel;
use navfuse_report::{Recorder, Residuals, quality};
use navfuse_rerun::re_sdk::blueprint::{ContainerLike, Grid, Tabs, Vertical};
use navfuse_rerun::re_sdk_types::archetypes::BarChart;
use navfuse_rerun::style::{BOUND, Colour, MARK, axis as colour, path};
use navfuse_rerun::{Layout, Recording, Series, Tab};

/// Width of the mark of an expected number, as a share of its bar.
const EXPECTED: f64 = 0.15;
/// Number of plots beside one another, and greatest number of blocks on a page.
const COLUMNS: usize = 3;
const BLOCKS: usize = 9;
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
    separation: Vec<Panel>,
    over: bool,
}

impl Quality {
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
    let counts: Vec<_> = histogram.iter().map(|bar| [bar.edges[0], bar.seen as f64]).collect();
    bars(recording, (&entity("distribution", "seen"), seen), (&counts, width))?;
    let total = all.count() as f64;
    let thin = EXPECTED * width;
    let beside = 0.5 * (width - thin);
    let normal = histogram.iter().map(|bar| [bar.edges[0] + beside, bar.probability * total]);
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

/// Writes the separation of a block, and its bounds.
fn write_separation(recording: &Recording, panel: &Panel) -> Result<(), StreamError> {
    let entity = |leaf: &str| path(&["quality", "separation", &panel.title, leaf]);
    let bound = || (format!("±{BOUNDS}"), BOUND, 1.2);
    let mut bounds = Series::lines(entity("bounds"), &[bound(), bound()]);
    let ends = panel.bands.iter().flat_map(|band| &band.points);
    for time in ends.filter_map(|point| Time::from_seconds(point[0])) {
        bounds.push(recording, time, &[BOUNDS, -BOUNDS])?;
    }
    bounds.flush(recording)?;
    for (k, curve) in panel.curves.iter().enumerate() {
        let line = (curve.name.clone(), colour(k), 1.8);
        let mut series = Series::lines(entity(&curve.name), &[line]);
        for [time, value] in &curve.points {
            if let Some(time) = Time::from_seconds(*time) {
                series.push(recording, time, &[*value])?;
            }
        }
        series.flush(recording)?;
    }
    Ok(())
}

/// The largest points of stretches of equal length.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let stretches = points.chunks(points.len().div_ceil(ROWS).max(1));
    let largest = |stretch: &[[f64; 2]]| {
        stretch.iter().copied().max_by(|a, b| a[1].abs().total_cmp(&b[1].abs()))
    };
    stretches.filter_map(largest).collect()
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
        let figure = history.and_then(|history| quality::separation(history.blocks.iter()));
        self.separation = figure.map(|figure| figure.panels).unwrap_or_default();
        for panel in &mut self.separation {
            panel.curves.iter_mut().for_each(|curve| curve.points = thinned(&curve.points));
            write_separation(recording, panel)?;
        }
        Ok(())
    }

    fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
        let mut tabs: Vec<ContainerLike> = Vec::new();
        for (page, panels) in self.separation.chunks(BLOCKS).enumerate() {
            layout.rows = panels.len().div_ceil(COLUMNS);
            let plot = |panel: &Panel| {
                let curves = || panel.curves.iter();
                let names: Vec<&str> = curves().map(|c| c.name.as_str()).chain(["±3"]).collect();
                let points: Vec<_> = curves().flat_map(|c| c.points.iter().copied()).collect();
                let size = points.iter().map(|p| p[1].abs()).fold(LEAST, f64::max);
                let range = layout.legend_beside(&names, &points, COLUMNS, [-size, size]);
                let contents = [format!("+ {}/**", path(&["quality", "separation", &panel.title]))];
                layout.plot(&format!("{} [sigma]", panel.title), &contents, Some(range))
            };
            let grid = Grid::new(panels.iter().map(plot).collect::<Vec<_>>());
            let name = if page == 0 { "Filter - smoothed" } else { "Filter - smoothed, continued" };
            tabs.push(grid.with_grid_columns(COLUMNS as u32).with_name(name).into());
        }
        for (sensor, channels) in self.shown().filter(|_| self.over) {
            let mut rows = Vec::new();
            // four beams fit beside one another
            let columns = if channels.len() == COLUMNS + 1 { channels.len() } else { COLUMNS };
            for row in channels.chunks(columns) {
                for (figure, title) in [
                    ("distribution", " / sigma; white: normal"),
                    ("autocorrelation", ", correlation; grey: chance"),
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
        (!tabs.is_empty()).then(|| Tabs::new(tabs).with_name("Quality").into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_separation_keeps_its_largest_values() {
        let points: Vec<[f64; 2]> = (0..2000).map(|k| [f64::from(k), 1e-3]).collect();
        assert_eq!(thinned(&points[..ROWS]).len(), ROWS);
        let mut points = points;
        points[1234][1] = -7.0;
        let thin = thinned(&points);
        assert_eq!(thin.len(), ROWS);
        assert!(thin.contains(&[1234.0, -7.0]));
        assert!(thinned(&[]).is_empty());
    }
}
