//! `R`: finite, symmetric and positive semi-definite wherever the model is asked.

use crate::lab::{Lab, Moment};
use crate::{Failure, Report};
use navfuse_core::model::measurement::At;
use navfuse_core::nalgebra::DMatrix;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    let layout = &lab.composition.layout;
    for (part, model) in lab.models() {
        let n = model.channels();
        let mut values = vec![0.0; n * n];
        let moments = lab.moments_of(part.index, layout);
        let outcome = moments.iter().try_for_each(|Moment { state, sample }| {
            model.noise(&At { layout, state, sample }, &mut values);
            fault(&DMatrix::from_row_slice(n, n, &values)).map_or(Ok(()), |fault| {
                Err(Failure::new(format!(
                    "R is {fault}; give variances (sigma squared) on the diagonal, and a covariance as L L' if channels correlate"
                )))
            })
        });
        report.add("noise", part.about, outcome.map(|()| format!("R of {} states", moments.len())));
    }
}

/// What is wrong with a covariance, if anything.
pub fn fault(covariance: &DMatrix<f64>) -> Option<String> {
    if let Some(bad) = covariance.iter().find(|v| !v.is_finite()) {
        return Some(format!("not finite: an element is {bad}"));
    }
    let n = covariance.nrows();
    if n == 0 {
        return None;
    }
    // each axis in its own unit: rows and columns divided by the root of the diagonal
    let scale: Vec<f64> =
        (0..n).map(|i| covariance[(i, i)].abs().sqrt().max(f64::MIN_POSITIVE)).collect();
    for i in 0..n {
        for j in 0..i {
            let (a, b) = (covariance[(i, j)], covariance[(j, i)]);
            if (a - b).abs() > 1e-12 * scale[i] * scale[j] {
                return Some(format!(
                    "not symmetric: element ({},{}) is {a:e}, its mirror image {b:e}",
                    i + 1,
                    j + 1
                ));
            }
        }
        if covariance[(i, i)] < 0.0 {
            return Some(format!(
                "not positive: the variance of axis {} is {:e}",
                i + 1,
                covariance[(i, i)]
            ));
        }
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let least = scaled.symmetric_eigenvalues().iter().fold(f64::INFINITY, |a, x| a.min(*x));
    (least < -1e-12 * n as f64).then(|| {
        format!("not positive semi-definite: an eigenvalue of its correlation is {least:e}, so that some correlation is above 1")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariance_is_one_in_any_unit_or_is_told_why_not() {
        let of = |v: &[f64]| fault(&DMatrix::from_row_slice(2, 2, v));
        assert_eq!(of(&[1.0, 0.5, 0.5, 1.0]), None);
        assert_eq!(of(&[1e-12, 0.9e-6, 0.9e-6, 1.0]), None);
        assert_eq!(of(&[0.0, 0.0, 0.0, 0.0]), None);
        let told =
            |v: &[f64], word: &str| assert!(of(v).is_some_and(|m| m.contains(word)), "{v:?}");
        told(&[1.0, 0.5, 0.4, 1.0], "not symmetric");
        told(&[1.0, 0.0, 0.0, -1.0], "not positive: the variance of axis 2");
        told(&[1.0, 2.0, 2.0, 1.0], "semi-definite");
        told(&[f64::NAN, 0.0, 0.0, 1.0], "not finite");
    }
}
