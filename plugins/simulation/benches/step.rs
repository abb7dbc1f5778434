//! The cost of one step of the estimator on the composition of `scenarios/pan-wu-3d.toml` (19
//! states): `cargo bench -p navfuse-simulation`
//!
//! `imu` is the whole loop step: mechanisation, Phi and covariance through `Ekf::process`. The
//! dense products are what the covariance would cost if its structure were not used.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    reason = "a benchmark that cannot start has nothing to report"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use navfuse_core::filter::Ekf;
use navfuse_core::model::process::{Input, Interval};
use navfuse_core::nalgebra::{DMatrix, SMatrix};
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::covariance::Covariance;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

const STATES: usize = 19;

fn assembly() -> Assembly {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/pan-wu-3d.toml");
    Scenario::load(&registry, &path, &[]).unwrap().assemble(None).unwrap()
}

/// Every sample from `from` to `to`, in order of time.
fn samples(assembly: &mut Assembly, from: f64, to: f64) -> Vec<Sample> {
    let mut all = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() && sample.time.seconds() < to {
            if sample.time.seconds() >= from {
                all.push(sample);
            }
        }
    }
    all.sort_by_key(|s| s.time);
    all
}

fn step(c: &mut Criterion) {
    let mut assembly = assembly();
    let before = samples(&mut assembly, 600.0, 700.0);
    let after = samples(&mut assembly, 700.0, 800.0);
    let (imu, dvl) =
        (assembly.composition.sensor("imu").unwrap(), assembly.composition.sensor("dvl").unwrap());
    let layout = assembly.composition.layout.clone();
    let mut transition = assembly.composition.transition.clone();
    transition.compile(&layout);
    let mut model = assembly.composition.processes[0].model.boxed_clone();
    let mut ekf = Ekf::new(assembly.composition);
    before.iter().for_each(|s| ekf.process(s, &mut ()).unwrap());
    assert_eq!(ekf.covariance().dimension(), STATES);
    let snapshot = ekf.snapshot();
    let inputs: Vec<Sample> = after.iter().filter(|s| s.sensor.0 == imu).copied().collect();
    let velocity = before.iter().rfind(|s| s.sensor.0 == dvl).unwrap();
    // a velocity with every inertial sample
    let pairs: Vec<Sample> = (inputs.iter())
        .flat_map(|s| {
            let mut v = *velocity;
            v.time = s.time;
            [*s, v]
        })
        .collect();

    let mut group = c.benchmark_group("step");
    group.throughput(Throughput::Elements(1));
    let mut run = |name: &str, samples: &[Sample], each: usize| {
        group.bench_function(name, |b| {
            b.iter_custom(|iterations| {
                let (mut left, mut elapsed) = (iterations as usize, Duration::ZERO);
                while left > 0 {
                    ekf.restore(&snapshot);
                    let count = left.min(samples.len() / each);
                    let start = Instant::now();
                    for sample in &samples[..count * each] {
                        ekf.process(black_box(sample), &mut ()).unwrap();
                    }
                    elapsed += start.elapsed();
                    left -= count;
                }
                elapsed
            });
        });
    };
    run("imu", &inputs, 1);
    run("imu and dvl", &pairs, 2);

    let mut state = ekf.state().clone();
    let from = inputs[0].time;
    state.time = from;
    let interval = Interval {
        from,
        to: inputs[1].time,
        input: Some(Input { sample: &inputs[1], duration: 0.01, usual: 0.01, spread: None }),
    };
    group.bench_function("mechanisation and Phi", |b| {
        let start = state.clone();
        b.iter(|| {
            state.values.copy_from_slice(&start.values);
            model.propagate(&layout, &mut state, black_box(&interval), &mut transition).unwrap();
        });
    });
    let start: Covariance = ekf.covariance().into_owned();
    let mut p = start.clone();
    group.bench_function("covariance, structured", |b| {
        b.iter(|| transition.propagate(black_box(&mut p)))
    });
    let (phi, q) = (transition.phi_dense(STATES), transition.noise_dense(STATES));
    let (mut p, mut half) = (start.to_dense(), DMatrix::zeros(STATES, STATES));
    group.bench_function("covariance, dense DMatrix", |b| {
        let transposed = phi.transpose();
        b.iter(|| {
            half.gemm(1.0, black_box(&phi), &p, 0.0);
            p.copy_from(&q);
            p.gemm(1.0, &half, &transposed, 1.0);
        });
    });
    let fixed = |m: &DMatrix<f64>| SMatrix::<f64, STATES, STATES>::from_column_slice(m.as_slice());
    let (phi, q, mut p) = (fixed(&phi), fixed(&q), fixed(&start.to_dense()));
    group.bench_function("covariance, dense SMatrix", |b| {
        b.iter(|| p = black_box(&phi) * p * phi.transpose() + q);
    });
}

criterion_group!(benches, step);
criterion_main!(benches);
