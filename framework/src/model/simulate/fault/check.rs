//! Checks of a fault against the channels of its sensor.

use super::config::{Fault, FaultType, KEYS};
use super::inject::{Effect, Stage};
use crate::document::unknown;
use crate::model::error::ComposeError;
use crate::model::simulate::Random;
use crate::units::sample::{Channel, MAX_CHANNELS};
use crate::units::time::{Span, Time};
use crate::units::{AnyQuantity, Exponents, Unit, parse_unit};
use std::f64::consts::TAU;

/// Exponents of a ratio, an angle and a time, in halves.
const RATIO: Exponents = [0, 0, 0, 0, 0, 0];
const ANGLE: Exponents = [0, 0, 0, 2, 0, 0];
const TIME: Exponents = [0, 0, 2, 0, 0, 0];

/// A fault that is being checked.
pub(super) struct Check<'a> {
    pub fault: &'a Fault,
    /// Key of the fault below the sensor's table.
    pub place: String,
    /// Channels of the sensor.
    pub channels: &'a [Channel],
}

impl Check<'_> {
    fn error(&self, key: &str, message: impl Into<String>) -> ComposeError {
        let dot = if key.is_empty() { "" } else { "." };
        ComposeError::new(format!("{}{dot}{key}", self.place), message)
    }

    /// Resolves the names and units of the fault; `random` gives its random numbers.
    pub fn stage(&self, mut random: Random) -> Result<Stage, ComposeError> {
        self.check_keys()?;
        let (from, to) = self.span()?;
        let channels = self.chosen()?;
        let effect = self.effect(&channels, &mut random)?;
        Ok(Stage { effect, from, to, channels, random, begun: false, before: None })
    }

    fn check_keys(&self) -> Result<(), ComposeError> {
        let (fault, kind) = (self.fault, self.fault.kind);
        let (needed, optional) = (kind.required(), kind.optional());
        if let Some(key) = needed.iter().find(|key| !fault.has(key)) {
            let example = match *key {
                "size" => format!("size = \"{}\"", self.example()),
                "unit" => "unit = \"g\"".to_owned(),
                "frequency" => "frequency = \"20 Hz\"".to_owned(),
                "channels" => {
                    let first: Vec<&str> = self.names().into_iter().take(2).collect();
                    format!("channels = {first:?}")
                }
                key => format!("{key} = \"250 s\""),
            };
            let message = format!("missing key {key:?}: give the {} {example}", kind.name());
            return Err(self.error("", message));
        }
        let taken = |key: &&str| needed.contains(key) || optional.contains(key);
        if let Some(key) = KEYS.iter().find(|key| fault.has(key) && !taken(key)) {
            let keys: Vec<&str> = KEYS.into_iter().filter(taken).collect();
            let message = format!(
                "a fault of type {:?} has no such key; remove it (it takes: {})",
                kind.name(),
                keys.join(", ")
            );
            return Err(self.error(key, message));
        }
        Ok(())
    }

    /// A size for messages, in the unit of the first channel.
    fn example(&self) -> String {
        let exponents = match self.fault.kind {
            FaultType::ClockOffset | FaultType::ClockStep => TIME,
            FaultType::ClockDrift => RATIO,
            kind => {
                let first = self.channels.first().map(|channel| channel.unit.exponents());
                sized(kind, first.unwrap_or(RATIO))
            }
        };
        crate::units::example(exponents)
    }

    fn names(&self) -> Vec<&str> {
        self.channels.iter().map(|c| &*c.name).collect()
    }

    /// Begin and end of the fault.
    fn span(&self) -> Result<(Time, Time), ComposeError> {
        let read = |key, value: Option<crate::units::Duration>, default| match value {
            None => Ok(default),
            Some(value) => Time::from_seconds(value.si()).ok_or_else(|| {
                self.error(key, "beyond 73 years, the longest time that can be represented")
            }),
        };
        let from = read("from", self.fault.from, Time::MIN)?;
        let to = read("to", self.fault.to, Time::MAX)?;
        if from >= to {
            return Err(self.error("to", format!("a fault ends after it begins, at {from}")));
        }
        Ok((from, to))
    }

    /// Indices of the faulty channels.
    fn chosen(&self) -> Result<Vec<usize>, ComposeError> {
        let Some(names) = &self.fault.channels else { return self.fitting() };
        if names.is_empty() {
            return Err(self.error("channels", "name a channel, or remove the key for all of them"));
        }
        let mut chosen = Vec::with_capacity(names.len());
        for (k, name) in names.iter().enumerate() {
            let key = format!("channels.{k}");
            let Some(index) = self.channels.iter().position(|c| *c.name == **name) else {
                return Err(self.error(&key, unknown("channel", name, &self.names())));
            };
            if chosen.contains(&index) {
                return Err(self.error(&key, "the channel is named twice; remove one"));
            }
            chosen.push(index);
        }
        Ok(chosen)
    }

    /// Indices of the channels of the fault's dimension; of all channels where it has none.
    fn fitting(&self) -> Result<Vec<usize>, ComposeError> {
        let (key, dimension) = match (&self.fault.size, &self.fault.unit) {
            _ if self.of_clock() => return Ok(Vec::new()),
            (Some(size), _) => ("size", size.dimension()),
            (_, Some(_)) => ("unit", Some(self.unit()?.exponents())),
            _ => ("", None),
        };
        let Some(dimension) = dimension else { return Ok((0..self.channels.len()).collect()) };
        let of_channel = |c: &Channel| sized(self.fault.kind, c.unit.exponents());
        let fitting: Vec<usize> = (0..self.channels.len())
            .filter(|k| of_channel(&self.channels[*k]) == dimension)
            .collect();
        if !fitting.is_empty() {
            return Ok(fitting);
        }
        let mut units: Vec<String> =
            self.channels.iter().map(of_channel).map(crate::units::usual_units).collect();
        units.dedup();
        let message = format!(
            "no channel takes {}; give a unit such as {}",
            crate::units::dimension_name(dimension),
            units.join(", or ")
        );
        Err(self.error(key, message))
    }

    fn of_clock(&self) -> bool {
        use FaultType::{ClockDrift, ClockOffset, ClockStep};
        matches!(self.fault.kind, ClockOffset | ClockStep | ClockDrift)
    }

    /// Size of the fault in SI; zero for a fault without one.
    fn size(&self, channels: &[usize]) -> Result<f64, ComposeError> {
        let Some(size) = &self.fault.size else { return Ok(0.0) };
        match self.fault.kind {
            FaultType::ClockOffset | FaultType::ClockStep => self.size_as(size, TIME, ""),
            FaultType::ClockDrift => self.size_as(size, RATIO, ""),
            kind => channels.iter().try_fold(size.si(), |_, k| {
                let channel = &self.channels[*k];
                self.size_as(size, sized(kind, channel.unit.exponents()), &channel.name)
            }),
        }
    }

    fn size_as(
        &self,
        size: &AnyQuantity,
        needed: Exponents,
        channel: &str,
    ) -> Result<f64, ComposeError> {
        size.si_as(needed).map_err(|e| {
            let of = if channel.is_empty() { String::new() } else { format!("{channel}: ") };
            self.error("size", format!("{of}{e}"))
        })
    }

    /// Unit in which the instrument writes.
    fn unit(&self) -> Result<Unit, ComposeError> {
        let name = self.fault.unit.as_deref().unwrap_or_default();
        parse_unit(name).map_err(|e| self.error("unit", e.to_string()))
    }

    /// Size that must be greater than zero.
    fn positive(&self, size: f64) -> Result<f64, ComposeError> {
        if size > 0.0 { Ok(size) } else { Err(self.error("size", "give a size greater than zero")) }
    }

    fn effect(&self, channels: &[usize], random: &mut Random) -> Result<Effect, ComposeError> {
        let (fault, size) = (self.fault, self.size(channels)?);
        Ok(match fault.kind {
            FaultType::Bias | FaultType::Step => Effect::Add(size),
            FaultType::Drift => Effect::Grow(size),
            FaultType::Stuck => Effect::Hold(fault.size.as_ref().map(|_| size)),
            FaultType::Frozen => Effect::Repeat,
            FaultType::Spike => match self.probability()? {
                None => Effect::Once(size),
                Some(probability) => Effect::Often { size, probability },
            },
            FaultType::Saturation => Effect::Limit(self.positive(size)?),
            FaultType::Dropout => Effect::Lose(self.probability()?.unwrap_or(1.0)),
            FaultType::Unit => Effect::Multiply(1.0 / self.common_unit(channels)?.factor()),
            FaultType::Sign => Effect::Multiply(-1.0),
            FaultType::Scale => Effect::Multiply(1.0 + size),
            FaultType::ScaleDrift => Effect::Stretch(size),
            FaultType::Turn => {
                let (a, b) = self.pair(channels, "turned")?;
                Effect::Turn(a, b, size.sin_cos())
            }
            FaultType::Swap => {
                let (a, b) = self.pair(channels, "exchanged")?;
                Effect::Exchange(a, b)
            }
            FaultType::ClockOffset | FaultType::ClockStep => {
                let beyond = || self.error("size", "beyond 73 years, the longest time");
                Effect::Shift(Span::from_seconds(size).ok_or_else(beyond)?)
            }
            FaultType::ClockDrift => Effect::Run(size),
            FaultType::Quantisation => Effect::Round(self.positive(size)?),
            FaultType::Vibration => {
                let mut phase = [0.0; MAX_CHANNELS];
                channels.iter().for_each(|k| phase[*k] = TAU * random.uniform());
                let turn = TAU * fault.frequency.map_or(0.0, |f| f.si());
                Effect::Swing { size, turn, phase }
            }
        })
    }

    fn probability(&self) -> Result<Option<f64>, ComposeError> {
        let probability = self.fault.probability.map(|p| p.si());
        if probability.is_some_and(|p| p > 1.0) {
            let message = "give a probability up to 1, such as \"2 %\"";
            return Err(self.error("probability", message));
        }
        Ok(probability)
    }

    /// Unit in which the instrument writes, if it fits every channel.
    fn common_unit(&self, channels: &[usize]) -> Result<Unit, ComposeError> {
        let unit = self.unit()?;
        for channel in channels.iter().map(|k| &self.channels[*k]) {
            let needed = channel.unit;
            if unit.exponents() != needed.exponents() {
                let message = format!(
                    "{} is {}, the channel {} needs {}, e.g. {}",
                    self.fault.unit.as_deref().unwrap_or_default(),
                    unit.dimension(),
                    channel.name,
                    needed.dimension(),
                    crate::units::usual_units(needed.exponents())
                );
                return Err(self.error("unit", message));
            }
        }
        Ok(unit)
    }

    /// The two channels of one unit that are turned or exchanged.
    fn pair(&self, channels: &[usize], what: &str) -> Result<(usize, usize), ComposeError> {
        let &[a, b] = channels else {
            return Err(self.error("channels", format!("two channels are {what}; name two")));
        };
        if self.channels[a].unit != self.channels[b].unit {
            let message = "the two channels have different units; name two of the same unit";
            return Err(self.error("channels", message));
        }
        Ok((a, b))
    }
}

/// Exponents of the size of a fault of a channel: those of the channel, a ratio or an angle; for a drift
/// per second.
fn sized(kind: FaultType, channel: Exponents) -> Exponents {
    let mut exponents = match kind {
        FaultType::Scale | FaultType::ScaleDrift => RATIO,
        FaultType::Turn => ANGLE,
        _ => channel,
    };
    if matches!(kind, FaultType::Drift | FaultType::ScaleDrift) {
        exponents[2] -= 2;
    }
    exponents
}
