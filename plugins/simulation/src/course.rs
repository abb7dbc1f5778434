//! Trajectory types of plugins: velocity and attitude as one function of time.

use crate::cursor::Nodes;
use crate::phase::{Motion, Piece, rate_of};
use crate::segment::MAX_SPEED;
use crate::source::simulate;
use crate::trajectory::{LEAST_RADIUS, MAX_HEIGHT, MAX_LATITUDE, Trajectory};
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::Real;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::state::geodesy::Geodetic;
use num_dual::Dual64;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::sync::Arc;

/// A type of trajectory, whose fields are the parameters in TOML. [`On`] turns the type into a
/// source:
///
/// ```
/// use navfuse_core::prelude::*;
/// use navfuse_core::state::geodesy::Geodetic;
/// use navfuse_core::units::{Angle, Speed, Duration};
/// use navfuse_simulation::{On, TrajectoryType};
///
/// /// A circle at constant speed.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Circle {
///     /// Geodetic latitude of the start.
///     latitude: Angle,
///     /// Speed along the circle.
///     speed: Speed,
///     /// Time of one round.
///     round: Duration,
/// }
///
/// impl TrajectoryType for Circle {
///     const TYPE: &'static str = "circle";
///     fn start(&self) -> Geodetic {
///         Geodetic { latitude: self.latitude.si(), longitude: 0.0, height: 0.0 }
///     }
///     fn duration(&self) -> f64 {
///         3.0 * self.round.si()
///     }
///     fn motion<T: Real>(&self, time: T) -> (Vector3<T>, Vector3<T>) {
///         let speed = convert::<_, T>(self.speed.si());
///         let heading = time * convert(std::f64::consts::TAU / self.round.si());
///         let velocity = Vector3::new(heading.cos() * speed, heading.sin() * speed, T::zero());
///         (velocity, Vector3::new(T::zero(), T::zero(), heading))
///     }
/// }
///
/// let mut registry = Registry::new();
/// registry.source::<On<Circle>>(); // [source.circle]
/// # // the parameters that `navfuse list circle` prints and the conformance kit checks
/// # let entry = registry.get(navfuse_core::plugin::Kind::Source, "circle").unwrap();
/// # assert!(navfuse_core::run::schema::parameters(entry).iter().any(|p| p.key == "round"));
/// ```
pub trait TrajectoryType: DeserializeOwned + JsonSchema + Send + Sync + 'static {
    /// The name in TOML.
    const TYPE: &'static str;

    /// Position of the start.
    fn start(&self) -> Geodetic;

    /// Duration, s.
    fn duration(&self) -> f64;

    /// Earth-referenced velocity in north, east, down (m/s), and roll, pitch and heading (rad, the
    /// heading not wrapped), at a time since the start (s). Dual numbers give their derivatives,
    /// acceleration and angular rate; the position is the integral of the velocity.
    fn motion<T: Real>(&self, time: T) -> (Vector3<T>, Vector3<T>);

    /// Times in increasing order, s, at which acceleration or angular rate jumps. The simulation
    /// does not interpolate across them.
    fn breaks(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Checks that the parameters are consistent.
    ///
    /// # Errors
    /// The key, its value, and the remedy.
    fn check(&self) -> Result<(), StreamError> {
        Ok(())
    }
}

/// Source that simulates every sensor on a trajectory of type `C`.
#[derive(Clone, Debug, Deserialize)]
#[serde(transparent)]
pub struct On<C>(pub C);

// the schema contains the trajectory's parameters, not a reference to them
impl<C: JsonSchema> JsonSchema for On<C> {
    fn schema_name() -> Cow<'static, str> {
        C::schema_name()
    }
    fn schema_id() -> Cow<'static, str> {
        C::schema_id()
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        C::json_schema(generator)
    }
}

impl<C: TrajectoryType> SourceType for On<C> {
    const TYPE: &'static str = C::TYPE;
    const SIMULATES: bool = true;

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        self.0.check()?;
        simulate(&Trajectory::of(self.0)?, context)
    }
}

/// Piece of a [`TrajectoryType`] between two of its breaks.
#[derive(Debug)]
pub struct Stretch<C> {
    course: Arc<C>,
    number: usize,
    start: f64,
    end: f64,
}

impl<C: TrajectoryType> Piece for Stretch<C> {
    fn number(&self) -> usize {
        self.number
    }

    fn label(&self) -> &str {
        C::TYPE
    }

    #[inline]
    fn span(&self) -> (f64, f64) {
        (self.start, self.end)
    }

    fn is_steady(&self) -> bool {
        false
    }

    fn velocity(&self, time: f64) -> Vector3<f64> {
        self.course.motion(time).0
    }

    fn euler(&self, time: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (_, euler) = self.course.motion(Dual64::from_re(time).derivative());
        (euler.map(|e| e.re), euler.map(|e| e.eps))
    }

    fn motion(&self, time: f64) -> Motion {
        let (velocity, euler) = self.course.motion(Dual64::from_re(time).derivative());
        let (angles, rates) = (euler.map(|e| e.re), euler.map(|e| e.eps));
        let c_b_n = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z)
            .to_rotation_matrix()
            .into_inner();
        Motion {
            velocity: velocity.map(|v| v.re),
            acceleration: velocity.map(|v| v.eps),
            c_b_n,
            w_nb_b: rate_of(&c_b_n, angles.x.sin_cos(), &rates),
        }
    }
}

/// Number of intervals at whose ends a trajectory is checked before its use.
const LOOKS: u32 = 1000;

impl<C: TrajectoryType> Trajectory<Stretch<C>> {
    /// Builds the trajectory that a type describes.
    ///
    /// # Errors
    /// When the duration, the breaks, the velocity or the attitude are outside of the range in
    /// which the equations hold.
    pub fn of(course: C) -> Result<Self, StreamError> {
        let refuse = |what| Err(StreamError::scenario(format!("trajectory {}: {what}", C::TYPE)));
        let (origin, duration) = (course.start(), course.duration());
        if !(duration > 0.0 && duration.is_finite()) {
            return refuse(format!("it takes {duration} s; a duration is above zero"));
        }
        let mut ends = course.breaks();
        ends.push(duration);
        if ends
            .iter()
            .zip(std::iter::once(&0.0).chain(&ends))
            .any(|(to, from)| to.partial_cmp(from) != Some(std::cmp::Ordering::Greater))
        {
            return refuse(format!(
                "its breaks {:?} are not in increasing order within its {duration} s",
                course.breaks()
            ));
        }
        let step = duration / f64::from(LOOKS);
        let mut way = 0.0;
        for k in 0..=LOOKS {
            let time = step * f64::from(k);
            let (velocity, euler) = course.motion(time);
            let speed = velocity.norm();
            if speed.is_nan() || speed > MAX_SPEED || euler.iter().any(|e| !e.is_finite()) {
                let (v, e) = (velocity.as_slice(), euler.as_slice());
                return refuse(format!(
                    "at {time} s its velocity is {v:?} m/s and its attitude {e:?} rad: both must \
                     be finite, and no speed above {MAX_SPEED} m/s"
                ));
            }
            way += speed * step;
        }
        let (latitude, height) =
            ((origin.latitude.abs() + way / LEAST_RADIUS).to_degrees(), origin.height.abs() + way);
        // not `>`, which lets a NaN through
        if !(latitude <= MAX_LATITUDE && height <= MAX_HEIGHT) {
            return refuse(format!(
                "from {:.1} deg of latitude and {:.0} m of height its way of {way:.0} m may lead \
                 beyond {MAX_LATITUDE} deg or {MAX_HEIGHT} m: shorten it or start elsewhere",
                origin.latitude.to_degrees(),
                origin.height
            ));
        }
        let course = Arc::new(course);
        let mut start = 0.0;
        let stretch = |(k, end): (usize, f64)| {
            let piece = Stretch { course: Arc::clone(&course), number: k + 1, start, end };
            start = end;
            piece
        };
        let pieces = ends.into_iter().enumerate().map(stretch).collect();
        Ok(Self { origin, pieces, wanders: false, nodes: Nodes::default() })
    }
}
