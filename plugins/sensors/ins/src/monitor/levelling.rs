//! Rule: the tilt is known well enough for the accelerometers.
//!
//! A tilt `e` turns gravity away from the vertical axis, on which `g e^2 / 2` is missing. The filter
//! neglects this, since it is of second order, and takes it for a bias of the accelerometers. The
//! mean of it is compared with the sigma of their vertical bias:
//! ```text
//! r = g (Pnn + Pee) / 2 / sqrt(d' Pb d)      d: down in body axes, Pb: covariance of the bias
//! ```

use super::fault::Fault;
use crate::earth::normal_gravity;
use crate::navigation::Navigation;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};
use navfuse_core::units::time::{Span, Time};

/// Time between two comparisons.
const PERIOD: Span = Span::from_nanos(1_000_000_000);
/// Ratio from which a result is doubtful, and from which it is useless: at 0.3 the errors of the bias
/// agree with their sigma, at 1.9 they are 1.5 times as large.
const DOUBTFUL: f64 = 0.5;
const USELESS: f64 = 3.0;
/// Share of the variance of the bias at the start below which the samples have determined it: before,
/// nothing has been taken for a bias.
const DETERMINED: f64 = 0.25;
/// Growth of the variance of the tilt above its least value that is no tilt of the start: the bridge
/// of a fault adds to it, for a short time and when the bias is known already.
const GROWN: f64 = 2.0;

/// Comparison of the tilt with the vertical bias of the accelerometers.
#[derive(Clone)]
pub(super) struct Levelling {
    navigation: Navigation,
    last: Option<Time>,
    /// Variance of the vertical bias at the start.
    first: f64,
    /// Least variance of the tilt so far.
    least: f64,
    aligned: bool,
    severity: Option<Severity>,
}

saved!(Levelling { last, first, least, severity } except { navigation, aligned });

impl Levelling {
    /// Creates the rule; it is off for initial values that an alignment finds.
    pub(super) fn new(navigation: Navigation, aligned: bool) -> Self {
        Self { navigation, last: None, first: 0.0, least: f64::INFINITY, aligned, severity: None }
    }

    #[inline]
    pub(super) fn take(&mut self, filter: &FilterView<'_>, time: Time) -> Option<Fault> {
        // linearised at the smoothed trajectory, the filter does not neglect this part of gravity
        if self.aligned || filter.smoothed || self.last.is_some_and(|last| time < last + PERIOD) {
            return None;
        }
        let n = &self.navigation;
        let tangent = |slot: usize| filter.layout.blocks[slot].tangent;
        let (tilt, bias) = (tangent(n.attitude.slot())?, tangent(n.accel_bias?.slot())?);
        let p = |i, j| filter.covariance.get(i, j);
        let c_b_n = filter.state.get(filter.layout, n.attitude);
        let down = c_b_n.inverse() * Vector3::z();
        let variance = down.dot(&(Matrix3::from_fn(|i, j| p(bias + i, bias + j)) * down));
        if self.last.replace(time).is_none() {
            self.first = variance;
        }
        let squared = p(tilt, tilt) + p(tilt + 1, tilt + 1);
        self.least = self.least.min(squared);
        let determined = variance > 0.0 && variance <= DETERMINED * self.first;
        if !determined || squared > GROWN * self.least {
            return None;
        }
        let at = filter.state.get(filter.layout, n.position);
        let neglected = 0.5 * normal_gravity(at.latitude, at.height) * squared;
        let ratio = neglected / variance.sqrt();
        let severity = match ratio {
            r if r >= USELESS => Severity::DoNotUse,
            r if r >= DOUBTFUL => Severity::Doubtful,
            _ => return None,
        };
        if self.severity.is_some_and(|before| before >= severity) {
            return None;
        }
        self.severity = Some(severity);
        Some(Fault {
            severity,
            basis: Basis::Comparison,
            text: format!(
                "the tilt is known to {:.2} deg, while the vertical bias of the accelerometers is \
                 known to {:.1} ug: the part of gravity that the filter neglects for such a tilt is \
                 {ratio:.1} times as large, so that the bias and what depends on it are off by more \
                 than their sigma",
                (0.5 * squared).sqrt().to_degrees(),
                variance.sqrt() / 9.80665e-6,
            ),
            remedy: "give roll and pitch a better initial value with a smaller sigma, or let an \
                     alignment at rest find them ([process.NAME.alignment])"
                .to_owned(),
        })
    }
}
