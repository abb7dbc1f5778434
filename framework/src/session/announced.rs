//! Entries of a run's log whose time is known beforehand.

use crate::checkpoint::saved;
use crate::model::record::{Event, Level, Observer};
use crate::units::time::Time;
use std::collections::VecDeque;

/// Events of the log that wait for their time, and remarks for its beginning and its end.
pub(crate) struct Announced {
    /// Notes for the first sample, each with the part that it is about.
    notes: VecDeque<(String, String)>,
    /// Events in order of time, the last one first.
    events: Vec<Event>,
    /// Warnings for the end.
    warnings: Vec<(String, String)>,
}

saved!(Announced { notes, events, warnings });

impl Announced {
    pub(crate) fn new(notes: Vec<(String, String)>) -> Self {
        Self { notes: notes.into(), events: Vec::new(), warnings: Vec::new() }
    }

    pub(crate) fn add(&mut self, events: Vec<Event>) {
        self.events.extend(events);
        self.events.sort_by_key(|e| std::cmp::Reverse(e.time));
    }

    pub(crate) fn add_warning(&mut self, about: String, text: String) {
        self.warnings.push((about, text));
    }

    /// Logs the notes, once.
    pub(crate) fn begin(&mut self, time: Time, log: &mut dyn Observer) {
        while let Some((about, text)) = self.notes.pop_front() {
            log.event(Event { time, level: Level::Info, about, text });
        }
    }

    /// Logs the events up to a time.
    pub(crate) fn reach(&mut self, now: Time, log: &mut dyn Observer) {
        while let Some(mut event) = self.events.pop_if(|e| e.time <= now) {
            // an event without a time belongs to the beginning
            if event.time == Time::MIN {
                event.time = now;
            }
            log.event(event);
        }
    }

    /// Logs the warnings.
    pub(crate) fn end(&mut self, time: Time, log: &mut dyn Observer) {
        for (about, text) in std::mem::take(&mut self.warnings) {
            log.event(Event { time, level: Level::Warning, about, text });
        }
    }
}
