//! Start of the filter: from given values, from a reference, or through an initial alignment.

use super::stage::Stage;
use crate::compose::draw::displacement;
use crate::filter::ekf::Ekf;
use crate::filter::parts::Parts;
use crate::model::record::{Event, Level, Observer};
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
        let Parts { estimate, truth, start, screening, .. } = &mut self.parts;
        let (state, covariance) = (&mut estimate.state, &mut estimate.covariance);
        let signals = std::mem::take(&mut state.signals);
        *state = self.layout.initial_state();
        state.signals = signals;
        state.time = time;
        let mut drawn_from = state.clone();
        for (slot, block) in self.layout.blocks.iter().enumerate() {
            let referenced = truth.referenced(slot).filter(|_| from_reference);
            if let Some(truth) = referenced {
                state.values[block.range()].copy_from_slice(&truth.values[block.range()]);
            }
            let range = block.tangent_range();
            if range.is_empty() || block.label.is_some() {
                continue;
            }
            let prior = block.prior(&state.values);
            for (i, row) in range.clone().enumerate() {
                for (j, column) in range.clone().enumerate() {
                    covariance.set(row, column, prior[(i, j)]);
                }
            }
            drawn_from.values[block.range()].copy_from_slice(&state.values[block.range()]);
            if let Some(random) = &mut start.draws
                && referenced.is_some()
                && let Some(delta) = displacement(block, &state.values, random)
            {
                let values = &mut state.values[block.range()];
                (block.operations.retract)(values, &delta[..range.len()]);
            }
        }
        if start.draws.is_some() {
            self.layout.carry(&drawn_from, state);
        }
        screening.begin_run();
        if self.composition.processes.iter().any(|p| p.searches) {
            start.stage = Stage::Searching(Vec::new());
        } else {
            self.begin(observer);
        }
    }

    /// Begins to run.
    pub(super) fn begin(&mut self, observer: &mut dyn Observer) {
        self.begin_past();
        self.begin_course();
        let Parts { estimate, propagation, history, start, .. } = &mut self.parts;
        propagation.restart();
        if let Some(history) = history {
            history.begin(&estimate.state);
        }
        start.stage = Stage::Running;
        observer.moved(&estimate.state, &estimate.covariance, estimate.offset());
        let time = estimate.state.time;
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
        let Parts { estimate, pace, start, truth, propagation, .. } = &mut self.parts;
        let behind = pace.input().is_some_and(|input| sample.time < input);
        let (starts, compares) = match start.stage {
            // a reference behind the driving sensor comes too late: its driving samples are used up
            Stage::FromReference(start) => (sample.time >= start && !behind, false),
            Stage::At(_) | Stage::Searching(_) | Stage::Found(_) => (false, false),
            Stage::Running => (false, sample.time == estimate.state.time),
        };
        if !starts && !compares {
            return;
        }
        let motion = reference.motion(&self.layout, &estimate.state, sample);
        let Some(mut motion) = motion else { return };
        motion.time = sample.time;
        truth.follow(&self.layout, &motion, propagation);
        if starts {
            let referenced = &self.composition.referenced;
            start.lacking = referenced.iter().copied().find(|slot| !truth.knows(*slot));
            if start.lacking.is_some() {
                return; // a later sample may give it
            }
            self.initialise(sample.time, true, observer);
        }
        if !self.running() {
            return; // there is no estimate to compare before an alignment has found the start
        }
        let Parts { estimate, truth, .. } = &self.parts;
        observer.epoch(&estimate.epoch(&self.layout, Some(truth.view())));
    }
}
