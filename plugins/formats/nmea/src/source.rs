//! The source: one stream of samples for each sensor that the scenario names.

use crate::beacon::Beacon;
use crate::config::Nmea;
use crate::epoch::{Dates, Epoch, Gatherer, North, Part};
use crate::sentence::{Sentence, parse, talker};
use navfuse_core::input::Input;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_frames::{Check, Clock, Count, Frames, Sentences, TimeConfig, open};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Size in bytes of the beginning of a file in which a date is searched.
const BEGINNING: u64 = 1024 * 1024;
/// Largest number of addresses that a message lists.
const LISTED: usize = 12;
/// The type of sensor that receives headings from magnetic north.
const MAGNETIC: &str = "magnetic-heading";
/// The sentence of Kongsberg's acoustic positioning.
const KONGSBERG: &str = "PSIMSSB";
/// The word for a record in messages.
const RECORD: &str = "sentence";

impl SourceType for Nmea {
    const TYPE: &'static str = "nmea";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let targets = targets(&self, context)?;
        let path = context.base.join(&self.file);
        let framing = self.checksum.framing();
        let dates = first_date(&path, framing)?;
        let mut sources: Vec<Box<dyn Source>> = Vec::new();
        for target in targets {
            let gatherer = Gatherer::new(target.part, self.estimated, dates);
            let mut stream = Stream {
                frames: Frames::new(open(&path)?, framing),
                path: path.clone(),
                talker: self.talker.clone(),
                target,
                gatherer,
                clock: Clock::new(self.time.zero()?),
                config: self.time,
                ready: None,
                checked: false,
                ended: false,
                sentences: 0,
                addresses: Vec::new(),
                estimated: Count::default(),
                unchecked: Count::default(),
                framing,
                // each source reads the whole file; the first reports its damage
                reports_damage: sources.is_empty(),
            };
            stream.start()?;
            sources.push(Box::new(stream));
        }
        Ok(sources)
    }
}

/// The first date in a file, by which sentences before it have dates, too.
fn first_date(path: &Path, framing: Sentences) -> Result<Dates, StreamError> {
    let mut frames = Frames::new(open(path)?.take(BEGINNING), framing);
    let mut dates = Dates::default();
    while let Some(frame) = frames.next().map_err(|e| StreamError::read(path, e))? {
        // the dates of transponders are for their own positions alone
        let sentence = parse(framing.content(frame.bytes))
            .filter(|s| !matches!(s, Sentence::Transponder { .. }));
        let stamp = sentence.and_then(|s| Some((s.time()?, s.date()?)));
        if let Some((time, date)) = stamp {
            dates.take(time, Some(date));
            break;
        }
    }
    Ok(dates)
}

/// A sensor and its channels, in the order of [`Target::names`].
#[derive(Debug)]
struct Target {
    part: Part,
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

    fn key(part: Part) -> &'static str {
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
    fn sentences(part: Part) -> &'static str {
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

    fn sample(&self, time: Time, epoch: &Epoch) -> Option<Sample> {
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
fn targets(config: &Nmea, context: &OpenContext<'_>) -> Result<Vec<Target>, StreamError> {
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

/// Adds the address of a sentence, `GPGSV`, to those that were seen.
fn remember(addresses: &mut Vec<String>, content: &[u8]) {
    let address = content.split(|b| *b == b',').next().unwrap_or_default();
    let address = String::from_utf8_lossy(&address[..address.len().min(8)]);
    if addresses.iter().all(|seen| *seen != address) {
        addresses.push(address.into_owned());
    }
}

/// The samples of one sensor.
struct Stream {
    path: PathBuf,
    frames: Frames<Input, Sentences>,
    talker: Option<String>,
    target: Target,
    gatherer: Gatherer,
    clock: Clock<Epoch>,
    config: TimeConfig,
    /// The first sample, which was read when the file was opened.
    ready: Option<Sample>,
    checked: bool,
    ended: bool,
    sentences: u64,
    /// The first addresses, for a message about a file without the sentences that are needed.
    addresses: Vec<String>,
    estimated: Count,
    /// Sentences that are used with a wrong checksum.
    unchecked: Count,
    framing: Sentences,
    reports_damage: bool,
}

impl Stream {
    /// Reads up to the first sample, so that a file that does not fit is rejected at once.
    fn start(&mut self) -> Result<(), StreamError> {
        self.ready = self.advance()?;
        if self.ready.is_some() {
            return Ok(());
        }
        let damage = self.warnings().map_or_else(String::new, |text| format!(" ({text})"));
        let wanted = Target::sentences(self.target.part);
        let (text, remedy) = if self.sentences == 0 {
            (
                "no intact sentence of NMEA 0183".to_owned(),
                "check the file and its baud rate; checksum = \"ignore\" uses sentences with wrong \
                 checksums",
            )
        } else {
            (
                format!("no valid {wanted} with a time; it has {}", self.addresses.join(", ")),
                self.remedy(),
            )
        };
        Err(StreamError::format(format!("{text}{damage}"))
            .in_file(&self.path)
            .at_key(Target::key(self.target.part))
            .with_remedy(remedy))
    }

    /// The remedy where a file has sentences, but none that the sensor needs.
    fn remedy(&self) -> &'static str {
        match self.target.part {
            Part::Usbl(_) if !self.gatherer.unplaced.is_zero() => {
                "PSIMSSB is relative to the vessel: record its GGA or RMC with it and, for PSIMSSB \
                 with heading up, HDT or THS and ZDA"
            }
            Part::Usbl(_) if self.addresses.iter().any(|a| a == KONGSBERG) => {
                "set `beacon` to a transponder of the file; of PSIMSSB, positions that are Cartesian \
                 (C) or in radians (R) are used: let the USBL program write these in place of polar \
                 coordinates (P) or UTM (U)"
            }
            Part::Usbl(_) => "set `beacon` to a transponder of the file",
            Part::Magnetic(North::True(None)) if !self.gatherer.unreferenced.is_zero() => {
                "set `declination`, or name a sensor of type \"magnetic-heading\", which has one"
            }
            _ => {
                "HDT, THS, HDG, HDM, DPT and PSXN have no time of their own: record ZDA, RMC or \
                 GGA with them"
            }
        }
    }

    /// Reads up to the next sample; `None` at the end.
    fn advance(&mut self) -> Result<Option<Sample>, StreamError> {
        loop {
            while let Some((nanos, epoch)) = self.clock.pop() {
                if epoch.estimated {
                    self.estimated.add(epoch.offset);
                }
                if let Some(sample) = self.target.sample(Time::from_nanos(nanos), &epoch) {
                    return Ok(Some(sample));
                }
            }
            if self.ended {
                return Ok(None);
            }
            let frame = self.frames.next().map_err(|e| StreamError::read(&self.path, e))?;
            let done = if let Some(frame) = frame {
                let content = self.framing.content(frame.bytes);
                self.sentences += 1;
                if self.framing.check == Check::Ignored && !Sentences::is_checked(frame.bytes) {
                    self.unchecked.add(frame.offset);
                }
                let other = match (&self.talker, talker(content)) {
                    (Some(wanted), Some(found)) => wanted.as_bytes() != found,
                    _ => false,
                };
                if self.addresses.len() < LISTED {
                    remember(&mut self.addresses, content);
                }
                let sentence = if other { None } else { parse(content) };
                sentence.and_then(|sentence| self.gatherer.take(frame.offset, &sentence))
            } else {
                self.ended = true;
                self.gatherer.finish()
            };
            if let Some((stamp, epoch)) = done {
                if !self.checked {
                    self.checked = true;
                    self.config.check(stamp).map_err(|e| e.in_file(&self.path))?;
                }
                self.clock.push(stamp, epoch.offset, epoch);
            }
            if self.ended {
                self.clock.finish();
            }
        }
    }

    fn warnings(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.reports_damage {
            parts.extend(self.frames.damage().describe(RECORD));
            parts.extend(self.unchecked.describe(RECORD, "used without their right checksum,"));
        }
        parts.extend(self.clock.describe("epoch"));
        let estimated = "with a position that is not from satellites, set `estimated` to use it,";
        parts.extend(self.estimated.describe("epoch", estimated));
        let magnetic = "without a variation, set `declination` to use it,";
        parts.extend(self.gatherer.unreferenced.describe("magnetic heading", magnetic));
        let vessel = "left out, without a position, or for heading up a heading, of the vessel,";
        parts.extend(self.gatherer.unplaced.describe("acoustic position", vessel));
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let next = self.ready.take().map_or_else(|| self.advance(), |s| Ok(Some(s)))?;
        Ok(next.map(|next| *sample = next).is_some())
    }

    fn warning(&mut self) -> Option<String> {
        let key = Target::key(self.target.part);
        self.warnings().map(|text| format!("{}: {key}: {text}", self.path.display()))
    }
}
