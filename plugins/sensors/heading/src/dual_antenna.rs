//! Dual-antenna GNSS: heading and elevation of the baseline from the first antenna to the second.
//!
//! `b^n = C_b^n [cos e cos a, cos e sin a, -sin e]`, `z = [atan2(b_e, b_n), asin(-b_d)] + noise`,
//! with the azimuth `a` and the elevation `e` of the baseline in body axes.

use crate::short_way;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Two GNSS antennas: heading and elevation of the baseline from the first to the second. Either may
/// be missing. The baseline has no roll, so two angles describe its mounting.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DualAntenna {
    /// 1-sigma noise of one heading: about 0.2 deg for a baseline of 1 m with fixed ambiguities.
    pub noise: Sigma<Angle>,
    /// 1-sigma noise of one elevation. Default: twice the noise of the heading.
    pub elevation_noise: Option<Sigma<Angle>>,
    /// Azimuth of the baseline in body axes, from forward to right: "90 deg" where the second
    /// antenna is to the right of the first. Default: forward.
    #[serde(default)]
    pub azimuth: Calibration<Angle, AngularRateNoise>,
    /// Elevation of the baseline above the plane of forward and right. Default: zero.
    #[serde(default)]
    pub elevation: Calibration<Angle, AngularRateNoise>,
    /// Process whose attitude the antennas measure.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

const ANGLE: Display = Display { components: &[""], ..display::ANGLES };
const HEADING: usize = 0;

impl SensorType for DualAntenna {
    const TYPE: &'static str = "dual-antenna";

    fn channels(&self) -> Vec<Channel> {
        ["heading", "elevation"].map(|name| Channel::new(name, "rad")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let heading = self.noise.value().si();
        let elevation = self.elevation_noise.map_or(2.0 * heading, |noise| noise.value().si());
        let model = DualAntennaModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            azimuth: self.azimuth.block(composer, "azimuth", &[0.0], ANGLE)?,
            elevation: self.elevation.block(composer, "elevation", &[0.0], ANGLE)?,
            sigma: [heading, elevation],
        };
        composer.mounted(Mounting::default().pointed(model.elevation, model.azimuth));
        Ok(Role::measurement(model))
    }
}

/// The measurement model of a [`DualAntenna`].
#[derive(Clone, Debug)]
struct DualAntennaModel {
    navigation: Navigation,
    azimuth: Handle<Scalar>,
    elevation: Handle<Scalar>,
    /// 1-sigma of heading and elevation, rad.
    sigma: [f64; 2],
}

impl MeasurementModel<2> for DualAntennaModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let (sin_a, cos_a) = x.get(self.azimuth).sin_cos();
        let (sin_e, cos_e) = x.get(self.elevation).sin_cos();
        let baseline = Vector3::new(cos_e * cos_a, cos_e * sin_a, -sin_e);
        let b = x.get(self.navigation.attitude) * baseline;
        // asin(-b_d), in a form whose derivative is finite also near the vertical
        let level = (b.x * b.x + b.y * b.y).sqrt();
        SVector::from([b.y.atan2(b.x), (-b.z).atan2(level)])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::from_diagonal(&SVector::from(self.sigma.map(|s| s * s)))
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        if channel == HEADING { short_way(measured, predicted) } else { measured - predicted }
    }
}
