//! Sensors whose measurement model is a class of Python: see `navfuse/_sensor.py`.

use crate::error::exception;
use crate::samples::values;
use crate::states::Own;
use crate::watch::{Failure, locked};
use navfuse_core::prelude::*;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::Value;
use std::sync::{Arc, Mutex};

/// A sensor as Python describes it.
#[derive(FromPyObject)]
struct Description {
    /// Names and units of the channels.
    channels: Vec<(String, String)>,
    /// Full names of the states that the model reads.
    reads: Vec<String>,
    own: Vec<Own>,
    /// Covariance of the noise, row by row.
    covariance: Vec<f64>,
    /// Which channels are angles.
    angles: Vec<bool>,
    /// Takes the count of numbers of each state, and gives the functions of [`Model`].
    bind: Py<PyAny>,
}

/// A class that is a type of sensor or process: its name, its keys, and its description.
#[derive(FromPyObject)]
pub struct Class {
    pub name: String,
    /// JSON Schema of its table.
    pub schema: String,
    /// Names and units of the channels that drive a process; empty for a sensor.
    pub channels: Vec<(String, String)>,
    /// Set for a process.
    pub moves: bool,
    /// The class itself.
    pub cls: Py<PyAny>,
}

/// Registers a class as a type of sensor.
///
/// # Errors
/// When the schema is none.
pub fn register(registry: &mut Registry, class: &Class, failure: &Arc<Failure>) -> PyResult<()> {
    let schema: Value = serde_json::from_str(&class.schema).map_err(exception)?;
    let schema = schema.try_into().map_err(exception)?;
    let (failure, cls) = (Arc::clone(failure), Python::attach(|py| class.cls.clone_ref(py)));
    registry.sensor_dyn(class.name.as_str(), schema, move |table, composer| {
        compose(describe(&cls, "navfuse._sensor", table).map_err(call_error)?, composer, &failure)
    });
    Ok(())
}

/// Channels of names and units.
pub fn channels(given: &[(String, String)]) -> Vec<Channel> {
    given.iter().map(|(name, unit)| Channel::new(name.as_str(), unit)).collect()
}

/// An exception of a class while a scenario is composed.
pub fn call_error(error: PyErr) -> ComposeError {
    ComposeError::new("", error.to_string())
}

/// Makes an object of a class with the keys of its table, and has it described by its module.
///
/// # Errors
/// The exception of the class.
pub fn describe<T>(class: &Py<PyAny>, module: &str, table: &Value) -> PyResult<T>
where
    T: for<'a, 'py> FromPyObject<'a, 'py, Error = PyErr>,
{
    Python::attach(|py| {
        let make = py.import(module)?.getattr("describe")?;
        make.call1((class, table.to_string()))?.extract()
    })
}

fn compose(
    description: Description,
    composer: &mut Composer,
    failure: &Arc<Failure>,
) -> Result<(Vec<Channel>, Role), ComposeError> {
    let Description { channels: channels_of, reads, own, covariance, angles, bind } = description;
    let mut states = Vec::with_capacity(reads.len() + own.len());
    for name in &reads {
        states.push(find(composer, name)?);
    }
    for own in own {
        let full = format!("{}.{}", composer.owner(), own.name);
        own.add(composer)?;
        states.push(find(composer, &full)?);
    }
    let channels = channels(&channels_of);
    let sizes: Vec<usize> = states.iter().map(Read::size).collect();
    let (call, slopes) =
        Python::attach(|py| bind.call1(py, (sizes,))?.extract(py)).map_err(call_error)?;
    let failure = Arc::clone(failure);
    let centre = Mutex::default();
    let model = Model { states, covariance, angles, call, slopes, failure, centre };
    let role = Role::dynamic(channels.len(), model);
    Ok((channels, role))
}

/// A state that the model reads.
enum Read {
    /// A rotation, which Python receives as the nine numbers of its matrix.
    Rotation(Handle<Rotation>),
    /// Any other state, as its components.
    Vector(AnyHandle),
}

impl Read {
    /// Count of its numbers.
    fn size(&self) -> usize {
        match self {
            Self::Rotation(_) => 9,
            Self::Vector(handle) => handle.components(),
        }
    }
}

fn find(composer: &Composer, full: &str) -> Result<Read, ComposeError> {
    if let Ok(rotation) = composer.find("", full) {
        return Ok(Read::Rotation(rotation));
    }
    composer.find_any("", full).map(Read::Vector)
}

/// The measurement model.
struct Model {
    states: Vec<Read>,
    covariance: Vec<f64>,
    angles: Vec<bool>,
    /// Predicts several states.
    call: Py<PyAny>,
    /// Predicts a state, with the derivatives by its numbers; none where they are differences.
    slopes: Option<Py<PyAny>>,
    failure: Arc<Failure>,
    /// The state of the last derivatives, and its prediction: the filter asks for it once more.
    centre: Mutex<(Vec<f64>, Vec<f64>)>,
}

impl Model {
    /// Appends the numbers of the states that the model reads.
    fn append(&self, x: &View<'_, f64>, numbers: &mut Vec<f64>) {
        for state in &self.states {
            match state {
                Read::Rotation(handle) => {
                    numbers.extend(x.get(*handle).matrix().transpose().iter())
                }
                Read::Vector(handle) => {
                    let first = numbers.len();
                    numbers.resize(first + handle.components(), 0.0);
                    x.read(*handle, &mut numbers[first..]);
                }
            }
        }
    }

    /// Count of the numbers of a state.
    fn width(&self) -> usize {
        self.states.iter().map(Read::size).sum()
    }

    /// Calls a function of Python with numbers, and takes the numbers that it returns.
    fn call(&self, function: &Py<PyAny>, numbers: &[f64], z: &mut [f64]) -> PyResult<()> {
        Python::attach(|py| {
            let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_ne_bytes()).collect();
            let answer = function.call1(py, (PyBytes::new(py, &bytes),))?;
            let predicted: &[u8] = answer.extract(py)?;
            z.iter_mut().zip(values(predicted)).for_each(|(z, p)| *z = p);
            Ok(())
        })
    }

    /// Predicts states, of which the last is amid the others where there are derivatives.
    fn predicted(&self, states: usize, numbers: &[f64], z: &mut [f64]) -> PyResult<()> {
        let (width, n) = (self.width(), z.len() / states.max(1));
        let last = states.saturating_sub(1);
        let centre = &numbers[last * width..];
        if states == 2
            && let Some(known) = self.known(centre)
        {
            z[n..].copy_from_slice(&known);
            return self.call(&self.call, &numbers[..width], &mut z[..n]);
        }
        match &self.slopes {
            Some(slopes) if states > 2 => self.along(slopes, numbers, centre, z)?,
            _ => self.call(&self.call, numbers, z)?,
        }
        if states > 2 {
            *locked(&self.centre) = (centre.to_vec(), z[last * n..].to_vec());
        }
        Ok(())
    }

    /// The prediction of the state at which the model was differentiated last.
    fn known(&self, numbers: &[f64]) -> Option<Vec<f64>> {
        let centre = locked(&self.centre);
        (numbers == centre.0).then(|| centre.1.clone())
    }

    /// Predicts the states beside the last one along the derivatives there: their difference is the
    /// chain rule, `dz = (dz / dnumbers) dnumbers`.
    fn along(
        &self,
        slopes: &Py<PyAny>,
        numbers: &[f64],
        centre: &[f64],
        z: &mut [f64],
    ) -> PyResult<()> {
        let (width, n) = (centre.len().max(1), self.angles.len());
        let mut expanded = vec![f64::NAN; n * (1 + centre.len())];
        self.call(slopes, centre, &mut expanded)?;
        let (middle, rows) = expanded.split_at(n);
        for (state, z) in numbers.chunks_exact(width).zip(z.chunks_exact_mut(n.max(1))) {
            for ((z, middle), row) in z.iter_mut().zip(middle).zip(rows.chunks_exact(width)) {
                let steps = state.iter().zip(centre).map(|(to, from)| to - from);
                *z = middle + row.iter().zip(steps).map(|(slope, step)| slope * step).sum::<f64>();
            }
        }
        Ok(())
    }
}

impl DynamicModel for Model {
    fn predict(&self, x: &View<'_, f64>, z: &mut [f64]) {
        self.predict_all(std::slice::from_ref(x), z);
    }

    /// An exception makes the prediction NaN, so that the sample is rejected, and ends the run.
    fn predict_all(&self, states: &[View<'_, f64>], z: &mut [f64]) {
        z.fill(f64::NAN);
        let mut numbers = Vec::new();
        states.iter().for_each(|x| self.append(x, &mut numbers));
        if !self.failure.happened()
            && let Err(error) = self.predicted(states.len(), &numbers, z)
        {
            self.failure.keep(error);
        }
    }

    /// The states are declared, so that no call is needed.
    fn read(&self, x: &View<'_, f64>, _: &mut [f64]) {
        self.append(x, &mut Vec::new());
    }

    fn noise(&self, _: &View<'_, f64>, r: &mut [f64]) {
        r.copy_from_slice(&self.covariance);
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        let difference = measured - predicted;
        let turn = std::f64::consts::TAU;
        match self.angles.get(channel) {
            Some(true) => difference - turn * (difference / turn).round(),
            _ => difference,
        }
    }
}
