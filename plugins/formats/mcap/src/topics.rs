//! The topics of a log, and the messages written to each.

use crate::chunk::{Definitions, Topic};
use crate::frames::Frames;
use crate::lanes::Lanes;
use crate::log::StreamFailure;
use crate::message::{BODY_FRAME, FIXED_FRAME, Stamp};
use crate::motion::{Motion, Moved};
use crate::schema;
use crate::shown::Shown;
use crate::template::{BlockMessage, ImuMessage, SampleMessage};
use crate::writer::LogWriter;
use navfuse_core::model::record::{Epoch, InputRejection, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::RunInfo;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{MAX_TANGENT, Position};
use navfuse_core::state::{Block, Layout};
use navfuse_core::units::sample::{Channel, Sample};
use std::any::TypeId;

/// All topics of a run.
#[derive(Debug)]
pub struct Topics {
    /// By sensor id.
    pub sensors: Vec<SensorTopics>,
    /// Topics of the estimate.
    pub estimate: Estimate,
    /// `/log`
    pub events: Topic,
    /// `/finding`
    pub findings: Topic,
    /// `/rejection`
    pub rejections: Topic,
    /// `/derived`
    pub derived: Topic,
    /// `/filtered/OWNER/NAME` of a run that is smoothed: the filter's own estimate.
    pub filtered: Blocks,
    /// Topics for those who look at the log.
    pub shown: Shown,
    /// `/health/NAME`
    pub lanes: Lanes,
}

impl Topics {
    /// Opens the topics of a run, in the order of its sensors and blocks.
    pub fn open(log: &mut Definitions, run: &RunInfo) -> Self {
        Self {
            sensors: run.sensors.iter().map(|s| SensorTopics::open(log, s)).collect(),
            estimate: Estimate::open(log, run),
            events: log.topic("/log", &schema::LOG),
            findings: log.topic("/finding", &schema::FINDING),
            rejections: log.topic("/rejection", &schema::REJECTION),
            derived: log.topic("/derived", &schema::DERIVED),
            filtered: match run.smoothed {
                true => Blocks::open(log, &run.layout, "/filtered"),
                false => Blocks(Vec::new()),
            },
            // the last ones: the others keep their numbers
            shown: Shown::open(log, run),
            lanes: Lanes::open(log, run),
        }
    }
}

/// Metadata key of the channel of the samples of a sensor: its registered type.
pub const KIND: &str = "type";
/// Metadata key as [`KIND`]: the purpose `input`, `measurement` or `reference`.
pub const PURPOSE: &str = "purpose";

fn purpose_word(purpose: Purpose) -> &'static str {
    match purpose {
        Purpose::Input => "input",
        Purpose::Measurement => "measurement",
        Purpose::Reference => "reference",
    }
}

/// The purpose that a word stands for.
pub fn purpose(word: &str) -> Option<Purpose> {
    [Purpose::Input, Purpose::Measurement, Purpose::Reference]
        .into_iter()
        .find(|p| purpose_word(*p) == word)
}

/// The channels that a `sensor_msgs/Imu` holds, in its order.
pub const RATES: [(&str, &str); 6] = [
    ("gyro_x", "radps"),
    ("gyro_y", "radps"),
    ("gyro_z", "radps"),
    ("accel_x", "mps2"),
    ("accel_y", "mps2"),
    ("accel_z", "mps2"),
];

/// The topics of a sensor.
#[derive(Debug)]
pub struct SensorTopics {
    name: String,
    columns: Vec<String>,
    message: SensorMessage,
    samples: Topic,
    also: Also,
    /// `/innovation/NAME` of a measuring sensor.
    innovation: Option<Topic>,
}

/// The message of a sample.
#[derive(Debug)]
enum SensorMessage {
    Imu(ImuMessage),
    Sample(SampleMessage),
}

/// An additional message for each sample, for other tools.
#[derive(Debug)]
enum Also {
    Nothing,
    /// The pressure of a sensor whose only channel is a depth.
    Pressure(Topic),
    /// The fix, from the channels of latitude, longitude and height.
    Fix(Topic, [usize; 3]),
}

impl SensorTopics {
    fn open(log: &mut Definitions, info: &SensorInfo) -> Self {
        let name = &info.name;
        let imu = info.channels == Channel::all(RATES);
        let of = [(KIND, info.kind.clone()), (PURPOSE, purpose_word(info.purpose).to_owned())];
        let of = of.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        let samples = log.described(
            &format!("/sensor/{name}"),
            if imu { &schema::IMU } else { &schema::SAMPLE },
            &of,
        );
        let find = |name, unit| info.channels.iter().position(|c| *c == Channel::new(name, unit));
        let also = if info.channels == [Channel::new("depth", "m")] {
            Also::Pressure(log.topic(&format!("/sensor/{name}/pressure"), &schema::PRESSURE))
        } else if info.purpose == Purpose::Reference
            && let (Some(lat), Some(lon), Some(height)) =
                (find("lat", "rad"), find("lon", "rad"), find("height", "m"))
        {
            Also::Fix(
                log.topic(&format!("/reference/{name}/fix"), &schema::FIX),
                [lat, lon, height],
            )
        } else {
            Also::Nothing
        };
        let innovation = match info.purpose {
            Purpose::Measurement => {
                Some(log.topic(&format!("/innovation/{name}"), &schema::INNOVATION))
            }
            Purpose::Input | Purpose::Reference => None,
        };
        let columns: Vec<String> = info.channels.iter().map(Channel::column).collect();
        let message = match imu {
            true => SensorMessage::Imu(ImuMessage::default()),
            false => SensorMessage::Sample(SampleMessage::new(name, &columns)),
        };
        Self { name: name.clone(), columns, message, samples, also, innovation }
    }

    pub fn sample(&mut self, log: &mut LogWriter, sample: &Sample) -> Result<(), StreamFailure> {
        let stamp = Stamp::new(sample.time)?;
        let message = match &mut self.message {
            SensorMessage::Imu(imu) => imu.of(stamp, sample),
            SensorMessage::Sample(other) => other.of(stamp, sample),
        };
        log.send(&mut self.samples, sample.time, |m| m.whole(message))?;
        match &mut self.also {
            Also::Nothing => Ok(()),
            Also::Pressure(topic) => match sample.get(0) {
                Some(depth) => log.send(topic, sample.time, |m| m.pressure(stamp, depth)),
                None => Ok(()),
            },
            Also::Fix(topic, channels) => match channels.map(|i| sample.get(i)) {
                [Some(latitude), Some(longitude), Some(height)] => {
                    let position = Geodetic { latitude, longitude, height };
                    log.send(topic, sample.time, |m| m.fix(stamp, BODY_FRAME, &position, None))
                }
                _ => Ok(()),
            },
        }
    }

    pub fn update(
        &mut self,
        log: &mut LogWriter,
        update: &UpdateRecord<'_>,
    ) -> Result<(), StreamFailure> {
        let Some(topic) = &mut self.innovation else { return Ok(()) };
        let stamp = Stamp::new(update.time)?;
        log.send(topic, update.time, |m| m.innovation(stamp, &self.name, &self.columns, update))
    }
}

impl Topic {
    /// Writes the rejection of a sample of a driving sensor.
    pub fn rejection(
        &mut self,
        log: &mut LogWriter,
        sensor: &SensorTopics,
        rejection: &InputRejection,
    ) -> Result<(), StreamFailure> {
        let (stamp, reason) =
            (Stamp::new(rejection.time)?, rejection.reason.reason(&sensor.columns));
        log.send(self, rejection.time, |m| m.rejection(stamp, &sensor.name, &reason))
    }
}

/// The topics of the estimate.
#[derive(Debug)]
pub struct Estimate {
    blocks: Blocks,
    navigation: Option<Navigation>,
}

/// The topics of a state that has a position and an attitude.
#[derive(Debug)]
struct Navigation {
    motion: Motion,
    odometry: Topic,
    fix: Topic,
    frames: Frames,
}

impl Estimate {
    fn open(log: &mut Definitions, run: &RunInfo) -> Self {
        let blocks = Blocks::open(log, &run.layout, "/state");
        let navigation = Motion::of(&run.layout).map(|motion| Navigation {
            motion: motion.from_height_zero(),
            odometry: log.topic("/estimate/odometry", &schema::ODOMETRY),
            fix: log.topic("/estimate/fix", &schema::FIX),
            frames: Frames::open(log, run),
        });
        Self { blocks, navigation }
    }

    pub fn epoch(&mut self, log: &mut LogWriter, epoch: &Epoch<'_>) -> Result<(), StreamFailure> {
        if let Some(navigation) = &mut self.navigation {
            navigation.epoch(log, Stamp::new(epoch.state.time)?, epoch)?;
        }
        self.blocks.epoch(log, epoch)
    }
}

/// The topics of all blocks, by slot, and their messages.
#[derive(Debug)]
pub struct Blocks(Vec<(Topic, BlockMessage)>);

impl Blocks {
    /// Opens `ROOT/OWNER/NAME` for each block.
    fn open(log: &mut Definitions, layout: &Layout, root: &str) -> Self {
        let topic = |block: &Block| {
            let name = format!("{root}/{}", block.name.replace('.', "/"));
            let geodetic = block.operations.kind == TypeId::of::<Position>();
            (log.topic(&name, &schema::BLOCK), BlockMessage::new(block, geodetic))
        };
        Self(layout.blocks.iter().map(topic).collect())
    }

    /// Writes the estimate of each block.
    pub fn epoch(&mut self, log: &mut LogWriter, epoch: &Epoch<'_>) -> Result<(), StreamFailure> {
        let stamp = Stamp::new(epoch.state.time)?;
        let values = &epoch.state.values;
        for (slot, block) in epoch.layout.blocks.iter().enumerate() {
            let Some((topic, message)) = self.0.get_mut(slot) else { continue };
            let [mut estimate, mut sigma, mut error] = [[0.0; MAX_TANGENT]; 3];
            block.show(values, &mut estimate);
            block.show_sigma(values, epoch.covariance, &mut sigma);
            let truth = epoch.truth.filter(|t| t.known[slot]);
            if let Some(truth) = truth {
                truth.show_error(epoch.layout, slot, epoch.state, &mut error);
            }
            let error = truth.map(|_| &error[..]);
            let message = message.of(stamp, &estimate, &sigma, error);
            log.send(topic, epoch.state.time, |m| m.whole(message))?;
        }
        Ok(())
    }
}

impl Navigation {
    fn epoch(
        &mut self,
        log: &mut LogWriter,
        stamp: Stamp,
        epoch: &Epoch<'_>,
    ) -> Result<(), StreamFailure> {
        let time = epoch.state.time;
        let Moved { position, pose, velocity } = self.motion.at(epoch);
        let of_position = pose.position_covariance();
        let frames = [FIXED_FRAME, BODY_FRAME];
        log.send(&mut self.odometry, time, |m| m.odometry(stamp, frames, &pose, &velocity))?;
        log.send(&mut self.fix, time, |m| m.fix(stamp, BODY_FRAME, &position, Some(&of_position)))?;
        self.frames.epoch(log, stamp, epoch, &pose)
    }
}
