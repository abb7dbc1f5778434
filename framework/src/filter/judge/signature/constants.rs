//! Constants that may be wrong: which there are, and what they act on.

use super::score::Score;
use super::wrong::Shares;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::model::sensor::Sensor;
use crate::state::manifold::Rotation;
use crate::state::{Block, Layout};
use crate::units::sample::{Channel, MAX_CHANNELS};
use std::any::TypeId;

/// Sigma of a scale factor of the driving sensor, and of the turn of its axes in rad, before any evidence: the
/// data sheets of MEMS state 1 %.
const USUAL: f64 = 0.01;

/// Kind of a constant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    /// A component of a fixed block.
    #[default]
    Fixed,
    /// The factor of a channel.
    Factor,
    /// A scale factor or axes of the driving sensor.
    Input,
    /// None: a place that keeps the components of a block together.
    Free,
}

saved!(
    enum Kind {
        Fixed,
        Factor,
        Input,
        Free,
    }
);

/// A constant that may be wrong.
#[derive(Clone, Copy, Default)]
pub(super) struct Component {
    pub(super) kind: Kind,
    /// Number of the block, of the channel, or of the error of the driving sensor.
    pub(super) of: usize,
    pub(super) component: usize,
    /// Index of the first sensor that reads the block, or of the sensor that has the error.
    pub(super) sensor: usize,
}

saved!(Component { kind, of, component, sensor });

/// Returns `true` for a channel of a length or a speed, which a wrong unit or scale multiplies.
pub(super) fn measures(channel: &Channel) -> bool {
    ["m", "mps"].contains(&channel.unit.suffix().as_str())
}

pub(super) fn turns(block: &Block) -> bool {
    block.operations.kind == TypeId::of::<Rotation>()
}

/// Rows of the error state that are rotations.
pub(super) fn rotations(layout: &Layout) -> Vec<usize> {
    layout.blocks.iter().filter(|block| turns(block)).flat_map(Block::tangent_range).collect()
}

/// Returns `true` if a sensor has an estimated block whose key ends with one of these words.
fn owns(layout: &Layout, sensor: &str, words: &[&str]) -> bool {
    let own = |block: &&Block| block.name.rsplit_once('.').is_some_and(|(part, _)| part == sensor);
    let named = |block: &Block| words.iter().any(|word| block.name.ends_with(word));
    layout.blocks.iter().filter(own).any(|block| block.estimated() && named(block))
}

/// Mean of a channel in its sigma below which its noise may make it up.
const ABOVE: f64 = 5.0;

/// The scale factors and the turns of the axes of the driving sensor, whose channels have biases in rows.
#[derive(Clone)]
pub(super) struct Inputs {
    /// Index of the sensor.
    sensor: usize,
    /// Shares of its channels in the rows of its biases, by error.
    pub(super) shares: Vec<Shares>,
    /// Root spectral densities of the noise of its channels.
    noise: Vec<f64>,
}

impl Inputs {
    pub(super) fn components(&self) -> impl Iterator<Item = Component> {
        let (sensor, kind, component) = (self.sensor, Kind::Input, 0);
        (0..self.shares.len()).map(move |of| Component { kind, of, component, sensor })
    }

    /// The means of the channels over a time, s, and zero for those that their noise may make up. The noise of a gyro
    /// is in the attitude as well, as if its scale factor were off by all of it: in six hours straight on, that would
    /// be evidence of 16 sigma (errors in variables, Fuller 1987).
    pub(super) fn above_noise(
        &self,
        means: &[f64; MAX_CHANNELS],
        duration: f64,
    ) -> [f64; MAX_CHANNELS] {
        let limit = |k: usize| ABOVE * self.noise.get(k).map_or(0.0, |n| n / duration.sqrt());
        std::array::from_fn(|k| if means[k].abs() > limit(k) { means[k] } else { 0.0 })
    }
}

/// The scale factors and the turns of the axes of the driving sensor, if the noise of its channels is known.
pub(super) fn inputs(composition: &Composition) -> Option<Inputs> {
    let process = composition.processes.iter().find(|process| process.input.is_some())?;
    let sensor = process.input?;
    let noise = process.screening.as_ref()?.channels.iter().map(|c| c.noise).collect();
    let blocks = process.biases.iter().map(|slot| &composition.layout.blocks[*slot]);
    let rows: Vec<usize> = blocks.flat_map(Block::tangent_range).collect();
    let Sensor { info, .. } = &composition.sensors[sensor];
    if owns(&composition.layout, &info.name, &["scale", "axes"]) {
        return None;
    }
    let channels = &info.channels;
    // a step in rates is one of the bias
    let rates = channels.iter().all(|c| ["radps", "mps2"].contains(&c.unit.suffix().as_str()));
    if rows.len() != channels.len() || rows.is_empty() || !rates {
        return None;
    }
    let scale = |k: usize| vec![(rows[k], k, 1.0)];
    let turn = |first: usize, axis: usize| {
        let [a, b] = [1, 2].map(|k| 3 * first + (axis + k) % 3);
        vec![(rows[a], b, -1.0), (rows[b], a, 1.0)]
    };
    let turns = (0..rows.len() / 3).flat_map(|first| (0..3).map(move |axis| (first, axis)));
    let all = (0..rows.len()).map(scale).chain(turns.map(|(first, axis)| turn(first, axis)));
    Some(Inputs { sensor, shares: all.collect(), noise })
}

/// Factor of the score by which a size that is unusual is less likely: `b^2 / (i + 1 / USUAL^2)` is twice the
/// log-likelihood ratio of a size that is a sample of that sigma.
pub(super) fn usual(kind: Kind, score: &Score) -> f64 {
    match kind {
        Kind::Input => (1.0 + score.variance() / (USUAL * USUAL)).sqrt().recip(),
        Kind::Fixed | Kind::Factor | Kind::Free => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::time::Time;

    /// Over a quarter of a second the noise of 2 units a root of a hertz has a sigma of 4 units.
    #[test]
    fn a_rate_that_noise_may_make_up_is_none() {
        let inputs = Inputs { sensor: 0, shares: Vec::new(), noise: vec![2.0; 3] };
        let mut means = [0.0; MAX_CHANNELS];
        means[..3].copy_from_slice(&[19.0, -19.0, -21.0]);
        assert_eq!(inputs.above_noise(&means, 0.25)[..3], [0.0, 0.0, -21.0]);
        assert_eq!(inputs.above_noise(&means, 1.0)[..3], [19.0, -19.0, -21.0]);
    }

    /// A size of 7 % +- 1 % is 7 sigma. Beside a prior of 1 % it is `7 / sqrt(2)`: the prior explains half of it.
    #[test]
    fn a_scale_of_an_imu_that_is_unusual_needs_more_evidence() {
        let mut score = Score::new(Time::MIN);
        score.add(700.0, 1e4, 1e4);
        assert!((score.size() - 0.07).abs() < 1e-12 && (score.sigmas() - 7.0).abs() < 1e-12);
        assert!((usual(Kind::Input, &score) - 0.5_f64.sqrt()).abs() < 1e-12);
        assert_eq!(usual(Kind::Factor, &score), 1.0);
    }
}
