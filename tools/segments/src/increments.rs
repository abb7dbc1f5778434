//! The integrals of eq. (18), as printed.

use crate::{BodyVelocity, Recording, Segment};
use nalgebra::Vector3;

/// Increments `β(t)` and `γ(t)` of Pan & Wu eq. (18) over one segment of Type I, at the times of
/// the body velocity's samples:
///
/// ```text
/// β(t) = ∫ f^b dτ - f^b(t_s) (t - t_s)
/// γ(t) = y(t) - y(t_s) - ydot(t_s) (t - t_s)          k β = C_d^b γ
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Increments {
    /// Times since the segment's start `t_s`, s.
    pub time: Vec<f64>,
    /// Increments `β` at these times, m/s.
    pub beta: Vec<Vector3<f64>>,
    /// Increments `γ` at these times, m/s.
    pub gamma: Vec<Vector3<f64>>,
}

impl Increments {
    /// Computes the increments of a segment for given anchors `f^b(t_s)`, `y(t_s)` and `ydot(t_s)`.
    /// The paper takes single samples, and a steady velocity at `t_s`.
    pub fn new(
        recording: &Recording,
        velocity: &BodyVelocity,
        segment: &Segment,
        force: &Vector3<f64>,
        y: &Vector3<f64>,
        ydot: &Vector3<f64>,
    ) -> Self {
        let mut out = Self::default();
        let imu = &recording.imu.samples;
        let mut k = imu.time.partition_point(|t| *t <= segment.from);
        // the integral up to `reached`
        let (mut integral, mut reached) = (Vector3::zeros(), segment.from);
        for (t, sample) in velocity.samples.samples(segment.from, segment.to) {
            while imu.time.get(k).is_some_and(|end| *end <= t) {
                integral += imu.value[k].force * (imu.time[k] - reached);
                reached = imu.time[k];
                k += 1;
            }
            let part = imu.value.get(k).map_or_else(Vector3::zeros, |s| s.force * (t - reached));
            let since = t - segment.from;
            out.time.push(since);
            out.beta.push(integral + part - force * since);
            out.gamma.push(sample - y - ydot * since);
        }
        out
    }

    /// Computes the increments with the paper's anchors: the first sample of each sensor at or
    /// after the segment's start, and zero acceleration. `None` without samples.
    pub fn printed(
        recording: &Recording,
        velocity: &BodyVelocity,
        segment: &Segment,
    ) -> Option<Self> {
        let (_, first) = recording.imu.samples.samples(segment.from, segment.to).next()?;
        let (_, y) = velocity.samples.samples(segment.from, segment.to).next()?;
        Some(Self::new(recording, velocity, segment, &first.force, y, &Vector3::zeros()))
    }
}
