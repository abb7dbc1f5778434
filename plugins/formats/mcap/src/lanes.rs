//! Topics of the health of the sensors, `/health/NAME`: a message for each change. They are the strips that
//! the viewer draws; nothing reads them again.

use crate::chunk::{Definitions, Topic};
use crate::log::StreamFailure;
use crate::message::{Encoder, Stamp};
use crate::schema;
use crate::writer::LogWriter;
use navfuse_core::model::record::UpdateRecord;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::health::{Judged, Lane};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::RunInfo;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// The topics, by the id of the sensor.
#[derive(Debug)]
pub struct Lanes {
    lanes: Vec<Option<SensorLane>>,
    /// Set for a run that is smoothed: its estimates come after the last sample.
    smoothed: bool,
}

/// The health of one sensor.
#[derive(Debug)]
struct SensorLane {
    name: String,
    drives: bool,
    lane: Lane,
    topic: Topic,
    /// Number of stretches whose begin is written.
    written: usize,
}

impl Lanes {
    /// Opens the topics of all sensors but references.
    pub fn open(log: &mut Definitions, run: &RunInfo) -> Self {
        let lane = |info: &SensorInfo| {
            let topic = (info.purpose != Purpose::Reference)
                .then(|| log.topic(&topic(&info.name), &schema::HEALTH))?;
            Some(SensorLane {
                name: info.name.clone(),
                drives: info.purpose == Purpose::Input,
                lane: Lane::default(),
                topic,
                written: 0,
            })
        };
        Self { lanes: run.sensors.iter().map(lane).collect(), smoothed: run.smoothed }
    }

    fn of(&mut self, sensor: SensorId) -> Option<&mut SensorLane> {
        self.lanes.get_mut(sensor.0)?.as_mut()
    }

    /// Takes a sample; of a measuring sensor the outcome counts instead.
    pub fn sample(&mut self, log: &mut LogWriter, sample: &Sample) -> Result<(), StreamFailure> {
        let Some(lane) = self.of(sample.sensor).filter(|lane| lane.drives) else { return Ok(()) };
        lane.lane.sample(sample.time);
        lane.write(log, sample.time)
    }

    /// Takes the outcome of a sample.
    pub fn update(
        &mut self,
        log: &mut LogWriter,
        update: &UpdateRecord<'_>,
    ) -> Result<(), StreamFailure> {
        let Some(lane) = self.of(update.sensor) else { return Ok(()) };
        lane.lane.update(&Judged::from(update));
        lane.write(log, update.time)
    }

    /// Takes back a sample of a driving sensor, which the filter rejected.
    pub fn reject(
        &mut self,
        log: &mut LogWriter,
        sensor: SensorId,
        time: Time,
    ) -> Result<(), StreamFailure> {
        let Some(lane) = self.of(sensor) else { return Ok(()) };
        lane.lane.reject(time);
        lane.write(log, time)
    }

    /// Takes a finding about sensors or their states.
    pub fn finding(&mut self, log: &mut LogWriter, finding: &Finding) -> Result<(), StreamFailure> {
        let lanes = self.lanes.iter_mut().flatten();
        lanes.filter(|lane| finding.is_about(&lane.name)).try_for_each(|lane| {
            lane.lane.doubt(finding);
            lane.write(log, finding.time)
        })
    }

    /// Notes the time of an estimate, or of the filter's own one in a run that is smoothed, and with it
    /// which sensors are silent.
    pub fn tick(
        &mut self,
        log: &mut LogWriter,
        now: Time,
        filtered: bool,
    ) -> Result<(), StreamFailure> {
        if filtered != self.smoothed {
            return Ok(());
        }
        self.lanes.iter_mut().flatten().try_for_each(|lane| {
            lane.lane.tick(now);
            lane.write(log, now)
        })
    }
}

/// The topic of a sensor's health.
pub fn topic(sensor: &str) -> String {
    format!("/health/{sensor}")
}

impl SensorLane {
    /// Writes the healths that began, at the time when that was known.
    fn write(&mut self, log: &mut LogWriter, now: Time) -> Result<(), StreamFailure> {
        for (health, from) in self.lane.begun(self.written) {
            let stamp = Stamp::new(from)?;
            log.send(&mut self.topic, now, |m| m.health(stamp, health.word()))?;
            self.written += 1;
        }
        Ok(())
    }
}

impl Encoder<'_> {
    /// `navfuse_msgs/Health`.
    fn health(mut self, stamp: Stamp, word: &str) {
        self.header(stamp, "");
        self.text(word);
    }
}
