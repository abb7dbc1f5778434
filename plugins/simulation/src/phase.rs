//! One smooth piece of a trajectory.

use crate::profile::{BUMP_MEAN, Profile, Shape};
use nalgebra::{Matrix3, Vector3};

/// Final values of a phase, with which the next phase starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    /// Horizontal speed along the heading, m/s.
    pub speed: f64,
    /// Roll, rad.
    pub roll: f64,
    /// Pitch, rad.
    pub pitch: f64,
    /// Heading, rad, not wrapped.
    pub heading: f64,
}

/// Velocity and attitude, and their rates, at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Velocity, NED, m/s.
    pub velocity: Vector3<f64>,
    /// Derivative of the velocity's components, m/s^2.
    pub acceleration: Vector3<f64>,
    /// Rotation matrix from body to NED.
    pub c_b_n: Matrix3<f64>,
    /// Angular rate of the body relative to NED, in the body, rad/s.
    pub w_nb_b: Vector3<f64>,
}

/// One smooth piece of a trajectory. All times are counted from the trajectory's start, s.
///
/// ```
/// use navfuse_simulation::Piece;
/// /// Length of a piece at the speed of its middle, m.
/// fn length(piece: &impl Piece) -> f64 {
///     let (start, end) = piece.span();
///     piece.velocity(0.5 * (start + end)).norm() * (end - start)
/// }
/// ```
pub trait Piece: Send + Sync + 'static {
    /// Number of the piece's row in the table of segments, from 1.
    fn number(&self) -> usize;
    /// Name of the piece in a log.
    fn label(&self) -> &str;
    /// Start and end, s.
    fn span(&self) -> (f64, f64);
    /// Tests whether velocity and attitude are constant.
    fn is_steady(&self) -> bool;
    /// Velocity, NED, m/s.
    fn velocity(&self, time: f64) -> Vector3<f64>;
    /// Roll, pitch and heading (rad, the heading not wrapped), and their derivatives (rad/s).
    fn euler(&self, time: f64) -> (Vector3<f64>, Vector3<f64>);
    /// Velocity and attitude, and their rates.
    fn motion(&self, time: f64) -> Motion;
}

/// Rate of the body relative to NED from the derivatives of roll, pitch and heading: the inverse of
/// Groves eq. 2.58. The third row of `c_b_n` is the down axis in the body.
#[inline]
pub(crate) fn rate_of(
    c_b_n: &Matrix3<f64>,
    (sin_roll, cos_roll): (f64, f64),
    rates: &Vector3<f64>,
) -> Vector3<f64> {
    c_b_n.row(2).transpose() * rates.z
        + Vector3::new(rates.x, rates.y * cos_roll, -rates.y * sin_roll)
}

/// Sine and cosine of the heading and of the roll, and `c_b_n`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Attitude {
    sin: f64,
    cos: f64,
    sin_roll: f64,
    cos_roll: f64,
    c_b_n: Matrix3<f64>,
}

/// Piece of a segment of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    number: usize,
    label: String,
    start: f64,
    pub(crate) end: f64,
    x_rate: f64,
    pub(crate) speed: Profile,
    pub(crate) down: Profile,
    /// Horizontal speed to starboard of the heading, m/s.
    pub(crate) side: Profile,
    roll: Profile,
    pitch: Profile,
    heading: Profile,
    /// Slope of the path, upwards, rad.
    slope: Profile,
    /// Attitude of a phase in which it is constant.
    fixed: Option<Attitude>,
}

impl Phase {
    /// Builds a phase in which nothing changes.
    pub(crate) fn new(
        number: usize,
        label: String,
        start: f64,
        duration: f64,
        pose: &Pose,
    ) -> Self {
        Self {
            number,
            label,
            start,
            end: start + duration,
            x_rate: 1.0 / duration,
            speed: Profile::constant(pose.speed),
            down: Profile::default(),
            side: Profile::default(),
            roll: Profile::constant(pose.roll),
            pitch: Profile::constant(pose.pitch),
            heading: Profile::constant(pose.heading),
            slope: Profile::default(),
            fixed: Some(Attitude::new(&Vector3::new(pose.roll, pose.pitch, pose.heading))),
        }
    }

    /// Adds a change of heading, and a bank (positive into the turn) and a pitch that rise and fall
    /// back to zero, rad.
    pub(crate) fn turning(mut self, angle: f64, bank: f64, pitch: f64) -> Self {
        self.heading.step = angle;
        self.roll.bump = bank * angle.signum();
        self.pitch.bump = pitch;
        self.fixed = None;
        self
    }

    /// Adds a slope of the path that rises and falls back to zero, rad; body and velocity follow
    /// it.
    pub(crate) fn sloping(mut self, angle: f64) -> Self {
        self.slope.bump = angle;
        self.pitch.bump = angle;
        self.fixed = None;
        self
    }

    pub(crate) fn end_pose(&self) -> Pose {
        Pose {
            speed: self.speed.end(),
            roll: self.roll.end(),
            pitch: self.pitch.end(),
            heading: self.heading.end(),
        }
    }

    /// Bounds on the horizontal and the vertical distance, m.
    pub(crate) fn reach(&self) -> (f64, f64) {
        let duration = self.end - self.start;
        let speed = self.speed.start.abs() + self.speed.step.abs() + self.speed.bump.abs();
        let side = self.side.bump.abs() * BUMP_MEAN;
        let climb = speed * self.slope.bump.abs().tan();
        ((speed + side) * duration, (self.down.bump.abs() * BUMP_MEAN + climb) * duration)
    }

    /// Downward speed and its derivative, by ballast and on a slope.
    #[inline]
    fn vertical(&self, shape: &Shape, speed: f64, speed_rate: f64) -> (f64, f64) {
        let (down, rate) = (self.down.value(shape), self.down.rate(shape));
        if self.slope.is_constant() {
            return (down, rate);
        }
        let (tan, turn) = (self.slope.value(shape).tan(), self.slope.rate(shape));
        (down - speed * tan, rate - speed_rate * tan - speed * turn * (1.0 + tan * tan))
    }

    #[inline]
    fn shape(&self, t: f64) -> Shape {
        Shape::at(((t - self.start) * self.x_rate).clamp(0.0, 1.0), self.x_rate)
    }

    #[inline]
    fn euler_at(&self, shape: &Shape) -> (Vector3<f64>, Vector3<f64>) {
        (
            Vector3::new(
                self.roll.value(shape),
                self.pitch.value(shape),
                self.heading.value(shape),
            ),
            Vector3::new(self.roll.rate(shape), self.pitch.rate(shape), self.heading.rate(shape)),
        )
    }
}

impl Piece for Phase {
    fn number(&self) -> usize {
        self.number
    }

    fn label(&self) -> &str {
        &self.label
    }

    #[inline]
    fn span(&self) -> (f64, f64) {
        (self.start, self.end)
    }

    #[inline]
    fn is_steady(&self) -> bool {
        self.fixed.is_some()
            && [&self.speed, &self.down, &self.side].into_iter().all(Profile::is_constant)
    }

    #[inline]
    fn velocity(&self, t: f64) -> Vector3<f64> {
        let shape = self.shape(t);
        let (sin, cos) =
            self.fixed.map_or_else(|| self.heading.value(&shape).sin_cos(), |a| (a.sin, a.cos));
        let speed = self.speed.value(&shape);
        let (down, _) = self.vertical(&shape, speed, self.speed.rate(&shape));
        let side = self.side.value(&shape);
        Vector3::new(speed * cos - side * sin, speed * sin + side * cos, down)
    }

    fn euler(&self, t: f64) -> (Vector3<f64>, Vector3<f64>) {
        self.euler_at(&self.shape(t))
    }

    #[inline]
    fn motion(&self, t: f64) -> Motion {
        let shape = self.shape(t);
        let (attitude, turn, w_nb_b) = match self.fixed {
            Some(fixed) => (fixed, 0.0, Vector3::zeros()),
            None => {
                let (euler, rates) = self.euler_at(&shape);
                let attitude = Attitude::new(&euler);
                let w = rate_of(&attitude.c_b_n, (attitude.sin_roll, attitude.cos_roll), &rates);
                (attitude, rates.z, w)
            }
        };
        let Attitude { sin, cos, c_b_n, .. } = attitude;
        let (speed, speed_rate) = (self.speed.value(&shape), self.speed.rate(&shape));
        let side = self.side.value(&shape);
        // a phase that moves sideways does not turn
        let across = speed * turn + self.side.rate(&shape);
        let (down, down_rate) = self.vertical(&shape, speed, speed_rate);
        Motion {
            velocity: Vector3::new(speed * cos - side * sin, speed * sin + side * cos, down),
            acceleration: Vector3::new(
                speed_rate * cos - across * sin,
                speed_rate * sin + across * cos,
                down_rate,
            ),
            c_b_n,
            w_nb_b,
        }
    }
}

impl Attitude {
    /// Attitude from roll, pitch and heading, rad (Groves eq. 2.24).
    #[inline]
    fn new(euler: &Vector3<f64>) -> Self {
        let (sr, cr) = euler.x.sin_cos();
        let (sp, cp) = euler.y.sin_cos();
        let (sin, cos) = euler.z.sin_cos();
        #[rustfmt::skip]
        let c_b_n = Matrix3::new(
            cp * cos, sr * sp * cos - cr * sin, cr * sp * cos + sr * sin,
            cp * sin, sr * sp * sin + cr * cos, cr * sp * sin - sr * cos,
            -sp,      sr * cp,                  cr * cp,
        );
        Self { sin, cos, sin_roll: sr, cos_roll: cr, c_b_n }
    }
}
