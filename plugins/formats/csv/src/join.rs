//! Two files of one sensor: the channels of the second are interpolated to the times of the first.

use crate::cells::ChannelCell;
use crate::sequence::Files;
use navfuse_core::model::record::Event;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// Longest interval of the second file that is interpolated, in nanoseconds.
const LONGEST: i64 = 500_000_000;

/// The samples of two files.
pub struct Joined {
    first: Files,
    second: Files,
    /// The samples of the second file around the time of the first.
    around: [Option<Sample>; 2],
    /// Number of samples of the first file without one of the second on each side.
    alone: u64,
}

impl Joined {
    /// Joins the files of a sensor.
    ///
    /// # Errors
    /// When a channel has a column in both of them or in none.
    pub fn new([first, second]: [Files; 2], info: &SensorInfo) -> Result<Self, StreamError> {
        let has = |files: &Files, k: usize| channels(files).iter().any(|c| c.channel == k);
        for (k, channel) in info.channels.iter().enumerate() {
            let fault = match (has(&first, k), has(&second, k)) {
                (true, true) => "stands in both files",
                (false, false) if info.purpose == Purpose::Input => "stands in none of the files",
                _ => continue,
            };
            let text = format!("the channel {} {fault}", channel.name);
            let error = StreamError::format(text).of_sensor(&info.name);
            return Err(match second.first() {
                Some(file) => error.in_file(&file.path),
                None => error,
            });
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

/// The channels that files have.
fn channels(files: &Files) -> &[ChannelCell] {
    files.first().map_or(&[], |file| &file.channels)
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
                    add(sample, &both, channels(&self.second).iter().map(|c| c.channel));
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
            let path = |files: &Files| files.first().map(|file| file.path.display().to_string());
            let [first, second] =
                [&self.first, &self.second].map(|files| path(files).unwrap_or_default());
            format!("{first}: {} rows without one of {second} on each side", self.alone)
        });
        let texts = [self.first.warning(), self.second.warning(), alone];
        let texts: Vec<String> = texts.into_iter().flatten().collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}
