//! A sensor with missing channels: ranges to up to four transponders, some of which do not reply.
use navfuse_core::prelude::*;

/// Acoustic ranges to up to four transponders on the bottom.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ranges {
    /// 1-sigma noise of a range.
    pub noise: Sigma<Length>,
    /// Latitude, longitude and height of each transponder.
    pub transponders: Vec<(Angle, Angle, Length)>,
    /// Longest range at which a transponder replies.
    pub reach: Positive<Length>,
    /// Process that gives the vehicle's position.
    #[serde(default = "ins")]
    pub vehicle: String,
}

fn ins() -> String {
    "ins".into()
}

struct Model {
    ranges: Ranges,
    transponders: [Option<Geodetic<f64>>; 4],
    position: Handle<Position>,
}

impl SensorType for Ranges {
    const TYPE: &'static str = "ranges";
    fn channels(&self) -> Vec<Channel> {
        ["range_1", "range_2", "range_3", "range_4"].map(|name| Channel::new(name, "m")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        if self.transponders.is_empty() || self.transponders.len() > 4 {
            let message = format!("{} transponders; give one to four", self.transponders.len());
            return Err(ComposeError::new("transponders", message));
        }
        let place = |&(latitude, longitude, height): &(Angle, Angle, Length)| Geodetic {
            latitude: latitude.si(),
            longitude: longitude.si(),
            height: height.si(),
        };
        let transponders = std::array::from_fn(|k| self.transponders.get(k).map(place));
        let position = composer.find("vehicle", &format!("{}.position", self.vehicle))?;
        Ok(Role::measurement(Model { ranges: self, transponders, position }))
    }
}

// ANCHOR: model
impl MeasurementModel<4> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 4> {
        let here = x.get(self.position);
        let range = |place: &Option<Geodetic<f64>>| {
            place.map_or(T::zero(), |there| here.ned_from(&there.cast()).norm())
        };
        SVector::from(self.transponders.each_ref().map(range))
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 4, 4> {
        SMatrix::identity() * self.ranges.noise.value().si().powi(2)
    }

    /// Clears the channels of transponders that do not exist or are beyond `reach`.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        for (k, place) in self.transponders.iter().enumerate() {
            let replies = place.is_some()
                && sample.get(k).is_some_and(|range| range < self.ranges.reach.value().si());
            if !replies {
                sample.clear(k);
            }
        }
    }
}
// ANCHOR_END: model
