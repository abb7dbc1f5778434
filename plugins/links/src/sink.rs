//! The newest estimate in datagrams or over a serial port, as JSON, NMEA 0183 or MAVLink.

use crate::blend::Blend;
use crate::mavlink::{Mavlink, MavlinkFormat};
use crate::serial::check_rate;
use crate::way::{Datagrams, SerialOut, Way};
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::state::{State, Vehicle};
use navfuse_core::units::calendar::Calendar;
use navfuse_core::units::{Date, Duration, Positive};
use navfuse_nmea::writing::{circle, course_and_speed, place, seal, time_of_day};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::fmt::Write;

/// Quality of a position in GGA: estimated, by dead reckoning.
const ESTIMATED: u8 = 6;

/// Sends the newest estimate in datagrams of UDP at the output rate: position, velocity, attitude, and
/// their 1-sigma.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UdpSink {
    /// Address of the receiver, such as `127.0.0.1:5006`.
    pub address: String,
    /// `json`, an object in each datagram, or `nmea`, the sentences GGA, GST, VTG and HDT. Default:
    /// `json`.
    #[serde(default)]
    pub format: EstimateFormat,
    /// Messages of MAVLink for an autopilot, in place of `format`: `mavlink = {}`.
    pub mavlink: Option<MavlinkFormat>,
    /// Date and time at which the run's clock is zero. Default: 1970-01-01T00:00:00, so that the
    /// times of the run are Unix times.
    pub origin: Option<Date>,
    /// Makes position and attitude continuous: a correction decays to 1/e in this time, such as `2 s`,
    /// and is in the sigma until then. Default: the estimate itself, which jumps.
    pub blend: Option<Positive<Duration>>,
}

/// The format of an estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum EstimateFormat {
    /// One object of JSON.
    #[default]
    Json,
    /// Sentences of NMEA 0183.
    Nmea,
}

/// Sends the newest estimate over a serial port at the output rate, such as to an autopilot. A link may read
/// the same port at the same rate.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SerialSink {
    /// The port, such as `/dev/ttyACM0`, or `COM3` on Windows.
    pub device: String,
    /// Bits a second, such as 115200.
    pub baud: u32,
    /// `json`, an object in each line, or `nmea`, the sentences GGA, GST, VTG and HDT. Default: `json`.
    #[serde(default)]
    pub format: EstimateFormat,
    /// Messages of MAVLink for an autopilot, in place of `format`: `mavlink = {}`.
    pub mavlink: Option<MavlinkFormat>,
    /// Date and time at which the run's clock is zero. Default: 1970-01-01T00:00:00, so that the
    /// times of the run are Unix times.
    pub origin: Option<Date>,
    /// Makes position and attitude continuous: a correction decays to 1/e in this time, such as `2 s`,
    /// and is in the sigma until then. Default: the estimate itself, which jumps.
    pub blend: Option<Positive<Duration>>,
}

impl SinkType for UdpSink {
    const TYPE: &'static str = "udp";
    const DEFAULT: bool = false;

    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let Self { address, format, mavlink, origin, blend } = self;
        let way = Datagrams::to(address)?;
        Ok(Box::new(Estimates::new(Box::new(way), format, mavlink, origin, blend)))
    }
}

impl SinkType for SerialSink {
    const TYPE: &'static str = "serial";
    const DEFAULT: bool = false;

    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let Self { device, baud, format, mavlink, origin, blend } = self;
        check_rate(baud)?;
        let way = SerialOut::start(device, baud)?;
        Ok(Box::new(Estimates::new(Box::new(way), format, mavlink, origin, blend)))
    }
}

/// Sends each estimate.
struct Estimates {
    way: Box<dyn Way>,
    format: EstimateFormat,
    /// Nanoseconds since 1970 of the run's zero.
    origin: i64,
    /// The messages of MAVLink that the scenario asks for, and their writer once the run starts.
    messages: Option<MavlinkFormat>,
    mavlink: Option<Mavlink>,
    vehicle: Vehicle,
    /// The continuous output, and its state.
    blend: Option<(Blend, State)>,
    text: String,
}

impl Estimates {
    fn new(
        way: Box<dyn Way>,
        format: EstimateFormat,
        messages: Option<MavlinkFormat>,
        origin: Option<Date>,
        blend: Option<Positive<Duration>>,
    ) -> Self {
        Self {
            way,
            format,
            origin: origin.map_or(0, |date| date.nanos),
            messages,
            mavlink: None,
            vehicle: Vehicle::default(),
            blend: blend.map(|time| (Blend::new(time.value().si()), State::default())),
            text: String::new(),
        }
    }
}

impl Sink for Estimates {
    fn wants(&self) -> Wants {
        Wants::NEWEST
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.vehicle = run.layout.vehicle();
        self.mavlink = self.messages.map(|format| Mavlink::new(format, run)).transpose()?;
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Newest(epoch) = record else { return Ok(()) };
        let (shown, offsets) = match &mut self.blend {
            Some((blend, shown)) => {
                shown.clone_from(epoch.state);
                let offsets = blend.take(&self.vehicle, epoch, shown);
                (Epoch { state: shown, ..**epoch }, offsets)
            }
            None => (**epoch, [[0.0; 3]; 2]),
        };
        let time = epoch.state.time;
        let unix = self.origin + time.nanos();
        self.text.clear();
        let motion = || Motion::of(&self.vehicle, &shown).widened(offsets);
        let bytes = match (&mut self.mavlink, self.format) {
            (Some(mavlink), _) => mavlink.messages(&shown, offsets, unix),
            (None, EstimateFormat::Json) => motion().json(&mut self.text, time.seconds()),
            (None, EstimateFormat::Nmea) => motion().nmea(&mut self.text, unix),
        };
        self.way.send(bytes)
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        Ok(Some(self.way.place()))
    }
}

/// A vector of the motion and its 1-sigma along each axis.
pub type Known = ([f64; 3], [f64; 3]);

/// The motion of the vehicle as far as it is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Latitude and longitude, deg, and height, m; 1-sigma north, east, down, m.
    pub position: Option<Known>,
    /// North, east, down, m/s.
    pub velocity: Option<Known>,
    /// Roll, pitch, heading, deg; 1-sigma about north, east, down, deg.
    pub attitude: Option<Known>,
}

impl Motion {
    /// The motion in an estimate, whose layout has these blocks of the vehicle.
    pub fn of(vehicle: &Vehicle, epoch: &Epoch<'_>) -> Self {
        let state = epoch.state;
        let sigma = |slot: usize| {
            let tangent = epoch.layout.blocks[slot].tangent;
            [0, 1, 2].map(|k| tangent.map_or(0.0, |t| epoch.covariance.sigma(t + k)))
        };
        Self {
            position: vehicle.position.map(|handle| {
                let p = state.get(epoch.layout, handle);
                let place = [p.latitude.to_degrees(), p.longitude.to_degrees(), p.height];
                (place, sigma(handle.slot()))
            }),
            velocity: vehicle
                .velocity
                .map(|handle| (state.get(epoch.layout, handle).into(), sigma(handle.slot()))),
            attitude: vehicle.attitude.map(|handle| {
                let (roll, pitch, yaw) = state.get(epoch.layout, handle).euler_angles();
                let angles = [roll, pitch, yaw.rem_euclid(std::f64::consts::TAU)];
                (angles.map(f64::to_degrees), sigma(handle.slot()).map(f64::to_degrees))
            }),
        }
    }

    /// The motion with the offsets of position, m, and attitude, rad, in its sigma.
    fn widened(mut self, [position, attitude]: [[f64; 3]; 2]) -> Self {
        let widen = |known: &mut Option<Known>, offset: [f64; 3]| {
            if let Some((_, sigma)) = known {
                *sigma = [0, 1, 2].map(|k| sigma[k].hypot(offset[k]));
            }
        };
        widen(&mut self.position, position);
        widen(&mut self.attitude, attitude.map(f64::to_degrees));
        self
    }

    /// Appends an object; what is not estimated is left out.
    fn json<'a>(&self, out: &'a mut String, time: f64) -> &'a [u8] {
        let mut object = Map::new();
        object.insert("time_s".to_owned(), json!(time));
        let mut add = |names: [&str; 2], known: Option<Known>| {
            if let Some((value, sigma)) = known {
                object.insert(names[0].to_owned(), json!(value));
                object.insert(names[1].to_owned(), json!(sigma));
            }
        };
        add(["position_deg_deg_m", "position_sigma_ned_m"], self.position);
        add(["velocity_ned_mps", "velocity_sigma_ned_mps"], self.velocity);
        add(["roll_pitch_heading_deg", "attitude_sigma_ned_deg"], self.attitude);
        // writing to a text cannot fail
        let _ = writeln!(out, "{}", Value::Object(object));
        out.as_bytes()
    }

    /// Appends the sentences of a time in nanoseconds since 1970.
    fn nmea<'a>(&self, out: &'a mut String, unix: i64) -> &'a [u8] {
        let time = time_of_day(&Calendar::of_unix_nanos(unix));
        if let Some(([latitude, longitude, height], [north, east, down])) = self.position {
            let place = place(latitude, longitude);
            seal(out, format_args!("INGGA,{time},{place},{ESTIMATED},,,{height:.3},M,0.0,M,,"));
            seal(out, format_args!("INGST,{time},,,,,{north:.3},{east:.3},{down:.3}"));
        }
        if let Some(([north, east, _], _)) = self.velocity {
            seal(out, format_args!("INVTG,{},E", course_and_speed(north, east, 3)));
        }
        if let Some(([_, _, heading], _)) = self.attitude {
            seal(out, format_args!("INHDT,{},T", circle(heading, 3)));
        }
        out.as_bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_frames::{Frames, Sentences};
    use navfuse_nmea::parse;

    #[test]
    fn the_sentences_are_read_back_by_the_reader_of_nmea() {
        let motion = Motion {
            position: Some(([-43.5, 5.999_999_999_99, -12.25], [0.5, 0.25, 1.0])),
            velocity: Some(([3.0, -4.0, 0.0], [0.1; 3])),
            attitude: Some(([1.0, 2.0, 359.5], [0.1; 3])),
        };
        let mut text = String::new();
        motion.nmea(&mut text, 1_790_000_000_500_000_000);
        let mut frames = Frames::new(text.as_bytes(), Sentences::NMEA);
        let mut parsed = Vec::new();
        while let Ok(Some(frame)) = frames.next() {
            parsed.extend(parse(Sentences::NMEA.content(frame.bytes)));
        }
        assert_eq!((parsed.len(), frames.damage().bytes()), (4, 0), "{text}");
        let text = format!("{parsed:?}");
        for value in [-43.5_f64, 6.0, 359.5] {
            assert!(text.contains(&format!("{:.12}", value.to_radians())[..7]), "{value}: {text}");
        }
        assert!(text.contains("-12.25"), "{text}");
    }
}
