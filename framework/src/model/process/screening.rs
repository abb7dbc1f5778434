//! Screening of a driving sensor: the limits by which the filter notices a faulty sample.

use crate::units::sample::MAX_CHANNELS;

/// Limits of one channel of a driving sensor, in SI. For a channel that is an integral over the
/// interval of a sample, the limits hold for its mean rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelLimits {
    /// Largest plausible magnitude.
    pub range: f64,
    /// Largest plausible change from one sample to the next; `None`: learnt from the samples.
    pub change: Option<f64>,
    /// Root spectral density of the white noise that the process assumes.
    pub noise: f64,
    /// Quantisation step.
    pub step: f64,
    /// Change of the channel within a second that is always possible, 1-sigma: the least
    /// uncertainty of a span that is bridged.
    pub motion: f64,
}

/// Limits by which the filter screens the samples of the driving sensor before the process takes
/// them. A process hands them over when it is built
/// ([`BuiltProcess::screened_by`](crate::model::process::BuiltProcess::screened_by)).
#[derive(Clone, Debug, PartialEq)]
pub struct Screening {
    /// Limits of the channels, in the sensor's order.
    pub channels: Vec<ChannelLimits>,
    /// Set if the channels are integrals over the interval of a sample.
    pub integrals: bool,
    /// Duration of identical samples after which the sensor counts as frozen, s; `None`: learnt
    /// from how often samples repeat.
    pub frozen: Option<f64>,
    /// Longest span that is bridged without making the result useless, s.
    pub max_bridge: f64,
}

/// Uncertainty of a sample that the screening replaced: 1-sigma of each channel, beyond the noise
/// of the sensor.
pub type Spread = [f64; MAX_CHANNELS];
