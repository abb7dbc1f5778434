//! The quantity of a sensor that is compared with the IMU.

use super::inertial::{Inertial, cross};
use std::f64::consts::{PI, TAU};

/// Largest number of samples of another sensor.
const SAMPLES: usize = 1 << 15;
/// Least time between two samples, s.
const SPACING: f64 = 0.98;
/// Number of ground velocities of a mean.
pub(super) const MEAN: usize = 3;
/// Number of samples after which a velocity has changed by more than its noise, where that to the next one does not show
/// the clock.
pub(super) const APART: usize = 4;
/// Speed over ground, m/s, below which a course is no heading.
const SLOWEST: f64 = 1.0;

/// The words for the comparison of velocities.
pub(super) const OF_VELOCITY: &str = "the change of its velocity with the specific force";

/// Least number of differences of samples.
pub const LEAST: usize = 30;

/// Two samples that are compared.
pub type Pair = [usize; 2];

/// The quantity of another sensor.
#[derive(Clone, Debug)]
pub enum Measured {
    /// Time and velocity along the body's axes.
    Velocity(Vec<[f64; 4]>),
    /// Time and heading.
    Heading(Vec<[f64; 2]>),
    /// Time, and velocity north and east where the vehicle moves, whose direction is its heading.
    Ground(Vec<[f64; 3]>),
}

impl Measured {
    /// Takes a velocity along the body's axes.
    pub fn velocity(&mut self, time: f64, v: [f64; 3]) {
        if let Self::Velocity(rows) = self
            && rows.len() < SAMPLES
        {
            rows.push([time, v[0], v[1], v[2]]);
        }
    }

    /// Takes a heading.
    pub fn heading(&mut self, time: f64, heading: f64) {
        if let Self::Heading(rows) = self
            && rows.len() < SAMPLES
        {
            rows.push([time, heading]);
        }
    }

    /// Takes a velocity north and east.
    pub fn ground(&mut self, time: f64, north: f64, east: f64) {
        if let Self::Ground(rows) = self
            && rows.len() < SAMPLES
            && north.hypot(east) > SLOWEST
        {
            rows.push([time, north, east]);
        }
    }

    pub(super) fn times(&self) -> Vec<f64> {
        match self {
            Self::Velocity(rows) => rows.iter().map(|r| r[0]).collect(),
            Self::Heading(rows) => rows.iter().map(|r| r[0]).collect(),
            Self::Ground(rows) => rows.iter().map(|r| r[0]).collect(),
        }
    }

    /// Pairs of samples, the second one `apart` places after the first, without gaps of the usual interval.
    pub(super) fn pairs(&self, apart: usize) -> Vec<Pair> {
        let times = self.times();
        let mut intervals: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
        intervals.sort_by(f64::total_cmp);
        let usual = intervals.get(intervals.len() / 2).copied().unwrap_or(0.0);
        let fits = |[a, b]: &Pair| times[*b] - times[*a] <= (apart as f64 + 1.5) * usual;
        (0..times.len().saturating_sub(apart)).map(|k| [k, k + apart]).filter(fits).collect()
    }

    /// The same with samples at least some time apart, so that the noise of one is little against the
    /// change between two.
    pub(super) fn spaced(&self) -> Self {
        fn some<const N: usize>(rows: &[[f64; N]]) -> Vec<[f64; N]> {
            let mut kept: Vec<[f64; N]> = Vec::with_capacity(rows.len());
            for row in rows {
                if kept.last().is_none_or(|last| row[0] - last[0] >= SPACING) {
                    kept.push(*row);
                }
            }
            kept
        }
        // the mean of the velocities of a faster log has less noise
        fn means(rows: &[[f64; 4]]) -> Vec<[f64; 4]> {
            let mut kept = Vec::new();
            let mut from = 0;
            for k in 1..=rows.len() {
                let ends = rows.get(k).is_none_or(|row| row[0] - rows[from][0] >= SPACING);
                if let Some(some) = rows.get(from..k).filter(|_| ends) {
                    let mean =
                        |i: usize| some.iter().map(|row| row[i]).sum::<f64>() / some.len() as f64;
                    kept.push([0, 1, 2, 3].map(mean));
                    from = k;
                }
            }
            kept
        }
        match self {
            Self::Velocity(rows) => Self::Velocity(means(rows)),
            Self::Heading(rows) => Self::Heading(some(rows)),
            Self::Ground(rows) => Self::Ground(some(rows)),
        }
    }

    /// The same with each ground velocity as the mean of [`MEAN`]: positions that differ by their noise
    /// give no course. `None` for other quantities.
    pub(super) fn smoothed(&self) -> Option<Self> {
        let Self::Ground(rows) = self else { return None };
        let mean = |w: &[[f64; 3]]| {
            let [north, east] =
                [1, 2].map(|k| w.iter().map(|row| row[k]).sum::<f64>() / MEAN as f64);
            [w[MEAN / 2][0], north, east]
        };
        Some(Self::Ground(rows.windows(MEAN).map(mean).collect()))
    }

    /// The same with at most this many samples.
    pub(super) fn thinned(&self, most: usize) -> Self {
        fn some<T: Copy>(rows: &[T], most: usize) -> Vec<T> {
            rows.iter().step_by(rows.len().div_ceil(most).max(1)).copied().collect()
        }
        match self {
            Self::Velocity(rows) => Self::Velocity(some(rows, most)),
            Self::Heading(rows) => Self::Heading(some(rows, most)),
            Self::Ground(rows) => Self::Ground(some(rows, most)),
        }
    }

    /// The weight of a difference: the noise of a course is that of the velocity divided by the speed.
    pub(super) fn weight(&self, [a, b]: Pair) -> f64 {
        let Self::Ground(rows) = self else { return 1.0 };
        let speed = |k: usize| rows.get(k).map_or(0.0, |row| row[1].hypot(row[2]));
        speed(a).min(speed(b))
    }

    /// The number of axes along which differences are compared.
    pub(super) fn axes(&self) -> usize {
        match self {
            Self::Velocity(_) => 2,
            Self::Heading(_) | Self::Ground(_) => 1,
        }
    }

    /// The words for the two quantities that are compared.
    pub(super) fn means(&self) -> &'static str {
        match self {
            Self::Velocity(_) => OF_VELOCITY,
            Self::Heading(_) => "the change of its heading with the angular rate",
            Self::Ground(_) => "the change of its course with the angular rate",
        }
    }

    /// The change of velocity, in space, between two samples, and the change of the angle.
    fn change(
        rows: &[[f64; 4]],
        [a, b]: Pair,
        from: &[f64; 7],
        to: &[f64; 7],
    ) -> Option<[[f64; 3]; 2]> {
        let (a, b) = (rows.get(a)?, rows.get(b)?);
        let mean = std::array::from_fn(|i| 0.5 * (a[i + 1] + b[i + 1]));
        let angle: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
        let turn = cross(angle, mean);
        Some([std::array::from_fn(|i| b[i + 1] - a[i + 1] + turn[i]), angle])
    }

    /// The change of velocity between two samples each that levelling takes for gravity, on a clock
    /// behind by `tau`: `y' = y x w - (a + y) / T`.
    pub(super) fn levelled(&self, imu: &Inertial, tau: f64) -> Vec<[f64; 3]> {
        let Self::Velocity(rows) = self else { return Vec::new() };
        let mut y = [0.0; 3];
        (0..rows.len().saturating_sub(1))
            .map(|k| {
                let interval = rows[k + 1][0] - rows[k][0];
                let ends = imu.at(rows[k][0] - tau).zip(imu.at(rows[k + 1][0] - tau));
                let change = ends.and_then(|(from, to)| Self::change(rows, [k, k + 1], &from, &to));
                let Some([change, angle]) = change else { return y.map(|y| y * interval) };
                let turned = cross(y, angle);
                let before = y;
                // the IMU is levelled faster in the beginning
                let levelling = imu.levelling(rows[k][0] + 0.5 * interval - tau);
                let decay = (-interval / levelling).exp();
                for i in 0..3 {
                    y[i] = (y[i] + turned[i]) * decay - change[i] / levelling;
                }
                std::array::from_fn(|i| 0.5 * (before[i] + y[i]) * interval)
            })
            .collect()
    }

    /// The heading or the course of a sample, with its time.
    fn heading_of(&self, k: usize) -> Option<[f64; 2]> {
        match self {
            Self::Velocity(_) => None,
            Self::Heading(rows) => rows.get(k).copied(),
            Self::Ground(rows) => rows.get(k).map(|r| [r[0], r[2].atan2(r[1])]),
        }
    }

    /// The change between two samples on a clock behind by `tau`: as the sensor and as the IMU measure
    /// it.
    pub(super) fn changes(
        &self,
        imu: &Inertial,
        levelled: &[[f64; 3]],
        pair: Pair,
        tau: f64,
    ) -> Option<[[f64; 2]; 2]> {
        let [first, second] = pair;
        if let Self::Velocity(rows) = self {
            let from = imu.at(rows.get(first)?[0] - tau)?;
            let (mut own, mut at) = ([0.0; 2], from);
            for k in first..second {
                let next = imu.at(rows.get(k + 1)?[0] - tau)?;
                let ([change, _], y) =
                    (Self::change(rows, [k, k + 1], &at, &next)?, levelled.get(k)?);
                own = [0, 1].map(|i| own[i] + change[i] + y[i]);
                at = next;
            }
            return Some([own, [0, 1].map(|i| at[i + 3] - from[i + 3])]);
        }
        let (a, b) = (self.heading_of(first)?, self.heading_of(second)?);
        let (from, to) = (imu.at(a[0] - tau)?, imu.at(b[0] - tau)?);
        Some([[b[1] - a[1], 0.0], [to[6] - from[6], 0.0]])
    }

    /// The difference of the two changes.
    pub(super) fn residual(
        &self,
        imu: &Inertial,
        levelled: &[[f64; 3]],
        pair: Pair,
        tau: f64,
    ) -> Option<[f64; 2]> {
        let [own, other] = self.changes(imu, levelled, pair, tau)?;
        let difference = [0, 1].map(|i| own[i] - other[i]);
        Some(match self {
            Self::Velocity(_) => difference,
            _ => [(difference[0] + PI).rem_euclid(TAU) - PI, 0.0],
        })
    }
}
