//! Second branch of a filter that follows a sensor, although nothing decides whether the sensor or the filter
//! was wrong.
//!
//! After a silence the samples of a sensor are off by `d`. Either the error of the filter grew beyond its
//! sigma, or channels of the sensor have an offset since then. The filter goes on with the first case. The
//! second one has the offset as a further state, which is separated from those of the filter (Friedland 1969):
//! its estimate is `x + B d` and its covariance `P + B M B'`, with
//! ```text
//! B := Phi B,        T = H B + D        D = 1 for the offset channels of the sensor's own samples
//! y ~ N(T d, S + T M T')                y ~ N(0, S) if the filter was wrong
//! B := B - K T,      d := d + G (y - T d),      M := (1 - G T) M,      G = M T' (S + T M T')^-1
//! ```
//! At the beginning `B = 0`, `d = y`, and `M = S` before the covariance is widened. The samples of every
//! sensor, used or refused, weigh the two cases. An offset may end: then `D = 0` explains the sensor's
//! samples. Meanwhile the filter reports the mixture about its own estimate, `P + w B (d d' + M) B'`, where
//! `w` is the probability of the second case. At 1000 : 1 one of the two ends.

use crate::checkpoint::saved;
use crate::model::record::{Event, Level};
use crate::model::sensor::Sensor;
use crate::state::covariance::{Covariance, Reach, Update};
use crate::units::time::Time;
use nalgebra::{DMatrix, DVector};

/// Logarithm of the odds at which a branch ends, 1000 : 1.
const DECIDED: f64 = 6.907_755_278_982_137;
/// Most that one sample adds to it, so that no single one decides: an outlier may fit either case.
const MOST: f64 = 5.0;
/// Logarithm of the probability that an offset ends at a sample.
const ENDS: f64 = -4.605_170_185_988_091;

/// The case that a sensor is wrong.
#[derive(Clone, Default)]
pub(in crate::filter) struct Branch {
    pub(super) sensor: usize,
    pub(super) since: Time,
    /// `B`, with a column for each channel that may be offset.
    pub(in crate::filter) effect: Reach,
    /// `d`, and `M` by row and column.
    offset: Vec<f64>,
    variance: Vec<f64>,
    /// Set once the offset has ended.
    ended: bool,
    /// Logarithm of the odds of this case: zero at the beginning, since the fixes of a receiver that
    /// regains its satellites are wrong about as often as the sigma of an outage is.
    odds: f64,
}

saved!(Branch { sensor, since, effect, offset, variance, ended, odds });

/// NIS and log-likelihood of an innovation with the covariance `s`.
fn fit(y: &DVector<f64>, s: DMatrix<f64>) -> Option<(f64, f64)> {
    let l = s.cholesky()?.unpack();
    let nis = l.solve_lower_triangular(y)?.norm_squared();
    let ln: f64 = l.diagonal().iter().map(|root| root.ln()).sum();
    nis.is_finite().then_some((nis, -0.5 * nis - ln))
}

impl Branch {
    /// Begins with the innovation of channels that may be offset, before the covariance is widened, for
    /// an error state of dimension `n`. Call after [`Update::innovate`].
    pub(super) fn new(
        (sensor, channels): (usize, u16),
        since: Time,
        update: &Update,
        n: usize,
    ) -> Self {
        let effect = Reach::of_offset(n, channels);
        let (offset, variance) = (update.innovation.clone(), update.s.clone());
        Self { sensor, since, effect, offset, variance, ended: false, odds: 0.0 }
    }

    /// Probability that the sensor is wrong.
    pub(super) fn weight(&self) -> f64 {
        1.0 / (1.0 + (-self.odds).exp())
    }

    fn offset(&self) -> DVector<f64> {
        DVector::from_column_slice(&self.offset)
    }

    fn variance(&self) -> DMatrix<f64> {
        let k = self.offset.len();
        DMatrix::from_row_slice(k, k, &self.variance)
    }

    /// `T` of a sample.
    fn seen(&self, (sensor, present): (usize, u16), update: &Update) -> DMatrix<f64> {
        let own = if sensor == self.sensor && !self.ended { present } else { 0 };
        update.seen_of_offset(&self.effect, present, own)
    }

    /// Weighs both cases by a sample, used or refused, of which the gate has the limit. Call after
    /// [`Update::innovate`].
    pub(super) fn weigh(&mut self, (sensor, present): (usize, u16), update: &Update, limit: f64) {
        let (y, m) = (DVector::from_column_slice(&update.innovation), update.m);
        let s = DMatrix::from_row_slice(m, m, &update.s);
        let (d, variance) = (self.offset(), self.variance());
        let fits = |t: DMatrix<f64>| fit(&(&y - &t * &d), &s + &t * &variance * t.transpose());
        let Some((nis, filter)) = fit(&y, s.clone()) else { return };
        let Some(mut own) = fits(self.seen((sensor, present), update)) else { return };
        if own.0 > limit && sensor == self.sensor && !self.ended {
            let without = update.seen_of_offset(&self.effect, present, 0);
            if let Some((nis, ln)) = fits(without).filter(|(nis, _)| *nis <= limit) {
                self.ended = true;
                own = (nis, ln + ENDS);
            }
        }
        // an outlier in both cases
        if nis <= limit || own.0 <= limit {
            self.odds += (own.1 - filter).clamp(-MOST, MOST);
        }
    }

    /// Corrects the case by a sample that the filter uses. Call after [`Update::apply`].
    pub(in crate::filter) fn correct(&mut self, of: (usize, u16), update: &Update, time: Time) {
        let t = self.seen(of, update);
        // the first sample gave the offset
        if time > self.since {
            self.estimate(&t, update);
        }
        update.correct_for(&mut self.effect, &t);
    }

    /// Corrects the offset by a sample.
    fn estimate(&mut self, t: &DMatrix<f64>, update: &Update) {
        let m = update.m;
        let y = DVector::from_column_slice(&update.innovation);
        let s = DMatrix::from_row_slice(m, m, &update.s);
        let (mut d, mut variance) = (self.offset(), self.variance());
        let cross = &variance * t.transpose();
        if let Some(inverse) = (s + t * &cross).try_inverse() {
            let gain = cross * inverse;
            d += &gain * (y - t * &d);
            variance -= &gain * t * &variance;
            self.offset.copy_from_slice(d.as_slice());
            // a symmetric matrix is the same by rows and by columns
            self.variance.copy_from_slice(((&variance + variance.transpose()) * 0.5).as_slice());
        }
    }

    /// Warning of a run that ends undecided.
    pub(in crate::filter) fn undecided(&self, time: Time, sensors: &[Sensor]) -> Event {
        let text = format!(
            "either the filter was off at {}, or the sensor has been wrong since then: nothing has decided it, \
             and the sigma contains both",
            self.since
        );
        let about = sensors[self.sensor].info.name.clone();
        Event { time, level: Level::Warning, about, text }
    }

    /// Channels that are offset still, one bit each.
    pub(super) fn channels(&self) -> u16 {
        if self.ended { 0 } else { self.effect.channels() }
    }

    /// The case that has outweighed the other one: `true` if the sensor was wrong.
    pub(super) fn decided(&self) -> Option<bool> {
        (self.odds.abs() >= DECIDED).then_some(self.odds > 0.0)
    }

    /// `P + w B (d d' + M) B'`.
    pub(super) fn mixed(&self, covariance: &Covariance, weight: f64) -> Covariance {
        let d = self.offset();
        let moment = (&d * d.transpose() + self.variance()) * weight;
        let mut mixed = covariance.clone();
        self.effect.widen(&mut mixed, &moment);
        mixed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A place with the sigma 0.4 m at zero, a sensor whose samples jump to 10 m after a silence, and another
    /// one.
    struct Place {
        value: f64,
        covariance: Covariance,
        branch: Branch,
        time: i64,
    }

    const SENSOR: usize = 0;
    const OTHER: usize = 1;
    const LIMIT: f64 = 15.1;

    /// A sample of the place.
    fn sample(value: f64, innovation: f64, noise: f64) -> Update {
        let mut update = Update::with_capacity(1, 1);
        update.m = 1;
        update.columns.push(0);
        (update.h, update.r) = (vec![1.0], vec![noise * noise]);
        update.innovation = vec![innovation - value];
        update
    }

    impl Place {
        /// The filter has followed a sample at 10 m.
        fn new() -> Self {
            let mut covariance = Covariance::zero(1);
            covariance.set(0, 0, 0.16);
            let mut update = sample(0.0, 10.0, 0.02);
            update.innovate(&covariance);
            let branch = Branch::new((SENSOR, 1), Time::MIN, &update, 1);
            covariance.set(0, 0, 100.0);
            let mut place = Self { value: 0.0, covariance, branch, time: 0 };
            place.apply(SENSOR, update, Time::MIN);
            place
        }

        fn apply(&mut self, sensor: usize, mut update: Update, time: Time) {
            update.innovate(&self.covariance);
            update.apply(&mut self.covariance, &[false]);
            self.value += update.delta[0];
            self.branch.correct((sensor, 1), &update, time);
        }

        fn take(&mut self, sensor: usize, value: f64, noise: f64) -> &mut Self {
            self.time += 1;
            let mut update = sample(self.value, value, noise);
            let nis = update.innovate(&self.covariance).unwrap_or(f64::NAN);
            self.branch.weigh((sensor, 1), &update, LIMIT);
            if nis <= LIMIT {
                self.apply(sensor, update, Time::from_nanos(self.time));
            }
            self
        }
    }

    /// The offset of 10 m and its variance of 0.16 m^2 count half.
    #[test]
    fn the_mixture_contains_both_cases_while_only_the_sensor_itself_speaks() {
        let mut place = Place::new();
        for k in 0..1000 {
            place.take(SENSOR, 10.0 + 0.02 * f64::from(k % 3 - 1), 0.02);
        }
        assert!(place.branch.odds.abs() < 0.1, "{}", place.branch.odds);
        assert_eq!(place.branch.decided(), None);
        let mixed = place.branch.mixed(&place.covariance, place.branch.weight());
        assert!((mixed.get(0, 0) - 0.5 * 100.16).abs() < 0.5, "{}", mixed.get(0, 0));
    }

    #[test]
    fn another_sensor_decides_for_either_case_and_not_by_one_sample() {
        for (value, wrong) in [(0.2, true), (10.2, false)] {
            let mut place = Place::new();
            assert_eq!(place.take(OTHER, value, 0.3).branch.decided(), None);
            assert_eq!(place.take(OTHER, value, 0.3).branch.decided(), Some(wrong), "{value}");
            assert!(!place.branch.ended);
        }
    }

    #[test]
    fn a_sensor_that_comes_back_was_wrong_and_one_that_jumps_elsewhere_decides_nothing() {
        let mut place = Place::new();
        place.take(SENSOR, 10.0, 0.02).take(SENSOR, 0.3, 0.02).take(SENSOR, 0.3, 0.02);
        assert_eq!((place.branch.decided(), place.branch.ended), (Some(true), true));
        let mut place = Place::new();
        place.take(SENSOR, 10.0, 0.02).take(SENSOR, -30.0, 0.02).take(SENSOR, -30.0, 0.02);
        assert_eq!((place.branch.decided(), place.branch.ended), (None, false));
    }
}
