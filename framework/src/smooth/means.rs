//! The smoothed trajectory without its covariance, in memory: the backward recursion of
//! `adjoint.rs` for `lambda` alone.

use super::adjoint::Correction;
use super::segment::{Kind, Segment};
use crate::compose::course::Course;
use crate::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use crate::state::covariance::{Covariance, Transition, Update, backward, cholesky, forward};
use crate::state::{Layout, State};
use crate::units::sample::SensorId;
use crate::units::time::{Span, Time};
use std::io;

/// Time between the states of the trajectory. In between the filter propagates them with its
/// samples, and misses no more than the process noise of this time.
const SPACING: Span = Span::from_nanos(100_000_000);

/// Number of gated samples in a row with which a sensor contradicts the estimate, as for the warning
/// of a lock-out.
const IN_A_ROW: u32 = 5;

/// Records of a filter, or of a pass, from its start on.
pub(super) struct Records {
    segment: Segment,
    /// Start of the filter.
    pub(super) start: Option<Time>,
    /// Time of the last recorded state.
    last: Option<Time>,
    /// Sensors that contradict the estimate.
    pub(super) gated: Gated,
}

/// Number of times in a row that the gate refused the same channels of a sensor.
#[derive(Default)]
pub(super) struct Gated(Vec<Row>);

struct Row {
    sensor: SensorId,
    present: u16,
    count: u32,
}

impl Gated {
    fn take(&mut self, update: &UpdateRecord<'_>) {
        let UpdateRecord { sensor, present, .. } = *update;
        let refused =
            matches!(update.outcome, Outcome::Gated | Outcome::Rejected(Rejection::Isolated));
        let own = self.0.iter_mut().filter(|row| row.sensor == sensor);
        if !refused {
            let within = own.filter(|row| row.present & !present == 0);
            within.for_each(|row| row.count = 0);
        } else if let Some(row) = own.into_iter().find(|row| row.present == present) {
            row.count += 1;
        } else {
            self.0.push(Row { sensor, present, count: 1 });
        }
    }

    /// Returns `true` if the last samples of a sensor contradict the estimate.
    pub(super) fn contradict(&self) -> bool {
        self.0.iter().any(|row| row.count >= IN_A_ROW)
    }
}

impl Records {
    pub(super) fn new(layout: &Layout, considers: bool) -> Self {
        let segment = Segment::new(layout, considers);
        Self { segment, start: None, last: None, gated: Gated::default() }
    }

    pub(super) fn clear(&mut self) {
        self.segment.clear();
        (self.start, self.last, self.gated) = (None, None, Gated::default());
    }

    /// Records that the estimate `c [+] d` has become the state, with the injected error.
    pub(super) fn joined(&mut self, delta: &[f64]) {
        self.segment.injection(delta);
    }

    /// Computes the smoothed trajectory `x [+] (d + P lambda)`, or that `part` of the way to it.
    pub(super) fn smooth(&mut self, layout: &Layout, considered: &[bool], part: f64) -> Points {
        let n = layout.tangent;
        self.segment.end_product();
        let mut patterns = self.segment.take_patterns();
        let mut adjoint = Mean { lambda: vec![0.0; n], seen: Vec::new(), lower: Vec::new() };
        let (mut from, mut to) = (layout.initial_state(), layout.initial_state());
        let mut delta = vec![0.0; n];
        let mut points = Points { width: layout.ambient, times: Vec::new(), values: Vec::new() };
        for (kind, values, columns) in self.segment.reversed() {
            match kind {
                Kind::Step(pattern) => patterns[pattern].carry(values, &mut adjoint.lambda, 1),
                Kind::Update(m, w, _) => {
                    let correction = self.segment.correction_of(m, w, values, columns);
                    adjoint.correct(layout, &correction);
                }
                Kind::Course => {
                    let (time, rest) = values.split_at(1);
                    let (state, rest) = rest.split_at(layout.ambient);
                    let (triangle, offset) = rest.split_at(n * (n + 1) / 2);
                    adjoint.project(triangle, &mut delta);
                    let kept = delta.iter_mut().zip(considered).filter(|(_, kept)| **kept);
                    kept.for_each(|(delta, _)| *delta = 0.0);
                    delta
                        .iter_mut()
                        .zip(offset)
                        .for_each(|(delta, d)| *delta = part * (*delta + d));
                    from.values.copy_from_slice(state);
                    layout.displace(&from, &mut delta, &mut to);
                    points.times.push(Time::from_nanos(time[0].to_bits().cast_signed()));
                    points.values.extend_from_slice(&to.values);
                }
                Kind::Gated(..) | Kind::Epoch => {}
            }
        }
        self.segment.keep_patterns(patterns);
        points
    }
}

impl Observer for Records {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.gated.take(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.segment.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.segment.correction(update, (SensorId(0), Time::MIN));
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.start.get_or_insert(state.time);
        if self.last.is_none_or(|last| state.time - last >= SPACING) {
            self.last = Some(state.time);
            self.segment.course(state, covariance, offset);
        }
    }
}

/// The adjoint.
struct Mean {
    lambda: Vec<f64>,
    seen: Vec<f64>,
    lower: Vec<f64>,
}

impl Mean {
    /// Passes over a correction and the reset after it: `lambda = (I - K H)' lambda + H' S^-1 y`.
    fn correct(&mut self, layout: &Layout, correction: &Correction<'_>) {
        let Self { lambda, seen, lower } = self;
        let &Correction { m, columns, h, s, gain, innovation, delta, .. } = correction;
        layout.reset_back(delta, lambda, 1);
        // the filter has used this S, so it is positive definite
        if m == 0 || !cholesky(s, m, lower) {
            return;
        }
        seen.clear();
        seen.extend_from_slice(innovation);
        forward(lower, m, seen);
        backward(lower, m, seen);
        for (lambda, gain) in lambda.iter().zip(gain.chunks_exact(m)) {
            seen.iter_mut().zip(gain).for_each(|(seen, k)| *seen -= k * lambda);
        }
        for (seen, h) in seen.iter().zip(h.chunks_exact(columns.len().max(1))) {
            columns.iter().zip(h).for_each(|(&c, h)| lambda[c] += h * seen);
        }
    }

    /// Computes `delta = P lambda` from the lower triangle of `P`.
    fn project(&self, triangle: &[f64], delta: &mut [f64]) {
        delta.fill(0.0);
        let mut rest = triangle;
        for i in 0..delta.len() {
            let (row, left) = rest.split_at(i + 1);
            let ((earlier, own), lambda) = (delta.split_at_mut(i), self.lambda[i]);
            earlier.iter_mut().zip(row).for_each(|(delta, p)| *delta += p * lambda);
            own[0] += row.iter().zip(&self.lambda).map(|(p, l)| p * l).sum::<f64>();
            rest = left;
        }
    }
}

/// A trajectory in memory, the last state first.
pub(super) struct Points {
    pub(super) width: usize,
    pub(super) times: Vec<Time>,
    pub(super) values: Vec<f64>,
}

impl Course for Points {
    fn read(&mut self, mut place: u64, time: Time, values: &mut [f64]) -> io::Result<Option<u64>> {
        let count = self.times.len();
        while let Some(row) = usize::try_from(place).ok().and_then(|p| count.checked_sub(p + 1)) {
            if self.times[row] > time {
                break;
            }
            place += 1;
            if self.times[row] == time {
                values.copy_from_slice(&self.values[row * self.width..][..self.width]);
                return Ok(Some(place));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn update(sensor: usize, present: u16, outcome: Outcome) -> UpdateRecord<'static> {
        UpdateRecord {
            time: Time::MIN,
            sensor: SensorId(sensor),
            outcome,
            nis: 0.0,
            threshold: 0.0,
            present,
            innovation: &[],
            covariance: &[],
        }
    }

    /// The velocities of a receiver are refused, and its positions are used.
    #[test]
    fn channels_that_are_refused_five_times_in_a_row_contradict_whatever_others_do() {
        let mut gated = Gated::default();
        for k in 0..5 {
            assert!(!gated.contradict(), "{k}");
            gated.take(&update(0, 0b000_111, Outcome::Accepted));
            gated.take(&update(0, 0b111_000, Outcome::Gated));
            gated.take(&update(1, 0b111_000, Outcome::Accepted));
        }
        assert!(gated.contradict());
        gated.take(&update(0, 0b111_111, Outcome::Accepted));
        assert!(!gated.contradict());
    }
}
