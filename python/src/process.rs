//! Processes that are classes of Python: see `navfuse/_process.py`.

use crate::error::exception;
use crate::samples::values;
use crate::sensor::{Class, call_error, channels, describe};
use crate::states::{Own, append, take};
use crate::watch::Failure;
use navfuse_core::model::process::ProcessError;
use navfuse_core::model::simulate::Simulate;
use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_core::prelude::*;
use navfuse_core::state::Block;
use navfuse_core::state::manifold::MAX_TANGENT;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::Value;
use std::ops::Range;
use std::sync::Arc;

/// Step of a central difference, relative to the number, or to 1 where that is larger.
const STEP: f64 = 6e-6;
/// Step of a position, m.
const METRES: f64 = 6e-3;

/// A process as Python describes it.
#[derive(FromPyObject)]
struct Description {
    /// States that the process moves, then states that are constant or walk.
    states: Vec<Own>,
    parameters: Vec<Own>,
    /// Covariance of the noise of a driving sample, row by row.
    covariance: Vec<f64>,
    /// Longest interval between driving samples, s.
    max_gap: f64,
    /// `propagate(numbers, dt)`, `follow(motion)` and `simulate(before, after, parameters, dt)`.
    propagate: Py<PyAny>,
    follow: Py<PyAny>,
    simulate: Py<PyAny>,
}

/// What the sensor that drives a process hands to it: the name of its type.
#[derive(Clone)]
struct Driving(String);

/// Registers a class as a type of process, and the sensor that drives it.
///
/// # Errors
/// When the schema is none.
pub fn register(registry: &mut Registry, class: &Class, failure: &Arc<Failure>) -> PyResult<()> {
    let schema: Value = serde_json::from_str(&class.schema).map_err(exception)?;
    let schema = schema.try_into().map_err(exception)?;
    let channels = channels(&class.channels);
    if !channels.is_empty() {
        registry.input_dyn(class.name.as_str(), channels.clone(), Driving(class.name.clone()));
    }
    let (failure, name) = (Arc::clone(failure), class.name.clone());
    let cls = Python::attach(|py| class.cls.clone_ref(py));
    registry.process_dyn(class.name.as_str(), schema, move |table, composer| {
        let driver = driver(composer, &name, table, channels.len())?;
        let description = describe(&cls, "navfuse._process", table).map_err(call_error)?;
        compose(description, composer, driver, channels.len(), &failure)
    });
    Ok(())
}

/// The sensor that drives the process: the key `sensor`, or the one of the process's name.
fn driver(
    composer: &Composer,
    name: &str,
    table: &Value,
    channels: usize,
) -> Result<Option<String>, ComposeError> {
    if channels == 0 {
        return Ok(None);
    }
    let sensor = table.get("sensor").and_then(Value::as_str).unwrap_or(composer.owner());
    let Driving(kind) = composer.input::<Driving>("sensor", sensor)?;
    if kind != name {
        let text = format!("[sensor.{sensor}] is of the type {kind}; the process needs {name}");
        return Err(ComposeError::new("sensor", text));
    }
    Ok(Some(sensor.to_owned()))
}

fn compose(
    description: Description,
    composer: &mut Composer,
    driver: Option<String>,
    channels: usize,
    failure: &Arc<Failure>,
) -> Result<BuiltProcess, ComposeError> {
    let Description { states, parameters, covariance, max_gap, .. } = description;
    let (owner, mut moved, mut held, mut walk) =
        (composer.owner().to_owned(), Vec::new(), Vec::new(), Vec::new());
    let first = composer.tangents();
    for own in states {
        walk.extend(own.density());
        moved.push(own.add_moved(composer)?);
    }
    let rows = first..composer.tangents();
    for own in parameters {
        held.push(own.add(composer)?);
    }
    let columns = first..composer.tangents();
    let of = |part: &str| format!("{owner}.{part}");
    let vehicle = Vehicle {
        position: composer.find("", &of("position")).ok(),
        attitude: composer.find("", &of("attitude")).ok(),
        velocity: composer.find("", &of("velocity")).ok(),
    };
    composer.moves(vehicle);
    let places = composer.transition().dense(rows.clone(), columns);
    let covariance = DMatrix::from_row_slice(channels, channels, &covariance);
    let Description { propagate, follow, simulate, .. } = description;
    let calls = Calls { propagate, follow, simulate, failure: Arc::clone(failure) };
    let model = Model {
        moved,
        held,
        rows,
        places,
        covariance,
        walk: DVector::from_vec(walk),
        max_gap,
        calls: Arc::new(calls),
    };
    let simulator = Simulator(model.clone());
    let built = BuiltProcess::new(model);
    Ok(match driver {
        Some(driver) => built.driven_by(driver, simulator),
        None => built,
    })
}

/// The functions of the class.
struct Calls {
    propagate: Py<PyAny>,
    follow: Py<PyAny>,
    simulate: Py<PyAny>,
    failure: Arc<Failure>,
}

impl Calls {
    /// Calls a function with bytes, and returns what it makes of the answer; an exception is kept,
    /// and ends the run.
    fn call<T>(
        &self,
        work: impl for<'py> FnOnce(Python<'py>) -> PyResult<T>,
    ) -> Result<T, ProcessError> {
        let error = match self.failure.happened() {
            true => "its class has raised an exception".to_owned(),
            false => match Python::attach(work) {
                Ok(answer) => return Ok(answer),
                Err(error) => {
                    let text = error.to_string();
                    self.failure.keep(error);
                    text
                }
            },
        };
        Err(ProcessError::new(error))
    }
}

/// Numbers as bytes of Python.
fn packed<'py>(py: Python<'py>, numbers: &[f64]) -> Bound<'py, PyBytes> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_ne_bytes()).collect();
    PyBytes::new(py, &bytes)
}

/// Numbers of the motion of the body: attitude, velocity, position, angular rate, specific force.
fn motion_numbers(motion: &Motion) -> Vec<f64> {
    let attitude = motion.c_b_n.to_rotation_matrix().matrix().transpose();
    let Geodetic { latitude, longitude, height } = motion.position;
    let place = [latitude, longitude, height];
    let vectors = [motion.w_ib_b, motion.f_ib_b];
    let before = attitude.iter().chain(motion.velocity.iter()).chain(&place);
    before.chain(vectors.iter().flat_map(|v| v.iter())).copied().collect()
}

/// The process model.
#[derive(Clone)]
struct Model {
    /// Slots of the states that the process moves, and of its parameters.
    moved: Vec<usize>,
    held: Vec<usize>,
    /// Error states that the process moves.
    rows: Range<usize>,
    places: DenseSlot,
    /// Covariance of the noise of a driving sample.
    covariance: DMatrix<f64>,
    /// Variance of the random walk of each row after a second.
    walk: DVector<f64>,
    max_gap: f64,
    calls: Arc<Calls>,
}

impl Model {
    fn blocks<'a>(&'a self, layout: &'a Layout) -> impl Iterator<Item = &'a Block> {
        self.moved.iter().chain(&self.held).map(|slot| &layout.blocks[*slot])
    }

    /// The channels of the driving sample, and the interval that it covers, s.
    fn input(&self, interval: &Interval<'_>) -> Result<(Vec<f64>, f64), ProcessError> {
        let channels = self.covariance.nrows();
        if channels == 0 {
            return Ok((Vec::new(), interval.duration()));
        }
        let Some(input) = interval.input else {
            return Err(ProcessError::input("its driving sensor has given no sample yet"));
        };
        if input.duration > self.max_gap {
            let text = format!("no driving sample for {:.3} s; raise max_gap", input.duration);
            return Err(ProcessError::input(text));
        }
        let values: Option<Vec<f64>> = (0..channels).map(|k| input.sample.get(k)).collect();
        let values = values.ok_or_else(|| ProcessError::input("a channel is missing"))?;
        Ok((values, input.duration.max(interval.duration())))
    }

    /// The states after a step from each point: `numbers` has all points one after the other.
    fn propagated(
        &self,
        layout: &Layout,
        before: &[f64],
        numbers: &[f64],
        dt: f64,
    ) -> Result<Vec<Vec<f64>>, ProcessError> {
        let answer = self.calls.call(|py| {
            let answer = self.calls.propagate.call1(py, (packed(py, numbers), dt))?;
            Ok(values(answer.extract(py)?).collect::<Vec<f64>>())
        })?;
        let (mut answer, mut points) = (&answer[..], Vec::new());
        while !answer.is_empty() {
            let mut point = before.to_vec();
            self.moved.iter().for_each(|k| take(&layout.blocks[*k], &mut answer, &mut point));
            points.push(point);
        }
        Ok(points)
    }

    /// Tangent vector of the moved states from one point to another.
    fn difference(&self, layout: &Layout, to: &[f64], from: &[f64]) -> DVector<f64> {
        let mut out = DVector::zeros(self.rows.len());
        let mut rest = out.as_mut_slice();
        for block in self.moved.iter().map(|slot| &layout.blocks[*slot]) {
            let (delta, others) = rest.split_at_mut(block.operations.tangent);
            (block.operations.local)(&to[block.range()], &from[block.range()], delta);
            rest = others;
        }
        out
    }

    /// The points at which Python propagates: the state, then both ends of the central difference
    /// along each axis of its error and along each channel. Returns their numbers, and the steps.
    fn points(&self, layout: &Layout, state: &State, input: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut numbers, mut steps) = (Vec::new(), Vec::new());
        let mut point = |values: &[f64], input: &[f64]| {
            self.blocks(layout).for_each(|block| append(block, values, &mut numbers));
            numbers.extend_from_slice(input);
        };
        point(&state.values, input);
        for block in self.blocks(layout).filter(|block| block.tangent.is_some()) {
            let step = step(block, &state.values);
            for axis in 0..block.operations.tangent {
                for side in [step, -step] {
                    let (mut moved, mut delta) = (state.values.clone(), [0.0; MAX_TANGENT]);
                    delta[axis] = side;
                    let delta = &delta[..block.operations.tangent];
                    (block.operations.retract)(&mut moved[block.range()], delta);
                    point(&moved, input);
                }
                steps.push(step);
            }
        }
        for (channel, value) in input.iter().enumerate() {
            let step = STEP * value.abs().max(1.0);
            for side in [step, -step] {
                let mut moved = input.to_vec();
                moved[channel] += side;
                point(&state.values, &moved);
            }
            steps.push(step);
        }
        (numbers, steps)
    }
}

fn step(block: &Block, values: &[f64]) -> f64 {
    match block.operations.reading {
        navfuse_core::state::manifold::Reading::Tangent => METRES,
        _ => STEP * values[block.range()].iter().fold(1.0_f64, |a, x| a.max(x.abs())),
    }
}

impl ProcessModel for Model {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let (dt, (input, covered)) = (interval.duration(), self.input(interval)?);
        let (numbers, steps) = self.points(layout, state, &input);
        let points = self.propagated(layout, &state.values, &numbers, dt)?;
        let Some((next, sides)) = points.split_first() else {
            return Err(ProcessError::new("propagate moved no state"));
        };
        let slope = |(step, sides): (&f64, &[Vec<f64>])| {
            let [ahead, behind] = [0, 1].map(|k| self.difference(layout, &sides[k], next));
            (ahead - behind) / (2.0 * step)
        };
        let slopes: Vec<DVector<f64>> =
            steps.iter().zip(sides.chunks_exact(2)).map(slope).collect();
        let (phi, gain) = slopes.split_at(steps.len() - input.len());
        // white noise from sample to sample: its share in a part of the interval of a sample has
        // the variance of a longer one, so that the parts add up to the whole
        let mut q = DMatrix::from_diagonal(&(&self.walk * dt));
        if !gain.is_empty() {
            let gain = DMatrix::from_columns(gain);
            q += &gain * &self.covariance * gain.transpose() * (covered / dt);
        }
        transition.set_dense(self.places, &DMatrix::from_columns(phi), &q);
        state.values.copy_from_slice(next);
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let followed = self.calls.call(|py| {
            let answer = self.calls.follow.call1(py, (packed(py, &motion_numbers(motion)),))?;
            let parts: Vec<Option<Vec<f64>>> = answer.extract(py)?;
            Ok(parts)
        });
        // an exception ends the run
        for (slot, numbers) in self.moved.iter().zip(followed.into_iter().flatten()) {
            if let Some(numbers) = numbers {
                take(&layout.blocks[*slot], &mut &numbers[..], &mut state.values);
                known[*slot] = true;
            }
        }
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Simulates the driving sensor.
#[derive(Clone)]
struct Simulator(Model);

impl Simulate for Simulator {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let Self(model) = self;
        let [before, after] =
            [scene.from, scene.to].map(|t| motion_numbers(&scene.trajectory.at(t)));
        let mut parameters = Vec::new();
        let held = model.held.iter().map(|slot| &scene.layout.blocks[*slot]);
        held.for_each(|block| append(block, &scene.truth.values, &mut parameters));
        let answer = model.calls.call(|py| {
            let motion = [&before, &after, &parameters].map(|numbers| packed(py, numbers));
            let [before, after, parameters] = motion;
            let dt = scene.to.since(scene.from);
            let answer = model.calls.simulate.call1(py, (before, after, parameters, dt))?;
            Ok(values(answer.extract(py)?).collect::<Vec<f64>>())
        });
        let n = model.covariance.nrows();
        let white = DVector::from_fn(n, |_, _| scene.noise * scene.random.normal());
        let noise = match model.covariance.clone().cholesky() {
            Some(factor) => factor.l() * white,
            None => white * 0.0, // the class has a positive 1-sigma of each channel
        };
        for (k, (value, noise)) in answer.unwrap_or_default().iter().zip(&noise).enumerate() {
            sample.set(k, value + noise);
        }
    }

    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}
