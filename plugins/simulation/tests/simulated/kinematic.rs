//! A vehicle without an IMU, as an outsider would write it: its process provides attitude, velocity
//! and position, and neither biases nor an angular rate. DVL and depth sensor run on it.

use navfuse_core::document::Document;
use navfuse_core::nalgebra::Matrix3;
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_ins::Navigation;
use navfuse_testing::judge::judged;

/// Nearly constant velocity and attitude.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Drifting {}

/// White noise on the acceleration, m^2/s^3, and on the angular rate, rad^2/s.
const DENSITIES: [f64; 2] = [1e-2, 1e-4];

#[derive(Clone)]
struct Model {
    navigation: Navigation,
    same: [PhiSlot<3, 3>; 3],
    moves: PhiSlot<3, 3>,
    noise: [NoiseSlot<3>; 2],
}

impl ProcessType for Drifting {
    const TYPE: &'static str = "drifting";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |initial: [f64; 3], sigma: f64, display| BlockSpec {
            mode: Mode::Estimate,
            initial: initial.to_vec(),
            sigma: vec![sigma; 3],
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        let attitude = composer.block("attitude", spec([0.0; 3], 0.05, display::ANGLES))?;
        let velocity = composer.block("velocity", spec([0.0; 3], 0.1, display::VELOCITY))?;
        let start = [30_f64.to_radians(), 0.0, -10.0];
        let position = composer.block("position", spec(start, 1.0, display::POSITION))?;
        let navigation = Navigation::provide(composer, attitude, velocity, position);
        let [a, v, p] =
            [composer.tangent(attitude), composer.tangent(velocity), composer.tangent(position)];
        let t = composer.transition();
        Ok(BuiltProcess::new(Model {
            navigation,
            same: [t.phi(a, a), t.phi(v, v), t.phi(p, p)],
            moves: t.phi(p, v),
            noise: [t.noise(v), t.noise(a)],
        }))
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
        let (dt, n) = (interval.duration(), &self.navigation);
        let place = state.get(layout, n.position).displaced(&(state.get(layout, n.velocity) * dt));
        state.set(layout, n.position, &place);
        self.same.iter().for_each(|slot| transition.set(*slot, &Matrix3::identity()));
        transition.set(self.moves, &(Matrix3::identity() * dt));
        for (slot, density) in self.noise.iter().zip(DENSITIES) {
            transition.set_noise(*slot, &(Matrix3::identity() * (density * dt)));
        }
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let n = &self.navigation;
        state.set(layout, n.attitude, &motion.c_b_n.to_rotation_matrix());
        state.set(layout, n.velocity, &motion.velocity);
        state.set(layout, n.position, &motion.position);
        for slot in [n.attitude.slot(), n.velocity.slot(), n.position.slot()] {
            known[slot] = true;
        }
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&navfuse_simulation::SimulationPlugin);
    registry.add(&navfuse_doppler::DopplerPlugin).add(&navfuse_depth::DepthPlugin);
    registry.process::<Drifting>();
    registry
}

const SCENARIO: &str = r#"
[estimator]
initial = "given"
[process.vehicle]
type = "drifting"
[sensor.dvl]
navigation = "vehicle"
noise = "1 cm/s"
simulation = { rate = "5 Hz" }
[sensor.depth]
navigation = "vehicle"
noise = "5 cm"
simulation = { rate = "2 Hz" }
[sensor.reference]
navigation = "vehicle"
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
height = "-10 m"
[[source.simulation.segments]]
type = "surge"
duration = "60 s"
speed = "1 m/s"
"#;

#[test]
fn dvl_and_depth_run_on_a_process_without_biases_and_angular_rate() {
    let (finished, judge) = judged(&registry(), SCENARIO, &[]);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    for sensor in ["dvl", "depth"] {
        let counts = &finished.summary.samples[sensor];
        assert!(counts["accepted"].as_u64().unwrap() > 100, "{sensor}: {counts}");
        assert_eq!(counts["rejected"], 0, "{sensor}");
    }
    // chi-square of 9: beyond 34 in one run of ten thousand
    assert!(judge.freedom == 9 && judge.nees < 34.0, "{} of {}", judge.nees, judge.freedom);
    let row = finished.summary.rows.iter().find(|row| row.name == "vehicle.position").unwrap();
    assert!(row.sigma[2] < 0.05, "the depth is measured: {:?}", row.sigma);
}

#[test]
fn a_sensor_that_needs_the_angular_rate_is_refused_with_what_is_missing() {
    let registry = registry();
    let refused = |setting: &str| {
        let document = Document::parse("kinematic.toml", SCENARIO.to_owned()).unwrap();
        let scenario = Scenario::new(&registry, document, &[setting.to_owned()]).unwrap();
        scenario.compose().err().unwrap().to_string()
    };
    for (setting, key) in [
        ("sensor.dvl.lever_arm={ sigma = \"10 cm\" }", "sensor.dvl"),
        ("sensor.reference.lever_arm=[\"1 m\", \"0 m\", \"0 m\"]", "sensor.reference"),
    ] {
        let text = refused(setting);
        assert!(text.contains(key) && text.contains("lever_arm needs the angular rate"), "{text}");
        assert!(text.contains("[process.vehicle] publishes no signal angular_rate"), "{text}");
    }
}

/// The vehicle is what the first process of the scenario moves.
#[test]
fn of_two_bodies_the_first_is_the_vehicle() {
    let registry = registry();
    let second = "[process.other]\ntype = \"drifting\"\n";
    let vehicle = |text: String| {
        let document = Document::parse("two.toml", text).unwrap();
        let scenario = Scenario::new(&registry, document, &[]).unwrap();
        let layout = scenario.compose().unwrap().layout;
        assert_eq!(layout.vehicles.len(), 2);
        let vehicle = layout.vehicle();
        let blocks = [
            vehicle.position.map(|block| layout.block(block).name.clone()),
            vehicle.attitude.map(|block| layout.block(block).name.clone()),
            vehicle.velocity.map(|block| layout.block(block).name.clone()),
        ];
        blocks.map(Option::unwrap)
    };
    let of = |name: &str| ["position", "attitude", "velocity"].map(|what| format!("{name}.{what}"));
    assert_eq!(vehicle(format!("{SCENARIO}{second}")), of("vehicle"));
    assert_eq!(vehicle(format!("{second}{SCENARIO}")), of("other"));
}
