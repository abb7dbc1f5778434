//! Fixed blocks that were found to be wrong, and are estimated since then.

use super::Derived;
use crate::state::manifold::{MAX_TANGENT, Reading};
use crate::state::{Block, State};
use crate::units::time::Time;

/// Words between the name of the block and the time in the name of the derived quantity.
const SINCE: &str = ", estimated since ";
/// Columns of the derived quantity.
const COLUMNS: [&str; 2] = ["estimate", "sigma"];

/// A fixed block that was found to be wrong, and that the filter estimates since then.
#[derive(Clone, Debug, PartialEq)]
pub struct Corrected {
    /// Name of the block, such as `dvl.lever_arm`.
    pub block: String,
    /// Time of the finding, on the run's clock.
    pub since: Time,
    /// Unit of estimate and sigma; empty for a ratio.
    pub unit: String,
    /// Names of the components.
    pub components: Vec<String>,
    /// Estimate of each component in the unit.
    pub estimate: Vec<f64>,
    /// 1-sigma of each component in the unit.
    pub sigma: Vec<f64>,
}

impl Corrected {
    /// A block of a state whose error has the covariance `sum v v'`, with the vectors `v` in SI; `None` for a
    /// position, whose estimate and sigma have different units.
    pub(crate) fn new(
        block: &Block,
        state: &State,
        since: Time,
        vectors: impl Iterator<Item = Vec<f64>>,
    ) -> Option<Self> {
        if block.operations.reading == Reading::Tangent {
            return None;
        }
        let (n, display) = (block.operations.tangent, &block.spec.display);
        let jacobian = block.shown_jacobian(&state.values);
        let (mut estimate, mut variance) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        block.show(&state.values, &mut estimate);
        for vector in vectors {
            for (variance, row) in variance.iter_mut().zip(jacobian.chunks_exact(n)).take(n) {
                *variance += row.iter().zip(&vector).map(|(j, v)| j * v).sum::<f64>().powi(2);
            }
        }
        let sigma = variance[..n].iter().map(|variance| variance.sqrt() / display.scale);
        Some(Self {
            block: block.name.clone(),
            since,
            unit: display.unit.to_owned(),
            components: (0..n).map(|k| block.component(k)).collect(),
            estimate: estimate[..n].to_vec(),
            sigma: sigma.collect(),
        })
    }

    /// The block as a derived quantity, which log, recording and page show: a row for each component.
    pub fn derived(&self, time: Time) -> Derived {
        let values = self.estimate.iter().zip(&self.sigma);
        Derived {
            time,
            name: format!("{}{SINCE}{}", self.block, self.since).into(),
            unit: self.unit.as_str().into(),
            rows: self.components.as_slice().into(),
            columns: COLUMNS.map(str::to_owned).into(),
            values: values.flat_map(|(estimate, sigma)| [*estimate, *sigma]).collect(),
        }
    }

    /// Reads a derived quantity; `None` for one of another kind.
    pub fn read(derived: &Derived) -> Option<Self> {
        let (block, since) = derived.name.split_once(SINCE)?;
        let since = since.strip_suffix(" s").and_then(|seconds| seconds.parse().ok())?;
        if *derived.columns != COLUMNS.map(str::to_owned) {
            return None;
        }
        let column = |k: usize| derived.iter().map(|(_, values)| values[k]).collect();
        Some(Self {
            block: block.to_owned(),
            since: Time::from_seconds(since)?,
            unit: derived.unit.to_string(),
            components: derived.rows.to_vec(),
            estimate: column(0),
            sigma: column(1),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corrected_block_is_read_back_from_the_derived_quantity() {
        let corrected = Corrected {
            block: "dvl.lever_arm".to_owned(),
            since: Time::from_nanos(380_500_000_000),
            unit: "m".to_owned(),
            components: ["x", "y", "z"].map(str::to_owned).to_vec(),
            estimate: vec![-0.5, 0.004, 0.2],
            sigma: vec![0.01, 0.02, 0.03],
        };
        let derived = corrected.derived(Time::from_nanos(630_000_000_000));
        assert_eq!(&*derived.name, "dvl.lever_arm, estimated since 380.500 s");
        assert_eq!(Corrected::read(&derived), Some(corrected));
        let other = Derived { name: "share".into(), ..derived };
        assert_eq!(Corrected::read(&other), None);
    }
}
