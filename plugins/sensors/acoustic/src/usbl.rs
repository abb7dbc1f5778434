//! Ultra-short baseline: the place of a vehicle in the axes of a transceiver on a ship.
//!
//! ```text
//! d = k C_s^t (C_n^s (p - p_s) - l_s)
//! ```
//! with the transponder of the vehicle at `p`, the ship at `p_s` with the attitude `C_s^n`, the
//! transceiver at the lever arm `l_s` with the mounting `C_s^t`, and the ratio `k` of the speeds of
//! sound. A ship with a process of its own ([`crate::Ship`]) has states for the errors of its pose.
//! `d` is compared in Cartesian axes, where a vehicle straight below the ship has no special
//! place: a bearing is not defined there.

use crate::direction::{Accuracy, OFFSET, POLAR, add_polar, complete};
use crate::line::line;
use crate::ship::Course;
use crate::sound::Ratio;
use navfuse_core::Real;
use navfuse_core::model::sensor::body::Body;
use navfuse_core::nalgebra::Rotation3;
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Ultra-short baseline (USBL) on a ship: range and direction of the vehicle from its transceiver,
/// or the same in Cartesian axes. Each sample has the pose of the ship at that time, or the key `ship`
/// names the process that moves the ship.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Usbl {
    /// 1-sigma noise of the range.
    pub range_noise: Sigma<Length>,
    /// 1-sigma noise of the direction, about each axis across the line of sight, with the noise of
    /// the ship's attitude: 0.115 deg is 0.2 % of the slant range.
    pub angle_noise: Sigma<Angle>,
    /// Ship: the name of a `[process.NAME]` of type ship, whose navigation gives the pose at the time
    /// of a sample. Default: the channels of the pose are in each sample.
    pub ship: Option<String>,
    /// 1-sigma noise of the position of the ship, on each axis. Default: zero.
    #[serde(default = "exact")]
    pub ship_noise: Sigma<Length>,
    /// Adds the channels `range`, `bearing` and `elevation`, from which the Cartesian ones follow
    /// where a sample lacks them.
    #[serde(default)]
    pub polar: bool,
    /// Roll, pitch and yaw of the transceiver in the axes of the ship. Default: zero.
    #[serde(default)]
    pub misalignment: Misalignment,
    /// Position of the transceiver from the reference point of the ship, in the ship's axes. Default:
    /// at that point.
    #[serde(default)]
    pub transceiver: LeverArm,
    /// Position of the transponder from the IMU of the vehicle, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Speed of sound: the name of a `[process.NAME]` of type sound-speed. Default: the one that the
    /// instrument is set to.
    pub sound: Option<String>,
    /// Process whose position is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
    /// Keys that only a simulation needs: the ship, where it has no process.
    #[serde(default)]
    pub simulation: Course,
}

fn exact() -> Sigma<Length> {
    Sigma::from_si(0.0)
}

const POSE: [(&str, &str); 6] = [
    ("ship_lat", "rad"),
    ("ship_lon", "rad"),
    ("ship_height", "m"),
    ("ship_roll", "rad"),
    ("ship_pitch", "rad"),
    ("ship_heading", "rad"),
];
/// The first channel of the pose of the ship, and of range, bearing and elevation.
const SHIP: usize = OFFSET.len();
const DIRECTION: usize = SHIP + POSE.len();

impl SensorType for Usbl {
    const TYPE: &'static str = "usbl";

    fn channels(&self) -> Vec<Channel> {
        let polar = POLAR.into_iter().filter(|_| self.polar);
        let all = OFFSET.into_iter().chain(POSE).chain(polar);
        all.map(|(name, unit)| Channel::new(name, unit)).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let arm = |arm: LeverArm, composer: &mut Composer, name| {
            arm.block(composer, name, &[0.0; 3], display::LEVER_ARM)
        };
        let lever_arm = arm(self.lever_arm, composer, "lever_arm")?;
        composer.mounted(Mounting::at(lever_arm));
        let body = self.ship.as_deref().map(|name| composer.body("ship", name)).transpose()?;
        if let Some(body) = &body {
            if self.simulation != Course::default() {
                let text = "the ship has a process of its own, whose navigation simulates it: move the \
                            keys of its course there";
                return Err(ComposeError::new("simulation", text));
            }
            composer.rides(body, SHIP);
        }
        Ok(Role::measurement(UsblModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            transceiver: arm(self.transceiver, composer, "transceiver")?,
            c_s_t: self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?,
            ratio: Ratio::find(composer, self.sound.as_deref())?,
            lever_arm,
            accuracy: Accuracy {
                range: self.range_noise.value().si(),
                angle: self.angle_noise.value().si(),
            },
            ship: self.ship_noise.value().si(),
            polar: self.polar,
            simulated: self.simulation,
            body,
        }))
    }
}

/// The measurement model of a [`Usbl`].
#[derive(Clone, Debug)]
struct UsblModel {
    navigation: Navigation,
    lever_arm: Handle<Vector<3>>,
    transceiver: Handle<Vector<3>>,
    c_s_t: Handle<Rotation>,
    ratio: Ratio,
    accuracy: Accuracy,
    /// 1-sigma of the ship's position, m.
    ship: f64,
    polar: bool,
    simulated: Course,
    /// The ship, where it has a process.
    body: Option<Body>,
}

/// The pose of the ship that a sample has.
fn ship(x: &View<'_, impl Real>) -> Option<(Geodetic, Rotation3<f64>)> {
    let channel = |k| x.channel(SHIP + k);
    let (latitude, longitude, height) = (channel(0)?, channel(1)?, channel(2)?);
    let c_s_n = Rotation3::from_euler_angles(channel(3)?, channel(4)?, channel(5)?);
    Some((Geodetic { latitude, longitude, height }, c_s_n))
}

impl UsblModel {
    /// The errors of the measured pose of the ship: place, m, and attitude. Without a process of the
    /// ship they are zero.
    fn errors<T: Real>(&self, x: &View<'_, T>) -> Option<(Vector3<T>, Rotation3<T>)> {
        self.body.as_ref().map(|body| (x.get(body.position_error), x.get(body.attitude_error)))
    }
}

impl MeasurementModel<3> for UsblModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let (c_s_t, transceiver) = (x.get(self.c_s_t), x.get(self.transceiver));
        let (position, ratio) = (x.get(self.navigation.position), self.ratio.get(x));
        let lever_arm = x.get(self.navigation.attitude) * x.get(self.lever_arm);
        let errors = self.errors(x);
        let Some((place, c_s_n)) = ship(x) else {
            return SVector::repeat(convert(f64::NAN)); // the filter then rejects the sample
        };
        let mut c_n_s: Rotation3<T> = convert(c_s_n.inverse());
        // north of the vehicle is north of the ship: both turn by 1.6e-7 rad per metre
        let mut way = line(&place.cast(), &position) + lever_arm;
        if let Some((moved, turned)) = errors {
            way -= moved;
            c_n_s *= turned.inverse();
        }
        let in_ship = c_n_s * way - transceiver;
        c_s_t * in_ship * ratio
    }

    /// The noise of range and direction, and that of the ship's position.
    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        let ship = SMatrix::from_diagonal_element(self.ship.powi(2));
        self.accuracy.variance(x, || self.predict(x)) + ship
    }

    fn complete(&self, sample: &mut Sample) {
        if self.polar {
            complete(sample, DIRECTION);
        }
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        match &self.body {
            Some(body) => body.measured(scene).put(sample, SHIP),
            None => {
                let pose = self.simulated.pose(scene.to.seconds());
                pose.into_iter().enumerate().for_each(|(k, value)| sample.set(SHIP + k, value));
            }
        }
        scene.measure(self, sample);
        if self.polar {
            add_polar(sample, DIRECTION);
        }
    }
}
