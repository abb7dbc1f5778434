//! The source in a scenario: sensors, units, clocks, and errors with remedies.

use crate::connected::WirePlugin;
use crate::generate::{
    binary_span, dataflash, flight, increments, nucleus, packet, psins, sbet, septentrio, span,
    telemetry_of_flight, ublox, vectornav, vectornav_with_fixes,
};
use navfuse_core::plugin::Registry;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_testing::recording::{self, AIDS, INERTIAL, Reading};
use navfuse_vehicle_logs::VehicleLogsPlugin;

pub fn read(log: &[u8], keys: &str) -> Result<Reading, String> {
    reading(log, &format!("[source.vehicle-log]\nfile = \"log.bin\"\n{keys}\n"))
}

/// Reads a log by the table of a source.
pub fn reading(log: &[u8], source: &str) -> Result<Reading, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("log.bin"), log).unwrap();
    let filter = match source.contains("increments") {
        true => INERTIAL.replace("[sensor.imu]", "[sensor.imu]\noutput = \"increments\""),
        false => INERTIAL.to_owned(),
    };
    let text = format!("{filter}{AIDS}{source}");
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&WirePlugin)
        .add(&VehicleLogsPlugin);
    let mut reading = recording::read(&registry, folder.path(), &text)?;
    for warning in reading.warnings.iter_mut().flatten() {
        *warning = warning.strip_prefix("log.bin: ").unwrap().to_owned();
    }
    Ok(reading)
}

pub fn near(sample: &Sample, expected: &[f64], tolerance: f64) {
    for (channel, expected) in expected.iter().enumerate() {
        let found = sample.get(channel);
        let close = match expected.is_nan() {
            true => found.is_none(),
            false => {
                found.is_some_and(|v| (v - expected).abs() <= tolerance * expected.abs().max(1.0))
            }
        };
        assert!(close, "channel {channel}: {found:?}, {expected}");
    }
}

/// Rounding of the log's numbers of four bytes.
const SINGLE: f64 = 1e-7;

#[test]
fn a_flight_of_px4_gives_each_sensor_its_samples() {
    let keys = "sensors.imu = { message = \"sensor_combined\" }\n\
                sensors.gnss = { message = \"sensor_gps\", instance = 1 }\n\
                sensors.reference = { message = \"vehicle_local_position\", with = \"vehicle_attitude\" }";
    let read = read(&flight(4), keys).unwrap();
    let [gnss, imu, reference] = read.samples.as_slice() else { panic!("three sources") };
    assert_eq!([imu.len(), gnss.len(), reference.len()], [200, 15, 20]);
    assert_eq!(imu[0].time, Time::from_nanos(2_000_000_000));
    near(&imu[50], &[0.001, -0.002, 0.1, 0.05, 0.5, -9.81], SINGLE);
    // the second receiver has a fix after one second
    let place = [(47.4 + 50e-6_f64).to_radians(), 8.5_f64.to_radians(), 450.25];
    near(&gnss[0], &[place[0], place[1], place[2], 5.0, 0.5, -0.1, 0.8, 1.2, 0.3], SINGLE);
    assert_eq!(gnss[0].time, Time::from_nanos(3_000_000_000));
    // the position lies 10 ms after an attitude: 0.1 rad/s times the mean of both times
    let time = 0.1_f64;
    assert_eq!(reference[0].time, Time::from_nanos(2_110_000_000));
    near(&reference[0], &[f64::NAN; 0], SINGLE);
    let angles =
        [reference[0].get(6), reference[0].get(7), reference[0].get(8)].map(Option::unwrap);
    let yaw = 0.1 * (time + 0.01);
    assert!(angles[0].abs() < SINGLE && angles[1].abs() < SINGLE, "{angles:?}");
    assert!((angles[2] - yaw).abs() < SINGLE, "{angles:?}");
    assert!((reference[0].get(2).unwrap() - 420.0).abs() < 1e-9);
    let north = (reference[0].get(0).unwrap() - 47.4_f64.to_radians()) * 6_371_000.0;
    assert!((north - 0.5).abs() < 1e-6, "{north}");
    let warnings = read.warnings.iter().flatten().cloned().collect::<Vec<_>>().join("|");
    assert!(warnings.contains("1 dropout of the logger at byte"), "{warnings}");
    assert!(warnings.contains("(0.150 s)"), "{warnings}");
    assert!(warnings.contains("5 messages without a valid measurement"), "{warnings}");
}

#[test]
fn any_topic_is_mapped_with_units_signs_and_conditions() {
    let keys = "sensors.imu.message = \"sensor_combined\"\n\
                [source.vehicle-log.sensors.depth]\nmessage = \"esc_status\"\n\
                only = { \"esc[0].state\" = -2 }\n\
                channels.depth = { field = \"counter\", unit = \"cm\", scale = -1, offset = 3 }";
    let samples = read(&flight(4), keys).unwrap().samples;
    assert_eq!(samples[0].len(), 20);
    near(&samples[0][2], &[3.0 - 0.2], 1e-15);
}

#[test]
fn telemetry_keeps_the_intervals_of_the_vehicle_on_the_clock_of_the_log() {
    let keys = "time.origin = \"2022-06-01T08:30:00Z\"\n\
                sensors.imu = { message = \"HIGHRES_IMU\" }\n\
                sensors.gnss = { message = \"GPS_RAW_INT\" }\n\
                sensors.compass = { message = \"ATTITUDE\" }\n";
    let samples = read(&telemetry_of_flight(2), keys).unwrap().samples;
    let [compass, gnss, imu] = samples.as_slice() else { panic!("three sources") };
    assert_eq!([imu.len(), gnss.len(), compass.len()], [200, 10, 100]);
    // the first message came 5.003 s after 08:30
    for (k, sample) in imu.iter().enumerate() {
        assert_eq!(sample.time.nanos(), 5_003_000_000 + 10_000_000 * k as i64);
    }
    near(&imu[0], &[0.01, -0.02, 0.03, 0.1, 0.2, -9.8], SINGLE);
    near(&compass[0], &[3.0], SINGLE);
    let place = [47.4_f64.to_radians(), 8.5_f64.to_radians(), 450.25];
    let none = f64::NAN;
    let east = [place[0], place[1], place[2], 0.0, 5.0, none, 0.8, 1.2, 0.3];
    near(&gnss[0], &east, 1e-12);
    // no course, so no velocity
    near(&gnss[1], &[place[0], place[1], place[2], none, none, none, 0.8, 1.2, 0.3], 1e-12);
    let received = read(&telemetry_of_flight(2), &format!("stamp = \"received\"\n{keys}")).unwrap();
    // received with up to 20 ms more delay, not in the order in which it was sent
    assert!(received.warnings.iter().flatten().any(|w| w.contains("not later than")));
}

#[test]
fn zero_north_zero_east_is_no_position() {
    let message = |lat: i32, lon: i32, k: u64| {
        let mut payload = (1000 * k as u32).to_le_bytes().to_vec();
        [lat, lon, 0, 0].iter().for_each(|v| payload.extend(v.to_le_bytes()));
        payload.extend([0; 8]);
        packet(2, 33, 104, 1, 1_654_072_200_000_000 + 1_000_000 * k, &payload)
    };
    let nowhere: Vec<u8> = (1..5).flat_map(|k| message(0, 0, k)).collect();
    let keys = "sensors.reference = { message = \"GLOBAL_POSITION_INT\" }";
    let error = read(&nowhere, keys).err().unwrap_or_default();
    assert!(error.contains("no GLOBAL_POSITION_INT has a valid measurement"), "{error}");
    let here: Vec<u8> = (5..9).flat_map(|k| message(430_000_000, 0, k)).collect();
    let reading = read(&[nowhere, here].concat(), keys).unwrap();
    assert_eq!(reading.samples[0].len(), 4);
    let count = "4 messages without a valid measurement, the first at byte 0";
    assert!(reading.warnings.iter().flatten().any(|w| w.contains(count)), "{:?}", reading.warnings);
}

#[test]
fn dataflash_has_units_in_its_letters_and_instances_in_its_messages() {
    let keys = "sensors.imu = { message = \"IMU\", instance = 1 }\n\
                sensors.gnss = { message = \"GPS\" }\n\
                sensors.compass = { message = \"ATT\" }\n\
                sensors.depth = { message = \"BARO\", instance = 1 }\n";
    let samples = read(&dataflash(2), keys).unwrap().samples;
    let [compass, depth, gnss, imu] = samples.as_slice() else { panic!("four sources") };
    assert_eq!([imu.len(), gnss.len(), compass.len(), depth.len()], [100, 10, 100, 10]);
    assert_eq!(imu[1].time.nanos(), 2_020_000_000);
    near(&imu[0], &[0.0, -0.002, 0.1, 0.05, 0.5, -9.81], SINGLE);
    near(&compass[0], &[90_f64.to_radians()], 1e-15);
    let [lat, lon] = [47.4_f64, 8.5].map(f64::to_radians);
    near(&gnss[0], &[lat, lon, 450.25, 0.0, 5.0, -0.1], SINGLE);
    // 50 000 Pa of sea water
    near(&depth[0], &[50_000.0 / (1025.0 * 9.806_65)], SINGLE);
    // a writer that counts four bytes too few for the second format, of 89 bytes as each
    let mut short = dataflash(2);
    short[89 + 4] -= 4;
    let again = read(&short, keys).unwrap().samples;
    assert_eq!(again[2].len(), 10);
    assert_eq!(again[2][0].time, gnss[0].time);
}

#[test]
fn ubx_gives_fixes_and_the_measurements_of_its_inertial_unit_on_one_clock() {
    let keys = "time.origin = \"2022-06-01T08:30:00Z\"\n\
                sensors.gnss = { message = \"NAV-PVT\" }\n\
                sensors.imu = { message = \"ESF-MEAS\" }\n";
    let reading = read(&ublox(3), keys).unwrap();
    let [gnss, imu] = reading.samples.as_slice() else { panic!("two sources") };
    assert_eq!([imu.len(), gnss.len()], [150, 10]);
    // 41 counts of 2^-12 deg/s; the first one came with the first NAV-PVT
    let rate = 41.0 / 4096.0_f64;
    let [x, y, z] = [rate, -rate, 1.0].map(f64::to_radians);
    near(&imu[1], &[x, y, z, 0.5, 0.0, -10_046.0 / 1024.0], 1e-15);
    assert_eq!(imu[1].time.nanos(), 20_000_000);
    let [lat, lon] = [47.400_05_f64, 8.5].map(f64::to_radians);
    near(&gnss[0], &[lat, lon, 450.25, 5.0, -0.5, 0.1, 0.8, 1.2, 0.3], 1e-12);
    assert_eq!(gnss[0].time.nanos(), 1_000_000_000);
    let count = "5 messages without a valid measurement";
    assert!(reading.warnings.iter().flatten().any(|w| w.contains(count)), "{:?}", reading.warnings);
}

#[test]
fn sbf_gives_fixes_attitude_and_an_external_inertial_unit() {
    let keys = "sensors.gnss = { message = \"PVTGeodetic\" }\n\
                sensors.imu = { message = \"ExtSensorMeas\" }\n\
                sensors.compass = { message = \"AttEuler\" }\n";
    let reading = read(&septentrio(2), keys).unwrap();
    let [compass, gnss, imu] = reading.samples.as_slice() else { panic!("three sources") };
    assert_eq!([imu.len(), gnss.len(), compass.len()], [100, 8, 10]);
    let [x, y, z] = [1.0_f64, -2.0, 6.0].map(f64::to_radians);
    near(&imu[6], &[x, y, z, 0.1, 0.2, -9.8], 1e-15);
    near(&compass[0], &[90_f64.to_radians()], 1e-15);
    // 2 m of twice the horizontal distance, and 1.2 m of twice the vertical sigma
    let none = f64::NAN;
    let h_acc = 2.0 / 8_f64.sqrt();
    near(&gnss[0], &[0.8, 0.15, 450.25, 5.0, -0.5, -0.1, h_acc, 0.6, none], SINGLE);
    // week 2212, second 336000 of GPS, 18 s before UTC
    assert_eq!(gnss[0].time.nanos(), (1_654_118_400 - 18) * 1_000_000_000);
    let count = "2 blocks without a valid measurement";
    assert!(reading.warnings.iter().flatten().any(|w| w.contains(count)), "{:?}", reading.warnings);
}

#[test]
fn a_nucleus_gives_inertial_measurements_and_attitude() {
    let keys = "time.origin = \"2022-06-01T08:30:00Z\"\n\
                sensors.imu = { message = \"NUCLEUS-IMU\" }\n\
                sensors.compass = { message = \"NUCLEUS-AHRS\" }\n\
                sensors.depth = { message = \"NUCLEUS-AHRS\" }\n";
    let samples = read(&nucleus(100), keys).unwrap().samples;
    let [compass, depth, imu] = samples.as_slice() else { panic!("three sources") };
    assert_eq!([imu.len(), compass.len(), depth.len()], [100, 10, 10]);
    near(&imu[13], &[0.01, -0.02, 0.0, 0.1, 0.0, -9.8], SINGLE);
    assert_eq!(imu[13].time.nanos(), 130_000_000);
    near(&compass[0], &[90_f64.to_radians()], 1e-15);
    near(&depth[0], &[12.5], 0.0);
    // of the tracks, each second one is valid in all three axes
    let (rows, topics, _) = crate::read(navfuse_vehicle_logs::Format::Nucleus, &nucleus(100));
    let track = topics.iter().position(|t| t.name == "NUCLEUS-BOTTOM-TRACK").unwrap();
    let valid = rows.iter().filter(|(r, _)| r.topic == track).map(|(_, values)| values[0]);
    assert_eq!(valid.collect::<Vec<_>>(), [1.0, 0.0].repeat(5));
}

#[test]
fn counts_of_psins_are_scaled_and_turned() {
    let keys = "sensors.imu = { message = \"PSINS\" } # increments";
    let samples = &read(&psins(100), keys).unwrap().samples[0];
    assert_eq!((samples.len(), samples[1].time.nanos()), (100, 20_000_000));
    // right, forward, up: 1 and 2 counts of 0.1", -7 of 0.2"; 1, 1 and 80 of 125e-6 g s
    let second = (1.0_f64 / 3600.0).to_radians();
    let speed = 125e-6 * 9.780_327;
    near(
        &samples[1],
        &[0.2 * second, 0.1 * second, 1.4 * second, speed, speed, -80.0 * speed],
        1e-12,
    );
}

#[test]
fn raw_measurements_of_a_span_are_turned_and_scaled() {
    let keys = "sensors.imu = { message = \"RAWIMUSX\" } # increments\n\
                sensors.gnss = { message = \"BESTPOS\" }\n\
                sensors.reference = { message = \"INSPVAX\" }\n";
    for (log, error) in [(span(3), 1e-12), (binary_span(3), SINGLE)] {
        let read = read(&log, keys).unwrap();
        let [gnss, imu, reference] = read.samples.as_slice() else { panic!("three sources") };
        assert_eq!([imu.len(), gnss.len(), reference.len()], [300, 3, 3]);
        // HG1700 AG58: 2^-33 rad and 2^-27 ft/s; the log has z, -y, x of axes right, forward, up
        let (gyro, accel) = (2_f64.powi(-33), 2_f64.powi(-27) * 0.3048);
        let counts = [7.0, 9895.0, -215.0].map(|n| n * gyro);
        let speeds = [-817_242.0, -202_184.0, 43_110_635.0].map(|n| n * accel);
        near(&imu[7], &[counts[0], counts[1], counts[2], speeds[0], speeds[1], speeds[2]], 1e-15);
        let (lat, lon) = (47.4_f64.to_radians(), 8.5_f64.to_radians());
        let [roll, pitch, yaw] = [1.5_f64, -2.5, 90.0].map(f64::to_radians);
        near(&reference[0], &[lat, lon, 447.75, 5.0, -0.5, -0.25, roll, pitch, yaw], 1e-12);
        let h_acc = (0.5 * (0.03_f64.powi(2) + 0.04_f64.powi(2))).sqrt();
        near(&gnss[0], &[lat, lon, 447.75, f64::NAN, f64::NAN, f64::NAN, h_acc, 0.06], error);
        // week 2212, second 336000: 2022-06-01T21:20:00 of GPS, 18 s before UTC
        let utc = 1_654_118_400 - 18;
        assert_eq!(imu[0].time.nanos(), utc * 1_000_000_000);
    }
    let keys = "sensors.gnss = { message = \"BESTPOS\", with = \"BESTVEL\" }";
    let gnss = &read(&binary_span(3), keys).unwrap().samples[0];
    let velocity = [3, 4, 5].map(|k| gnss[1].get(k).unwrap());
    assert!((velocity[0].abs() < 1e-12) && (velocity[1] - 10.0).abs() < 1e-12, "{velocity:?}");
    assert_eq!(velocity[2], -0.5);
    // the example in NovAtel's manual
    let manual =
        b"%RAWIMUSXA,1692,484620.664;00,11,1692,484620.664389000,00801503,43110635,-817242,\
                   -202184,-215194,-41188,-9895*a5db8c7b\r\n";
    assert_eq!(crate::read(navfuse_vehicle_logs::Format::Novatel, manual).0.len(), 1);
}

#[test]
fn messages_without_a_time_have_the_interval_that_the_scenario_gives() {
    let keys = "interval = \"5 ms\"\nsensors.imu = { message = \"VNYMR\" }\n\
                sensors.compass = { message = \"VNYMR\" }";
    let samples = read(&vectornav(60), keys).unwrap().samples;
    let [compass, imu] = samples.as_slice() else { panic!("two sources") };
    near(&imu[3], &[0.003, -0.02, 0.03, 0.1, -0.2, -9.8], 1e-15);
    near(&compass[3], &[90.5_f64.to_radians()], 1e-15);
    assert_eq!((imu.len(), imu[59].time.nanos()), (60, 59 * 5_000_000));
}

#[test]
fn a_fix_between_messages_without_a_time_has_the_time_of_the_newest_one() {
    let keys = "interval = \"5 ms\"\nsensors.imu = { message = \"VNIMU\" }\n\
                sensors.gnss = { message = \"VNGPS\" }";
    let samples = read(&vectornav_with_fixes(60), keys).unwrap().samples;
    let [gnss, imu] = samples.as_slice() else { panic!("two sources") };
    let times: Vec<i64> = gnss.iter().map(|s| s.time.nanos() / 5_000_000).collect();
    assert_eq!((imu.len(), imu[59].time.nanos(), times), (60, 59 * 5_000_000, vec![19, 39, 59]));
    let (lat, lon) = (47.4_f64.to_radians(), 8.5_f64.to_radians());
    let h_acc = (0.5 * (9.0 + 16.0_f64)).sqrt();
    near(&gnss[0], &[lat, lon, 447.75, 5.0, -0.5, -0.25, h_acc, 6.0, 0.1], 1e-12);
}

#[test]
fn records_in_double_precision_keep_their_week() {
    let keys = "sensors.reference = { message = \"SBET\" }\nweek = 2212\n\
                time.origin = \"2022-06-04T23:59:41Z\"";
    let samples = &read(&sbet(8), keys).unwrap().samples[0];
    // a second before the end of the week, 18 s of leap seconds: the origin; then the next week
    let times: Vec<i64> = samples.iter().map(|s| s.time.nanos() / 1_000_000).collect();
    assert_eq!(times, [0, 500, 1000, 1500, 2000, 2500, 3000, 3500]);
    near(&samples[0], &[0.8, 0.15, 450.0, 5.0, 1.0, -0.5, 0.1, -0.2, 1.0], 1e-14);
    let keys = "sensors.imu = { message = \"IMU\" } # increments";
    let samples = &read(&increments(100), keys).unwrap().samples[0];
    assert_eq!((samples.len(), samples[1].time.nanos()), (100, 91_620_005_000_000));
    near(&samples[1], &[1e-5, -2e-5, 3e-5, 1e-3, -2e-3, -0.049], 0.0);
}

#[test]
fn what_does_not_fit_is_rejected_with_a_remedy() {
    let log = flight(1);
    let imu = |more: &str| format!("sensors.imu = {{ message = \"sensor_combined\"{more} }}");
    for (file, keys, words) in [
        (&log, "sensors = {}".to_owned(), ["it names no sensor", "sensors.imu ="]),
        (
            &log,
            "sensors.imo = { message = \"a\" }".into(),
            ["there is no [sensor.imo]", "\"imu\"?"],
        ),
        (
            &log,
            imu(", channels.gyro_x = { field = \"gyro_rad[3]\" }"),
            ["gyro_rad[3]", "gyro_rad[2]"],
        ),
        (
            &log,
            imu(", channels.gyro_x = { field = \"gyro_rad[0]\", unit = \"m\" }"),
            ["no unit of the channel gyro_x", "channels.gyro_x.unit"],
        ),
        (
            &log,
            imu(", channels.gyro = { field = \"gyro_rad[0]\" }"),
            ["no channel \"gyro\"", "gyro_x"],
        ),
        (&log, imu("").replace("combined", "gyro"), ["there is no sensor_gyro", "sensor_combined"]),
        (&log, imu("").replace("sensor_combined", "esc_status"), ["not known", "channels.gyro_x"]),
        (&log, imu("") + "\ntime.origin = \"2022-06-01\"", ["time.origin", "time.offset"]),
        (&log, imu(", instance = 3"), ["no sensor_combined has", "sensors.imu.message"]),
        (&vectornav(9), "sensors.imu = { message = \"VNYMR\" }".into(), ["interval", "5 ms"]),
        (&b"hello".to_vec(), imu(""), ["no known format", "ulog, tlog"]),
        (&Vec::new(), imu(""), ["the file is empty", "ulog, tlog"]),
    ] {
        let error = read(file, &keys).err().unwrap_or_default();
        assert!(words.iter().all(|w| error.contains(w)), "{keys}: {error}");
    }
}
