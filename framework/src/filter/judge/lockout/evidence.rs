//! What a lock-out knows: the sample, the evidence on it, and the samples before.

use crate::checkpoint::saved;
use crate::units::time::Time;

/// Decision on a measured sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::filter) enum Verdict {
    Pass,
    Gate,
    /// The sample is used, although the gate does not pass.
    Accept,
    Inflate,
    /// The covariance is inflated, although the sensor may be wrong.
    Adopt,
    /// The sample passes again, although the sensor was found to be wrong.
    Try,
    /// The covariance is inflated, and the samples before were wrong.
    Follow,
    /// The position is free, and the sample sets it.
    Obey,
    Isolate,
}

impl Verdict {
    /// Returns `true` if the covariance is inflated.
    pub(in crate::filter) fn recovers(self) -> bool {
        matches!(self, Self::Inflate | Self::Adopt | Self::Follow | Self::Obey)
    }
}

/// The channel with the largest innovation, and its size in sigma.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::filter) struct Largest {
    pub(in crate::filter) channel: usize,
    pub(in crate::filter) sigmas: f64,
}

saved!(Largest { channel, sigmas });

/// A sample as the gate sees it.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Judged<'a> {
    pub(in crate::filter) sensor: &'a str,
    /// The driving sensor, if there is one.
    pub(in crate::filter) driver: Option<&'a str>,
    pub(in crate::filter) time: Time,
    pub(in crate::filter) nis: f64,
    pub(in crate::filter) threshold: f64,
    /// Number of channels, and the channels, one bit each.
    pub(in crate::filter) m: usize,
    pub(in crate::filter) channels: u16,
    /// Square of the innovation relative to that of the first gated sample.
    pub(in crate::filter) share: f64,
    pub(in crate::filter) largest: Largest,
}

impl<'a> Judged<'a> {
    /// A sensor without a sample.
    pub(super) fn none(sensor: &'a str, time: Time) -> Self {
        let (nis, threshold, share) = (f64::NAN, f64::NAN, f64::NAN);
        let largest = Largest { channel: 0, sigmas: f64::NAN };
        Self { sensor, driver: None, time, nis, threshold, m: 0, channels: 0, share, largest }
    }
}

/// Evidence on a sample that is gated, or follows a gated one, beside its innovation.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Evidence {
    /// The sample passes its gate.
    pub(in crate::filter) passes: bool,
    /// Another sensor is gated at the same time.
    pub(in crate::filter) shared: bool,
    /// Other sensors would have removed the error from the filter; `None` where the sample has
    /// other channels than the first gated one.
    pub(in crate::filter) contradicted: Option<bool>,
    /// The innovation is that of the first gated sample.
    pub(in crate::filter) repeated: bool,
    /// Time of the last driving sample that the screening replaced.
    pub(in crate::filter) replaced: Time,
}

/// Consecutive gated samples of one sensor.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Streak {
    pub(in crate::filter) since: Time,
    pub(in crate::filter) count: u64,
    /// Time without a used sample before the streak, s, if it was longer than the timeout.
    pub(super) silence: Option<f64>,
    /// Set if driving samples were replaced since the last used sample.
    pub(super) replaced: bool,
    /// NIS of the first sample as a multiple of that from which on an innovation jumped; zero where a jump
    /// is no evidence.
    pub(super) jump: f64,
    /// Set if other sensors contradicted the last sample.
    pub(super) contradicted: bool,
    /// Set once the lock-out has been reported.
    pub(super) reported: bool,
    /// The largest innovation of all samples.
    pub(super) largest: Largest,
}

saved!(Streak { since, count, silence, replaced, jump, contradicted, reported, largest });

/// Isolation of a sensor: its samples are judged and not used.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Isolation {
    /// Time of the first gated sample.
    pub(in crate::filter) since: Time,
    /// Set if other sensors contradicted the sensor; otherwise its innovation jumped.
    pub(in crate::filter) contradicted: bool,
    /// The channels that are isolated, one bit each.
    pub(super) channels: u16,
    /// Number of samples in a row that were not used.
    pub(super) count: u64,
    /// Time at which the isolation began.
    pub(super) began: Time,
    /// Number of samples in a row that agreed.
    pub(super) agreed: u32,
    /// The jump of the streak before it.
    pub(super) jump: f64,
}

saved!(Isolation { since, contradicted, channels, count, began, agreed, jump });

/// A sensor that was found to be wrong.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Conviction {
    /// Time of the first wrong sample.
    pub(in crate::filter) since: Time,
    /// Time at which the evidence sufficed.
    pub(in crate::filter) at: Time,
    /// The channels that are wrong still, one bit each.
    pub(in crate::filter) channels: u16,
}
