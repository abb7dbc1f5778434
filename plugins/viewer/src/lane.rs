//! The lane of a sensor in the recording, and the numbers of its samples.

use crate::legend;
use crate::recording::Recording;
use crate::strip::Words;
use crate::style::{Colour, path};
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::health::{Health, Judged, Lane, Stretch};
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{InPart, InputRejection, Outcome, Outcomes, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use re_sdk::EntityPath;
use re_sdk_types::archetypes::StateChange;

/// A sensor and its lane.
pub struct SensorLane {
    /// Name of the sensor.
    pub name: String,
    /// Health over time.
    pub lane: Lane,
    /// Numbers of samples by outcome.
    pub outcomes: Outcomes,
    /// Gated or rejected samples of which other channels were used.
    pub in_part: InPart,
    /// Samples that reached the gate, and gated ones, while the vehicle turned.
    pub in_turns: [u64; 2],
    /// Set for a sensor that drives the process.
    pub drives: bool,
    /// The most severe finding about the sensor, and the strongest basis of one.
    pub found: Option<(Severity, Basis)>,
    /// Times of the findings about the sensor, but those of a silence and notes.
    pub findings: Vec<Time>,
    /// Entity of the lane.
    path: EntityPath,
    /// Number of stretches whose begin is written.
    written: usize,
    words: Words,
    /// Times at which the filter was found to be off after a silence of the sensor.
    pub after_silence: Vec<Time>,
}

/// The word and the colour of the time before the filter uses a sensor's samples.
pub const WAITING: (&str, Colour) = ("waiting", [52, 58, 68]);

impl SensorLane {
    /// The lane of a sensor; `None` for a reference.
    pub fn new(info: &SensorInfo) -> Option<Self> {
        (info.purpose != Purpose::Reference).then(|| Self {
            name: info.name.clone(),
            lane: Lane::default(),
            outcomes: Outcomes::default(),
            in_part: InPart::default(),
            in_turns: [0; 2],
            drives: info.purpose == Purpose::Input,
            found: None,
            findings: Vec::new(),
            path: path(&["health", &info.name]),
            written: 0,
            words: Words::default(),
            after_silence: Vec::new(),
        })
    }

    /// Writes the colours of the lane.
    pub fn start(&self, recording: &Recording) -> Result<(), StreamError> {
        recording.log_static(&self.path, &legend::look())
    }

    /// Writes that the filter does not use the sensor's samples yet.
    pub fn wait(&self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        recording.log(&self.path, time.nanos(), &StateChange::single(WAITING.0))
    }

    /// Notes the time, and with it a silence.
    pub fn tick(&mut self, recording: &Recording, now: Time) -> Result<(), StreamError> {
        self.lane.tick(now);
        self.write(recording)
    }

    /// Adds a sample; of a measuring sensor the outcome counts instead. `used` once the filter runs.
    pub fn sample(
        &mut self,
        recording: &Recording,
        time: Time,
        used: bool,
    ) -> Result<(), StreamError> {
        if !self.drives {
            return Ok(());
        }
        self.outcomes.accepted += u64::from(used);
        self.lane.sample(time);
        self.write(recording)
    }

    /// Takes a finding about the sensor.
    pub fn doubt(&mut self, recording: &Recording, finding: &Finding) -> Result<(), StreamError> {
        if finding.basis == Basis::Silence {
            self.after_silence.push(finding.time);
            return Ok(());
        }
        let (severity, basis) = self.found.unwrap_or((finding.severity, finding.basis));
        self.found = Some((severity.max(finding.severity), basis.max(finding.basis)));
        if finding.severity > Severity::Note {
            self.findings.push(finding.time);
        }
        self.lane.doubt(finding);
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
        self.in_part.add(update.time, update.outcome);
        self.lane.update(&Judged::from(update));
        self.write(recording)
    }

    /// Ends the last stretch. A doubt of the verdict about the whole run has no time of its own: it begins
    /// with the first sample that was used.
    pub fn finish(&mut self, end: Time, verdict: Option<&Verdict>) {
        self.lane.finish(end);
        if verdict.is_some_and(|verdict| verdict.doubts_throughout(&self.name)) {
            let used = self.lane.stretches.iter_mut().filter(|s| s.health == Health::Used);
            used.for_each(|stretch| stretch.health = Health::Doubted);
        }
    }

    /// The stretches so far; the last one ends now.
    pub fn stretches(&self, now: Time) -> Vec<Stretch> {
        let last = self.lane.current();
        let last = last.map(|(health, from)| Stretch { health, from, to: now.max(from) });
        self.lane.stretches.iter().copied().chain(last).collect()
    }

    /// Writes the stretches that began.
    fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        for (health, from) in self.lane.begun(self.written) {
            recording.log(&self.path, from.nanos(), &StateChange::single(health.word()))?;
            self.words.has(from.nanos(), health.word());
            self.written += 1;
        }
        Ok(())
    }

    /// Leaves their words to the stretches that have room for them, in a run between those times, ns, on
    /// strips of that width, pixels.
    pub fn fit(
        &mut self,
        recording: &Recording,
        (first, now): (i64, i64),
        width: f64,
    ) -> Result<(), StreamError> {
        let stretches = self.stretches(Time::from_nanos(now));
        let begun = stretches.first().map_or(now, |s| s.from.nanos());
        let stretches = stretches.iter().map(|s| (s.from.nanos(), s.to.nanos(), s.health.word()));
        let stretches = std::iter::once((first, begun, WAITING.0)).chain(stretches);
        self.words.fit(recording, &self.path, stretches, (now - first, width))
    }
}
