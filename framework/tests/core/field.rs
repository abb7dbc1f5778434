//! A field of 2000 unknowns outside of the framework: a boat maps the magnetic anomaly of an area on
//! a grid, while it locates itself with fixes. A sample reads the four nearest nodes.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{BuiltProcess, OwnDynamics};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector2, convert};
use navfuse_core::plugin::{ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::manifold::{Scalar, Vector};
use navfuse_core::state::{BlockSpec, Display, Dynamics, Handle, Mode, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_testing::lab::{Log, seconds};
use schemars::JsonSchema;
use serde::Deserialize;

/// Nodes of the grid, along x and y, and their distance, m.
const NODES: [usize; 2] = [50, 40];
const SPACING: f64 = 10.0;
/// Sigma of a fix, m, and of a reading of the field; that of each node is 1.
const FIX: f64 = 0.05;
const READING: f64 = 0.05;

fn spec(initial: Vec<f64>, dynamics: Dynamics, display: Display) -> BlockSpec {
    let sigma = vec![1.0; initial.len()];
    BlockSpec { mode: Mode::Estimate, initial, sigma, truth: None, dynamics, display }
}

/// The boat and its field.
#[derive(Deserialize, JsonSchema)]
struct Survey {}

impl ProcessType for Survey {
    const TYPE: &'static str = "survey";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let [metres, ratio] = ["m", ""];
        let place = Display { unit: metres, scale: 1.0, components: &["x", "y"] };
        let node = Display { unit: ratio, scale: 1.0, components: &["anomaly"] };
        let walk = Dynamics::RandomWalk(vec![4.0; 2]);
        composer.block::<Vector<2>>("place", spec(vec![15.0, 15.0], walk, place))?;
        for k in 0..NODES[0] * NODES[1] {
            let spec = spec(vec![0.0], Dynamics::Constant, node.clone());
            composer.block::<Scalar>(&format!("node_{k}"), spec)?;
        }
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

#[derive(Deserialize, JsonSchema)]
struct Fix {}

impl SensorType for Fix {
    const TYPE: &'static str = "fix";
    fn channels(&self) -> Vec<Channel> {
        ["x", "y"].map(|name| Channel::new(name, "m")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(FixModel(composer.find("place", "survey.place")?)))
    }
}

struct FixModel(Handle<Vector<2>>);

impl MeasurementModel<2> for FixModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        x.get(self.0)
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::identity() * (FIX * FIX)
    }
}

#[derive(Deserialize, JsonSchema)]
struct Magnetometer {}

impl SensorType for Magnetometer {
    const TYPE: &'static str = "magnetometer";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("anomaly", "1")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let place = composer.find("place", "survey.place")?;
        let node = |k| composer.find("nodes", &format!("survey.node_{k}"));
        let nodes = (0..NODES[0] * NODES[1]).map(node).collect::<Result<_, _>>()?;
        Ok(Role::measurement(Field { place, nodes }))
    }
}

// ANCHOR: field
/// The field between four nodes, bilinear.
struct Field {
    place: Handle<Vector<2>>,
    nodes: Vec<Handle<Scalar>>,
}

/// Nodes around a place, and the place between them.
fn cell<T: Real>(place: SVector<T, 2>) -> ([usize; 4], [T; 2]) {
    let along = |axis: usize| {
        let last = NODES[axis] - 2;
        let beyond = |k: &usize| place[axis] < convert(SPACING * (*k as f64 + 1.0));
        let k = (0..last).find(beyond).unwrap_or(last);
        (k, (place[axis] - convert(SPACING * k as f64)) / convert(SPACING))
    };
    let ((i, a), (j, b)) = (along(0), along(1));
    let first = i * NODES[1] + j;
    ([first, first + 1, first + NODES[1], first + NODES[1] + 1], [a, b])
}

fn between<T: Real>(corners: [T; 4], [a, b]: [T; 2]) -> T {
    let west = corners[0] + (corners[1] - corners[0]) * b;
    let east = corners[2] + (corners[3] - corners[2]) * b;
    west + (east - west) * a
}

impl MeasurementModel<1> for Field {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let (corners, at) = cell(x.get(self.place));
        SVector::from([between(corners.map(|k| x.get(self.nodes[k])), at)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(READING * READING)
    }
}
// ANCHOR_END: field

fn filter() -> Ekf {
    let mut registry = Registry::new();
    registry.process::<Survey>();
    registry.sensor::<Fix>();
    registry.sensor::<Magnetometer>();
    let text = "[process.survey]\n[sensor.fix]\n[sensor.magnetometer]\n";
    let document = Document::parse("survey.toml", text.to_owned()).unwrap();
    Ekf::new(Scenario::new(&registry, document, &[]).unwrap().compose().unwrap())
}

/// Place of the boat on lines of 450 m, 40 m apart, at 2 m/s.
fn tour(t: f64) -> Vector2<f64> {
    let (line, along) = ((2.0 * t / 490.0).floor(), 2.0 * t % 490.0);
    let x = if line % 2.0 == 0.0 { 15.0 + along.min(450.0) } else { 465.0 - along.min(450.0) };
    Vector2::new(x, 15.0 + 40.0 * line + (along - 450.0).max(0.0))
}

/// A survey of 500 s: the filter, the true nodes, and those that were read.
fn survey(seed: u64) -> (Ekf, Vec<f64>, Vec<usize>) {
    let mut ekf = filter();
    let mut random = Random::new(seed, "field");
    let truth: Vec<f64> = (0..NODES[0] * NODES[1]).map(|_| random.normal()).collect();
    let mut read = std::collections::BTreeSet::new();
    for k in 0..500 {
        let place = tour(f64::from(k));
        let (corners, at) = cell(place);
        read.extend(corners);
        let fix = place.map(|c| c + FIX * random.normal());
        let field = between(corners.map(|k| truth[k]), at) + READING * random.normal();
        for (sensor, values) in [("fix", fix.as_slice()), ("magnetometer", &[field])] {
            let id = SensorId(ekf.composition().sensor(sensor).unwrap());
            let sample = Sample::new(seconds(f64::from(k)), id, values);
            ekf.process(&sample, &mut Log::default()).unwrap();
        }
    }
    (ekf, truth, read.into_iter().collect())
}

#[test]
fn a_field_of_2000_unknowns_is_mapped_consistently_and_only_where_it_was_read() {
    let (mut squares, mut number) = (0.0, 0.0);
    for seed in 0..4 {
        let (ekf, truth, read) = survey(seed);
        assert_eq!(ekf.layout().tangent, 2002);
        let tangent = |k: &usize| 2 + k;
        let value = |k: usize| ekf.state().values[ekf.layout().blocks[1 + k].offset];
        let error = DVector::from_iterator(read.len(), read.iter().map(|&k| truth[k] - value(k)));
        let p = DMatrix::from_fn(read.len(), read.len(), |i, j| {
            ekf.covariance().get(tangent(&read[i]), tangent(&read[j]))
        });
        squares += error.dot(&p.cholesky().unwrap().solve(&error));
        number += read.len() as f64;
        // the others are as they were, and correlated with nothing
        for k in (0..truth.len()).filter(|k| read.binary_search(k).is_err()) {
            assert_eq!(value(k), 0.0);
            let row = |j| ekf.covariance().get(tangent(&k), j);
            assert!((0..2002).all(|j| row(j) == f64::from(j == tangent(&k))), "node {k}");
        }
    }
    // chi-square of some 900 numbers: 3.3 sigma for 99.9 %
    let band = 3.3 * (2.0 / number).sqrt();
    println!("{number} nodes, NEES per node {:.3}", squares / number);
    assert!(number > 800.0 && (squares / number - 1.0).abs() < band, "{}", squares / number);
}
