//! An alignment from the first sample to its end, beside an estimate of one's choice.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use super::*;
use crate::earth::LocalEarth;
use crate::testing::{Bench, imu};
use nalgebra::{Rotation3, Vector3};
use navfuse_core::state::covariance::Covariance;
use navfuse_core::units::sample::SensorId;
use serde_json::json;

/// The beginning, s.
const BEGIN: f64 = 100.0;
/// Heading of the vehicle, rad.
const HEADING: f64 = -0.5;

/// A vehicle at rest and level, its alignment and the estimate.
struct Start {
    bench: Bench,
    state: State,
    covariance: Covariance,
    aligner: Aligner,
}

fn at(seconds: f64) -> Time {
    Time::from_seconds(BEGIN + seconds).unwrap()
}

impl Start {
    fn new(sensors: &str, keys: serde_json::Value, imu_keys: &serde_json::Value) -> Self {
        let bench = Bench::with(sensors, &[]);
        let layout = bench.composition.layout.clone();
        let mut state = bench.state();
        state.time = at(0.0);
        let config: Alignment = serde_json::from_value(keys).unwrap();
        let settings = AlignmentSettings::new(&config, (0.0, 0.0)).unwrap().unwrap();
        let imu = ("imu".to_owned(), imu(imu_keys));
        let mut aligner = Aligner::new(&config, settings, imu, bench.navigation);
        aligner.connect(&bench.composition.sensors).unwrap();
        Self { bench, state, covariance: Covariance::zero(layout.tangent), aligner }
    }

    /// At rest for 60 s, of which the coarse alignment takes 20 s, up to 1 deg of heading.
    fn at_rest() -> Self {
        let keys = json!({
            "method": "static", "duration": "60 s", "coarse_duration": "20 s",
            "heading_gate": "1 deg",
        });
        Self::new("", keys, &json!({}))
    }

    /// Takes samples of every second until they are enough, with speeds of zero; returns the time.
    fn search(&mut self, speeds: &str) -> Result<(f64, Progress), ProcessError> {
        let composition = &self.bench.composition;
        let [driver, speeds] = ["imu", speeds].map(|name| composition.sensor(name).unwrap());
        let earth = LocalEarth::at(45_f64.to_radians(), 100.0);
        let body = Rotation3::from_euler_angles(0.0, 0.0, HEADING).inverse();
        let (w, f) = (body * earth.earth_rate(), body * Vector3::z() * -earth.gravity);
        for k in 1..1_000 {
            let time = at(f64::from(k));
            let zero = Sample::new(time, SensorId(speeds), &[0.0; 4]);
            self.aligner.search(&composition.layout, &mut self.state, &zero)?;
            let channels = [w.x, w.y, w.z, f.x, f.y, f.z];
            let sample = Sample::new(time, SensorId(driver), &channels);
            let progress = self.aligner.search(&composition.layout, &mut self.state, &sample)?;
            if progress != Progress::Searching {
                return Ok((f64::from(k), progress));
            }
        }
        panic!("the search does not end")
    }

    /// The reaction to an estimate at a time since the beginning, whose heading has this 1-sigma in
    /// deg; so many zero-velocity updates have been gated from 7 s on.
    fn supervise(
        &mut self,
        seconds: f64,
        sigma: f64,
        gated: u64,
    ) -> Result<Supervision, ProcessError> {
        let layout = &*self.bench.composition.layout;
        let attitude = layout.block(self.bench.navigation.attitude).tangent.unwrap();
        let variance = sigma.to_radians().powi(2);
        self.covariance.set(attitude + 2, attitude + 2, variance);
        self.state.time = at(seconds);
        let gated = (gated > 0).then_some((at(7.0), gated));
        let view = FilterView { layout, state: &self.state, covariance: &self.covariance, gated };
        self.aligner.supervise(&view)
    }

    /// The message of [`Self::supervise`] without gated updates.
    fn message(&mut self, seconds: f64, sigma: f64) -> Option<(Level, String)> {
        self.supervise(seconds, sigma, 0).unwrap().message
    }

    fn unfinished(&self) -> Option<(Level, String)> {
        let layout = &*self.bench.composition.layout;
        let (state, covariance) = (&self.state, &self.covariance);
        self.aligner.unfinished(&FilterView { layout, state, covariance, gated: None })
    }
}

fn says(message: Option<(Level, String)>, level: Level, words: &str) {
    let (found, text) = message.unwrap();
    assert!(found == level && text.contains(words), "{text}");
}

#[test]
fn the_coarse_alignment_takes_its_time_and_sets_the_heading() {
    let mut start = Start::at_rest();
    assert!(start.unfinished().is_none(), "there was no sample");
    let layout = start.bench.composition.layout.clone();
    let sample = Sample::new(at(3.5), SensorId(99), &[0.0; 6]);
    start.aligner.search(&layout, &mut start.state, &sample).unwrap();
    says(start.unfinished(), Level::Error, "end 0.0 s into an alignment at rest of 60 s");
    assert_eq!(start.search("speeds").unwrap(), (20.0, Progress::Found));
    let (.., yaw) = start.state.get(&layout, start.bench.navigation.attitude).euler_angles();
    // samples of a second turn with the Earth by 7e-5 rad in each
    assert!((yaw - HEADING).abs() < 1e-3, "{yaw}");
    says(start.message(0.0, 5.0), Level::Info, "heading 331.35 deg, from 20.0 s");
}

#[test]
fn a_vehicle_at_rest_gets_a_zero_velocity_update_every_second() {
    let mut start = Start::at_rest();
    start.search("speeds").unwrap();
    let mut constrained = |seconds: f64| start.supervise(seconds, 5.0, 0).unwrap().constrain;
    let times = [0.0, 0.5, 1.0, 1.5, 2.0, 5.25, 5.75, 6.0, 6.5];
    let found: Vec<f64> = times.into_iter().filter(|t| constrained(*t)).collect();
    assert_eq!(found, [1.0, 2.0, 5.25, 6.0]);
}

/// The alignment ends after its duration with a heading up to the gate; it is late without one, and
/// its report has the heading of the estimate.
#[test]
fn an_alignment_ends_in_time_or_goes_on_until_its_heading_is_good() {
    let mut start = Start::at_rest();
    start.search("speeds").unwrap();
    start.message(0.0, 5.0);
    assert!(start.message(59.0, 0.5).is_none());
    says(start.unfinished(), Level::Warning, "end 59.0 s into an alignment at rest of 60 s");
    assert!(start.message(59.5, 1.5).is_none());
    says(start.unfinished(), Level::Error, "1-sigma of the heading of 1.500 deg, gate 1.000 deg");
    says(start.message(60.0, 1.5), Level::Warning, "has a 1-sigma of 1.500 deg, gate 1.000 deg");
    assert!(start.message(61.0, 1.5).is_none(), "it was reported");
    says(start.unfinished(), Level::Error, "more time or turns");
    assert!(start.aligner.report().is_none());
    start.supervise(61.5, 0.75, 0).unwrap();
    assert!(start.unfinished().is_none(), "nothing is missing at the end");
    let layout = start.bench.composition.layout.clone();
    let attitude = Rotation3::from_euler_angles(0.0, 0.0, -0.25);
    start.state.set(&layout, start.bench.navigation.attitude, &attitude);
    let text = "aligned, static, 62 s: heading 345.676 deg (coarse, at the start: 331.35 deg), \
                1-sigma 0.750 deg";
    says(start.message(62.0, 0.75), Level::Info, text);
    let values = start.aligner.report().unwrap().values;
    assert!(
        (values["heading_deg"].as_f64().unwrap() - (360.0 - 0.25_f64.to_degrees())).abs() < 1e-9
    );
    assert!((values["heading_sigma_deg"].as_f64().unwrap() - 0.75).abs() < 1e-9);
    assert_eq!((&values["method"], &values["duration_s"]), (&json!("static"), &json!(62.0)));
    let after = start.supervise(63.0, 5.0, 5).unwrap();
    assert!(!after.constrain && after.message.is_none() && start.unfinished().is_none());
}

#[test]
fn three_gated_updates_are_motion_which_a_good_heading_survives() {
    let gated = |sigma: f64, count: u64| {
        let mut start = Start::at_rest();
        start.search("speeds").unwrap();
        start.message(0.0, 5.0);
        let found = start.supervise(10.0, sigma, count);
        (found, start.aligner.report())
    };
    let (goes_on, report) = gated(1.5, 2);
    assert!(goes_on.unwrap().constrain && report.is_none());
    let error = gated(1.5, 3).0.unwrap_err().to_string();
    let words = ["7.0 s into a static alignment", "heading 1.500 deg, gate 1.000 deg"];
    assert!(words.iter().all(|word| error.contains(word)), "{error}");
    let (ends, report) = gated(0.75, 3);
    says(ends.unwrap().message, Level::Warning, "7.0 s into a static alignment of 60 s");
    assert!(report.is_some_and(|r| r.text.starts_with("aligned, static, 10 s")));
}

/// The expected error of the heading is 1.2 times the noise over the root of the time, over the
/// horizontal Earth rate: `1.2 N / (sqrt(20 s) 5.156e-5 rad/s)` at 45 deg, to be within 0.5 rad.
#[test]
fn gyros_that_cannot_find_north_are_refused() {
    let limit = 0.5 / 1.2 * 20_f64.sqrt() * EARTH_RATE * 0.5_f64.sqrt();
    let search = |noise: f64| {
        let keys = json!({
            "method": "static", "duration": "60 s", "coarse_duration": "20 s",
            "rest_velocity": "1e-9 m/s",
        });
        let noise = json!({ "gyro_noise": format!("{noise:e} rad/s/sqrt(Hz)") });
        Start::new("", keys, &noise).search("speeds").map_err(|error| error.to_string())
    };
    assert!(search(0.999 * limit).is_ok());
    // 0.5 rad is 28.6 deg, and a tenth more 31.5 deg
    let error = search(1.1 * limit).unwrap_err();
    assert!(error.contains("32 deg wrong") && error.contains("latitude 45.0 deg"), "{error}");
}

/// An instrument whose mounting is known to 5 deg.
const MOUNTED: &str = "[sensor.mounted]\nsigma = 5.0\n";

#[test]
fn an_alignment_in_motion_is_tried_until_it_settles_and_doubted_once() {
    let keys = json!({ "method": "in-motion", "duration": "20 s", "velocity": "mounted" });
    let mut start = Start::new(MOUNTED, keys, &json!({}));
    assert_eq!(start.search("mounted").unwrap(), (20.0, Progress::Trial));
    let layout = start.bench.composition.layout.clone();
    let again = start.aligner.search_again(&layout, &mut start.state).unwrap();
    assert_eq!(again, Progress::Found, "the trial has changed nothing");
    says(start.message(0.0, 5.0), Level::Info, "deg, from 20.0 s");
    let second = start.supervise(0.5, 5.0, 0).unwrap();
    assert!(second.doubt.is_some_and(|(text, _)| text.starts_with("mounted.mounting")));
    let third = start.supervise(1.0, 5.0, 0).unwrap();
    assert!(third.doubt.is_none() && !third.constrain);
    says(start.unfinished(), Level::Error, "end 1.0 s into an alignment in motion of 20 s");
    says(start.message(20.0, 0.5), Level::Info, "aligned, in-motion, 20 s");
}

/// A receiver with velocity and position.
const RECEIVER: &str = "[sensor.fixes]\n";

fn aligner(keys: serde_json::Value, navigation: Navigation) -> Aligner {
    let config: Alignment = serde_json::from_value(keys).unwrap();
    let settings = AlignmentSettings::new(&config, (0.0, 0.0)).unwrap().unwrap();
    Aligner::new(&config, settings, ("imu".to_owned(), imu(&json!({}))), navigation)
}

#[test]
fn the_velocity_sensor_is_the_only_one_or_the_one_that_is_named() {
    let connect = |sensors: &str, velocity: Option<&str>| {
        let bench = Bench::with(sensors, &[]);
        let keys = json!({ "method": "in-motion", "velocity": velocity });
        let mut aligner = aligner(keys, bench.navigation);
        let composition = &bench.composition;
        aligner.connect(&composition.sensors).map_err(|error| error.to_string())?;
        let sensed = aligner.sensed.unwrap();
        let name = |index: usize| composition.sensors[index].info.name.clone();
        Ok::<_, String>((name(sensed.driver), name(sensed.velocity.unwrap().0)))
    };
    let found = |name: &str| Ok(("imu".to_owned(), name.to_owned()));
    assert_eq!(connect("", None), found("speeds"));
    assert_eq!(connect(MOUNTED, Some("mounted")), found("mounted"));
    assert_eq!(connect(MOUNTED, Some("speeds")), found("speeds"));
    let error = connect(MOUNTED, None).unwrap_err();
    assert!(error.contains("more than one sensor measures the velocity"), "{error}");
    // velocities to north and east are none in the axes of the vehicle
    assert_eq!(connect(RECEIVER, None), found("speeds"));
    let error = connect(RECEIVER, Some("fixes")).unwrap_err();
    assert!(error.contains("alignment.method = \"in-flight\""), "{error}");
    let error = connect("", Some("dvl")).unwrap_err();
    assert!(error.contains("no [sensor.dvl]"), "{error}");
    // the IMU corrects nothing
    assert!(connect("", Some("imu")).is_err());
}

#[test]
fn an_alignment_in_flight_takes_the_velocities_of_its_receiver_if_there_are_any() {
    let bench = Bench::with(RECEIVER, &[]);
    let (sensors, navigation) = (&bench.composition.sensors, bench.navigation);
    let mut connected = aligner(json!({ "method": "in-flight" }), navigation);
    connected.connect(sensors).unwrap();
    let sensed = connected.sensed.unwrap();
    assert_eq!(sensed.velocity.map(|(index, _)| index), bench.composition.sensor("fixes"));
    let (channels, formula) = sensed.gnss.unwrap();
    assert_eq!((channels.position, channels.velocity, formula), (3, Some(0), Formula::Velocity));
    let bare = Channels { position: 0, velocity: None };
    for (stated, with, without) in [
        (None, Some(Formula::Velocity), Some(Formula::Position)),
        (Some("velocity"), Some(Formula::Velocity), None),
        (Some("position"), Some(Formula::Position), Some(Formula::Position)),
    ] {
        let aligner = aligner(json!({ "method": "in-flight", "formula": stated }), navigation);
        assert_eq!(aligner.formula(channels).ok(), with, "{stated:?}");
        assert_eq!(aligner.formula(bare).ok(), without, "{stated:?}");
    }
    let mut alone = aligner(json!({ "method": "in-flight" }), navigation);
    let error = alone.connect(&Bench::new(&[]).composition.sensors).unwrap_err().to_string();
    assert!(error.contains("such as [sensor.gnss]"), "{error}");
}
