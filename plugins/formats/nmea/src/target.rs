//! The sensors that receive the sentences, and the channels that they take.

use crate::beacon::Beacon;
use crate::config::Nmea;
use crate::epoch::{Epoch, North, Part};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::OpenContext;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// The type of sensor that receives headings from magnetic north.
const MAGNETIC: &str = "magnetic-heading";

/// A sensor and its channels, in the order of [`Target::names`].
#[derive(Debug)]
pub struct Target {
    pub part: Part,
    sensor: SensorId,
    channels: Vec<Option<usize>>,
}

impl Target {
    /// The channels that a part fills.
    fn names(part: Part) -> &'static [&'static str] {
        match part {
            Part::Gnss => &["lat", "lon", "height", "vel_n", "vel_e", "h_acc", "v_acc"],
            Part::Heading | Part::Magnetic(_) => &["heading"],
            Part::Usbl(_) => &["lat", "lon", "height", "h_acc"],
            Part::Depth => &["depth"],
            Part::Reference => &["lat", "lon", "height", "vel_n", "vel_e", "roll", "pitch", "yaw"],
        }
    }

    pub fn key(part: Part) -> &'static str {
        match part {
            Part::Gnss => "gnss",
            Part::Heading => "heading",
            Part::Magnetic(_) => "magnetic",
            Part::Usbl(_) => "usbl",
            Part::Depth => "depth",
            Part::Reference => "reference",
        }
    }

    /// The sentences with the content of a part.
    pub fn sentences(part: Part) -> &'static str {
        match part {
            Part::Gnss => "GGA or RMC",
            Part::Heading => "HDT or THS",
            Part::Magnetic(North::True(None)) => "HDG with a variation",
            Part::Magnetic(_) => "HDG or HDM",
            Part::Usbl(_) => "PTSAG, PSONLLD or PSIMSSB of the transponder",
            Part::Depth => "DPT or PRVAT",
            Part::Reference => "GGA, RMC, PASHR or PSXN",
        }
    }

    fn new(part: Part, sensor: SensorId, info: &SensorInfo) -> Result<Self, StreamError> {
        let part = match part {
            Part::Magnetic(North::True(declination)) if info.kind == MAGNETIC => {
                if declination.is_some() {
                    let message = format!("[sensor.{}] has a declination of its own", info.name);
                    return Err(StreamError::scenario(message)
                        .at_key("declination")
                        .with_remedy("remove this key, and set the declination of the sensor"));
                }
                Part::Magnetic(North::Magnetic)
            }
            part => part,
        };
        let names = Self::names(part);
        let channels: Vec<Option<usize>> = names.iter().map(|name| info.position(name)).collect();
        if channels[0].is_none() {
            let has: Vec<&str> = info.channels.iter().map(|c| &*c.name).collect();
            let message = format!(
                "it needs a sensor with the channel {}; [sensor.{}] of type {:?} has {}",
                names[0],
                info.name,
                info.kind,
                has.join(", ")
            );
            return Err(StreamError::scenario(message).at_key(Self::key(part)));
        }
        Ok(Self { part, sensor, channels })
    }

    pub fn sample(&self, time: Time, epoch: &Epoch) -> Option<Sample> {
        let [lat, lon] = split(epoch.position);
        let velocity =
            epoch.velocity.map(|[speed, course]| [speed * course.cos(), speed * course.sin()]);
        let [vel_n, vel_e] = split(velocity);
        let sigma = epoch.sigma;
        // the receiver's accuracies are those of each axis: their root mean square
        let h_acc = sigma.map(|[n, e, _]| (0.5 * (n * n + e * e)).sqrt());
        let v_acc = sigma.map(|[_, _, down]| down);
        let [roll, pitch, yaw] = split(epoch.attitude);
        let values: &[Option<f64>] = match self.part {
            Part::Gnss => &[lat, lon, epoch.height, vel_n, vel_e, h_acc, v_acc],
            Part::Reference => &[lat, lon, epoch.height, vel_n, vel_e, roll, pitch, yaw],
            Part::Usbl(_) => &[lat, lon, epoch.height, h_acc],
            Part::Heading | Part::Magnetic(_) | Part::Depth => &[epoch.value],
        };
        let mut sample = Sample::empty(time, self.sensor);
        for (channel, value) in self.channels.iter().zip(values) {
            if let Some((channel, value)) = channel.zip(*value) {
                sample.set(channel, value);
            }
        }
        (sample.present() != 0).then_some(sample)
    }
}

fn split<const N: usize>(values: Option<[f64; N]>) -> [Option<f64>; N] {
    values.map_or([None; N], |values| values.map(Some))
}

/// The transponder whose positions a sensor receives; `None` without such a sensor.
fn beacon(config: &Nmea) -> Result<Option<Beacon>, StreamError> {
    let error =
        |text: &str, remedy| Err(StreamError::scenario(text).at_key("beacon").with_remedy(remedy));
    match (&config.usbl, &config.beacon) {
        (None, None) => Ok(None),
        (None, Some(_)) => {
            error("no sensor receives the positions of the transponder", "name it with `usbl`")
        }
        (Some(_), None) => error(
            "the transponder of `usbl` is not given",
            "set `beacon` to its number or name, such as \"1\"",
        ),
        (Some(_), Some(text)) => match Beacon::new(text) {
            Some(beacon) => Ok(Some(beacon)),
            None => error(
                &format!("{text:?} is no transponder"),
                "give a number or a name of 1 to 16 bytes",
            ),
        },
    }
}

/// Finds the sensors that the parameters name.
///
/// # Errors
/// When there is no such sensor, or its channels do not fit.
pub fn targets(config: &Nmea, context: &OpenContext<'_>) -> Result<Vec<Target>, StreamError> {
    let sensors = &context.composition.sensors;
    let north = North::True(config.declination.map(|angle| angle.si()));
    let beacon = beacon(config)?;
    let named = [
        (Part::Gnss, &config.gnss),
        (Part::Heading, &config.heading),
        (Part::Magnetic(north), &config.magnetic),
        (Part::Depth, &config.depth),
        (Part::Reference, &config.reference),
    ];
    let named: Vec<(Part, &Option<String>)> =
        named.into_iter().chain(beacon.map(|beacon| (Part::Usbl(beacon), &config.usbl))).collect();
    let mut targets = Vec::new();
    for &(part, name) in &named {
        let Some(name) = name else { continue };
        let sensor = context.sensor(name).map_err(|e| e.at_key(Target::key(part)))?;
        if let Some((sensor, info)) = sensor {
            targets.push(Target::new(part, sensor, info)?);
        }
    }
    if named.iter().all(|(_, name)| name.is_none()) {
        let found: Vec<usize> =
            (0..sensors.len()).filter(|k| sensors[*k].info.kind == "gnss").collect();
        let [only] = *found.as_slice() else {
            let message = match found.len() {
                0 => "the scenario has no sensor of type \"gnss\"",
                _ => "the scenario has several sensors of type \"gnss\"",
            };
            return Err(StreamError::scenario(message).with_remedy(
                "name the sensors that receive the sentences with `gnss`, `heading`, `magnetic`, \
                 `depth`, `usbl` or `reference`",
            ));
        };
        targets.push(Target::new(Part::Gnss, SensorId(only), &sensors[only].info)?);
    }
    Ok(targets)
}
