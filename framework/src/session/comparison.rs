//! Path of the estimates, and their errors against the reference.

use crate::checkpoint::saved;
use crate::model::record::Epoch;
use crate::state::carried::Back;
use crate::state::covariance::Covariance;
use crate::state::{Block, Handle, Layout};
use crate::units::time::Time;
use serde::Serialize;

/// Horizontal position error against the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HorizontalError {
    /// At the last reference, m.
    #[serde(rename = "final")]
    pub last: f64,
    /// Root mean square over all references, m.
    pub rms: f64,
    /// The last error in per cent of the path length of the reference; null for a path below 1 m.
    pub percent_of_distance: Option<f64>,
}

/// A block's estimate beside the last reference. Error and sigma in the display unit are computed on
/// request: a run compares its estimates thousands of times, and its summary shows the last one.
#[derive(Clone, Debug)]
pub(crate) struct Compared {
    /// Time of the last comparison, if there was one.
    time: Option<Time>,
    /// Time since the comparison before, s.
    interval: f64,
    /// The block as the only one of a state.
    block: Block,
    value: Vec<f64>,
    truth: Vec<f64>,
    covariance: Covariance,
}

saved!(Compared { time, interval, covariance } each { value, truth } except { block });

impl Compared {
    fn new(block: &Block) -> Self {
        let states = block.tangent_range().len();
        let alone = Block { offset: 0, tangent: block.tangent.map(|_| 0), ..block.clone() };
        Self {
            time: None,
            interval: 0.0,
            value: vec![0.0; block.operations.ambient],
            truth: vec![0.0; block.operations.ambient],
            covariance: Covariance::zero(states),
            block: alone,
        }
    }

    /// A comparison with a truth of zero: the estimate has that error and sigma in each component.
    #[cfg(test)]
    pub(crate) fn beside(block: &Block, time: Time, error: [f64; 3], sigma: f64) -> Self {
        let mut compared = Self { time: Some(time), ..Self::new(block) };
        compared.value.copy_from_slice(&error);
        (0..3).for_each(|k| compared.covariance.set(k, k, sigma * sigma));
        compared
    }

    /// Replaces the comparison by that of another epoch.
    fn replace(&mut self, block: &Block, epoch: &Epoch<'_>, truth: &[f64]) {
        let time = epoch.state.time;
        self.interval = self.time.replace(time).map_or(0.0, |before| time.since(before));
        self.value.copy_from_slice(&epoch.state.values[block.range()]);
        self.truth.copy_from_slice(truth);
        self.covariance.copy_block(epoch.covariance, block.tangent_range());
    }

    /// Forgets a comparison of another time.
    pub(crate) fn forget_unless_at(&mut self, time: Time) {
        self.time = self.time.filter(|own| *own == time);
    }

    /// True if the comparison is recent enough to hold at the end.
    pub(crate) fn holds_at(&self, end: Time) -> bool {
        self.time.is_some_and(|time| end.since(time) <= (2.0 * self.interval).max(2.0))
    }

    /// The block, as the only one of a state.
    pub(crate) fn block(&self) -> &Block {
        &self.block
    }

    /// Error of the estimate, in the display unit.
    pub(crate) fn error(&self) -> Vec<f64> {
        let mut error = vec![0.0; self.block.operations.tangent];
        self.block.show_error(&self.value, &self.truth, &mut error);
        error
    }

    /// 1-sigma of the estimate, in the display unit.
    pub(crate) fn sigma(&self) -> Vec<f64> {
        let mut sigma = vec![0.0; self.block.operations.tangent];
        self.block.show_sigma(&self.value, &self.covariance, &mut sigma);
        sigma
    }
}

/// Estimates of a run compared with the reference.
#[derive(Debug)]
pub(crate) struct Comparison {
    position: Option<usize>,
    before: Option<Vec<f64>>,
    before_truth: Option<Vec<f64>>,
    distance: f64,
    true_distance: f64,
    errors: (u64, f64, f64),
    /// Comparison of each block.
    pub(crate) compared: Vec<Compared>,
}

saved!(Comparison {
    before, before_truth, distance, true_distance, errors
} each { compared } except { position });

impl Comparison {
    pub(crate) fn new(layout: &Layout) -> Self {
        Self {
            position: layout.vehicle().position.map(Handle::slot),
            before: None,
            before_truth: None,
            distance: 0.0,
            true_distance: 0.0,
            errors: (0, 0.0, 0.0),
            compared: layout.blocks.iter().map(Compared::new).collect(),
        }
    }

    pub(crate) fn epoch(&mut self, epoch: &Epoch<'_>) {
        if let Some(slot) = self.position {
            let block = &epoch.layout.blocks[slot];
            let step = |before: &mut Option<Vec<f64>>, now: &[f64]| {
                let mut d = [0.0; 3];
                if let Some(before) = before {
                    (block.operations.local)(now, before, &mut d);
                    before.copy_from_slice(now);
                } else {
                    *before = Some(now.to_vec());
                }
                d[0].hypot(d[1])
            };
            let now = &epoch.state.values[block.range()];
            self.distance += step(&mut self.before, now);
            if let Some(truth) = epoch.truth.filter(|t| t.known[slot]) {
                let true_now = &truth.state.values[block.range()];
                self.true_distance += step(&mut self.before_truth, true_now);
                let mut e = [0.0; 3];
                (block.operations.local)(now, true_now, &mut e);
                let (count, squares, _) = self.errors;
                let error = e[0].hypot(e[1]);
                self.errors = (count + 1, squares + error * error, error);
            }
        }
        if let Some(truth) = epoch.truth {
            for (slot, block) in
                epoch.layout.blocks.iter().enumerate().filter(|(slot, _)| truth.known[*slot])
            {
                let mut back = Back::default();
                let states = [truth.state, epoch.state];
                let value = epoch.layout.true_value(slot, states, truth.known, &mut back);
                self.compared[slot].replace(block, epoch, value);
            }
        }
    }

    /// Horizontal path length, m: of the reference, or of the estimate where no reference reaches
    /// the end.
    pub(crate) fn distance(&self, end: Time) -> f64 {
        let (count, ..) = self.errors;
        let position = self.position.map(|slot| &self.compared[slot]);
        let to_the_end = count > 1 && position.is_some_and(|c| c.holds_at(end));
        if to_the_end { self.true_distance } else { self.distance }
    }

    pub(crate) fn horizontal_error(&self) -> Option<HorizontalError> {
        let (count, squares, last) = self.errors;
        (count > 0).then(|| HorizontalError {
            last,
            rms: (squares / count as f64).sqrt(),
            percent_of_distance: (self.true_distance >= 1.0)
                .then(|| 100.0 * last / self.true_distance),
        })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::state::manifold::{Operations, Vector};
    use crate::state::{BlockSpec, Dynamics, Mode, display};

    /// A velocity as the only block of a state.
    pub(crate) fn velocity() -> Block {
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: vec![1.0; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::VELOCITY,
        };
        let (operations, tangent) = (Operations::of::<Vector<3>>(), Some(0));
        let name = "ins.velocity".to_owned();
        Block { name, spec, operations, offset: 0, tangent, wanders: false, label: None }
    }

    /// A comparison at 10 s, after that interval.
    fn compared(interval: f64) -> Compared {
        let block = velocity();
        let time = Some(Time::from_nanos(10_000_000_000));
        Compared { time, interval, ..Compared::new(&block) }
    }

    /// Two intervals of 3 s end at 16 s. A fast reference counts for 2 s.
    #[test]
    fn the_last_comparison_holds_for_two_intervals_of_the_reference_and_for_2_seconds_at_least() {
        let until = |interval: f64, last: i64| {
            let holds = |ms: i64| compared(interval).holds_at(Time::from_nanos(ms * 1_000_000));
            assert!(holds(last) && !holds(last + 1), "{interval}");
        };
        until(3.0, 16_000);
        until(0.1, 12_000);
        until(0.0, 12_000);
    }

    /// Errors of 3 m and 4 m have the mean square 12.5 m^2; the last one is 2 % of 200 m.
    #[test]
    fn the_horizontal_error_is_a_root_mean_square_and_a_percentage_of_the_true_path() {
        let comparison = |errors, true_distance| Comparison {
            position: None,
            before: None,
            before_truth: None,
            distance: 0.0,
            true_distance,
            errors,
            compared: Vec::new(),
        };
        let of =
            |c: Comparison| c.horizontal_error().map(|e| (e.last, e.rms, e.percent_of_distance));
        assert_eq!(of(comparison((2, 25.0, 4.0), 200.0)), Some((4.0, 12.5_f64.sqrt(), Some(2.0))));
        assert_eq!(of(comparison((2, 25.0, 4.0), 0.9)), Some((4.0, 12.5_f64.sqrt(), None)));
        assert_eq!(of(comparison((0, 0.0, 0.0), 200.0)), None);
    }
}
