//! Magnetometer: field direction in body axes, `z = C_n^b (cos I cos D, cos I sin D, sin I)`.
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Magnetometer: the direction of the Earth's field in body axes, as a unit vector.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FieldDirection {
    /// 1-sigma noise of each axis, as a share of the field.
    pub noise: Sigma<Ratio>,
    /// Dip of the field below the horizon.
    pub dip: Angle,
    /// Declination: the field's direction east of true north.
    pub declination: Calibration<Angle, AngularRateNoise>,
}

impl SensorType for FieldDirection {
    const TYPE: &'static str = "field-direction";

    fn channels(&self) -> Vec<Channel> {
        ["mag_x", "mag_y", "mag_z"].map(|name| Channel::new(name, "1")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(Model {
            navigation: Navigation::only(composer)?,
            declination: self.declination.block(composer, "declination", &[0.0], display::ANGLE)?,
            dip: self.dip.si(),
            sigma: self.noise.value().si(),
        }))
    }
}

/// The states that the sensor reads, the dip in rad, and the noise of each axis.
struct Model {
    navigation: Navigation,
    declination: Handle<Scalar>,
    dip: f64,
    sigma: f64,
}

impl MeasurementModel<3> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let (east, north) = x.get(self.declination).sin_cos();
        let (down, level) = self.dip.sin_cos();
        let field = Vector3::new(north * convert(level), east * convert(level), convert(down));
        x.get(self.navigation.attitude).inverse() * field
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * (self.sigma * self.sigma)
    }
}
