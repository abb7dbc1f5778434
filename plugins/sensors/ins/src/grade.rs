//! Classes of inertial measurement units, with the noise and the errors that their data sheets state.

use crate::errors::{Axes, GSensitivities, Scales};
use navfuse_core::compose::calibration::{AccelBias, Calibration, GyroBias};
use navfuse_core::units::{Components, Sigma};
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Class of an inertial measurement unit. The sizes are 1-sigma of good units of the class, from the
/// tables and ranges of Groves, 2nd ed., chapter 4, and from data sheets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Grade {
    /// Silicon sensors of an autopilot or a small vehicle, without a calibration over temperature.
    Mems,
    /// Fibre-optic gyros or calibrated silicon, of a survey-class vehicle.
    Tactical,
    /// Ring-laser or fibre-optic gyros that find north at rest.
    Navigation,
}

/// Sizes of one class, 1-sigma, in SI.
struct Sheet {
    /// White noise of gyros and accelerometers.
    noise: [f64; 2],
    /// Bias from turn-on to turn-on.
    bias: [f64; 2],
    /// Random walk of the bias during a run.
    walk: [f64; 2],
    scale: [f64; 2],
    /// Each of the six cross-coupling coefficients of a triad, rad.
    axes: f64,
    g_sensitivity: f64,
}

const DEG_PER_HOUR: f64 = PI / 180.0 / 3600.0;
const G: f64 = 9.806_65;
const UG: f64 = 1e-6 * G;

const MEMS: Sheet = Sheet {
    noise: [18.0 * DEG_PER_HOUR, 150.0 * UG],
    bias: [360.0 * DEG_PER_HOUR, 10e3 * UG],
    walk: [0.3 * DEG_PER_HOUR, 3.0 * UG],
    scale: [1e-2, 1e-2],
    axes: 10e-3,
    g_sensitivity: 100.0 * DEG_PER_HOUR / G,
};

const TACTICAL: Sheet = Sheet {
    noise: [3.0 * DEG_PER_HOUR, 50.0 * UG],
    bias: [3.0 * DEG_PER_HOUR, 1e3 * UG],
    walk: [0.01 * DEG_PER_HOUR, 0.5 * UG],
    scale: [300e-6, 500e-6],
    axes: 0.5e-3,
    g_sensitivity: 1.0 * DEG_PER_HOUR / G,
};

const NAVIGATION: Sheet = Sheet {
    noise: [0.1 * DEG_PER_HOUR, 10.0 * UG],
    bias: [0.01 * DEG_PER_HOUR, 50.0 * UG],
    walk: [3e-5 * DEG_PER_HOUR, 0.1 * UG],
    scale: [10e-6, 50e-6],
    axes: 0.02e-3,
    g_sensitivity: 0.01 * DEG_PER_HOUR / G,
};

/// A state with this prior sigma on each axis.
fn prior<V: Components, W: Components>(sigma: Sigma<V>) -> Calibration<V, W> {
    Calibration { sigma: Some(sigma), ..Calibration::default() }
}

impl Grade {
    fn sheet(self) -> &'static Sheet {
        match self {
            Self::Mems => &MEMS,
            Self::Tactical => &TACTICAL,
            Self::Navigation => &NAVIGATION,
        }
    }

    /// White noise of the gyros and of the accelerometers, SI.
    pub(crate) fn noise(self) -> [f64; 2] {
        self.sheet().noise
    }

    /// Scale factor errors of the gyros and of the accelerometers.
    pub(crate) fn scales(self) -> [Scales; 2] {
        self.sheet().scale.map(|size| prior(Sigma::each(size)))
    }

    /// Rotation or non-orthogonality of a triad; a coefficient is the sum of both, of equal size.
    pub(crate) fn axes(self) -> Axes {
        prior(Sigma::each(self.sheet().axes * FRAC_1_SQRT_2))
    }

    /// Sensitivity of the gyros to specific force.
    pub(crate) fn g_sensitivity(self) -> GSensitivities {
        prior(Sigma::each(self.sheet().g_sensitivity))
    }

    /// The bias of the gyros: constant but for a random walk.
    pub(crate) fn gyro_bias(self) -> GyroBias {
        let Sheet { bias, walk, .. } = self.sheet();
        Calibration { random_walk: Some(Sigma::each(walk[0])), ..prior(Sigma::each(bias[0])) }
    }

    /// The bias of the accelerometers.
    pub(crate) fn accel_bias(self) -> AccelBias {
        let Sheet { bias, walk, .. } = self.sheet();
        Calibration { random_walk: Some(Sigma::each(walk[1])), ..prior(Sigma::each(bias[1])) }
    }
}
