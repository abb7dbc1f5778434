//! The tracks of several runs on one timeline, in three dimensions and on a map.

use crate::axis::short;
use crate::blueprint::Layout;
use crate::map::Graticule;
use crate::recording::Recording;
use crate::scene::{VEHICLE, around, exaggerate, hull};
use crate::style::{Colour, path};
use crate::track::{Extent, Place};
use navfuse_core::model::stream::StreamError;
use re_sdk::blueprint::{ContainerLike, Horizontal};
use re_sdk_types::archetypes::{
    GeoLineStrings, GeoPoints, LineStrips3D, Points3D, Transform3D, ViewCoordinates,
};
use re_sdk_types::components::Radius;
use re_sdk_types::datatypes::Quaternion;

/// Size of the mark where a run is at the time of the cursor, and of the marks of the legend,
/// points.
const MARK: f32 = 4.0;
/// Growth of lines and marks with each track that is drawn over them, so that all of them remain
/// visible where runs agree.
const WIDER: f32 = 0.6;

/// Least length of the vehicles, as a share of the longest side of the tracks.
const LEAST: f32 = 1e-3;
/// Reach of the cube that the eye sees around the first vehicle, in lengths, which are twice the mean
/// distance of the others.
const AROUND: f32 = 1.0;

/// The track of one run.
#[derive(Clone, Debug)]
pub struct Overlaid {
    /// Name beside the mark of the run.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// Width of the line, points.
    pub width: f32,
    /// Places in order of time.
    pub places: Vec<OverlaidPlace>,
}

/// A place of a track.
#[derive(Clone, Copy, Debug)]
pub struct OverlaidPlace {
    /// Time, ns.
    pub time: i64,
    /// Position north, east, down from an origin that all tracks share, m.
    pub ned: [f32; 3],
    /// Latitude and longitude, deg.
    pub geo: [f64; 2],
    /// Attitude: x, y, z, w.
    pub attitude: Option<[f32; 4]>,
}

impl Overlaid {
    /// Name of the track in entities: two runs may have the same name.
    fn entity(&self, k: usize) -> String {
        format!("{} {}", k + 1, self.name)
    }

    /// Returns `true` for a track with an attitude, which has a vehicle.
    fn turns(&self) -> bool {
        self.places.iter().any(|p| p.attitude.is_some())
    }
}

/// Writes the tracks, and where each run is at every time.
///
/// # Errors
/// When the recording cannot be written.
pub fn draw(recording: &Recording, tracks: &[Overlaid]) -> Result<(), StreamError> {
    if tracks.is_empty() {
        return Ok(());
    }
    recording.log_static(&path(&["world"]), &ViewCoordinates::FRD())?;
    draw_legend(recording, tracks)?;
    let extent = extent(tracks);
    exaggerate(recording, &extent)?;
    if let Some(graticule) = Graticule::new(&extent) {
        graticule.draw(recording)?;
    }
    let length = extent.middle().map_or(0.0, |(_, side)| length(tracks, side));
    for (k, track) in tracks.iter().enumerate() {
        let wider = 1.0 + WIDER * (tracks.len() - 1 - k) as f32;
        let name = track.entity(k);
        let width = Radius::new_ui_points(0.5 * track.width * wider);
        let line = LineStrips3D::new([track.places.iter().map(|p| p.ned)])
            .with_colors([track.colour])
            .with_radii([width]);
        recording.log_static(&path(&["world", &name, "track"]), &line)?;
        let line = GeoLineStrings::from_lat_lon([track.places.iter().map(|p| p.geo)])
            .with_colors([track.colour])
            .with_radii([width]);
        recording.log_static(&path(&["map", &name, "track"]), &line)?;
        let times: Vec<i64> = track.places.iter().map(|p| p.time).collect();
        let mark = Radius::new_ui_points(MARK * wider);
        let entity = path(&["world", &name, "now"]);
        let points = Points3D::update_fields().with_positions(track.places.iter().map(|p| p.ned));
        let columns = points.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, columns)?;
        let look = Points3D::update_fields().with_colors([track.colour]).with_radii([mark]);
        recording.log_static(&entity, &look)?;
        let entity = path(&["map", &name, "now"]);
        let points = GeoPoints::from_lat_lon(track.places.iter().map(|p| p.geo));
        let columns = points.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, columns)?;
        let look = GeoPoints::update_fields().with_colors([track.colour]).with_radii([mark]);
        recording.log_static(&entity, &look)?;
        draw_vehicle(recording, &name, track, length, k)?;
    }
    Ok(())
}

/// Draws the vehicle of the `k`-th run in the run's colour, with its name.
fn draw_vehicle(
    recording: &Recording,
    name: &str,
    track: &Overlaid,
    length: f32,
    k: usize,
) -> Result<(), StreamError> {
    let poses: Vec<(&OverlaidPlace, [f32; 4])> =
        track.places.iter().filter_map(|p| Some((p, p.attitude?))).collect();
    if poses.is_empty() {
        return Ok(());
    }
    let times: Vec<i64> = poses.iter().map(|p| p.0.time).collect();
    let pose = Transform3D::update_fields()
        .with_many_translation(poses.iter().map(|p| p.0.ned))
        .with_many_quaternion(poses.iter().map(|p| Quaternion::from_xyzw(p.1)));
    let columns = pose.columns_of_unit_batches().map_err(|e| recording.error(e))?;
    recording.columns(&path(&["world", name, "vehicle"]), &times, columns)?;
    let shade = |light: f32| track.colour.map(|c| (f32::from(c) * light).min(255.0) as u8);
    let shades = [1.3, 0.8, 1.0, 0.5, 1.2, 1.5].map(shade);
    let body = |leaf: &str| path(&["world", name, "vehicle", leaf]);
    recording.log_static(&body("hull"), &hull(length, shades))?;
    recording.log_static(&body("around"), &around(AROUND * length))?;
    // the names of vehicles at one place are above each other
    let label = Points3D::new([[0.0, 0.0, -(0.3 + 0.25 * k as f32) * length]])
        .with_labels([track.name.as_str()])
        .with_show_labels(true)
        .with_colors([track.colour])
        .with_radii([Radius::new_ui_points(MARK)]);
    recording.log_static(&body("name"), &label)
}

/// The length of the vehicles: twice the mean distance between the first one and the others, so that
/// a view that follows them shows the distance.
fn length(tracks: &[Overlaid], side: f32) -> f32 {
    let mut vehicles = tracks.iter().filter(|t| t.turns());
    let Some(first) = vehicles.next() else { return 0.0 };
    let there = |place: &OverlaidPlace| {
        let at = first.places.partition_point(|p| p.time < place.time);
        let other = first.places.get(at)?;
        let square = (0..3).map(|k| (place.ned[k] - other.ned[k]).powi(2)).sum::<f32>();
        (other.time == place.time).then(|| square.sqrt())
    };
    let distances = vehicles.flat_map(|t| t.places.iter().filter_map(there));
    let (sum, count) = distances.fold((0.0, 0.0_f32), |(sum, n), d| (sum + d, n + 1.0));
    (2.0 * sum / count.max(1.0)).clamp(LEAST * side, VEHICLE * side)
}

/// Draws the names of the tracks in their colours, in a row south of the tracks: beside the marks
/// they would cover each other.
fn draw_legend(recording: &Recording, tracks: &[Overlaid]) -> Result<(), StreamError> {
    let extent = extent(tracks);
    let Some((_, side)) = extent.middle() else { return Ok(()) };
    let place = |k: usize| {
        [extent.low[0] - 0.12 * side, extent.low[1] + 0.15 * side * k as f32, extent.high[2]]
    };
    let legend = Points3D::new((0..tracks.len()).map(place))
        .with_labels(tracks.iter().map(|t| t.name.as_str()))
        .with_show_labels(true)
        .with_colors(tracks.iter().map(|t| t.colour))
        .with_radii([Radius::new_ui_points(MARK)]);
    recording.log_static(&path(&["world", "legend"]), &legend)
}

/// The box around all tracks.
fn extent(tracks: &[Overlaid]) -> Extent {
    let mut extent = Extent::NONE;
    for OverlaidPlace { ned, geo, .. } in tracks.iter().flat_map(|t| &t.places) {
        extent.include(&Place { ned: *ned, geo: *geo, sigma: 0.0 });
    }
    extent
}

impl Layout {
    /// The tab of overlaid tracks; `None` without a place.
    pub fn overlay(&mut self, tracks: &[Overlaid]) -> Option<ContainerLike> {
        let extent = extent(tracks);
        extent.middle()?;
        let depth = if self.ranges { extent.exaggeration() } else { 1.0 };
        let name = match depth > 1.0 {
            true => format!("3-D track, depth x {depth}"),
            false => "3-D track".to_owned(),
        };
        let views = self.overviews(&name, &extent);
        let views = Horizontal::new(views).with_column_shares(vec![1.3, 1.0]);
        Some(views.with_name("Track").into())
    }

    /// The view that follows the vehicles of the runs; `None` without an attitude.
    pub fn vehicles(&mut self, tracks: &[Overlaid]) -> Option<ContainerLike> {
        let (k, first) = tracks.iter().enumerate().find(|(_, track)| track.turns())?;
        let extent = extent(tracks);
        let (_, side) = extent.middle()?;
        let name = format!("Vehicles of all runs, {} m long", short(length(tracks, side).into()));
        // the names are at the vehicles
        let view = self.space(&name, "/world", &extent, &["+ /world/**", "- /world/legend"]);
        let entity = path(&["world", &first.entity(k), "vehicle", "around"]);
        self.eye_follows(&view, &entity.to_string(), AROUND * length(tracks, side));
        Some(view)
    }
}
