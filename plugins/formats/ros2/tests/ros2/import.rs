//! A bag becomes a scenario that runs, with the topics, lever arms and mountings of the bag.

use crate::recorder::{Imu, Raw, mcap, odometry, raw, usual};
use crate::registry;
use navfuse_core::document::Document;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_import::{Answers, Imported, OdometryUse, import};
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn imported(bag: &Path) -> Result<Imported, String> {
    imported_with(bag, None)
}

fn imported_with(bag: &Path, odometry: Option<OdometryUse>) -> Result<Imported, String> {
    let scenario = bag.with_file_name("imported.toml");
    let position = Some([54.0, 10.0, 0.0]);
    let answers = Answers { name: "bag".into(), position, odometry };
    let stop = AtomicBool::new(false);
    let found = import(&registry(), &[bag.to_owned()], &scenario, &answers, &stop);
    found.map(|found| found.expect("nothing stops it")).map_err(|e| e.to_string())
}

/// The table of a sensor in a scenario.
fn table<'a>(text: &'a str, name: &str) -> &'a str {
    let from = text.find(&format!("[{name}]")).unwrap_or_else(|| panic!("{name}: {text}"));
    let rest = &text[from + 1..];
    &rest[..rest.find("\n[").unwrap_or(rest.len())]
}

/// Checks the scenario of a bag of the other program, which has `/tf_static`.
pub fn frames_of_the_bag(bag: &Path) {
    let found = imported(bag).unwrap_or_else(|e| panic!("{e}"));
    let text = &found.scenario;
    for (sensor, topic) in
        [("imu", "/imu"), ("dvl", "/dvl"), ("depth", "/pressure"), ("gnss", "/fix")]
    {
        let keys = table(text, &format!("source.ros2.sensors.{sensor}"));
        // every fourth velocity log has as many messages: the first is as good
        let others = ["/a50", "/nucleus"].map(|t| format!("topic = {t:?}"));
        let right = keys.contains(&format!("topic = {topic:?}"))
            || sensor == "dvl" && others.iter().any(|other| keys.contains(other));
        assert!(right, "{keys}");
    }
    assert!(table(text, "source.ros2.sensors.gnss").contains("more = [\"/vel\"]"), "{text}");
    // from the IMU, forward, right, down
    let arm = "lever_arm = [\"-0.1 m\", \"-0.5 m\", \"-1.5 m\"]  # of /tf_static";
    assert!(table(text, "sensor.gnss").contains(arm), "{text}");
    // an odometry beside GNSS is a sensor of the motion between its messages
    let sensor = table(text, "sensor.odometry");
    let arm = "lever_arm = [\"0.2 m\", \"0 m\", \"0 m\"]  # of /tf_static";
    assert!(sensor.contains("type = \"relative-pose\"") && sensor.contains(arm), "{text}");
    let keys = table(text, "source.ros2.sensors.odometry");
    assert!(keys.contains("topic = \"/odom\"") && keys.contains("--odometry reference"), "{keys}");
    let notes = found.notes.join("\n");
    for words in ["several topics of type", "/imu: received 0.00", "topics that are not used: "] {
        assert!(notes.contains(words), "{notes}");
    }
}

#[test]
fn an_odometry_is_the_reference_or_a_sensor_as_asked() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    let still: Vec<Imu> = usual(3000).iter().map(|m| Imu { rate: 4.3e-5, ..*m }).collect();
    let poses = still.iter().step_by(10);
    let poses = poses.map(|m| odometry(m.stamp, [1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0]));
    let mut messages: Vec<Raw> = still.iter().map(Raw::from).chain(poses).collect();
    messages.sort_by_key(|m| m.received);
    std::fs::write(&bag, raw(&messages, None, Some(4096))).unwrap();
    let found = imported(&bag).unwrap();
    assert!(found.scenario.contains("[sensor.reference]"), "{}", found.scenario);
    let question = found.questions.iter().find(|q| q.starts_with("reference: ")).unwrap();
    assert!(question.contains("--odometry relative-pose"), "{question}");
    let found = imported_with(&bag, Some(OdometryUse::RelativePose)).unwrap();
    assert!(!found.scenario.contains("[sensor.reference]"), "{}", found.scenario);
    let odometry = found.streams.iter().find(|s| s.sensor == "odometry").unwrap();
    assert_eq!(odometry.samples, 299);
    let name = folder.path().join("imported.toml").display().to_string();
    let document = Document::parse(name, found.scenario).unwrap();
    let registry = registry();
    let wide = ["process.ins.alignment.heading_gate='60 deg'".to_owned()];
    let scenario = Scenario::new(&registry, document, &wide).unwrap();
    let finished = runner::run(scenario.assemble(None).unwrap(), &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let counts = &finished.summary.samples["odometry"];
    assert!(counts["accepted"].as_u64() > Some(0), "{counts}");
}

#[test]
fn a_bag_of_two_imus_becomes_a_scenario_that_runs() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    let still: Vec<Imu> = usual(3000).iter().map(|m| Imu { rate: 4.3e-5, ..*m }).collect();
    let slow = still.iter().step_by(2).map(|m| Imu { topic: "/slow", ..*m });
    let mut messages: Vec<Imu> = still.iter().copied().chain(slow).collect();
    messages.sort_by_key(|m| m.received);
    std::fs::write(&bag, mcap(&messages, None, Some(4096))).unwrap();
    let found = imported(&bag).unwrap();
    assert!(found.notes.iter().any(|n| n.contains("not /slow (50.0 Hz)")), "{:?}", found.notes);
    assert_eq!((found.streams[0].samples, found.streams[0].rate().round()), (3000, 100.0));
    let name = folder.path().join("imported.toml").display().to_string();
    let document = Document::parse(name, found.scenario).unwrap();
    let registry = registry();
    // 30 s at rest give the heading to some 50 deg with the noise that the import assumes
    let wide = ["process.ins.alignment.heading_gate='60 deg'".to_owned()];
    let scenario = Scenario::new(&registry, document, &wide).unwrap();
    let stop = AtomicBool::new(false);
    let finished = runner::run(scenario.assemble(None).unwrap(), &stop, |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    // without a stamp, the time of receiving; axes that are not those of ROS are found by gravity
    for m in &mut messages {
        m.stamp = 0;
    }
    std::fs::write(&bag, mcap(&messages, None, Some(4096))).unwrap();
    let found = imported(&bag).unwrap();
    assert!(found.scenario.contains("stamp = \"receive\""), "{}", found.scenario);
    assert!(found.questions.iter().any(|q| q.contains("all stamps of /imu are zero")));
}
