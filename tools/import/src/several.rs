//! A sensor in several files: its channels in two of them, or its rows in one after another.

use crate::found::{Found, ORIGIN, point};
use crate::recording::{Part, Reader, Recording, TABLE, is_reference};
use crate::samples::Samples;
use crate::table;
use navfuse_core::document::quoted;
use navfuse_core::model::stream::StreamError;
use std::path::Path;

/// Interval between the times that rows of an IMU share, s, that displaces no receiver: 20 m/s show 20 cm in it.
const LITTLE: f64 = 0.01;

impl Recording {
    /// Writes the point from which positions of a table count.
    ///
    /// # Errors
    /// When no answer gives it.
    pub fn count_from(&mut self, position: Option<[f64; 3]>) -> Result<(), StreamError> {
        if let Some([.., height]) = position {
            self.settle_pressure(height);
        }
        let point = position.map(point);
        for part in &mut self.parts {
            for key in part.found.source.iter_mut().filter(|key| key.contains(ORIGIN)) {
                let Some(point) = &point else {
                    let text =
                        "its positions are metres east and north of a point that no column names";
                    return Err(StreamError::format(text).in_file(&part.file).with_remedy(
                        "give this point with --position latitude,longitude,height, or name the zone of UTM \
                         in a column `zone`",
                    ));
                };
                *key = key.replace(ORIGIN, point);
            }
        }
        Ok(())
    }

    /// Decides how a pressure counts by the height at the start, as answered.
    fn settle_pressure(&mut self, height: f64) {
        let Some(part) = self.part_mut("depth") else { return };
        let Some(pressure) = &mut part.found.pressure else { return };
        let (key, question) = (pressure.key(), pressure.question());
        if !pressure.settle(-height) {
            return;
        }
        let [new_key, new_question] = [pressure.key(), pressure.question()];
        part.found.source.iter_mut().filter(|k| **k == key).for_each(|k| k.clone_from(&new_key));
        part.found.questions.retain(|q| *q != question && !q.ends_with("by its size"));
        part.found.questions.push(new_question.clone());
        self.notes.push(format!("depth: {new_question}"));
    }

    /// Makes one inertial unit of gyros and accelerometers in two files.
    pub fn join_halves(&mut self) {
        // rates and increments are two units
        let alike = || {
            let mut keys = self.halves.iter().flatten().map(|(found, _)| &found.sensor);
            keys.next() == keys.next()
        };
        if self.part("imu").is_some() || self.halves.iter().any(Option::is_none) || !alike() {
            return;
        }
        let [Some((gyros, other)), Some((accels, file))] = std::mem::take(&mut self.halves) else {
            return;
        };
        let mut found = Found { kind: "imu", ..accels };
        found.questions.extend(gyros.questions);
        found.questions.push(format!(
            "the rates of {} are interpolated to the times of the specific forces",
            other.display()
        ));
        let (name, reader) = ("imu", Reader::Csv);
        let samples = Samples::default();
        let [more, then] = std::mem::take(&mut self.halves_then);
        let files: Vec<String> =
            more.iter().map(|(_, file)| quoted(&file.display().to_string())).collect();
        let list = (!files.is_empty()).then(|| format!("then = [{}]", files.join(", ")));
        let more = Some((gyros.source.into_iter().chain(list).collect(), other));
        self.parts.push(Part { name, found, reader, file, lever_arm: None, more, then, samples });
    }

    /// Lets a receiver have a clock of its own beside rows of an IMU of which several share a time: they are taken for the
    /// rows after this time, and may be those before it.
    pub fn doubt_bursts(&mut self) {
        let burst = self.part("imu").map_or(0.0, |imu| imu.found.burst);
        let Some(part) = self.part_mut("gnss").filter(|_| burst > LITTLE) else { return };
        part.found.sensor.push(format!("time_offset = {{ sigma = \"{burst:.3} s\" }}"));
        let text = "rows of the IMU that share a time may be those before it: the offset of the clock is estimated";
        part.found.questions.push(text.to_owned());
    }

    /// Takes a table of poses for a receiver where no other file aids the inertial unit, and the name of the file does not
    /// call it a reference.
    pub fn aid_by_poses(&mut self) {
        let driven = self.part("imu").is_some();
        let alone = self.parts.iter().all(|part| ["imu", "reference"].contains(&part.name));
        let poses = |part: &&mut Part| part.name == "reference" && !part.found.apart.is_empty();
        let part = self.parts.iter_mut().find(poses).filter(|part| !is_reference(&part.file));
        let Some(part) = part.filter(|_| driven && alone && self.velocity.is_none()) else {
            return;
        };
        if let Some(found) = part.found.apart.iter().find(|found| found.kind == "gnss") {
            (part.name, part.found) = ("gnss", found.clone());
            self.notes.push(format!(
                "gnss: no other file aids the IMU: the positions of {} are taken for those of a receiver; with \
                 `reference` in the name of the file they are compared alone",
                part.file.display()
            ));
        }
    }

    /// Adds the velocity of a receiver to its positions in another table.
    ///
    /// # Errors
    /// When no table has its positions.
    pub fn join_velocity(&mut self) -> Result<(), StreamError> {
        let Some((velocity, file)) = self.velocity.take() else { return Ok(()) };
        let gnss = self.parts.iter_mut().find(|part| {
            let alone = part.reader == Reader::Csv && part.then.is_empty();
            part.name == "gnss" && alone && !part.found.velocity
        });
        let named = file.file_stem().map(|s| s.to_string_lossy().to_lowercase());
        let log = named.is_some_and(|name| name.contains("dvl"));
        let Some(part) = gnss.filter(|_| !log) else {
            let text = "its velocities are along north and east, and no table has the positions of their \
                        receiver";
            return Err(StreamError::format(text).in_file(file).with_remedy(
                "give positions of the receiver, or the velocities of a log along the axes of the \
                 instrument",
            ));
        };
        part.found.questions.extend(velocity.questions);
        part.found.questions.push(format!(
            "the velocities of {} are taken for those of the receiver, and interpolated to its fixes",
            file.display()
        ));
        part.found.velocity = true;
        part.more = Some((velocity.source, file));
        Ok(())
    }

    /// Adds a file of gyros or accelerometers whose rows go on where those of the files before end; `false` for any other
    /// file.
    pub fn half_goes_on(&mut self, k: usize, found: &Found, file: &Path) -> bool {
        let Some((first, _)) = &self.halves[k] else { return false };
        let (Some(own), Some(span)) = (first.span, found.span) else { return false };
        let last = self.halves_then[k].last().map_or(own, |(span, _)| *span);
        let follows = first.source == found.source && span[0] >= last[1];
        if follows {
            self.halves_then[k].push((span, file.to_owned()));
            self.notes.push(format!("{}: {} goes on in the same form", found.kind, file.display()));
        }
        follows
    }

    /// Adds a file without headings whose rows go on where those of a file with headings end; `false` for any other file.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn goes_on_without_headings(
        &mut self,
        file: &Path,
        absolute: &Path,
    ) -> Result<bool, StreamError> {
        let read = |path: &Path| {
            let bytes =
                navfuse_csv::beginning(path, TABLE).map_err(|e| StreamError::open(path, e))?;
            Ok::<String, StreamError>(navfuse_csv::text(&bytes).into_owned())
        };
        let mut others: Vec<&Path> = Vec::new();
        for part in self.parts.iter().filter(|part| part.reader == Reader::Csv) {
            if !others.contains(&&*part.file) {
                others.push(&part.file);
            }
        }
        if others.is_empty() {
            return Ok(false);
        }
        let rows = read(file)?;
        let Some(first) = rows.lines().next().map(str::to_owned) else { return Ok(false) };
        for other in others {
            let text = read(other)?;
            let Some(headings) = text.lines().next() else { continue };
            let cells = |line: &str| line.matches([',', ';', '\t', '|']).count();
            let words = |line: &str| line.chars().filter(|c| c.is_alphabetic()).count();
            let alike = cells(headings) > 0 && cells(headings) == cells(&first);
            if !alike || words(headings) <= words(&first) || words(&first) > cells(&first) {
                continue;
            }
            let name = other.file_stem().map(|s| s.to_string_lossy().into_owned());
            let found = table::recognise(&format!("{headings}\n{rows}"), &name.unwrap_or_default());
            let found = found.unwrap_or_default();
            let known = |found: &Found| {
                self.parts.iter().any(|p| p.name == found.kind && p.found.source == found.source)
            };
            if !found.is_empty() && found.iter().all(known) {
                return Ok(found.iter().all(|found| self.goes_on(found.kind, found, absolute)));
            }
        }
        Ok(false)
    }

    /// Adds a file whose rows go on where those of another one end, or end where they begin, in the same
    /// form; `false` for any other file.
    pub fn goes_on(&mut self, name: &str, found: &Found, file: &Path) -> bool {
        let same = |part: &&mut Part| {
            part.name == name && part.reader == Reader::Csv && part.found.source == found.source
        };
        let Some(part) = self.parts.iter_mut().find(same) else { return false };
        let (Some(own), Some(span)) = (part.found.span, found.span) else { return false };
        let apart = |other: [f64; 2]| span[0] >= other[1] || span[1] <= other[0];
        if !apart(own) || !part.then.iter().all(|(other, _)| apart(*other)) {
            return false;
        }
        part.then.push((span, file.to_owned()));
        if span[0] < own[0] {
            // the first file in time is the file of the part
            part.found.span = Some(span);
            let first = std::mem::replace(&mut part.file, file.to_owned());
            part.then.pop();
            part.then.push((own, first));
        }
        part.then.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]));
        self.notes.push(format!("{name}: {} goes on in the same form", file.display()));
        true
    }
}
