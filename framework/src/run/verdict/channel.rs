//! Innovations of one channel.

use super::report::{SLIGHT, UNTRUE, size};
use crate::model::chi_square::{outside, sigmas};
use crate::model::finding::Severity;
use crate::model::verdict::Criterion;

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
    /// Sum and number of the minute so far.
    minute: (f64, f64),
    /// Sum over the minutes of `(sum of u)^2 / n`, each of expectation 1, and their number.
    drift: (f64, f64),
}

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
        self.minute.0 += u;
        self.minute.1 += 1.0;
    }

    pub(crate) fn end_minute(&mut self) {
        let (sum, count) = std::mem::take(&mut self.minute);
        if count > 0.0 {
            self.drift.0 += sum * sum / count;
            self.drift.1 += 1.0;
        }
    }

    /// Returns `true` if the channel has enough innovations for a statement.
    pub(crate) fn used(&self) -> bool {
        self.count >= 3.0
    }

    /// Finds the departures of the channel, of a sensor of `channels` channels. `white` is set
    /// if a consistent filter gives white innovations, `inside` if the sensor's mean NIS is in its
    /// band.
    pub(crate) fn judge(
        &self,
        alpha: f64,
        (white, channels, inside): (bool, usize, bool),
        found: &mut Vec<Departure>,
    ) {
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
            let (severity, words, remedy) = size(ratio);
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
        let (drift, minutes) = self.drift;
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
