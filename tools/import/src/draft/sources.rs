//! The tables of the sources.

use super::text::{MARK, Text, comment};
use crate::beams::{self, Aimed, Beams};
use crate::recording::{Part, Reader, Recording};
use crate::rotation;
use navfuse_core::document::quoted;
use navfuse_core::units::calendar::Calendar;
use navfuse_vehicle_logs::Format;

/// The tables of the sources.
pub(super) fn sources(out: &mut Text, recording: &Recording) {
    out.line("");
    for part in recording.parts.iter().filter(|p| p.reader == Reader::Csv) {
        out.line(&format!("[source.csv.files.{}]", part.name));
        out.line(&format!("path = {}", path(part)));
        if !part.then.is_empty() {
            let then = part.then.iter().map(|(_, file)| quoted(&file.display().to_string()));
            out.line(&format!("then = [{}]", then.collect::<Vec<_>>().join(", ")));
        }
        if let Some(turn) = &part.samples.rotation {
            let [roll, pitch, yaw] =
                rotation::degrees(turn).map(|a| (a * 100.0).round() / 100.0 + 0.0);
            out.line(&format!("rotation = [\"{roll} deg\", \"{pitch} deg\", \"{yaw} deg\"]"));
        }
        table(out, &part.found.source);
        if let Some((keys, file)) = &part.more {
            out.line(&format!("[source.csv.more.{}]", part.name));
            out.line(&format!("path = {}", quoted(&file.display().to_string())));
            table(out, keys);
        }
        questions(out, part);
    }
    for part in &recording.parts {
        if let Reader::Dvl(stamp) = part.reader {
            out.line("[source.dvl-file]");
            out.line(&format!("file = {}", path(part)));
            part.found.source.iter().for_each(|key| out.line(key));
            if let (Some(origin), Some(_)) = (recording.origin, stamp) {
                let c = Calendar::of_unix_nanos(origin);
                let line = format!(
                    "time = {{ origin = \"{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z\" }}",
                    c.year, c.month, c.day, c.hour, c.minute, c.second
                );
                out.ask(&line, "date and time at which the clock of the IMU is zero");
            }
            questions(out, part);
        }
    }
    vehicles(out, recording);
    let bag = || recording.parts.iter().filter(|p| p.reader == Reader::Bag);
    if let Some(first) = bag().next() {
        out.line("[source.ros2]");
        out.line(&format!("path = {}", path(first)));
        for part in bag() {
            out.line("");
            out.line(&format!("[source.ros2.sensors.{}]", part.name));
            part.found.source.iter().for_each(|key| out.line(key));
            questions(out, part);
        }
    }
    let nmea: Vec<&Part> = recording.parts.iter().filter(|p| p.reader == Reader::Nmea).collect();
    if let Some(first) = nmea.first() {
        out.line("[source.nmea]");
        out.line(&format!("file = {}", path(first)));
        for part in &nmea {
            let key = if part.name == "compass" { "heading" } else { part.name };
            out.line(&format!("{key} = \"{}\"", part.name));
            part.found.source.iter().for_each(|key| out.line(key));
            questions(out, part);
        }
    }
}

/// The keys of a log with velocities along its beams: as the file or the motion shows them.
pub(super) fn beams(out: &mut Text, beams: &Beams, aimed: Option<&Aimed>) {
    let list = |azimuth: &[f64]| {
        let list: Vec<String> = azimuth.iter().map(|a| format!("\"{a:.1} deg\"")).collect();
        format!("azimuth = [{}]", list.join(", "))
    };
    let slant = |deg: f64| format!("slant = \"{} deg\"", (deg * 100.0).round() / 100.0);
    let why = "as the accelerations that the IMU measures show it: data sheet, and mounting";
    match (beams.slant, aimed) {
        (Some(deg), _) => out.line(&slant(deg)),
        (None, Some(aimed)) => out.ask(&slant(aimed.slant), why),
        (None, None) => out.ask(&slant(beams::USUAL), "angle of the beams from the vertical"),
    }
    match (&beams.azimuth, aimed) {
        (_, Some(aimed)) => out.ask(&list(&aimed.azimuth), why),
        (Some(azimuth), None) => out.line(&list(azimuth)),
        (None, None) => {
            let usual = Beams::usual(beams.count);
            out.ask(&list(usual), "from forward to the right, of each beam");
        }
    }
    let known = if beams.slant.is_some() { beams::KNOWN } else { beams::UNKNOWN };
    let scale = 100.0 * aimed.map_or(known, |aimed| aimed.scale);
    out.ask(
        &format!("scale = {{ sigma = \"{scale:.1} %\" }}"),
        "accuracy of the data sheet, and slant",
    );
    let yaw = aimed.map_or(1.0, |aimed| (3.0 * aimed.sigma).max(1.0));
    out.ask(
        &format!("misalignment = {{ sigma = [\"1 deg\", \"1 deg\", \"{yaw:.1} deg\"] }}"),
        "accuracy of the mounting",
    );
}

/// The keys of a table.
fn table(out: &mut Text, keys: &[String]) {
    keys.iter().for_each(|key| out.line(key));
    if !keys.iter().any(|key| key.starts_with("disorder")) {
        out.line("disorder = \"skip\"");
    }
    out.line("nan = \"missing\"");
}

/// The tables of the logs of vehicles, one for each file.
fn vehicles(out: &mut Text, recording: &Recording) {
    let of =
        |part: &Part, wanted: usize| matches!(part.reader, Reader::Vehicle(_, k) if k == wanted);
    for k in 0.. {
        let parts: Vec<&Part> = recording.parts.iter().filter(|p| of(p, k)).collect();
        let Some(first) = parts.first() else { return };
        let Reader::Vehicle(format, _) = first.reader else { return };
        if k == 0 {
            out.line("[source.vehicle-log]");
        } else {
            out.line(&format!("[source.vehicle-log-{}]", k + 1));
            out.line("type = \"vehicle-log\"");
        }
        out.line(&format!("file = {}", path(first)));
        out.line(&format!("format = \"{}\"", format.name()));
        let timed = |part: &&Part| part.found.source.iter().any(|key| key.starts_with("interval"));
        if format == Format::Vectornav && !parts.iter().any(timed) {
            out.ask("interval = \"10 ms\"", "the messages have no time");
        }
        for part in &parts {
            part.found.source.iter().for_each(|key| out.line(key));
            questions(out, part);
        }
    }
}

fn path(part: &Part) -> String {
    quoted(&part.file.display().to_string())
}

fn questions(out: &mut Text, part: &Part) {
    for question in part.found.questions.iter().map(|question| comment(question)) {
        out.line(&format!("{MARK} {question}"));
        out.questions.push(format!("{}: {question}", part.name));
    }
    out.line("");
}
