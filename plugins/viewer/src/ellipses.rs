//! The uncertainty along the track: ellipses of 3 sigma from above, on the map and in three dimensions,
//! and a tube of 3 sigma around the track.

use crate::plan;
use crate::recording::Recording;
use crate::style::{Colour, path};
use crate::track::{Motion, Pose};
use navfuse_core::model::stream::StreamError;
use navfuse_core::nalgebra::{Matrix2, Quaternion, Rotation3, UnitQuaternion, Vector2, Vector3};
use re_sdk_types::archetypes::{GeoLineStrings, LineStrips2D, LineStrips3D};
use re_sdk_types::components::{DrawOrder, Radius};
use std::f64::consts::TAU;

/// Colour of ellipses and ellipsoids.
pub const ELLIPSOID: Colour = [86, 180, 233];
/// Greatest number of ellipses.
const COUNT: f32 = 24.0;
/// Number of corners of an ellipse.
const CORNERS: usize = 32;
/// Greatest half axis of the ellipses after the begin of a run, as a share of the longest side.
const USUAL: f32 = 0.06;
/// Greatest half axis of an ellipse that is drawn enlarged, as a share of the longest side: the one of a
/// prior would surround the whole track.
const LARGEST: f32 = 0.1;
/// Greatest number of poses of the tube, and its colour.
const POSES: usize = 300;
const TUBE: Colour = [52, 108, 140];
/// Length of the chord that gives the direction of the tube, as a share of the longest side.
const CHORD: f32 = 0.02;
/// Length of a degree of latitude, m: the ellipses are small.
const METRES_PER_DEGREE: f64 = 111_200.0;

/// The power of ten by which the ellipsoids are enlarged: 3 sigma of a good run is invisible beside
/// its track.
pub fn enlargement(track: &Motion) -> f32 {
    let Some((_, side)) = track.extent.middle() else { return 1.0 };
    let later = track.poses.iter().skip(track.poses.len() / 10);
    let largest = later.flat_map(|p| p.ellipsoid.0).fold(f32::MIN_POSITIVE, f32::max);
    10f32.powf((USUAL * side / largest).log10().floor()).max(1.0)
}

/// Draws the uncertainty along the track, enlarged as around the vehicle.
pub fn draw(recording: &Recording, track: &Motion) -> Result<(), StreamError> {
    let enlarged = enlargement(track);
    let all: Vec<Pose> = track.poses.iter().collect();
    let side = track.extent.middle().map_or(0.0, |(_, side)| side);
    let fits = |pose: &Pose| {
        let size = enlarged * pose.ellipsoid.0.into_iter().fold(0.0, f32::max);
        enlarged <= 1.0 || size <= LARGEST * side
    };
    let sizable: Vec<Pose> = all.iter().copied().filter(fits).collect();
    let poses = spaced(&sizable, enlarged);
    let outlines: Vec<_> = poses.iter().map(|p| outline(p, enlarged)).collect();
    let thin = Radius::new_ui_points(0.6);
    let above = |(pose, outline): (&Pose, &Vec<[f64; 2]>)| {
        let [north, east, down] = pose.place.ned;
        let corner = |p: &[f64; 2]| plan::point([north + p[0] as f32, east + p[1] as f32, down]);
        outline.iter().map(corner).collect::<Vec<_>>()
    };
    let lines = LineStrips2D::new(poses.iter().zip(&outlines).map(above))
        .with_colors([ELLIPSOID])
        .with_radii([thin])
        .with_draw_order(DrawOrder::from(1.0));
    recording.log_static(&path(&["plan", "ellipses"]), &lines)?;
    let on_map = |(pose, outline): (&Pose, &Vec<[f64; 2]>)| {
        let [latitude, longitude] = pose.place.geo;
        let east = METRES_PER_DEGREE * latitude.to_radians().cos().max(1e-3);
        let corner = |p: &[f64; 2]| [latitude + p[0] / METRES_PER_DEGREE, longitude + p[1] / east];
        outline.iter().map(corner).collect::<Vec<_>>()
    };
    let lines = GeoLineStrings::from_lat_lon(poses.iter().zip(&outlines).map(on_map))
        .with_colors([ELLIPSOID])
        .with_radii([thin]);
    recording.log_static(&path(&["map", "ellipses"]), &lines)?;
    // flat ones: where depths are enlarged, an ellipsoid becomes a spindle
    let in_space = |(pose, outline): (&Pose, &Vec<[f64; 2]>)| {
        let [north, east, down] = pose.place.ned;
        let corner = |p: &[f64; 2]| [north + p[0] as f32, east + p[1] as f32, down];
        outline.iter().map(corner).collect::<Vec<_>>()
    };
    let lines = LineStrips3D::new(poses.iter().zip(&outlines).map(in_space))
        .with_colors([ELLIPSOID])
        .with_radii([thin]);
    recording.log_static(&path(&["world", "ellipses"]), &lines)?;
    let every = all.len().div_ceil(POSES).max(1);
    let along: Vec<Pose> = all.into_iter().step_by(every).collect();
    let depth = track.extent.exaggeration();
    let limit = if enlarged * depth > 1.0 { LARGEST * side / depth } else { f32::INFINITY };
    let lines = LineStrips3D::new(tube(&along, enlarged, (CHORD * side, limit), fits))
        .with_colors([TUBE])
        .with_radii([Radius::new_ui_points(0.5)]);
    recording.log_static(&path(&["world", "tube"]), &lines)
}

/// The lines of the tube: left and right of the track, above and below it, each at the distance at which
/// the ellipsoid of 3 sigma ends in that direction. They break where an ellipsoid is too large, and those above
/// and below also where it is higher than a limit: where depths are enlarged, it is a spike.
///
/// The direction is that of a chord of some length: the first estimates of a vehicle at rest jump to and fro.
fn tube(
    poses: &[Pose],
    enlarged: f32,
    (chord, limit): (f32, f32),
    fits: impl Fn(&Pose) -> bool,
) -> Vec<Vec<[f32; 3]>> {
    let mut lines = vec![Vec::new(); 4];
    let mut broken: Vec<Vec<[f32; 3]>> = Vec::new();
    let mut right = None;
    for (at, pose) in poses.iter().enumerate() {
        let from = pose.place.ned;
        let away = |to: &Pose| [to.place.ned[0] - from[0], to.place.ned[1] - from[1]];
        let ahead = poses[at..].iter().map(away).find(|[n, e]| n.hypot(*e) > chord);
        let turned = |[north, east]: [f32; 2]| {
            let length = north.hypot(east);
            [-east / length, north / length, 0.0]
        };
        right = ahead.map(turned).or(right);
        let Some(right) = right else { continue };
        if !fits(pose) {
            broken.extend(lines.iter_mut().map(std::mem::take));
            continue;
        }
        for (k, direction) in [right, [0.0, 0.0, 1.0]].into_iter().enumerate() {
            let reach = enlarged * reach(pose, direction);
            if k == 1 && reach > limit {
                broken.extend(lines[2..].iter_mut().map(std::mem::take));
                continue;
            }
            for (n, side) in [-1.0, 1.0].into_iter().enumerate() {
                let point = |axis: usize| from[axis] + side * reach * direction[axis];
                lines[2 * k + n].push([0, 1, 2].map(point));
            }
        }
    }
    broken.extend(lines);
    broken.retain(|line| line.len() > 1);
    broken
}

/// The distance at which the ellipsoid of 3 sigma ends along a direction `d` of length one, between
/// planes across it: `sqrt(d' P d)`.
fn reach(pose: &Pose, direction: [f32; 3]) -> f32 {
    let (half, [x, y, z, w]) = pose.ellipsoid;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let along = turn.inverse() * Vector3::from(direction);
    along.component_mul(&Vector3::from(half)).norm()
}

/// Poses at equal distances along the track, so far apart that their ellipsoids do not touch.
fn spaced(poses: &[Pose], enlarged: f32) -> Vec<Pose> {
    let step = |pair: &[Pose]| {
        let [a, b] = [pair[0].place.ned, pair[1].place.ned];
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt()
    };
    let length: f32 = poses.windows(2).map(step).sum();
    let size = |pose: &Pose| enlarged * pose.ellipsoid.0.into_iter().fold(0.0, f32::max);
    let mut kept: Vec<Pose> = poses.first().copied().into_iter().collect();
    let mut travelled = 0.0;
    for pair in poses.windows(2) {
        travelled += step(pair);
        let apart = kept.last().map_or(0.0, |last| size(last) + size(&pair[1]));
        if travelled >= apart.max(length / COUNT) {
            kept.push(pair[1]);
            travelled = 0.0;
        }
    }
    kept
}

/// The closed outline of the horizontal ellipse, north and east of the place, m: the points `L u` of
/// all unit vectors `u`, with the Cholesky factor `L` of the horizontal part of the covariance.
fn outline(pose: &Pose, enlarged: f32) -> Vec<[f64; 2]> {
    let (half, [x, y, z, w]) = pose.ellipsoid;
    let [x, y, z, w] = [x, y, z, w].map(f64::from);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let axes = Rotation3::from(turn);
    let scaled =
        |row: usize, axis: usize| axes[(row, axis)] * f64::from(half[axis]) * f64::from(enlarged);
    let product = |i: usize, j: usize| (0..3).map(|k| scaled(i, k) * scaled(j, k)).sum::<f64>();
    let horizontal = Matrix2::from_fn(product);
    let factor = horizontal.cholesky().map_or_else(Matrix2::zeros, |c| c.l());
    let corner = |k: usize| {
        let (sin, cos) = (TAU * (k % CORNERS) as f64 / CORNERS as f64).sin_cos();
        (factor * Vector2::new(cos, sin)).into()
    };
    (0..=CORNERS).map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::Place;

    fn pose(north: f32, half: [f32; 3], attitude: [f32; 4]) -> Pose {
        let place = Place { ned: [north, 0.0, 0.0], geo: [0.0; 2], sigma: 0.0 };
        Pose { time: 0, place, attitude: [0.0, 0.0, 0.0, 1.0], ellipsoid: (half, attitude) }
    }

    #[test]
    fn the_outline_from_above_has_the_horizontal_axes_of_the_ellipsoid() {
        // a quarter turn about the vertical puts the long axis east
        let half_turn = std::f32::consts::FRAC_1_SQRT_2;
        let outline = outline(&pose(0.0, [3.0, 1.0, 2.0], [0.0, 0.0, half_turn, half_turn]), 10.0);
        let largest = |k: usize| outline.iter().map(|p| p[k].abs()).fold(0.0, f64::max);
        // half axes in single precision
        assert!(
            (largest(0) - 10.0).abs() < 1e-4 && (largest(1) - 30.0).abs() < 1e-4,
            "{outline:?}"
        );
        assert_eq!(outline.first(), outline.last());
    }

    /// The track goes north, so that the ellipsoid's 2 m east, 3 m down and ten times that are its sides.
    #[test]
    fn the_tube_has_the_width_and_the_height_of_the_ellipsoids_and_breaks_where_one_is_too_large() {
        let poses: Vec<Pose> =
            (0..6).map(|k| pose(k as f32, [1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0])).collect();
        let usual = (0.5, f32::INFINITY);
        let lines = tube(&poses, 10.0, usual, |_| true);
        let first: Vec<[f32; 3]> = lines.iter().map(|line| line[0]).collect();
        assert_eq!(
            first,
            [[0.0, -20.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, -30.0], [0.0, 0.0, 30.0]]
        );
        assert_eq!(tube(&poses, 10.0, usual, |pose| pose.place.ned[0] != 2.0).len(), 8);
        // 30 m down are beyond a limit of 20 m, and 20 m east are within
        assert_eq!(tube(&poses, 10.0, (0.5, 20.0), |_| true).len(), 2);
    }

    /// A vehicle stands, its first estimates jump by 1 m, and then it goes north.
    #[test]
    fn the_sides_of_the_tube_are_beside_the_track_of_a_vehicle_that_stood_at_first() {
        let mut poses: Vec<Pose> =
            (0..6).map(|k| pose(10.0 * k as f32, [1.0; 3], [0.0, 0.0, 0.0, 1.0])).collect();
        for (k, east) in [0.0, 1.0, -1.0].into_iter().enumerate() {
            let mut still = poses[0];
            still.place.ned[1] = east;
            poses.insert(k, still);
        }
        let lines = tube(&poses, 1.0, (5.0, f32::INFINITY), |_| true);
        // a side is 1 m beside the estimate, to within the angle of 1 m in 10 m
        for (left, pose) in lines[0].iter().zip(&poses) {
            assert!((left[1] - pose.place.ned[1] + 1.0).abs() < 0.01, "{left:?}");
            assert!((left[0] - pose.place.ned[0]).abs() < 0.11, "{left:?}");
        }
        assert_eq!(lines[0].len(), poses.len());
    }

    #[test]
    fn ellipsoids_along_the_track_are_few_and_do_not_touch() {
        let track = |half: f32| -> Vec<Pose> {
            (0..1000).map(|k| pose(k as f32, [half; 3], [0.0, 0.0, 0.0, 1.0])).collect()
        };
        assert_eq!(spaced(&track(1.0), 1.0).len(), 24);
        let kept = spaced(&track(50.0), 2.0);
        assert_eq!(kept.len(), 5);
        assert!(kept.windows(2).all(|p| p[1].place.ned[0] - p[0].place.ned[0] >= 200.0));
        assert_eq!(spaced(&[], 1.0).len(), 0);
    }
}
