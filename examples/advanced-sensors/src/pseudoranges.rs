//! Pseudoranges of a GNSS receiver: one observation for each satellite in view.
use navfuse_core::prelude::*;

/// Time of one revolution of a GPS satellite, half a sidereal day, s.
const REVOLUTION: f64 = 43_082.0;
/// Radius of the orbit of a GPS satellite, m.
const ORBIT: f64 = 26_560e3;

// ANCHOR: sensor
/// Receiver that gives the pseudorange to each satellite in view.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pseudoranges {
    /// 1-sigma noise of a pseudorange.
    pub noise: Sigma<Length>,
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

struct Model {
    receiver: Pseudoranges,
    position: Handle<Position>,
    clock: Handle<Scalar>,
}

impl SensorType for Pseudoranges {
    const TYPE: &'static str = "pseudoranges";
    /// The pseudorange, and the place of the satellite in Earth-fixed axes.
    fn channels(&self) -> Vec<Channel> {
        let place = ["sat_x", "sat_y", "sat_z"].map(|name| Channel::new(name, "m"));
        [vec![Channel::new("pseudorange", "m")], place.to_vec()].concat()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let position = composer.find("", "ins.position")?;
        let clock = composer.find("", "receiver-clock.offset")?;
        Ok(Role::measurement(Model { receiver: self, position, clock }))
    }
}

impl MeasurementModel<1> for Model {
    fn observations(&self) -> usize {
        self.receiver.simulation.satellites
    }

    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let (here, clock) = (x.get(self.position).earth_fixed(), x.get(self.clock));
        // a recording without the place of a satellite has no prediction, and is gated
        let place = [1, 2, 3].map(|k| convert(x.channel(k).unwrap_or(f64::NAN)));
        SVector::from([(Vector3::from(place) - here).norm() + clock])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.receiver.noise.value().si().powi(2))
    }

    /// Fills the sample of one satellite, and leaves it empty where the satellite is not in view.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let satellite = orbit(scene.observation, sample.time.seconds());
        let here = scene.truth.get(scene.layout, self.position);
        let up = here.displaced(&Vector3::new(0.0, 0.0, -1.0)).earth_fixed() - here.earth_fixed();
        let sight = (satellite - here.earth_fixed()).normalize();
        if sight.dot(&up) > self.receiver.simulation.mask.si().sin() {
            (0..3).for_each(|axis| sample.set(axis + 1, satellite[axis]));
            scene.measure(self, sample);
        }
    }
}
// ANCHOR_END: sensor

/// Place of a satellite on a circular orbit, six planes at 55 deg, in Earth-fixed axes.
fn orbit(satellite: usize, time: f64) -> Vector3<f64> {
    use std::f64::consts::TAU;
    let turn = time / REVOLUTION;
    let along = TAU * (satellite as f64 * 0.618_034 + turn);
    // the Earth turns once in two revolutions
    let plane = TAU * ((satellite % 6) as f64 / 6.0 - 0.5 * turn);
    let inclination = 55_f64.to_radians();
    let (x, y) = (along.cos(), along.sin() * inclination.cos());
    let (sin, cos) = plane.sin_cos();
    Vector3::new(x * cos - y * sin, x * sin + y * cos, along.sin() * inclination.sin()) * ORBIT
}
