//! Samples of a run, gathered without running the filter, or while it runs and in bounded memory.

use crate::gather::{Builder, imu_of};
use crate::{Recording, SegmentError};
use navfuse_core::compose::Composition;
use navfuse_core::model::record::Record;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::session::Finished;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::thin::{Merge, Thin};
use navfuse_core::units::time::Time;
use navfuse_ins::Output;

/// Greatest number of samples that are kept of one sensor: 18 hours of an IMU at 1 Hz, which is
/// the bin of the finder of segments.
const SAMPLES: usize = 1 << 16;
/// Number of channels of an IMU: three angles or rates, three velocities or forces.
const CHANNELS: usize = 6;

impl Recording {
    /// Gathers the samples of a scenario up to its `estimator.stop`, including those before the
    /// filter's start.
    ///
    /// # Errors
    /// Returns an error if the scenario does not compose, a source fails, or there are no IMU
    /// samples.
    pub fn read(scenario: &Scenario<'_>) -> Result<Self, SegmentError> {
        Self::gather(scenario.assemble(None)?, |_, _| {})
    }

    /// Gathers the samples of an assembly, as [`Self::read`] does. `progress` receives the current
    /// time, and the end if it is known.
    ///
    /// # Errors
    /// Returns an error as [`Self::read`] does.
    pub fn gather(
        assembly: Assembly,
        mut progress: impl FnMut(Time, Option<Time>),
    ) -> Result<Self, SegmentError> {
        let Assembly { composition, sources, .. } = assembly;
        let stop = composition.estimator.stop();
        let end = sources.iter().filter_map(|(_, s)| s.end()).max();
        let end = stop.map_or(end, |stop| Some(end.map_or(stop, |end| end.min(stop))));
        let mut samples: Vec<Vec<Sample>> =
            composition.sensors.iter().map(|_| Vec::new()).collect();
        let mut dropped = vec![0_usize; samples.len()];
        let mut warnings = Vec::new();
        let mut count = 0_u64;
        for (name, mut source) in sources {
            let mut sample = Sample::empty(Time::MIN, SensorId(0));
            while source
                .next(&mut sample)
                .map_err(|error| SegmentError::Source { name: name.clone(), error })?
            {
                if stop.is_some_and(|stop| sample.time > stop) {
                    break;
                }
                if let Some((list, dropped)) =
                    samples.get_mut(sample.sensor.0).zip(dropped.get_mut(sample.sensor.0))
                {
                    if sample.not_finite().is_none() {
                        list.push(sample);
                    } else {
                        *dropped += 1;
                    }
                }
                count += 1;
                if count.is_multiple_of(16384) {
                    progress(sample.time, end);
                }
            }
            warnings.extend(source.warning().map(|text| format!("{name}: {text}")));
        }
        samples.iter_mut().for_each(|list| list.sort_by_key(|s| s.time));
        warnings.extend(dropped_samples(&composition, &dropped));
        Ok(Self { warnings, ..Builder::new(&composition, samples)?.build()? })
    }
}

/// Sink that gathers the samples of a run for a [`Recording`].
///
/// It keeps a bounded number of samples of each sensor. Whenever there are that many, it joins the
/// samples of the IMU by twos, as if the instrument had averaged over twice the interval. Of every
/// other sensor it then keeps each second sample, whose noise stays that of the sensor.
pub struct Gatherer {
    sensors: Vec<Kept>,
}

impl Gatherer {
    /// A sink for the samples of a composition.
    pub fn new(composition: &Composition) -> Self {
        Self::limited(composition, SAMPLES)
    }

    fn limited(composition: &Composition, limit: usize) -> Self {
        let imu = imu_of(composition);
        let kept = |index| {
            let joined = imu.filter(|(at, _)| *at == index).map(|(_, imu)| imu.output);
            Kept::new(joined, limit)
        };
        Self { sensors: (0..composition.sensors.len()).map(kept).collect() }
    }

    /// Takes the recording out of a finished run of the composition.
    ///
    /// # Errors
    /// When the run has no gatherer, or no samples of an IMU.
    pub fn take(
        finished: &mut Finished,
        composition: &Composition,
    ) -> Result<Recording, SegmentError> {
        let missing = || SegmentError::Missing("the run gathered no samples".into());
        finished.take_sink::<Self>().ok_or_else(missing)?.recording(composition)
    }

    fn recording(self, composition: &Composition) -> Result<Recording, SegmentError> {
        let dropped: Vec<usize> = self.sensors.iter().map(|kept| kept.dropped).collect();
        let samples = self.sensors.into_iter().map(Kept::finish).collect();
        let warnings = dropped_samples(composition, &dropped).collect();
        Ok(Recording { warnings, ..Builder::new(composition, samples)?.build()? })
    }
}

/// Warnings of the sensors of which samples that were not finite were dropped.
pub(crate) fn dropped_samples(
    composition: &Composition,
    dropped: &[usize],
) -> impl Iterator<Item = String> {
    let some = composition.sensors.iter().zip(dropped).filter(|(_, count)| **count > 0);
    some.map(|(sensor, count)| {
        let name = &sensor.info.name;
        format!(
            "[sensor.{name}]: {count} samples are not finite and were dropped: check its source"
        )
    })
}

/// Samples of one sensor: those of an IMU are joined, and of another sensor each n-th one is kept.
struct Kept {
    samples: Thin<Joined>,
    /// Output of an IMU.
    joined: Option<Output>,
    /// Time of the last sample.
    last: Option<Time>,
    /// Number of samples that were not finite.
    dropped: usize,
}

impl Kept {
    fn new(joined: Option<Output>, limit: usize) -> Self {
        Self { samples: Thin::with_rows(limit), joined, last: None, dropped: 0 }
    }

    fn push(&mut self, sample: &Sample) {
        if sample.not_finite().is_some() {
            self.dropped += 1;
            return;
        }
        if self.joined.is_some() && sample.array::<CHANNELS>(0).is_none() {
            return;
        }
        let before = self.last.replace(sample.time);
        self.samples.push(Joined { sample: *sample, before, output: self.joined });
    }

    fn finish(self) -> Vec<Sample> {
        self.samples.into_rows().into_iter().map(|joined| joined.sample).collect()
    }
}

/// A sample that may stand for several.
struct Joined {
    sample: Sample,
    /// Time of the sample before the first of them.
    before: Option<Time>,
    /// Output of an IMU; `None` for a sensor whose first sample stands for all.
    output: Option<Output>,
}

impl Merge for Joined {
    /// Joins two samples to one over the intervals of both.
    fn merge(&mut self, next: Self) {
        let (Some(output), a, b) = (self.output, self.sample, next.sample) else { return };
        let second = b.time.since(a.time);
        let first = self.before.map_or(second, |before| a.time.since(before));
        let [wa, wb] = match output {
            Output::Rates if first + second > 0.0 => {
                [first / (first + second), second / (first + second)]
            }
            Output::Rates => [0.5; 2],
            Output::Increments => [1.0; 2],
        };
        self.sample = Sample::empty(b.time, b.sensor);
        for k in 0..CHANNELS {
            if let Some((x, y)) = a.get(k).zip(b.get(k)) {
                self.sample.set(k, wa * x + wb * y);
            }
        }
    }
}

impl Sink for Gatherer {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Sample(sample) = record else { return Ok(()) };
        if let Some(kept) = self.sensors.get_mut(sample.sensor.0) {
            kept.push(sample);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::units::sample::SensorId;

    const LIMIT: usize = 64;

    /// Sample `k` of 100 Hz, with the same value in all channels.
    fn sample(k: usize, value: f64) -> Sample {
        let time = Time::from_nanos(10_000_000 * (k as i64 + 1));
        Sample::new(time, SensorId(0), &[value; CHANNELS])
    }

    /// Keeps `count` samples whose values are their numbers.
    fn kept(joined: Option<Output>, count: usize) -> Vec<Sample> {
        let mut kept = Kept::new(joined, LIMIT);
        for k in 0..count {
            kept.push(&sample(k, k as f64));
            assert!(kept.samples.rows().len() <= LIMIT);
        }
        kept.finish()
    }

    #[test]
    fn a_long_run_keeps_few_samples_and_the_sum_of_its_increments() {
        for count in [10, LIMIT - 1, LIMIT, 1000, 10_001] {
            let samples = kept(Some(Output::Increments), count);
            let sum: f64 = samples.iter().filter_map(|s| s.get(0)).sum();
            assert_eq!(sum, (count * (count - 1) / 2) as f64);
            assert_eq!(samples.last().map(|s| s.time), Some(sample(count - 1, 0.0).time));
            assert!(samples.windows(2).all(|w| w[0].time < w[1].time));
        }
    }

    #[test]
    fn joined_rates_have_the_mean_over_their_interval() {
        let samples = kept(Some(Output::Rates), 1000);
        let mut from = 0.0;
        for s in &samples {
            let to = (s.time.seconds() * 100.0).round(); // the number after the last one joined
            let mean = 0.5 * (from + to - 1.0);
            assert!(s.get(0).is_some_and(|rate| (rate - mean).abs() < 1e-9), "{s:?}: {mean}");
            from = to;
        }
    }

    #[test]
    fn samples_of_other_sensors_are_thinned_and_not_averaged() {
        let samples = kept(None, 1000);
        assert!(samples.len() > LIMIT / 4);
        for s in &samples {
            assert_eq!(s.get(0), Some((s.time.seconds() * 100.0).round() - 1.0));
        }
    }

    #[test]
    fn a_sample_that_is_not_finite_is_counted() {
        let mut kept = Kept::new(None, LIMIT);
        kept.push(&sample(0, f64::NAN));
        assert_eq!((kept.dropped, kept.finish().len()), (1, 0));
    }
}
