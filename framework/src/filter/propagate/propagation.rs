//! The propagation of the estimate from one time to the next.

use super::held::Held;
use super::inputs::{Corrected, correct, replace};
use super::linear::Linear;
use super::passage::Passage;
use super::pooled::PooledSteps;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::estimate::Estimate;
use crate::model::estimator_error::EstimatorError;
use crate::model::process::{Input, Interval, ProcessModel, SecondOrder};
use crate::model::sensor::motion::Motion;
use crate::state::covariance::{Covariance, Transition};
use crate::state::dynamics::BlockDynamics;
use crate::state::{Layout, State};
use crate::units::sample::Sample;

/// Rule by which a step moves state and covariance.
pub(in crate::filter) enum Method {
    /// `x = f(x)`, `P = Phi P Phi' + Q`.
    Linear,
    /// Sigma points of the uncertainty pass through `f`.
    SigmaPoints(Box<Passage>),
}

/// Work space of a step: the corrected inputs, and the method.
pub(in crate::filter) struct Stepper {
    corrected: Vec<Corrected>,
    method: Method,
}

impl Stepper {
    pub(in crate::filter) fn new(composition: &Composition, method: Method) -> Self {
        Self { corrected: Corrected::of(composition), method }
    }
}

/// The processes of a filter, and the transition of its last step.
#[derive(Clone)]
pub(in crate::filter) struct Propagation {
    processes: Vec<Box<dyn ProcessModel>>,
    dynamics: BlockDynamics,
    transition: Transition,
    /// Steps that the covariance has not taken yet, where it has a rate of its own.
    pool: Option<PooledSteps>,
    /// Driving sensors beside the first.
    held: Vec<Held>,
    /// Terms of the second order that the processes neglect.
    second_order: Vec<SecondOrder>,
}

saved!(Propagation { transition } each { processes, pool, held, second_order } except { dynamics });

impl Propagation {
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        let mut transition = composition.transition.clone();
        Self {
            processes: composition.processes.iter().map(|p| p.model.boxed_clone()).collect(),
            dynamics: BlockDynamics::new(&composition.layout, &mut transition),
            pool: PooledSteps::new(composition, &transition),
            held: Held::of(composition),
            transition,
            second_order: composition.second_order().copied().collect(),
        }
    }

    /// Lets the covariance take every step by itself.
    pub(in crate::filter) fn take_every_step(&mut self) {
        self.pool = None;
    }

    /// Transition of the last step of the state.
    pub(in crate::filter) fn transition(&self) -> &Transition {
        &self.transition
    }

    /// Moves the state to the end of an interval. Returns `true` when the covariance is due.
    pub(in crate::filter) fn step(
        &mut self,
        stepper: &mut Stepper,
        composition: &Composition,
        considered: &[bool],
        estimate: &mut Estimate,
        interval: &Interval<'_>,
    ) -> Result<bool, EstimatorError> {
        let Self { processes, dynamics, transition, pool, held, second_order } = self;
        let corrected = &mut stepper.corrected[..];
        let mut linear = Linear { composition, held, corrected, dynamics, transition };
        match &mut stepper.method {
            Method::Linear => {
                // the covariance is up to date at the first step of a pool
                let begins = pool.as_ref().is_none_or(|pool| !pool.holds_steps());
                let at = begins.then_some((&estimate.state, &estimate.covariance));
                for term in second_order {
                    term.fill(&composition.layout, at, linear.transition);
                }
                linear.propagate(processes, &mut estimate.state, interval)?;
            }
            Method::SigmaPoints(passage) => {
                passage.propagate(&mut linear, considered, processes, estimate, interval)?;
            }
        }
        let Interval { from, to, .. } = *interval;
        estimate.state.time = to;
        Ok(pool.as_mut().is_none_or(|pool| pool.add(transition, from, to)))
    }

    /// Moves the covariance over the steps that it has not taken, and returns their transition.
    pub(in crate::filter) fn move_covariance(
        &mut self,
        stepper: &Stepper,
        covariance: &mut Covariance,
    ) -> &mut Transition {
        match (&mut self.pool, &stepper.method) {
            (Some(pool), _) => return pool.take(covariance),
            (None, Method::Linear) => self.transition.propagate(covariance),
            (None, Method::SigmaPoints(_)) => {} // the points have moved it
        }
        &mut self.transition
    }

    /// Moves a copy of the covariance over the steps that it has not taken, and shows their transition.
    pub(in crate::filter) fn preview(
        &self,
        covariance: &mut Covariance,
        moved: impl FnOnce(&mut Transition),
    ) {
        if let Some(mut pool) = self.pool.clone() {
            moved(pool.take(covariance));
        }
    }

    /// Returns `true` if the covariance is behind the state.
    pub(in crate::filter) fn is_behind(&self) -> bool {
        self.pool.as_ref().is_some_and(PooledSteps::holds_steps)
    }

    /// The driving sample as the processes see it, corrected at a state.
    pub(in crate::filter) fn corrected<'a>(
        &self,
        stepper: &'a mut Stepper,
        layout: &Layout,
        state: &State,
        input: Input<'a>,
    ) -> Input<'a> {
        correct(&mut stepper.corrected, layout, state, Some(&input), &self.held);
        replace(&stepper.corrected, input)
    }

    /// Shows a sample of the first driving sensor to its processes before the start.
    pub(in crate::filter) fn prepare(
        &mut self,
        stepper: &mut Stepper,
        layout: &Layout,
        state: &mut State,
        input: Input<'_>,
    ) {
        let input = self.corrected(stepper, layout, state, input);
        let Self { processes, held, .. } = self;
        let others = |process: usize| held.iter().any(|held| held.drives(process));
        for (_, process) in processes.iter_mut().enumerate().filter(|(k, _)| !others(*k)) {
            process.prepare(layout, state, &input);
        }
    }

    /// Holds a sample of another driving sensor from its time on, and shows it to the process
    /// before the start. Returns `false` if the sensor drives nothing.
    pub(in crate::filter) fn hold(
        &mut self,
        stepper: &mut Stepper,
        layout: &Layout,
        state: &mut State,
        running: bool,
        sample: &Sample,
    ) -> bool {
        let Some(k) = self.held.iter().position(|held| held.is_of(sample)) else { return false };
        self.held[k].take(sample);
        if !running {
            correct(&mut stepper.corrected, layout, state, None, &self.held);
            if let Some(input) = self.held[k].input() {
                let input = replace(&stepper.corrected, input);
                self.processes[self.held[k].process()].prepare(layout, state, &input);
            }
        }
        true
    }

    /// Begins to run.
    pub(in crate::filter) fn restart(&mut self) {
        self.processes.iter_mut().for_each(|process| process.restart());
    }

    /// Fills in the truth that the processes know about a motion.
    pub(in crate::filter) fn follow(
        &self,
        layout: &Layout,
        motion: &Motion,
        truth: &mut State,
        known: &mut [bool],
    ) {
        self.processes.iter().for_each(|process| process.follow(layout, motion, truth, known));
    }

    /// Approximate size of its memory, bytes.
    pub(in crate::filter) fn size(&self) -> usize {
        self.transition.size()
    }
}
