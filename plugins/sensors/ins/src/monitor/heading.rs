//! Rule: the heading is known well enough for the way made.
//!
//! A heading error `e` turns the way `r` that the filter has made with it: across by `r e`, and back
//! along it by `r e^2 / 2`. The filter neglects the second, since it is of second order. The mean of it is
//! compared with the sigma of the position along the way:
//! ```text
//! r = |d|,   d = P_pe / P_ee       d: change of the horizontal position with the heading
//! q = r P_ee / 2 / sqrt(u' P_pp u) u: horizontal, perpendicular to d
//! ```
//! `P_pe` has only the way since the last fix of the position, and only the heading error that is left.

use super::fault::Fault;
use crate::navigation::Navigation;
use nalgebra::{Matrix2, Vector2};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};
use navfuse_core::units::time::{Span, Time};

/// Time between two comparisons, and the number of them in a row that count: the first fixes of an
/// alignment in motion reduce a wide heading within seconds.
const PERIOD: Span = Span::from_nanos(1_000_000_000);
const COUNT: u32 = 10;
/// Ratio from which a result is doubtful, and from which it is useless.
const DOUBTFUL: f64 = 0.5;
const USELESS: f64 = 3.0;

/// Comparison of the heading with the position along the way.
#[derive(Clone)]
pub(super) struct Heading {
    navigation: Navigation,
    /// Time of the next comparison.
    next: Time,
    /// Comparisons in a row that were doubtful, and useless.
    doubtful: u32,
    useless: u32,
    severity: Option<Severity>,
}

saved!(Heading { next, doubtful, useless, severity } except { navigation });

impl Heading {
    pub(super) fn new(navigation: Navigation) -> Self {
        Self { navigation, next: Time::MIN, doubtful: 0, useless: 0, severity: None }
    }

    #[inline]
    pub(super) fn take(&mut self, filter: &FilterView<'_>, time: Time) -> Option<Fault> {
        if time < self.next {
            return None;
        }
        self.next = time + PERIOD;
        let n = &self.navigation;
        let tangent = |slot: usize| filter.layout.blocks[slot].tangent;
        let (heading, position) = (tangent(n.attitude.slot())? + 2, tangent(n.position.slot())?);
        let p = |i, j| filter.covariance.get(i, j);
        let squared = p(heading, heading);
        let d = Vector2::from_fn(|i, _| p(position + i, heading)) / squared;
        let way = d.norm();
        let along = Vector2::new(d.y, -d.x) / way;
        let variance = along.dot(&(Matrix2::from_fn(|i, j| p(position + i, position + j)) * along));
        let ratio = 0.5 * way * squared / variance.sqrt();
        let count = |limit: f64, before: u32| if ratio >= limit { before + 1 } else { 0 };
        self.doubtful = count(DOUBTFUL, self.doubtful);
        self.useless = count(USELESS, self.useless);
        let severity = match () {
            () if self.useless >= COUNT => Severity::DoNotUse,
            () if self.doubtful >= COUNT => Severity::Doubtful,
            () => return None,
        };
        if self.severity >= Some(severity) {
            return None;
        }
        self.severity = Some(severity);
        Some(Fault {
            severity,
            basis: Basis::Comparison,
            text: format!(
                "the heading is known to {:.1} deg, and {way:.0} m were made with it, while the position \
                 along them is known to {:.2} m: the part of the way that the filter neglects for such \
                 a heading is {ratio:.1} times as large, so that the position is off by more than its \
                 sigma",
                squared.sqrt().to_degrees(),
                variance.sqrt(),
            ),
            remedy:
                "give the heading a better initial value with a smaller sigma, let an alignment \
                     find it ([process.NAME.alignment]), or add a sensor that observes it"
                    .to_owned(),
        })
    }
}
