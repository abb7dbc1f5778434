//! Sensitivity of gyros to specific force.
use navfuse_core::prelude::*;

// ANCHOR: model
/// Sensitivity of each gyro to the specific force along its axis.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GyroSensitivity {
    /// Angular rate per specific force.
    pub sensitivity: Calibration<Triple<GSensitivity>, Triple<GSensitivityRandomWalk>>,
}

struct Model(Handle<Vector<3>>);

const PER_G: Display =
    Display { unit: "deg/h/g", scale: 4.943_660e-7, components: &["x", "y", "z"] };

impl ProcessType for GyroSensitivity {
    const TYPE: &'static str = "gyro-sensitivity";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let sensitivity = self.sensitivity.block(composer, "sensitivity", &[0.0; 3], PER_G)?;
        Ok(BuiltProcess::new(OwnDynamics).correcting("imu", Model(sensitivity)))
    }
}

impl InputModel<6> for Model {
    fn correct<T: Real>(&self, x: &View<'_, T>, [wx, wy, wz, fx, fy, fz]: [T; 6]) -> [T; 6] {
        let g = x.get(self.0);
        [wx - g.x * fx, wy - g.y * fy, wz - g.z * fz, fx, fy, fz]
    }
}
// ANCHOR_END: model
