//! The files of a recording and the sensors in them.

use crate::bag::{self, InBag};
use crate::found::{Found, OdometryUse};
use crate::instrument;
use crate::marks;
use crate::stream::StreamSurvey;
use crate::table;
use crate::vehicle;
use navfuse_core::model::stream::StreamError;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Size in bytes of the beginning of a file by which it is recognised.
const BEGINNING: u64 = 256 * 1024;
/// Size in bytes of the beginning of a table by which its units are found.
const TABLE: u64 = 4 * 1024 * 1024;
/// Size in bytes of the beginning of a log of a vehicle in which its messages are looked for.
const MESSAGES: u64 = 16 * 1024 * 1024;

/// Rates, rad/s, above which the unit of an IMU is looked at, and below which a vehicle hardly turns.
const FAST: f64 = 0.5;
const STILL: f64 = 0.005;
/// Ratio of rates in deg/s to the changes of the attitude in rad/s: 57, or less by the noise of the
/// changes.
const DEGREES: std::ops::RangeInclusive<f64> = 10.0..=110.0;

/// The sensors in the order of a scenario.
const ORDER: [&str; 9] =
    ["imu", "dvl", "depth", "gnss", "compass", "odometer", "odometry", "reference", "attitude"];

/// The source type that reads a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    Csv,
    /// With the time of the first ping, if the format has dates.
    Dvl(Option<i64>),
    Nmea,
    /// With the index of the file among the logs of vehicles.
    Vehicle(navfuse_vehicle_logs::Format, usize),
    Bag,
}

/// A sensor with its file.
#[derive(Clone, Debug)]
pub struct Part {
    /// Name of the sensor.
    pub name: &'static str,
    pub found: Found,
    pub reader: Reader,
    /// The file, absolute.
    pub file: PathBuf,
    /// Position from the IMU along forward, right, down, m, where the recording has it.
    pub lever_arm: Option<[f64; 3]>,
}

/// The sensors of a recording.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    pub parts: Vec<Part>,
    pub notes: Vec<String>,
    /// Zero of the run's clock for pings with dates, where the other files count from elsewhere.
    pub origin: Option<i64>,
    /// Use of an odometry, as answered.
    odometry: Option<OdometryUse>,
    /// Odometry of a bag, whose use depends on the other files.
    undecided: Option<(InBag, PathBuf)>,
    /// What each file has, in words.
    contents: Vec<(PathBuf, String)>,
    /// Set if a file is a bag.
    bag: bool,
    /// Set once the axes were turned.
    turned: bool,
    /// Roll, pitch and yaw at the start by the vehicle's own filter, rad.
    pub attitude: Option<[f64; 3]>,
}

impl Recording {
    /// Recognises files; `None` if `stop` was set.
    ///
    /// # Errors
    /// When a file cannot be read or recognised, two files have the same sensor, or no file has an
    /// IMU.
    pub fn recognise(
        files: &[PathBuf],
        odometry: Option<OdometryUse>,
        stop: &AtomicBool,
    ) -> Result<Option<Self>, StreamError> {
        let mut recording = Self { odometry, ..Self::default() };
        for file in files {
            if !recording.add(file, stop)? {
                return Ok(None);
            }
        }
        recording.use_odometry()?;
        if recording.part("imu").is_none() {
            return Err(recording.without_imu());
        }
        recording.parts.sort_by_key(|part| ORDER.iter().position(|name| *name == part.name));
        Ok(Some(recording))
    }

    /// The error of a recording without an IMU: what each file has, and what is missing.
    fn without_imu(&self) -> StreamError {
        let has = self.contents.iter().map(|(file, has)| format!("{}: {has}", file.display()));
        let text = format!("no file has an IMU ({})", has.collect::<Vec<_>>().join("; "));
        let remedy = if self.parts.iter().any(|p| p.reader == Reader::Bag) || self.bag {
            "name the fields of an unknown type in a scenario, such as \
             [source.ros2.sensors.imu] with topic = \"/fmu/out/sensor_combined\" and \
             channels.gyro_x = { field = \"gyro_rad[0]\" }"
        } else {
            "give a table with the columns gyro_x_radps ... accel_z_mps2 or dtheta_x_rad ... \
             dvel_z_mps"
        };
        StreamError::format(text).with_remedy(remedy)
    }

    /// The sensor of a name.
    pub fn part(&self, name: &str) -> Option<&Part> {
        self.parts.iter().find(|part| part.name == name)
    }

    fn add(&mut self, file: &Path, stop: &AtomicBool) -> Result<bool, StreamError> {
        let bytes = match file.is_dir() {
            true => Vec::new(),
            false => {
                navfuse_csv::beginning(file, BEGINNING).map_err(|e| StreamError::open(file, e))?
            }
        };
        if let Some([format, remedy]) = marks::known(&bytes) {
            let text = format!("it is {format}, which navfuse does not read");
            return Err(StreamError::format(text).in_file(file).with_remedy(remedy));
        }
        let absolute = std::fs::canonicalize(file).map_err(|e| StreamError::open(file, e))?;
        if bag::is_bag(file, &bytes) {
            let paths = [file.to_owned()];
            let Some(survey) = navfuse_ros2::survey(&paths, || stop.load(Ordering::Relaxed))?
            else {
                return Ok(false);
            };
            if let Some(other) = self.parts.iter().find(|p| p.reader == Reader::Bag) {
                let text = format!("a second bag beside {}", other.file.display());
                return Err(StreamError::format(text)
                    .in_file(file)
                    .with_remedy("give one bag, which may have several files in one folder"));
            }
            let (sensors, odometry) = bag::sensors(&survey, file, &mut self.notes)?;
            let topics = survey.topics.iter().map(|t| format!("{} ({})", t.name, t.kind));
            let has = match topics.collect::<Vec<_>>().as_slice() {
                [] => survey.faults.clone().unwrap_or_else(|| "no topic".to_owned()),
                topics => format!("the topics {}", topics.join(", ")),
            };
            self.contents.push((file.to_owned(), has));
            self.bag = true;
            for InBag { found, lever_arm } in sensors {
                self.add_part(found, Reader::Bag, file, &absolute, lever_arm)?;
            }
            self.undecided = odometry.map(|odometry| (odometry, file.to_owned()));
            return Ok(true);
        }
        let (reader, found) = if let Some((stamp, found)) = instrument::velocity_log(&bytes) {
            (Reader::Dvl(stamp), found)
        } else if let Some(format) = navfuse_vehicle_logs::Format::recognise(&bytes) {
            let bytes =
                navfuse_csv::beginning(file, MESSAGES).map_err(|e| StreamError::open(file, e))?;
            let found = vehicle::sensors(format, bytes, &mut self.notes);
            if found.is_empty() {
                let text = format!("no known message of the format {}", format.name());
                return Err(StreamError::format(text).in_file(file).with_remedy(
                    "write [source.vehicle-log] into a scenario, and map the fields of its messages",
                ));
            }
            let logs = self.parts.iter().filter_map(|p| match p.reader {
                Reader::Vehicle(_, k) => Some(k + 1),
                _ => None,
            });
            (Reader::Vehicle(format, logs.max().unwrap_or(0)), found)
        } else if let Some(found) = instrument::nmea(&bytes) {
            (Reader::Nmea, found)
        } else {
            let found = as_table(file, &bytes)?;
            (Reader::Csv, found)
        };
        let kinds: Vec<&str> = found.iter().map(|found| found.kind).collect();
        self.contents.push((file.to_owned(), kinds.join(", ")));
        for mut found in found {
            let stem = file.file_stem().map(|s| s.to_string_lossy().to_lowercase());
            let is_reference = stem.is_some_and(|s| s.contains("reference") || s.contains("truth"));
            if found.kind == "gnss" && is_reference {
                found.kind = "reference";
            }
            self.add_part(found, reader, file, &absolute, None)?;
        }
        Ok(true)
    }

    /// Adds the odometry of a bag: as answered, or as relative poses where the recording has GNSS or
    /// a reference.
    fn use_odometry(&mut self) -> Result<(), StreamError> {
        let Some((mut odometry, file)) = self.undecided.take() else { return Ok(()) };
        let known = ["gnss", "reference"].iter().any(|name| self.part(name).is_some());
        let default = if known { OdometryUse::RelativePose } else { OdometryUse::Reference };
        bag::use_odometry(&mut odometry.found, self.odometry.unwrap_or(default));
        let absolute = std::fs::canonicalize(&file).map_err(|e| StreamError::open(&file, e))?;
        self.add_part(odometry.found, Reader::Bag, &file, &absolute, odometry.lever_arm)
    }

    /// Adds a sensor of a file.
    fn add_part(
        &mut self,
        mut found: Found,
        reader: Reader,
        file: &Path,
        absolute: &Path,
        lever_arm: Option<[f64; 3]>,
    ) -> Result<(), StreamError> {
        let name = match found.kind {
            "dual-antenna" => "compass",
            "relative-pose" => "odometry",
            "attitude" => {
                found.kind = "reference";
                "attitude"
            }
            kind => kind,
        };
        if let Some(other) = self.part(name) {
            let message = format!(
                "it has the sensor {name}, as {} has: give one of the files",
                other.file.display()
            );
            return Err(StreamError::format(message).in_file(file));
        }
        self.parts.push(Part { name, found, reader, file: absolute.to_owned(), lever_arm });
        Ok(())
    }

    /// Changes the description by what the samples show; `true` if it changed.
    pub fn learn(&mut self, streams: &[StreamSurvey]) -> bool {
        let turned = self.turn_axes(streams) | self.scale_rates(streams);
        // the attitude is along the axes of the IMU
        let changed = turned || self.take_attitude(streams);
        self.drop_empty(streams) || changed
    }

    /// Scales the rates of a bag's IMU that are in degrees: they exceed the changes of the
    /// vehicle's own roll and pitch by far.
    fn scale_rates(&mut self, streams: &[StreamSurvey]) -> bool {
        let stream = |name: &str| streams.iter().find(|s| s.sensor == name);
        let Some((imu, own)) = stream("imu").zip(stream("attitude")) else { return false };
        let fits = |(gyro, angle): (&str, &str)| {
            let Some((k, a)) = imu.channel(gyro).zip(own.channel(angle)) else { return false };
            let rate = imu.mean[k].hypot(imu.wander[k]).hypot(imu.noise[k]);
            let turn = std::f64::consts::SQRT_2 * own.noise[a] / own.interval.max(1e-9);
            rate > FAST && turn > STILL && DEGREES.contains(&(rate / turn))
        };
        let bag = |p: &&mut Part| p.name == "imu" && p.reader == Reader::Bag;
        let Some(part) = self.parts.iter_mut().find(bag) else { return false };
        if !part.found.sensor.is_empty()
            || ![("gyro_x", "roll"), ("gyro_y", "pitch")].map(fits).iter().all(|f| *f)
        {
            return false;
        }
        let unit = 1_f64.to_radians();
        let factors = format!("gyro_x = {unit}, gyro_y = {unit}, gyro_z = {unit}");
        part.found.sensor.push(format!("samples = {{ factor = {{ {factors} }} }}"));
        let text =
            "the vehicle's own attitude turns as if the rates were in deg/s: they are scaled";
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("imu: {text}"));
        true
    }

    /// Leaves out sensors of which no file has a valid sample.
    fn drop_empty(&mut self, streams: &[StreamSurvey]) -> bool {
        let silent = |name: &str| streams.iter().any(|s| s.sensor == name && s.samples == 0);
        let (empty, parts) = std::mem::take(&mut self.parts)
            .into_iter()
            .partition::<Vec<Part>, _>(|part| part.name != "imu" && silent(part.name));
        self.parts = parts;
        let note = |part: &Part| {
            format!("{}: {} has no valid sample for it: left out", part.name, part.file.display())
        };
        self.notes.extend(empty.iter().filter(|p| p.name != "attitude").map(note));
        !empty.is_empty()
    }

    /// Takes the first attitude of the vehicle's own filter, whose samples have no other use.
    fn take_attitude(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(k) = self.parts.iter().position(|part| part.name == "attitude") else {
            return false;
        };
        self.parts.remove(k);
        self.attitude = streams.iter().find(|s| s.sensor == "attitude").and_then(|s| {
            let angle = |name| s.first.get(s.channel(name)?);
            Some([angle("roll")?, angle("pitch")?, angle("yaw")?])
        });
        true
    }

    fn turn_axes(&mut self, streams: &[StreamSurvey]) -> bool {
        let stream = |name: &str| streams.iter().find(|s| s.sensor == name);
        let mut changed = false;
        if let Some(imu) = stream("imu")
            && !std::mem::replace(&mut self.turned, true)
        {
            let up = imu.channel("accel_z").map(|k| imu.mean[k]).or_else(|| {
                let k = imu.channel("dvel_z")?;
                (imu.interval > 0.0).then(|| imu.mean[k] / imu.interval)
            });
            if up.is_some_and(|up| up > 5.0) {
                self.turn_imu();
                changed = true;
            }
        }
        let dated = self.parts.iter().find_map(|p| match p.reader {
            Reader::Dvl(stamp) => stamp,
            _ => None,
        });
        // ten years after 1970, below which a clock is not that of Unix
        let counts = stream("imu").is_some_and(|imu| imu.span[0].seconds() < 315_576_000.0);
        if dated.is_some() && counts && self.origin.is_none() {
            self.origin = dated;
            changed = true;
        }
        changed
    }

    /// Turns an IMU with axes forward, left, up.
    fn turn_imu(&mut self) {
        let bag = |p: &Part| matches!(p.name, "imu" | "attitude") && p.reader == Reader::Bag;
        for part in self.parts.iter_mut().filter(|p| bag(p)) {
            // the source has turned the axes of ROS, which these were not
            part.found.source.push("axes = \"frd\"".to_owned());
        }
        if let Some(part) = self.parts.iter_mut().find(|p| p.name == "imu" && bag(p)) {
            let text = "its axes are forward, right, down already, and not the axes of ROS";
            part.found.questions.push(format!("by the mean of accel_z, {text}"));
            self.notes.push(format!("imu: {text}"));
            return;
        }
        let Some(part) = self.parts.iter_mut().find(|p| p.name == "imu") else { return };
        let note = "imu: its z axis points up; y and z are turned to right and down";
        self.notes.push(note.to_owned());
        part.found.questions.push(
            "the mean of accel_z fits an IMU whose z axis points up: forward, left, up is \
             assumed, and y and z are turned"
                .to_owned(),
        );
        if part.reader != Reader::Csv {
            part.found.sensor.push("samples = { axes = [\"x\", \"-y\", \"-z\"] }".to_owned());
            return;
        }
        let increments = !part.found.sensor.is_empty();
        let names = if increments {
            ["dtheta_y", "dtheta_z", "dvel_y", "dvel_z"]
        } else {
            ["gyro_y", "gyro_z", "accel_y", "accel_z"]
        };
        for name in names {
            let key = format!("columns.{name} = {{");
            let line = part.found.source.iter_mut().find(|line| line.starts_with(&key));
            match line.and_then(|line| line.strip_suffix(" }").map(|l| l.len()).zip(Some(line))) {
                Some((length, line)) => line.replace_range(length.., ", scale = -1 }"),
                None => part.found.source.push(format!("{key} scale = -1 }}")),
            }
        }
    }
}

/// The sensors of a table.
fn as_table(file: &Path, bytes: &[u8]) -> Result<Vec<Found>, StreamError> {
    let refused = |why: String| StreamError::format(why).in_file(file);
    if let Some([format, remedy]) = marks::likely(bytes) {
        let text = format!("it begins like {format}, which navfuse does not read");
        return Err(refused(text).with_remedy(remedy));
    }
    let binary =
        bytes.contains(&0) || bytes.iter().filter(|b| b.is_ascii()).count() * 2 < bytes.len();
    if binary {
        return Err(refused(
            "it is neither a table, nor a file of a velocity log (PD0, PD4, PD6, AD2CP, Nortek, \
             Water Linked), nor NMEA 0183, nor a log of a vehicle (ULog, MAVLink, NovAtel, \
             VectorNav, u-blox, Nucleus, DataFlash, SBET, KF-GINS), nor a bag of ROS"
                .to_owned(),
        ));
    }
    let beginning = navfuse_csv::beginning(file, TABLE).map_err(|e| StreamError::open(file, e))?;
    table::recognise(&String::from_utf8_lossy(&beginning)).map_err(refused)
}
