//! Headings that mean something beside others alone: axes, a height under water, parts of a degree.

use super::columns::{ACCEL, BODY, Chosen, DTHETA, DVEL, GYRO, Table};
use super::vocabulary::{self, Meaning, fitting, meaning};
use crate::found::Found;
use crate::pressure::Pressure;
use navfuse_core::document::quoted;

/// Largest height, m, at which one that counts from the start begins, and least one of another zero.
const LEVEL: f64 = 0.5;
const HIGH: f64 = 5.0;

impl Table<'_> {
    /// Names columns whose headings are axes alone: by their unit, as the specific force beside angular
    /// rates, or after the file, such as `Gyroscope.csv`.
    pub(super) fn name_axes(&mut self, name: &str) {
        let alone = self.layout.headings.iter().enumerate().filter_map(|(k, heading)| {
            let (axis, sign, unit) = vocabulary::axis(heading)?;
            Some((k, (axis, sign), unit.or_else(|| self.layout.units.get(k).cloned())))
        });
        let alone: Vec<(usize, (usize, f64), Option<String>)> = alone.collect();
        if !(0..3).all(|axis| alone.iter().filter(|(_, (a, _), _)| *a == axis).count() == 1) {
            return;
        }
        // a length alone is a position
        let of = |si: &str| {
            let fits = |u: &String| fitting(u, si).is_some() && fitting(u, "m").is_none();
            alone.iter().all(|(.., unit)| unit.as_ref().is_some_and(fits))
        };
        let inertial = |word: &&String| {
            let first = meaning(&format!("{word} x")).map(|m| m.channel);
            word.len() > 2 && first.is_some_and(|channel| [GYRO[0], ACCEL[0]].contains(&channel))
        };
        let words = vocabulary::words(name);
        let whole = meaning(&format!("{name} x")).is_some();
        let word = words.iter().find(inertial).filter(|_| !whole);
        let vector = match () {
            () if self.has(&GYRO) && !self.has(&ACCEL) => "accel",
            () if of("m/s^2") => "accel",
            () if of("m/s") => "velocity",
            () if of("rad/s") => "gyro",
            // as sensor_gyro_0.csv
            () => word.map_or(name, String::as_str),
        };
        let found = alone.iter().filter_map(|(k, (axis, sign), unit)| {
            let meaning = meaning(&format!("{vector} {}", ["x", "y", "z"][*axis]))?;
            let si = vocabulary::si(meaning.channel);
            let unit = unit.as_deref().and_then(|unit| fitting(unit, si));
            Some((*k, Meaning { unit, sign: *sign, ..meaning }))
        });
        let found: Vec<(usize, Meaning)> = found.collect();
        if found.len() == 3 {
            self.columns.extend(found);
        }
    }

    /// Leaves out columns without a number where others with the same meaning have some, as those of a receiver without a
    /// fix beside another one.
    pub(super) fn leave_out_empty(&mut self) {
        let channels: Vec<&str> = self.columns.iter().map(|(_, m)| m.channel).collect();
        // a time may be a text
        let clock = |m: &Meaning| ["time", "date", "week"].contains(&m.channel);
        let several =
            |m: &Meaning| !clock(m) && channels.iter().filter(|c| **c == m.channel).count() > 1;
        let holds = |k: usize| self.layout.column(k).iter().any(|v| v.is_finite() && *v != 0.0);
        let filled: Vec<&str> = (self.columns.iter())
            .filter(|(k, m)| several(m) && holds(*k))
            .map(|(_, m)| m.channel)
            .collect();
        let empty = |(k, m): &(usize, Meaning)| filled.contains(&m.channel) && !holds(*k);
        let columns = self.columns.iter().filter(|column| !empty(column)).cloned().collect();
        self.columns = columns;
    }

    /// Takes velocities beside increments of angles, where no forces are, for increments of velocity.
    pub(super) fn increments(&mut self) {
        if !self.has(&DTHETA) || !self.has(&BODY) || self.has(&DVEL) || self.has(&ACCEL) {
            return;
        }
        for (_, meaning) in &mut self.columns {
            if let Some(axis) = BODY.iter().position(|name| *name == meaning.channel) {
                meaning.channel = DVEL[axis];
            }
        }
    }

    /// Takes the meaning of the name of the file for a column `value`, as in `Depth.csv`.
    pub(super) fn name_value(&mut self, name: &str) {
        let value = |heading: &String| {
            let stem = heading.split(['[', '(', '{']).next().unwrap_or_default();
            ["value", "data"].contains(&vocabulary::words(stem).concat().as_str())
        };
        let Some(k) = self.layout.headings.iter().position(value) else { return };
        let named = meaning(name).filter(|m| ["depth", "pressure", "yaw"].contains(&m.channel));
        if let Some(named) = named.filter(|m| self.find(m.channel).is_none()) {
            let (_, unit) = self.layout.headings[k].split_once(['[', '(', '{']).unwrap_or_default();
            let unit =
                fitting(unit.trim_end_matches([']', ')', '}']), vocabulary::si(named.channel));
            self.columns.retain(|(column, _)| *column != k);
            self.columns.push((k, Meaning { unit, ..named }));
        }
    }

    /// Takes a velocity down beside one forward and one to the right for the third of a log.
    pub(super) fn down_beside_forward(&mut self) {
        let of_log = self.has(&["vel_x", "vel_y", "vel_d"])
            && ["vel_z", "vel_n", "vel_e"].iter().all(|other| self.find(other).is_none());
        for (_, meaning) in self.columns.iter_mut().filter(|(_, m)| of_log && m.channel == "vel_d")
        {
            meaning.channel = "vel_z";
        }
    }

    /// A depth in a table with one height alone: `z`, or a height below zero.
    pub(super) fn depth_by_height(&self) -> Option<Found> {
        let alone = self.layout.headings.iter().filter_map(|h| vocabulary::axis(h)).count() < 2
            && self.local().is_none();
        let below = |values: &[f64]| values.iter().all(|v| !v.is_finite() || *v < 1.0);
        let named = |word: &str| {
            self.find(word).filter(|(k, m)| m.channel == "z" || below(&self.layout.column(*k)))
        };
        let (k, meaning) = named("z").filter(|_| alone).or_else(|| named("height"))?;
        let (mut questions, heading) = (Vec::new(), self.heading(*k));
        questions.push(format!("the column {heading} is taken for the depth"));
        let key = self.key(meaning.channel, "depth", None, &mut questions)?;
        Some(Found { kind: "depth", source: vec![key], questions, ..Found::default() })
    }

    /// Leaves out a height that counts from the start, where another column has one that does not.
    pub(super) fn leave_out_relative_height(&mut self) {
        let begin = |k: usize| self.layout.column(k).into_iter().find(|v| v.is_finite());
        let Some((k, _)) = self.find("height").filter(|_| self.has(&["lat", "lon"])) else {
            return;
        };
        let relative = *k;
        let others = self.columns.iter().filter(|(k, m)| *k != relative && m.channel == "height");
        let other = others.filter_map(|(k, _)| begin(*k)).any(|v| v.abs() > HIGH);
        if other && begin(relative).is_some_and(|v| v.abs() < LEVEL) {
            self.columns.retain(|(k, _)| *k != relative);
        }
    }

    /// A depth by the pressure of water; `None` for a pressure of air, and without one.
    pub(super) fn pressure(&self) -> Option<Found> {
        let (k, meaning) = self.find("pressure")?;
        let heading = self.heading(*k);
        let mut words = vocabulary::words(heading);
        words.extend(self.layout.units.get(*k).iter().flat_map(|unit| vocabulary::words(unit)));
        let stated = meaning.unit.as_deref();
        let pressure = Pressure::of(heading, &words, &self.layout.column(*k), stated)?;
        let mut questions = vec![pressure.question()];
        if stated.is_none() {
            questions.push(format!("the unit of {heading}: {} by its size", pressure.unit()));
        }
        Some(Found {
            kind: "depth",
            source: vec![pressure.key()],
            questions,
            pressure: Some(pressure),
            ..Found::default()
        })
    }

    /// The column of the height of the geoid, beside a height that is not said to be above the
    /// ellipsoid.
    pub(super) fn geoid(&self) -> Option<usize> {
        let (height, _) = self.find("height")?;
        let name = vocabulary::words(self.heading(*height)).concat();
        // Septentrio, which alone writes radians, has heights above the ellipsoid
        let radians = self.find("lat").is_some_and(|(_, m)| m.unit.as_deref() == Some("rad"));
        let ellipsoid = radians || ["ell", "hae", "wgs"].iter().any(|word| name.contains(word));
        self.find("geoid").map(|(k, _)| *k).filter(|_| !ellipsoid)
    }

    /// The key of a height above the geoid, whose height above the ellipsoid a column has.
    pub(super) fn above_geoid(&self, questions: &mut Vec<String>) -> Option<String> {
        let ((k, meaning), geoid) = (self.find("height")?, self.geoid()?);
        let (heading, geoid) = (self.heading(*k), self.heading(geoid));
        questions.push(format!("{heading} counts from the geoid: {geoid} is added"));
        let unit = meaning.unit.clone().unwrap_or_else(|| "m".to_owned());
        let (scale, more) = (meaning.sign, format!(", plus = {}", quoted(geoid)));
        Chosen { heading, unit, scale, minutes: false, more, usual: false }.key("height")
    }

    /// The first of two or three columns with degrees, minutes and perhaps seconds of a latitude or longitude.
    pub(super) fn sexagesimal(&self, channel: &str) -> Option<usize> {
        const PARTS: [&[&str]; 3] =
            [&["d", "deg", "degrees"], &["m", "min", "minutes"], &["s", "sec", "seconds"]];
        let part = |k: usize, part: &[&str]| {
            let mut words = vocabulary::words(self.layout.headings.get(k)?);
            let mut last = words.pop()?;
            // as LATDD, LATMN, LATSS
            let glued = [("dd", "d"), ("mn", "m"), ("ss", "s")];
            if let Some((end, part)) =
                glued.iter().find(|(end, _)| words.is_empty() && last.ends_with(end))
            {
                words.push(last[..last.len() - end.len()].to_owned());
                last = (*part).to_owned();
            }
            let of = meaning(&words.join("_")).is_some_and(|m| m.channel == channel);
            (of && part.contains(&last.as_str())).then_some(())
        };
        let all = |k: &usize| {
            let minutes = (0..2).all(|i| part(k + i, PARTS[i]).is_some());
            minutes && (part(k + 2, PARTS[2]).is_some() || !self.is_whole(k + 1))
        };
        (0..self.layout.headings.len()).find(all)
    }
}
