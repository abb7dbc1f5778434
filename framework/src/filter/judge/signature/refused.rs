//! What an offset explains of the samples that the gate refused.

use super::effect::{OFFSETS, SUMS, Whitened};
use super::lanes::Seen;
use super::score::Score;
use crate::checkpoint::saved;
use crate::filter::judge::lockout::GONE;
use crate::state::covariance::forward;
use crate::units::sample::MAX_CHANNELS;

/// Share of the samples up to which they may be outliers.
pub(super) const OUTLIERS: f64 = 0.1;

/// What the gate refused of a sensor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gated {
    /// Samples, those of them that were refused, and `sum y' S^-1 y` of these.
    all: f64,
    count: f64,
    squares: f64,
}

saved!(Gated { all, count, squares });

impl Gated {
    pub(super) fn take(&mut self, sample: &Whitened<'_>) {
        self.all += 1.0;
        if !sample.used {
            let products = sample.update.innovation.iter().zip(&sample.y);
            self.squares += sample.weight * products.map(|(y, white)| y * white).sum::<f64>();
            self.count += 1.0;
        }
    }

    /// Returns `true` if the gate used outliers alone.
    pub(super) fn nearly_all(&self) -> bool {
        self.all - self.count <= OUTLIERS * self.all
    }

    /// Returns `true` if an error with that score by all samples, and that by the used ones, explains
    /// three quarters of the squares, or the refused samples are few.
    pub(super) fn explained(&self, all: &Score, used: &Score) -> bool {
        let Self { all: samples, count, squares } = *self;
        let by = all.sigmas().powi(2) - used.sigmas().powi(2);
        count <= OUTLIERS * samples || squares - by <= GONE * squares
    }
}

/// Samples of the sensor since a hypothesis began, and those of them that the gate refused.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    all: f64,
    count: f64,
    /// `sum y' S^-1 y`, `sum g' S^-1 y` and `sum g' S^-1 g`.
    yy: f64,
    gy: f64,
    gg: f64,
    /// Sums of the information `w` of the samples, and of `w^2 / dt`.
    known: f64,
    squares: f64,
}

saved!(Sums { all, count, yy, gy, gg, known, squares });

/// Samples by hypothesis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Refused {
    sums: [Sums; SUMS],
}

saved!(Refused { sums });

impl Refused {
    /// Takes a sample, to which the hypotheses have these sensitivities, with its information on an offset
    /// and the time since the sample before.
    pub(super) fn take(
        &mut self,
        sample: &Whitened<'_>,
        g: &Seen<OFFSETS>,
        (information, duration): (f64, f64),
    ) {
        let square = if duration > 0.0 { information * information / duration } else { 0.0 };
        for sums in &mut self.sums {
            sums.all += 1.0;
            sums.known += if duration > 0.0 { information } else { 0.0 };
            sums.squares += square;
        }
        if sample.used {
            return;
        }
        let (m, w) = (sample.update.m, sample.weight);
        let products = sample.update.innovation.iter().zip(&sample.y);
        let yy = w * products.map(|(y, white)| y * white).sum::<f64>();
        for (k, sums) in self.sums.iter_mut().enumerate() {
            let mut own = [0.0; MAX_CHANNELS];
            own.iter_mut().zip(g).for_each(|(own, g)| *own = f64::from(g[k]));
            sums.count += 1.0;
            sums.yy += yy;
            sums.gy += w * own.iter().zip(&sample.y).map(|(g, y)| g * y).sum::<f64>();
            forward(sample.lower, m, &mut own[..m]);
            sums.gg += w * own[..m].iter().map(|g| g * g).sum::<f64>();
        }
    }

    /// Time for which a hypothesis has seen the slope, s: samples of equal information count in full, and one
    /// that has all of it counts alone.
    pub(super) fn seen(&self, sum: usize) -> f64 {
        let Sums { known, squares, .. } = self.sums[sum];
        if squares > 0.0 { known * known / squares } else { 0.0 }
    }

    /// Begins one hypothesis again.
    pub(super) fn renew(&mut self, sum: usize) {
        self.sums[sum] = Sums::default();
    }

    /// Returns `true` if an offset of the size `a` explains the samples, or they are few.
    pub(super) fn explained(&self, sum: usize, a: f64) -> bool {
        let Sums { all, count, yy, gy, gg, .. } = self.sums[sum];
        let left = yy - 2.0 * a * gy + a * a * gg;
        count <= OUTLIERS * all || left <= GONE * yy
    }

    /// Returns `true` if the gate, which is about to refuse one more sample, refuses more than a third of
    /// those since the first hypothesis began.
    pub(super) fn contradicts(&self) -> bool {
        let Sums { all, count, .. } = self.sums[0];
        3.0 * (count + 1.0) > all
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Jacobian;
    use super::*;
    use crate::state::covariance::Update;

    fn seen(information: impl Fn(usize) -> f64) -> f64 {
        let update = Update::with_capacity(1, 1);
        let y = [0.0; MAX_CHANNELS];
        let sample = Whitened {
            update: &update,
            lower: &[],
            gain: &[],
            jacobian: &Jacobian::default(),
            y,
            weight: 1.0,
            used: true,
        };
        let mut refused = Refused::default();
        let g = [[0.0; OFFSETS]; MAX_CHANNELS];
        (0..40).for_each(|k| refused.take(&sample, &g, (information(k), 0.2)));
        refused.seen(0)
    }

    /// 40 samples every 0.2 s while the vehicle keeps its acceleration, and a vehicle that accelerates in the last
    /// five of them.
    #[test]
    fn a_slope_is_seen_for_as_long_as_it_lasts() {
        assert!((seen(|_| 3.0) - 8.0).abs() < 1e-9);
        assert!((seen(|k| if k < 35 { 0.0 } else { 3.0 }) - 1.0).abs() < 1e-9);
        assert_eq!(seen(|_| 0.0), 0.0);
    }
}
