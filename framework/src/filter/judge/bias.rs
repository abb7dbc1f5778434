//! Sequential test on the innovations, for slow and small errors, which no gate detects.
//!
//! The innovations of a consistent filter are white with the covariance `S`, so `e = y / sqrt(S)`
//! of each channel is N(0, 1) and independent of those before. An error of the sensor gives them a
//! mean, if only until the filter has followed it. Page's cumulative sum finds a mean that begins
//! at an unknown time:
//! ```text
//! C = max(0, C + e - k)         for each sign; an alarm where C > h
//! ```
//! `k` is half of the shift that is found fastest; three charts cover shifts of 0.5, 1 and 2 sigma.
//! The mean number of samples to a false alarm is, with `b = h + 1.166` (Siegmund 1985, eq. 2.57),
//! ```text
//! ARL = (exp(2 k b) - 1 - 2 k b) / (2 k^2)
//! ```
//! and `h` is chosen for ARL = 1e8: six charts on 1e5 innovations of a run, such as those of
//! three channels at 5 Hz for 110 minutes, give a false alarm in 0.6 % of the runs.
//!
//! Innovations of real sensors are wider and correlated. `e` is therefore divided by the root mean
//! square of the innovations where that exceeds one. Where the correlation `r` of successive
//! innovations is positive, the variance of a sum grows by `(1 + r) / (1 - r)`, and `e` is also
//! divided by the root of this factor.

use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Update;
use crate::units::sample::channels;
use crate::units::time::Time;

/// Mean number of samples to a false alarm of a chart.
const SAMPLES: f64 = 1e8;

/// Half of the shifts that the charts find fastest, sigma.
const HALVES: [f64; 3] = [0.25, 0.5, 1.0];

/// Excess of a random walk over a boundary, sigma.
const EXCESS: f64 = 1.166;

/// Weight of the last innovation in the mean square and in the correlation.
const WEIGHT: f64 = 0.005;

/// Largest correlation of successive innovations that the test accounts for.
const CORRELATED: f64 = 0.9;

/// Innovations of a channel before the test begins: the start of a filter is not linear.
const BEGINNING: u32 = 20;

/// Bound `h` of a chart with that `k` for a mean number of samples to a false alarm.
fn bound(k: f64, samples: f64) -> f64 {
    // fixed-point iteration b = ln(1 + 2 k b + 2 k^2 ARL) / (2 k), which is a contraction
    let mut b = 1.0;
    for _ in 0..50 {
        b = (1.0 + 2.0 * k * b + 2.0 * k * k * samples).ln() / (2.0 * k);
    }
    b - EXCESS
}

/// One cumulative sum.
#[derive(Clone, Copy, Default)]
struct Chart {
    value: f64,
    /// Start of the sum, its number of innovations, and their total.
    since: Time,
    count: u32,
    sum: f64,
}

saved!(Chart { value, since, count, sum });

/// Charts of one channel.
#[derive(Clone, Copy)]
struct Charts {
    charts: [[Chart; 2]; HALVES.len()],
    seen: u32,
    /// Mean square of the innovations, and mean product with the one before.
    square: f64,
    product: f64,
    before: f64,
}

saved!(Charts { charts, seen, square, product, before });

/// A mean of the innovations of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::filter) struct Shift {
    pub(in crate::filter) channel: usize,
    pub(in crate::filter) since: Time,
    pub(in crate::filter) count: u32,
    /// Mean in units of the innovation's sigma.
    pub(in crate::filter) mean: f64,
}

impl Shift {
    /// Finding about a sensor whose innovations have a mean.
    pub(in crate::filter) fn finding(&self, time: Time, sensor: &SensorInfo) -> Finding {
        let &Self { channel, since, count, mean } = self;
        let channel = sensor.words(channel);
        let severity = if mean.abs() >= 1.0 { Severity::DoNotUse } else { Severity::Doubtful };
        Finding {
            time,
            about: sensor.name.clone(),
            severity,
            basis: Basis::Comparison,
            text: format!(
                "the innovations of {channel} have a mean of {mean:+.2} sigma from {since} to \
                 {time} ({count} samples), where a consistent filter's innovations have none"
            ),
            remedy: "look at the sensor in this span, and at its axes, signs and units; if its \
                     error is known to last, give it a bias or correlated_error"
                .to_owned(),
        }
    }
}

/// Sequential test of one sensor.
#[derive(Clone)]
pub(in crate::filter) struct BiasTest {
    bounds: [f64; HALVES.len()],
    channels: Vec<Charts>,
}

saved!(BiasTest {} each { channels } except { bounds });

impl BiasTest {
    /// Creates the test of a sensor with that number of channels.
    pub(in crate::filter) fn new(channels: usize) -> Self {
        Self::with(SAMPLES, channels)
    }

    fn with(samples: f64, channels: usize) -> Self {
        let bounds = HALVES.map(|k| bound(k, samples));
        Self { bounds, channels: vec![Charts::new(); channels] }
    }

    /// Begins again: the state has changed by more than a correction.
    pub(in crate::filter) fn restart(&mut self) {
        self.channels.fill(Charts::new());
    }

    /// Takes the innovations of a sample, and returns the first shift that they show. Call after
    /// [`Update::innovate`].
    pub(in crate::filter) fn take(
        &mut self,
        time: Time,
        update: &Update,
        present: u16,
    ) -> Option<Shift> {
        let mut found = None;
        for (a, channel) in channels(present).enumerate().take(update.m) {
            let e = update.innovation[a] / update.s[a * update.m + a].sqrt();
            let charts = self.channels.get_mut(channel);
            let shift = charts.and_then(|charts| charts.take(time, e, &self.bounds));
            found = found.or(shift.map(|shift| Shift { channel, ..shift }));
        }
        found
    }
}

impl Charts {
    fn new() -> Self {
        Self {
            charts: [[Chart::default(); 2]; HALVES.len()],
            seen: 0,
            square: 1.0,
            product: 0.0,
            before: 0.0,
        }
    }

    fn take(&mut self, time: Time, e: f64, bounds: &[f64; HALVES.len()]) -> Option<Shift> {
        self.seen = self.seen.saturating_add(1);
        let correlation = (self.product / self.square).clamp(0.0, CORRELATED);
        let scale = self.square.max(1.0) * (1.0 + correlation) / (1.0 - correlation);
        self.square += WEIGHT * (e * e - self.square);
        self.product += WEIGHT * (e * self.before - self.product);
        self.before = e;
        if self.seen <= BEGINNING {
            return None;
        }
        let scaled = e / scale.sqrt();
        let mut found = None;
        for ((pair, k), bound) in self.charts.iter_mut().zip(HALVES).zip(bounds) {
            for (chart, sign) in pair.iter_mut().zip([1.0, -1.0]) {
                if chart.value == 0.0 {
                    *chart = Chart { since: time, ..Chart::default() };
                }
                chart.value = (chart.value + sign * scaled - k).max(0.0);
                chart.count += 1;
                chart.sum += e;
                if chart.value > *bound {
                    let Chart { since, count, sum, .. } = *chart;
                    found = Some(Shift { channel: 0, since, count, mean: sum / f64::from(count) });
                }
            }
        }
        if found.is_some() {
            self.charts = [[Chart::default(); 2]; HALVES.len()];
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    /// Innovations until the first alarm of one chart.
    fn length(random: &mut Random, samples: f64, chart: usize, mean: f64) -> u32 {
        let mut charts = BiasTest::with(samples, 1).channels[0];
        let mut bounds = [f64::INFINITY; HALVES.len()];
        bounds[chart] = bound(HALVES[chart], samples);
        // the beginning is over, and the scale stays one
        charts.seen = BEGINNING;
        (1..)
            .find(|_| {
                (charts.square, charts.product) = (1.0, 0.0);
                charts.take(Time::MIN, mean + random.normal(), &bounds).is_some()
            })
            .unwrap_or(u32::MAX)
    }

    /// Run lengths to an alarm are exponential, so that the mean of 400 has a standard deviation of
    /// 5 %; two signs halve it. The approximation itself is good to a few per cent.
    #[test]
    fn the_mean_time_to_a_false_alarm_is_the_stated_one() {
        let mut random = Random::new(1, "charts");
        for (chart, k) in HALVES.iter().enumerate() {
            let total: u32 = (0..400).map(|_| length(&mut random, 2000.0, chart, 0.0)).sum();
            let mean = f64::from(total) / 400.0;
            assert!((mean / 1000.0 - 1.0).abs() < 0.25, "k = {k}: {mean}");
        }
    }

    /// A mean of one sigma climbs by 1 - k = 0.5 for each innovation, to 16.6 and half of the
    /// excess: 34 innovations. Such a walk has a standard deviation of sqrt(34 / 0.5^2) = 12, the
    /// mean of 100 walks 1.2; the bound is three times that.
    #[test]
    fn a_mean_of_one_sigma_is_found_after_34_innovations() {
        let mut random = Random::new(2, "charts");
        let total: u32 = (0..100).map(|_| length(&mut random, SAMPLES, 1, 1.0)).sum();
        let mean = f64::from(total) / 100.0;
        assert!((mean - 34.0).abs() < 3.6, "{mean}");
    }

    /// Siegmund's formula at the bound gives the number of samples back. The exponential of 2 k b
    /// magnifies the rounding of b, some 1e-14, by 2 k < 3.
    #[test]
    fn the_bound_of_each_chart_has_the_stated_number_of_samples_to_a_false_alarm() {
        for (k, samples) in HALVES.into_iter().flat_map(|k| [(k, 50.0), (k, SAMPLES)]) {
            let x = 2.0 * k * (bound(k, samples) + 1.166);
            let length = (x.exp() - 1.0 - x) / (2.0 * k * k);
            assert!((length / samples - 1.0).abs() < 1e-12, "k = {k}: {length}");
        }
    }

    /// With the weight w = 1/200 of the last innovation, the mean square of innovations of 2 and -2
    /// is 4 - 3 (1 - w)^n after n of them, and the mean product is -4 (1 - (1 - w)^(n - 1)).
    #[test]
    fn the_mean_square_and_the_mean_product_remember_200_innovations() {
        let mut charts = BiasTest::with(SAMPLES, 1).channels[0];
        for n in 1..=1000 {
            charts.take(Time::MIN, if n % 2 == 1 { 2.0 } else { -2.0 }, &[f64::INFINITY; 3]);
            if [1, 200, 1000].contains(&n) {
                let (left, less) = (0.995_f64.powi(n), 0.995_f64.powi(n - 1));
                assert!((charts.square - (4.0 - 3.0 * left)).abs() < 1e-12, "{n}");
                assert!((charts.product + 4.0 * (1.0 - less)).abs() < 1e-12, "{n}");
            }
        }
    }

    /// Innovations `y` of the channels that are present, with the variance 4, until the first shift.
    fn shift(present: u16, y: &[f64]) -> Option<Shift> {
        let m = y.len();
        let mut update = Update::with_capacity(1, m);
        update.m = m;
        update.innovation.extend(y);
        update.s.extend((0..m * m).map(|k| if k % (m + 1) == 0 { 4.0 } else { 0.0 }));
        let mut test = BiasTest::new(3);
        (0..200).find_map(|k| test.take(Time::from_nanos(k), &update, present))
    }

    #[test]
    fn a_shift_names_its_channel_where_others_are_missing_and_has_the_sign_of_the_mean() {
        let found = |present, y: &[f64]| shift(present, y).map(|s| (s.channel, s.mean));
        assert_eq!(found(0b111, &[0.0, 0.0, 2.0]), Some((2, 1.0)));
        assert_eq!(found(0b110, &[2.0, 0.0]), Some((1, 1.0)));
        assert_eq!(found(0b110, &[0.0, -2.0]), Some((2, -1.0)));
        assert_eq!(found(0b100, &[-2.0]), Some((2, -1.0)));
        assert_eq!(found(0b111, &[0.0; 3]), None);
    }

    /// The mean of innovations with the variance `v` and the correlation `r` of neighbours has the
    /// variance `v (1 + r) / (1 - r)` over their number. A variance below 1 counts as 1, and the
    /// correlation is 0 to 0.9.
    #[test]
    fn correlated_innovations_weigh_as_little_as_their_mean_is_uncertain() {
        for (square, product, variance) in
            [(2.0, 1.0, 2.0 * 3.0), (2.0, 2.0, 2.0 * 19.0), (0.25, 0.05, 1.5), (4.0, -1.0, 4.0)]
        {
            for sign in [1.0, -1.0] {
                let mut charts = BiasTest::with(SAMPLES, 1).channels[0];
                (charts.square, charts.product, charts.seen) = (square, product, BEGINNING);
                charts.take(Time::MIN, 30.0 * sign, &[f64::INFINITY; 3]);
                for (pair, k) in charts.charts.iter().zip(HALVES) {
                    let expected = 30.0 / f64::sqrt(variance) - k;
                    let [same, other] = if sign > 0.0 { *pair } else { [pair[1], pair[0]] };
                    assert!((same.value - expected).abs() < 1e-12, "{square} {product} {sign}");
                    assert_eq!(other.value, 0.0);
                }
            }
        }
    }

    /// The first 20 innovations are left out. The charts begin anew after an alarm.
    #[test]
    fn a_shift_counts_the_innovations_from_its_begin_to_the_alarm() {
        let mut charts = BiasTest::new(1).channels[0];
        let bounds = BiasTest::new(1).bounds;
        let alarms: Vec<(i64, Shift)> = (0..400_i64)
            .filter_map(|k| {
                let e = if k < 100 { 0.0 } else { 2.0 };
                charts.take(Time::from_nanos(k), e, &bounds).map(|shift| (k, shift))
            })
            .collect();
        assert!(alarms.len() > 1, "{alarms:?}");
        let mut begin = 100;
        for (k, shift) in alarms {
            assert_eq!((shift.since.nanos(), i64::from(shift.count)), (begin, k - begin + 1));
            assert!((shift.mean - 2.0).abs() < 1e-12, "{}", shift.mean);
            begin = k + 1;
        }
    }
}
