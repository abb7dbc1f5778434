//! Continuity of a prediction where the blocks that it reads change.
//!
//! Between two states at which a model reads different blocks, a bisection finds a place where they
//! change. A model that interpolates is continuous there, and its derivative is right on either side.
//! A model with a branch jumps, by the contribution of the block that it leaves out.

use crate::Failure;
use crate::lab::Moment;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::state::{BlockSet, Layout, State};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample};

/// Number of bisections: the two sides are then 1e-12 of the distance of the states apart.
const STEPS: usize = 40;

/// Largest accepted jump, in sigma of the channel.
const JUMP: f64 = 1e-3;

/// Checks each pair of successive states.
pub fn check(
    model: &dyn AnyMeasurement,
    layout: &Layout,
    moments: &[Moment],
    names: &[&str],
) -> Result<(), Failure> {
    for pair in moments.windows(2) {
        let sample = &pair[0].sample;
        // a block that is absent at one of the states is no place between them
        if pair[0].state.labels == pair[1].state.labels {
            between(model, layout, sample, [&pair[0].state, &pair[1].state], names)?;
        }
    }
    Ok(())
}

fn between(
    model: &dyn AnyMeasurement,
    layout: &Layout,
    sample: &Sample,
    ends: [&State; 2],
    names: &[&str],
) -> Result<(), Failure> {
    let reads = |state: &State| model.blocks(&At { layout, state, sample });
    let (first, last) = (reads(ends[0]), reads(ends[1]));
    if first == last {
        return Ok(());
    }
    let (mut low, mut high) = (0.0, 1.0);
    let mut beyond = last;
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        let read = reads(&along(layout, ends, middle));
        if read == first {
            low = middle;
        } else {
            (high, beyond) = (middle, read);
        }
    }
    let n = model.channels();
    let (mut noise, mut sides) = ([0.0; MAX_CHANNELS * MAX_CHANNELS], [[0.0; MAX_CHANNELS]; 2]);
    for (part, side) in [low, high].into_iter().zip(&mut sides) {
        let state = along(layout, ends, part);
        let at = At { layout, state: &state, sample };
        model.predict(&at, &mut side[..n]);
        model.noise(&at, &mut noise[..n * n]);
    }
    for channel in (0..n).filter(|c| sample.get(*c).is_some()) {
        let jump = model.difference(channel, sides[1][channel], sides[0][channel]).abs();
        let sigma = noise[channel * n + channel].max(0.0).sqrt();
        if jump.is_finite() && jump > JUMP * sigma {
            return Err(Failure::new(format!(
                "predict reads {} at some states and not at others, and jumps by {jump:.2e} in \
                 channel {} where it changes, so its derivative is lost there; read every state \
                 with x.get(...) before the first branch, or interpolate",
                changed(layout, &first, &beyond),
                names[channel]
            )));
        }
    }
    Ok(())
}

/// Names of the blocks that one set has and the other has not.
fn changed(layout: &Layout, a: &BlockSet, b: &BlockSet) -> String {
    let slots = (0..layout.blocks.len()).filter(|&slot| a.contains(slot) != b.contains(slot));
    slots.map(|slot| layout.blocks[slot].name.as_str()).collect::<Vec<_>>().join(", ")
}

/// State on the way between two others, each block along its manifold; time and signals are those of
/// the first.
fn along(layout: &Layout, [from, to]: [&State; 2], part: f64) -> State {
    let mut state = from.clone();
    for block in &layout.blocks {
        let range = block.range();
        let mut delta = [0.0; MAX_TANGENT];
        let delta = &mut delta[..block.operations.tangent];
        (block.operations.local)(&to.values[range.clone()], &from.values[range.clone()], delta);
        delta.iter_mut().for_each(|d| *d *= part);
        (block.operations.retract)(&mut state.values[range], delta);
    }
    state
}
