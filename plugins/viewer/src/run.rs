//! The series of a run.

use crate::bodies::Body;
use crate::innovation::SensorSeries;
use crate::lane::SensorLane;
use crate::legend::{self, Clock};
use crate::quantity::Here;
use crate::recording::{Axis, Recording};
use crate::rig::Mount;
use crate::samples::{self, SampleSeries};
use crate::scene;
use crate::shade::Shades;
use crate::state::{self, BlockSeries};
use crate::strip::BESIDE;
use crate::track::Motion;
use navfuse_core::model::record::Corrected;
use navfuse_core::model::record::finding::{Finding, Severity};
use navfuse_core::model::record::health::Health;
use navfuse_core::model::sensor::{Accuracy, Purpose};
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::units::time::Time;

/// The series of a run, from which the layout is made.
pub struct Run {
    /// The name of the scenario.
    pub name: String,
    /// Set where every row is recorded.
    pub full: bool,
    /// The blocks that have an uncertainty.
    pub blocks: Vec<BlockSeries>,
    /// The sensors that correct the state.
    pub sensors: Vec<SensorSeries>,
    /// The samples that are recorded.
    pub samples: Vec<SampleSeries>,
    /// The health of the sensors.
    pub lanes: Vec<SensorLane>,
    /// The track, where there is a position.
    pub track: Option<Motion>,
    /// Set where every source simulates its samples: otherwise the truth is a recorded reference.
    pub simulated: bool,
    /// 1-sigma of a recorded reference.
    pub reference: Option<Accuracy>,
    /// Set for a run that is smoothed.
    pub smoothed: bool,
    /// The component with the largest error in sigma, once the run is over.
    pub worst: Option<(usize, usize)>,
    /// The strip of seconds.
    pub clock: Clock,
    /// The heaviest finding of each part.
    pub findings: Vec<Finding>,
    /// The first and the last time of an epoch, ns.
    pub span: Option<(i64, i64)>,
    /// The time of the first sample, ns.
    pub begun: Option<i64>,
    /// Fixed blocks that were found to be wrong, and are estimated since then.
    pub corrected: Vec<Corrected>,
    /// Place of each sensor, by its id, among those above.
    pub places: Vec<Places>,
}

/// Places of a sensor among the series.
#[derive(Clone, Copy, Default)]
pub struct Places {
    pub series: Option<usize>,
    pub samples: Option<usize>,
    pub lane: Option<usize>,
    pub mount: Option<usize>,
    pub body: Option<usize>,
}

impl Run {
    /// The timeline of the plots once the run is over.
    pub fn axis(&self) -> Axis {
        if self.full { Axis::Clock } else { Axis::of(self.span) }
    }

    /// The series of a run that begins; with `all_samples` also those of driving and reference sensors,
    /// and with `full` every row.
    pub fn new(info: &RunInfo, all_samples: bool, full: bool) -> Self {
        let mut run = Self {
            name: info.name.clone(),
            full,
            blocks: state::blocks(info, full),
            sensors: Vec::new(),
            samples: Vec::new(),
            lanes: Vec::new(),
            track: Motion::new(&info.layout, full),
            simulated: info.simulated,
            smoothed: info.smoothed,
            reference: info.reference.filter(|_| !info.simulated),
            clock: Clock::default(),
            findings: Vec::new(),
            worst: None,
            span: None,
            begun: None,
            corrected: Vec::new(),
            places: Vec::new(),
        };
        if let Some(track) = run.track.as_mut().filter(|_| !info.simulated) {
            track.compared = "reference";
        }
        for sensor in &info.sensors {
            let mut places = Places::default();
            if let Some(series) = SensorSeries::new(sensor, full) {
                places.series = Some(run.sensors.len());
                run.sensors.push(series);
            }
            if all_samples || sensor.purpose == Purpose::Measurement {
                places.samples = Some(run.samples.len());
                run.samples.push(SampleSeries::new(sensor, full));
            }
            if let Some(lane) = SensorLane::new(sensor) {
                places.lane = Some(run.lanes.len());
                run.lanes.push(lane);
            }
            let mount = Mount::new(sensor, full).filter(|_| sensor.purpose != Purpose::Reference);
            if let (Some(track), Some(mount)) = (&mut run.track, mount) {
                places.mount = Some(track.mounts.len());
                track.mounts.push(mount);
            }
            let body = info.layout.bodies.iter().find(|body| body.sensor == sensor.name);
            if let (Some(track), Some(body)) = (&mut run.track, body) {
                places.body = Some(track.bodies.len());
                track.bodies.push(Body::new(&body.name, full));
            }
            run.places.push(places);
        }
        run
    }

    /// The place at which an angle on the Earth becomes a distance.
    pub fn here(&self) -> Here {
        self.track.as_ref().map_or_else(Here::default, Motion::here)
    }

    /// Writes the whole run; `judged` is its verdict in words, and how severe it is.
    pub fn write(
        &mut self,
        recording: &Recording,
        judged: Option<(String, Severity)>,
    ) -> Result<(), StreamError> {
        self.blocks.iter_mut().try_for_each(|block| block.write(recording))?;
        if let Some((block, component)) = self.worst {
            self.blocks[block].write_normalised(recording, component)?;
        }
        let lanes = &self.lanes;
        let run = self.span.map_or(0, |(first, last)| last - first);
        for sensor in &mut self.sensors {
            let lane = lanes.iter().find(|lane| lane.name == sensor.name);
            let shades = lane.map(|lane| Shades::new(&lane.lane.stretches, run));
            let span = self.span.unwrap_or_default();
            sensor.write(recording, &shades.unwrap_or_default(), span)?;
        }
        let begun = self.begun.into_iter();
        let span = self.span.map(|(first, last)| (begun.fold(first, i64::min), last));
        if let Some(span) = span.filter(|(first, last)| first < last) {
            legend::write(recording, span)?;
            legend::write_clock(recording, span)?;
            if let Some((words, severity)) = judged {
                legend::write_verdict(recording, span.0, (&words, severity))?;
            }
            self.lanes.iter_mut().try_for_each(|lane| lane.fit(recording, span, BESIDE))?;
        }
        let span = self.span.unwrap_or_default();
        self.samples.iter_mut().try_for_each(|samples| samples.write(recording))?;
        let grid = samples::grid(self.samples.iter().map(|samples| samples.plots.len()).sum());
        self.samples.iter_mut().for_each(|samples| samples.place(span, grid));
        match &self.track {
            Some(track) => {
                scene::draw(recording, track, true)?;
                scene::finish(recording, track)
            }
            None => Ok(()),
        }
    }

    /// Notes the first sample: until the filter uses its samples, a sensor waits.
    pub fn begin(&mut self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        if self.begun.replace(self.begun.unwrap_or(time.nanos())).is_some() {
            return Ok(());
        }
        self.lanes.iter().try_for_each(|lane| lane.wait(recording, time))
    }

    /// Draws which sensors are silent now, and the words of the strips, for the viewers that watch.
    pub fn show_health(&mut self, recording: &Recording, now: Time) -> Result<(), StreamError> {
        let span = (self.begun.unwrap_or(now.nanos()), now.nanos());
        self.lanes.iter_mut().try_for_each(|lane| lane.fit(recording, span, BESIDE))?;
        self.clock.show(recording, span)?;
        for sensor in &mut self.sensors {
            let lane = self.lanes.iter().find(|lane| lane.name == sensor.name);
            let health = lane.and_then(|lane| lane.lane.current()).map(|(health, _)| health);
            sensor.silent(recording, now, health == Some(Health::Silent))?;
        }
        Ok(())
    }
}
