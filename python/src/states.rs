//! States that classes of Python declare: their kinds, and their numbers as Python sees them.

use navfuse_core::prelude::*;
use navfuse_core::state::Block;
use pyo3::prelude::*;
use std::any::TypeId;
use std::f64::consts::{PI, TAU};

/// A state of a class's own: `navfuse._sensor.Own`.
#[derive(FromPyObject)]
pub struct Own {
    pub name: String,
    /// `vector`, `angle`, `rotation` or `position`.
    kind: String,
    /// Coordinates, SI.
    initial: Vec<f64>,
    sigma: Vec<f64>,
    truth: Option<Vec<f64>>,
    /// Random walk of each component, 1-sigma after a second.
    walk: Vec<f64>,
}

impl Own {
    /// Adds a constant state, or one that walks; one with a sigma of zero is fixed.
    ///
    /// # Errors
    /// When the kind is unknown, or the number of components does not fit.
    pub fn add(self, composer: &mut Composer) -> Result<usize, ComposeError> {
        let fixed = self.sigma.iter().all(|s| *s == 0.0);
        let dynamics = match self.walk.iter().any(|walk| *walk > 0.0) {
            true => Dynamics::RandomWalk(self.density()),
            false => Dynamics::Constant,
        };
        self.block(composer, if fixed { Mode::Fixed } else { Mode::Estimate }, dynamics)
    }

    /// Adds a state that a process moves.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn add_moved(self, composer: &mut Composer) -> Result<usize, ComposeError> {
        self.block(composer, Mode::Estimate, Dynamics::Constant)
    }

    /// Variance of the random walk after a second.
    pub fn density(&self) -> Vec<f64> {
        self.walk.iter().map(|walk| walk * walk).collect()
    }

    fn block(
        self,
        composer: &mut Composer,
        mode: Mode,
        dynamics: Dynamics,
    ) -> Result<usize, ComposeError> {
        let Self { name, kind, initial, sigma, truth, .. } = self;
        const PLAIN: Display = Display { unit: "", scale: 1.0, components: &[] };
        let count = initial.len();
        let spec = |display| BlockSpec { mode, initial, sigma, truth, dynamics, display };
        match (&*kind, count) {
            ("vector", 1) => composer.block::<Scalar>(&name, spec(PLAIN)).map(Handle::slot),
            ("vector", 2) => composer.block::<Vector<2>>(&name, spec(PLAIN)).map(Handle::slot),
            ("vector", 3) => composer.block::<Vector<3>>(&name, spec(PLAIN)).map(Handle::slot),
            ("angle", 1) => composer.block::<Circle>(&name, spec(display::ANGLE)).map(Handle::slot),
            ("rotation", 3) => {
                composer.block::<Rotation>(&name, spec(display::ANGLES)).map(Handle::slot)
            }
            ("position", 3) => {
                composer.block::<Position>(&name, spec(display::POSITION)).map(Handle::slot)
            }
            _ => Err(ComposeError::new("", format!("the state {name} is no {kind} of {count}"))),
        }
    }
}

/// An angle in (-pi, pi]; the error is the shorter arc of the circle.
struct Circle;

impl Manifold for Circle {
    const AMBIENT: usize = 1;
    const TANGENT: usize = 1;
    const READING: Reading = Reading::Angles;
    type Value<T: Real> = T;

    fn load<T: Real>(ambient: &[f64]) -> T {
        convert(ambient[0])
    }
    fn store(value: &f64, ambient: &mut [f64]) {
        ambient[0] = wrap(*value);
    }
    fn retract<T: Real>(x: &T, delta: &[T]) -> T {
        *x + delta[0]
    }
    fn local(to: &f64, from: &f64, delta: &mut [f64]) {
        delta[0] = wrap(to - from);
    }
    fn coordinates<T: Real>(x: &T, out: &mut [T]) {
        out[0] = *x;
    }
    fn from_coordinates(coordinates: &[f64]) -> f64 {
        wrap(coordinates[0])
    }
}

fn wrap(angle: f64) -> f64 {
    PI - (PI - angle).rem_euclid(TAU)
}

/// The value of a block as Python sees it: the nine numbers of the matrix of a rotation, row by row,
/// and the numbers that are stored of any other state.
pub fn append(block: &Block, values: &[f64], numbers: &mut Vec<f64>) {
    let value = &values[block.range()];
    match is_rotation(block) {
        true => numbers.extend(Rotation::load::<f64>(value).matrix().transpose().iter()),
        false => numbers.extend_from_slice(value),
    }
}

/// Takes the value of a block off the numbers of Python.
pub fn take(block: &Block, numbers: &mut &[f64], values: &mut [f64]) {
    let size = size(block).min(numbers.len());
    let (given, rest) = numbers.split_at(size);
    *numbers = rest;
    let value = &mut values[block.range()];
    match is_rotation(block) && size == 9 {
        true => Rotation::store(&matrix(given), value),
        false => value.iter_mut().zip(given).for_each(|(value, number)| *value = *number),
    }
}

/// The rotation of nine numbers, row by row.
fn matrix(numbers: &[f64]) -> navfuse_core::nalgebra::Rotation3<f64> {
    let matrix = SMatrix::<f64, 3, 3>::from_row_slice(numbers);
    navfuse_core::nalgebra::Rotation3::from_matrix_unchecked(matrix)
}

/// Count of the numbers of a block as Python sees it.
fn size(block: &Block) -> usize {
    if is_rotation(block) { 9 } else { block.operations.ambient }
}

fn is_rotation(block: &Block) -> bool {
    block.operations.kind == TypeId::of::<Rotation>()
}
