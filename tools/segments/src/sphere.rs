//! The accelerometer bias from turns: eq. (13) and Lemma 2.

use crate::finder::{eigen, slope};
use crate::{Attitude, BodyVelocity, Mounting, Recording, Segment};
use nalgebra::{Matrix3, Vector3};

/// Points `α` on segments of Type II, with `v^b = C_d^b y / k`:
///
/// ```text
/// α = (w_ib^b - b_g) x v^b + vdot^b - f^b
/// ```
/// They lie on a sphere of radius `g` about `-b_a`. (Pan & Wu print `ydot` instead of `y` in the
/// cross product; eq. 9 has `y`.)
///
/// The angular rate in this formula should be the rate relative to the local axes plus twice the
/// Earth's rate (Coriolis). This implementation uses that rate; the difference is 7e-5 rad/s times
/// the speed.
#[derive(Clone, Debug, PartialEq)]
pub struct Sphere {
    /// Times, s.
    pub time: Vec<f64>,
    /// Points `α` at these times, body axes, m/s^2.
    pub alpha: Vec<Vector3<f64>>,
    /// Root-mean-square distances from the mean along the principal axes, m/s^2, the largest first.
    /// The smallest is the margin to coplanar points, which Lemma 2 excludes.
    pub singular_values: Vector3<f64>,
    /// Principal axes in body axes, as columns.
    pub axes: Matrix3<f64>,
    /// Ratio of the largest to the smallest singular value of `Σ (α - mean)(α - mean)'`.
    pub condition: f64,
    /// Ratio of the largest to the smallest singular value of `Σ α α'`, as in the paper; gravity
    /// dominates it.
    pub condition_about_zero: f64,
}

impl Sphere {
    /// Computes the points of segments with a known mounting, in consecutive windows of `window` s;
    /// a window needs at least three samples of the velocity.
    pub fn of<'a>(
        recording: &Recording,
        velocity: &BodyVelocity,
        mounting: &Mounting,
        attitude: &Attitude,
        segments: impl IntoIterator<Item = &'a Segment>,
        window: f64,
    ) -> Self {
        let (mut time, mut alpha) = (Vec::new(), Vec::new());
        let earth = attitude.earth().earth_rate();
        for segment in segments {
            let mut from = segment.from;
            while from + window <= segment.to + 1e-9 {
                let to = from + window;
                if let Some(a) = point(recording, velocity, mounting, attitude, &earth, [from, to])
                {
                    time.push(0.5 * (from + to));
                    alpha.push(a);
                }
                from = to;
            }
        }
        let n = alpha.len().max(1) as f64;
        let mean = alpha.iter().sum::<Vector3<f64>>() / n;
        let scatter = |about: Vector3<f64>| {
            alpha.iter().map(|a| (a - about) * (a - about).transpose()).sum::<Matrix3<f64>>() / n
        };
        let (values, axes) = eigen(scatter(mean));
        let (about_zero, _) = eigen(scatter(Vector3::zeros()));
        let condition = |v: &Vector3<f64>| if v[2] > 0.0 { v[0] / v[2] } else { f64::INFINITY };
        Self {
            time,
            alpha,
            singular_values: values.map(|v| v.max(0.0).sqrt()),
            axes,
            condition: condition(&values),
            condition_about_zero: condition(&about_zero),
        }
    }

    /// Returns the accelerometer bias, m/s^2, for gravity of magnitude `g`.
    ///
    /// The difference of `|α + b|^2 = g^2` and its mean over the points, `2 (α - mean)' b = mean
    /// |α|^2 - |α|^2`, is linear in `b` and free of `g`. Least squares solves it along the axes
    /// with a singular value above `margin`; the radius `g` determines the rest. `None` for fewer
    /// than four points.
    pub fn bias(&self, g: f64, margin: f64) -> Option<Vector3<f64>> {
        if self.alpha.len() < 4 {
            return None;
        }
        let n = self.alpha.len() as f64;
        let mean = self.alpha.iter().sum::<Vector3<f64>>() / n;
        let square = self.alpha.iter().map(Vector3::norm_squared).sum::<f64>() / n;
        let right: Vector3<f64> = self
            .alpha
            .iter()
            .map(|a| (a - mean) * (square - a.norm_squared()))
            .sum::<Vector3<f64>>()
            / (2.0 * n);
        let mut bias = Vector3::zeros();
        for k in (0..3).filter(|k| self.singular_values[*k] > margin) {
            let axis = self.axes.column(k);
            bias += axis * (axis.dot(&right) / self.singular_values[k].powi(2));
        }
        // nearly coplanar points: |α + b| = g determines b along their mean
        let left = (0..3).any(|k| self.singular_values[k] <= margin);
        if left {
            let along = (mean + bias).normalize();
            let radius = self.alpha.iter().map(|a| (a + bias).norm()).sum::<f64>() / n;
            bias += along * (g - radius);
        }
        Some(bias)
    }
}

fn point(
    recording: &Recording,
    velocity: &BodyVelocity,
    mounting: &Mounting,
    attitude: &Attitude,
    earth: &Vector3<f64>,
    [from, to]: [f64; 2],
) -> Option<Vector3<f64>> {
    let samples = velocity.samples.within(from, to);
    if samples.len() < 3 {
        return None;
    }
    let (mean, _) = velocity.samples.mean(from, to)?;
    let ydot = slope(
        velocity.samples.samples(from, to).map(|(t, y)| (t, *y)).collect::<Vec<_>>().into_iter(),
    );
    let inside = recording.imu.samples.within(from, to);
    let n = inside.len();
    if n == 0 {
        return None;
    }
    let rate = attitude.w_nb_b[inside.clone()].iter().sum::<Vector3<f64>>() / n as f64;
    let force = recording.imu.samples.value[inside].iter().map(|s| s.force).sum::<Vector3<f64>>()
        / n as f64;
    let w_ie_b = attitude.at(0.5 * (from + to)).inverse_transform_vector(earth);
    Some((rate + w_ie_b * 2.0).cross(&mounting.body(&mean)) + mounting.body(&ydot) - force)
}
