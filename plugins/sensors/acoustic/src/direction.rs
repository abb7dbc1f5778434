//! Range and direction in the axes of an instrument, and the same place in Cartesian axes.

use navfuse_core::nalgebra::Matrix3;
use navfuse_core::prelude::*;

/// The channels of a place in the axes of an instrument.
pub(crate) const OFFSET: [(&str, &str); 3] =
    [("offset_x", "m"), ("offset_y", "m"), ("offset_z", "m")];
/// The channels of the same place as range and direction.
pub(crate) const POLAR: [(&str, &str); 3] =
    [("range", "m"), ("bearing", "rad"), ("elevation", "rad")];

/// Computes the Cartesian channels of a sample, the first three, where it has only range, bearing and
/// elevation, which begin at the given channel.
pub(crate) fn complete(sample: &mut Sample, polar: usize) {
    let [Some(range), Some(bearing), Some(elevation)] = [0, 1, 2].map(|k| sample.get(polar + k))
    else {
        return;
    };
    let level = range * elevation.cos();
    let offset = [level * bearing.cos(), level * bearing.sin(), -range * elevation.sin()];
    for (k, value) in offset.into_iter().enumerate() {
        sample.set(k, sample.get(k).unwrap_or(value));
    }
}

/// Computes range, bearing and elevation from the Cartesian channels of a sample.
pub(crate) fn add_polar(sample: &mut Sample, polar: usize) {
    let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(|k| sample.get(k)) else { return };
    let level = x.hypot(y);
    let values = [level.hypot(z), y.atan2(x), (-z).atan2(level)];
    values.into_iter().enumerate().for_each(|(k, value)| sample.set(polar + k, value));
}

/// 1-sigma noise of range (m) and direction (rad).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Accuracy {
    pub(crate) range: f64,
    pub(crate) angle: f64,
}

impl Accuracy {
    /// `s_r^2 u u' + (s_a d)^2 (I - u u')`, with the unit vector `u` of the measured line of sight `d`,
    /// or of the predicted one where the sample has none.
    pub(crate) fn variance(
        &self,
        x: &View<'_, f64>,
        predicted: impl Fn() -> Vector3<f64>,
    ) -> SMatrix<f64, 3, 3> {
        let measured = [0, 1, 2].map(|k| x.channel(k));
        let offset = match measured {
            [Some(x), Some(y), Some(z)] => Vector3::new(x, y, z),
            _ => predicted(),
        };
        let along = offset * offset.transpose() / offset.norm_squared();
        let across = Matrix3::identity() - along;
        along * self.range.powi(2) + across * (self.angle.powi(2) * offset.norm_squared())
    }
}
