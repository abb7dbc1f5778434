//! The place and the axes of a sensor on the vehicle.

use crate::state::manifold::{Rotation, Scalar, Vector, load_quaternion};
use crate::state::{Handle, Layout, State};
use nalgebra::{UnitQuaternion, Vector3};

/// The place and the axes of a sensor on the vehicle, as far as its model knows them. A sensor type
/// states them with [`crate::compose::Composer::mounted`]; logs and viewers draw the sensor there.
///
/// ```
/// # use navfuse_core::prelude::*;
/// # use navfuse_core::model::mounting::Mounting;
/// fn build(composer: &mut Composer, lever_arm: Handle<Vector<3>>, c_b_s: Handle<Rotation>) {
///     composer.mounted(Mounting::at(lever_arm).turned(c_b_s));
/// }
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mounting {
    place: Place,
    axes: Axes,
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
        Self { place: Place::LeverArm(lever_arm.slot), axes: Axes::Body }
    }

    /// A sensor at a constant lever arm (m), with the axes of the body.
    pub fn at_constant(lever_arm: Vector3<f64>) -> Self {
        Self { place: Place::Constant(lever_arm), axes: Axes::Body }
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
