//! The third velocity of a log against the rate of a depth.

use crate::axes;
use crate::clocks::Inertial;
use navfuse_core::nalgebra::{Matrix3, Vector3};
use std::ops::RangeInclusive;

/// Number of pairs of samples, and of deviations of the third velocity's share in the rate, from which a log sinks or
/// rises as the depth does, and the sizes of the share that are one of a velocity.
const LEAST: usize = 15;
const EVIDENT: f64 = 4.0;
const SHARE: RangeInclusive<f64> = 0.3..=3.0;

/// The share of the third velocity of a log in the rate of a depth, whose rows have time and depth: below zero for a
/// log whose third axis points up; `None` where it may be chance.
///
/// With `d` down in the axes of the IMU, a log that is turned by any angle about the vertical sinks by
/// `a (d_x v_x + d_y v_y) + b (d_x v_y - d_y v_x) + c d_z v_z`, of which least squares give `c`: a vehicle that
/// dives by its pitch has the rate in its forward velocity.
pub fn sinks(log: &[[f64; 4]], depth: &[[f64; 2]], imu: &Inertial) -> Option<f64> {
    let (mut count, mut normal, mut right, mut square) =
        (0, Matrix3::zeros(), Vector3::zeros(), 0.0);
    for [a, b] in axes::pairs(depth) {
        let from = log.partition_point(|row| row[0] < a[0]);
        let to = log.partition_point(|row| row[0] <= b[0]);
        let rows = log.get(from..to).unwrap_or_default().iter();
        let parts = rows.filter_map(|[t, x, y, z]| {
            let [forward, across, down] = imu.down_at(*t)?;
            Some(Vector3::new(forward * x + across * y, forward * y - across * x, down * z))
        });
        let (sum, rows) = parts.fold((Vector3::zeros(), 0.0), |(sum, n), v| (sum + v, n + 1.0));
        if rows == 0.0 {
            continue;
        }
        let (mean, rate) = (sum / rows, (b[1] - a[1]) / (b[0] - a[0]));
        count += 1;
        normal += mean * mean.transpose();
        right += mean * rate;
        square += rate * rate;
    }
    // a vehicle that keeps its level has no share of its horizontal velocities
    let least = normal.trace() * 1e-9;
    let inverse = (normal + Matrix3::identity() * least).try_inverse()?;
    let shares = inverse * right;
    let rest = (square - shares.dot(&right)).max(0.0) / count.max(LEAST) as f64;
    let sigma = (rest * inverse[(2, 2)]).sqrt();
    let fits = count >= LEAST && SHARE.contains(&shares[2].abs());
    (fits && shares[2].abs() > EVIDENT * sigma).then_some(shares[2])
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::sinks;
    use crate::clocks::Inertial;

    /// A vehicle of 1.5 m/s that pitches by 0.1 rad, and sinks by 0.05 m/s beside it.
    #[test]
    fn a_log_whose_third_axis_points_up_sinks_against_the_depth_of_a_vehicle_that_pitches() {
        let pitch = |t: f64| 0.1 * (0.3 * t).sin();
        let down = |t: f64| 0.05 * (0.1 * t).sin();
        let mut imu = Inertial::default();
        let mut depth = vec![[0.0, 20.0]];
        for k in 1..=10_000_i32 {
            let t = 0.02 * f64::from(k);
            let p = pitch(t);
            imu.add(
                t,
                0.02,
                [0.0, 0.03 * (0.3 * t).cos(), 0.0],
                [9.8 * p.sin(), 0.0, -9.8 * p.cos()],
            );
            let rate = -p.sin() * 1.5 + p.cos() * down(t);
            let [_, before] = depth[depth.len() - 1];
            depth.push([t, before + 0.02 * rate]);
        }
        let log = |turn: f64, sign: f64| -> Vec<[f64; 4]> {
            let row = |k| 0.2 * f64::from(k);
            let (s, c) = turn.sin_cos();
            (0..990).map(|k| [row(k), 1.5 * c, 1.5 * s, sign * down(row(k))]).collect()
        };
        for turn in [0.0, 1.2, 3.1] {
            let found = [1.0, -1.0].map(|sign| sinks(&log(turn, sign), &depth, &imu).unwrap());
            // the pairs are 2 s long, and the levelling by the force lags: a tenth
            assert!((found[0] - 1.0).abs() < 0.1 && (found[1] + 1.0).abs() < 0.1, "{found:?}");
        }
        assert_eq!(sinks(&log(0.0, 1.0), &depth[..500], &imu), None);
    }
}
