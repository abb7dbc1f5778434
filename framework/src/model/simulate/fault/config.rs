//! The keys of a simulated fault.

use crate::units::{AnyQuantity, Duration, Frequency, Positive, Ratio};
use schemars::JsonSchema;
use serde::Deserialize;

/// One fault of a simulated sensor.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Type of the fault.
    #[serde(rename = "type")]
    pub kind: FaultType,
    /// Time of the first faulty sample. Default: the start of the run.
    pub from: Option<Duration>,
    /// Time of the first sample without the fault. Default: never.
    pub to: Option<Duration>,
    /// Faulty channels. Default: every channel of the dimension of `size` or `unit`; every channel
    /// for a fault without them.
    pub channels: Option<Vec<String>>,
    /// Size in a unit of the channels: the error of a bias, step or spike; the error that a drift
    /// gains each second; the value at which a channel is stuck or saturates; a quantisation step;
    /// the amplitude of a vibration. A time for `clock-offset` and `clock-step`, a ratio for
    /// `clock-drift` and `scale`, a ratio per time for `scale-drift`, an angle for `turn`.
    pub size: Option<AnyQuantity>,
    /// Unit in which the instrument writes its numbers, for `unit`.
    pub unit: Option<String>,
    /// Frequency of a `vibration`.
    pub frequency: Option<Positive<Frequency>>,
    /// Probability that a sample has a `spike`, or is lost by a `dropout`. Default: one spike, at
    /// the first sample; a dropout loses every sample.
    pub probability: Option<Positive<Ratio>>,
}

/// Type of a simulated fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultType {
    /// A constant error.
    Bias,
    /// A constant error from a time to the end of the run.
    Step,
    /// An error that grows with time from zero.
    Drift,
    /// Channels that keep a value: `size`, or the last value before the fault.
    Stuck,
    /// The last sample before the fault, repeated as a whole with new time stamps.
    Frozen,
    /// An error of one sample; of random samples, with a random sign, if a `probability` is given.
    Spike,
    /// Values cut off at plus and minus `size`.
    Saturation,
    /// Lost samples, or lost channels where `channels` names some.
    Dropout,
    /// Numbers written in another unit and read as SI.
    Unit,
    /// Two channels exchanged.
    Swap,
    /// Values too large by a ratio.
    Scale,
    /// Values too large by a ratio that grows with time from zero.
    ScaleDrift,
    /// Two channels turned by an angle, from the first to the second.
    Turn,
    /// Channels with the wrong sign. One axis of each triad makes the instrument left-handed.
    Sign,
    /// A time stamp with a constant error.
    ClockOffset,
    /// A time stamp with a constant error from a time to the end of the run.
    ClockStep,
    /// A time stamp whose error grows with time from zero.
    ClockDrift,
    /// Values rounded to multiples of `size`.
    Quantisation,
    /// A sinusoid of amplitude `size`, with a random phase for each channel.
    Vibration,
}

/// Keys of a fault beside its type.
pub(super) const KEYS: [&str; 7] =
    ["from", "to", "channels", "size", "unit", "frequency", "probability"];

impl FaultType {
    /// Name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Step => "step",
            Self::Drift => "drift",
            Self::Stuck => "stuck",
            Self::Frozen => "frozen",
            Self::Spike => "spike",
            Self::Saturation => "saturation",
            Self::Dropout => "dropout",
            Self::Unit => "unit",
            Self::Swap => "swap",
            Self::Scale => "scale",
            Self::ScaleDrift => "scale-drift",
            Self::Turn => "turn",
            Self::Sign => "sign",
            Self::ClockOffset => "clock-offset",
            Self::ClockStep => "clock-step",
            Self::ClockDrift => "clock-drift",
            Self::Quantisation => "quantisation",
            Self::Vibration => "vibration",
        }
    }

    /// Keys that a fault of this type must have.
    pub(super) const fn required(self) -> &'static [&'static str] {
        match self {
            Self::Bias
            | Self::Drift
            | Self::Spike
            | Self::Saturation
            | Self::ClockOffset
            | Self::ClockDrift
            | Self::Scale
            | Self::ScaleDrift
            | Self::Quantisation => &["size"],
            Self::Turn => &["size", "channels"],
            Self::Step | Self::ClockStep => &["from", "size"],
            Self::Vibration => &["size", "frequency"],
            Self::Unit => &["unit"],
            Self::Swap => &["channels"],
            Self::Stuck | Self::Frozen | Self::Dropout | Self::Sign => &[],
        }
    }

    /// Keys that a fault of this type may have beside those that it must have.
    pub(super) const fn optional(self) -> &'static [&'static str] {
        match self {
            Self::Bias
            | Self::Drift
            | Self::Saturation
            | Self::Unit
            | Self::Scale
            | Self::ScaleDrift
            | Self::Sign
            | Self::Quantisation
            | Self::Vibration => &["from", "to", "channels"],
            Self::Step => &["channels"],
            Self::Stuck => &["from", "to", "channels", "size"],
            Self::Frozen | Self::Swap | Self::Turn | Self::ClockOffset | Self::ClockDrift => {
                &["from", "to"]
            }
            Self::ClockStep => &[],
            Self::Spike | Self::Dropout => &["from", "to", "channels", "probability"],
        }
    }
}

impl Fault {
    /// Returns `true` if the fault only loses samples or channels.
    pub fn only_loses(&self) -> bool {
        self.kind == FaultType::Dropout
    }

    /// Returns `true` if the key has a value.
    pub(super) fn has(&self, key: &str) -> bool {
        match key {
            "from" => self.from.is_some(),
            "to" => self.to.is_some(),
            "channels" => self.channels.is_some(),
            "size" => self.size.is_some(),
            "unit" => self.unit.is_some(),
            "frequency" => self.frequency.is_some(),
            "probability" => self.probability.is_some(),
            _ => false,
        }
    }
}
