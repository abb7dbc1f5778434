//! Clocks of two sensors, compared by the motion that both measure.
//!
//! The IMU gives the integrals of its angular rate and of its acceleration, the specific force with
//! gravity removed. Between two samples of a velocity log at `t1` and `t2` on a clock that is `tau`
//! behind that of the IMU,
//!
//! ```text
//! v(t2) - v(t1) + [theta(t2 - tau) - theta(t1 - tau)] x v  =  A(t2 - tau) - A(t1 - tau) + noise
//! ```
//!
//! Levelling by the specific force takes slow accelerations for gravity. The same filter acts on
//! the accelerations of the log, so that both sides lack the same. Between two headings, `psi(t2) -
//! psi(t1) = Y(t2 - tau) - Y(t1 - tau) + noise`. The offset `tau` has the least sum of squares of
//! the noise. Blocks of the recording show the drift.

mod wide;

use std::f64::consts::{PI, TAU};

/// Gravity, m/s^2. An error of it changes the vertical axis alone, which is not used.
const GRAVITY: f64 = 9.81;
/// Longest time in seconds over which the specific force levels the IMU.
const LEVELLING: f64 = 60.0;
/// Largest number of rows of the IMU; beyond, every other one is removed.
const ROWS: usize = 1 << 18;
/// Largest number of samples of another sensor.
const SAMPLES: usize = 1 << 15;
/// Largest offset that is searched, s.
const LARGEST: f64 = 5.0;
/// Least time between two samples, s.
const SPACING: f64 = 0.98;
/// Distance, s, to which an offset that was found is searched again.
const AROUND: f64 = 2.0;
/// Step of the search, s, which is less than the time over which a vehicle changes its motion.
const STEP: f64 = 0.1;
/// Share of the residuals at other offsets that the least ones must not exceed: otherwise the
/// motion does not show the clock.
const SHARE: f64 = 0.5;
/// Shortest block by which the drift is found, s, and the largest number of blocks.
const BLOCK: f64 = 100.0;
const BLOCKS: usize = 8;
/// Least number of differences of samples.
const LEAST: usize = 30;
/// Differences of time scales since 2015, s: GPS time and TAI from UTC, before and after the leap
/// second of 2016, and 27 s where a program had an old table.
const LEAPS: [f64; 5] = [17.0, 18.0, 27.0, 36.0, 37.0];
/// Speed over ground, m/s, below which a course is no heading.
const SLOWEST: f64 = 1.0;

/// The integrals of an IMU.
#[derive(Clone, Debug, Default)]
pub struct Inertial {
    /// Unit vector down, in body axes.
    down: Option<[f64; 3]>,
    begin: f64,
    /// Angle (rad) and velocity (m/s) along the body's axes, and the angle about the vertical.
    sums: [f64; 7],
    /// Time and sums.
    rows: Vec<[f64; 8]>,
    /// Least interval of rows, s.
    spacing: f64,
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let norm = a.iter().map(|x| x * x).sum::<f64>().sqrt();
    (norm > 0.0 && norm.is_finite()).then(|| a.map(|x| x / norm))
}

impl Inertial {
    /// Takes the mean angular rate and specific force of the interval that ends at a time.
    pub fn add(&mut self, time: f64, interval: f64, rate: [f64; 3], force: [f64; 3]) {
        let Some(measured) = unit(force.map(|f| -f)) else { return };
        let before = *self.down.get_or_insert_with(|| {
            self.begin = time;
            measured
        });
        // d' = d x w for a vector that rests in space; the measured one corrects it slowly, and at
        // once in the beginning
        let turned = cross(before, rate);
        let gain = interval / (time - self.begin).clamp(1.0, LEVELLING);
        let moved: [f64; 3] = std::array::from_fn(|k| {
            before[k] + interval * turned[k] + gain * (measured[k] - before[k])
        });
        let down = unit(moved).unwrap_or(measured);
        self.down = Some(down);
        for k in 0..3 {
            self.sums[k] += rate[k] * interval;
            self.sums[3 + k] += (force[k] + GRAVITY * down[k]) * interval;
        }
        // psi' = (w_y sin phi + w_z cos phi) / cos theta, with the angles in the vector down
        let level = 1.0 - down[0] * down[0];
        if level > 0.01 {
            self.sums[6] += (rate[1] * down[1] + rate[2] * down[2]) / level * interval;
        }
        if self.rows.last().is_none_or(|row| time - row[0] >= self.spacing) {
            if self.rows.len() >= ROWS {
                let mut keep = false;
                self.rows.retain(|_| {
                    keep = !keep;
                    keep
                });
                self.spacing = (2.0 * self.spacing).max(2.0 * interval);
            }
            let s = self.sums;
            self.rows.push([time, s[0], s[1], s[2], s[3], s[4], s[5], s[6]]);
        }
    }

    /// The integrals at a time, between two rows: three angles, three velocities, and the angle about
    /// the vertical; `None` outside of them.
    pub fn at(&self, time: f64) -> Option<[f64; 7]> {
        let after = self.rows.partition_point(|row| row[0] < time);
        let (a, b) = (self.rows.get(after.checked_sub(1)?)?, self.rows.get(after)?);
        let share = (time - a[0]) / (b[0] - a[0]);
        Some(std::array::from_fn(|k| a[k + 1] + share * (b[k + 1] - a[k + 1])))
    }
}

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

    fn times(&self) -> Vec<f64> {
        match self {
            Self::Velocity(rows) => rows.iter().map(|r| r[0]).collect(),
            Self::Heading(rows) => rows.iter().map(|r| r[0]).collect(),
            Self::Ground(rows) => rows.iter().map(|r| r[0]).collect(),
        }
    }

    /// The same with samples at least some time apart, so that the noise of one is little against the
    /// change between two.
    fn spaced(&self) -> Self {
        fn some<const N: usize>(rows: &[[f64; N]]) -> Vec<[f64; N]> {
            let mut kept: Vec<[f64; N]> = Vec::with_capacity(rows.len());
            for row in rows {
                if kept.last().is_none_or(|last| row[0] - last[0] >= SPACING) {
                    kept.push(*row);
                }
            }
            kept
        }
        match self {
            Self::Velocity(rows) => Self::Velocity(some(rows)),
            Self::Heading(rows) => Self::Heading(some(rows)),
            Self::Ground(rows) => Self::Ground(some(rows)),
        }
    }

    /// The same with at most this many samples.
    fn thinned(&self, most: usize) -> Self {
        fn some<T: Copy>(rows: &[T], most: usize) -> Vec<T> {
            rows.iter().step_by(rows.len().div_ceil(most).max(1)).copied().collect()
        }
        match self {
            Self::Velocity(rows) => Self::Velocity(some(rows, most)),
            Self::Heading(rows) => Self::Heading(some(rows, most)),
            Self::Ground(rows) => Self::Ground(some(rows, most)),
        }
    }

    /// The words for the two quantities that are compared.
    fn means(&self) -> &'static str {
        match self {
            Self::Velocity(_) => "the change of its velocity with the specific force",
            Self::Heading(_) => "the change of its heading with the angular rate",
            Self::Ground(_) => "the change of its course with the angular rate",
        }
    }

    /// The change of velocity, in space, between the samples `k` and `k + 1`, and that of the
    /// angle.
    fn change(
        rows: &[[f64; 4]],
        k: usize,
        from: &[f64; 7],
        to: &[f64; 7],
    ) -> Option<[[f64; 3]; 2]> {
        let (a, b) = (rows.get(k)?, rows.get(k + 1)?);
        let mean = std::array::from_fn(|i| 0.5 * (a[i + 1] + b[i + 1]));
        let angle: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
        let turn = cross(angle, mean);
        Some([std::array::from_fn(|i| b[i + 1] - a[i + 1] + turn[i]), angle])
    }

    /// The change of velocity between two samples each that levelling takes for gravity, on a clock
    /// behind by `tau`: `y' = y x w - (a + y) / T`.
    fn levelled(&self, imu: &Inertial, tau: f64) -> Vec<[f64; 3]> {
        let Self::Velocity(rows) = self else { return Vec::new() };
        let mut y = [0.0; 3];
        (0..rows.len().saturating_sub(1))
            .map(|k| {
                let interval = rows[k + 1][0] - rows[k][0];
                let ends = imu.at(rows[k][0] - tau).zip(imu.at(rows[k + 1][0] - tau));
                let change = ends.and_then(|(from, to)| Self::change(rows, k, &from, &to));
                let Some([change, angle]) = change else { return y.map(|y| y * interval) };
                let turned = cross(y, angle);
                let before = y;
                let decay = (-interval / LEVELLING).exp();
                for i in 0..3 {
                    y[i] = (y[i] + turned[i]) * decay - change[i] / LEVELLING;
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

    /// The change between the samples `k` and `k + 1` on a clock behind by `tau`: as the sensor and as
    /// the IMU measure it.
    fn changes(
        &self,
        imu: &Inertial,
        levelled: &[[f64; 3]],
        k: usize,
        tau: f64,
    ) -> Option<[[f64; 2]; 2]> {
        if let Self::Velocity(rows) = self {
            let (a, b) = (rows.get(k)?, rows.get(k + 1)?);
            let (from, to) = (imu.at(a[0] - tau)?, imu.at(b[0] - tau)?);
            let ([change, _], y) = (Self::change(rows, k, &from, &to)?, levelled.get(k)?);
            return Some([
                [0, 1].map(|i| change[i] + y[i]),
                [0, 1].map(|i| to[i + 3] - from[i + 3]),
            ]);
        }
        let (a, b) = (self.heading_of(k)?, self.heading_of(k + 1)?);
        let (from, to) = (imu.at(a[0] - tau)?, imu.at(b[0] - tau)?);
        Some([[b[1] - a[1], 0.0], [to[6] - from[6], 0.0]])
    }

    /// The difference of the two changes.
    fn residual(
        &self,
        imu: &Inertial,
        levelled: &[[f64; 3]],
        k: usize,
        tau: f64,
    ) -> Option<[f64; 2]> {
        let [own, other] = self.changes(imu, levelled, k, tau)?;
        let difference = [0, 1].map(|i| own[i] - other[i]);
        Some(match self {
            Self::Velocity(_) => difference,
            _ => [(difference[0] + PI).rem_euclid(TAU) - PI, 0.0],
        })
    }
}

/// The clock of a sensor, compared with that of the IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockOffset {
    /// Seconds by which its stamps are late, at the middle of the recording, and the 1-sigma.
    pub offset: [f64; 2],
    /// Seconds per second by which the offset grows, and the 1-sigma; `None` for a short recording.
    pub drift: Option<[f64; 2]>,
    /// The two quantities that are compared.
    pub means: &'static str,
}

/// The least sum of squares over some samples: the offset and its 1-sigma.
struct Fit {
    offset: f64,
    sigma: f64,
}

/// Pairs of samples that follow each other at the usual interval.
fn pairs(times: &[f64]) -> Vec<usize> {
    let mut intervals: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    intervals.sort_by(f64::total_cmp);
    let usual = intervals.get(intervals.len() / 2).copied().unwrap_or(0.0);
    let fits = |k: &usize| times[k + 1] - times[*k] <= 2.5 * usual;
    (0..times.len().saturating_sub(1)).filter(fits).collect()
}

/// Finds the offset by the samples of some pairs, between two offsets.
fn fit(
    imu: &Inertial,
    measured: &Measured,
    levelled: &[[f64; 3]],
    pairs: &[usize],
    range: [f64; 2],
) -> Option<Fit> {
    // the same pairs at every offset, those inside the recording of the IMU at all of them
    let inside =
        |k: &&usize| range.iter().all(|tau| measured.residual(imu, levelled, **k, *tau).is_some());
    let pairs: Vec<usize> = pairs.iter().filter(inside).copied().collect();
    if pairs.len() < LEAST {
        return None;
    }
    // the mean is that of a bias and of errors of levelling
    let cost = |tau: f64| {
        let mut sums = [[0.0; 2]; 2];
        for r in pairs.iter().filter_map(|k| measured.residual(imu, levelled, *k, tau)) {
            for (sum, r) in sums.iter_mut().zip(r) {
                *sum = [sum[0] + r, sum[1] + r * r];
            }
        }
        let n = pairs.len() as f64;
        sums.iter().map(|[mean, square]| square - mean * mean / n).sum::<f64>()
    };
    let steps = ((range[1] - range[0]) / STEP).floor() as usize;
    let costs: Vec<f64> = (0..=steps).map(|k| cost(range[0] + k as f64 * STEP)).collect();
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    let mut sorted = costs.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    // at the end of the range the true offset may lie beyond
    if best == 0 || best == steps || costs[best] > SHARE * usual {
        return None;
    }
    // the minimum of a parabola through three offsets, once more around the first one
    let mut offset = range[0] + best as f64 * STEP;
    let mut curvature = 0.0;
    for _ in 0..2 {
        let [before, at, after] = [-STEP, 0.0, STEP].map(|d| cost(offset + d));
        curvature = (before - 2.0 * at + after) / (STEP * STEP);
        if curvature <= 0.0 {
            return None;
        }
        offset -= ((after - before) / (2.0 * STEP * curvature)).clamp(-STEP, STEP);
    }
    let rows = match measured {
        Measured::Velocity(_) => 2 * pairs.len(),
        Measured::Heading(_) | Measured::Ground(_) => pairs.len(),
    };
    // the sum of squares S has the second derivative 2 / sigma^2 of the offset, times the variance
    let variance = cost(offset) / rows as f64;
    Some(Fit { offset, sigma: (2.0 * variance / curvature).sqrt() })
}

/// Compares the clock of a sensor with that of the IMU; `None` if the motion does not show it.
pub fn compare(imu: &Inertial, measured: &Measured) -> Option<ClockOffset> {
    let measured = &measured.spaced();
    let times = measured.times();
    let pairs = pairs(&times);
    let near = fit(imu, measured, &measured.levelled(imu, 0.0), &pairs, [-LARGEST, LARGEST]);
    let (start, range) = match near {
        Some(near) => (near.offset, [-LARGEST, LARGEST]),
        None => {
            let found = wide::search(imu, measured)?;
            (found, [found - AROUND, found + AROUND])
        }
    };
    let levelled = measured.levelled(imu, start);
    let all = fit(imu, measured, &levelled, &pairs, range)?;
    let (first, last) = (*times.first()?, *times.last()?);
    let count = (((last - first) / BLOCK) as usize).min(BLOCKS);
    let length = (last - first) / count.max(1) as f64;
    let mut blocks = Vec::new();
    for block in 0..count {
        let from = first + block as f64 * length;
        let within = |k: &&usize| (from..from + length).contains(&times[**k]);
        let some: Vec<usize> = pairs.iter().filter(within).copied().collect();
        // a drift of a percent would move the offset by more than this
        let range = [all.offset - AROUND, all.offset + AROUND];
        if let Some(one) = fit(imu, measured, &levelled, &some, range) {
            blocks.push((from + 0.5 * (length - (last - first)) - first, one));
        }
    }
    let means = measured.means();
    let Some((line, scatter)) = line(&blocks) else {
        return Some(ClockOffset { offset: [all.offset, all.sigma], drift: None, means });
    };
    // blocks that scatter beyond their sigmas have correlated noise
    let [offset, sigma, drift, drift_sigma] = line;
    Some(ClockOffset {
        offset: [offset, sigma * scatter],
        drift: Some([drift, drift_sigma * scatter]),
        means,
    })
}

/// The line through offsets of blocks: offset at time zero with its sigma, slope with its sigma,
/// and the factor, at least one, by which the blocks scatter beyond their sigmas.
fn line(blocks: &[(f64, Fit)]) -> Option<([f64; 4], f64)> {
    if blocks.len() < 3 {
        return None;
    }
    let mut sums = [0.0; 5];
    for (t, f) in blocks {
        let w = f.sigma.powi(-2);
        for (sum, term) in sums.iter_mut().zip([1.0, *t, t * t, f.offset, t * f.offset]) {
            *sum += w * term;
        }
    }
    let [n, t, tt, y, ty] = sums;
    let det = n * tt - t * t;
    if !(det > 0.0 && det.is_finite()) {
        return None;
    }
    let (offset, slope) = ((tt * y - t * ty) / det, (n * ty - t * y) / det);
    let square = |(at, f): &(f64, Fit)| ((f.offset - offset - slope * at) / f.sigma).powi(2);
    let chi = blocks.iter().map(square).sum::<f64>() / (blocks.len() - 2) as f64;
    Some(([offset, (tt / det).sqrt(), slope, (n / det).sqrt()], chi.sqrt().max(1.0)))
}

impl ClockOffset {
    /// Returns `true` if the offset is more than five times its uncertainty, and more than 20 ms.
    pub fn matters(&self) -> bool {
        let [offset, sigma] = self.offset;
        offset.abs() > (5.0 * sigma).max(0.02)
    }

    /// The shift of the stamps that corrects the offset: the difference of two time scales
    /// where it is one.
    pub fn correction(&self) -> f64 {
        let [offset, sigma] = self.offset;
        let near = |leap: &&f64| (offset.abs() - **leap).abs() < (3.0 * sigma).max(0.1);
        -LEAPS.iter().find(near).map_or(offset, |leap| leap.copysign(offset))
    }

    /// Describes the clock in words.
    pub fn describe(&self) -> String {
        let [offset, sigma] = self.offset;
        let side = if offset < 0.0 { "ahead of" } else { "behind" };
        let mut text = format!(
            "its clock is {:.3} s {side} the clock of the IMU, sigma {sigma:.3} s",
            offset.abs()
        );
        if let Some([drift, sigma]) = self.drift.filter(|[d, s]| d.abs() > 3.0 * s) {
            let [drift, sigma] = [drift, sigma].map(|x| x * 1e6);
            text.push_str(&format!(", with a drift of {drift:.0} ppm, sigma {sigma:.0} ppm"));
        }
        text.push_str(&format!(" (found by comparing {})", self.means));
        text
    }
}

#[cfg(test)]
mod tests;
