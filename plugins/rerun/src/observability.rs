//! What the run determines, while it goes on: bits gained of each state, and a page of verdicts.

use crate::columns::{Range, Series};
use crate::recording::Recording;
use crate::style::{axis, path};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::units::time::Time;
use navfuse_observability::{Tracker, markdown};
use rerun::{EntityPath, TextDocument};

/// How often the bits are recorded, ns.
const EVERY: i64 = 1_000_000_000;
/// How often the page is written where no verdict changes, in the same.
const PAGE: i64 = 30;

/// The bits of one state's components.
pub struct BlockBits {
    /// `ins.attitude`.
    pub name: String,
    /// The entity above all of them.
    pub path: EntityPath,
    /// Their range.
    pub range: Range,
    components: Vec<Series>,
}

/// Follows a run.
pub struct Observability {
    /// What it hears of the filter.
    pub tracker: Tracker,
    /// One a state.
    pub blocks: Vec<BlockBits>,
    next: Time,
    next_page: Time,
    changed: bool,
}

impl Observability {
    /// For a run.
    pub fn new(info: &RunInfo) -> Self {
        let tracker = Tracker::new(info, f64::INFINITY);
        let mut blocks: Vec<BlockBits> = Vec::new();
        for c in tracker.components() {
            let (owner, name) = c.state.split_once('.').unwrap_or(("", &c.state));
            if blocks.last().is_none_or(|b| b.name != c.state) {
                blocks.push(BlockBits {
                    name: c.state.clone(),
                    path: path(&["observability", owner, name]),
                    range: Range::default(),
                    components: Vec::new(),
                });
            }
            let Some(block) = blocks.last_mut() else { continue };
            let line = (c.name.clone(), axis(c.axis), 2.2);
            block
                .components
                .push(Series::lines(path(&["observability", owner, name, &c.name]), &[line]));
        }
        Self { tracker, blocks, next: Time::MIN, next_page: Time::MIN, changed: true }
    }

    /// Where the page is.
    pub fn page() -> EntityPath {
        path(&["observability", "verdicts"])
    }

    /// Takes an estimate.
    pub fn epoch(&mut self, recording: &Recording, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let time = epoch.state.time;
        self.changed |= self.tracker.epoch(epoch);
        if time < self.next {
            return Ok(());
        }
        let second = time.nanos().div_euclid(EVERY);
        self.next = Time::from_nanos((second + 1) * EVERY);
        let mut bits = self.tracker.status().iter().map(|now| now.bits());
        for block in &mut self.blocks {
            for (series, bits) in block.components.iter_mut().zip(&mut bits) {
                series.push(recording, time, &[bits])?;
                block.range.include(bits);
            }
        }
        if self.changed || time >= self.next_page {
            self.next_page = Time::from_nanos((second + PAGE) * EVERY);
            self.write(recording)?;
        }
        Ok(())
    }

    /// Writes the page as it is now.
    pub fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        if !self.tracker.started() {
            return Ok(());
        }
        self.changed = false;
        let page = TextDocument::from_markdown(markdown(&self.tracker));
        recording.log(&Self::page(), self.tracker.span().1.nanos(), &page)
    }

    /// Its series.
    pub fn series(&mut self) -> impl Iterator<Item = &mut Series> {
        self.blocks.iter_mut().flat_map(|b| &mut b.components)
    }
}
