//! Innovations of one channel.

use super::report::{SLIGHT, Size, UNTRUE, size};
use crate::checkpoint::saved;
use crate::model::chi_square::{outside, sigmas};
use crate::model::record::finding::Severity;
use crate::model::record::verdict::Criterion;

/// Correlation of successive innovations below which a run is not doubted: the sigma of a mean is
/// then wrong by less than `sqrt((1 + 0.1) / (1 - 0.1))`, 11 %.
const WEAK: f64 = 0.1;
/// Ratio of the drift to its expectation below which a run is not doubted.
const SLOW: f64 = 1.2;

/// Departure of a channel from white noise.
#[derive(Clone, Debug)]
pub(crate) struct Departure {
    pub(crate) criterion: Criterion,
    pub(crate) severity: Severity,
    pub(crate) channel: String,
    /// Size in relation to the other channels.
    pub(crate) size: f64,
    pub(crate) text: String,
    pub(crate) remedy: &'static str,
}

/// The sensor of a channel as a whole.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Whole {
    /// Set if a consistent filter gives white innovations.
    pub(crate) white: bool,
    /// Number of channels.
    pub(crate) channels: usize,
    /// Set if the mean NIS is in its band.
    pub(crate) inside: bool,
}

/// Sums over the normalised innovations `u` of one channel; they have mean 0 and variance 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChannelStatistics {
    name: String,
    count: f64,
    sum: f64,
    /// Sum of the innovations, SI.
    raw: f64,
    squares: f64,
    last: Option<f64>,
    products: f64,
    minute: Minute,
    drift: Drift,
}

/// The innovations of the minute so far.
#[derive(Clone, Copy, Debug, Default)]
struct Minute {
    sum: f64,
    count: f64,
}

saved!(Minute { sum, count });

/// Sum over the minutes of `(sum of u)^2 / n`, each of expectation 1.
#[derive(Clone, Copy, Debug, Default)]
struct Drift {
    sum: f64,
    minutes: f64,
}

saved!(Drift { sum, minutes });

saved!(ChannelStatistics {
    count, sum, raw, squares, last, products, minute, drift,
} except {
    name,
});

impl ChannelStatistics {
    pub(crate) fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }

    /// Adds an innovation, normalised and raw.
    pub(crate) fn add(&mut self, u: f64, raw: f64) {
        self.count += 1.0;
        self.sum += u;
        self.raw += raw;
        self.squares += u * u;
        if let Some(last) = self.last.replace(u) {
            self.products += last * u;
        }
        self.minute.sum += u;
        self.minute.count += 1.0;
    }

    pub(crate) fn end_minute(&mut self) {
        let Minute { sum, count } = std::mem::take(&mut self.minute);
        if count > 0.0 {
            self.drift.sum += sum * sum / count;
            self.drift.minutes += 1.0;
        }
    }

    /// Returns `true` if the channel has enough innovations to be judged.
    pub(crate) fn used(&self) -> bool {
        self.count >= 3.0
    }

    /// Finds the departures of the channel.
    pub(crate) fn judge(&self, alpha: f64, sensor: &Whole, found: &mut Vec<Departure>) {
        let Whole { white, channels, inside } = *sensor;
        let (n, name) = (self.count, &self.name);
        let mut push = |criterion, severity, size, text, remedy| {
            let channel = name.clone();
            found.push(Departure { criterion, severity, channel, size, text, remedy });
        };
        let ratio = (self.squares / n).sqrt();
        // the NIS of a sensor with one channel is the square of its innovation
        if channels > 1
            && inside
            && ratio.max(1.0 / ratio) >= SLIGHT
            && outside(self.squares, n, 2.0 * n, alpha)
        {
            let Size { severity, words, remedy } = size(ratio);
            let text = format!("the innovations of {name} are {words} sigma");
            push(Criterion::Channel, severity, ratio.ln().abs(), text, remedy);
        }
        if !white {
            return;
        }
        // innovations that are too large have too large a mean as well, and the NIS reports these
        let scale = ratio.max(1.0);
        let limit = sigmas(0.5 * alpha);
        let bias = self.sum / n.sqrt() / scale;
        if bias.abs() > limit {
            let text = format!(
                "the innovations of {name} have a mean of {:.2e}, {:.1} of its sigma",
                self.raw / n,
                bias.abs()
            );
            let remedy = "look for a bias that is not modelled";
            push(Criterion::Bias, Severity::Doubtful, bias.abs(), text, remedy);
        }
        let correlation = self.products / (n - 1.0) / (scale * scale);
        if correlation.abs() >= WEAK && correlation.abs() * n.sqrt() > limit {
            let text = format!(
                "successive innovations of {name} have a correlation of {correlation:.2}, expected \
                 0 ± {:.2}",
                limit / n.sqrt()
            );
            let remedy = "the filter follows the samples too closely or not closely enough: look at \
                          the noise of this sensor and of the driving sensor";
            push(Criterion::Correlation, Severity::Doubtful, correlation.abs(), text, remedy);
        }
        let Drift { sum: drift, minutes } = self.drift;
        let ratio = (drift / minutes).sqrt() / scale;
        // minutes of one sample each repeat the test of the channel
        if n >= 3.0 * minutes
            && ratio >= SLOW
            && outside(drift / (scale * scale), minutes, 2.0 * minutes, alpha)
        {
            // few minutes give a ratio of two by chance where the drift is smaller
            let excess = drift / (scale * scale * UNTRUE * UNTRUE);
            let untrue = ratio >= UNTRUE && outside(excess, minutes, 2.0 * minutes, alpha);
            let severity = if untrue { Severity::DoNotUse } else { Severity::Doubtful };
            let text = format!(
                "the innovations of {name} drift: their means over a minute are {ratio:.2} times as \
                 large as white noise makes them"
            );
            let remedy = "a slow error is not modelled: of this sensor, or of one that contradicts \
                          this sensor";
            push(Criterion::Drift, severity, ratio, text, remedy);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Level of each test: 3.29 sigma to either side.
    const ALPHA: f64 = 1e-3;

    /// Statistics of `n` innovations with that root mean square.
    fn statistics(n: f64, rms: f64) -> ChannelStatistics {
        ChannelStatistics { count: n, squares: n * rms * rms, ..ChannelStatistics::default() }
    }

    fn found(channel: &ChannelStatistics, white: bool) -> Vec<(Criterion, Severity)> {
        let mut found = Vec::new();
        channel.judge(ALPHA, &Whole { white, channels: 3, inside: true }, &mut found);
        found.iter().map(|d| (d.criterion, d.severity)).collect()
    }

    /// A million innovations show a ratio of 1.04, which no decision depends on; 100 do not show
    /// 1.06, as the sigma of the ratio is 1 / sqrt(2 n) = 7 %.
    #[test]
    fn a_ratio_to_the_reported_sigma_is_noted_from_5_per_cent_and_doubted_from_20_if_the_samples_show_it()
     {
        let of = |n, ratio| found(&statistics(n, ratio), false);
        let doubt = |severity| vec![(Criterion::Channel, severity)];
        assert_eq!(of(1e6, 1.04), []);
        assert_eq!(of(1e6, 1.06), doubt(Severity::Note));
        assert_eq!(of(100.0, 1.06), []);
        assert_eq!(of(1e6, 1.19), doubt(Severity::Note));
        assert_eq!(of(1e6, 1.21), doubt(Severity::Doubtful));
        assert_eq!(of(1e6, 1.0 / 1.06), doubt(Severity::Note));
        assert_eq!(of(1e6, 0.1), doubt(Severity::Note));
        assert_eq!(of(1e6, 1.99), doubt(Severity::Doubtful));
        assert_eq!(of(1e6, 2.01), doubt(Severity::DoNotUse));
        // the mean NIS of the sensor speaks of these
        let mut found = Vec::new();
        let large = statistics(1e6, 1.5);
        large.judge(ALPHA, &Whole { white: false, channels: 1, inside: true }, &mut found);
        large.judge(ALPHA, &Whole { white: false, channels: 3, inside: false }, &mut found);
        assert_eq!(found.len(), 0);
    }

    /// The mean of n innovations has the sigma 1 / sqrt(n), times their ratio where that is larger.
    #[test]
    fn a_mean_is_a_bias_from_3_29_of_its_sigma() {
        for (scale, mean) in [(1.0, 3.28), (2.0, 6.57), (0.5, -3.28)] {
            let of = |sum: f64| {
                let (sum, raw) = (sum * 100.0, sum);
                let channel = ChannelStatistics { sum, raw, ..statistics(1e4, scale) };
                let found = found(&channel, true);
                found.iter().filter(|f| f.0 == Criterion::Bias).map(|f| f.1).collect::<Vec<_>>()
            };
            assert_eq!(of(mean), []);
            assert_eq!(of(mean * 1.01), [Severity::Doubtful]);
        }
    }

    /// A correlation has the sigma 1 / sqrt(n) = 0.1 for 100 innovations; below 0.1 none is doubted.
    #[test]
    fn a_correlation_is_doubted_from_a_tenth_and_from_3_29_of_its_sigma() {
        let of = |n: f64, correlation: f64, scale: f64| {
            let products = (n - 1.0) * correlation * scale * scale;
            let found = found(&ChannelStatistics { products, ..statistics(n, scale) }, true);
            found.contains(&(Criterion::Correlation, Severity::Doubtful))
        };
        for scale in [1.0, 2.0] {
            assert!(!of(1e6, 0.099, scale) && of(1e6, 0.101, scale));
            assert!(!of(1e6, -0.099, scale) && of(1e6, -0.101, scale));
            assert!(!of(100.0, 0.328, scale) && of(100.0, 0.331, scale));
        }
    }

    /// The drift of m minutes is chi-square with m degrees of freedom, times the square of the
    /// ratio of the innovations to their sigma. A drift of 1.5 per minute is 22.5 in 15 minutes,
    /// which chance exceeds in 10 %, and 225 in 150 minutes, 4.3 sigma of sqrt(2 * 150).
    #[test]
    fn means_over_a_minute_drift_where_enough_minutes_show_1_2_times_white_noise() {
        for scale in [1.0, 2.0] {
            let of = |minutes: f64, ratio: f64| {
                let drift = Drift { sum: minutes * ratio * ratio * scale * scale, minutes };
                let channel = ChannelStatistics { drift, ..statistics(10.0 * minutes, scale) };
                let found = found(&channel, true);
                let drifts = found.iter().filter(|f| f.0 == Criterion::Drift);
                drifts.map(|f| f.1).collect::<Vec<_>>()
            };
            assert_eq!(of(15.0, 1.5_f64.sqrt()), []);
            assert_eq!(of(150.0, 1.5_f64.sqrt()), [Severity::Doubtful]);
            assert_eq!(of(1e4, 1.19), []);
            assert_eq!(of(1e4, 1.21), [Severity::Doubtful]);
            assert_eq!(of(1e4, 1.99), [Severity::Doubtful]);
            // the drift has to show that it is beyond twice the expectation: sqrt(2 / 1e4) / 2 is
            // 0.7 % of the ratio, 3.29 of which are 2.3 %
            assert_eq!(of(1e4, 2.03), [Severity::Doubtful]);
            assert_eq!(of(1e4, 2.06), [Severity::DoNotUse]);
        }
        // two samples a minute
        let drift = Drift { sum: 9e4, minutes: 1e4 };
        let sparse = ChannelStatistics { drift, ..statistics(2e4, 1.0) };
        assert_eq!(found(&sparse, true), []);
        let dense = ChannelStatistics { drift, ..statistics(3e4, 1.0) };
        assert_eq!(found(&dense, true), [(Criterion::Drift, Severity::DoNotUse)]);
    }

    #[test]
    fn each_minute_adds_the_square_of_its_sum_over_its_number() {
        let mut channel = ChannelStatistics::new("x".to_owned());
        for u in [1.0, 2.0, 3.0] {
            channel.add(u, 10.0 * u);
        }
        channel.end_minute();
        channel.end_minute();
        channel.add(-2.0, -20.0);
        channel.end_minute();
        assert_eq!((channel.drift.sum, channel.drift.minutes), (36.0 / 3.0 + 4.0, 2.0));
        assert_eq!((channel.sum, channel.raw, channel.squares), (4.0, 40.0, 18.0));
        assert_eq!(channel.products, 2.0 + 6.0 - 6.0);
    }

    /// A correlation of two innovations has one product.
    #[test]
    fn a_channel_says_something_from_three_innovations_on() {
        let mut channel = ChannelStatistics::new("x".to_owned());
        (0..2).for_each(|_| channel.add(1.0, 1.0));
        assert!(!channel.used());
        channel.add(1.0, 1.0);
        assert!(channel.used());
    }

    /// The chi-square distribution of 15 degrees of freedom exceeds 39.72 with 1 / 2000: 2.65 per
    /// minute, and four times as much for a drift beyond twice the expectation.
    #[test]
    fn fifteen_minutes_show_a_drift_beyond_2_65_per_minute() {
        let of = |per_minute: f64| {
            let drift = Drift { sum: 15.0 * per_minute, minutes: 15.0 };
            let found = found(&ChannelStatistics { drift, ..statistics(150.0, 1.0) }, true);
            found.iter().map(|f| f.1).collect::<Vec<_>>()
        };
        assert_eq!((of(2.6), of(2.7)), (vec![], vec![Severity::Doubtful]));
        assert_eq!((of(10.5), of(10.7)), (vec![Severity::Doubtful], vec![Severity::DoNotUse]));
    }

    /// The chi-square distribution of 100 degrees of freedom exceeds 153.2 with 1 / 2000.
    #[test]
    fn a_hundred_innovations_show_a_ratio_beyond_the_root_of_1_532() {
        let of = |ratio| found(&statistics(100.0, ratio), false).len();
        assert_eq!((of(1.53_f64.sqrt()), of(1.535_f64.sqrt())), (0, 1));
    }
}
