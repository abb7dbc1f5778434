//! Kinsey & Whitcomb (2006): an adaptive identifier on SO(3); (2007): displacements by position fixes.

use crate::fixes::{Fix, blocks, instrument, pairs};
use crate::solve::{Residual, determined, sensitivity, shown_by_integrals, wahba};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_segments::Mounting;

/// Gain of the identifier, 1/s, for unit vectors: an error about an axis square to the velocity decays in so long.
const GAIN: f64 = 0.02;

/// `dR/dt = [g (R x) × y ×] R` for pairs `y = R x`, `x` and `y` of length one (Kinsey & Whitcomb 2006, adaptive identification on
/// the group of rotations): `d/dt |log(R_true' R)|` is never positive, and the error vanishes if the directions of `x` keep
/// changing. It has no scale factor, and no sigma.
pub fn observer(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let initial = data.velocity()?.initial;
    let (pairs, own) = pairs(data)?;
    let spread = spread(&pairs.iter().map(|p| p.y.normalize()).collect::<Vec<_>>());
    let mut r = initial.c_b_d.inverse(); // C_d^b
    let mut history = Vec::new();
    let mut before = pairs[0].time;
    for pair in pairs.iter().filter(|p| p.body.norm() > 0.2 && p.y.norm() > 0.2) {
        let dt = (pair.time - before).clamp(0.0, 10.0);
        before = pair.time;
        let (x, y) = (pair.y.normalize(), pair.body.normalize());
        r = Rotation3::from_scaled_axis((r * x).cross(&y) * (GAIN * dt)) * r;
        history.push(IntermediateEstimate {
            time: pair.time,
            mounting: Mounting { k: initial.k, c_b_d: r.inverse() },
        });
    }
    let Some(last) = history.last() else {
        return Err(CalibrationError::new("the vehicle does not move while there are fixes"));
    };
    let mut notes =
        vec![data.attitude_source(), velocities(own), "no scale factor, no sigma".into()];
    // the angle about a direction that hardly changes decays with the spread of the directions about it
    let seconds = last.time - pairs[0].time;
    let about = spread > 0.0 && GAIN * spread * seconds > 2.0;
    if !about {
        notes.push(format!(
            "the velocity keeps its direction in the instrument within {:.2} deg r.m.s.: the angle about it is not determined",
            spread.sqrt().to_degrees()
        ));
    }
    let used = [pairs[0].time, last.time];
    Ok(Estimate {
        mounting: last.mounting,
        covariance: None,
        determined: [false, about, true, true],
        history,
        used,
        notes,
    })
}

/// How far unit vectors are from one direction: one less the largest eigenvalue of their mean square.
fn spread(units: &[Vector3<f64>]) -> f64 {
    let n = units.len().max(1) as f64;
    let square = units.iter().map(|u| u * u.transpose()).sum::<Matrix3<f64>>() / n;
    (1.0 - square.symmetric_eigenvalues().max()).max(0.0)
}

/// Both sides at a fix, less their block's mean, m.
struct Point {
    time: f64,
    a: Vector3<f64>,
    b: Vector3<f64>,
}

/// `a(t) = C_d^b b(t) / k` with both sides displacements in instrument axes ([`instrument`]): least squares over `k` and
/// SO(3), each block of fixes about its own mean. (Kinsey & Whitcomb's `R` has no `k`.)
pub fn displacements(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.over_ground()?;
    let blocks = blocks(data)?;
    let mut points: Vec<Vec<Point>> = Vec::new();
    let mut history = Vec::new();
    let (mut cross, mut square) = (Matrix3::zeros(), 0.0);
    for block in &blocks {
        let (a, b) = instrument(data, block, &velocity.samples);
        // running sums about the block's own mean, for the estimate until each fix
        let (mut n, mut sa, mut sb, mut sab, mut sbb) =
            (0.0, Vector3::zeros(), Vector3::zeros(), Matrix3::zeros(), 0.0);
        for ((fix, a), b) in block.iter().zip(&a).zip(&b) {
            n += 1.0;
            sa += a;
            sb += b;
            sab += a * b.transpose();
            sbb += b.norm_squared();
            let (m, s) =
                (cross + sab - sa * sb.transpose() / n, square + sbb - sb.norm_squared() / n);
            if let Some(mounting) = fit(&m, s) {
                history.push(IntermediateEstimate { time: fix.time, mounting });
            }
        }
        cross += sab - sa * sb.transpose() / n;
        square += sbb - sb.norm_squared() / n;
        let centred =
            |((fix, a), b): ((&Fix, _), _)| Point { time: fix.time, a: a - sa / n, b: b - sb / n };
        points.push(block.iter().zip(a).zip(b).map(centred).collect());
    }
    let way = (square / points.iter().flatten().count() as f64).sqrt();
    if way < 10.0 * blocks[0][0].sigma {
        return Err(CalibrationError(format!(
            "the way is {way:.0} m r.m.s. about its mean, less than ten times the fixes' error of {:.1} m: go farther",
            blocks[0][0].sigma
        )));
    }
    let mounting = fit(&cross, square).ok_or_else(|| {
        CalibrationError::new("the way keeps one direction in the instrument: turn or dive")
    })?;
    let residuals: Vec<Vec<Residual>> = (points.iter())
        .map(|block| {
            let turned = |from: usize, to: usize| {
                let between =
                    data.attitude.at(block[from].time).inverse() * data.attitude.at(block[to].time);
                between.scaled_axis() * 0.5
            };
            let row = |(i, p): (usize, &Point)| Residual {
                time: p.time,
                h: sensitivity(&mounting, &p.b),
                z: p.a - mounting.body(&p.b),
                turn: turned(i.saturating_sub(1), (i + 1).min(block.len() - 1)),
            };
            block.iter().enumerate().map(row).collect()
        })
        .collect();
    let (first, last) = (&blocks[0], &blocks[blocks.len() - 1]);
    let used = [first[0].time, last[last.len() - 1].time];
    let walk = data.recording.positions.first().map_or_else(Vector3::zeros, |p| p.bias_walk);
    let walk = Vector3::new(walk.x.max(walk.y), walk.x.max(walk.y), walk.z); // of a vehicle that is about level
    let covariance = shown_by_integrals(&residuals, walk, &velocity.initial, &mounting)
        + data.attitude_covariance(&mounting, used);
    let notes = vec![
        data.attitude_source(),
        "sigma from the residuals as white noise and a random walk, the bias of the fixes, and the attitude".into(),
    ];
    Ok(Estimate {
        mounting,
        determined: determined(&covariance),
        covariance: Some(covariance),
        history,
        used,
        notes,
    })
}

/// `k` and `C_b^d` of `Σ a b'` and `Σ |b|^2`.
fn fit(cross: &Matrix3<f64>, square: f64) -> Option<Mounting> {
    let c_d_b = wahba(cross)?;
    let inverse = (c_d_b.matrix().transpose() * cross).trace() / square;
    (inverse > 1e-6).then(|| Mounting { k: 1.0 / inverse, c_b_d: c_d_b.inverse() })
}

/// Where the velocities come from, in words.
pub fn velocities(own: bool) -> String {
    if own {
        "velocities of the fixes' sensor".into()
    } else {
        "velocities from displacements of the fixes over 10 s".into()
    }
}
