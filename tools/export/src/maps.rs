//! GeoJSON, KML and GPX. Longitudes are cut at the antimeridian, as RFC 7946 requires. Heights are
//! above the ellipsoid.

use crate::{Fix, Form, UtcClock};
use std::io::{self, Write};

/// Escapes the characters with a meaning in XML, and removes those that XML 1.0 forbids.
fn xml(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '\u{9}' | '\u{a}' | '\u{d}' | '\u{20}'..='\u{fffd}' | '\u{10000}'.. => out.push(c),
            _ => {}
        }
    }
    out
}

/// A text in JSON.
fn json(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            '\0'..='\u{1f}' => out.push_str(&format!("\\u{:04x}", u32::from(c))),
            _ => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A line that is written as its positions come; it ends at the antimeridian, where the next begins.
#[derive(Default)]
struct Line {
    /// The last position: longitude, latitude (deg) and height (m).
    last: Option<[f64; 3]>,
    /// Number of positions of the line that is open.
    count: u64,
}

/// The place of a position in the lines.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// The first position of a line, which is held back until there is a second.
    Held,
    /// The second position: the line begins with the one held back.
    Second([f64; 3]),
    /// A further position.
    Further,
}

impl Line {
    /// Adds a position; `true` if a line of two positions or more ends before it.
    fn add(&mut self, fix: &Fix) -> (bool, Place, [f64; 3]) {
        let [latitude, longitude] = fix.degrees();
        let position = [longitude, latitude, fix.position.height];
        let jumps = self.last.is_some_and(|last| (last[0] - longitude).abs() > 180.0);
        let ends = jumps && self.count > 1;
        if jumps {
            self.count = 0;
        }
        let place = match (self.count, self.last) {
            (1, Some(first)) => Place::Second(first),
            (0, _) | (_, None) => Place::Held,
            _ => Place::Further,
        };
        self.count += 1;
        self.last = Some(position);
        (ends, place, position)
    }

    fn is_open(&self) -> bool {
        self.count > 1
    }
}

/// Writes a position with 0.1 mm, longitude first.
fn position(out: &mut dyn Write, [longitude, latitude, height]: [f64; 3]) -> io::Result<()> {
    write!(out, "{longitude:.9},{latitude:.9},{height:.4}")
}

/// GeoJSON: first the track as lines, then a point for each epoch.
pub struct GeoJson {
    name: String,
    clock: UtcClock,
    line: Line,
    /// Set once there is a feature.
    any: bool,
}

impl GeoJson {
    pub fn new(name: String, clock: UtcClock) -> Self {
        Self { name, clock, line: Line::default(), any: false }
    }

    fn separate(&mut self, out: &mut dyn Write) -> io::Result<()> {
        let separator = if std::mem::replace(&mut self.any, true) { ",\n" } else { "\n" };
        out.write_all(separator.as_bytes())
    }

    fn end_line(&self, out: &mut dyn Write) -> io::Result<()> {
        write!(out, "]}},\"properties\":{{\"name\":{}}}}}", json(&self.name))
    }
}

impl Form for GeoJson {
    fn passes(&self) -> usize {
        2
    }

    fn begin(&mut self, out: &mut dyn Write) -> io::Result<()> {
        write!(out, "{{\"type\":\"FeatureCollection\",\"features\":[")
    }

    fn fix(&mut self, pass: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        if pass > 0 {
            self.separate(out)?;
            return point(fix, self.clock, out);
        }
        let (ends, place, here) = self.line.add(fix);
        if ends {
            self.end_line(out)?;
        }
        match place {
            Place::Held => return Ok(()),
            Place::Second(first) => {
                self.separate(out)?;
                write!(out, "{{\"type\":\"Feature\",\"geometry\":{{\"type\":\"LineString\",")?;
                write!(out, "\"coordinates\":[[")?;
                position(out, first)?;
                write!(out, "]")?;
            }
            Place::Further => {}
        }
        write!(out, ",\n[")?;
        position(out, here)?;
        write!(out, "]")
    }

    fn end_pass(&mut self, pass: usize, out: &mut dyn Write) -> io::Result<()> {
        if pass == 0 && self.line.is_open() { self.end_line(out) } else { Ok(()) }
    }

    fn end(&mut self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(b"\n]}\n")
    }
}

/// The feature of one epoch.
fn point(fix: &Fix, clock: UtcClock, out: &mut dyn Write) -> io::Result<()> {
    let [latitude, longitude] = fix.degrees();
    write!(out, "{{\"type\":\"Feature\",\"geometry\":{{\"type\":\"Point\",\"coordinates\":[")?;
    position(out, [longitude, latitude, fix.position.height])?;
    write!(out, "]}},\"properties\":{{\"time_s\":{}", fix.time.seconds())?;
    if let Some(utc) = clock.iso(fix.time) {
        write!(out, ",\"utc\":\"{utc}\"")?;
    }
    let mut put = |names: [&str; 3], values: nalgebra::Vector3<f64>| -> io::Result<()> {
        let known = names.iter().zip(values.iter()).filter(|(_, v)| v.is_finite());
        for (name, value) in known {
            write!(out, ",\"{name}\":{value:.6}")?;
        }
        Ok(())
    };
    put(["north_sigma_m", "east_sigma_m", "down_sigma_m"], fix.position_sigma)?;
    if let Some([velocity, sigma]) = fix.velocity {
        put(["north_mps", "east_mps", "down_mps"], velocity)?;
        put(["north_sigma_mps", "east_sigma_mps", "down_sigma_mps"], sigma)?;
    }
    if let Some([angles, sigma]) = fix.attitude {
        put(["roll_deg", "pitch_deg", "yaw_deg"], angles.map(f64::to_degrees))?;
        let names = ["roll_sigma_deg", "pitch_sigma_deg", "yaw_sigma_deg"];
        put(names, sigma.map(f64::to_degrees))?;
    }
    write!(out, "}}}}")
}

/// KML: one placemark for each line.
pub struct Kml {
    name: String,
    line: Line,
}

impl Kml {
    pub fn new(name: String) -> Self {
        Self { name, line: Line::default() }
    }
}

const KML_END: &[u8] = b"</coordinates></LineString></Placemark>\n";

impl Form for Kml {
    fn begin(&mut self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
        writeln!(out, "<kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document>")?;
        writeln!(out, "<name>{}</name>", xml(&self.name))
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let (ends, place, here) = self.line.add(fix);
        if ends {
            out.write_all(KML_END)?;
        }
        match place {
            Place::Held => return Ok(()),
            Place::Second(first) => {
                write!(out, "<Placemark><name>{}</name><LineString>", xml(&self.name))?;
                writeln!(out, "<altitudeMode>absolute</altitudeMode><coordinates>")?;
                position(out, first)?;
                writeln!(out)?;
            }
            Place::Further => {}
        }
        position(out, here)?;
        writeln!(out)
    }

    fn end(&mut self, out: &mut dyn Write) -> io::Result<()> {
        if self.line.is_open() {
            out.write_all(KML_END)?;
        }
        out.write_all(b"</Document></kml>\n")
    }
}

/// GPX: one segment for each line. A time is written where the run's clock has a date.
pub struct Gpx {
    name: String,
    clock: UtcClock,
    last: Option<f64>,
}

impl Gpx {
    pub fn new(name: String, clock: UtcClock) -> Self {
        Self { name, clock, last: None }
    }
}

impl Form for Gpx {
    fn begin(&mut self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
        write!(out, "<gpx version=\"1.1\" creator=\"navfuse\" ")?;
        writeln!(out, "xmlns=\"http://www.topografix.com/GPX/1/1\">")?;
        writeln!(out, "<trk><name>{}</name><trkseg>", xml(&self.name))
    }

    fn fix(&mut self, _: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()> {
        let [latitude, longitude] = fix.degrees();
        if self.last.is_some_and(|last| (last - longitude).abs() > 180.0) {
            writeln!(out, "</trkseg><trkseg>")?;
        }
        self.last = Some(longitude);
        write!(out, "<trkpt lat=\"{latitude:.9}\" lon=\"{longitude:.9}\">")?;
        write!(out, "<ele>{:.4}</ele>", fix.position.height)?;
        if let Some(utc) = self.clock.iso(fix.time) {
            write!(out, "<time>{utc}</time>")?;
        }
        writeln!(out, "</trkpt>")
    }

    fn end(&mut self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(b"</trkseg></trk></gpx>\n")
    }
}
