//! Samples that share a stamp, as those of one message or of one second, at even times up to the next stamp.

use navfuse_core::model::stream::StreamError;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Span;
use std::collections::VecDeque;

/// Largest number of samples with one stamp.
const MOST: usize = 100_000;

/// The samples of one stamp, and those of the stamp before with times of their own.
#[derive(Debug, Default)]
pub struct Spread {
    group: Vec<Sample>,
    ready: VecDeque<Sample>,
    /// Time between the last two stamps, and between two samples in it.
    length: Option<Span>,
    step: Span,
    /// Set once the first group, which may lack samples, is over.
    begun: bool,
    ended: bool,
}

impl Spread {
    /// The next sample, from samples as the file has them; `false` at the end.
    ///
    /// # Errors
    /// As for the samples of the file, and where more than 100 000 share a stamp.
    pub fn next(
        &mut self,
        sample: &mut Sample,
        mut read: impl FnMut(&mut Sample) -> Result<bool, StreamError>,
    ) -> Result<bool, StreamError> {
        loop {
            if let Some(first) = self.ready.pop_front() {
                *sample = first;
                return Ok(true);
            }
            if self.ended {
                return Ok(false);
            }
            let mut next = *sample;
            let more = read(&mut next)?;
            let same = self.group.first().is_some_and(|first| more && first.time == next.time);
            if !same {
                self.end_group(more.then_some(&next));
            }
            if self.group.len() == MOST {
                let text = format!("more than {MOST} rows share the time {} s", next.time);
                return Err(StreamError::format(text).with_remedy("give a time to each row"));
            }
            match more {
                true => self.group.push(next),
                false => self.ended = true,
            }
        }
    }

    /// Spreads the samples of a stamp up to the next one. At the end of the file, and before a gap, their interval is that
    /// of the samples before.
    fn end_group(&mut self, next: Option<&Sample>) {
        let Some(first) = self.group.first().map(|first| first.time) else { return };
        let gap = |length: &Span| self.length.is_some_and(|usual| *length > usual + usual);
        let length = next.map(|next| next.time - first);
        if let Some(length) = length.filter(|length| !gap(length)) {
            let count = i64::try_from(self.group.len()).unwrap_or(i64::MAX);
            self.step = Span::from_nanos(length.nanos() / count);
            self.length = Some(length);
        }
        let mut time = first;
        let begun = std::mem::replace(&mut self.begun, true);
        for mut sample in self.group.drain(..).filter(|_| begun) {
            sample.time = time;
            self.ready.push_back(sample);
            time = time + self.step;
        }
    }
}
