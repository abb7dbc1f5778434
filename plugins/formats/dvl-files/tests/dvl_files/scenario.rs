//! The source in a scenario: sensors, clock, coordinates, errors with remedies, and conformance.

use crate::generate::{Ensemble, ad2cp, json, pd4, profiler, records};
use navfuse_core::document::Document;
use navfuse_core::plugin::{Plugin, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_dvl_files::{DvlFilesPlugin, Format};
use navfuse_testing::recording::{self, INERTIAL};

const DVL: &str = "[sensor.dvl]\nnoise = \"2 cm/s\"\n";
const BEAMS: &str = "[sensor.dvl]\ntype = \"dvl-beams\"\nnoise = \"2 cm/s\"\n";

/// The samples of a file and the source's warning.
struct Read {
    samples: Vec<Sample>,
    warning: Option<String>,
}

impl Read {
    fn seconds(&self) -> Vec<f64> {
        self.samples.iter().map(|s| s.time.seconds()).collect()
    }
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&DvlFilesPlugin);
    registry
}

/// Reads a file with the keys of its source. Errors omit the path of the folder.
fn read(file: &[u8], sensors: &str, keys: &str) -> Result<Read, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("dive.bin"), file).unwrap();
    let text = format!("{INERTIAL}{sensors}[source.dvl-file]\nfile = \"dive.bin\"\n{keys}\n");
    let mut reading = recording::read(&registry(), folder.path(), &text)?;
    Ok(Read { samples: reading.samples.remove(0), warning: reading.warnings.remove(0) })
}

fn error(file: &[u8], sensors: &str, keys: &str) -> String {
    match read(file, sensors, keys) {
        Err(error) => error,
        Ok(read) => panic!("{} samples", read.samples.len()),
    }
}

#[test]
fn every_format_gives_samples_to_the_only_dvl_without_a_key() {
    for format in Format::ALL {
        let read = read(&records(format.name(), 20).concat(), DVL, "").unwrap();
        assert_eq!((read.samples.len(), &read.warning), (20, &None), "{format:?}");
        let axes = read.samples[7].array::<3>(0).unwrap();
        let error = axes.iter().zip([1.5, -0.1, 0.02]).map(|(a, b)| (a - b).abs());
        assert!(error.fold(0.0, f64::max) < 1e-6, "{format:?}: {axes:?}");
        // 2022-06-01T08:30 in seconds since 1970; PD4 has the time of the day alone
        let start = if format == Format::Pd4 { 8.5 * 3600.0 } else { 1_654_072_200.0 };
        assert!((0.0..1.0).contains(&(read.seconds()[0] - start)), "{format:?}");
    }
}

#[test]
fn the_clock_of_the_run_begins_at_the_origin() {
    let pd0 = records("pd0", 3).concat();
    let origin = "time = { origin = \"2022-06-01T08:29:00Z\", offset = \"-0.25 s\" }";
    assert_eq!(read(&pd0, DVL, origin).unwrap().seconds(), [59.75, 60.25, 60.75]);
    let pd4 = records("pd4", 2).concat();
    let day = "time = { origin = \"2022-06-01T08:00:00\", first_day = \"2022-06-02\" }";
    assert_eq!(read(&pd4, DVL, day).unwrap().seconds(), [88_200.0, 88_200.5]);
}

#[test]
fn a_key_of_the_clock_that_the_format_does_not_have_is_rejected() {
    let (pd0, pd4) = (records("pd0", 3).concat(), records("pd4", 3).concat());
    let (v2, _) = (String::from_utf8(json(1, [1.0; 3], true)).unwrap(), ());
    let v2 = v2.replace("\"time_of_validity\":1,", "");
    for (file, keys, words) in [
        (&pd4[..], "time.origin = \"2022-06-01\"", ["no date", "time.first_day"]),
        (&pd0, "time.first_day = \"2022-06-01\"", ["dates of its own", "time.origin"]),
        (v2.as_bytes(), "time.origin = \"2022-06-01\"", ["no date", "time.offset"]),
        (&pd0, "time.origin = \"1 June 2022\"", ["is no date", "2022-06-01"]),
        (&pd4, "time.first_day = \"2022-06-01T08:00\"", ["without a time", "time.first_day"]),
        (&pd0, "time.offset = \"100 year\"", ["unit", "time.offset"]),
    ] {
        let error = error(file, DVL, keys);
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    }
}

#[test]
fn bottom_track_water_track_and_depth_go_to_their_sensors() {
    let sensors = "[process.water]\ntype = \"water-current\"\ncurrent = { sigma = \"10 cm/s\" }\n\
                   [sensor.dvl]\nnoise = \"2 cm/s\"\n\
                   [sensor.wt]\ntype = \"dvl\"\ntrack = \"water\"\ncurrent = \"water\"\nnoise = \"2 cm/s\"\n\
                   [sensor.depth]\nnoise = \"10 cm\"\n";
    let ensemble = Ensemble { water: [50, -1000, 20, 0], ..Ensemble::default() };
    let file = [ensemble.clone().at(0).bytes(), ensemble.at(100).bytes()].concat();
    let keys = "bottom_track = \"dvl\"\nwater_track = \"wt\"\ndepth = \"depth\"";
    let read = self::read(&file, sensors, keys).unwrap();
    assert_eq!(read.samples.len(), 6);
    let values: Vec<Option<f64>> = read.samples[..3].iter().map(|s| s.get(0)).collect();
    assert_eq!(values, [Some(1.5), Some(1.0), Some(12.3)]);
    let only = self::read(&file, sensors, "depth = \"depth\"").unwrap();
    assert_eq!(only.samples.len(), 2);
    let words = error(&file, sensors, "");
    assert!(words.contains("dvl, wt") && words.contains("bottom_track"), "{words}");
}

#[test]
fn a_sensor_that_does_not_fit_is_rejected_with_a_remedy() {
    let file = records("pd0", 2).concat();
    for (keys, words) in [
        ("bottom_track = \"dlv\"", ["bottom_track", "did you mean \"dvl\"?"]),
        ("depth = \"dvl\"", ["depth", "vel_x, vel_y, vel_z"]),
        ("bottom_track = \"imu\"", ["beam_1", "gyro_x"]),
    ] {
        let error = error(&file, DVL, keys);
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    }
    let none = error(&file, "", "");
    assert!(none.contains("no sensor of type") && none.contains("bottom_track"), "{none}");
    // a sensor that the scenario disables may keep its key
    let disabled = format!("{DVL}enabled = false\n");
    assert_eq!(read(&file, &disabled, "bottom_track = \"dvl\"").unwrap().samples.len(), 0);
}

#[test]
fn ship_and_earth_coordinates_are_refused_or_turned_back() {
    for coordinates in [2, 3] {
        let file = Ensemble { coordinates, ..Ensemble::default() }.bytes();
        let error = error(&file, DVL, "");
        assert!(error.contains("dive.bin") && error.contains("attitude = \"file\""), "{error}");
        let turned = read(&file, DVL, "attitude = \"file\"").unwrap();
        assert_eq!(turned.samples[0].array::<3>(0), Some([1.5, -0.1, 0.02]));
    }
    // PD4 has no attitude, and the bottom track of a profiler in ENU is not turned back
    let pd4 = pd4(false, 0xe0, [1, 2, 3, 4], [i16::MIN; 4], [8, 0, 0, 0], 0);
    let enu = ad2cp(0x17, &profiler(0, 0, [1; 4], [20_000; 4], [1; 4]), false);
    for file in [pd4, enu] {
        for keys in ["", "attitude = \"file\""] {
            let error = error(&file, DVL, keys);
            assert!(error.contains("Earth") && error.contains("set the instrument"), "{error}");
        }
    }
}

#[test]
fn beams_go_to_a_sensor_of_beams_and_axes_to_one_of_axes() {
    let beams = Ensemble { coordinates: 0, bottom: [1, 2, 3, i16::MIN], ..Ensemble::default() };
    let sample = read(&beams.bytes(), BEAMS, "").unwrap().samples[0];
    assert_eq!([0, 1, 2, 3].map(|k| sample.get(k)), [Some(0.001), Some(0.002), Some(0.003), None]);
    let axes = error(&Ensemble::default().bytes(), BEAMS, "");
    assert!(axes.contains("instrument coordinates") && axes.contains("type \"dvl\""), "{axes}");
    let nortek = ad2cp(0x17, &profiler(2, 0, [1; 4], [20_000; 4], [1; 4]), false);
    let error = error(&nortek, DVL, "");
    assert!(error.contains("along the beams") && error.contains("dvl-beams"), "{error}");
    assert_eq!(read(&nortek, BEAMS, "").unwrap().samples[0].present(), 0b1111);
}

/// The mean of vertical ranges, or the height that an instrument of Water Linked reports: its ranges
/// are along the beams.
#[test]
fn the_altitude_is_the_height_above_the_bottom_where_the_sensor_has_the_channel() {
    let sensor = format!("{DVL}altitude = true\n");
    for (format, altitude) in [
        ("pd0", Some(186.35)),
        ("pd4", Some(12.015)),
        ("pd6", None),
        ("ad2cp", Some(20.15)),
        ("nortek-nmea", Some(23.45)),
        ("water-linked-json", Some(0.49)),
        ("water-linked-serial", Some(1.3)),
    ] {
        let file = records(format, 2).concat();
        let found = read(&file, &sensor, "").unwrap().samples[0].get(3);
        // the ranges of AD2CP are numbers of 32 bits
        let near = |(a, b): (f64, f64)| (a - b).abs() < 1e-6;
        assert_eq!(found.is_some(), altitude.is_some(), "{format}");
        assert!(found.zip(altitude).is_none_or(near), "{format}: {found:?}");
        assert_eq!(read(&file, DVL, "").unwrap().samples[0].get(3), None, "{format}");
    }
}

/// The 45 deg mounting: beam 3 points 45 deg to starboard. The misalignment is the attitude of the
/// body from the instrument, whose bow is then 45 deg to port: a yaw of -45 deg. A filter that moves
/// forward at 1 m/s predicts the velocities in the file.
#[test]
fn a_mounting_of_45_deg_is_a_misalignment_in_yaw() {
    use navfuse_core::filter::Ekf;
    use navfuse_core::model::record::{Epoch, Event, Observer, Rejection, UpdateRecord};
    struct Innovation(Vec<f64>);
    impl Observer for Innovation {
        fn epoch(&mut self, _: &Epoch<'_>) {}
        fn update(&mut self, update: &UpdateRecord<'_>) {
            self.0.extend(update.innovation.iter());
        }
        fn input(&mut self, _: &Sample, _: Option<Rejection>) {}
        fn event(&mut self, _: Event) {}
    }
    // forward is 45 deg to port of beam 3: cos(45 deg) along beam 3, and as much to the left of it
    let (x, y) = (707, -707);
    let file = Ensemble { bottom: [x, y, 0, 0], ..Ensemble::default() }.bytes();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("dive.pd0"), file).unwrap();
    let filter = INERTIAL.replace("\"0 m/s\"", "[\"1 m/s\", \"0 m/s\", \"0 m/s\"]");
    let text = format!(
        "{filter}{DVL}misalignment = {{ initial = [\"0 deg\", \"0 deg\", \"-45 deg\"] }}\n\
         [source.dvl-file]\nfile = \"dive.pd0\"\ntime.origin = \"2022-06-01T08:30:00\"\n"
    );
    let registry = registry();
    let name = folder.path().join("test.toml").display().to_string();
    let document = Document::parse(name, text).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    let mut assembly = scenario.assemble(None).unwrap();
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    assert!(assembly.sources[0].1.next(&mut sample).unwrap());
    let (mut ekf, mut seen) = (Ekf::new(assembly.composition), Innovation(Vec::new()));
    for k in 0..3 {
        let at = Time::from_nanos(k * 10_000_000);
        let still = Sample::new(at, SensorId(0), &[0.0, 0.0, 0.0, 0.0, 0.0, -9.8]);
        ekf.process(&still, &mut seen).unwrap();
        if k == 0 {
            ekf.process(&sample, &mut seen).unwrap();
        }
    }
    assert_eq!(seen.0.len(), 3);
    // 707 mm/s are 0.1 mm/s from cos(45 deg); an axis with the wrong sign would be 1.4 m/s off
    assert!(seen.0.iter().all(|i| i.abs() < 0.01), "{:?}", seen.0);
}

#[test]
fn limits_leave_out_beams_and_pings_and_are_counted() {
    let good = Ensemble::default();
    let poor = Ensemble {
        bottom: [100, -1500, 20, 300],
        percent_good: [100, 100, 20, 20],
        correlation: [200, 50, 50, 200],
        ..Ensemble::default()
    };
    let file =
        [good.clone().at(0).bytes(), poor.clone().at(50).bytes(), good.at(100).bytes()].concat();
    for limit in ["error_velocity = \"10 cm/s\"", "percent_good = \"50 %\"", "correlation = 0.5"] {
        let read = read(&file, DVL, &format!("screen = {{ {limit} }}")).unwrap();
        assert_eq!(read.samples.len(), 2, "{limit}");
        let warning = read.warning.unwrap();
        assert!(warning.contains("1 ping beyond the limits of `screen` at byte "), "{warning}");
    }
    let beams = Ensemble { coordinates: 0, ..poor };
    let read = read(&beams.bytes(), BEAMS, "screen = { percent_good = \"50 %\" }").unwrap();
    assert_eq!(read.samples[0].present(), 0b0011);
}

#[test]
fn damage_and_stamps_are_reported_with_offset_and_count() {
    let ensemble = Ensemble::default();
    let zero = Ensemble { clock: [0; 7], century: None, ..Ensemble::default() };
    let mut file = b"noise".to_vec();
    for k in [0, 50, 100] {
        file.extend(ensemble.clone().at(k).bytes());
    }
    let size = ensemble.bytes().len();
    file.extend(zero.bytes());
    file.extend(ensemble.clone().at(20).bytes());
    let mut wrong = ensemble.clone().at(150).bytes();
    wrong[100] ^= 1;
    file.extend(wrong);
    file.extend(ensemble.clone().at(200).bytes());
    file.extend(&ensemble.at(250).bytes()[..100]);
    let read = read(&file, DVL, "time.origin = \"2022-06-01T08:30:00\"").unwrap();
    assert_eq!(read.seconds(), [0.0, 0.5, 1.0, 2.0]);
    let at = |k: usize| 5 + k * size;
    let expected = format!(
        "dive.bin: skipped {} bytes in 3 places that hold no intact ensemble (at byte 0: 5 bytes; \
         at byte {}: {size} bytes, wrong checksum; at byte {}: 100 bytes); wrong checksums in 1 \
         place; the file ends within the ensemble at byte {}; 1 ping left out without a valid \
         time within 73 years of the run's zero at byte {}; 1 ping left out, not later than the \
         one before at byte {} (by up to 0.80 \
         s)",
        5 + size + 100,
        at(5),
        at(7),
        at(7),
        at(3),
        at(4)
    );
    assert_eq!(read.warning.unwrap(), expected);
}

#[test]
fn a_file_without_what_is_needed_is_rejected_at_once() {
    let lost = Ensemble { bottom: [i16::MIN; 4], ..Ensemble::default() }.bytes();
    let error_of = |file: &[u8], keys| error(file, DVL, keys);
    let error = error_of(&lost, "");
    assert!(error.contains("1 pings, and none with a valid bottom track"), "{error}");
    let error = error_of(b"time_s,vel_x_mps\n", "");
    assert!(error.contains("known format") && error.contains("`format`: pd0, pd4"), "{error}");
    let error = error_of(b"", "");
    assert!(error.contains("the file is empty"), "{error}");
    let error = error_of(b"no ensemble", "format = \"pd0\"");
    assert!(error.contains("no intact ensemble") && error.contains("at byte 0"), "{error}");
    let error = error_of(&lost, "format = \"pdo\"");
    assert!(error.contains("pd0"), "{error}");
    let missing = error_of(&lost, "").replace("dive.bin", "");
    assert!(!missing.is_empty());
}

#[test]
fn the_source_conforms() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dive.pd0");
    std::fs::write(&path, records("pd0", 60).concat()).unwrap();
    let text = format!(
        "{INERTIAL}simulation = {{ rate = \"10 Hz\" }}\n{DVL}\
         [source.simulation]\n\
         segments = [{{ type = \"surge\", duration = \"31 s\", speed = \"1 m/s\" }}]\n\
         [source.dvl-file]\nfile = {:?}\ntime.origin = \"2022-06-01T08:30:00\"\n",
        path.display().to_string()
    );
    let others: [&dyn Plugin; 1] = [&navfuse_doppler::DvlPlugin];
    navfuse_conformance::check_with(&[&DvlFilesPlugin], &others, &text).unwrap();
}
