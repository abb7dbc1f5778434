//! `R`: finite, symmetric and positive semi-definite at every state.

use crate::lab::{Lab, Moment};
use crate::{Failure, Report};
use navfuse_core::model::sensor::measurement::At;
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
                    "R is {fault}; put variances (sigma squared) on the diagonal, and compute R as \
                     L L' if channels are correlated"
                )))
            })
        });
        report.add("noise", part.about, outcome.map(|()| format!("R at {} states", moments.len())));
    }
}

/// Fault of a covariance, if there is one.
pub fn fault(covariance: &DMatrix<f64>) -> Option<String> {
    if let Some(bad) = covariance.iter().find(|v| !v.is_finite()) {
        return Some(format!("not finite: an element is {bad}"));
    }
    let n = covariance.nrows();
    if n == 0 {
        return None;
    }
    // correlation matrix, which does not depend on units: rows and columns divided by the sigmas
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
        format!(
            "not positive semi-definite: its correlation matrix has the eigenvalue {least:e}, so \
             a correlation exceeds 1"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_a_covariance_is_named_in_any_unit() {
        let of = |v: &[f64]| fault(&DMatrix::from_row_slice(2, 2, v));
        assert_eq!(of(&[1.0, 0.5, 0.5, 1.0]), None);
        assert_eq!(of(&[1e-12, 0.9e-6, 0.9e-6, 1.0]), None);
        assert_eq!(of(&[0.0, 0.0, 0.0, 0.0]), None);
        let fault_has =
            |v: &[f64], word: &str| assert!(of(v).is_some_and(|m| m.contains(word)), "{v:?}");
        fault_has(&[1.0, 0.5, 0.4, 1.0], "not symmetric");
        fault_has(&[1.0, 0.0, 0.0, -1.0], "not positive: the variance of axis 2");
        fault_has(&[1.0, 2.0, 2.0, 1.0], "semi-definite");
        fault_has(&[f64::NAN, 0.0, 0.0, 1.0], "not finite");
    }
}
