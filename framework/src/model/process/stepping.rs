//! Processes as one function: the model that the filter propagates.

use crate::model::process::step::{Densities, Moved, Passes, Step};
use crate::model::process::{Input, Interval, ProcessError, ProcessModel};
use crate::model::sensor::motion::Motion;
use crate::model::simulate::Random;
use crate::state::covariance::Transition;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{BlockSet, Layout, State, View};
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use crate::units::time::Time;
use nalgebra::DMatrix;
use num_dual::Dual64;
use std::cell::RefCell;

/// A [`Step`] with its places in the transition, and its work space.
#[derive(Clone)]
pub(crate) struct Stepping<S> {
    step: S,
    /// Blocks that the step reads or moves.
    known: BlockSet,
    /// Slots of the blocks that the step moves.
    moved: Vec<usize>,
    /// Slots of the estimated blocks that the step reads or moves.
    columns: Vec<usize>,
    places: Vec<Place>,
    /// The elements of all places, and the place of the first in the transition.
    elements: Vec<f64>,
    at: usize,
    noise: Noise,
    passes: Passes,
    read: RefCell<BlockSet>,
}

/// Place of the derivative of one block with respect to another.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Slots of the block that moves and of the block that is read.
    moved: usize,
    read: usize,
    /// First rows of both, and the numbers of their rows.
    row: usize,
    rows: usize,
    column: usize,
    columns: usize,
    /// First element in [`Stepping::elements`].
    at: usize,
}

impl<S: Step> Stepping<S> {
    /// Finds the blocks that the step reads and moves, and declares their places.
    pub(crate) fn new(step: S, layout: &Layout, transition: &mut Transition) -> Self {
        let (mut passes, read) = (Passes::new(layout), RefCell::<BlockSet>::default());
        let state = layout.initial_state();
        for_each_input(|input| {
            let x = View::new(layout, &state).recording(&read);
            step.step(&x, input, 1.0, &mut Moved::of(layout, &mut passes));
        });
        let moved: Vec<usize> = passes.moved.slots().collect();
        let mut known = passes.moved.clone();
        known.extend(read.borrow().slots());
        let estimated = |slot: &usize| layout.blocks[*slot].tangent.is_some();
        let columns: Vec<usize> = known.slots().filter(estimated).collect();
        let rows: Vec<usize> = moved.iter().copied().filter(estimated).collect();
        let (at, mut elements, mut places) = (transition.places().len(), 0, Vec::new());
        for &read in &columns {
            let depends = dependent(&step, layout, &state, read, &mut passes);
            for &moved in rows.iter().filter(|slot| **slot == read || depends.contains(**slot)) {
                let [row, column] = [moved, read].map(|slot| layout.blocks[slot].tangent_range());
                transition.phi_block(row.clone(), column.clone());
                let (rows, columns) = (row.len(), column.len());
                let (row, column) = (row.start, column.start);
                places.push(Place { moved, read, row, rows, column, columns, at: elements });
                elements += rows * columns;
            }
        }
        let noise = Noise::new(layout, &rows, transition);
        let elements = vec![0.0; elements];
        Self { step, known, moved, columns, places, elements, at, noise, passes, read }
    }

    /// Computes the new values of the moved blocks.
    fn evaluate(
        &mut self,
        layout: &Layout,
        state: &State,
        input: Option<&Input<'_>>,
        dt: f64,
    ) -> Result<(), ProcessError> {
        let Self { step, known, passes, read, .. } = self;
        passes.moved.clear();
        read.get_mut().clear();
        step.step(
            &View::new(layout, state).recording(read),
            input,
            dt,
            &mut Moved::of(layout, passes),
        );
        let unknown = |set: &BlockSet| set.slots().find(|slot| !known.contains(*slot));
        match unknown(read.get_mut()).or_else(|| unknown(&passes.moved)) {
            None => Ok(()),
            Some(slot) => Err(ProcessError::new(format!(
                "the step uses {}, and did not when its places were found: let it read and set the \
                 same blocks at every state",
                layout.blocks[slot].name
            ))),
        }
    }

    /// Computes the derivative of the moved blocks, one pass for each axis of a block that is read.
    fn differentiate(
        &mut self,
        layout: &Layout,
        state: &State,
        input: Option<&Input<'_>>,
        dt: f64,
    ) {
        let Self { step, passes, places, elements, .. } = self;
        for &read in &self.columns {
            for axis in 0..layout.blocks[read].operations.tangent {
                // a block that this step leaves out stays as it is
                self.moved.iter().for_each(|slot| passes.slope(*slot).fill(0.0));
                passes.slope(read)[axis] = 1.0;
                let mut delta = [Dual64::from(0.0); MAX_TANGENT];
                delta[axis] = delta[axis].derivative();
                let x = View::seeded(layout, state, read, delta);
                step.step(&x, input, dt, &mut Moved::of(layout, passes));
                for place in places.iter().filter(|place| place.read == read) {
                    let column = &mut elements[place.at + axis * place.rows..][..place.rows];
                    column.copy_from_slice(&passes.slope(place.moved)[..place.rows]);
                }
            }
        }
    }

    /// Copies the new values of the moved blocks to the state.
    fn store(&self, layout: &Layout, state: &mut State) {
        for slot in self.passes.moved.slots() {
            let range = layout.blocks[slot].range();
            state.values[range.clone()].copy_from_slice(&self.passes.values[range]);
        }
    }

    /// Computes derivative and noise at the state, and then moves the state.
    fn advance(
        &mut self,
        layout: &Layout,
        state: &mut State,
        input: Option<&Input<'_>>,
        dt: f64,
    ) -> Result<(), ProcessError> {
        self.evaluate(layout, state, input, dt)?;
        self.differentiate(layout, state, input, dt);
        let Self { step, noise, places, elements, .. } = self;
        noise.density.fill(0.0);
        let mut densities = Densities { layout, first: noise.first, matrix: &mut noise.density };
        step.noise(&View::new(layout, state), &mut densities);
        noise.integrate(places, elements, dt);
        self.store(layout, state);
        Ok(())
    }
}

impl<S: Step> ProcessModel for Stepping<S> {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        self.advance(layout, state, interval.input.as_ref(), interval.duration())?;
        let (elements, noise) = (&self.elements, self.noise.covariance.as_slice());
        transition.phi_from(self.at)[..elements.len()].copy_from_slice(elements);
        transition.noise_from(self.noise.at)[..noise.len()].copy_from_slice(noise);
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        self.step.follow(layout, motion, state, known);
    }

    fn wander(
        &mut self,
        layout: &Layout,
        truth: &mut State,
        known: &mut [bool],
        dt: f64,
        random: &mut Random,
    ) {
        self.moved.iter().for_each(|slot| known[*slot] = true);
        if dt > 0.0 && self.advance(layout, truth, None, dt).is_ok() {
            let first = self.noise.first;
            let noise = self.noise.draw(random);
            for block in self.moved.iter().map(|slot| &layout.blocks[*slot]) {
                let Some(row) = block.tangent.map(|row| row - first) else { continue };
                let delta = &noise[row..][..block.operations.tangent];
                (block.operations.retract)(&mut truth.values[block.range()], delta);
            }
        }
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Calls a function without a driving sample, and with one that has every channel.
fn for_each_input(mut call: impl FnMut(Option<&Input<'_>>)) {
    let sample = Sample::new(Time::default(), SensorId(0), &[1.0; MAX_CHANNELS]);
    call(None);
    call(Some(&Input { sample: &sample, duration: 1.0, usual: 1.0, spread: None }));
}

/// The moved blocks that depend on a block. A derivative of the block that is no number makes every
/// derivative that depends on it no number, even where its factor is zero at this state.
fn dependent<S: Step>(
    step: &S,
    layout: &Layout,
    state: &State,
    read: usize,
    passes: &mut Passes,
) -> BlockSet {
    let (moved, mut found) = (passes.moved.clone(), BlockSet::default());
    for_each_input(|input| {
        passes.slopes.fill(0.0);
        let lost = Dual64::new(0.0, f64::NAN);
        let x = View::seeded(layout, state, read, [lost; MAX_TANGENT]);
        step.step(&x, input, 1.0, &mut Moved::of(layout, passes));
        found.extend(moved.slots().filter(|s| passes.slope(*s).iter().any(|v| v.is_nan())));
    });
    found
}

/// The noise of a step over its interval.
#[derive(Clone)]
struct Noise {
    /// First row of the moved blocks, and the place of the noise in the transition.
    first: usize,
    at: usize,
    /// Transpose of the `Phi` of the moved blocks.
    phi: DMatrix<f64>,
    /// Density of the noise, `D`; and `D Phi'`.
    density: DMatrix<f64>,
    product: DMatrix<f64>,
    covariance: DMatrix<f64>,
    /// A draw from the covariance.
    drawn: Vec<f64>,
}

impl Noise {
    /// Declares the noise of the blocks `rows`, from the first to the last.
    fn new(layout: &Layout, rows: &[usize], transition: &mut Transition) -> Self {
        let ranges = rows.iter().map(|slot| layout.blocks[*slot].tangent_range());
        let first = ranges.clone().map(|range| range.start).min().unwrap_or(0);
        let size = ranges.map(|range| range.end).max().unwrap_or(first) - first;
        let at = transition.noise_block(first, size);
        let zeros = || DMatrix::zeros(size, size);
        let (phi, density, product, covariance) = (zeros(), zeros(), zeros(), zeros());
        Self { first, at, phi, density, product, covariance, drawn: vec![0.0; size] }
    }

    /// Integrates `Phi(s) D Phi(s)'` from 0 to `dt` by Simpson's rule, with `Phi(dt/2) = (I +
    /// Phi)/2`: `Q = dt/6 (2 Phi D Phi' + Phi D + D Phi' + 2 D)`. It is exact where `Phi` grows
    /// linearly, as for a clock or a constant velocity (Groves eq. 3.44).
    fn integrate(&mut self, places: &[Place], elements: &[f64], dt: f64) {
        let Self { first, phi, density, product, covariance, .. } = self;
        let n = phi.nrows();
        let moved = |place: &&Place| (*first..*first + n).contains(&place.column);
        for place in places.iter().filter(moved) {
            for (k, value) in elements[place.at..][..place.rows * place.columns].iter().enumerate()
            {
                let (row, column) = (k % place.rows, k / place.rows);
                phi[(place.column - *first + column, place.row - *first + row)] = *value;
            }
        }
        for i in 0..n {
            for j in 0..n {
                product[(i, j)] = density.column(i).dot(&phi.column(j));
            }
        }
        for i in 0..n {
            for j in 0..=i {
                let whole = phi.column(i).dot(&product.column(j));
                let mixed = product[(i, j)] + product[(j, i)];
                let q = dt / 6.0 * (2.0 * whole + mixed + 2.0 * density[(i, j)]);
                covariance[(i, j)] = q;
                covariance[(j, i)] = q;
            }
        }
    }

    /// Draws `L n` with white noise `n` from the covariance `L L'`, which may be singular: a column of
    /// the Cholesky factor `L` is zero where no more than rounding is left of its pivot. The factor
    /// takes the place of the product.
    fn draw(&mut self, random: &mut Random) -> &[f64] {
        let Self { covariance, product: root, drawn, .. } = self;
        let n = covariance.nrows();
        drawn.fill(0.0);
        for j in 0..n {
            let white = random.normal();
            let mut pivot = 0.0;
            for i in j..n {
                let known = (0..j).map(|k| root[(i, k)] * root[(j, k)]).sum::<f64>();
                let left = covariance[(i, j)] - known;
                if i == j {
                    let rounding = n as f64 * f64::EPSILON * covariance[(j, j)];
                    pivot = if left <= rounding { 0.0 } else { left.sqrt() };
                }
                root[(i, j)] = if pivot == 0.0 { 0.0 } else { left / pivot };
                drawn[i] += root[(i, j)] * white;
            }
        }
        drawn
    }
}
