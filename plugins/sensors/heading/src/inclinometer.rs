//! Inclinometer: `z = [roll, pitch] + b + noise`, with the Euler angles of `C_b^n` (Groves eqs 2.23).

use crate::short_way;
use navfuse_core::Real;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Inclinometer, or the roll and pitch of an attitude sensor. Accelerations of the vehicle are part of
/// the noise, and of `correlated_error` where they last.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Inclinometer {
    /// 1-sigma noise of each angle.
    pub noise: Sigma<Angle>,
    /// Bias of the roll: the mounting of the instrument, and its offset. Default: zero.
    #[serde(default)]
    pub roll_bias: Calibration<Angle, AngularRateNoise>,
    /// Bias of the pitch. Default: zero.
    #[serde(default)]
    pub pitch_bias: Calibration<Angle, AngularRateNoise>,
    /// Process whose attitude is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

impl SensorType for Inclinometer {
    const TYPE: &'static str = "inclinometer";

    fn channels(&self) -> Vec<Channel> {
        ["roll", "pitch"].map(|name| Channel::new(name, "rad")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(InclinometerModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            roll_bias: self.roll_bias.block(composer, "roll_bias", &[0.0], display::ANGLE)?,
            pitch_bias: self.pitch_bias.block(composer, "pitch_bias", &[0.0], display::ANGLE)?,
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of an [`Inclinometer`].
#[derive(Clone, Debug)]
struct InclinometerModel {
    navigation: Navigation,
    roll_bias: Handle<Scalar>,
    pitch_bias: Handle<Scalar>,
    /// 1-sigma, rad.
    sigma: f64,
}

impl MeasurementModel<2> for InclinometerModel {
    /// Roll and pitch from the down axis in body axes, `u = C_n^b e_D`: `atan2(u_y, u_z)` and
    /// `atan2(-u_x, |u_yz|)`, whose derivatives are finite up to the vertical.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let down = Vector3::z().map(convert::<f64, T>);
        let u = x.get(self.navigation.attitude).inverse() * down;
        let level = (u.y * u.y + u.z * u.z).sqrt();
        SVector::from([
            u.y.atan2(u.z) + x.get(self.roll_bias),
            (-u.x).atan2(level) + x.get(self.pitch_bias),
        ])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }

    fn difference(&self, _: usize, measured: f64, predicted: f64) -> f64 {
        short_way(measured, predicted)
    }
}
