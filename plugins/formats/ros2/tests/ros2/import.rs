//! A bag becomes a scenario that runs, with the topics, lever arms and mountings of the bag.

use crate::recorder::{Imu, Raw, mcap, number, odometry, pressure, raw, rolled, twist, usual};
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
    let answers = Answers { name: "bag".into(), position, odometry, ..Answers::default() };
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
fn stamps_of_several_clocks_are_replaced_by_the_times_of_receiving() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    // a driver that sets no stamp, and a computer whose clock is an hour and a half late
    let still: Vec<Imu> =
        usual(3000).iter().map(|m| Imu { rate: 4.3e-5, stamp: 0, ..*m }).collect();
    let poses = still.iter().step_by(10).map(|m| {
        let late = m.received - 5_000_000_000_000;
        let mut pose = odometry(late, [1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0]);
        pose.received = m.received;
        pose
    });
    let mut messages: Vec<Raw> = still.iter().map(Raw::from).chain(poses).collect();
    messages.sort_by_key(|m| m.received);
    std::fs::write(&bag, raw(&messages, None, Some(4096))).unwrap();
    let found = imported(&bag).unwrap();
    for sensor in ["imu", "reference"] {
        let keys = table(&found.scenario, &format!("source.ros2.sensors.{sensor}"));
        assert!(keys.contains("stamp = \"receive\""), "{keys}");
    }
    let asked = "all stamps of /odom are not on the clock of the others";
    assert!(found.questions.iter().any(|q| q.contains(asked)), "{:?}", found.questions);
    assert!(!found.notes.iter().any(|n| n.contains("no time in common")), "{:?}", found.notes);
}

#[test]
fn the_pressure_is_the_water_s_and_a_topic_without_a_number_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    let still: Vec<Imu> = usual(3000).iter().map(|m| Imu { rate: 4.3e-5, ..*m }).collect();
    for (pascals, used) in [(120_000.0, true), (f64::NAN, false)] {
        let leak = still.iter().step_by(5).map(|m| pressure("/leak", m.received, 98_000.0));
        let water = still.iter().step_by(10).map(|m| pressure("/pressure", m.received, pascals));
        let mut messages: Vec<Raw> = still.iter().map(Raw::from).chain(leak).chain(water).collect();
        messages.sort_by_key(|m| m.received);
        std::fs::write(&bag, raw(&messages, None, Some(4096))).unwrap();
        let found = imported(&bag).unwrap();
        assert_eq!(found.scenario.contains("topic = \"/pressure\""), used, "{}", found.scenario);
        assert!(!found.scenario.contains("topic = \"/leak\""), "{}", found.scenario);
        let note = found.notes.iter().any(|n| n.contains("has no valid sample for it: left out"));
        assert_eq!(note, !used, "{:?}", found.notes);
    }
}

/// A twist whose topic names a log, or an odometry that never moves and does so, is its velocity, and the number of a
/// topic that is called depth is a depth; other twists and numbers are none.
#[test]
fn a_twist_an_odometry_and_a_number_are_a_log_and_a_depth_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    let still: Vec<Imu> = usual(3000).iter().map(|m| Imu { rate: 4.3e-5, ..*m }).collect();
    let slow = || still.iter().step_by(20).map(|m| m.received);
    let fixed = |topic, t| odometry(t, [0.0; 3], [0.0, 0.0, 0.0, 1.0]).on(topic);
    let logs: [(Vec<Raw>, bool); 4] = [
        (slow().map(|t| twist("/auv/bottom_track", t, 1.0)).collect(), true),
        (slow().map(|t| twist("/cmd_vel_stamped", t, 1.0)).collect(), false),
        (slow().map(|t| fixed("/dvl/odom", t)).collect(), true),
        (slow().map(|t| fixed("/odom", t)).collect(), false),
    ];
    for ((log, is_log), topic) in
        logs.into_iter().zip(["/auv/depth", "/auv/voltage"].iter().cycle())
    {
        let numbers = slow().map(|t| number(topic, t + 1, 12.0));
        let mut messages: Vec<Raw> =
            still.iter().map(Raw::from).chain(log).chain(numbers).collect();
        messages.sort_by_key(|m| m.received);
        std::fs::write(&bag, raw(&messages, None, Some(4096))).unwrap();
        let found = imported(&bag).unwrap();
        assert_eq!(found.scenario.contains("[sensor.dvl]"), is_log, "{}", found.scenario);
        let depth = found.streams.iter().find(|s| s.sensor == "depth");
        let is_depth = *topic == "/auv/depth";
        assert_eq!(depth.is_some(), is_depth, "{}", found.scenario);
        assert!(depth.is_none_or(|s| s.samples == 150 && s.mean[0] == 12.0), "{depth:?}");
    }
}

#[test]
fn rates_in_degrees_are_found_by_the_attitude_in_the_same_messages() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("bag.mcap");
    let rolling = |unit: f64| -> Vec<Raw> {
        let of = |m: &Imu| {
            // 0.3 rad of roll and of pitch, at 1 rad/s
            let t = (m.received - usual(1)[0].received) as f64 * 1e-9;
            rolled(m, [0.3 * t.sin(), 0.3 * t.cos()], [0.3 * t.cos() * unit, -0.3 * t.sin() * unit])
        };
        usual(3000).iter().map(of).collect()
    };
    for (unit, scaled) in [(1_f64.to_degrees(), true), (1.0, false)] {
        std::fs::write(&bag, raw(&rolling(unit), None, Some(4096))).unwrap();
        let found = imported(&bag).unwrap();
        let factor = found.scenario.contains("samples = { factor = { gyro_x = 0.01745");
        assert_eq!(factor, scaled, "{}", found.scenario);
    }
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
