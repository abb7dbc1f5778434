//! The estimates of a run as a bag of ROS 2: a folder with an MCAP file and its `metadata.yaml`.
//!
//! | topic | type | content |
//! |---|---|---|
//! | `/odometry` | `nav_msgs/Odometry` | pose of `base_link` in `map`, velocity along `base_link`, covariances |
//! | `/fix` | `sensor_msgs/NavSatFix` | geodetic position and its covariance |
//! | `/tf` | `tf2_msgs/TFMessage` | `base_link` in `map` |
//!
//! Axes are those of REP 103: `map` is east, north, up at the position of the first epoch, and
//! `base_link` is forward, left, up.

use crate::chunk::{Definitions, Topic};
use crate::file::Compression;
use crate::frames::{MAP_FRAME, ROS_BODY_FRAME};
use crate::log::StreamFailure;
use crate::message::Stamp;
use crate::motion::{Motion, Moved};
use crate::pose::Link;
use crate::schema::{self, Schema};
use crate::writer::LogWriter;
use navfuse_core::files::{WholeFile, check_output};
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::units::time::Span;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The name of the file in the folder; rosbag2 numbers the files of a bag.
const FILE: &str = "estimate_0.mcap";
/// The name of the description of the bag in the folder.
const METADATA: &str = "metadata.yaml";
/// The topics with their types, in the order of [`Recording::topics`].
const TOPICS: [(&str, &Schema); 3] =
    [("/odometry", &schema::ODOMETRY), ("/fix", &schema::FIX), ("/tf", &schema::TRANSFORMS)];

/// Sink that writes a bag of ROS 2 with the estimates of position, attitude and velocity.
#[derive(Debug)]
pub struct BagSink {
    folder: PathBuf,
    /// Stamp minus run time.
    origin: Span,
    /// From the start of the run until the bag is whole.
    recording: Option<Recording>,
    /// Number of epochs.
    pub epochs: u64,
    /// Set once the bag is whole.
    pub whole: bool,
}

/// The file to which messages are being written.
#[derive(Debug)]
struct Recording {
    log: LogWriter,
    motion: Motion,
    topics: [Topic; 3],
    /// The first and the last log time, ns.
    span: Option<[u64; 2]>,
}

impl BagSink {
    /// A bag in a folder, which the start of the run makes. The stamps are those of the run plus
    /// `origin`, the nanoseconds since 1970 of the run's zero.
    pub fn new(folder: &Path, origin: i64) -> Self {
        let (folder, origin) = (folder.to_path_buf(), Span::from_nanos(origin));
        Self { folder, origin, recording: None, epochs: 0, whole: false }
    }

    fn file(&self) -> PathBuf {
        self.folder.join(FILE)
    }
}

impl Sink for BagSink {
    fn wants(&self) -> Wants {
        Wants::EPOCHS
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        let motion = Motion::of(&run.layout).ok_or_else(|| {
            StreamError::format("the run has no estimate of a geodetic position and an attitude")
                .with_remedy("use --to csv or --to parquet, which have every state")
        })?;
        std::fs::create_dir_all(&self.folder).map_err(|e| StreamError::write(&self.folder, e))?;
        let metadata = self.folder.join(METADATA);
        check_output(&metadata).map_err(|e| StreamError::write(&metadata, e))?;
        let path = self.file();
        let failed = |e| StreamError::write(&path, e);
        let file = WholeFile::create(&path).map_err(failed)?;
        let mut definitions = Definitions::default();
        let topics = TOPICS.map(|(name, schema)| definitions.topic(name, schema));
        let (version, offset) = (&run.version, self.origin.nanos());
        let zstd = Compression::Zstd;
        let log = LogWriter::begin(file, zstd, version, definitions, offset, |_| Ok(()));
        let log = log.map_err(failed)?;
        self.recording = Some(Recording { log, motion, topics, span: None });
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let Some(recording) = &mut self.recording else { return Ok(()) };
        let written = Stamp::new(epoch.state.time + self.origin)
            .map_err(StreamFailure::from)
            .and_then(|stamp| recording.epoch(epoch, stamp));
        self.epochs += 1;
        if written.is_err() {
            // a bag with a hole never takes its name
            self.recording = None;
        }
        written.map_err(|e| StreamError::write(self.file(), e))
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let Some(mut recording) = self.recording.take() else { return Ok(None) };
        recording.log.finish().map_err(|e| StreamError::write(self.file(), e))?;
        let path = self.folder.join(METADATA);
        let written = WholeFile::create(&path).and_then(|mut file| {
            file.write_all(recording.metadata().as_bytes())?;
            file.finish()
        });
        written.map_err(|e| StreamError::write(&path, e))?;
        self.whole = true;
        Ok(Some(self.folder.display().to_string()))
    }
}

impl Recording {
    fn epoch(&mut self, epoch: &Epoch<'_>, stamp: Stamp) -> Result<(), StreamFailure> {
        let time = epoch.state.time;
        let Moved { position, pose, velocity } = self.motion.at(epoch);
        let of_position = pose.position_covariance();
        let (pose, velocity) = (pose.of_ros(), velocity.of_ros());
        let link = Link {
            parent: MAP_FRAME,
            child: ROS_BODY_FRAME,
            translation: pose.position,
            rotation: pose.attitude,
        };
        let [odometry, fix, frames] = &mut self.topics;
        let (log, body) = (&mut self.log, ROS_BODY_FRAME);
        log.send(odometry, time, |m| m.odometry(stamp, [MAP_FRAME, body], &pose, &velocity))?;
        log.send(fix, time, |m| m.fix(stamp, body, &position, Some(&of_position)))?;
        log.send(frames, time, |m| m.transforms(stamp, std::iter::once(link)))?;
        let now = self.log.log_time(time);
        self.span = Some(self.span.map_or([now; 2], |[from, to]| [from.min(now), to.max(now)]));
        Ok(())
    }

    /// The `metadata.yaml` of rosbag2, in the version of ROS 2 Humble, which later ones read.
    fn metadata(&self) -> String {
        let [from, to] = self.span.unwrap_or_default();
        let counts = self.topics.map(|t| t.sequence);
        let (duration, count) = (to - from, counts.map(u64::from).iter().sum::<u64>());
        let mut text = format!(
            "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  \
             duration:\n    nanoseconds: {duration}\n  \
             starting_time:\n    nanoseconds_since_epoch: {from}\n  \
             message_count: {count}\n  topics_with_message_count:\n"
        );
        for ((name, schema), count) in TOPICS.iter().zip(counts) {
            let kind = schema.name;
            // writing to a text cannot fail
            let _ = write!(
                text,
                "    - topic_metadata:\n        name: {name}\n        type: {kind}\n        \
                 serialization_format: cdr\n        offered_qos_profiles: \"\"\n      \
                 message_count: {count}\n"
            );
        }
        text + &format!(
            "  compression_format: \"\"\n  compression_mode: \"\"\n  \
             relative_file_paths:\n    - {FILE}\n  files:\n    - path: {FILE}\n      \
             starting_time:\n        nanoseconds_since_epoch: {from}\n      \
             duration:\n        nanoseconds: {duration}\n      message_count: {count}\n"
        )
    }
}
