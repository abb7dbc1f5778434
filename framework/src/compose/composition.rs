//! The composition of a scenario: everything that an estimator needs, with every name resolved.

use crate::compose::draw::Draw;
use crate::compose::estimator::Creator;
use crate::compose::settings::Initial;
use crate::model::error::ComposeError;
use crate::model::process::monitor::Monitor;
use crate::model::process::screening::Screening;
use crate::model::process::start::InitialAlignment;
use crate::model::process::{ProcessModel, Product, SecondOrder};
use crate::model::sensor::Role;
use crate::model::sensor::Sensor;
use crate::model::sensor::motion::Motion;
use crate::model::sensor::rule::UpdateRule;
use crate::model::sensor::{Purpose, SensorInfo};
use crate::model::simulate::Random;
use crate::model::simulate::fault::Fault;
use crate::state::covariance::Transition;
use crate::state::{Layout, Mode};
use crate::units::Sigma;
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;
use std::sync::Arc;

/// A process model with its place in the composition.
pub struct Process {
    /// Name in the scenario.
    pub name: String,
    /// Registered type.
    pub kind: String,
    /// Model.
    pub model: Box<dyn ProcessModel>,
    /// Set if the truth of all its blocks moves by its own equations, and with no trajectory.
    pub wanders: bool,
    /// Index of the driving sensor.
    pub input: Option<usize>,
    /// Set if the simulator of that sensor reads the truth of the states, and no trajectory.
    pub sensor_wanders: bool,
    /// Longest gap of that sensor that the model bridges, s, if it coasts on a longer one.
    pub coasts_after: Option<f64>,
    /// Index of the process's constraint among the sensors.
    pub constraint: Option<usize>,
    /// Alignment that finds the initial values of the process.
    pub alignment: Option<Box<dyn InitialAlignment>>,
    /// Limits by which the filter screens the driving sensor.
    pub screening: Option<Screening>,
    /// Monitor that notices faults of the driving sensor.
    pub monitor: Option<Box<dyn Monitor>>,
    /// Slots of the biases of the driving sensor, which the filter tests for steps.
    pub biases: Vec<usize>,
    /// Product of two errors that the linear model neglects.
    pub product: Option<Product>,
    /// Terms of the second order that the linear model neglects.
    pub second_order: Vec<SecondOrder>,
    /// Set if the alignment searches for the initial values; otherwise it only supervises.
    pub searches: bool,
}

impl Process {
    /// Slots of the blocks whose truth the process moves: no motion of the vehicle gives them, and
    /// no sensor that measures such a motion drives the process.
    pub fn wandering(&self, layout: &Layout) -> Vec<usize> {
        if self.input.is_some() && !self.sensor_wanders {
            return Vec::new();
        }
        let (mut state, mut wander) = (layout.initial_state(), vec![false; layout.blocks.len()]);
        let mut random = Random::new(0, "none");
        let mut model = self.model.boxed_clone();
        model.wander(layout, &mut state, &mut wander, 0.0, &mut random);
        let followed = moved(layout, std::slice::from_ref(self));
        (0..wander.len()).filter(|slot| wander[*slot] && !followed[*slot]).collect()
    }
}

/// Everything that an estimator needs, with every name resolved.
pub struct Composition {
    /// Name of the scenario.
    pub name: String,
    /// Description of the scenario.
    pub description: Option<String>,
    /// Scenario in TOML with every override applied.
    pub text: String,
    /// The blocks.
    pub layout: Arc<Layout>,
    /// The pattern of the transition.
    pub transition: Transition,
    /// The process models.
    pub processes: Vec<Process>,
    /// The sensors, in the order of their ids.
    pub sensors: Vec<Sensor>,
    /// Start, end and initial values of the filter.
    pub estimator: crate::compose::settings::EstimatorConfig,
    /// Type of the estimator.
    pub(crate) creator: Creator,
    /// Seed of every random number.
    pub seed: u64,
    /// True where every source simulates its samples, so that another seed gives another run.
    pub simulated: bool,
    /// Slots of the blocks whose initial value a reference must give.
    pub referenced: Vec<usize>,
    /// Notes of the parts for the user: the part and the text.
    pub notes: Vec<(String, String)>,
}

/// Marks the blocks that a process or a clone moves, one entry per slot.
pub(crate) fn moved(layout: &Layout, processes: &[Process]) -> Vec<bool> {
    let (mut state, mut moved) = (layout.initial_state(), vec![false; layout.blocks.len()]);
    processes
        .iter()
        .for_each(|p| p.model.follow(layout, &Motion::at_rest(), &mut state, &mut moved));
    layout.clones.iter().for_each(|[_, past]| moved[*past] = true);
    moved
}

impl std::fmt::Debug for Composition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Composition")
            .field("name", &self.name)
            .field("layout", &self.layout)
            .finish_non_exhaustive()
    }
}

impl Composition {
    /// Terms of the second order that the processes neglect.
    pub(crate) fn second_order(&self) -> impl Iterator<Item = &SecondOrder> {
        self.processes.iter().flat_map(|process| &process.second_order)
    }

    /// Index of the sensor that drives a process.
    pub(crate) fn driver(&self) -> Option<usize> {
        self.processes.iter().find_map(|process| process.input)
    }

    /// Index of the sensor with a name.
    pub fn sensor(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|s| s.info.name == name)
    }

    /// Marks the blocks whose truth a run can know, one entry per slot: from the scenario, from a
    /// draw, or from a reference through a process.
    pub fn known(&self) -> Vec<bool> {
        let referenced = self.sensors.iter().any(|s| matches!(s.role, Role::Reference(_)));
        let moved = moved(&self.layout, &self.processes);
        let stated = self.layout.blocks.iter().map(|b| b.spec.truth.is_some());
        let known = stated.zip(moved).map(|(stated, moved)| stated || (referenced && moved));
        known.enumerate().map(|(slot, known)| known && !self.layout.is_past(slot)).collect()
    }

    /// Prepares the composition for the Cramer-Rao bound. Every block starts at its truth, and
    /// sensors are simulated without noise, outliers and faults while the filter assumes their
    /// noise; samples that a fault loses stay lost. The filter thus stays at the truth, and its
    /// covariance is that of the best estimate. Considered states are estimated.
    pub fn at_truth(&mut self) {
        let mut layout = (*self.layout).clone();
        for block in &mut layout.blocks {
            if let Some(truth) = &block.spec.truth {
                block.spec.initial.clone_from(truth);
            }
            block.wanders = false;
            if block.spec.mode == Mode::Consider {
                block.spec.mode = Mode::Estimate;
            }
        }
        self.layout = Arc::new(layout);
        self.estimator.draw = Draw::Nothing;
        let estimator = &mut self.estimator;
        (estimator.smooth, estimator.lag, estimator.passes) = (false, None, None);
        estimator.linearise_once();
        // without noise, samples at rest repeat: screening and monitor would report them as frozen
        for process in &mut self.processes {
            process.searches = false;
            process.screening = None;
            process.monitor = None;
            process.second_order.clear();
            process.biases.clear();
        }
        if self.sensors.iter().any(|s| matches!(s.role, Role::Reference(_))) {
            self.estimator.initial = Some(Initial::Reference);
        }
        for (index, sensor) in self.sensors.iter_mut().enumerate() {
            // the bound is that of the model linearised at the truth
            sensor.update = UpdateRule::default();
            let Some(faults) = &mut sensor.simulation else { continue };
            if sensor.info.purpose == Purpose::Reference {
                continue; // a reference has no noise
            }
            sensor.noise = faults.noise.value().si();
            faults.noise = Sigma::from_si(0.0);
            faults.outliers = Sigma::from_si(0.0);
            faults.faults.retain(Fault::only_loses);
            if self.processes.iter().any(|p| p.input == Some(index)) {
                self.transition.scale_noise(sensor.noise);
            }
        }
    }

    /// Checks that a sensor's channels fit a sample and its model.
    pub(crate) fn check_channels(info: &SensorInfo, role: &Role) -> Result<(), ComposeError> {
        let count = info.channels.len();
        if let Some((channel, error)) = info.channels.iter().find_map(|c| Some((c, c.wrong()?))) {
            let text = format!("the unit of the channel {} in the type's code", channel.name);
            return Err(ComposeError::new("", format!("{text}: {error}")));
        }
        let message = match role {
            _ if count > MAX_CHANNELS => {
                format!("{count} channels; at most {MAX_CHANNELS} fit a sample")
            }
            Role::Measurement(model) if model.channels() > count => {
                format!("{count} channels are declared, the model predicts {}", model.channels())
            }
            _ => return Ok(()),
        };
        Err(ComposeError::new("", message))
    }

    /// Start of the filter.
    pub fn start(&self) -> Time {
        self.estimator.start()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::sensor::mounting::Mounting;
    use crate::units::sample::Channel;

    #[test]
    fn a_sensor_has_as_many_channels_as_fit_a_sample() {
        let fits = |count: usize| {
            let info = SensorInfo {
                name: "s".to_owned(),
                kind: "s".to_owned(),
                channels: vec![Channel::new("x", "1"); count],
                purpose: Purpose::Input,
                mounting: Mounting::default(),
            };
            Composition::check_channels(&info, &Role::Input(Box::new(()))).is_ok()
        };
        assert_eq!([MAX_CHANNELS, MAX_CHANNELS + 1].map(fits), [true, false]);
    }
}
