//! Samples at times of their own: a ping, which is an event without a measurement, and the replies,
//! which measure from the state of the ping. A past state beside several observations of one time.

use crate::past::{consistency, run};
use navfuse_core::prelude::*;
use navfuse_ins::Navigation;

// ANCHOR: ping
/// Ranges to transponders by the time from a ping to each reply.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwoWay {
    /// 1-sigma noise of half the way.
    noise: Sigma<Length>,
    /// Latitude, longitude and height of each transponder.
    transponders: Vec<(Angle, Angle, Length)>,
}

struct Model {
    sigma: f64,
    transponders: Vec<Geodetic<f64>>,
    position: Handle<Position>,
    pinged: Past<Position>,
}

/// A reply has the range and the number of its transponder; a ping has the third channel alone.
const TRANSPONDER: usize = 1;
const PING: usize = 2;
/// Speed of sound, m/s.
const SOUND: f64 = 1500.0;

impl SensorType for TwoWay {
    const TYPE: &'static str = "two-way";
    fn channels(&self) -> Vec<Channel> {
        [("range", "m"), ("transponder", "1"), ("ping", "1")]
            .map(|(name, unit)| Channel::new(name, unit))
            .to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let position = Navigation::only(composer)?.position;
        let place = |&(latitude, longitude, height): &(Angle, Angle, Length)| Geodetic {
            latitude: latitude.si(),
            longitude: longitude.si(),
            height: height.si(),
        };
        Ok(Role::measurement(Model {
            sigma: self.noise.value().si(),
            transponders: self.transponders.iter().map(place).collect(),
            position,
            pinged: composer.past(position)?,
        }))
    }
}

impl Model {
    /// Length of the way from one place to a transponder and back to another place, m.
    fn way<T: Real>(&self, transponder: usize, from: &Geodetic<T>, to: &Geodetic<T>) -> T {
        let Some(there) = self.transponders.get(transponder) else { return convert(f64::NAN) };
        let there = there.cast().earth_fixed();
        (from.earth_fixed() - there).norm() + (to.earth_fixed() - there).norm()
    }
}

impl MeasurementModel<1> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let transponder = x.channel(TRANSPONDER).unwrap_or(0.0) as usize;
        let way = self.way(transponder, &x.then(self.pinged), &x.get(self.position));
        SVector::from([way * convert(0.5)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma.powi(2))
    }
    /// The past state is that of the ping. A sample without a range is an event.
    fn keyframe(&self, sample: &Sample) -> bool {
        sample.get(PING).is_some()
    }
    /// Sends a reply at the time that `next_time` has chosen, and a ping at any other.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        match scene.recall::<Vec<(Time, usize)>>().first() {
            Some((time, transponder)) if *time == scene.to => {
                sample.set(TRANSPONDER, *transponder as f64);
                scene.measure(self, sample);
            }
            _ => sample.set(PING, 1.0),
        }
    }
    /// Time of the next reply. The vehicle moves on while the sound is under way.
    fn next_time(&self, scene: &mut Scene<'_>, sample: &Sample) -> Option<Time> {
        let mut due: Vec<(Time, usize)> = scene.recall();
        if sample.get(PING).is_some() {
            let here = scene.truth.get(scene.layout, self.position);
            let reply = |transponder| {
                let mut time = scene.to;
                for _ in 0..4 {
                    let way = self.way(transponder, &here, &scene.trajectory.at(time).position);
                    time = scene.to + Span::from_seconds(way / SOUND)?;
                }
                Some((time, transponder))
            };
            due = (0..self.transponders.len()).filter_map(reply).collect();
            due.sort_unstable();
        } else {
            due.remove(0);
        }
        let next = due.first().map(|(time, _)| *time);
        scene.remember(due);
        next
    }
}
// ANCHOR_END: ping

/// The motion since the samples before, one axis of north, east and down in each sample.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axes {
    /// 1-sigma noise of an axis.
    noise: Sigma<Length>,
}

struct Moved {
    sigma: f64,
    position: Handle<Position>,
    past: Past<Position>,
}

impl SensorType for Axes {
    const TYPE: &'static str = "axes";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("moved", "m"), Channel::new("axis", "1")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let position = Navigation::only(composer)?.position;
        let (sigma, past) = (self.noise.value().si(), composer.past(position)?);
        Ok(Role::measurement(Moved { sigma, position, past }))
    }
}

impl MeasurementModel<1> for Moved {
    fn observations(&self) -> usize {
        3
    }
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let moved = x.get(self.position).ned_from(&x.then(self.past));
        SVector::from([moved[x.channel(1).unwrap_or(0.0) as usize % 3]])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma.powi(2))
    }
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        sample.set(1, scene.observation as f64);
        scene.measure(self, sample);
    }
}

const VEHICLE: &str = r#"
[estimator]
draw = "all"
[process.ins]
attitude = { sigma = ["0.02 deg", "0.02 deg", "0.5 deg"] }
velocity = { sigma = "5 cm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "50 ug" }
[sensor.imu]
gyro_noise = "0.2 deg/h/sqrt(Hz)"
accel_noise = "20 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
longitude = "0 deg"
heading = "20 deg"
[[source.simulation.segments]]
type = "surge"
duration = "15 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "90 deg"
bank = "8 deg"
[[source.simulation.segments]]
type = "cruise"
duration = "25 s"
"#;

const ACOUSTIC: &str = r#"
[sensor.acoustic]
type = "two-way"
noise = "10 cm"
transponders = [["30.006 deg", "0.001 deg", "-100 m"], ["30.001 deg", "0.009 deg", "-80 m"]]
gate = "off"
simulation = { rate = "0.5 Hz" }
"#;

/// The sound is under way for 0.9 and 1.1 s, and the vehicle moves by 2 m in this time: half of it
/// would be ten times the noise. Over 30 runs the mean of a chi-square of 15 has a sigma of 0.067 of its
/// mean, and that of 30 * 56 replies one of sqrt(2 / 1680) = 0.035. The bands are 3.3 sigma.
#[test]
fn replies_at_times_of_their_own_measure_from_the_state_of_the_ping() {
    let text = format!("{VEHICLE}{ACOUSTIC}");
    let [anees, anis] = consistency(&text, 30, (15, 1));
    println!("ANEES {anees:.3}, ANIS {anis:.4}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.12, "{anis}");
    let (finished, judge) = run(&text, &[]);
    let count = &finished.summary.samples["acoustic"];
    // a ping every 2 s until 60 s, and two replies to each but the last
    assert_eq!((&count["read"], &count["rejected"]), (&91.into(), &0.into()), "{count}");
    assert!(judge.nis.iter().all(|(time, _)| time.fract() > 0.01), "pings have no innovation");
    assert_eq!(count["accepted"], judge.nis.len(), "{count}");
}

/// A ping within a span that the scenario excludes is no event: its replies measure from nothing.
#[test]
fn replies_to_a_ping_that_is_excluded_update_nothing() {
    let text = format!("{VEHICLE}{ACOUSTIC}");
    let used = |settings: &[String]| {
        let (_, judge) = run(&text, settings);
        judge.nis.iter().filter(|(_, nis)| nis.is_finite()).count()
    };
    let exclude = "sensor.acoustic.exclude=[[\"29.9 s\", \"30.1 s\"]]".to_owned();
    assert_eq!(used(&[]) - used(&[exclude]), 2);
}

/// Three observations a second, each of one axis: 30 * 3 * 58 updates with a sigma of 0.020. With a past
/// taken after the first of them, the second would measure from the present: the vehicle moves 2 m.
#[test]
fn several_observations_of_one_time_measure_from_the_time_before() {
    let sensor = "[sensor.motion]\ntype = \"axes\"\nnoise = \"2 cm\"\ngate = \"off\"\n\
                  simulation = { rate = \"1 Hz\" }";
    let text = format!("{VEHICLE}{sensor}");
    let [anees, anis] = consistency(&text, 30, (15, 1));
    println!("ANEES {anees:.3}, ANIS {anis:.4}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.066, "{anis}");
}
