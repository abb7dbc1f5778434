//! A trajectory from a table of motion segments (as Pan & Wu 2016, Table 1).

use crate::cursor::{Cursor, Nodes};
use crate::error::TrajectoryError;
use crate::phase::{Phase, Piece, Pose};
use crate::segment::{MAX_SPEED, SegmentConfig};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::{Angle, Latitude, Length, Longitude, Quantity, Speed};
use navfuse_ins::Frame;
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// Greatest latitude, deg, of a motion to the north and to the east, which change too fast beyond it.
pub(crate) const MAX_LATITUDE: f64 = 89.0;
/// Greatest height above or depth below the ellipsoid, m.
pub(crate) const MAX_HEIGHT: f64 = 1e5;
/// Lower bound of the radii of curvature within [`MAX_HEIGHT`] of the ellipsoid, m.
pub(crate) const LEAST_RADIUS: f64 = 6.2e6;

/// Start of a trajectory and the table of its segments.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrajectoryConfig {
    /// Initial position, attitude and speed.
    #[serde(default)]
    pub start: StartConfig,
    /// The motions, one after the other.
    pub segments: Vec<SegmentConfig>,
}

/// Vehicle at the start, by default at rest on the ellipsoid at 30 deg north, level, heading north.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StartConfig {
    /// Geodetic latitude.
    pub latitude: Latitude,
    /// Longitude.
    pub longitude: Longitude,
    /// Height above the ellipsoid.
    pub height: Length,
    /// Heading of the body and of the velocity, from north to starboard.
    pub heading: Angle,
    /// Roll, kept until the end: positive is starboard down.
    pub roll: Angle,
    /// Pitch, kept until the end: positive is nose up. The velocity stays level.
    pub pitch: Angle,
    /// Forward speed.
    pub speed: Speed,
    /// Axes of the motion: `north-east-down` (default), or `wander-azimuth`, those of the start carried
    /// along: a leg of constant heading is straight then, and may lead through a pole.
    pub frame: Frame,
}

impl Default for StartConfig {
    fn default() -> Self {
        let zero = Angle::from_si(0.0);
        Self {
            latitude: Angle::from_si(30_f64.to_radians()).into(),
            longitude: zero.into(),
            height: Length::from_si(0.0),
            heading: zero,
            roll: zero,
            pitch: zero,
            speed: Speed::from_si(0.0),
            frame: Frame::default(),
        }
    }
}

/// Converts a value to SI, unless its magnitude exceeds the limit.
fn within<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>(
    key: &'static str,
    value: Quantity<L, M, T, A, K, I>,
    limit: f64,
    written: &'static str,
) -> Result<f64, TrajectoryError> {
    if value.si().abs() <= limit {
        return Ok(value.si());
    }
    Err(TrajectoryError::Start { key, value: value.to_string(), limit: written })
}

/// A part of the trajectory with one kind of motion, for a log of events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span<'a> {
    /// Row of the table, from 1.
    pub number: usize,
    /// Start, s.
    pub start: f64,
    /// End, s.
    pub end: f64,
    /// The type of the segment; of a square, `square leg 1`, `square turn 1` and so on.
    pub label: &'a str,
}

/// A smooth motion over the ellipsoid; see [`Cursor`] for its values. Cheap to clone.
#[derive(Debug, PartialEq)]
pub struct Trajectory<P: Piece = Phase> {
    pub(crate) origin: Geodetic,
    /// Not empty; each starts where the one before ends, the first at zero.
    pub(crate) pieces: Arc<[P]>,
    /// Set if the motion is in axes that are carried along.
    pub(crate) wanders: bool,
    /// Nodes of the path that its cursors share.
    pub(crate) nodes: Nodes,
}

impl<P: Piece> Clone for Trajectory<P> {
    fn clone(&self) -> Self {
        Self { pieces: Arc::clone(&self.pieces), nodes: self.nodes.clone(), ..*self }
    }
}

impl Trajectory {
    /// Checks the table and joins its segments.
    ///
    /// # Errors
    /// When the table is empty, or a number is outside of the region in which the equations hold.
    pub fn new(config: &TrajectoryConfig) -> Result<Self, TrajectoryError> {
        let start = &config.start;
        let wanders = start.frame == Frame::WanderAzimuth;
        let (most, written) = if wanders { (90.0, "90 deg") } else { (MAX_LATITUDE, "89 deg") };
        let origin = Geodetic {
            latitude: within("latitude", start.latitude.angle(), f64::to_radians(most), written)?,
            longitude: within("longitude", start.longitude.angle(), TAU, "360 deg")?,
            height: within("height", start.height, MAX_HEIGHT, "100 km")?,
        };
        let mut pose = Pose {
            speed: within("speed", start.speed, MAX_SPEED, "1000 m/s")?,
            roll: within("roll", start.roll, PI, "180 deg")?,
            pitch: within("pitch", start.pitch, FRAC_PI_2, "90 deg")?,
            heading: within("heading", start.heading, TAU, "360 deg")?,
        };

        let mut phases = Vec::new();
        let mut duration = 0.0;
        let (mut latitude, mut height) = (origin.latitude.abs(), origin.height.abs());
        for (i, segment) in config.segments.iter().enumerate() {
            let before = phases.len();
            (duration, pose) = segment.append(&mut phases, i + 1, duration, pose)?;
            for phase in &phases[before..] {
                let (horizontal, vertical) = phase.reach();
                latitude += horizontal / LEAST_RADIUS;
                height += vertical;
            }
            let reach = |key, value, limit, unit| {
                if value <= limit {
                    Ok(())
                } else {
                    Err(TrajectoryError::Reach { number: i + 1, key, value, limit, unit })
                }
            };
            if !wanders {
                reach("latitude", latitude.to_degrees(), MAX_LATITUDE, "deg")?;
            }
            reach("height", height, MAX_HEIGHT, "m")?;
        }
        if phases.is_empty() {
            return Err(TrajectoryError::Empty);
        }
        Ok(Self { origin, pieces: phases.into(), wanders, nodes: Nodes::default() })
    }
}

impl<P: Piece> Trajectory<P> {
    /// Duration, s.
    pub fn duration(&self) -> f64 {
        self.pieces.last().map_or(0.0, |piece| piece.span().1)
    }

    /// The parts, in order and without gaps.
    pub fn segments(&self) -> impl Iterator<Item = Span<'_>> {
        self.pieces.iter().map(|p| Span {
            number: p.number(),
            start: p.span().0,
            end: p.span().1,
            label: p.label(),
        })
    }

    /// A cursor at the start.
    pub fn cursor(&self) -> Cursor<P> {
        Cursor::new(self.clone())
    }
}
