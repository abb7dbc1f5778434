//! History of a sensor: its samples, and the outcomes of those that correct the state.

use crate::residuals::Residuals;
use navfuse_core::model::record::health::Lane;
use navfuse_core::model::record::{InPart, Outcomes};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::units::thin::{Merge, Thin};

/// History of a sensor.
#[derive(Clone, Debug, Default)]
pub struct SensorHistory {
    /// Name in the scenario.
    pub name: String,
    /// Registered type, if it is known.
    pub kind: Option<String>,
    /// Purpose, if it is known.
    pub purpose: Option<Purpose>,
    /// Names and SI units of the channels, such as `vel_x_mps`; empty before the first sample.
    pub channels: Vec<String>,
    /// Number of samples.
    pub read: u64,
    /// Samples over time; a row has the smallest and the largest value of each channel over several
    /// samples.
    pub samples: Thin<Envelope>,
    /// Outcomes of the samples of a measuring sensor.
    pub updates: Updates,
    /// Health over time; of a reference nothing is known.
    pub health: Lane,
}

/// Range of a sensor's channels over several samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// Time of the first sample, s.
    pub time: f64,
    /// Smallest value of each channel; NaN if it is missing.
    pub low: Vec<f64>,
    /// Largest value of each channel.
    pub high: Vec<f64>,
}

impl Merge for Envelope {
    fn merge(&mut self, next: Self) {
        // if one operand is NaN, `min` and `max` return the other
        self.low.iter_mut().zip(next.low).for_each(|(a, b)| *a = a.min(b));
        self.high.iter_mut().zip(next.high).for_each(|(a, b)| *a = a.max(b));
    }
}

/// Largest number of innovations in a plot: dots, which need more room than the points of a line.
const DOTS: usize = 512;

/// Outcomes of the samples of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Updates {
    /// Numbers of samples. Of a driving sensor, the rejected ones alone.
    pub outcomes: Outcomes<String>,
    /// Gated or rejected samples of which other channels were used.
    pub in_part: InPart,
    /// Sum of the normalised innovation squared of the accepted samples, and of their degrees of
    /// freedom.
    pub nis: [f64; 2],
    /// Every n-th accepted innovation.
    pub innovations: Thin<Innovation>,
    /// Every n-th gated innovation; all, unless there are very many.
    pub outliers: Thin<Innovation>,
    /// Accepted and gated innovations of each channel over their sigma.
    pub residuals: Vec<Residuals>,
    /// Sums of `nis` over time.
    pub consistency: Thin<Consistency>,
}

impl Default for Updates {
    fn default() -> Self {
        Self {
            outcomes: Outcomes::default(),
            in_part: InPart::default(),
            nis: [0.0; 2],
            innovations: Thin::with_rows(DOTS),
            outliers: Thin::with_rows(DOTS),
            residuals: Vec::new(),
            consistency: Thin::default(),
        }
    }
}

/// Innovation of a sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovation {
    /// Time, s.
    pub time: f64,
    /// Sample minus prediction of each channel, SI; NaN if the channel is missing.
    pub innovation: Vec<f64>,
    /// 1-sigma of the innovation of each channel.
    pub sigma: Vec<f64>,
    /// Normalised innovation squared.
    pub nis: f64,
    /// Threshold of the gate on the NIS; infinite if the gate is off.
    pub threshold: f64,
}

impl Merge for Innovation {
    /// Keeps the first row, a choice that does not depend on the value and so introduces no bias.
    fn merge(&mut self, _: Self) {}
}

/// Sums over several accepted samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// Times of the first and the last sample, s.
    pub span: [f64; 2],
    /// Sum of the normalised innovation squared.
    pub nis: f64,
    /// Sum of the degrees of freedom, the expectation of `nis`.
    pub expected: f64,
}

impl Merge for Consistency {
    fn merge(&mut self, next: Self) {
        self.span[1] = next.span[1];
        self.nis += next.nis;
        self.expected += next.expected;
    }
}

impl SensorHistory {
    /// Returns `true` for a measuring sensor with samples.
    pub fn measures(&self) -> bool {
        self.purpose != Some(Purpose::Input) && self.updates != Updates::default()
    }
}
