//! Elements of XML as rows that name their values: the points of GPX and TCX, KML with its times and coordinates, and in
//! other files the elements at the smallest depth at which a name repeats.

use crate::paths::{PIECE, bounded, join};
use std::collections::{BTreeMap, VecDeque};
use std::io::{BufRead, Read, Result};

/// Elements that are points.
const POINTS: [&str; 4] = ["trkpt", "rtept", "wpt", "Trackpoint"];
/// Elements of KML with the time of a point, and with its longitude, latitude and height.
const TIME: &str = "when";
const PLACE: &str = "coord";

/// Elements of one name at one depth from which they are rows.
const SEVERAL: usize = 3;

/// The points of a text, or its elements.
#[derive(Default)]
pub struct Points {
    /// Times of KML whose places were not read yet.
    times: VecDeque<String>,
    /// Depth of the elements that are rows, where they are no points, and that of the next tag.
    level: Option<usize>,
    depth: usize,
}

/// The smallest depth at which the elements of one name are several; the whole text is at 0.
fn level(text: &str) -> Option<usize> {
    let (mut depth, mut counts) = (0, BTreeMap::new());
    for piece in text.split_inclusive('>').filter(|piece| piece.ends_with('>')) {
        let Some((_, tag)) = split(piece) else { continue };
        depth = match step(tag, depth) {
            Some((at, next)) => {
                *counts.entry((at, name(tag).to_owned())).or_insert(0) +=
                    usize::from(!tag.starts_with('/'));
                next
            }
            None => depth,
        };
    }
    counts.into_iter().find(|((at, _), count)| *at > 0 && *count >= SEVERAL).map(|((at, _), _)| at)
}

/// The depth of the element of a tag, and that of the next tag; `None` for a comment or a declaration.
fn step(tag: &str, depth: usize) -> Option<(usize, usize)> {
    match tag.chars().next()? {
        '?' | '!' | '-' | ']' => None,
        '/' => Some((depth.saturating_sub(1), depth.saturating_sub(1))),
        _ => Some((depth, depth + usize::from(!tag.ends_with('/')))),
    }
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
        if !text.starts_with('<') {
            return None;
        }
        let tracks = ["<gpx", "<kml", "<TrainingCenterDatabase"];
        let level = match tracks.iter().any(|mark| text.contains(mark)) {
            true => None,
            false => Some(level(text)?),
        };
        Some(Self { level, ..Self::default() })
    }

    /// Takes a tag of a file whose rows are the elements at a depth; `true` where one ends.
    fn take(&mut self, level: usize, (tag, piece): (&str, &[u8]), record: &mut Vec<u8>) -> bool {
        let Some((at, next)) = step(tag, self.depth) else { return false };
        self.depth = next;
        if at < level {
            return false;
        }
        match record.is_empty() {
            true => record.extend_from_slice(format!("<{tag}>").as_bytes()),
            false => record.extend_from_slice(piece),
        }
        at == level && next == level
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
            if let Some(level) = self.level {
                if self.take(level, (tag, &piece), record) {
                    return Ok(true);
                }
                bounded(record.len())?;
                continue;
            }
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
