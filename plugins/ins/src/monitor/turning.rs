//! Rule: gravity turns in body axes as the gyros turn.
//!
//! With the velocity `v` in body axes, `p = f - w x v` is the reaction to gravity and the change of
//! speed. Without the latter, `p' = -w x p`. Axes that are left-handed turn it the other way; rates
//! in deg/s turn it 57 times too far. The rule compares the residuals of that equation for the
//! samples as they are with those for each error of use.

use super::Fault;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::model::finding::{Basis, Severity};

/// Length of the blocks of which means are compared, s.
const BLOCK: f64 = 0.5;
/// Ratio of the residuals that is evidence of an error of use.
const EVIDENCE: f64 = 9.0;
/// Part of the observed change that the error of use must explain.
const EXPLAINED: f64 = 0.5;
/// Least sum of squared changes for a decision, (m/s^2)^2: rolling by 5 deg in two seconds.
const LEAST: f64 = 0.1;
/// Number of blocks before a decision.
const BLOCKS: u32 = 8;

/// Errors of use: the samples as they should be, from those that are.
#[rustfmt::skip]
const ERRORS: [(&str, [f64; 9], f64); 7] = [
    ("the gyros are in deg/s", [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 0.017_453_292_519_943_295),
    ("the x axis points backward", [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 1.0),
    ("the y axis points left", [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0], 1.0),
    ("the z axis points up", [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0], 1.0),
    ("the x and y axes are swapped", [0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], 1.0),
    ("the x and z axes are swapped", [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], 1.0),
    ("the y and z axes are swapped", [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0], 1.0),
];

/// Mean rates of a block.
#[derive(Clone, Copy, Debug)]
struct Block {
    w: Vector3<f64>,
    f: Vector3<f64>,
    v: Vector3<f64>,
}

/// Sums of squares for one reading of the samples.
#[derive(Clone, Copy, Debug, Default)]
struct Squares {
    /// Of the residuals, and of the change itself.
    residual: f64,
    change: f64,
}

impl Squares {
    /// Adds two blocks, read with axes `m` and rates times `unit`.
    fn add(&mut self, m: &Matrix3<f64>, unit: f64, before: &Block, after: &Block) {
        let p = |b: &Block| m * b.f - (m * b.w * unit).cross(&b.v);
        let (p0, p1) = (p(before), p(after));
        let angle = m * (before.w + after.w) * (0.5 * unit * BLOCK);
        let (change, turned) = (p1 - p0, -angle.cross(&((p0 + p1) * 0.5)));
        self.residual += (change - turned).norm_squared();
        self.change += change.norm_squared();
    }
}

/// Comparison of the accelerometers with the gyros.
#[derive(Clone, Default)]
pub(super) struct Turning {
    /// Velocity in body axes after the last correction, m/s.
    pub(super) velocity: Vector3<f64>,
    w: Vector3<f64>,
    f: Vector3<f64>,
    time: f64,
    before: Option<Block>,
    blocks: u32,
    right: Squares,
    wrong: [Squares; ERRORS.len()],
    reported: bool,
}

impl Turning {
    #[inline]
    pub(super) fn take(&mut self, w: &Vector3<f64>, f: &Vector3<f64>, dt: f64) -> Option<Fault> {
        self.w += w * dt;
        self.f += f * dt;
        self.time += dt;
        if self.time < BLOCK || self.reported {
            return None;
        }
        let block = Block { w: self.w / self.time, f: self.f / self.time, v: self.velocity };
        (self.w, self.f, self.time) = (Vector3::zeros(), Vector3::zeros(), 0.0);
        let before = self.before.replace(block)?;
        self.blocks += 1;
        self.right.add(&Matrix3::identity(), 1.0, &before, &block);
        for (squares, (_, axes, unit)) in self.wrong.iter_mut().zip(&ERRORS) {
            squares.add(&Matrix3::from_row_slice(axes), *unit, &before, &block);
        }
        self.decide()
    }

    fn decide(&mut self) -> Option<Fault> {
        if self.blocks < BLOCKS || self.right.residual < LEAST {
            return None;
        }
        // an error of use that puts a level vehicle on its side is none
        let level = |axes: &[f64; 9]| {
            let f =
                Matrix3::from_row_slice(axes) * self.before.map_or_else(Vector3::zeros, |b| b.f);
            f.z < -0.5 * f.norm()
        };
        let squares = self.wrong.iter().zip(&ERRORS).filter(|(_, (_, axes, _))| level(axes));
        let (best, (name, ..)) =
            squares.min_by(|(a, _), (b, _)| a.residual.total_cmp(&b.residual))?;
        let ratio = self.right.residual / best.residual;
        if best.change < LEAST || ratio < EVIDENCE || best.residual > EXPLAINED * best.change {
            return None;
        }
        self.reported = true;
        Some(Fault {
            severity: Severity::DoNotUse,
            basis: Basis::Samples,
            text: format!(
                "gravity does not turn as the gyros turn; the residuals are {:.0} times smaller if, \
                 for example, {name}",
                ratio.sqrt()
            ),
            remedy: "check the units of the gyros, and that the axes of gyros and accelerometers \
                     are forward, right, down: change the sign of one axis, or exchange two",
        })
    }
}
