//! Warning where the linearisation of a sensor is not valid within the uncertainty.
//!
//! The part of `h` that a linearised update neglects has, for a Gaussian error, the mean and the
//! variance
//! ```text
//! b = sum_i q_ii / 2,    V = sum_ij q_ij^2 / 2
//! ```
//! with the second derivatives `q_ij` of [`super::points`]. The update trusts the sample to its
//! noise `R`, so that
//! ```text
//! c = sqrt((b^2 + V) / R)
//! ```
//! compares the neglected part with the uncertainty that remains. It is the curvature of Bates &
//! Watts (J. R. Statist. Soc. B 42, 1980) over one sigma. The check runs at samples 1, 2, 4, ... 256
//! of a sensor, at every 256th sample after these, and where the variances of the states that it
//! reads have grown so much that the last `c` would reach the bound. A first update that determines
//! the states in which the model is curved does no harm; two checks in a row give a finding.

use super::points::{SigmaPoints, place};
use crate::model::finding::{Basis, Finding, Severity};
use crate::model::measurement::{AnyMeasurement, At};
use crate::model::sensor::SensorInfo;
use crate::state::Layout;
use crate::state::covariance::{Covariance, Update};
use crate::units::time::Time;

/// Ratio `c` from which the linearisation is doubtful.
const DOUBTFUL: f64 = 3.0;

/// Ratio `c` from which a result must not be used.
const TOO_CURVED: f64 = 10.0;

/// Number of checks in a row that give a finding: a single update may determine the states in which
/// the model is curved.
const IN_A_ROW: u32 = 2;

/// Largest number of samples between two checks. A check costs as much as a hundred updates.
const PERIOD: u32 = 256;

/// Check of one sensor.
#[derive(Clone, Default)]
pub(super) struct Curvature {
    seen: u32,
    /// Columns that the model read at the last check, and their variances.
    columns: Vec<usize>,
    variances: Vec<f64>,
    ratio: f64,
    /// Number of checks in a row that found too large a curvature.
    curved: u32,
}

/// A model that is curved within the uncertainty.
#[derive(Clone, Copy)]
pub(super) struct Curved {
    ratio: f64,
    channel: usize,
    /// Columns of the largest second derivative.
    columns: [usize; 2],
}

impl Curvature {
    /// Takes an accepted sample, and returns `true` if a check is due.
    pub(super) fn is_due(&mut self, update: &Update, covariance: &Covariance) -> bool {
        self.seen = self.seen.saturating_add(1);
        if self.seen.is_multiple_of(PERIOD) || (self.seen < PERIOD && self.seen.is_power_of_two()) {
            return true;
        }
        if self.curved == 1 || (self.curved == 0 && self.columns != update.columns) {
            return true;
        }
        // second derivatives over sigma grow with the variance
        let growth = self.columns.iter().zip(&self.variances);
        let growth =
            growth.map(|(&c, before)| covariance.get(c, c) / before.max(f64::MIN_POSITIVE));
        self.curved == 0 && self.ratio * growth.fold(0.0, f64::max) > DOUBTFUL
    }

    /// Checks a model at a state, and returns the curvature where it begins to be too large.
    pub(super) fn check(
        &mut self,
        points: &mut SigmaPoints,
        at: &At<'_>,
        model: &dyn AnyMeasurement,
        covariance: &Covariance,
        update: &Update,
    ) -> Option<Curved> {
        points.evaluate(at, model, &update.columns, covariance);
        let (m, w) = (update.m, update.columns.len());
        let present = (0..model.channels()).filter(|&c| at.sample.get(c).is_some());
        let mut worst = Curved { ratio: 0.0, channel: 0, columns: [0; 2] };
        for (a, channel) in present.enumerate().take(m) {
            let (mut mean, mut variance, mut largest) = (0.0, 0.0, (0.0, [0; 2]));
            for i in 0..w {
                for j in 0..=i {
                    let q = points.seconds[place(i, j)][channel];
                    mean += if i == j { 0.5 * q } else { 0.0 };
                    variance += if i == j { 0.5 } else { 1.0 } * q * q;
                    if q.abs() > largest.0 {
                        largest = (q.abs(), [update.columns[i], update.columns[j]]);
                    }
                }
            }
            let ratio = ((mean * mean + variance) / update.r[a * m + a]).sqrt();
            if ratio > worst.ratio {
                worst = Curved { ratio, channel, columns: largest.1 };
            }
        }
        self.ratio = worst.ratio;
        self.columns.clone_from(&update.columns);
        self.variances.clear();
        self.variances.extend(update.columns.iter().map(|&c| covariance.get(c, c)));
        self.curved = if worst.ratio >= DOUBTFUL { self.curved.saturating_add(1) } else { 0 };
        (self.curved == IN_A_ROW).then_some(worst)
    }
}

impl Curved {
    /// Finding about the sensor, with the names of the states in which it is curved.
    pub(super) fn finding(&self, time: Time, sensor: &SensorInfo, layout: &Layout) -> Finding {
        let of = |column: usize| {
            let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&column));
            block.map_or("?", |block| block.name.as_str())
        };
        let [first, second] = self.columns.map(of);
        let blocks =
            if first == second { first.to_owned() } else { format!("{second} and {first}") };
        let channel = sensor.channels.get(self.channel).map_or("?", |c| c.name);
        let severity =
            if self.ratio >= TOO_CURVED { Severity::DoNotUse } else { Severity::Doubtful };
        Finding {
            time,
            about: sensor.name.clone(),
            severity,
            basis: Basis::Comparison,
            text: format!(
                "the linearisation is not valid within the uncertainty of {blocks}: the \
                 second-order term of {channel} is {:.1} times its noise, and the update neglects it",
                self.ratio
            ),
            remedy: format!(
                "give [sensor.{}] update = \"ukf\", or the state a better initial value with a \
                 smaller sigma",
                sensor.name
            ),
        }
    }
}
