//! A position in columns without headings: by its range, and by the speed of its changes, which attitudes
//! and quaternions exceed by far.

use super::units::median;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Metres of a radian of latitude, and of a degree.
pub(super) const RADIAN: f64 = 6.371e6;
const DEGREE: f64 = RADIAN * PI / 180.0;
/// Speed, m/s, that no vehicle exceeds for half of a recording.
const FASTEST: f64 = 350.0;
/// Size of an angle against its usual change.
const STEADY: f64 = 1e3;
/// Distance, m, from latitude and longitude zero.
const NOWHERE: f64 = 1e5;
/// Least number of rows with a position.
const LEAST: usize = 3;
/// Largest height, m.
const HIGHEST: f64 = 2e4;
/// The channels of a position in the order of the columns.
const LATITUDE_FIRST: [&str; 3] = ["lat", "lon", "height"];
const LONGITUDE_FIRST: [&str; 3] = ["lon", "lat", "height"];

/// Median of the speed of a column between the rows in which it changes, in its unit; zero for one that
/// never does.
fn speed(seconds: &[f64], values: &[f64]) -> f64 {
    let mut before = seconds.first().copied().zip(values.first().copied());
    let mut speeds = Vec::new();
    for (t, v) in seconds.iter().zip(values) {
        let Some((from, old)) = before.filter(|(_, old)| old != v) else { continue };
        if t > &from {
            speeds.push((v - old).abs() / (t - from));
        }
        before = Some((*t, *v));
    }
    if speeds.is_empty() { 0.0 } else { median(speeds) }
}

fn within(values: &[f64], most: f64) -> bool {
    values.iter().all(|v| v.abs() <= most)
}

/// Largest distance of the norm of four columns from that of a quaternion; `None` where it is none.
fn distance(columns: &[Vec<f64>], first: usize) -> Option<f64> {
    let four = columns.get(first..first + 4)?;
    // a column of words has no number
    let worst = |a: f64, b: f64| if b.is_nan() { f64::INFINITY } else { a.max(b) };
    let norm = |row: usize| four.iter().map(|c| c[row] * c[row]).sum::<f64>();
    let largest = (0..four[0].len()).map(|row| (norm(row) - 1.0).abs()).fold(0.0, worst);
    (largest < 0.01).then_some(largest)
}

/// Tests whether four columns with the first one are a quaternion: of those that share columns, as beside small rates, the
/// nearest to a norm of one.
fn is_quaternion(columns: &[Vec<f64>], first: usize) -> bool {
    let Some(own) = distance(columns, first) else { return false };
    let others = (first.saturating_sub(3)..first + 4).filter(|k| *k != first);
    others.filter_map(|k| distance(columns, k)).all(|other| own <= other)
}

/// Tests whether a column is one of four that are a quaternion.
pub fn in_quaternion(columns: &[Vec<f64>], first: usize) -> bool {
    (0..4).any(|k| first.checked_sub(k).is_some_and(|k| is_quaternion(columns, k)))
}

/// The channels of three columns that are latitude, longitude and height, in their order.
pub fn order(seconds: &[f64], columns: &[Vec<f64>], first: usize) -> Option<[&'static str; 3]> {
    // rows of another sensor have no position
    let whole = |row: &usize| (first..first + 3).all(|k| columns[k][*row].is_finite());
    let rows: Vec<usize> = (0..seconds.len()).filter(whole).collect();
    let some = |values: &[f64]| rows.iter().map(|row| values[*row]).collect::<Vec<f64>>();
    if rows.len() < seconds.len().min(LEAST) {
        return None;
    }
    let [a, b, height] = [0, 1, 2].map(|k| some(&columns[first + k]));
    let (a, b, height, seconds) = (&a[..], &b[..], &height[..], &some(seconds)[..]);
    let fractions = |values: &[f64]| values.iter().any(|v| v.fract() != 0.0);
    let radians = within(a, PI) && within(b, PI) && (within(a, FRAC_PI_2) || within(b, FRAC_PI_2));
    let metre = if radians { RADIAN } else { DEGREE };
    // increments and rates are as large as their changes
    let steady = |values: &[f64]| {
        let step = median(values.windows(2).map(|v| (v[1] - v[0]).abs()));
        median(values.iter().map(|v| v.abs())) > STEADY * step
    };
    let slow = |values: &[f64], metre: f64| speed(seconds, values) * metre < FASTEST;
    // a number that never changes is no angle of a vehicle that moves
    let changes = |values: &[f64]| values.iter().any(|v| *v != values[0]);
    // where zeros and small numbers would be, no vehicle is
    let nowhere = |values: &[f64]| within(values, NOWHERE / metre);
    let quaternion = (first..first + 3).any(|k| in_quaternion(columns, k));
    let fits = fractions(a)
        && fractions(b)
        && steady(a)
        && steady(b)
        && changes(a) == changes(b)
        && !quaternion
        && !(nowhere(a) && nowhere(b))
        && within(height, HIGHEST)
        && slow(a, metre)
        && slow(b, metre)
        && slow(height, 1.0);
    let [largest_lat, largest_lon] = if radians { [FRAC_PI_2, TAU] } else { [90.0, 360.0] };
    match fits {
        true if within(a, largest_lat) && within(b, largest_lon) => Some(LATITUDE_FIRST),
        true if within(b, largest_lat) && within(a, largest_lon) => Some(LONGITUDE_FIRST),
        _ => None,
    }
}

/// Tests whether two columns are far from the angles that an attitude in radians has.
pub fn is_far(columns: &[Vec<f64>], first: usize) -> bool {
    let beyond = |values: &[f64], limit: f64| values.iter().all(|v| v.abs() > limit);
    let finite = |k: usize| columns[first + k].iter().copied().filter(|v| v.is_finite());
    let [a, b] = [0, 1].map(|k| finite(k).collect::<Vec<f64>>());
    let (a, b) = (&a[..], &b[..]);
    let one = |a, b| beyond(a, FRAC_PI_2) && beyond(b, 0.0);
    let changes = |values: &[f64]| values.iter().any(|v| *v != values[0]);
    one(a, b) && one(b, a) && (beyond(a, TAU) || beyond(b, TAU)) && changes(a) && changes(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows at 10 Hz of a function of the time.
    fn columns<const N: usize>(row: impl Fn(f64) -> [f64; N]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let times: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
        let column = |k: usize| times.iter().map(|t| row(*t)[k]).collect();
        let columns = (0..N).map(column).collect();
        (times, columns)
    }

    #[test]
    fn a_place_is_slow_and_its_range_shows_the_order() {
        // 15 m/s are 1.35e-4 deg/s
        let found = |row: [f64; 3], speed: f64| {
            let (times, columns) =
                columns(|t| [row[0] + speed * t, row[1] - speed * t, row[2] + 0.1 * t.sin()]);
            order(&times, &columns, 0)
        };
        assert_eq!(found([48.1, 11.5, 500.0], 1.35e-4), Some(LATITUDE_FIRST));
        assert_eq!(found([-122.3, 47.5, 30.0], 1.35e-4), Some(LONGITUDE_FIRST));
        assert_eq!(found([0.84, 0.2, 500.0], 2.4e-6), Some(LATITUDE_FIRST));
        // roll, pitch and yaw in degrees, and in radians, of a vehicle that turns by 0.5 deg/s
        assert_eq!(found([1.5, -0.7, 120.0], 0.5), None);
        assert_eq!(found([0.02, -0.01, 2.1], 0.009), None);
        // beyond any latitude
        assert_eq!(found([170.0, 150.0, 3.0], 1e-5), None);
    }

    #[test]
    fn a_place_may_have_no_number_in_the_rows_of_other_sensors() {
        let (times, mut columns) = columns(|t| [48.1 + 1.35e-4 * t, 11.5, 500.0 + 0.1 * t.sin()]);
        for column in &mut columns {
            (0..column.len()).filter(|k| k % 20 != 0).for_each(|k| column[k] = f64::NAN);
        }
        columns[1].iter_mut().enumerate().for_each(|(k, lon)| *lon += 1e-6 * k as f64);
        assert_eq!(order(&times, &columns, 0), Some(LATITUDE_FIRST));
    }

    #[test]
    fn a_quaternion_at_rest_is_no_place() {
        let (times, columns) = columns(|t| {
            let half = 0.4 + 1e-9 * t;
            [half.cos(), 0.0, 1e-9 * t, half.sin()]
        });
        assert_eq!(order(&times, &columns, 0), None);
        assert_eq!(order(&times, &columns, 1), None);
    }
}
