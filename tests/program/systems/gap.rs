//! Hegrenaes & Berglund (2009), *Doppler water-track aided inertial navigation for autonomous underwater
//! vehicle*: the velocity through the water, whose current the bottom track has determined, and a model
//! of the vehicle for the gap in which neither the bottom nor the water is tracked.
//!
//! The current is their Gauss-Markov process (`process.water-current`), water track is their
//! measurement (`sensor.dvl` with `track = "water"`), and the model of the vehicle gives the velocity
//! through the water from the thrust, with an error that is correlated in time.

use super::{filter, over_runs, settings};
use crate::common::parallel;

/// The survey with IMU, pressure and a DVL, which loses the bottom from 700 to 1300 s.
const DIVE: [&str; 13] = [
    "sensor.imu.simulation.rate=20 Hz",
    "process.ship.enabled=false",
    "sensor.ship-navigation.enabled=false",
    "sensor.usbl.enabled=false",
    "process.sound.enabled=false",
    "sensor.beacon-north.enabled=false",
    "sensor.beacon-east.enabled=false",
    "sensor.speed-log.enabled=false",
    "sensor.magnetometer.enabled=false",
    "sensor.altimeter.enabled=false",
    "sensor.dvl.simulation.outages=[[\"700 s\", \"1300 s\"]]",
    "process.ins.position.sigma=[\"1 cm\", \"1 cm\", \"1 m\"]",
    "estimator.stop=1300 s",
];

/// Water track with 3 cm/s, which is lost from 700 to 1000 s.
const WATER: &str = "sensor.dvl-water={type=\"dvl\",track=\"water\",current=\"water\",noise=\"3 cm/s\",\
    scale={sigma=\"0.1 %\"},misalignment={sigma=\"0.5 deg\"},simulation={rate=\"4 Hz\",offset=\"0.13 s\",\
    outages=[[\"700 s\",\"1000 s\"]]}}";

/// The model of the vehicle: 3 cm/s of white error, and 3 cm/s that changes within 10 min.
const MODEL: &str = "sensor.vehicle-model={type=\"speed-log\",current=\"water\",lateral=true,noise=\"3 cm/s\",\
    correlated_error={sigma=\"3 cm/s\",correlation_time=\"10 min\"},simulation={rate=\"1 Hz\",offset=\"0.5 s\"}}";

/// Horizontal errors after the gap of both tracks, at 1000 s, and after the water track, at 1300 s, over
/// ten runs. Without any aid the error grows with the cube of the time by the gyro bias that is left; a
/// velocity with an error of 3 cm/s leaves 9 m of 300 s at most.
#[test]
fn a_model_of_the_vehicle_bridges_the_gap_between_bottom_and_water_track() {
    let seeds: Vec<u64> = (1..=10).collect();
    println!("| aids from 700 s on | at 1000 s | at 1300 s |");
    println!("|---|---|---|");
    let row = |name: &str, aids: &[&str]| {
        let errors = parallel(&seeds, |seed| {
            let lines: Vec<&str> = DIVE.iter().chain(aids).copied().collect();
            let errors = filter("survey", &settings(&lines, seed));
            let at = |time: f64| errors[errors.partition_point(|e| e.0 < time - 0.1)].1;
            [at(1000.0), at(1299.0)]
        });
        let [gap, end] = [0, 1].map(|k| over_runs(errors.iter().map(|e| e[k])));
        println!("| {name} | {gap:.1} m | {end:.1} m |");
        [gap, end]
    };
    let none = row("none: IMU and pressure", &["process.water.enabled=false"]);
    let water = row("water track from 1000 s on", &[WATER]);
    let model = row("vehicle model", &[MODEL]);
    let both = row("Hegrenaes & Berglund 2009: water track and vehicle model", &[WATER, MODEL]);
    let lost = "sensor.dvl.simulation.outages=[]";
    let bottom = row("bottom track all the time", &["process.water.enabled=false", lost]);
    assert!(model[0] < 0.3 * none[0] && both[0] < 0.3 * water[0], "{none:?} {water:?} {model:?}");
    assert!(both[1] < water[1].min(none[1]) && bottom[1] < both[1], "{both:?} {bottom:?}");
}
