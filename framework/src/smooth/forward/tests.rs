//! The memory that a pass needs: the counted length of the records, and the snapshots.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::Real;
use crate::compose::Composer;
use crate::document::Document;
use crate::filter::Ekf;
use crate::model::error::ComposeError;
use crate::model::process::{BuiltProcess, Interval, ProcessError, ProcessModel};
use crate::model::record::UpdateRecord;
use crate::model::sensor::Role;
use crate::model::sensor::measurement::MeasurementModel;
use crate::model::sensor::motion::Motion;
use crate::model::simulate::{Scene, Simulate};
use crate::plugin::{Plugin, ProcessType, Registry, SensorType};
use crate::run::scenario::Scenario;
use crate::state::covariance::{Covariance, NoiseSlot, PhiDiagonal};
use crate::state::manifold::Vector;
use crate::state::{BlockSpec, Dynamics, Handle, Mode, State, View, display};
use crate::units::sample::Channel;
use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

/// A walker in space, whose velocity is a random walk. A clock drives him.
#[derive(Deserialize, JsonSchema)]
struct Walk {
    #[serde(default)]
    consider: bool,
}

impl ProcessType for Walk {
    const TYPE: &'static str = "walk";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        composer.input::<()>("input", "clock")?;
        let spec = |mode, dynamics| BlockSpec {
            mode,
            initial: vec![0.0; 3],
            sigma: vec![1.0; 3],
            truth: None,
            dynamics,
            display: display::VELOCITY,
        };
        let walk = Dynamics::RandomWalk(vec![0.01; 3]);
        let place = composer.block("place", spec(Mode::Estimate, Dynamics::Constant))?;
        let velocity = composer.block::<Vector<3>>("velocity", spec(Mode::Estimate, walk))?;
        if self.consider {
            composer.block::<Vector<3>>("wind", spec(Mode::Consider, Dynamics::Constant))?;
        }
        let (p, v) = (composer.tangent(place), composer.tangent(velocity));
        let t = composer.transition();
        let phi = [t.phi_diagonal(p, p), t.phi_diagonal(p, v)];
        let model = Walker { place, velocity, phi, noise: t.noise(p) };
        Ok(BuiltProcess::new(model).driven_by("clock", Silent))
    }
}

#[derive(Clone)]
struct Silent;

impl Simulate for Silent {
    fn simulate(&self, _: &mut Scene<'_>, _: &mut Sample) {}
    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(Self)
    }
}

#[derive(Clone)]
struct Walker {
    place: Handle<Vector<3>>,
    velocity: Handle<Vector<3>>,
    phi: [PhiDiagonal<3>; 2],
    noise: NoiseSlot<3>,
}

impl ProcessModel for Walker {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let place = state.get(layout, self.place) + state.get(layout, self.velocity) * dt;
        state.set(layout, self.place, &place);
        transition.set_diagonal(self.phi[0], &[1.0; 3]);
        transition.set_diagonal(self.phi[1], &[dt; 3]);
        transition.set_noise(self.noise, &(Matrix3::identity() * (0.01 * dt)));
        Ok(())
    }
    fn follow(&self, layout: &Layout, _: &Motion, truth: &mut State, known: &mut [bool]) {
        truth.set(layout, self.place, &Vector3::zeros());
        known[self.place.slot()] = true;
    }
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

#[derive(Deserialize, JsonSchema)]
struct Clock {}

impl SensorType for Clock {
    const TYPE: &'static str = "clock";
    const INPUT: bool = true;
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("tick", "s")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(())))
    }
}

/// The place with a noise of 0.1 m.
#[derive(Deserialize, JsonSchema)]
struct Fix {}

impl SensorType for Fix {
    const TYPE: &'static str = "fix";
    fn channels(&self) -> Vec<Channel> {
        ["x", "y", "z"].map(|name| Channel::new(name, "m")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(FixModel(composer.find("place", "walk.place")?)))
    }
}

struct FixModel(Handle<Vector<3>>);

impl MeasurementModel<3> for FixModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> Vector3<T> {
        x.get(self.0)
    }
    fn noise(&self, _: &View<'_, f64>) -> Matrix3<f64> {
        Matrix3::identity() * 0.01
    }
}

struct Own;

impl Plugin for Own {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Walk>();
        registry.sensor::<Clock>();
        registry.sensor::<Fix>();
    }
}

fn filter(settings: &[&str]) -> Ekf {
    let mut registry = Registry::new();
    registry.add(&Own);
    let document = Document::parse("walk.toml", "[sensor.clock]\n[process.walk]\n[sensor.fix]");
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let scenario = Scenario::new(&registry, document.unwrap(), &settings).unwrap();
    Ekf::new(scenario.compose().unwrap())
}

fn sample(ekf: &Ekf, sensor: &str, seconds: f64, values: &[f64]) -> Sample {
    let id = SensorId(ekf.composition().sensor(sensor).unwrap());
    Sample::new(Time::from_seconds(seconds).unwrap(), id, values)
}

/// Shows what the filter does to a recorder and to what counts its records. An estimate has
/// `offset`, as in a further pass.
struct Both<'a> {
    forward: Forward,
    counter: Counter,
    recorder: Recorder<'a>,
    offset: Vec<f64>,
}

impl Observer for Both<'_> {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.forward.epoch(true);
        self.counter.epoch(epoch);
        self.recorder.epoch(epoch);
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.recorder.update(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.forward.transition(transition);
        self.counter.transition(transition);
        self.recorder.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.forward.correction(update);
        self.counter.correction(update);
        self.recorder.correction(update);
    }
    fn gated(&mut self, update: &Update) {
        self.forward.gated(update);
        self.counter.gated(update);
        self.recorder.gated(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, _: &[f64]) {
        self.recorder.moved(state, covariance, &self.offset);
    }
}

/// Bytes of the records of a run after its start, those that the first pass counts, and those that a further pass
/// counts. Every fix has other channels, and one of them is gated.
fn lengths(consider: bool, further: bool) -> [usize; 3] {
    let mut ekf = filter(&[if consider { "process.walk.consider=true" } else { "name=\"a\"" }]);
    let begin = sample(&ekf, "clock", 0.0, &[0.0]);
    ekf.process(&begin, &mut ()).unwrap();
    let forward = Forward::new(&ekf, false).unwrap();
    let (layout, recorded) = (Arc::clone(&ekf.composition().layout), [true; 4]);
    let further_pass = Forward::new(&ekf, true).unwrap().counter;
    let course = if further { further_pass.course } else { 0 };
    let counter = Counter { recorded: recorded.to_vec(), course, ..further_pass };
    let mut segment = Segment::new(&layout, ekf.considered().contains(&true));
    let recorder = Recorder {
        segment: &mut segment,
        recorded: recorded.iter(),
        source: (SensorId(0), Time::MIN, 0.0),
        offset: Vec::new(),
        course: further,
    };
    let offset = vec![0.0; if further { layout.tangent } else { 0 }];
    let mut both = Both { forward, counter, recorder, offset };
    for k in 1..=40 {
        let t = 0.1 * f64::from(k);
        let clock = sample(&ekf, "clock", t, &[t]);
        ekf.process(&clock, &mut both).unwrap();
        if k % 7 == 6 {
            let values = [0.1, -0.1, if k == 20 { 1e3 } else { 0.0 }];
            let fix = sample(&ekf, "fix", t, &values[..1 + k as usize % 3]);
            ekf.process(&fix, &mut both).unwrap();
        }
        if k % 10 == 0 {
            both.epoch(&ekf.epoch());
        }
    }
    let counted = [both.forward.counter.since, both.counter.since];
    segment.end_product();
    let records = segment.reversed().map(|(_, values, columns)| 8 * (values.len() + columns.len()));
    [records.sum(), counted[0], counted[1]]
}

#[test]
fn the_counted_length_of_a_segment_is_that_of_its_records() {
    for consider in [false, true] {
        let [records, first, _] = lengths(consider, false);
        assert_eq!(first, records, "first pass, {consider}");
        let [records, _, further] = lengths(consider, true);
        assert_eq!(further, records, "further pass, {consider}");
    }
}

/// Every second snapshot is dropped once all need more than a segment, which then becomes longer.
#[test]
fn the_snapshots_need_no_more_memory_than_a_segment_and_the_first_and_the_last_one_stay() {
    let ekf = filter(&[]);
    let (mut checkpoints, size) = (Checkpoints::new(), ekf.snapshot().size());
    let mut added = 0;
    while checkpoints.longest < 8 * SHORTEST {
        checkpoints.add(&ekf, added, 0);
        let count = checkpoints.list.len();
        // an even number of them waits for the next one
        assert!((count - 1) * size <= checkpoints.longest, "{count} of {size} bytes");
        assert_eq!(checkpoints.list[0].at, 0);
        assert_eq!(checkpoints.list[count - 1].at, added);
        added += 1;
    }
}

/// A history of 100 ms and three sigma of 1 s at 20 ms, or none. Its entries and the samples that
/// wait are what a snapshot copies; the bytes of a copy are measured.
#[test]
fn the_size_of_a_snapshot_contains_its_history_and_the_samples_that_wait() {
    let copied = |ekf: &Ekf| allocation_counter::measure(|| drop(ekf.snapshot())).bytes_total;
    let offset = "sensor.fix.time_offset={ initial = \"0.1 s\", sigma = \"1 s\" }";
    let (mut with, without) = (filter(&[offset]), filter(&[]));
    let stated = (with.snapshot().size() - without.snapshot().size()) as f64;
    let measured = (copied(&with) - copied(&without)) as f64;
    assert!((stated / measured - 1.0).abs() < 0.2, "{stated} {measured}");
    let begin = sample(&with, "clock", 0.0, &[0.0]);
    with.process(&begin, &mut ()).unwrap();
    let before = with.snapshot().size();
    for k in 1..=100 {
        let fix = sample(&with, "fix", f64::from(k), &[0.0]);
        with.process(&fix, &mut ()).unwrap();
    }
    assert_eq!(with.snapshot().size() - before, 100 * size_of::<Sample>());
}
