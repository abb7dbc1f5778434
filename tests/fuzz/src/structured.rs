//! Damage of texts that keeps their structure: values, keys, rows and columns change as people and
//! programs change them. A reader understands a good share of such texts, so that more of it is
//! reached than the first error.

use navfuse_testing::damage::{Random, damaged};

/// Texts in the place of a number.
const NUMBERS: [&str; 22] = [
    "0",
    "1",
    "-1",
    "0.5",
    "-0.0",
    "45",
    "1e-9",
    "1e9",
    "1e308",
    "1e400",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "9007199254740993",
    "18446744073709551616",
    "+1",
    ".5",
    "5.",
    "1_000",
    "0x10",
    "",
];
/// Headings of columns of an IMU, in some of their units.
const HEADINGS: [&str; 12] = [
    "time_s",
    "time_ms",
    "time_us",
    "gyro_x_degps",
    "gyro_y_radps",
    "accel_x_g",
    "accel_z_mps2",
    "time",
    "x",
    "",
    "gyro_x_furlong",
    "accel_y_mgal",
];
/// Times in the place of seconds.
const TIMES: [&str; 6] = [
    "2022-06-01T08:30:00.5Z",
    "2022-06-01 08:30:01",
    "2022-06-31T00:00:00",
    "9999-12-31T23:59:60",
    "-0001-01-01T00:00:00",
    "08:30:00.25",
];
/// Quantities in the place of a text in TOML.
const QUANTITIES: [&str; 16] = [
    "1 m", "2 cm", "0.5 deg", "1 deg/h", "0 deg", "1 m/s", "10 ug", "1 mg", "1 %", "200 ppm",
    "1 h", "off", "imu", "", "1e400 m", "\\u0000",
];
/// Lines that a scenario may have.
const LINES: [&str; 14] = [
    "gate = \"off\"",
    "late = \"5 s\"",
    "time_offset = { sigma = \"0.1 s\" }",
    "exclude = [[\"1 s\", \"2 s\"]]",
    "simulation = { rate = \"10 Hz\" }",
    "type = \"dvl\"",
    "enabled = false",
    "[estimator]\ndraw = \"all\"",
    "[estimator]\noutput_rate = \"1 Hz\"\nstop = \"10 s\"",
    "[sensor.depth]\nnoise = \"1 cm\"",
    "[sensor.gnss]\nhorizontal_noise = \"1 m\"\nvertical_noise = \"2 m\"",
    "[sensor.second]\ntype = \"dvl\"\nnoise = [\"1 cm/s\", \"1 cm/s\", \"2 cm/s\"]",
    "[process.water]\ntype = \"water-current\"\ncurrent = { sigma = \"0.1 m/s\" }",
    "[sensor.reference]",
];

fn one<'a>(of: &[&'a str], random: &mut Random) -> &'a str {
    of[random.below(of.len())]
}

/// A text of the file, or else of the other one; `None` for files that are no text.
fn text<'a>(file: &'a [u8], other: &'a [u8]) -> Option<&'a str> {
    std::str::from_utf8(file).or_else(|_| std::str::from_utf8(other)).ok()
}

/// The numbers in a text, as ranges of bytes.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = text.as_bytes();
    let of_number = |b: u8| b.is_ascii_digit() || b == b'.';
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let from = at;
        while at < bytes.len() && of_number(bytes[at]) {
            at += 1;
        }
        // not the digits of a name such as mps2
        let named = from > 0 && (bytes[from - 1].is_ascii_alphabetic() || bytes[from - 1] == b'_');
        if at > from && !named {
            found.push(from..at);
        }
        at = at.max(from + 1);
    }
    found
}

/// Replaces one number: mostly by one of its size, else by one at a limit.
fn renumber(text: &mut String, random: &mut Random) {
    let found = numbers(text);
    if found.is_empty() {
        return;
    }
    let range = found[random.below(found.len())].clone();
    let new = match text[range.clone()].parse::<f64>() {
        Ok(number) if random.below(3) > 0 => {
            format!("{}", number * [0.5, 1.0, 1.001, 2.0, 10.0][random.below(5)])
        }
        _ => one(&NUMBERS, random).to_owned(),
    };
    text.replace_range(range, &new);
}

/// Damages a table with a line of headings.
pub fn table(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let Some(text) = text(file, other).filter(|_| random.below(8) > 0) else {
        return damaged(file, other, random);
    };
    let mut rows: Vec<Vec<String>> =
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let mut ending = "\n";
    let mut delimiter = ",";
    for _ in 0..=random.below(4) {
        if rows.is_empty() {
            break;
        }
        let (row, width) = (random.below(rows.len()), rows[0].len().max(1));
        let (a, b) = (random.below(width), random.below(width));
        let cell = random.below(rows[row].len());
        match random.below(18) {
            0..=2 => rows[row].iter_mut().skip(cell).take(1).for_each(|c| renumber(c, random)),
            3 => rows[row].iter_mut().skip(cell).take(1).for_each(|c| {
                *c = one(&NUMBERS, random).to_owned();
            }),
            4 => rows.iter_mut().filter(|r| r.len() > a.max(b)).for_each(|r| r.swap(a, b)),
            5 => rows.iter_mut().filter(|r| r.len() > a).for_each(|r| drop(r.remove(a))),
            6 => rows.iter_mut().filter(|r| r.len() > a).for_each(|r| r.push(r[a].clone())),
            7 => rows[0][a..].iter_mut().take(1).for_each(|h| {
                *h = one(&HEADINGS, random).to_owned();
            }),
            8 => rows.insert(row, rows[random.below(rows.len())].clone()),
            9 => drop(rows.remove(row)),
            10 => rows[row].truncate(cell),
            11 => rows[row].push(one(&NUMBERS, random).to_owned()),
            12 => rows[row].iter_mut().skip(cell).take(1).for_each(|c| *c = format!("\"{c}\"")),
            13 => rows.insert(row, vec![one(&["# text", "", "#", "\"", " "], random).to_owned()]),
            14 => ending = one(&["\r\n", "\r", "\n\n", "\n"], random),
            15 => delimiter = one(&[";", "\t", " ", ", "], random),
            16 => {
                // times that go on
                let last = rows[rows.len() - 1].clone();
                for k in 0..random.below(100) {
                    let time = format!("{}", 1.0 + 0.01 * k as f64);
                    let cells = last.iter().enumerate();
                    rows.push(cells.map(|(c, v)| if c == 0 { &time } else { v }.clone()).collect());
                }
            }
            _ => rows[row].iter_mut().take(1).for_each(|time| {
                *time = one(&TIMES, random).to_owned();
            }),
        }
    }
    let lines: Vec<String> = rows.iter().map(|row| row.join(delimiter)).collect();
    (lines.join(ending) + ending).into_bytes()
}

/// Damages a scenario.
pub fn scenario(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let Some(text) = text(file, other).filter(|_| random.below(8) > 0) else {
        return damaged(file, other, random);
    };
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=random.below(3) {
        if lines.is_empty() {
            break;
        }
        let line = random.below(lines.len());
        match random.below(12) {
            0..=4 => renumber(&mut lines[line], random),
            5 => {
                // one text between quotes
                let parts: Vec<&str> = lines[line].split('"').collect();
                let k = 2 * random.below(parts.len() / 2) + 1;
                let new = one(&QUANTITIES, random);
                let part = |i: usize, part: &str| if i == k { new } else { part }.to_owned();
                let parts: Vec<String> =
                    parts.iter().enumerate().map(|(i, p)| part(i, p)).collect();
                lines[line] = parts.join("\"");
            }
            6 => drop(lines.remove(line)),
            7 | 8 => lines.insert(line + 1, one(&LINES, random).to_owned()),
            9 => lines.push(one(&LINES, random).to_owned()),
            10 => {
                let other = random.below(lines.len());
                lines.swap(line, other);
            }
            _ => {
                let at = random.below(lines[line].len());
                if lines[line].is_char_boundary(at) {
                    lines[line].insert_str(at, one(&[" ", "#", "\"", "[", "=", "x", "é"], random));
                }
            }
        }
    }
    (lines.join("\n") + "\n").into_bytes()
}

/// Damages a definition in JSON.
pub fn definition(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let Some(text) = text(file, other).filter(|_| random.below(8) > 0) else {
        return damaged(file, other, random);
    };
    let mut text = text.to_owned();
    for _ in 0..=random.below(3) {
        let lines: Vec<&str> = text.lines().collect();
        match random.below(6) {
            0..=3 => renumber(&mut text, random),
            4 => {
                let line = random.below(lines.len());
                let kept = lines.iter().enumerate().filter(|(k, _)| *k != line);
                text = kept.map(|(_, l)| *l).collect::<Vec<_>>().join("\n");
            }
            _ => {
                let texts: Vec<&str> = text.split('"').collect();
                let k = 2 * random.below(texts.len() / 2) + 1;
                let new = one(&QUANTITIES, random);
                let all = texts.iter().enumerate().map(|(i, t)| if i == k { new } else { *t });
                text = all.collect::<Vec<_>>().join("\"");
            }
        }
    }
    text.into_bytes()
}
