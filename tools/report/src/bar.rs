//! Bars of a histogram.

/// Probability outside a band.
pub(crate) const ALPHA: f64 = 0.05;

/// Bar of a histogram.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// Its edges.
    pub edges: [f64; 2],
    /// Number of values in it.
    pub seen: u64,
    /// Probability of a value in it.
    pub probability: f64,
}
