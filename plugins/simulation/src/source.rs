//! The simulated source, which simulates every sensor of the scenario on one trajectory.

use crate::ideal::{Ideal, IdealReader};
use crate::phase::Piece;
use crate::{Cursor, Trajectory, TrajectoryConfig};
use nalgebra::Vector3;
use navfuse_core::compose::Composition;
use navfuse_core::compose::truth::TrueState;
use navfuse_core::model::process::ProcessModel;
use navfuse_core::model::process::input::Correction;
use navfuse_core::model::record::{Event, Level};
use navfuse_core::model::sensor::measurement::AnyMeasurement;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::sensor::{Reference, Role};
use navfuse_core::model::simulate::fault::Injector;
use navfuse_core::model::simulate::{Faults, Memory, Random, Scene, Simulate};
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{Handle, Layout};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::{Span, Time};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Simulates every sensor that has a `simulation` table, on a trajectory made of segments.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// Initial position, attitude and speed.
    #[serde(default)]
    pub start: crate::StartConfig,
    /// Motions, one after the other.
    pub segments: Vec<crate::SegmentConfig>,
}

impl SourceType for Simulation {
    const TYPE: &'static str = "simulation";
    const SIMULATES: bool = true;

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let config = TrajectoryConfig { start: self.start, segments: self.segments };
        let trajectory = Trajectory::new(&config)
            .map_err(|e| StreamError::scenario(e.message()).at_key(e.key()).with_source(e))?;
        let sensors = context.composition.sensors.len();
        let ideal = context.shared.as_ref().map(|shared| {
            let made = || Ideal::new(trajectory.clone(), sensors);
            shared.find(|ideal: &Ideal| ideal.trajectory == trajectory, made)
        });
        streams(&trajectory, context, ideal.as_deref())
    }
}

/// Opens a stream for every sensor that has a `simulation` table, on the trajectory.
///
/// # Errors
/// When no sensor is simulated, or the parameters of a simulation are out of range.
pub fn simulate<P: Piece>(
    trajectory: &Trajectory<P>,
    context: &OpenContext<'_>,
) -> Result<Vec<Box<dyn Source>>, StreamError> {
    streams(trajectory, context, None)
}

/// As [`simulate`], with the error-free readings that other runs share.
fn streams<P: Piece>(
    trajectory: &Trajectory<P>,
    context: &OpenContext<'_>,
    ideal: Option<&Ideal>,
) -> Result<Vec<Box<dyn Source>>, StreamError> {
    let composition = context.composition;
    let mut streams: Vec<Box<dyn Source>> = Vec::new();
    // another driving sensor, such as the navigation of a ship, follows the same trajectory
    let mut announced = false;
    for (index, sensor) in composition.sensors.iter().enumerate() {
        let Some(faults) = &sensor.simulation else { continue };
        check(faults, &sensor.info)?;
        let kind = match (&sensor.role, &sensor.simulator) {
            (_, Some(simulator)) => Simulated::Driving(simulator.boxed_clone()),
            (Role::Measurement(model), None) => Simulated::Measuring(Arc::clone(model)),
            (Role::Reference(reference), None) => Simulated::Reference(Arc::clone(reference)),
            (Role::Input(_), None) => continue,
        };
        let injector = Injector::new(&faults.faults, &sensor.info, composition.seed)
            .map_err(|e| StreamError::scenario(e.to_string()).of_sensor(&sensor.info.name))?;
        let path = Path {
            cursor: trajectory.cursor(),
            number: 0,
            shared: ideal.and_then(|ideal| ideal.reader(index)),
        };
        let end = Time::from_seconds(trajectory.duration()).unwrap_or(Time::MAX);
        let mut stream = SensorStream::new(composition, index, faults, injector, kind, path, end);
        announced = announced || stream.announce(trajectory);
        streams.push(Box::new(stream));
    }
    if streams.is_empty() {
        return Err(StreamError::scenario(
            "no sensor is simulated: give one a rate, such as [sensor.imu.simulation] rate = \"100 \
             Hz\"",
        ));
    }
    Ok(streams)
}

/// Greatest rate, Hz: times are whole nanoseconds, and a run is finite.
const MAX_RATE: f64 = 1e6;

/// Rejects parameters that cannot be simulated.
fn check(faults: &Faults, sensor: &SensorInfo) -> Result<(), StreamError> {
    let refuse = |key: &str, found: String, ask: &str| {
        let place = format!("[sensor.{}.simulation] {key} = {found}", sensor.name);
        Err(StreamError::scenario(ask).at_key(place))
    };
    if faults.rate.value().si() > MAX_RATE {
        return refuse("rate", faults.rate.value().to_string(), "give a rate up to 1 MHz");
    }
    // a measuring sensor may begin before the trajectory, where the vehicle is as at 0 s; an
    // integrating sensor may not
    if sensor.purpose == Purpose::Input && faults.offset.si() < 0.0 {
        return refuse(
            "offset",
            faults.offset.to_string(),
            "the trajectory begins at 0 s: give an offset from there on",
        );
    }
    for (key, probability, limit) in
        [("dropout", faults.dropout, 0.999), ("outliers", faults.outliers, 1.0)]
    {
        if probability.value().si() > limit {
            let ask = format!("give a probability up to {limit}, such as \"2 %\"");
            return refuse(key, probability.value().to_string(), &ask);
        }
    }
    if let Some([from, to]) = faults.outages.iter().find(|[from, to]| from.si() >= to.si()) {
        return refuse("outages", format!("[{from}, {to}]"), "an outage ends after it begins");
    }
    if sensor.purpose != Purpose::Measurement && faults.outliers.value().si() > 0.0 {
        return refuse(
            "outliers",
            faults.outliers.value().to_string(),
            "only measuring sensors have outliers",
        );
    }
    if sensor.purpose == Purpose::Reference && faults.noise.value().si() != 1.0 {
        return refuse(
            "noise",
            faults.noise.value().to_string(),
            "a reference is simulated without noise",
        );
    }
    Ok(())
}

/// Simulator of a sensor.
enum Simulated {
    /// The simulator of the driving sensor itself.
    Driving(Box<dyn Simulate>),
    /// The measurement model, at the true state.
    Measuring(Arc<dyn AnyMeasurement + Sync>),
    /// The reference, from the motion.
    Reference(Arc<dyn Reference>),
}

/// A cursor as the framework's trajectory.
struct Path<P: Piece> {
    cursor: Cursor<P>,
    /// Number of the sample that is simulated.
    number: usize,
    /// Readings that the run shares with others.
    shared: Option<IdealReader>,
}

impl<P: Piece> navfuse_core::model::sensor::motion::Trajectory for Path<P> {
    fn at(&mut self, time: Time) -> Motion {
        let Self { cursor, number, shared } = self;
        let mut compute = || {
            let k = cursor.at(time.seconds());
            Motion {
                time,
                position: k.position,
                velocity: k.velocity,
                c_b_n: k.c_b_n,
                w_ib_b: k.w_ib_b,
                f_ib_b: k.specific_force,
            }
        };
        match shared {
            Some(shared) => shared.motions.value(*number, time, compute),
            None => compute(),
        }
    }

    fn increments(&mut self, from: Time, to: Time) -> (Vector3<f64>, Vector3<f64>) {
        let Self { cursor, number, shared } = self;
        let mut compute = || cursor.increments(from.seconds(), to.seconds());
        match shared {
            Some(shared) => shared.increments.value(*number, (from, to), compute),
            None => compute(),
        }
    }
}

/// One simulated sensor.
struct SensorStream<P: Piece> {
    layout: Arc<Layout>,
    processes: Vec<Box<dyn ProcessModel>>,
    truth: TrueState,
    path: Path<P>,
    random: Random,
    faults: Faults,
    injector: Injector,
    sensor: SensorId,
    /// Past states of the sensor: source and past, a pair of slots each.
    clones: Vec<[usize; 2]>,
    /// Lag of the samples, and the truth at the time of a sample, which contains the lag.
    lag: Option<(Handle<Scalar>, TrueState)>,
    kind: Simulated,
    /// Input models of the sensor.
    correction: Option<Arc<Correction>>,
    /// Number of the next time, the time before it, and the number of the next observation.
    count: i64,
    before: Time,
    observation: usize,
    /// Time that the instrument has chosen for its next sample.
    chosen: Option<Time>,
    /// What the instrument remembers.
    memory: Memory,
    /// Set if a past state begins at the last time.
    keyframe: bool,
    /// Largest number of observations of one time.
    observations: usize,
    /// Set if the samples of the current time are lost.
    gone: bool,
    end: Time,
    schedule: Vec<Event>,
}

impl<P: Piece> SensorStream<P> {
    fn new(
        composition: &Composition,
        index: usize,
        faults: &Faults,
        injector: Injector,
        kind: Simulated,
        path: Path<P>,
        end: Time,
    ) -> Self {
        let name = &composition.sensors[index].info.name;
        let truth = TrueState::of(composition);
        let mut stream = Self {
            layout: Arc::clone(&composition.layout),
            processes: composition.processes.iter().map(|p| p.model.boxed_clone()).collect(),
            lag: composition.sensors[index].time_offset.map(|offset| (offset, truth.clone())),
            truth,
            path,
            random: Random::new(composition.seed, name),
            faults: faults.clone(),
            injector,
            sensor: SensorId(index),
            clones: composition.sensors[index].clones.clone(),
            correction: composition.sensors[index].correction.clone(),
            // an integrating sensor's first sample covers the first interval
            count: i64::from(matches!(kind, Simulated::Driving(_))),
            before: Time::MIN,
            observation: 0,
            chosen: None,
            memory: Memory::default(),
            keyframe: false,
            observations: match &kind {
                Simulated::Measuring(model) => model.observations(),
                Simulated::Driving(_) | Simulated::Reference(_) => 1,
            },
            gone: false,
            kind,
            end,
            schedule: Vec::new(),
        };
        stream.before = stream.time(stream.count - 1);
        stream
    }

    /// Announces the parts of the trajectory in the log if the sensor drives a process, and returns
    /// `true` in that case.
    fn announce(&mut self, trajectory: &Trajectory<P>) -> bool {
        let drives = matches!(self.kind, Simulated::Driving(_));
        if drives {
            self.schedule = (trajectory.segments())
                .filter_map(|s| {
                    let text = format!("{} from {:.0} s to {:.0} s", s.label, s.start, s.end);
                    Time::from_seconds(s.start).map(|time| Event {
                        time,
                        level: Level::Info,
                        about: "trajectory".into(),
                        text,
                    })
                })
                .collect();
        }
        drives
    }

    /// The time of the sample of that number.
    fn time(&self, count: i64) -> Time {
        let seconds = self.faults.offset.si() + count as f64 / self.faults.rate.value().si();
        Time::from_seconds(seconds).unwrap_or(Time::MAX)
    }

    /// Begins the next observation at a time, and returns its number.
    fn begin(&mut self, to: Time) -> usize {
        // the shared readings are those of the multiples of the rate
        let regular = if self.chosen.is_some() { -1 } else { self.count };
        self.path.number = usize::try_from(regular).unwrap_or(usize::MAX);
        let observation = self.observation;
        // a past state is the truth after all observations of the time before
        if observation == 0 && std::mem::take(&mut self.keyframe) {
            self.layout.copy_past(&self.clones, &mut self.truth.state.values);
        }
        self.observation += 1;
        if self.observation >= self.observations {
            (self.observation, self.before) = (0, to);
            self.count += i64::from(self.chosen.take().is_none());
            // an instrument that chose a time is busy until then
            while self.time(self.count) <= to && to < self.end {
                self.count += 1;
            }
        }
        observation
    }

    /// Lag of the sample at that time.
    fn lag(&mut self, time: Time) -> Option<Span> {
        let (offset, truth) = self.lag.as_mut()?;
        truth.advance(&self.layout, time);
        Span::from_seconds(truth.state.get(&self.layout, *offset))
    }

    /// Draws whether the sample at that time is lost.
    fn lost(&mut self, time: Time) -> bool {
        let t = time.seconds();
        let dropped = self.faults.dropout.value().si() > 0.0
            && self.random.uniform() < self.faults.dropout.value().si();
        dropped || self.faults.outages.iter().any(|[from, to]| t >= from.si() && t < to.si())
    }
}

impl<P: Piece> Source for SensorStream<P> {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        loop {
            let (from, to) = (self.before, self.chosen.unwrap_or_else(|| self.time(self.count)));
            if to > self.end {
                return Ok(false);
            }
            let observation = self.begin(to);
            *sample = Sample::empty(to, self.sensor);
            // a sample that lags holds the motion of an earlier time
            let (from, to) = match self.lag(to) {
                Some(lag) => (from - lag, to - lag),
                None => (from, to),
            };
            // a reference reads the motion alone
            if !matches!(self.kind, Simulated::Reference(_)) {
                self.truth.advance(&self.layout, to);
            }
            if let Simulated::Driving(simulator) = &self.kind {
                let (layout, truth) = (&*self.layout, &self.truth.state);
                let (noise, random) = (self.faults.noise.value().si(), &mut self.random);
                simulator.simulate(
                    &mut Scene {
                        layout,
                        truth,
                        trajectory: &mut self.path,
                        from,
                        to,
                        observation,
                        noise,
                        outlier: 0.0,
                        random,
                        memory: &mut self.memory,
                    },
                    sample,
                );
                // the instrument gives the channels that its input models correct
                if let Some(correction) = &self.correction
                    && !correction.invert(layout, truth, sample)
                {
                    return Err(StreamError::scenario(format!(
                        "no reading of the instrument gives the true input at {to}: its input \
                         models have no inverse there; check the `truth` of their states"
                    )));
                }
                if !self.lost(to) && self.injector.apply(sample) {
                    return Ok(true);
                }
                continue;
            }
            if observation == 0 {
                self.gone = self.lost(sample.time);
            }
            if self.gone {
                continue;
            }
            let motion = navfuse_core::model::sensor::motion::Trajectory::at(&mut self.path, to);
            match &self.kind {
                Simulated::Measuring(model) => {
                    let TrueState { state, known, .. } = &mut self.truth;
                    for process in &self.processes {
                        process.follow(&self.layout, &motion, state, known);
                    }
                    let faults = &self.faults;
                    let hit = self.random.uniform() < faults.outliers.value().si();
                    let outlier = if hit { faults.outlier_size.value().si() } else { 0.0 };
                    let (noise, random) = (faults.noise.value().si(), &mut self.random);
                    let (layout, truth, trajectory) = (&*self.layout, &*state, &mut self.path);
                    let memory = &mut self.memory;
                    let mut scene = Scene {
                        layout,
                        truth,
                        trajectory,
                        from,
                        to,
                        observation,
                        noise,
                        outlier,
                        random,
                        memory,
                    };
                    model.simulate(&mut scene, sample);
                    if self.observation == 0 {
                        let next = model.next_time(&mut scene, sample).filter(|next| *next > to);
                        self.chosen = next.map(|next| sample.time + (next - to));
                    }
                }
                Simulated::Reference(reference) => reference.sample(&motion, sample),
                Simulated::Driving(_) => {}
            }
            // a sensor that has lost all channels gives no sample
            if sample.present() != 0 && self.injector.apply(sample) {
                // the next sample begins at the truth of this one, if it is a keyframe
                self.keyframe |=
                    matches!(&self.kind, Simulated::Measuring(m) if m.keyframe(sample));
                return Ok(true);
            }
        }
    }

    fn end(&self) -> Option<Time> {
        Some(self.end)
    }

    fn schedule(&self) -> Vec<Event> {
        self.schedule.clone()
    }
}
