//! A velocity log whose velocities are along north and east, although its columns have other names: the
//! direction of its velocity turns with the vehicle.
//!
//! Along the axes of the vehicle the direction stays where the vehicle turns; along north and east it
//! turns as the heading does, and along east and north against it.

use crate::clocks::Inertial;
use std::f64::consts::{PI, TAU};

/// Time between the rows that are compared, s, and the longest one.
const SHORTEST: f64 = 2.0;
const LONGEST: f64 = 5.0;
/// Speed, m/s, from which a velocity has a direction.
const SLOWEST: f64 = 0.3;
/// Least number of pairs, and root mean square of their turns, rad: 6 deg.
const LEAST: usize = 20;
const TURNS: f64 = 0.1;
/// Share of the turns that must remain neither as a turn of the direction nor as its lack.
const REST: f64 = 0.1;

/// Tests whether the direction of a log's velocity turns with the vehicle, or against it: rows have time
/// and velocity along three axes. `true` for an order of north and east, `false` for east and north.
pub fn turns(imu: &Inertial, down: (usize, f64), rows: &[[f64; 4]]) -> Option<bool> {
    let (mut count, mut turned, mut with, mut against, mut still) = (0, 0.0, 0.0, 0.0, 0.0);
    let mut end = 0;
    for (begin, a) in rows.iter().enumerate() {
        end = end.max(begin);
        while end < rows.len() && rows[end][0] - a[0] < SHORTEST {
            end += 1;
        }
        let Some(b) = rows.get(end).filter(|b| b[0] - a[0] <= LONGEST) else { continue };
        if a[1].hypot(a[2]) < SLOWEST || b[1].hypot(b[2]) < SLOWEST {
            continue;
        }
        let Some((from, to)) = imu.at(a[0]).zip(imu.at(b[0])) else { continue };
        let heading = down.1 * (to[down.0] - from[down.0]);
        let wrapped = |angle: f64| (angle + PI).rem_euclid(TAU) - PI;
        let direction = wrapped(b[2].atan2(b[1]) - a[2].atan2(a[1]));
        count += 1;
        turned += heading * heading;
        with += wrapped(direction - heading).powi(2);
        against += wrapped(direction + heading).powi(2);
        still += direction * direction;
    }
    let enough = count >= LEAST && turned > TURNS * TURNS * f64::from(count as u32);
    let clear = |one: f64, other: f64| one < REST * turned && one < REST * other.min(still);
    match enough {
        true if clear(with, against) => Some(true),
        true if clear(against, with) => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows of a vehicle that swims ahead and turns to and fro, along axes of the Earth or its own.
    fn found(row: impl Fn(f64) -> [f64; 2]) -> Option<bool> {
        let (mut imu, mut rows, mut heading) = (Inertial::default(), Vec::new(), 0.0_f64);
        for step in 1..12_000 {
            let t = 0.01 * f64::from(step);
            let rate = 0.1 * (0.05 * t).sin();
            heading += 0.01 * rate;
            imu.add(t, 0.01, [0.0, 0.0, rate], [0.0, 0.0, -9.81]);
            if step % 50 == 0 {
                let [x, y] = row(heading);
                rows.push([t, x, y, 0.0]);
            }
        }
        turns(&imu, (2, 1.0), &rows)
    }

    #[test]
    fn a_direction_that_turns_with_the_vehicle_is_along_the_earth() {
        assert_eq!(found(|h| [1.5 * h.cos(), 1.5 * h.sin()]), Some(true));
        assert_eq!(found(|h| [1.5 * h.sin(), 1.5 * h.cos()]), Some(false));
        assert_eq!(found(|_| [1.5, 0.1]), None);
        // sideways in part, and drifting, is along the vehicle still
        assert_eq!(found(|h| [1.5 + 0.2 * h.cos(), 0.3 * h.sin()]), None);
    }
}
