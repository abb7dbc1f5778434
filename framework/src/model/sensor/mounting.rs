//! The place, the axes and the beams of a sensor on the vehicle.

use crate::state::manifold::{Rotation, Scalar, Vector, load_quaternion};
use crate::state::{Handle, Layout, State};
use nalgebra::{UnitQuaternion, Vector3};

/// The place, the axes and the beams of a sensor on the vehicle, as far as its model knows them.
///
/// A sensor type states them with [`crate::compose::Composer::mounted`]; logs and viewers draw the
/// sensor there, and at the origin of the body without it:
/// ```
/// # use navfuse_core::prelude::*;
/// # use navfuse_core::model::sensor::mounting::{Beam, Mounting, Reach};
/// /// Mounts an echo sounder whose channel 0 is the range along its only beam.
/// fn build(composer: &mut Composer, transducer: Handle<Vector<3>>, c_b_s: Handle<Rotation>) {
///     let down = Beam { direction: [0.0, 0.0, 1.0], channel: None, reach: Reach::Range(0) };
///     composer.mounted(Mounting::at(transducer).turned(c_b_s).with_beams([down]));
/// }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mounting {
    place: Place,
    axes: Axes,
    beams: Vec<Beam>,
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

/// The place of a sensor, from the origin of the body along its axes.
#[derive(Clone, Debug, Default, PartialEq)]
enum Place {
    #[default]
    Origin,
    /// A constant, m.
    Constant(Vector3<f64>),
    /// The slot of a lever arm.
    LeverArm(usize),
}

/// The axes of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
enum Axes {
    #[default]
    Body,
    /// The slot of the rotation from the body to the sensor.
    Turned(usize),
    /// The slots of pitch and yaw from the body to the sensor.
    Pointed([usize; 2]),
}

impl Mounting {
    /// A sensor at a lever arm, with the axes of the body.
    pub fn at(lever_arm: Handle<Vector<3>>) -> Self {
        Self::of_slots(Some(lever_arm.slot), None)
    }

    /// A sensor at a constant lever arm (m), with the axes of the body.
    pub fn at_constant(lever_arm: Vector3<f64>) -> Self {
        Self { place: Place::Constant(lever_arm), ..Self::default() }
    }

    /// A sensor at the lever arm and with the misalignment that these slots of a layout hold, where
    /// it has them.
    pub fn of_slots(lever_arm: Option<usize>, misalignment: Option<usize>) -> Self {
        Self {
            place: lever_arm.map_or(Place::Origin, Place::LeverArm),
            axes: misalignment.map_or(Axes::Body, Axes::Turned),
            beams: Vec::new(),
        }
    }

    /// Turns the axes by the rotation that maps from the body to the sensor, `C_b^s`.
    #[must_use]
    pub fn turned(self, c_b_s: Handle<Rotation>) -> Self {
        Self { axes: Axes::Turned(c_b_s.slot), ..self }
    }

    /// Points the forward axis of the sensor: first the yaw to the right, then the pitch up.
    #[must_use]
    pub fn pointed(self, pitch: Handle<Scalar>, yaw: Handle<Scalar>) -> Self {
        Self { axes: Axes::Pointed([pitch.slot, yaw.slot]), ..self }
    }

    /// Adds beams.
    #[must_use]
    pub fn with_beams(mut self, beams: impl IntoIterator<Item = Beam>) -> Self {
        self.beams.extend(beams);
        self
    }

    /// Beams of the sensor.
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// Returns `true` if the model knows a place of the sensor.
    pub fn is_placed(&self) -> bool {
        self.place != Place::Origin
    }

    /// Returns `true` if the axes of the sensor are not simply those of the body.
    pub fn is_turned(&self) -> bool {
        self.axes != Axes::Body
    }

    /// Returns `true` if the filter estimates a part of the mounting.
    pub fn is_estimated(&self, layout: &Layout) -> bool {
        let place = match self.place {
            Place::LeverArm(slot) => Some(slot),
            Place::Origin | Place::Constant(_) => None,
        };
        let axes: &[usize] = match &self.axes {
            Axes::Body => &[],
            Axes::Turned(slot) => std::slice::from_ref(slot),
            Axes::Pointed(slots) => slots,
        };
        place.iter().chain(axes).any(|slot| layout.blocks[*slot].tangent.is_some())
    }

    /// The place of the sensor in body axes, m, and the rotation `C_s^b` from the sensor to the
    /// body.
    pub fn pose(&self, layout: &Layout, state: &State) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let value = |slot: usize| &state.values[layout.blocks[slot].range()];
        let place = match self.place {
            Place::Origin => Vector3::zeros(),
            Place::Constant(place) => place,
            Place::LeverArm(slot) => Vector3::from_column_slice(value(slot)),
        };
        let axes = match self.axes {
            Axes::Body => UnitQuaternion::identity(),
            Axes::Turned(slot) => load_quaternion(value(slot)).inverse(),
            Axes::Pointed([pitch, yaw]) => {
                UnitQuaternion::from_euler_angles(0.0, value(pitch)[0], value(yaw)[0])
            }
        };
        (place, axes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_is_placed_or_turned_once_its_model_knows_more_than_the_body() {
        let body = Mounting::default();
        assert_eq!((body.is_placed(), body.is_turned()), (false, false));
        let placed = Mounting::at_constant(Vector3::x());
        assert_eq!((placed.is_placed(), placed.is_turned()), (true, false));
    }
}
