//! What the tests of this crate share: a registry, scenarios, states set by name, and runs.

use navfuse_core::compose::Composition;
use navfuse_core::model::record::{Epoch, Record, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::nalgebra::Matrix3;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::state::State;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
pub use navfuse_testing::scenario;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub fn compose(text: &str, settings: &[&str]) -> Composition {
    scenario(text, settings, |s| s.compose().unwrap_or_else(|e| panic!("{e}")))
}

/// What is wrong with a scenario.
pub fn refused(text: &str, settings: &[&str]) -> String {
    scenario(text, settings, |s| s.compose().map(|_| "accepted").unwrap_err().to_string())
}

/// Sets a block to coordinates in SI.
pub fn set(composition: &Composition, state: &mut State, name: &str, coordinates: &[f64]) {
    let block = composition.layout.find(name).unwrap_or_else(|| panic!("no {name}"));
    (block.operations.from_coordinates)(coordinates, &mut state.values[block.range()]);
}

pub fn model(composition: &Composition, name: &str) -> Arc<dyn AnyMeasurement + Sync> {
    match &composition.sensors[composition.sensor(name).unwrap()].role {
        Role::Measurement(model) => Arc::clone(model),
        _ => panic!("{name} measures"),
    }
}

/// What a sensor would read, and the sample's other channels if there are any.
pub fn predict(composition: &Composition, name: &str, state: &State, sample: &Sample) -> Vec<f64> {
    let model = model(composition, name);
    let mut out = vec![0.0; model.channels()];
    model.predict(&At { layout: &composition.layout, state, sample }, &mut out);
    out
}

pub fn no_sample() -> Sample {
    Sample::empty(Time::MIN, SensorId(0))
}

/// What a run tells at an epoch.
#[derive(Clone, Debug)]
pub struct Moment {
    pub time: f64,
    /// Horizontal error of the position, m.
    pub error: f64,
    /// The larger horizontal 1-sigma of the position, m.
    pub sigma: f64,
    /// Covariance of the velocity.
    pub velocity: Matrix3<f64>,
    /// 1-sigma of the current north, east, down, m/s; zero where there is none.
    pub current: [f64; 3],
}

/// Everything a test wants of a run.
#[derive(Debug, Default)]
pub struct Log {
    pub samples: Vec<Sample>,
    pub epochs: Vec<Moment>,
    /// NIS, number of channels and sensor of every update that was accepted.
    pub nis: Vec<(f64, u32, usize)>,
}

impl Sink for Log {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Sample(sample) => self.sample(sample),
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Update(update) => self.update(update),
            _ => Ok(()),
        }
    }
}

impl Log {
    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        self.samples.push(*sample);
        Ok(())
    }
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let Some(truth) = epoch.truth else { return Ok(()) };
        let (layout, values) = (epoch.layout, &epoch.state.values);
        let mut errors = [0.0; 3];
        let position = layout.find("ins.position").unwrap();
        position.show_error(values, &truth.state.values, &mut errors);
        let (mut sigma, mut current) = ([0.0; 3], [0.0; 3]);
        position.show_sigma(values, epoch.covariance, &mut sigma);
        if let Some(block) = layout.find("water.current") {
            block.show_sigma(values, epoch.covariance, &mut current);
        }
        let v = layout.find("ins.velocity").unwrap().tangent.unwrap();
        self.epochs.push(Moment {
            time: epoch.state.time.seconds(),
            error: errors[0].hypot(errors[1]),
            sigma: sigma[0].max(sigma[1]),
            velocity: Matrix3::from_fn(|i, j| epoch.covariance.get(v + i, v + j)),
            current,
        });
        Ok(())
    }
    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        if !update.innovation.is_empty() {
            let m = update.innovation.len() as u32;
            self.nis.push((update.nis, m, update.sensor.0));
        }
        Ok(())
    }
}

fn listen(mut assembly: Assembly) -> Log {
    assembly.sinks.push(("test".into(), Box::new(Log::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished.take_sink().unwrap()
}

pub fn run(text: &str, settings: &[&str]) -> Log {
    listen(scenario(text, settings, |s| s.assemble(None).unwrap_or_else(|e| panic!("{e}"))))
}

/// The Cramer-Rao bound: the filter at the truth.
pub fn bound(text: &str, settings: &[&str]) -> Log {
    listen(scenario(text, settings, |s| s.assemble_at_truth().unwrap_or_else(|e| panic!("{e}"))))
}

impl Log {
    /// The epoch at a time, s.
    pub fn at(&self, time: f64) -> &Moment {
        self.epochs.iter().rfind(|e| e.time <= time + 1e-6).unwrap()
    }

    /// Mean and bound of 4 sigma of NIS over channels of a sensor: the mean of chi-square over its
    /// degrees of freedom.
    pub fn mean_nis(&self, sensor: usize) -> (f64, f64) {
        let of = || self.nis.iter().filter(|n| n.2 == sensor);
        let channels: f64 = of().map(|n| f64::from(n.1)).sum();
        (of().map(|n| n.0).sum::<f64>() / channels, 4.0 * (2.0 / channels).sqrt())
    }
}
