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

/// Sentences of instruments, with the name in the cell behind that of their maker, and their headings: Rowe (DVL/ADCP
/// User Guide) and Exail (PHINS, interface library).
const SENTENCES: [(&str, &str, &[&str]); 3] = [
    (
        "$PRTI01",
        "",
        &["time [10*ms]", "ping", "temperature", "vel_x [mm/s]", "vel_y [mm/s]", "vel_z [mm/s]"],
    ),
    ("$PIXSE", "LOGIN_", &["vel_x [m/s]", "vel_y [m/s]", "vel_z [m/s]", "misalignment", "UTC"]),
    ("$PIXSE", "DEPIN_", &["depth [m]", "UTC"]),
];

/// The rows of one kind.
struct Kind<'a> {
    name: &'a str,
    /// Name of a sentence behind that of the maker, or nothing.
    part: &'a str,
    lines: Vec<&'a str>,
}

impl Kind<'_> {
    /// The headings of a known sentence, behind its name.
    fn sentence(&self) -> Option<&'static [&'static str]> {
        let found =
            SENTENCES.iter().find(|(maker, part, _)| (*maker, *part) == (self.name, self.part));
        found.map(|(.., headings)| *headings)
    }
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
        let makes = SENTENCES.iter().any(|(maker, part, _)| *maker == name && !part.is_empty());
        let part = if makes { cells(line).get(place + 1).copied().unwrap_or("") } else { "" };
        match kinds.iter().position(|kind| kind.name == name && kind.part == part) {
            Some(k) => kinds[k].lines.push(line),
            None if kinds.len() < KINDS => kinds.push(Kind { name, part, lines: vec![line] }),
            None => return Vec::new(),
        }
    }
    let several = kinds.iter().filter(|kind| kind.lines.len() > 1).count() > 1
        || kinds.iter().any(|kind| kind.sentence().is_some());
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
    let described = kind.sentence().map_or(described, |sentence| {
        let names = (0..=place + usize::from(!kind.part.is_empty())).map(|k| format!("word_{k}"));
        let known = names.chain(sentence.iter().map(|heading| (*heading).to_owned()));
        let others = (0..).map(|k| format!("column_{k}"));
        Some(known.chain(others).take(layout.width()).collect())
    });
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
    if !kind.part.is_empty() {
        layout.kind.push((place + 1, kind.part.to_owned()));
    }
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
                false => unused.push([kind.name, kind.part].join(" ").trim_end().to_owned()),
            }
        }
        if let Some(first) =
            sensors.first_mut().filter(|_| whole && !described && !unused.is_empty())
        {
            unused.truncate(NOTED);
            first.questions.push(format!("the rows of {} are not used", unused.join(", ")));
        }
        // rows of one width with a word before them may be one table; a word further on may be a status
        let known = kinds.iter().any(|kind| kind.sentence().is_some());
        let several = sensors.len() > 1 || known || of_several_widths(&kinds);
        if several && (place == 0 || used > 1) { sensors } else { Vec::new() }
    };
    (0..PLACES).map(found).find(|sensors| !sensors.is_empty()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::sensors;

    /// The kinds of the sensors in lines, with their keys.
    fn found(line: &dyn Fn(usize) -> String) -> Vec<(&'static str, String)> {
        let text: String = (0..60).map(line).collect();
        sensors(&text, true).into_iter().map(|f| (f.kind, f.source.join("\n"))).collect()
    }

    #[test]
    fn the_bottom_track_of_rowe_is_a_velocity_log_in_mm_per_second() {
        let line = |k: usize| {
            let bad = k % 20 == 9;
            let [x, y, z] = if bad { [-99_999; 3] } else { [1200 + k as i32, 35, -12] };
            format!("$PRTI01,{},{k},1468,{x},{y},{z},12000,,,,,0000,0,0*1A\n", 379_550 + 20 * k)
        };
        let log = &found(&line)[0];
        assert_eq!(log.0, "dvl");
        for key in [
            "unit = \"10*ms\"",
            "columns.vel_x = { column = \"vel_x [mm/s]\", unit = \"mm/s\" }",
            "missing = [-99999.0]",
            "rows = { \"kind\" = \"$PRTI01\" }",
        ] {
            assert!(log.1.contains(key), "{}", log.1);
        }
    }

    #[test]
    fn the_sentences_of_a_phins_are_a_velocity_log_and_a_depth() {
        let line = |k: usize| {
            let time = format!("2213{:02}.{:02}0000", 10 + k / 5, 20 * (k % 5));
            format!(
                "$PIXSE,TIME__,{time}*6B\n$PIXSE,LOGIN_,1.4{k},0.039,0.033,0.000,{time}*67\n\
                 $PIXSE,DEPIN_,73{}.811,{time}*7D\n",
                k % 9
            )
        };
        let found = found(&line);
        let kinds: Vec<&str> = found.iter().map(|(kind, _)| *kind).collect();
        assert_eq!(kinds, ["dvl", "depth"]);
        let rows = "rows = { \"kind\" = \"$PIXSE\", \"word_1\" = \"LOGIN_\" }";
        assert!(found[0].1.contains(rows), "{}", found[0].1);
        assert!(found[0].1.contains("format = \"time-of-day\""), "{}", found[0].1);
    }
}
