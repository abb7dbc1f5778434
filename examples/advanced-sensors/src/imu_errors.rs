//! Scale factors of an IMU, and the misalignment of its gyros.
use navfuse_core::prelude::*;

// ANCHOR: model
/// Scale factors of an IMU, and the misalignment of its gyros to its accelerometers.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImuErrors {
    /// Scale factor error of each gyro.
    pub gyro_scale: Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>,
    /// Scale factor error of each accelerometer.
    pub accel_scale: Calibration<Triple<Ratio>, Triple<RatioRandomWalk>>,
    /// Rotation from the axes of the gyros to those of the accelerometers.
    pub misalignment: Misalignment,
}

struct Model(Handle<Vector<3>>, Handle<Vector<3>>, Handle<Rotation>);

impl ProcessType for ImuErrors {
    const TYPE: &'static str = "imu-errors";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let gyro = self.gyro_scale.block(composer, "gyro_scale", &[0.0; 3], display::RATIOS)?;
        let accel = self.accel_scale.block(composer, "accel_scale", &[0.0; 3], display::RATIOS)?;
        let axes = self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
        Ok(BuiltProcess::new(OwnDynamics).correcting("imu", Model(gyro, accel, axes)))
    }
}

impl InputModel<6> for Model {
    fn correct<T: Real>(&self, x: &View<'_, T>, z: [T; 6]) -> [T; 6] {
        let (gyro, accel) = (x.get(self.0).add_scalar(T::one()), x.get(self.1));
        let w = Vector3::new(z[0], z[1], z[2]).component_div(&gyro);
        let f = Vector3::new(z[3], z[4], z[5]).component_div(&accel.add_scalar(T::one()));
        let w = x.get(self.2) * w;
        [w.x, w.y, w.z, f.x, f.y, f.z]
    }
}
// ANCHOR_END: model
