//! The warnings of a run as they come, on standard error.

use super::run::event;
use super::terminal::Detail;
use navfuse_core::model::record::{Event, Level};
use std::collections::{BTreeMap, HashSet};
use std::time::{Duration, Instant};

/// Warnings about one part that are printed at once, and the time after which it may have another.
const AT_ONCE: u32 = 3;
const PAUSE: Duration = Duration::from_secs(10);
/// Texts that are remembered: a run keeps as many warnings for its end.
const REMEMBERED: usize = 1000;

/// Prints the warnings of a run, of each part at most three at once and then one in 10 s, and all
/// errors; notes too where the amount of output asks for all.
#[derive(Default)]
pub struct Warnings {
    parts: BTreeMap<String, Part>,
    printed: HashSet<[String; 2]>,
}

/// The warnings about one part.
struct Part {
    /// Warnings that may be printed now.
    left: u32,
    /// The moment from which on the next one counts.
    since: Instant,
    /// Warnings that were left out since the last one that was printed.
    left_out: u64,
}

impl Part {
    /// Takes a warning; `false` where it is left out.
    fn take(&mut self, now: Instant) -> bool {
        while self.left < AT_ONCE && now.saturating_duration_since(self.since) >= PAUSE {
            (self.left, self.since) = (self.left + 1, self.since + PAUSE);
        }
        if self.left == AT_ONCE {
            self.since = now;
        }
        let printed = self.left > 0;
        self.left = self.left.saturating_sub(1);
        self.left_out += u64::from(!printed);
        printed
    }
}

impl Warnings {
    /// Prints an event, unless there were too many about its part.
    pub fn take(&mut self, happened: &Event) {
        if let Some(left_out) = self.admit(happened, Instant::now()) {
            event(happened, left_out);
        }
    }

    /// Decides on an event; the number of those about its part that were left out before it.
    fn admit(&mut self, event: &Event, now: Instant) -> Option<u64> {
        let all = Detail::get() == Detail::Verbose;
        if event.level == Level::Info && !all {
            return None;
        }
        let new = || Part { left: AT_ONCE, since: now, left_out: 0 };
        let part = self.parts.entry(event.about.clone()).or_insert_with(new);
        if !part.take(now) && !all && event.level < Level::Error {
            return None;
        }
        if self.printed.len() < REMEMBERED {
            self.printed.insert([event.about.clone(), event.text.clone()]);
        }
        Some(std::mem::take(&mut part.left_out))
    }

    /// The events of a run that were not printed as they came.
    pub fn others(&self, events: &[Event]) -> Vec<Event> {
        let printed = |e: &Event| self.printed.contains(&[e.about.clone(), e.text.clone()]);
        events.iter().filter(|e| !printed(e)).cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_warns_often_is_printed_now_and_then_and_hides_no_other() {
        let (mut warnings, begin) = (Warnings::default(), Instant::now());
        let warning = |about: &str, text: String| Event {
            level: Level::Warning,
            about: about.to_owned(),
            text,
            ..Event::default()
        };
        // ten warnings a second for 65 s
        let printed: Vec<(u64, u64)> = (0..650)
            .filter_map(|k| {
                let event = warning("dvl", format!("{k}"));
                let left_out = warnings.admit(&event, begin + Duration::from_millis(100 * k))?;
                Some((k, left_out))
            })
            .collect();
        // three at once, then one every 10 s, which counts the others
        let expected = [(0, 0), (1, 0), (2, 0), (100, 97), (200, 99)];
        assert_eq!(printed[..5], expected);
        assert_eq!(printed.len(), 9);
        let other = warning("udp", "lost".to_owned());
        assert_eq!(warnings.admit(&other, begin + Duration::from_secs(65)), Some(0));
        // the others are for the end
        let events = [warning("dvl", "1".to_owned()), warning("dvl", "3".to_owned()), other];
        assert_eq!(warnings.others(&events), events[1..2]);
    }
}
