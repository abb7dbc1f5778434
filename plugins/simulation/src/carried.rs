//! Motion in axes that are carried along with the position, without a turn about the vertical: wander
//! azimuth, north, east and down at the start. A leg of constant heading is straight, and may lead
//! through a pole.

use crate::phase::Motion;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_ins::earth::LocalEarth;

/// Place of the vehicle, and the direction of north in the axes of its motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub position: Geodetic,
    pub earth: LocalEarth,
    /// Azimuth of north in the axes of the motion, rad.
    north: f64,
}

/// Rotation from north, east and down of a place to Earth-fixed axes (Groves eq. 2.150, transposed).
fn to_earth(place: &Geodetic) -> Matrix3<f64> {
    let ((sin, cos), (sin_lon, cos_lon)) = (place.latitude.sin_cos(), place.longitude.sin_cos());
    #[rustfmt::skip]
    let rotation = Matrix3::new(
        -sin * cos_lon, -sin_lon, -cos * cos_lon,
        -sin * sin_lon, cos_lon, -cos * sin_lon,
        cos, 0.0, -sin,
    );
    rotation
}

impl Place {
    /// The place that the carried axes have reached by a rotation vector from those of the start.
    pub fn reached(origin: &Geodetic, turned: &Vector3<f64>, height: f64) -> Self {
        let axes = to_earth(origin) * Rotation3::from_scaled_axis(*turned).matrix();
        let down = axes.column(2);
        let latitude = (-down.z).atan2(down.x.hypot(down.y));
        let longitude = (-down.y).atan2(-down.x);
        Self {
            position: Geodetic { latitude, longitude, height },
            earth: LocalEarth::at(latitude, height),
            // the projection of the axis of the Earth
            north: axes.m32.atan2(axes.m31),
        }
    }

    /// Turns a vector of the axes of the motion to north, east, down.
    pub fn northern(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        about_down(-self.north) * vector
    }

    /// Turns an attitude in the axes of the motion to north, east, down.
    pub fn attitude(&self, c_b_w: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -self.north) * c_b_w
    }

    /// Heading from north of a heading in the axes of the motion.
    pub fn heading(&self, heading: f64) -> f64 {
        heading - self.north
    }

    /// Transport rate of a velocity, both in the axes of the motion, rad/s: the curvature is along
    /// north and east, and nothing turns about the vertical.
    pub fn transport_rate(&self, velocity: &Vector3<f64>) -> Vector3<f64> {
        let v = self.northern(velocity);
        let rate = Vector3::new(v.y * self.earth.inv_e, -v.x * self.earth.inv_n, 0.0);
        about_down(self.north) * rate
    }

    /// Derivative of the rotation vector of the axes (Bortz, *IEEE Trans. Aerospace and Electronic
    /// Systems* 7, 1971; to the third order, 1e-7 of the rate after 600 km).
    pub fn slope(&self, turned: &Vector3<f64>, velocity: &Vector3<f64>) -> Vector3<f64> {
        let w = self.transport_rate(velocity);
        let cross = turned.cross(&w);
        w + cross * 0.5 + turned.cross(&cross) * (1.0 / 12.0)
    }

    /// Angular rate of the axes of the motion with respect to inertial space, and specific force, both
    /// in these axes.
    pub fn inertial(&self, motion: &Motion) -> (Vector3<f64>, Vector3<f64>) {
        let w_ie = about_down(self.north) * self.earth.earth_rate();
        let w_en = self.transport_rate(&motion.velocity);
        let coriolis = (w_ie * 2.0 + w_en).cross(&motion.velocity);
        let gravity = Vector3::new(0.0, 0.0, self.earth.gravity);
        (w_ie + w_en, motion.acceleration + coriolis - gravity)
    }
}

fn about_down(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
}
