//! Points of a track in XML as rows that name their values: GPX, TCX, and KML with its times and coordinates.

use crate::paths::{bounded, join};
use std::collections::VecDeque;
use std::io::{BufRead, Read, Result};

/// Elements that are points.
const POINTS: [&str; 4] = ["trkpt", "rtept", "wpt", "Trackpoint"];
/// Elements of KML with the time of a point, and with its longitude, latitude and height.
const TIME: &str = "when";
const PLACE: &str = "coord";
/// Bytes of a line that are read at once.
const PIECE: u64 = 1 << 16;

/// The points of a text.
#[derive(Default)]
pub struct Points {
    /// Times of KML whose places were not read yet.
    times: VecDeque<String>,
}

/// The name of a tag without its namespace.
fn name(tag: &str) -> &str {
    let end = tag.find([' ', '/', '\n', '\t', '\r']).unwrap_or(tag.len());
    let whole = &tag[..end];
    whole.split_once(':').map_or(whole, |(_, name)| name)
}

/// The text before a tag, and the tag without its brackets.
fn split(piece: &str) -> Option<(&str, &str)> {
    let (text, tag) = piece.rsplit_once('<')?;
    Some((text.trim(), tag.trim_end().trim_end_matches('>')))
}

impl Points {
    /// The points of a text that is XML.
    pub fn of(text: &str) -> Option<Self> {
        let text = text.trim_start_matches('\u{feff}').trim_start();
        let xml = ["<?xml", "<gpx", "<kml", "<TrainingCenterDatabase"];
        xml.iter().any(|mark| text.starts_with(mark)).then(Self::default)
    }

    /// Reads the next point; `false` at the end.
    pub fn next(&mut self, file: &mut impl BufRead, record: &mut Vec<u8>) -> Result<bool> {
        record.clear();
        let mut piece = Vec::new();
        loop {
            piece.clear();
            while !piece.ends_with(b">") {
                bounded(piece.len())?;
                if file.by_ref().take(PIECE).read_until(b'>', &mut piece)? == 0 {
                    return Ok(false);
                }
            }
            let text = String::from_utf8_lossy(&piece).into_owned();
            let Some((before, tag)) = split(&text) else { continue };
            match tag.strip_prefix('/') {
                Some(end) if name(end) == TIME => self.times.push_back(before.to_owned()),
                Some(end) if name(end) == PLACE => {
                    let Some(time) = self.times.pop_front() else { continue };
                    let mut place = before.split_whitespace();
                    let mut next = || place.next().unwrap_or_default();
                    let [lon, lat, height] = [next(), next(), next()];
                    let point = format!(
                        "<coord><time>{time}</time><lon>{lon}</lon><lat>{lat}</lat><alt>{height}</alt></coord>"
                    );
                    record.extend_from_slice(point.as_bytes());
                    return Ok(true);
                }
                Some(end) if POINTS.contains(&name(end)) && !record.is_empty() => {
                    record.extend_from_slice(&piece);
                    return Ok(true);
                }
                None if record.is_empty() && POINTS.contains(&name(tag)) => {
                    record.extend_from_slice(format!("<{tag}>").as_bytes());
                    if tag.ends_with('/') {
                        return Ok(true);
                    }
                }
                _ if !record.is_empty() => record.extend_from_slice(&piece),
                _ => {}
            }
            bounded(record.len())?;
        }
    }
}

/// Calls `found` with the path and the text of each value of a point: its attributes and its elements.
pub fn values(record: &str, mut found: impl FnMut(&str, &str)) {
    let (mut path, mut bases) = (String::new(), Vec::<usize>::new());
    for piece in record.split_inclusive('>') {
        let Some((text, tag)) = split(piece) else { continue };
        if tag.starts_with('/') {
            if !text.is_empty() {
                found(&path, text);
            }
            path.truncate(bases.pop().unwrap_or_default());
            continue;
        }
        let base = path.len();
        // the point itself has no name
        if !bases.is_empty() {
            join(&mut path, name(tag));
        }
        let inner = path.len();
        let mut rest = tag;
        while let Some((before, after)) = rest.split_once('=') {
            let key = before.rsplit(char::is_whitespace).next().unwrap_or_default();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c));
            let Some((value, after)) = quote.and_then(|q| after[1..].split_once(q)) else { break };
            join(&mut path, key);
            found(&path, value);
            path.truncate(inner);
            rest = after;
        }
        match tag.ends_with('/') {
            true => path.truncate(base),
            false => bases.push(base),
        }
    }
}
