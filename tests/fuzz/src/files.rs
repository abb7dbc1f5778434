//! Readers that open a file.

use crate::in_folder;
use navfuse_campaign::{Campaign, Folder, JobCount, Options};
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::model::stream::Source;
use navfuse_core::plugin::{OpenContext, Registry, SourceType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_import::Answers;
use navfuse_mcap::{LogReader, McapSource, read_scenario};
use navfuse_testing::recording::{AIDS, INERTIAL};
use serde_json::{Value, from_value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

/// Samples that are read of one file.
const SAMPLES: usize = 100_000;

/// The scenario of the quickstart, whose samples are simulated.
const QUICKSTART: &str = include_str!("../../../scenarios/quickstart.toml");

/// The types of the scenarios in the corpus.
pub fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_csv::CsvPlugin);
    registry
}

fn composition() -> &'static Composition {
    fn compose() -> &'static Composition {
        // a vehicle whose sensors every source can fill
        let text = format!("{INERTIAL}{AIDS}");
        let document = Document::parse("fuzz.toml", text).unwrap();
        let composition = Scenario::new(&registry(), document, &[]).unwrap().compose().unwrap();
        Box::leak(Box::new(composition))
    }
    thread_local! {
        static COMPOSITION: &'static Composition = compose();
    }
    COMPOSITION.with(|composition| *composition)
}

/// The number of samples that the sources of a type give for a file of this name.
fn samples<S: SourceType>(keys: Value, name: &str, bytes: &[u8]) -> usize {
    in_folder(|folder| {
        std::fs::write(folder.join(name), bytes).unwrap();
        let source: S = from_value(keys).unwrap();
        let opened = source.open(&OpenContext::new(composition(), folder.to_owned()));
        opened.unwrap_or_default().into_iter().map(|mut source| drain(&mut *source)).sum()
    })
}

/// The number of samples that a source gives.
fn drain(source: &mut dyn Source) -> usize {
    let (mut sample, mut count) = (Sample::empty(Time::MIN, SensorId(0)), 0);
    while count < SAMPLES && source.next(&mut sample).unwrap_or(false) {
        count += 1;
    }
    drop(source.warning());
    count
}

/// A recording of NMEA 0183, whose sentences fill four sensors.
pub fn nmea(bytes: &[u8]) -> usize {
    let keys = json!({
        "file": "nav.nmea", "gnss": "gnss", "heading": "compass", "depth": "depth",
        "reference": "reference",
    });
    samples::<navfuse_nmea::Nmea>(keys, "nav.nmea", bytes)
}

/// A bag of ROS 2, in either storage: its survey, and its samples.
pub fn bag(bytes: &[u8]) -> usize {
    let keys = json!({ "path": "fuzz.bag", "sensors": { "imu": { "topic": "/imu" } } });
    let count = samples::<navfuse_ros2::Ros2>(keys, "fuzz.bag", bytes);
    let survey = in_folder(|folder| {
        let survey = navfuse_ros2::survey(&[folder.join("fuzz.bag")], || false);
        survey.ok().flatten().map_or(0, |survey| survey.topics.len())
    });
    count + survey
}

/// A recording in CSV, as it is; with the separator that it has, rows out of order skipped and text
/// as missing values; and, if it has a colon, with dates.
pub fn csv(bytes: &[u8]) -> usize {
    let plain = json!({ "path": "imu.csv" });
    let first = bytes.split(|b| *b == b'\n').next().unwrap_or_default();
    let delimiter = [",", ";", "\t"].into_iter().find(|d| first.contains(&d.as_bytes()[0]));
    let lenient = json!({
        "path": "imu.csv", "disorder": "skip", "nan": "missing",
        "delimiter": delimiter.unwrap_or("whitespace"),
    });
    let dated = json!({ "path": "imu.csv", "time": { "column": "time_s", "format": "date-time" } });
    let forms = [Some(plain), Some(lenient), bytes.contains(&b':').then_some(dated)];
    let count = |file| {
        let keys = json!({ "files": { "imu": file } });
        samples::<navfuse_csv::Csv>(keys, "imu.csv", bytes)
    };
    forms.into_iter().flatten().map(count).sum()
}

/// A recording whose rows name their values: objects of JSON, or lines.
pub fn labels(bytes: &[u8]) -> usize {
    let axes = ["x", "y", "z"];
    let columns = |vector: &str, channel: &str, unit: &str| {
        let column = |k: usize| json!({ "column": format!("{vector}.{k}"), "unit": unit });
        (0..3).map(|k| (format!("{channel}_{}", axes[k]), column(k))).collect::<Vec<_>>()
    };
    let both = [columns("gyro", "gyro", "rad/s"), columns("accel", "accel", "m/s^2")].concat();
    let headings = ["t", "gyro.0", "gyro.1", "gyro.2", "accel.0", "accel.1", "accel.2"];
    let file = json!({
        "path": "imu.json", "labels": true, "headings": headings, "disorder": "skip",
        "nan": "missing", "time": { "column": "t", "unit": "s" },
        "columns": both.into_iter().collect::<serde_json::Map<_, _>>(),
    });
    samples::<navfuse_csv::Csv>(json!({ "files": { "imu": file } }), "imu.json", bytes)
}

/// A file of another program: its recognition, and the samples by which `import` finds units, axes and
/// clocks.
pub fn import(bytes: &[u8]) -> usize {
    in_folder(|folder| {
        let path = folder.join("stranger.txt");
        std::fs::write(&path, bytes).unwrap();
        let (place, stop) = (folder.join("new.toml"), AtomicBool::new(false));
        let found =
            navfuse_import::import(&registry(), &[path], &place, &Answers::default(), &stop);
        let streams = found.ok().flatten().map_or(Vec::new(), |imported| imported.streams);
        streams.iter().map(|stream| stream.samples as usize).sum()
    })
}

/// A log of a run: its scenario, its entries for a report, and its samples for a replay.
pub fn mcap(bytes: &[u8]) -> usize {
    in_folder(|folder| {
        let path = folder.join("run.mcap");
        std::fs::write(&path, bytes).unwrap();
        let mut count = usize::from(read_scenario(&path).is_ok());
        if let Ok(mut log) = LogReader::open(&path) {
            while log.next(|_| count += 1).unwrap_or(false) {}
        }
        let sensors = composition().sensors.iter().map(|s| s.info.clone()).collect();
        if let Ok(mut source) = McapSource::open(&path, sensors, BTreeMap::new()) {
            count += drain(&mut source);
        }
        count
    })
}

/// A scenario: it is parsed and composed, and nothing is opened. The number of states.
pub fn toml(bytes: &[u8]) -> usize {
    static REGISTRY: OnceLock<Registry> = OnceLock::new();
    let Ok(text) = std::str::from_utf8(bytes) else { return 0 };
    let Ok(document) = Document::parse("fuzz.toml", text) else { return 0 };
    let scenario = Scenario::new(REGISTRY.get_or_init(registry), document, &[]);
    scenario.ok().and_then(|s| s.compose().ok()).map_or(0, |c| c.layout.tangent)
}

/// The files of a campaign: the bytes as its definition, as a table of a part, and behind the head
/// of a journal. The number of jobs in the journal, and one for a definition.
pub fn campaign(bytes: &[u8]) -> usize {
    in_folder(|folder| {
        let own = tempfile::tempdir_in(folder).unwrap();
        campaign_in(own.path(), bytes)
    })
}

fn campaign_in(folder: &Path, bytes: &[u8]) -> usize {
    let at = |name: &str| folder.join(name);
    for name in ["campaign.json", "runs.parquet", "bounds.parquet"] {
        std::fs::write(at(name), bytes).unwrap();
    }
    let is_defined = navfuse_campaign::campaign_of(folder).is_ok();
    drop(navfuse_campaign::merge(&[folder.to_owned()], &at("merged")));
    let campaign = quickstart();
    let journal = at("journal");
    drop(Folder::with_journal(Some(&journal), campaign, None).unwrap());
    let path = journal.join("campaign.journal");
    let mut frames = std::fs::read(&path).unwrap_or_default();
    // the bytes as frames, and as the content of one frame with its checksum
    let head = frames.len();
    let mut count = 0;
    let content =
        [&(bytes.len() as u32).to_le_bytes()[..], &crc32fast::hash(bytes).to_le_bytes(), bytes];
    for behind in [bytes, &content.concat()] {
        frames.truncate(head);
        frames.extend_from_slice(behind);
        std::fs::write(&path, &frames).unwrap();
        count += Folder::resume(&journal, campaign, None).map_or(0, |(_, jobs)| jobs);
    }
    count + usize::from(is_defined)
}

/// A campaign of the quickstart.
fn quickstart() -> &'static Campaign {
    static CAMPAIGN: OnceLock<Campaign> = OnceLock::new();
    CAMPAIGN.get_or_init(|| {
        let document = Document::parse("quickstart.toml", QUICKSTART).unwrap();
        let options = Options { runs: 2, ..Options::default() };
        Campaign::new(&registry(), &document, &options).unwrap()
    })
}

/// Writes the files of a campaign of the quickstart without a run into a folder.
pub fn write_campaign(folder: &Path) {
    let folder = Folder::create(Some(folder), quickstart(), None).unwrap();
    drop(folder.finish(JobCount { done: 0, asked: 0 }).unwrap());
}
