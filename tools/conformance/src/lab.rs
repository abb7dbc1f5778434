//! Data of the checks: the composed scenario, its samples, and the states at which models are
//! evaluated.

use crate::Failure;
use navfuse_core::compose::Composition;
use navfuse_core::document::{Document, Node};
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::AnyMeasurement;
use navfuse_core::model::sensor::motion::Motion;
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

/// Number of random states at which a model is evaluated.
pub const STATES: usize = 24;

/// Types of the plugins, and types that a scenario needs in addition.
pub struct Types {
    pub registry: Registry,
    /// Kinds and names of the checked types.
    pub checked: Vec<(Kind, Arc<str>)>,
}

/// Registers the plugins that are checked and the others that the scenario needs, and also the IMU,
/// the strapdown process and the simulation if the plugins do not.
pub fn registry(plugins: &[&dyn Plugin], others: &[&dyn Plugin]) -> Types {
    let mut registry = Registry::new();
    plugins.iter().for_each(|plugin| _ = registry.add(*plugin));
    let checked = registry.entries().map(|e| (e.kind, Arc::clone(&e.name))).collect();
    others.iter().for_each(|plugin| _ = registry.add(*plugin));
    if registry.get(Kind::Process, "ins").is_none() {
        registry.add(&navfuse_ins::InsPlugin);
    }
    if registry.get(Kind::Source, "simulation").is_none() {
        registry.add(&navfuse_simulation::SimulationPlugin);
    }
    Types { registry, checked }
}

/// A state of the run, and the sample of the same time.
pub struct Moment {
    pub state: State,
    pub sample: Sample,
}

/// The scenario and one run of it.
pub struct Lab<'a> {
    pub types: &'a Types,
    pub text: &'a str,
    pub composition: Composition,
    /// Every sample of the run, in the order in which a filter processes them.
    pub samples: Vec<Sample>,
    /// State of the filter at each sample, with the sample.
    pub moments: Vec<Moment>,
    /// Reason why the run ended early.
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
            assemble(types, text, &[])?; // repeated runs need simulated samples
        } else if lab.streams(Kind::Source).is_empty() && lab.streams(Kind::Sink).is_empty() {
            let names: Vec<&str> = types.checked.iter().map(|(_, name)| &**name).collect();
            return Err(Failure::new(format!(
                "the scenario uses no type of the plugins, so there is nothing to check; add a \
                 table for one of: {}",
                names.join(", ")
            )));
        }
        let mut ekf = Ekf::new(lab.compose(&[])?);
        for sample in &lab.samples {
            if let Err(e) = ekf.process(sample, &mut Heard::default()) {
                // the moments before the end may show the cause
                lab.ended = Some(format!("the run ends early: {e}"));
                break;
            }
            if ekf.running() {
                lab.moments.push(Moment { state: ekf.state().clone(), sample: *sample });
            }
        }
        if lab.moments.is_empty() {
            return Err(
                "the filter never starts; `navfuse run` on the scenario prints the reason".into()
            );
        }
        Ok(lab)
    }

    /// Composes the scenario again, with `key.path=value` overrides.
    pub fn compose(&self, settings: &[String]) -> Result<Composition, Failure> {
        let document = Document::parse("scenario", self.text).map_err(Failure::caused_by)?;
        let scenario =
            Scenario::new(&self.types.registry, document, settings).map_err(Failure::caused_by)?;
        scenario.compose().map_err(Failure::caused_by)
    }

    fn is_checked(&self, kind: Kind, name: &str) -> bool {
        self.types.checked.iter().any(|(k, n)| *k == kind && **n == *name)
    }

    /// Tests whether a sensor or process is checked, and not only sources and sinks.
    pub fn has_models(&self) -> bool {
        !self.sensors().is_empty() || !self.processes().is_empty()
    }

    /// Checked sources or sinks of the scenario.
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

    /// Checked sensors.
    pub fn sensors(&self) -> Vec<Part> {
        let sensors = self.composition.sensors.iter().enumerate();
        let checked = sensors.filter(|(_, s)| self.is_checked(Kind::Sensor, &s.info.kind));
        let part = |(index, s): (usize, &navfuse_core::model::sensor::Sensor)| Part {
            about: format!("sensor type {} ([sensor.{}])", s.info.kind, s.info.name),
            index,
        };
        checked.map(part).collect()
    }

    /// Checked measuring sensors, with their models.
    pub fn models(&self) -> Vec<(Part, &Arc<dyn AnyMeasurement + Sync>)> {
        let model = |part: Part| match &self.composition.sensors[part.index].role {
            Role::Measurement(model) => Some((part, model)),
            _ => None,
        };
        self.sensors().into_iter().filter_map(model).collect()
    }

    /// Checked processes.
    pub fn processes(&self) -> Vec<Part> {
        let processes = self.composition.processes.iter().enumerate();
        let checked = processes.filter(|(_, p)| self.is_checked(Kind::Process, &p.kind));
        let part = |(index, p): (usize, &navfuse_core::compose::Process)| Part {
            about: format!("process type {} ([process.{}])", p.kind, p.name),
            index,
        };
        checked.map(part).collect()
    }

    /// Tests whether a process moves states with the vehicle although no sensor drives it. The `Q`
    /// of such a process represents manoeuvres, and the simulated manoeuvres are not a random draw
    /// of it: errors and innovations may be smaller than their covariance predicts.
    pub fn assumes(&self) -> bool {
        self.followed(|process| process.input.is_none()).contains(&true)
    }

    /// Tests whether a run can know the truth of a block: a process that moves it follows the motion
    /// of the vehicle with it, or moves its truth, or none moves it. A past state has no truth.
    pub fn has_truth(&self, block: &Block) -> bool {
        let layout = &self.composition.layout;
        let Some(slot) = layout.blocks.iter().position(|b| b.name == block.name) else {
            return false;
        };
        let moves = self.composition.transition.moves(&block.tangent_range());
        let wanders =
            || self.composition.processes.iter().any(|p| p.wandering(layout).contains(&slot));
        let given = || self.followed(|_| true)[slot] || wanders();
        !layout.is_past(slot) && (!moves || given())
    }

    /// Marks the blocks that some processes set on a known motion.
    fn followed(&self, chosen: impl Fn(&navfuse_core::compose::Process) -> bool) -> Vec<bool> {
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
        for process in self.composition.processes.iter().filter(|p| chosen(p)) {
            process.model.follow(layout, &motion, &mut state, &mut moved);
        }
        moved
    }

    /// Moments at a sensor's samples, evenly spaced over the run, each state displaced at random.
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

/// Layout in which fixed blocks also have a place in the error state, so that the derivatives with
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

/// Size of a displacement of a block: its prior sigma, but large enough to show nonlinearity.
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

/// Assembles the scenario without sinks; every source must simulate its samples.
pub fn assemble(types: &Types, text: &str, settings: &[String]) -> Result<Assembly, Failure> {
    let document = Document::parse("scenario", text).map_err(Failure::caused_by)?;
    let scenario =
        Scenario::new(&types.registry, document, settings).map_err(Failure::caused_by)?;
    if !scenario.simulates().map_err(Failure::caused_by)? {
        return Err(
            "not all samples are simulated; use [source.simulation] as the only source".into()
        );
    }
    scenario.assemble(None).map_err(Failure::caused_by)
}

/// Assembles the scenario unchanged, also with recorded samples; opens its sinks if they have an
/// output folder.
pub fn assemble_to(types: &Types, text: &str, output: Option<&Path>) -> Result<Assembly, Failure> {
    let document = Document::parse("scenario", text).map_err(Failure::caused_by)?;
    let scenario = Scenario::new(&types.registry, document, &[]).map_err(Failure::caused_by)?;
    scenario.assemble(output).map_err(Failure::caused_by)
}

/// Merges all samples in order of time; at equal times the samples of a reference come last.
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

/// Message about a sample of a sensor that the scenario does not have.
pub fn stranger(sample: &Sample, known: usize) -> String {
    let (time, index) = (sample.time, sample.sensor.0);
    format!(
        "a sample at {time} belongs to sensor number {index}, but the scenario has {known}; use \
         the sensor's index in context.composition.sensors"
    )
}

/// Observer that records the outcome of the last sample.
#[derive(Default)]
pub struct Heard {
    /// Reason of the rejection.
    pub rejection: Option<Rejection>,
    /// Number of channels in the update.
    pub used: Option<usize>,
}

impl Observer for Heard {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        match update.outcome {
            Outcome::Rejected(rejection) => self.rejection = Some(rejection),
            Outcome::Accepted | Outcome::Placed | Outcome::Gated => {
                self.used = Some(update.innovation.len())
            }
        }
    }
    fn input(&mut self, _: &Sample, rejected: Option<Rejection>) {
        self.rejection = self.rejection.or(rejected);
    }
}
