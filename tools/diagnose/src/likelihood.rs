//! Likelihood of the samples of a run.
//!
//! Each channel of each sample contributes `ln((1 - e) N(nu; 0, S) + e U)`: the filter's prediction,
//! or with the rate `e` an outlier from a Cauchy distribution `U`. The whitened innovation
//! `y = L^-1 nu` with `S = L L'` splits the normal density into one factor a channel. A wild channel
//! costs some 14 nats, whatever its size, so that samples that the gate refused count too.

use navfuse_core::model::record::{Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::units::sample::MAX_CHANNELS;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Rate of outliers.
const OUTLIERS: f64 = 1e-3;
/// Scale of outliers as a multiple of the smallest sigma of an innovation.
const WILD: f64 = 1000.0;

/// A value for each channel of each sensor, by the name of the sensor.
pub(crate) type Channels<T> = BTreeMap<String, [T; MAX_CHANNELS]>;

/// Sums over the channels of a sensor.
#[derive(Clone, Debug, Default)]
struct Sums {
    /// Scale of the outliers.
    scale: [f64; MAX_CHANNELS],
    /// Logarithm of the factor by which the channel was changed.
    stretch: [f64; MAX_CHANNELS],
    /// Sum of the log-densities.
    density: [f64; MAX_CHANNELS],
    count: [u64; MAX_CHANNELS],
    /// Smallest sigma of the innovation.
    smallest: [f64; MAX_CHANNELS],
    /// Normalised innovation squared of the accepted samples, and their channels.
    nis: (f64, u64),
}

/// Follows the innovations of a run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Likelihood {
    scales: Channels<f64>,
    stretches: Channels<f64>,
    names: Vec<String>,
    sensors: Vec<Sums>,
    seconds: BTreeMap<i64, f64>,
}

/// The log-densities of a run, by sensor and channel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Densities {
    pub density: Channels<f64>,
    pub count: Channels<u64>,
    /// Normalised innovation squared of the accepted samples of each sensor, and their channels.
    pub nis: BTreeMap<String, (f64, u64)>,
    /// The log-densities of all channels of each second.
    pub seconds: BTreeMap<i64, f64>,
}

impl Likelihood {
    /// A sink with the scales of outliers, and the logarithms of the factors on the channels.
    pub fn new(scales: Channels<f64>, stretches: Channels<f64>) -> Self {
        Self { scales, stretches, ..Self::default() }
    }

    /// The scales of outliers that the innovations of this run suggest.
    pub fn scales(&self) -> Channels<f64> {
        let scale = |s: f64| if s.is_finite() { WILD * s } else { 1.0 };
        let sums = self.names.iter().zip(&self.sensors);
        sums.map(|(name, s)| (name.clone(), s.smallest.map(scale))).collect()
    }

    /// The log-densities.
    pub fn densities(&self) -> Densities {
        let mut all = Densities { seconds: self.seconds.clone(), ..Densities::default() };
        for (name, sums) in self.names.iter().zip(&self.sensors) {
            all.density.insert(name.clone(), sums.density);
            all.count.insert(name.clone(), sums.count);
            all.nis.insert(name.clone(), sums.nis);
        }
        all
    }

    fn add(&mut self, update: &UpdateRecord<'_>) {
        let Some(sums) = self.sensors.get_mut(update.sensor.0) else { return };
        let Some((whitened, diagonal)) = whitened(update.innovation, update.covariance) else {
            return;
        };
        if update.outcome == Outcome::Accepted {
            sums.nis.0 += update.nis;
            sums.nis.1 += update.innovation.len() as u64;
        }
        let second = self.seconds.entry(update.time.seconds().floor() as i64).or_default();
        for (k, (channel, innovation, sigma)) in update.channels().enumerate() {
            let density = density(whitened[k], diagonal[k], innovation, sums.scale[channel]);
            let density = density + sums.stretch[channel];
            sums.density[channel] += density;
            *second += density;
            sums.count[channel] += 1;
            sums.smallest[channel] = sums.smallest[channel].min(sigma);
        }
    }
}

impl Densities {
    /// Mean normalised innovation squared of all accepted channels, expected to be 1, and their
    /// number.
    pub fn mean_nis(&self) -> (f64, u64) {
        let sum = |a: (f64, u64), b: &(f64, u64)| (a.0 + b.0, a.1 + b.1);
        let (nis, channels) = self.nis.values().fold((0.0, 0), sum);
        (nis / channels as f64, channels)
    }

    /// How far the gain over other densities is from chance, in sigma. A change that only turns noise
    /// around, such as the sign of a channel that reads nothing else, gains in some seconds what it
    /// loses in others: the losses give the variance of such a gain.
    pub fn significance(&self, before: &Self) -> f64 {
        let both = self.seconds.iter().filter_map(|(k, d)| Some(d - before.seconds.get(k)?));
        let add = |(gain, lost): (f64, f64), d: f64| (gain + d, lost + d.min(0.0).powi(2));
        let (gain, lost) = both.fold((0.0, 0.0), add);
        gain / (2.0 * lost).sqrt().max(1.0)
    }

    /// The log-likelihood of `wanted` values of each channel. A channel that has fewer pays the
    /// density of an outlier of its scale for each that it lacks; one that has more, as a constraint
    /// may, counts with their mean. So does one that has fewer where a clock was `moved`.
    pub fn total(&self, wanted: &Channels<u64>, scales: &Channels<f64>, moved: bool) -> f64 {
        let mut total = 0.0;
        for (name, wanted) in wanted {
            let none = [0.0; MAX_CHANNELS];
            let density = self.density.get(name).unwrap_or(&none);
            let count = self.count.get(name).copied().unwrap_or_default();
            let scale = scales.get(name).copied().unwrap_or([1.0; MAX_CHANNELS]);
            for k in 0..MAX_CHANNELS {
                if count[k] > wanted[k] || (moved && count[k] > 0) {
                    total += wanted[k] as f64 / count[k] as f64 * density[k];
                    continue;
                }
                total += density[k];
                if let missing @ 1.. = wanted[k].saturating_sub(count[k]) {
                    total += missing as f64 * (OUTLIERS / (TAU * scale[k])).ln();
                }
            }
        }
        total
    }
}

/// The whitened innovation `L^-1 nu` and the diagonal of `L`, by the Cholesky factor of the row-major
/// `S = L L'`. `None` without an innovation, or where `S` is not positive definite.
fn whitened(nu: &[f64], s: &[f64]) -> Option<([f64; MAX_CHANNELS], [f64; MAX_CHANNELS])> {
    let m = nu.len();
    let mut l = [[0.0; MAX_CHANNELS]; MAX_CHANNELS];
    let (mut y, mut diagonal) = ([0.0; MAX_CHANNELS], [0.0; MAX_CHANNELS]);
    if m == 0 || m > MAX_CHANNELS || s.len() != m * m {
        return None;
    }
    for i in 0..m {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = s[i * m + j] - dot;
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
        diagonal[i] = l[i][i];
        y[i] = (nu[i] - (0..i).map(|k| l[i][k] * y[k]).sum::<f64>()) / l[i][i];
        if !(diagonal[i] > 0.0 && y[i].is_finite()) {
            return None;
        }
    }
    Some((y, diagonal))
}

/// Log-density of a whitened innovation `y` with the sigma `l`, or of an outlier of the size `nu`.
fn density(y: f64, l: f64, nu: f64, scale: f64) -> f64 {
    let normal = (-0.5 * y * y).exp() / (l * TAU.sqrt());
    let wild = 1.0 / (PI * scale * (1.0 + (nu / scale).powi(2)));
    ((1.0 - OUTLIERS) * normal + OUTLIERS * wild).ln()
}

impl Sink for Likelihood {
    fn wants(&self) -> Wants {
        Wants::UPDATES
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        for sensor in &run.sensors {
            let value = |of: &Channels<f64>, default| {
                of.get(&sensor.name).copied().unwrap_or([default; MAX_CHANNELS])
            };
            self.sensors.push(Sums {
                scale: value(&self.scales, 1.0),
                stretch: value(&self.stretches, 0.0),
                smallest: [f64::INFINITY; MAX_CHANNELS],
                ..Sums::default()
            });
            self.names.push(sensor.name.clone());
        }
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Update(update) = record {
            self.add(update);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn the_factors_of_the_channels_are_the_density_of_the_sample() {
        let (s, nu) = ([4.0, 1.0, 1.0, 2.0], [1.0, -0.5]);
        let (y, l) = whitened(&nu, &s).unwrap();
        let sum: f64 = (0..2).map(|k| -0.5 * y[k] * y[k] - (l[k] * TAU.sqrt()).ln()).sum();
        // nu' S^-1 nu with det S = 7
        let nis = (2.0 * 1.0 - 2.0 * 1.0 * -0.5 + 4.0 * 0.25) / 7.0;
        assert!((sum - (-0.5 * nis - (TAU * 7_f64.sqrt()).ln())).abs() < 1e-12);
        assert!(whitened(&nu, &[1.0, 2.0, 2.0, 1.0]).is_none());
    }

    #[test]
    fn a_wild_channel_costs_the_same_whatever_its_size() {
        let good = density(0.0, 1.0, 0.0, WILD);
        let cost = [20.0, 200.0].map(|nu| good - density(nu, 1.0, nu, WILD));
        assert!((cost[0] - cost[1]).abs() < 0.1 && (12.0..16.0).contains(&cost[0]), "{cost:?}");
    }

    #[test]
    fn a_gain_that_comes_with_losses_of_its_size_is_chance() {
        let seconds = |values: &[f64]| Densities {
            seconds: (0..).zip(values.iter().copied()).collect(),
            ..Densities::default()
        };
        let before = seconds(&[0.0; 6]);
        let noise = seconds(&[9.0, -8.0, 7.0, -6.0, 8.0, -3.0]);
        let cause = seconds(&[9.0, 8.0, 7.0, -0.5, 8.0, 0.0]);
        assert!(noise.significance(&before) < 1.0);
        assert!(cause.significance(&before) > 10.0);
    }

    #[test]
    fn a_value_that_a_run_lacks_pays_the_price_of_an_outlier() {
        let one = |value: f64| {
            let mut all = [0.0; MAX_CHANNELS];
            all[0] = value;
            BTreeMap::from([("dvl".to_owned(), all)])
        };
        let mut wanted = [0; MAX_CHANNELS];
        wanted[0] = 3;
        let wanted = BTreeMap::from([("dvl".to_owned(), wanted)]);
        let none = Densities::default().total(&wanted, &one(2.0), false);
        assert!((none - 3.0 * (OUTLIERS / (TAU * 2.0)).ln()).abs() < 1e-9);
        let mut count = [0; MAX_CHANNELS];
        count[0] = 6;
        let count = BTreeMap::from([("dvl".to_owned(), count)]);
        let more = Densities { density: one(12.0), count, ..Densities::default() };
        assert!((more.total(&wanted, &one(2.0), false) - 6.0).abs() < 1e-12);
        let mut count = [0; MAX_CHANNELS];
        count[0] = 2;
        let count = BTreeMap::from([("dvl".to_owned(), count)]);
        let fewer = Densities { density: one(4.0), count, ..Densities::default() };
        assert!((fewer.total(&wanted, &one(2.0), true) - 6.0).abs() < 1e-12);
    }
}
