//! A run while it goes on: samples in, the newest estimate out.

use crate::error::{exception, exception_of};
use crate::recorder::Recorder;
use crate::run::result;
use crate::samples::{sample, times, values};
use crate::scenario::Scenario;
use crate::watch::{Failure, locked};
use navfuse::CommandError;
use navfuse_core::checkpoint::{Checkpoint, CheckpointError};
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{NamedSink, RunInfo, Sink, StreamError};
use navfuse_core::session::{End, RunError, Session as Core};
use navfuse_core::units::sample::SensorId;
use navfuse_core::units::time::Time;
use navfuse_csv::EstimateColumns;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

/// A run, until it is finished.
struct Running {
    core: Core,
    columns: EstimateColumns,
    /// The error that ended the run.
    error: Option<RunError>,
}

impl Running {
    /// Keeps the error that ended the run, and returns its exception.
    fn failed(&mut self, error: RunError) -> PyErr {
        let error = CommandError::Run(error);
        let raised = exception_of(&error);
        if let CommandError::Run(error) = error {
            self.error = Some(error);
        }
        raised
    }
}

/// The exception of a checkpoint that cannot be written or used.
fn unfit(error: CheckpointError) -> PyErr {
    exception(CommandError::Request(error.to_string()))
}

/// Columns and their description, which a run knows when it starts.
type Known = Arc<OnceLock<(EstimateColumns, String)>>;

/// Learns the columns of a run.
struct Learning(Known);

impl Sink for Learning {
    fn wants(&self) -> Wants {
        Wants::NOTHING
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        let mut recorder = Recorder::default();
        recorder.start(run)?;
        let text = recorder.describe().to_string();
        self.0.get_or_init(|| (recorder.estimate, text));
        Ok(())
    }

    fn take(&mut self, _: &Record<'_>) -> Result<(), StreamError> {
        Ok(())
    }
}

/// A session: samples are pushed in the order of their arrival.
#[pyclass(frozen, module = "navfuse._navfuse")]
pub struct Session {
    running: Mutex<Option<Running>>,
    /// What went wrong in a sensor in Python.
    failure: Arc<Failure>,
    /// Id and number of channels of each sensor.
    sensors: BTreeMap<String, (SensorId, usize)>,
    /// Headings and blocks, for Python.
    #[pyo3(get)]
    text: String,
}

impl Session {
    /// Works on the run without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Running) -> T + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| locked(&self.running).as_mut().map(work));
        self.failure.take()?;
        done.ok_or_else(|| PyValueError::new_err("the session is finished"))
    }

    fn sensor(&self, name: &str) -> PyResult<(SensorId, usize)> {
        self.sensors.get(name).copied().ok_or_else(|| {
            let names: Vec<&str> = self.sensors.keys().map(String::as_str).collect();
            let message =
                format!("there is no sensor {name:?}; the sensors are {}", names.join(", "));
            PyValueError::new_err(message)
        })
    }
}

#[pymethods]
impl Session {
    #[new]
    fn new(scenario: &Scenario, covariance: bool, resume: Option<&[u8]>) -> PyResult<Self> {
        let from = resume.map(Checkpoint::from_bytes).transpose().map_err(unfit)?;
        let mut composition = scenario.composed()?.compose().map_err(exception)?;
        composition.simulated = false;
        let ids = composition
            .sensors
            .iter()
            .enumerate()
            .map(|(k, s)| (s.info.name.clone(), (SensorId(k), s.info.channels.len())));
        let sensors = ids.collect();
        let known = Known::default();
        let learning: NamedSink = ("columns".to_owned(), Box::new(Learning(Arc::clone(&known))));
        let recorder = ("python".to_owned(), Box::new(Recorder::new(covariance)) as _);
        let sinks = vec![recorder, learning];
        let core = match from {
            Some(from) => Core::resume(composition, sinks, &from).map_err(unfit)?,
            None => Core::new(composition, sinks),
        };
        let (columns, text) = known.get().cloned().unwrap_or_default();
        let running = Mutex::new(Some(Running { core, columns, error: None }));
        Ok(Self { running, failure: Arc::clone(&scenario.failure), sensors, text })
    }

    /// Takes rows of a sensor: times, and the channels of each row one row after the other.
    fn push(&self, py: Python<'_>, sensor: &str, at: (&[u8], bool), rows: &[u8]) -> PyResult<()> {
        let (id, channels) = self.sensor(sensor)?;
        let (times, rows) = (times(at.0, at.1)?, values(rows).collect::<Vec<_>>());
        if rows.len() != times.len() * channels {
            let message = format!("{} rows of {channels} channels are needed", times.len());
            return Err(PyValueError::new_err(message));
        }
        self.with(py, |running| {
            let samples = times.iter().zip(rows.chunks_exact(channels.max(1)));
            for (time, row) in samples {
                let sample = sample(*time, id, row.iter().copied());
                running.core.push(&sample).map_err(|error| running.failed(error))?;
            }
            Ok(())
        })?
    }

    /// Lets the time go on without a sample, ns.
    fn tick(&self, py: Python<'_>, nanos: i64) -> PyResult<()> {
        self.with(py, |running| {
            let ticked = running.core.tick(Time::from_nanos(nanos));
            ticked.map_err(|error| running.failed(error))
        })?
    }

    /// The newest estimate as a row of numbers; none before the start.
    fn newest(&self, py: Python<'_>) -> PyResult<Option<Vec<f64>>> {
        self.with(py, |Running { core, columns, .. }| {
            core.newest(|epoch| {
                let time = std::iter::once(epoch.state.time.seconds());
                time.chain(columns.row(epoch).iter().copied()).collect()
            })
        })
    }

    /// The verdict so far, in JSON.
    fn verdict(&self, py: Python<'_>) -> PyResult<String> {
        let verdict = self.with(py, |running| running.core.health())?;
        serde_json::to_string(&verdict).map_err(exception)
    }

    /// The run as it is, in bytes.
    fn checkpoint<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let saved = self.with(py, |running| running.core.checkpoint())?.map_err(unfit)?;
        Ok(PyBytes::new(py, saved.as_bytes()))
    }

    /// Ends the run.
    fn finish<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let running = py.detach(|| locked(&self.running).take());
        let Some(Running { core, error, .. }) = running else {
            return Err(PyValueError::new_err("the session is finished"));
        };
        let end = error.map_or(End::Complete, End::Failed);
        let finished = py.detach(|| core.finish(end));
        result(py, finished)
    }
}
