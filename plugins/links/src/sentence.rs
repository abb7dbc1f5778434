//! Sentences of samples: the line protocol of navfuse.
//!
//! A sentence has the outer form of NMEA 0183: `$PNVF`, the sensor, the time, channels, and a
//! checksum, the exclusive or of all bytes between `$` and `*` in hexadecimal:
//! ```text
//! $PNVF,depth,12.250000000,depth=31.04*2D
//! ```
//! The time is in seconds on the clock of the run, or empty where samples are stamped on arrival.
//! Values are in SI. The sensor and the channels have the names of the scenario; a channel that is
//! missing is left out.
//!
//! A sentence with a command is `$PNVC` and `reset`, `checkpoint`, or `sensor`, the name of a sensor, and
//! `on` or `off`:
//! ```text
//! $PNVC,sensor,dvl,off*20
//! ```

use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::Command;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::Sentences;
use navfuse_nmea::writing::close;
use std::fmt::Write;
use std::str::Split;

/// The address of a sentence of samples.
const ADDRESS: &str = "PNVF";
/// The address of a sentence with a command.
const COMMAND: &[u8] = b"PNVC,";

/// A sentence of samples, whose channels are not resolved yet.
#[derive(Clone, Debug)]
pub struct Sentence<'a> {
    /// Name of the sensor.
    pub sensor: &'a str,
    /// Time in nanoseconds; `None` where it is left to the receiver.
    pub nanos: Option<i64>,
    channels: Split<'a, char>,
}

impl<'a> Sentence<'a> {
    /// The sentence in the content of a frame of [`Sentences::NMEA`]; `None` for another one, and
    /// for one whose time is no number.
    pub fn parse(content: &'a [u8]) -> Option<Self> {
        let text = std::str::from_utf8(content).ok()?;
        let mut fields = text.split(',');
        if fields.next() != Some(ADDRESS) {
            return None;
        }
        let (sensor, time) = (fields.next()?, fields.next()?);
        let nanos = if time.is_empty() { None } else { Some(nanos(time)?) };
        Some(Self { sensor, nanos, channels: fields })
    }

    /// Fills the channels of a sample; `None` if a channel is unknown or no number.
    pub fn fill(self, info: &SensorInfo, sample: &mut Sample) -> Option<()> {
        for field in self.channels {
            let (name, value) = field.split_once('=')?;
            sample.set(info.position(name)?, value.parse().ok()?);
        }
        (sample.present() != 0).then_some(())
    }
}

/// Tests whether the content of a frame of [`Sentences::NMEA`] is a command.
pub(crate) fn is_command(content: &[u8]) -> bool {
    content.starts_with(COMMAND)
}

/// The command in such a content, to a run with these sensors; `None` if it has no such command.
pub(crate) fn command(content: &[u8], sensors: &[SensorInfo]) -> Option<Command> {
    let text = std::str::from_utf8(content.strip_prefix(COMMAND)?).ok()?;
    let mut fields = text.split(',');
    match [(); 4].map(|()| fields.next()) {
        [Some("reset"), None, ..] => Some(Command::Reset),
        [Some("checkpoint"), None, ..] => Some(Command::Checkpoint),
        [Some("sensor"), Some(name), Some(switch @ ("on" | "off")), None] => {
            let sensor = sensors.iter().position(|info| info.name == name)?;
            Some(Command::Use(SensorId(sensor), switch == "on"))
        }
        _ => None,
    }
}

/// Reads seconds with up to nine decimals, exactly.
fn nanos(text: &str) -> Option<i64> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let (seconds, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    let plain = |part: &str| part.bytes().all(|b| b.is_ascii_digit());
    if seconds.is_empty() || decimals.len() > 9 || !plain(seconds) || !plain(decimals) {
        return None;
    }
    let seconds: i64 = seconds.parse().ok()?;
    let decimals: i64 = format!("{decimals:0<9}").parse().ok()?;
    let nanos = seconds.checked_mul(1_000_000_000)?.checked_add(decimals)? * sign;
    (Time::MIN.nanos() < nanos && nanos < Time::MAX.nanos()).then_some(nanos)
}

/// Appends the sentence of a sample, with its line break. A number is written with as many digits as
/// it needs to be read back to the same bits.
pub fn write_sentence(out: &mut String, info: &SensorInfo, sample: &Sample) {
    let begin = out.len();
    let nanos = sample.time.nanos();
    let (sign, size) = (if nanos < 0 { "-" } else { "" }, nanos.unsigned_abs());
    let (seconds, decimals) = (size / 1_000_000_000, size % 1_000_000_000);
    // writing to a text cannot fail
    let _ = write!(out, "${ADDRESS},{},{sign}{seconds}.{decimals:09}", info.name);
    for (k, channel) in info.channels.iter().enumerate() {
        if let Some(value) = sample.get(k) {
            let _ = write!(out, ",{}={value:?}", channel.name);
        }
    }
    close(out, begin);
}

/// The framing of the sentences.
pub(crate) const FRAMING: Sentences = Sentences::NMEA;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use navfuse_core::model::sensor::Purpose;
    use navfuse_core::model::sensor::mounting::Mounting;
    use navfuse_core::units::sample::Channel;
    use navfuse_frames::Frames;

    fn dvl() -> SensorInfo {
        SensorInfo {
            name: "dvl".to_owned(),
            kind: "dvl".to_owned(),
            channels: Channel::all([("vel_x", "m/s"), ("vel_y", "m/s"), ("vel_z", "m/s")]).to_vec(),
            purpose: Purpose::Measurement,
            mounting: Mounting::default(),
        }
    }

    #[test]
    fn a_sentence_gives_the_time_and_the_values_back_to_the_bit() {
        let info = dvl();
        for nanos in [0, 1, -1, 12_250_000_000, -3_000_000_001, 1_790_000_000_123_456_789] {
            let values = [0.1 + 0.2, -1e-310, 5.0e15 / 3.0];
            let mut sample = Sample::new(Time::from_nanos(nanos), SensorId(0), &values);
            sample.clear(1);
            let mut line = String::new();
            write_sentence(&mut line, &info, &sample);
            let mut frames = Frames::new(line.as_bytes(), FRAMING);
            let frame = frames.next().unwrap().unwrap();
            let read = Sentence::parse(FRAMING.content(frame.bytes)).unwrap();
            assert_eq!((read.sensor, read.nanos), ("dvl", Some(nanos)));
            let mut back = Sample::empty(Time::from_nanos(nanos), SensorId(0));
            read.fill(&info, &mut back).unwrap();
            assert_eq!(back.present(), sample.present());
            assert_eq!(back.get(0).map(f64::to_bits), sample.get(0).map(f64::to_bits));
            assert_eq!(back.get(2).map(f64::to_bits), sample.get(2).map(f64::to_bits));
        }
    }

    #[test]
    fn a_command_is_known_by_all_of_its_fields() {
        let of = |text: &str| command(text.as_bytes(), &[dvl()]);
        assert_eq!(of("PNVC,reset"), Some(Command::Reset));
        assert_eq!(of("PNVC,checkpoint"), Some(Command::Checkpoint));
        assert_eq!(of("PNVC,sensor,dvl,off"), Some(Command::Use(SensorId(0), false)));
        assert_eq!(of("PNVC,sensor,dvl,on"), Some(Command::Use(SensorId(0), true)));
        for wrong in [
            "PNVC,",
            "PNVC,reset,now",
            "PNVC,Reset",
            "PNVC,sensor,dvl",
            "PNVC,sensor,dvl,0",
            "PNVC,sensor,sonar,off",
            "PNVC,sensor,dvl,on,dvl",
            "PNVF,dvl,1.5,vel_x=1",
        ] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_sentence_with_a_wrong_field_gives_nothing() {
        let fill = |text: &str| {
            let mut sample = Sample::empty(Time::from_nanos(0), SensorId(0));
            Sentence::parse(text.as_bytes())?.fill(&dvl(), &mut sample)
        };
        assert_eq!(fill("PNVF,dvl,1.5,vel_x=1"), Some(()));
        assert_eq!(fill("PNVF,dvl,,vel_x=1"), Some(()), "the receiver stamps it");
        for wrong in [
            "PNVF,dvl,1.5",
            "PNVF,dvl,1.5,vel_x=",
            "PNVF,dvl,1.5,vel_x",
            "PNVF,dvl,1.5,speed=1",
            "PNVF,dvl,1e3,vel_x=1",
            "PNVF,dvl,99999999999,vel_x=1",
            "PNVF,dvl",
            "GPGGA,dvl,1.5,vel_x=1",
        ] {
            assert_eq!(fill(wrong), None, "{wrong}");
        }
    }
}
