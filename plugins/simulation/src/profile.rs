//! Profile of a quantity over a phase: a smooth step to a new value, a smooth bump and back, or
//! both.

/// The two shapes and their derivatives at one place `x` of a phase, `0 <= x <= 1`.
///
/// - step `S = x^4 (35 - 84 x + 70 x^2 - 20 x^3)`: from 0 to 1, its first three derivatives zero at
///   both ends;
/// - bump `B = 64 x^3 (1 - x)^3`, which is `S'` scaled to a peak of 1: its first two derivatives
///   are zero at both ends, where those of `sin^2` are not.
///
/// Joined end to end they are twice continuously differentiable, and so are a velocity and an
/// attitude made of them: the specific force and the angular rate have a continuous derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shape {
    step: f64,
    step_rate: f64,
    bump: f64,
    bump_rate: f64,
}

/// The mean of the bump over its phase: `64 / 140`.
pub(crate) const BUMP_MEAN: f64 = 16.0 / 35.0;

impl Shape {
    /// The shapes at `x`, and their derivatives by time where `x` runs at `x_rate` (1/s).
    #[inline]
    pub(crate) fn at(x: f64, x_rate: f64) -> Self {
        let q = x * (1.0 - x);
        let (q2, x2) = (q * q, x * x);
        let q3 = q2 * q;
        Self {
            step: x2 * x2 * (35.0 - 84.0 * x + 70.0 * x2 - 20.0 * x2 * x),
            step_rate: 140.0 * q3 * x_rate,
            bump: 64.0 * q3,
            bump_rate: 192.0 * q2 * (1.0 - 2.0 * x) * x_rate,
        }
    }
}

/// One quantity through a phase: `start + step S + bump B`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Profile {
    /// The value at the start.
    pub start: f64,
    /// The change from the start to the end.
    pub step: f64,
    /// The peak, in the middle, of what comes and goes.
    pub bump: f64,
}

impl Profile {
    /// A quantity that stays.
    pub(crate) const fn constant(start: f64) -> Self {
        Self { start, step: 0.0, bump: 0.0 }
    }

    /// Its value.
    #[inline]
    pub(crate) fn value(&self, shape: &Shape) -> f64 {
        self.start + self.step * shape.step + self.bump * shape.bump
    }

    /// Its derivative by time.
    #[inline]
    pub(crate) fn rate(&self, shape: &Shape) -> f64 {
        self.step * shape.step_rate + self.bump * shape.bump_rate
    }

    /// Its value at the end of the phase.
    pub(crate) fn end(&self) -> f64 {
        self.start + self.step
    }

    /// Returns `true` if the quantity is constant.
    pub(crate) fn is_constant(&self) -> bool {
        self.step == 0.0 && self.bump == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Value and rate of a unit step and a unit bump.
    fn unit(x: f64) -> [(f64, f64); 2] {
        let shape = Shape::at(x, 1.0);
        [Profile { step: 1.0, ..Profile::default() }, Profile { bump: 1.0, ..Profile::default() }]
            .map(|p| (p.value(&shape), p.rate(&shape)))
    }

    #[test]
    fn the_rates_are_the_derivatives() {
        let d = 1e-5;
        for x in (1..100).map(|i| f64::from(i) / 100.0) {
            let (before, here, after) = (unit(x - d), unit(x), unit(x + d));
            for i in 0..2 {
                // Central difference: third derivatives reach 384 (the bump's, at its ends): 384
                // d^2 / 6 = 6.4e-9.
                let rate = (after[i].0 - before[i].0) / (2.0 * d);
                assert!((rate - here[i].1).abs() < 7e-9, "{x} {i}: {rate} {}", here[i].1);
            }
        }
    }

    #[test]
    fn step_and_bump_leave_and_arrive_with_no_first_or_second_derivative() {
        assert_eq!(unit(0.0), [(0.0, 0.0), (0.0, 0.0)]);
        assert_eq!(unit(1.0), [(1.0, 0.0), (0.0, 0.0)]);
        assert_eq!(unit(0.5)[1], (1.0, 0.0));
        // The second derivative one d inside either end: 420 d^2 of the step and 384 d of the bump.
        let d = 1e-6;
        for end in [0.0, 1.0 - d] {
            for (i, bound) in [(0, 420.0 * d * d), (1, 384.0 * d)] {
                let second = (unit(end + d)[i].1 - unit(end)[i].1) / d;
                assert!(second.abs() <= 1.001 * bound, "{end} {i}: {second}");
            }
        }
    }

    #[test]
    fn the_mean_of_the_bump_is_16_of_35() {
        // Simpson's rule with n intervals: f'''' (23 040 at most) / (180 n^4) = 1.3e-14.
        let n = 10_000;
        let sum: f64 = (0..=n)
            .map(|i| {
                let weight = if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                weight * unit(f64::from(i) / f64::from(n))[1].0
            })
            .sum();
        assert!((sum / f64::from(3 * n) - BUMP_MEAN).abs() < 1e-13);
    }
}
