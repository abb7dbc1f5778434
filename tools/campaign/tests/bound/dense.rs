//! Dense least squares: every covariance is the inverse of one information matrix of all unknowns,
//! without a recursion.
//!
//! The unknowns are the initial state and the process noise of each step, each scaled to unit
//! variance: `x_0 = L_0 u_0`, `x_k = Phi_k x_(k-1) + L_k u_k` with `Q_k = L_k L_k'`. So `x_k = A_k
//! u`, the information of the samples is `I + sum A_k' H' R^-1 H A_k`, and the covariance of `x_k`
//! is `A_k (...)^-1 A_k'`.

use navfuse_core::nalgebra::{DMatrix, SymmetricEigen};

/// `H` and `R`.
pub type Measurement = (DMatrix<f64>, DMatrix<f64>);

/// Propagation to the time of a measurement, or of an epoch without a measurement.
pub struct Propagation {
    pub phi: DMatrix<f64>,
    pub q: DMatrix<f64>,
    pub measurement: Option<Measurement>,
}

/// The sigma of every state at one epoch.
pub struct Sigmas {
    pub filtered: Vec<f64>,
    pub smoothed: Vec<f64>,
}

pub struct Dense {
    prior: DMatrix<f64>,
    steps: Vec<Propagation>,
}

impl Dense {
    pub fn new(prior: DMatrix<f64>, steps: Vec<Propagation>) -> Self {
        Self { prior, steps }
    }

    /// Returns the sigmas at every epoch.
    pub fn sigmas(&self) -> Vec<Sigmas> {
        let n = self.prior.nrows();
        let unknowns = n * (self.steps.len() + 1);
        let mut a = DMatrix::zeros(n, unknowns);
        a.view_mut((0, 0), (n, n)).copy_from(&root(&self.prior));
        let mut information = DMatrix::identity(unknowns, unknowns);
        let mut epochs = Vec::new();
        for (k, step) in self.steps.iter().enumerate() {
            a = &step.phi * a;
            a.view_mut((0, n * (k + 1)), (n, n)).copy_from(&root(&step.q));
            match &step.measurement {
                Some((h, r)) => {
                    let ha = h * &a;
                    let r = r.clone().cholesky().expect("R is positive definite");
                    information += ha.tr_mul(&r.solve(&ha));
                }
                None => epochs.push((a.clone(), sigma(&a, &information))),
            }
        }
        let smoothed = |(a, filtered)| Sigmas { smoothed: sigma(&a, &information), filtered };
        epochs.into_iter().map(smoothed).collect()
    }
}

/// Returns `L` with `P = L L'`; `P` may be singular.
fn root(p: &DMatrix<f64>) -> DMatrix<f64> {
    let e = SymmetricEigen::new(p.clone());
    e.eigenvectors * DMatrix::from_diagonal(&e.eigenvalues.map(|v| v.max(0.0).sqrt()))
}

/// Returns the square roots of the diagonal of `A I^-1 A'`.
fn sigma(a: &DMatrix<f64>, information: &DMatrix<f64>) -> Vec<f64> {
    let solved = information
        .clone()
        .cholesky()
        .expect("information is positive definite")
        .solve(&a.transpose());
    (a * solved).diagonal().map(f64::sqrt).as_slice().to_vec()
}
