//! The eyes of the views in three dimensions, and what they see.

use crate::track::Extent;
use navfuse_core::nalgebra::Vector3;
use re_sdk_types::blueprint::archetypes::EyeControls3D;

/// Distance of the eye from the middle of the track, in radii of the sphere around it: the sphere
/// fits into a view of 2 asin(1 / 2.5), 47 degrees, and the labels of its distances into one of 55 degrees.
pub const EYE: f32 = 2.5;
/// Tangent of the angle up to which a label beside the track has room: the view sees 55 degrees from top to
/// bottom, which are 890 pixels, and half of its 900 pixels without half a label, 30 pixels, from the middle.
const SEEN: f32 = 0.52 * (450.0 - 30.0) / 445.0;
/// Direction of the eye from the middle of the track, and from a vehicle that it follows, of length
/// one: south and above, so that north is ahead and east to the right.
pub const SEEING_ALL: [f32; 3] = [-0.75, -0.25, -0.61];
pub const FOLLOWING: [f32; 3] = [-0.905, -0.302, -0.302];

/// Returns `true` for a place, north, east and down, whose label is inside of the view of the whole track, which
/// enlarges depths by that factor.
pub fn has_room(extent: &Extent, depth: f32, [north, east, down]: [f32; 3]) -> bool {
    let Some((middle, radius)) = extent.ball(depth) else { return false };
    let eye = Vector3::from(middle) + EYE * radius * Vector3::from(SEEING_ALL);
    let seen = Vector3::new(north, east, depth * down) - eye;
    let ahead = -Vector3::from(SEEING_ALL);
    // down is the third axis, so that right is the product of down and ahead
    let right = Vector3::z().cross(&ahead).normalize();
    (seen.dot(&right) / seen.dot(&ahead)).abs() < SEEN
}

/// The eye at a distance from a place.
pub fn eye(middle: [f32; 3], distance: f32, direction: [f32; 3]) -> EyeControls3D {
    let position: [f32; 3] = std::array::from_fn(|k| middle[k] + distance * direction[k]);
    EyeControls3D::new()
        .with_position(position)
        .with_look_target(middle)
        .with_eye_up([0.0, 0.0, -1.0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The dive of an AUV to 55 m, enlarged five times. At the right edge of a picture of it, the label of
    /// 1500 m east was cut; that of 1000 m was inside.
    #[test]
    fn a_distance_has_its_label_where_the_view_does_not_cut_it() {
        let (low, high) = ([-420.0, 0.0, 0.0], [1480.0, 1450.0, 55.0]);
        let extent = Extent { low, high, geo: Extent::NONE.geo };
        let south = low[0] - 0.12 * 1900.0;
        let room =
            [0.0, 500.0, 1000.0, 1500.0].map(|east| has_room(&extent, 5.0, [south, east, 0.0]));
        assert_eq!(room, [true, true, true, false]);
        // to the left of the middle is west
        assert!(!has_room(&extent, 5.0, [south, -1500.0, 0.0]));
    }
}
