//! Ranges by the time from a ping to its reply: the ping is an event, and the reply measures from its place.

use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

/// Channel of a ping, beside that of the range.
const PING: usize = 1;
/// Speed of sound, m/s, slow enough that the vehicle moves on meanwhile.
const SOUND: f64 = 150.0;

/// Half the way from the vehicle to a transponder and back.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct TwoWay {
    /// 1-sigma noise of half the way.
    noise: Sigma<Length>,
    /// Latitude, longitude and height of the transponder.
    transponder: (Angle, Angle, Length),
}

struct Model {
    sigma: f64,
    transponder: Geodetic<f64>,
    position: Handle<Position>,
    pinged: Past<Position>,
}

impl SensorType for TwoWay {
    const TYPE: &'static str = "two-way";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m"), Channel::new("ping", "1")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let position = Navigation::only(composer)?.position;
        let (latitude, longitude, height) = self.transponder;
        let transponder =
            Geodetic { latitude: latitude.si(), longitude: longitude.si(), height: height.si() };
        let (sigma, pinged) = (self.noise.value().si(), composer.past(position)?);
        Ok(Role::measurement(Model { sigma, transponder, position, pinged }))
    }
}

impl Model {
    fn range<T: Real>(&self, place: &Geodetic<T>) -> T {
        (place.earth_fixed() - self.transponder.cast().earth_fixed()).norm()
    }
}

impl MeasurementModel<1> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let way = self.range(&x.then(self.pinged)) + self.range(&x.get(self.position));
        SVector::from([way * convert(0.5)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma.powi(2))
    }
    fn keyframe(&self, sample: &Sample) -> bool {
        sample.get(PING).is_some()
    }
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        match scene.recall::<Option<Time>>() {
            Some(reply) if reply == scene.to => scene.measure(self, sample),
            _ => sample.set(PING, 1.0),
        }
    }
    fn next_time(&self, scene: &mut Scene<'_>, sample: &Sample) -> Option<Time> {
        let reply = sample.get(PING).and_then(|_| {
            let here = scene.truth.get(scene.layout, self.position);
            (0..4).try_fold(scene.to, |reply, _| {
                let there = scene.trajectory.at(reply).position;
                let way = self.range(&here) + self.range(&there);
                Some(scene.to + Span::from_seconds(way / SOUND)?)
            })
        });
        scene.remember(reply);
        reply
    }
}

/// Registers the sensor type `two-way`.
pub struct TwoWayPlugin;

impl Plugin for TwoWayPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<TwoWay>();
    }
    navfuse_core::named_after_crate!();
}
