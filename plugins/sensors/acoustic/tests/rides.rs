//! A sensor of one's own on another body: the range to a transducer of the ship.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::model::sensor::body::Body;
use navfuse_core::nalgebra::Rotation3;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;
use navfuse_testing::judge::judged;

// ANCHOR: sensor
/// Range from a transducer below the ship to the vehicle.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShipRange {
    /// 1-sigma noise of the range.
    pub noise: Sigma<Length>,
    /// Name of the process of the ship.
    pub ship: String,
    /// Place of the transducer from the reference point of the ship, in the ship's axes.
    pub transducer: LeverArm,
}

struct Model {
    sigma: f64,
    position: Handle<Position>,
    transducer: Handle<Vector<3>>,
    ship: Body,
}

/// First channel of the pose of the ship.
const POSE: usize = 1;

impl SensorType for ShipRange {
    const TYPE: &'static str = "ship-range";
    fn channels(&self) -> Vec<Channel> {
        let pose = [
            ("ship_lat", "rad"),
            ("ship_lon", "rad"),
            ("ship_height", "m"),
            ("ship_roll", "rad"),
            ("ship_pitch", "rad"),
            ("ship_heading", "rad"),
        ];
        let all = [("range", "m")].into_iter().chain(pose);
        all.map(|(name, unit)| Channel::new(name, unit)).collect()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let ship = composer.body("ship", &self.ship)?;
        composer.rides(&ship, POSE);
        let zero = [0.0; 3];
        Ok(Role::measurement(Model {
            sigma: self.noise.value().si(),
            position: Navigation::only(composer)?.position,
            transducer: self.transducer.block(composer, "transducer", &zero, display::LEVER_ARM)?,
            ship,
        }))
    }
}

impl MeasurementModel<1> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let (here, arm) = (x.get(self.position), x.get(self.transducer));
        let (moved, turned) = (x.get(self.ship.position_error), x.get(self.ship.attitude_error));
        let channel = |k| x.channel(POSE + k).unwrap_or(f64::NAN);
        let measured = Geodetic { latitude: channel(0), longitude: channel(1), height: channel(2) };
        let c_s_n = Rotation3::from_euler_angles(channel(3), channel(4), channel(5));
        let arm = turned * convert::<_, Rotation3<T>>(c_s_n) * arm;
        let transducer = measured.cast().displaced(&(moved + arm));
        SVector::from([(here.earth_fixed() - transducer.earth_fixed()).norm()])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma.powi(2))
    }
    /// The simulated pose is the one that the navigation of the ship measures.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        self.ship.measured(scene).put(sample, POSE);
        scene.measure(self, sample);
    }
}
// ANCHOR_END: sensor

const SCENARIO: &str = r#"
[estimator]
draw = "all"
[process.ins]
attitude = { sigma = ["0.1 deg", "0.1 deg", "0.3 deg"] }
velocity = { sigma = "5 cm/s" }
position = { sigma = "2 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "100 ug" }
[process.ship]
position = { sigma = "50 cm", correlation_time = "10 min" }
attitude = { sigma = ["0.1 deg", "0.1 deg", "0.5 deg"], correlation_time = "30 min" }
[sensor.imu]
gyro_noise = "1 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }
[sensor.ship-navigation]
simulation = { rate = "5 Hz", latitude = "43.001 deg", longitude = "5.0005 deg", heading = "40 deg", speed = "1 m/s", turn = "0.5 deg/s", swell = "3 deg" }
[sensor.ship-range]
noise = "20 cm"
ship = "ship"
transducer = { initial = ["10 m", "-3 m", "5 m"], sigma = "10 cm" }
late = "2 s"
gate = "off"
simulation = { rate = "0.5 Hz", offset = "0.33 s" }
[sensor.dvl]
noise = "1 cm/s"
gate = "off"
simulation = { rate = "2 Hz", offset = "0.1 s" }
[sensor.depth]
noise = "5 cm"
gate = "off"
simulation = { rate = "1 Hz", offset = "0.2 s" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "43 deg", longitude = "5 deg", height = "-60 m", heading = "30 deg" }
segments = [
    { type = "surge", duration = "20 s", speed = "2 m/s" },
    { type = "square", duration = "130 s", turn = "20 s", bank = "5 deg", pitch = "1 deg" },
]
"#;

/// 24 states: 15 of the INS, 6 of the ship and 3 of the transducer. Over 20 runs the mean of a chi-square
/// of 24 has a sigma of `sqrt(2 / (20 * 24))` = 0.065 of its mean; the band is 3.3 of them.
#[test]
fn a_range_from_a_moving_ship_is_consistent() {
    let mut registry = navfuse_testing::registry();
    registry.sensor::<ShipRange>();
    let mut sum = 0.0;
    for seed in 1..=20 {
        let (finished, judge) = judged(&registry, SCENARIO, &[format!("seed={seed}")]);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        assert_eq!(judge.freedom, 24);
        sum += judge.nees / (20.0 * 24.0);
        let used = finished.summary.samples["ship-range"]["accepted"].as_u64().unwrap();
        assert!(used > 70, "{used}");
    }
    println!("mean NEES over the degrees of freedom: {sum:.3}");
    assert!((sum - 1.0).abs() < 3.3 * 0.065, "{sum}");
}
