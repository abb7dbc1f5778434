//! A histogram beside the distribution that a consistent filter has.

use crate::bar::{ALPHA, Bar};
use crate::plots::curve;
use navfuse_figures::{Axis, Band, Look, Panel};
use statrs::distribution::{Binomial, DiscreteCDF};

/// Plots bars of `total` values `what`, with the expected number in each and its band.
pub(crate) fn histogram(
    title: &str,
    x: Axis,
    (what, total): (&str, u64),
    bars: impl Iterator<Item = Bar>,
) -> Panel {
    let (mut seen, mut expected, mut chance) = (Vec::new(), Vec::new(), Vec::new());
    for bar in bars {
        let counts = Binomial::new(bar.probability, total);
        let limit = |p: f64| counts.map_or(f64::NAN, |c| c.inverse_cdf(p) as f64);
        let [least, most] = [0.5 * ALPHA, 1.0 - 0.5 * ALPHA].map(limit);
        for edge in bar.edges {
            seen.push([edge, bar.seen as f64]);
            expected.push([edge, bar.probability * total as f64]);
            chance.push([edge, least, most]);
        }
    }
    Panel {
        title: title.into(),
        x,
        y: Axis::linear(what),
        curves: vec![
            curve("expected", Look::Bound, expected.into_iter()),
            curve("seen", Look::Data(0), seen.into_iter()),
        ],
        bands: vec![Band { name: "95 % band".into(), points: chance }],
    }
}
