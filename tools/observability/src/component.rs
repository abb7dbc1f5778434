//! The uncertain components of a state and what is known of each.

use nalgebra::DMatrix;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use navfuse_core::state::{Block, Layout, Mode};
use serde::Serialize;

/// One component of an uncertain block.
#[derive(Clone, Debug)]
pub struct Component {
    /// Its block: `dvl.misalignment`.
    pub state: String,
    /// Its name: `roll`.
    pub name: String,
    /// The unit of its sigma; empty for a ratio.
    pub unit: &'static str,
    /// The block's place in the layout.
    pub slot: usize,
    /// Its place in the block.
    pub axis: usize,
    /// Whether updates leave it as it is.
    pub considered: bool,
}

impl Component {
    /// Those of a layout, in the order of the error state.
    pub fn of(layout: &Layout) -> Vec<Self> {
        let uncertain = layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
        let components = uncertain.flat_map(|(slot, block)| {
            let names = match block.operations.reading {
                Reading::Tangent => &["north", "east", "down"],
                _ => block.spec.display.components,
            };
            (0..block.operations.tangent).map(move |axis| Self {
                state: block.name.clone(),
                name: names.get(axis).map_or_else(|| axis.to_string(), |n| (*n).to_owned()),
                unit: block.spec.display.unit,
                slot,
                axis,
                considered: block.spec.mode == Mode::Consider,
            })
        });
        components.collect()
    }

    /// `dvl.misalignment roll`; the block alone where it has one component.
    pub fn title(&self, layout: &Layout) -> String {
        let single = layout.blocks[self.slot].operations.tangent == 1;
        if single { self.state.clone() } else { format!("{} {}", self.state, self.name) }
    }
}

/// What is known of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// At most a sixteenth of it is still prior.
    Determined,
    /// At most a half of it is still prior.
    InPart,
    /// More than a half of it is still prior.
    NotDetermined,
    /// The filter was told not to estimate it.
    Considered,
}

impl Verdict {
    /// As a person reads it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Determined => "determined",
            Self::InPart => "in part",
            Self::NotDetermined => "not determined",
            Self::Considered => "considered",
        }
    }
}

/// `L` of the start, row-major: column `i` is the displacement, in the tangent, of one prior sigma in what is shown as the
/// component `i`, so that `L L'` is the covariance.
pub fn square_root(layout: &Layout, values: &[f64], covariance: &DMatrix<f64>) -> Vec<f64> {
    let n = layout.tangent;
    let (mut shown, mut inverse) = (DMatrix::identity(n, n), DMatrix::identity(n, n));
    for block in layout.blocks.iter().filter(|b| b.tangent.is_some()) {
        let range = block.tangent_range();
        let j = shown_per_tangent(block, values);
        if let Some(i) = j.clone().try_inverse() {
            shown.view_mut((range.start, range.start), (range.len(), range.len())).copy_from(&j);
            inverse.view_mut((range.start, range.start), (range.len(), range.len())).copy_from(&i);
        }
    }
    let l = inverse * semidefinite(&(&shown * covariance * shown.transpose()));
    l.transpose().as_slice().to_vec()
}

/// Derivative of what is shown of a block with respect to its tangent.
fn shown_per_tangent(block: &Block, values: &[f64]) -> DMatrix<f64> {
    const STEP: f64 = 1e-6;
    let n = block.operations.tangent;
    let mut jacobian = DMatrix::zeros(n, n);
    for k in 0..n {
        let shown = |step: f64| {
            let (mut moved, mut delta, mut out) =
                (values.to_vec(), [0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
            delta[k] = step;
            (block.operations.retract)(&mut moved[block.range()], &delta[..n]);
            block.show_error(&moved, values, &mut out);
            out
        };
        let (up, down) = (shown(STEP), shown(-STEP));
        (0..n).for_each(|i| jacobian[(i, k)] = (up[i] - down[i]) / (2.0 * STEP));
    }
    jacobian
}

/// The Cholesky factor of a matrix that may be zero in some directions.
fn semidefinite(a: &DMatrix<f64>) -> DMatrix<f64> {
    let n = a.nrows();
    let mut l = DMatrix::zeros(n, n);
    for j in 0..n {
        let pivot: f64 = a[(j, j)] - l.row(j).columns(0, j).norm_squared();
        if pivot <= 1e-14 * a[(j, j)] {
            continue;
        }
        let root = pivot.sqrt();
        l[(j, j)] = root;
        for i in j + 1..n {
            let sum: f64 = (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum();
            l[(i, j)] = (a[(i, j)] - sum) / root;
        }
    }
    l
}
