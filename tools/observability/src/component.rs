//! The uncertain components of a state, and the verdict on each.

use nalgebra::DMatrix;
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::state::{Block, Layout, Mode};
use serde::{Deserialize, Serialize};

/// One component of an uncertain block.
#[derive(Clone, Debug)]
pub struct Component {
    /// Name of the block: `dvl.misalignment`.
    pub state: String,
    /// Name of the component: `roll`.
    pub name: String,
    /// Unit of the sigma; empty for a ratio.
    pub unit: &'static str,
    /// Index of the block in the layout.
    pub slot: usize,
    /// Index of the component in the block.
    pub axis: usize,
    /// Set if updates leave the component as it is (consider state).
    pub considered: bool,
}

impl Component {
    /// Lists the components of a layout, in the order of the error state.
    pub fn of(layout: &Layout) -> Vec<Self> {
        let uncertain = layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
        let components = uncertain.flat_map(|(slot, block)| {
            (0..block.operations.tangent).map(move |axis| Self {
                state: block.name.clone(),
                name: block.component(axis),
                unit: block.spec.display.unit,
                slot,
                axis,
                considered: block.spec.mode == Mode::Consider,
            })
        });
        components.collect()
    }

    /// Returns `dvl.misalignment roll`, or the block alone if it has a single component.
    pub fn title(&self, layout: &Layout) -> String {
        let single = layout.blocks[self.slot].operations.tangent == 1;
        if single { self.state.clone() } else { format!("{} {}", self.state, self.name) }
    }
}

/// How far the run determines a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Determination {
    /// At most a sixteenth of its variance is still prior.
    Determined,
    /// At most a half of its variance is still prior.
    InPart,
    /// More than a half of its variance is still prior.
    NotDetermined,
    /// The scenario considers the component: its uncertainty counts, but updates do not estimate
    /// it.
    Considered,
}

impl Determination {
    /// Returns the verdict as text.
    pub fn text(self) -> &'static str {
        match self {
            Self::Determined => "determined",
            Self::InPart => "in part",
            Self::NotDetermined => "not determined",
            Self::Considered => "considered",
        }
    }
}

/// Returns a square root `L` of the covariance, `P = L L'`, row-major. Column `i` is the
/// displacement in the tangent space for one prior sigma of the displayed component `i`. The root
/// is taken of the displayed covariance `J P J'` (`J` from [`shown_per_tangent`]) and mapped back,
/// so that each column belongs to one displayed component.
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

/// Returns the derivative of the displayed components of a block with respect to its tangent, by
/// central differences.
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

/// Returns the Cholesky factor of a positive semidefinite matrix; a direction with zero variance
/// has a zero column.
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
