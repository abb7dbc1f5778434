//! The stages of a composition: driving sensors, processes, the other sensors, constraints, and the
//! checks of the whole.

use crate::compose::draw::{self, Draw};
use crate::compose::estimator::Creator;
use crate::compose::keys::WANDER;
use crate::compose::settings::{EstimatorConfig, Initial};
use crate::compose::{self, Composer, Composition, Process, truth};
use crate::document::{DocumentError, Node};
use crate::model::process::{BuiltProcess, ProcessModel, Wanderer};
use crate::model::sensor::{Role, Sensor};
use crate::plugin::{BuildError, Make};
use crate::run::inputs::{self, InputPart};
use crate::run::parts::Part;
use crate::run::placing::{place_sensor, ride};
use crate::run::rules::Rules;
use crate::state::Layout;
use std::path::Path;
use std::sync::Arc;

/// The values at the top of a scenario.
pub(crate) struct Header {
    pub name: String,
    pub description: Option<String>,
    pub seed: u64,
    pub estimator: EstimatorConfig,
}

impl Header {
    /// Reads the values; `name` is used where the scenario gives none.
    pub fn read(root: &Node<'_>, name: String) -> Result<Self, DocumentError> {
        let estimator = root.get("estimator");
        let config: EstimatorConfig =
            estimator.as_ref().map_or_else(|| Ok(EstimatorConfig::default()), Node::parse)?;
        if let Some(key) = config.beyond_the_clock() {
            let place = estimator.and_then(|n| n.get(key)).unwrap_or_else(|| root.clone());
            return Err(place.error("beyond 73 years, the longest time that can be represented"));
        }
        Ok(Self {
            name: root.get("name").map_or(Ok(name), |n| n.parse())?,
            seed: root.get("seed").map_or(Ok(1), |n| n.parse())?,
            description: root.get("description").map(|n| n.parse()).transpose()?,
            estimator: config,
        })
    }
}

/// A composition that is being built.
pub(crate) struct Building<'a> {
    root: Node<'a>,
    composer: Composer,
    /// The tables of the sensors, and the sensors built so far, one a table.
    parts: Vec<Part<'a>>,
    built: Vec<Option<Sensor>>,
    /// Update rules, with that of the sensors that have none of their own.
    rules: Rules,
    processes: Vec<Process>,
    /// Input models of the processes.
    inputs: Vec<InputPart>,
    /// All sensors once they are built: those of the tables, then the constraints.
    sensors: Vec<Sensor>,
}

impl<'a> Building<'a> {
    /// Begins with the tables of the sensors. Relative paths in the scenario start at `folder`;
    /// `rules` have that of the sensors that have none of their own.
    pub fn new(root: Node<'a>, folder: &Path, parts: Vec<Part<'a>>, rules: Rules) -> Self {
        let built = parts.iter().map(|_| None).collect();
        let composer = Composer::new(folder);
        let (processes, inputs, sensors) = (Vec::new(), Vec::new(), Vec::new());
        Self { root, composer, parts, built, rules, processes, inputs, sensors }
    }

    /// Builds the sensors that drive a process. Processes ask for the parameters of these sensors,
    /// so they come first.
    pub fn driving_sensors(&mut self) -> Result<(), BuildError> {
        self.build_sensors(true)
    }

    /// Builds the sensors that correct the state, and the references.
    pub fn other_sensors(&mut self) -> Result<(), BuildError> {
        self.build_sensors(false)?;
        self.sensors = std::mem::take(&mut self.built).into_iter().flatten().collect();
        Ok(())
    }

    fn build_sensors(&mut self, driving: bool) -> Result<(), BuildError> {
        for (part, place) in self.parts.iter().zip(&mut self.built) {
            let Make::Sensor { make, input } = &part.entry.make else { continue };
            if *input == driving {
                self.composer.begin(part.name);
                let keys = part.sensor_keys().parse()?;
                let built = make(&part.own_keys(), &mut self.composer)?;
                let sensor = place_sensor(part, keys, built, &self.rules, &mut self.composer)?;
                *place = Some(ride(sensor, &mut self.composer, &self.parts));
            }
        }
        Ok(())
    }

    /// Builds the processes and connects each to its driving sensor; those of the vehicle come first,
    /// in whatever order their tables stand.
    pub fn processes(&mut self, parts: &[Part<'_>]) -> Result<(), BuildError> {
        let is_beside =
            |part: &&Part<'_>| matches!(part.entry.make, Make::Process { beside: true, .. });
        let (beside, vehicle): (Vec<_>, Vec<_>) = parts.iter().partition(is_beside);
        for part in vehicle.into_iter().chain(beside) {
            let Make::Process { make, .. } = &part.entry.make else { continue };
            self.composer.begin(part.name);
            let BuiltProcess {
                model,
                input,
                alignment,
                screening,
                monitor,
                coasts_after,
                biases,
                corrections,
                product,
                second_order,
                sensor_wanders,
            } = make(&part.own_keys(), &mut self.composer)?;
            let named = corrections.into_iter().map(|(sensor, model)| InputPart {
                owner: part.name.to_owned(),
                sensor,
                model,
            });
            self.inputs.extend(named);
            let input = input.and_then(|driving| {
                let index = self.parts.iter().position(|p| p.name == driving.name);
                if let Some(sensor) = index.and_then(|k| self.built[k].as_mut()) {
                    sensor.simulator = Some(driving.simulator);
                }
                index
            });
            let wanders = part.wanders()?;
            let model: Box<dyn ProcessModel> =
                if wanders { Box::new(Wanderer(model)) } else { model };
            self.processes.push(Process {
                name: part.name.to_owned(),
                kind: part.entry.name.to_string(),
                searches: alignment.is_some(),
                alignment,
                screening,
                monitor,
                model,
                wanders,
                input,
                sensor_wanders,
                coasts_after,
                biases,
                product,
                second_order,
                constraint: None,
            });
        }
        Ok(())
    }

    /// Hands the sensors to the alignments of the processes.
    pub fn connect_alignments(&mut self) -> Result<(), BuildError> {
        for process in &mut self.processes {
            if let Some(alignment) = &mut process.alignment {
                let place = process_place(&self.root, &process.name);
                alignment.connect(&self.sensors).map_err(|e| e.at(&place))?;
            }
        }
        Ok(())
    }

    /// Hands the sensors to the detectors of the pseudo-measurements.
    pub fn connect_detectors(&mut self) -> Result<(), BuildError> {
        for index in 0..self.sensors.len() {
            if let Some(mut detector) = self.sensors[index].detector.take() {
                let place = self.parts.get(index).map_or(&self.root, |part| &part.node);
                detector.connect(&self.sensors).map_err(|e| e.at(place))?;
                self.sensors[index].detector = Some(detector);
            }
        }
        Ok(())
    }

    /// Adds the constraints of the processes as sensors of their own.
    pub fn constraints(&mut self) -> Result<(), BuildError> {
        for (owner, (info, role)) in self.composer.take_constraints() {
            if self.sensors.iter().any(|s| s.info.name == info.name) {
                let message = format!(
                    "[sensor.{}] has the name of a constraint of this process; rename the sensor",
                    info.name
                );
                return Err(process_place(&self.root, &owner).error(message).into());
            }
            Composition::check_channels(&info, &role)
                .map_err(|e| e.at(&process_place(&self.root, &owner)))?;
            if let Some(process) = self.processes.iter_mut().find(|p| p.name == owner) {
                process.constraint = Some(self.sensors.len());
            }
            let update = self.rules.default;
            self.sensors.push(Sensor { update, ..Sensor::constraint(info, role) });
        }
        Ok(())
    }

    /// Checks the whole and returns the composition; `text` is the scenario in TOML.
    pub fn finish(
        mut self,
        mut header: Header,
        creator: Creator,
        text: String,
        simulated: bool,
    ) -> Result<Composition, BuildError> {
        let notes = self.composer.take_notes();
        self.restore_inputs();
        let places = self.composer.take_input_places();
        let (mut layout, mut transition, needing) = std::mem::take(&mut self.composer).finish();
        inputs::connect(
            &self.root,
            std::mem::take(&mut self.inputs),
            &places,
            &layout,
            &mut transition,
            &mut self.sensors,
        )?;
        self.check_states(&layout)?;
        self.check_driving_sensors()?;
        let initial = self.initial(&mut header.estimator);
        self.check_initial(initial, &needing)?;
        let moved = compose::moved(&layout, &self.processes);
        if header.estimator.draw == Draw::All {
            draw::draw(&mut layout, &moved, header.seed);
        }
        truth::settle(&mut layout, &transition, &moved, &self.processes);
        self.check_wandering(&layout)?;
        let referenced = |name: &String| layout.blocks.iter().position(|b| b.name == *name);
        Ok(Composition {
            referenced: needing.iter().filter_map(referenced).collect(),
            name: header.name,
            description: header.description,
            text,
            layout: Arc::new(layout),
            transition,
            processes: self.processes,
            sensors: self.sensors,
            estimator: header.estimator,
            creator,
            seed: header.seed,
            simulated,
            notes,
        })
    }

    /// Gives the driving sensors their parameters back, which the composer held for the processes.
    fn restore_inputs(&mut self) {
        for (name, config) in self.composer.take_inputs() {
            if let Some(sensor) = self.sensors.iter_mut().find(|s| s.info.name == name) {
                sensor.role = Role::Input(config);
            }
        }
    }

    /// Rejects a scenario without any state.
    fn check_states(&self, layout: &Layout) -> Result<(), DocumentError> {
        if layout.tangent > 0 {
            return Ok(());
        }
        let message = "nothing is estimated: add a process model, such as [process.ins]";
        Err(self.root.error(message))
    }

    /// Rejects the key `wander` of a process that moves no truth.
    fn check_wandering(&self, layout: &Layout) -> Result<(), DocumentError> {
        let idle = |p: &&Process| p.wanders && p.wandering(layout).is_empty();
        match self.processes.iter().find(idle) {
            None => Ok(()),
            Some(process) => {
                let message = format!(
                    "a process of type {} does not move the truth: a sensor that is simulated from the \
                     trajectory drives it, or it has no `wander`; remove this key",
                    process.kind
                );
                let table = process_place(&self.root, &process.name);
                Err(table.get(WANDER).unwrap_or(table).error(message))
            }
        }
    }

    /// Rejects a driving sensor that drives no process.
    fn check_driving_sensors(&self) -> Result<(), DocumentError> {
        let idle = |s: &Sensor| matches!(s.role, Role::Input(_)) && s.simulator.is_none();
        match self.parts.iter().zip(&self.sensors).find(|(_, sensor)| idle(sensor)) {
            None => Ok(()),
            Some((part, _)) => Err(part.node.error(format!(
                "[sensor.{}] drives no process; remove it, or set enabled = false",
                part.name
            ))),
        }
    }

    fn has_reference(&self) -> bool {
        self.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)))
    }

    /// The origin of the initial values: by default the reference where there is one.
    fn initial(&self, estimator: &mut EstimatorConfig) -> Initial {
        let default = if self.has_reference() { Initial::Reference } else { Initial::Given };
        *estimator.initial.get_or_insert(default)
    }

    /// Rejects a scenario that does not provide the initial values.
    fn check_initial(&self, initial: Initial, needing: &[String]) -> Result<(), DocumentError> {
        match initial {
            Initial::Given if !needing.is_empty() => Err(self.process_table().error(format!(
                "no initial value: give {}, or a reference to start from: [sensor.reference]",
                needing.join(", ")
            ))),
            Initial::Reference if !self.has_reference() => {
                let place = self.root.get("estimator").unwrap_or_else(|| self.root.clone());
                let message =
                    "initial = \"reference\" needs a sensor that is one: [sensor.reference]";
                Err(place.error(message))
            }
            _ => Ok(()),
        }
    }

    /// The table `[process]`, or the whole scenario where there is none.
    fn process_table(&self) -> Node<'a> {
        self.root.get("process").unwrap_or_else(|| self.root.clone())
    }
}

/// The table of a process, or the whole scenario where there is none.
pub(super) fn process_place<'a>(root: &Node<'a>, name: &str) -> Node<'a> {
    root.get("process").and_then(|p| p.get(name)).unwrap_or_else(|| root.clone())
}
