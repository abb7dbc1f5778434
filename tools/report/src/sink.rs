//! History of a run during the run.

use crate::history::{BlockInfo, Fate, Row, RunHistory};
use crate::sensors::SensorHistory;
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Epoch, Event, Outcome, Record, UpdateRecord};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::state::Block;
use navfuse_core::state::manifold::{MAX_TANGENT, Position};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::time::Time;
use std::any::TypeId;

/// Sink that collects the history of a run; see
/// [`navfuse_core::session::Finished::take_sink`].
#[derive(Debug)]
pub struct Recorder {
    history: RunHistory,
    columns: Vec<Vec<String>>,
    /// Latest time so far, which events without a time of their own get, as in the log.
    latest: Time,
}

impl Default for Recorder {
    fn default() -> Self {
        Self { history: RunHistory::default(), columns: Vec::new(), latest: Time::MIN }
    }
}

impl Recorder {
    /// The history of the run so far.
    pub fn into_history(self) -> RunHistory {
        self.history
    }
}

impl Sink for Recorder {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        let sensors = run.sensors.iter().map(|s| SensorHistory {
            name: s.name.clone(),
            kind: Some(s.kind.clone()),
            purpose: Some(s.purpose),
            ..SensorHistory::default()
        });
        self.history.name.clone_from(&run.name);
        self.history.version.clone_from(&run.version);
        self.history.scenario.clone_from(&run.scenario);
        self.history.description.clone_from(&run.description);
        self.history.seed = run.simulated.then_some(run.seed);
        self.history.sensors = sensors.collect();
        self.columns =
            run.sensors.iter().map(|s| s.channels.iter().map(Channel::column).collect()).collect();
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Sample(sample) => self.sample(sample),
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Filtered(epoch) => self.filtered(epoch),
            Record::Update(update) => self.update(update),
            Record::Event(event) => self.event(event),
            Record::InputRejection(rejection) => {
                let sensor = rejection.sensor.0;
                let why = rejection.reason.reason(&self.columns[sensor]);
                self.history.input_rejection(sensor, rejection.time, &why);
                Ok(())
            }
            Record::Finding(finding) => {
                self.history.finding(finding);
                self.event(&finding.event())
            }
            Record::Derived(derived) => {
                self.history.derived(derived);
                Ok(())
            }
            Record::Verdict(verdict) => self.verdict(verdict),
            _ => Ok(()),
        }
    }
}

impl Recorder {
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        if self.latest <= Time::MIN {
            self.history
                .events
                .iter_mut()
                .filter(|e| e.time <= Time::MIN)
                .for_each(|e| e.time = sample.time);
        }
        self.latest = self.latest.max(sample.time);
        self.history.sample(sample, self.columns[sample.sensor.0].iter().map(String::as_str));
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.history.tick(epoch.state.time);
        self.latest = self.latest.max(epoch.state.time);
        for (slot, block) in epoch.layout.blocks.iter().enumerate() {
            let components = block.spec.display.components;
            let info = BlockInfo {
                name: &block.name,
                mode: block.spec.mode,
                components: (0..block.operations.tangent)
                    .map(|k| components.get(k).copied().unwrap_or("")),
                unit: block.spec.display.unit,
                geodetic: block.operations.kind == TypeId::of::<Position>(),
            };
            self.history.state(info, row(epoch, slot, block));
        }
        Ok(())
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.history.tick(epoch.state.time);
        self.latest = self.latest.max(epoch.state.time);
        for (slot, block) in epoch.layout.blocks.iter().enumerate() {
            self.history.filtered(&block.name, row(epoch, slot, block));
        }
        Ok(())
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let why;
        let sensor = update.sensor.0;
        let fate = match update.outcome {
            Outcome::Accepted => Fate::Accepted,
            Outcome::Placed => Fate::Placed,
            Outcome::Gated => Fate::Gated,
            Outcome::Rejected(rejection) => {
                why = rejection.reason(&self.columns[sensor]);
                Fate::Rejected(&why)
            }
        };
        self.history.update(
            sensor,
            update.time,
            fate,
            update.nis,
            update.threshold,
            update.channels(),
        );
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        let known = event.time > Time::MIN;
        let time = if known { event.time } else { self.latest };
        self.latest = self.latest.max(time);
        self.history.event(&Event { time, ..event.clone() });
        Ok(())
    }

    fn verdict(&mut self, verdict: &Verdict) -> Result<(), StreamError> {
        self.history.verdict = Some(verdict.clone());
        Ok(())
    }
}

/// The estimate of a block at an epoch, in display units.
fn row(epoch: &Epoch<'_>, slot: usize, block: &Block) -> Row {
    let show = |show: &dyn Fn(&mut [f64])| {
        let mut out = [0.0; MAX_TANGENT];
        show(&mut out);
        out[..block.operations.tangent].to_vec()
    };
    let values = &epoch.state.values;
    let truth = epoch.truth.filter(|t| t.known[slot]);
    Row {
        time: epoch.state.time.seconds(),
        estimate: show(&|out| block.show(values, out)),
        sigma: show(&|out| block.show_sigma(values, epoch.covariance, out)),
        error: truth.map_or_else(Vec::new, |t| {
            show(&|out| t.show_error(epoch.layout, slot, epoch.state, out))
        }),
    }
}
