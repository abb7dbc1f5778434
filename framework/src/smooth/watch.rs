//! The times at which a filter linearises its samples again because of the products of errors that
//! its processes neglect.
//!
//! At rest, a tilt of 1 deg and a gyro bias of 0.1 deg/s make a rate of 6 deg/h in navigation axes,
//! which is not in the linear model, and which looks like the rotation of the Earth. The filter takes
//! it for information about the heading. Linearised at their smoothed trajectory, the same samples
//! have no such product.

use crate::compose::Composition;
use crate::compose::estimator::Linearised;
use crate::model::process::Product;
use crate::units::time::Span;

/// Longest time after the start whose samples are taken again: it bounds the cost of a pass.
pub(super) const LONGEST: Span = Span::from_nanos(1_800_000_000_000);

/// Time from the start to the first passes.
pub(super) const FIRST: Span = Span::from_nanos(10_000_000_000);

/// Part of its value after the last passes to which the weight falls before the next ones: the
/// samples that reduce it, such as of the beginning of a drive, determine what the products hid.
const FALL: f64 = 0.5;

/// What follows from the weight of the products.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Due {
    /// Nothing yet.
    Nothing,
    /// Passes over all samples since the start.
    Passes,
    /// The products will not matter any more.
    End,
}

/// Weight of the products after the last passes; `None` before the first ones.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Watch {
    last: Option<f64>,
}

impl Watch {
    /// Decides at a weight of the products, `time` seconds after the start; `planned` if so much time
    /// has passed that new passes may be due. Before the first passes the covariance is honest, since the
    /// products have not mattered yet. Later it is honest only after passes.
    pub(super) fn due(self, weight: f64, time: f64, planned: bool) -> Due {
        match self.last {
            Some(last) if planned || weight < FALL * last => Due::Passes,
            None if planned && Product::matters(weight, time) => Due::Passes,
            None if planned && !matters_later(weight) => Due::End,
            _ => Due::Nothing,
        }
    }

    /// Notes the weight after passes. Returns `true` if the products will not matter any more, nor once the
    /// vehicle moves, with that weight then: a heading that is known to some degrees at rest is
    /// determined by the first metres of a drive, which turn with it.
    pub(super) fn made(&mut self, weight: f64, moving: f64) -> bool {
        self.last = Some(weight);
        !matters_later(weight.max(moving))
    }

    /// Returns `true` if passes at that time change the estimate.
    pub(super) fn matters(self, weight: f64, time: f64) -> bool {
        self.last.is_some() || Product::matters(weight, time)
    }
}

/// Returns `true` if products of that weight matter within the longest time.
fn matters_later(weight: f64) -> bool {
    Product::matters(weight, LONGEST.seconds())
}

/// Largest weight of the products of all processes.
fn largest(composition: &Composition, weight: impl Fn(&Product) -> f64) -> f64 {
    let products = composition.processes.iter().filter_map(|process| process.product.as_ref());
    products.map(weight).fold(0.0, f64::max)
}

/// Weight of the products at the covariance of a filter.
pub(super) fn weight(filter: &dyn Linearised) -> f64 {
    let variance = |i: usize| filter.propagated().get(i, i);
    largest(filter.composition(), |product| product.weight(variance))
}

/// The same once the vehicle moves.
pub(super) fn weight_moving(filter: &dyn Linearised) -> f64 {
    let variance = |i: usize| filter.propagated().get(i, i);
    largest(filter.composition(), |product| product.weight_moving(variance))
}

/// Returns `true` if the products that the processes neglect matter at the priors.
pub(crate) fn products_matter(composition: &Composition) -> bool {
    let blocks = &composition.layout.blocks;
    let variance = |i: usize| {
        let block = blocks.iter().find(|block| block.tangent_range().contains(&i));
        block.map_or(0.0, |block| block.spec.sigma[i - block.tangent_range().start].powi(2))
    };
    matters_later(largest(composition, |product| product.weight(variance)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 1800 s on a weight of 0.0059 matters: `0.25 / sqrt(1800)`.
    #[test]
    fn passes_are_due_once_the_products_matter_and_then_until_they_will_not() {
        let before = Watch::default();
        assert_eq!(before.due(0.2, 4.0, false), Due::Nothing);
        assert_eq!(before.due(0.2, 4.0, true), Due::Passes);
        assert_eq!(before.due(0.1, 4.0, true), Due::Nothing, "they matter later");
        assert_eq!(before.due(0.0058, 4.0, true), Due::End);
        let mut watch = before;
        assert!(!watch.made(0.1, 0.1));
        assert_eq!(watch.due(0.051, 5.0, false), Due::Nothing);
        assert_eq!(watch.due(0.049, 5.0, false), Due::Passes);
        assert_eq!(watch.due(0.001, 5.0, true), Due::Passes, "only passes make it honest");
        assert!(!watch.made(0.0058, 0.1), "the heading is wide");
        assert!(watch.made(0.0058, 0.0058));
    }
}
