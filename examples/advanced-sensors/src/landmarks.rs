//! Landmarks that a stereo camera sees, as states that come and go.
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

// ANCHOR: sensor
/// Stereo camera that recognises landmarks and measures their place in body axes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Landmarks {
    /// 1-sigma noise of each axis.
    pub noise: Sigma<Length>,
    /// Largest number of landmarks in the map at one time.
    pub states: usize,
    /// Keys that only a simulation needs.
    #[serde(default)]
    pub simulation: Map,
}

/// Landmarks of a simulation.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Map {
    /// Latitude and longitude of the origin of the map, at sea level.
    pub origin: [Angle; 2],
    /// Places north, east and down of the origin; the first landmark has the number 1.
    pub landmarks: Vec<Triple<Length>>,
    /// Distance within which the camera sees a landmark.
    pub sight: Length,
}

impl Default for Map {
    fn default() -> Self {
        let zero = Angle::from_si(0.0);
        Self { origin: [zero, zero], landmarks: Vec::new(), sight: Length::from_si(30.0) }
    }
}

struct Model {
    camera: Landmarks,
    vehicle: Navigation,
    landmarks: Transients<Position>,
}

impl SensorType for Landmarks {
    const TYPE: &'static str = "landmarks";
    /// Place forward, right and down of the camera, and the number of the landmark.
    fn channels(&self) -> Vec<Channel> {
        let place = ["forward", "right", "down"].map(|axis| Channel::new(axis, "m"));
        [place.to_vec(), vec![Channel::new("landmark", "1")]].concat()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let vehicle = Navigation::only(composer)?;
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; 3],
            sigma: vec![], // no prior: each landmark is placed by its first sample
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::POSITION,
        };
        let landmarks = composer.transients("landmark", self.states, spec)?;
        for (number, place) in (1..).zip(self.simulation.places()) {
            composer.true_transient(landmarks, number, &place)?;
        }
        Ok(Role::measurement(Model { camera: self, vehicle, landmarks }))
    }
}

impl MeasurementModel<3> for Model {
    fn observations(&self) -> usize {
        64
    }

    /// Adds a landmark that is seen for the first time, in place of the one longest out of sight.
    fn admit(&self, x: &View<'_, f64>, roster: &mut Roster<'_>) {
        let [Some(forward), Some(right), Some(down), Some(number)] =
            [0, 1, 2, 3].map(|k| x.channel(k))
        else {
            return;
        };
        if roster.has(self.landmarks, number as u32) {
            return;
        }
        if roster.free(self.landmarks) == 0
            && let Some((oldest, seen)) = roster.longest_unseen(self.landmarks)
            && seen < x.time()
        {
            roster.remove(self.landmarks, oldest);
        }
        let place = self.vehicle.position_at(x, &Vector3::new(forward, right, down));
        roster.place(self.landmarks, number as u32, &place);
    }

    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let number = x.channel(3).unwrap_or(0.0) as u32;
        match x.transient(self.landmarks, number) {
            Some(landmark) => {
                let ned = landmark.ned_from(&x.get(self.vehicle.position));
                x.get(self.vehicle.attitude).inverse() * ned
            }
            None => SVector::repeat(convert(f64::NAN)), // the filter then rejects the sample
        }
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * self.camera.noise.value().si().powi(2)
    }

    /// Fills the sample of one landmark, and leaves it empty where the landmark is out of sight.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let map = &self.camera.simulation;
        let here = scene.truth.get(scene.layout, self.vehicle.position);
        let Some(place) = map.places().nth(scene.observation) else { return };
        if place.ned_from(&here).norm() < map.sight.si() {
            sample.set(3, (scene.observation + 1) as f64);
            scene.measure(self, sample);
        }
    }
}
// ANCHOR_END: sensor

impl Map {
    fn places(&self) -> impl Iterator<Item = Geodetic> + '_ {
        let [latitude, longitude] = self.origin.map(|angle| angle.si());
        let origin = Geodetic { latitude, longitude, height: 0.0 };
        self.landmarks.iter().map(move |place| origin.displaced(&Vector3::from(place.si())))
    }
}
