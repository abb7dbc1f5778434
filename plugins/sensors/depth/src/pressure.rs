//! Pressure sensor: `p = a + rho P(z, L)`, with the pressure `P` of the standard ocean at the depth `z`
//! of its port and the latitude `L` (Saunders 1981), the density `rho` of the water relative to that
//! ocean, and the pressure `a` of the atmosphere.

use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::prelude::*;
use navfuse_core::units::PressureRandomWalk;
use navfuse_ins::Navigation;
use navfuse_seawater::pressure_at;

/// Pressure sensor in the water: the depth follows by latitude and density.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureSensor {
    /// 1-sigma noise of one sample: 1 dbar is about a metre of water.
    pub noise: Sigma<Pressure>,
    /// Reading at the surface: the air pressure, with the offset of the sensor and the tide. Default:
    /// 1013.25 hPa; give zero for a sensor that reads the pressure above that of the air.
    #[serde(default)]
    pub atmosphere: Calibration<Pressure, PressureRandomWalk>,
    /// Mean density of the water above the sensor, as a multiple of an ocean of 0 deg C and salinity
    /// 35 (1028.1 kg/m^3 at the surface): about 0.998 in warm sea water, 0.972 in fresh water.
    /// Default: 1.
    #[serde(default)]
    pub density: ScaleFactor,
    /// Height of the surface above the ellipsoid. Default: zero.
    #[serde(default = "sea_level")]
    pub surface: Length,
    /// Position of the sensor's port from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion the sensor measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

fn sea_level() -> Length {
    Length::from_si(0.0)
}

/// Standard atmosphere, Pa.
const ATMOSPHERE: f64 = 101_325.0;
const PRESSURE: Display = Display { unit: "hPa", scale: 100.0, components: &["surface"] };
const DENSITY: Display = Display { components: &["density"], ..display::RATIO };

impl SensorType for PressureSensor {
    const TYPE: &'static str = "pressure";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("pressure", "Pa")]
    }

    fn limits(&self) -> Vec<Limit> {
        // from below the air pressure, for one that reads the pressure above it, to the deepest trench
        vec![Limit::range("pressure", -5e4, 1.3e8)]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        composer.mounted(Mounting::at(lever_arm));
        Ok(Role::measurement(PressureModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            atmosphere: self.atmosphere.block(composer, "atmosphere", &[ATMOSPHERE], PRESSURE)?,
            density: self.density.block(composer, "density", &[1.0], DENSITY)?,
            lever_arm,
            surface: self.surface.si(),
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of a [`PressureSensor`].
#[derive(Clone, Debug)]
struct PressureModel {
    navigation: Navigation,
    atmosphere: Handle<Scalar>,
    density: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    /// Height of the surface above the ellipsoid, m.
    surface: f64,
    /// 1-sigma, Pa.
    sigma: f64,
}

impl MeasurementModel<1> for PressureModel {
    fn predict<T: navfuse_core::Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let port = self.navigation.position_at(x, &x.get(self.lever_arm));
        let depth = convert::<f64, T>(self.surface) - port.height;
        let water = pressure_at(depth, port.latitude);
        SVector::from([x.get(self.atmosphere) + x.get(self.density) * water])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }
}
