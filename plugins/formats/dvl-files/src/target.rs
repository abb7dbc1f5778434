//! The sensors that receive the pings, and the parts of a ping that they take.

use crate::config::{AttitudeUse, DvlFile, Screen};
use crate::ping::{Coordinates, Ping, TrackedVelocity};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_frames::validity::{Judge, is_trusted};

/// Largest number of beams that a format has.
const BEAMS: usize = 4;
/// Types of the sensors that receive bottom track without being named.
const TYPES: [&str; 2] = ["dvl", "dvl-beams"];

/// A part of a ping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Bottom,
    Water,
    Depth,
}

impl Part {
    fn key(self) -> &'static str {
        match self {
            Self::Bottom => "bottom_track",
            Self::Water => "water_track",
            Self::Depth => "depth",
        }
    }

    /// The name in a message.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bottom => "bottom track",
            Self::Water => "water track",
            Self::Depth => "depth",
        }
    }

    fn track(self, ping: &Ping) -> Option<&TrackedVelocity> {
        match self {
            Self::Bottom => ping.bottom.as_ref(),
            Self::Water => ping.water.as_ref(),
            Self::Depth => None,
        }
    }
}

/// The channels of a sensor that a part fills.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channels {
    /// The velocity along three axes.
    Axes([usize; 3]),
    /// The velocity along each beam.
    Beams([Option<usize>; BEAMS]),
    Depth(usize),
}

/// A sensor and the part of a ping that it receives.
#[derive(Debug)]
pub struct Target {
    pub part: Part,
    sensor: SensorId,
    channels: Channels,
    /// The channel of the height above the bottom.
    altitude: Option<usize>,
    judge: Judge,
    /// Number of samples.
    pub samples: u64,
}

/// The result of giving a ping to a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Given {
    Sample(Sample),
    /// The ping has nothing for the sensor.
    Nothing,
    /// A velocity is beyond the limits.
    Screened,
    /// A velocity is a number that stands for none, or its figure of merit is at the limit.
    Invalid,
    /// The velocities are along other axes than the sensor's.
    Refused(Coordinates),
}

/// Finds the sensors that the parameters name.
///
/// # Errors
/// When there is no such sensor, or its channels do not fit.
pub fn targets(config: &DvlFile, context: &OpenContext<'_>) -> Result<Vec<Target>, StreamError> {
    let sensors = &context.composition.sensors;
    let named = [
        (Part::Bottom, config.bottom_track.as_deref()),
        (Part::Water, config.water_track.as_deref()),
        (Part::Depth, config.depth.as_deref()),
    ];
    let mut targets = Vec::new();
    for (part, name) in named {
        let Some(name) = name else { continue };
        let sensor = context.sensor(name).map_err(|e| e.at_key(part.key()))?;
        if let Some((sensor, info)) = sensor {
            targets.push(Target::new(part, sensor, info)?);
        }
    }
    let wanted = [&config.bottom_track, &config.water_track, &config.depth];
    if wanted.iter().all(|name| name.is_none()) {
        let fits = |k: &usize| TYPES.contains(&sensors[*k].info.kind.as_str());
        let found: Vec<usize> = (0..sensors.len()).filter(fits).collect();
        match *found.as_slice() {
            [only] => targets.push(Target::new(Part::Bottom, SensorId(only), &sensors[only].info)?),
            [] => {
                let message = "the scenario has no sensor of type \"dvl\" or \"dvl-beams\"";
                return Err(StreamError::scenario(message)
                    .with_remedy("add one, or name a sensor with `bottom_track`"));
            }
            _ => {
                let names: Vec<&str> =
                    found.iter().map(|k| sensors[*k].info.name.as_str()).collect();
                let message = format!("several sensors could receive it: {}", names.join(", "));
                return Err(StreamError::scenario(message)
                    .with_remedy("name one with `bottom_track` or `water_track`"));
            }
        }
    }
    Ok(targets)
}

impl Target {
    fn new(part: Part, sensor: SensorId, info: &SensorInfo) -> Result<Self, StreamError> {
        let channel = |name: &str| info.position(name);
        let beams = ["beam_1", "beam_2", "beam_3", "beam_4"].map(channel);
        let axes = || Some([channel("vel_x")?, channel("vel_y")?, channel("vel_z")?]);
        let channels = match part {
            Part::Depth => channel("depth").map(Channels::Depth),
            _ => axes()
                .map(Channels::Axes)
                .or_else(|| beams[0].is_some().then_some(Channels::Beams(beams))),
        };
        let Some(channels) = channels else {
            let needed = match part {
                Part::Depth => "depth",
                _ => "vel_x, vel_y and vel_z, or beam_1, beam_2, ...",
            };
            let has: Vec<&str> = info.channels.iter().map(|c| &*c.name).collect();
            return Err(StreamError::scenario(format!(
                "{} needs the channels {needed}; [sensor.{}] of type {:?} has {}",
                part.name(),
                info.name,
                info.kind,
                has.join(", ")
            ))
            .at_key(part.key()));
        };
        let altitude = channel("altitude").filter(|_| part == Part::Bottom);
        let judge = Judge::new(info);
        Ok(Self { part, sensor, channels, altitude, judge, samples: 0 })
    }

    /// Gives a ping to the sensor.
    pub fn give(
        &self,
        ping: &Ping,
        time: navfuse_core::units::time::Time,
        attitude: AttitudeUse,
        screen: &Screen,
    ) -> Given {
        let mut sample = Sample::empty(time, self.sensor);
        if let Channels::Depth(channel) = self.channels {
            let Some(depth) = ping.depth else { return Given::Nothing };
            sample.set(channel, depth);
            return Given::Sample(sample);
        }
        let Some(track) = self.part.track(ping) else { return Given::Nothing };
        if track.recorded.iter().all(Option::is_none) {
            return Given::Nothing;
        }
        if track.figure_of_merit.is_some_and(|merit| !is_trusted(merit)) {
            return Given::Invalid;
        }
        if beyond(track, screen) {
            return Given::Screened;
        }
        match self.channels {
            Channels::Axes(channels) => {
                let turned = matches!(track.coordinates, Coordinates::Ship | Coordinates::Earth);
                let three = track.recorded.iter().flatten().count() >= 3;
                let Some(axes) = track.axes.filter(|_| !turned || attitude == AttitudeUse::File)
                else {
                    // one or two velocities are no vector, whatever their axes
                    return if three { Given::Refused(track.coordinates) } else { Given::Nothing };
                };
                if (0..BEAMS).filter(|k| poor(track, screen, *k)).count() > 1 {
                    return Given::Screened;
                }
                channels.iter().zip(axes).for_each(|(c, v)| sample.set(*c, v));
            }
            Channels::Beams(channels) => {
                let Some(beams) = track.beams else { return Given::Refused(track.coordinates) };
                for (k, (channel, beam)) in channels.iter().zip(beams).enumerate() {
                    let usable = beam.filter(|_| !poor(track, screen, k));
                    if let Some((channel, v)) = channel.zip(usable) {
                        sample.set(channel, v);
                    }
                }
                if sample.present() == 0 {
                    return Given::Screened;
                }
            }
            Channels::Depth(_) => {}
        }
        if self.judge.refuses(&mut sample).is_some() {
            return Given::Invalid;
        }
        if let Some((channel, altitude)) = self.altitude.zip(track.altitude) {
            sample.set(channel, altitude);
        }
        Given::Sample(sample)
    }

    /// The error for velocities along other axes than the sensor's, with its remedy.
    pub fn refusal(&self, coordinates: Coordinates, turnable: bool) -> StreamError {
        let name = coordinates.name();
        let (message, remedy) = match (self.channels, coordinates) {
            (Channels::Beams(_), _) => (
                format!("its velocities are in {name} coordinates, not along the beams"),
                "use a sensor of type \"dvl\", or set the instrument to beam coordinates",
            ),
            (_, Coordinates::Beam) => (
                "its velocities are along the beams, and the file does not name their directions"
                    .to_owned(),
                "use a sensor of type \"dvl-beams\" with the directions of the instrument's beams",
            ),
            (_, Coordinates::Ship | Coordinates::Earth) if turnable => (
                format!(
                    "its velocities are in {name} coordinates, which the instrument's own heading \
                     and tilts turned"
                ),
                "set attitude = \"file\" to turn them back with the attitude in the file, or set \
                 the instrument to instrument or beam coordinates",
            ),
            _ => (
                format!(
                    "its velocities are in {name} coordinates, and the format has no attitude to \
                     turn them back"
                ),
                "set the instrument to instrument or beam coordinates",
            ),
        };
        StreamError::format(message).with_remedy(remedy)
    }
}

/// Tests whether the velocity as a whole is beyond a limit.
fn beyond(track: &TrackedVelocity, screen: &Screen) -> bool {
    let above = |value: Option<f64>, limit: Option<f64>| {
        value.zip(limit).is_some_and(|(value, limit)| value.abs() > limit)
    };
    above(track.error_velocity, screen.error_velocity.map(|l| l.value().si()))
        || above(track.figure_of_merit, screen.figure_of_merit.map(|l| l.value().si()))
}

/// Tests whether a beam is beyond a limit.
fn poor(track: &TrackedVelocity, screen: &Screen, beam: usize) -> bool {
    let below = |value: Option<f64>, limit: Option<f64>| {
        value.zip(limit).is_some_and(|(value, limit)| value < limit)
    };
    below(track.correlation[beam], screen.correlation.map(|l| l.si()))
        || below(track.percent_good[beam], screen.percent_good.map(|l| l.si()))
}
