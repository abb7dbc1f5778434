//! The track in three dimensions and on the map.

use crate::columns::{ROWS, Thinned};
use crate::recording::Recording;
use crate::style::{AXES, BOUND, Colour, FILTERED, TRACK, TRUTH, path};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::StreamError;
use navfuse_core::state::Layout;
use navfuse_core::state::manifold::{Position, Rotation};
use re_sdk::EntityPath;
use re_sdk_types::archetypes::{
    Arrows3D, GeoLineStrings, GeoPoints, LineStrips3D, Transform3D, ViewCoordinates,
};
use re_sdk_types::components::Radius;
use re_sdk_types::datatypes::Quaternion;
use std::any::TypeId;

/// The greatest number of vertices of a track: more would make a software renderer slow.
const VERTICES: usize = 5000;
/// The time between two poses, ns: 50 poses a second look continuous.
const POSE_INTERVAL: i64 = 20_000_000;

/// A place: north, east, down from the origin (m), latitude and longitude (deg).
type Place = ([f32; 3], [f64; 2]);

/// The position and attitude of the vehicle over time, and its track so far.
pub struct Track {
    position: usize,
    attitude: Option<usize>,
    origin: Option<Vec<f64>>,
    estimate: Thinned<Place>,
    /// Track of the filter in a run that is smoothed.
    filtered: Thinned<Place>,
    truth: Thinned<Place>,
    times: Vec<i64>,
    places: Vec<Place>,
    attitudes: Vec<[f32; 4]>,
    last: Option<i64>,
    pub(crate) extent: Extent,
}

/// The box around the estimated and the true track.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Least north, east, down, m.
    pub low: [f32; 3],
    /// Greatest north, east, down, m.
    pub high: [f32; 3],
    /// Latitude of the first place, deg.
    pub latitude: f64,
}

impl Extent {
    const NONE: Self =
        Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3], latitude: 0.0 };

    fn include(&mut self, (ned, geo): &Place) {
        if self.low[0] > self.high[0] {
            self.latitude = geo[0];
        }
        for (k, x) in ned.iter().enumerate() {
            self.low[k] = self.low[k].min(*x);
            self.high[k] = self.high[k].max(*x);
        }
    }

    /// The middle, m, and the longest side, at least 1 m; `None` before the first place.
    pub fn middle(&self) -> Option<([f32; 3], f32)> {
        let side = (0..3).map(|k| self.high[k] - self.low[k]).fold(f32::NEG_INFINITY, f32::max);
        (side >= 0.0)
            .then(|| (std::array::from_fn(|k| 0.5 * (self.low[k] + self.high[k])), side.max(1.0)))
    }
}

impl Track {
    /// The track of the first position in the layout, with the attitude of the same owner; `None`
    /// without a position.
    pub fn new(layout: &Layout) -> Option<Self> {
        let position =
            layout.blocks.iter().position(|b| b.operations.kind == TypeId::of::<Position>())?;
        let owner = layout.blocks[position].name.split('.').next();
        let attitude = layout.blocks.iter().position(|b| {
            b.operations.kind == TypeId::of::<Rotation>() && b.name.split('.').next() == owner
        });
        Some(Self {
            position,
            attitude,
            origin: None,
            estimate: Thinned::new(VERTICES),
            filtered: Thinned::new(VERTICES),
            truth: Thinned::new(VERTICES),
            times: Vec::new(),
            places: Vec::new(),
            attitudes: Vec::new(),
            last: None,
            extent: Extent::NONE,
        })
    }

    /// Records the directions of the axes: x forward (north), y right (east), z down.
    pub fn start(&self, recording: &Recording) -> Result<(), StreamError> {
        recording.log_static(&path(&["world"]), &ViewCoordinates::FRD())
    }

    /// Adds the filter's own estimate in a run that is smoothed.
    pub fn filtered(&mut self, epoch: &Epoch<'_>) {
        let place = self.place(epoch, &epoch.state.values);
        self.extent.include(&place);
        self.filtered.push(place);
    }

    /// A position of an epoch from the first one.
    fn place(&mut self, epoch: &Epoch<'_>, values: &[f64]) -> Place {
        let block = &epoch.layout.blocks[self.position];
        let origin = self.origin.get_or_insert_with(|| values[block.range()].to_vec());
        let (mut ned, mut geo) = ([0.0; 3], [0.0; 3]);
        let value = &values[block.range()];
        (block.operations.local)(value, origin, &mut ned);
        (block.operations.coordinates)(value, &mut geo);
        (ned.map(|x| x as f32), [geo[0].to_degrees(), geo[1].to_degrees()])
    }

    /// Adds an estimate and, where it is known, the truth.
    pub fn epoch(&mut self, recording: &Recording, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        let here = self.place(epoch, &epoch.state.values);
        self.extent.include(&here);
        self.estimate.push(here);
        if let Some(truth) = epoch.truth.filter(|t| t.known[self.position]) {
            let there = self.place(epoch, &truth.state.values);
            self.extent.include(&there);
            self.truth.push(there);
        }
        let now = epoch.state.time.nanos();
        if self.last.is_none_or(|last| now - last >= POSE_INTERVAL) {
            self.last = Some(now);
            self.times.push(now);
            self.places.push(here);
            if let Some(slot) = self.attitude {
                let q = &epoch.state.values[epoch.layout.blocks[slot].range()];
                self.attitudes.push([q[1], q[2], q[3], q[0]].map(|x| x as f32));
            }
            if self.times.len() == ROWS {
                self.flush(recording)?;
            }
        }
        Ok(())
    }

    /// Sends the buffered poses.
    pub fn flush(&mut self, recording: &Recording) -> Result<(), StreamError> {
        if self.times.is_empty() {
            return Ok(());
        }
        let mut poses =
            Transform3D::update_fields().with_many_translation(self.places.iter().map(|p| p.0));
        if self.attitude.is_some() {
            let quaternions = self.attitudes.iter().map(|q| Quaternion::from_xyzw(*q));
            poses = poses.with_many_quaternion(quaternions);
        }
        let columns = poses.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&path(&["world", "vehicle"]), &self.times, columns)?;
        let points = GeoPoints::from_lat_lon(self.places.iter().map(|p| p.1));
        let columns = points.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns(&path(&["map", "vehicle"]), &self.times, columns)?;
        self.times.clear();
        self.places.clear();
        self.attitudes.clear();
        Ok(())
    }

    /// Draws the tracks so far, which replace those drawn before.
    pub fn draw(&mut self, recording: &Recording) -> Result<(), StreamError> {
        self.flush(recording)?;
        let Some((_, side)) = self.extent.middle() else { return Ok(()) };
        line(recording, "truth", &self.truth, TRUTH, 0.9)?;
        line(recording, "filtered", &self.filtered, FILTERED, 0.9)?;
        line(recording, "estimate", &self.estimate, TRACK, 1.5)?;
        // the shadow of the track at the level of its start makes a dive visible
        let shadow = self.estimate.iter().map(|(ned, _)| [ned[0], ned[1], 0.0]);
        let shadow = LineStrips3D::new([shadow.collect::<Vec<_>>()]);
        recording.log_static(&path(&["world", "shadow"]), &styled(shadow, BOUND, 0.7))?;
        let vehicle = EntityPath::from("map/vehicle");
        let look = GeoPoints::update_fields()
            .with_colors([AXES[0]])
            .with_radii([Radius::new_ui_points(7.0)]);
        recording.log_static(&vehicle, &look)?;
        let length = 0.08 * side;
        let body = Arrows3D::from_vectors([
            [length, 0.0, 0.0],
            [0.0, 0.6 * length, 0.0],
            [0.0, 0.0, 0.6 * length],
        ])
        .with_colors(AXES)
        .with_radii([Radius::new_ui_points(2.0)]);
        recording.log_static(&path(&["world", "vehicle", "body"]), &body)
    }
}

fn line(
    recording: &Recording,
    name: &str,
    track: &Thinned<Place>,
    colour: Colour,
    width: f32,
) -> Result<(), StreamError> {
    if track.len() < 2 {
        return Ok(());
    }
    let strip = LineStrips3D::new([track.iter().map(|p| p.0).collect::<Vec<_>>()]);
    recording.log_static(&path(&["world", name]), &styled(strip, colour, width))?;
    let strip = GeoLineStrings::from_lat_lon([track.iter().map(|p| p.1).collect::<Vec<_>>()]);
    let strip = strip.with_colors([colour]).with_radii([Radius::new_ui_points(width)]);
    recording.log_static(&path(&["map", name]), &strip)
}

fn styled(strip: LineStrips3D, colour: Colour, width: f32) -> LineStrips3D {
    strip.with_colors([colour]).with_radii([Radius::new_ui_points(width)])
}
