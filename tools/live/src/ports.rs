//! The links of a run, and what else outlasts a reset of it.

use crate::stamps::Stamps;
use crate::status::LinkStatus;
use navfuse_core::compose::Composition;
use navfuse_core::model::stream::{Arrivals, Inbox, NamedFeed, StreamError};
use navfuse_core::units::time::Span;
use navfuse_links::is_worth_a_report;
use std::thread::Builder;

/// The links, the clocks of the sensors, and the sensors that are switched off.
pub(crate) struct Ports {
    pub(crate) arrivals: Arrivals,
    pub(crate) links: Vec<LinkStatus>,
    pub(crate) stamps: Stamps,
    /// For each sensor, set while its samples are left out.
    pub(crate) off: Vec<bool>,
}

impl Ports {
    /// Starts the feeds of a composition, each on a thread of its own.
    ///
    /// # Errors
    /// When the system cannot start a thread.
    pub(crate) fn start(
        feeds: Vec<NamedFeed>,
        composition: &Composition,
        speed: f64,
    ) -> Result<Self, StreamError> {
        let late = composition.sensors.iter().map(|s| s.late.map_or(0.0, Span::seconds)).collect();
        let driver = composition.processes.iter().find_map(|p| p.input);
        let mut ports = Self {
            arrivals: Arrivals::default(),
            links: Vec::new(),
            stamps: Stamps::new(driver, late, speed),
            off: vec![false; composition.sensors.len()],
        };
        for (name, feed) in feeds {
            let mut inbox = ports.inbox(name.clone());
            let thread = Builder::new().name(name).spawn(move || feed.run(&mut inbox));
            // the thread ends with the run, or with the process where its port blocks
            drop(thread.map_err(|e| {
                StreamError::new("the system cannot start a thread").with_source(e)
            })?);
        }
        Ok(ports)
    }

    /// Adds the inbox of a link of that name.
    pub(crate) fn inbox(&mut self, name: String) -> Inbox {
        self.links.push(LinkStatus { name, ..LinkStatus::default() });
        self.arrivals.inbox()
    }

    /// Returns `true` once every link has ended.
    pub(crate) fn have_ended(&self) -> bool {
        self.links.iter().all(|link| link.ended)
    }

    /// Counts the samples that the links dropped, and returns a text for each link that is worth one.
    pub(crate) fn count_dropped(&mut self) -> Vec<(String, String)> {
        let mut reports = Vec::new();
        for (k, link) in self.links.iter_mut().enumerate() {
            let dropped = self.arrivals.dropped(k);
            if is_worth_a_report(link.dropped, dropped) {
                let text = format!("{dropped} samples dropped: they came faster than the filter");
                reports.push((link.name.clone(), text));
            }
            link.dropped = dropped;
        }
        reports
    }
}
