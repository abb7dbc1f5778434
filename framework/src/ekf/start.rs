//! How the filter starts, and what a reference tells it.

use super::Ekf;
use crate::compose::Reference;
use crate::draw::displacement;
use crate::record::{Epoch, Event, Level, Observer, Truth};
use crate::sample::Sample;
use crate::time::Time;

/// When the filter starts.
#[derive(Clone)]
pub(super) enum Start {
    /// At the first driving sample, or measurement where nothing drives, from this time on.
    At(Time),
    /// At the first reference from this time on.
    FromReference(Time),
    /// It has.
    Running,
}

impl Start {
    /// Whether a driving sample, or measurement where nothing drives, of that time starts the filter.
    pub(super) fn is_due(&self, time: Time) -> bool {
        matches!(self, Self::At(start) if time >= *start)
    }
}

impl Ekf {
    /// Starts from the blocks' initial values, or from the truth that a reference just gave.
    pub(super) fn initialise(&mut self, time: Time, from_reference: bool, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        let signals = std::mem::take(&mut m.state.signals);
        m.state = self.layout.initial_state();
        m.state.signals = signals;
        m.state.time = time;
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let told = from_reference && m.known[slot] && !m.constants.known[slot];
            if told {
                m.state.values[block.range()].copy_from_slice(&m.truth.values[block.range()]);
            }
            let range = block.tangent_range();
            if range.is_empty() {
                continue;
            }
            let prior = block.prior(&m.state.values);
            for (i, row) in range.clone().enumerate() {
                for (j, column) in range.clone().enumerate() {
                    m.covariance.set(row, column, prior[(i, j)]);
                }
            }
            if let Some(random) = &mut m.draws
                && told
                && let Some(delta) = displacement(block, &m.state.values, random)
            {
                (block.operations.retract)(&mut m.state.values[block.range()], &delta[..range.len()]);
            }
        }
        m.processes.iter_mut().for_each(|p| p.restart());
        if let Some(history) = &mut m.history {
            history.begin(&m.state);
        }
        m.start = Start::Running;
        let text = format!("started with {} states", self.layout.tangent);
        observer.event(Event { time, level: Level::Info, about: "estimator".into(), text });
    }

    /// A reference's sample: the filter starts from it if it waits for one, and is compared with it at its own time.
    pub(super) fn follow(&mut self, sample: &Sample, reference: &dyn Reference, observer: &mut dyn Observer) {
        let m = &mut self.memory;
        let behind = m.input.is_some_and(|input| sample.time < input);
        let (starts, compares) = match m.start {
            // one that comes after later driving samples is too late: they could not be used again
            Start::FromReference(start) => (sample.time >= start && !behind, false),
            Start::At(_) => (false, false),
            Start::Running => (false, sample.time == m.state.time),
        };
        if !starts && !compares {
            return;
        }
        let Some(mut motion) = reference.motion(&self.layout, &m.state, sample) else { return };
        motion.time = sample.time;
        m.constants.advance(&self.layout, sample.time);
        m.truth.values.copy_from_slice(&m.constants.state.values);
        m.truth.time = sample.time;
        m.known.copy_from_slice(&m.constants.known);
        for process in &m.processes {
            process.follow(&self.layout, &motion, &mut m.truth, &mut m.known);
        }
        if starts {
            self.initialise(sample.time, true, observer);
        }
        let m = &self.memory;
        let truth = Some(Truth { state: &m.truth, known: &m.known });
        observer.epoch(&Epoch { layout: &self.layout, state: &m.state, covariance: &m.covariance, truth });
    }
}
