//! IO-DVLC of Pan & Wu (2016), improved.
//!
//! On a stretch of samples without a turn, in local axes, eq. (9) integrated once is
//!
//! ```text
//! C_b^n(t) C_d^b y / k = u + c t + ∫ C_b^n f^b dτ - ∫ (2 w_ie^n + w_en^n) x v^n dτ + noise
//! ```
//! This form keeps the terms that eq. (10) drops: the Earth's rate, the effect of attitude changes,
//! and (not written) the change of gravity with height and latitude. `u` is the initial velocity,
//! and `c` is gravity less the accelerometer bias and the effect of the tilt error.
//!
//! `u`, `c`, `k` and `C_d^b` are estimated from all samples of the stretch, including those at rest
//! or in steady motion before and after the segment. The paper instead takes single samples as
//! anchors, whose noise enters the estimate in full. The noise consists of the DVL's noise, the
//! integral of the accelerometer noise, and gravity times the double integral of the gyro noise.
//! The estimate is the weighted least-squares estimate for its covariance.

use crate::data::Gaps;
use crate::solve::{determined, moved, prior, sensitivity};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{
    Cholesky, DMatrix, DVector, Dyn, Matrix2, Matrix3x4, Matrix4, Matrix4x2, UnitQuaternion,
    Vector2, Vector3, Vector4,
};
use navfuse_segments::{Attitude, Kind, Mounting, Segment};

/// Longest time at rest or in steady motion that is used before and after a segment, s.
const LEAD: f64 = 120.0;
/// Duration over which samples are averaged, s.
const BIN: f64 = 1.0;
/// Gauss-Newton iterations: from 20 % in `k` and 10 deg in the angles, the sixth step is below
/// 1e-9.
const ROUNDS: usize = 6;

pub fn estimate(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.velocity()?;
    let (segments, _, mut notes) = data.type_one(Gaps::Bridged)?;
    let stretches = stretches(data, &segments);
    let mut mounting = velocity.initial;
    let mut result = None;
    let mut previous = vec![StretchEstimate::default(); stretches.len()];
    for _ in 0..ROUNDS {
        let attitude = data.attitude_with(Some(&mounting));
        let at = Problem { data, attitude: &attitude, mounting };
        let solved = at.solve(&stretches, &previous)?;
        for (k, SmoothedStretch { velocity, gravity }) in previous.iter_mut().zip(&solved.parts) {
            let level =
                UnitQuaternion::rotation_between(gravity, &Vector3::z()).unwrap_or_default();
            *k = StretchEstimate {
                velocity: velocity.iter().map(|v| level * v).collect(),
                level: level * k.level,
            };
        }
        let d = solved.step;
        mounting = moved(&mounting, d[0], &Vector3::new(d[1], d[2], d[3]));
        if mounting.k.abs() < 0.01 {
            return Err(CalibrationError::Inconsistent(
                "the estimated scale factor is zero: check that IMU and DVL are of the same \
                 run"
                .into(),
            ));
        }
        result = Some(solved);
    }
    let Some(solved) = result else { return Err(CalibrationError::Samples("no estimate".into())) };
    let mut covariance = solved.covariance;
    let (square, freedom) = solved.residuals;
    let excess = square / freedom;
    if excess > 1.0 + 3.0 * (2.0 / freedom).sqrt() {
        covariance *= excess;
        notes.push(format!(
            "the residuals between IMU and DVL are {:.1} times as large as the scenario's noise: \
             the sigma is enlarged by this factor",
            excess.sqrt()
        ));
    }
    let determined = determined(&covariance);
    if mounting.k < 0.0 {
        notes.push(
            "the scale factor is negative: check whether the axes of the DVL are turned by more \
             than 90 deg"
                .into(),
        );
    }
    let ends = |s: &Stretch| [s.from, s.to];
    let used = [
        stretches.iter().map(|s| ends(s)[0]).fold(f64::INFINITY, f64::min),
        stretches.iter().map(|s| ends(s)[1]).fold(f64::NEG_INFINITY, f64::max),
    ];
    Ok(Estimate {
        mounting,
        covariance: Some(covariance),
        determined,
        history: solved.history,
        used,
        notes,
    })
}

/// Consecutive segments of Type I, with the calm motion before and after them.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: f64,
    to: f64,
}

fn stretches(data: &CalibrationData, segments: &[Segment]) -> Vec<Stretch> {
    let calm = |kind: Kind| matches!(kind, Kind::Static | Kind::Steady | Kind::TypeI);
    let touches = |a: f64, b: f64| (a - b).abs() < 0.5 * data.settings.bin;
    let mut out: Vec<Stretch> = Vec::new();
    for segment in segments {
        let (mut from, mut to) = (segment.from, segment.to);
        for s in data.segments.iter().rev().filter(|s| calm(s.kind)) {
            if touches(s.to, from) {
                from = s.from.max(segment.from - LEAD);
            }
        }
        for s in data.segments.iter().filter(|s| calm(s.kind)) {
            if touches(s.from, to) {
                to = s.to.min(segment.to + LEAD);
            }
        }
        match out.last_mut() {
            Some(last) if from < last.to => last.to = to,
            _ => out.push(Stretch { from, to }),
        }
    }
    out
}

struct Problem<'a> {
    data: &'a CalibrationData,
    attitude: &'a Attitude,
    mounting: Mounting,
}

struct Solved {
    step: Vector4<f64>,
    covariance: Matrix4<f64>,
    history: Vec<IntermediateEstimate>,
    /// Sum of squares of the whitened residuals, and their degrees of freedom.
    residuals: (f64, f64),
    parts: Vec<SmoothedStretch>,
}

/// Estimates of one stretch.
struct SmoothedStretch {
    /// Velocity at its bins, local axes, m/s.
    velocity: Vec<Vector3<f64>>,
    /// Parameter `c`: gravity less the accelerometer bias, in the assumed local axes, m/s^2.
    gravity: Vector3<f64>,
}

/// Estimates of one stretch from the previous iteration.
#[derive(Clone, Debug, Default)]
struct StretchEstimate {
    velocity: Vec<Vector3<f64>>,
    /// Rotation that levels the axes along `c`. The gyros drift, and only for small tilts is the
    /// effect of a changing tilt on the vertical of second order.
    level: UnitQuaternion<f64>,
}

/// Information on `k` and `δ`, and information times their values.
type Information = (Matrix4<f64>, Vector4<f64>);

/// Mean of the samples of one bin.
struct Row {
    /// Time since the beginning of the stretch, s.
    t: f64,
    /// Number of samples.
    count: f64,
    /// Velocity of the DVL, local axes, m/s.
    v: Vector3<f64>,
    /// Velocity of the IMU less that of the DVL, m/s.
    z: Vector3<f64>,
    /// Derivative of `v` by `k` and `δ`.
    h: Matrix3x4<f64>,
}

/// Bins of a stretch along one axis, whitened.
struct Axis {
    cholesky: Cholesky<f64, Dyn>,
    /// Variance of the DVL's noise in each bin.
    white: Vec<f64>,
    /// Information on velocity `u` and acceleration `c` (`d`), their coupling with `k` and `δ`
    /// (`b`), and their right-hand side (`q`).
    d: Matrix2<f64>,
    b: Matrix4x2<f64>,
    q: Vector2<f64>,
    /// Sum of squares of the residuals.
    square: f64,
}

impl Problem<'_> {
    fn solve(
        &self,
        stretches: &[Stretch],
        previous: &[StretchEstimate],
    ) -> Result<Solved, CalibrationError> {
        let initial = self.data.velocity()?.initial;
        let mut total = prior(&initial, &self.mounting);
        let (mut history, mut parts) = (Vec::new(), Vec::new());
        for (stretch, previous) in stretches.iter().zip(previous) {
            let mut rows = self.rows(stretch, &previous.level)?;
            if previous.velocity.len() == rows.len() {
                let velocity = rows.iter_mut().zip(&previous.velocity);
                velocity.for_each(|(row, v)| {
                    row.h = self.derivative(stretch.from + row.t, v, &previous.level)
                });
            }
            let (sums, axes) = self.accumulate(&rows)?;
            for (row, sum) in rows.iter().zip(&sums) {
                let whole = (total.0 + sum.0, total.1 + sum.1);
                if let Some(step) = whole.0.cholesky().map(|c| c.solve(&whole.1)) {
                    let mounting =
                        moved(&self.mounting, step[0], &Vector3::new(step[1], step[2], step[3]));
                    history.push(IntermediateEstimate { time: stretch.from + row.t, mounting });
                }
            }
            if let Some(last) = sums.last() {
                total = (total.0 + last.0, total.1 + last.1);
            }
            parts.push((rows, axes));
        }
        let cholesky = total
            .0
            .cholesky()
            .ok_or_else(|| CalibrationError::Samples("the samples are not finite".into()))?;
        let step = cholesky.solve(&total.1);
        let mut residuals = (0.0, -4.0);
        for (rows, axes) in &parts {
            residuals.0 += axes.iter().map(Axis::residual).sum::<f64>();
            residuals.1 += 3.0 * rows.len() as f64 - 6.0;
        }
        let residuals = (residuals.0, f64::max(residuals.1, 1.0));
        let parts = parts.iter().map(|(rows, axes)| smoothed(rows, axes, &step)).collect();
        Ok(Solved { step, covariance: cholesky.inverse(), history, residuals, parts })
    }

    /// Returns the derivative of the DVL's velocity in local axes by `k` and `δ`, for the velocity
    /// `v`.
    fn derivative(
        &self,
        time: f64,
        v: &Vector3<f64>,
        level: &UnitQuaternion<f64>,
    ) -> Matrix3x4<f64> {
        let c_b_n = level * self.attitude.at(time);
        let y = self.mounting.c_b_d * c_b_n.inverse_transform_vector(v) * self.mounting.k;
        c_b_n.to_rotation_matrix().matrix() * sensitivity(&self.mounting, &y)
    }

    /// Computes the bins of a stretch.
    fn rows(
        &self,
        stretch: &Stretch,
        level: &UnitQuaternion<f64>,
    ) -> Result<Vec<Row>, CalibrationError> {
        let velocity = self.data.velocity()?;
        let (imu, attitude) = (&self.data.recording.imu.samples, self.attitude);
        let earth = attitude.earth();
        let mut rows: Vec<Row> = Vec::new();
        let mut k = imu.time.partition_point(|t| *t <= stretch.from);
        // integrals up to `reached`, local axes
        let (mut force, mut coriolis, mut reached) =
            (Vector3::zeros(), Vector3::zeros(), stretch.from);
        let mut before: Option<(f64, Vector3<f64>, Vector3<f64>)> = None;
        // displacement since then, for the change of gravity
        let mut way = Vector3::zeros();
        let width = BIN.max(velocity.samples.period());
        for (time, y) in velocity.samples.samples(stretch.from, stretch.to) {
            let mut add = |k: usize, until: f64, reached: &mut f64| {
                let (s, dt) = (&imu.value[k], until - *reached);
                let back = attitude.w_nb_b[k] * (0.5 * (until + *reached) - imu.time[k]);
                let c = level * attitude.c_b_n[k] * UnitQuaternion::from_scaled_axis(back);
                force += c * s.force * dt;
                *reached = until;
            };
            while imu.time.get(k).is_some_and(|end| *end <= time) {
                add(k, imu.time[k], &mut reached);
                k += 1;
            }
            if k < imu.time.len() {
                add(k, time, &mut reached);
            }
            let c_b_n = level * attitude.at(time);
            let v_n = c_b_n * self.mounting.body(y);
            if let Some((t, _, last)) = before {
                way += (v_n + last) * (0.5 * (time - t));
            }
            let mut turn = (earth.earth_rate() * 2.0 + earth.transport_rate(&v_n)).cross(&v_n);
            turn.z -= earth.gravity_latitude * way.x * earth.inv_n - earth.gravity_height * way.z;
            if let Some((t, last, _)) = before {
                coriolis += (turn + last) * (0.5 * (time - t));
            }
            before = Some((time, turn, v_n));
            let (t, z) = (time - stretch.from, force - coriolis - v_n);
            match rows.last_mut() {
                Some(row) if (row.t / width).floor() == (t / width).floor() => {
                    let n = row.count + 1.0;
                    row.t += (t - row.t) / n;
                    row.v += (v_n - row.v) / n;
                    row.z += (z - row.z) / n;
                    row.count = n;
                }
                _ => rows.push(Row { t, count: 1.0, v: v_n, z, h: Matrix3x4::zeros() }),
            }
        }
        rows.iter_mut()
            .for_each(|row| row.h = self.derivative(stretch.from + row.t, &row.v, level));
        Ok(rows)
    }

    /// Returns the covariance of the bins' noise along one axis, (m/s)^2, and the DVL's part of its
    /// diagonal.
    ///
    /// It is the sum of these terms, for times `s <= t`; the last two, from the tilt, act on
    /// horizontal axes only:
    /// - white noise of the DVL: its variance on the diagonal;
    /// - integral of white accelerometer noise `N_a`: `N_a^2 s`;
    /// - gravity times the double integral of white gyro noise `N_g`: `(g N_g)^2 (s^3 / 3 + s^2 (t
    ///   - s) / 2)`;
    /// - gravity times the double integral of a constant rate error: `(g b)^2 (t s)^2 / 4`.
    fn noise(
        &self,
        rows: &[Row],
        horizontal: bool,
    ) -> Result<(DMatrix<f64>, Vec<f64>), CalibrationError> {
        let velocity = self.data.velocity()?;
        let imu = &self.data.recording.imu;
        let white = velocity.covariance.trace() / 3.0 / (self.mounting.k * self.mounting.k);
        let accel = imu.accel_noise.norm_squared() / 3.0;
        let g = self.attitude.earth().gravity;
        let share = if horizontal { g * g } else { 0.0 };
        let gyro = share * imu.gyro_noise.norm_squared() / 3.0;
        let rate = share * self.data.gyro_bias_sigma().norm_squared() / 3.0;
        let white: Vec<f64> = rows.iter().map(|row| white / row.count).collect();
        let noise = DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let (s, t) = (rows[i].t.min(rows[j].t), rows[i].t.max(rows[j].t));
            let own = if i == j { white[i] } else { 0.0 };
            own + accel * s
                + gyro * (s * s * s / 3.0 + s * s * (t - s) / 2.0)
                + rate * (s * t).powi(2) / 4.0
        });
        Ok((noise, white))
    }

    /// Returns the information on `k` and `δ` from the bins up to each one, with `u` and `c`
    /// eliminated (Schur complement `A - B D^-1 B'`), and the whitened axes.
    fn accumulate(&self, rows: &[Row]) -> Result<(Vec<Information>, Vec<Axis>), CalibrationError> {
        let mut sums = vec![(Matrix4::zeros(), Vector4::zeros()); rows.len()];
        let mut axes = Vec::new();
        for axis in 0..3 {
            let (noise, white) = self.noise(rows, axis < 2)?;
            let cholesky = noise.cholesky();
            let cholesky = cholesky.ok_or_else(|| {
                CalibrationError::Sensor(
                    "the noise of the DVL is zero: give [sensor.dvl] a `noise`".into(),
                )
            })?;
            // columns: k and δ, the velocity u and the acceleration c, the residual
            let mut whitened = DMatrix::from_fn(rows.len(), 7, |i, j| match j {
                0..4 => rows[i].h[(axis, j)],
                4 => -1.0,
                5 => -rows[i].t,
                _ => rows[i].z[axis],
            });
            // The leading block of a Cholesky factor is the factor of the leading block. So each
            // whitened row adds its information to that of the rows before it.
            cholesky.l_dirty().solve_lower_triangular_mut(&mut whitened);
            let (mut a, mut b, mut d) = (Matrix4::zeros(), Matrix4x2::zeros(), Matrix2::zeros());
            let (mut p, mut q) = (Vector4::zeros(), Vector2::zeros());
            for (row, sum) in whitened.row_iter().zip(&mut sums) {
                let h = Vector4::new(row[0], row[1], row[2], row[3]);
                let n = Vector2::new(row[4], row[5]);
                a += h * h.transpose();
                b += h * n.transpose();
                d += n * n.transpose();
                p += h * row[6];
                q += n * row[6];
                if let Some(inverse) = inverse(&d) {
                    sum.0 += a - b * inverse * b.transpose();
                    sum.1 += p - b * inverse * q;
                }
            }
            let square = whitened.column(6).norm_squared();
            axes.push(Axis { cholesky, white, d, b, q, square });
        }
        Ok((sums, axes))
    }
}

impl Axis {
    /// Returns the sum of squared residuals after `u` and `c` are fitted.
    fn residual(&self) -> f64 {
        self.square
            - inverse(&self.d).map_or(0.0, |inverse| (self.q.transpose() * inverse * self.q)[0])
    }
}

fn inverse(d: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    d.try_inverse().filter(|_| d.determinant() > 1e-12 * d.trace().powi(2))
}

/// Returns the velocity at the bins after a step of `k` and `δ`: the DVL's velocity less the
/// expected value of its noise, `W K^-1 r`. `r` is the difference of IMU and DVL, `K` its
/// covariance, and `W` the DVL's part of `K`.
fn smoothed(rows: &[Row], axes: &[Axis], step: &Vector4<f64>) -> SmoothedStretch {
    let mut gravity = Vector3::zeros();
    let mut out: Vec<Vector3<f64>> = rows.iter().map(|row| row.v + row.h * step).collect();
    for (axis, a) in axes.iter().enumerate() {
        let Some(inverse) = inverse(&a.d) else { continue };
        let n = inverse * (a.q - a.b.transpose() * step);
        gravity[axis] = n[1];
        let r = DVector::from_iterator(
            rows.len(),
            rows.iter().map(|row| row.z[axis] - (row.h.row(axis) * step)[0] + n[0] + n[1] * row.t),
        );
        let weighted = a.cholesky.solve(&r);
        out.iter_mut().zip(&a.white).zip(weighted.iter()).for_each(|((v, w), x)| v[axis] += w * x);
    }
    SmoothedStretch { velocity: out, gravity }
}
