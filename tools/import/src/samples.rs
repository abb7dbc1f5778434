//! What the samples of a recording show: axes, units, clocks and mountings, which the scenario corrects.

use crate::axes::{self, Sense, Turn};
use crate::beams::Aimed;
use crate::recording::{Part, Reader, Recording};
use crate::rotation::Rotation;
use crate::stream::StreamSurvey;
use crate::table::GUESSED;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use std::path::PathBuf;

/// Noise of rates, deg/h/sqrt(Hz), beyond any instrument: 1 deg/s/sqrt(Hz), ten times that of a phone on
/// a rough road.
const NOISY: f64 = 3600.0;
/// Mean depth, m, from which it is a height.
const ABOVE: f64 = -0.3;
/// Time before which a clock is not that of Unix, s: ten years after 1970.
const COUNTS: f64 = 315_576_000.0;
/// Sensors whose clock is not shifted: they are what the others are compared with.
const FIXED: [&str; 5] = ["imu", "ahrs", "reference", "odometry", "attitude"];
/// Offset, s, that the latency of one instrument does not explain, and its share within which another sensor on the
/// same clock begins and ends.
const LATENCY: f64 = 1.0;
const TOGETHER: f64 = 0.25;
/// Sensors that drive the filter.
pub const DRIVING: [&str; 2] = ["imu", "ahrs"];

/// The conversion of the samples of a sensor, as the key `samples` has it, and its mounting.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// The axes forward, right, down.
    pub axes: Option<[String; 3]>,
    /// The turn of a table's samples by any angle, before these axes.
    pub rotation: Option<Rotation>,
    /// 1-sigma of the roll, pitch and yaw, rad, of axes that were guessed by the motion; zero for others.
    pub doubt: [f64; 3],
    /// Factor of the rates, of which the motion shows another unit.
    pub rates: Option<f64>,
    /// Set if rates, and specific forces, are negative.
    pub negative: [bool; 2],
    /// Set if the vertical specific force is negative.
    pub vertical: bool,
    /// Set if the second axis was turned, because the axes formed a left-handed set.
    pub mirrored: bool,
    /// Set if a depth counts upwards.
    pub upwards: bool,
    /// Set if a sample of zeros is none.
    pub zeros: bool,
    /// Number of beams whose velocities have the other sign.
    pub beams: usize,
    /// The beams of a log, as the motion shows them.
    pub aimed: Option<Aimed>,
    /// Shift of the stamps, s.
    pub clock: Option<f64>,
    /// Yaw of a velocity log in the vehicle.
    pub mounting: Option<Turn>,
}

impl Samples {
    /// Turns the axes, after what has turned them already.
    pub fn turn(&mut self, axes: [String; 3]) {
        self.axes = Some(match self.axes.take() {
            Some(before) => axes.map(|axis| axes::composed(&before, &axis)),
            None => axes,
        });
    }

    /// The line of the scenario; `None` for samples that need no conversion.
    pub fn line(&self) -> Option<String> {
        let axes =
            self.axes.as_ref().map(|[x, y, z]| format!("axes = [\"{x}\", \"{y}\", \"{z}\"]"));
        let unit = self.rates.unwrap_or(1.0);
        let sizes = [("gyro", unit), ("accel", 1.0)];
        let factors = sizes.iter().zip(self.negative).filter_map(|((name, size), negative)| {
            let size = if negative { -size } else { *size };
            let vector = || ["x", "y", "z"].map(|axis| format!("{name}_{axis} = {size}"));
            (size != 1.0).then(|| vector().join(", "))
        });
        let vertical = self.vertical.then(|| "accel_z = -1".to_owned());
        let factors: Vec<String> = factors.chain(vertical).collect();
        let factor =
            (!factors.is_empty()).then(|| format!("factor = {{ {} }}", factors.join(", ")));
        let depth = self.upwards.then(|| "factor = { depth = -1 }".to_owned());
        let beams =
            (1..=self.beams).map(|k| format!("beam_{k} = -1")).collect::<Vec<_>>().join(", ");
        let beams = (self.beams > 0).then(|| format!("factor = {{ {beams} }}"));
        let zeros = self.zeros.then(|| "zeros = \"missing\"".to_owned());
        let clock = self.clock.map(|clock| format!("clock = \"{clock:.3} s\""));
        let keys: Vec<String> =
            [axes, factor, depth, beams, zeros, clock].into_iter().flatten().collect();
        (!keys.is_empty()).then(|| format!("samples = {{ {} }}", keys.join(", ")))
    }
}

pub fn find<'a>(streams: &'a [StreamSurvey], name: &str) -> Option<&'a StreamSurvey> {
    streams.iter().find(|s| s.sensor == name)
}

/// Tests whether a sensor has no time in common with the one that drives the filter.
fn is_apart(streams: &[StreamSurvey], stream: &StreamSurvey) -> bool {
    let drive = DRIVING.iter().find_map(|name| find(streams, name));
    drive.is_some_and(|drive| drive.samples > 0 && stream.samples > 0 && !drive.meets(stream))
}

impl Recording {
    /// Changes the description by what the samples show; `true` if it changed.
    pub fn learn(&mut self, streams: &[StreamSurvey]) -> bool {
        // as the file has them: clocks may fit such velocities at a wrong offset
        self.earth = self.earth.or_else(|| find(streams, "dvl").and_then(|s| s.earth));
        let turned = self.level(streams) | self.scale_rates(streams) | self.date(streams);
        // the attitude is along the axes of the IMU, and a sensor without samples shows nothing
        let changed = turned || self.leave_rates(streams) || self.take_attitude(streams);
        let changed = self.drop_empty(streams) || changed;
        // clocks and mountings are compared in the right axes, and axes on the right clock
        changed
            || self.rates_by_course(streams)
            || self.turn_depth(streams)
            || self.turn_beams(streams)
            || self.turn_log(streams)
            || self.exchange(streams)
            || self.reorder(streams)
            || self.shift(streams)
            || self.level_freely(streams)
            || self.right_senses(streams)
            || self.turn(streams)
            || self.turn_freely(streams)
            || self.mount(streams)
    }

    pub fn part_mut(&mut self, name: &str) -> Option<&mut Part> {
        self.parts.iter_mut().find(|part| part.name == name)
    }

    /// Leaves out an IMU whose rates are noise beyond any instrument, where an attitude is known.
    fn leave_rates(&mut self, streams: &[StreamSurvey]) -> bool {
        let noisy =
            find(streams, "imu").is_some_and(|imu| imu.samples > 0 && imu.rate_scatter() > NOISY);
        let known = find(streams, "attitude").is_some_and(|own| own.samples > 0);
        if !noisy || !known || !self.drive_by_attitude() {
            return false;
        }
        let text = "the rates of the IMU are noise: the attitude of the vehicle's own filter drives \
                    dead reckoning";
        self.notes.push(format!("ahrs: {text}"));
        true
    }

    /// Leaves out sensors of which no file has a valid sample, and receivers that never have a position.
    fn drop_empty(&mut self, streams: &[StreamSurvey]) -> bool {
        let silent = |name: &str| find(streams, name).is_some_and(|s| s.samples == 0 || s.nowhere);
        let (empty, parts) = std::mem::take(&mut self.parts)
            .into_iter()
            .partition::<Vec<Part>, _>(|part| !DRIVING.contains(&part.name) && silent(part.name));
        self.parts = parts;
        let note = |part: &Part| {
            let lacks = match find(streams, part.name).is_some_and(|s| s.samples > 0) {
                true => "no latitude and longitude in any row",
                false => "no valid sample",
            };
            format!("{}: {} has {lacks} for it: left out", part.name, part.file.display())
        };
        let sensors = || empty.iter().filter(|p| p.name != "attitude");
        self.notes.extend(sensors().map(note));
        self.empty.extend(sensors().map(|part| (part.name, part.file.clone())));
        !empty.is_empty()
    }

    /// Takes the first attitude of the vehicle's own filter, whose samples have no other use.
    fn take_attitude(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(k) = self.parts.iter().position(|part| part.name == "attitude") else {
            return false;
        };
        self.parts.remove(k);
        self.attitude = find(streams, "attitude").and_then(|s| {
            let angle = |name| s.first.get(s.channel(name)?);
            Some([angle("roll")?, angle("pitch")?, angle("yaw")?])
        });
        true
    }

    /// Gives dated pings an origin beside an IMU whose clock counts from elsewhere.
    fn date(&mut self, streams: &[StreamSurvey]) -> bool {
        let dated = self.parts.iter().find_map(|p| match p.reader {
            Reader::Dvl(stamp) => stamp,
            _ => None,
        });
        let drive = DRIVING.iter().find_map(|name| find(streams, name));
        let counts = drive.is_some_and(|drive| drive.span[0].seconds() < COUNTS);
        if dated.is_none() || !counts || self.origin.is_some() {
            return false;
        }
        self.origin = dated;
        true
    }

    /// Turns an IMU so that its third axis points down, by the mean of the specific force.
    fn level(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(imu) = find(streams, "imu") else { return false };
        if imu.samples == 0 || std::mem::replace(&mut self.turned[0], true) {
            return false;
        }
        let first = imu.channel("accel_x").or_else(|| imu.channel("dvel_x"));
        let Some(k) = first else { return false };
        let force = [imu.mean[k], imu.mean[k + 1], imu.mean[k + 2]];
        let Some(axes) = axes::named(force, 0) else {
            self.ask(
                "no axis of the IMU is near the vertical by the mean of the specific force: \
                      which of them point forward, right, down? Set sensor.imu.samples.axes",
            );
            return false;
        };
        let bag = |p: &Part| matches!(p.name, "imu" | "attitude") && p.reader == Reader::Bag;
        let up = axes[2] == "-z";
        if axes[2] == "z" {
            return false;
        }
        if up && self.parts.iter().any(|p| p.name == "imu" && bag(p)) {
            // the source has turned the axes of ROS, which these were not
            let turned = self.parts.iter_mut().filter(|p| bag(p));
            turned.for_each(|part| part.found.source.push("axes = \"frd\"".to_owned()));
            let text = "its axes are forward, right, down already, and not the axes of ROS";
            self.notes.push(format!("imu: {text}"));
            self.ask(&format!("by the mean of accel_z, {text}"));
            return true;
        }
        if up {
            self.notes
                .push("imu: its z axis points up; y and z are turned to right and down".into());
            self.ask(
                "the mean of accel_z fits an IMU whose z axis points up: forward, left, up is \
                      assumed, and y and z are turned",
            );
        } else {
            let text =
                format!("its axis {} points down, by the mean of the specific force", axes[2]);
            self.notes.push(format!("imu: {text}"));
            self.ask(&format!("{text}; {} is taken for forward", axes[0]));
        }
        self.set_axes(axes);
        true
    }

    /// Turns the IMU about the vertical by the course of a receiver. A velocity log shows the axes of
    /// its own, and a vehicle with one may move sideways.
    fn turn(&mut self, streams: &[StreamSurvey]) -> bool {
        let turn = find(streams, "gnss").and_then(|s| s.course).map(|course| course.turn);
        let Some(quarters) = turn.and_then(axes::quarters) else { return false };
        if quarters == 0 || self.moves_sideways() || std::mem::replace(&mut self.turned[1], true) {
            return false;
        }
        let Some(relative) = axes::named([0.0, 0.0, -1.0], quarters) else { return false };
        let text = format!(
            "the course of the receiver fits its accelerations after a turn by {} deg about down",
            90 * quarters
        );
        self.notes.push(format!("imu: {text}"));
        self.ask(&text);
        self.set_axes(relative);
        true
    }

    /// Tests whether the vehicle may move sideways, so that its course is no heading.
    pub fn moves_sideways(&self) -> bool {
        ["dvl", "compass"].iter().any(|name| self.part(name).is_some())
    }

    /// Turns the signs of rates or forces that are negative, and of an axis of a left-handed set, by
    /// the course of a receiver.
    fn right_senses(&mut self, streams: &[StreamSurvey]) -> bool {
        let course = find(streams, "gnss").and_then(|s| s.course);
        let sense = course.map_or(Sense::Right, |course| course.sense);
        let increments = find(streams, "imu").is_some_and(|imu| imu.channel("dvel_x").is_some());
        if self.moves_sideways() || increments {
            return false;
        }
        let text = match sense {
            Sense::Right => return false,
            Sense::LeftHanded => "its axes form a left-handed set: y is turned",
            Sense::Rates => "its rates have the wrong sign: the signs are reversed",
            Sense::Forces => "its specific forces have the wrong sign: the signs are reversed",
            Sense::Vertical => "its vertical specific force has the wrong sign: it is reversed",
        };
        let Some(part) = self.part_mut("imu") else { return false };
        // each sense is turned once
        match sense {
            Sense::LeftHanded if !part.samples.mirrored => {
                part.samples.mirrored = true;
                part.samples.turn(["x", "-y", "z"].map(str::to_owned));
            }
            Sense::Rates if !part.samples.negative[0] => part.samples.negative[0] = true,
            Sense::Forces if !part.samples.negative[1] => {
                part.samples.negative[1] = true;
                // the vertical, which the forces show, points the other way
                part.samples.axes = None;
                part.found.source.retain(|key| key != "axes = \"frd\"");
                self.turned = [false; 2];
            }
            Sense::Vertical if !part.samples.vertical && !part.samples.negative[1] => {
                part.samples.vertical = true;
                part.samples.axes = None;
                self.turned = [false; 2];
            }
            _ => return false,
        }
        let text = format!("{text}, by the course and the accelerations of the receiver");
        self.notes.push(format!("imu: {text}"));
        self.ask(&text);
        true
    }

    pub fn ask(&mut self, question: &str) {
        if let Some(part) = self.part_mut("imu") {
            part.found.questions.push(question.to_owned());
        }
    }

    /// Turns the IMU, after what has turned it already.
    fn set_axes(&mut self, axes: [String; 3]) {
        if let Some(part) = self.part_mut("imu") {
            part.samples.turn(axes);
        }
    }

    /// Shifts the clocks whose offset from the clock of the IMU the motion shows, and those of other sensors that share
    /// one of these: they have no time in common with the IMU, or show no motion.
    fn shift(&mut self, streams: &[StreamSurvey]) -> bool {
        let mut shifted: Vec<(&StreamSurvey, f64)> = Vec::new();
        let own = |part: &&mut Part| part.samples.clock.is_none();
        for part in self.parts.iter_mut().filter(own) {
            let Some(stream) = find(streams, part.name) else { continue };
            let fixed = FIXED.contains(&part.name) && !is_apart(streams, stream);
            let clock = stream.clock.filter(|clock| clock.matters() && !fixed);
            let Some(clock) = clock else { continue };
            part.samples.clock = Some(clock.correction());
            self.notes.push(format!("{}: {}: its stamps are shifted", part.name, clock.describe()));
            shifted.push((stream, clock.correction()));
        }
        let files: Vec<(String, PathBuf)> =
            self.parts.iter().map(|part| (part.name.to_owned(), part.file.clone())).collect();
        let file = |name: &str| files.iter().find(|(n, _)| n == name).map(|(_, file)| file);
        let drive = DRIVING.iter().find_map(|name| file(name));
        for part in self.parts.iter_mut().filter(own).filter(|p| !FIXED.contains(&p.name)) {
            let Some(stream) = find(streams, part.name).filter(|s| s.samples > 0) else { continue };
            // a sensor whose motion shows no clock shares one with that of its file, or that begins and ends with it
            let apart = is_apart(streams, stream);
            let together = |other: &StreamSurvey, clock: f64| {
                let near =
                    |k: usize| other.span[k].since(stream.span[k]).abs() < TOGETHER * clock.abs();
                let beside = drive != Some(&part.file) && file(&other.sensor) == Some(&part.file);
                clock.abs() > LATENCY && stream.clock.is_none() && (beside || (near(0) && near(1)))
            };
            let same = shifted.iter().find(|(other, clock)| {
                if apart { other.meets(stream) } else { together(other, *clock) }
            });
            let Some((other, clock)) = same else { continue };
            part.samples.clock = Some(*clock);
            let text =
                format!("its stamps are shifted by {clock:.3} s, as those of {}", other.sensor);
            self.notes.push(format!("{}: {text}", part.name));
            part.found.questions.push(text);
        }
        !shifted.is_empty()
    }

    /// Reads the dates of a sensor that has no time in common with the IMU in the other order, where they do
    /// not show which one it is: its own, or else the dates of the IMU.
    fn reorder(&mut self, streams: &[StreamSurvey]) -> bool {
        let apart = |part: &&Part| find(streams, part.name).is_some_and(|s| is_apart(streams, s));
        let apart = self.parts.iter().filter(apart).map(|part| part.name);
        let names: Vec<&str> = apart.chain(DRIVING).collect();
        let guess = |part: &&mut Part| {
            let mut questions = part.found.questions.iter();
            names.contains(&part.name) && questions.any(|q| q.contains(GUESSED))
        };
        let apart = streams.iter().any(|stream| is_apart(streams, stream));
        let Some(part) = self.parts.iter_mut().filter(|_| apart).find(guess) else { return false };
        for key in &mut part.found.source {
            *key = key.replace("month-day-year", "day-month-year");
        }
        for question in &mut part.found.questions {
            *question = question.replace(GUESSED, "is day, month, year, by the other files");
        }
        true
    }

    /// Tests whether all sensors have time in common with the one that drives the filter.
    ///
    /// # Errors
    /// When one has none: with both files and their spans.
    pub fn share_time(&self, streams: &[StreamSurvey]) -> Result<(), StreamError> {
        let drive = DRIVING.iter().find_map(|name| find(streams, name));
        let apart = |part: &&Part| find(streams, part.name).is_some_and(|s| is_apart(streams, s));
        let Some((drive, part)) = drive.zip(self.parts.iter().find(apart)) else { return Ok(()) };
        let describe = |name: &str| {
            let span = find(streams, name).map_or([Time::MIN; 2], |stream| stream.span);
            let file = self.part(name).map(|part| part.file.display().to_string());
            format!("{} ({name}, from {} to {})", file.unwrap_or_default(), span[0], span[1])
        };
        let text = format!(
            "{} and {} have no time in common, and their motions do not show the offset of their clocks",
            describe(&drive.sensor),
            describe(part.name)
        );
        Err(StreamError::format(text).with_remedy(
            "write the times of both on one clock, or shift one with `offset` of the key `time` in a \
             scenario",
        ))
    }

    /// Turns a depth that is below zero on average, and no pressure at a height above the sea.
    fn turn_depth(&mut self, streams: &[StreamSurvey]) -> bool {
        let above = find(streams, "depth").is_some_and(|s| s.samples > 0 && s.mean[0] < ABOVE);
        let Some(part) = self.part_mut("depth").filter(|part| above && !part.samples.upwards)
        else {
            return false;
        };
        if part.found.source.iter().any(|key| key.contains("press")) {
            return false;
        }
        part.samples.upwards = true;
        let text = "it is below zero on average, as a height is: its sign is turned";
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("depth: {text}"));
        true
    }
}
