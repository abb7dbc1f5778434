//! Sensors that contradict the filter, as a car with a receiver meets them: what the filter keeps, follows
//! and takes back. Each fault is varied in size, time, rate and channel.

use crate::aiding::DIVE;
use crate::aiding::bench::{Trial, run};
use navfuse_core::model::record::finding::Severity;

/// A car of 110 s with an IMU of MEMS.
const CAR: &str = r#"
name = "car"
[estimator]
draw = "start"
[process.ins]
attitude = { sigma = "0.5 deg" }
velocity = { sigma = "5 cm/s" }
position = { sigma = "10 cm" }
gyro_bias = { sigma = "100 deg/h", truth = ["60 deg/h", "-40 deg/h", "50 deg/h"] }
accel_bias = { sigma = "5 mg", truth = ["3 mg", "-2 mg", "4 mg"] }
[sensor.imu]
gyro_noise = "18 deg/h/sqrt(Hz)"
accel_noise = "150 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.gnss]
horizontal_noise = "2 cm"
vertical_noise = "4 cm"
velocity_noise = "3 cm/s"
simulation = { rate = "5 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "48.1 deg", longitude = "11.5 deg", height = "500 m", heading = "35 deg" }
segments = [
  { type = "static", duration = "10 s" },
  { type = "surge", duration = "8 s", speed = "12 m/s" },
  { type = "turn", duration = "10 s", angle = "80 deg" },
  { type = "surge", duration = "6 s", speed = "17 m/s" },
  { type = "cruise", duration = "10 s" },
  { type = "turn", duration = "8 s", angle = "-70 deg" },
  { type = "surge", duration = "8 s", speed = "5 m/s" },
  { type = "turn", duration = "12 s", angle = "120 deg" },
  { type = "cruise", duration = "10 s" },
  { type = "turn", duration = "8 s", angle = "-90 deg" },
  { type = "surge", duration = "8 s", speed = "9 m/s" },
  { type = "cruise", duration = "12 s" },
]
"#;

/// Runs the car with a seed and settings.
fn car(seed: usize, settings: &[&str]) -> Trial {
    let seed = format!("seed={seed}");
    run(CAR, &[&[seed.as_str()], settings].concat())
}

/// Horizontal error at the end, m.
fn off(trial: &Trial) -> f64 {
    trial.finished.summary.horizontal_error_m.as_ref().map_or(f64::NAN, |h| h.last)
}

/// The most severe finding about the receiver.
fn severity(trial: &Trial) -> Option<Severity> {
    let findings = trial.finished.findings.iter().filter(|finding| finding.about == "gnss");
    findings.map(|finding| finding.severity).max()
}

fn says(trial: &Trial, text: &str) -> bool {
    trial.finished.findings.iter().any(|finding| finding.text.contains(text))
}

/// The result holds at the end.
fn holds(trial: &Trial, metres: f64, case: &str) {
    let sigmas = trial.errors.final_largest();
    assert!(sigmas.0 <= 3.5 && off(trial) < metres, "{case}: {sigmas:?}, {} m", off(trial));
}

/// The result holds at the end, and no finding forbids its use.
fn is_right(trial: &Trial, metres: f64, case: &str) {
    holds(trial, metres, case);
    let findings = &trial.finished.findings;
    assert!(severity(trial) < Some(Severity::DoNotUse), "{case}: {findings:?}");
}

/// A jump of the height, as from the ellipsoid to the sea level, and one of a velocity.
#[test]
fn a_channel_that_jumps_costs_that_channel_and_not_the_sample() {
    let jumps = [("height", "-12 m"), ("height", "47 m"), ("vel_n", "3 m/s"), ("vel_d", "-2 m/s")];
    for (seed, (channel, size)) in (0..8).zip(jumps.into_iter().cycle()) {
        let from = 15 + 9 * seed;
        let fault = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", from = \"{from} s\", size = \"{size}\", \
             channels = [\"{channel}\"] }}]"
        );
        let trial = car(seed, &[&fault]);
        holds(&trial, 0.15, &fault);
        assert!(trial.errors.outcomes["gnss accepted"] > 530, "{:?}", trial.errors.outcomes);
    }
}

/// A receiver whose samples are stamped late or early, at several rates and noises. The lag is named with its
/// size, for all its samples that the gate refuses first. What follows is right within its sigma, of up to
/// 0.6 m for each axis, or the run refuses its result.
#[test]
fn a_receiver_that_lags_is_named_with_its_lag_which_is_taken_off() {
    let receivers =
        [(1, "1 m", "5 cm/s"), (1, "2 m", "10 cm/s"), (2, "1 m", "5 cm/s"), (5, "1 m", "10 cm/s")];
    let lags = [0.3, -0.2, 0.1, 0.5, 0.2, -0.35];
    let mut wide = Vec::new();
    for (seed, lag) in (0..12).zip(lags.into_iter().cycle()) {
        let (rate, horizontal, velocity) = receivers[seed % receivers.len()];
        let fault = format!("{{ type = \"clock-offset\", size = \"{lag} s\" }}");
        let settings = [
            format!("sensor.gnss.horizontal_noise=\"{horizontal}\""),
            format!("sensor.gnss.vertical_noise=\"{horizontal}\""),
            format!("sensor.gnss.velocity_noise=\"{velocity}\""),
            format!("sensor.gnss.simulation={{ rate = \"{rate} Hz\", faults = [{fault}] }}"),
        ];
        let settings = settings.each_ref().map(String::as_str);
        let (trial, case) = (car(seed, &settings), format!("{lag} s at {rate} Hz, {velocity}"));
        let (largest, place) = trial.errors.final_largest();
        let refused = severity(&trial) == Some(Severity::DoNotUse);
        assert!(largest <= 3.5 || refused, "{case}: {largest} {place}");
        assert!(off(&trial) < 2.0, "{case}: {} m", off(&trial));
        let named = trial.finished.findings.iter().find_map(|finding| lag_of(&finding.text));
        let Some([found, sigma]) = named else {
            panic!("{case}: {:?}", trial.finished.findings);
        };
        wide.extend(((found - lag).abs() > 2.0 * sigma).then_some((case.clone(), found, sigma)));
        assert!((found - lag).abs() < 4.0 * sigma, "{case}: {found} {sigma}");
    }
    // one in twenty is beyond two sigma
    assert!(wide.len() <= 3, "{wide:?}");
}

/// The lag in the text of a finding, and its sigma, s.
fn lag_of(text: &str) -> Option<[f64; 2]> {
    let (lag, rest) = text.split_once("time offset of ")?.1.split_once(" s +- ")?;
    Some([lag.parse().ok()?, rest.split_once(" s (")?.0.parse().ok()?])
}

/// Noise of 2.5 to 5 times the stated one.
#[test]
fn a_receiver_that_states_too_small_a_noise_is_used_with_the_noise_of_its_samples() {
    for (seed, noise) in [2.5, 3.3, 5.0].into_iter().enumerate() {
        let case = format!("sensor.gnss.simulation.noise={noise}");
        let trial = car(seed, &[&case]);
        holds(&trial, 0.03 * noise, &case);
        assert!(says(&trial, "stated accuracy is too small"), "{case}");
    }
}

/// Fixes of the first one to three seconds that a wide prior lets pass.
#[test]
fn first_fixes_that_are_wrong_are_outvoted() {
    for (seed, size) in (0..6).zip(["3 arcsec", "40 arcsec", "-300 arcsec"].into_iter().cycle()) {
        let to = 1 + seed / 2;
        let fault = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", to = \"{to} s\", size = \"{size}\", \
             channels = [\"lat\"] }}]"
        );
        let trial = car(seed, &["process.ins.position={ sigma = \"10 km\" }", &fault]);
        is_right(&trial, 0.15, &fault);
    }
}

/// Fixes that are 3 to 60 m off after 12 to 20 s without any, with right velocities, until the receiver is
/// right again or the run ends. The error of the filter may have grown as much: the covariance contains both.
#[test]
fn a_wrong_fix_after_an_outage_stays_within_the_sigma() {
    let sizes = [-0.1, 0.2, -0.35, 2.0];
    for (seed, size) in (0..8).zip(sizes.into_iter().cycle()) {
        let (back, ends) = (52 + seed, seed < 6);
        let to = if ends { 80 + seed } else { 200 };
        let outage = format!("sensor.gnss.simulation.outages=[[\"40 s\", \"{back} s\"]]");
        let fault = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", from = \"{back} s\", to = \"{to} s\", size = \
             \"{size} arcsec\", channels = [\"lat\"] }}]"
        );
        let trial = car(seed, &[&outage, &fault]);
        // an arc second is 30.9 m
        is_right(&trial, if ends { 0.15 } else { 0.15 + 31.0 * f64::abs(size) }, &fault);
    }
}

/// Fixes that are 0.6 to 1.5 m off after an outage, from one sample to 25 s long: up to four sigma of the
/// filter, so that the gate passes most of them. In one run of eight the evidence may name the wrong channels.
#[test]
fn a_wrong_fix_that_passes_the_gate_after_an_outage_is_undone() {
    let sizes = [0.02, -0.035, 0.05];
    let lengths = [0.1, 1.0, 5.0, 25.0];
    let undone = |seed: &usize| {
        let (channel, size, to) =
            (["lat", "lon"][seed / 4], sizes[seed % 3], 55.05 + lengths[seed % 4]);
        let outage = "sensor.gnss.simulation.outages=[[\"40 s\", \"55 s\"]]";
        let fault = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", from = \"54 s\", to = \"{to} s\", size = \
             \"{size} arcsec\", channels = [\"{channel}\"] }}]"
        );
        let trial = car(*seed, &[outage, &fault]);
        let sigmas = trial.errors.final_largest();
        let forbidden = severity(&trial) == Some(Severity::DoNotUse);
        assert!(sigmas.0 <= 3.5 || forbidden, "{fault}: {sigmas:?}");
        sigmas.0 <= 3.5 && !forbidden && off(&trial) < 0.15
    };
    assert!((0..8).filter(undone).count() >= 7);
}

/// The accelerometers are off by far more than the filter expects while no fix comes: the fixes afterwards
/// are right, some of them with a height that agrees.
#[test]
fn a_filter_that_was_wrong_in_an_outage_follows_the_fixes_after_it() {
    let axes = ["accel_x", "accel_y", "accel_z"];
    for (seed, axis) in (0..6).zip(axes.into_iter().cycle()) {
        let size = 20 + 8 * seed;
        let outage = "sensor.gnss.simulation.outages=[[\"40 s\", \"55 s\"]]";
        let fault = format!(
            "sensor.imu.simulation.faults=[{{ type = \"bias\", from = \"40 s\", to = \"55 s\", size = \
             \"{size} mg\", channels = [\"{axis}\"] }}]"
        );
        let trial = car(seed, &[outage, &fault]);
        is_right(&trial, 0.15, &fault);
        assert!(trial.errors.outcomes["gnss accepted"] > 460, "{:?}", trial.errors.outcomes);
    }
}

/// The first fix is 31 to 930 m off, and a wide prior lets it pass. The DVL and the depth sensor know the motion
/// well, so that every further fix contradicts the filter: ten of them outvote each one that was wrong.
#[test]
fn a_first_fix_that_is_an_outlier_does_not_lock_out_the_good_ones() {
    for size in ["1 arcsec", "-30 arcsec"] {
        let fault = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"bias\", to = \"11.5 s\", size = \"{size}\", channels \
             = [\"lat\"] }}]"
        );
        let prior = "process.ins.position={ sigma = \"2 km\" }";
        let trial = run(DIVE, &["estimator.stop=160 s", prior, &fault]);
        let (sigmas, outcomes) = (trial.errors.final_largest(), &trial.errors.outcomes);
        assert!(sigmas.0 <= 3.5, "{size}: {sigmas:?}");
        assert!(outcomes["gnss accepted"] >= 149 - 2 - 20, "{size}: {outcomes:?}");
    }
}
