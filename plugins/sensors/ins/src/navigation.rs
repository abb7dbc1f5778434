//! The navigation state as measurement models read it.

use nalgebra::{Matrix3, Vector3};
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::state::geodesy::{Geodetic, radii_of_curvature};
use navfuse_core::state::manifold::{Position, Rotation, Vector};
use navfuse_core::state::{Handle, Layout, Signal, State, Vehicle, View};

use crate::earth::EARTH_RATE;

/// The motion of a body, from which its sensors predict their samples. A process provides it with
/// [`Navigation::provide`]: a strapdown process with biases and angular rate, a kinematic model
/// without.
#[derive(Clone, Copy, Debug)]
pub struct Navigation {
    /// Attitude: body to navigation frame.
    pub attitude: Handle<Rotation>,
    /// Earth-referenced velocity, north, east, down, m/s.
    pub velocity: Handle<Vector<3>>,
    /// Geodetic position of the IMU.
    pub position: Handle<Position>,
    /// Gyro bias, rad/s, of a process with gyros.
    pub gyro_bias: Option<Handle<Vector<3>>>,
    /// Accelerometer bias, m/s^2, of a process with accelerometers.
    pub accel_bias: Option<Handle<Vector<3>>>,
    /// Angular rate with respect to inertial space as the gyros measured it, rad/s, of a process that
    /// publishes it.
    pub angular_rate: Option<Signal<3>>,
}

/// Derivative of [`Navigation::velocity_at`] with respect to the tangent of each block that it reads,
/// and to the lever arm.
#[derive(Clone, Copy, Debug)]
pub struct VelocityDerivative {
    /// Derivative with respect to the attitude.
    pub attitude: Matrix3<f64>,
    /// Derivative with respect to the velocity, which is `C_n^b`.
    pub velocity: Matrix3<f64>,
    /// Derivative with respect to the position.
    pub position: Matrix3<f64>,
    /// Derivative with respect to the gyro bias.
    pub gyro_bias: Matrix3<f64>,
    /// Derivative with respect to the lever arm.
    pub lever_arm: Matrix3<f64>,
}

/// Default name of a strapdown process, and therefore of the parameter with which a sensor refers
/// to it.
pub fn default_name() -> String {
    "ins".to_owned()
}

impl Navigation {
    /// Declares the motion of the body that a process moves. The biases and the angular rate are
    /// absent; a process that has them adds them as its states `gyro_bias` and `accel_bias` and as
    /// its signal `angular_rate`.
    pub fn provide(
        composer: &mut Composer,
        attitude: Handle<Rotation>,
        velocity: Handle<Vector<3>>,
        position: Handle<Position>,
    ) -> Self {
        composer.moves(Vehicle {
            position: Some(position),
            attitude: Some(attitude),
            velocity: Some(velocity),
        });
        let (gyro_bias, accel_bias, angular_rate) = (None, None, None);
        Self { attitude, velocity, position, gyro_bias, accel_bias, angular_rate }
    }

    /// Finds the navigation state of the process `name`; `key` is the parameter that named it.
    ///
    /// # Errors
    /// When there is no process of that name with an attitude, a velocity and a position.
    pub fn find(composer: &Composer, key: &str, name: &str) -> Result<Self, ComposeError> {
        Ok(Self {
            attitude: composer.find(key, &format!("{name}.attitude"))?,
            velocity: composer.find(key, &format!("{name}.velocity"))?,
            position: composer.find(key, &format!("{name}.position"))?,
            gyro_bias: composer.find(key, &format!("{name}.gyro_bias")).ok(),
            accel_bias: composer.find(key, &format!("{name}.accel_bias")).ok(),
            angular_rate: composer.find_signal(key, &format!("{name}.angular_rate")).ok(),
        })
    }

    /// As [`Self::find`] with the key `navigation`, for a sensor that needs the angular rate if `turns` is set: `what` names
    /// the reason, such as a lever arm.
    ///
    /// # Errors
    /// As for [`Self::find`], and when the process publishes no angular rate and `turns` is set.
    pub fn find_turning(
        composer: &Composer,
        name: &str,
        what: &str,
        turns: bool,
    ) -> Result<Self, ComposeError> {
        let key = "navigation";
        let navigation = Self::find(composer, key, name)?;
        if turns && navigation.angular_rate.is_none() {
            let text = format!(
                "{what} needs the angular rate of the body, and [process.{name}] publishes no \
                 signal angular_rate; remove {what}, or name a process with gyros"
            );
            return Err(ComposeError::new(key, text));
        }
        Ok(navigation)
    }

    /// The biases of gyros and accelerometers; zero where the process has none.
    pub(crate) fn biases(&self, layout: &Layout, state: &State) -> [Vector3<f64>; 2] {
        let of = |bias: Handle<Vector<3>>| state.get(layout, bias);
        [self.gyro_bias, self.accel_bias].map(|bias| bias.map_or_else(Vector3::zeros, of))
    }

    /// The angular rate that is published; zero where the process publishes none.
    pub(crate) fn published<T: Real>(&self, x: &View<'_, T>) -> [f64; 3] {
        self.angular_rate.map_or([0.0; 3], |rate| x.signal(rate))
    }

    /// Publishes an angular rate.
    pub(crate) fn publish(&self, state: &mut State, rate: &[f64; 3]) {
        if let Some(signal) = self.angular_rate {
            state.publish(signal, rate);
        }
    }

    /// Finds the navigation state of the vehicle, whatever the name of its process.
    ///
    /// # Errors
    /// When there is none.
    pub fn only(composer: &Composer) -> Result<Self, ComposeError> {
        let attitude = composer.vehicle().attitude.map(|attitude| composer.name(attitude));
        let owner = attitude.and_then(|name| name.split('.').next()).unwrap_or("ins");
        Self::find(composer, "", owner)
    }

    /// Angular rate of the body with respect to the Earth in body axes, rad/s:
    /// `w_eb^b = w_ib^b - b_g - C_n^b w_ie^n`. A lever arm moves relative to the Earth, so the
    /// Earth rate is subtracted; `w_ie^n` is Groves eq. 2.123. Zero where the process publishes no
    /// angular rate: see [`Self::find_turning`].
    pub fn angular_rate<T: Real>(&self, x: &View<'_, T>) -> Vector3<T> {
        let Some(signal) = self.angular_rate else { return Vector3::zeros() };
        let measured = Vector3::from(x.signal(signal)).map(nalgebra::convert::<f64, T>);
        let measured = self.gyro_bias.map_or(measured, |bias| measured - x.get(bias));
        let (sin, cos) = x.get(self.position).latitude.sin_cos();
        let rate: T = nalgebra::convert(EARTH_RATE);
        let w_ie_n = Vector3::new(rate * cos, T::zero(), -rate * sin);
        measured - x.get(self.attitude).inverse() * w_ie_n
    }

    /// Earth-referenced velocity in body axes, m/s, of the point at `lever_arm` (body axes, m) from
    /// the IMU: `C_n^b v^n + w_eb^b x l` (Groves eq. 17.13).
    pub fn velocity_at<T: Real>(&self, x: &View<'_, T>, lever_arm: &Vector3<T>) -> Vector3<T> {
        let v_b = x.get(self.attitude).inverse() * x.get(self.velocity);
        v_b + self.angular_rate(x).cross(lever_arm)
    }

    /// Computes the derivative of [`Self::velocity_at`]. With the attitude `exp([phi x]) C_b^n`,
    /// `C_n^b u` changes by `C_n^b [u x] phi`, and a change `dw` of the rate moves the point by
    /// `-[l x] dw`.
    pub fn velocity_derivative(
        &self,
        x: &View<'_, f64>,
        lever_arm: &Vector3<f64>,
    ) -> VelocityDerivative {
        let c_n_b = x.get(self.attitude).inverse().into_inner();
        let position = x.get(self.position);
        let ((sin, cos), (r_n, _)) =
            (position.latitude.sin_cos(), radii_of_curvature(position.latitude));
        let w_ie_n = Vector3::new(EARTH_RATE * cos, 0.0, -EARTH_RATE * sin);
        // per metre to the north
        let w_turned = Vector3::new(-EARTH_RATE * sin, 0.0, -EARTH_RATE * cos)
            * (1.0 / (r_n + position.height));
        let arm = lever_arm.cross_matrix();
        let to_north = arm * (c_n_b * w_turned);
        VelocityDerivative {
            attitude: c_n_b * x.get(self.velocity).cross_matrix()
                + arm * c_n_b * w_ie_n.cross_matrix(),
            velocity: c_n_b,
            position: Matrix3::from_columns(&[to_north, Vector3::zeros(), Vector3::zeros()]),
            gyro_bias: arm,
            lever_arm: self.angular_rate(x).cross_matrix(),
        }
    }

    /// Position of the point at `lever_arm` (body axes, m) from the IMU: `p [+] C_b^n l`.
    pub fn position_at<T: Real>(&self, x: &View<'_, T>, lever_arm: &Vector3<T>) -> Geodetic<T> {
        x.get(self.position).displaced(&(x.get(self.attitude) * lever_arm))
    }
}
