//! Start of the filter: from given values, from a reference, or through an initial alignment.

use crate::compose::draw::displacement;
use crate::filter::ekf::Ekf;
use crate::filter::start::stage::Stage;
use crate::model::record::{Epoch, Event, Level, Observer, Truth};
use crate::model::sensor::Reference;
use crate::units::sample::Sample;
use crate::units::time::Time;

impl Ekf {
    /// Starts from the blocks' initial values, or from the truth that a reference has just given.
    pub(in crate::filter) fn initialise(
        &mut self,
        time: Time,
        from_reference: bool,
        observer: &mut dyn Observer,
    ) {
        let m = &mut self.memory;
        let signals = std::mem::take(&mut m.state.signals);
        m.state = self.layout.initial_state();
        m.state.signals = signals;
        m.state.time = time;
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let referenced = from_reference && m.known[slot] && !m.constants.known[slot];
            if referenced {
                m.state.values[block.range()].copy_from_slice(&m.truth.values[block.range()]);
            }
            let range = block.tangent_range();
            if range.is_empty() || block.label.is_some() {
                continue;
            }
            let prior = block.prior(&m.state.values);
            for (i, row) in range.clone().enumerate() {
                for (j, column) in range.clone().enumerate() {
                    m.covariance.set(row, column, prior[(i, j)]);
                }
            }
            if let Some(random) = &mut m.draws
                && referenced
                && let Some(delta) = displacement(block, &m.state.values, random)
            {
                let values = &mut m.state.values[block.range()];
                (block.operations.retract)(values, &delta[..range.len()]);
            }
        }
        if let Some(screen) = &mut self.memory.screen {
            screen.begin_run();
        }
        if self.composition.processes.iter().any(|p| p.searches) {
            self.memory.stage = Stage::Searching(Vec::new());
        } else {
            self.begin(observer);
        }
    }

    /// Begins to run.
    pub(in crate::filter) fn begin(&mut self, observer: &mut dyn Observer) {
        self.begin_past();
        self.begin_course();
        let m = &mut self.memory;
        m.processes.iter_mut().for_each(|p| p.restart());
        if let Some(history) = &mut m.history {
            history.begin(&m.state);
        }
        m.stage = Stage::Running;
        observer.moved(&m.state, &m.covariance, m.offset.as_ref().map_or(&[], |o| &o.d));
        let time = m.state.time;
        let text = format!("started with {} states", self.layout.tangent);
        observer.event(Event { time, level: Level::Info, about: "estimator".into(), text });
    }

    /// Takes a reference's sample: starts a filter that waits for one, and compares a running
    /// filter with it at the sample's own time.
    pub(in crate::filter) fn follow(
        &mut self,
        sample: &Sample,
        reference: &dyn Reference,
        observer: &mut dyn Observer,
    ) {
        let m = &mut self.memory;
        let behind = m.input.is_some_and(|input| sample.time < input);
        let (starts, compares) = match m.stage {
            // a reference behind the driving sensor comes too late: its driving samples are used up
            Stage::FromReference(start) => (sample.time >= start && !behind, false),
            Stage::At(_) | Stage::Searching(_) | Stage::Found(_) => (false, false),
            Stage::Running => (false, sample.time == m.state.time),
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
        // a part that the reference does not give is NaN
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let range = block.range();
            if m.known[slot] && m.truth.values[range.clone()].iter().any(|v| !v.is_finite()) {
                m.known[slot] = m.constants.known[slot];
                let constant = &m.constants.state.values[range.clone()];
                m.truth.values[range].copy_from_slice(constant);
            }
        }
        if starts {
            let referenced = &self.composition.referenced;
            m.lacking = referenced.iter().copied().find(|slot| !m.known[*slot]);
            if m.lacking.is_some() {
                return; // a later sample may give it
            }
            self.initialise(sample.time, true, observer);
        }
        if !self.running() {
            return; // there is no estimate to compare before an alignment has found the start
        }
        let m = &self.memory;
        let truth = Some(Truth { state: &m.truth, known: &m.known });
        observer.epoch(&Epoch {
            layout: &self.layout,
            state: &m.state,
            covariance: &m.covariance,
            truth,
        });
    }
}
