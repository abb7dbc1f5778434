//! Errors of a method over many runs, compared with its sigma.

use crate::Estimate;
use navfuse_segments::Mounting;

/// The results of a method on all runs.
#[derive(Clone, Debug)]
pub struct Repeated {
    /// Name of the method.
    pub name: String,
    /// Sensors that it uses.
    pub sensors: String,
    /// The runs to which the method could be applied.
    pub runs: Vec<Run>,
    /// The first reason why the method could not be applied.
    pub refused: Option<String>,
}

/// The result of a method on one run: `k` (1), roll, pitch and yaw (rad).
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Estimate minus truth.
    pub error: [f64; 4],
    /// 1-sigma; `None` if the method has none.
    pub sigma: Option<[f64; 4]>,
    /// Components that the run determined.
    pub determined: [bool; 4],
    /// Time until the estimate settled, s.
    pub settled_after: Option<f64>,
}

impl Run {
    /// The result of an estimate whose truth is known.
    pub fn new(estimate: &Estimate, truth: &Mounting) -> Self {
        Self {
            error: estimate.error(truth),
            sigma: estimate.sigma(),
            determined: estimate.determined,
            settled_after: estimate.settled_after(),
        }
    }

    /// Error of a component in units of its sigma.
    pub fn ratio(&self, i: usize) -> Option<f64> {
        Some(self.error[i] / self.sigma?[i]).filter(|ratio| ratio.is_finite())
    }
}

impl Repeated {
    /// Root mean square of a value over the runs, where all runs determined the component.
    fn rms(&self, i: usize, of: impl Fn(&Run) -> Option<f64>) -> Option<f64> {
        let squares: Option<Vec<f64>> =
            self.runs.iter().map(|r| of(r).filter(|_| r.determined[i]).map(|v| v * v)).collect();
        squares.filter(|s| !s.is_empty()).map(|s| (s.iter().sum::<f64>() / s.len() as f64).sqrt())
    }

    /// R.m.s. error, r.m.s. sigma, and the r.m.s. of their ratio, for `k` (1) and the angles (rad).
    pub fn figures(&self) -> [[Option<f64>; 4]; 3] {
        let all = |of: &dyn Fn(&Run, usize) -> Option<f64>| {
            std::array::from_fn(|i| self.rms(i, |r| of(r, i)))
        };
        [all(&|r, i| Some(r.error[i])), all(&|r, i| Some(r.sigma?[i])), all(&|r, i| r.ratio(i))]
    }

    /// Median over the runs of the time at which the method settled, s.
    pub fn settled_after(&self) -> Option<f64> {
        let mut times: Vec<f64> = self.runs.iter().filter_map(|r| r.settled_after).collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    }
}
