//! The number of directions in which the specific force varies: the condition of Theorem 1 on Type
//! I.

use crate::finder::{body_slopes, eigen};
use crate::{Attitude, Recording, Segment, Settings};
use nalgebra::{Matrix3, Vector3};

/// The directions of the specific-force rate `fdot^b` over one segment or several.
///
/// The rate in each bin is the slope of the specific force in local axes. So a slow change of tilt
/// counts as the rate that acts on the velocity, not as a rate of gravity in body axes. With noise
/// of sigma `s` per axis, the expectation of the mean of `fdot fdot'` is that of the motion plus
/// `s^2 I`; the noise term is subtracted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// Root-mean-square rate along each principal axis, m/s^3, the largest first; zero if it is
    /// below the noise.
    pub singular_values: Vector3<f64>,
    /// Principal axes in body axes, as columns.
    pub axes: Matrix3<f64>,
    /// Largest singular value due to noise, m/s^3.
    pub noise: f64,
    /// Number of singular values above the noise: the number of independent directions.
    pub rank: usize,
    /// Duration of the segments, s.
    pub duration: f64,
}

impl Directions {
    /// Computes the directions of one or more segments together.
    pub fn of<'a>(
        recording: &Recording,
        settings: &Settings,
        attitude: &Attitude,
        segments: impl IntoIterator<Item = &'a Segment>,
    ) -> Self {
        let (mut scatter, mut count) = (Matrix3::zeros(), 0.0_f64);
        for segment in segments {
            for s in body_slopes(recording, settings, attitude, segment) {
                scatter += s * s.transpose();
                count += 1.0;
            }
        }
        let variance = settings.slope_noise(recording).powi(2);
        let (values, axes) = eigen(scatter / count.max(1.0) - Matrix3::identity() * variance);
        // Slopes of overlapping windows are correlated: only one in `slope_bins` is independent.
        // The limit is four sigma of the mean of their squares, whose relative sigma is sqrt(2 /
        // n).
        let independent = (count / settings.slope_bins as f64).max(1.0);
        let noise = (4.0 * variance * (2.0 / independent).sqrt()).sqrt();
        let singular_values = values.map(|v| v.max(0.0).sqrt());
        let rank = singular_values.iter().filter(|s| **s > noise).count();
        Self { singular_values, axes, noise, rank, duration: count * settings.bin }
    }

    /// Returns the smallest singular value, m/s^3.
    pub fn smallest(&self) -> f64 {
        self.singular_values[2]
    }
}
