//! The sink.

use crate::blueprint;
use crate::columns::{ROWS, Series};
use crate::innovation::SensorSeries;
use crate::recording::Recording;
use crate::state::{self, BlockSeries};
use crate::style::path;
use crate::tab::Tab;
use crate::track::Track;
use navfuse_core::model::record::{Epoch, Event, Level, UpdateRecord};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::model::verdict::{Verdict, VerdictLevel};
use navfuse_core::state::covariance::{Transition, Update};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use re_sdk_types::archetypes::{TextDocument, TextLog};
use re_sdk_types::components::TextLogLevel;
use std::time::{Duration, Instant};

/// The time between two refreshes of a viewer that watches.
const LIVE_INTERVAL: Duration = Duration::from_millis(500);

/// The series of a run, from which the layout is made.
pub struct Run {
    /// The blocks that have an uncertainty.
    pub blocks: Vec<BlockSeries>,
    /// All sensors, by their ids.
    pub sensors: Vec<SensorSeries>,
    /// The track, where there is a position.
    pub track: Option<Track>,
    /// Set where a reference gives the truth of the processes' blocks.
    pub reference: bool,
    /// Set for a run that is smoothed.
    pub smoothed: bool,
}

/// Records a run for the viewer.
pub struct RerunSink {
    recording: Recording,
    samples: bool,
    tabs: Vec<Box<dyn Tab>>,
    run: Option<Run>,
    epochs: usize,
    last: Option<Time>,
    waiting: Vec<Event>,
    refreshed: Instant,
    place: Option<String>,
}

impl RerunSink {
    /// A sink that writes to an open recording; with `samples` also those of driving and reference
    /// sensors.
    pub fn new(recording: Recording, samples: bool, tabs: Vec<Box<dyn Tab>>) -> Self {
        Self {
            recording,
            samples,
            tabs,
            run: None,
            epochs: 0,
            last: None,
            waiting: Vec::new(),
            refreshed: Instant::now(),
            place: None,
        }
    }

    /// Sends all buffered rows, and the tracks so far.
    fn refresh(&mut self) -> Result<(), StreamError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        for series in run.series() {
            series.flush(&self.recording)?;
        }
        for tab in &mut self.tabs {
            tab.flush(&self.recording)?;
        }
        if let Some(track) = &mut run.track {
            track.draw(&self.recording)?;
        }
        self.refreshed = Instant::now();
        self.recording.flush()
    }

    fn write(&self, event: &Event, time: Time) -> Result<(), StreamError> {
        let level = match event.level {
            Level::Info => TextLogLevel::INFO,
            Level::Warning => TextLogLevel::WARN,
            Level::Error => TextLogLevel::ERROR,
        };
        let text = if event.about.is_empty() {
            event.text.clone()
        } else {
            format!("{}: {}", event.about, event.text)
        };
        self.recording.log(&path(&["events"]), time.nanos(), &TextLog::new(text).with_level(level))
    }

    /// Writes the events that came before the first epoch set the clock.
    fn write_waiting(&mut self, first: Time) -> Result<(), StreamError> {
        std::mem::take(&mut self.waiting).iter().try_for_each(|e| self.write(e, e.time.max(first)))
    }

    fn close(&mut self) -> Result<String, StreamError> {
        self.write_waiting(self.last.unwrap_or_default())?;
        if self.run.is_some() {
            self.tabs.iter_mut().try_for_each(|tab| tab.finish(&self.recording))?;
        }
        self.refresh()?;
        if let Some(run) = &self.run {
            let layout =
                blueprint::messages(run, &self.tabs, true).map_err(|e| self.recording.error(e))?;
            self.recording.layout(&layout, true);
        }
        self.recording.close()
    }
}

impl Run {
    fn series(&mut self) -> impl Iterator<Item = &mut Series> {
        let blocks = self.blocks.iter_mut().flat_map(BlockSeries::series);
        let sensors = self.sensors.iter_mut().flat_map(SensorSeries::series);
        blocks.chain(sensors)
    }
}

impl Sink for RerunSink {
    fn start(&mut self, info: &RunInfo) -> Result<(), StreamError> {
        let run = Run {
            blocks: state::blocks(&info.layout),
            sensors: info.sensors.iter().map(|s| SensorSeries::new(s, self.samples)).collect(),
            track: Track::new(&info.layout),
            reference: info.sensors.iter().any(|s| s.purpose == Purpose::Reference),
            smoothed: info.smoothed,
        };
        self.recording.name(&info.name)?;
        let scenario = format!("```toml\n{}\n```\n\nnavfuse {}\n", info.scenario, info.version);
        self.recording.log_static(&path(&["scenario"]), &TextDocument::from_markdown(scenario))?;
        if let Some(track) = &run.track {
            track.start(&self.recording)?;
        }
        for tab in &mut self.tabs {
            tab.start(info, &self.recording)?;
        }
        let layout =
            blueprint::messages(&run, &self.tabs, false).map_err(|e| self.recording.error(e))?;
        self.recording.layout(&layout, false);
        self.run = Some(run);
        self.recording.flush()
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        let sensor = self.run.as_mut().and_then(|r| r.sensors.get_mut(sample.sensor.0));
        sensor.map_or(Ok(()), |s| s.sample(&self.recording, sample))
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let time = epoch.state.time;
        if self.last.replace(time).is_none() {
            self.write_waiting(time)?;
        }
        let Some(run) = &mut self.run else { return Ok(()) };
        for block in &mut run.blocks {
            block.epoch(&self.recording, epoch)?;
        }
        if !run.smoothed {
            for tab in &mut self.tabs {
                tab.epoch(epoch, &self.recording)?;
            }
        }
        if let Some(track) = &mut run.track {
            track.epoch(&self.recording, epoch)?;
        }
        self.epochs += 1;
        let watched = self.recording.is_live() && self.refreshed.elapsed() >= LIVE_INTERVAL;
        if watched || self.epochs.is_multiple_of(ROWS) { self.refresh() } else { Ok(()) }
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let time = epoch.state.time;
        if self.last.replace(time).is_none() {
            self.write_waiting(time)?;
        }
        // the tabs follow the filter
        for tab in &mut self.tabs {
            tab.epoch(epoch, &self.recording)?;
        }
        let Some(run) = &mut self.run else { return Ok(()) };
        for block in &mut run.blocks {
            block.filtered(&self.recording, epoch)?;
        }
        if let Some(track) = &mut run.track {
            track.filtered(epoch);
        }
        Ok(())
    }

    fn transition(&mut self, transition: &Transition) -> Result<(), StreamError> {
        self.tabs.iter_mut().for_each(|tab| tab.transition(transition));
        Ok(())
    }

    fn correction(&mut self, update: &Update) -> Result<(), StreamError> {
        self.tabs.iter_mut().for_each(|tab| tab.correction(update));
        Ok(())
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        for tab in &mut self.tabs {
            tab.update(update, &self.recording)?;
        }
        let sensor = self.run.as_mut().and_then(|r| r.sensors.get_mut(update.sensor.0));
        sensor.map_or(Ok(()), |s| s.update(&self.recording, update))
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        if self.last.is_none() {
            self.waiting.push(event.clone());
            return Ok(());
        }
        self.write(event, event.time)
    }

    fn verdict(&mut self, verdict: &Verdict) -> Result<(), StreamError> {
        let time = self.last.unwrap_or_default();
        let level = match verdict.level {
            VerdictLevel::Consistent => Level::Info,
            VerdictLevel::Doubtful => Level::Warning,
            VerdictLevel::DoNotUse => Level::Error,
        };
        let (about, text) = ("verdict".to_owned(), verdict.to_string());
        self.write(&Event { time, level, about, text }, time)?;
        let document = TextDocument::from_markdown(markdown(verdict));
        self.recording.log_static(&path(&["verdict"]), &document)
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let place = self.close()?;
        self.place = Some(place.clone());
        Ok(Some(place))
    }
}

/// The verdict with its reasons and remedies.
fn markdown(verdict: &Verdict) -> String {
    let mut text = format!("# Verdict: {}\n\n", verdict.level.words());
    for reason in &verdict.reasons {
        let words = VerdictLevel::from(reason.severity).words();
        text += &format!("- {words}: **{}**: {}", reason.about, reason.text);
        if !reason.remedy.is_empty() {
            text += &format!("; *{}*", reason.remedy);
        }
        text += ".\n";
    }
    text
}

impl Drop for RerunSink {
    /// Closes the recording, so that a run that was aborted leaves a file that opens.
    fn drop(&mut self) {
        if self.place.is_none() {
            self.close().ok();
        }
    }
}
