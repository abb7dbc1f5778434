//! The files of a recording and the sensors in them.

use crate::bag::{self, InBag};
use crate::beams::Beams;
use crate::folder;
use crate::found::{Found, OdometryUse};
use crate::instrument;
use crate::lcm;
use crate::marks;
use crate::samples::Samples;
use crate::table;
use crate::vehicle;
use navfuse_core::model::stream::StreamError;
use navfuse_vehicle_logs::Format;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Size in bytes of the beginning of a file by which it is recognised.
pub const BEGINNING: u64 = 256 * 1024;
/// Size in bytes of the beginning of a table by which its units are found.
pub const TABLE: u64 = 4 * 1024 * 1024;
/// Size in bytes of the beginning of a log of a vehicle in which its messages are looked for.
const MESSAGES: u64 = 16 * 1024 * 1024;

/// The sensors in the order of a scenario.
const ORDER: [&str; 10] = [
    "imu",
    "ahrs",
    "dvl",
    "depth",
    "gnss",
    "compass",
    "odometer",
    "odometry",
    "reference",
    "attitude",
];

/// End of the note on a file that is not used.
const LEFT_OUT: &str = ": left out";

/// Words in the name of a file whose positions are compared alone.
const REFERENCES: [&str; 2] = ["reference", "truth"];

/// Tests whether the positions of a file are compared alone, by its name.
pub fn is_reference(file: &Path) -> bool {
    let stem = file.file_stem().map(|s| s.to_string_lossy().to_lowercase());
    stem.is_some_and(|s| REFERENCES.iter().any(|word| s.contains(word)))
}

/// The source type that reads a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reader {
    Csv,
    /// With the time of the first ping, if the format has dates.
    Dvl(Option<i64>),
    Nmea,
    /// With the index of the file among the logs of vehicles.
    Vehicle(Format, usize),
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
    /// Keys and file with other channels: the other half of an inertial unit, the velocity of a receiver.
    pub more: Option<(Vec<String>, PathBuf)>,
    /// Files that go on where the one before ends, with the times of their first and last row.
    pub then: Vec<([f64; 2], PathBuf)>,
    /// Conversion of the samples that they need.
    pub samples: Samples,
}

/// The sensors of a recording.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    pub parts: Vec<Part>,
    pub notes: Vec<String>,
    /// Sensors without a valid sample, each with its file.
    pub empty: Vec<(&'static str, PathBuf)>,
    /// Zero of the run's clock for pings with dates, where the other files count from elsewhere.
    pub origin: Option<i64>,
    /// Use of an odometry, as answered.
    odometry: Option<OdometryUse>,
    /// Odometry of a bag, whose use depends on the other files.
    undecided: Option<(InBag, PathBuf)>,
    /// What each file has, in words.
    pub contents: Vec<(PathBuf, String)>,
    /// Set if a file is a bag.
    bag: bool,
    /// Set once the IMU was levelled, and once it was turned about the vertical.
    pub turned: [bool; 2],
    /// Set once the mounting of the velocity log was found.
    pub mounted: bool,
    /// Roll, pitch and yaw at the start by the vehicle's own filter, rad.
    pub attitude: Option<[f64; 3]>,
    /// Set once the IMU was levelled, and turned, by any angle, and once positions were exchanged.
    pub tilted: bool,
    pub turned_freely: bool,
    pub exchanged: bool,
    /// Set where the velocities of a log are along north and east; `false` for east and north.
    pub earth: Option<bool>,
    /// Velocity of a receiver in a file of its own.
    pub velocity: Option<(Found, PathBuf)>,
    /// Definitions of the messages of LCM.
    definitions: Vec<lcm::Definitions>,
    /// Gyros and accelerometers in files of their own, and the files that go on with them.
    pub halves: [Option<(Found, PathBuf)>; 2],
    pub halves_then: [Vec<([f64; 2], PathBuf)>; 2],
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
        let definitions = files.iter().filter_map(|file| lcm::definitions(file)).collect();
        let mut recording = Self { odometry, definitions, ..Self::default() };
        let given = files.iter().filter(|file| lcm::definitions(file).is_none());
        let given = given.flat_map(|given| match folder::files(given) {
            Some(inside) => inside.into_iter().map(|file| (file, true)).collect(),
            None => vec![(given.clone(), false)],
        });
        let given = recording.take_channels(given.collect())?;
        let mut refused = Vec::new();
        for (file, inside) in given {
            match recording.add(&file, stop) {
                Ok(true) => {}
                Ok(false) => return Ok(None),
                Err(error) => refused.push(((file, inside), error)),
            }
        }
        recording.take_refused(&mut refused)?;
        for ((_, inside), error) in refused {
            // nobody named a file of a folder
            if !inside {
                return Err(error);
            }
            recording.notes.push(format!("{error}{LEFT_OUT}"));
        }
        recording.use_odometry()?;
        recording.join_halves();
        recording.join_velocity()?;
        recording.aid_by_poses();
        recording.split_poses();
        if recording.part("imu").is_none() && !recording.drive_by_attitude() {
            return Err(recording.without_imu());
        }
        recording.sort();
        recording.doubt_bursts();
        Ok(Some(recording))
    }

    fn sort(&mut self) {
        self.parts.sort_by_key(|part| ORDER.iter().position(|name| *name == part.name));
    }

    /// The error of a recording without an IMU: what each file has, and what is missing.
    fn without_imu(&self) -> StreamError {
        let columns = |file: &Path| {
            let named =
                |half: &(Found, PathBuf)| std::fs::canonicalize(file).is_ok_and(|f| f == half.1);
            let half = self.halves.iter().flatten().find(|half| named(half))?;
            Some(format!(", with the columns {}", half.0.others))
                .filter(|_| !half.0.others.is_empty())
        };
        let has = self.contents.iter().map(|(file, has)| {
            format!("{}: {has}{}", file.display(), columns(file).unwrap_or_default())
        });
        // files of a folder that nobody named
        let left = self.notes.iter().filter(|note| note.ends_with(LEFT_OUT)).cloned();
        let text =
            format!("no file has an IMU ({})", has.chain(left).collect::<Vec<_>>().join("; "));
        let remedy = if self.parts.iter().any(|p| p.reader == Reader::Bag) || self.bag {
            "name the fields of an unknown type in a scenario, such as \
             [source.ros2.sensors.imu] with topic = \"/fmu/out/sensor_combined\" and \
             channels.gyro_x = { field = \"gyro_rad[0]\" }"
        } else if self.part("attitude").is_some() {
            "the attitude of the vehicle's own system drives the filter beside a velocity, which no file has: \
             record the rates and specific forces too (a Nucleus: NUCLEUS-IMU), or a valid bottom track, or \
             give the file of a velocity log or of a receiver"
        } else {
            "give a table with the columns gyro_x_radps ... accel_z_mps2 or dtheta_x_rad ... \
             dvel_z_mps"
        };
        StreamError::format(text).with_remedy(remedy)
    }

    /// Takes a table of poses for a receiver and an attitude where nothing else has a position and no file an inertial unit.
    fn split_poses(&mut self) {
        let others = ["imu", "attitude", "gnss"].iter().any(|name| self.part(name).is_some());
        let poses = |part: &Part| part.name == "reference" && !part.found.apart.is_empty();
        let Some(k) = self.parts.iter().position(poses).filter(|_| !others) else { return };
        let part = self.parts.remove(k);
        for (name, mut found) in ["gnss", "attitude"].into_iter().zip(part.found.apart.clone()) {
            if name == "attitude" {
                found.kind = "reference";
            }
            self.parts.push(Part { name, found, ..part.clone() });
        }
    }

    /// Drives the filter by the attitude of the vehicle's own system, with the velocity of a log,
    /// instead of an inertial unit; `false` if the recording has no such attitude.
    pub fn drive_by_attitude(&mut self) -> bool {
        let aided = ["dvl", "gnss"].iter().any(|name| self.part(name).is_some());
        if !aided || self.part("attitude").is_none() {
            return false;
        }
        self.parts.retain(|part| part.name != "imu");
        let Some(part) = self.parts.iter_mut().find(|part| part.name == "attitude") else {
            return false;
        };
        part.name = "ahrs";
        part.found.kind = "ahrs";
        for key in &mut part.found.source {
            *key = key.replace("sensors.attitude", "sensors.ahrs");
        }
        self.sort();
        true
    }

    /// The beams of a log whose velocities are along them.
    pub fn beams(&self) -> Option<&Beams> {
        self.part("dvl").and_then(|part| part.found.beams.as_ref())
    }

    /// The sensor of a name.
    pub fn part(&self, name: &str) -> Option<&Part> {
        self.parts.iter().find(|part| part.name == name)
    }

    fn add(&mut self, file: &Path, stop: &AtomicBool) -> Result<bool, StreamError> {
        let rows = navfuse_csv::is_folder(file);
        let bytes = match file.is_dir() && !rows {
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
        if !rows && bag::is_bag(file, &bytes) {
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
        let (noted, mut beside) = (self.notes.len(), Vec::new());
        let (reader, found) = if rows {
            (Reader::Csv, table::oxts(&navfuse_csv::text(&bytes)))
        } else if let Some((stamp, found)) = instrument::velocity_log(&bytes) {
            (Reader::Dvl(stamp), found)
        } else if let Some(format) = Format::recognise(&bytes) {
            let bytes =
                navfuse_csv::beginning(file, MESSAGES).map_err(|e| StreamError::open(file, e))?;
            let found = match format {
                Format::Lcm => lcm::sensors(bytes, &self.definitions, &mut self.notes),
                _ => vehicle::sensors(format, bytes, false, &mut self.notes),
            };
            if found.is_empty() {
                let notes = self.notes[noted..].iter().map(|note| format!(": {note}"));
                let notes: String = notes.collect();
                let text = format!("no known message of the format {}{notes}", format.name());
                return Err(StreamError::format(text).in_file(file).with_remedy(
                    "write [source.vehicle-log] into a scenario, and map the fields of its messages",
                ));
            }
            (Reader::Vehicle(format, self.next_log()), found)
        } else if let Some(found) = vehicle::unchecked(&bytes, &mut self.notes) {
            (Reader::Vehicle(Format::Novatel, self.next_log()), found)
        } else if let Some(found) = instrument::nmea(&bytes) {
            beside = table::other_kinds(&navfuse_csv::text(&bytes));
            beside.retain(|other| found.iter().all(|own| own.kind != other.kind));
            (Reader::Nmea, found)
        } else {
            if self.goes_on_without_headings(file, &absolute)? {
                return Ok(true);
            }
            (Reader::Csv, as_table(file, &bytes)?)
        };
        let kinds: Vec<&str> = found.iter().map(|found| found.kind).collect();
        let has = [&[kinds.join(", ")], &self.notes[noted..]].concat().join(": ");
        self.contents.push((file.to_owned(), has));
        for mut found in found {
            if found.kind == "gnss" && is_reference(file) {
                found.kind = "reference";
            }
            self.add_part(found, reader, file, &absolute, None)?;
        }
        for found in beside {
            self.add_part(found, Reader::Csv, file, &absolute, None)?;
        }
        Ok(true)
    }

    /// Index of the next log of a vehicle.
    fn next_log(&self) -> usize {
        let logs = self.parts.iter().filter_map(|p| match p.reader {
            Reader::Vehicle(_, k) => Some(k + 1),
            _ => None,
        });
        logs.max().unwrap_or(0)
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
    pub fn add_part(
        &mut self,
        mut found: Found,
        reader: Reader,
        file: &Path,
        absolute: &Path,
        lever_arm: Option<[f64; 3]>,
    ) -> Result<(), StreamError> {
        let half = ["gyros", "accels"].iter().position(|kind| *kind == found.kind);
        if let Some(k) = half {
            if self.half_goes_on(k, &found, absolute) {
                return Ok(());
            }
            if let Some((_, other)) = &self.halves[k] {
                let message = format!("it has the {}, as {} has", found.kind, other.display());
                return Err(StreamError::format(message).in_file(file));
            }
            self.halves[k] = Some((found, absolute.to_owned()));
            return Ok(());
        }
        if found.kind == "velocity" {
            if let Some((_, other)) = &self.velocity {
                let text =
                    format!("it has velocities along north and east, as {} has", other.display());
                return Err(StreamError::format(text).in_file(file));
            }
            self.velocity = Some((found, absolute.to_owned()));
            return Ok(());
        }
        let name = match found.kind {
            "dual-antenna" => "compass",
            "dvl-beams" => "dvl",
            "relative-pose" => "odometry",
            "attitude" => {
                found.kind = "reference";
                "attitude"
            }
            kind => kind,
        };
        if self.goes_on(name, &found, absolute) {
            return Ok(());
        }
        if let Some(other) = self.part(name) {
            let message = format!(
                "it has the sensor {name}, as {} has: give one of the files",
                other.file.display()
            );
            return Err(StreamError::format(message).in_file(file));
        }
        let (file, zeros) = (absolute.to_owned(), found.zeros);
        self.parts.push(Part {
            name,
            found,
            reader,
            file,
            lever_arm,
            more: None,
            then: Vec::new(),
            samples: Samples { zeros, ..Samples::default() },
        });
        Ok(())
    }
}

/// The sensors of a table.
fn as_table(file: &Path, bytes: &[u8]) -> Result<Vec<Found>, StreamError> {
    let refused = |why: String| StreamError::format(why).in_file(file);
    if let Some([format, remedy]) = marks::likely(bytes) {
        let text = format!("it begins like {format}, which navfuse does not read");
        return Err(refused(text).with_remedy(remedy));
    }
    // a recorder without power leaves zeros behind the last row
    let filled = |bytes: &[u8]| bytes.iter().rev().take_while(|b| **b == 0).count();
    let zeros = filled(bytes);
    let bytes = &bytes[..bytes.len() - zeros];
    let binary = (zeros > 0 && bytes.is_empty())
        || bytes.contains(&0)
        || bytes.iter().filter(|b| b.is_ascii()).count() * 2 < bytes.len();
    if binary {
        return Err(refused(
            "it is neither a table, nor a file of a velocity log (PD0, PD4, PD6, AD2CP, Nortek, \
             Water Linked), nor NMEA 0183, nor a log of a vehicle (ULog, MAVLink, NovAtel, \
             VectorNav, u-blox, Nucleus, DataFlash, SBET, KF-GINS), nor a bag of ROS"
                .to_owned(),
        ));
    }
    let mut beginning =
        navfuse_csv::beginning(file, TABLE).map_err(|e| StreamError::open(file, e))?;
    // other records may begin behind the first ones
    let json = beginning.trim_ascii_start().starts_with(b"{")
        || beginning.trim_ascii_start().starts_with(b"[{");
    if json && beginning.len() as u64 >= TABLE {
        beginning = navfuse_csv::records_of_all_forms(file, 4 * TABLE)
            .map_err(|e| StreamError::open(file, e))?;
    }
    beginning.truncate(beginning.len() - filled(&beginning));
    let name = file.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    table::recognise(&navfuse_csv::text(&beginning), &name).map_err(refused)
}
