//! Random numbers and a vehicle for the tests of this crate.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::imu::Imu;
use crate::navigation::Navigation;
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use std::cell::Cell;

/// A seeded stream of uniform numbers (splitmix64), so that a test sees the same cases everywhere.
pub(crate) struct Uniform(u64);

impl Uniform {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `-bound..bound`.
    pub(crate) fn within(&mut self, bound: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        bound * ((z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    }

    /// A vector whose components are uniform in `-bound..bound`.
    pub(crate) fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::new(self.within(bound), self.within(bound), self.within(bound))
    }
}

/// A vehicle with this crate alone: the composition of its strapdown process, which starts at rest,
/// level and heading north, and the handles of its navigation state.
pub(crate) struct Bench {
    pub composition: Composition,
    pub navigation: Navigation,
}

pub(crate) const SCENARIO: &str = r#"
    name = "bench"
    [process.ins]
    attitude = { sigma = "1 deg", initial = "0 deg" }
    velocity = { sigma = "1 m/s", initial = "0 m/s" }
    position = { sigma = "1 m", latitude = "45 deg", longitude = "8 deg", height = "100 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "50 ug" }
    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    [sensor.speeds]
    sigma = [1.0, 1.0, 1.0, 1.0]
"#;

impl Bench {
    /// Composes the vehicle with settings, each `key.path=value`.
    pub(crate) fn new(settings: &[&str]) -> Self {
        Self::with("", settings)
    }

    /// As [`Self::new`], with more sensors.
    pub(crate) fn with(sensors: &str, settings: &[&str]) -> Self {
        let composition = compose(&format!("{SCENARIO}{sensors}"), settings).unwrap();
        Self { composition, navigation: FOUND.get().unwrap() }
    }

    /// The initial state at time zero.
    pub(crate) fn state(&self) -> State {
        State { time: Time::default(), ..self.composition.layout.initial_state() }
    }
}

/// Composes a scenario of this crate's types, and of [`Speeds`], [`Fixes`] and [`Mounted`].
pub(crate) fn compose(text: &str, settings: &[&str]) -> Result<Composition, String> {
    let mut registry = Registry::new();
    registry.add(&crate::InsPlugin);
    registry.sensor::<Speeds>();
    registry.sensor::<Fixes>();
    registry.sensor::<Mounted>();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("bench.toml", text).unwrap();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    scenario.compose().map_err(|error| error.to_string())
}

/// An IMU of navigation grade, with other values of some keys.
pub(crate) fn imu(keys: &serde_json::Value) -> Imu {
    let mut all = serde_json::json!({
        "gyro_noise": "0.1 deg/h/sqrt(Hz)",
        "accel_noise": "20 ug/sqrt(Hz)",
    });
    keys.as_object().unwrap().iter().for_each(|(key, value)| all[key] = value.clone());
    serde_json::from_value(all).unwrap()
}

thread_local! {
    /// Navigation state that the latest [`Speeds`] has found.
    static FOUND: Cell<Option<Navigation>> = const { Cell::new(None) };
}

/// Speeds along forward, right, down, and along the diagonal of the three.
#[derive(Deserialize, JsonSchema)]
struct Speeds {
    /// 1-sigma of each, m/s.
    sigma: [f64; 4],
}

impl SensorType for Speeds {
    const TYPE: &'static str = "speeds";

    fn channels(&self) -> Vec<Channel> {
        ["forward", "right", "down", "diagonal"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let navigation = Navigation::find(composer, "navigation", "ins")?;
        FOUND.set(Some(navigation));
        Ok(Role::measurement(SpeedsModel { navigation, sigma: self.sigma }))
    }
}

struct SpeedsModel {
    navigation: Navigation,
    sigma: [f64; 4],
}

impl MeasurementModel<4> for SpeedsModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 4> {
        let v = x.get(self.navigation.attitude).inverse() * x.get(self.navigation.velocity);
        SVector::from([v.x, v.y, v.z, (v.x + v.y + v.z) * convert::<f64, T>(3_f64.sqrt().recip())])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 4, 4> {
        SMatrix::from_diagonal(&SVector::from(self.sigma.map(|sigma| sigma * sigma)))
    }
}

/// Velocity and position, in this order.
#[derive(Deserialize, JsonSchema)]
struct Fixes {}

impl SensorType for Fixes {
    const TYPE: &'static str = "fixes";

    fn channels(&self) -> Vec<Channel> {
        let names = ["vel_n", "vel_e", "vel_d", "lat", "lon", "height"];
        let units = ["mps", "mps", "mps", "rad", "rad", "m"];
        names.into_iter().zip(units).map(|(name, unit)| Channel::new(name, unit)).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(FixesModel(Navigation::find(composer, "navigation", "ins")?)))
    }
}

struct FixesModel(Navigation);

impl MeasurementModel<3> for FixesModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.0.velocity)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity()
    }
}

/// Velocity in the axes of an instrument with an uncertain mounting, beside a rotation that it does
/// not read.
#[derive(Deserialize, JsonSchema)]
struct Mounted {
    /// 1-sigma of the mounting, deg.
    sigma: f64,
    /// Held at its initial value, with its uncertainty.
    #[serde(default)]
    considered: bool,
}

impl SensorType for Mounted {
    const TYPE: &'static str = "mounted";

    fn channels(&self) -> Vec<Channel> {
        ["x", "y", "z"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let navigation = Navigation::find(composer, "navigation", "ins")?;
        let block = |mode, degrees: f64| BlockSpec {
            mode,
            initial: vec![0.0; 3],
            sigma: vec![0.0, degrees.to_radians(), 0.0],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::ANGLES,
        };
        let mode = if self.considered { Mode::Consider } else { Mode::Estimate };
        let _: Handle<Rotation> = composer.block("other", block(Mode::Estimate, 90.0))?;
        let mounting = composer.block("mounting", block(mode, self.sigma))?;
        Ok(Role::measurement(MountedModel { navigation, mounting }))
    }
}

struct MountedModel {
    navigation: Navigation,
    mounting: Handle<Rotation>,
}

impl MeasurementModel<3> for MountedModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let body = x.get(self.navigation.attitude).inverse() * x.get(self.navigation.velocity);
        x.get(self.mounting).inverse() * body
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity()
    }
}
