//! A sensor with its own state: a pressure gauge, whose depth contains the tide.
use navfuse_core::prelude::*;

// ANCHOR: sensor
/// Depth by pressure below a sea surface that the tide moves.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureGauge {
    /// 1-sigma noise of one reading.
    pub noise: Sigma<Length>,
    /// Height of the surface above the ellipsoid: a state that varies, with `correlation_time` or
    /// `random_walk`.
    pub tide: LengthBias,
    /// Process that gives the vehicle's position.
    #[serde(default = "ins")]
    pub vehicle: String,
}

fn ins() -> String {
    "ins".into()
}

/// Sigma of the noise (m), and the states that the model reads.
struct Model {
    noise: f64,
    position: Handle<Position>,
    tide: Handle<Scalar>,
}

impl SensorType for PressureGauge {
    const TYPE: &'static str = "pressure-gauge";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("depth", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        const TIDE: Display = Display { unit: "m", scale: 1.0, components: &["height"] };
        let tide = self.tide.block(composer, "tide", &[0.0], TIDE)?;
        let position = composer.find("vehicle", &format!("{}.position", self.vehicle))?;
        Ok(Role::measurement(Model { noise: self.noise.value().si(), position, tide }))
    }
}

impl MeasurementModel<1> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.tide) - x.get(self.position).height])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.noise.powi(2))
    }
}
// ANCHOR_END: sensor
