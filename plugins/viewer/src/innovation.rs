//! The measuring sensors over time: innovations with their bounds, gated and rejected samples, NIS
//! with its band and the gate.

use crate::axis::{self, Scale, short};
use crate::columns::{BOUNDS, Series};
use crate::corner::{Legend, Place, quietest};
use crate::history::{Gaps, History, Row};
use crate::quantity::{Here, Quantity, quantity};
use crate::recording::Recording;
use crate::shade::Shades;
use crate::style::{AXES, BAND, BOUND, GATED, MARK, REJECTED, channel as colour, label, path};
use navfuse_core::model::chi_square;
use navfuse_core::model::record::health::Judgement;
use navfuse_core::model::record::latest::{LATEST, Latest};
use navfuse_core::model::record::{Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::mounting::Reach;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::time::Time;
use re_sdk::EntityPath;
use re_sdk_types::components::MarkerShape;
use std::sync::Arc;

/// Probability outside the band of the mean NIS.
const OUTSIDE: f64 = 0.05;
/// Bound over the usual one from which on an innovation is that of a wide prior.
const WIDE: f64 = 3.0;
/// Place of a mark for an innovation beyond the plot, relative to the edge.
const EDGE: f64 = 0.97;
/// Decimal logarithm of the NIS per channel below which it does not count for the range.
const LEAST_NIS: f64 = -1.0;
/// Level of a rejected sample without a gate, decimal logarithm of the NIS per channel.
const REJECTED_LEVEL: f64 = 1.5;

/// The innovations of one channel.
pub struct Innovations {
    /// Entity above those of the channel.
    pub path: EntityPath,
    /// The plot; `None` until the series are written, and for a channel that is not measured.
    pub plot: Option<Plot>,
    quantity: Quantity,
    /// Set for a height above the ground with which beams are drawn.
    aids: bool,
    /// Innovation and sigma.
    accepted: History<2>,
    gated: History<1>,
    gaps: Gaps,
    live: Option<Series>,
}

/// A plot: its name, and the range of its values.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Name with the unit.
    pub name: String,
    /// Range.
    pub range: [f64; 2],
    /// Place of the legend.
    pub legend: Place,
    /// Set where marks at the edge stand for innovations beyond it: the legend has their size.
    pub beyond: bool,
}

/// The series of one measuring sensor.
pub struct SensorSeries {
    /// The name of the sensor.
    pub name: String,
    /// The innovations of each channel.
    pub channels: Vec<Innovations>,
    /// Entity above those of the NIS.
    pub nis_path: EntityPath,
    /// The plot of the NIS; `None` until the series are written.
    pub nis: Option<Plot>,
    /// Names of the channels.
    names: Vec<Arc<str>>,
    /// Logarithms of NIS and gate, and of the mean NIS of the latest samples with its band, per
    /// channel.
    accepted: History<5>,
    gated: History<1>,
    rejected: Vec<(Rejection, History<1>)>,
    level: f64,
    latest: Latest,
    /// Expectation and variance for which the band was computed.
    band: ([f64; 2], [f64; 2]),
    gaps: Gaps,
    /// The line of a silence in the plots of a run that goes on.
    silence: Series,
    silent: bool,
}

impl SensorSeries {
    /// The series of a sensor; `None` for one that does not correct the state.
    pub fn new(info: &SensorInfo, full: bool) -> Option<Self> {
        if info.purpose != Purpose::Measurement {
            return None;
        }
        let beams = info.mounting.beams();
        let aids = |k: usize| beams.iter().any(|beam| beam.reach == Reach::Altitude(k));
        let channels = info.channels.iter().enumerate().map(|(k, channel)| Innovations {
            path: path(&["innovation", &info.name, &channel.name]),
            aids: aids(k),
            plot: None,
            quantity: quantity(channel),
            accepted: History::new([0], full),
            gated: History::new([0], full),
            gaps: Gaps::default(),
            live: None,
        });
        Some(Self {
            name: info.name.clone(),
            channels: channels.collect(),
            nis_path: path(&["innovation", &info.name, "nis"]),
            nis: None,
            names: info.channels.iter().map(|c: &Channel| Arc::clone(&c.name)).collect(),
            accepted: History::new([0], full),
            gated: History::new([0], full),
            rejected: Vec::new(),
            level: REJECTED_LEVEL,
            latest: Latest::default(),
            band: ([f64::NAN; 2], [f64::NAN; 2]),
            gaps: Gaps::default(),
            silence: Series::silence(path(&["live", "silent", &info.name])),
            silent: false,
        })
    }

    /// The name of a channel.
    pub fn channel(&self, k: usize) -> &str {
        self.channels.get(k).map_or("a channel", |c| c.quantity.name.as_str())
    }

    /// The name of a channel with its unit as the channel comes.
    pub fn channel_label(&self, k: usize) -> String {
        let quantity = self.channels.get(k).map(|c| &c.quantity);
        quantity.map_or_else(String::new, |q| label(&q.name, &q.unit))
    }

    /// The entity of a channel that a viewer sees during the run.
    pub fn live_entity(&self, k: usize) -> EntityPath {
        path(&["live", "innovation", &self.name, self.names.get(k).map_or("nis", |name| name)])
    }

    /// Adds an update at a place.
    pub fn update(
        &mut self,
        recording: &Recording,
        update: &UpdateRecord<'_>,
        here: Here,
    ) -> Result<(), StreamError> {
        let time = update.time.nanos();
        let gated = match update.outcome {
            Outcome::Placed => return Ok(()),
            Outcome::Accepted => false,
            Outcome::Gated => true,
            Outcome::Rejected(reason) => {
                let known = self.rejected.iter().position(|r| r.0 == reason);
                let at = known.unwrap_or_else(|| {
                    self.rejected.push((reason, History::new([0], false)));
                    self.rejected.len() - 1
                });
                self.rejected[at].1.push(time, [0.0]);
                return Ok(());
            }
        };
        for (k, innovation, sigma) in update.channels() {
            let entity = recording.is_live().then(|| self.live_entity(k));
            let Some(channel) = self.channels.get_mut(k) else { continue };
            let factor = channel.quantity.factor(here);
            let (innovation, sigma) = (factor * innovation, (factor * sigma).abs());
            if gated {
                channel.gated.push(time, [innovation]);
            } else {
                break_line(&mut channel.gaps, &mut channel.accepted, update.time);
                channel.accepted.push(time, [innovation, sigma]);
            }
            if let Some(entity) = entity {
                let series = channel.live.get_or_insert_with(|| {
                    let Quantity { name, unit, .. } = &channel.quantity;
                    Series::live(entity, &label(name, unit), colour(name, k), 1.2)
                });
                series.push(recording, update.time, &[innovation, 3.0 * sigma, -3.0 * sigma])?;
            }
        }
        // sensors that lose channels have one scale: a NIS of one for each channel is expected
        let channels = update.innovation.len();
        let per_channel = |x: f64| logarithm(x / channels as f64);
        let [nis, threshold] = [update.nis, update.threshold].map(per_channel);
        if threshold.is_finite() {
            self.level = threshold + 0.25;
        }
        if gated {
            self.gated.push(time, [nis]);
        } else {
            let UpdateRecord { nis: sum, threshold: gate, .. } = *update;
            let judged = Judgement { channels, nis: sum, threshold: gate };
            let [mean, low, high] = self.mean(&judged);
            break_line(&mut self.gaps, &mut self.accepted, update.time);
            self.accepted.push(time, [nis, threshold, mean, low, high]);
        }
        Ok(())
    }

    /// The mean NIS of the latest samples and its band, per channel: logarithms.
    fn mean(&mut self, judged: &Judgement) -> [f64; 3] {
        let latest = self.latest.take(judged);
        if latest.count < LATEST {
            return [f64::NAN; 3];
        }
        let expected = [latest.mean, latest.variance];
        if self.band.0 != expected {
            let band = chi_square::band(latest.mean, latest.variance, OUTSIDE);
            self.band = (expected, [band.low, band.high]);
        }
        let [low, high] = self.band.1;
        [latest.nis, low, high].map(|x| logarithm(x / latest.channels as f64))
    }

    /// The entity of the line of a silence that a viewer sees during the run.
    pub fn live_silence(&self) -> &EntityPath {
        &self.silence.path
    }

    /// Draws that the sensor is silent now, and ends the line where it no longer is.
    pub fn silent(
        &mut self,
        recording: &Recording,
        now: Time,
        silent: bool,
    ) -> Result<(), StreamError> {
        if std::mem::replace(&mut self.silent, silent) || silent {
            self.silence.push(recording, now, &[if silent { 0.0 } else { f64::NAN }])?;
        }
        self.silence.flush(recording)
    }

    /// Sends what viewers see during the run.
    pub fn refresh(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let live = self.channels.iter_mut().filter_map(|c| c.live.as_mut());
        live.into_iter().try_for_each(|series| series.flush(recording))
    }

    /// Writes the whole run, and chooses units and ranges from it.
    pub fn write(
        &mut self,
        recording: &Recording,
        shades: &Shades,
        span: (i64, i64),
    ) -> Result<(), StreamError> {
        let count = 1 + self.channels.iter().filter(|channel| channel.is_shown(false)).count();
        let [columns, rows] = grid(count);
        let size = Legend { lines: shades.lines(), letters: 0, columns, rows };
        for (k, channel) in self.channels.iter_mut().enumerate() {
            channel.write(recording, k, (span, size))?;
            if let Some(plot) = &channel.plot {
                shades.write(recording, &channel.path, plot.range)?;
            }
        }
        self.write_nis(recording, (span, size))?;
        let plot = self.nis.as_ref();
        plot.map_or(Ok(()), |plot| shades.write(recording, &self.nis_path, plot.range))
    }

    fn write_nis(
        &mut self,
        recording: &Recording,
        (span, size): ((i64, i64), Legend),
    ) -> Result<(), StreamError> {
        let rows = self.accepted.rows();
        if rows.is_empty() && self.gated.is_empty() && self.rejected.is_empty() {
            return Ok(());
        }
        let entity = |leaf: &str| self.nis_path.join(&EntityPath::from(leaf));
        let line = [("NIS".to_owned(), AXES[2], 1.0)];
        let mut nis = Series::lines(entity("accepted"), &line);
        let limits = [
            ("gate".to_owned(), GATED, 1.4),
            (format!("mean of {LATEST}"), MARK, 2.2),
            ("95 % of means".to_owned(), BAND, 1.8),
            ("95 % of means".to_owned(), BAND, 1.8),
        ];
        let gate = rows.iter().any(|r| r.1[1].is_finite());
        let limits = if gate { &limits[..] } else { &limits[1..] };
        let mut band = Series::lines(entity("limits"), limits);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut include = |x: f64| range = [range[0].min(x), range[1].max(x)];
        for (time, [value, limits_and_mean @ ..]) in &rows {
            let time = Time::from_nanos(*time);
            nis.push(recording, time, &[*value])?;
            band.push(recording, time, &limits_and_mean[limits_and_mean.len() - limits.len()..])?;
            // a NIS near zero is no sign of anything: the mean is
            include(value.max(LEAST_NIS));
            limits_and_mean.iter().for_each(|x| include(*x));
        }
        let mut all = vec![nis, band];
        let marks = self.gated.rows();
        let mut gated = Series::marked(entity("gated"), "gated", GATED, 4.5, MarkerShape::Diamond);
        for (time, [value]) in &marks {
            gated.push(recording, Time::from_nanos(*time), &[*value])?;
            include(*value);
        }
        all.push(gated);
        let names: Vec<&str> = (0..self.channels.len()).map(|k| self.channel(k)).collect();
        let (mut lines, mut letters) = (limits.len() + usize::from(!marks.is_empty()), 14);
        for (k, (reason, history)) in self.rejected.iter().enumerate() {
            let name = format!("rejected: {}", reason.reason(&names));
            let marker = MarkerShape::Cross;
            let colour = REJECTED[k % REJECTED.len()];
            let mut series =
                Series::marked(entity(&format!("rejected/{k}")), &name, colour, 4.0, marker);
            for (time, _) in history.rows() {
                series.push(recording, Time::from_nanos(time), &[self.level])?;
            }
            include(self.level);
            (lines, letters) = (lines + 1, letters.max(name.chars().count()));
            all.push(series);
        }
        let of = |[nis, gate, mean, low, high]: &[f64; 5]| [*nis, *mean, *gate, *low, *high];
        let mut drawn: Vec<Row<5>> = rows.iter().map(|(time, row)| (*time, of(row))).collect();
        let alone = |nis: f64| [nis, f64::NAN, f64::NAN, f64::NAN, f64::NAN];
        drawn.extend(marks.iter().map(|(time, [nis])| (*time, alone(*nis))));
        let refused = self.rejected.iter().flat_map(|(_, history)| history.rows());
        drawn.extend(refused.map(|(time, _)| (time, alone(self.level))));
        let size = Legend { lines: size.lines + lines, letters, ..size };
        let legend = quietest(&drawn, |row: &[f64; 5]| *row, (span, range), size);
        let name = format!("{} NIS per channel [10^y]", self.name);
        self.nis = Some(Plot { name, range, legend, beyond: false });
        all.iter_mut().try_for_each(|series| series.flush(recording))
    }
}

/// The columns and rows of that many plots of a sensor.
pub fn grid(count: usize) -> [usize; 2] {
    let columns = if count > 3 { 2 } else { 1 };
    [columns, count.div_ceil(columns)]
}

/// The decimal logarithm of a positive number.
fn logarithm(x: f64) -> f64 {
    if x.is_finite() && x > 0.0 { x.log10() } else { f64::NAN }
}

/// Breaks a line where accepted samples are missing.
fn break_line<const N: usize>(gaps: &mut Gaps, line: &mut History<N>, now: Time) {
    if let Some(middle) = gaps.after(now) {
        line.break_at(middle);
    }
}

impl Innovations {
    /// Returns `true` for a channel with a plot: before the end of a run, for one that can have
    /// innovations.
    pub fn is_shown(&self, over: bool) -> bool {
        if over { self.plot.is_some() } else { !self.quantity.is_accuracy() && !self.aids }
    }

    fn write(
        &mut self,
        recording: &Recording,
        k: usize,
        (span, window): ((i64, i64), Legend),
    ) -> Result<(), StreamError> {
        let (accepted, gated) = (self.accepted.rows(), self.gated.rows());
        if accepted.is_empty() && gated.is_empty() {
            return Ok(());
        }
        let scale = self.scale(&accepted, &gated);
        let entity = |leaf: &str| self.path.join(&EntityPath::from(leaf));
        let name = label(&self.quantity.name, scale.unit);
        let own = colour(&self.quantity.name, k);
        let mut line = Series::lines(entity("accepted"), &[(name.clone(), own, 1.0)]);
        let bounds = || (BOUNDS.to_owned(), BOUND, 1.2);
        let mut bounds = Series::lines(entity("bounds"), &[bounds(), bounds()]);
        let mut marks = Series::marked(entity("gated"), "gated", GATED, 4.5, MarkerShape::Diamond);
        // the priors, and the first samples after an outage, have wide bounds: one in twenty
        let bound = |sigma: &f64| 3.0 * sigma / scale.size;
        let mut limits: Vec<f64> = accepted.iter().map(|r| bound(&r.1[1])).collect();
        limits.retain(|limit| limit.is_finite());
        limits.sort_by(f64::total_cmp);
        let usual = limits.get(limits.len() * 19 / 20).copied();
        let mut size = usual.unwrap_or(0.0);
        for (time, [value, sigma]) in &accepted {
            let (time, value, bound) = (Time::from_nanos(*time), value / scale.size, bound(sigma));
            line.push(recording, time, &[value])?;
            bounds.push(recording, time, &[bound, -bound])?;
            // an innovation of a wide prior would flatten the others; max ignores NaN
            if usual.is_none_or(|usual| bound <= WIDE * usual) {
                size = size.max(value.abs());
            }
        }
        // an outlier far away would flatten the plot: a mark at the edge stands for it
        let far = gated.iter().map(|r| (r.1[0] / scale.size).abs()).fold(0.0, f64::max);
        let size = if size > 0.0 { size.max(far.min(3.0 * size)) } else { far };
        let beyond = |sign: f64, leaf: &str, marker| {
            let far = gated.iter().map(|r| sign * r.1[0] / scale.size).fold(0.0, f64::max);
            let name = format!("gated, beyond: up to {} {}", short(sign * far), scale.unit);
            Series::marked(entity(leaf), &name, GATED, 4.5, marker)
        };
        let mut above = beyond(1.0, "above", MarkerShape::Up);
        let mut below = beyond(-1.0, "below", MarkerShape::Down);
        for (time, [value]) in &gated {
            let (time, value) = (Time::from_nanos(*time), value / scale.size);
            match value {
                _ if value > size => above.push(recording, time, &[EDGE * size])?,
                _ if value < -size => below.push(recording, time, &[-EDGE * size])?,
                _ => marks.push(recording, time, &[value])?,
            }
        }
        let range = [-size, size];
        let lines = |row: &[f64; 2]| {
            let [value, bound] = [row[0] / scale.size, bound(&row[1])];
            [value, bound, -bound]
        };
        let mut drawn: Vec<Row<3>> = accepted.iter().map(|(time, r)| (*time, lines(r))).collect();
        let mark = |value: f64| [(value / scale.size).clamp(-size, size), f64::NAN, f64::NAN];
        drawn.extend(gated.iter().map(|(time, [value])| (*time, mark(*value))));
        let any = |counts: &dyn Fn(f64) -> bool| {
            usize::from(gated.iter().any(|r| counts(r.1[0] / scale.size)))
        };
        let inside = any(&|value| value.abs() <= size);
        let beyond = any(&|value| value > size) + any(&|value| value < -size);
        let letters = if beyond > 0 { 34 } else { name.chars().count() };
        let of = Legend { lines: window.lines + 2 + inside + beyond, letters, ..window };
        let legend = quietest(&drawn, |row: &[f64; 3]| *row, (span, range), of);
        self.plot = Some(Plot { name, range, legend, beyond: beyond > 0 });
        [line, bounds, marks, above, below]
            .iter_mut()
            .try_for_each(|series| series.flush(recording))
    }

    /// The unit that fits the last sigma.
    fn scale(&self, accepted: &[Row<2>], gated: &[Row<1>]) -> Scale<'_> {
        let sigma = accepted.iter().rev().map(|r| 3.0 * r.1[1]).find(|s| s.is_finite());
        let size = sigma.or_else(|| gated.last().map(|r| r.1[0].abs()));
        axis::scale(&self.quantity.unit, size.unwrap_or(f64::NAN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::sensor::mounting::{Beam, Mounting};

    /// While a run goes on, nothing else shows that a channel has no innovations: its plot would stay empty.
    #[test]
    fn a_height_that_only_ends_beams_has_no_plot_of_innovations() {
        let beam = Beam { direction: [0.0, 0.0, 1.0], channel: None, reach: Reach::Altitude(1) };
        let info = SensorInfo {
            name: "dvl".into(),
            kind: "dvl".into(),
            channels: vec![Channel::new("vel_x", "m/s"), Channel::new("altitude", "m")],
            purpose: Purpose::Measurement,
            mounting: Mounting::default().with_beams([beam]),
        };
        let series = SensorSeries::new(&info, false);
        let shown = series.iter().flat_map(|s| &s.channels).map(|c| c.is_shown(false));
        assert_eq!(shown.collect::<Vec<_>>(), [true, false]);
    }
}
