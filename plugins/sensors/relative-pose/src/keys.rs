//! The keys and channels of the sensor.

use crate::model::RelativePoseModel;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::plugin::SensorType;
use navfuse_core::state::display;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::time::Span;
use navfuse_core::units::{Angle, Duration, Length, Positive, Sigma, Triple};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::PI;

/// Visual odometry, lidar odometry or scan matching: translation and rotation since the previous
/// sample, in the axes that the sensor had then.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelativePose {
    /// 1-sigma noise of the translation of one sample, one value or one per axis.
    pub translation_noise: Sigma<Triple<Length>>,
    /// 1-sigma noise of the rotation of one sample, one value or one per axis.
    pub rotation_noise: Sigma<Triple<Angle>>,
    /// Scale factor k: the translation is k times the true one. A single camera does not know it.
    /// Default: k = 1.
    #[serde(default)]
    pub scale: ScaleFactor,
    /// Roll, pitch and yaw of the sensor's axes relative to the IMU. Default: zero.
    #[serde(default)]
    pub misalignment: Misalignment,
    /// Position of the sensor from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Time between the keyframes of a simulated sensor, from which it measures. A recording names its
    /// keyframes by the channel `keyframe`. Default: every sample is a keyframe.
    pub simulated_keyframes: Option<Positive<Duration>>,
    /// Process whose motion the sensor measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

/// The time between keyframes.
fn keyframes(every: Positive<Duration>) -> Result<Span, ComposeError> {
    let span = Span::from_seconds(every.value().si());
    span.filter(|span| *span > Span::ZERO).ok_or_else(|| {
        ComposeError::new("simulated_keyframes", "it is a time from 1 ns to 73 years")
    })
}

/// Place of the channel that names a keyframe.
pub const KEYFRAME: usize = 6;

impl SensorType for RelativePose {
    const TYPE: &'static str = "relative-pose";

    fn channels(&self) -> Vec<Channel> {
        let moved = ["move_x", "move_y", "move_z"].map(|name| Channel::new(name, "m"));
        let turned = ["turn_x", "turn_y", "turn_z"].map(|name| Channel::new(name, "rad"));
        moved.into_iter().chain(turned).chain([Channel::new("keyframe", "1")]).collect()
    }

    fn limits(&self) -> Vec<Limit> {
        ["turn_x", "turn_y", "turn_z"].map(|name| Limit::range(name, -PI, PI)).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let keyframes = self.simulated_keyframes.map(keyframes).transpose()?;
        let navigation = Navigation::find(composer, "navigation", &self.navigation)?;
        let past = (composer.past(navigation.attitude)?, composer.past(navigation.position)?);
        let scale = self.scale.block(composer, "scale", &[1.0], display::RATIO)?;
        let c_b_s =
            self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        composer.mounted(Mounting::at(lever_arm).turned(c_b_s));
        Ok(Role::measurement(RelativePoseModel {
            navigation,
            past,
            scale,
            c_b_s,
            lever_arm,
            translation: self.translation_noise.value().si(),
            rotation: self.rotation_noise.value().si(),
            keyframes,
        }))
    }
}
