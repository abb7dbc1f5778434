//! Noise of the process, against what each of its causes does to angle and velocity.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::testing::Bench;
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_core::model::process::{Input, Interval};
use navfuse_core::model::screening::Spread;
use navfuse_core::state::State;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;

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
        let (Run { bench, state, attitude, time }, mut sums) = (self, [Matrix3::zeros(); 2]);
        let (duration, composition) = (parts.iter().sum(), &mut bench.composition);
        let layout = &*composition.layout;
        let end = *time + Time::from_seconds(duration).unwrap();
        let sample = Sample::new(end, SensorId(0), &channels);
        for part in parts {
            let (from, to) = (*time, *time + Time::from_seconds(*part).unwrap());
            let input = Some(Input { sample: &sample, duration, usual, spread });
            let interval = Interval { from, to, input };
            let (model, out) = (&mut composition.processes[0].model, &mut composition.transition);
            model.propagate(layout, state, &interval, out).unwrap();
            (*time, state.time) = (to, to);
            let q = out.noise_dense(layout.tangent);
            let n = &bench.navigation;
            let rows = [layout.block(n.attitude).tangent, layout.block(n.velocity).tangent];
            for (sum, row) in sums.iter_mut().zip(rows.map(Option::unwrap)) {
                let q: Matrix3<f64> = q.fixed_view::<3, 3>(row, row).into();
                *sum += attitude.inverse() * q * attitude.matrix();
            }
        }
        sums
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
        run.take(STILL, &[0.01], 0.01, None);
        let found = run.take([0.3, 0.0, -0.4, 0.0, 4.0, 3.0], parts, 0.01, None);
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
