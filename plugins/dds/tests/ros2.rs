//! Topics of ROS 2: a vehicle by Cyclone DDS, the middleware of many robots, publishes and receives.
#![cfg(feature = "dds")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_core::document::Document;
use navfuse_core::model::record::Event;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::pass_samples;
use navfuse_core::run::scenario::Scenario;
use navfuse_dds::{DdsPlugin, PlayedTopic, PlayedType};
use navfuse_links::write_sentence;
use navfuse_live::{Options, run};
use navfuse_testing::python::{Packages, output};
use serde_json::{Value, json};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::scope;
use std::time::Duration;

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

/// A domain of its own for each trial.
fn domain() -> String {
    static TRIALS: AtomicU32 = AtomicU32::new(0);
    let domain = std::process::id() * 8 + TRIALS.fetch_add(1, Ordering::Relaxed);
    (30 + domain % 200).to_string()
}

/// A run and what the vehicle does.
struct Trial {
    /// What the vehicle does beside publishing, as `vehicle.py` knows it.
    task: &'static str,
    /// Further keys of the link.
    link: &'static str,
    /// Tables before that of the link.
    tables: &'static str,
    /// Seconds of the run in a second, as the run expects them.
    speed: f64,
}

const COMMANDS: Trial =
    Trial { task: "commands", link: "commands = true\n", tables: "", speed: SPEED };

/// What the vehicle receives while the scenario runs on its topics, an object for each message, and the
/// warnings of the run.
fn received(python: &Path, trial: &Trial) -> (Vec<Value>, String) {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let samples = folder.path().join("samples.txt");
    std::fs::write(&samples, sentences(&registry)).unwrap();
    let domain = domain();
    let Trial { tables, link, .. } = trial;
    let live = scenario(
        &registry,
        &format!(
            "{tables}[link.vehicle]\ntype = \"ros2\"\ndomain = {domain}\n{link}\
             sensors.imu = {{ topic = \"/imu/data\" }}\n\
             sensors.gnss = {{ topic = \"/fix\" }}\n\
             sensors.dvl = {{ topic = \"/dvl/twist\", axes = \"flu\" }}\n\
             sensors.depth = {{ topic = \"/pressure\" }}\n\
             [sink.ros2]\ndomain = {domain}\ntf = true\npose = \"/pose\"\n\
             innovations = \"/innovations\"\n\
             datum = {{ latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\" }}\n"
        ),
    );
    let assembly = live.assemble_live(Some(folder.path())).unwrap();
    let stop = AtomicBool::new(false);
    let (text, warnings) = scope(|threads| {
        let options = Options { speed: trial.speed, ..Options::default() };
        let mut first = Some(assembly);
        // a reset assembles the scenario again
        let (scenario, out) = (&live, folder.path());
        let assemble = move || first.take().map_or_else(|| scenario.assemble_live(Some(out)), Ok);
        let running = threads.spawn(|| run(assemble, options, &stop, &mut ()).unwrap());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vehicle.py");
        let mut vehicle = Command::new(python);
        vehicle.arg(script).arg(&domain).arg(&samples).arg(SPEED.to_string()).arg(trial.task);
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
    let (all, warnings) = received(&python, &COMMANDS);
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

    // the pose alone, for programs that take no odometry
    let poses = of("pose");
    assert!(poses.len() > 150, "{}", poses.len());
    assert!(global.iter().any(|m| m["pose"] == poses[99]["pose"]), "{}", poses[99]);

    // `odom` in `map` and the body in `odom` are the body in `map`, at each time
    assert_eq!(local[0]["header"]["frame_id"], "odom");
    for message in tf {
        let stamp = &message["transforms"][0]["header"]["stamp"];
        // a late fix corrects the estimate of the same time once more
        let same = global.iter().filter(|m| m["header"]["stamp"] == *stamp);
        let wholes: Vec<_> = same.map(|m| &m["pose"]["pose"]).collect();
        if wholes.is_empty() {
            continue;
        }
        let link = |k: usize| {
            let link = &message["transforms"][k];
            assert_eq!(link["child_frame_id"], ["odom", "base_link"][k]);
            place(&link["transform"]["translation"], &link["transform"]["rotation"])
        };
        let ([x, y, turn], [forward, left, _]) = (link(0), link(1));
        let error = |whole: &&Value| {
            let [east, north, _] = place(&whole["position"], &whole["orientation"]);
            (x + turn.cos() * forward - turn.sin() * left - east)
                .hypot(y + turn.sin() * forward + turn.cos() * left - north)
        };
        let error = wholes.iter().map(error).fold(f64::INFINITY, f64::min);
        // roll and pitch of the correction are left out here
        assert!(error < 0.05, "{error}: {message}");
    }

    // the services have the types that other programs know, and do what they are asked for
    let answers = of("answer");
    assert!(answers.len() == 2 && answers.iter().all(|a| a["success"] == true), "{answers:?}");
    for outcome in ["depth is switched off", "the run cannot be saved: it has no folder"] {
        assert!(warnings.contains(outcome), "{warnings}");
    }

    // a subscriber whose quality of service nobody offers receives nothing, and is reported
    assert!(of("mismatch").is_empty());
    let diagnostics = of("diagnostics");
    assert!((15..50).contains(&diagnostics.len()), "one a second: {}", diagnostics.len());
    let status = diagnostics[diagnostics.len() - 1]["status"].as_array().unwrap();
    let topics = status.iter().find(|s| s["name"] == "navfuse: topics");
    let topics = topics.unwrap_or_else(|| panic!("{status:?}"));
    assert_eq!(topics["values"][0]["value"], "Durability", "{topics}");
    for (sensor, least) in [("gnss", 20), ("dvl", 100), ("depth", 80)] {
        let own = status.iter().find(|s| s["name"] == format!("navfuse: {sensor}")).unwrap();
        let used = own["values"].as_array().unwrap().iter().find(|v| v["key"] == "used").unwrap();
        let used: u32 = used["value"].as_str().unwrap().parse().unwrap();
        assert!(used > least, "{own}");
    }
}

#[test]
fn each_use_of_a_measurement_is_a_record_that_a_plot_shows() {
    let Some(python) = cyclone().python() else { return };
    let (all, _) = received(&python, &COMMANDS);
    let records: Vec<_> = all.iter().filter(|m| m["topic"] == "innovations").collect();
    let of = |name: &str| {
        let statuses = records.iter().map(|m| &m["status"][0]);
        statuses.filter(|s| s["name"] == format!("navfuse: {name}")).collect::<Vec<_>>()
    };
    // 30 s with 1, 5 and 4 samples a second, of which some are lost on purpose
    for (sensor, least, channels) in [("gnss", 20, 3), ("dvl", 100, 3), ("depth", 80, 1)] {
        let own = of(sensor);
        assert!(own.len() > least, "{sensor}: {}", own.len());
        let used: Vec<_> = own.iter().filter(|s| s["message"] == "accepted").collect();
        assert!(used.len() > least, "{sensor}: {:?}", own[0]);
        for status in used {
            let values = status["values"].as_array().unwrap();
            let of = |kind: &str| {
                let named = values.iter().filter(|v| v["key"].as_str().unwrap().starts_with(kind));
                named.map(|v| v["value"].as_str().unwrap().parse().unwrap()).collect::<Vec<f64>>()
            };
            let (nis, innovations, sigmas) = (of("NIS"), of("innovation "), of("sigma "));
            assert_eq!([nis.len(), innovations.len(), sigmas.len()], [1, channels, channels]);
            // one channel alone has the NIS of its own sigma
            let ratio = innovations[0] / sigmas[0];
            assert!(channels > 1 || (ratio * ratio - nis[0]).abs() < 1e-9, "{status}");
        }
    }
}

#[test]
fn a_run_that_may_not_be_commanded_refuses_with_the_remedy() {
    let Some(python) = cyclone().python() else { return };
    let (all, warnings) = received(&python, &Trial { link: "", ..COMMANDS });
    let answers: Vec<_> = all.iter().filter(|m| m["topic"] == "answer").collect();
    assert!(answers.len() == 2 && answers.iter().all(|a| a["success"] == false), "{answers:?}");
    let remedy = "commands are refused: set commands = true in the link";
    assert!(answers.iter().all(|a| a["message"] == remedy), "{answers:?}");
    assert!(warnings.contains("/navfuse/enable_depth: commands are refused"), "{warnings}");
    assert!(!warnings.contains("depth is switched off"), "{warnings}");
}

/// An operator: a receiver that the filter obeys, on the topic and the service of robot_localization.
const OPERATOR: &str = "[sensor.operator]\ntype = \"gnss\"\nhorizontal_noise = \"5 m\"\n\
                        vertical_noise = \"5 m\"\nlate = \"5 s\"\nrecovery = { action = \"obey\" }\n";

#[test]
fn a_lifecycle_manager_activates_the_node_and_an_operator_sets_the_pose() {
    let Some(python) = cyclone().python() else { return };
    let link = "commands = true\nautostart = false\n\
                sensors.operator = { topic = \"/set_pose\", \
                datum = { latitude = \"43 deg\", longitude = \"5 deg\", height = \"0 m\" } }\n";
    let trial = Trial { task: "manage", link, tables: OPERATOR, speed: f64::INFINITY };
    let (all, warnings) = received(&python, &trial);
    let answers: Vec<_> = all.iter().filter(|m| m["topic"] == "answer").collect();
    let answer = |k: usize| answers.get(k).unwrap_or_else(|| panic!("{answers:?} {warnings}"));
    assert_eq!(answer(0)["current_state"]["label"], "unconfigured");
    assert_eq!([1, 2, 3].map(|k| answer(k)["success"].as_bool().unwrap()), [false, true, true]);
    assert_eq!(answer(4)["current_state"], json!({ "id": 3, "label": "active" }));
    assert_eq!(answer(5)["success"], true, "the receiver is off");
    assert_eq!(answer(6)["service"], "set_pose");
    assert_eq!(answer(7)["success"], true, "deactivated");
    assert_eq!(answer(8)["available_states"].as_array().unwrap().len(), 4);
    assert_eq!(answer(9)["available_transitions"].as_array().unwrap().len(), 7);
    assert!(
        warnings.contains("no transition 3 \"\" leaves the state \"unconfigured\""),
        "{warnings}"
    );

    // it is active from 10 to 30 s of the dive
    let odometry: Vec<_> = all.iter().filter(|m| m["topic"] == "global").collect();
    let time = |m: &Value| number(&m["header"]["stamp"]["sec"]);
    let span = [odometry[0], odometry[odometry.len() - 1]].map(time);
    assert!(span[0] >= 9.0 && span[0] < 13.0 && span[1] > 25.0 && span[1] < 32.0, "{span:?}");
    // at 16 s the vehicle is put 500 m to the east and 300 m to the south, and goes on from there
    let at = |second: f64| {
        let message = odometry.iter().rev().find(|m| time(m) <= second).unwrap();
        let position = &message["pose"]["pose"]["position"];
        ([number(&position["x"]), number(&position["y"])], message)
    };
    let ([east, north], message) = at(18.0);
    assert!((east - 500.0).hypot(north + 300.0) < 30.0, "{message} {warnings}");
    let sigma = number(&message["pose"]["covariance"][0]).sqrt();
    assert!((1.0..10.0).contains(&sigma), "{sigma}");
}

#[test]
fn a_simulation_whose_time_goes_back_begins_the_run_anew() {
    let Some(python) = cyclone().python() else { return };
    let link = "use_sim_time = true\n";
    let trial = Trial { task: "clock", link, tables: "", speed: f64::INFINITY };
    let (all, warnings) = received(&python, &trial);
    let stamps: Vec<f64> = all
        .iter()
        .filter(|m| m["topic"] == "global")
        .map(|m| number(&m["header"]["stamp"]["sec"]))
        .collect();
    let back = stamps.windows(2).filter(|w| w[1] < w[0]).count();
    assert_eq!(back, 1, "{stamps:?} {warnings}");
    // a busy computer loses messages of sensors, which nobody sends again
    assert!(stamps.iter().any(|s| *s > 20.0) && stamps[stamps.len() - 1] > 3.0, "{stamps:?}");
}

#[test]
fn a_node_that_nobody_can_activate_is_refused() {
    let registry = registry();
    let link = "[link.vehicle]\ntype = \"ros2\"\nautostart = false\n\
                sensors.imu = { topic = \"/imu/data\" }\n";
    let Err(error) = scenario(&registry, link).assemble_live(None) else { panic!("it is opened") };
    let text = error.to_string();
    assert!(text.contains("no lifecycle manager can activate the node"), "{text}");
}

/// The dive as `navfuse play` sends it: the drivers' messages, whose axes are forward, left, up.
#[test]
fn a_recording_that_is_played_to_topics_is_navigated_as_it_was() {
    let registry = registry();
    let domain = domain();
    let live = scenario(
        &registry,
        &format!(
            "[link.vehicle]\ntype = \"ros2\"\ndomain = {domain}\n\
             sensors.imu = {{ topic = \"/imu/data\" }}\nsensors.gnss = {{ topic = \"/fix\" }}\n\
             sensors.dvl = {{ topic = \"/dvl/twist\", axes = \"flu\" }}\n\
             sensors.depth = {{ topic = \"/pressure\" }}\n"
        ),
    );
    let offline = scenario(&registry, "").assemble(None).unwrap();
    let infos: Vec<_> = offline.composition.sensors.iter().map(|s| s.info.clone()).collect();
    let kinds =
        [("imu", "/imu/data"), ("fix", "/fix"), ("twist", "/dvl/twist"), ("pressure", "/pressure")];
    let mut topics: Vec<Option<PlayedTopic>> = infos
        .iter()
        .map(|info| {
            let k = ["imu", "gnss", "dvl", "depth"].iter().position(|name| *name == info.name)?;
            let kind = PlayedType::ALL.into_iter().find(|(name, _)| *name == kinds[k].0).unwrap().1;
            Some(PlayedTopic::open(kind, kinds[k].1, domain.parse().ok()).unwrap())
        })
        .collect();
    let stop = AtomicBool::new(false);
    let finished = scope(|threads| {
        let options = Options { speed: f64::INFINITY, ..Options::default() };
        let running =
            threads.spawn(|| run(|| live.assemble_live(None), options, &stop, &mut ()).unwrap());
        // the link finds the topics
        std::thread::sleep(Duration::from_secs(5));
        pass_samples(offline, |sample| {
            if let Some(topic) = &mut topics[sample.sensor.0] {
                topic.send(&infos[sample.sensor.0], sample).unwrap();
                std::thread::sleep(Duration::from_micros(500));
            }
            true
        })
        .unwrap();
        std::thread::sleep(Duration::from_secs(1));
        stop.store(true, Ordering::Relaxed);
        running.join().unwrap()
    });
    let summary = &finished.summary;
    // 2 m/s along 30 deg
    let velocity = &summary.states["ins.velocity"]["estimate"];
    let error = (number(&velocity[0]) - 1.732).hypot(number(&velocity[1]) - 1.0);
    assert!(error < 0.1, "{velocity} {:?}", summary.samples);
    let used = |sensor: &str| summary.samples[sensor]["accepted"].as_u64().unwrap();
    assert!(used("gnss") > 25 && used("dvl") > 150 && used("depth") > 120, "{:?}", summary.samples);
}
