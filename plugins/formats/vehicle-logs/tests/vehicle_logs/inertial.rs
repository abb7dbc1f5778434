//! What the source reads from the logs of the inertial units of SBG, VectorNav and MicroStrain.

use crate::generate::floats;
use crate::generate::units::{WEEKS, mip, sbg, vectornav_binary, vectornav_message};
use crate::read as decoded;
use crate::scenario::{near, read};
use navfuse_core::units::calendar::{GPS_ZERO, WEEK, utc_of_gps};
use navfuse_core::units::time::Time;
use navfuse_vehicle_logs::Format;

/// Rounding of the log's numbers of four bytes.
const SINGLE: f64 = 1e-7;
const PLACE: [f64; 2] = [47.4, 8.5];

fn place() -> [f64; 2] {
    PLACE.map(f64::to_radians)
}

#[test]
fn a_unit_of_sbg_fills_its_sensors_and_its_time_goes_on() {
    let keys = "sensors.imu = { message = \"IMU_SHORT\" }\n\
                sensors.gnss = { message = \"GPS1_POS\", with = \"GPS1_VEL\" }\n\
                sensors.depth = { message = \"DEPTH\" }\n\
                sensors.reference = { message = \"EKF_NAV\", with = \"EKF_EULER\" }";
    let read = read(&sbg(4), keys).unwrap();
    let [depth, gnss, imu, reference] = read.samples.as_slice() else { panic!("four sources") };
    assert_eq!([imu.len(), gnss.len(), depth.len(), reference.len()], [200, 15, 20, 20]);
    // 2^32 us are 4294.967296 s, and the log begins 0.500001 s before
    let first = 4_294_467_295_000;
    for (k, sample) in imu.iter().enumerate() {
        assert_eq!(sample.time, Time::from_nanos(first + 20_000_000 * k as i64));
        // a count of the large range is 8e-8 rad/s
        near(sample, &[0.001, -0.002, 0.1, 0.05, 0.5, -9.8], 2e-6);
    }
    let [lat, lon] = place();
    // the first fix has no velocity before it to interpolate from
    let north = (47.4_f64 + 60e-6).to_radians();
    near(&gnss[1], &[north, lon, 450.25, 5.0, 0.5, -0.1, 0.8, 1.2, 0.3], SINGLE);
    near(&depth[0], &[12.5], SINGLE);
    near(&reference[0], &[lat, lon, 450.25, 5.0, 0.5, -0.1, 0.02, -0.03, 1.5], SINGLE);
    let warnings = read.warnings.iter().flatten().cloned().collect::<Vec<_>>().join("|");
    assert!(warnings.contains("10 logs without a valid measurement"), "{warnings}");
    assert!(!warnings.contains("skipped"), "{warnings}");
}

#[test]
fn an_invalid_velocity_of_sbg_is_left_out() {
    let (rows, topics, _) = decoded(Format::SbgEcom, &sbg(1));
    let track = topics.iter().position(|t| t.name == "DVL_BOTTOM_TRACK").unwrap();
    let status = rows.iter().filter(|(r, _)| r.topic == track).map(|(_, v)| v[0]);
    assert_eq!(status.collect::<Vec<_>>(), [1.0, 0.0, 1.0, 0.0, 1.0]);
}

#[test]
fn a_unit_of_vectornav_gives_each_fix_once_at_its_own_time() {
    let keys = "sensors.imu = { message = \"VN-IMU\" }\n\
                sensors.gnss = { message = \"VN-GPS\" }\n\
                sensors.compass = { message = \"VN-ATTITUDE\" }\n\
                sensors.reference = { message = \"VN-INS\" }";
    let read = read(&vectornav_binary(3), keys).unwrap();
    let [compass, gnss, imu, reference] = read.samples.as_slice() else { panic!("four sources") };
    // a fix in every second of the messages of the receiver
    assert_eq!([imu.len(), gnss.len(), compass.len(), reference.len()], [300, 10, 30, 30]);
    near(&imu[7], &[0.001, -0.002, 0.1, 0.05, 0.5, -9.81], SINGLE);
    assert_eq!(imu[7].time, Time::from_nanos(2_070_000_000));
    let [lat, lon] = place();
    near(&gnss[0], &[lat, lon, 450.25, 5.0, 0.5, -0.1, 0.8, 1.2, 0.3], SINGLE);
    // the fix is 30 ms older than the message at 1 s
    assert_eq!(gnss[0].time, Time::from_nanos(3_000_000_000 - 30_000_000));
    near(&compass[0], &[90_f64.to_radians()], SINGLE);
    let [roll, pitch, yaw] = [1.5_f64, -2.5, 90.0].map(f64::to_radians);
    near(&reference[0], &[lat, lon, 450.0, 5.0, 0.5, -0.1, roll, pitch, yaw], SINGLE);
}

#[test]
fn a_vectornav_message_without_the_time_since_the_start_has_gps_time() {
    let gps = u64::from(WEEKS) * WEEK as u64 + 336_000_000_000_000;
    let mut values = gps.to_le_bytes().to_vec();
    values.extend(floats(&[0.01, 0.1, -0.2, 10.0, 0.1, 0.2, -0.1]));
    // time: GPS time; and increments: seconds, degrees, metres per second
    let message = vectornav_message(&[(0, 2 | 1 << 11)], &values);
    let (rows, topics, damage) = decoded(Format::VectornavBinary, &message.repeat(3));
    assert_eq!((topics[0].name.as_str(), damage.bytes()), ("VN-DELTA", 0));
    let stamp = utc_of_gps(GPS_ZERO + gps as i64);
    assert_eq!(rows[0].0.stamp, navfuse_frames::Stamp::Date(stamp));
    let expected =
        [0.1_f64.to_radians(), -0.2_f64.to_radians(), 10_f64.to_radians(), 0.1, 0.2, -0.1];
    assert!(rows[0].1.iter().zip(expected).all(|(a, b)| (a - b).abs() < SINGLE));
}

#[test]
fn a_unit_of_microstrain_has_gps_time_from_when_it_is_valid() {
    let keys = "time.origin = \"2022-06-01T21:19:42Z\"\n\
                sensors.imu = { message = \"MIP-IMU\" }\n\
                sensors.gnss = { message = \"MIP-GNSS\" }\n\
                sensors.compass = { message = \"MIP-FILTER\" }\n\
                sensors.reference = { message = \"MIP-FILTER\" }";
    let read = read(&mip(3, false), keys).unwrap();
    let [compass, gnss, imu, reference] = read.samples.as_slice() else { panic!("four sources") };
    assert_eq!([imu.len(), gnss.len(), compass.len(), reference.len()], [100, 10, 10, 10]);
    // the second 336000 of the week 2212, 18 s before UTC
    assert_eq!(imu[0].time, Time::from_nanos(1_000_000_000));
    let g = 9.806_65;
    near(&imu[0], &[0.001, -0.002, 0.1, 0.01 * g, 0.05 * g, -g], SINGLE);
    let [lat, lon] = place();
    near(&gnss[0], &[lat, lon, 450.25, 5.0, 0.5, -0.1, 0.8, 1.2, 0.3], SINGLE);
    near(&compass[0], &[1.5], SINGLE);
    near(&reference[0], &[lat, lon, 450.0, 5.0, 0.5, -0.1, 0.02, -0.03, 1.5], SINGLE);
    let warnings = read.warnings.iter().flatten().cloned().collect::<Vec<_>>().join("|");
    assert!(warnings.contains("50 packets left out without a valid time"), "{warnings}");
}

#[test]
fn increments_of_microstrain_count_from_the_start_without_gps() {
    // one second, in which no time is valid
    let keys = "sensors.imu = { message = \"MIP-DELTA\" }\n# increments";
    let read = read(&mip(1, true), keys).unwrap();
    let imu = &read.samples[0];
    assert_eq!((imu.len(), imu[0].time), (50, Time::from_nanos(336_000_000_000_000)));
    let g = 9.806_65;
    near(&imu[0], &[2e-5, -4e-5, 2e-3, 2e-4 * g, 1e-3 * g, -0.02 * g], SINGLE);
}
