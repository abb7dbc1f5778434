//! Rule: a bias that the filter takes as constant stays constant.
//!
//! An estimate of a constant moves from `x1` to `x2` while its variance falls from `P1` to `P2`; the
//! difference has the variance `P1 - P2`. A larger move shows that the constant has changed, or that
//! a sensor contradicts the others. What a tilt of the axes takes off gravity, in the second order, is in the
//! estimate of the accelerometer bias, and leaves it as the tilt becomes known
//! ([`navfuse_core::model::process::SecondOrder`]).

use super::fault::Fault;
use crate::imu::STANDARD_GRAVITY;
use crate::navigation::Navigation;
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::SecondOrder;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};
use navfuse_core::state::{Block, Dynamics, Handle, Mode};
use navfuse_core::units::time::{Span, Time};
use std::collections::VecDeque;

/// Time between two estimates that are kept.
const PERIOD: Span = Span::from_nanos(20_000_000_000);
/// Number of estimates that are kept.
const KEPT: usize = 16;
/// Move in sigma at which the result is doubtful, and at which it is useless. Of a million moves of
/// a constant, 0.6 are larger than the first.
const DOUBTFUL: f64 = 5.0;
const USELESS: f64 = 5.5;
/// Least decrease of the variance, as a share of it, that allows a comparison.
const DECREASE: f64 = 1e-4;

/// Estimates and variances at one time.
#[derive(Clone, Debug, Default)]
struct Kept {
    time: Time,
    values: Vec<f64>,
    variances: Vec<f64>,
}

saved!(Kept { time, values, variances });

/// Moves of the estimates of constants.
#[derive(Clone)]
pub(super) struct Drift {
    navigation: Navigation,
    kept: VecDeque<Kept>,
    severity: Option<Severity>,
}

saved!(Drift { kept, severity } except { navigation });

/// Of a block that comes and goes, another object may have the place by now.
fn is_constant(block: &Block) -> bool {
    let stays = block.spec.mode == Mode::Estimate && block.label.is_none();
    stays && matches!(block.spec.dynamics, Dynamics::Constant)
}

impl Drift {
    pub(super) fn new(navigation: Navigation) -> Self {
        Self { navigation, kept: VecDeque::with_capacity(KEPT), severity: None }
    }

    #[inline]
    pub(super) fn take(&mut self, filter: &FilterView<'_>, time: Time) -> Option<Fault> {
        if self.kept.back().is_some_and(|last| time < last.time + PERIOD) {
            return None;
        }
        let fault = self.judge(filter);
        self.keep(filter, time);
        fault
    }

    /// Begins again with the next estimate: the difference of two variances says nothing about a
    /// move across a covariance that the filter has widened.
    pub(super) fn widened(&mut self) {
        self.kept.iter_mut().for_each(|kept| kept.time = Time::MIN);
    }

    /// Blocks that no process moves, with their slots.
    fn constants<'a>(
        &self,
        filter: &FilterView<'a>,
    ) -> impl Iterator<Item = (usize, &'a Block)> + use<'a> {
        let n = &self.navigation;
        let moving = [n.attitude.slot(), n.velocity.slot(), n.position.slot()];
        let blocks = filter.layout.blocks.iter().enumerate();
        blocks.filter(move |(slot, block)| !moving.contains(slot) && is_constant(block))
    }

    /// Keeps the estimate. All room is allocated at the first call.
    fn keep(&mut self, filter: &FilterView<'_>, time: Time) {
        let n = filter.layout.tangent;
        if self.kept.is_empty() {
            let values = filter.state.values.clone();
            let kept = Kept { time: Time::MIN, values, variances: vec![0.0; n] };
            self.kept.resize(KEPT, kept);
        }
        let Some(mut kept) = self.kept.pop_front() else { return };
        kept.time = time;
        kept.values.copy_from_slice(&filter.state.values);
        (0..n).for_each(|i| kept.variances[i] = filter.covariance.get(i, i));
        self.kept.push_back(kept);
    }

    /// Largest mean square, along each axis, of the second order of gravity in the tilt at a kept estimate.
    fn tilted(&self, filter: &FilterView<'_>, kept: &Kept) -> [f64; 3] {
        let attitude = self.navigation.attitude;
        let rows = filter.layout.blocks[attitude.slot()].tangent_range();
        let tilts = kept.variances[rows].iter().take(2).sum::<f64>();
        let along = SecondOrder::mean_square(STANDARD_GRAVITY, tilts, tilts * tilts);
        let c_b_n = filter.state.get(filter.layout, attitude);
        [0, 1, 2].map(|axis| along * c_b_n[(2, axis)].powi(2))
    }

    /// Blames the IMU if one of its biases moved more than any other constant.
    fn judge(&mut self, filter: &FilterView<'_>) -> Option<Fault> {
        let gyro = self.navigation.gyro_bias.map(Handle::slot);
        let accel = self.navigation.accel_bias.map(Handle::slot);
        let (mut own, mut other): (f64, f64) = (0.0, 0.0);
        let mut worst = None;
        for kept in self.kept.iter().filter(|kept| kept.time > Time::MIN) {
            let tilted = self.tilted(filter, kept);
            for (slot, block) in self.constants(filter) {
                let n = block.operations.tangent;
                let mut moved = [0.0; navfuse_core::state::manifold::MAX_TANGENT];
                (block.operations.local)(
                    &kept.values[block.range()],
                    &filter.state.values[block.range()],
                    &mut moved[..n],
                );
                for (k, i) in block.tangent_range().enumerate() {
                    let decrease = kept.variances[i] - filter.covariance.get(i, i);
                    if decrease < DECREASE * kept.variances[i] {
                        continue;
                    }
                    let further = if Some(slot) == accel { tilted[k] } else { 0.0 };
                    let sigmas = moved[k].abs() / (decrease + further).sqrt();
                    if Some(slot) != gyro && Some(slot) != accel {
                        other = other.max(sigmas);
                    } else if sigmas > own {
                        own = sigmas;
                        worst = Some((slot, kept.time));
                    }
                }
            }
        }
        let (slot, since) = worst.filter(|_| own > DOUBTFUL && own > other)?;
        let severity = if own > USELESS { Severity::DoNotUse } else { Severity::Doubtful };
        if self.severity.is_some_and(|before| before >= severity) {
            return None;
        }
        self.severity = Some(severity);
        let what = if Some(slot) == gyro { "gyro" } else { "accelerometer" };
        Some(Fault {
            severity,
            basis: Basis::Comparison,
            text: format!(
                "since {since} the estimate of the {what} bias has moved by {own:.1} times what its \
                 uncertainty allows: a bias of the IMU has changed, or its noise is larger than \
                 stated"
            ),
            remedy: "check the IMU (temperature, supply, mounting); let the bias wander \
                     (random_walk or correlation_time of gyro_bias and accel_bias), or raise the \
                     noise of the IMU"
                .to_owned(),
        })
    }
}
