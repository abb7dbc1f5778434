//! What the motion shows of axes by any angle: an IMU that is mounted at one, and positions whose
//! columns are exchanged.

use crate::axes::Sense;
use crate::draft::SLOWEST;
use crate::recording::{Part, Reader, Recording};
use crate::rotation::{Rotation, about_down, levelling, of_axes, product};
use crate::samples::{Samples, find};
use crate::stream::StreamSurvey;
use crate::table::{BY_CONTENT, E7, IN_E7, LATITUDE_FIRST, LONGITUDE_FIRST, ORDER, SEMICIRCLE};
use navfuse_core::model::stream::StreamError;

/// Angle between the mean of the specific force and an axis, rad, that no vehicle keeps on average: 20 deg.
const TILTED: f64 = 0.35;
/// 1-sigma of what slopes, banks and springs do to such a turn, rad: 3 deg. A recorded drive shows 8 deg, with
/// 1.6 deg by the scatter.
const ROAD: f64 = 0.052;
/// Sigmas of a turn from which it is doubted, and from which the IMU is turned.
const DOUBTED: f64 = 1.5;
const DETERMINED: f64 = 5.0;
/// 1-sigma of the yaw of a unit that was levelled and of which no course shows the yaw, rad: 20 deg.
const UNKNOWN: f64 = 0.35;
/// 1-sigma of the trim that a vehicle keeps on average, rad: 2 deg.
const TRIM: f64 = 0.035;
/// 1-sigma of the level of a unit at an odd angle, rad: 0.5 deg.
const LEVEL: f64 = 0.009;
/// Gravity, m/s^2.
const GRAVITY: f64 = 9.8;

impl Samples {
    /// The key of the mounting whose error was guessed with the axes.
    pub fn doubted(&self) -> Option<String> {
        let [roll, pitch, yaw] = self.doubt.map(f64::to_degrees);
        let line = format!("[\"{roll:.1} deg\", \"{pitch:.1} deg\", \"{yaw:.1} deg\"]");
        (yaw > 0.0).then(|| format!("mounting = {{ sigma = {line} }}"))
    }
}

impl Part {
    /// Exchanges the columns of latitude and longitude; `false` where the source has found them by itself.
    fn exchange_columns(&mut self) -> bool {
        let names = ["columns.lat =", "columns.lon ="];
        let of = |key: &String| names.iter().position(|name| key.starts_with(name));
        if self.found.source.iter().filter_map(of).count() != names.len() {
            return false;
        }
        for key in &mut self.found.source {
            if let Some(k) = of(key) {
                *key = key.replacen(names[k], names[1 - k], 1);
            }
        }
        true
    }

    /// Turns the samples by a rotation, after what has turned them already; `false` where their axes
    /// form a left-handed set.
    fn rotate(&mut self, rotation: &Rotation) -> bool {
        let identity = about_down(0.0);
        let axes = match &self.samples.axes {
            Some(axes) => of_axes(axes),
            None => Some(identity),
        };
        let Some(axes) = axes else { return false };
        let before = self.samples.rotation.unwrap_or(identity);
        self.samples.rotation = Some(product(rotation, &product(&axes, &before)));
        self.samples.axes = None;
        true
    }
}

impl Recording {
    /// The table of the IMU, which the source can turn by any angle.
    fn turnable(&mut self) -> Option<&mut Part> {
        self.part_mut("imu").filter(|part| part.reader == Reader::Csv && part.more.is_none())
    }

    /// Levels an IMU that no vehicle holds so on average, where no sensor shows that it does.
    pub fn level_freely(&mut self, streams: &[StreamSurvey]) -> bool {
        let imu = find(streams, "imu").filter(|imu| imu.samples > 0);
        let first = imu.and_then(|s| s.channel("accel_x").or_else(|| s.channel("dvel_x")));
        let Some((imu, k)) = imu.zip(first).filter(|_| !self.tilted && self.turned[0]) else {
            return false;
        };
        let level = levelling([imu.mean[k], imu.mean[k + 1], imu.mean[k + 2]]);
        let Some((rotation, angle)) = level.filter(|(_, angle)| *angle > TILTED) else {
            return false;
        };
        // a change of the speed over the whole recording tilts the mean force
        let fastest = find(streams, "gnss").map_or(0.0, |gnss| gnss.fastest);
        let doubt = TRIM.hypot(fastest / (GRAVITY * imu.length().max(1.0)));
        let yaw = if self.moves_sideways() { UNKNOWN } else { 0.0 };
        let Some(part) = self.turnable() else { return false };
        if !part.rotate(&rotation) {
            return false;
        }
        part.samples.doubt = [doubt, doubt, yaw];
        self.tilted = true;
        let text = format!(
            "the mean of its specific force is {:.0} deg from an axis: it is levelled, as for a vehicle \
             that is level on average",
            angle.to_degrees()
        );
        self.notes.push(format!("imu: {text}"));
        self.ask(&text);
        true
    }

    /// Turns an IMU that is at an angle in its vehicle by the course of a receiver, and states what remains
    /// uncertain of its axes.
    pub fn turn_freely(&mut self, streams: &[StreamSurvey]) -> bool {
        let course = find(streams, "gnss").and_then(|s| s.course);
        let turn = course.filter(|course| course.sense == Sense::Right).map(|course| course.turn);
        let sigma = turn.map_or(UNKNOWN, |turn| turn.sigma.hypot(ROAD));
        let turn = turn.filter(|turn| turn.angle.abs() > DOUBTED * sigma);
        if self.turned_freely || self.moves_sideways() || (turn.is_none() && !self.tilted) {
            return false;
        }
        self.turned_freely = true;
        let Some(turn) = turn else {
            self.doubt_yaw(sigma);
            return true;
        };
        let large = turn.angle.abs() > DETERMINED * sigma;
        let rotation = about_down(turn.angle);
        let turned = large && self.turnable().is_some_and(|part| part.rotate(&rotation));
        self.doubt_yaw(if turned { sigma } else { sigma.hypot(turn.angle) });
        let kept = ", which is too uncertain or too small: it stays, as an error of the mounting";
        let text = format!(
            "the course of the receiver fits its accelerations after a turn by {:.1} deg about down, \
             sigma {:.1} deg{}",
            turn.angle.to_degrees(),
            sigma.to_degrees(),
            if turned { "" } else { kept }
        );
        self.notes.push(format!("imu: {text}"));
        self.ask(&text);
        true
    }

    /// States the 1-sigma of the yaw of the IMU in the vehicle, rad.
    fn doubt_yaw(&mut self, yaw: f64) {
        let Some(part) = self.part_mut("imu") else { return };
        let [roll, pitch, _] = part.samples.doubt.map(|sigma| sigma.max(LEVEL));
        part.samples.doubt = [roll, pitch, yaw];
    }

    /// The factor by which the integers of latitude and longitude of a receiver without a velocity are semicircles
    /// instead of 1e-7 deg.
    pub fn in_semicircles(&self) -> Option<f64> {
        let part = self.part("gnss").filter(|part| !part.found.velocity)?;
        let integers = part.found.questions.iter().any(|q| q.contains(IN_E7));
        let named = part.found.source.iter().any(|key| key.to_lowercase().contains("e7\""));
        (integers && !named).then_some(SEMICIRCLE / E7)
    }

    /// Asks for the forward axis of an IMU where no course of a receiver shows it.
    pub fn doubt_forward(&mut self, streams: &[StreamSurvey]) {
        let moves = find(streams, "gnss").filter(|gnss| gnss.fastest > SLOWEST);
        let shown = moves.is_none_or(|gnss| gnss.course.is_some());
        if shown || self.moves_sideways() || self.part("reference").is_some() {
            return;
        }
        let text = "the motion of the receiver is too slow or too noisy to show which axis of the IMU points forward: is \
                    it the first one of sensor.imu.samples.axes, or x? A wrong one turns the heading by quarters";
        self.notes.push(format!("imu: {text}"));
        self.ask(text);
    }

    /// Tests whether the velocities of a log are along the axes of its vehicle.
    ///
    /// # Errors
    /// When they are along north and east, which the attitude of the instrument made of them.
    pub fn swims_along_its_axes(&self) -> Result<(), StreamError> {
        let Some((north_first, part)) = self.earth.zip(self.part("dvl")) else { return Ok(()) };
        let order = if north_first { "north and east" } else { "east and north" };
        let text = format!(
            "the direction of its velocities turns as the vehicle does: they are along {order}, not along \
             the axes of the instrument"
        );
        Err(StreamError::format(text).in_file(&part.file).with_remedy(
            "record the velocities along the axes of the instrument or of the ship, or turn them back by \
             the attitude that the instrument used",
        ))
    }

    /// Exchanges latitude and longitude of a table without headings, where the course turns as if they
    /// were exchanged. A table that names them is doubted.
    pub fn exchange(&mut self, streams: &[StreamSurvey]) -> bool {
        let [turns, forces] = find(streams, "gnss").map_or([false; 2], |s| s.mirrored);
        let is_pair = |key: &String| key.contains(LATITUDE_FIRST) || key.contains(LONGITUDE_FIRST);
        let is_unnamed = |part: &Part| {
            let mut questions = part.found.questions.iter();
            questions.any(|q| q.contains(BY_CONTENT) || q.contains(ORDER))
        };
        let unnamed = self.part("gnss").is_some_and(is_unnamed);
        // negative rates of the IMU would turn so, too, where the columns have names
        let mirrored = forces || (turns && unnamed);
        if !mirrored || self.moves_sideways() || std::mem::replace(&mut self.exchanged, true) {
            return false;
        }
        let Some(part) = self.part_mut("gnss") else { return false };
        let other = |key: &String| match key.contains(LATITUDE_FIRST) {
            true => key.replace(LATITUDE_FIRST, LONGITUDE_FIRST),
            false => key.replace(LONGITUDE_FIRST, LATITUDE_FIRST),
        };
        part.found.source.iter_mut().filter(|key| is_pair(key)).for_each(|key| *key = other(key));
        let swapped = !unnamed && !part.found.velocity && part.exchange_columns();
        if swapped {
            let text = "the columns of latitude and longitude are exchanged: its course turns as the IMU does so";
            part.found.questions.push(text.to_owned());
            self.notes.push(format!("gnss: {text}"));
            return true;
        }
        if !unnamed {
            let text = "its course turns against the IMU as if east and north were exchanged: check \
                        latitude and longitude, and the velocities along north and east";
            part.found.questions.push(text.to_owned());
            self.notes.push(format!("gnss: {text}"));
            return true;
        }
        for key in part.found.source.iter_mut().filter(|key| key.starts_with("headings = [")) {
            let other = key.replace("\"lat\"", "\"-\"").replace("\"lon\"", "\"lat\"");
            *key = other.replace("\"-\"", "\"lon\"");
        }
        let text = "the longitude stands before the latitude: its course turns as the IMU does so";
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("gnss: {text}"));
        true
    }
}
