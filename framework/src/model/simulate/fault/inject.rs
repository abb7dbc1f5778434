//! The effect of faults on the samples of a simulated sensor.

use super::check::Check;
use super::config::Fault;
use crate::model::error::ComposeError;
use crate::model::sensor::SensorInfo;
use crate::model::simulate::Random;
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::{Span, Time};

/// Applies the faults of a simulated sensor to its samples.
///
/// ```
/// use navfuse_core::document::Document;
/// use navfuse_core::model::simulate::fault::{Fault, Injector};
/// use navfuse_core::model::sensor::mounting::Mounting;
/// use navfuse_core::model::sensor::{Purpose, SensorInfo};
/// use navfuse_core::prelude::*;
///
/// let text = r#"fault = { type = "bias", from = "10 s", to = "20 s", size = "5 m" }"#;
/// let document = Document::parse("depth.toml", text)?;
/// let fault: Fault = document.root().get("fault").unwrap().parse()?;
/// let (name, kind) = ("depth".to_owned(), "depth".to_owned());
/// let (channels, purpose) = (vec![Channel::new("depth", "m")], Purpose::Measurement);
/// let mounting = Mounting::default();
/// let sensor = SensorInfo { name, kind, channels, purpose, mounting };
///
/// let mut injector = Injector::new(&[fault], &sensor, 1)?;
/// for (second, depth) in [(9, 3.0), (10, 8.0), (19, 8.0), (20, 3.0)] {
///     let mut sample = Sample::new(Time::from_nanos(second * 1_000_000_000), SensorId(0), &[3.0]);
///     assert!(injector.apply(&mut sample), "the sample is not lost");
///     assert_eq!(sample.get(0), Some(depth));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Injector(Vec<Stage>);

impl Injector {
    /// Resolves the names and units of the faults against the channels of the sensor. Random faults
    /// draw from a stream of their own, which the seed and the sensor determine.
    ///
    /// # Errors
    /// When a fault names no channel of the sensor, its size has another dimension than its
    /// channels, or a key is missing or too many. The error names the key below the sensor's table.
    pub fn new(faults: &[Fault], sensor: &SensorInfo, seed: u64) -> Result<Self, ComposeError> {
        let stages = faults.iter().enumerate().map(|(k, fault)| {
            let place = format!("simulation.faults.{k}");
            // counted among its type, so that a fault of another type changes no draw of this one
            let number = faults[..k].iter().filter(|before| before.kind == fault.kind).count();
            let purpose = format!("{} {number} of {}", fault.kind.name(), sensor.name);
            let random = Random::new(seed, &purpose);
            Check { fault, place, channels: &sensor.channels }.stage(random)
        });
        Ok(Self(stages.collect::<Result<_, _>>()?))
    }

    /// Applies the faults to a sample; `false` if the sample is lost.
    pub fn apply(&mut self, sample: &mut Sample) -> bool {
        let time = sample.time;
        self.0.iter_mut().all(|stage| stage.apply(time, sample))
    }
}

/// One fault with its names and units resolved.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub effect: Effect,
    /// The fault begins at `from` and has ended at `to`.
    pub from: Time,
    pub to: Time,
    /// Indices of the faulty channels.
    pub channels: Vec<usize>,
    pub random: Random,
    /// Set once a sample was faulty.
    pub begun: bool,
    /// Sample before the fault; during the fault, the values that it repeats.
    pub before: Option<Sample>,
}

/// Effect of a fault on a sample; sizes are in SI.
#[derive(Clone, Copy, Debug)]
pub(super) enum Effect {
    /// Adds a constant.
    Add(f64),
    /// Adds a constant times the time since the begin.
    Grow(f64),
    /// Keeps a value, or the last one.
    Hold(Option<f64>),
    /// Repeats the last sample.
    Repeat,
    /// Adds a constant to the first sample.
    Once(f64),
    /// Adds a constant with a probability, with a random sign.
    Often { size: f64, probability: f64 },
    /// Limits the magnitude.
    Limit(f64),
    /// Loses channels with a probability.
    Lose(f64),
    /// Multiplies by a constant.
    Multiply(f64),
    /// Multiplies by one plus a constant times the time since the begin.
    Stretch(f64),
    /// Turns two channels by the angle of that sine and cosine.
    Turn(usize, usize, (f64, f64)),
    /// Exchanges two channels.
    Exchange(usize, usize),
    /// Adds a constant to the time stamp.
    Shift(Span),
    /// Adds a constant times the time since the begin to the time stamp.
    Run(f64),
    /// Rounds to multiples.
    Round(f64),
    /// Adds a sinusoid: amplitude, angular frequency, and the phase of each channel.
    Swing { size: f64, turn: f64, phase: [f64; MAX_CHANNELS] },
}

impl Stage {
    /// Applies the fault to a sample, valid at `time`; `false` if the sample is lost. Another fault
    /// may have changed the sample's time stamp already.
    fn apply(&mut self, time: Time, sample: &mut Sample) -> bool {
        if time < self.from || time >= self.to {
            self.before = Some(*sample);
            return true;
        }
        // without a begin, a fault begins with the clock
        let begin = if self.from == Time::MIN { Time::default() } else { self.from };
        let elapsed = time.since(begin);
        let first = !std::mem::replace(&mut self.begun, true);
        match self.effect {
            Effect::Add(size) => self.change(sample, |_, x| x + size),
            Effect::Grow(rate) => self.change(sample, |_, x| x + rate * elapsed),
            Effect::Hold(Some(value)) => self.change(sample, |_, _| value),
            Effect::Hold(None) => self.hold(sample),
            Effect::Repeat => {
                let before = self.before.get_or_insert(*sample);
                let time = sample.time;
                *sample = *before;
                sample.time = time;
            }
            Effect::Once(size) if first => self.change(sample, |_, x| x + size),
            Effect::Once(_) => {}
            Effect::Often { size, probability } => {
                let (hit, positive) =
                    (self.random.uniform() < probability, self.random.uniform() < 0.5);
                let size = if positive { size } else { -size };
                if hit {
                    self.change(sample, |_, x| x + size);
                }
            }
            Effect::Limit(limit) => self.change(sample, |_, x| x.clamp(-limit, limit)),
            Effect::Lose(probability) => {
                if self.random.uniform() < probability {
                    self.channels.iter().for_each(|k| sample.clear(*k));
                    return sample.present() != 0;
                }
            }
            Effect::Multiply(factor) => self.change(sample, |_, x| x * factor),
            Effect::Stretch(rate) => self.change(sample, |_, x| x * (1.0 + rate * elapsed)),
            Effect::Turn(a, b, (sin, cos)) => {
                if let (Some(x), Some(y)) = (sample.get(a), sample.get(b)) {
                    sample.set(a, cos * x - sin * y);
                    sample.set(b, sin * x + cos * y);
                }
            }
            Effect::Exchange(a, b) => {
                let (first, second) = (sample.get(a), sample.get(b));
                put(sample, a, second);
                put(sample, b, first);
            }
            Effect::Shift(offset) => sample.time = sample.time + offset,
            Effect::Run(rate) => {
                let offset = Span::from_seconds(rate * elapsed).unwrap_or_default();
                sample.time = sample.time + offset;
            }
            Effect::Round(step) => self.change(sample, |_, x| (x / step).round() * step),
            Effect::Swing { size, turn, phase } => {
                self.change(sample, |k, x| x + size * (turn * elapsed + phase[k]).sin());
            }
        }
        true
    }

    /// Changes the faulty channels that the sample has.
    fn change(&self, sample: &mut Sample, change: impl Fn(usize, f64) -> f64) {
        for k in &self.channels {
            if let Some(value) = sample.get(*k) {
                sample.set(*k, change(*k, value));
            }
        }
    }

    /// Repeats the values before the fault; a channel that was missing then repeats its first
    /// value.
    fn hold(&mut self, sample: &mut Sample) {
        let before = self.before.get_or_insert(*sample);
        for k in &self.channels {
            match (before.get(*k), sample.get(*k)) {
                (Some(kept), Some(_)) => sample.set(*k, kept),
                (None, Some(value)) => before.set(*k, value),
                (_, None) => {}
            }
        }
    }
}

/// Sets or clears a channel.
fn put(sample: &mut Sample, channel: usize, value: Option<f64>) {
    match value {
        Some(value) => sample.set(channel, value),
        None => sample.clear(channel),
    }
}
