//! Tang, Wang, Li & Wu (2013): GNSS at the surface, in two iterated steps.

use crate::fixes::{Fix, blocks, pairs};
use crate::kinsey::velocities;
use crate::solve::{covariance_of_residuals, determined, moved, sensitivity, wahba};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix3, Vector3};
use navfuse_segments::{Mounting, Series};

/// Shortest displacement that determines the scale factor, in sigmas of a fix.
const WAY: f64 = 100.0;

/// Iterates two steps:
/// 1. `k` from the ratio of displacements, `|Σ C_b^n C_d^b y dt| / |Δp|`;
/// 2. `C_d^b` from the pairs `(C_n^b v_GNSS, y / k)`, Wahba's problem.
///
/// The displacement of the calibrated DVL is then compared with that of the fixes. The remaining
/// errors of its length and heading correct `k` and yaw, until both corrections are below 1e-6.
pub fn estimate(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.over_ground()?;
    let blocks = blocks(data)?;
    let (pairs, own) = pairs(data)?;
    let farthest = |b: &Vec<Fix>| {
        let way = |f: &Fix| (f.position - b[0].position).xy().norm();
        b.iter().copied().max_by(|x, y| way(x).total_cmp(&way(y))).map(|f| (b[0], f, way(&f)))
    };
    let way = blocks.iter().filter_map(farthest).max_by(|x, y| x.2.total_cmp(&y.2));
    let Some((from, to, distance)) = way.filter(|w| w.2 > WAY * w.1.sigma) else {
        return Err(CalibrationError::Motion(format!(
            "the vehicle goes at most {:.0} m from its first fix, less than {WAY} times the noise \
             of a fix: go straight for longer",
            way.map_or(0.0, |w| w.2)
        )));
    };
    let mut cross = Matrix3::zeros();
    let (mut ground, mut doppler) = (0.0, 0.0);
    let mut history = Vec::new();
    for pair in &pairs {
        cross += pair.body * pair.y.transpose();
        ground += pair.body.norm_squared();
        doppler += pair.y.norm_squared();
        if let Some(c) = wahba(&cross) {
            let k = (doppler / ground).sqrt();
            history.push(IntermediateEstimate {
                time: pair.time,
                mounting: Mounting { k, c_b_d: c.inverse() },
            });
        }
    }
    let c_d_b = wahba(&cross).ok_or_else(|| {
        CalibrationError::Motion(
            "the velocity keeps one direction in the instrument: turn or dive".into(),
        )
    })?;
    let mut mounting = Mounting { k: 1.0, c_b_d: c_d_b.inverse() };
    let fixed = (to.position - from.position).xy();
    for _ in 0..20 {
        let reckoned = reckoned(data, &velocity.samples, &mounting, [from.time, to.time]).xy();
        let ratio = reckoned.norm() / fixed.norm();
        let angle = f64::atan2(reckoned.x * fixed.y - reckoned.y * fixed.x, reckoned.dot(&fixed));
        // the sensor's own velocities give the better yaw: the displacement has a single course
        let yaw = if own { 0.0 } else { -angle };
        mounting = moved(&mounting, mounting.k * (ratio - 1.0), &Vector3::new(0.0, 0.0, yaw));
        if (ratio - 1.0).abs() < 1e-6 && yaw.abs() < 1e-6 {
            break;
        }
    }
    // earlier scales are those of the velocities; the last one is that of the displacement
    history.push(IntermediateEstimate { time: to.time.max(pairs[pairs.len() - 1].time), mounting });
    let rows: Vec<_> = pairs
        .iter()
        .map(|p| (sensitivity(&mounting, &p.y), p.body - mounting.body(&p.y)))
        .collect();
    let mut covariance = covariance_of_residuals(&rows, &velocity.initial, &mounting);
    let along = (to.sigma * std::f64::consts::SQRT_2 / distance * mounting.k).powi(2);
    (1..4).for_each(|i| {
        covariance[(0, i)] = 0.0;
        covariance[(i, 0)] = 0.0;
    });
    covariance[(0, 0)] = along;
    let used = [pairs[0].time, pairs[pairs.len() - 1].time];
    covariance += data.attitude_covariance(&mounting, used);
    let scale_note = format!(
        "scale factor from a displacement of {distance:.0} m; sigma of the angles from the \
         residuals"
    );
    let notes = vec![data.attitude_source(), velocities(own), scale_note];
    Ok(Estimate {
        mounting,
        determined: determined(&covariance),
        covariance: Some(covariance),
        history,
        used,
        notes,
    })
}

/// Returns the displacement of the DVL, north, east, down, m.
fn reckoned(
    data: &CalibrationData,
    y: &Series<Vector3<f64>>,
    m: &Mounting,
    [from, to]: [f64; 2],
) -> Vector3<f64> {
    let velocity =
        |t: f64| y.at(t).map_or_else(Vector3::zeros, |y| data.attitude.at(t) * m.body(&y));
    let inner = y.samples(from, to).map(|s| s.0).filter(|t| *t > from && *t < to);
    let (mut sum, mut before) = (Vector3::zeros(), (from, velocity(from)));
    for t in inner.chain([to]) {
        let v = velocity(t);
        sum += (v + before.1) * (0.5 * (t - before.0));
        before = (t, v);
    }
    sum
}
