//! Columns of the estimate: for every component of every block its value, 1-sigma and error, and the
//! covariance of every pair of components.

use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::RunInfo;
use navfuse_core::state::Block;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use schemars::JsonSchema;
use serde::Deserialize;

/// Axes of the vectors that the state holds along north, east and down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axes {
    /// North, east, down; the body forward, right, down.
    #[default]
    Ned,
    /// East, north, up; a trajectory has the body forward, left, up.
    Enu,
}

/// The components of the vectors that [`Axes`] are about.
const NED: [&str; 3] = ["north", "east", "down"];

impl Axes {
    /// Names of the components.
    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Ned => NED,
            Self::Enu => ["east", "north", "up"],
        }
    }

    /// Changes a vector along north, east and down into one along these axes.
    fn turn(self, vector: &mut [f64]) {
        if let ([north, east, down, ..], Self::Enu) = (vector, self) {
            std::mem::swap(north, east);
            // not -down: zero stays zero
            *down = 0.0 - *down;
        }
    }

    /// Does the same to the rows of a matrix of three columns.
    fn turn_rows(self, matrix: &mut [f64]) {
        for column in 0..3 {
            let mut vector: [f64; 3] = std::array::from_fn(|row| matrix[3 * row + column]);
            self.turn(&mut vector);
            (0..3).for_each(|row| matrix[3 * row + column] = vector[row]);
        }
    }
}

/// Columns of the estimate, in the units of the summary.
///
/// The covariance is the upper triangle of the symmetric matrix, row by row. The column
/// `A*B_cov_UNIT*UNIT` holds `cov(A, B)`; `A*A_cov` is the square of the 1-sigma of `A`. A position
/// counts north, east and down in metres, an attitude roll, pitch and yaw. A fixed block has no
/// covariance. With [`Axes::Enu`], vectors along north, east and down have the components east, north
/// and up; latitude, longitude and height, angles and vectors in body axes stay as they are.
#[derive(Clone, Debug, Default)]
pub struct EstimateColumns {
    headings: Vec<String>,
    /// By slot: set if the block has columns for its error.
    errors: Vec<bool>,
    covariance: bool,
    axes: Axes,
    /// Scratch: the row, and the derivatives of the components of the uncertain blocks.
    row: Vec<f64>,
    jacobians: Vec<Shown>,
}

/// An uncertain block at an epoch.
#[derive(Clone, Debug)]
struct Shown {
    /// Its first error state.
    first: usize,
    /// Number of components.
    count: usize,
    /// Derivative of the components, in the display unit, with respect to the error; row-major.
    jacobian: [f64; MAX_TANGENT * MAX_TANGENT],
}

/// The unit as the end of a heading: `deg/h` is `_degph`.
pub fn ending(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!("_{}", plain(unit)) }
}

fn plain(unit: &str) -> String {
    unit.replace('/', "p").replace('^', "")
}

/// The names of the components of a block; a component without a name has its number.
fn names(block: &Block, names: &[&str]) -> Vec<String> {
    let name = |k: usize| names.get(k).map_or_else(|| k.to_string(), |n| (*n).to_owned());
    (0..block.operations.tangent).map(name).collect()
}

/// Set for a block whose sigma, error and covariance are along north, east and down.
fn is_ned(block: &Block) -> bool {
    let named = is_geodetic(block) || block.spec.display.components == NED;
    named && block.operations.tangent == 3
}

/// Set for a block whose estimate is latitude, longitude and height.
fn is_geodetic(block: &Block) -> bool {
    block.operations.reading == Reading::Tangent
}

/// The names of the components of the estimate.
fn components(block: &Block, axes: Axes) -> Vec<String> {
    match is_ned(block) && !is_geodetic(block) {
        true => names(block, &axes.names()),
        false => names(block, block.spec.display.components),
    }
}

/// The names of the components of sigma, error and covariance.
fn differences(block: &Block, axes: Axes) -> Vec<String> {
    match is_ned(block) {
        true => names(block, &axes.names()),
        false => names(block, block.spec.display.components),
    }
}

/// The headings of a block.
fn of_block(block: &Block, error: bool, axes: Axes, out: &mut Vec<String>) {
    let display = &block.spec.display;
    let units = if is_geodetic(block) { ["deg", "deg", display.unit] } else { [display.unit; 3] };
    let mut add = |name: &str, what: &str, unit: &str| {
        out.push(format!("{}.{name}{what}{}", block.name, ending(unit)))
    };
    for (k, name) in components(block, axes).iter().enumerate() {
        add(name, "", units[k.min(2)]);
    }
    for what in ["_sigma", "_error"].into_iter().take(1 + usize::from(error)) {
        differences(block, axes).iter().for_each(|name| add(name, what, display.unit));
    }
}

/// The headings of the covariance.
fn of_covariance(blocks: &[Block], axes: Axes, out: &mut Vec<String>) {
    let uncertain = blocks.iter().filter(|b| b.tangent.is_some());
    let components: Vec<(String, &str)> = uncertain
        .flat_map(|b| {
            let names = differences(b, axes).into_iter();
            names.map(|c| (format!("{}.{c}", b.name), b.spec.display.unit))
        })
        .collect();
    for (i, (row, row_unit)) in components.iter().enumerate() {
        for (column, column_unit) in &components[i..] {
            let units: Vec<String> = [*row_unit, *column_unit]
                .into_iter()
                .filter(|u| !u.is_empty())
                .map(plain)
                .collect();
            out.push(format!("{row}*{column}_cov{}", ending(&units.join("*"))));
        }
    }
}

impl EstimateColumns {
    /// The columns of a run.
    pub fn new(run: &RunInfo, covariance: bool, axes: Axes) -> Self {
        let reference = run.sensors.iter().any(|s| s.purpose == Purpose::Reference);
        let blocks = &run.layout.blocks;
        let errors: Vec<bool> =
            blocks.iter().map(|b| reference || b.spec.truth.is_some()).collect();
        let mut headings = vec!["time_s".to_owned()];
        for (block, error) in blocks.iter().zip(&errors) {
            of_block(block, *error, axes, &mut headings);
        }
        if covariance {
            of_covariance(blocks, axes, &mut headings);
        }
        Self { headings, errors, covariance, axes, ..Self::default() }
    }

    /// The headings, with `time_s` first.
    pub fn headings(&self) -> &[String] {
        &self.headings
    }

    /// The numbers of an epoch, after the time; NaN where there is none.
    pub fn row(&mut self, epoch: &Epoch<'_>) -> &[f64] {
        self.row.clear();
        let mut numbers = [0.0; MAX_TANGENT];
        let values = &epoch.state.values;
        for (slot, (block, error)) in epoch.layout.blocks.iter().zip(&self.errors).enumerate() {
            let n = block.operations.tangent;
            let axes = if is_ned(block) { self.axes } else { Axes::Ned };
            block.show(values, &mut numbers);
            if !is_geodetic(block) {
                axes.turn(&mut numbers);
            }
            self.row.extend_from_slice(&numbers[..n]);
            block.show_sigma(values, epoch.covariance, &mut numbers);
            axes.turn(&mut numbers);
            // a sigma has no sign
            numbers[..n].iter_mut().for_each(|sigma| *sigma = sigma.abs());
            self.row.extend_from_slice(&numbers[..n]);
            if *error {
                match epoch.truth.filter(|t| t.known[slot]) {
                    Some(t) => t.show_error(epoch.layout, slot, epoch.state, &mut numbers),
                    None => numbers.fill(f64::NAN),
                }
                axes.turn(&mut numbers);
                self.row.extend_from_slice(&numbers[..n]);
            }
        }
        if self.covariance {
            self.append_covariance(epoch);
        }
        &self.row
    }

    /// Appends the upper triangle of `J P J'`, where `J` are the derivatives of the components.
    fn append_covariance(&mut self, epoch: &Epoch<'_>) {
        self.jacobians.clear();
        for block in &epoch.layout.blocks {
            let Some(first) = block.tangent else { continue };
            let mut jacobian = block.shown_jacobian(&epoch.state.values);
            jacobian.iter_mut().for_each(|j| *j /= block.spec.display.scale);
            if is_ned(block) {
                self.axes.turn_rows(&mut jacobian);
            }
            self.jacobians.push(Shown { first, count: block.operations.tangent, jacobian });
        }
        let components = |from: usize, start: usize| {
            let blocks = self.jacobians.iter().enumerate().skip(from);
            blocks.flat_map(|(k, b)| (0..b.count).map(move |i| (k, b, i))).skip(start)
        };
        for (k, a, i) in components(0, 0) {
            let left = &a.jacobian[a.count * i..a.count * (i + 1)];
            for (_, b, j) in components(k, i) {
                let right = &b.jacobian[b.count * j..b.count * (j + 1)];
                let mut covariance = 0.0;
                for (row, l) in left.iter().enumerate().filter(|(_, l)| **l != 0.0) {
                    for (column, r) in right.iter().enumerate().filter(|(_, r)| **r != 0.0) {
                        covariance += l * r * epoch.covariance.get(a.first + row, b.first + column);
                    }
                }
                self.row.push(covariance);
            }
        }
    }
}
