//! What the filter costs: the dive of `scenarios/auv.toml`, an update of each of its sensors, a fix
//! that arrives 5 s late, and what a state adds, with the block-sparse kernel and with dense
//! matrices in the same run; the states of a field, of which an update reads four. Prints the
//! tables of docs/src/explanation/performance.md and draws its figure:
//!
//! `cargo run --release -p navfuse-simulation --example cost -- docs/src/images/performance.svg`
#![allow(clippy::unwrap_used, reason = "a measurement that cannot start has nothing to report")]

use navfuse_core::document::Document;
use navfuse_core::filter::{Ekf, Timeline};
use navfuse_core::model::record::Observer;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::nalgebra::DMatrix;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::covariance::{Covariance, Transition, Update};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_figures::{Axis, Curve, Figure, Look, Panel, svg};
use std::collections::BTreeMap;
use std::hint::black_box;
use std::time::Instant;

const SCENARIO: &str = include_str!("../../../scenarios/auv.toml");

/// Keeps the last transition.
#[derive(Default)]
struct Listener(Option<Transition>, bool);

impl Observer for Listener {
    fn transition(&mut self, transition: &Transition) {
        if self.1 {
            self.0 = Some(transition.clone());
        }
    }
}

fn assembly(text: &str) -> Assembly {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin);
    registry.add(&navfuse_gnss::GnssPlugin).add(&navfuse_simulation::SimulationPlugin);
    let document = Document::parse("cost.toml", text).unwrap();
    Scenario::new(&registry, document, &[]).unwrap().assemble(None).unwrap()
}

/// Every sample, in order of time.
fn samples(assembly: &mut Assembly) -> Vec<Sample> {
    let mut all = Vec::new();
    for (_, source) in &mut assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).unwrap() {
            all.push(sample);
        }
    }
    all.sort_by_key(|s| s.time);
    all
}

/// What this thread has computed, s: another program on the same core is not in it. The wall clock
/// where there is no such clock.
fn clock(begin: Instant) -> f64 {
    let spent = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let spent = spent.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
    spent.map_or_else(|| begin.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A filter that has just started, and what it still gets: all but the reference.
fn started(text: &str) -> (Ekf, Vec<Sample>) {
    let mut assembly = assembly(text);
    let all = samples(&mut assembly);
    let mut ekf = Ekf::new(assembly.composition);
    let mut count = 0;
    while !ekf.running() {
        ekf.process(&all[count], &mut Listener::default()).unwrap();
        count += 1;
    }
    let sensors = &ekf.composition().sensors;
    let kept = |s: &&Sample| sensors[s.sensor.0].info.purpose != Purpose::Reference;
    let rest = all[count..].iter().filter(kept).copied().collect();
    (ekf, rest)
}

fn dive() {
    let (mut ekf, rest) = started(SCENARIO);
    let infos: Vec<_> = ekf.composition().sensors.iter().map(|s| s.info.clone()).collect();
    let imu = |s: &Sample| infos[s.sensor.0].purpose == Purpose::Input;
    let inputs = rest.iter().filter(|s| imu(s)).count();
    let (snapshot, mut best, begin) = (ekf.snapshot(), f64::INFINITY, Instant::now());
    for _ in 0..5 {
        ekf.restore(&snapshot);
        let before = clock(begin);
        rest.iter().for_each(|s| ekf.process(black_box(s), &mut Listener::default()).unwrap());
        best = best.min(clock(begin) - before);
    }
    let (states, each) = (ekf.layout().tangent, 1e6 * best / inputs as f64);
    println!("auv: {states} states, {inputs} IMU samples, {} updates", rest.len() - inputs);
    println!("{each:.2} us an IMU sample, all updates included\n");
    // an update is made when the IMU sample that covers its time comes
    let (mut waiting, mut times) = (Vec::new(), BTreeMap::<Vec<usize>, Vec<f64>>::new());
    ekf.restore(&snapshot);
    for sample in &rest {
        let start = Instant::now();
        ekf.process(black_box(sample), &mut Listener::default()).unwrap();
        let took = 1e6 * start.elapsed().as_secs_f64();
        if imu(sample) {
            times.entry(std::mem::take(&mut waiting)).or_default().push(took);
        } else {
            waiting.push(sample.sensor.0);
        }
    }
    let alone = median(times.get_mut(&Vec::new()).unwrap());
    println!("{:16}{alone:6.2} us", "imu alone");
    for (who, times) in times.iter_mut().filter(|(who, _)| who.len() == 1) {
        println!(
            "{:16}{:6.2} us more, {} times",
            infos[who[0]].name,
            median(times) - alone,
            times.len()
        );
    }
}

/// The newest estimate after a fix that arrives 5 s late: INS and DVL with an IMU of 200 Hz.
fn late_fix() {
    let text = "
        [estimator]
        start = '1 s'
        [process.ins]
        attitude = { sigma = '0.1 deg', initial = '0 deg' }
        velocity = { sigma = '1 cm/s', initial = '0 m/s' }
        position = { sigma = '1 m', latitude = '30 deg', longitude = '0 deg', height = '0 m' }
        gyro_bias = { sigma = '1 deg/h' }
        accel_bias = { sigma = '100 ug' }
        [sensor.imu]
        gyro_noise = '0.1 deg/h/sqrt(Hz)'
        accel_noise = '10 ug/sqrt(Hz)'
        simulation = { rate = '200 Hz' }
        [sensor.dvl]
        noise = '2 cm/s'
        scale = { sigma = '1 %' }
        misalignment = { sigma = '1 deg' }
        simulation = { rate = '5 Hz' }
        [sensor.gnss]
        late = '5 s'
        horizontal_noise = '1 m'
        vertical_noise = '1 m'
        simulation = { rate = '1 Hz' }
        [source.simulation.start]
        latitude = '30 deg'
        [[source.simulation.segments]]
        type = 'static'
        duration = '90 s'";
    let mut assembly = assembly(text);
    let all = samples(&mut assembly);
    let gnss = assembly.composition.sensor("gnss").unwrap();
    let mut ekf = Ekf::new(assembly.composition);
    let mut timeline = Timeline::new(ekf.composition()).unwrap();
    let (mut fixes, mut times) = (std::collections::VecDeque::new(), Vec::new());
    let (begin, mut computed) = (Instant::now(), 0.0);
    for sample in &all {
        let mut arrive = |sample: &Sample| {
            assert!(timeline.arrive(sample, &mut ekf, &mut ()));
            while let Some(next) = timeline.release(ekf.running()) {
                ekf.process(&next, &mut ()).unwrap();
            }
            let (before, spent) = (Instant::now(), clock(begin));
            timeline.newest(&mut ekf, |epoch| black_box(epoch.state.time));
            [before.elapsed().as_secs_f64(), clock(begin) - spent]
        };
        if sample.sensor.0 == gnss {
            fixes.push_back(*sample);
            continue;
        }
        arrive(sample);
        if let Some(fix) = fixes.pop_front_if(|fix| sample.time.since(fix.time) >= 5.0) {
            let [elapsed, spent] = arrive(&fix);
            times.push(1e3 * elapsed);
            computed += 1e3 * spent;
        }
    }
    println!(
        "\n{:.2} ms for a fix that arrives 5 s late (computing {:.2} ms), {} states, {} times",
        median(&mut times),
        computed / times.len() as f64,
        ekf.layout().tangent,
        times.len()
    );
}

/// The INS alone, and sensors of one block of three states each until there are so many states.
fn composed(states: usize, calibration: &str) -> String {
    let base = "
        [estimator]
        start = '1 s'
        [process.ins]
        attitude = { sigma = '0.1 deg' }
        velocity = { sigma = '1 cm/s' }
        position = { sigma = '1 m' }
        gyro_bias = { sigma = '1 deg/h' }
        accel_bias = { sigma = '100 ug' }
        [sensor.imu]
        gyro_noise = '1 deg/h/sqrt(Hz)'
        accel_noise = '50 ug/sqrt(Hz)'
        simulation = { rate = '100 Hz' }
        [sensor.reference]
        simulation = { rate = '10 Hz' }
        [source.simulation]
        start = { latitude = '43 deg', heading = '30 deg' }
        segments = [
            { type = 'surge', duration = '10 s', speed = '2 m/s' },
            { type = 'square', duration = '80 s', turn = '10 s' },
        ]
    ";
    let more = (0..(states - 15) / 3).map(|k| format!("[sensor.s{k}]\n{calibration}\n"));
    std::iter::once(base.to_owned()).chain(more).collect()
}

/// Microseconds of: the covariance with the kernel, dense, the whole step of an IMU sample, and an
/// update of four channels.
fn costs(text: &str) -> [f64; 4] {
    let (mut ekf, rest) = started(text);
    let (warm, rest) = rest.split_at(3000);
    let mut listener = Listener(None, true);
    warm.iter().for_each(|s| ekf.process(s, &mut listener).unwrap());
    let (mut transition, n) = (listener.0.unwrap(), ekf.layout().tangent);
    let (phi, q) = (transition.phi_dense(n), transition.noise_dense(n));
    let transposed = phi.transpose();
    let (snapshot, start) = (ekf.snapshot(), ekf.covariance().into_owned());
    // a DVL of four beams: 13 states seen, the others through the covariance
    let (m, w) = (4, 13.min(n));
    let mut update = Update::with_capacity(n, m);
    update.m = m;
    update.columns = (0..w).collect();
    update.h = (0..m * w).map(|k| (k as f64).sin()).collect();
    update.innovation = vec![0.01; m];
    update.r = DMatrix::<f64>::identity(m, m).as_slice().to_vec();
    let considered = vec![false; n];
    let mut best = [f64::INFINITY; 4];
    let mut half = DMatrix::zeros(n, n);
    const STEPS: usize = 50;
    for _ in 0..200 {
        let mut p: Covariance = start.clone();
        let mut dense = p.to_dense();
        let mut time = |k: usize, step: &mut dyn FnMut(usize)| {
            let start = Instant::now();
            (0..STEPS).for_each(step);
            best[k] = best[k].min(1e6 * start.elapsed().as_secs_f64() / STEPS as f64);
        };
        time(0, &mut |_| transition.propagate(black_box(&mut p)));
        time(1, &mut |_| {
            half.gemm(1.0, black_box(&phi), &dense, 0.0);
            dense.copy_from(&q);
            dense.gemm(1.0, &half, &transposed, 1.0);
        });
        ekf.restore(&snapshot);
        time(2, &mut |k| ekf.process(black_box(&rest[k]), &mut Listener::default()).unwrap());
        p.clone_from(&start);
        time(3, &mut |_| {
            update.innovate(black_box(&p)).unwrap();
            update.apply(&mut p, &considered);
        });
    }
    best
}

fn curve() -> Figure {
    let kinds = [
        ("constant", "type = 'dvl'\nnoise = '1 cm/s'\nlever_arm = { sigma = '3 cm' }"),
        (
            "wandering",
            "type = 'gnss'\nhorizontal_noise = '1 m'\nvertical_noise = '1 m'\n\
             bias = { sigma = '1 m', correlation_time = '10 min' }",
        ),
    ];
    println!(
        "\n{:9}{:>10}{:>10}{:>10}{:>8}{:>10}{:>10}",
        "states", "added", "sparse", "dense", "ratio", "imu step", "update"
    );
    let mut found: Vec<Vec<[f64; 5]>> = Vec::new();
    for (name, calibration) in kinds {
        found.push(Vec::new());
        for n in (15..=60).step_by(3) {
            let [sparse, dense, step, update] = costs(&composed(n, calibration));
            println!(
                "{n:<9}{name:>10}{sparse:10.2}{dense:10.2}{:8.1}{step:10.2}{update:10.2}",
                dense / sparse
            );
            found.last_mut().unwrap().push([n as f64, sparse, dense, step, update]);
        }
    }
    let line = |name: &str, look, kind: usize, k: usize| Curve {
        name: name.into(),
        look,
        points: found[kind].iter().map(|row| [row[0], row[k]]).collect(),
    };
    let panel = |title: &str, curves| Panel {
        title: title.into(),
        x: Axis::linear("error states"),
        y: Axis::logarithmic("time [us]"),
        curves,
        bands: Vec::new(),
    };
    Figure {
        name: "performance".into(),
        title: "What a state costs".into(),
        columns: 2,
        panels: vec![
            panel(
                "covariance of one IMU sample",
                vec![
                    line("dense", Look::Data(1), 0, 2),
                    line("sparse, wandering states", Look::Data(2), 1, 1),
                    line("sparse, constant states", Look::Data(0), 0, 1),
                ],
            ),
            panel(
                "filter, constant states",
                vec![
                    line("update of four channels", Look::Data(1), 0, 4),
                    line("IMU sample", Look::Data(0), 0, 3),
                ],
            ),
        ],
    }
}

/// Microseconds of an IMU step, and of an update by one channel that reads the INS and four states
/// of a field: `n` states, of which `explored` are correlated with the INS.
fn field(n: usize, explored: usize) -> [f64; 2] {
    let (ekf, rest) = started(&composed(15, ""));
    let mut listener = Listener(None, true);
    let mut warm = ekf;
    rest[..100].iter().for_each(|s| warm.process(s, &mut listener).unwrap());
    // the field adds rows of the identity to the transition of the INS
    let mut layout = warm.layout().clone();
    let mut transition = listener.0.unwrap();
    layout.tangent = n;
    transition.compile(&layout);
    let mut start = Covariance::zero(n);
    for i in 0..n {
        start.set(i, i, 1.0);
        for j in 0..if i < 15 + explored { i } else { 0 } {
            start.set(i, j, if i < 15 { warm.covariance().get(i, j) } else { 1e-3 });
        }
    }
    (0..15).for_each(|i| start.set(i, i, warm.covariance().get(i, i) + 1.0));
    let mut update = Update::with_capacity(n, 1);
    update.m = 1;
    update.columns = (6..9).chain(15..19).collect();
    update.h = vec![0.1, 0.1, 0.0, 0.25, 0.25, 0.25, 0.25];
    update.innovation = vec![0.01];
    update.r = vec![1e4];
    let considered = vec![false; n];
    let mut best = [f64::INFINITY; 2];
    for _ in 0..if n > 500 { 20 } else { 200 } {
        let mut p = start.clone();
        let mut time = |k: usize, step: &mut dyn FnMut()| {
            let start = Instant::now();
            (0..20).for_each(|_| step());
            best[k] = best[k].min(1e6 * start.elapsed().as_secs_f64() / 20.0);
        };
        time(0, &mut || transition.propagate(black_box(&mut p)));
        p.clone_from(&start);
        time(1, &mut || {
            update.innovate(black_box(&p)).unwrap();
            update.apply(&mut p, &considered);
        });
    }
    best
}

/// Prints the cost of a field that nobody has explored, and of one that is explored everywhere.
fn fields() {
    println!("\n{:9}{:>10}{:>10}{:>10}", "states", "explored", "step", "update");
    for (n, explored) in [(20, 5), (200, 4), (200, 185), (2000, 4), (2000, 200), (2000, 1985)] {
        let [step, update] = field(n, explored);
        println!("{n:<9}{explored:>10}{step:10.2}{update:10.2}");
    }
}

fn main() {
    dive();
    late_fix();
    fields();
    let figure = curve();
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(&path, svg(&figure).unwrap()).unwrap();
        println!("\n{path}");
    }
}
