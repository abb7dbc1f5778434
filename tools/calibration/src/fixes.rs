//! Position fixes and velocities over the ground, at the IMU's point, paired with the samples of
//! the DVL.

use crate::{CalibrationData, CalibrationError};
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_segments::{Positions, Series};

/// Position fix.
#[derive(Clone, Copy, Debug)]
pub struct Fix {
    /// Time, s.
    pub time: f64,
    /// North, east, down from the first fix of its block, m.
    pub position: Vector3<f64>,
    /// North, east, down, m/s, if the sensor has a velocity.
    pub velocity: Option<Vector3<f64>>,
    /// 1-sigma north and east, m.
    pub sigma: f64,
}

/// Returns the fixes with samples of the DVL, in blocks without gaps; together they cover at least
/// a minute.
///
/// # Errors
/// Returns an error if no sensor measures the position, or if the fixes are too few.
pub fn blocks(data: &CalibrationData) -> Result<Vec<Vec<Fix>>, CalibrationError> {
    let velocity = data.over_ground()?;
    let Some(Positions { fixes: series, lever_arm: lever, .. }) = data.recording.positions.first()
    else {
        return Err(CalibrationError::Sensor(
            "this method needs position fixes, but no sensor of the scenario has latitude and \
             longitude: add [sensor.gnss], or use io-dvlc, which needs no fixes"
                .into(),
        ));
    };
    let attitude = &data.attitude;
    let limit = (3.0 * series.period()).max(2.0);
    let silent = (3.0 * velocity.samples.period()).max(2.0);
    let mut blocks: Vec<Vec<Fix>> = Vec::new();
    let mut origin = None;
    let mut before = f64::NEG_INFINITY;
    for (time, fix) in series.time.iter().zip(&series.value) {
        let near = velocity.samples.within(time - silent, time + silent);
        if near.is_empty() || *time > data.recording.end() {
            continue;
        }
        let gap = time - before > limit
            || !velocity.samples.gaps(before.max(0.0), *time, silent).is_empty();
        before = *time;
        if gap || origin.is_none() {
            origin = Some(fix.position);
            blocks.push(Vec::new());
        }
        let Some((from, block)) = origin.zip(blocks.last_mut()) else { continue };
        let c_b_n = attitude.at(*time);
        let k = attitude.time.partition_point(|t| t < time).min(attitude.time.len() - 1);
        let w = attitude.w_nb_b[k];
        let mut position = fix.position.ned_from(&from);
        if position.z.is_nan() {
            position.z = 0.0;
        }
        block.push(Fix {
            time: *time,
            position: position - c_b_n * lever,
            velocity: fix.velocity.map(|v| v - c_b_n * w.cross(lever)),
            sigma: fix.sigma,
        });
    }
    blocks.retain(|b| b.len() >= 3);
    let covered =
        blocks.iter().map(|b| b[b.len() - 1].time - b[0].time).fold(0.0, |sum, t| sum + t);
    if covered < 60.0 {
        return Err(CalibrationError::Samples(format!(
            "[sensor.{}] and [sensor.{}] overlap for {covered:.0} s: at least a minute is needed; \
             stay at the surface longer, under way",
            series.name, velocity.samples.name
        )));
    }
    Ok(blocks)
}

/// Velocity over the ground in body axes, and the simultaneous velocity of the DVL.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Time, s.
    pub time: f64,
    /// Velocity over the ground, body axes, m/s.
    pub body: Vector3<f64>,
    /// Velocity of the DVL, instrument axes, m/s.
    pub y: Vector3<f64>,
    /// Attitude, body to north, east, down.
    pub c_b_n: UnitQuaternion<f64>,
}

/// Length of a displacement, s.
const WINDOW: f64 = 10.0;

/// Returns pairs of velocities. The flag is `true` if the sensor of the fixes measures the
/// velocity. If it does not, the velocities are displacements in instrument axes ([`instrument`])
/// over their duration.
///
/// # Errors
/// Returns an error as [`blocks`] does, and if the vehicle does not move.
pub fn pairs(data: &CalibrationData) -> Result<(Vec<Pair>, bool), CalibrationError> {
    let velocity = data.over_ground()?;
    let blocks = blocks(data)?;
    let own = blocks.iter().flatten().all(|f| f.velocity.is_some());
    let mut pairs = Vec::new();
    if own {
        for fix in blocks.iter().flatten() {
            let Some(v) = fix.velocity else { continue };
            // the mean of the samples around the fix: exact if the velocity changes linearly
            let reach = (0.6 * velocity.samples.period()).max(0.5);
            let mean = velocity.samples.mean(fix.time - reach, fix.time + reach);
            let Some((y, _)) = mean else { continue };
            let c_b_n = data.attitude.at(fix.time);
            pairs.push(Pair { time: fix.time, body: c_b_n.inverse_transform_vector(&v), y, c_b_n });
        }
    } else {
        for block in &blocks {
            let (a, b) = instrument(data, block, &velocity.samples);
            let mut k = 0;
            for j in 1..block.len() {
                let dt = block[j].time - block[k].time;
                if dt >= WINDOW {
                    let time = 0.5 * (block[j].time + block[k].time);
                    let (body, y) = ((a[j] - a[k]) / dt, (b[j] - b[k]) / dt);
                    pairs.push(Pair { time, body, y, c_b_n: data.attitude.at(time) });
                    k = j;
                }
            }
        }
    }
    let speed = (pairs.iter().map(|p| p.body.norm_squared()).sum::<f64>()
        / pairs.len().max(1) as f64)
        .sqrt();
    if speed < 0.2 {
        return Err(CalibrationError::Motion(format!(
            "the vehicle moves at only {speed:.2} m/s while there are fixes: give fixes of \
             a vehicle under way"
        )));
    }
    Ok((pairs, own))
}

/// Returns the displacements from the first fix in instrument axes, at the fixes (Kinsey & Whitcomb
/// 2007):
///
/// ```text
/// a(t) = ∫ C_n^b pdot dτ = C_n^b p |_0^t + ∫ w_nb^b x C_n^b p dτ          b(t) = ∫ y dτ
/// ```
/// Integration by parts avoids the derivative of `p`, which would amplify the noise of the fixes.
pub fn instrument(
    data: &CalibrationData,
    block: &[Fix],
    y: &Series<Vector3<f64>>,
) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let attitude = &data.attitude;
    let turned = |t: f64, p: &Vector3<f64>| attitude.at(t).inverse_transform_vector(p);
    let Some(first) = block.first() else { return (Vec::new(), Vec::new()) };
    let begin = turned(first.time, &first.position);
    let (mut a, mut b) = (vec![Vector3::zeros()], vec![Vector3::zeros()]);
    let (mut turn, mut way) = (Vector3::zeros(), Vector3::zeros());
    for w in block.windows(2) {
        let (from, to) = (w[0].time, w[1].time);
        let p =
            |t: f64| w[0].position + (w[1].position - w[0].position) * ((t - from) / (to - from));
        let mut t = from;
        let mut k = attitude.time.partition_point(|x| *x <= from);
        while t < to {
            let end = attitude.time.get(k).copied().unwrap_or(to).min(to);
            let rate = attitude.w_nb_b.get(k).copied().unwrap_or_default();
            let middle = 0.5 * (t + end);
            turn += rate.cross(&turned(middle, &p(middle))) * (end - t);
            t = if end > t { end } else { to };
            k += 1;
        }
        let mut t = from;
        let inner: Vec<f64> =
            y.samples(from, to).map(|s| s.0).filter(|s| *s > from && *s < to).collect();
        for end in inner.into_iter().chain([to]) {
            if let Some((first, second)) = y.at(t).zip(y.at(end)) {
                way += (first + second) * (0.5 * (end - t));
            }
            t = end;
        }
        a.push(turned(to, &w[1].position) - begin + turn);
        b.push(way);
    }
    (a, b)
}
