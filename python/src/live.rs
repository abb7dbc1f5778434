//! Python in the loop of a run: an iterator as its source, and a function as its sink.

use crate::samples::sample;
use crate::watch::Watch;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::sensor::Sensor;
use navfuse_core::model::stream::{RunInfo, Sink, Source, StreamError};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_csv::{Axes, EstimateColumns};
use pyo3::exceptions::PyStopIteration;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A sample of an iterator: the name of the sensor, the time in s, and the channels in SI.
type Item = (String, f64, Vec<f64>);

/// Samples that an iterator of Python gives, in the order of time.
pub struct Iterating {
    iterator: Py<PyAny>,
    sensors: BTreeMap<String, SensorId>,
    watch: Arc<Watch>,
}

impl Iterating {
    /// A source of what `iter(iterable)` gives. An exception of the iterator ends the run.
    pub fn new(iterable: &Py<PyAny>, sensors: &[Sensor], watch: &Arc<Watch>) -> PyResult<Self> {
        let ids = sensors.iter().enumerate().map(|(k, s)| (s.info.name.clone(), SensorId(k)));
        let iterator =
            Python::attach(|py| PyResult::Ok(iterable.bind(py).try_iter()?.into_any().unbind()))?;
        Ok(Self { iterator, sensors: ids.collect(), watch: Arc::clone(watch) })
    }

    fn item(&self) -> PyResult<Option<Item>> {
        Python::attach(|py| match self.iterator.call_method0(py, "__next__") {
            Ok(item) => item.extract(py).map(Some),
            Err(error) if error.is_instance_of::<PyStopIteration>(py) => Ok(None),
            Err(error) => Err(error),
        })
    }
}

impl Source for Iterating {
    fn next(&mut self, into: &mut Sample) -> Result<bool, StreamError> {
        let item = self.item().unwrap_or_else(|error| {
            self.watch.fail(error);
            None
        });
        let Some((name, seconds, values)) = item else { return Ok(false) };
        let time = Time::from_seconds(seconds).ok_or_else(|| {
            StreamError::format(format!("the time {seconds} s is no time of a run"))
        })?;
        let sensor = self.sensors.get(&name).ok_or_else(|| {
            let known: Vec<&str> = self.sensors.keys().map(String::as_str).collect();
            let remedy = format!("the sensors are {}", known.join(", "));
            StreamError::scenario(format!("there is no sensor {name:?}")).with_remedy(remedy)
        })?;
        *into = sample(time, *sensor, values.into_iter());
        Ok(true)
    }
}

/// Passes each estimate to a function of Python, as a row of numbers.
pub struct Calling {
    function: Py<PyAny>,
    columns: EstimateColumns,
    watch: Arc<Watch>,
}

impl Calling {
    /// A sink that calls `function(row)`. An exception of the function ends the run.
    pub fn new(function: Py<PyAny>, watch: &Arc<Watch>) -> Self {
        Self { function, columns: EstimateColumns::default(), watch: Arc::clone(watch) }
    }
}

impl Sink for Calling {
    fn wants(&self) -> Wants {
        Wants::EPOCHS
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.columns = EstimateColumns::new(run, false, Axes::Ned);
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let time = std::iter::once(epoch.state.time.seconds());
        let row: Vec<f64> = time.chain(self.columns.row(epoch).iter().copied()).collect();
        if !self.watch.stop.load(Ordering::Relaxed)
            && let Err(error) = Python::attach(|py| self.function.call1(py, (row,)).map(drop))
        {
            self.watch.fail(error);
        }
        Ok(())
    }
}
