//! Processes as one function: what their author writes.

use crate::Real;
use crate::model::process::Input;
use crate::model::sensor::motion::Motion;
use crate::state::manifold::{MAX_TANGENT, Manifold};
use crate::state::{BlockSet, Handle, Layout, State, View};
use nalgebra::{DMatrix, SVector};
use num_dual::Dual64;
use std::any::Any;
use std::marker::PhantomData;

/// A process as one function from the state to the state `dt` seconds later.
///
/// The framework differentiates [`Self::step`] with respect to the blocks that it reads, which
/// gives `Phi`, and computes `Q` from the densities of [`Self::noise`]. It finds the places in
/// `Phi` and `Q` by itself, and moves the truth of a simulation with the same equations and noise
/// where no trajectory gives it. [`crate::compose::Composer::step`] builds the process. A process
/// with a memory, or with a derivative of its own, is a
/// [`ProcessModel`](crate::model::process::ProcessModel).
///
/// A clock, whose offset grows with its drift:
/// ```
/// use navfuse_core::prelude::*;
///
/// #[derive(Clone)]
/// struct Clock {
///     offset: Handle<Scalar>,
///     drift: Handle<Scalar>,
/// }
///
/// impl Step for Clock {
///     fn step<T: Real>(
///         &self,
///         x: &View<'_, T>,
///         _: Option<&Input<'_>>,
///         dt: f64,
///         next: &mut Moved<'_, T>,
///     ) {
///         let drift = x.get(self.drift);
///         next.set(self.offset, &(x.get(self.offset) + drift * convert(dt)));
///         next.set(self.drift, &drift);
///     }
///     fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
///         noise.white(self.offset, &[0.04]);
///         noise.white(self.drift, &[0.01]);
///     }
/// }
/// ```
pub trait Step: Clone + Send + 'static {
    /// Sets the blocks that the process moves to their values after `dt` seconds, without noise.
    ///
    /// Compute with `T`, and without functions that branch at zero, whose derivative is lost there: turn
    /// an attitude by [`Manifold::retract`], and not by `Rotation3::from_scaled_axis`.
    ///
    /// `input` is the driving sample, if the process has one; while the process coasts, and when
    /// the places are found, it is `None`.
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        input: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    );

    /// Sets the power spectral densities of the white noise on the rates of the moved blocks.
    fn noise(&self, x: &View<'_, f64>, noise: &mut Densities<'_>);

    /// Sets the blocks to their values on a known motion, as
    /// [`ProcessModel::follow`](crate::model::process::ProcessModel::follow) does. Default: no
    /// motion gives them.
    fn follow(&self, _layout: &Layout, _motion: &Motion, _state: &mut State, _known: &mut [bool]) {}
}

/// What the passes of a step leave: the new values, and their derivative.
#[derive(Clone, Debug, Default)]
pub(super) struct Passes {
    /// The new values, laid out as the state.
    pub values: Vec<f64>,
    /// Derivative of each block along its tangent, [`MAX_TANGENT`] numbers a block.
    pub slopes: Vec<f64>,
    /// The blocks that the pass has moved.
    pub moved: BlockSet,
}

impl Passes {
    pub fn new(layout: &Layout) -> Self {
        let slopes = vec![0.0; MAX_TANGENT * layout.blocks.len()];
        Self { values: vec![0.0; layout.ambient], slopes, moved: BlockSet::default() }
    }

    /// Derivative of a block.
    pub fn slope(&mut self, slot: usize) -> &mut [f64] {
        &mut self.slopes[MAX_TANGENT * slot..][..MAX_TANGENT]
    }
}

/// The new values of the blocks that a [`Step`] moves.
#[derive(Debug)]
pub struct Moved<'a, T: Real> {
    layout: &'a Layout,
    passes: &'a mut Passes,
    scalar: PhantomData<T>,
}

impl<'a, T: Real> Moved<'a, T> {
    pub(super) fn of(layout: &'a Layout, passes: &'a mut Passes) -> Self {
        Self { layout, passes, scalar: PhantomData }
    }

    /// Sets the value of a block after the step.
    pub fn set<M: Manifold>(&mut self, block: Handle<M>, value: &M::Value<T>) {
        self.passes.moved.insert(block.slot());
        let value: &dyn Any = value;
        if let Some(value) = value.downcast_ref::<M::Value<f64>>() {
            let range = self.layout.block(block).range();
            M::store(value, &mut self.passes.values[range]);
        }
        if let Some(value) = value.downcast_ref::<M::Value<Dual64>>() {
            M::slope(value, &mut self.passes.slope(block.slot())[..M::TANGENT]);
        }
    }
}

/// Power spectral densities of the white noise on the rates of the blocks that a [`Step`] moves.
#[derive(Debug)]
pub struct Densities<'a> {
    pub(super) layout: &'a Layout,
    /// First row of the moved blocks.
    pub(super) first: usize,
    pub(super) matrix: &'a mut DMatrix<f64>,
}

impl Densities<'_> {
    /// Adds independent noise to each axis of the tangent of a block: `(SI unit)^2 / Hz` of the rate,
    /// the square of the `noise` on a data sheet.
    pub fn white<M: Manifold, const N: usize>(&mut self, block: Handle<M>, density: &[f64; N]) {
        for (axis, density) in density.iter().enumerate() {
            let direction = SVector::<f64, N>::from_fn(|k, _| f64::from(k == axis));
            self.along(block, &direction, *density);
        }
    }

    /// Adds noise along one direction of the tangent of a block, such as the axis of a thruster:
    /// the density `q u u'`. Noise of a block that is fixed, or that the step does not move, has no
    /// effect.
    pub fn along<M: Manifold, const N: usize>(
        &mut self,
        block: Handle<M>,
        direction: &SVector<f64, N>,
        density: f64,
    ) {
        const { assert!(N == M::TANGENT) };
        let row = self.layout.block(block).tangent.and_then(|row| row.checked_sub(self.first));
        let Some(row) = row.filter(|row| row + N <= self.matrix.nrows()) else { return };
        let mut own = self.matrix.fixed_view_mut::<N, N>(row, row);
        own += direction * direction.transpose() * density;
    }
}
