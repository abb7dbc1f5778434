//! The verdict names the sensor at fault first, where several errors explain the same innovations.

use navfuse_core::model::record::finding::Severity;
use navfuse_core::run::runner;
use navfuse_testing::scenario;
use std::sync::atomic::AtomicBool;

const QUICKSTART: &str = include_str!("../../../../scenarios/quickstart.toml");
const CAR: &str = include_str!("../../../../scenarios/faults/gnss-outage.toml");

/// The part that the verdict names first.
fn first(text: &str, settings: &[&str]) -> Option<String> {
    let assembly = scenario(text, settings, |s| s.assemble(None).unwrap());
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    let verdict = finished.summary.verdict.without_reference();
    let doubt = verdict.reasons.into_iter().find(|reason| reason.severity > Severity::Note);
    doubt.map(|reason| reason.about)
}

fn dive(fault: &str) -> Vec<Option<String>> {
    ["seed=1", "seed=2"].map(|seed| first(QUICKSTART, &[seed, fault])).into()
}

/// What is named in two runs of the car, of whose IMU a channel steps.
fn car_after_step([from, size, channel]: [&str; 3]) -> Vec<Option<String>> {
    let step = format!(
        "sensor.imu.simulation.faults=[{{ type = \"step\", from = \"{from}\", size = \"{size}\", channels = [\"{channel}\"] }}]"
    );
    let healthy = "sensor.gnss.simulation.outages=[]";
    ["seed=1", "seed=2"].map(|seed| first(CAR, &[seed, healthy, &step])).into()
}

fn all(about: &str) -> Vec<Option<String>> {
    vec![Some(about.to_owned()); 2]
}

/// 1 deg at 2 m/s is 3.5 cm/s, 3.5 times the noise of a sample, from one sample to the next: no bias of
/// the IMU does that, though a step of a gyro bias turns the track as well.
#[test]
fn a_dvl_that_turns_in_its_mounting_is_no_step_of_a_gyro_bias() {
    let turn = "sensor.dvl.simulation.faults=[{ type = \"turn\", from = \"353 s\", size = \"1 deg\", \
                channels = [\"vel_x\", \"vel_y\"] }]";
    assert_eq!(dive(turn), all("dvl"));
}

/// 5 mg are 5 cm/s in a second: DVL and depth are refused, and one error explains both.
#[test]
fn an_accelerometer_that_steps_explains_what_all_sensors_are_refused_for() {
    let step = "sensor.imu.simulation.faults=[{ type = \"step\", from = \"223 s\", size = \"5 mg\", \
                channels = [\"accel_z\"] }]";
    assert_eq!(dive(step), all("imu"));
}

/// 0.3 m/s from one sample to the next; a ramp that began just before, by chance, fits 90 % of it.
#[test]
fn a_jump_of_the_dvl_is_no_step_of_an_accelerometer() {
    let jump = include_str!("../../../../scenarios/faults/dvl-jump.toml");
    let named = first(jump, &["estimator.draw=all", "seed=1000027"]);
    assert_eq!(named.as_deref(), Some("dvl"));
}

/// 0.4 mm/s in each second are 40 ug, which the prior of an accelerometer bias allows, until the vehicle turns: the error turns
/// with the instrument, and that of the filter does not.
#[test]
fn a_dvl_that_drifts_is_no_step_of_an_accelerometer() {
    for channel in ["vel_x", "vel_y", "vel_z"] {
        let drift = format!(
            "sensor.dvl.simulation.faults=[{{ type = \"drift\", from = \"343 s\", size = \"0.4 mm/s^2\", \
             channels = [\"{channel}\"] }}]"
        );
        assert_eq!(dive(&drift), all("dvl"), "{channel}");
    }
}

/// One axis of the DVL repeats its value for three minutes, while the others vary with the vehicle and its noise.
#[test]
fn a_channel_of_the_dvl_that_is_stuck_is_left_out_alone() {
    for channel in ["vel_y", "vel_z"] {
        let stuck = format!(
            "sensor.dvl.simulation.faults=[{{ type = \"stuck\", from = \"300 s\", to = \"480 s\", \
             channels = [\"{channel}\"] }}]"
        );
        assert_eq!(dive(&stuck), all("dvl"), "{channel}");
        for seed in ["seed=1", "seed=2"] {
            let assembly = scenario(QUICKSTART, &[seed, &stuck], |s| s.assemble(None).unwrap());
            let summary = runner::run(assembly, &AtomicBool::new(false), |_| {}).summary;
            // an error above 4.5 sigma is in one of 15 000 components of a consistent filter
            let errors = summary.rows.iter().filter_map(|row| Some((row, row.error.as_ref()?)));
            let pairs = errors.flat_map(|(row, errors)| errors.iter().zip(&row.error_sigma));
            let worst = pairs.map(|(error, sigma)| (error / sigma).abs()).fold(0.0, f64::max);
            assert!(worst < 4.5, "{channel}, {seed}: {worst}");
            assert_eq!(summary.verdict.severity(), Severity::Contained, "{channel}, {seed}");
        }
    }
}

/// A vehicle that falls upwards: velocity log and depth contradict the filter from the same second on.
#[test]
fn an_accelerometer_of_the_wrong_sign_is_named_by_those_that_contradict_it() {
    let sign = "sensor.imu.simulation.faults=[{ type = \"sign\", from = \"440 s\", channels = [\"accel_z\"] }]";
    assert_eq!(dive(sign), all("imu"));
}

/// No DVL sends a sample 0.2 s before it has measured it: the other clock is late.
#[test]
fn an_imu_whose_samples_are_late_is_named_where_those_of_the_dvl_seem_to_be_early() {
    let late = "sensor.imu.simulation.faults=[{ type = \"clock-offset\", size = \"0.2 s\" }]";
    assert_eq!(dive(late), all("imu"));
}

/// A second without a sample is more than the run can bridge: it ends there, and its IMU is at fault.
#[test]
fn an_imu_whose_gap_ends_the_run_is_named() {
    let gap =
        "sensor.imu.simulation.faults=[{ type = \"dropout\", from = \"300 s\", to = \"301 s\" }]";
    assert_eq!(dive(gap), all("imu"));
}

/// 0.3 s at 12 m/s are 3.6 m, 180 times the noise of the position.
#[test]
fn a_clock_that_steps_is_no_step_of_a_gyro_bias() {
    let step = "sensor.gnss.simulation.faults=[{ type = \"clock-step\", from = \"153 s\", size = \"0.3 s\" }]";
    let healthy = ["sensor.imu.simulation.faults=[]", "sensor.gnss.simulation.outages=[]"];
    let named = ["seed=1", "seed=2"].map(|seed| first(CAR, &[seed, healthy[0], healthy[1], step]));
    assert_eq!(named.to_vec(), all("gnss"));
}

/// The noise of the gyros, 0.6 deg/s a sample, times a lever arm of 1.5 m is 1.5 cm/s of the antenna. It is in the
/// derivative by the lever arm as well, so that least squares finds a lever arm of zero.
#[test]
fn a_lever_arm_that_is_right_is_not_named_for_the_noise_of_the_gyros() {
    let arm = "sensor.gnss.lever_arm=[\"1 m\", \"-0.5 m\", \"1.5 m\"]";
    let healthy = ["sensor.imu.simulation.faults=[]", "sensor.gnss.simulation.outages=[]"];
    let of = |seed| first(CAR, &[seed, healthy[0], healthy[1], arm]);
    assert_eq!(["seed=1", "seed=2", "seed=3"].map(of), [const { None }; 3]);
}

/// 0.2 s at 12 m/s are 2.4 m, 120 times the noise of the position: the car has no other sensor, so that an error
/// of its IMU would explain the samples that the gate refuses as well.
#[test]
fn a_late_gnss_is_named_where_it_is_the_only_sensor() {
    let late = "sensor.gnss.simulation.faults=[{ type = \"clock-offset\", size = \"0.2 s\" }]";
    let healthy = ["sensor.imu.simulation.faults=[]", "sensor.gnss.simulation.outages=[]"];
    let named = ["seed=1", "seed=3"].map(|seed| first(CAR, &[seed, healthy[0], healthy[1], late]));
    assert_eq!(named.to_vec(), all("gnss"));
}

/// 0.4 deg/s are 0.1 m/s and 1 deg after 2.5 s. The error grows within the gate before it refuses a sample, where one of
/// the receiver would jump.
#[test]
fn a_gyro_that_steps_is_named_where_gnss_is_the_only_sensor() {
    for channel in ["gyro_x", "gyro_y", "gyro_z"] {
        assert_eq!(car_after_step(["100 s", "0.4 deg/s", channel]), all("imu"), "{channel}");
    }
}

/// 50 mg are 12 cm/s after the first sample and 1.6 m after ten: the gate refuses from the second or third sample on, and no
/// sample before shows the step. A jump or a drift of the receiver does not grow like that.
#[test]
fn a_step_of_the_imu_that_the_gate_refuses_at_once_is_named_within_seconds() {
    for (size, channel) in [("50 mg", "accel_x"), ("-60 mg", "accel_y"), ("2 deg/s", "gyro_x")] {
        assert_eq!(car_after_step(["150 s", size, channel]), all("imu"), "{channel}");
    }
}

/// The fixes scatter by 3.3 times what the receiver states: they are far beyond the gate without growing, and no step of the IMU.
#[test]
fn a_receiver_that_states_a_third_of_its_noise_is_no_step_of_the_imu() {
    let settings = [
        "estimator.start=\"1 s\"",
        "sensor.imu={ gyro_noise = \"18 deg/h/sqrt(Hz)\", accel_noise = \"150 ug/sqrt(Hz)\", simulation = { rate = \"100 Hz\" } }",
        "process.ins={ attitude = { sigma = \"0.5 deg\" }, velocity = { sigma = \"5 cm/s\" }, position = { sigma = \"10 cm\" }, \
         gyro_bias = { sigma = \"100 deg/h\", truth = \"50 deg/h\" }, accel_bias = { sigma = \"5 mg\", truth = \"3 mg\" } }",
        "sensor.gnss={ horizontal_noise = \"3 mm\", vertical_noise = \"6 mm\", velocity_noise = \"3 cm/s\", \
         simulation = { rate = \"5 Hz\", noise = 3.3 } }",
    ];
    let named = ["seed=2", "seed=5"].map(|seed| first(CAR, &[&[seed], &settings[..]].concat()));
    assert_eq!(named.to_vec(), all("gnss"));
}

/// After an outage of 26 s a step of an accelerometer would explain fixes that are off by 3 m, or 11 m: no sample
/// before has seen it grow.
#[test]
fn a_fix_that_is_off_after_an_outage_is_no_step_of_the_imu() {
    let outage = "sensor.gnss.simulation.outages=[[\"100 s\", \"126 s\"]]";
    for size in ["0.1 arcsec", "0.36 arcsec"] {
        let wrong = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", from = \"126 s\", to = \"180 s\", size = \"{size}\", channels = [\"lat\"] }}]"
        );
        let healthy = "sensor.imu.simulation.faults=[]";
        let named = ["seed=1", "seed=2"].map(|seed| first(CAR, &[seed, healthy, outage, &wrong]));
        assert_eq!(named.to_vec(), all("gnss"), "{size}");
    }
}

/// The fixes stay 31 m off to the end, so that nothing decides between the receiver and a drift of the IMU in the
/// outage.
#[test]
fn a_sensor_that_may_have_been_wrong_since_an_outage_is_named_with_both_cases() {
    let outage = "sensor.gnss.simulation.outages=[[\"350 s\", \"365 s\"]]";
    let wrong = "sensor.gnss.simulation.faults=[{ type = \"bias\", from = \"365 s\", size = \"1 arcsec\", channels = [\"lat\"] }]";
    let healthy = "sensor.imu.simulation.faults=[]";
    assert_eq!(first(CAR, &["seed=1", healthy, outage, wrong]).as_deref(), Some("gnss"));
}
