//! Histogram of the NEES of all runs, beside the chi-square distribution that a consistent filter
//! has.

use crate::bar::Bar;
use crate::histogram::histogram;
use navfuse_figures::{Axis, Figure};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Smallest number of runs that a histogram shows something of.
const FEWEST: usize = 20;
/// Probability below the right edge.
const COVERED: f64 = 0.9999;

/// Plots the NEES of the whole state, of `dimension` components, at the end of each run, and returns
/// the number of runs beyond the right edge. `None` with too few runs.
pub fn histogram_of(dimension: usize, values: &[f64]) -> Option<(Figure, usize)> {
    let chi = ChiSquared::new(dimension as f64).ok()?;
    if values.len() < FEWEST {
        return None;
    }
    let edge = chi.inverse_cdf(COVERED);
    // the square-root rule: bars wide enough to hold runs, narrow enough to show the shape
    let count = (values.len() as f64).sqrt().ceil().clamp(8.0, 40.0) as usize;
    let place = |bar: usize| edge * bar as f64 / count as f64;
    let bars = (0..count).map(|bar| {
        let edges = [place(bar), place(bar + 1)];
        let [low, high] = edges;
        let seen = values.iter().filter(|v| (low..high).contains(*v)).count() as u64;
        Bar { edges, seen, probability: chi.cdf(high) - chi.cdf(low) }
    });
    let x = Axis::linear("NEES of the whole state at the end");
    let panel = histogram("", x, ("runs", values.len() as u64), bars);
    let figure =
        Figure { name: "nees".into(), title: String::new(), columns: 1, panels: vec![panel] };
    Some((figure, values.iter().filter(|v| **v >= edge).count()))
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use navfuse_figures::Curve;

    /// Heights of the bars of a curve, each of which has two points.
    fn heights(curve: &Curve) -> Vec<f64> {
        curve.points.iter().step_by(2).map(|[_, height]| *height).collect()
    }

    #[test]
    fn quantiles_of_chi_square_fill_the_bars_as_expected_and_an_outlier_lies_beyond_the_edge() {
        let chi = ChiSquared::new(19.0).expect("19 degrees of freedom");
        let mut values: Vec<f64> =
            (0..400).map(|k| chi.inverse_cdf((f64::from(k) + 0.5) / 400.0)).collect();
        values.push(127_044.2);
        let (figure, beyond) = histogram_of(19, &values).expect("enough runs");
        let panel = &figure.panels[0];
        let [expected, runs] = [heights(&panel.curves[0]), heights(&panel.curves[1])];
        assert_eq!((runs.iter().sum::<f64>(), beyond), (400.0, 1));
        // quantiles at the middles of 400 equal shares: an edge of a bar cuts at most one share
        for ((seen, mean), [_, low, high]) in
            runs.iter().zip(&expected).zip(panel.bands[0].points.iter().step_by(2))
        {
            assert!((seen - mean).abs() < 2.1, "{seen} of {mean}");
            assert!(low <= seen && seen <= high, "{seen} outside {low} to {high}");
        }
    }

    #[test]
    fn a_handful_of_runs_has_no_histogram() {
        assert!(histogram_of(3, &[3.0; FEWEST - 1]).is_none());
        assert!(histogram_of(0, &[3.0; FEWEST]).is_none());
    }
}
