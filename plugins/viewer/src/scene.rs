//! The run in three dimensions and on the map: track, vehicle, uncertainty and sensors.

use crate::bodies::HULL;
use crate::colours::ColourScale;
use crate::ellipses::{self, ELLIPSOID, enlargement};
use crate::eye;
use crate::map::Graticule;
use crate::plan::{self, Plan};
use crate::polar::Polar;
use crate::recording::Recording;
use crate::rig;
use crate::style::{AXES, BOUND, Colour, FILTERED, MARK, TRUTH, path};
use crate::track::{Extent, Motion, Place, Pose};
use navfuse_core::model::stream::StreamError;
use re_sdk_types::archetypes::{
    Arrows3D, Ellipsoids3D, GeoLineStrings, GeoPoints, LineStrips3D, Mesh3D, Points2D, Points3D,
    Transform3D, ViewCoordinates,
};
use re_sdk_types::components::{Color, FillMode, Radius};
use re_sdk_types::datatypes::Quaternion;

/// Length of the vehicle, as a share of the longest side of the track.
pub const VEHICLE: f32 = 0.09;
/// Length of the vehicle while viewers watch, m: an eye keeps the distance that it had at the begin.
pub const LIVE_VEHICLE: f32 = 10.0;
/// Reach of the cube around the vehicle that an eye sees that follows it, in lengths. The eye sees
/// 1.4 times as much, and with it the farthest sensor, at 0.7.
pub const AROUND: f32 = 0.78;
/// Distance at which a viewer puts an eye that tracks [`around`], in reaches: 1.5 radii of the sphere
/// around the cube of two standard deviations of its seven points.
pub const DISTANCE: f32 = 1.5 * 1.732 * 1.069;

/// Distance beyond the track up to which the grid has a label, in spacings of the labels.
const BEYOND: f32 = 0.3;

/// Records the directions of the axes: x forward (north), y right (east), z down.
pub fn start(recording: &Recording) -> Result<(), StreamError> {
    recording.log_static(&path(&["world"]), &ViewCoordinates::FRD())
}

/// Enlarges the depths in the view of the whole track, whose origin is above `/world`: the views that
/// follow a vehicle have their origin there, and are not enlarged.
pub fn exaggerate(recording: &Recording, extent: &Extent) -> Result<(), StreamError> {
    let scale = Transform3D::from_scale([1.0, 1.0, extent.exaggeration()]);
    recording.log_static(&path(&["world"]), &scale)
}

/// Radius of the ball that the eye of the whole track sees while the run goes on, m.
pub const BALL: f32 = 100.0;

/// Moves and scales the track of a run that goes on into the ball that the eye sees: viewers keep the eye
/// of the first layout, and would cut off the start of a track that grows. The views that follow a vehicle
/// have their origin at `/world`, and show it in its size.
fn fit(recording: &Recording, extent: &Extent) -> Result<(), StreamError> {
    let Some((middle, radius)) = extent.ball(1.0) else { return Ok(()) };
    let scale = BALL / radius;
    let place = Transform3D::from_translation_scale(middle.map(|x| -scale * x), scale);
    recording.log_static_to_viewers(&path(&["world"]), &place)
}

/// Draws the tracks so far, which replace those drawn before, and the vehicle where it is now; `over`
/// where the run has ended.
pub fn draw(recording: &Recording, track: &Motion, over: bool) -> Result<(), StreamError> {
    let Some((_, side)) = track.extent.middle() else { return Ok(()) };
    let length = if over { VEHICLE * side } else { LIVE_VEHICLE };
    let estimate: Vec<Place> = track.estimate.iter().collect();
    let truth: Vec<Place> = track.truth.iter().collect();
    draw_line(recording, "truth", &truth, TRUTH)?;
    draw_line(recording, "filtered", &track.filtered.iter().collect::<Vec<_>>(), FILTERED[0])?;
    draw_estimate(recording, &estimate, track.extent.level(), over)?;
    if let Some(plan) = Plan::new(&track.extent) {
        plan.draw(recording, &estimate, (&truth, track.compared), over)?;
        if !over {
            plan.fit(recording)?;
        }
    }
    if let Some(graticule) = Graticule::new(&track.extent) {
        graticule.draw(recording)?;
    }
    if let Some(polar) = Polar::of(track).filter(|_| over) {
        polar.draw(recording)?;
    }
    let depth = if over { track.extent.exaggeration() } else { 1.0 };
    draw_distances(recording, &track.extent, depth)?;
    if over {
        exaggerate(recording, &track.extent)?;
    } else {
        fit(recording, &track.extent)?;
    }
    ellipses::draw(recording, track)?;
    let ship = hull(length, HULL);
    track.bodies.iter().try_for_each(|body| body.draw(recording, &ship))?;
    draw_vehicle(recording, track, length)
}

/// Sends the last pose to the viewers that watch.
pub fn follow(recording: &Recording, track: &Motion) -> Result<(), StreamError> {
    track.bodies.iter().try_for_each(|body| body.follow(recording))?;
    match track.poses.iter().last() {
        Some(pose) => write_poses(recording, &[pose], track, true),
        None => Ok(()),
    }
}

/// Writes all poses.
pub fn finish(recording: &Recording, track: &Motion) -> Result<(), StreamError> {
    let poses: Vec<Pose> = track.poses.iter().collect();
    if poses.is_empty() {
        return Ok(());
    }
    if let Some((_, side)) = track.extent.middle() {
        let end = poses.last().map_or(0, |p| p.time);
        let vehicle = VEHICLE * side;
        track.mounts.iter().try_for_each(|mount| mount.write(recording, vehicle, end))?;
    }
    track.bodies.iter().try_for_each(|body| body.finish(recording))?;
    write_poses(recording, &poses, track, false)
}

fn draw_line(
    recording: &Recording,
    name: &str,
    places: &[Place],
    colour: Colour,
) -> Result<(), StreamError> {
    if places.len() < 2 {
        return Ok(());
    }
    let thin = Radius::new_ui_points(0.9);
    let line = LineStrips3D::new([places.iter().map(|p| p.ned)]);
    let line = line.with_colors([colour]).with_radii([thin]);
    recording.log_static(&path(&["world", name]), &line)?;
    let line = GeoLineStrings::from_lat_lon([places.iter().map(|p| p.geo)]);
    let line = line.with_colors([colour]).with_radii([thin]);
    recording.log_static(&path(&["map", name]), &line)
}

fn draw_estimate(
    recording: &Recording,
    estimate: &[Place],
    level: f32,
    over: bool,
) -> Result<(), StreamError> {
    let scale = ColourScale::over(estimate.iter().map(|p| p.sigma));
    let thick = Radius::new_ui_points(1.7);
    let pieces = scale.pieces(estimate.iter().map(|p| (p.ned, p.sigma)));
    let line = LineStrips3D::new(pieces.iter().map(|p| p.1.iter().copied()))
        .with_colors(pieces.iter().map(|p| p.0))
        .with_radii([thick]);
    recording.log_static(&path(&["world", "estimate"]), &line)?;
    let pieces = scale.pieces(estimate.iter().map(|p| (p.geo, p.sigma)));
    // lines of the map have no order: the colours of the estimate are on both sides of the truth
    let line = GeoLineStrings::from_lat_lon(pieces.iter().map(|p| p.1.clone()))
        .with_colors(pieces.iter().map(|p| p.0))
        .with_radii([Radius::new_ui_points(2.8)]);
    recording.log_static(&path(&["map", "estimate"]), &line)?;
    // the shadow of the track on the grid makes a dive visible
    let shadow = LineStrips3D::new([estimate.iter().map(|p| [p.ned[0], p.ned[1], level])]);
    let shadow = shadow.with_colors([BOUND]).with_radii([Radius::new_ui_points(0.6)]);
    recording.log_static(&path(&["world", "shadow"]), &shadow)?;
    let (Some(first), Some(last)) = (estimate.first(), estimate.last()) else { return Ok(()) };
    let size = Radius::new_ui_points(5.0);
    // while the run goes on, the vehicle is at its last place
    let count = if over { 2 } else { 1 };
    let marks = Points3D::new([first.ned, last.ned].into_iter().take(count))
        .with_labels(["start", "end"].into_iter().take(count))
        .with_colors([MARK])
        .with_radii([size]);
    recording.log_static(&path(&["world", "marks"]), &marks)?;
    let marks = GeoPoints::from_lat_lon([first.geo, last.geo].into_iter().take(count));
    let marks = marks.with_colors([MARK]).with_radii([size]);
    recording.log_static(&path(&["map", "marks"]), &marks)
}

/// Distances north and east of the start, at two edges of the grid, in a view that enlarges depths.
fn draw_distances(recording: &Recording, extent: &Extent, depth: f32) -> Result<(), StreamError> {
    let Some((_, side)) = extent.middle() else { return Ok(()) };
    let spacing = plan::round(f64::from(side) / 5.0) as f32;
    let places = |k: usize| {
        // beyond the track a label may be out of view
        let [first, last] = [extent.low[k] / spacing, extent.high[k] / spacing];
        ((first - BEYOND).ceil() as i64..=(last + BEYOND).floor() as i64)
            .map(move |n| n as f32 * spacing)
    };
    let [south, west] = [0, 1].map(|k| extent.low[k] - 0.12 * side);
    let north = places(0).map(|x| ([x, west], x));
    let east = places(1).map(|x| ([south, x], x));
    let (places, labels): (Vec<_>, Vec<_>) = north
        .chain(east)
        .map(|([north, east], x)| ([north, east, extent.level()], plan::distance(x, spacing)))
        .filter(|(place, _)| eye::has_room(extent, depth, *place))
        .unzip();
    let labels = Points3D::new(places)
        .with_labels(labels)
        .with_colors([BOUND])
        .with_radii([Radius::new_ui_points(1.0)])
        .with_show_labels(true);
    recording.log_static(&path(&["world", "distances"]), &labels)
}

/// The vehicle: a hull, axes, and the sensors at their lever arms.
fn draw_vehicle(recording: &Recording, track: &Motion, length: f32) -> Result<(), StreamError> {
    let body = |leaf: &str| path(&["world", "vehicle", leaf]);
    let shades =
        [[225, 228, 232], [235, 64, 82], [38, 166, 91], [120, 124, 130], [190, 194, 200], [250; 3]];
    recording.log_static(&body("hull"), &hull(length, shades))?;
    let axes = [[1.1, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.6]];
    let axes = Arrows3D::from_vectors(axes.map(|v| v.map(|x| x * length)))
        .with_colors(AXES)
        .with_radii([Radius::new_ui_points(1.6)]);
    recording.log_static(&body("axes"), &axes)?;
    recording.log_static(&body("around"), &around(AROUND * length))?;
    // where the whole track is in view, a mark stands for the vehicle and its sensors
    let here = Points3D::new([[0.0; 3]]).with_colors([AXES[0]]);
    let here = here.with_radii([Radius::new_ui_points(6.0)]);
    recording.log_static(&body("here"), &here)?;
    rig::draw(recording, &track.mounts, length)
}

/// Points without size or colour, two of them at that distance from the middle along every axis: an
/// eye that tracks them keeps the distance that shows the cube between them.
///
/// Viewers since 0.41 take twice the standard deviation of the points for their reach. Beside five
/// points in the middle, two points have a deviation of `sqrt(2/7)`, 0.53 of their distance.
pub fn around(reach: f32) -> Points3D {
    Points3D::new([-reach, 0.0, 0.0, 0.0, 0.0, 0.0, reach].map(|place| [place; 3]))
        .with_colors([Color::from_unmultiplied_rgba(0, 0, 0, 0)])
        .with_radii([Radius::new_ui_points(0.0)])
}

/// A hull of that length, which points forward and has a fin above it. The colours of its corners:
/// bow, left, right, bottom, top and fin.
pub fn hull(length: f32, shades: [Colour; 6]) -> Mesh3D {
    let corners = [
        [0.55, 0.0, 0.0],
        [-0.45, -0.22, 0.0],
        [-0.45, 0.22, 0.0],
        [-0.3, 0.0, 0.12],
        [-0.3, 0.0, -0.12],
        [-0.5, 0.0, -0.3],
    ];
    let faces = [[0, 1, 3], [0, 3, 2], [0, 4, 1], [0, 2, 4], [1, 4, 3], [2, 3, 4], [0, 4, 5]];
    Mesh3D::new(corners.map(|v| v.map(|x| x * length)))
        .with_triangle_indices(faces)
        .with_vertex_colors(shades.map(|[r, g, b]| Color::from_rgb(r, g, b)))
}

/// Writes poses and ellipsoids; `live` to the viewers alone.
fn write_poses(
    recording: &Recording,
    poses: &[Pose],
    track: &Motion,
    live: bool,
) -> Result<(), StreamError> {
    let times: Vec<i64> = poses.iter().map(|p| p.time).collect();
    let send = |parts: &[&str], columns| {
        if live {
            recording.columns_to_viewers(&path(parts), &times, columns)
        } else {
            recording.columns(&path(parts), &times, columns)
        }
    };
    let error = |e| recording.error(e);
    let places = || poses.iter().map(|p| p.place.ned);
    let pose = Transform3D::update_fields()
        .with_many_translation(places())
        .with_many_quaternion(poses.iter().map(|p| Quaternion::from_xyzw(p.attitude)));
    let columns: Vec<_> = pose.columns_of_unit_batches().map_err(error)?.collect();
    send(&["world", "vehicle"], columns.into_iter())?;
    let enlarged = enlargement(track);
    let ellipsoids = Ellipsoids3D::update_fields()
        .with_half_sizes(poses.iter().map(|p| p.ellipsoid.0.map(|h| h * enlarged)))
        .with_centers(places())
        .with_quaternions(poses.iter().map(|p| Quaternion::from_xyzw(p.ellipsoid.1)));
    let columns: Vec<_> = ellipsoids.columns_of_unit_batches().map_err(error)?.collect();
    send(&["world", "uncertainty"], columns.into_iter())?;
    let look = Ellipsoids3D::update_fields()
        .with_colors([ELLIPSOID])
        .with_fill_mode(FillMode::MajorWireframe);
    recording.log_static(&path(&["world", "uncertainty"]), &look)?;
    let points = GeoPoints::from_lat_lon(poses.iter().map(|p| p.place.geo));
    let columns: Vec<_> = points.columns_of_unit_batches().map_err(error)?.collect();
    send(&["map", "vehicle"], columns.into_iter())?;
    let look =
        GeoPoints::update_fields().with_colors([AXES[0]]).with_radii([Radius::new_ui_points(7.0)]);
    recording.log_static(&path(&["map", "vehicle"]), &look)?;
    let points = Points2D::update_fields().with_positions(places().map(plan::point));
    let columns: Vec<_> = points.columns_of_unit_batches().map_err(error)?.collect();
    send(&["plan", "vehicle"], columns.into_iter())?;
    let look = Points2D::update_fields()
        .with_colors([AXES[0]])
        .with_radii([Radius::new_ui_points(5.0)])
        .with_labels(["now"])
        .with_show_labels(live);
    recording.log_static(&path(&["plan", "vehicle"]), &look)
}
