//! The source in a scenario: topics, clocks, and errors with remedies.

use crate::recorder::{Imu, mcap, usual};
use crate::{Read, read};

const IMU: &str = "path = \"bag.mcap\"\nsensors.imu = { topic = \"/imu\" }\n";
const SECOND: i64 = 1_000_000_000;

fn from(messages: &[Imu], keys: &str) -> Result<Read, String> {
    let folder = tempfile::tempdir().unwrap();
    let bytes = mcap(messages, Some(mcap::Compression::Zstd), Some(4096));
    std::fs::write(folder.path().join("bag.mcap"), bytes).unwrap();
    read(folder.path(), "", keys)
}

fn rates(read: &Read) -> Vec<i64> {
    read.samples["imu"].iter().map(|(_, v)| v["gyro_x"] as i64).collect()
}

#[test]
fn one_of_two_imus_is_chosen_by_its_topic() {
    let mut messages = usual(20);
    for k in 0..20 {
        messages.push(Imu { topic: "/other", rate: 100.0 + k as f64, ..messages[k] });
    }
    messages.sort_by_key(|m| m.received);
    assert_eq!(rates(&from(&messages, IMU).unwrap()), (0..20).collect::<Vec<_>>());
    let other = IMU.replace("/imu", "/other");
    assert_eq!(rates(&from(&messages, &other).unwrap()), (100..120).collect::<Vec<_>>());
}

#[test]
fn stamps_of_zero_are_reported_and_the_others_are_used() {
    let mut messages = usual(20);
    (messages[7].stamp, messages[9].stamp) = (0, 0);
    let found = from(&messages, IMU).unwrap();
    assert_eq!(found.count("imu"), 18);
    let words = "/imu: 2 messages left out without a valid time";
    assert!(found.warning().contains(words), "{}", found.warning());
    // without any stamp, the time of receiving remains
    messages.iter_mut().for_each(|m| m.stamp = 0);
    let error = from(&messages, IMU).unwrap_err();
    assert!(error.contains("20 messages left out without a valid time"), "{error}");
    let found = from(&messages, &format!("{IMU}stamp = \"receive\"\n")).unwrap();
    assert_eq!((found.count("imu"), found.warning), (20, None));
}

#[test]
fn a_clock_that_steps_costs_the_samples_between_and_is_reported() {
    // back by one second after the first half: the samples until then are seen already
    let mut messages = usual(400);
    messages[200..].iter_mut().for_each(|m| m.stamp -= SECOND);
    let found = from(&messages, IMU).unwrap();
    assert_eq!(rates(&found), (0..200).chain(300..400).collect::<Vec<_>>());
    let words = "/imu: 100 messages left out, not later than the one before";
    assert!(found.warning().contains(words), "{}", found.warning());
    // forward by an hour
    let mut messages = usual(400);
    messages[200..].iter_mut().for_each(|m| m.stamp += 3600 * SECOND);
    let found = from(&messages, IMU).unwrap();
    assert_eq!(found.count("imu"), 400);
    for words in ["1 message after a gap or a step of the clock", "received -1799.998"] {
        assert!(found.warning().contains(words), "{}", found.warning());
    }
}

#[test]
fn the_clock_of_the_run_begins_at_the_origin() {
    let origin = format!("{IMU}time = {{ origin = \"2023-11-14T22:13:00Z\" }}\n");
    let found = from(&usual(3), &origin).unwrap();
    let times: Vec<i64> = found.samples["imu"].iter().map(|(t, _)| t / 1_000_000).collect();
    assert_eq!(times, [20_000, 20_010, 20_020]);
}

#[test]
fn vectors_are_turned_by_the_mounting_of_the_sensor() {
    // the sensor is turned by 90 degrees to the right: its forward is the right of the vehicle
    let turned = IMU.replace(" }", ", rotation = [\"0 deg\", \"0 deg\", \"90 deg\"] }");
    let found = from(&usual(3), &turned).unwrap();
    let last = &found.samples["imu"][2].1;
    assert!((last["gyro_y"] - 2.0).abs() < 1e-12 && last["gyro_x"].abs() < 1e-12, "{last:?}");
    assert!((last["accel_z"] + 9.81).abs() < 1e-12);
    let frd = IMU.replace(" }", ", axes = \"frd\" }");
    let found = from(&usual(3), &frd).unwrap();
    assert_eq!(found.samples["imu"][2].1["accel_z"], 9.81);
}

#[test]
fn what_does_not_fit_is_an_error_with_a_remedy() {
    let messages = usual(5);
    let keys = |text: &str| format!("path = \"bag.mcap\"\n{text}\n");
    for (text, words) in [
        (keys("sensors.imu = { topic = \"/no\" }"), "topics of the bag: /imu (sensor_msgs/msg/Imu)"),
        (keys("sensors.imuu = { topic = \"/imu\" }"), "did you mean \"imu\"?"),
        (keys("sensors.imu = {}"), "sensors.imu: it needs a topic"),
        (keys("sensors = {}"), "name them, such as sensors.imu"),
        (keys("sensors.imu = { topic = \"/imu\", channels.gyro = { field = \"x\" } }"), "gyro_x"),
        (
            keys("sensors.imu = { topic = \"/imu\", channels.gyro_x = { field = \"angular.x\" } }"),
            "has no field \"angular\"; it has header, orientation",
        ),
        (
            keys(
                "sensors.imu = { topic = \"/imu\", channels.gyro_x = { field = \
                 \"angular_velocity.x\", unit = \"m\" } }",
            ),
            "\"m\" is no unit of the channel, gyro_x_radps",
        ),
        (keys("sensors.imu = { topic = \"/imu\" }\nwait = \"-1 s\""), "source.ros2.wait = \"-1 s\": it is"),
        (
            "path = \"no.mcap\"\nsensors.imu = { topic = \"/imu\" }".to_owned(),
            "no.mcap: cannot be opened",
        ),
        (
            "path = \".\"\nsensors.imu = { topic = \"/imu\" }\ntime = { first_day = \"2023-01-01\" }"
                .to_owned(),
            "a bag has dates of its own",
        ),
        (
            "path = \"test.txt\"\nsensors.imu = { topic = \"/imu\" }".to_owned(),
            "test.txt: cannot be opened",
        ),
    ] {
        let error = from(&messages, &text).unwrap_err();
        assert!(error.contains(words), "{words}: {error}");
    }
    let folder = tempfile::tempdir().unwrap();
    for (name, content, words) in [
        ("text.mcap", "not a bag", "neither MCAP nor SQLite"),
        ("empty.db3", "", "the file is empty"),
        ("short.db3", "SQLite format 3\0", "whose header is damaged"),
    ] {
        std::fs::write(folder.path().join(name), content).unwrap();
        let keys = format!("path = {name:?}\nsensors.imu = {{ topic = \"/imu\" }}");
        let error = read(folder.path(), "", &keys).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    let error = read(folder.path(), "", "path = \"bag\"\nsensors.imu = { topic = \"/imu\" }");
    assert!(error.unwrap_err().contains("has no file .mcap, .db3 or .bag"));
}
