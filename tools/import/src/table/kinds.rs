//! Files with rows of several kinds, each of which begins with its name: `IMU,0.01,...`, `GPS,0.2,...`.

use super::content;
use super::layout::Layout;
use super::measured::measured;
use crate::found::Found;

/// Least number of lines of such a file, and the share of lines that must begin with a word.
const LINES: usize = 10;
const SHARE: f64 = 0.95;
/// Largest number of kinds.
const KINDS: usize = 200;
/// The kind that describes the columns of the others, as ArduPilot writes it: type, length, name,
/// format, headings.
const DESCRIPTION: &str = "FMT";
/// Sensors that such a file may have; its other rows are of the vehicle's own filter.
const SENSORS: [&str; 4] = ["imu", "gyros", "accels", "gnss"];

/// The rows of one kind.
struct Kind<'a> {
    name: &'a str,
    lines: Vec<&'a str>,
}

fn first_word(line: &str) -> Option<&str> {
    let word = line.split([',', ';', '\t', ' ']).next()?.trim();
    let named = word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '$');
    (named && word.len() < line.len()).then_some(word)
}

/// The kinds of rows, if nearly all lines begin with the name of a kind.
fn kinds(text: &str) -> Vec<Kind<'_>> {
    let lines: Vec<&str> =
        text.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#')).collect();
    let words = lines.iter().filter_map(|line| Some((first_word(line)?, *line)));
    let mut kinds: Vec<Kind<'_>> = Vec::new();
    let mut named = 0;
    for (name, line) in words {
        named += 1;
        match kinds.iter().position(|kind| kind.name == name) {
            Some(k) => kinds[k].lines.push(line),
            None if kinds.len() < KINDS => kinds.push(Kind { name, lines: vec![line] }),
            None => return Vec::new(),
        }
    }
    let several = kinds.iter().filter(|kind| kind.lines.len() > 1).count() > 1;
    let most = named >= LINES && f64::from(named as u32) >= SHARE * lines.len() as f64;
    if several && most { kinds } else { Vec::new() }
}

/// Tests whether kinds differ in their numbers of cells.
fn of_several_widths(kinds: &[Kind<'_>]) -> bool {
    let cells = |kind: &Kind<'_>| kind.lines[0].split([',', ';', '\t']).count();
    let mut widths: Vec<usize> = kinds.iter().filter(|k| k.lines.len() > 1).map(cells).collect();
    widths.dedup();
    widths.len() > 1
}

/// The headings that a description, or a comment, has for a kind.
fn described(text: &str, kinds: &[Kind<'_>], name: &str) -> Option<Vec<String>> {
    let cells = |line: &str| line.split(',').map(|c| c.trim().to_owned()).collect::<Vec<String>>();
    let mut formats = kinds.iter().filter(|kind| kind.name == DESCRIPTION).flat_map(|k| &k.lines);
    let format = formats.find_map(|line| {
        let cells = cells(line);
        let columns = cells.get(5..).filter(|_| cells[3] == name)?;
        Some([&["kind".to_owned()], columns].concat())
    });
    let comment = || {
        let comments = text.lines().filter_map(|line| line.strip_prefix('#'));
        comments.map(cells).find(|cells| cells.len() > 1 && cells[0] == name)
    };
    format.or_else(comment)
}

/// The sensors of one kind of rows.
fn of(text: &str, kinds: &[Kind<'_>], kind: &Kind<'_>) -> Vec<Found> {
    let rows = kind.lines.join("\n") + "\n";
    let Some(mut layout) = Layout::of(&rows) else { return Vec::new() };
    let mut questions = Vec::new();
    match described(text, kinds, kind.name) {
        Some(headings) if headings.len() == layout.width() => layout.headings = headings,
        _ => {
            let Some((mut headings, question)) = content::headings(&layout) else {
                return Vec::new();
            };
            headings[0] = "kind".to_owned();
            layout.headings = headings;
            questions.push(question);
        }
    }
    layout.given = true;
    layout.skip = 0;
    layout.kind = vec![(0, kind.name.to_owned())];
    // several instances share their rows: the first is used
    let instance = layout.headings.iter().position(|h| h == "I");
    if let Some((k, first)) = instance.and_then(|k| Some((k, layout.rows.first()?.get(k)?.clone())))
    {
        layout.rows.retain(|row| row.get(k) == Some(&first));
        layout.kind.push((k, first));
    }
    measured(layout, "", questions).unwrap_or_default()
}

/// The sensors of a file with rows of several kinds: for each sensor the first kind that has it, or
/// the first one with a velocity.
pub fn sensors(text: &str) -> Vec<Found> {
    let kinds = kinds(text);
    let mut sensors: Vec<Found> = Vec::new();
    let found = kinds.iter().filter(|kind| kind.lines.len() > 1).flat_map(|k| of(text, &kinds, k));
    for found in found.filter(|found| SENSORS.contains(&found.kind)) {
        match sensors.iter_mut().find(|known| known.kind == found.kind) {
            Some(known) if found.velocity && !known.velocity => *known = found,
            Some(_) => {}
            None => sensors.push(found),
        }
    }
    // rows of one width with a word before them may be one table
    if sensors.len() > 1 || of_several_widths(&kinds) { sensors } else { Vec::new() }
}
