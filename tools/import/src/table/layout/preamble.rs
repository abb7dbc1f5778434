//! Lines before the rows that resemble rows, and headings of unusual forms.

use super::{is_number, uncommented};

/// Share of the rows with a number in a column that then has no words, and the least number of rows.
const SHARE: f64 = 0.9;
const LEAST: usize = 20;
/// Number of columns from which a row that counts them is no sample.
const NUMBERED: usize = 4;

/// The number of rows of a preamble at the beginning, `Samples 100 100`: they have words in columns of numbers, or number
/// the columns.
pub(super) fn length(rows: &[(usize, Vec<String>)]) -> usize {
    let width = rows.first().map_or(0, |(_, row)| row.len());
    let number = |cell: &String| cell.is_empty() || navfuse_csv::is_absent(cell) || is_number(cell);
    let of_numbers = |k: &usize| {
        let count = rows.iter().filter(|(_, row)| row.get(*k).is_some_and(number)).count();
        count as f64 > SHARE * rows.len() as f64
    };
    if rows.len() < LEAST {
        return 0;
    }
    let columns: Vec<usize> = (0..width).filter(of_numbers).collect();
    let fits = |row: &[String]| columns.iter().all(|k| row.get(*k).is_some_and(number));
    let words = rows.iter().position(|(_, row)| fits(row)).unwrap_or(0);
    // a row that numbers the columns, as RaceStudio writes it below the units
    let numbers = |from: usize| {
        let row = &rows[words].1;
        width > NUMBERED && row.iter().enumerate().all(|(k, cell)| cell.parse() == Ok(k + from))
    };
    words + usize::from(numbers(1) || numbers(0))
}

/// Headings with one for the first column, where none of a table of R stands over it, and it counts the rows from one.
pub(super) fn with_row(headings: Vec<String>, rows: &[Vec<String>]) -> Vec<String> {
    let width = rows.first().map_or(0, Vec::len);
    let mut first = rows.iter().map(|row| row.first().map_or("", String::as_str)).enumerate();
    match headings.len() + 1 == width && first.all(|(k, cell)| cell.parse() == Ok(k + 1)) {
        true => [vec!["row".to_owned()], headings].concat(),
        false => headings,
    }
}

/// The headings that comments describe one by one, as Sea-Bird writes them: `# name 1 = prDM: Pressure, Digiquartz [db]`.
pub(super) fn described(before: &[&str], width: usize) -> Option<Vec<String>> {
    let heading = |line: &&str| -> Option<(usize, String)> {
        let (index, title) = uncommented(line)?.1.strip_prefix("name ")?.split_once('=')?;
        let title = title.split_once(':').map_or(title, |(_, title)| title);
        let name = title.split([',', '[']).next().unwrap_or_default().trim();
        // the unit follows a remark: `[salt water, m]`
        let unit = title.split_once('[').and_then(|(_, rest)| rest.split_once(']'));
        let unit = unit.and_then(|(unit, _)| unit.rsplit(',').next()).map(str::trim);
        let unit = unit.map_or_else(String::new, |unit| format!(" [{unit}]"));
        // it has subtracted the pressure of the air
        let name = if name == "Pressure" { "Sea Pressure" } else { name };
        Some((index.trim().parse().ok()?, format!("{name}{unit}")))
    };
    let found: Vec<(usize, String)> = before.iter().filter_map(heading).collect();
    let counts = found.iter().enumerate().all(|(k, (index, _))| k == *index);
    (found.len() == width && counts).then(|| found.into_iter().map(|(_, name)| name).collect())
}

/// Headings with the name of a vector over its first column and 1, 2 over the others, as gopro-telemetry writes them, with
/// the name and the axis over each.
pub(super) fn uncounted(headings: Vec<String>) -> Vec<String> {
    let mut found = headings.clone();
    for (first, name) in headings.iter().enumerate().filter(|(_, name)| !is_number(name)) {
        let others = headings[first + 1..].iter().zip(1..).take_while(|(h, k)| h.parse() == Ok(*k));
        match others.count() {
            0 => {}
            others => (0..=others).for_each(|k| found[first + k] = format!("{name} {k}")),
        }
    }
    found
}

/// Words for a point from which positions count.
const POINTS: [&str; 4] = ["origin", "datum", "reference", "lat0"];

/// The latitude, longitude (deg) and height (m) of a line such as `# origin: lat=48.1 lon=11.5 alt=500`.
pub(super) fn origin(line: &str) -> Option<[f64; 3]> {
    let line = line.to_lowercase();
    if !POINTS.iter().any(|word| line.contains(word)) {
        return None;
    }
    let number = |c: char| c.is_ascii_digit() || ['.', '-', '+'].contains(&c);
    // the digit of `lat0` is no number
    let words = line.split(|c: char| !c.is_alphanumeric() && !number(c));
    let numbers = words.filter(|word| word.starts_with(number)).map(|word| {
        let digits = word.trim_end_matches(|c: char| c.is_alphabetic());
        digits.parse::<f64>().ok()
    });
    let [lat, lon, height] = *numbers.collect::<Option<Vec<f64>>>()?.as_slice() else {
        return None;
    };
    let place = lat.abs() <= 90.0 && lon.abs() <= 360.0 && lat.fract() != 0.0 && height.is_finite();
    place.then_some([lat, lon, height])
}

/// The zone of UTM of a line such as `# EPSG:32632`, or `# UTM zone 32N`.
pub(super) fn zone(line: &str) -> Option<String> {
    let line = line.to_lowercase();
    let digits = |text: &str| -> String {
        text.trim_start_matches([':', ' ', '=']).chars().take_while(char::is_ascii_digit).collect()
    };
    if let Some((_, rest)) = line.split_once("epsg") {
        let code: u32 = digits(rest).parse().ok()?;
        let side = match code / 100 {
            326 => 'N',
            327 => 'S',
            _ => return None,
        };
        return (1..=60).contains(&(code % 100)).then(|| format!("{}{side}", code % 100));
    }
    let (_, rest) = line.split_once("utm")?;
    let rest = rest.trim_start_matches([':', ' ', '=']);
    let rest = rest.strip_prefix("zone").unwrap_or(rest).trim_start_matches([':', ' ', '=']);
    let number = digits(rest);
    let side =
        rest[number.len()..].trim_start().chars().next().filter(|c| ['n', 's'].contains(c))?;
    let zone: u8 = number.parse().ok()?;
    (1..=60).contains(&zone).then(|| format!("{zone}{}", side.to_ascii_uppercase()))
}

/// The rate in Hz of a line such as `# Sample Rate: 100.0Hz`.
pub(super) fn rate(line: &str) -> Option<f64> {
    let line = line.to_lowercase();
    let (before, _) = line.split_once("hz")?;
    let digits = |c: char| c.is_ascii_digit() || c == '.';
    let number = before.trim_end().rsplit(|c| !digits(c)).next()?;
    let named = ["rate", "freq", "sampl"].iter().any(|word| line.contains(word));
    number.parse().ok().filter(|rate: &f64| named && *rate > 0.0 && rate.is_finite())
}
