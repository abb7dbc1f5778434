//! Two files of one sensor: the channels of the second are interpolated to the times of the first.

use crate::config::FileConfig;
use crate::stream::Stream;
use navfuse_core::model::record::Event;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::path::Path;

/// Longest interval of the second file that is interpolated, in nanoseconds.
const LONGEST: i64 = 500_000_000;

/// The samples of two files.
pub struct Joined {
    first: Stream,
    second: Stream,
    /// The samples of the second file around the time of the first.
    around: [Option<Sample>; 2],
    /// Number of samples of the first file without one of the second on each side.
    alone: u64,
}

impl Joined {
    /// Opens the two files of a sensor.
    ///
    /// # Errors
    /// When a file cannot be read, or a channel has a column in both of them or in none.
    pub fn open(
        paths: [&Path; 2],
        configs: [&FileConfig; 2],
        (sensor, info): (SensorId, &SensorInfo),
    ) -> Result<Self, StreamError> {
        let first = Stream::open(paths[0], configs[0], (sensor, info), true)?;
        let second = Stream::open(paths[1], configs[1], (sensor, info), true)?;
        let has = |stream: &Stream, k: usize| stream.channels.iter().any(|c| c.channel == k);
        for (k, channel) in info.channels.iter().enumerate() {
            let fault = match (has(&first, k), has(&second, k)) {
                (true, true) => "stands in both files",
                (false, false) if info.purpose == Purpose::Input => "stands in none of the files",
                _ => continue,
            };
            let text = format!("the channel {} {fault}", channel.name);
            return Err(StreamError::format(text).in_file(paths[1]).of_sensor(&info.name));
        }
        Ok(Self { first, second, around: [None, None], alone: 0 })
    }

    /// Reads the second file up to a time, and returns its samples around it.
    fn around(&mut self, time: Time) -> Result<Option<[Sample; 2]>, StreamError> {
        while self.around[1].is_none_or(|after| after.time < time) {
            let mut sample = Sample::empty(time, SensorId(0));
            if !self.second.next(&mut sample)? {
                return Ok(None);
            }
            self.around = [self.around[1], Some(sample)];
        }
        let [before, after] = self.around;
        let near = |[a, b]: &[Sample; 2]| a.time <= time && (b.time - a.time).nanos() <= LONGEST;
        // the first sample of the second file may have the time itself
        let both = before.or(after).zip(after).map(|(before, after)| [before, after]);
        Ok(both.filter(near))
    }
}

/// Adds the channels of the second file to a sample, on the line between two samples.
fn add(sample: &mut Sample, [before, after]: &[Sample; 2], channels: impl Iterator<Item = usize>) {
    let whole = (after.time - before.time).nanos() as f64;
    let part = (sample.time - before.time).nanos() as f64;
    let share = if whole > 0.0 { part / whole } else { 0.0 };
    for k in channels {
        if let Some((a, b)) = before.get(k).zip(after.get(k)) {
            sample.set(k, a + share * (b - a));
        }
    }
}

impl Source for Joined {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        while self.first.next(sample)? {
            match self.around(sample.time)? {
                Some(both) => {
                    add(sample, &both, self.second.channels.iter().map(|c| c.channel));
                    return Ok(true);
                }
                None => self.alone += 1,
            }
        }
        Ok(false)
    }

    fn end(&self) -> Option<Time> {
        self.first.end()
    }

    fn schedule(&self) -> Vec<Event> {
        Vec::new()
    }

    fn warning(&mut self) -> Option<String> {
        let alone = (self.alone > 0).then(|| {
            let (first, second) = (self.first.path.display(), self.second.path.display());
            format!("{first}: {} rows without one of {second} on each side", self.alone)
        });
        let texts = [self.first.warning(), self.second.warning(), alone];
        let texts: Vec<String> = texts.into_iter().flatten().collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}
