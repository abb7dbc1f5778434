//! Topics of ROS 2: a vehicle by Cyclone DDS, the middleware of many robots, publishes and receives.
#![cfg(feature = "dds")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_core::document::Document;
use navfuse_core::model::record::Event;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::pass_samples;
use navfuse_core::run::scenario::Scenario;
use navfuse_dds::DdsPlugin;
use navfuse_links::write_sentence;
use navfuse_live::{Options, run};
use navfuse_testing::python::{Packages, output};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::scope;

/// Seconds of the dive in a second.
const SPEED: f64 = 5.0;

/// A vehicle with an IMU, a DVL, a pressure sensor and GNSS: a run-up of 10 s to 2 m/s, and 20 s of cruise at a
/// heading of 30 deg.
const VEHICLE: &str = r#"
name = "ros2"
seed = 3
[process.ins]
attitude = { initial = ["0 deg", "0 deg", "30 deg"], sigma = ["0.1 deg", "0.1 deg", "2 deg"] }
velocity = { initial = ["0 m/s", "0 m/s", "0 m/s"], sigma = "5 cm/s" }
position = { latitude = "43 deg", longitude = "5 deg", height = "0 m", sigma = "5 m" }
gyro_bias = { sigma = "3 deg/h" }
accel_bias = { sigma = "500 ug" }
[sensor.imu]
gyro_noise = "3 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
coast = { turn = "1 deg/s/sqrt(Hz)", acceleration = "0.1 m/s^2/sqrt(Hz)" }
simulation = { rate = "100 Hz" }
[sensor.gnss]
horizontal_noise = "1 m"
vertical_noise = "2 m"
late = "5 s"
simulation = { rate = "1 Hz" }
[sensor.dvl]
noise = "1 cm/s"
late = "5 s"
simulation = { rate = "5 Hz" }
[sensor.depth]
noise = "5 cm"
late = "5 s"
simulation = { rate = "4 Hz" }
[source.simulation.start]
latitude = "43 deg"
longitude = "5 deg"
heading = "30 deg"
[[source.simulation.segments]]
type = "static"
duration = "5 s"
[[source.simulation.segments]]
type = "surge"
duration = "10 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "cruise"
duration = "20 s"
"#;

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DopplerPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&DdsPlugin);
    registry
}

fn scenario<'a>(registry: &'a Registry, topics: &str) -> Scenario<'a> {
    let document = Document::parse("ros2.toml", format!("{VEHICLE}{topics}")).unwrap();
    Scenario::new(registry, document, &[]).unwrap()
}

/// The samples of the dive as sentences.
fn sentences(registry: &Registry) -> String {
    let assembly = scenario(registry, "").assemble(None).unwrap();
    let infos: Vec<_> = assembly.composition.sensors.iter().map(|s| s.info.clone()).collect();
    let mut text = String::new();
    pass_samples(assembly, |sample| {
        write_sentence(&mut text, &infos[sample.sensor.0], sample);
        true
    })
    .unwrap();
    text
}

fn cyclone() -> Packages<'static> {
    Packages {
        names: "cyclonedds",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("cyclonedds"),
        variable: Some("NAVFUSE_CYCLONEDDS_PYTHON"),
        check: "import cyclonedds.idl",
        install: &[&["cyclonedds==11.0.1"]],
    }
}

/// What the vehicle receives while the scenario runs on its topics, an object for each message, and the
/// warnings of the run.
fn received(python: &Path, commands: bool) -> (Vec<Value>, String) {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let samples = folder.path().join("samples.txt");
    std::fs::write(&samples, sentences(&registry)).unwrap();
    // a domain of its own for each test
    let domain = (30 + (std::process::id() + u32::from(commands)) % 70).to_string();
    let live = scenario(
        &registry,
        &format!(
            "[link.vehicle]\ntype = \"ros2\"\ndomain = {domain}\ncommands = {commands}\n\
             sensors.imu = {{ topic = \"/imu/data\" }}\n\
             sensors.gnss = {{ topic = \"/fix\" }}\n\
             sensors.dvl = {{ topic = \"/dvl/twist\", axes = \"flu\" }}\n\
             sensors.depth = {{ topic = \"/pressure\" }}\n\
             [sink.ros2]\ndomain = {domain}\ntf = true\n\
             datum = {{ latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\" }}\n"
        ),
    );
    let assembly = live.assemble_live(Some(folder.path())).unwrap();
    let stop = AtomicBool::new(false);
    let (text, warnings) = scope(|threads| {
        let options = Options { speed: SPEED, ..Options::default() };
        let mut first = Some(assembly);
        let assemble = move || Ok(first.take().unwrap());
        let running = threads.spawn(|| run(assemble, options, &stop, &mut ()).unwrap());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vehicle.py");
        let mut vehicle = Command::new(python);
        vehicle.arg(script).arg(&domain).arg(&samples).arg(SPEED.to_string());
        let text = output(&mut vehicle);
        stop.store(true, Ordering::Relaxed);
        let finished = running.join().unwrap();
        let text = text.unwrap_or_else(|why| panic!("{why}: {:?}", finished.summary.verdict));
        let warning = |event: &Event| format!("{}: {}\n", event.about, event.text);
        (text, finished.events.iter().map(warning).collect())
    });
    (text.lines().map(|line| serde_json::from_str(line).unwrap()).collect(), warnings)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The position and the heading of a pose from the axis x.
fn place(position: &Value, orientation: &Value) -> [f64; 3] {
    let [z, w] = ["z", "w"].map(|part| number(&orientation[part]));
    let yaw = (2.0 * w * z).atan2(w * w - z * z);
    [number(&position["x"]), number(&position["y"]), yaw]
}

#[test]
fn a_vehicle_of_ros_2_is_navigated_by_its_topics_and_receives_the_estimate() {
    let Some(python) = cyclone().python() else { return };
    let (all, warnings) = received(&python, true);
    let of = |topic: &str| all.iter().filter(|m| m["topic"] == topic).collect::<Vec<_>>();
    let [global, local, tf] = [of("global"), of("local"), of("tf")];
    let counts = [global.len(), local.len(), tf.len()];
    assert!(counts.iter().all(|n| *n > 150), "{counts:?}");

    // 2 m/s forward at a heading of 30 deg: in east, north, up that is a yaw of 60 deg
    let last = global[global.len() - 1];
    assert_eq!([&last["header"]["frame_id"], &last["child_frame_id"]], ["map", "base_link"]);
    let twist = &last["twist"]["twist"]["linear"];
    assert!((number(&twist["x"]) - 2.0).abs() < 0.1 && number(&twist["y"]).abs() < 0.2, "{last}");
    let pose = &last["pose"]["pose"];
    let [east, north, yaw] = place(&pose["position"], &pose["orientation"]);
    assert!((yaw.to_degrees() - 60.0).abs() < 5.0, "{last}");
    // 10 m in the run-up, and 40 m
    assert!((east - 50.0 * 0.5).abs() < 6.0 && (north - 50.0 * 0.866).abs() < 6.0, "{last}");
    let sigma = number(&last["pose"]["covariance"][0]).sqrt();
    assert!(sigma > 0.05 && sigma < 3.0, "{sigma}");

    // `odom` in `map` and the body in `odom` are the body in `map`, at each time
    assert_eq!(local[0]["header"]["frame_id"], "odom");
    for message in tf {
        let stamp = &message["transforms"][0]["header"]["stamp"];
        let same = global.iter().find(|m| m["header"]["stamp"] == *stamp);
        let Some(Value::Object(whole)) = same.map(|m| &m["pose"]["pose"]) else { continue };
        let link = |k: usize| {
            let link = &message["transforms"][k];
            assert_eq!(link["child_frame_id"], ["odom", "base_link"][k]);
            place(&link["transform"]["translation"], &link["transform"]["rotation"])
        };
        let ([x, y, turn], [forward, left, _]) = (link(0), link(1));
        let [east, north, _] = place(&whole["position"], &whole["orientation"]);
        let error = (x + turn.cos() * forward - turn.sin() * left - east)
            .hypot(y + turn.sin() * forward + turn.cos() * left - north);
        // roll and pitch of the correction are left out here
        assert!(error < 0.05, "{error}: {message}");
    }

    // the services have the types that other programs know, and do what they are asked for
    let answers = of("answer");
    assert!(answers.len() == 2 && answers.iter().all(|a| a["success"] == true), "{answers:?}");
    for outcome in ["depth is switched off", "the run cannot be saved: it has no folder"] {
        assert!(warnings.contains(outcome), "{warnings}");
    }

    let diagnostics = of("diagnostics");
    assert!((15..50).contains(&diagnostics.len()), "one a second: {}", diagnostics.len());
    let status = diagnostics[diagnostics.len() - 1]["status"].as_array().unwrap();
    for (sensor, least) in [("gnss", 20), ("dvl", 100), ("depth", 80)] {
        let own = status.iter().find(|s| s["name"] == format!("navfuse: {sensor}")).unwrap();
        let used = own["values"].as_array().unwrap().iter().find(|v| v["key"] == "used").unwrap();
        let used: u32 = used["value"].as_str().unwrap().parse().unwrap();
        assert!(used > least, "{own}");
    }
}

#[test]
fn a_run_that_may_not_be_commanded_refuses_with_the_remedy() {
    let Some(python) = cyclone().python() else { return };
    let (all, warnings) = received(&python, false);
    let answers: Vec<_> = all.iter().filter(|m| m["topic"] == "answer").collect();
    assert!(answers.len() == 2 && answers.iter().all(|a| a["success"] == false), "{answers:?}");
    let remedy = "commands are refused: set commands = true in the link";
    assert!(answers.iter().all(|a| a["message"] == remedy), "{answers:?}");
    assert!(warnings.contains("/navfuse/enable_depth: commands are refused"), "{warnings}");
    assert!(!warnings.contains("depth is switched off"), "{warnings}");
}
