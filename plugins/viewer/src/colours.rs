//! A scale of colours for a positive quantity: dark blue is small, yellow is large. It is readable
//! without colour vision, since brightness grows with it.

use crate::style::Colour;

/// Number of colours: so many steps are distinguished, and a track has few pieces.
pub const STEPS: usize = 12;

/// Anchors of the scale (viridis, without its darkest end, which a dark ground would swallow).
const ANCHORS: [Colour; 5] =
    [[72, 82, 160], [44, 128, 150], [40, 170, 130], [130, 205, 80], [253, 231, 37]];

/// The colour at a place of the scale between 0 and 1.
pub fn at(place: f64) -> Colour {
    let last = ANCHORS.len() - 1;
    let place = place.clamp(0.0, 1.0) * last as f64;
    let k = (place as usize).min(last - 1);
    let part = place - k as f64;
    std::array::from_fn(|c| {
        let [a, b] = [ANCHORS[k][c], ANCHORS[k + 1][c]].map(f64::from);
        (a + part * (b - a)).round() as u8
    })
}

/// Share of the largest values that are beyond the scale: a wide prior in the first seconds would leave the
/// rest of a run one colour.
const BEYOND: f64 = 0.01;

/// Logarithmic scale over the values of a run.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    low: f64,
    high: f64,
    /// Set where some values are larger than the scale.
    pub beyond: bool,
}

impl ColourScale {
    /// The scale over positive values; others do not count.
    pub fn over(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|v| v.is_finite() && *v > 0.0).collect();
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1);
        let high = last - (BEYOND * values.len() as f64) as usize;
        match (values.first(), values.get(high), values.last()) {
            (Some(low), Some(high), Some(largest)) => {
                Self { low: *low, high: *high, beyond: high < largest }
            }
            _ => Self { low: 1.0, high: 1.0, beyond: false },
        }
    }

    /// The step of a value.
    pub fn step(&self, value: f64) -> usize {
        let span = (self.high / self.low).ln();
        if span < 1e-6 || value.is_nan() || value <= self.low {
            return 0;
        }
        (((value / self.low).ln() / span * STEPS as f64) as usize).min(STEPS - 1)
    }

    /// The colour of a step.
    pub fn colour(step: usize) -> Colour {
        at(step as f64 / (STEPS - 1) as f64)
    }

    /// The smallest, the middle and the largest value with their colours.
    pub fn legend(&self) -> [(f64, Colour); 3] {
        let middle = (self.low * self.high).sqrt();
        [(self.low, at(0.0)), (middle, at(0.5)), (self.high, at(1.0))]
    }

    /// Pieces of a line with one colour each; neighbours share a point.
    pub fn pieces<P: Copy>(&self, points: impl Iterator<Item = (P, f64)>) -> Vec<(Colour, Vec<P>)> {
        let mut pieces: Vec<(usize, Vec<P>)> = Vec::new();
        let mut before = None;
        for (point, value) in points {
            let step = self.step(value);
            match pieces.last_mut() {
                Some((last, piece)) if *last == step => piece.push(point),
                _ => pieces.push((step, before.into_iter().chain([point]).collect())),
            }
            before = Some(point);
        }
        pieces.retain(|p| p.1.len() > 1);
        pieces.into_iter().map(|(step, piece)| (Self::colour(step), piece)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sigma of a prior lasts 5 of 1000 s, and that of an outage 50.
    #[test]
    fn a_wide_prior_does_not_take_the_colours_of_the_run() {
        let run = |wide: usize| {
            let sigmas =
                (0..1000).map(move |k| if k < wide { 14.0 } else { 1.0 + 0.001 * k as f64 });
            ColourScale::over(sigmas)
        };
        let [prior, outage] = [5, 50].map(run);
        assert!(prior.beyond && (prior.legend()[2].0 - 2.0).abs() < 0.01, "{prior:?}");
        assert_eq!((prior.step(14.0), prior.step(1.995)), (STEPS - 1, STEPS - 1));
        assert!(!outage.beyond && outage.legend()[2].0 == 14.0, "{outage:?}");
    }

    #[test]
    fn the_pieces_of_a_line_follow_its_values_and_share_their_ends() {
        let values = [1.0, 1.0, 10.0, 100.0, 100.0];
        let scale = ColourScale::over(values.into_iter());
        let pieces = scale.pieces(values.into_iter().enumerate());
        assert_eq!(
            pieces.iter().map(|p| p.1.clone()).collect::<Vec<_>>(),
            [vec![0, 1], vec![1, 2], vec![2, 3, 4]]
        );
        assert_eq!((pieces[0].0, pieces[2].0), (at(0.0), at(1.0)));
        let one =
            ColourScale::over([2.0, 2.0].into_iter()).pieces([(0, 2.0), (1, 2.0)].into_iter());
        assert_eq!(one.len(), 1);
    }
}
