//! A continuous output: corrections of the estimate are blended in over some time.
//!
//! An estimate jumps with a correction, such as the first fix after a dive. The output is the estimate
//! plus an offset, which takes the jump up and decays. The sigma of the output has the offset in it.

use navfuse_core::model::record::Epoch;
use navfuse_core::state::manifold::Operations;
use navfuse_core::state::{State, Vehicle};
use navfuse_core::units::time::Time;

/// A change of the rate of turn beyond so many usual ones is a correction.
const UNUSUAL: f64 = 5.0;
/// Steps over which a change of the rate of turn is usual, and of which a few have to be known.
const STEPS: [u32; 2] = [10, 100];

/// Position and attitude of a continuous output.
pub struct Blend {
    /// Time in which a correction decays to 1/e, s.
    time: f64,
    position: Followed,
    attitude: Followed,
    /// Time and velocity, north, east, down, m/s, of the last estimate.
    last: Option<(Time, Option<[f64; 3]>)>,
}

impl Blend {
    /// An output whose corrections decay to 1/e in a time, s.
    pub fn new(time: f64) -> Self {
        Self { time, position: Followed::default(), attitude: Followed::default(), last: None }
    }

    /// Moves position and attitude of `shown`, a copy of the estimate. Returns the offsets of position,
    /// m, and attitude, rad, along or about north, east and down.
    pub fn take(
        &mut self,
        vehicle: &Vehicle,
        epoch: &Epoch<'_>,
        shown: &mut State,
    ) -> [[f64; 3]; 2] {
        let (now, state) = (epoch.state.time, epoch.state);
        let velocity = vehicle.velocity.map(|v| <[f64; 3]>::from(state.get(epoch.layout, v)));
        let last = self.last.replace((now, velocity));
        let dt = last.map_or(0.0, |(time, _)| now.since(time));
        let share = (-dt / self.time).exp();
        let before = last.and_then(|(_, velocity)| velocity);
        // the mean velocity over the step, Euler's trapezoid
        let moved = velocity.zip(before).map(|(v, u)| [0, 1, 2].map(|k| 0.5 * (v[k] + u[k]) * dt));
        let places = [vehicle.position.map(|h| h.slot()), vehicle.attitude.map(|h| h.slot())];
        for (k, slot) in places.into_iter().enumerate() {
            let Some(block) = slot.map(|slot| &epoch.layout.blocks[slot]) else { continue };
            let (part, moved) = match k {
                0 => (&mut self.position, moved),
                _ => (&mut self.attitude, None),
            };
            part.step(&block.operations, &state.values[block.range()], moved, dt);
            part.offset = part.offset.map(|x| share * x);
            (block.operations.retract)(&mut shown.values[block.range()], &part.offset);
        }
        [self.position.offset, self.attitude.offset]
    }
}

/// A part of the output, with three degrees of freedom.
#[derive(Default)]
struct Followed {
    /// The last estimate.
    values: Vec<f64>,
    offset: [f64; 3],
    /// Change a second in the last step without a correction.
    rate: [f64; 3],
    /// Usual size of what the rate does not explain, and the number of steps behind it.
    usual: f64,
    steps: u32,
    /// Set where the last step had a correction.
    corrected: bool,
}

impl Followed {
    /// Takes the next estimate, `dt` seconds later; `moved` is its motion as far as it is known.
    fn step(&mut self, of: &Operations, values: &[f64], moved: Option<[f64; 3]>, dt: f64) {
        if self.values.len() == values.len() && dt > 0.0 {
            let mut change = [0.0; 3];
            (of.local)(values, &self.values, &mut change);
            let expected = moved.unwrap_or_else(|| self.rate.map(|rate| rate * dt));
            let jump = [0, 1, 2].map(|k| change[k] - expected[k]);
            if moved.is_some() || self.is_correction(&jump) {
                self.offset = [0, 1, 2].map(|k| self.offset[k] - jump[k]);
            } else {
                self.rate = change.map(|x| x / dt);
            }
        }
        self.values.clear();
        self.values.extend_from_slice(values);
    }

    /// Tests whether a change is a correction: it is unusual, and a single one. A vehicle that begins
    /// to turn goes on turning.
    fn is_correction(&mut self, jump: &[f64; 3]) -> bool {
        let size = jump.iter().map(|x| x * x).sum::<f64>().sqrt();
        let known = self.steps >= STEPS[0];
        let corrected = known && !self.corrected && size > UNUSUAL * self.usual;
        let size = if known { size.min(UNUSUAL * self.usual) } else { size };
        self.steps = (self.steps + 1).min(STEPS[1]);
        self.usual += (size - self.usual) / f64::from(self.steps);
        self.corrected = corrected;
        corrected
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::state::manifold::Vector;

    /// Passes estimates, 100 a second, and returns the output.
    fn follow(estimates: impl Iterator<Item = f64>, speed: Option<f64>) -> Vec<f64> {
        let (of, dt, share) = (Operations::of::<Vector<3>>(), 0.01, (-0.01_f64 / 2.0).exp());
        let mut followed = Followed::default();
        let output = estimates.map(|x| {
            followed.step(&of, &[x, 0.0, 0.0], speed.map(|v| [v * dt, 0.0, 0.0]), dt);
            followed.offset = followed.offset.map(|x| share * x);
            x + followed.offset[0]
        });
        output.collect()
    }

    fn largest_step(output: &[f64]) -> f64 {
        output.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_jump_of_the_position_is_blended_and_the_output_ends_at_the_estimate() {
        // 1 m/s, and 5 m ahead from 10 s on
        let at = |k: i32| 0.01 * f64::from(k) + if k > 1000 { 5.0 } else { 0.0 };
        let output = follow((0..3000).map(at), Some(1.0));
        assert!(
            largest_step(&output) < 0.01 + 5.0 * 0.01 / 2.0 + 1e-9,
            "{}",
            largest_step(&output)
        );
        assert!((output[2999] - at(2999)).abs() < 5.0 * (-19.9_f64 / 2.0).exp() + 1e-6);
    }

    #[test]
    fn a_correction_of_the_heading_is_blended_and_a_turn_is_followed_at_once() {
        // a wave of 0.1 rad/s, a correction of 0.05 rad at 10 s, and a turn of 0.5 rad/s from 20 s on
        let at = |k: i32| {
            let t = 0.01 * f64::from(k);
            0.1 * t.sin() + if k > 1000 { 0.05 } else { 0.0 } + 0.5 * (t - 20.0).max(0.0)
        };
        let output = follow((0..3000).map(at), None);
        assert!(
            largest_step(&output[..2000]) < 0.0015 + 0.05 * 0.01 / 2.0,
            "{}",
            largest_step(&output[..2000])
        );
        for k in [990, 1990, 2005, 2999] {
            let behind = (output[k] - at(k as i32)).abs();
            assert!(behind < 0.006, "{k}: {behind}");
        }
    }
}
