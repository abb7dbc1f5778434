//! The clock of a receiver: offset and drift, whose truth wanders.
use navfuse_core::prelude::*;

/// Clock of a receiver in metres: its offset, and its drift.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReceiverClock {
    /// Prior 1-sigma of the offset.
    pub offset: Sigma<Length>,
    /// Prior 1-sigma of the drift.
    pub drift: Sigma<Speed>,
    /// Random walk of the offset.
    pub offset_noise: Sigma<LengthRandomWalk>,
    /// Random walk of the drift.
    pub drift_noise: Sigma<AccelerationNoise>,
}

#[derive(Clone)]
struct ClockModel {
    /// Spectral densities of offset (m^2/s) and drift (m^2/s^3).
    density: [f64; 2],
    offset: Handle<Scalar>,
    drift: Handle<Scalar>,
}

impl ProcessType for ReceiverClock {
    const TYPE: &'static str = "receiver-clock";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let mut state = |name: &str, sigma: f64, unit: &'static str| {
            let display = Display { unit, scale: 1.0, components: &["clock"] };
            let (mode, dynamics) = (Mode::Estimate, Dynamics::Constant);
            let (initial, sigma) = (vec![0.0], vec![sigma]);
            let spec = BlockSpec { mode, initial, sigma, truth: None, dynamics, display };
            composer.block::<Scalar>(name, spec)
        };
        let offset = state("offset", self.offset.value().si(), "m")?;
        let drift = state("drift", self.drift.value().si(), "m/s")?;
        let density =
            [self.offset_noise.value().si().powi(2), self.drift_noise.value().si().powi(2)];
        Ok(composer.step(ClockModel { density, offset, drift }))
    }
}

/// `Q` is that of Brown & Hwang, section 9.3.
impl Step for ClockModel {
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        _: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    ) {
        let drift = x.get(self.drift);
        next.set(self.offset, &(x.get(self.offset) + drift * convert(dt)));
        next.set(self.drift, &drift);
    }

    fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
        let [offset, drift] = self.density;
        noise.white(self.offset, &[offset]);
        noise.white(self.drift, &[drift]);
    }
}
