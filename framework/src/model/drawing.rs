//! Geometry of sensors on the vehicle, for sinks that draw it.

use crate::state::Handle;
use crate::state::manifold::{Rotation, Vector};

/// Place, orientation and beams of a sensor on the vehicle.
///
/// A type hands it over with [`Composer::draw`](crate::compose::Composer::draw); without that, a
/// sensor is drawn at its state `lever_arm`, turned by its state `misalignment`, where it has them:
/// ```
/// use navfuse_core::model::drawing::{Beam, Drawing, Reach};
/// use navfuse_core::prelude::*;
/// /// Draws an echo sounder whose channel 0 is the range along its only beam.
/// fn draw(composer: &mut Composer, lever_arm: Handle<Vector<3>>) {
///     let down = Beam { direction: [0.0, 0.0, 1.0], channel: None, reach: Reach::Range(0) };
///     composer.draw(Drawing::at(lever_arm).with_beams([down]));
/// }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drawing {
    /// Slot of the position of the sensor from the origin of the body, in body axes, m.
    pub lever_arm: Option<usize>,
    /// Slot of the rotation from the body's axes to those of the instrument.
    pub misalignment: Option<usize>,
    /// Beams.
    pub beams: Vec<Beam>,
}

/// Beam of an instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// Unit vector in the axes of the instrument.
    pub direction: [f64; 3],
    /// Channel that a sample lacks if the beam was lost; `None` where no channel belongs to the
    /// beam alone.
    pub channel: Option<usize>,
    /// Length of the beam.
    pub reach: Reach,
}

/// Length of a beam, by the channel from which it follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// No channel gives the length.
    Unknown,
    /// Range along the beam, m.
    Range(usize),
    /// Vertical distance of the instrument from the ground below it, m.
    Altitude(usize),
}

impl Drawing {
    /// Geometry of a sensor at a lever arm, along the axes of the body.
    pub fn at(lever_arm: Handle<Vector<3>>) -> Self {
        Self { lever_arm: Some(lever_arm.slot), ..Self::default() }
    }

    /// Turns the sensor: the block is the rotation from the body's axes to those of the instrument.
    #[must_use]
    pub fn turned(self, misalignment: Handle<Rotation>) -> Self {
        Self { misalignment: Some(misalignment.slot), ..self }
    }

    /// Adds beams.
    #[must_use]
    pub fn with_beams(mut self, beams: impl IntoIterator<Item = Beam>) -> Self {
        self.beams.extend(beams);
        self
    }
}
