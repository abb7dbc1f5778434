//! The samples of a scenario in memory, so that each run takes the same ones.

use crate::DiagnoseError;
use navfuse_core::compose::Composition;
use navfuse_core::model::stream::{NamedSource, Source, StreamError};
use navfuse_core::run::scenario::Assembly;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::sync::Arc;

/// A sample, and its arrival where the source gives one.
type Taken = (Sample, Option<Time>);

/// The samples of the sources of a scenario.
pub(crate) struct Recording {
    /// Names of the sensors, to which the samples refer.
    sensors: Vec<String>,
    streams: Vec<(String, Arc<[Taken]>)>,
}

impl Recording {
    /// Reads all sources.
    pub fn read(assembly: Assembly) -> Result<Self, DiagnoseError> {
        let sensors = assembly.composition.sensors.iter().map(|s| s.info.name.clone()).collect();
        let mut streams = Vec::new();
        for (name, mut source) in assembly.sources {
            let mut samples = Vec::new();
            let mut sample = Sample::empty(Time::MIN, SensorId(0));
            loop {
                let open = source.next(&mut sample);
                let failed = |error| DiagnoseError::Source { name: name.clone(), error };
                if !open.map_err(failed)? {
                    break;
                }
                samples.push((sample, source.arrival()));
            }
            streams.push((name, samples.into()));
        }
        Ok(Self { sensors, streams })
    }

    /// The samples of a sensor.
    pub fn of(&self, name: &str) -> impl Iterator<Item = &Sample> {
        let id = self.sensors.iter().position(|s| s == name);
        let all = self.streams.iter().flat_map(|(_, samples)| samples.iter());
        all.map(|(sample, _)| sample).filter(move |s| Some(s.sensor.0) == id)
    }

    /// The first and the last time.
    pub fn span(&self) -> (Time, Time) {
        let times = || self.streams.iter().flat_map(|(_, s)| s.iter().map(|(s, _)| s.time));
        (times().min().unwrap_or_default(), times().max().unwrap_or_default())
    }

    /// Sources that give the samples until a time to a composition; samples of sensors that it lacks
    /// are left out.
    pub fn sources(&self, composition: &Composition, until: Time) -> Vec<NamedSource> {
        let ids: Arc<[Option<SensorId>]> =
            self.sensors.iter().map(|name| composition.sensor(name).map(SensorId)).collect();
        let replay = |samples: &Arc<[Taken]>| Replay {
            samples: Arc::clone(samples),
            ids: Arc::clone(&ids),
            until,
            next: 0,
        };
        let streams = self.streams.iter();
        streams.map(|(n, s)| (n.clone(), Box::new(replay(s)) as Box<dyn Source>)).collect()
    }
}

/// A source of the samples in memory.
struct Replay {
    samples: Arc<[Taken]>,
    ids: Arc<[Option<SensorId>]>,
    until: Time,
    next: usize,
}

impl Source for Replay {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        while let Some((taken, _)) = self.samples.get(self.next) {
            self.next += 1;
            let id = self.ids.get(taken.sensor.0).copied().flatten();
            if let Some(sensor) = id.filter(|_| taken.time <= self.until) {
                *sample = *taken;
                sample.sensor = sensor;
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn arrival(&self) -> Option<Time> {
        self.samples.get(self.next.checked_sub(1)?)?.1
    }
}
