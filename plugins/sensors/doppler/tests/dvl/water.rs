//! Water tracking and the current: the equation, and ten minutes without the bottom.

use crate::common::{bound, compose, no_sample, predict, refused, run, set};
use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::Dynamics;

const SCENARIO: &str = include_str!("../../../../../scenarios/water-track.toml");

const NO_WATER: &str = "sensor.water-track.enabled=false";

#[test]
fn the_current_is_taken_off_in_north_east_down() {
    let body = "sensor.water-track={ type = \"dvl\", noise = \"1 cm/s\", track = \"water\", \
                current = \"water\" }";
    let composition = compose(SCENARIO, &[body]);
    let mut state = composition.layout.initial_state();
    // heading east at 2 m/s in a current of 0.3 m/s to the north and 0.5 m/s to the east, sinking
    // water of 0.1 m/s
    set(&composition, &mut state, "ins.attitude", &[0.0, 0.0, 90_f64.to_radians()]);
    set(&composition, &mut state, "ins.velocity", &[0.0, 2.0, 0.0]);
    set(&composition, &mut state, "water.current", &[0.3, 0.5, 0.1]);
    let z = Vector3::from_vec(predict(&composition, "water-track", &state, &no_sample()));
    // forward is east, right is south
    assert!((z - Vector3::new(1.5, 0.3, -0.1)).amax() < 1e-15, "{z}");
}

const SAME: &str = "sensor.water-track={ type = \"dvl-beams\", noise = \"3 cm/s\", \
                    scale = { sigma = 0.01 }, track = \"water\", current = \"water\", \
                    transducer = \"bottom-track\"";

#[test]
fn one_transducer_has_one_misalignment_and_one_lever_arm_whatever_it_tracks() {
    let composition = compose(SCENARIO, &[&format!("{SAME} }}")]);
    let of = |sensor: &str| {
        composition.layout.blocks.iter().filter(|b| b.name.starts_with(sensor)).count()
    };
    assert_eq!((of("bottom-track."), of("water-track.")), (3, 1), "the scale factor is its own");
    let mut state = composition.layout.initial_state();
    set(&composition, &mut state, "ins.velocity", &[2.0, 0.3, -0.1]);
    set(&composition, &mut state, "bottom-track.misalignment", &[0.01, -0.02, 0.05]);
    // no current, no error of scale: both read the same
    let [bottom, water] =
        ["bottom-track", "water-track"].map(|s| predict(&composition, s, &state, &no_sample()));
    assert_eq!(bottom, water);
}

#[test]
fn a_transducer_that_is_not_there_or_is_mounted_twice_is_refused() {
    let twice =
        refused(SCENARIO, &[&format!("{SAME}, lever_arm = [\"1 m\", \"0 m\", \"0 m\"] }}")]);
    assert!(
        twice.contains("lever_arm")
            && twice.contains("[sensor.bottom-track], which `transducer` names, has it already"),
        "{twice}"
    );
    let none = refused(SCENARIO, &[&format!("{SAME} }}").replace("bottom-track", "botom")]);
    assert!(none.contains("there is no DVL [sensor.botom] above this one"), "{none}");
}

#[test]
fn a_current_is_gauss_markov_of_an_hour_unless_the_scenario_says_otherwise() {
    let of = |setting: &str| {
        let composition = compose(SCENARIO, &[setting]);
        let block = composition.layout.find("water.current").unwrap();
        (block.spec.dynamics.clone(), block.tangent.is_some())
    };
    let sigma = vec![0.2; 3];
    let hour = Dynamics::GaussMarkov { sigma: sigma.clone(), time: 3600.0 };
    assert_eq!(of("process.water.current={ sigma = \"20 cm/s\" }"), (hour, true));
    let day = Dynamics::GaussMarkov { sigma, time: 86400.0 };
    assert_eq!(
        of("process.water.current={ sigma = \"20 cm/s\", correlation_time = \"1 day\" }"),
        (day, true)
    );
    let (walk, _) =
        of("process.water.current={ sigma = \"20 cm/s\", random_walk = \"1 mm/s/sqrt(s)\" }");
    assert_eq!(walk, Dynamics::RandomWalk(vec![0.001 * 0.001; 3]));
    // known from elsewhere, as of a model of the tide
    assert_eq!(
        of("process.water.current=[\"10 cm/s\", \"0 m/s\", \"0 m/s\"]"),
        (Dynamics::Constant, false)
    );
}

/// What is known of the position when the bottom is back, from what can be said by hand:
/// - the current wanders from what it was when the bottom was lost, by `sqrt(2 s^2/T t^3/3)` = 5.8
///   m of position, with s = 10 cm/s, T = 12 h and t = 600 s;
/// - the heading is known to 0.25 deg: 1200 m of it are 5.2 m across the track;
/// - velocity and current together are known to about 5 mm/s when the bottom is lost, which is 3 m,
///   and 1 m was there before.
///
/// That is 8.5 m. An accelerometer of 100 ug/sqrt(Hz) alone gives `1e-3 sqrt(t^3/3)` = 8.3 m; the
/// gyros' 3 deg/h/sqrt(Hz) tilt the platform and give `9.8 N sqrt(t^5/20)` = 282 m with N =
/// 1.45e-5.
#[test]
fn the_current_is_known_when_the_bottom_is_lost_and_holds_the_drift_at_metres() {
    let (with, without) = (bound(SCENARIO, &[]), bound(SCENARIO, &[NO_WATER]));
    let (lost, back) = (899.0, 1499.9);
    println!("{:?}\n{:?}\n{:?}", with.at(lost), with.at(back), without.at(back));
    let current = with.at(lost).current;
    assert!(current[0] < 0.01 && current[1] < 0.01, "of a prior of 10 cm/s: {current:?}");
    assert!(with.at(back).sigma < 10.0, "{:?}", with.at(back));
    assert!((200.0..400.0).contains(&without.at(back).sigma), "{:?}", without.at(back));
    // the bottom seen again for a minute
    assert!(with.at(1560.0).velocity.diagonal().max().sqrt() < 0.02);
}

/// With the water, the error is within 3 sigma of the worse component.
#[test]
fn a_run_without_the_bottom_is_metres_off_with_the_water_and_hundreds_without() {
    let (with, without) = (run(SCENARIO, &[]), run(SCENARIO, &[NO_WATER]));
    let (aided, alone) = (with.at(1499.9), without.at(1499.9));
    println!("{aided:?}\n{alone:?}");
    assert!(aided.error < 3.0 * aided.sigma && aided.sigma < 10.0, "{aided:?}");
    assert!(alone.error > 100.0, "{alone:?}");
    let water = compose(SCENARIO, &[]).sensor("water-track").unwrap();
    let (mean, tolerance) = with.mean_nis(water);
    assert!((mean - 1.0).abs() < tolerance, "{mean} +- {tolerance}");
}

/// Water that is taken for the bottom: the current, 14 cm/s, is then an error of the velocity, a wrong fixed vector
/// of which the filter finds one component, and estimates all from then on. 14 cm/s for 600 s are 85 m; with the
/// current the position is known to 10 m.
#[test]
fn the_same_samples_without_a_current_are_as_good_as_with_it_once_it_is_found() {
    for seed in 1..=4 {
        let known = "process.water.current={ initial = \"0 m/s\", truth = [\"10 cm/s\", \"-10 \
                     cm/s\", \"0 m/s\"] }";
        let seed = format!("seed={seed}");
        let log = run(SCENARIO, &[known, "sensor.water-track.gate=\"off\"", &seed]);
        let back = log.at(1499.9);
        assert!(back.sigma < 15.0 && back.error < 3.0 * back.sigma, "{seed} {back:?}");
    }
}

#[test]
fn beams_water_track_and_current_conform() {
    let text = r#"
        [process.ins]
        attitude = { sigma = ["0.02 deg", "0.02 deg", "0.2 deg"] }
        velocity = { sigma = "1 cm/s" }
        position = { sigma = "1 m" }
        gyro_bias = { sigma = "1 deg/h" }
        accel_bias = { sigma = "100 ug" }
        [process.water]
        type = "water-current"
        current = { sigma = ["20 cm/s", "20 cm/s", "2 cm/s"], correlation_time = "10 min" }
        [sensor.imu]
        gyro_noise = "0.1 deg/h/sqrt(Hz)"
        accel_noise = "10 ug/sqrt(Hz)"
        simulation = { rate = "50 Hz" }
        [sensor.bottom]
        type = "dvl-beams"
        noise = "1 cm/s"
        scale = { sigma = "1 %" }
        misalignment = { sigma = "0.5 deg" }
        lever_arm = ["0.3 m", "0 m", "0.2 m"]
        simulation = { rate = "2 Hz" }
        [sensor.water-track]
        type = "dvl"
        track = "water"
        current = "water"
        noise = "3 cm/s"
        simulation = { rate = "2 Hz" }
        [sensor.reference]
        simulation = { rate = "1 Hz" }
        [source.simulation]
        start = { latitude = "43 deg", heading = "30 deg" }
        segments = [
            { type = "surge", duration = "20 s", speed = "2 m/s" },
            { type = "descend", duration = "30 s", rate = "0.5 m/s" },
            { type = "turn", duration = "20 s", angle = "90 deg", bank = "8 deg" },
            { type = "cruise", duration = "20 s" },
        ]
    "#;
    let report = navfuse_conformance::report(&[&navfuse_doppler::DvlPlugin], text);
    assert!(report.failures().count() == 0 && report.findings.len() > 10, "{report}");
}
