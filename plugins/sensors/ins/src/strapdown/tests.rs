//! The process, sample by sample: the state that it moves, the rate that it publishes, and its
//! noise, against what each of the causes does to angle and velocity.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::testing::Bench;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::model::process::screening::Spread;
use navfuse_core::model::process::{Input, Interval, ProcessError};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::{State, View};
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::{Span, Time};

/// 0.1 deg/h/sqrt(Hz) and 20 ug/sqrt(Hz), the noise of the bench, in SI.
const NOISE: [f64; 2] = [0.1 / 180.0 * std::f64::consts::PI / 3600.0, 20.0 * 9.80665e-6];

/// Samples of one IMU, and the state that they move.
struct Run {
    bench: Bench,
    state: State,
    attitude: Rotation3<f64>,
    time: Time,
}

impl Run {
    fn new(settings: &[&str]) -> Self {
        let bench = Bench::new(settings);
        let mut state = bench.state();
        let attitude = Rotation3::from_euler_angles(0.3, -0.2, 1.0);
        state.set(&bench.composition.layout, bench.navigation.attitude, &attitude);
        Self { bench, state, attitude, time: Time::default() }
    }

    /// Takes a sample in parts that last so many seconds each; `usual` is the interval of the
    /// sensor. Returns the variance that it adds to angle and velocity, in body axes.
    fn take(
        &mut self,
        channels: [f64; 6],
        parts: &[f64],
        usual: f64,
        spread: Option<&Spread>,
    ) -> [Matrix3<f64>; 2] {
        self.try_take(channels, parts, (parts.iter().sum(), usual), spread).unwrap()
    }

    /// As [`Self::take`], with the intervals of the sample and of the sensor, as the filter gives
    /// them.
    fn try_take(
        &mut self,
        channels: [f64; 6],
        parts: &[f64],
        (duration, usual): (f64, f64),
        spread: Option<&Spread>,
    ) -> Result<[Matrix3<f64>; 2], ProcessError> {
        let (Run { bench, state, attitude, time }, mut sums) = (self, [Matrix3::zeros(); 2]);
        let composition = &mut bench.composition;
        let layout = &*composition.layout;
        let end = *time + Span::from_seconds(parts.iter().sum()).unwrap();
        let sample = Sample::new(end, SensorId(0), &channels);
        for part in parts {
            let (from, to) = (*time, *time + Span::from_seconds(*part).unwrap());
            let input = Some(Input { sample: &sample, duration, usual, spread });
            let interval = Interval { from, to, input };
            let (model, out) = (&mut composition.processes[0].model, &mut composition.transition);
            model.propagate(layout, state, &interval, out)?;
            (*time, state.time) = (to, to);
            let q = out.noise_dense(layout.tangent);
            let n = &bench.navigation;
            let rows = [layout.block(n.attitude).tangent, layout.block(n.velocity).tangent];
            for (sum, row) in sums.iter_mut().zip(rows.map(Option::unwrap)) {
                let q: Matrix3<f64> = q.fixed_view::<3, 3>(row, row).into();
                *sum += attitude.inverse() * q * attitude.matrix();
            }
        }
        Ok(sums)
    }

    /// Angular rate that the sensors read.
    fn rate(&self) -> Vector3<f64> {
        let layout = &*self.bench.composition.layout;
        self.bench.navigation.published(&View::new(layout, &self.state)).into()
    }
}

/// Checks for a covariance in body axes that the axes are independent, with these 1-sigma. The
/// attitude turns by the rate of the Earth alone: 7e-5 rad/s for 0.1 s at most, which mixes the
/// axes by 1e-5.
fn independent(found: &Matrix3<f64>, sigma: [f64; 3]) {
    let expected = Matrix3::from_diagonal(&Vector3::from(sigma).map(|s| s * s));
    assert!((found - expected).amax() < 2e-5 * expected.amax(), "{found:e}, not {expected:e}");
}

const STILL: [f64; 6] = [0.0; 6];

/// Along each axis the noise is that of its own gyro and accelerometer, also where two axes agree.
#[test]
fn every_axis_has_the_noise_of_its_own_sensor() {
    let interval: f64 = 0.01;
    for axes in [[1.0, 1.0, 1.0], [1.0, 1.0, 3.0], [3.0, 1.0, 1.0], [1.0, 3.0, 1.0]] {
        for (gyro, accel) in [(axes, [1.0; 3]), ([1.0; 3], axes)] {
            let [x, y, z] = gyro.map(|k| format!("\"{} deg/h/sqrt(Hz)\"", 0.1 * k));
            let gyros = format!("sensor.imu.gyro_noise=[{x}, {y}, {z}]");
            let [x, y, z] = accel.map(|k| format!("\"{} ug/sqrt(Hz)\"", 20.0 * k));
            let accels = format!("sensor.imu.accel_noise=[{x}, {y}, {z}]");
            let found = Run::new(&[&gyros, &accels]).take(STILL, &[interval], interval, None);
            independent(&found[0], gyro.map(|k| k * NOISE[0] * interval.sqrt()));
            independent(&found[1], accel.map(|k| k * NOISE[1] * interval.sqrt()));
        }
    }
}

/// Rounding to a step adds the variance of a uniform distribution, `step^2 / 12`, to the rate, for
/// the whole of the sample; parts of it add up to that.
#[test]
fn rounding_adds_the_variance_of_a_uniform_distribution() {
    let steps: [f64; 2] = [1e-4, 2e-2];
    let settings =
        ["sensor.imu.gyro_quantisation=1e-4 rad/s", "sensor.imu.accel_quantisation=2e-2 m/s^2"];
    for parts in [&[0.01][..], &[0.002, 0.008]] {
        let found = Run::new(&settings).take(STILL, parts, 0.01, None);
        for k in 0..2 {
            let rounding = steps[k] / 12_f64.sqrt() * 0.01;
            independent(&found[k], [rounding.hypot(NOISE[k] * 0.1); 3]);
        }
    }
}

/// Samples are missing for 30 ms before this one, over which the rate changed by 0.5 rad/s and the
/// specific force by 5 m/s^2. If their mean in the hole is off by that change, the angle is off by
/// 15 mrad, the velocity by 0.15 m/s.
#[test]
fn a_hole_adds_the_change_over_it_to_the_noise() {
    for parts in [&[0.04][..], &[0.01, 0.03]] {
        let mut run = Run::new(&[]);
        run.take([0.1, 0.2, 0.1, 1.0, -2.0, 0.5], &[0.01], 0.01, None);
        let found = run.take([0.4, 0.2, -0.3, 1.0, 2.0, 3.5], parts, 0.01, None);
        // in the hole the attitude turns by 0.02 rad, which the same sigma on all axes does not show
        independent(&found[0], [0.015_f64.hypot(NOISE[0] * 0.2); 3]);
        independent(&found[1], [0.15_f64.hypot(NOISE[1] * 0.2); 3]);
    }
}

/// A replaced sample with its own sigma in each channel, for the whole of its interval: of a rate
/// in rad/s and m/s^2, of an increment in rad and m/s. Parts of the sample add up to the whole.
#[test]
fn a_replaced_sample_adds_its_spread_to_the_noise() {
    let sigma = [0.1, 0.2, 0.4, 1.0, 3.0, 2.0];
    for (output, share) in [("rates", 0.01), ("increments", 1.0)] {
        let mut spread = [0.0; MAX_CHANNELS];
        (0..6).for_each(|k| spread[k] = sigma[k] / share);
        for parts in [&[0.01][..], &[0.007, 0.003]] {
            let output = format!("sensor.imu.output={output}");
            let found = Run::new(&[&output]).take(STILL, parts, 0.01, Some(&spread));
            for k in 0..2 {
                let noise = NOISE[k] * 0.1;
                independent(&found[k], [0, 1, 2].map(|axis| noise.hypot(sigma[3 * k + axis])));
            }
        }
    }
}

/// A vehicle that moves, with biases of its own on every axis. For 10 ms its samples show these
/// biases and gravity: it keeps attitude and velocity but for the rate of the Earth (1e-4 rad/s with
/// the transport rate) and Coriolis (`2 W v` = 3e-3 m/s^2), and travels by velocity times time.
#[test]
fn every_component_of_the_state_takes_part_in_a_step() {
    let mut run = Run::new(&[]);
    let (n, dt) = (run.bench.navigation, 0.01);
    let velocity = Vector3::new(15.0, -8.0, 3.0);
    let (gyro, accel) = (Vector3::new(0.2, -0.3, 0.5), Vector3::new(0.4, 0.7, -0.6));
    let layout = run.bench.composition.layout.clone();
    run.state.set(&layout, n.velocity, &velocity);
    run.state.set(&layout, n.gyro_bias.unwrap(), &gyro);
    run.state.set(&layout, n.accel_bias.unwrap(), &accel);
    let before = run.state.get(&layout, n.position);
    let gravity = crate::earth::normal_gravity(before.latitude, before.height);
    let force = run.attitude.inverse() * Vector3::new(0.0, 0.0, -gravity) + accel;
    run.take([gyro.x, gyro.y, gyro.z, force.x, force.y, force.z], &[dt], dt, None);
    let turned = run.attitude.angle_to(&run.state.get(&layout, n.attitude));
    assert!(turned < 1e-4 * dt, "{turned} rad");
    let gained = (run.state.get(&layout, n.velocity) - velocity).norm();
    assert!(gained < 3e-3 * dt, "{gained} m/s");
    let after = run.state.get(&layout, n.position);
    let off = after.ned_from(&before.displaced(&(velocity * dt))).norm();
    assert!(off < 3e-3 * dt * dt, "{off} m");
}

/// Increments that come for the first time: the interval since the start of the filter is theirs,
/// and so is the rounding of the whole of it.
#[test]
fn the_first_sample_covers_the_time_since_the_start() {
    let settings = [
        "sensor.imu.output=increments",
        "sensor.imu.gyro_quantisation=1e-4 rad/s",
        "sensor.imu.accel_quantisation=2e-2 m/s^2",
    ];
    let mut run = Run::new(&settings);
    let found = run.try_take([0.0, 0.0, 0.02, 0.0, 0.0, 0.0], &[0.01], (0.0, 0.0), None).unwrap();
    let n = run.bench.navigation;
    let turned = run.attitude.angle_to(&run.state.get(&run.bench.composition.layout, n.attitude));
    // the Earth turns by 7e-5 rad/s
    assert!((turned - 0.02).abs() < 1e-6, "{turned}");
    assert_eq!(run.rate(), Vector3::new(0.0, 0.0, 2.0));
    let whole = Run::new(&settings).take(STILL, &[0.01], 0.01, None);
    for k in 0..2 {
        // of the two, one turned by 0.02 rad, which an isotropic covariance does not show
        assert!((found[k] - whole[k]).amax() < 1e-12 * whole[k].amax(), "{found:?}");
    }
}

#[test]
fn a_gap_up_to_the_longest_is_bridged() {
    let gap = |length: f64, covered: f64| {
        let mut run = Run::new(&["sensor.imu.max_gap=0.125 s"]);
        run.try_take(STILL, &[length], (covered, 0.01), None).is_ok()
    };
    // of the interval that the sample covers, and of the time since the state
    assert!(gap(0.125, 0.125) && !gap(0.126, 0.126));
    assert!(gap(0.125, 0.01) && !gap(0.126, 0.01));
    assert!(!gap(0.01, 0.126));
}

/// The middle of the last sample is half an interval before its end: at 10 and 30 ms the means are
/// 1 and 3 rad/s, so that the rate is 4 rad/s at 40 ms.
#[test]
fn a_sample_publishes_the_rate_at_its_end_before_it_moves_the_state() {
    for (output, share) in [("rates", 1.0), ("increments", 0.02)] {
        let mut run = Run::new(&[&format!("sensor.imu.output={output}")]);
        for (k, rate) in [(1, 1.0), (2, 3.0)] {
            let end = Time::from_nanos(k * 20_000_000);
            let z = rate * share;
            let sample = Sample::new(end, SensorId(0), &[z, 0.0, -2.0 * z, 0.0, 0.0, 0.0]);
            let input = Input { sample: &sample, duration: 0.02, usual: 0.02, spread: None };
            let composition = &mut run.bench.composition;
            composition.processes[0].model.prepare(&composition.layout, &mut run.state, &input);
        }
        let off = run.rate() - Vector3::new(4.0, 0.0, -8.0);
        assert!(off.norm() < 1e-14, "{output}: {off}");
    }
}

/// Before the second sample the interval of increments is not known, and counts as one second.
#[test]
fn increments_without_an_interval_count_as_those_of_a_second() {
    let mut run = Run::new(&["sensor.imu.output=increments"]);
    let sample = Sample::new(Time::default(), SensorId(0), &[0.5, 0.0, -1.0, 0.0, 0.0, 0.0]);
    let input = Input { sample: &sample, duration: 0.0, usual: 0.0, spread: None };
    let composition = &mut run.bench.composition;
    composition.processes[0].model.prepare(&composition.layout, &mut run.state, &input);
    assert_eq!(run.rate(), Vector3::new(0.5, 0.0, -1.0));
}

/// Coning of two samples about different axes needs both of them: `0.2 * 0.3 / 12` = 5 mrad, beside
/// a turn by 0.3 rad, of which a small rotation across it contributes `sin(0.15) / 0.15`.
#[test]
fn after_a_restart_the_samples_before_it_do_not_count() {
    let turned = |restart: bool| {
        let mut run = Run::new(&[]);
        run.take([20.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[0.01], 0.01, None);
        if restart {
            run.bench.composition.processes[0].model.restart();
        }
        run.take([0.0, 30.0, 0.0, 0.0, 0.0, 0.0], &[0.01], 0.01, None);
        let turns = Rotation3::new(Vector3::x() * 0.2) * Rotation3::new(Vector3::y() * 0.3);
        let layout = &run.bench.composition.layout;
        run.state.get(layout, run.bench.navigation.attitude).angle_to(&(run.attitude * turns))
    };
    // the rate of the Earth for 20 ms
    assert!(turned(true) < 2e-6, "{}", turned(true));
    let coning = 5e-3 * 0.15_f64.sin() / 0.15;
    assert!((turned(false) - coning).abs() < 2e-6, "{}", turned(false));
}

/// The sensors read the rate with the bias in it, as the gyros show it.
#[test]
fn a_vehicle_that_follows_a_motion_shows_its_rate_with_the_bias() {
    let mut run = Run::new(&[]);
    let (n, layout) = (run.bench.navigation, run.bench.composition.layout.clone());
    run.state.set(&layout, n.gyro_bias.unwrap(), &Vector3::new(0.5, -0.25, 0.125));
    let motion = Motion {
        position: Geodetic { latitude: 0.3, longitude: -2.0, height: 7.0 },
        velocity: Vector3::new(1.0, -2.0, 3.0),
        c_b_n: UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
        w_ib_b: Vector3::new(1.0, 2.0, 4.0),
        ..Motion::unknown(Time::default())
    };
    let mut known = vec![false; layout.blocks.len()];
    run.bench.composition.processes[0].model.follow(&layout, &motion, &mut run.state, &mut known);
    assert_eq!(run.rate(), Vector3::new(1.5, 1.75, 4.125));
    assert_eq!(run.state.get(&layout, n.velocity), motion.velocity);
    assert_eq!(run.state.get(&layout, n.position), motion.position);
    assert!(run.state.get(&layout, n.attitude).angle_to(&motion.c_b_n.into()) < 1e-15);
    let names = layout.blocks.iter().zip(&known).filter(|(_, known)| **known);
    let names: Vec<&str> = names.map(|(block, _)| block.name.as_str()).collect();
    assert_eq!(names, ["ins.attitude", "ins.velocity", "ins.position"]);
}
