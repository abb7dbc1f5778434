//! The columns of a table for the channels of its sensors, with the units that the numbers show.

use super::layout::Layout;
use super::units::{self, AID_INTERVAL, IMU_INTERVAL, settle};
use super::vocabulary::{self, Meaning, fitting, meaning};
use crate::found::Found;
use navfuse_core::document::quoted;
use navfuse_core::units::column_suffix;
use std::fmt::Write;

pub(super) const GYRO: [&str; 3] = ["gyro_x", "gyro_y", "gyro_z"];
pub(super) const ACCEL: [&str; 3] = ["accel_x", "accel_y", "accel_z"];
pub(super) const DTHETA: [&str; 3] = ["dtheta_x", "dtheta_y", "dtheta_z"];
pub(super) const DVEL: [&str; 3] = ["dvel_x", "dvel_y", "dvel_z"];
pub(super) const BODY: [&str; 3] = ["vel_x", "vel_y", "vel_z"];
const FIX: [&str; 9] =
    ["lat", "lon", "height", "vel_n", "vel_e", "vel_d", "h_acc", "v_acc", "s_acc"];
pub(super) const ECEF: [&str; 3] = ["x_ecef", "y_ecef", "z_ecef"];
const POSE: [&str; 9] = ["lat", "lon", "height", "roll", "pitch", "yaw", "vel_n", "vel_e", "vel_d"];
/// The reason why rows from the newest to the oldest are read in the other order.
pub const BACKWARDS: &str = "the times of its rows run backwards: sort the rows by their time";

/// A table with the meanings of its columns.
pub struct Table<'a> {
    pub(super) layout: &'a Layout,
    pub(super) columns: Vec<(usize, Meaning)>,
    pub(super) questions: Vec<String>,
    /// Columns of the gravity that the specific forces lack.
    pub(super) gravity: Option<[usize; 3]>,
}

/// A column with its unit, for the key of a channel.
pub(super) struct Chosen<'a> {
    pub(super) heading: &'a str,
    pub(super) unit: String,
    pub(super) scale: f64,
    pub(super) minutes: bool,
    /// More keys.
    pub(super) more: String,
    /// Set if the source finds the column and its unit by itself.
    pub(super) usual: bool,
}

impl<'a> Table<'a> {
    /// The table of a file with this name; `questions` are about all of its sensors.
    pub fn new(layout: &'a Layout, name: &str, questions: Vec<String>) -> Self {
        let meant = |(k, heading): (usize, &String)| {
            let heading = vocabulary::from_zero(heading, &layout.headings);
            let mut meaning = meaning(&heading)?;
            if let Some(unit) = layout.units.get(k) {
                let si = vocabulary::si(meaning.channel);
                meaning.unit = fitting(unit, si).or(meaning.unit);
            }
            Some((k, meaning))
        };
        let mut columns: Vec<(usize, Meaning)> =
            layout.headings.iter().enumerate().filter_map(meant).collect();
        // beside lambda, phi is the latitude
        let named = |k: usize, word: &str| {
            let name = layout.headings[k].split(['[', '(', '{']).next();
            vocabulary::words(name.unwrap_or_default()) == [word]
        };
        if columns.iter().any(|(k, _)| named(*k, "lambda")) {
            let phi = columns.iter_mut().filter(|(k, _)| named(*k, "phi"));
            phi.for_each(|(_, meaning)| meaning.channel = "lat");
        }
        let mut table = Self { layout, columns, questions, gravity: None };
        table.height_of_map();
        table.leave_out_relative_height();
        table.leave_out_empty();
        table.down_beside_forward();
        table.name_axes(name);
        table.name_value(name);
        table.name_earth_fixed();
        table.exchange();
        table.increments();
        table.complete_inertial();
        table.choose_inertial();
        table.name_course();
        table
    }

    /// The columns with measurements.
    pub(super) fn measured(&self) -> Vec<usize> {
        let clock = ["time", "date", "week"];
        let known = self.columns.iter().filter(|(_, m)| !clock.contains(&m.channel));
        let mut columns: Vec<usize> = known.map(|(k, _)| *k).chain(self.beams()).collect();
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// The key of the numbers that stand for no measurement, and a question.
    fn missing(&self) -> Option<(String, String)> {
        let mut numbers: Vec<f64> = self.layout.missing.iter().map(|(_, n)| *n).collect();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        let list: Vec<String> = numbers.iter().map(|n| format!("{n:?}")).collect();
        let list = list.join(", ");
        let question = format!("{list}: far from all other numbers, it stands for no measurement");
        (!list.is_empty()).then(|| (format!("missing = [{list}]"), question))
    }

    /// The headings, for a message.
    pub(super) fn listed(&self) -> String {
        let list: Vec<&str> = self.layout.headings.iter().take(20).map(String::as_str).collect();
        list.join(", ")
    }

    pub(super) fn heading(&self, k: usize) -> &'a str {
        self.layout.headings.get(k).map_or("", String::as_str)
    }

    /// Tests whether the source finds the column of a channel by its heading.
    pub(super) fn usual(&self, k: usize, channel: &str) -> bool {
        let suffix = |h: &str| Some(h.strip_prefix(channel)?.strip_prefix('_')?.to_owned());
        suffix(self.heading(k)).is_some_and(|s| column_suffix(&s).is_some())
    }

    /// The best column of a channel.
    pub(super) fn find(&self, channel: &str) -> Option<&(usize, Meaning)> {
        let fitting = self.columns.iter().filter(|(_, m)| m.channel == channel);
        fitting.min_by_key(|(k, m)| (!self.usual(*k, channel), m.rank))
    }

    pub(super) fn has(&self, channels: &[&str]) -> bool {
        channels.iter().all(|channel| self.find(channel).is_some())
    }

    pub(super) fn values(&self, channel: &str) -> Vec<f64> {
        self.find(channel).map(|(k, _)| self.layout.column(*k)).unwrap_or_default()
    }

    pub(super) fn vector(&self, channels: [&str; 3]) -> Vec<[f64; 3]> {
        let [x, y, z] = channels.map(|channel| self.values(channel));
        let mut rows = units::rows([&x, &y, &z]);
        if let Some(gravity) = self.gravity.filter(|_| channels == ACCEL) {
            let more = gravity.map(|k| self.layout.column(k));
            for (row, v) in rows.iter_mut().enumerate() {
                *v = std::array::from_fn(|k| v[k] + more[k].get(row).copied().unwrap_or(f64::NAN));
            }
        }
        rows
    }

    /// The sensors of the table.
    ///
    /// # Errors
    /// With the reason why no sensor is recognised.
    pub fn sensors(&self) -> Result<Vec<Found>, String> {
        let inertial =
            (self.has(&GYRO) && self.has(&ACCEL)) || (self.has(&DTHETA) && self.has(&DVEL));
        let halves = [GYRO, ACCEL, DTHETA, DVEL];
        let half = !inertial && halves.iter().any(|half| self.has(half));
        let clock = self.clock(if inertial || half { IMU_INTERVAL } else { AID_INTERVAL })?;
        if units::step(&clock.seconds) < 0.0 {
            return Err(BACKWARDS.to_owned());
        }
        let mut sensors = Vec::new();
        if inertial {
            sensors.push(self.imu(&clock)?);
        } else if half {
            sensors.push(self.half(&clock)?);
        }
        let map = || self.placed().is_some();
        let place = self.has(&["lat", "lon"]) || self.has(&ECEF) || map();
        // a receiver has velocities along axes of its own, unless their headings name a log
        if self.has(&BODY) && (!place || self.of_log()) {
            sensors.push(self.other("dvl", &BODY));
        } else if !self.has(&BODY) {
            sensors.extend(self.beams_log());
        }
        if self.has(&["depth"]) {
            sensors.push(self.other("depth", &["depth"]));
        } else {
            sensors.extend(self.pressure());
        }
        let deep = sensors.iter().any(|found| found.kind == "depth");
        let swims = self.has(&BODY) && self.has(&["z"]) && !deep;
        if (sensors.is_empty() || swims) && !place {
            sensors.extend(self.depth_by_height());
        }
        if place && self.has(&["roll", "pitch", "yaw"]) && !inertial {
            let mut pose = self.other("reference", &POSE);
            pose.apart =
                vec![self.other("gnss", &FIX), self.other("attitude", &["roll", "pitch", "yaw"])];
            sensors.push(pose);
        } else if place {
            sensors.push(self.other("gnss", &FIX));
        } else if self.has(&["roll", "pitch", "yaw"]) && !inertial {
            sensors.push(self.other("attitude", &["roll", "pitch", "yaw"]));
        } else if self.has(&["yaw"]) && !self.has(&["roll"]) && (!inertial || self.is_slower("yaw"))
        {
            sensors.push(self.other("dual-antenna", &["heading"]));
        }
        let along = self.has(&["vel_n", "vel_e"]);
        // a speed with a course is one of a receiver
        let moves = along || (sensors.is_empty() && self.has(&["speed", "course"]));
        if self.has(&["speed"]) && !place && !moves {
            sensors.push(self.other("odometer", &["speed"]));
        }
        if sensors.is_empty() && moves {
            sensors.push(self.other("velocity", &["vel_n", "vel_e", "vel_d", "s_acc"]));
        }
        if sensors.is_empty() {
            return Err(self.unknown());
        }
        if half && sensors.len() == 1 {
            sensors[0].others = self.listed();
        }
        for found in &mut sensors {
            let usual = if found.kind == "imu" { IMU_INTERVAL } else { AID_INTERVAL };
            let own = self.stamped(found.kind, usual);
            let clock = own.as_ref().unwrap_or(&clock);
            let seconds = || clock.seconds.iter().copied().filter(|t| t.is_finite());
            let span = seconds().next().zip(seconds().next_back());
            let span = span.map(|(first, last)| [first, last]);
            let mut source = self.layout.keys();
            source.extend(clock.key.clone());
            for apart in &mut found.apart {
                apart.source = [source.as_slice(), &apart.source].concat();
                apart.questions = self.questions.iter().chain(&apart.questions).cloned().collect();
            }
            source.append(&mut found.source);
            found.source = source;
            found.span = span;
            found.source.extend(self.valid(found.kind));
            if let Some((key, question)) = self.missing() {
                found.source.push(key);
                found.questions.push(question);
            }
            if found.kind == "dvl" && self.has_zeros() {
                found.zeros = true;
                found.questions.push("three zeros are taken for no measurement".to_owned());
            }
            if inertial && found.kind != "imu" && self.repeats(found.kind) {
                found.source.push("changes_only = true".to_owned());
            }
            let ramps = || self.ramps().filter(|_| inertial && found.kind == "gnss");
            if let Some(rows) = ramps() {
                found.questions.push(format!(
                    "the positions lie on straight lines between fixes each {rows} rows, and are no measurements there: \
                     give the fixes of the receiver in a table of their own"
                ));
            }
            if ["imu", "gyros", "accels"].contains(&found.kind) && clock.is_shared() {
                found.source.push("disorder = \"spread\"".to_owned());
                found.burst = clock.burst();
                found.questions.push(
                    "rows that share a time are spread evenly up to the next time".to_owned(),
                );
            }
            let shared = self.questions.iter().chain(&clock.questions).cloned();
            found.questions = shared.chain(found.questions.drain(..)).collect();
        }
        Ok(sensors)
    }

    /// The unit that the headings of a vector state, if they state the same.
    pub(super) fn stated(&self, channels: [&str; 3]) -> Option<String> {
        let [x, y, z] = channels.map(|c| self.find(c).and_then(|(_, m)| m.unit.clone()));
        x.filter(|unit| y.as_ref() == Some(unit) && z.as_ref() == Some(unit))
    }

    pub(super) fn any_stated(&self, channels: [&str; 3]) -> bool {
        channels.iter().any(|c| self.find(c).is_some_and(|(_, m)| m.unit.is_some()))
    }

    /// The key of a channel with a unit, or with the unit of its heading, or with its SI unit and a
    /// question; `None` where the source finds the column by itself.
    pub(super) fn key(
        &self,
        word: &str,
        channel: &str,
        unit: Option<&str>,
        questions: &mut Vec<String>,
    ) -> Option<String> {
        let (k, meaning) = self.find(word)?;
        let si = vocabulary::si(word);
        if unit.is_none() && meaning.unit.is_none() {
            let heading = self.heading(*k);
            questions.push(match self.unknown_unit(*k) {
                Some(unit) => format!(
                    "the unit of {heading}: {unit} is no unit that is known, and {si} is assumed: set the unit \
                     of columns.{channel}"
                ),
                None => format!("the unit of {heading}: {si} is assumed"),
            });
        }
        let stated = meaning.unit.as_deref();
        let unit = unit.or(stated).unwrap_or(si);
        let usual = self.usual(*k, channel) && stated == Some(unit);
        let (heading, unit) = (self.heading(*k), unit.to_owned());
        let axis = ACCEL.iter().position(|name| *name == word);
        let plus = self.gravity.zip(axis).map(|(gravity, axis)| self.heading(gravity[axis]));
        let more = plus.map_or_else(String::new, |plus| format!(", plus = {}", quoted(plus)));
        let scale = meaning.sign;
        Chosen { heading, unit, scale, minutes: false, more, usual }.key(channel)
    }

    /// A sensor that is no inertial unit.
    fn other(&self, kind: &'static str, channels: &[&str]) -> Found {
        let (mut source, mut questions) = (Vec::new(), Vec::new());
        if channels.contains(&"lat") && !self.has(&["lat"]) {
            source.extend(self.earth_fixed());
            let map = source.is_empty().then(|| self.placed()).flatten();
            map.into_iter().for_each(|(keys, question)| {
                source.extend(keys);
                questions.push(question);
            });
        }
        let angles = channels.contains(&"lat") && self.has(&["lat"]);
        let packed = angles && self.is_packed();
        let place = angles.then(|| match packed {
            true => ("deg".to_owned(), 1.0, false),
            false => self.place(&mut questions),
        });
        if packed {
            let text = "latitude and longitude are taken for ddmmss.s, by their range";
            questions.push(text.to_owned());
        }
        let by_track = place.as_ref().filter(|_| !packed).and_then(|(unit, scale, minutes)| {
            self.by_track(units::factor(unit) * scale, *minutes)
        });
        // the message NAV-PVT of u-blox has lengths in mm, as integers or beside decoded degrees
        let fine = place.as_ref().is_some_and(|(_, scale, _)| *scale == units::E7)
            || by_track.as_ref().is_some_and(|shown| shown.unit == "mm/s");
        // a velocity down alone is no velocity of a receiver
        let moves = self.has(&["vel_n", "vel_e"]) || self.has(&["speed", "course"]);
        let whole = moves || !channels.contains(&"vel_n");
        for channel in channels.iter().filter(|c| whole || !c.starts_with("vel_")) {
            let word = if *channel == "heading" { "yaw" } else { channel };
            let Some((k, meaning)) = self.find(word) else { continue };
            let (heading, usual) = (self.heading(*k), self.usual(*k, channel));
            let stated = meaning.unit.clone();
            match (&place, *channel) {
                (Some(_), "lat" | "lon") if self.sexagesimal(channel).is_some() => {
                    let first = self.sexagesimal(channel).unwrap_or(*k);
                    let sides = (first..first + 3).map(|k| self.side(k, channel));
                    source.push(format!(
                        "columns.{channel} = {{ column = {}, unit = \"deg\", \
                         notation = \"degrees-minutes-seconds\"{} }}",
                        quoted(self.heading(first)),
                        sides.max().unwrap_or_default()
                    ));
                }
                (Some(_), "lat" | "lon")
                    if packed || self.values(channel).iter().all(|v| v.is_nan()) =>
                {
                    let side = if packed { self.side(*k, channel) } else { String::new() };
                    source.push(format!(
                        "columns.{channel} = {{ column = {}, unit = \"deg\", \
                         notation = \"degrees-minutes-seconds\"{side} }}",
                        quoted(heading)
                    ));
                }
                (Some((unit, scale, minutes)), "lat" | "lon") => {
                    let usual = usual && stated.as_deref() == Some(unit) && *scale == 1.0;
                    let scale = scale * meaning.sign;
                    let (unit, minutes) = (unit.clone(), *minutes);
                    let more = self.side(*k, channel);
                    let chosen = Chosen { heading, unit, scale, minutes, more, usual };
                    source.extend(chosen.key(channel));
                }
                (None, "lat" | "lon" | "height")
                    if source.iter().any(|key| key.starts_with(&format!("columns.{channel} "))) => {
                }
                (Some(_), "height")
                    if stated.is_none()
                        && fine
                        && self.is_whole(*k)
                        && units::in_millimetres(&self.layout.column(*k)) =>
                {
                    questions.push(format!(
                        "the unit of {heading}: mm, as whole numbers beside 1e-7 deg or mm/s"
                    ));
                    let (unit, scale, minutes) = ("mm".to_owned(), meaning.sign, false);
                    let more = String::new();
                    let chosen = Chosen { heading, unit, scale, minutes, more, usual };
                    source.extend(chosen.key(channel));
                }
                (Some(_), "h_acc" | "v_acc" | "s_acc")
                    if stated.is_none() && fine && self.is_whole(*k) =>
                {
                    // the eph of others is no length
                    let unit = if *channel == "s_acc" { "mm/s" } else { "mm" };
                    if !heading.to_lowercase().starts_with("ep") {
                        source.extend(self.key(word, channel, Some(unit), &mut questions));
                    }
                }
                (Some(_), "vel_n" | "vel_e" | "vel_d") if by_track.is_some() => {
                    let unit = by_track
                        .clone()
                        .map(|shown| settle(heading, stated, shown, true, &mut questions));
                    source.extend(self.key(word, channel, unit.as_deref(), &mut questions));
                }
                (Some(_), "height") if self.geoid().is_some() => {
                    source.extend(self.above_geoid(&mut questions));
                }
                (_, "vel_x" | "vel_y" | "vel_z") if stated.is_none() && kind == "dvl" => {
                    let unit = units::speed(&self.vector(BODY));
                    questions.push(format!("the unit of {heading}: {unit} by its size"));
                    source.extend(self.key(word, channel, Some(unit), &mut questions));
                }
                (_, "roll" | "pitch" | "yaw" | "heading") if stated.is_none() => {
                    let unit = self.turned();
                    questions.push(format!("the unit of {heading}: {unit} by its range"));
                    source.extend(self.key(word, channel, Some(unit), &mut questions));
                }
                _ => source.extend(self.key(word, channel, None, &mut questions)),
            }
        }
        let along = channels.contains(&"vel_n") && !self.has(&["vel_n"]);
        let course = if along { self.course(by_track, &mut questions) } else { Vec::new() };
        let whole = kind != "reference" || self.has(&["vel_d"]);
        let velocity = whole && (self.has(&["vel_n", "vel_e"]) || !course.is_empty());
        source.extend(course);
        Found { kind, source, questions, velocity, ..Found::default() }
    }
}

impl Chosen<'_> {
    /// The key of a channel; `None` where the source needs none.
    pub(super) fn key(&self, channel: &str) -> Option<String> {
        if self.usual && self.scale == 1.0 && !self.minutes && self.more.is_empty() {
            return None;
        }
        let mut text = format!("columns.{channel} = {{ column = {}", quoted(self.heading));
        let _ = write!(text, ", unit = {}", quoted(&self.unit));
        if self.scale != 1.0 {
            let _ = write!(text, ", scale = {:e}", self.scale);
        }
        if self.minutes {
            text.push_str(", notation = \"degrees-minutes\"");
        }
        text.push_str(&self.more);
        text.push_str(" }");
        Some(text)
    }
}
