//! Every message, read back by the definition that stands in the log.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::fixture::{self, ATTITUDE, ORIGIN, VELOCITY};
use common::{Logged, float, floats, number, read};
use navfuse_core::model::record::{
    Epoch, Event, Level, Outcome, Record, Rejection, Truth, UpdateRecord,
};
use navfuse_core::model::stream::Sink;
use navfuse_core::nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_mcap::{Compression, McapSink, read_scenario};
use serde_json::{Value, json};

const NOW: Time = Time::from_nanos(12_000_000_345);

/// What a log holds after `tell`, but for the health of the sensors, which has tests of its own.
fn logged(tell: impl FnOnce(&mut McapSink)) -> Vec<Logged> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::Zstd);
    tell(&mut sink);
    assert_eq!(sink.finish().unwrap(), Some(path.display().to_string()));
    read(&path).into_iter().filter(|m| !m.topic.starts_with("/health/")).collect()
}

fn header(frame: &str) -> Value {
    json!({ "stamp": { "sec": 12, "nanosec": 345 }, "frame_id": format!("s:{frame}") })
}

fn xyz(v: [f64; 3]) -> Value {
    json!({ "x": float(v[0]), "y": float(v[1]), "z": float(v[2]) })
}

#[test]
fn an_imu_in_rates_is_a_sensor_msgs_imu_without_orientation() {
    let values = [0.1, -0.2, 0.3, 4.0, -5.0, 9.8];
    let log =
        logged(|sink| sink.take(&Record::Sample(&Sample::new(NOW, SensorId(0), &values))).unwrap());
    assert_eq!(log.len(), 1);
    assert_eq!(
        (log[0].topic.as_str(), log[0].schema.as_str()),
        ("/sensor/imu", "sensor_msgs/msg/Imu")
    );
    assert_eq!((log[0].log_time, log[0].publish_time), (12_000_000_345, 12_000_000_345));
    let unknown = floats(&[0.0; 9]);
    let mut none = [0.0; 9];
    none[0] = -1.0;
    let expected = json!({
        "header": header("base_link_frd"),
        "orientation": { "x": float(0.0), "y": float(0.0), "z": float(0.0), "w": float(1.0) },
        "orientation_covariance": floats(&none),
        "angular_velocity": xyz([0.1, -0.2, 0.3]),
        "angular_velocity_covariance": unknown,
        "linear_acceleration": xyz([4.0, -5.0, 9.8]),
        "linear_acceleration_covariance": unknown,
    });
    assert_eq!(log[0].fields, expected);
}

#[test]
fn a_sample_names_its_channels_and_which_of_them_are_there() {
    let mut sample = Sample::new(NOW, SensorId(1), &[1.0, 2.0, 3.0]);
    sample.clear(1);
    let log = logged(|sink| sink.take(&Record::Sample(&sample)).unwrap());
    assert_eq!(
        (log[0].topic.as_str(), log[0].schema.as_str()),
        ("/sensor/dvl", "navfuse_msgs/msg/Sample")
    );
    let expected = json!({
        "header": header("dvl"),
        "channels": ["s:vel_x_mps", "s:vel_y_mps", "s:vel_z_mps"],
        "values": floats(&[1.0, 0.0, 3.0]),
        "present": 5,
    });
    assert_eq!((log.len(), &log[0].fields), (1, &expected));
}

#[test]
fn a_depth_is_also_a_pressure_of_sea_water_under_the_atmosphere() {
    let log = logged(|sink| {
        sink.take(&Record::Sample(&Sample::new(NOW, SensorId(2), &[10.0]))).unwrap();
        sink.take(&Record::Sample(&Sample::empty(NOW, SensorId(2)))).unwrap();
    });
    let topics: Vec<&str> = log.iter().map(|m| m.topic.as_str()).collect();
    assert_eq!(topics, ["/sensor/depth", "/sensor/depth/pressure", "/sensor/depth"]);
    assert_eq!(log[1].schema, "sensor_msgs/msg/FluidPressure");
    assert_eq!(log[1].fields["header"], header("base_link_frd"));
    // 101325 Pa + 1025 kg/m^3 9.80665 m/s^2 10 m = 201843.1625 Pa; half an ulp of a double is
    // 1.5e-11 there
    assert!((number(&log[1].fields["fluid_pressure"]) - 201_843.162_5).abs() < 1e-9);
}

#[test]
fn a_reference_is_also_a_fix_in_degrees() {
    let values = [0.5, -1.0, 20.0, 0.1];
    let log =
        logged(|sink| sink.take(&Record::Sample(&Sample::new(NOW, SensorId(3), &values))).unwrap());
    let topics: Vec<&str> = log.iter().map(|m| m.topic.as_str()).collect();
    assert_eq!(topics, ["/sensor/truth", "/reference/truth/fix"]);
    let expected = json!({
        "header": header("base_link_frd"),
        "status": { "status": 0, "service": 0 },
        "latitude": float(0.5_f64.to_degrees()),
        "longitude": float((-1.0_f64).to_degrees()),
        "altitude": float(20.0),
        "position_covariance": floats(&[0.0; 9]),
        "position_covariance_type": 0,
    });
    assert_eq!((log[1].schema.as_str(), &log[1].fields), ("sensor_msgs/msg/NavSatFix", &expected));
}

#[test]
fn an_epoch_tells_pose_velocity_and_every_block() {
    let layout = fixture::layout();
    let p = fixture::covariance();
    let known = [true, false, true, true, false];
    let truth = fixture::state(&layout, NOW, 95.0);
    let log = logged(|sink| {
        for (north, time) in [(0.0, Time::default()), (100.0, NOW)] {
            let state = fixture::state(&layout, time, north);
            let truth = (north > 0.0).then_some(Truth { state: &truth, known: &known });
            sink.take(&Record::Epoch(&Epoch {
                layout: &layout,
                state: &state,
                covariance: &p,
                truth,
            }))
            .unwrap();
        }
    });
    // shown.rs tests the topics that nothing reads again
    let shown = ["/path", "/markers", "/reference/odometry"];
    let log: Vec<_> =
        log.into_iter().filter(|m| !shown.iter().any(|end| m.topic.ends_with(end))).collect();
    // the first epoch has the frames that do not change as well
    let (_, log) = log.split_at(log.len().div_ceil(2));
    let topics: Vec<(&str, &str)> =
        log.iter().map(|m| (m.topic.as_str(), m.schema.as_str())).collect();
    let block = "navfuse_msgs/msg/BlockState";
    let expected = [
        ("/estimate/odometry", "nav_msgs/msg/Odometry"),
        ("/estimate/fix", "sensor_msgs/msg/NavSatFix"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
        ("/state/ins/attitude", block),
        ("/state/ins/velocity", block),
        ("/state/ins/position", block),
        ("/state/dvl/scale", block),
        ("/state/dvl/lever_arm", block),
    ];
    assert_eq!(topics, expected);

    let pose = &log[0].fields["pose"]["pose"];
    // displaced() and ned_from() are inverse to each other up to rounding: an angle of 0.6 rad has
    // an ulp of 1.1e-16 rad, times 6.4e6 m
    assert!((number(&pose["position"]["x"]) - 100.0).abs() < 3e-9);
    // down counts from height zero
    let [east, down] = ["y", "z"].map(|axis| number(&pose["position"][axis]));
    assert_eq!((east, down), (0.0, -ORIGIN.height));
    let q = UnitQuaternion::from_euler_angles(ATTITUDE[0], ATTITUDE[1], ATTITUDE[2]);
    let orientation = json!({ "x": float(q.i), "y": float(q.j), "z": float(q.k), "w": float(q.w) });
    assert_eq!(pose["orientation"], orientation);
    let transform = &log[2].fields["transforms"][0];
    assert_eq!(transform["header"], header("ned"));
    assert_eq!(transform["child_frame_id"], "s:base_link_frd");
    assert_eq!(
        (&transform["transform"]["translation"], &transform["transform"]["rotation"]),
        (&pose["position"], &orientation)
    );
    // the tangent: attitude 0..3, velocity 3..6, position 6..9
    let order = [6, 7, 8, 0, 1, 2];
    let joint: Vec<f64> = order.iter().flat_map(|i| order.map(|j| p.get(*i, j))).collect();
    assert_eq!(log[0].fields["pose"]["covariance"], floats(&joint));

    let twist = &log[0].fields["twist"];
    let v = q.inverse() * Vector3::from(VELOCITY);
    let linear = ["x", "y", "z"].map(|k| number(&twist["twist"]["linear"][k]));
    assert!((Vector3::from(linear) - v).norm() < 1e-15);
    // differences of v_b = (exp(phi) C)' (v + dv) with a step of 1e-6: truncation 1e-12, rounding
    // 1e-10
    let mut jacobian = SMatrix::<f64, 3, 6>::zeros();
    for k in 0..6 {
        let mut d = [0.0; 6];
        d[k] = 1e-6;
        let at = |s: f64| {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::new(d[3], d[4], d[5]) * s);
            (turn * q).inverse() * (Vector3::from(VELOCITY) + Vector3::new(d[0], d[1], d[2]) * s)
        };
        jacobian.set_column(k, &((at(1.0) - at(-1.0)) / 2e-6));
    }
    let order = [3, 4, 5, 0, 1, 2];
    let joint = SMatrix::<f64, 6, 6>::from_fn(|i, j| p.get(order[i], order[j]));
    let expected: Matrix3<f64> = jacobian * joint * jacobian.transpose();
    for i in 0..6 {
        for j in 0..6 {
            let found = number(&twist["covariance"][6 * i + j]);
            let wanted = match (i, j) {
                (0..3, 0..3) => expected[(i, j)],
                (3, 3) => -1.0,
                _ => 0.0,
            };
            assert!(
                (found - wanted).abs() < 1e-7,
                "twist covariance ({i}, {j}): {found}, {wanted}"
            );
        }
    }

    let fix = &log[1].fields;
    assert_eq!(number(&fix["longitude"]), ORIGIN.longitude.to_degrees());
    let enu = [(7, 1.0), (6, 1.0), (8, -1.0)];
    let wanted: Vec<f64> =
        enu.iter().flat_map(|(i, a)| enu.map(|(j, b)| a * b * p.get(*i, j))).collect();
    let found: Vec<f64> =
        fix["position_covariance"].as_array().unwrap().iter().map(number).collect();
    assert_eq!((found, &fix["position_covariance_type"]), (wanted, &json!(3)));

    let position = &log[5].fields;
    assert_eq!(position["units"], json!(["s:deg", "s:deg", "s:m"]));
    assert_eq!((&position["unit"], &position["mode"]), (&json!("s:m"), &json!("s:estimate")));
    assert_eq!(number(&position["estimate"][2]), ORIGIN.height);
    assert_eq!(number(&position["sigma"][0]), p.get(6, 6).sqrt());
    // the meridian radius changes by (3/2) e^2 sin(2 lat) = 0.94 % per radian: over 95 m by 1.4e-7,
    // of 5 m that is 7e-7 m
    assert!((number(&position["error"][0]) - 5.0).abs() < 1e-6);
    let scale = json!({
        "header": header(""), "name": "s:dvl.scale", "mode": "s:consider",
        "components": ["s:k"], "units": ["s:"], "estimate": floats(&[1.01]), "unit": "s:",
        "sigma": floats(&[p.get(9, 9).sqrt()]), "error": floats(&[0.0]),
    });
    assert_eq!(log[6].fields, scale);
    let lever = json!({
        "header": header(""), "name": "s:dvl.lever_arm", "mode": "s:fixed",
        "components": ["s:x", "s:y", "s:z"],
        "units": ["s:m", "s:m", "s:m"], "estimate": floats(&[0.5, 0.0, -0.25]), "unit": "s:m",
        "sigma": floats(&[0.0; 3]), "error": [],
    });
    assert_eq!(log[7].fields, lever);
}

#[test]
fn an_update_is_an_innovation_of_the_channels_that_were_there() {
    let update = |outcome| UpdateRecord {
        time: NOW,
        sensor: SensorId(1),
        outcome,
        nis: 1.5,
        threshold: 7.8,
        present: 0b110,
        innovation: &[0.5, -0.25],
        covariance: &[4.0, 0.1, 0.1, 9.0],
    };
    let none = UpdateRecord {
        nis: f64::NAN,
        present: 0,
        innovation: &[],
        covariance: &[],
        ..update(Outcome::Rejected(Rejection::NotFinite(2)))
    };
    let log = logged(|sink| {
        sink.take(&Record::Update(&update(Outcome::Gated))).unwrap();
        sink.take(&Record::Update(&none)).unwrap();
    });
    let expected = json!({
        "header": header("dvl"), "outcome": "s:gated", "nis": float(1.5), "threshold": float(7.8),
        "dof": 2, "channels": ["s:vel_y_mps", "s:vel_z_mps"], "innovation": floats(&[0.5, -0.25]),
        "sigma": floats(&[2.0, 3.0]),
    });
    assert_eq!((log[0].topic.as_str(), &log[0].fields), ("/innovation/dvl", &expected));
    assert_eq!(log[1].fields["outcome"], "s:rejected: vel_z_mps is not finite");
    assert_eq!((&log[1].fields["dof"], &log[1].fields["innovation"]), (&json!(0), &json!([])));
    assert!(number(&log[1].fields["nis"]).is_nan());
}

#[test]
fn events_keep_their_order_and_level_also_those_before_the_first_sample() {
    let event =
        |time, level, text: &str| Event { time, level, about: "dvl".into(), text: text.into() };
    let log = logged(|sink| {
        sink.take(&Record::Event(&event(Time::MIN, Level::Error, "no clock yet"))).unwrap();
        sink.take(&Record::Event(&event(NOW, Level::Info, "Straße"))).unwrap();
        sink.take(&Record::Sample(&Sample::new(NOW, SensorId(2), &[1.0]))).unwrap();
        sink.take(&Record::Event(&event(NOW, Level::Warning, ""))).unwrap();
    });
    let log: Vec<&Logged> = log.iter().filter(|m| m.topic == "/log").collect();
    let told: Vec<(&Value, &Value)> =
        log.iter().map(|m| (&m.fields["level"], &m.fields["msg"])).collect();
    let (error, info, warning) = (json!(40), json!(20), json!(30));
    let texts = [json!("s:no clock yet"), json!("s:Straße"), json!("s:")];
    assert_eq!(told, [(&error, &texts[0]), (&info, &texts[1]), (&warning, &texts[2])]);
    assert_eq!(log[0].fields["stamp"], header("")["stamp"]);
    assert_eq!(
        (&log[0].fields["name"], &log[0].schema),
        (&json!("s:dvl"), &"rcl_interfaces/msg/Log".to_owned())
    );
}

#[test]
fn log_times_are_run_times_moved_by_whole_seconds_if_they_begin_before_zero() {
    for (first, offset) in
        [(0, 0), (5, 0), (-1, 1), (-450_000_000, 1), (-2_000_000_000, 2), (-2_000_000_001, 3)]
    {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut sink = fixture::create(&path, Compression::Zstd);
        for time in [first, first + 7, first - 1_000_000_000] {
            sink.take(&Record::Sample(&Sample::new(
                Time::from_nanos(time),
                SensorId(1),
                &[1.0; 3],
            )))
            .unwrap();
        }
        sink.finish().unwrap();
        let offset = offset * 1_000_000_000;
        let late = (first - 1_000_000_000 + offset).max(0) as u64;
        let times: Vec<u64> = read(&path).iter().map(|m| m.log_time).collect();
        assert_eq!(times, [(first + offset) as u64, (first + 7 + offset) as u64, late]);
        assert_eq!(read_scenario(&path).unwrap().log_time_offset, offset);
    }
}

#[test]
fn the_scenario_is_in_the_metadata_and_attached() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::Zstd);
    sink.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    assert_eq!(metadata.name, "navfuse");
    let entries: Vec<(&str, &str)> =
        metadata.metadata.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    let expected = [
        ("log_time_offset_ns", "0"),
        ("name", "dive"),
        ("scenario", fixture::SCENARIO),
        ("seed", "7"),
        ("simulated", "false"),
        ("version", "1.2.3"),
    ];
    assert_eq!(entries, expected);
    let attached = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!(
        (attached.name.as_str(), &attached.data[..]),
        ("scenario.toml", fixture::SCENARIO.as_bytes())
    );
    let info = read_scenario(&path).unwrap();
    assert_eq!(
        (info.name.as_str(), info.scenario.as_str(), info.version.as_str()),
        ("dive", fixture::SCENARIO, "1.2.3")
    );
    let header = mcap::read::LinearReader::new(&bytes).unwrap().next().unwrap().unwrap();
    let mcap::records::Record::Header(header) = header else { panic!("no header") };
    assert_eq!((header.profile.as_str(), header.library.as_str()), ("ros2", "navfuse 1.2.3"));
}
