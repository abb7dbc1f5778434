//! A process as one function, whose rotation loses its derivative at a rate of zero.

use navfuse_core::nalgebra::Rotation3;
use navfuse_core::prelude::*;

pub struct SpinnerPlugin;

impl Plugin for SpinnerPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Spinner>();
        registry.sensor::<Bow>();
    }
}

/// An attitude that turns at a rate.
#[derive(Deserialize, JsonSchema)]
pub struct Spinner {
    /// Takes the rotation of nalgebra.
    pub fault: bool,
}

#[derive(Clone)]
struct Model {
    attitude: Handle<Rotation>,
    rate: Handle<Vector<3>>,
    fault: bool,
}

impl ProcessType for Spinner {
    const TYPE: &'static str = "spinner";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |sigma: f64, display| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: vec![sigma; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        let attitude = composer.block("attitude", spec(0.1, display::ANGLES))?;
        const RATE: Display = Display { unit: "rad/s", scale: 1.0, ..display::LEVER_ARM };
        let rate = composer.block("rate", spec(0.01, RATE))?;
        Ok(composer.step(Model { attitude, rate, fault: self.fault }))
    }
}

impl Step for Model {
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        _: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    ) {
        let (attitude, rate) = (x.get(self.attitude), x.get(self.rate));
        let turn = rate * convert::<_, T>(dt);
        let turned = if self.fault {
            attitude * Rotation3::from_scaled_axis(turn)
        } else {
            Rotation::retract(&attitude, (attitude * turn).as_slice())
        };
        next.set(self.attitude, &turned);
        next.set(self.rate, &rate);
    }
    fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
        noise.white(self.rate, &[1e-6; 3]);
    }
}

/// North, east and down of the forward axis.
#[derive(Deserialize, JsonSchema)]
pub struct Bow {
    /// 1-sigma noise.
    pub noise: Sigma<Ratio>,
}

struct BowModel {
    attitude: Handle<Rotation>,
    sigma: f64,
}

impl SensorType for Bow {
    const TYPE: &'static str = "bow";
    fn channels(&self) -> Vec<Channel> {
        ["north", "east", "down"].map(|name| Channel::new(name, "1")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let attitude = composer.find("", "spinner.attitude")?;
        Ok(Role::measurement(BowModel { attitude, sigma: self.noise.value().si() }))
    }
}

impl MeasurementModel<3> for BowModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.attitude).matrix().column(0).into()
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * self.sigma * self.sigma
    }
}
