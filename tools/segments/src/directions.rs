//! In how many directions the specific force varies: the condition of Theorem 1 for Type I.

use crate::finder::{body_slopes, eigen};
use crate::{Attitude, Recording, Segment, Settings};
use nalgebra::{Matrix3, Vector3};

/// The directions of the specific-force rate `fdot^b` over one segment or several.
///
/// The rate at each bin is the slope of the specific force in local axes, so that a slow change of the tilt counts as the
/// rate that it is to the velocity and not as one of gravity. With its noise of sigma `s` an axis, the mean of `fdot fdot'` is
/// that of the motion plus `s^2 I`, which is taken off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Directions {
    /// Singular values of the rates over their number's root: the r.m.s. rate along each principal axis, m/s^3, the largest
    /// first; what is below the noise is zero.
    pub singular_values: Vector3<f64>,
    /// The principal axes in body axes, as columns.
    pub axes: Matrix3<f64>,
    /// A singular value below this is noise, m/s^3.
    pub noise: f64,
    /// How many are above it: the number of independent directions.
    pub rank: usize,
    /// Time that they were taken over, s.
    pub duration: f64,
}

impl Directions {
    /// Of one or more segments together.
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
        // slopes of windows that overlap are not independent: so many are; four sigma of the mean of their squares
        let independent = (count / settings.slope_bins as f64).max(1.0);
        let noise = (4.0 * variance * (2.0 / independent).sqrt()).sqrt();
        let singular_values = values.map(|v| v.max(0.0).sqrt());
        let rank = singular_values.iter().filter(|s| **s > noise).count();
        Self { singular_values, axes, noise, rank, duration: count * settings.bin }
    }

    /// The smallest singular value, m/s^3.
    pub fn smallest(&self) -> f64 {
        self.singular_values[2]
    }
}
