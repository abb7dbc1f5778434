//! The update rule of each sensor.

use crate::compose::Composition;
use crate::model::sensor::rule::{Linear, Rule};

/// The rules of all sensors, with their work space.
pub(in crate::filter) struct Rules {
    /// One rule per sensor.
    own: Vec<Box<dyn Rule>>,
    /// The rule at a given trajectory, which is the point of linearisation for every sensor.
    given: Linear,
}

impl Rules {
    pub(super) fn new(composition: &Composition) -> Self {
        let own = composition.sensors.iter().map(|sensor| (sensor.update.create)());
        Self { own: own.collect(), given: Linear }
    }

    /// Rule of a sensor, at its estimate or at a given trajectory.
    pub(super) fn of(&mut self, sensor: usize, follows: bool) -> &mut dyn Rule {
        if follows { &mut self.given } else { self.own[sensor].as_mut() }
    }
}
