//! Magnetometer: field direction in body axes, `z = C_n^b (cos I cos D, cos I sin D, sin I)`.
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Magnetometer: the direction of the Earth's field in body axes, as a unit vector.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Magnetometer {
    /// 1-sigma noise of each axis, as a share of the field.
    pub noise: Sigma<Ratio>,
    /// Dip of the field below the horizon.
    pub dip: Angle,
    /// Declination: the field's direction east of true north.
    pub declination: Calibration<Angle, AngularRateNoise>,
}

struct Model(Magnetometer, Navigation, Handle<Scalar>); // parameters, and the states it reads

impl SensorType for Magnetometer {
    const TYPE: &'static str = "magnetometer";
    fn channels(&self) -> Vec<Channel> {
        ["mag_x", "mag_y", "mag_z"].map(|name| Channel::new(name, "1")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let declination =
            self.declination.block(composer, "declination", &[0.0], display::ANGLE)?;
        Ok(Role::measurement(Model(self, Navigation::only(composer)?, declination)))
    }
}

impl MeasurementModel<3> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let ((sin, cos), (east, north)) = (self.0.dip.si().sin_cos(), x.get(self.2).sin_cos());
        x.get(self.1.attitude).inverse()
            * Vector3::new(north * convert(cos), east * convert(cos), convert(sin))
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * self.0.noise.value().si().powi(2)
    }
}
