//! Standstills of a simulated car: zero velocity is applied at all of them, and never in motion.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::model::record::{Outcome, Record};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::{document, registry};
use std::sync::atomic::AtomicBool;

/// Times of the updates of `zero-velocity`, s, and whether each was accepted.
#[derive(Default)]
struct Updates {
    sensor: Option<usize>,
    found: Vec<(f64, bool)>,
}

impl Sink for Updates {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.sensor = run.sensors.iter().position(|s| s.name == "zero-velocity");
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Update(update) = record else { return Ok(()) };
        if self.sensor == Some(update.sensor.0) {
            self.found.push((update.time.seconds(), update.outcome == Outcome::Accepted));
        }
        Ok(())
    }
}

/// Updates of the car of `land-odometer`, which stands up to 60 s and from 247 to 277 s. The errors
/// of the velocity at the end are checked against their sigma.
fn updates(settings: &[&str]) -> Vec<(f64, bool)> {
    let common = ["estimator.start=40 s", "estimator.stop=276.9 s"];
    let settings: Vec<String> = common.iter().chain(settings).map(|s| (*s).to_owned()).collect();
    let registry = registry();
    let scenario = Scenario::new(&registry, document("land-odometer.toml"), &settings)
        .unwrap_or_else(|e| panic!("{e}"));
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("updates".into(), Box::new(Updates::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let velocity = finished.summary.rows.iter().find(|r| r.name == "ins.velocity");
    let velocity = velocity.expect("it is estimated");
    let error = velocity.error.as_ref().expect("there is a reference");
    for (error, sigma) in error.iter().zip(&velocity.error_sigma) {
        assert!((error / sigma).abs() < 4.0 && *sigma < 0.01, "{error} of sigma {sigma}");
    }
    finished.take_sink::<Updates>().expect("the sink is there").found
}

/// Checks that the updates cover both standstills, once a second, and nothing else. The car starts
/// and stops smoothly: within 2 s of a standstill it moves by a few cm/s, where the gate may reject.
fn at_the_standstills_alone(updates: &[(f64, bool)]) {
    let gated = updates.iter().filter(|(_, accepted)| !accepted).count();
    assert!(gated <= 2, "{updates:?}");
    let (first, second): (Vec<f64>, Vec<f64>) =
        updates.iter().map(|(time, _)| *time).partition(|time| *time < 150.0);
    assert!(first.iter().all(|t| (40.0..62.0).contains(t)), "{first:?}");
    assert!(second.iter().all(|t| (245.0..277.0).contains(t)), "{second:?}");
    assert!((18..=22).contains(&first.len()), "{first:?}");
    assert!((27..=32).contains(&second.len()), "{second:?}");
}

#[test]
fn the_vibration_of_the_road_tells_rolling_from_standing() {
    // 1 m/s^2 of the road; the car is simulated without any at rest
    let road = "sensor.imu.simulation.faults=[{ type = 'vibration', size = '1 m/s^2', \
                frequency = '13 Hz', channels = ['accel_x', 'accel_y', 'accel_z'], \
                from = '60 s', to = '247 s' }]";
    let settings = [
        "sensor.odometer.enabled=false",
        // 0.01 m/s^2 in a sample at 100 Hz, far below the limit of 15 mg
        "sensor.imu.accel_noise=100 ug/sqrt(Hz)",
        "sensor.non-holonomic.lateral_noise=5 cm/s",
        "sensor.non-holonomic.vertical_noise=5 cm/s",
        "sensor.zero-velocity.window=1 s",
        road,
    ];
    at_the_standstills_alone(&updates(&settings));
}

#[test]
fn an_odometer_tells_a_smooth_ride_from_standing() {
    let settings = [
        "sensor.odometer.noise=1 cm/s",
        "sensor.zero-velocity.odometer=odometer",
        // five sigma of the odometer
        "sensor.zero-velocity.quiet_speed=5 cm/s",
    ];
    at_the_standstills_alone(&updates(&settings));
}

/// Sigma of the velocity of a car that stands, whose IMU is noisy and which nothing but its zero
/// velocity corrects, five times a second.
fn sigma_at_rest(settings: &[&str]) -> Vec<f64> {
    let common = [
        "estimator.start=40 s",
        "estimator.stop=58.9 s",
        "sensor.odometer.enabled=false",
        "sensor.non-holonomic.enabled=false",
        "sensor.zero-velocity.rate=5 Hz",
        "sensor.zero-velocity.quiet_force=100 mg",
        "sensor.imu.accel_noise=3 mg/sqrt(Hz)",
    ];
    let settings: Vec<String> = common.iter().chain(settings).map(|s| (*s).to_owned()).collect();
    let registry = registry();
    let scenario = Scenario::new(&registry, document("land-odometer.toml"), &settings)
        .unwrap_or_else(|e| panic!("{e}"));
    let assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let rows = &finished.summary.rows;
    rows.iter().find(|r| r.name == "ins.velocity").expect("it is estimated").sigma.clone()
}

/// The covariance waits between standstills, while the noise of the IMU adds to it; it is brought to
/// the time of each before it is corrected, or sigma would be that of another time.
#[test]
fn a_standstill_corrects_the_covariance_of_its_own_time_at_every_covariance_rate() {
    let every = sigma_at_rest(&["estimator.covariance_rate='every sample'"]);
    let pooled = sigma_at_rest(&[]);
    for (every, pooled) in every.iter().zip(&pooled) {
        assert!((pooled / every - 1.0).abs() < 1e-6, "{every} {pooled}");
    }
}
