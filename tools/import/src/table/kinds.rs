//! Files with rows of several kinds, whose names stand in one of the first cells: `IMU,0.01,...`, `GPS,0.2,...`, or
//! `0.01,GYR,...`, `0.01,ACC,...`.

use super::content;
use super::layout::Layout;
use super::measured::measured;
use super::vocabulary::{meaning, words};
use crate::found::Found;

/// Least number of lines of such a file, and the share of lines that must begin with a word.
const LINES: usize = 10;
const SHARE: f64 = 0.95;
/// Largest number of kinds.
const KINDS: usize = 200;
/// Number of lines by which a cell counts them.
const SOME: usize = 100;
/// Number of unused kinds that are named.
const NOTED: usize = 10;
/// The kind that describes the columns of the others, as ArduPilot writes it: type, length, name,
/// format, headings.
const DESCRIPTION: &str = "FMT";
/// Number of cells of which one may hold the name.
const PLACES: usize = 3;
/// Sensors that a file with descriptions may have; its other rows are of the vehicle's own filter.
const SENSORS: [&str; 4] = ["imu", "gyros", "accels", "gnss"];
/// The same for a file without, by the names of its rows.
const NAMED: [&str; 6] = ["imu", "gyros", "accels", "gnss", "dvl", "depth"];

/// The rows of one kind.
struct Kind<'a> {
    name: &'a str,
    lines: Vec<&'a str>,
}

/// The cells of a line, which commas or the like separate, or else spaces.
fn cells(line: &str) -> Vec<&str> {
    let separators = [',', ';', '\t', '|'];
    match line.contains(separators) {
        true => line.split(separators).map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    }
}

/// The word in a cell of a line with several.
fn word(line: &str, place: usize) -> Option<&str> {
    let cells = cells(line);
    let word = cells.get(place).copied().filter(|_| cells.len() > 1)?;
    word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '$').then_some(word)
}

/// The kinds of rows, if nearly all lines have the name of a kind in this cell.
fn kinds(text: &str, place: usize) -> Vec<Kind<'_>> {
    let lines: Vec<&str> =
        text.lines().filter(|l| !l.trim().is_empty() && !l.starts_with('#')).collect();
    let mut kinds: Vec<Kind<'_>> = Vec::new();
    let (mut named, mut others) = (0, 0);
    for line in &lines {
        let Some(name) = word(line, place) else {
            others += 1;
            if f64::from(others) > (1.0 - SHARE) * lines.len() as f64 + 1.0 {
                return Vec::new();
            }
            continue;
        };
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

/// Tests whether a cell counts the lines.
fn counts(text: &str, place: usize) -> bool {
    let lines = text.lines().filter(|line| !line.trim().is_empty()).take(SOME);
    let numbers: Option<Vec<i64>> =
        lines.map(|line| cells(line).get(place)?.parse::<i64>().ok()).collect();
    numbers.is_some_and(|n| n.len() == SOME && n.windows(2).all(|n| n[1] == n[0] + 1))
}

/// Tests whether kinds differ in their numbers of cells.
fn of_several_widths(kinds: &[Kind<'_>]) -> bool {
    let count = |kind: &Kind<'_>| cells(kind.lines[0]).len();
    let mut widths: Vec<usize> = kinds.iter().filter(|k| k.lines.len() > 1).map(count).collect();
    widths.dedup();
    widths.len() > 1
}

/// The headings of rows with a time and a vector or a number, by the name of their kind.
fn by_name(layout: &Layout, kind: &Kind<'_>, place: usize) -> Option<Vec<String>> {
    let columns = || (0..layout.width()).filter(|k| *k != place);
    let counted = || columns().find(|k| content::increases(&layout.column(*k)));
    let stamps = content::stamps(layout);
    let time = stamps.or_else(counted)?;
    // a second clock is no measurement
    let clock = |k: &usize| content::increases(&layout.column(*k));
    let free: Vec<usize> = columns().filter(|k| *k > time && !clock(k)).collect();
    let channel = |heading: &str| meaning(heading).map(|m| m.channel);
    let axes = ["x", "y", "z"].map(|axis| channel(&format!("{} {axis}", kind.name)));
    let named: Vec<&str> = match axes {
        [Some(x), Some(y), Some(z)] if x.ends_with("_x") && free.len() > 2 => vec![x, y, z],
        _ => channel(kind.name).filter(|c| *c == "depth" || *c == "pressure").into_iter().collect(),
    };
    let mut headings: Vec<String> = (1..=layout.width()).map(|k| format!("column_{k}")).collect();
    headings[time] = "time".to_owned();
    if let Some(day) = content::day_before(layout, time).filter(|_| stamps.is_some()) {
        headings[day] = "date".to_owned();
    }
    named.iter().zip(&free).for_each(|(name, k)| headings[*k] = (*name).to_owned());
    (!named.is_empty()).then_some(headings)
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
fn of(
    text: &str,
    kinds: &[Kind<'_>],
    kind: &Kind<'_>,
    (place, counters): (usize, &[usize]),
) -> Vec<Found> {
    let rows = kind.lines.join("\n") + "\n";
    let Some(mut layout) = Layout::of(&rows) else { return Vec::new() };
    let mut questions = Vec::new();
    // a number that counts the lines of all kinds is no time
    for cells in layout.rows.iter_mut() {
        (0..cells.len()).filter(|k| counters.contains(k)).for_each(|k| cells[k].clear());
    }
    let described = described(text, kinds, kind.name).filter(|_| place == 0);
    let headings = match described {
        Some(headings) if headings.len() == layout.width() => Some(headings),
        _ => {
            let mut content = || {
                let (headings, question) = content::headings(&layout)?;
                questions.push(question);
                Some(headings)
            };
            // a letter alone may be any word, and a magnetic field has a vector, too
            let field = words(kind.name).iter().any(|word| word.starts_with("mag"));
            match kind.name.len() {
                _ if field => None,
                1 => content().or_else(|| by_name(&layout, kind, place)),
                _ => by_name(&layout, kind, place).or_else(content),
            }
        }
    };
    let Some(mut headings) = headings else { return Vec::new() };
    headings[place] = "kind".to_owned();
    layout.headings = headings;
    layout.given = true;
    layout.skip = 0;
    layout.kind = vec![(place, kind.name.to_owned())];
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
/// the first one with a velocity. The other kinds are named if they are a `whole` file.
pub fn sensors(text: &str, whole: bool) -> Vec<Found> {
    let found = |place: usize| {
        let kinds = kinds(text, place);
        let counters: Vec<usize> = (0..PLACES).filter(|k| counts(text, *k)).collect();
        let described = kinds.iter().any(|kind| kind.name == DESCRIPTION);
        let wanted: &[&str] = if described { &SENSORS } else { &NAMED };
        let mut sensors: Vec<Found> = Vec::new();
        let (mut used, mut unused) = (0, Vec::new());
        for kind in kinds.iter().filter(|kind| kind.lines.len() > 1) {
            let before = sensors.len();
            for found in of(text, &kinds, kind, (place, &counters)) {
                match sensors.iter_mut().find(|known| known.kind == found.kind) {
                    _ if !wanted.contains(&found.kind) => {}
                    Some(known) if found.velocity && !known.velocity => *known = found,
                    Some(_) => {}
                    None => sensors.push(found),
                }
            }
            match sensors.len() > before {
                true => used += 1,
                false => unused.push(kind.name),
            }
        }
        if let Some(first) =
            sensors.first_mut().filter(|_| whole && !described && !unused.is_empty())
        {
            unused.truncate(NOTED);
            first.questions.push(format!("the rows of {} are not used", unused.join(", ")));
        }
        // rows of one width with a word before them may be one table; a word further on may be a status
        let several = sensors.len() > 1 || of_several_widths(&kinds);
        if several && (place == 0 || used > 1) { sensors } else { Vec::new() }
    };
    (0..PLACES).map(found).find(|sensors| !sensors.is_empty()).unwrap_or_default()
}
