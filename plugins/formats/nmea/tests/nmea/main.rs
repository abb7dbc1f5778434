//! The source in a scenario: sensors, epochs, clock, damage, and errors with remedies.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod foreign;
mod mutated;
mod vendors;

use navfuse_core::plugin::Registry;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_nmea::NmeaPlugin;
use navfuse_testing::recording::{self, AIDS, INERTIAL, Reading};
use navfuse_testing::speed::measure;
use std::fmt::Write;
use tempfile::TempDir;

/// The sentence with this content and its checksum.
fn sentence(content: &str) -> String {
    format!("${content}*{:02X}\r\n", content.bytes().fold(0, |sum, b| sum ^ b))
}

/// A recording of this many seconds from 08:30:00 on 1 June 2022: GNSS at 1 Hz, heading at 1 Hz,
/// attitude and depth.
fn recording(seconds: u32) -> String {
    let mut text = String::new();
    for k in 0..seconds {
        let time = format!("08{:02}{:02}.00", 30 + k / 60, k % 60);
        let minutes = 4.0 + 0.001 * f64::from(k);
        let place = format!("32{minutes:08.5},N,0345{:.4},W", 9.5 - 0.002 * f64::from(k));
        for content in [
            format!("GPGGA,{time},{place},4,12,0.7,10.5,M,18.25,M,,"),
            format!("GPGST,{time},0.1,,,,0.03,0.04,0.06"),
            format!("GPRMC,{time},A,{place},3.6,90.0,010622,,,A"),
            format!("HEHDT,{:.2},T", 350.0 + 0.5 * f64::from(k)),
            "PSXN,23,1.5,-2.5,351.0,0.1".to_owned(),
            format!("SDDPT,{:.2},0.5", 20.0 + 0.1 * f64::from(k)),
        ] {
            text.push_str(&sentence(&content));
        }
    }
    text
}

fn scenario(folder: &TempDir, file: &[u8], keys: &str) -> String {
    std::fs::write(folder.path().join("nav.nmea"), file).unwrap();
    format!("{INERTIAL}{AIDS}[source.nmea]\nfile = \"nav.nmea\"\n{keys}\n")
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&NmeaPlugin);
    registry
}

/// Reads a file with the keys of its source.
fn read(file: &[u8], keys: &str) -> Result<Reading, String> {
    let folder = tempfile::tempdir().unwrap();
    let text = scenario(&folder, file, keys);
    let mut reading = recording::read(&registry(), folder.path(), &text)?;
    for warning in reading.warnings.iter_mut().flatten() {
        *warning = warning.strip_prefix("nav.nmea: ").unwrap().to_owned();
    }
    Ok(reading)
}

fn near(sample: &Sample, expected: &[f64]) {
    for (channel, expected) in expected.iter().enumerate() {
        let found = sample.get(channel);
        let close = if expected.is_nan() {
            found.is_none()
        } else {
            found.is_some_and(|v| (v - expected).abs() <= 1e-12 * expected.abs().max(1.0))
        };
        assert!(close, "channel {channel}: {found:?}, {expected}");
    }
}

const ALL: &str = "gnss = \"gnss\"\nheading = \"compass\"\ndepth = \"depth\"\n\
                   reference = \"reference\"\ntime.origin = \"2022-06-01T08:30:00Z\"";

#[test]
fn the_sentences_of_an_instant_are_one_sample_of_each_sensor() {
    let read = read(recording(5).as_bytes(), ALL).unwrap();
    assert_eq!(read.samples.iter().map(Vec::len).collect::<Vec<_>>(), [5; 4]);
    assert_eq!(read.warnings, vec![None; 4]);
    let k = 3;
    for samples in &read.samples {
        assert_eq!(samples[k].time, Time::from_nanos(3_000_000_000));
    }
    let place = [(32.0 + 4.003 / 60.0_f64).to_radians(), -(34.0 + 59.494 / 60.0_f64).to_radians()];
    let east = 3.6 * 1852.0 / 3600.0;
    // no vertical velocity, and no accuracy of the velocity
    let accuracy = (0.5 * (0.03_f64.powi(2) + 0.04_f64.powi(2))).sqrt();
    let none = f64::NAN;
    let gnss = [place[0], place[1], 28.75, 0.0, east, none, accuracy, 0.06, none];
    near(&read.samples[0][k], &gnss);
    near(&read.samples[1][k], &[351.5_f64.to_radians()]);
    near(&read.samples[2][k], &[20.8]);
    let angles = [1.5_f64, -2.5, 351.0].map(f64::to_radians);
    let mut reference = vec![place[0], place[1], 28.75, 0.0, east, none];
    reference.extend(angles);
    near(&read.samples[3][k], &reference);
}

#[test]
fn damage_is_reported_with_offset_and_count_and_the_rest_is_used() {
    let whole = recording(10);
    let lines: Vec<&str> = whole.split_inclusive("\r\n").collect();
    let mut file = String::from("garbage\u{0}before");
    for (k, line) in lines.iter().enumerate() {
        match k {
            // a changed digit, a sentence without its end, and bytes of another device
            7 => file.push_str(&line.replacen("0.1", "0.2", 1)),
            14 => file.push_str(&line[..20]),
            20 => write!(file, "\u{1}\u{2}binary\u{3}{line}").unwrap(),
            _ => file.push_str(line),
        }
    }
    file.push_str("$GPGGA,0830");
    let read = read(file.as_bytes(), "gnss = \"gnss\"").unwrap();
    assert_eq!(read.samples[0].len(), 10, "no epoch loses all its sentences");
    let warning = read.warnings[0].clone().unwrap();
    let changed = lines[7].trim_end().len();
    let bytes = 14 + changed + 20 + 9 + 11;
    assert!(warning.starts_with(&format!("gnss: skipped {bytes} bytes in 5 places")), "{warning}");
    let at = 14 + lines[..7].concat().len();
    let damaged = format!("at byte {at}: {changed} bytes, wrong checksum; ");
    assert!(warning.contains(&damaged), "{warning}");
    assert!(warning.contains("wrong checksums in 1 place"), "{warning}");
    assert!(warning.contains("the file ends within the sentence"), "{warning}");
    near(&read.samples[0][1], &[(32.0 + 4.001 / 60.0_f64).to_radians()]);
    assert_eq!(read.samples[0][1].get(6), None, "the accuracy of the damaged GST is missing");
}

#[test]
fn dates_go_on_at_midnight_and_reach_back_before_the_first() {
    let gga = |time: &str| sentence(&format!("GPGGA,{time},3204.0,N,03459.5,E,1,9,1,5,M,0,M,,"));
    let hdt = sentence("GPHDT,10.0,T");
    let zda = sentence("GPZDA,235959.00,31,12,2022,00,00");
    let file =
        [gga("235958.00"), hdt.clone(), gga("235959.00"), zda, hdt.clone(), gga("000000.00"), hdt]
            .concat();
    let keys = "gnss = \"gnss\"\nheading = \"compass\"\ntime.origin = \"2023-01-01\"";
    let read = read(file.as_bytes(), keys).unwrap();
    for samples in &read.samples {
        let seconds: Vec<f64> = samples.iter().map(|s| s.time.seconds()).collect();
        assert_eq!(seconds, [-2.0, -1.0, 0.0]);
    }
}

#[test]
fn a_position_that_is_not_from_satellites_is_used_where_asked() {
    let gga = |second: u8, quality: u8| {
        sentence(&format!("INGGA,0830{second:02},3204.0,N,03459.5,E,{quality},9,1,5,M,0,M,,"))
    };
    let file: String = [(1, 1), (2, 6), (3, 0), (4, 2), (5, 8)].map(|(s, q)| gga(s, q)).concat();
    let seconds = |keys: &str| -> Vec<f64> {
        let read = read(file.as_bytes(), keys).unwrap();
        read.samples[0].iter().map(|s| s.time.seconds() - 30_600.0).collect()
    };
    assert_eq!(seconds(""), [1.0, 4.0]);
    assert_eq!(seconds("estimated = true"), [1.0, 2.0, 4.0, 5.0]);
    let read = read(file.as_bytes(), "").unwrap();
    let warning = read.warnings[0].clone().unwrap();
    assert!(warning.contains("2 epochs with a position that is not from satellites"), "{warning}");
}

#[test]
fn wrong_and_missing_checksums_are_accepted_and_counted_where_asked() {
    let right = recording(4);
    let wrong: String = (right.lines().enumerate())
        .map(|(k, line)| {
            let content = line.split('*').next().unwrap_or_default();
            if k % 2 == 0 { format!("{content}*00\r\n") } else { format!("{content}\r\n") }
        })
        .collect();
    let refused = read(wrong.as_bytes(), "").unwrap_err();
    assert!(refused.contains("checksum = \"ignore\""), "{refused}");
    let (a, b) = (
        read(wrong.as_bytes(), "checksum = \"ignore\"").unwrap(),
        read(right.as_bytes(), "").unwrap(),
    );
    assert_eq!(a.samples, b.samples);
    let count = "24 sentences used without their right checksum, the first at byte 0";
    assert!(a.warnings.iter().flatten().any(|w| w.contains(count)), "{:?}", a.warnings);
}

#[test]
fn one_of_several_talkers_is_chosen() {
    let gga = |talker: &str, quality: &str| {
        sentence(&format!("{talker}GGA,083000,3204.0,N,03459.5,E,{quality},9,1,5,M,0,M,,"))
    };
    let file = format!("{}{}", gga("GN", "1"), gga("IN", "6"));
    assert_eq!(read(file.as_bytes(), "talker = \"GN\"").unwrap().samples[0].len(), 1);
    let error = read(file.as_bytes(), "talker = \"GP\"").err().unwrap();
    assert!(error.contains("no valid GGA or RMC with a time; it has GNGGA, INGGA"), "{error}");
}

#[test]
fn what_cannot_be_read_is_an_error_with_a_remedy() {
    let (good, keys) = (recording(2), "gnss = \"gnss\"");
    let hdt = sentence("GPHDT,10.0,T");
    for (file, keys, words) in [
        ("nothing of this kind", keys, ["no intact sentence of NMEA 0183", "baud rate"]),
        ("", keys, ["nav.nmea", "no intact sentence"]),
        (&hdt, "heading = \"compass\"", ["no valid HDT or THS with a time", "record ZDA"]),
        (&good, "gnss = \"gps\"", ["there is no [sensor.gps]", "(sensors: "]),
        (&good, "gnss = \"depth\"", ["the channel lat", "[sensor.depth]"]),
        (&good, "heading = \"imu\"", ["heading", "the channel heading"]),
        (&good, "time.first_day = \"2022-06-01\"", ["dates of its own", "time.origin"]),
        (&good, "time.origin = \"June\"", ["is no date", "time"]),
    ] {
        let error = read(file.as_bytes(), keys).err().unwrap();
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    }
}

#[test]
#[ignore = "it measures"]
fn speed_of_reading() {
    let seconds = 1800;
    let text = recording(seconds);
    measure("nmea", text.len(), seconds as usize, || {
        let folder = tempfile::tempdir().unwrap();
        let scenario = scenario(&folder, text.as_bytes(), "gnss = \"gnss\"");
        let (mut sources, _) = recording::open(&registry(), folder.path(), &scenario).unwrap();
        let (source, mut sample) = (&mut sources[0], Sample::empty(Time::MIN, SensorId(0)));
        (0..).take_while(|_| source.next(&mut sample).unwrap()).count()
    });
}
