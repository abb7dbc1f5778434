//! IO-DVLC of Pan & Wu (2016), improved.
//!
//! On a stretch of samples without a turn, in local axes,
//!
//! ```text
//! C_b^n(t) C_d^b y / k = u + c t + ∫ C_b^n f^b dτ - ∫ (2 w_ie^n + w_en^n) x v^n dτ + noise
//! ```
//! is (9) integrated once, so that the terms that eq. (10) drops are there: the Earth's rate, and what the attitude does
//! change. `u` is the velocity at the beginning and `c` gravity less the accelerometer bias and the tilt's error: both are
//! estimated with `k` and `C_d^b` from all samples of the stretch, those at rest or in steady motion before and after it too,
//! where the paper takes single samples as anchors. The noise is that of the DVL, the integral of the accelerometers' and
//! the double integral of the gyros' times gravity; the estimate is the least-squares one of its covariance.

use crate::data::Gaps;
use crate::solve::{determined, moved, prior, sensitivity};
use crate::{Data, Estimate, Need, Step};
use nalgebra::{DMatrix, Matrix2, Matrix3x4, Matrix4, Matrix4x2, Vector2, Vector3, Vector4};
use navfuse_segments::{Attitude, Kind, Mounting, Segment};

/// The longest lead of rest or steady motion that is used before and after a segment, s.
const LEAD: f64 = 120.0;
/// Samples are averaged over so long, s.
const BIN: f64 = 1.0;
/// Gauss-Newton steps; the equation is linear in `C_d^b / k`, so that the third is below rounding.
const ROUNDS: usize = 4;

pub fn estimate(data: &Data) -> Result<Estimate, Need> {
    let velocity = data.velocity()?;
    let (segments, _, mut notes) = data.type_one(Gaps::Bridged)?;
    let stretches = stretches(data, &segments);
    let mut mounting = velocity.initial;
    let mut result = None;
    for _ in 0..ROUNDS {
        let attitude = data.attitude_with(Some(&mounting));
        let at = Problem { data, attitude: &attitude, mounting };
        let solved = at.solve(&stretches)?;
        let d = solved.step;
        mounting = moved(&mounting, d[0], &Vector3::new(d[1], d[2], d[3]));
        if mounting.k.abs() < 0.01 {
            return Err(Need::new("the scale factor comes out as zero: do IMU and DVL belong together?"));
        }
        result = Some(solved);
    }
    let Some(solved) = result else { return Err(Need::new("no estimate")) };
    let determined = determined(&solved.covariance);
    if mounting.k < 0.0 {
        notes.push("the scale factor is negative: are the axes of the DVL turned by more than 90 deg?".into());
    }
    let ends = |s: &Stretch| [s.from, s.to];
    let used = [
        stretches.iter().map(|s| ends(s)[0]).fold(f64::INFINITY, f64::min),
        stretches.iter().map(|s| ends(s)[1]).fold(f64::NEG_INFINITY, f64::max),
    ];
    Ok(Estimate { mounting, covariance: Some(solved.covariance), determined, history: solved.history, used, notes })
}

/// Segments of Type I that follow each other, with their leads.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    from: f64,
    to: f64,
}

fn stretches(data: &Data, segments: &[Segment]) -> Vec<Stretch> {
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
    data: &'a Data,
    attitude: &'a Attitude,
    mounting: Mounting,
}

struct Solved {
    step: Vector4<f64>,
    covariance: Matrix4<f64>,
    history: Vec<Step>,
}

/// Information on `k` and `δ`, and its product with their values.
type Information = (Matrix4<f64>, Vector4<f64>);

/// One bin: the mean of its samples.
struct Row {
    /// Since the beginning of the stretch, s.
    t: f64,
    /// Samples in it.
    count: f64,
    /// The derivative of the velocity in local axes by `k` and `δ`.
    h: Matrix3x4<f64>,
    /// What the velocity by the IMU exceeds that by the DVL, local axes, m/s.
    z: Vector3<f64>,
}

impl Problem<'_> {
    fn solve(&self, stretches: &[Stretch]) -> Result<Solved, Need> {
        let velocity = self.data.velocity()?;
        let (information, right) = prior(&velocity.initial, &self.mounting);
        let mut total = (information, right);
        let mut history = Vec::new();
        for stretch in stretches {
            let rows = self.rows(stretch)?;
            if rows.len() < 3 {
                continue;
            }
            let mut last = (Matrix4::zeros(), Vector4::zeros());
            for (row, sum) in rows.iter().zip(self.accumulate(&rows)?) {
                last = sum;
                let whole = (total.0 + last.0, total.1 + last.1);
                if let Some(step) = whole.0.cholesky().map(|c| c.solve(&whole.1)) {
                    let mounting = moved(&self.mounting, step[0], &Vector3::new(step[1], step[2], step[3]));
                    history.push(Step { time: stretch.from + row.t, mounting });
                }
            }
            total = (total.0 + last.0, total.1 + last.1);
        }
        let cholesky = total.0.cholesky().ok_or_else(|| Need::new("the samples are not finite"))?;
        Ok(Solved { step: cholesky.solve(&total.1), covariance: cholesky.inverse(), history })
    }

    /// The bins of a stretch.
    fn rows(&self, stretch: &Stretch) -> Result<Vec<Row>, Need> {
        let velocity = self.data.velocity()?;
        let (imu, attitude) = (&self.data.recording.imu.samples, self.attitude);
        let earth = attitude.earth();
        let mut rows: Vec<Row> = Vec::new();
        let mut k = imu.time.partition_point(|t| *t <= stretch.from);
        // integrals up to `reached`, local axes
        let (mut force, mut coriolis, mut reached) = (Vector3::zeros(), Vector3::zeros(), stretch.from);
        let mut before: Option<(f64, Vector3<f64>)> = None;
        let width = BIN.max(velocity.samples.period());
        for (time, y) in velocity.samples.samples(stretch.from, stretch.to) {
            let mut add = |k: usize, until: f64, reached: &mut f64| {
                let (s, dt) = (&imu.value[k], until - *reached);
                let back = attitude.w_nb_b[k] * (0.5 * (until + *reached) - imu.time[k]);
                let c = attitude.c_b_n[k] * nalgebra::UnitQuaternion::from_scaled_axis(back);
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
            let c_b_n = attitude.at(time);
            let v_n = c_b_n * self.mounting.body(y);
            let turn = (earth.earth_rate() * 2.0 + earth.transport_rate(&v_n)).cross(&v_n);
            if let Some((t, last)) = before {
                coriolis += (turn + last) * (0.5 * (time - t));
            }
            before = Some((time, turn));
            let h = c_b_n.to_rotation_matrix().matrix() * sensitivity(&self.mounting, y);
            let (t, z) = (time - stretch.from, force - coriolis - v_n);
            match rows.last_mut() {
                Some(row) if (row.t / width).floor() == (t / width).floor() => {
                    let n = row.count + 1.0;
                    row.t += (t - row.t) / n;
                    row.h += (h - row.h) / n;
                    row.z += (z - row.z) / n;
                    row.count = n;
                }
                _ => rows.push(Row { t, count: 1.0, h, z }),
            }
        }
        Ok(rows)
    }

    /// The covariance of the bins' noise along one axis, (m/s)^2; a horizontal axis has the tilt's too.
    ///
    /// White noise of the DVL; the integral of white noise `N_a`, `min(t, s)`; gravity times the double integral of `N_g`,
    /// `s^3 / 3 + s^2 (t - s) / 2` for `s < t`; gravity times a constant rate, `(t s)^2 / 4`.
    fn noise(&self, rows: &[Row], horizontal: bool) -> Result<DMatrix<f64>, Need> {
        let velocity = self.data.velocity()?;
        let imu = &self.data.recording.imu;
        let white = velocity.covariance.trace() / 3.0 / (self.mounting.k * self.mounting.k);
        let accel = imu.accel_noise.norm_squared() / 3.0;
        let g = self.attitude.earth().gravity;
        let share = if horizontal { g * g } else { 0.0 };
        let gyro = share * imu.gyro_noise.norm_squared() / 3.0;
        let rate = share * self.data.gyro_bias_sigma().norm_squared() / 3.0;
        Ok(DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
            let (s, t) = (rows[i].t.min(rows[j].t), rows[i].t.max(rows[j].t));
            let own = if i == j { white / rows[i].count } else { 0.0 };
            own + accel * s + gyro * (s * s * s / 3.0 + s * s * (t - s) / 2.0) + rate * (s * t).powi(2) / 4.0
        }))
    }

    /// The information on `k` and `δ` of the bins up to each, once `u` and `c` are taken out.
    fn accumulate(&self, rows: &[Row]) -> Result<Vec<Information>, Need> {
        let mut sums = vec![(Matrix4::zeros(), Vector4::zeros()); rows.len()];
        for axis in 0..3 {
            let cholesky = self.noise(rows, axis < 2)?.cholesky();
            let cholesky =
                cholesky.ok_or_else(|| Need::new("the noise of the DVL is zero: give [sensor.dvl] a `noise`"))?;
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
                if let Some(inverse) = d.try_inverse().filter(|_| d.determinant() > 1e-12 * d.trace().powi(2)) {
                    sum.0 += a - b * inverse * b.transpose();
                    sum.1 += p - b * inverse * q;
                }
            }
        }
        Ok(sums)
    }
}
