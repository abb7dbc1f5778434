//! Errors of a sensor that look like an offset of its clock, each with its usual size.

use super::inertial::{Inertial, cross};
use super::measured::Measured;

/// Largest number of these errors.
pub const OTHERS: usize = 5;
/// Lever arm, m: of a velocity log from the IMU, and of an antenna from the point about which the vehicle turns.
const LEVER_ARM: f64 = 3.0;
/// Yaw of the mounting of a velocity log, rad, and its scale.
const MOUNTING: f64 = 0.03;
const SCALE: f64 = 0.01;
/// Deviation of a compass by hard iron, rad.
const DEVIATION: f64 = 0.05;
/// Mean square of the times, s^2, over which a receiver or a line through positions averages a velocity: the line
/// over `2 T` has `T^2 / 5`, the mean of three has `2 T^2 / 3`.
const AVERAGED: f64 = 0.3;
/// Slip of tyres, rad for each m/s^2 across the vehicle: the cornering compliance of cars is 3 to 6 deg per g (Milliken,
/// Race Car Vehicle Dynamics).
const SLIP: f64 = 0.006;
/// Half of the time, s, over which a rate is a difference of angles, and over which it changes.
const HALF: f64 = 0.25;
/// Longest time, s, over which two velocities show an acceleration.
const SHORT: f64 = 5.0;

/// The angular rate about the axes of the body, and about the vertical.
fn rate(imu: &Inertial, time: f64) -> [f64; 4] {
    let ends = imu.at(time - HALF).zip(imu.at(time + HALF));
    ends.map_or([0.0; 4], |(a, b)| [0, 1, 2, 6].map(|k| (b[k] - a[k]) / (2.0 * HALF)))
}

impl Measured {
    /// The same samples with one error each, on a clock behind by `tau`.
    pub(super) fn others(&self, imu: &Inertial, tau: f64) -> Vec<Self> {
        match self {
            Self::Velocity(rows) => of_log(rows, imu, tau),
            Self::Heading(rows) => {
                let with = |of: fn(f64) -> f64| {
                    rows.iter().map(|[t, psi]| [*t, psi + DEVIATION * of(*psi)]).collect()
                };
                [f64::sin, f64::cos].map(|of| Self::Heading(with(of))).to_vec()
            }
            Self::Ground(rows) => of_course(rows, imu, tau),
        }
    }
}

/// A velocity log with a lever arm along each axis, a mounting and a scale.
fn of_log(rows: &[[f64; 4]], imu: &Inertial, tau: f64) -> Vec<Measured> {
    let with = |error: &dyn Fn(&[f64; 4]) -> [f64; 3]| {
        let moved = rows.iter().map(|row| {
            let [x, y, z] = error(row);
            [row[0], row[1] + x, row[2] + y, row[3] + z]
        });
        Measured::Velocity(moved.collect())
    };
    let lever_arm = |k: usize| {
        let mut arm = [0.0; 3];
        arm[k] = LEVER_ARM;
        with(&move |row| {
            let [x, y, z, _] = rate(imu, row[0] - tau);
            cross([x, y, z], arm)
        })
    };
    let mounting = with(&|row| [-MOUNTING * row[2], MOUNTING * row[1], 0.0]);
    let scale = with(&|row| [1, 2, 3].map(|k| SCALE * row[k]));
    vec![lever_arm(0), lever_arm(1), lever_arm(2), mounting, scale]
}

/// A course with a lever arm, one of averaged velocities, and one with the slip of tyres. The mean of `v exp(i psi)` over times with the mean square
/// `m` has the angle `m (psi' v' / v + psi'' / 2)` beside the one at the middle.
fn of_course(rows: &[[f64; 3]], imu: &Inertial, tau: f64) -> Vec<Measured> {
    let turned = |angle: &dyn Fn(usize, &[f64; 3]) -> f64| {
        let moved = rows.iter().enumerate().map(|(k, row)| {
            let angle = angle(k, row);
            [row[0], row[1] - angle * row[2], row[2] + angle * row[1]]
        });
        Measured::Ground(moved.collect())
    };
    let speed = |row: &[f64; 3]| row[1].hypot(row[2]);
    let turn = |time: f64| rate(imu, time - tau)[3];
    let acceleration = |k: usize| {
        let beside = rows.get(k.saturating_sub(1)).zip(rows.get(k + 1));
        let near = beside.filter(|(a, b)| b[0] - a[0] < SHORT);
        near.map_or(0.0, |(a, b)| (speed(b) - speed(a)) / (b[0] - a[0]))
    };
    let lever_arm = turned(&|_, row| LEVER_ARM * turn(row[0]) / speed(row));
    let averaged = turned(&|k, row| {
        let changes = (turn(row[0] + HALF) - turn(row[0] - HALF)) / (2.0 * HALF);
        AVERAGED * (turn(row[0]) * acceleration(k) / speed(row) + 0.5 * changes)
    });
    let slip = turned(&|_, row| SLIP * turn(row[0]) * speed(row));
    vec![lever_arm, averaged, slip]
}
