//! The finder of segments.

use crate::{Attitude, AttitudeStart, Recording, SegmentError};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use std::ops::Range;

/// Kind of motion on a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// At rest.
    Static,
    /// Constant attitude and constant specific force, but not at rest as far as the sensors show.
    Steady,
    /// Constant attitude, varying specific force: Type I of Theorem 1.
    #[serde(rename = "type-i")]
    TypeI,
    /// Turning: Type II.
    #[serde(rename = "type-ii")]
    TypeII,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Static => "static",
            Self::Steady => "steady",
            Self::TypeI => "type I",
            Self::TypeII => "type II",
        })
    }
}

/// A part of the recording in which one kind of motion holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Segment {
    /// Kind of motion.
    pub kind: Kind,
    /// Start, s on the recording's clock.
    pub from: f64,
    /// End, s.
    pub to: f64,
}

impl Segment {
    /// Returns the duration, s.
    pub fn duration(&self) -> f64 {
        self.to - self.from
    }
}

/// Thresholds of the finder. [`Settings::of`] derives them from the noise of the sensors; each can
/// be changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Duration of a bin, over which samples are averaged, s.
    pub bin: f64,
    /// Number of bins in a slope of the specific force.
    pub slope_bins: usize,
    /// Number of bins in a mean rate of turn, so that rolling and pitching in waves do not count as
    /// a turn.
    pub turn_bins: usize,
    /// Rate above which the attitude is not constant, rad/s, until it falls below half of it.
    pub turn_rate: f64,
    /// Change of attitude that ends a segment of constant attitude, rad.
    pub turn_angle: f64,
    /// Rate above which the specific force varies, m/s^3, until it falls below half of it.
    pub force_rate: f64,
    /// Largest mean body velocity over ten bins of a vehicle at rest, m/s.
    pub rest_speed: f64,
    /// Shortest segments at rest, of Type I, and of Type II, s.
    pub shortest: [f64; 3],
}

impl Settings {
    /// Derives the thresholds from the noise of the sensors.
    ///
    /// The specific-force rate is the slope of means over `n` bins. Accelerometer noise gives it
    /// the sigma `N_a sqrt(12 / T^3)` with `T = n bin`. The gyro bias and random walk tilt the
    /// axes, and so add a part of gravity. The threshold is six sigma of an axis. A moving vehicle
    /// is never still: below 0.3 deg/s it counts as not turning.
    pub fn of(recording: &Recording) -> Self {
        let (bin, slope_bins) = (1.0, 5);
        let imu = &recording.imu;
        let slope = (bin * slope_bins as f64).powi(3);
        let gyro = imu.gyro_noise.amax() / f64::sqrt(bin);
        let force = imu.accel_noise.amax() * (12.0 / slope).sqrt();
        let leak =
            G * (imu.gyro_bias.amax() + imu.gyro_noise.amax() / (bin * slope_bins as f64).sqrt());
        let rest = recording.velocities.first().map_or(0.0, |v| {
            let samples = (10.0 * bin / v.samples.period()).max(1.0);
            4.0 * (v.covariance.trace() / samples).sqrt()
        });
        Self {
            bin,
            slope_bins,
            turn_bins: 9,
            turn_rate: 0.3_f64.to_radians().max(6.0 * gyro + 3.0 * imu.gyro_bias.amax()),
            turn_angle: 2_f64.to_radians(),
            force_rate: 6.0 * force.hypot(leak),
            rest_speed: rest.max(0.005),
            shortest: [30.0, 10.0, 5.0],
        }
    }

    /// Returns the 1-sigma of the noise in one axis of a slope of the specific force, m/s^3.
    pub fn slope_noise(&self, recording: &Recording) -> f64 {
        recording.imu.accel_noise.amax()
            * (12.0 / (self.bin * self.slope_bins as f64).powi(3)).sqrt()
    }
}

/// Standard gravity, m/s^2.
const G: f64 = 9.80665;

/// Means over one bin.
#[derive(Clone, Copy, Debug)]
struct Bin {
    /// Middle of the bin, s.
    time: f64,
    /// Angular rate relative to the local axes, in body axes, rad/s.
    rate: Vector3<f64>,
    /// Specific force in local axes, m/s^2.
    force: Vector3<f64>,
}

/// Finds the segments of a recording in order of time, and their attitude. The mean gyro rate at
/// rest is the gyro bias, and the segments are found again with it.
///
/// # Errors
/// Returns an error if no initial attitude is known.
pub fn find(
    recording: &Recording,
    settings: &Settings,
) -> Result<(Vec<Segment>, Attitude), SegmentError> {
    let start = AttitudeStart::of(recording)?;
    let mounting = recording.velocities.first().map(|v| v.initial);
    let attitude = Attitude::integrate(recording, start, Vector3::zeros(), mounting.as_ref());
    let first = label(recording, settings, &attitude);
    let rest: Vec<[f64; 2]> =
        first.iter().filter(|s| s.kind == Kind::Static).map(|s| [s.from, s.to]).collect();
    let Some(bias) = Attitude::bias_at_rest(recording, &start, &rest) else {
        return Ok((first, attitude));
    };
    let attitude = Attitude::integrate(recording, start, bias, mounting.as_ref());
    Ok((label(recording, settings, &attitude), attitude))
}

fn label(recording: &Recording, settings: &Settings, attitude: &Attitude) -> Vec<Segment> {
    let bins = bins(recording, settings, attitude);
    let slopes = slopes(&bins, settings);
    let turning = turning(&bins, settings);
    let varying = hysteresis(slopes.iter().map(Vector3::norm), settings.force_rate);
    let velocity = recording.velocities.first().filter(|v| !v.water && !v.samples.is_empty());
    let resting = |bin: &Bin| {
        let mean = velocity.and_then(|v| {
            v.samples.mean(bin.time - 5.0 * settings.bin, bin.time + 5.0 * settings.bin)
        });
        mean.is_some_and(|(mean, _)| mean.norm() < settings.rest_speed)
    };
    let kinds: Vec<Kind> = (bins.iter().enumerate())
        .map(|(k, bin)| match (turning[k], varying[k]) {
            (true, _) => Kind::TypeII,
            (false, true) => Kind::TypeI,
            (false, false) if resting(bin) => Kind::Static,
            (false, false) => Kind::Steady,
        })
        .collect();
    let kinds = without_short(kinds, settings);
    runs(&bins, &kinds, settings, attitude)
}

/// Averages the IMU's samples over bins; a bin without samples is left out.
fn bins(recording: &Recording, settings: &Settings, attitude: &Attitude) -> Vec<Bin> {
    bins_of(recording, settings, attitude, 0..recording.imu.samples.time.len())
}

/// The bins of some samples, of which the first and the last may lack a part.
fn bins_of(
    recording: &Recording,
    settings: &Settings,
    attitude: &Attitude,
    samples: Range<usize>,
) -> Vec<Bin> {
    let imu = &recording.imu.samples;
    let mut bins: Vec<Bin> = Vec::new();
    let (mut k, last) = (samples.start, samples.end);
    let begin = imu.time.first().map_or(0.0, |t| t - imu.value[0].dt);
    while k < last {
        let index = ((imu.time[k] - 0.5 * imu.value[k].dt - begin) / settings.bin).floor();
        let end = begin + (index + 1.0) * settings.bin;
        let (mut rate, mut force, mut dt) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        while k < last && imu.time[k] - 0.5 * imu.value[k].dt < end {
            let s = &imu.value[k];
            // in the axes of the interval's end, turned from its middle: to the second order, 1e-10
            // of the force for 0.1 rad/s at 100 Hz
            let back = attitude.w_nb_b[k] * (-0.5 * s.dt);
            let turn = back.cross(&s.force);
            let at_end = s.force + turn + back.cross(&turn) * 0.5;
            rate += attitude.w_nb_b[k] * s.dt;
            force += attitude.c_b_n[k] * (at_end * s.dt);
            dt += s.dt;
            k += 1;
        }
        bins.push(Bin { time: end - 0.5 * settings.bin, rate: rate / dt, force: force / dt });
    }
    bins
}

/// Returns the slope of the specific force at every bin, local axes, m/s^3: least squares over the
/// surrounding bins.
fn slopes(bins: &[Bin], settings: &Settings) -> Vec<Vector3<f64>> {
    let reach = settings.slope_bins / 2;
    (0..bins.len())
        .map(|k| {
            let around = &bins[k.saturating_sub(reach)..(k + reach + 1).min(bins.len())];
            slope(around.iter().map(|b| (b.time, b.force)))
        })
        .collect()
}

/// Returns the least-squares slope of a vector over time; zero for fewer than two samples.
pub(crate) fn slope(samples: impl Iterator<Item = (f64, Vector3<f64>)> + Clone) -> Vector3<f64> {
    let n = samples.clone().count().max(1) as f64;
    let middle = samples.clone().map(|s| s.0).sum::<f64>() / n;
    let spread: f64 = samples.clone().map(|s| (s.0 - middle).powi(2)).sum();
    if spread <= 0.0 {
        return Vector3::zeros();
    }
    samples.map(|(t, v)| v * (t - middle)).sum::<Vector3<f64>>() / spread
}

/// Flags values above a threshold, and their neighbours above half of it.
fn hysteresis(values: impl Iterator<Item = f64>, threshold: f64) -> Vec<bool> {
    let values: Vec<f64> = values.collect();
    let mut on: Vec<bool> = values.iter().map(|v| *v > threshold).collect();
    for k in 1..on.len() {
        on[k] = on[k] || (on[k - 1] && values[k] > 0.5 * threshold);
    }
    for k in (0..on.len().saturating_sub(1)).rev() {
        on[k] = on[k] || (on[k + 1] && values[k] > 0.5 * threshold);
    }
    on
}

/// Flags bins with the mean rate of a turn. The mean extends farther than a slope, so that no slope
/// outside the flagged bins extends into a turn.
fn turning(bins: &[Bin], settings: &Settings) -> Vec<bool> {
    let reach = settings.turn_bins / 2;
    let mean = |k: usize| {
        let around = &bins[k.saturating_sub(reach)..(k + reach + 1).min(bins.len())];
        (around.iter().map(|b| b.rate).sum::<Vector3<f64>>() / around.len() as f64).norm()
    };
    hysteresis((0..bins.len()).map(mean), settings.turn_rate)
}

/// Replaces runs that are too short for their kind by their surroundings: an interruption of a turn
/// or a Type I becomes a part of it, and a Type I that is too short becomes steady.
fn without_short(mut kinds: Vec<Kind>, settings: &Settings) -> Vec<Kind> {
    let shortest = |kind: Kind| match kind {
        Kind::Static => settings.shortest[0],
        Kind::Steady => settings.slope_bins as f64 * settings.bin,
        Kind::TypeI => settings.shortest[1],
        Kind::TypeII => settings.shortest[2],
    };
    for kind in [Kind::TypeII, Kind::Steady, Kind::Static, Kind::TypeI] {
        let mut k = 0;
        while k < kinds.len() {
            let end = kinds[k..].iter().position(|x| *x != kinds[k]).map_or(kinds.len(), |n| k + n);
            if kinds[k] == kind && ((end - k) as f64) * settings.bin < shortest(kind) {
                let (before, after) = (k.checked_sub(1).map(|b| kinds[b]), kinds.get(end).copied());
                let into = match (kind, before, after) {
                    (Kind::TypeII, _, _) => Kind::TypeI,
                    (Kind::TypeI, _, _) => Kind::Steady,
                    (_, Some(before), Some(after)) if before == after => before,
                    (Kind::Static, _, _) => Kind::Steady,
                    (_, before, after) => {
                        before.filter(|b| *b != Kind::TypeII).or(after).unwrap_or(kind)
                    }
                };
                kinds[k..end].fill(into);
            }
            k = end;
        }
    }
    kinds
}

/// Joins consecutive bins of one kind, and splits them where the attitude has changed too much.
fn runs(bins: &[Bin], kinds: &[Kind], settings: &Settings, attitude: &Attitude) -> Vec<Segment> {
    let mut segments: Vec<Segment> = Vec::new();
    let half = 0.5 * settings.bin;
    for (bin, kind) in bins.iter().zip(kinds) {
        let (from, to) = (bin.time - half, bin.time + half);
        if let Some(last) = segments.last_mut() {
            let joined = last.kind == *kind && from - last.to < half;
            let same = *kind == Kind::TypeII
                || attitude.between(last.from, to).angle() < settings.turn_angle;
            if joined && same {
                last.to = to;
                continue;
            }
        }
        segments.push(Segment { kind: *kind, from, to });
    }
    let end = bins.last().map_or(0.0, |b| b.time + half);
    let short = |s: &Segment| {
        let least = if s.kind == Kind::TypeI { settings.shortest[1] } else { 0.0 };
        s.duration() + 1e-9 < least && s.to < end + half
    };
    // a piece that this split made too short is not a segment of its kind
    segments.iter_mut().filter(|s| short(s)).for_each(|s| s.kind = Kind::Steady);
    segments
}

/// Returns the slopes of the specific force on a segment, body axes, m/s^3, one per bin.
pub(crate) fn body_slopes(
    recording: &Recording,
    settings: &Settings,
    attitude: &Attitude,
    segment: &Segment,
) -> Vec<Vector3<f64>> {
    // the bins inside are whole, those at the ends are left out
    let (from, to) = (segment.from - 2.0 * settings.bin, segment.to + 2.0 * settings.bin);
    let samples = recording.imu.samples.within(from, to);
    let bins = bins_of(recording, settings, attitude, samples);
    let inside: Vec<Bin> =
        bins.into_iter().filter(|b| b.time > segment.from && b.time < segment.to).collect();
    let slopes = slopes(&inside, settings);
    // slopes at the ends would have fewer bins, and more noise
    let reach = settings.slope_bins / 2;
    let whole = reach..inside.len().saturating_sub(reach);
    whole.map(|k| attitude.at(inside[k].time).inverse_transform_vector(&slopes[k])).collect()
}

/// Returns the eigenvalues of a symmetric matrix, the largest first, with the eigenvectors as
/// columns.
pub(crate) fn eigen(matrix: Matrix3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
    let eigen = matrix.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let axes = Matrix3::from_columns(&order.map(|k| eigen.eigenvectors.column(k).into_owned()));
    (Vector3::from(order.map(|k| eigen.eigenvalues[k])), axes)
}
