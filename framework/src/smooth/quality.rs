//! Quality of a smoothed run: where its uncertainty is large, where filter and smoother contradict
//! each other, and how well the samples fit the smoothed run.
//!
//! The difference `d` of the smoothed estimate and the filter's has the covariance `P - P_s` if the
//! models are right, whatever `d` is caused by. So `d / sqrt(P - P_s)` of each component is N(0, 1)
//! (McReynolds, AIAA Guidance and Control Conference, 1984); it compares the filter with the
//! information of all later samples.
//!
//! The smoothed innovation `u = S^-1 y - K' G' lambda` has the covariance
//! `M = S^-1 + K' G' Lambda G K`, so `u' M^-1 u` is chi-square with one degree of freedom for each
//! channel (de Jong, J. Am. Stat. Assoc. 84, 1989). `R u` is the residual of the sample from the
//! smoothed run.

use super::change::Passes;
use crate::compose::Composition;
use crate::model::chi_square::band;
use crate::model::record::Epoch;
use crate::state::covariance::Covariance;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{Block, Layout, State};
use crate::units::time::Time;
use serde::Serialize;
use std::fmt::Write as _;

/// Largest number of parts into which a run is divided.
const PARTS: usize = 500;

/// Ratio of a sigma to its median over the run from which a part counts as weak.
const WEAK: f64 = 2.5;

/// Share of the sigma at the start below which the smoothed one has to fall somewhere in the run,
/// unless the component counts as not observed.
const UNOBSERVED: f64 = 0.9;

/// Share of the usual number of used samples below which a sensor is named.
const RARE: f64 = 0.5;

/// Difference of filter and smoother that is reported, in its sigma. A run with 40 components has
/// some 1e4 independent values, of which one exceeds 5 by chance in 0.6 % of the runs.
const CONTRADICTION: f64 = 5.0;

/// Probability that a sample of a consistent run counts as an outlier.
const OUTLIER: f64 = 1e-6;

/// Largest number of sentences of one kind.
const SENTENCES: usize = 20;

/// Sums over the samples of a sensor.
#[derive(Clone, Debug, Default)]
struct Fit {
    used: u64,
    /// Statistic and its degrees of freedom.
    sum: f64,
    freedom: f64,
    outliers: Counted,
    gated: u64,
    plausible: Counted,
}

/// Samples with the times of the first and the last one, s; the backward pass counts the last one
/// first.
#[derive(Clone, Debug, Default)]
struct Counted {
    count: u64,
    first: f64,
    last: f64,
}

impl Counted {
    fn add(&mut self, time: Time) {
        self.first = time.seconds();
        if self.count == 0 {
            self.last = self.first;
        }
        self.count += 1;
    }

    /// Number and times in words; `None` if there is no sample.
    fn words(&self, of: u64, kind: &str) -> Option<String> {
        let Self { count, first, last } = self;
        let samples = format!("{count} of {of} {kind} samples");
        match count {
            0 => None,
            1 => Some(format!("{samples}, at {first:.1} s,")),
            _ => Some(format!("{samples}, from {first:.1} to {last:.1} s,")),
        }
    }
}

/// Quality of a smoothed run, in words and numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct QualityReport {
    /// Spans in which the smoothed sigma of a component is far above its median, with the sensors
    /// that were used less than usual.
    pub weak: Vec<String>,
    /// Components whose smoothed sigma is at no time below 90 % of that at the start of the run.
    pub unobserved: Vec<String>,
    /// Components in which filter and smoothed run contradict each other.
    pub contradictions: Vec<String>,
    /// Gated samples that fit the smoothed run, and used samples that contradict it, for each
    /// sensor.
    pub reconsidered: Vec<String>,
    /// Fit of the samples of each sensor.
    pub sensors: Vec<SensorFit>,
    /// Passes, where more than one was allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passes: Option<Passes>,
}

/// Fit of a sensor's used samples to the smoothed run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorFit {
    /// Name of the sensor.
    pub sensor: String,
    /// Used samples.
    pub used: u64,
    /// Mean of the normalised smoothed innovation squared for each channel: 1 if the noise is
    /// right.
    pub mean: Option<f64>,
    /// Used samples that the whole run contradicts.
    pub outliers: u64,
    /// Gated samples, and those of them that would have passed their gate beside the smoothed run;
    /// none is counted as such beside considered states.
    pub gated: u64,
    /// See `gated`.
    pub plausible: u64,
}

/// A part of the run.
#[derive(Clone)]
struct Part {
    /// Largest smoothed sigma of each shown component, and the difference from the filter.
    sigmas: Vec<f64>,
    differences: Vec<f64>,
    /// Samples and channels that each sensor gave.
    samples: Vec<[f64; 2]>,
}

/// Collects the quality during the backward pass.
pub(super) struct Quality {
    start: Time,
    length: i64,
    parts: Vec<Part>,
    /// Sigma of each shown component before the first sample, and its smallest smoothed one.
    priors: Vec<f64>,
    smallest: Vec<f64>,
    /// Sums of each sensor.
    fits: Vec<Fit>,
    /// Bound of the statistic for each number of channels, found on first use.
    bounds: Vec<f64>,
}

/// Blocks that are judged, with the index of each one's first component: estimated states of the
/// present.
fn judged(layout: &Layout) -> impl Iterator<Item = (usize, &Block)> {
    let mut first = 0;
    let present = layout.blocks.iter().enumerate().filter(|(slot, _)| !layout.is_past(*slot));
    let estimated = present.map(|(_, block)| block).filter(|b| b.estimated());
    estimated.map(move |block| {
        first += block.operations.tangent;
        (first - block.operations.tangent, block)
    })
}

impl Quality {
    /// Prepares for a run between two times.
    pub(super) fn new(composition: &Composition, start: Time, end: Time) -> Self {
        let length = (end - start).nanos() / PARTS as i64 + 1;
        let components = judged(&composition.layout).map(|(_, b)| b.operations.tangent).sum();
        let sensors = composition.sensors.len();
        let part = Part {
            sigmas: vec![0.0; components],
            differences: vec![0.0; components],
            samples: vec![[0.0; 2]; sensors],
        };
        Self {
            start,
            length,
            parts: vec![part; PARTS],
            priors: vec![0.0; components],
            smallest: vec![f64::INFINITY; components],
            fits: vec![Fit::default(); sensors],
            bounds: Vec::new(),
        }
    }

    /// Index of the part of a time.
    fn at(&self, time: Time) -> usize {
        ((time - self.start).nanos() / self.length).clamp(0, PARTS as i64 - 1) as usize
    }

    /// Takes a smoothed estimate, and the differences of each error state from the filter in their
    /// sigma.
    pub(super) fn epoch(&mut self, epoch: &Epoch<'_>, differences: &[f64]) {
        let at = self.at(epoch.state.time);
        let part = &mut self.parts[at];
        for (first, block) in judged(epoch.layout) {
            let mut sigma = [0.0; MAX_TANGENT];
            block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
            for (k, row) in block.tangent_range().enumerate() {
                let (most, largest) =
                    (&mut part.sigmas[first + k], &mut part.differences[first + k]);
                *most = most.max(sigma[k]);
                *largest = largest.max(differences[row].abs());
                self.smallest[first + k] = self.smallest[first + k].min(sigma[k]);
            }
        }
    }

    /// Takes the state and the covariance with which the filter began.
    pub(super) fn begin(&mut self, layout: &Layout, state: &State, covariance: &Covariance) {
        for (first, block) in judged(layout) {
            let mut sigma = [0.0; MAX_TANGENT];
            block.show_sigma(&state.values, covariance, &mut sigma);
            let tangent = block.operations.tangent;
            self.priors[first..first + tangent].copy_from_slice(&sigma[..tangent]);
        }
    }

    /// Takes a sample that corrected the filter, and the square of its smoothed innovation.
    pub(super) fn sample(&mut self, sensor: usize, time: Time, m: usize, square: Option<f64>) {
        let at = self.at(time);
        let [samples, channels] = &mut self.parts[at].samples[sensor];
        *samples += 1.0;
        *channels += m as f64;
        let Some(square) = square else { return };
        while self.bounds.len() <= m {
            let freedom = self.bounds.len().max(1) as f64;
            self.bounds.push(band(freedom, 2.0 * freedom, 2.0 * OUTLIER).high);
        }
        let fit = &mut self.fits[sensor];
        fit.used += 1;
        fit.sum += square;
        fit.freedom += m as f64;
        if square > self.bounds[m] {
            fit.outliers.add(time);
        }
    }

    /// Takes a gated sample, and whether it would pass its gate beside the smoothed run.
    pub(super) fn gated(&mut self, sensor: usize, time: Time, plausible: Option<bool>) {
        let fit = &mut self.fits[sensor];
        fit.gated += 1;
        if plausible == Some(true) {
            fit.plausible.add(time);
        }
    }

    /// Sums the run up.
    pub(super) fn report(self, composition: &Composition) -> QualityReport {
        let (mut weak, mut contradictions, mut unobserved) = (Vec::new(), Vec::new(), Vec::new());
        let sensors = composition.sensors.iter();
        let sensors: Vec<_> = sensors.map(|s| (&*s.info.name, s.info.channels.len())).collect();
        for (first, block) in judged(&composition.layout) {
            for k in 0..block.operations.tangent {
                let component = block.spec.display.components.get(k).copied().unwrap_or("");
                let name = format!("{} {component}", block.name);
                let unit = block.spec.display.unit;
                weak.extend(self.weak(first + k, name.trim_end(), unit, &sensors));
                contradictions.extend(self.contradiction(first + k, name.trim_end()));
                let (prior, smallest) = (self.priors[first + k], self.smallest[first + k]);
                if smallest.is_finite() && smallest >= UNOBSERVED * prior {
                    unobserved.push(name.trim_end().to_owned());
                }
            }
        }
        // the worst first
        weak.sort_by(|a, b| b.0.total_cmp(&a.0));
        contradictions.sort_by(|a, b| b.0.total_cmp(&a.0));
        let words = |found: Vec<(f64, String)>| {
            found.into_iter().take(SENTENCES).map(|(_, text)| text).collect()
        };
        let sensors = composition.sensors.iter().map(|s| &s.info.name).zip(&self.fits);
        let judged = sensors.clone().filter(|(_, fit)| fit.used + fit.gated > 0);
        let judged = judged.map(|(sensor, fit)| SensorFit {
            sensor: sensor.clone(),
            used: fit.used,
            mean: (fit.freedom > 0.0).then(|| fit.sum / fit.freedom),
            outliers: fit.outliers.count,
            gated: fit.gated,
            plausible: fit.plausible.count,
        });
        let reconsidered = sensors.flat_map(|(sensor, fit)| {
            let good = fit.plausible.words(fit.gated, "gated");
            let bad = fit.outliers.words(fit.used, "used");
            let good = good.map(|samples| {
                format!(
                    "{sensor}: {samples} would have passed the gate beside the smoothed run: the \
                     filter was wrong there, not the sensor"
                )
            });
            let bad = bad.map(|samples| {
                format!(
                    "{sensor}: {samples} contradict the smoothed run: a tighter gate or \
                         `robust` keeps such samples out"
                )
            });
            [good, bad].into_iter().flatten()
        });
        QualityReport {
            reconsidered: reconsidered.collect(),
            sensors: judged.collect(),
            weak: words(weak),
            unobserved,
            contradictions: words(contradictions),
            passes: None,
        }
    }

    /// Times of a span of parts.
    fn span(&self, from: usize, to: usize) -> String {
        let time = |part: usize| {
            let nanos = self.start.nanos() + part as i64 * self.length;
            Time::from_nanos(nanos).seconds()
        };
        format!("from {:.0} to {:.0} s", time(from), time(to))
    }

    /// Spans of parts that fulfil a condition; a part without an estimate fulfils none and ends
    /// none.
    fn spans(&self, holds: impl Fn(&Part) -> Option<bool>) -> Vec<(usize, usize)> {
        let mut spans: Vec<(usize, usize)> = Vec::new();
        let mut open = false;
        for (at, part) in self.parts.iter().enumerate() {
            match (holds(part), spans.last_mut().filter(|_| open)) {
                (None, _) => {}
                (Some(true), Some(last)) => last.1 = at + 1,
                (Some(true), None) => {
                    spans.push((at, at + 1));
                    open = true;
                }
                (Some(false), _) => open = false,
            }
        }
        spans
    }

    /// Spans in which a component is weak: the ratio to its median, and the sentence. `sensors` has
    /// the name of each sensor, and the number of its channels.
    fn weak(
        &self,
        component: usize,
        name: &str,
        unit: &str,
        sensors: &[(&str, usize)],
    ) -> Vec<(f64, String)> {
        let of = |part: &Part| Some(part.sigmas[component]).filter(|sigma| *sigma > 0.0);
        let Some(usual) = median(self.parts.iter().filter_map(of)) else { return Vec::new() };
        let spans = self.spans(|part| of(part).map(|sigma| sigma > WEAK * usual));
        let sentence = |(from, to): (usize, usize)| {
            let sigma = self.parts[from..to].iter().filter_map(of).fold(0.0, f64::max);
            let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
            let mut text = format!(
                "{name} {}: 1-sigma up to {sigma:.3}{unit}, {:.1} times the usual one",
                self.span(from, to),
                sigma / usual
            );
            for (k, &(sensor, channels)) in sensors.iter().enumerate() {
                if let Some(cause) = self.rare(k, from, to, channels) {
                    let _ = write!(text, "; {sensor}: {cause}");
                }
            }
            (sigma / usual, text)
        };
        spans.into_iter().map(sentence).collect()
    }

    /// Words for a sensor that was used less than usual in a span.
    fn rare(&self, sensor: usize, from: usize, to: usize, channels: usize) -> Option<String> {
        let of = |part: &Part| part.samples[sensor];
        let usual = median(self.parts.iter().map(|part| of(part)[0]).filter(|n| *n > 0.0))?;
        let [samples, given] = self.parts[from..to].iter().fold([0.0; 2], |sum, part| {
            let [samples, channels] = of(part);
            [sum[0] + samples, sum[1] + channels]
        });
        let share = samples / (usual * (to - from) as f64);
        let rows = median(self.parts.iter().map(of).filter(|s| s[0] > 0.0).map(|s| s[1] / s[0]))?;
        if samples == 0.0 {
            Some("no sample used".to_owned())
        } else if share < RARE {
            Some(format!("{:.0} % of the usual number of samples used", 100.0 * share))
        } else if given / samples < 0.75 * rows {
            Some(format!("{:.1} of {channels} channels on average", given / samples))
        } else {
            None
        }
    }

    /// Largest contradiction of filter and smoother in a component, and the sentence.
    fn contradiction(&self, component: usize, name: &str) -> Option<(f64, String)> {
        let of = |part: &Part| part.differences[component];
        let spans = self.spans(|part| Some(of(part) > CONTRADICTION));
        let largest = self.parts.iter().map(of).fold(0.0, f64::max);
        let (from, to) = *spans.iter().max_by(|a, b| {
            let most = |s: &(usize, usize)| self.parts[s.0..s.1].iter().map(of).fold(0.0, f64::max);
            most(a).total_cmp(&most(b))
        })?;
        let text = format!(
            "{name}: the filter differs from the smoothed run by {largest:.1} sigma of the \
             difference {}; a noise, a prior or a model is wrong there",
            self.span(from, to)
        );
        Some((largest, text))
    }
}

/// Median of some numbers.
fn median(numbers: impl Iterator<Item = f64>) -> Option<f64> {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied()
}

#[cfg(test)]
mod tests;
