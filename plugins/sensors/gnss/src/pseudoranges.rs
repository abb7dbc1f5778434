//! Pseudoranges of a GNSS receiver (tightly coupled): one observation for each satellite in view.
//!
//! `z = |s - p| + w/c (s_x p_y - s_y p_x) + b`: the distance of the antenna `p` from the satellite `s`, both
//! in Earth-fixed axes, `s` in those of the transmission; the Earth turns while the signal is under way
//! (Sagnac, RTKLIB manual 2.4.2, eq. E.3.8b); and the offset `b` of the receiver's clock, a state of
//! [`ReceiverClock`].
//!
//! [`ReceiverClock`]: crate::ReceiverClock

use navfuse_core::prelude::*;
use navfuse_core::state::manifold::Vector;
use navfuse_ins::Navigation;
use navfuse_ins::earth::EARTH_RATE;
use std::f64::consts::TAU;

/// Time of one revolution of a GPS satellite, half a sidereal day, s.
const REVOLUTION: f64 = 43_082.0;
/// Radius of the orbit of a GPS satellite, m.
const ORBIT: f64 = 26_560e3;
/// Speed of light, m/s.
const LIGHT: f64 = 299_792_458.0;
/// Largest number of satellites at one time: four constellations have some 50 in view.
const MOST: usize = 64;

// ANCHOR: sensor
/// GNSS receiver that gives the pseudorange to each satellite in view, without the errors that its
/// message and models correct: clock of the satellite, ionosphere and troposphere.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pseudoranges {
    /// 1-sigma noise of a pseudorange at the zenith.
    pub noise: Sigma<Length>,
    /// Part of the 1-sigma that grows with 1/sin of the elevation, at the zenith: atmosphere and
    /// multipath. It adds to `noise` as a variance. Default: none.
    pub elevation_noise: Option<Sigma<Length>>,
    /// Position of the antenna from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process of the receiver's clock.
    #[serde(default = "clock")]
    pub clock: String,
    /// Process whose motion the receiver measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
    /// Keys that only a simulation needs.
    #[serde(default)]
    pub simulation: Constellation,
}

/// Satellites of a simulation.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Constellation {
    /// Number of satellites in orbit, of which about a third are in view.
    pub satellites: usize,
    /// Elevation below which the receiver does not track a satellite.
    pub mask: Angle,
}

impl Default for Constellation {
    fn default() -> Self {
        Self { satellites: 32, mask: Angle::from_si(10_f64.to_radians()) }
    }
}

fn clock() -> String {
    "receiver-clock".into()
}

/// The measurement model of [`Pseudoranges`].
#[derive(Clone, Debug)]
pub struct PseudorangeModel {
    navigation: Navigation,
    clock: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    /// Variances at the zenith, m^2: of the part that is the same at each elevation, and of the other.
    variances: [f64; 2],
    constellation: Constellation,
}

impl SensorType for Pseudoranges {
    const TYPE: &'static str = "pseudoranges";

    /// The pseudorange, and the place of the satellite in Earth-fixed axes.
    fn channels(&self) -> Vec<Channel> {
        ["pseudorange", "sat_x", "sat_y", "sat_z"].map(|name| Channel::new(name, "m")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let navigation = Navigation::find(composer, "navigation", &self.navigation)?;
        let clock = composer.find("clock", &format!("{}.offset", self.clock))?;
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        composer.mounted(Mounting::at(lever_arm));
        let variance = |sigma: Sigma<Length>| sigma.value().si().powi(2);
        let variances = [variance(self.noise), self.elevation_noise.map_or(0.0, variance)];
        let constellation = self.simulation;
        Ok(Role::measurement(PseudorangeModel {
            navigation,
            clock,
            lever_arm,
            variances,
            constellation,
        }))
    }
}

impl PseudorangeModel {
    /// Place of the antenna.
    fn antenna<T: Real>(&self, x: &View<'_, T>) -> Geodetic<T> {
        self.navigation.position_at(x, &x.get(self.lever_arm))
    }
}

/// Place of the satellite. A recording without it has no prediction, and is rejected.
fn satellite(x: &View<'_, impl Real>) -> Vector3<f64> {
    Vector3::from([1, 2, 3].map(|k| x.channel(k).unwrap_or(f64::NAN)))
}

/// Sine of the elevation of a satellite above the horizon of a place.
fn sine_of_elevation(satellite: &Vector3<f64>, place: &Geodetic<f64>) -> f64 {
    let here = place.earth_fixed();
    let up = place.displaced(&Vector3::new(0.0, 0.0, -1.0)).earth_fixed() - here;
    (satellite - here).normalize().dot(&up)
}

impl MeasurementModel<1> for PseudorangeModel {
    fn observations(&self) -> usize {
        self.constellation.satellites.max(MOST)
    }

    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let here = self.antenna(x).earth_fixed();
        let there = satellite(x).map(convert::<f64, T>);
        let turn = (there.x * here.y - there.y * here.x) * convert(EARTH_RATE / LIGHT);
        SVector::from([(there - here).norm() + turn + x.get(self.clock)])
    }

    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        let [same, grows] = self.variances;
        // below 3 deg the mapping 1/sin ends
        let sine = sine_of_elevation(&satellite(x), &self.antenna(x)).max(0.05);
        SMatrix::from_element(same + grows / (sine * sine))
    }

    /// Fills the sample of one satellite, and leaves it empty where the satellite is not in view.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        if scene.observation >= self.constellation.satellites {
            return;
        }
        let satellite = orbit(scene.observation, sample.time.seconds());
        let here = scene.truth.get(scene.layout, self.navigation.position);
        if sine_of_elevation(&satellite, &here) > self.constellation.mask.si().sin() {
            (0..3).for_each(|axis| sample.set(axis + 1, satellite[axis]));
            scene.measure(self, sample);
        }
    }
}
// ANCHOR_END: sensor

/// Place of a satellite on a circular orbit, six planes at 55 deg, in Earth-fixed axes.
fn orbit(satellite: usize, time: f64) -> Vector3<f64> {
    let turn = time / REVOLUTION;
    let along = TAU * (satellite as f64 * 0.618_034 + turn);
    // the Earth turns once in two revolutions
    let plane = TAU * ((satellite % 6) as f64 / 6.0 - 0.5 * turn);
    let inclination = 55_f64.to_radians();
    let (x, y) = (along.cos(), along.sin() * inclination.cos());
    let (sin, cos) = plane.sin_cos();
    Vector3::new(x * cos - y * sin, x * sin + y * cos, along.sin() * inclination.sin()) * ORBIT
}
