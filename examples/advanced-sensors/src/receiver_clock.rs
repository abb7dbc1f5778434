//! The clock of a receiver: offset and drift, whose truth wanders.
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{Matrix2, Vector2};
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
struct Model {
    /// Spectral densities of offset (m^2/s) and drift (m^2/s^3).
    density: [f64; 2],
    states: [Handle<Scalar>; 2],
    phi: [PhiSlot<1, 1>; 3],
    noise: NoiseSlot<2>,
}

impl Model {
    /// Covariance of the noise of `dt` seconds (Brown & Hwang, section 9.3).
    fn covariance(&self, dt: f64) -> Matrix2<f64> {
        let [offset, drift] = self.density;
        let cross = drift * dt * dt / 2.0;
        Matrix2::new(offset * dt + drift * dt.powi(3) / 3.0, cross, cross, drift * dt)
    }

    fn advance(&self, layout: &Layout, state: &mut State, dt: f64) {
        let [offset, drift] = self.states;
        let moved = state.get(layout, offset) + dt * state.get(layout, drift);
        state.set(layout, offset, &moved);
    }
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
        let [b, d] = [composer.tangent(offset), composer.tangent(drift)];
        let t = composer.transition();
        let phi = [t.phi(b, b), t.phi(b, d), t.phi(d, d)];
        let density =
            [self.offset_noise.value().si().powi(2), self.drift_noise.value().si().powi(2)];
        let model = Model { density, states: [offset, drift], phi, noise: t.noise(b) };
        Ok(BuiltProcess::new(model))
    }
}

impl ProcessModel for Model {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        self.advance(layout, state, dt);
        for (place, value) in self.phi.iter().zip([1.0, dt, 1.0]) {
            transition.set(*place, &SMatrix::from([[value]]));
        }
        transition.set_noise(self.noise, &self.covariance(dt));
        Ok(())
    }

    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}

    fn wander(
        &mut self,
        layout: &Layout,
        truth: &mut State,
        known: &mut [bool],
        dt: f64,
        random: &mut Random,
    ) {
        self.advance(layout, truth, dt);
        let white = Vector2::new(random.normal(), random.normal());
        if let Some(root) = self.covariance(dt).cholesky() {
            let noise = root.l() * white;
            for (state, noise) in self.states.iter().zip(&noise) {
                truth.set(layout, *state, &(truth.get(layout, *state) + noise));
            }
        }
        self.states.iter().for_each(|state| known[state.slot()] = true);
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}
