//! IO-DVLC of Pan & Wu (2016) as printed: section 2.3, steps 1 and 2.

use crate::data::Gaps;
use crate::solve::wahba;
use crate::{CalibrationData, CalibrationError, Estimate, IntermediateEstimate};
use nalgebra::{Matrix3, Rotation3, Vector3};
use navfuse_segments::{Increments, Mounting};

/// Step 1 gives `k = |γ(t)| / |β(t)|` at each time, which the paper plots. As a single number this
/// method returns the ratio of the mean squares, `k^2 = ∫ |γ|^2 / ∫ |β|^2`. Step 2 is Wahba's
/// problem of the pairs `(β, γ)`. There is no sigma.
pub fn estimate(data: &CalibrationData) -> Result<Estimate, CalibrationError> {
    let velocity = data.velocity()?;
    let (segments, directions, mut notes) = data.type_one(Gaps::Refused)?;
    let mut history = Vec::new();
    let (mut beta2, mut gamma2, mut b) = (0.0, 0.0, Matrix3::zeros());
    let initial = velocity.initial;
    let mut mounting = initial;
    for segment in &segments {
        let Some(i) = Increments::printed(&data.recording, velocity, segment) else { continue };
        for ((t, beta), gamma) in i.time.iter().zip(&i.beta).zip(&i.gamma) {
            beta2 += beta.norm_squared();
            gamma2 += gamma.norm_squared();
            b += gamma * beta.transpose();
            if beta2 > 0.0 {
                mounting.k = (gamma2 / beta2).sqrt();
                mounting.c_b_d = solve_rotation(
                    &b,
                    directions.rank,
                    &directions.axes.column(0).into_owned(),
                    &initial,
                );
                history.push(IntermediateEstimate { time: segment.from + t, mounting });
            }
        }
    }
    if history.is_empty() || mounting.k <= 0.0 {
        return Err(CalibrationError::Samples(
            "the DVL has no samples on the segments of Type I: check its times".into(),
        ));
    }
    let (ratio, fit) = (
        mounting.k / initial.k,
        (mounting.c_b_d.matrix().transpose() * b).trace() / (beta2 * gamma2).sqrt(),
    );
    if !(0.5..2.0).contains(&ratio) || fit < 0.5 {
        return Err(CalibrationError::Inconsistent(format!(
            "β and γ contradict each other (k = {:.3}, correlation {fit:.2}): the anchors are \
             single samples, and where a segment does not begin in steady motion they are wrong; \
             use io-dvlc",
            mounting.k
        )));
    }
    notes.push("as printed: single samples as anchors, no Earth rate, no sigma".into());
    let used = [segments[0].from, segments[segments.len() - 1].to];
    let mut determined = [true; 4];
    if directions.rank < 2 {
        // undetermined: the angle about the body axis nearest to the single direction
        determined[1 + directions.axes.column(0).iamax()] = false;
    }
    Ok(Estimate { mounting, covariance: None, determined, history, used, notes })
}

/// Returns the rotation from body to instrument axes. For pairs with a single direction it is the
/// smallest rotation from the initial one.
fn solve_rotation(
    b: &Matrix3<f64>,
    rank: usize,
    direction: &Vector3<f64>,
    initial: &Mounting,
) -> Rotation3<f64> {
    if rank >= 2 {
        return wahba(b).unwrap_or(initial.c_b_d);
    }
    // all γ are along one direction, to which the rotation maps the axis of thrust
    let gamma = b * direction;
    let from = initial.c_b_d * direction;
    let turn = Rotation3::rotation_between(&from, &gamma).unwrap_or_else(Rotation3::identity);
    turn * initial.c_b_d
}
