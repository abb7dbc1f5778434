//! Columns of the estimate: for every component of every block its value, 1-sigma and error, and the
//! covariance of every pair of components.

use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::RunInfo;
use navfuse_core::state::Block;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};

/// Columns of the estimate, in the units of the summary.
///
/// The covariance is the upper triangle of the symmetric matrix, row by row. The column
/// `A*B_cov_UNIT*UNIT` holds `cov(A, B)`; `A*A_cov` is the square of the 1-sigma of `A`. A position
/// counts north, east and down in metres, an attitude roll, pitch and yaw. A fixed block has no
/// covariance.
#[derive(Clone, Debug, Default)]
pub struct EstimateColumns {
    headings: Vec<String>,
    /// By slot: set if the block has columns for its error.
    errors: Vec<bool>,
    covariance: bool,
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

/// The names of the components of sigma, error and covariance.
fn differences(block: &Block) -> Vec<String> {
    match block.operations.reading {
        Reading::Tangent => names(block, &["north", "east", "down"]),
        _ => names(block, block.spec.display.components),
    }
}

/// The headings of a block.
fn of_block(block: &Block, error: bool, out: &mut Vec<String>) {
    let (display, tangent) = (&block.spec.display, block.operations.reading == Reading::Tangent);
    let units = if tangent { ["deg", "deg", display.unit] } else { [display.unit; 3] };
    let mut add = |name: &str, what: &str, unit: &str| {
        out.push(format!("{}.{name}{what}{}", block.name, ending(unit)))
    };
    for (k, name) in names(block, display.components).iter().enumerate() {
        add(name, "", units[k.min(2)]);
    }
    for what in ["_sigma", "_error"].into_iter().take(1 + usize::from(error)) {
        differences(block).iter().for_each(|name| add(name, what, display.unit));
    }
}

/// The headings of the covariance.
fn of_covariance(blocks: &[Block], out: &mut Vec<String>) {
    let uncertain = blocks.iter().filter(|b| b.tangent.is_some());
    let components: Vec<(String, &str)> = uncertain
        .flat_map(|b| {
            differences(b).into_iter().map(|c| (format!("{}.{c}", b.name), b.spec.display.unit))
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
    pub fn new(run: &RunInfo, covariance: bool) -> Self {
        let reference = run.sensors.iter().any(|s| s.purpose == Purpose::Reference);
        let blocks = &run.layout.blocks;
        let errors: Vec<bool> =
            blocks.iter().map(|b| reference || b.spec.truth.is_some()).collect();
        let mut headings = vec!["time_s".to_owned()];
        for (block, error) in blocks.iter().zip(&errors) {
            of_block(block, *error, &mut headings);
        }
        if covariance {
            of_covariance(blocks, &mut headings);
        }
        Self { headings, errors, covariance, ..Self::default() }
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
            block.show(values, &mut numbers);
            self.row.extend_from_slice(&numbers[..n]);
            block.show_sigma(values, epoch.covariance, &mut numbers);
            self.row.extend_from_slice(&numbers[..n]);
            if *error {
                match epoch.truth.filter(|t| t.known[slot]) {
                    Some(truth) => block.show_error(values, &truth.state.values, &mut numbers),
                    None => numbers.fill(f64::NAN),
                }
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
