//! Bodies beside the vehicle, such as the ship above it: their tracks, and their poses over time.

use crate::columns::Thinned;
use crate::recording::Recording;
use crate::style::{Colour, path};
use navfuse_core::model::sensor::body::Pose;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;
use re_sdk_types::archetypes::{GeoLineStrings, LineStrips2D, LineStrips3D, Mesh3D, Transform3D};
use re_sdk_types::components::{DrawOrder, Radius};
use re_sdk_types::datatypes::Quaternion;

/// Greatest number of poses of a thinned recording.
const POSES: usize = 2000;
/// The colour of the track.
const TRACK: Colour = [165, 125, 205];
/// The colours of the hull.
pub const HULL: [Colour; 6] =
    [[204, 178, 230], [235, 64, 82], [38, 166, 91], [92, 68, 120], TRACK, [250; 3]];

/// A pose at one time.
#[derive(Clone, Copy, Debug)]
struct Moment {
    /// Time, ns.
    time: i64,
    /// North and east from the first position of the vehicle, and down from height zero, m.
    ned: [f32; 3],
    /// Latitude and longitude, deg.
    geo: [f64; 2],
    /// Attitude: x, y, z, w.
    attitude: [f32; 4],
}

/// A body with its poses, as its navigation measured them.
pub struct Body {
    name: String,
    poses: Thinned<Moment>,
}

impl Body {
    /// A body of that name; a full recording has all poses.
    pub fn new(name: &str, full: bool) -> Self {
        let poses = Thinned::new(if full { usize::MAX } else { POSES });
        Self { name: name.to_owned(), poses }
    }

    /// Takes a sample of the body's navigation. Returns its place: metres north and east of the origin
    /// and down from height zero, and latitude and longitude, deg.
    pub fn sample(&mut self, sample: &Sample, origin: &Geodetic) -> Option<([f32; 3], [f64; 2])> {
        let pose = Pose::of(sample, 0)?;
        let ned = pose.position.ned_from(origin);
        let ned = [ned.x, ned.y, -pose.position.height].map(|x| x as f32);
        let geo = [pose.position.latitude.to_degrees(), pose.position.longitude.to_degrees()];
        let attitude = pose.c_b_n.coords.map(|x| x as f32).into();
        self.poses.push(Moment { time: sample.time.nanos(), ned, geo, attitude });
        Some((ned, geo))
    }

    /// Draws the track so far, and the hull.
    pub fn draw(&self, recording: &Recording, hull: &Mesh3D) -> Result<(), StreamError> {
        if self.poses.len() == 0 {
            return Ok(());
        }
        let name = self.name.as_str();
        recording.log_static(&path(&["world", "bodies", name, "hull"]), hull)?;
        let thin = Radius::new_ui_points(1.2);
        let line = LineStrips3D::new([self.poses.iter().map(|p| p.ned)]);
        let line = line.with_colors([TRACK]).with_radii([thin]);
        recording.log_static(&path(&["world", "tracks", name]), &line)?;
        // east and south: the viewer's second axis points down
        let line = LineStrips2D::new([self.poses.iter().map(|p| [p.ned[1], -p.ned[0]])]);
        let line = line.with_colors([TRACK]).with_radii([thin]).with_labels([name]);
        let line = line.with_draw_order(DrawOrder::from(1.0));
        recording.log_static(&path(&["plan", "bodies", name]), &line)?;
        let line = GeoLineStrings::from_lat_lon([self.poses.iter().map(|p| p.geo)]);
        let line = line.with_colors([TRACK]).with_radii([thin]);
        recording.log_static(&path(&["map", "bodies", name]), &line)
    }

    /// Sends the last pose to the viewers that watch.
    pub fn follow(&self, recording: &Recording) -> Result<(), StreamError> {
        let last: Vec<Moment> = self.poses.iter().last().into_iter().collect();
        self.write(recording, &last, true)
    }

    /// Writes all poses.
    pub fn finish(&self, recording: &Recording) -> Result<(), StreamError> {
        self.write(recording, &self.poses.iter().collect::<Vec<_>>(), false)
    }

    fn write(
        &self,
        recording: &Recording,
        poses: &[Moment],
        live: bool,
    ) -> Result<(), StreamError> {
        if poses.is_empty() {
            return Ok(());
        }
        let times: Vec<i64> = poses.iter().map(|p| p.time).collect();
        let pose = Transform3D::update_fields()
            .with_many_translation(poses.iter().map(|p| p.ned))
            .with_many_quaternion(poses.iter().map(|p| Quaternion::from_xyzw(p.attitude)));
        let columns: Vec<_> =
            pose.columns_of_unit_batches().map_err(|e| recording.error(e))?.collect();
        let entity = path(&["world", "bodies", &self.name]);
        if live {
            recording.columns_to_viewers(&entity, &times, columns.into_iter())
        } else {
            recording.columns(&entity, &times, columns.into_iter())
        }
    }
}
