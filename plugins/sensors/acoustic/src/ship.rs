//! The ship of a USBL: another body than the vehicle, with a navigation of its own.
//!
//! ```text
//! p_s   = p~_s [+] e_p          C_s^n = exp([e_a x]) C~_s^n
//! ```
//! with the pose that its navigation measures, marked by `~`, and the errors `e_p` and `e_a` of that
//! navigation in north, east, down.

use navfuse_core::model::sensor::body::{Body, Pose, Track};
use navfuse_core::model::simulate::Simulate;
use navfuse_core::nalgebra::UnitQuaternion;
use navfuse_core::prelude::*;
use navfuse_core::units::Duration;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Simulated ship: a straight track or a circle at sea level, in a swell.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Course {
    /// Latitude at the time zero.
    pub latitude: Angle,
    /// Longitude at the time zero.
    pub longitude: Angle,
    /// Heading at the time zero, and direction of the track.
    pub heading: Angle,
    /// Speed.
    pub speed: Speed,
    /// Turn to the right. Default: a straight track.
    pub turn: AngularRate,
    /// Amplitude of the roll in the swell; the pitch has half of it.
    pub swell: Angle,
}

impl Default for Course {
    fn default() -> Self {
        let zero = Angle::from_si(0.0);
        let (speed, turn) = (Speed::from_si(0.0), AngularRate::from_si(0.0));
        Self { latitude: zero, longitude: zero, heading: zero, speed, turn, swell: zero }
    }
}

impl Course {
    /// Latitude, longitude (rad), height (m), roll, pitch and heading (rad) at a time, s. It rolls
    /// within 9 s and pitches within 7 s.
    pub(crate) fn pose(&self, time: f64) -> [f64; 6] {
        let (sin, cos) = self.heading.si().sin_cos();
        let start =
            Geodetic { latitude: self.latitude.si(), longitude: self.longitude.si(), height: 0.0 };
        let (turned, way) = (self.turn.si() * time, self.speed.si() * time);
        let moved = if turned == 0.0 {
            Vector3::new(cos, sin, 0.0) * way
        } else {
            // the chord of the circle: ahead by sin(a)/a, and aside by (1 - cos(a))/a of the arc
            let (ahead, aside) = (turned.sin() / turned, (1.0 - turned.cos()) / turned);
            Vector3::new(cos * ahead - sin * aside, sin * ahead + cos * aside, 0.0) * way
        };
        let here = start.displaced(&moved);
        let wave = |period: f64| self.swell.si() * (TAU * time / period).sin();
        let heading = self.heading.si() + turned;
        [here.latitude, here.longitude, 0.0, wave(9.0), wave(7.0) / 2.0, heading]
    }
}

impl Track for Course {
    fn pose(&self, time: Time) -> Pose {
        let [latitude, longitude, height, roll, pitch, heading] = self.pose(time.seconds());
        let position = Geodetic { latitude, longitude, height };
        Pose { position, c_b_n: UnitQuaternion::from_euler_angles(roll, pitch, heading) }
    }
}

/// Navigation of a ship: place and attitude of its reference point, as its INS or its GNSS compass
/// measures them. It drives a process of the type `ship`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShipNavigation {
    /// Keys that only a simulation needs.
    #[serde(default)]
    pub simulation: Course,
}

const CHANNELS: [(&str, &str); Pose::CHANNELS] = [
    ("lat", "rad"),
    ("lon", "rad"),
    ("height", "m"),
    ("roll", "rad"),
    ("pitch", "rad"),
    ("heading", "rad"),
];

impl SensorType for ShipNavigation {
    const TYPE: &'static str = "ship-navigation";
    const INPUT: bool = true;

    fn channels(&self) -> Vec<Channel> {
        Channel::all(CHANNELS).into()
    }

    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(self)))
    }
}

/// A ship beside the vehicle, for the sensors on it: its pose is that of its navigation, without the
/// errors of this navigation, which are states.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ship {
    /// Navigation of the ship: the name of its `[sensor.NAME]` table.
    #[serde(default = "navigation")]
    pub navigation: String,
    /// Error of the measured position north, east, down, with `sigma` and `correlation_time`.
    /// Default: none.
    #[serde(default)]
    pub position: LeverArm,
    /// Error of the measured attitude about north, east, down, with `sigma` and `correlation_time`.
    /// Default: none.
    #[serde(default)]
    pub attitude: Misalignment,
    /// Longest time between two samples of the navigation; sensors on the ship have no pose within a
    /// longer one. Default: 2 s.
    #[serde(default = "two_seconds")]
    pub max_gap: Positive<Duration>,
}

fn navigation() -> String {
    "ship-navigation".into()
}

fn two_seconds() -> Positive<Duration> {
    Positive::from_si(2.0)
}

const NED: &[&str] = &["north", "east", "down"];

impl ProcessType for Ship {
    const TYPE: &'static str = "ship";
    const BESIDE: bool = true;

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let navigation = composer.input::<ShipNavigation>("navigation", &self.navigation)?.clone();
        if composer.vehicle().position.is_none() {
            let text = "no process moves the vehicle, and its driving sensor gives the pace: add one, \
                        such as [process.ins]";
            return Err(ComposeError::new("", text));
        }
        let place = Display { components: NED, ..display::LEVER_ARM };
        let turn = Display { components: NED, ..display::ANGLES };
        let course = navigation.simulation;
        let body = Body {
            sensor: self.navigation.clone(),
            position_error: self.position.block(composer, "position_error", &[0.0; 3], place)?,
            attitude_error: self.attitude.block(composer, "attitude_error", &[0.0; 3], turn)?,
            max_gap: Span::from_seconds(self.max_gap.value().si()).unwrap_or_default(),
            track: Arc::new(course),
        };
        composer.moves_body(body.clone());
        Ok(BuiltProcess::new(OwnDynamics).driven_by(self.navigation, SimulatedShip(body)))
    }
}

/// Simulates the navigation of a ship with the true errors of its process.
#[derive(Clone, Debug)]
struct SimulatedShip(Body);

impl Simulate for SimulatedShip {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        self.0.measured(scene).put(sample, 0);
    }

    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}
