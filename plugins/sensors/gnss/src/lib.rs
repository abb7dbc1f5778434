//! GNSS: position and velocity of the antenna, as a receiver outputs them (loosely coupled; Groves
//! section 14.3), or its pseudoranges with the clock of the receiver (tightly coupled).
//!
//! `p = p_imu [+] (C_b^n l + b)`, `v = v^n + C_b^n (w_eb^b x l)`: Groves section 14.3.1, with a
//! bias `b`. `[+]` displaces a geodetic position by metres.
//!
//! Latitude and longitude are in radians, and so are their innovations; the radii of curvature at
//! the estimate convert the noise from metres to radians. In double precision an angle of pi is
//! accurate to 3 nm on the ground. The normalised innovation squared is the same as in metres.

mod clock;
mod pseudoranges;

pub use clock::ReceiverClock;
pub use pseudoranges::{Constellation, PseudorangeModel, Pseudoranges};

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{Calibration, LeverArm};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3};
use navfuse_core::plugin::{Need, Plugin, Registry, SensorType};
use navfuse_core::state::display;
use navfuse_core::state::geodesy::radii_of_curvature;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Display, Handle, View};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, LengthRandomWalk, Positive, Ratio, Sigma, Speed, Triple};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, TAU};

/// GNSS receiver: position of its antenna and, where `velocity_noise` is given, velocity. Any
/// channel may be missing: a 2-D fix has no height. Accuracies that a recording reports replace the
/// noise given here.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gnss {
    /// 1-sigma noise of one position, north and east alike.
    pub horizontal_noise: Sigma<Length>,
    /// 1-sigma noise of one height.
    pub vertical_noise: Sigma<Length>,
    /// 1-sigma noise of one velocity, one value or north, east, down. Default: no velocity
    /// channels.
    pub velocity_noise: Option<Sigma<Triple<Speed>>>,
    /// Factor on the accuracies that the receiver reports; the product is the 1-sigma of each axis.
    /// Default: 1.
    #[serde(default = "one")]
    pub accuracy_factor: Positive<Ratio>,
    /// Smallest 1-sigma of each axis, however small an accuracy the receiver reports, such as
    /// `{ horizontal = "1 cm", vertical = "2 cm" }`. Default: none.
    pub accuracy_floor: Option<AccuracyFloor>,
    /// Slowly varying error of the position, north, east, down: atmosphere, orbits, multipath. With
    /// a `correlation_time` it is a Gauss-Markov process. Default: zero.
    #[serde(default)]
    pub bias: Calibration<Triple<Length>, Triple<LengthRandomWalk>>,
    /// Position of the antenna from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion the receiver measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

/// Smallest accuracies that are taken from a receiver; one that is not given has no bound.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AccuracyFloor {
    /// 1-sigma of north and of east.
    pub horizontal: Option<Positive<Length>>,
    /// 1-sigma of the height.
    pub vertical: Option<Positive<Length>>,
    /// 1-sigma of each velocity.
    pub velocity: Option<Positive<Speed>>,
}

impl AccuracyFloor {
    /// m, m, m/s.
    fn si(self) -> [f64; 3] {
        [
            self.horizontal.map_or(0.0, |sigma| sigma.value().si()),
            self.vertical.map_or(0.0, |sigma| sigma.value().si()),
            self.velocity.map_or(0.0, |sigma| sigma.value().si()),
        ]
    }
}

fn one() -> Positive<Ratio> {
    Positive::from_si(1.0)
}

const BIAS: Display = Display { unit: "m", scale: 1.0, components: &["north", "east", "down"] };
const POSITION: [(&str, &str); 3] = [("lat", "rad"), ("lon", "rad"), ("height", "m")];
const VELOCITY: [(&str, &str); 3] = [("vel_n", "mps"), ("vel_e", "mps"), ("vel_d", "mps")];
const ACCURACY: [(&str, &str); 3] = [("h_acc", "m"), ("v_acc", "m"), ("s_acc", "mps")];
const LONGITUDE: usize = 1;

impl SensorType for Gnss {
    const TYPE: &'static str = "gnss";

    fn channels(&self) -> Vec<Channel> {
        let [position, velocity, accuracy] = [POSITION, VELOCITY, ACCURACY].map(Channel::all);
        match self.velocity_noise {
            Some(_) => [position, velocity, accuracy].concat(),
            None => [&position[..], &accuracy[..2]].concat(),
        }
    }

    fn limits(&self) -> Vec<Limit> {
        // latitude, either convention of the longitude, and heights up to the satellites
        vec![
            Limit::range("lat", -FRAC_PI_2, FRAC_PI_2),
            Limit::range("lon", -TAU, TAU),
            Limit::range("height", -12_000.0, 2e7),
        ]
    }

    // receivers output 0 N 0 E before their first fix, some with a valid status
    fn unset(&self) -> &'static [&'static str] {
        &["lat", "lon"]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let turns = self.velocity_noise.is_some() && self.lever_arm != LeverArm::default();
        let model = GnssModel {
            navigation: Navigation::find_turning(composer, &self.navigation, "lever_arm", turns)?,
            bias: self.bias.block(composer, "bias", &[0.0; 3], BIAS)?,
            lever_arm: self.lever_arm.block(
                composer,
                "lever_arm",
                &[0.0; 3],
                display::LEVER_ARM,
            )?,
            horizontal: self.horizontal_noise.value().si(),
            vertical: self.vertical_noise.value().si(),
            velocity: self.velocity_noise.map_or_else(Vector3::zeros, |noise| noise.value().si()),
            accuracy_factor: self.accuracy_factor.value().si(),
            accuracy_floor: self.accuracy_floor.unwrap_or_default().si(),
        };
        composer.mounted(Mounting::at(model.lever_arm));
        Ok(match self.velocity_noise {
            Some(_) => Role::measurement::<_, 6>(model),
            None => Role::measurement::<_, 3>(model),
        })
    }
}

/// The measurement model of a [`Gnss`]: with three rows it predicts the position, with six the
/// position and the velocity.
#[derive(Clone, Debug)]
pub struct GnssModel {
    navigation: Navigation,
    bias: Handle<Vector<3>>,
    lever_arm: Handle<Vector<3>>,
    /// 1-sigma, m.
    horizontal: f64,
    /// 1-sigma, m.
    vertical: f64,
    /// 1-sigma, m/s.
    velocity: Vector3<f64>,
    accuracy_factor: f64,
    /// Horizontal, vertical, m, and of the velocity, m/s.
    accuracy_floor: [f64; 3],
}

impl GnssModel {
    /// Latitude, longitude and height of the antenna, displaced by the bias:
    /// `p_imu [+] (C_b^n l + b)` (Groves section 14.3.1).
    ///
    /// The bias is added in north, east and down before the displacement, so that its unit is the
    /// metre at every latitude.
    fn position<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let displacement =
            x.get(self.navigation.attitude) * x.get(self.lever_arm) + x.get(self.bias);
        let antenna = x.get(self.navigation.position).displaced(&displacement);
        SVector::from([antenna.latitude, antenna.longitude, antenna.height])
    }

    /// Velocity of the antenna, north, east, down: `v^n + C_b^n (w_eb^b x l)` (Groves section
    /// 14.3.1). The rate is relative to the Earth, because the antenna's velocity is too.
    fn velocity<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let rotation = self.navigation.angular_rate(x).cross(&x.get(self.lever_arm));
        x.get(self.navigation.velocity) + x.get(self.navigation.attitude) * rotation
    }

    /// The accuracy `k` of horizontal, vertical and velocity that the receiver reports, scaled and not
    /// below its floor, if it is there and positive. The reported ones begin at the channel `first`.
    fn reported(&self, x: &View<'_, f64>, first: usize, k: usize) -> Option<f64> {
        x.channel(first + k)
            .filter(|accuracy| *accuracy > 0.0)
            .map(|accuracy| f64::max(accuracy * self.accuracy_factor, self.accuracy_floor[k]))
    }

    /// Sigma of latitude and longitude (rad) and height (m): `sigma_L = sigma / (R_N + h)`,
    /// `sigma_lon = sigma / ((R_E + h) cos L)` (Groves eq. 2.111 read as differentials). Reported
    /// accuracies begin at the channel `first`.
    fn position_sigma(&self, x: &View<'_, f64>, first: usize) -> [f64; 3] {
        let horizontal = self.reported(x, first, 0).unwrap_or(self.horizontal);
        let vertical = self.reported(x, first, 1).unwrap_or(self.vertical);
        let at = x.get(self.navigation.position);
        let (r_n, r_e) = radii_of_curvature(at.latitude);
        let cos = at.latitude.cos().abs();
        [horizontal / (r_n + at.height), horizontal / ((r_e + at.height) * cos), vertical]
    }
}

/// Computes the innovation of a channel, for longitudes the short way round: at the date line a
/// plain difference would be a full turn.
fn short_way(channel: usize, measured: f64, predicted: f64) -> f64 {
    let difference = measured - predicted;
    if channel == LONGITUDE { difference - TAU * (difference / TAU).round() } else { difference }
}

/// Wraps a simulated longitude to +-180 deg, the range that receivers output.
fn wrap_longitude(sample: &mut Sample) {
    if let Some(longitude) = sample.get(LONGITUDE) {
        sample.set(LONGITUDE, short_way(LONGITUDE, longitude, 0.0));
    }
}

impl MeasurementModel<3> for GnssModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        self.position(x)
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&SVector::from(self.position_sigma(x, 3).map(|s| s * s)))
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        short_way(channel, measured, predicted)
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure::<_, 3>(self, sample);
        wrap_longitude(sample);
    }
}

impl MeasurementModel<6> for GnssModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 6> {
        let (p, v) = (self.position(x), self.velocity(x));
        SVector::from([p.x, p.y, p.z, v.x, v.y, v.z])
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 6, 6> {
        let p = self.position_sigma(x, 6);
        let v = self.reported(x, 6, 2).map_or(self.velocity, Vector3::repeat);
        SMatrix::from_diagonal(&SVector::from([p[0], p[1], p[2], v.x, v.y, v.z].map(|s| s * s)))
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        short_way(channel, measured, predicted)
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure::<_, 6>(self, sample);
        wrap_longitude(sample);
    }
}

/// Registers the sensor types `gnss` and `pseudoranges` and the process type `receiver-clock`.
#[derive(Clone, Copy, Debug)]
pub struct GnssPlugin;

impl Plugin for GnssPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Gnss>().sensor::<Pseudoranges>().process::<ReceiverClock>();
    }

    navfuse_core::named_after_crate!();

    fn needs(&self) -> &[Need] {
        &[Need { plugin: "navfuse-ins", version: "0.1" }]
    }
}
