//! `navfuse diagnose`: what an IMU has wrong is named, and a channel that reads noise alone is not.

use crate::diagnose::{DIVE, run};
use navfuse_core::model::record::verdict::VerdictLevel;

/// A car on level ground, whose vertical velocity and rates of roll and pitch are noise alone.
const CAR: &str = r#"
[process.ins]
attitude = { sigma = ["1 deg", "1 deg", "3 deg"] }
velocity = { sigma = "10 cm/s" }
position = { sigma = "0.5 m" }
gyro_bias = { sigma = "0.1 deg/s", truth = ["0.05 deg/s", "-0.03 deg/s", "0.04 deg/s"] }
accel_bias = { sigma = "20 mg", truth = ["10 mg", "-15 mg", "5 mg"] }
[sensor.imu]
gyro_noise = "200 deg/h/sqrt(Hz)"
accel_noise = "3 mg/sqrt(Hz)"
simulation = { rate = "25 Hz" }
[sensor.gnss]
horizontal_noise = "2 cm"
vertical_noise = "4 cm"
velocity_noise = "6 cm/s"
simulation = { rate = "4 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "40 deg", longitude = "-105 deg", height = "1600 m", heading = "30 deg" }
segments = [
  { type = "static", duration = "10 s" },
  { type = "surge", duration = "10 s", speed = "12 m/s" },
  { type = "turn", duration = "12 s", angle = "90 deg" },
  { type = "cruise", duration = "20 s" },
  { type = "turn", duration = "12 s", angle = "-60 deg" },
  { type = "cruise", duration = "20 s" },
]
"#;

#[test]
fn a_channel_that_reads_noise_alone_is_not_blamed() {
    let diagnosis = run(CAR, &["seed=1".to_owned()]);
    let best = diagnosis.best().map(|best| &best.change);
    assert_eq!(best, None);
}

#[test]
fn what_an_imu_has_wrong_is_named_and_mended() {
    let turn = |vector: &str| {
        format!(
            "{{ type = \"turn\", size = \"35 deg\", channels = [\"{vector}_x\", \"{vector}_y\"] }}"
        )
    };
    let cases = [
        (
            "{ type = \"scale\", size = \"3 %\", channels = [\"gyro_z\"] }".to_owned(),
            "imu: gyro_scale",
        ),
        ("{ type = \"clock-offset\", size = \"0.28 s\" }".to_owned(), "imu: clock -0.2"),
        ([turn("gyro"), turn("accel")].join(", "), "imu: mounting"),
    ];
    for (faults, change) in cases {
        let imu = format!("sensor.imu.simulation={{ rate = \"25 Hz\", faults = [{faults}] }}");
        let diagnosis = run(DIVE, &["seed=5".to_owned(), imu]);
        let best = diagnosis.best().expect("a change explains it");
        assert!(best.change.starts_with(change), "{faults}: {}", best.change);
        assert_eq!(best.level, VerdictLevel::Consistent, "{faults}: {}", best.verdict);
    }
}
