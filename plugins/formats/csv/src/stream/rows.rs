//! The samples of a file, row by row.

use super::{Row, Stream};
use navfuse_core::model::record::Event;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;

impl Stream {
    /// Reads the next row that is a sample; `false` at the end.
    fn next_row(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            let line = self.reader.position().line();
            let more = self.read_row();
            let row = |e| StreamError::read(&self.path, e).on_line(line);
            if !more.map_err(row)? {
                return Ok(false);
            }
            match self.row(sample) {
                Ok(Row::Sample) => return Ok(true),
                Ok(Row::Empty) => {}
                Ok(Row::Unused(why)) => {
                    let line = if self.unused.has(why) { 0 } else { self.line() };
                    self.unused.add(why, line);
                }
                Err(problem) => {
                    let line = self.line();
                    if problem.cut && self.ends_within_line() {
                        self.cut = Some(format!(
                            "{}:{line}: the file ends within this line, which is not used: \
                             was it cut off?",
                            self.path.display()
                        ));
                        return Ok(false);
                    }
                    if let Some(lines) = self.trailer() {
                        let (path, last) = (self.path.display(), line + lines as u64 - 1);
                        self.cut = Some(format!(
                            "{path}: the lines {line} to {last} at the end are no rows and are not used"
                        ));
                        return Ok(false);
                    }
                    return Err(StreamError::of(problem.kind, problem.text)
                        .in_file(&self.path)
                        .on_line(line));
                }
            }
        }
    }
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let Some(mut spread) = self.spread.take() else { return self.next_row(sample) };
        let more = spread.next(sample, |sample| self.next_row(sample));
        self.spread = Some(spread);
        more
    }

    fn end(&self) -> Option<Time> {
        self.end
    }

    fn schedule(&self) -> Vec<Event> {
        let (time, about) = (Time::MIN, &self.name);
        let note = self.note.clone();
        let event = |(level, text)| Event { time, level, about: about.clone(), text };
        note.map(event).into_iter().collect()
    }

    fn warning(&mut self) -> Option<String> {
        let unused = std::mem::take(&mut self.unused).texts(&self.path);
        let turns = self.counter.text(&self.path);
        let texts: Vec<String> = unused.into_iter().chain(self.cut.take()).chain(turns).collect();
        (!texts.is_empty()).then(|| texts.join("; "))
    }
}
