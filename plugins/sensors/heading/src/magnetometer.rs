//! Three-axis magnetometer: `z = (I + S) C_b^m C_n^b m + h`, with the field `m` of the Earth, the soft
//! iron `S` and the hard iron `h` of the vehicle (Gebre-Egziabher et al. 2006, *Calibration of strapdown
//! magnetometers in magnetic field domain*).

use crate::wmm::{Earth, MagneticModel};
use navfuse_core::Real;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::nalgebra::Matrix3;
use navfuse_core::prelude::*;
use navfuse_core::units::{MagneticField, MagneticFieldRandomWalk};
use navfuse_ins::Navigation;

/// Magnetometer of three axes: the field of the Earth in the axes of the instrument, distorted by the
/// iron of the vehicle.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Magnetometer {
    /// 1-sigma noise of each axis.
    pub noise: Sigma<MagneticField>,
    /// Field of the Earth at the place of the run.
    pub field: Field,
    /// Hard iron: the field of the magnets and steel of the vehicle, which turns with it. Default: zero.
    #[serde(default)]
    pub hard_iron: Calibration<Triple<MagneticField>, Triple<MagneticFieldRandomWalk>>,
    /// Diagonal of `I + S`, which holds the scale factors too. Default: 1.
    #[serde(default)]
    pub scale: Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>,
    /// Symmetric off-diagonal elements of the soft iron `S`: xy, xz, yz. Default: zero.
    #[serde(default)]
    pub soft_iron: Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>,
    /// Roll, pitch and yaw of the instrument. Default: zero.
    #[serde(default)]
    pub misalignment: Misalignment,
    /// Process whose attitude is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

/// Field of the Earth at the place and the date of the run: by the World Magnetic Model, or as another
/// model gives it.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Place and date at which the World Magnetic Model gives the field.
    pub wmm: Option<MagneticModel>,
    /// Total intensity, without `wmm`.
    pub strength: Option<Positive<MagneticField>>,
    /// Angle of the field below the horizon, positive in the north, without `wmm`.
    pub inclination: Option<Angle>,
    /// Direction of magnetic north from true north, east positive. Default: zero, or the value of
    /// `wmm`, considered with the uncertainty of the model, about 0.3 deg.
    #[serde(default)]
    pub declination: Calibration<Angle, AngularRateNoise>,
}

impl Field {
    fn earth(&self, composer: &mut Composer) -> Result<Earth, ComposeError> {
        match (&self.wmm, self.strength, self.inclination) {
            (Some(model), None, None) => {
                model.earth(composer, "field.declination", &self.declination)
            }
            (None, Some(strength), Some(inclination)) => {
                Ok(Earth::given(strength.value().si(), inclination.si()))
            }
            _ => Err(ComposeError::new("field", "give wmm, or strength and inclination")),
        }
    }
}

const HARD_IRON: Display = Display { unit: "uT", scale: 1e-6, components: &["x", "y", "z"] };
const SOFT_IRON: Display = Display { components: &["xy", "xz", "yz"], ..display::RATIOS };

impl SensorType for Magnetometer {
    const TYPE: &'static str = "magnetometer";

    fn channels(&self) -> Vec<Channel> {
        ["mag_x", "mag_y", "mag_z"].map(|name| Channel::new(name, "T")).to_vec()
    }

    fn limits(&self) -> Vec<Limit> {
        // the field of the Earth is below 70 uT, and instruments read up to some 1 mT
        ["mag_x", "mag_y", "mag_z"].map(|name| Limit::range(name, -1e-3, 1e-3)).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let earth = self.field.earth(composer)?;
        let c_b_m =
            self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
        composer.mounted(Mounting::default().turned(c_b_m));
        Ok(Role::measurement(MagnetometerModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            horizontal: earth.horizontal,
            down: earth.down,
            declination: earth.declination(self.field.declination, composer, display::ANGLE)?,
            hard_iron: self.hard_iron.block(composer, "hard_iron", &[0.0; 3], HARD_IRON)?,
            scale: self.scale.block(composer, "scale", &[1.0; 3], display::RATIOS)?,
            soft_iron: self.soft_iron.block(composer, "soft_iron", &[0.0; 3], SOFT_IRON)?,
            c_b_m,
            sigma: self.noise.value().si(),
        }))
    }
}

/// The measurement model of a [`Magnetometer`].
#[derive(Clone, Debug)]
struct MagnetometerModel {
    navigation: Navigation,
    /// Horizontal and downward intensity, T.
    horizontal: f64,
    down: f64,
    declination: Handle<Scalar>,
    hard_iron: Handle<Vector<3>>,
    scale: Handle<Vector<3>>,
    soft_iron: Handle<Vector<3>>,
    c_b_m: Handle<Rotation>,
    /// 1-sigma, T.
    sigma: f64,
}

impl MeasurementModel<3> for MagnetometerModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let (sin, cos) = x.get(self.declination).sin_cos();
        let horizontal: T = convert(self.horizontal);
        let earth = Vector3::new(horizontal * cos, horizontal * sin, convert(self.down));
        let field = x.get(self.c_b_m) * (x.get(self.navigation.attitude).inverse() * earth);
        let (k, s) = (x.get(self.scale), x.get(self.soft_iron));
        let iron = Matrix3::new(k.x, s.x, s.y, s.x, k.y, s.z, s.y, s.z, k.z);
        iron * field + x.get(self.hard_iron)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }
}
