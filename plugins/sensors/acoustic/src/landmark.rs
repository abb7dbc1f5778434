//! A known place in the axes of an instrument on the vehicle: a docking station or a mark that a camera
//! recognises, or a transponder that an inverted ultra-short baseline hears.
//!
//! ```text
//! d = k C_b^s (C_n^b (q - p) - l)
//! ```
//! with the place `q`, the IMU at `p`, the instrument at the lever arm `l` with the mounting `C_b^s`, and
//! the ratio `k` of the speeds of sound, 1 for a camera.

use crate::direction::{Accuracy, OFFSET, POLAR, add_polar, complete};
use crate::place::{Displaced, Place};
use crate::sound::Ratio;
use navfuse_core::Real;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// A known place as an instrument of the vehicle sees it, forward, right and down of that instrument, or
/// by range and direction: a docking station, a mark, a transponder.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Landmark {
    /// 1-sigma noise of the range.
    pub range_noise: Sigma<Length>,
    /// 1-sigma noise of the direction, about each axis across the line of sight.
    pub angle_noise: Sigma<Angle>,
    /// The known place.
    pub place: Place,
    /// North, east and down of the true place from the given one: with a `sigma`, the place is a
    /// state. Default: zero.
    #[serde(default)]
    pub displacement: LeverArm,
    /// Adds the channels `range`, `bearing` and `elevation`, from which the Cartesian ones follow
    /// where a sample lacks them.
    #[serde(default)]
    pub polar: bool,
    /// Roll, pitch and yaw of the body in the axes of the instrument, `C_s^b`. Default: zero.
    #[serde(default)]
    pub misalignment: Misalignment,
    /// Position of the instrument from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Speed of sound of an acoustic instrument: the name of a `[process.NAME]` of type sound-speed.
    /// Default: the one that the instrument is set to, or a camera.
    pub sound: Option<String>,
    /// Process whose position and attitude are measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
    /// Keys that only a simulation needs.
    #[serde(default)]
    pub simulation: Sight,
}

/// Simulation of a landmark.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sight {
    /// Distance beyond which the instrument does not see the place. Default: none.
    pub reach: Option<Positive<Length>>,
    /// Largest angle between the forward axis of the instrument and the place. Default: 180 deg.
    pub view: Option<Positive<Angle>>,
}

impl SensorType for Landmark {
    const TYPE: &'static str = "landmark";

    fn channels(&self) -> Vec<Channel> {
        let polar = POLAR.into_iter().filter(|_| self.polar);
        OFFSET.into_iter().chain(polar).map(|(name, unit)| Channel::new(name, unit)).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        let c_b_s =
            self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
        composer.mounted(Mounting::at(lever_arm).turned(c_b_s));
        let Sight { reach, view } = self.simulation;
        Ok(Role::measurement(LandmarkModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            place: Displaced::new(composer, &self.place, self.displacement)?,
            ratio: Ratio::find(composer, self.sound.as_deref())?,
            accuracy: Accuracy {
                range: self.range_noise.value().si(),
                angle: self.angle_noise.value().si(),
            },
            polar: self.polar,
            reach: reach.map_or(f64::INFINITY, |reach| reach.value().si()),
            view: view.map_or(std::f64::consts::PI, |view| view.value().si()),
            lever_arm,
            c_b_s,
        }))
    }
}

/// The measurement model of a [`Landmark`].
#[derive(Clone, Debug)]
struct LandmarkModel {
    navigation: Navigation,
    place: Displaced,
    lever_arm: Handle<Vector<3>>,
    c_b_s: Handle<Rotation>,
    ratio: Ratio,
    accuracy: Accuracy,
    polar: bool,
    /// Longest simulated distance, m.
    reach: f64,
    /// Half the simulated field of view, rad.
    view: f64,
}

impl MeasurementModel<3> for LandmarkModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let way = self.place.seen_from(x, &x.get(self.navigation.position));
        let in_body = x.get(self.navigation.attitude).inverse() * way - x.get(self.lever_arm);
        x.get(self.c_b_s) * in_body * self.ratio.get(x)
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        self.accuracy.variance(x, || self.predict(x))
    }

    fn complete(&self, sample: &mut Sample) {
        if self.polar {
            complete(sample, OFFSET.len());
        }
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|k| sample.get(k)) else { return };
        let across = y.hypot(z);
        if x.hypot(across) > self.reach || across.atan2(x) > self.view {
            (0..3).for_each(|k| sample.clear(k));
        } else if self.polar {
            add_polar(sample, OFFSET.len());
        }
    }
}
