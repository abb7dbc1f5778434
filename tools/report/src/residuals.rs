//! Sums of the innovations of a channel, for their distribution and their correlation.

use crate::bar::{ALPHA, Bar};
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::VecDeque;

/// Right edge of the histogram, sigma; the outer bars hold everything beyond.
pub(crate) const EDGE: f64 = 5.0;
/// Bars of the histogram, half a sigma wide.
pub(crate) const BARS: usize = 20;
/// Fewest innovations that a figure shows something of.
const FEWEST: u64 = 50;
/// Largest lag of the autocorrelation, samples.
pub(crate) const LAGS: usize = 32;

/// Innovations of a channel over their sigma, those that the gate refused included: a consistent
/// filter has independent ones of unit variance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residuals {
    pub(crate) count: u64,
    pub(crate) bars: [u64; BARS],
    /// Sum of the squares.
    pub(crate) squares: f64,
    /// Sums of the products of two values `lag + 1` apart.
    pub(crate) products: [f64; LAGS],
    /// The last values, the newest first.
    last: VecDeque<f64>,
}

impl Residuals {
    /// Returns `true` where there are enough innovations for a figure.
    pub fn suffice(&self) -> bool {
        self.count >= FEWEST
    }

    /// Returns the bars of the histogram beside the normal distribution.
    pub fn distribution(&self) -> impl Iterator<Item = Bar> + '_ {
        let normal = Normal::standard();
        // the outer bars hold everything beyond
        let below = move |edge: usize| match edge {
            0 => 0.0,
            BARS => 1.0,
            _ => normal.cdf(place(edge)),
        };
        self.bars.iter().enumerate().map(move |(bar, seen)| Bar {
            edges: [place(bar), place(bar + 1)],
            seen: *seen,
            probability: below(bar + 1) - below(bar),
        })
    }

    /// Returns the number of innovations.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the autocorrelation at the lags of one sample and more.
    pub fn autocorrelation(&self) -> impl Iterator<Item = f64> + '_ {
        self.products.iter().map(|sum| sum / self.squares)
    }

    /// Returns the half width of the band of 95 % around the autocorrelation of independent innovations.
    pub fn band(&self) -> f64 {
        -Normal::standard().inverse_cdf(0.5 * ALPHA) / (self.count as f64).sqrt()
    }

    /// Adds an innovation over its sigma; one that is not finite is left out.
    pub fn push(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        self.count += 1;
        let place = (value + EDGE) * BARS as f64 / (2.0 * EDGE);
        self.bars[place.clamp(0.0, (BARS - 1) as f64) as usize] += 1;
        // one wild value would hide the correlation of all others
        let value = value.clamp(-EDGE, EDGE);
        self.squares += value * value;
        self.products.iter_mut().zip(&self.last).for_each(|(sum, before)| *sum += value * before);
        self.last.truncate(LAGS - 1);
        self.last.push_front(value);
    }
}

/// Left edge of a bar, sigma.
fn place(bar: usize) -> f64 {
    2.0 * EDGE * bar as f64 / BARS as f64 - EDGE
}
