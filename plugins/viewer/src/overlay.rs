//! The tracks of several runs on one timeline, in three dimensions and on a map.

use crate::blueprint::Layout;
use crate::recording::Recording;
use crate::style::{Colour, path};
use crate::track::{Extent, Place};
use navfuse_core::model::stream::StreamError;
use re_sdk::blueprint::{ContainerLike, Horizontal};
use re_sdk_types::archetypes::{
    GeoLineStrings, GeoPoints, LineStrips3D, Points3D, ViewCoordinates,
};
use re_sdk_types::components::Radius;

/// Size of the mark where a run is at the time of the cursor, and of the marks of the legend,
/// points.
const MARK: f32 = 4.0;
/// Growth of lines and marks with each track that is drawn over them, so that all of them remain
/// visible where runs agree.
const WIDER: f32 = 0.6;

/// The track of one run.
#[derive(Clone, Debug)]
pub struct Overlaid {
    /// Name beside the mark of the run.
    pub name: String,
    /// Colour.
    pub colour: Colour,
    /// Width of the line, points.
    pub width: f32,
    /// Time, ns; position north, east, down from an origin that all tracks share, m; latitude and
    /// longitude, deg.
    pub places: Vec<(i64, [f32; 3], [f64; 2])>,
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
    for (k, track) in tracks.iter().enumerate() {
        let wider = 1.0 + WIDER * (tracks.len() - 1 - k) as f32;
        // two runs may have the same name
        let name = format!("{} {}", k + 1, track.name);
        let width = Radius::new_ui_points(0.5 * track.width * wider);
        let line = LineStrips3D::new([track.places.iter().map(|p| p.1)])
            .with_colors([track.colour])
            .with_radii([width]);
        recording.log_static(&path(&["world", &name, "track"]), &line)?;
        let line = GeoLineStrings::from_lat_lon([track.places.iter().map(|p| p.2)])
            .with_colors([track.colour])
            .with_radii([width]);
        recording.log_static(&path(&["map", &name, "track"]), &line)?;
        let times: Vec<i64> = track.places.iter().map(|p| p.0).collect();
        let mark = Radius::new_ui_points(MARK * wider);
        let entity = path(&["world", &name, "now"]);
        let points = Points3D::update_fields().with_positions(track.places.iter().map(|p| p.1));
        let columns = points.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, columns)?;
        let look = Points3D::update_fields().with_colors([track.colour]).with_radii([mark]);
        recording.log_static(&entity, &look)?;
        let entity = path(&["map", &name, "now"]);
        let points = GeoPoints::from_lat_lon(track.places.iter().map(|p| p.2));
        let columns = points.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, columns)?;
        let look = GeoPoints::update_fields().with_colors([track.colour]).with_radii([mark]);
        recording.log_static(&entity, &look)?;
    }
    Ok(())
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
    for (_, ned, geo) in tracks.iter().flat_map(|t| &t.places) {
        extent.include(&Place { ned: *ned, geo: *geo, sigma: 0.0 });
    }
    extent
}

impl Layout {
    /// The tab of overlaid tracks; `None` without a place.
    pub fn overlay(&mut self, tracks: &[Overlaid]) -> Option<ContainerLike> {
        let extent = extent(tracks);
        extent.middle()?;
        let views = self.overviews(&extent);
        let views = Horizontal::new(views).with_column_shares(vec![1.3, 1.0]);
        Some(views.with_name("Track").into())
    }
}
