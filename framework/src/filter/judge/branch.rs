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
//! At the beginning `B = 0`, and the first sample gives the offset of some groups of channels, beside what
//! the others `r` predict for them, before the covariance is widened:
//! ```text
//! d = y_g - S_gr S_rr^-1 y_r,      M = S_gg - S_gr S_rr^-1 S_rg,      r^2 = d' M^-1 d
//! L = exp(r^2 / 2 - m / 2) (m / r^2)^(m / 2)      for r^2 > m, else 1
//! w = e L / (1 + e L + (e L or 0))
//! ```
//! `L` is the likelihood ratio of an offset of unknown size (`m` channels, normal with the variance that makes
//! the sample likeliest), and `e` the rate of wrong samples after a silence. The groups are those of the largest
//! `L`. If the gate refuses the sample, the filter may have been off as well, at the same rate.
//!
//! The samples of every sensor, used or refused, weigh the two cases, as far as their innovations are
//! independent under the case that they favour ([`Whiteness`]). An offset may end: then `D = 0` explains the
//! sensor's samples. While the second case is likelier than 1 %, the filter reports the mixture about its
//! own estimate, `P + w B (d d' + M) B'`, where `w` is its probability. A case ends once the odds are
//! 1000 : 1 for the sensor's fault, or have fallen by as much.

use crate::checkpoint::saved;
use crate::filter::judge::measured::Measured;
use crate::filter::judge::whiteness::Whiteness;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Level, Observer};
use crate::model::sensor::Sensor;
use crate::state::covariance::{Covariance, Reach, Update};
use crate::units::sample::channels;
use crate::units::time::Time;
use nalgebra::{DMatrix, DVector};

/// Logarithm of the odds at which a branch ends, 1000 : 1.
const DECIDED: f64 = 6.907_755_278_982_137;
/// Most that one sample adds to it, so that no single one decides: an outlier may fit either case.
const MOST: f64 = 5.0;
/// Logarithm of the probability that an offset ends at a sample.
const ENDS: f64 = -4.605_170_185_988_091;
/// Logarithm of the odds from which on the report contains the case: one in a hundred.
const DOUBT: f64 = -4.605_170_185_988_091;
/// Logarithm of the rate at which a sensor is wrong after a silence: one in a thousand.
const WRONG: f64 = -6.907_755_278_982_137;

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
    /// Logarithm of the odds of this case now, and at the beginning.
    odds: f64,
    began: f64,
    /// Set if the gate refused the first sample.
    gated: bool,
    /// Set if the first sample alone is wrong in this case.
    once: bool,
    /// Time of a first sample that the filter has taken back, where the case is that it was right.
    pub(super) first: Option<Time>,
    /// Of each sensor, of the filter and of this case.
    whiteness: Vec<[Whiteness; 2]>,
}

saved!(Branch {
    sensor,
    since,
    effect,
    offset,
    variance,
    ended,
    odds,
    began,
    gated,
    once,
    first,
    whiteness,
});

/// The offset of some channels that a sample gives.
struct Offset {
    d: DVector<f64>,
    /// `M`.
    variance: DMatrix<f64>,
    /// Logarithm of `L`.
    ln: f64,
}

/// The offset of the rows of an update that are `own`.
fn offset_of(update: &Update, own: impl Fn(usize) -> bool) -> Option<Offset> {
    let (own, rest): (Vec<usize>, Vec<usize>) = (0..update.m).partition(|row| own(*row));
    let y = |rows: &[usize]| {
        DVector::from_iterator(rows.len(), rows.iter().map(|a| update.innovation[*a]))
    };
    let s = |a: &[usize], b: &[usize]| {
        DMatrix::from_fn(a.len(), b.len(), |i, j| update.s[a[i] * update.m + b[j]])
    };
    let gain = s(&own, &rest) * s(&rest, &rest).try_inverse()?;
    let (d, variance) = (y(&own) - &gain * y(&rest), s(&own, &own) - &gain * s(&rest, &own));
    let m = own.len() as f64;
    let square = d.dot(&variance.clone().cholesky()?.solve(&d)).max(m);
    let ln = 0.5 * (square - m - m * (square / m).ln());
    Some(Offset { d, variance, ln })
}

/// Fit of a case to an innovation.
struct Fit {
    /// The innovation as multiples of its sigma that are independent of each other, and its NIS.
    whitened: DVector<f64>,
    nis: f64,
    /// Log-likelihood.
    ln: f64,
}

impl Fit {
    /// The fit of an innovation with the covariance `s`.
    fn of(y: &DVector<f64>, s: DMatrix<f64>) -> Option<Self> {
        let l = s.cholesky()?.unpack();
        let whitened = l.solve_lower_triangular(y)?;
        let nis = whitened.norm_squared();
        let ln = -0.5 * nis - l.diagonal().iter().map(|root| root.ln()).sum::<f64>();
        nis.is_finite().then_some(Self { whitened, nis, ln })
    }
}

impl Branch {
    /// Begins with a sample, before the covariance is widened, for an error state of dimension `n`.
    /// `groups` are the channels that may be offset alone or together. Call after [`Update::innovate`].
    pub(super) fn new(
        of: Measured,
        groups: &[u16],
        since: Time,
        update: &Update,
        n: usize,
    ) -> Option<Self> {
        let Measured { sensor, present } = of;
        let groups: Vec<u16> = groups.iter().map(|g| g & present).filter(|g| *g != 0).collect();
        let some = |k: u16| (0..groups.len()).filter(move |i| k >> i & 1 == 1);
        let sets = (1..1 << groups.len()).map(|k| some(k).fold(0, |set, i| set | groups[i]));
        let offset = |set: u16| {
            let rows: Vec<usize> = channels(present).collect();
            Some((set, offset_of(update, |row| set >> rows[row] & 1 == 1)?))
        };
        let (set, Offset { d, variance, ln }) =
            sets.filter_map(offset).max_by(|(_, a), (_, b)| a.ln.total_cmp(&b.ln))?;
        let odds = WRONG + ln;
        let effect = Reach::of_offset(n, set);
        let (offset, variance) = (d.as_slice().to_vec(), variance.as_slice().to_vec());
        let began = odds;
        Some(Self { sensor, since, effect, offset, variance, odds, began, ..Self::default() })
    }

    /// Notes that the gate refuses the first sample: the filter may be off as well, at the same rate.
    pub(super) fn refused(mut self) -> Self {
        self.gated = true;
        self.odds = -(-self.odds).exp().ln_1p();
        self.began = self.odds;
        self
    }

    /// Notes that the sensor was found to be wrong before, and agrees only since the filter has
    /// become uncertain: both cases are equally likely.
    pub(super) fn even(mut self) -> Self {
        (self.odds, self.began) = (0.0, 0.0);
        self
    }

    /// The case that this sample is wrong, and none after it.
    pub(super) fn once(mut self) -> Self {
        self.once = true;
        self
    }

    /// The opposite case of a filter that has taken a first sample back: that sample was right, and those
    /// that contradict it since a time are off by as much. Nothing decides yet.
    pub(super) fn reversed(self, since: Time) -> Self {
        let offset = self.offset.iter().map(|d| -d).collect();
        let (first, whiteness) = (Some(self.since), Vec::new());
        let opposite =
            Self { since, offset, ended: false, once: false, gated: true, first, ..self };
        Self { whiteness, ..opposite.even() }
    }

    /// Decides that the sensor was right.
    pub(super) fn overrule(&mut self) {
        self.odds = f64::NEG_INFINITY;
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
    fn seen(&self, of: Measured, update: &Update) -> DMatrix<f64> {
        let Measured { sensor, present } = of;
        let own = if sensor == self.sensor && !self.ended { present } else { 0 };
        update.seen_of_offset(&self.effect, present, own)
    }

    /// Weighs both cases by a sample, used or refused, of which the gate has the limit. Call after
    /// [`Update::innovate`].
    pub(super) fn weigh(&mut self, of: Measured, update: &Update, limit: f64) {
        let Measured { sensor, present } = of;
        let (y, m) = (DVector::from_column_slice(&update.innovation), update.m);
        let s = DMatrix::from_row_slice(m, m, &update.s);
        let (d, variance) = (self.offset(), self.variance());
        let fits = |t: DMatrix<f64>| Fit::of(&(&y - &t * &d), &s + &t * &variance * t.transpose());
        let Some(filter) = Fit::of(&y, s.clone()) else { return };
        let Some(mut own) = fits(self.seen(of, update)) else { return };
        if own.nis > limit && sensor == self.sensor && !self.ended {
            let without = update.seen_of_offset(&self.effect, present, 0);
            if let Some(fit) = fits(without).filter(|fit| fit.nis <= limit) {
                self.ended = true;
                own = Fit { ln: fit.ln + ENDS, ..fit };
            }
        }
        // an outlier in both cases
        if filter.nis <= limit || own.nis <= limit {
            self.odds += self.gain(sensor, &filter, &own).clamp(-MOST, MOST);
        }
    }

    /// The evidence of a sample, as far as it is independent of the samples before under the case that it
    /// favours.
    fn gain(&mut self, sensor: usize, filter: &Fit, own: &Fit) -> f64 {
        let count = self.whiteness.len().max(sensor + 1);
        self.whiteness.resize_with(count, Default::default);
        let [of_filter, of_own] = &mut self.whiteness[sensor];
        let shares = [of_filter.take(&filter.whitened), of_own.take(&own.whitened)];
        let gain = own.ln - filter.ln;
        gain * shares[usize::from(gain > 0.0)]
    }

    /// Corrects the case by a sample that the filter uses. Call after [`Update::apply`].
    pub(in crate::filter) fn correct(&mut self, of: Measured, update: &Update, time: Time) {
        let t = self.seen(of, update);
        // the first sample gave the offset
        if time > self.since {
            self.estimate(&t, update);
        }
        update.correct_for(&mut self.effect, &t);
        self.ended |= self.once && of.sensor == self.sensor;
    }

    /// Corrects the offset by a sample that the filter refuses, although it fits this case. A filter that had
    /// not used the first sample would correct its states too, so that `M` is larger than it need be.
    pub(super) fn learn(&mut self, of: Measured, update: &Update, limit: f64) {
        let t = self.seen(of, update);
        let (m, y) = (update.m, DVector::from_column_slice(&update.innovation));
        let s = DMatrix::from_row_slice(m, m, &update.s) + &t * self.variance() * t.transpose();
        if Fit::of(&(y - &t * self.offset()), s).is_some_and(|fit| fit.nis <= limit) {
            self.estimate(&t, update);
        }
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

    /// Reports that a run ends undecided: a doubt about the sensor if the gate refused it, else a warning.
    pub(in crate::filter) fn finish(
        &self,
        time: Time,
        sensors: &[Sensor],
        observer: &mut dyn Observer,
    ) {
        let text = format!(
            "either the filter was off at {}, or the sensor has been wrong since then: the samples do not \
             decide which, and the sigma contains both cases",
            self.since
        );
        let about = sensors[self.sensor].info.name.clone();
        if self.gated {
            let (severity, basis) = (Severity::Contained, Basis::Comparison);
            let remedy =
                "look at the sensor's samples since then, and at the noise of the driving sensor";
            let remedy = remedy.to_owned();
            observer.finding(Finding { time, about, severity, basis, text, remedy });
        } else {
            observer.event(Event { time, level: Level::Warning, about, text });
        }
    }

    /// The case that has outweighed the other one: `true` if the sensor was wrong.
    pub(super) fn decided(&self) -> Option<bool> {
        let wrong = self.odds >= DECIDED;
        (wrong || self.odds <= self.began.min(0.0) - DECIDED).then_some(wrong)
    }

    /// Returns `true` while the report contains the case.
    pub(in crate::filter) fn is_in_doubt(&self) -> bool {
        self.odds > DOUBT
    }

    /// Returns `true` if the report contained the case at the beginning.
    pub(super) fn was_in_doubt(&self) -> bool {
        self.began > DOUBT
    }

    /// `P + w B (d d' + M) B'`.
    pub(super) fn mixed(&self, covariance: &Covariance, weight: f64) -> Covariance {
        let d = self.offset();
        let moment = (&d * d.transpose() + self.variance()) * weight;
        let mut mixed = covariance.clone();
        self.effect.widen(&mut mixed, &moment);
        mixed
    }

    /// `B d`, after which the estimate is that of this case, and `P` becomes `P + B M B'`.
    pub(super) fn follow(&self, covariance: &mut Covariance) -> Vec<f64> {
        self.effect.widen(covariance, &self.variance());
        self.effect.times(&self.offset)
    }

    /// Channels that are offset still, one bit each.
    pub(super) fn offset_channels(&self) -> u16 {
        if self.ended { 0 } else { self.effect.channels() }
    }

    /// The offset of each channel that has one, or had one.
    pub(super) fn offsets(&self) -> &[f64] {
        &self.offset
    }
}

#[cfg(test)]
mod tests;
