//! Present status of a component: its uncertainty, the share of prior, and the verdict.

use crate::component::Determination;
use navfuse_core::units::time::Time;

/// Largest share of prior in a determined component: the estimate is four times better than the
/// prior, 2 bits.
pub const DETERMINED: f64 = 1.0 / 16.0;
/// Share of prior above which a component ceases to be determined; larger than [`DETERMINED`] as a
/// hysteresis.
pub const LOST: f64 = 1.0 / 8.0;
/// Largest share of prior in a component that is determined in part: the measurements weigh as much
/// as the prior.
pub const IN_PART: f64 = 0.5;

/// Present status of a component.
#[derive(Clone, Copy, Debug)]
pub struct ComponentStatus {
    /// Prior 1-sigma, in the unit of the component.
    pub prior: f64,
    /// 1-sigma without measurements, from the component's own dynamics.
    pub reference: f64,
    /// Present 1-sigma.
    pub sigma: f64,
    /// Share of the estimate that is still prior, 0 to 1: see [`crate::Tracker`].
    pub weight: f64,
    /// Determination.
    pub verdict: Determination,
    /// Time since which the component is determined.
    pub since: Option<Time>,
    /// Last time at which the component ceased to be determined.
    pub lost: Option<Time>,
}

impl ComponentStatus {
    /// Returns sigma divided by the sigma without measurements.
    pub fn normalised(&self) -> f64 {
        if self.reference > 0.0 { self.sigma / self.reference } else { 1.0 }
    }

    /// Returns the gained information in bits, the number of times sigma was halved; negative if
    /// sigma has grown.
    pub fn bits(&self) -> f64 {
        0.0 - self.normalised().log2()
    }

    /// Sets the sigmas and the share of prior at a time; returns `true` if the verdict changed.
    pub(crate) fn set(
        &mut self,
        time: Time,
        prior: f64,
        reference: f64,
        sigma: f64,
        weight: f64,
    ) -> bool {
        (self.prior, self.reference, self.sigma, self.weight) = (prior, reference, sigma, weight);
        if self.verdict == Determination::Considered {
            return false;
        }
        if self.weight <= DETERMINED {
            self.since.get_or_insert(time);
        } else if self.weight > LOST && self.since.take().is_some() {
            self.lost = Some(time);
        }
        let verdict = match (self.since, self.weight <= IN_PART) {
            (Some(_), _) => Determination::Determined,
            (None, true) => Determination::InPart,
            (None, false) => Determination::NotDetermined,
        };
        std::mem::replace(&mut self.verdict, verdict) != verdict
    }
}
