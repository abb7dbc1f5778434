//! The lane of a sensor in the recording, and the numbers of its samples.

use crate::health::{Health, Judged, Judgement, Lane};
use crate::recording::Recording;
use crate::style::path;
use navfuse_core::model::record::{InputRejection, Outcome, Outcomes, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use re_sdk::EntityPath;
use re_sdk_types::archetypes::{Scalars, SeriesLines, StateChange, StateConfiguration};
use re_sdk_types::components::Color;

/// Width of the line of a sensor while the run goes on.
const THICK: f32 = 10.0;

/// A sensor and its lane.
pub struct SensorLane {
    /// Name of the sensor.
    pub name: String,
    /// Health over time.
    pub lane: Lane,
    /// Numbers of samples by outcome.
    pub outcomes: Outcomes,
    /// Samples that reached the gate, and gated ones, while the vehicle turned.
    pub in_turns: [u64; 2],
    /// Entity of the lane.
    path: EntityPath,
    /// Set for a sensor that corrects the state.
    measures: bool,
    /// Number of stretches whose begin is written.
    written: usize,
}

impl SensorLane {
    /// The lane of a sensor; `None` for a reference.
    pub fn new(info: &SensorInfo) -> Option<Self> {
        (info.purpose != Purpose::Reference).then(|| Self {
            name: info.name.clone(),
            lane: Lane::default(),
            outcomes: Outcomes::default(),
            in_turns: [0; 2],
            path: path(&["health", &info.name]),
            measures: info.purpose == Purpose::Measurement,
            written: 0,
        })
    }

    /// Set where a finding or a reason is about the sensor or one of its states: `dvl.scale`.
    pub fn is_meant_by(&self, about: &str) -> bool {
        about.split(['.', ' ']).next() == Some(&self.name)
    }

    /// Writes the colours of the lane.
    pub fn start(&self, recording: &Recording) -> Result<(), StreamError> {
        let colours = Health::ALL.map(|h| {
            let [r, g, b] = h.colour();
            Color::from_rgb(r, g, b)
        });
        let look = StateConfiguration::new()
            .with_values(Health::ALL.map(Health::word))
            .with_colors(colours);
        recording.log_static(&self.path, &look)
    }

    /// Sends the present health to the viewers that watch, as a point of the `k`-th thick line: their
    /// lanes do not follow the cursor.
    pub fn show(&self, recording: &Recording, k: usize, now: Time) -> Result<(), StreamError> {
        let Some((health, _)) = self.lane.current() else { return Ok(()) };
        let entity = path(&["live", "health", &self.name]);
        let level = k as f64 + 1.0;
        let look = SeriesLines::update_fields()
            .with_names([format!("{level} {}", self.name)])
            .with_widths([THICK]);
        recording.log_static_to_viewers(&entity, &look)?;
        let colour = SeriesLines::update_fields().with_colors([health.colour()]);
        let point =
            Scalars::single(level).columns_of_unit_batches().map_err(|e| recording.error(e))?;
        let colour = colour.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns_to_viewers(&entity, &[now.nanos()], point.chain(colour))
    }

    /// Notes the time, and with it a silence.
    pub fn tick(&mut self, recording: &Recording, now: Time) -> Result<(), StreamError> {
        self.lane.tick(now);
        self.write(recording)
    }

    /// Adds a sample; of a measuring sensor the outcome counts instead.
    pub fn sample(&mut self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        if self.measures {
            return Ok(());
        }
        self.outcomes.accepted += 1;
        self.lane.sample(time);
        self.write(recording)
    }

    /// Takes a finding about the sensor.
    pub fn doubt(&mut self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        self.lane.doubt(time);
        self.write(recording)
    }

    /// Takes back a sample of a driving sensor, which the filter rejected.
    pub fn reject(
        &mut self,
        recording: &Recording,
        rejection: &InputRejection,
    ) -> Result<(), StreamError> {
        self.outcomes.accepted = self.outcomes.accepted.saturating_sub(1);
        self.outcomes.reject(rejection.reason);
        self.lane.reject(rejection.time);
        self.write(recording)
    }

    /// Adds the outcome of a sample; `turning` while the vehicle turns.
    pub fn update(
        &mut self,
        recording: &Recording,
        update: &UpdateRecord<'_>,
        turning: bool,
    ) -> Result<(), StreamError> {
        if turning && !matches!(update.outcome, Outcome::Rejected(_)) {
            self.in_turns[0] += 1;
            self.in_turns[1] += u64::from(update.outcome == Outcome::Gated);
        }
        self.outcomes.add(update.outcome);
        let health = match update.outcome {
            Outcome::Accepted | Outcome::Placed => Health::Used,
            Outcome::Gated => Health::Gated,
            Outcome::Rejected(_) => Health::Rejected,
        };
        // a placed sample has no innovation
        let innovation = (update.outcome == Outcome::Accepted).then_some(Judgement {
            channels: update.innovation.len(),
            nis: update.nis,
            threshold: update.threshold,
        });
        let (time, present) = (update.time, update.present);
        self.lane.update(&Judged { time, health, present, innovation });
        self.write(recording)
    }

    /// Ends the last stretch.
    pub fn finish(&mut self, end: Time) {
        self.lane.finish(end);
    }

    /// Writes the stretches that began.
    fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        for (health, from) in self.lane.begun(self.written) {
            recording.log(&self.path, from.nanos(), &StateChange::single(health.word()))?;
            self.written += 1;
        }
        Ok(())
    }
}
