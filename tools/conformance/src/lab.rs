//! What the checks work on: the scenario composed, its samples, and states at which models are
//! asked.

use crate::Failure;
use navfuse_core::compose::Composition;
use navfuse_core::document::{Document, Node};
use navfuse_core::ekf::Ekf;
use navfuse_core::model::measurement::AnyMeasurement;
use navfuse_core::model::motion::Motion;
use navfuse_core::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::simulate::Random;
use navfuse_core::model::stream::Source;
use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::plugin::{Kind, Plugin, Registry};
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{MAX_TANGENT, Position, Rotation};
use navfuse_core::state::{Block, Layout, State};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use std::any::TypeId;
use std::path::Path;
use std::sync::Arc;

/// Random states at which a model is asked.
pub const STATES: usize = 24;

/// The types of the plugins, and what a scenario needs beside them.
pub struct Types {
    pub registry: Registry,
    /// The kinds and names that are checked.
    pub checked: Vec<(Kind, &'static str)>,
}

/// Registers the plugins, and the IMU, the strapdown process and the simulation where they are not
/// among them.
pub fn registry(plugins: &[&dyn Plugin]) -> Types {
    let mut registry = Registry::new();
    plugins.iter().for_each(|plugin| _ = registry.add(*plugin));
    let checked = registry.entries().map(|e| (e.kind, e.name)).collect();
    if registry.get(Kind::Process, "ins").is_none() {
        registry.add(&navfuse_ins::InsPlugin);
    }
    if registry.get(Kind::Source, "simulation").is_none() {
        registry.add(&navfuse_simulation::SimulationPlugin);
    }
    Types { registry, checked }
}

/// A state on the way, and the sample of some sensor that came then.
pub struct Moment {
    pub state: State,
    pub sample: Sample,
}

/// The scenario and one run of it.
pub struct Lab<'a> {
    pub types: &'a Types,
    pub text: &'a str,
    pub composition: Composition,
    /// Every sample of the run, in the order in which a filter takes them.
    pub samples: Vec<Sample>,
    /// The filter's state at each of them, with the sample.
    pub moments: Vec<Moment>,
    /// Why the run ended early, if it did.
    pub ended: Option<String>,
}

/// A source or sink of the scenario that is checked.
pub struct Stream {
    /// Its type and its table, for the report.
    pub about: String,
    /// Its registered type.
    pub kind: String,
    /// The name of its table.
    pub name: String,
}

/// A sensor or process of the scenario that is checked.
pub struct Part {
    /// Its type and its table, for the report.
    pub about: String,
    /// Its place in the composition.
    pub index: usize,
}

impl<'a> Lab<'a> {
    pub fn new(types: &'a Types, text: &'a str) -> Result<Self, Failure> {
        let Assembly { composition, mut sources, .. } = assemble_to(types, text, None)?;
        let samples = merged(&mut sources, &composition)?;
        let mut lab = Self { types, text, composition, samples, moments: Vec::new(), ended: None };
        if lab.has_models() {
            assemble(types, text, &[])?; // what is drawn again and again must be simulated
        } else if lab.streams(Kind::Source).is_empty() && lab.streams(Kind::Sink).is_empty() {
            let names: Vec<&str> = types.checked.iter().map(|(_, name)| *name).collect();
            return Err(Failure::new(format!(
                "no type of the plugins is in the scenario, so nothing is checked; add a table for one of: {}",
                names.join(", ")
            )));
        }
        let mut ekf = Ekf::new(lab.compose(&[])?);
        for sample in &lab.samples {
            if let Err(e) = ekf.process(sample, &mut Heard::default()) {
                // what it was asked at until then may show why
                lab.ended = Some(format!("the run ends early: {e}"));
                break;
            }
            if ekf.running() {
                lab.moments.push(Moment { state: ekf.state().clone(), sample: *sample });
            }
        }
        if lab.moments.is_empty() {
            return Err("the filter never starts; see `navfuse run` on the scenario".into());
        }
        Ok(lab)
    }

    /// The scenario composed anew, with `key.path=value` overrides.
    pub fn compose(&self, settings: &[String]) -> Result<Composition, Failure> {
        let document = Document::parse("scenario", self.text).map_err(Failure::caused_by)?;
        let scenario =
            Scenario::new(&self.types.registry, document, settings).map_err(Failure::caused_by)?;
        scenario.compose().map_err(Failure::caused_by)
    }

    fn is_checked(&self, kind: Kind, name: &str) -> bool {
        self.types.checked.iter().any(|(k, n)| *k == kind && *n == name)
    }

    /// Whether a sensor or process is checked, not sources and sinks alone.
    pub fn has_models(&self) -> bool {
        !self.sensors().is_empty() || !self.processes().is_empty()
    }

    /// The sources, or the sinks, of the scenario that are checked.
    pub fn streams(&self, kind: Kind) -> Vec<Stream> {
        let Ok(document) = Document::parse("scenario", self.text) else { return Vec::new() };
        let root = document.root();
        let tables =
            root.get(kind.table()).and_then(|node| node.entries().ok()).unwrap_or_default();
        let stream = |(name, node): (&str, Node<'_>)| {
            let own =
                node.get("type").and_then(|t| t.parse().ok()).unwrap_or_else(|| name.to_owned());
            self.is_checked(kind, &own).then(|| Stream {
                about: format!("{0} type {own} ([{0}.{name}])", kind.table()),
                kind: own,
                name: name.to_owned(),
            })
        };
        tables.into_iter().filter_map(stream).collect()
    }

    /// The sensors that are checked.
    pub fn sensors(&self) -> Vec<Part> {
        let sensors = self.composition.sensors.iter().enumerate();
        let checked = sensors.filter(|(_, s)| self.is_checked(Kind::Sensor, &s.info.kind));
        let part = |(index, s): (usize, &navfuse_core::model::sensor::Sensor)| Part {
            about: format!("sensor type {} ([sensor.{}])", s.info.kind, s.info.name),
            index,
        };
        checked.map(part).collect()
    }

    /// The measuring sensors that are checked, with their models.
    pub fn models(&self) -> Vec<(Part, &Arc<dyn AnyMeasurement + Sync>)> {
        let model = |part: Part| match &self.composition.sensors[part.index].role {
            Role::Measurement(model) => Some((part, model)),
            _ => None,
        };
        self.sensors().into_iter().filter_map(model).collect()
    }

    /// The processes that are checked.
    pub fn processes(&self) -> Vec<Part> {
        let processes = self.composition.processes.iter().enumerate();
        let checked = processes.filter(|(_, p)| self.is_checked(Kind::Process, &p.kind));
        let part = |(index, p): (usize, &navfuse_core::compose::Process)| Part {
            about: format!("process type {} ([process.{}])", p.kind, p.name),
            index,
        };
        checked.map(part).collect()
    }

    /// Whether a process moves states with the vehicle and no sensor drives it. Then its `Q` stands
    /// for manoeuvres, of which the simulated ones are no draw: errors and innovations may be
    /// smaller than the filter says.
    pub fn assumes(&self) -> bool {
        let (layout, mut state) = (&self.composition.layout, self.moments[0].state.clone());
        let motion = Motion {
            time: state.time,
            position: Geodetic { latitude: 0.5, longitude: 0.0, height: 0.0 },
            velocity: Vector3::x(),
            c_b_n: UnitQuaternion::identity(),
            w_ib_b: Vector3::zeros(),
            f_ib_b: Vector3::zeros(),
        };
        let mut moved = vec![false; layout.blocks.len()];
        for process in self.composition.processes.iter().filter(|p| p.input.is_none()) {
            process.model.follow(layout, &motion, &mut state, &mut moved);
        }
        moved.contains(&true)
    }

    /// Moments of the run at a sensor's samples, evenly over the run, each state displaced at
    /// random.
    pub fn moments_of(&self, sensor: usize, layout: &Layout) -> Vec<Moment> {
        let own: Vec<&Moment> =
            self.moments.iter().filter(|m| m.sample.sensor.0 == sensor).collect();
        let mut random = Random::new(1, "conformance");
        let count = STATES.min(own.len());
        (0..count)
            .map(|k| {
                let moment = own[k * own.len() / count];
                let mut state = moment.state.clone();
                displace(layout, &mut state, &mut random);
                Moment { state, sample: moment.sample }
            })
            .collect()
    }
}

/// The layout with a place in the error state for fixed blocks too, so that derivatives with
/// respect to them are checked.
pub fn all_estimated(layout: &Layout) -> Layout {
    let mut layout = layout.clone();
    for block in &mut layout.blocks {
        if block.tangent.is_none() {
            block.tangent = Some(layout.tangent);
            layout.tangent += block.operations.tangent;
        }
    }
    layout
}

/// How large a displacement of a block is: its prior sigma, and not so little that a function is
/// straight.
pub fn reach(block: &Block, values: &[f64], axis: usize) -> f64 {
    let floor = if block.operations.kind == TypeId::of::<Position>() {
        10.0
    } else if block.operations.kind == TypeId::of::<Rotation>() {
        0.3
    } else {
        0.05 * values.iter().fold(0.0_f64, |a, x| a.max(x.abs()))
    };
    let sigma = block.spec.sigma[axis];
    if floor == 0.0 && sigma == 0.0 { 0.05 } else { sigma.max(floor) }
}

/// Displaces every block at random.
fn displace(layout: &Layout, state: &mut State, random: &mut Random) {
    for block in &layout.blocks {
        let values = &mut state.values[block.range()];
        let mut delta = [0.0; MAX_TANGENT];
        for (axis, d) in delta[..block.operations.tangent].iter_mut().enumerate() {
            *d = (2.0 * random.uniform() - 1.0) * reach(block, values, axis);
        }
        (block.operations.retract)(values, &delta[..block.operations.tangent]);
    }
}

pub fn assemble(types: &Types, text: &str, settings: &[String]) -> Result<Assembly, Failure> {
    let document = Document::parse("scenario", text).map_err(Failure::caused_by)?;
    let scenario =
        Scenario::new(&types.registry, document, settings).map_err(Failure::caused_by)?;
    if !scenario.simulates().map_err(Failure::caused_by)? {
        return Err("its samples are not all simulated; use [source.simulation] alone".into());
    }
    scenario.assemble(None).map_err(Failure::caused_by)
}

/// The scenario as it is, also where its samples are recorded; with the sinks that it names, where
/// there is a folder for them.
pub fn assemble_to(types: &Types, text: &str, output: Option<&Path>) -> Result<Assembly, Failure> {
    let document = Document::parse("scenario", text).map_err(Failure::caused_by)?;
    let scenario = Scenario::new(&types.registry, document, &[]).map_err(Failure::caused_by)?;
    scenario.assemble(output).map_err(Failure::caused_by)
}

/// All samples in order of time; a reference's after what else comes then, but not before the first
/// driving sample.
pub fn merged(
    sources: &mut [(String, Box<dyn Source>)],
    composition: &Composition,
) -> Result<Vec<Sample>, Failure> {
    let mut samples = Vec::new();
    let until = composition.estimator.stop().unwrap_or(Time::MAX);
    for (name, source) in sources {
        let mut sample = Sample::empty(Time::MIN, navfuse_core::units::sample::SensorId(0));
        while source
            .next(&mut sample)
            .map_err(|e| Failure::during(format_args!("source {name}"), e))?
            && sample.time <= until
        {
            if sample.sensor.0 >= composition.sensors.len() {
                return Err(Failure::new(format!(
                    "source {name}: {}",
                    stranger(&sample, composition.sensors.len())
                )));
            }
            samples.push(sample);
        }
    }
    let reference = |s: &Sample| matches!(composition.sensors[s.sensor.0].role, Role::Reference(_));
    samples.sort_by_key(|s| (s.time, reference(s)));
    Ok(samples)
}

/// What to say of a sample of a sensor that is not there.
pub fn stranger(sample: &Sample, known: usize) -> String {
    let (time, index) = (sample.time, sample.sensor.0);
    format!(
        "a sample at {time} is of sensor number {index}, and the scenario has {known}; give the sensor's place in \
         context.composition.sensors"
    )
}

/// An observer that keeps what became of the last sample.
#[derive(Default)]
pub struct Heard {
    /// Why it was rejected.
    pub rejection: Option<Rejection>,
    /// The number of channels that it was used with.
    pub used: Option<usize>,
}

impl Observer for Heard {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        match update.outcome {
            Outcome::Rejected(rejection) => self.rejection = Some(rejection),
            Outcome::Accepted | Outcome::Gated => self.used = Some(update.innovation.len()),
        }
    }
    fn input(&mut self, _: &Sample, rejected: Option<Rejection>) {
        self.rejection = self.rejection.or(rejected);
    }
}
