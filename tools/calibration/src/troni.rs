//! Troni & Whitcomb (2010), Troni, Kinsey, Yoerger & Whitcomb (2012): least squares of
//! accelerations.
//!
//! ```text
//! a^b = X ydot + w_nb^b x X y          a^b = f^b + C_n^b g^n - constant, X = C_d^b / k
//! d(depth)/dt = e_3 . C_b^n X y
//! ```
//! The attitude and the angular rate are taken as known, and the Earth's rate is left out: `2 w_ie
//! x v` is 0.4 mm/s^2 at 2.5 m/s. (Their `R` is `X` without `k`; the lever arm comes from the
//! scenario.) `a` is free of gravity only for a good attitude: 1 mrad of tilt is 1 mg. Pan & Wu
//! (after eq. 9) describe the method with the term `C_n^b g^n` neglected; then only its mean is
//! removed, with the constant.

use crate::solve::{determined, moved, prior, sensitivity};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix3x4, Matrix4, Vector3, Vector4};
use navfuse_segments::Mounting;

/// Shortest window of a derivative, s.
const WINDOW: f64 = 4.0;
/// Samples of the DVL in a window.
const SAMPLES: f64 = 5.0;

/// One window.
struct Window {
    time: f64,
    /// Slope and mean of the DVL's samples, instrument axes.
    ydot: Vector3<f64>,
    y: Vector3<f64>,
    /// Acceleration in body axes, filtered as the slope is.
    a: Vector3<f64>,
    /// Terms of `Σ w x X y`: angular rates with the weights of the slope, and the samples of the
    /// DVL.
    turns: Vec<(Vector3<f64>, Vector3<f64>)>,
    /// Down axis in body axes, and the depth rate, m/s, with its sigma.
    down: Vector3<f64>,
    depth_rate: Option<(f64, f64)>,
    /// Number of DVL samples.
    count: f64,
}

pub fn estimate(data: &CalibrationData, gravity: bool) -> Result<Estimate, CalibrationError> {
    let velocity = data.over_ground()?;
    let windows = windows(data, gravity)?;
    if windows.len() < 10 {
        return Err(CalibrationError::Samples(format!(
            "only {} windows of {:.0} s have samples of the IMU and [sensor.{}]: at least 10 are \
             needed; record longer, or fill the gaps",
            windows.len(),
            length(data)?,
            velocity.samples.name
        )));
    }
    let still = windows.iter().map(|w| w.ydot.norm_squared()).sum::<f64>() / windows.len() as f64;
    let noise = slope_variance(data)?;
    if still < 3.0 * noise * 1.5 {
        return Err(CalibrationError::Motion(format!(
            "the velocity changes by {:.1} mm/s^2 r.m.s., with noise of {:.1}: accelerate and turn \
             more",
            1e3 * still.sqrt(),
            1e3 * (3.0 * noise).sqrt()
        )));
    }
    let mut mounting = velocity.initial;
    let mut fit = Fit::default();
    for _ in 0..6 {
        fit = fit_at(&windows, &mounting, velocity);
        let d = fit.step;
        mounting = moved(&mounting, d[0], &Vector3::new(d[1], d[2], d[3]));
        if !(mounting.k > 1e-3 && mounting.k < 1e3) {
            return Err(CalibrationError::Inconsistent(format!(
                "the accelerations do not agree with the DVL's velocity (k = {:.3}): {}",
                mounting.k,
                if gravity {
                    "check the attitude"
                } else {
                    "they contain gravity; use the method with gravity"
                }
            )));
        }
    }
    let mut notes = vec![data.attitude_source()];
    if !gravity {
        notes.push(
            "the accelerations contain the change of C_n^b g, as Pan & Wu describe the method"
                .into(),
        );
    }
    // Least squares takes the regressor as exact. Its noise n biases the normal equations by
    // E[dH' dz] with dH = -X n / k, and so makes 1/k too small.
    let asked = 3.0 * noise * windows.len() as f64 / (mounting.k.powi(3) * fit.variance);
    let shift = fit.covariance.column(0) * asked;
    fit.covariance += shift * shift.transpose();
    if shift[0] > 1e-3 {
        notes.push(format!("the noise of the DVL's derivative biases k by about +{:.4}", shift[0]));
    }
    if windows.iter().all(|w| w.depth_rate.is_none()) {
        notes.push("no depth sensor: the rows of the depth rate are left out".into());
    }
    notes.push("sigma from white residuals and the noise of the derivative".into());
    let used = [windows[0].time, windows[windows.len() - 1].time];
    let determined = determined(&fit.covariance);
    Ok(Estimate {
        mounting,
        covariance: Some(fit.covariance),
        determined,
        history: fit.history,
        used,
        notes,
    })
}

fn length(data: &CalibrationData) -> Result<f64, CalibrationError> {
    Ok(WINDOW.max(SAMPLES * data.velocity()?.samples.period()))
}

/// Returns the noise variance of one axis of a slope, (m/s^2)^2: `12 sigma^2 period / T^3`.
fn slope_variance(data: &CalibrationData) -> Result<f64, CalibrationError> {
    let velocity = data.velocity()?;
    let (t, period) = (length(data)?, velocity.samples.period());
    Ok(velocity.covariance.trace() / 3.0 * 12.0 * period / t.powi(3))
}

fn windows(data: &CalibrationData, gravity: bool) -> Result<Vec<Window>, CalibrationError> {
    let velocity = data.over_ground()?;
    let (imu, attitude, window) = (&data.recording.imu.samples, &data.attitude, length(data)?);
    let down_gravity = Vector3::new(0.0, 0.0, attitude.earth().gravity);
    let depth = data.recording.depths.first();
    let (first, last) = (velocity.samples.time[0], data.recording.end());
    let least = (0.8 * window / velocity.samples.period()).floor().max(3.0) as usize;
    let mut out = Vec::new();
    let mut from = first.max(imu.time[0]);
    while from + window <= last {
        let to = from + window;
        let range = velocity.samples.within(from, to);
        let (n, inside) = (range.len(), imu.within(from, to));
        let start = std::mem::replace(&mut from, to);
        if n < least || inside.is_empty() {
            continue;
        }
        let time = 0.5 * (start + to);
        let middle = velocity.samples.time[range.clone()].iter().sum::<f64>() / n as f64;
        let spread: f64 =
            velocity.samples.time[range.clone()].iter().map(|t| (t - middle).powi(2)).sum();
        // the slopes of y and of the integrals of a and w x X y use the same weights: the same
        // filter on both sides, so that its delay and attenuation cancel
        let (times, ys) =
            (&velocity.samples.time[range.clone()], &velocity.samples.value[range.clone()]);
        let weights: Vec<f64> = times.iter().map(|t| (t - middle) / spread).collect();
        let ydot = ys.iter().zip(&weights).map(|(y, w)| y * *w).sum();
        let y = ys.iter().sum::<Vector3<f64>>() / n as f64;
        let (mut a, mut turns, mut k) =
            (Vector3::zeros(), Vec::new(), imu.time.partition_point(|t| *t <= times[0]));
        let mut after: f64 = weights.iter().sum();
        for j in 1..n {
            // an integral up to this sample enters the weights of all later samples
            after -= weights[j - 1];
            let (begin, end) = (times[j - 1], times[j]);
            let (mut first, mut second, mut reached) = (Vector3::zeros(), Vector3::zeros(), begin);
            while reached < end && k < imu.time.len() {
                let until = imu.time[k].min(end);
                let (dt, share) =
                    (until - reached, (0.5 * (until + reached) - begin) / (end - begin));
                let w = attitude.w_nb_b[k];
                a += acceleration(data, k, gravity, &down_gravity) * (dt * after);
                first += w * ((1.0 - share) * dt * after);
                second += w * (share * dt * after);
                reached = until;
                k += usize::from(until >= imu.time[k]);
            }
            turns.push((first, ys[j - 1]));
            turns.push((second, ys[j]));
        }
        let depth_rate = depth.and_then(|(series, sigma)| {
            let d = series.within(start, to);
            let count = d.len() as f64;
            (d.len() >= 3).then(|| {
                let slope = line(&series.time[d.clone()], &series.value[d]);
                (slope, sigma * (12.0 / count).sqrt() / window)
            })
        });
        let down = attitude.at(time).inverse_transform_vector(&Vector3::z());
        out.push(Window { time, ydot, y, a, turns, down, depth_rate, count: n as f64 });
    }
    Ok(out)
}

fn acceleration(data: &CalibrationData, k: usize, gravity: bool, g: &Vector3<f64>) -> Vector3<f64> {
    let force = data.recording.imu.samples.value[k].force;
    if gravity { force + data.attitude.c_b_n[k].inverse_transform_vector(g) } else { force }
}

/// Returns the least-squares slope of a line.
fn line(times: &[f64], values: &[f64]) -> f64 {
    let n = times.len() as f64;
    let middle = times.iter().sum::<f64>() / n;
    let spread: f64 = times.iter().map(|t| (t - middle).powi(2)).sum();
    times.iter().zip(values).map(|(t, v)| (t - middle) * v).sum::<f64>() / spread
}

#[derive(Default)]
struct Fit {
    step: Vector4<f64>,
    covariance: Matrix4<f64>,
    /// Variance of the residual accelerations, (m/s^2)^2.
    variance: f64,
    history: Vec<IntermediateEstimate>,
}

/// Computes one Gauss-Newton step. The rows of the depth rate are weighted by its noise, those of
/// the accelerations by their residuals.
fn fit_at(windows: &[Window], m: &Mounting, velocity: &navfuse_segments::BodyVelocity) -> Fit {
    let rows: Vec<(Matrix3x4<f64>, Vector3<f64>)> = (windows.iter())
        .map(|w| {
            let start = (sensitivity(m, &w.ydot), w.a - m.body(&w.ydot));
            w.turns.iter().fold(start, |(h, z), (rate, y)| {
                (h + rate.cross_matrix() * sensitivity(m, y), z - rate.cross(&m.body(y)))
            })
        })
        .collect();
    // a constant is estimated, too: the accelerometer bias and, in the method without gravity's
    // change, gravity
    let n = rows.len().max(1) as f64;
    let mean = rows
        .iter()
        .fold((Matrix3x4::zeros(), Vector3::zeros()), |m, r| (m.0 + r.0 / n, m.1 + r.1 / n));
    let rows: Vec<_> = rows.into_iter().map(|r| (r.0 - mean.0, r.1 - mean.1)).collect();
    let freedom = (3.0 * rows.len() as f64 - 7.0).max(1.0);
    let variance = rows.iter().map(|r| r.1.norm_squared()).sum::<f64>() / freedom;
    let (mut information, mut right) = prior(&velocity.initial, m);
    let mut history = Vec::new();
    for (w, (h, z)) in windows.iter().zip(&rows) {
        information += h.transpose() * h / variance;
        right += h.transpose() * z / variance;
        if let Some((rate, sigma)) = w.depth_rate {
            let row = w.down.transpose() * sensitivity(m, &w.y);
            // this row also has the noise of the velocity
            let s2 = sigma * sigma + velocity.covariance.trace() / 3.0 / w.count;
            information += row.transpose() * row / s2;
            right += row.transpose() * ((rate - w.down.dot(&m.body(&w.y))) / s2);
        }
        if let Some(step) = information.cholesky().map(|c| c.solve(&right)) {
            let mounting = moved(m, step[0], &Vector3::new(step[1], step[2], step[3]));
            history.push(IntermediateEstimate { time: w.time, mounting });
        }
    }
    let cholesky = information.cholesky();
    let (step, covariance) =
        cholesky.map_or_else(Default::default, |c| (c.solve(&right), c.inverse()));
    Fit { step, covariance, variance, history }
}
