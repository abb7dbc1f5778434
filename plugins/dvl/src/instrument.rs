//! What every Doppler velocity log has: where it is, how it is turned, how it is scaled, and what it sees.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Rotation, Scalar, Vector};
use navfuse_core::state::{Handle, View};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// What the velocity is relative to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Track {
    /// The bottom.
    #[default]
    Bottom,
    /// The water, which moves with the current.
    Water,
}

/// The parameters that the types have in common.
pub(crate) struct Settings<'a> {
    pub scale: ScaleFactor,
    pub misalignment: Misalignment,
    pub lever_arm: LeverArm,
    pub transducer: Option<&'a str>,
    pub navigation: &'a str,
    pub track: Track,
    pub current: Option<&'a str>,
}

/// The instrument: its calibration states, and the motion that it sees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instrument {
    navigation: Navigation,
    scale: Handle<Scalar>,
    c_b_d: Handle<Rotation>,
    lever_arm: Handle<Vector<3>>,
    current: Option<Handle<Vector<3>>>,
}

impl Settings<'_> {
    /// Adds the calibration states, and finds the motion and the current.
    pub fn build(&self, composer: &mut Composer) -> Result<Instrument, ComposeError> {
        let navigation = Navigation::find(composer, "navigation", self.navigation)?;
        let current = match (self.track, self.current) {
            (Track::Bottom, None) => None,
            (Track::Water, Some(name)) => {
                Some(composer.find("current", &format!("{name}.current"))?)
            }
            (Track::Water, None) => {
                let message = "water tracking needs the current of the water: add [process.water] type = \"water-current\" \
                               and current = \"water\" here";
                return Err(ComposeError::new("track", message));
            }
            (Track::Bottom, Some(_)) => {
                let message = "the velocity over the bottom has no current in it; remove this key, or set track = \"water\"";
                return Err(ComposeError::new("current", message));
            }
        };
        let scale = self.scale.block(composer, "scale", &[1.0], display::RATIO)?;
        let (c_b_d, lever_arm) = self.mounting(composer)?;
        Ok(Instrument { navigation, scale, c_b_d, lever_arm, current })
    }

    /// Misalignment and lever arm: states of its own, or those of another sensor.
    fn mounting(
        &self,
        composer: &mut Composer,
    ) -> Result<(Handle<Rotation>, Handle<Vector<3>>), ComposeError> {
        let Some(name) = self.transducer else {
            let c_b_d =
                self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
            return Ok((
                c_b_d,
                self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?,
            ));
        };
        let given = [("misalignment", self.misalignment != Misalignment::default())];
        for (key, given) in
            given.into_iter().chain([("lever_arm", self.lever_arm != LeverArm::default())])
        {
            if given {
                let message = format!(
                    "it is that of [sensor.{name}], which `transducer` names; remove one of the two"
                );
                return Err(ComposeError::new(key, message));
            }
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

impl Instrument {
    /// The velocity in the instrument's axes as it reads it, m/s: `k C_b^d (C_n^b (v^n - c^n) + w_eb^b x l)`.
    pub fn velocity<T: Real>(&self, x: &View<'_, T>) -> Vector3<T> {
        let mut v_b = self.navigation.velocity_at(x, &x.get(self.lever_arm));
        if let Some(current) = self.current {
            v_b -= x.get(self.navigation.attitude).inverse() * x.get(current);
        }
        x.get(self.c_b_d) * v_b * x.get(self.scale)
    }
}
