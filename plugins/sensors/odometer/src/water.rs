//! Speed log through the water: `z = k (R_z(yaw) (C_n^b (v^n - c^n) + w_eb^b x l))_xy + b`.

use navfuse_core::Real;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Speed through the water by an electromagnetic log, an impeller or a pitot tube: forward and, for an
/// instrument of two axes, sideways.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeedLog {
    /// 1-sigma noise of one speed.
    pub noise: Sigma<Speed>,
    /// Current of the water: the name of a `[process.NAME]` of type water-current.
    pub current: String,
    /// Adds the channel `lateral`: the speed to the right.
    #[serde(default)]
    pub lateral: bool,
    /// Scale factor k: the output is k times the speed. Default: k = 1.
    #[serde(default)]
    pub scale: ScaleFactor,
    /// Speed that the instrument shows at rest, the same on both axes: the zero of an electromagnetic
    /// log. Default: zero.
    #[serde(default)]
    pub bias: Calibration<Speed, AccelerationNoise>,
    /// Yaw of the instrument's axis relative to the IMU. Default: zero.
    #[serde(default)]
    pub yaw: Calibration<Angle, AngularRateNoise>,
    /// Position of the instrument from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

const BIAS: Display = Display { components: &["bias"], ..display::VELOCITY };

impl SensorType for SpeedLog {
    const TYPE: &'static str = "speed-log";

    fn channels(&self) -> Vec<Channel> {
        let count = if self.lateral { 2 } else { 1 };
        ["speed", "lateral"][..count].iter().map(|name| Channel::new(*name, "mps")).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let turns = self.lever_arm != LeverArm::default();
        let model = SpeedLogModel {
            navigation: Navigation::find_turning(composer, &self.navigation, "lever_arm", turns)?,
            current: composer.find("current", &format!("{}.current", self.current))?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            bias: self.bias.block(composer, "bias", &[0.0], BIAS)?,
            yaw: self.yaw.block(composer, "yaw", &[0.0], display::YAW)?,
            lever_arm: self.lever_arm.block(
                composer,
                "lever_arm",
                &[0.0; 3],
                display::LEVER_ARM,
            )?,
            sigma: self.noise.value().si(),
        };
        composer.mounted(Mounting::at(model.lever_arm));
        Ok(match self.lateral {
            true => Role::measurement::<_, 2>(model),
            false => Role::measurement::<_, 1>(model),
        })
    }
}

/// The measurement model of a [`SpeedLog`] of one or two axes.
#[derive(Clone, Debug)]
struct SpeedLogModel {
    navigation: Navigation,
    current: Handle<Vector<3>>,
    scale: Handle<Scalar>,
    bias: Handle<Scalar>,
    yaw: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    /// 1-sigma, m/s.
    sigma: f64,
}

impl<const N: usize> MeasurementModel<N> for SpeedLogModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, N> {
        let over_ground = self.navigation.velocity_at(x, &x.get(self.lever_arm));
        let v = over_ground - x.get(self.navigation.attitude).inverse() * x.get(self.current);
        let (sin, cos) = x.get(self.yaw).sin_cos();
        let axes = [cos * v.x + sin * v.y, cos * v.y - sin * v.x];
        SVector::from_fn(|k, _| axes[k] * x.get(self.scale) + x.get(self.bias))
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }
}
