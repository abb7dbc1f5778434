//! Replay of a log: the samples to the bit, from complete logs, cut logs and logs of other
//! programs.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::fixture;
use mcap::records::MessageHeader;
use navfuse_core::model::record::Record;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Sink, Source};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_mcap::{Compression, McapSink, McapSource, read_scenario};
use navfuse_testing::damage::{Random, damaged, files};
use proptest::prelude::*;
use re_cdr::{BigEndian, CdrWriter};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const ALL: [Compression; 3] = [Compression::Zstd, Compression::Lz4, Compression::None];

fn open(path: &Path) -> Result<McapSource, String> {
    McapSource::open(path, fixture::sensors(), BTreeMap::new()).map_err(|e| e.to_string())
}

/// All samples of a source, and its warning.
fn drain(source: &mut McapSource) -> Result<(Vec<Sample>, Option<String>), String> {
    let mut samples = Vec::new();
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    while source.next(&mut sample).map_err(|e| e.to_string())? {
        samples.push(sample);
    }
    Ok((samples, source.warning()))
}

/// Samples compare by bits: NaN is equal to itself.
fn bits(samples: &[Sample]) -> Vec<(i64, usize, u16, Vec<Option<u64>>)> {
    let values = |s: &Sample| (0..16).map(|i| s.get(i).map(f64::to_bits)).collect();
    samples.iter().map(|s| (s.time.nanos(), s.sensor.0, s.present(), values(s))).collect()
}

fn record(path: &Path, compression: Compression, first: Time, count: usize) -> Vec<Sample> {
    let mut sink = fixture::create(path, compression);
    fixture::run(&mut sink, first, count);
    sink.finish().unwrap();
    fixture::samples(first, count)
}

#[test]
fn samples_come_back_to_the_bit_and_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        for first in [-450_000_001, 0, 1_790_000_000_123_456_789] {
            let path = folder.path().join("run.mcap");
            let samples = record(&path, compression, Time::from_nanos(first), 4000);
            let mut source = open(&path).unwrap();
            assert_eq!(source.end(), samples.last().map(|s| s.time));
            let (read, warning) = drain(&mut source).unwrap();
            assert_eq!(bits(&read), bits(&samples));
            assert_eq!(warning, None);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_sample_comes_back_to_the_bit(
        told in prop::collection::vec((
            -2_000_000_000_i64 * 1_000_000_000..2_000_000_000 * 1_000_000_000,
            0_usize..4,
            prop::array::uniform6(prop::option::of(any::<u64>())),
        ), 1..20)
    ) {
        let channels = [6, 3, 1, 4];
        let samples: Vec<Sample> = told.iter().map(|(time, sensor, values)| {
            let mut sample = Sample::empty(Time::from_nanos(*time), SensorId(*sensor));
            for (i, v) in values.iter().enumerate().take(channels[*sensor]) {
                if let Some(v) = v {
                    sample.set(i, f64::from_bits(*v));
                }
            }
            sample
        }).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut sink = fixture::create(&path, Compression::Zstd);
        samples.iter().for_each(|s| sink.take(&Record::Sample(s)).unwrap());
        sink.finish().unwrap();
        let (read, _) = drain(&mut open(&path).unwrap()).unwrap();
        prop_assert_eq!(bits(&read), bits(&samples));
    }
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        let paths = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
        paths.iter().for_each(|path| drop(record(path, compression, Time::from_nanos(-5), 3000)));
        let [a, b] = paths.map(|path| std::fs::read(path).unwrap());
        assert!(a == b, "{compression:?}");
    }
}

#[test]
fn a_log_cut_off_at_any_byte_gives_what_is_before_the_cut_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        let path = folder.path().join(format!("{compression:?}.mcap"));
        let samples = record(&path, compression, Time::from_nanos(-5), 24);
        let whole = bits(&samples);
        let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        let length = file.metadata().unwrap().len();
        let (mut before, mut scenario) = (samples.len(), true);
        for cut in (0..length).rev() {
            file.set_len(cut).unwrap();
            let result = open(&path).and_then(|mut source| drain(&mut source));
            if cut < 8 {
                assert!(result.unwrap_err().contains("not an MCAP file"), "{compression:?} {cut}");
                continue;
            }
            let (read, warning) = result.unwrap_or_else(|e| panic!("{compression:?} {cut}: {e}"));
            assert!(read.len() <= before, "{compression:?} {cut}: a shorter log gives more");
            assert!(
                cut < length - 1 || read.len() == samples.len(),
                "{compression:?}: all samples are before the end"
            );
            // without compression, one byte less costs at most one sample: the reader returns every
            // sample before the cut
            assert!(compression != Compression::None || before - read.len() <= 1, "{cut}");
            assert_eq!(bits(&read), whole[..read.len()], "{compression:?} {cut}");
            before = read.len();
            let warning = warning.unwrap_or_else(|| panic!("{compression:?} {cut}: no warning"));
            assert!(warning.contains(&format!("cut off at byte {cut} ")), "{warning}");
            // the scenario is there unless the cut is before its end
            let found = read_scenario(&path).is_ok();
            assert!(scenario || !found);
            assert!(found || read.is_empty());
            scenario = found;
        }
        assert_eq!(before, 0);
    }
}

#[test]
fn a_writer_that_is_dropped_leaves_a_part_without_a_gap() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::Zstd);
    fixture::run(&mut sink, Time::default(), 100);
    drop(sink);
    // only a run that ended gives the file its name
    assert!(!path.exists());
    let part = folder.path().join("run.mcap.part");
    let (read, warning) = drain(&mut open(&part).unwrap()).unwrap();
    assert_eq!((read.len(), warning), (100, None));
}

#[test]
fn a_run_that_is_killed_leaves_the_chunks_that_were_full() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sink = fixture::create(&path, Compression::None);
    let count = 30_000;
    fixture::run(&mut sink, Time::default(), count);
    // what another process would find now, with the writer still open
    let killed = folder.path().join("killed.mcap");
    std::fs::copy(folder.path().join("run.mcap.part"), &killed).unwrap();
    let size = std::fs::metadata(&killed).unwrap().len();
    let (read, warning) = drain(&mut open(&killed).unwrap()).unwrap();
    assert_eq!(bits(&read), bits(&fixture::samples(Time::default(), count)[..read.len()]));
    assert!(warning.unwrap().contains("cut off"));
    sink.finish().unwrap();
    let missing = std::fs::metadata(&path).unwrap().len() - size;
    // one chunk of 1 MiB, the last message in it, its indexes (16 bytes a message), and the summary
    assert!(
        missing < 2 << 20 && read.len() < count && read.len() > count / 2,
        "{missing} {}",
        read.len()
    );
}

#[test]
fn a_log_that_is_read_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let samples = record(&path, Compression::None, Time::default(), 5000);
    let mut source = open(&path).unwrap();
    let refused = McapSink::create(&path, Compression::None).err().map(|e| e.to_string());
    let refused = refused.expect("the log is an input");
    assert!(refused.contains("run.mcap") && refused.contains("it is an input"), "{refused}");
    let (read, _) = drain(&mut source).unwrap();
    assert_eq!(bits(&read), bits(&samples));
}

fn error_of_writing(path: &str) -> String {
    let mut sink = McapSink::create(Path::new(path), Compression::None).unwrap();
    sink.start(&fixture::info()).unwrap();
    let mut told = fixture::samples(Time::default(), 30_000).into_iter();
    match told.find_map(|s| sink.take(&Record::Sample(&s)).err()) {
        Some(e) => e.to_string(),
        None => sink.finish().unwrap_err().to_string(),
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told_with_the_path_and_what_to_do() {
    let error = error_of_writing("/dev/full");
    assert!(error.starts_with("/dev/full: cannot be written: No space left on device"), "{error}");
    assert!(error.contains("--out"), "{error}");
}

#[test]
#[cfg(unix)]
fn a_closed_pipe_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || drop(std::fs::File::open(pipe).unwrap())
    });
    let error = error_of_writing(pipe.to_str().unwrap());
    reader.join().unwrap();
    assert!(error.contains("Broken pipe"), "{error}");
}

#[test]
fn a_folder_that_is_not_there_is_told() {
    let error = McapSink::create(Path::new("/nowhere/run.mcap"), Compression::Zstd)
        .unwrap_err()
        .to_string();
    assert!(error.starts_with("/nowhere/run.mcap: ") && error.contains("No such file"), "{error}");
}

/// A file with some bytes.
fn file(folder: &tempfile::TempDir, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join("some.mcap");
    std::fs::write(&path, bytes).unwrap();
    path
}

#[test]
fn a_file_that_is_no_log_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for bytes in [&b""[..], b"time_s,gyro_x_radps\n0,1\n", &[0x89; 100], &[0; 100_000]] {
        let path = file(&folder, bytes);
        for error in [open(&path).err().unwrap(), read_scenario(&path).unwrap_err().to_string()] {
            assert!(error.contains("some.mcap: this is not an MCAP file"), "{error}");
        }
    }
    let error = open(Path::new("/nowhere.mcap")).err().unwrap();
    assert!(error.contains("/nowhere.mcap: cannot be opened: No such file"), "{error}");
}

#[test]
fn a_damaged_chunk_costs_its_samples_alone_and_the_warning_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let samples = bits(&record(&path, Compression::Zstd, Time::default(), 60_000));
    let mut bytes = std::fs::read(&path).unwrap();
    let chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    let chunk = &chunks[chunks.len() / 2];
    // the indexes behind a chunk are longer than the chunk, and nothing reads them here
    bytes[(chunk.chunk_start_offset + chunk.chunk_length / 2) as usize] ^= 1;
    let path = file(&folder, &bytes);
    let (read, warning) = open(&path).and_then(|mut source| drain(&mut source)).unwrap();
    let read = bits(&read);
    let before = read.iter().zip(&samples).take_while(|(a, b)| a == b).count();
    let after = read[before..].iter().rev().zip(samples.iter().rev());
    assert!(before > 0 && before < read.len() && read.len() < samples.len(), "{before}");
    assert!(after.clone().count() == read.len() - before && { after }.all(|(a, b)| a == b));
    let warning = warning.unwrap();
    assert!(warning.contains("1 chunk skipped, damaged, at byte"), "{warning}");
}

#[test]
fn a_damaged_log_is_an_error_or_a_cut_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ALL {
        let path = folder.path().join("run.mcap");
        record(&path, compression, Time::default(), 200);
        let bytes = std::fs::read(&path).unwrap();
        let mut draw = common::Draw(3);
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            let (at, bit) = (draw.below(bytes.len() as u64), draw.below(8));
            damaged[at] ^= 1 << bit;
            let path = file(&folder, &damaged);
            drop(open(&path).and_then(|mut s| drain(&mut s)));
            drop(read_scenario(&path));
        }
    }
}

#[test]
fn a_log_with_many_damaged_places_is_an_error_or_a_cut_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let logs = ALL.map(|compression| {
        let path = folder.path().join("run.mcap");
        record(&path, compression, Time::default(), 200);
        std::fs::read(&path).unwrap()
    });
    let (mut read, count) = (0, files(200));
    for (k, log) in logs.iter().enumerate() {
        let other = &logs[(k + 1) % logs.len()];
        for seed in 0..count {
            let path = file(&folder, &damaged(log, other, &mut Random(seed)));
            let samples = open(&path).and_then(|mut s| drain(&mut s));
            read += samples.map_or(0, |(samples, _)| samples.len() as u64);
            drop(read_scenario(&path));
        }
    }
    // a test that reads nothing would pass as well
    assert!(read > count, "{read} samples");
}

#[test]
fn sensors_that_the_scenario_does_not_have_are_skipped_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let samples = record(&path, Compression::Zstd, Time::default(), 100);
    // another order of the sensors, and only two of them
    let sensors: Vec<SensorInfo> = [2, 0].map(|k| fixture::sensors()[k].clone()).into();
    let mut source = McapSource::open(&path, sensors, BTreeMap::new()).unwrap();
    let (read, warning) = drain(&mut source).unwrap();
    let wanted: Vec<Sample> = (samples.into_iter())
        .filter_map(|mut s| {
            s.sensor = SensorId([1, 9, 0, 9][s.sensor.0]);
            (s.sensor.0 < 9).then_some(s)
        })
        .collect();
    assert_eq!(bits(&read), bits(&wanted));
    assert!(warning.unwrap().contains("samples of dvl, truth were skipped"));

    let other = SensorInfo { name: "sonar".into(), ..fixture::sensors()[2].clone() };
    let error = McapSource::open(&path, vec![other], BTreeMap::new()).err().unwrap().to_string();
    assert!(error.contains("(sonar); recorded sensors: imu, dvl, depth, truth"), "{error}");
}

#[test]
fn channels_that_do_not_fit_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    record(&path, Compression::Zstd, Time::default(), 100);
    let mut sensors = fixture::sensors();
    sensors[1].channels[2] = Channel::new("vel_z", "radps");
    let mut source = McapSource::open(&path, sensors, BTreeMap::new()).unwrap();
    let error = drain(&mut source).unwrap_err();
    let wanted = "dvl is recorded with the channels vel_x_mps vel_y_mps vel_z_mps; [sensor.dvl] of \
                  the scenario has vel_x_mps vel_y_mps vel_z_radps";
    assert!(error.contains(wanted), "{error}");
    let mut sensors = fixture::sensors();
    sensors[0].channels[0] = Channel::new("dtheta_x", "rad");
    let error = McapSource::open(&path, sensors, BTreeMap::new()).err().unwrap().to_string();
    assert!(error.contains("imu is recorded with the channels gyro_x_radps"), "{error}");
}

/// A log of another program: an Imu in big-endian CDR, whose log times are those of reception.
fn foreign(path: &Path, schema: &str) {
    let mut writer = mcap::Writer::new(std::fs::File::create(path).unwrap()).unwrap();
    let schema = writer.add_schema(schema, "ros2msg", b"").unwrap();
    let channel = writer.add_channel(schema, "/imu/data", "cdr", &BTreeMap::new()).unwrap();
    for k in 0..3_u32 {
        let mut data = vec![0, 0, 0, 0];
        let mut w = CdrWriter::<BigEndian>::new(&mut data);
        w.write_i32(1_700_000_000);
        w.write_u32(k * 10_000_000);
        w.write_string("imu_link");
        (0..13).for_each(|_| w.write_f64(0.5));
        (0..3).for_each(|i| w.write_f64(f64::from(i + k)));
        (0..9).for_each(|_| w.write_f64(0.5));
        (0..3).for_each(|i| w.write_f64(f64::from(10 + i + k)));
        (0..9).for_each(|_| w.write_f64(0.5));
        let time = 1_700_000_000_500_000_000 + u64::from(k);
        let header =
            MessageHeader { channel_id: channel, sequence: k, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn an_imu_of_another_program_is_read_from_its_topic_at_the_times_of_its_headers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.mcap");
    foreign(&path, "sensor_msgs/msg/Imu");
    let topics = |topic: &str| BTreeMap::from([("imu".to_owned(), topic.to_owned())]);
    let mut source = McapSource::open(&path, fixture::sensors(), topics("/imu/data")).unwrap();
    let (read, warning) = drain(&mut source).unwrap();
    let wanted: Vec<Sample> = (0..3)
        .map(|k| {
            let time = Time::from_nanos(1_700_000_000_000_000_000 + k * 10_000_000);
            let k = k as f64;
            Sample::new(time, SensorId(0), &[k, k + 1.0, k + 2.0, k + 10.0, k + 11.0, k + 12.0])
        })
        .collect();
    assert_eq!((bits(&read), warning), (bits(&wanted), None));

    let error =
        McapSource::open(&path, fixture::sensors(), topics("/imu")).err().unwrap().to_string();
    assert!(error.contains("none of the scenario's sensors"), "{error}");
    assert!(read_scenario(&path).unwrap_err().to_string().contains("give one with --scenario"));
    foreign(&path, "geometry_msgs/msg/Twist");
    let error =
        McapSource::open(&path, fixture::sensors(), topics("/imu/data")).err().unwrap().to_string();
    assert!(error.contains("/imu/data is of type \"geometry_msgs/msg/Twist\""), "{error}");
    let topics = BTreeMap::from([("gyro".to_owned(), "/imu/data".to_owned())]);
    let error = McapSource::open(&path, fixture::sensors(), topics).err().unwrap().to_string();
    assert!(
        error.contains("\"gyro\", which is no sensor of the scenario (imu, dvl, depth, truth)"),
        "{error}"
    );
}
