//! The events of a run as they come: of the filter, and of the driver before the log has them.

use navfuse_core::model::record::{Event, Record, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Events that nobody has seen yet.
#[derive(Clone, Debug, Default)]
pub struct Events {
    shared: Arc<Mutex<Shared>>,
}

#[derive(Debug, Default)]
struct Shared {
    fresh: Vec<Event>,
    /// Events of the driver, which come back once the samples reach them.
    announced: Vec<Event>,
}

impl Events {
    fn lock(&self) -> MutexGuard<'_, Shared> {
        // a list is a list, whatever happened to a thread that held it
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes an event of the driver, which the session will pass on as well.
    pub fn announce(&self, event: &Event) {
        let mut shared = self.lock();
        shared.fresh.push(event.clone());
        shared.announced.push(event.clone());
    }

    /// The events since the last call.
    pub fn fresh(&self) -> Vec<Event> {
        std::mem::take(&mut self.lock().fresh)
    }

    fn take_event(&self, event: &Event) {
        let mut shared = self.lock();
        let same = |other: &Event| other.about == event.about && other.text == event.text;
        match shared.announced.iter().position(same) {
            Some(known) => drop(shared.announced.remove(known)),
            None => shared.fresh.push(event.clone()),
        }
    }
}

impl Sink for Events {
    fn wants(&self) -> Wants {
        Wants::EVENTS | Wants::FINDINGS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match record {
            Record::Event(event) => self.take_event(event),
            Record::Finding(finding) => self.take_event(&finding.event()),
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::units::time::Time;

    #[test]
    fn an_event_of_the_driver_is_fresh_at_once_and_not_again_when_the_log_has_it() {
        let mut events = Events::default();
        let own = Event { about: "udp".to_owned(), text: "lost".to_owned(), ..Event::default() };
        events.announce(&own);
        assert_eq!(events.fresh(), std::slice::from_ref(&own));
        // the log gives it a time; a second one like it is another event
        let logged = Event { time: Time::from_nanos(7), ..own };
        for fresh in [&[][..], std::slice::from_ref(&logged)] {
            assert!(events.take(&Record::Event(&logged)).is_ok());
            assert_eq!(events.fresh(), fresh);
        }
    }
}
