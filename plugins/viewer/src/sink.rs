//! The sink.

use crate::arrangement::{self, Stage};
use crate::columns::ROWS;
use crate::overview;
use crate::recording::Recording;
use crate::run::Run;
use crate::scene;
use crate::style::path;
use crate::tab::Tab;
use crate::tally::{Excursion, Excursions};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::verdict::{Verdict, VerdictLevel};
use navfuse_core::model::record::{
    Corrected, Epoch, Event, InputRejection, Level, Record, UpdateRecord, Wants,
};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use re_sdk_types::archetypes::{TextDocument, TextLog};
use re_sdk_types::components::TextLogLevel;
use std::time::{Duration, Instant};

/// The time between two refreshes of a viewer that watches.
const LIVE_INTERVAL: Duration = Duration::from_millis(500);
/// The shortest time between two, of a run that has moved on by [`LIVE_SPAN`]: a simulation is some hundred
/// times faster than its clock, and what viewers show would be minutes old.
const LIVE_SHORTEST: Duration = Duration::from_millis(200);
/// The time of the run after which a viewer that watches is refreshed earlier, s.
const LIVE_SPAN: f64 = 5.0;
/// The number of times that the pause before a refresh is longer than the last refresh took.
const LIVE_PAUSE: u32 = 4;

/// Greatest number of letters of a line of the log: it fits into a small window (1280x720).
const LINE: usize = 180;

/// The age at which a run that nobody watches writes its first layout, which shows the file of a run
/// that was killed. A short run saves its cost.
const LAYOUT_AFTER: Duration = Duration::from_secs(1);

/// Records a run for the viewer.
pub struct RerunSink {
    recording: Recording,
    samples: bool,
    full: bool,
    tabs: Vec<Box<dyn Tab>>,
    run: Option<Run>,
    epochs: usize,
    last: Option<Time>,
    waiting: Vec<Event>,
    left: Vec<(String, Excursion)>,
    excursions: Excursions,
    verdict: Option<Verdict>,
    refreshed: Instant,
    /// Duration of the last refresh, and the time of the run at which it was.
    refresh: (Duration, Option<Time>),
    begun: Instant,
    /// Set once the first layout is written.
    laid_out: bool,
    place: Option<String>,
}

impl RerunSink {
    /// A sink that writes to an open recording; with `samples` also those of driving and reference
    /// sensors, and with `full` every row.
    pub fn new(recording: Recording, samples: bool, full: bool, tabs: Vec<Box<dyn Tab>>) -> Self {
        Self {
            recording,
            samples,
            full,
            tabs,
            run: None,
            epochs: 0,
            last: None,
            waiting: Vec::new(),
            left: Vec::new(),
            excursions: Excursions::default(),
            verdict: None,
            refreshed: Instant::now(),
            refresh: (Duration::ZERO, None),
            begun: Instant::now(),
            laid_out: false,
            place: None,
        }
    }

    /// Sends to the viewers that watch what came since the last refresh.
    fn refresh(&mut self) -> Result<(), StreamError> {
        let begun = Instant::now();
        let Some(run) = &mut self.run else { return Ok(()) };
        for tab in &mut self.tabs {
            tab.flush(&self.recording)?;
        }
        if self.recording.is_live() {
            run.blocks.iter_mut().try_for_each(|b| b.refresh(&self.recording))?;
            run.sensors.iter_mut().try_for_each(|s| s.refresh(&self.recording))?;
            if let Some(now) = self.last {
                run.show_health(&self.recording, now)?;
            }
            if let Some(track) = &run.track {
                scene::draw(&self.recording, track, false)?;
                scene::follow(&self.recording, track)?;
            }
            let at = (self.verdict.as_ref(), self.last.unwrap_or_default());
            run.write_overview(&self.recording, at, &left(&self.tabs))?;
        }
        let flushed = self.recording.flush();
        self.refreshed = Instant::now();
        self.refresh = (begun.elapsed(), self.last);
        flushed
    }

    fn lay_out_in_time(&mut self) -> Result<(), StreamError> {
        let due = !self.laid_out && self.begun.elapsed() >= LAYOUT_AFTER;
        if due { self.lay_out() } else { Ok(()) }
    }

    /// Writes the first layout, which knows no ranges yet.
    fn lay_out(&mut self) -> Result<(), StreamError> {
        if let Some(run) = &self.run {
            let watched = self.recording.is_live();
            let stage = if watched { Stage::Watched } else { Stage::Begins };
            let layout = arrangement::messages(run, &self.tabs, stage);
            self.recording.first_layout(&layout.map_err(|e| self.recording.error(e))?);
        }
        self.laid_out = true;
        Ok(())
    }

    fn write(&self, event: &Event, time: Time) -> Result<(), StreamError> {
        let level = match event.level {
            Level::Info => TextLogLevel::INFO,
            Level::Warning => TextLogLevel::WARN,
            Level::Error => TextLogLevel::ERROR,
        };
        // `gnss lost: no sample for 5 s` names the sensor itself
        let text = if event.text.starts_with(&event.about) {
            event.text.clone()
        } else {
            format!("{}: {}", event.about, event.text)
        };
        // the viewer cuts its own column of times
        let text = in_lines(&format!("{:>9.3} s  {text}", time.seconds()));
        self.recording.log(&path(&["events"]), time.nanos(), &TextLog::new(text).with_level(level))
    }

    /// Writes the events that came before the first epoch set the clock.
    fn write_waiting(&mut self, first: Time) -> Result<(), StreamError> {
        std::mem::take(&mut self.waiting).iter().try_for_each(|e| self.write(e, e.time.max(first)))
    }

    /// Writes the excursions of errors that ended.
    fn write_excursions(&mut self) -> Result<(), StreamError> {
        let left = std::mem::take(&mut self.left);
        let events = left.into_iter().filter_map(|(about, e)| self.excursions.add(about, e));
        let events: Vec<Event> = events.collect();
        events.iter().try_for_each(|event| self.write(event, event.time))
    }

    fn close(&mut self) -> Result<String, StreamError> {
        let end = self.last.unwrap_or_default();
        self.write_waiting(end)?;
        if let Some(run) = &mut self.run {
            self.recording.settle(run.axis(), run.span);
            self.tabs.iter_mut().try_for_each(|tab| tab.finish(&self.recording))?;
            run.finish((end, self.verdict.as_ref()), &mut self.left);
        }
        self.write_excursions()?;
        self.excursions.finish().iter().try_for_each(|event| self.write(event, event.time))?;
        self.refresh()?;
        if let Some(run) = &mut self.run {
            let judged = self.verdict.as_ref().map(|verdict| overview::judged(run, verdict));
            run.write(&self.recording, judged)?;
            let at = (self.verdict.as_ref(), end);
            run.write_overview(&self.recording, at, &left(&self.tabs))?;
            let layout = arrangement::messages(run, &self.tabs, Stage::Ended)
                .map_err(|e| self.recording.error(e))?;
            self.recording.last_layout(&layout);
        }
        self.recording.flush()?;
        self.recording.close()
    }
}

impl Run {
    /// Ends stretches and excursions.
    fn finish(
        &mut self,
        (end, verdict): (Time, Option<&Verdict>),
        left: &mut Vec<(String, Excursion)>,
    ) {
        self.lanes.iter_mut().for_each(|lane| lane.finish(end, verdict));
        for block in &mut self.blocks {
            for k in 0..block.components.len() {
                if let Some(excursion) = block.components[k].tally.finish() {
                    left.push((block.full_name(k), excursion));
                }
            }
        }
        self.worst = overview::worst(&self.blocks);
    }

    /// Writes the page of the overview; `left` is the weight that the prior of a component still has.
    fn write_overview(
        &self,
        recording: &Recording,
        (verdict, now): (Option<&Verdict>, Time),
        left: &dyn Fn(&str, &str) -> Option<f64>,
    ) -> Result<(), StreamError> {
        let page = overview::page(self, (verdict, now), left);
        recording.log_static(&path(&["overview"]), &TextDocument::from_markdown(page))?;
        let states = TextDocument::from_markdown(overview::states(self, verdict));
        recording.log_static(&path(&["states"]), &states)
    }
}

impl Sink for RerunSink {
    fn wants(&self) -> Wants {
        self.tabs.iter().fold(Wants::default(), |wants, tab| wants | tab.wants())
    }

    fn start(&mut self, info: &RunInfo) -> Result<(), StreamError> {
        let run = Run::new(info, self.samples, self.full);
        self.recording.name(&info.name)?;
        let scenario = format!("```toml\n{}\n```\n\nnavfuse {}\n", info.scenario, info.version);
        self.recording.log_static(&path(&["scenario"]), &TextDocument::from_markdown(scenario))?;
        if run.track.is_some() {
            scene::start(&self.recording)?;
        }
        run.lanes.iter().try_for_each(|lane| lane.start(&self.recording))?;
        for tab in &mut self.tabs {
            tab.start(info, &self.recording)?;
        }
        self.run = Some(run);
        if self.recording.is_live() {
            self.lay_out()?;
        }
        self.recording.flush()
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        for tab in self.tabs.iter_mut().filter(|tab| tab.wants().contains(record.kind())) {
            tab.take(record, &self.recording)?;
        }
        match *record {
            Record::Sample(sample) => self.sample(sample),
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Filtered(epoch) => self.filtered(epoch),
            Record::Update(update) => self.update(update),
            Record::InputRejection(rejection) => self.input_rejection(rejection),
            Record::Event(event) => self.event(event),
            Record::Finding(finding) => self.finding(finding),
            Record::Verdict(verdict) => self.verdict(verdict),
            Record::Derived(derived) => {
                let run = self.run.as_mut().zip(Corrected::read(derived));
                run.into_iter().for_each(|(run, corrected)| run.corrected.push(corrected));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let place = self.close()?;
        self.place = Some(place.clone());
        Ok(Some(place))
    }
}

impl RerunSink {
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        let here = run.here();
        let Some(&places) = run.places.get(sample.sensor.0) else { return Ok(()) };
        if places.lane.is_some() {
            run.begin(&self.recording, sample.time)?;
        }
        if let Some(samples) = places.samples {
            run.samples[samples].sample(sample, here);
        }
        if let (Some(track), Some(mount)) = (&mut run.track, places.mount) {
            track.sample(mount, sample);
        }
        if let (Some(track), Some(body)) = (&mut run.track, places.body) {
            track.body(body, sample);
        }
        match places.lane {
            Some(lane) => {
                // until the first epoch the filter is aligned, and takes no sample
                run.lanes[lane].sample(&self.recording, sample.time, self.last.is_some())
            }
            None => Ok(()),
        }
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let time = epoch.state.time;
        if self.last.replace(time).is_none() {
            self.write_waiting(time)?;
        }
        let Some(run) = &mut self.run else { return Ok(()) };
        let now = time.nanos();
        run.span = Some(run.span.map_or((now, now), |(a, b)| (a.min(now), b.max(now))));
        for block in &mut run.blocks {
            block.epoch(&self.recording, epoch, &mut self.left)?;
        }
        if !run.smoothed {
            run.lanes.iter_mut().try_for_each(|lane| lane.tick(&self.recording, time))?;
        }
        if let Some(track) = &mut run.track {
            track.epoch(epoch);
        }
        self.write_excursions()?;
        self.epochs += 1;
        self.lay_out_in_time()?;
        let (took, at) = self.refresh;
        let advanced = at.map_or(f64::INFINITY, |at| time.since(at));
        let watched = self.recording.is_live() && is_due(self.refreshed.elapsed(), took, advanced);
        if watched || self.epochs.is_multiple_of(ROWS) { self.refresh() } else { Ok(()) }
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let time = epoch.state.time;
        if self.last.replace(time).is_none() {
            self.write_waiting(time)?;
        }
        let Some(run) = &mut self.run else { return Ok(()) };
        // the sensors follow the filter
        run.lanes.iter_mut().try_for_each(|lane| lane.tick(&self.recording, time))?;
        run.blocks.iter_mut().for_each(|block| block.filtered(epoch));
        if let Some(track) = &mut run.track {
            track.filtered(epoch);
        }
        self.lay_out_in_time()
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        let here = run.here();
        let Some(places) = run.places.get(update.sensor.0) else { return Ok(()) };
        if let Some(lane) = places.lane {
            let turning = run.track.as_ref().is_some_and(|t| t.turning);
            run.lanes[lane].update(&self.recording, update, turning)?;
        }
        match places.series {
            Some(series) => run.sensors[series].update(&self.recording, update, here),
            None => Ok(()),
        }
    }

    fn input_rejection(&mut self, rejection: &InputRejection) -> Result<(), StreamError> {
        let Some(run) = &mut self.run else { return Ok(()) };
        match run.places.get(rejection.sensor.0).and_then(|places| places.lane) {
            Some(lane) => run.lanes[lane].reject(&self.recording, rejection),
            None => Ok(()),
        }
    }

    fn finding(&mut self, finding: &Finding) -> Result<(), StreamError> {
        if let Some(run) = &mut self.run {
            let mut lanes = run.lanes.iter_mut().filter(|lane| finding.is_about(&lane.name));
            lanes.try_for_each(|lane| lane.doubt(&self.recording, finding))?;
            match run.findings.iter_mut().find(|before| before.about == finding.about) {
                Some(before) if before.severity >= finding.severity => {}
                Some(before) => *before = finding.clone(),
                None => run.findings.push(finding.clone()),
            }
        }
        self.event(&finding.event())
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
        self.verdict = Some(verdict.clone());
        self.write(&Event { time, level, about, text }, time)
    }
}

/// A text of the log in lines, which the viewer does not wrap: later ones begin below the words of the first.
fn in_lines(text: &str) -> String {
    let mut lines = String::new();
    let mut length = 0;
    for word in text.split_inclusive(' ') {
        let letters = word.chars().count();
        if length > 0 && length + letters > LINE {
            lines.truncate(lines.trim_end().len());
            lines.push_str("\n             ");
            length = 0;
        }
        lines.push_str(word);
        length += letters;
    }
    lines
}

/// Returns `true` where viewers that watch are to be refreshed: that long after the last refresh, which took
/// some time, and the run has advanced since then, s.
fn is_due(since: Duration, took: Duration, advanced: f64) -> bool {
    let early = advanced >= LIVE_SPAN && since >= LIVE_SHORTEST.max(LIVE_PAUSE * took);
    early || since >= LIVE_INTERVAL
}

/// The weight that the prior of a component of a block still has, by the tab that follows it.
fn left(tabs: &[Box<dyn Tab>]) -> impl Fn(&str, &str) -> Option<f64> + '_ {
    |block, component| tabs.iter().find_map(|tab| tab.left(block, component))
}

impl Drop for RerunSink {
    /// Closes the recording, so that a run that was aborted leaves a file that opens.
    fn drop(&mut self) {
        if self.place.is_none() {
            self.close().ok();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_event_has_lines_that_fit_into_a_small_window_and_loses_no_word() {
        let text = format!("  280.000 s  gnss: {}", "locked out; ".repeat(40));
        let lines = in_lines(&text);
        assert!(lines.lines().count() == 3 && lines.lines().all(|l| l.len() <= LINE + 13));
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&lines), words(&text));
        assert_eq!(in_lines("    1.000 s  short"), "    1.000 s  short");
    }

    #[test]
    fn a_fast_run_refreshes_viewers_earlier_and_spends_a_fifth_of_its_time_on_them_at_most() {
        let ms = Duration::from_millis;
        // on the clock of the vehicle, twice a second
        assert!(!is_due(ms(499), ms(1), 0.5) && is_due(ms(500), ms(1), 0.5));
        // 300 times as fast: the page is a minute old at most
        assert!(!is_due(ms(199), ms(1), 59.7) && is_due(ms(200), ms(1), 60.0));
        assert!(!is_due(ms(319), ms(80), 96.0) && is_due(ms(320), ms(80), 96.0));
    }
}
