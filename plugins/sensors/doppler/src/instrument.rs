//! A Doppler instrument: its calibration states, and the velocity that it reads in its own axes.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{Calibration, LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::measurement::Jacobian;
use navfuse_core::model::sensor::mounting;
use navfuse_core::nalgebra::{SMatrix, Vector3};
use navfuse_core::state::display;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{Rotation, Scalar, Vector};
use navfuse_core::state::{Display, Handle, View};
use navfuse_core::units::{AccelerationNoise, Speed, Triple};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// Reference of a measured velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TrackingMode {
    /// The bottom.
    #[default]
    Bottom,
    /// The water, which moves with the current.
    Water,
}

/// Bias of a velocity in the axes of the instrument.
pub(crate) type VelocityBias = Calibration<Triple<Speed>, Triple<AccelerationNoise>>;

const BIAS: Display = Display { components: &["x", "y", "z"], ..display::VELOCITY };

/// Values of the calibration keys that every Doppler instrument has.
pub(crate) struct Mounting<'a> {
    pub scale: ScaleFactor,
    pub misalignment: Misalignment,
    pub lever_arm: LeverArm,
    pub bias: Option<VelocityBias>,
    pub navigation: &'a str,
}

/// Values of the keys of an instrument that tracks the bottom or the water.
#[derive(Default)]
pub(crate) struct Tracking<'a> {
    pub transducer: Option<&'a str>,
    pub mode: TrackingMode,
    pub current: Option<&'a str>,
}

/// Handles of the calibration states, and of the motion and the current that the instrument sees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instrument {
    navigation: Navigation,
    scale: Handle<Scalar>,
    pub c_b_d: Handle<Rotation>,
    pub lever_arm: Handle<Vector<3>>,
    bias: Option<Handle<Vector<3>>>,
    current: Option<Handle<Vector<3>>>,
}

impl Mounting<'_> {
    /// Finds the motion and the current, and adds the calibration states.
    pub fn build(
        &self,
        composer: &mut Composer,
        tracking: &Tracking<'_>,
    ) -> Result<Instrument, ComposeError> {
        let turns = self.lever_arm != LeverArm::default();
        let navigation = Navigation::find_turning(composer, self.navigation, "lever_arm", turns)?;
        let current = tracking.current(composer)?;
        let scale = self.scale.block(composer, "scale", &[1.0], display::RATIO)?;
        let (c_b_d, lever_arm) = match tracking.transducer {
            Some(name) => self.of_transducer(composer, name)?,
            None => (
                self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?,
                self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?,
            ),
        };
        let bias =
            self.bias.map(|bias| bias.block(composer, "bias", &[0.0; 3], BIAS)).transpose()?;
        Ok(Instrument { navigation, scale, c_b_d, lever_arm, bias, current })
    }

    /// Finds the misalignment and the lever arm of the sensor whose transducer this one shares.
    fn of_transducer(
        &self,
        composer: &mut Composer,
        name: &str,
    ) -> Result<(Handle<Rotation>, Handle<Vector<3>>), ComposeError> {
        let given = [
            ("misalignment", self.misalignment != Misalignment::default()),
            ("lever_arm", self.lever_arm != LeverArm::default()),
        ];
        if let Some((key, _)) = given.into_iter().find(|(_, given)| *given) {
            let message = format!(
                "[sensor.{name}], which `transducer` names, has it already; remove one of the two"
            );
            return Err(ComposeError::new(key, message));
        }
        let misalignment = composer.find("transducer", &format!("{name}.misalignment"));
        let misalignment = misalignment.map_err(|_| {
            let message = format!(
                "there is no DVL [sensor.{name}] above this one; name one, or put it first"
            );
            ComposeError::new("transducer", message)
        })?;
        Ok((misalignment, composer.find("transducer", &format!("{name}.lever_arm"))?))
    }
}

impl Tracking<'_> {
    /// Finds the current of the water where the instrument tracks the water.
    fn current(&self, composer: &mut Composer) -> Result<Option<Handle<Vector<3>>>, ComposeError> {
        match (self.mode, self.current) {
            (TrackingMode::Bottom, None) => Ok(None),
            (TrackingMode::Water, Some(name)) => {
                composer.find("current", &format!("{name}.current")).map(Some)
            }
            (TrackingMode::Water, None) => Err(ComposeError::new(
                "track",
                "water tracking needs the current of the water: add [process.water] type = \
                 \"water-current\" and current = \"water\" here",
            )),
            (TrackingMode::Bottom, Some(_)) => Err(ComposeError::new(
                "current",
                "the velocity over the bottom has no current in it; remove this key, or set \
                 track = \"water\"",
            )),
        }
    }
}

impl Instrument {
    /// Place and axes of the instrument.
    pub fn mounting(&self) -> mounting::Mounting {
        mounting::Mounting::at(self.lever_arm).turned(self.c_b_d)
    }

    /// Computes the place of the instrument.
    pub fn place<T: Real>(&self, x: &View<'_, T>) -> Geodetic<T> {
        self.navigation.position_at(x, &x.get(self.lever_arm))
    }

    /// Turns a vector in the axes of the instrument to north, east, down.
    pub fn in_navigation<T: Real>(&self, x: &View<'_, T>, v: &Vector3<T>) -> Vector3<T> {
        x.get(self.navigation.attitude) * (x.get(self.c_b_d).inverse() * v)
    }

    /// Computes the velocity in the instrument's axes as the instrument reads it, m/s:
    /// `y = k C_b^d (C_n^b (v^n - c^n) + w_eb^b x l) + b`.
    ///
    /// Pan & Wu eq. (7) with three additions: the lever arm `l`, at which rotation adds velocity
    /// (Groves eq. 17.13), the current `c`, because an instrument that tracks the water reads
    /// the velocity relative to it, and the bias `b`.
    pub fn velocity<T: Real>(&self, x: &View<'_, T>) -> Vector3<T> {
        self.through(x, self.current.map(|current| x.get(current)))
    }

    /// As [`Self::velocity`], through water that moves with a current (north, east, down).
    pub fn through<T: Real>(&self, x: &View<'_, T>, current: Option<Vector3<T>>) -> Vector3<T> {
        let mut v_b = self.navigation.velocity_at(x, &x.get(self.lever_arm));
        if let Some(current) = current {
            v_b -= x.get(self.navigation.attitude).inverse() * current;
        }
        let y = x.get(self.c_b_d) * v_b * x.get(self.scale);
        self.bias.map_or(y, |bias| y + x.get(bias))
    }

    /// Sets the derivatives of the readings `u_i . y` along `beams`, with `y` of [`Self::velocity`],
    /// with respect to every block that it reads. With `exp([phi x]) C_b^d`, `y` changes by
    /// `phi x y`.
    pub fn differentiate<const N: usize>(
        &self,
        x: &View<'_, f64>,
        beams: &[Vector3<f64>; N],
        h: &mut Jacobian<'_, N>,
    ) {
        let b = SMatrix::<f64, N, 3>::from_fn(|i, k| beams[i][k]);
        let arm = x.get(self.lever_arm);
        let mut v_b = self.navigation.velocity_at(x, &arm);
        let mut body = self.navigation.velocity_derivative(x, &arm);
        let (c_b_d, scale) = (x.get(self.c_b_d).into_inner(), x.get(self.scale));
        let b_d = b * c_b_d * scale;
        if let Some(handle) = self.current {
            let current = x.get(handle);
            v_b -= body.velocity * current;
            body.attitude -= body.velocity * current.cross_matrix();
            h.set(handle, &(b_d * -body.velocity));
        }
        let v_d = c_b_d * v_b;
        h.set(self.scale, &(b * v_d));
        if let Some(bias) = self.bias {
            h.set(bias, &b);
        }
        h.set(self.c_b_d, &(b * (v_d * -scale).cross_matrix()));
        h.set(self.lever_arm, &(b_d * body.lever_arm));
        h.set(self.navigation.attitude, &(b_d * body.attitude));
        h.set(self.navigation.velocity, &(b_d * body.velocity));
        h.set(self.navigation.position, &(b_d * body.position));
        if let Some(bias) = self.navigation.gyro_bias {
            h.set(bias, &(b_d * body.gyro_bias));
        }
    }
}
