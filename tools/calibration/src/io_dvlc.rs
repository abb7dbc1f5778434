//! IO-DVLC of Pan & Wu (2016), improved.
//!
//! On a stretch of samples without a turn, in local axes,
//!
//! ```text
//! C_b^n(t) C_d^b y / k = u + c t + ∫ C_b^n f^b dτ - ∫ (2 w_ie^n + w_en^n) x v^n dτ + noise
//! ```
//! is (9) integrated once, so that the terms that eq. (10) drops are there: the Earth's rate, what the attitude does change, and
//! (not written) gravity's change with height and latitude. `u` is the velocity at the beginning and `c` gravity less the accelerometer bias and the tilt's error: both are
//! estimated with `k` and `C_d^b` from all samples of the stretch, those at rest or in steady motion before and after it too,
//! where the paper takes single samples as anchors. The noise is that of the DVL, the integral of the accelerometers' and
//! the double integral of the gyros' times gravity; the estimate is the least-squares one of its covariance.

use crate::data::Gaps;
use crate::solve::{determined, moved, prior, sensitivity};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{
    Cholesky, DMatrix, DVector, Dyn, Matrix2, Matrix3x4, Matrix4, Matrix4x2, UnitQuaternion,
    Vector2, Vector3, Vector4,
};
use navfuse_segments::{Attitude, Kind, Mounting, Segment};

/// The longest lead of rest or steady motion that is used before and after a segment, s.
const LEAD: f64 = 120.0;
/// Samples are averaged over so long, s.
const BIN: f64 = 1.0;
/// Gauss-Newton steps: from `k` 20 % and angles 10 deg off the sixth is below 1e-9.
const ROUNDS: usize = 6;

pub fn estimate(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.velocity()?;
    let (segments, _, mut notes) = data.type_one(Gaps::Bridged)?;
    let stretches = stretches(data, &segments);
    let mut mounting = velocity.initial;
    let mut result = None;
    let mut known = vec![Known::default(); stretches.len()];
    for _ in 0..ROUNDS {
        let attitude = data.attitude_with(Some(&mounting));
        let at = Problem { data, attitude: &attitude, mounting };
        let solved = at.solve(&stretches, &known)?;
        for (k, Part { velocity, gravity }) in known.iter_mut().zip(&solved.parts) {
            let level =
                UnitQuaternion::rotation_between(gravity, &Vector3::z()).unwrap_or_default();
            *k = Known {
                velocity: velocity.iter().map(|v| level * v).collect(),
                level: level * k.level,
            };
        }
        let d = solved.step;
        mounting = moved(&mounting, d[0], &Vector3::new(d[1], d[2], d[3]));
        if mounting.k.abs() < 0.01 {
            return Err(CalibrationError::new(
                "the scale factor comes out as zero: do IMU and DVL belong together?",
            ));
        }
        result = Some(solved);
    }
    let Some(solved) = result else { return Err(CalibrationError::new("no estimate")) };
    let mut covariance = solved.covariance;
    let (square, freedom) = solved.residuals;
    let excess = square / freedom;
    if excess > 1.0 + 3.0 * (2.0 / freedom).sqrt() {
        covariance *= excess;
        notes.push(format!(
            "what IMU and DVL differ by is {:.1} times as large as their noise in the scenario: sigma is made larger by that",
            excess.sqrt()
        ));
    }
    let determined = determined(&covariance);
    if mounting.k < 0.0 {
        notes.push(
            "the scale factor is negative: are the axes of the DVL turned by more than 90 deg?"
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

/// Segments of Type I that follow each other, with their leads.
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
    /// Sum of the squares of the white residuals, and their degrees of freedom.
    residuals: (f64, f64),
    parts: Vec<Part>,
}

/// What is found of one stretch.
struct Part {
    /// The velocity at its bins, local axes, m/s.
    velocity: Vec<Vector3<f64>>,
    /// Gravity less the accelerometers' bias in the axes that were taken as local, m/s^2: `c`.
    gravity: Vector3<f64>,
}

/// What the round before found of one stretch.
#[derive(Clone, Debug, Default)]
struct Known {
    velocity: Vec<Vector3<f64>>,
    /// Makes the axes level: gyros drift, and a tilt that changes is of second order to the vertical only where it is small.
    level: UnitQuaternion<f64>,
}

/// Information on `k` and `δ`, and its product with their values.
type Information = (Matrix4<f64>, Vector4<f64>);

/// One bin: the mean of its samples.
struct Row {
    /// Since the beginning of the stretch, s.
    t: f64,
    /// Samples in it.
    count: f64,
    /// The velocity by the DVL, local axes, m/s.
    v: Vector3<f64>,
    /// What the velocity by the IMU exceeds it.
    z: Vector3<f64>,
    /// Its derivative by `k` and `δ`.
    h: Matrix3x4<f64>,
}

/// The bins of a stretch along one axis, made white.
struct Axis {
    cholesky: Cholesky<f64, Dyn>,
    /// Variance of the DVL's noise in each bin.
    white: Vec<f64>,
    /// Information on velocity `u` and acceleration `c`, how they go with `k` and `δ`, and their right side.
    d: Matrix2<f64>,
    b: Matrix4x2<f64>,
    q: Vector2<f64>,
    /// Sum of the squares of the residuals.
    square: f64,
}

impl Problem<'_> {
    fn solve(&self, stretches: &[Stretch], known: &[Known]) -> Result<Solved, CalibrationError> {
        let initial = self.data.velocity()?.initial;
        let mut total = prior(&initial, &self.mounting);
        let (mut history, mut parts) = (Vec::new(), Vec::new());
        for (stretch, known) in stretches.iter().zip(known) {
            let mut rows = self.rows(stretch, &known.level)?;
            if known.velocity.len() == rows.len() {
                let velocity = rows.iter_mut().zip(&known.velocity);
                velocity.for_each(|(row, v)| {
                    row.h = self.derivative(stretch.from + row.t, v, &known.level)
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
            .ok_or_else(|| CalibrationError::new("the samples are not finite"))?;
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

    /// The derivative of the velocity by the DVL, local axes, by `k` and `δ`, where the velocity is `v`.
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

    /// The bins of a stretch.
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
        // the way since then, for gravity's change
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

    /// The covariance of the bins' noise along one axis, (m/s)^2, and the DVL's part of its diagonal; a horizontal axis has the
    /// tilt's too.
    ///
    /// White noise of the DVL; the integral of white noise `N_a`, `min(t, s)`; gravity times the double integral of `N_g`,
    /// `s^3 / 3 + s^2 (t - s) / 2` for `s < t`; gravity times a constant rate, `(t s)^2 / 4`.
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

    /// The information on `k` and `δ` of the bins up to each, once `u` and `c` are taken out; and the axes.
    fn accumulate(&self, rows: &[Row]) -> Result<(Vec<Information>, Vec<Axis>), CalibrationError> {
        let mut sums = vec![(Matrix4::zeros(), Vector4::zeros()); rows.len()];
        let mut axes = Vec::new();
        for axis in 0..3 {
            let (noise, white) = self.noise(rows, axis < 2)?;
            let cholesky = noise.cholesky();
            let cholesky = cholesky.ok_or_else(|| {
                CalibrationError::new("the noise of the DVL is zero: give [sensor.dvl] a `noise`")
            })?;
            // columns: k and δ, the velocity u and the acceleration c, the residual
            let mut whitened = DMatrix::from_fn(rows.len(), 7, |i, j| match j {
                0..4 => rows[i].h[(axis, j)],
                4 => -1.0,
                5 => -rows[i].t,
                _ => rows[i].z[axis],
            });
            // the leading block of the factor is the factor of the leading block: so each row adds to those before it
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
    /// The sum of the squares of what `u` and `c` leave.
    fn residual(&self) -> f64 {
        self.square
            - inverse(&self.d).map_or(0.0, |inverse| (self.q.transpose() * inverse * self.q)[0])
    }
}

fn inverse(d: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    d.try_inverse().filter(|_| d.determinant() > 1e-12 * d.trace().powi(2))
}

/// The velocity at the bins after a step of `k` and `δ`: that of the DVL less what its noise is expected to be, `W K^-1 r`, where
/// `r` is what IMU and DVL differ by, `K` its covariance and `W` the DVL's part.
fn smoothed(rows: &[Row], axes: &[Axis], step: &Vector4<f64>) -> Part {
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
    Part { velocity: out, gravity }
}
