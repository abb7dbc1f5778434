//! Magnetic heading: `z = psi - D - d + noise`, with the heading `psi`, the declination `D` of the
//! place and the deviation `d` of the vehicle's own field (Groves section 6.1.1).

use crate::short_way;
use crate::wmm::{Earth, MagneticModel};
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Magnetic compass: the heading from magnetic north, already corrected for tilt. A constant
/// deviation is a state; one that turns with the heading (soft iron) is not modelled.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MagneticHeading {
    /// 1-sigma noise of one heading.
    pub noise: Sigma<Angle>,
    /// Declination: the direction of magnetic north from true north, east positive. It changes by
    /// about 0.1 deg a year and a few deg in 1000 km. Default: zero, or the value of `wmm`, considered
    /// with the uncertainty of the model.
    #[serde(default)]
    pub declination: Calibration<Angle, AngularRateNoise>,
    /// Place and date at which the World Magnetic Model gives the declination.
    pub wmm: Option<MagneticModel>,
    /// Deviation: heading that the compass shows too small, from the field of the vehicle and from
    /// the mounting. Default: zero.
    #[serde(default)]
    pub deviation: Calibration<Angle, AngularRateNoise>,
    /// Process whose attitude the compass measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

const ANGLE: Display = Display { components: &[""], ..display::ANGLES };

impl SensorType for MagneticHeading {
    const TYPE: &'static str = "magnetic-heading";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("heading", "rad")]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let earth = match &self.wmm {
            Some(model) => model.earth(composer, "declination", &self.declination)?,
            None => Earth::default(),
        };
        Ok(Role::measurement(MagneticHeadingModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            declination: earth.declination(self.declination, composer, ANGLE)?,
            deviation: self.deviation.block(composer, "deviation", &[0.0], ANGLE)?,
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of a [`MagneticHeading`].
#[derive(Clone, Debug)]
struct MagneticHeadingModel {
    navigation: Navigation,
    declination: Handle<Scalar>,
    deviation: Handle<Scalar>,
    /// 1-sigma, rad.
    sigma: f64,
}

impl MeasurementModel<1> for MagneticHeadingModel {
    /// `psi = atan2(c_21, c_11)` of `C_b^n`: the direction of the forward axis (Groves eq. 2.25).
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let forward = x.get(self.navigation.attitude) * Vector3::x().map(convert::<f64, T>);
        let heading = forward.y.atan2(forward.x);
        SVector::from([heading - x.get(self.declination) - x.get(self.deviation)])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }

    // ANCHOR: difference
    fn difference(&self, _: usize, measured: f64, predicted: f64) -> f64 {
        short_way(measured, predicted)
    }
    // ANCHOR_END: difference
}
