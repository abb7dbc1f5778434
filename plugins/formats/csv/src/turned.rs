//! Samples of a sensor whose axes are turned in the vehicle by any angle.

use crate::config::FileConfig;
use nalgebra::{Rotation3, Vector3};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::units::sample::Sample;

/// The turn of the vectors of a sensor.
#[derive(Clone, Debug, Default)]
pub struct Turned {
    /// `C_s^b`, and the first of each three channels along x, y and z.
    turn: Option<Rotation3<f64>>,
    vectors: Vec<usize>,
}

impl Turned {
    /// The turn that the file of a sensor has.
    pub fn new(config: &FileConfig, info: &SensorInfo) -> Self {
        let turn = config.rotation.map(|angles| {
            let [roll, pitch, yaw]: [f64; 3] = angles.si().into();
            Rotation3::from_euler_angles(roll, pitch, yaw)
        });
        let ends =
            |k: usize, axis: &str| info.channels.get(k).is_some_and(|c| c.name.ends_with(axis));
        let vector = |k: &usize| ["_x", "_y", "_z"].iter().enumerate().all(|(i, a)| ends(k + i, a));
        Self { turn, vectors: (0..info.channels.len()).filter(vector).collect() }
    }

    /// Turns the vectors of a sample. One that lacks a component has none afterwards, since each
    /// component would need it.
    pub fn apply(&self, sample: &mut Sample) {
        let Some(turn) = self.turn else { return };
        for first in &self.vectors {
            match sample.array::<3>(*first) {
                Some(vector) => {
                    let turned = turn * Vector3::from(vector);
                    turned.iter().enumerate().for_each(|(k, value)| sample.set(first + k, *value));
                }
                None => (0..3).for_each(|k| sample.clear(first + k)),
            }
        }
    }
}
