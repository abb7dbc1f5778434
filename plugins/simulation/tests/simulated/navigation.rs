//! The estimator with the inertial, DVL and depth plugins: Jacobians, intervals, long runs, memory.
use crate::samples;
use navfuse_core::filter::Ekf;
use navfuse_core::model::record::{Observer, Outcome, Record, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{At, jacobian_error};
use navfuse_core::model::simulate::Random;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::nalgebra::{DMatrix, Matrix3, Vector3};
use navfuse_core::run::runner;
use navfuse_core::state::State;
use navfuse_core::state::manifold::{Manifold, Rotation};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_ins::earth::earth_rate_ned;
use navfuse_testing::scenario;
use std::sync::atomic::AtomicBool;

const PAN_WU: &str = include_str!("../../../../scenarios/pan-wu-3d.toml");

/// Every calibration state there is, estimated.
const EVERYTHING: &str = r#"
[process.ins]
attitude = { sigma = "1 deg", initial = "0 deg" }
velocity = { sigma = "1 m/s", initial = "0 m/s" }
position = { sigma = "10 m", latitude = "30 deg", longitude = "10 deg", height = "-20 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "50 ug" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
[sensor.dvl]
noise = "2 cm/s"
scale = { sigma = 0.1 }
misalignment = { sigma = "1 deg" }
lever_arm = { sigma = "10 cm" }
[sensor.depth]
noise = "10 cm"
bias = { sigma = "1 m" }
lever_arm = { sigma = "10 cm" }
"#;

/// The state with every block and signal at random: angles to half a turn, lever arms and
/// velocities of metres.
fn random_state(ekf: &Ekf, random: &mut Random) -> State {
    let layout = ekf.layout();
    let mut state = ekf.state().clone();
    for block in &layout.blocks {
        let mut u = || 2.0 * random.uniform() - 1.0;
        let c: Vec<f64> = match block.name.as_str() {
            "ins.position" => vec![1.4 * u(), 3.0 * u(), 3000.0 * u()],
            "ins.attitude" | "dvl.misalignment" => vec![3.0 * u(), 1.5 * u(), 3.0 * u()],
            _ => (0..block.operations.tangent).map(|_| 3.0 * u()).collect(),
        };
        (block.operations.from_coordinates)(&c, &mut state.values[block.range()]);
    }
    state.signals.iter_mut().for_each(|s| *s = 2.0 * random.uniform() - 1.0);
    state
}

#[test]
fn the_jacobian_of_every_measurement_model_is_its_derivative_on_the_manifold() {
    let ekf = Ekf::new(scenario(EVERYTHING, &[], |s| s.compose().unwrap()));
    let mut random = Random::new(1, "states");
    let mut models = 0;
    for sensor in &ekf.composition().sensors {
        let Role::Measurement(model) = &sensor.role else { continue };
        models += 1;
        for case in 0..200 {
            let state = random_state(&ekf, &mut random);
            // central differences: truncation (6e-6)^2 and rounding 1e-16/6e-6 of numbers up to
            // 3000 (a depth) leave 1e-7
            let error = jacobian_error(model.as_ref(), &At::state(ekf.layout(), &state));
            assert!(error < 1e-6, "{}, case {case}: {error:e}", sensor.info.name);
        }
    }
    assert_eq!(models, 2);
}

/// The Jacobian by dual numbers, and the analytic one if there is one, over the blocks that are
/// read.
fn jacobians(
    ekf: &Ekf,
    name: &str,
    state: &State,
) -> (Vec<usize>, DMatrix<f64>, Option<DMatrix<f64>>) {
    let sensor = &ekf.composition().sensors[ekf.composition().sensor(name).unwrap()];
    let Role::Measurement(model) = &sensor.role else { panic!("{name} measures") };
    let (layout, n) = (ekf.layout(), model.channels());
    let at = At::state(layout, state);
    let read = model.blocks(&at);
    let columns: Vec<usize> = read.slots().flat_map(|s| layout.blocks[s].tangent_range()).collect();
    let mut h = vec![0.0; n * columns.len()];
    model.differentiate(&at, &columns, &read, &mut h);
    let dual = DMatrix::from_row_slice(n, columns.len(), &h);
    h.fill(0.0);
    let analytic = model.analytic(&at, &columns, &mut h);
    let analytic = analytic.then(|| DMatrix::from_row_slice(n, columns.len(), &h));
    (columns, dual, analytic)
}

#[test]
fn the_analytic_jacobian_of_the_depth_is_that_of_the_dual_numbers() {
    let ekf = Ekf::new(scenario(EVERYTHING, &[], |s| s.compose().unwrap()));
    let mut random = Random::new(2, "states");
    for _ in 0..500 {
        let (_, dual, analytic) = jacobians(&ekf, "depth", &random_state(&ekf, &mut random));
        // derivatives of at most 3 m per rad, a dozen roundings
        assert!((dual - analytic.unwrap()).amax() < 1e-14);
    }
    let fixed = ["sensor.depth.bias=\"1 m\"", "sensor.depth.lever_arm=[\"1 m\",\"2 m\",\"3 m\"]"];
    let ekf = Ekf::new(scenario(EVERYTHING, &fixed, |s| s.compose().unwrap()));
    let (columns, dual, analytic) = jacobians(&ekf, "depth", &random_state(&ekf, &mut random));
    assert_eq!(columns.len(), 6, "what is fixed has no column");
    assert!((dual - analytic.unwrap()).amax() < 1e-14);
}

#[test]
fn a_lever_arm_carries_the_attitude_and_the_gyro_bias_into_the_dvl() {
    let ekf = Ekf::new(scenario(EVERYTHING, &[], |s| s.compose().unwrap()));
    let layout = ekf.layout();
    let mut random = Random::new(3, "states");
    for _ in 0..200 {
        let state = random_state(&ekf, &mut random);
        let (columns, h, _) = jacobians(&ekf, "dvl", &state);
        let block = |name: &str| layout.find(name).unwrap();
        let value = |name: &str| Vector3::from_row_slice(&state.values[block(name).range()]);
        let part = |name: &str| -> Matrix3<f64> {
            let at = columns.iter().position(|c| Some(*c) == block(name).tangent).unwrap();
            h.fixed_view::<3, 3>(0, at).into()
        };
        let rotation =
            |name: &str| *Rotation::load::<f64>(&state.values[block(name).range()]).matrix();
        let (c_b_n, c_b_d) = (rotation("ins.attitude"), rotation("dvl.misalignment"));
        let (v, l, k) = (
            value("ins.velocity"),
            value("dvl.lever_arm"),
            state.values[block("dvl.scale").offset],
        );
        let w_ie = earth_rate_ned(state.values[block("ins.position").offset]);
        // y = k C_b^d (C_n^b v + (w - b_g - C_n^b w_ie) x l), with C_b^n -> exp([phi x]) C_b^n:
        // dy/db_g = k C_b^d [l x] and dy/dphi = k C_b^d (C_n^b [v x] + [l x] C_n^b [w_ie x])
        let c_n_b = c_b_n.transpose();
        let gyro = c_b_d * l.cross_matrix() * k;
        let attitude =
            c_b_d * (c_n_b * v.cross_matrix() + l.cross_matrix() * c_n_b * w_ie.cross_matrix()) * k;
        // products of numbers up to 3, a few dozen roundings of 27 x 2^-53
        assert!((part("ins.gyro_bias") - gyro).amax() < 1e-13);
        assert!((part("ins.attitude") - attitude).amax() < 1e-13);
        assert!(gyro.amax() > 0.0);
    }
}

#[derive(Default)]
struct Log {
    outcomes: Vec<Outcome>,
}

impl Observer for Log {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.outcomes.push(update.outcome);
    }
}

/// Samples as `(sensor, nanoseconds)`: constant rates, and a velocity of zero.
fn run(text: &str, settings: &[&str], samples: &[(&str, i64)]) -> (Ekf, Log) {
    let mut ekf = Ekf::new(scenario(text, settings, |s| s.compose().unwrap()));
    let mut log = Log::default();
    for (name, ns) in samples {
        let values: &[f64] = match *name {
            "imu" => &[0.1, -0.05, 0.2, 0.3, -0.2, -9.8],
            "dvl" => &[0.02, -0.01, 0.03],
            _ => &[0.5, 0.2, -20.0, 0.1, 0.0, 0.0, 0.02, -0.05, 1.0],
        };
        let id = SensorId(ekf.composition().sensor(name).unwrap());
        ekf.process(&Sample::new(Time::from_nanos(*ns), id, values), &mut log).unwrap();
    }
    (ekf, log)
}

/// The largest difference of the values, and of the covariance relative to its sigmas.
fn difference(a: &Ekf, b: &Ekf) -> (f64, f64) {
    assert_eq!(a.state().time, b.state().time);
    let values = a
        .state()
        .values
        .iter()
        .zip(&b.state().values)
        .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let (p, q) = (a.covariance(), b.covariance());
    let mut largest = 0.0_f64;
    for i in 0..p.dimension() {
        for j in 0..p.dimension() {
            let scale = (q.get(i, i) * q.get(j, j)).sqrt();
            largest = largest.max((p.get(i, j) - q.get(i, j)).abs() / scale);
        }
    }
    (values, largest)
}

#[test]
fn a_velocity_between_two_inertial_samples_is_used_at_its_own_time() {
    const MS: i64 = 1_000_000;
    for (at, output) in [(3, "rates"), (5, "rates"), (9, "rates")] {
        let set = format!("sensor.imu.output=\"{output}\"");
        let set = [set.as_str()];
        let imu = |t: i64| ("imu", t * MS);
        let (whole, _) = run(
            EVERYTHING,
            &set,
            &[imu(0), imu(10), imu(20), ("dvl", (20 + at) * MS), imu(30), imu(40)],
        );
        let split =
            [imu(0), imu(10), imu(20), imu(20 + at), ("dvl", (20 + at) * MS), imu(30), imu(40)];
        let (split, log) = run(EVERYTHING, &set, &split);
        assert_eq!(log.outcomes, [Outcome::Accepted]);
        // at constant rates coning and sculling vanish, and both runs make the same steps but for
        // the rounding of the increments: 2^-53 of the largest value, the height of 20 m, over ten
        // operations; as much of the covariance
        let (values, covariance) = difference(&whole, &split);
        assert!(values < 3e-14 && covariance < 1e-13, "{at} ms: {values:e} {covariance:e}");
        // the nearest epoch differs: 0.3 m/s^2 and 9.8 m/s^2 x 0.2 rad/s over milliseconds
        let (nearest, _) =
            run(EVERYTHING, &set, &[imu(0), imu(10), imu(20), ("dvl", 20 * MS), imu(30), imu(40)]);
        let (values, _) = difference(&nearest, &split);
        assert!(values > 1e-6, "{values:e}");
    }
}

#[test]
fn a_filter_that_starts_inside_an_interval_takes_only_its_rest() {
    const MS: i64 = 1_000_000;
    let text = format!("{EVERYTHING}[sensor.reference]\n");
    let set = ["estimator.initial=\"reference\""];
    let imu = |t: i64| ("imu", t * MS);
    let reference = ("reference", 14 * MS);
    let (whole, _) = run(&text, &set, &[imu(0), imu(10), reference, imu(20), imu(30), imu(40)]);
    let (split, _) =
        run(&text, &set, &[imu(0), imu(10), reference, imu(14), imu(20), imu(30), imu(40)]);
    let (values, covariance) = difference(&whole, &split);
    assert!(values < 3e-14 && covariance < 1e-13, "{values:e} {covariance:e}");
    // a reference that comes after later inertial samples starts nothing: they could not be used
    // again
    let (late, _) = run(&text, &set, &[imu(0), imu(10), imu(20), reference, imu(30)]);
    assert!(!late.running());
}

/// Looks at the covariance of every epoch.
struct Definite(u64, f64, f64);

impl Sink for Definite {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let p = epoch.covariance.to_dense();
        if p != p.transpose() {
            return Err(StreamError::new("not symmetric to the bit"));
        }
        let scaled = DMatrix::from_fn(p.nrows(), p.nrows(), |i, j| {
            p[(i, j)] / (p[(i, i)] * p[(j, j)]).sqrt()
        });
        let smallest = scaled.symmetric_eigenvalues().min();
        let north = p[(6, 6)].sqrt();
        *self = Self(self.0 + 1, self.1.min(smallest), self.2.max(north));
        Ok(())
    }
}

/// A day at 10 Hz: around a square, with DVL and depth at 1 Hz.
const DAY: &str = r#"
[estimator]
output_rate = "0.02 Hz"
draw = "start"
[process.ins]
attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.01 deg/h", truth = "0.01 deg/h" }
accel_bias = { sigma = "50 ug", truth = "20 ug", correlation_time = "2 h" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
max_gap = "1 s"
simulation = { rate = "10 Hz" }
[sensor.dvl]
noise = "2 cm/s"
gate = "off"
scale = { sigma = 0.01, truth = 1.002 }
misalignment = { sigma = "1 deg", truth = ["0.1 deg", "-0.2 deg", "0.5 deg"] }
simulation = { rate = "1 Hz" }
[sensor.depth]
noise = "10 cm"
gate = "off"
bias = { sigma = "20 cm", random_walk = "1 mm/sqrt(s)" }
simulation = { rate = "1 Hz" }
[sensor.reference]
simulation = { rate = "0.1 Hz" }
[source.simulation.start]
latitude = "30 deg"
height = "-20 m"
[[source.simulation.segments]]
type = "surge"
duration = "60 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "square"
duration = "86340 s"
turn = "60 s"
"#;

fn day(settings: &[&str]) -> (u64, f64, f64) {
    let mut assembly = scenario(DAY, settings, |s| s.assemble(None).unwrap());
    assembly.sinks.push(("definite".into(), Box::new(Definite(0, f64::INFINITY, 0.0))));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    assert!(finished.events.iter().all(|e| e.about != "definite"), "{:?}", finished.events);
    let summary = &finished.summary;
    // the first reference comes before the first IMU sample: the second, at 10 s, starts the filter
    assert!((summary.duration_s - 86_390.0).abs() < 1.0, "{}", summary.duration_s);
    // 2 m/s around the square and half of it while it gathers speed; chords of 10 s cut corners of
    // 76 m radius by 0.3 % in 240 s of the day
    assert!(
        (summary.distance_m / (2.0 * 86_340.0 + 60.0) - 1.0).abs() < 1e-4,
        "{}",
        summary.distance_m
    );
    let error = summary.horizontal_error_m.unwrap();
    assert!(
        (error.percent_of_distance.unwrap() - 100.0 * error.last / summary.distance_m).abs()
            < 1e-12
    );
    let Definite(epochs, smallest, north) = finished.take_sink().unwrap();
    (epochs, smallest, north)
}

// the eigenvalues of a correlation matrix of dimension 20 are computed to 20 x 2^-53 = 2e-15: what
// is above 1e-14 is certainly positive
const CERTAINLY_POSITIVE: f64 = 1e-14;

#[test]
fn the_covariance_stays_positive_definite_for_a_day() {
    let (epochs, smallest, _) = day(&[]);
    assert!(epochs > 1700, "{epochs}");
    assert!(smallest > CERTAINLY_POSITIVE, "{smallest:e}");
}

#[test]
fn the_covariance_stays_positive_definite_when_the_dvl_is_lost_for_hours() {
    let lost = "sensor.dvl.simulation.outages=[[\"10000 s\", \"60000 s\"]]";
    let (_, smallest, north) = day(&[lost]);
    assert!(smallest > CERTAINLY_POSITIVE, "{smallest:e}");
    assert!(north > 1000.0, "the run is poor in information: {north} m");
}

#[test]
fn a_step_of_the_paper_s_composition_allocates_nothing() {
    let mut assembly = scenario(PAN_WU, &[], |s| s.assemble(None).unwrap());
    let all = samples(&mut assembly, 640.0);
    let dvl = assembly.composition.sensor("dvl").unwrap();
    let mut ekf = Ekf::new(assembly.composition);
    let mut log = Log { outcomes: Vec::with_capacity(10_000) };
    let warm = all.iter().position(|s| s.time.seconds() > 601.0).unwrap();
    for sample in &all[..warm] {
        ekf.process(sample, &mut log).unwrap();
    }
    assert!(ekf.running());
    let info = allocation_counter::measure(|| {
        for sample in &all[warm..] {
            ekf.process(sample, &mut log).unwrap();
        }
    });
    assert!(all[warm..].iter().filter(|s| s.sensor.0 == dvl).count() > 150);
    assert!(log.outcomes.iter().all(|o| *o == Outcome::Accepted));
    assert_eq!(info.count_total, 0, "{} bytes in {} steps", info.bytes_total, all.len() - warm);
}

#[test]
fn the_paper_s_run_repeats_to_the_bit_and_continues_from_a_snapshot_to_the_bit() {
    let start = || {
        let mut assembly = scenario(PAN_WU, &[], |s| s.assemble(None).unwrap());
        let all = samples(&mut assembly, 700.0);
        (Ekf::new(assembly.composition), all)
    };
    let drive = |ekf: &mut Ekf, samples: &[Sample]| {
        let mut log = Log::default();
        samples.iter().for_each(|s| ekf.process(s, &mut log).unwrap());
    };
    let ((mut a, all), (mut b, again)) = (start(), start());
    assert_eq!(all, again);
    drive(&mut a, &all);
    // from before the start, whose draws are part of the snapshot, and from the middle
    for cut in [100, all.len() - 3001] {
        drive(&mut b, &again[..cut]);
        let snapshot = b.snapshot();
        drive(&mut b, &again[cut..]);
        for _ in 0..2 {
            assert_eq!(a.state(), b.state());
            assert_eq!(a.covariance(), b.covariance());
            b.restore(&snapshot);
            drive(&mut b, &again[cut..]);
        }
        b = start().0;
    }
}
