//! Kinsey & Whitcomb: an adaptive identifier on SO(3) (2006), and displacements from position fixes
//! (2007).

use crate::fixes::{Fix, blocks, instrument, pairs};
use crate::solve::{Residual, covariance_of_integrals, determined, sensitivity, wahba};
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_segments::Mounting;

/// Gain of the identifier, 1/s, for unit vectors; an error about an axis perpendicular to the
/// velocity decays with the time constant `1 / GAIN`.
const GAIN: f64 = 0.02;

/// Adaptive identifier on the group of rotations (Kinsey & Whitcomb 2006), for pairs `y = R x` of
/// unit vectors:
///
/// ```text
/// dR/dt = [g (R x) × y ×] R
/// ```
/// The distance `|log(R_true' R)|` never grows, and the error vanishes if the directions of `x`
/// keep changing. The method has no scale factor and no sigma.
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
        // R <- exp([g (R x) × y ×] dt) R
        r = Rotation3::from_scaled_axis((r * x).cross(&y) * (GAIN * dt)) * r;
        history.push(IntermediateEstimate {
            time: pair.time,
            mounting: Mounting { k: initial.k, c_b_d: r.inverse() },
        });
    }
    let Some(last) = history.last() else {
        return Err(CalibrationError::Motion(
            "the vehicle does not move while there are \
                                             fixes"
                .into(),
        ));
    };
    let mut notes =
        vec![data.attitude_source(), velocities(own), "no scale factor, no sigma".into()];
    // the error about a nearly constant direction decays with the spread of the directions
    let seconds = last.time - pairs[0].time;
    let about = spread > 0.0 && GAIN * spread * seconds > 2.0;
    if !about {
        notes.push(format!(
            "the velocity keeps its direction in the instrument within {:.2} deg r.m.s.: the angle \
             about it is not determined",
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

/// Returns the spread of unit vectors about one direction: one less the largest eigenvalue of their
/// mean square.
fn spread(units: &[Vector3<f64>]) -> f64 {
    let n = units.len().max(1) as f64;
    let square = units.iter().map(|u| u * u.transpose()).sum::<Matrix3<f64>>() / n;
    (1.0 - square.symmetric_eigenvalues().max()).max(0.0)
}

/// Both displacements at a fix, less the mean of their block, m.
struct Point {
    time: f64,
    a: Vector3<f64>,
    b: Vector3<f64>,
}

/// Least squares over `k` and SO(3) of `a(t) = C_d^b b(t) / k`, with both displacements in
/// instrument axes ([`instrument`]) and each block of fixes about its own mean. (Kinsey &
/// Whitcomb's `R` has no `k`.)
pub fn displacements(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.over_ground()?;
    let blocks = blocks(data)?;
    let mut points: Vec<Vec<Point>> = Vec::new();
    let mut history = Vec::new();
    let (mut cross, mut square) = (Matrix3::zeros(), 0.0);
    for block in &blocks {
        let (a, b) = instrument(data, block, &velocity.samples);
        // running sums about the block's mean give the estimate up to each fix
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
        return Err(CalibrationError::Motion(format!(
            "the displacement is {way:.0} m r.m.s. about its mean, less than ten times the error \
             of the fixes, {:.1} m: go farther",
            blocks[0][0].sigma
        )));
    }
    let mounting = fit(&cross, square).ok_or_else(|| {
        CalibrationError::Motion(
            "the displacement keeps one direction in the instrument: turn or dive".into(),
        )
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
    let level = walk.x.max(walk.y); // the vehicle is about level
    let walk = Vector3::new(level, level, walk.z);
    let covariance = covariance_of_integrals(&residuals, walk, &velocity.initial, &mounting)
        + data.attitude_covariance(&mounting, used);
    let notes = vec![
        data.attitude_source(),
        "sigma from white noise and a random walk in the residuals, the bias of the fixes, and \
         the attitude"
            .into(),
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

/// Solves for `k` and `C_b^d` from `Σ a b'` and `Σ |b|^2`: Wahba's problem for the rotation, then
/// `1 / k = trace(C_d^b' Σ a b') / Σ |b|^2`.
fn fit(cross: &Matrix3<f64>, square: f64) -> Option<Mounting> {
    let c_d_b = wahba(cross)?;
    let inverse = (c_d_b.matrix().transpose() * cross).trace() / square;
    (inverse > 1e-6).then(|| Mounting { k: 1.0 / inverse, c_b_d: c_d_b.inverse() })
}

/// Describes the source of the velocities.
pub fn velocities(own: bool) -> String {
    if own {
        "velocities of the fixes' sensor".into()
    } else {
        "velocities from displacements of the fixes over 10 s".into()
    }
}
