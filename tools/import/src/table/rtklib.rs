//! Solutions of RTKLIB: their times and positions in any of its forms.

use super::layout::Layout;
use crate::class;
use crate::found::Found;
use navfuse_core::document::quoted;

/// The titles with the headings of the channels. The deviation to the north stands for both
/// horizontal ones; `vu` points up and is turned.
const TITLES: [(&str, &str); 9] = [
    ("latitude(deg)", "lat_deg"),
    ("longitude(deg)", "lon_deg"),
    ("height(m)", "height_m"),
    ("sdn(m)", "h_acc_m"),
    ("sdu(m)", "v_acc_m"),
    ("sdx(m)", "sdx"),
    ("vn(m/s)", "vel_n_mps"),
    ("ve(m/s)", "vel_e_mps"),
    ("vu(m/s)", "vu(m/s)"),
];
/// Titles of angles in degrees, minutes and seconds, each of which stands over three columns.
const SEXAGESIMAL: [(&str, &str); 2] = [("latitude(d'\")", "lat"), ("longitude(d'\")", "lon")];
/// Seconds of a week.
const WEEK: f64 = 604_800.0;
/// Title of the first of the coordinates of Earth-fixed axes.
const EARTH_FIXED: &str = "x-ecef(m)";

/// The titles of a solution in degrees, which a receiver may leave out.
const USUAL: &str = "GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) \
                     age(s) ratio";

/// Number of lines in which the first row of a solution without titles is looked for.
const FIRST: usize = 100;

/// The titles of a solution, in the last comment before its rows, and its separator.
fn titles(beginning: &str) -> Option<(Vec<&str>, Option<char>)> {
    let comments = beginning.lines().take_while(|line| line.starts_with('%'));
    let known = |line: &&str| {
        ["latitude(deg)", SEXAGESIMAL[0].0, EARTH_FIXED].iter().any(|title| line.contains(title))
    };
    let line = comments.filter(known).last()?.trim_start_matches('%');
    let separator = [';', ','].into_iter().find(|c| line.contains(*c));
    let titles = match separator {
        Some(c) => line.split(c).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    };
    Some((titles, separator))
}

/// Tests whether a table without titles has the columns of a solution: stamp, position, quality, number of satellites, and
/// deviations.
fn untitled(layout: &Layout) -> bool {
    let columns: Vec<Vec<f64>> = (0..layout.width()).map(|k| layout.column(k)).collect();
    if !layout.headings.is_empty() || columns.len() != USUAL.split_whitespace().count() + 1 {
        return false;
    }
    let all = |k: usize, fits: &dyn Fn(f64) -> bool| columns[k].iter().all(|v| fits(*v));
    let whole = |k: usize, most: f64| all(k, &|v| v.fract() == 0.0 && (0.0..=most).contains(&v));
    let dated =
        layout.rows.iter().all(|row| row[0].matches('/').count() == 2 && row[1].contains(':'));
    let stamped = dated || (whole(0, 1e4) && all(1, &|v| (0.0..=WEEK).contains(&v)));
    let place = all(2, &|v| v.abs() <= 90.0) && all(3, &|v| v.abs() <= 360.0);
    let deviations = (7..10).all(|k| all(k, &|v| (0.0..1e5).contains(&v)));
    stamped && place && whole(5, 7.0) && whole(6, 100.0) && deviations
}

/// The headings of the columns: one for each title, more where it stands over several.
fn headings(titles: &[&str]) -> Vec<String> {
    let mut headings = Vec::new();
    for title in titles {
        match SEXAGESIMAL.iter().find(|(name, _)| name == title) {
            Some((_, channel)) => {
                headings.extend(["deg", "min", "sec"].map(|part| format!("{channel} {part}")))
            }
            None => {
                let known = TITLES.iter().find(|(name, _)| name == title);
                headings.push(known.map_or(*title, |(_, heading)| heading).to_owned());
            }
        }
    }
    headings
}

/// A solution of RTKLIB; `None` if the text is none, or its rows do not fit its titles.
pub fn solution(beginning: &str) -> Option<Found> {
    let titled = titles(beginning);
    let wide = |line: &str| line.split_whitespace().count() == USUAL.split_whitespace().count() + 1;
    if titled.is_none() && !beginning.lines().take(FIRST).any(wide) {
        return None;
    }
    let layout = Layout::of(beginning)?;
    let own = titled.is_none();
    let usual = || untitled(&layout).then(|| (USUAL.split_whitespace().collect(), None));
    let (titles, separator) = titled.or_else(usual)?;
    let row = layout.rows.first()?;
    // the sexagesimal parts are separated by spaces, whatever the separator
    let scale = if titles.first()?.contains("UTC") { "utc" } else { "gps" };
    let dated = row.first()?.contains(['/', '-']);
    let whitespace = separator.is_none();
    let time = match (dated, whitespace) {
        (true, true) => ["date", "time"].as_slice(),
        (true, false) => &["time"],
        (false, _) => &["week", "time"],
    };
    let mut names: Vec<String> = time.iter().map(|name| (*name).to_owned()).collect();
    // one title, GPST or UTC, stands over date and time, or over week and seconds
    names.extend(match separator {
        Some(_) => titles[1..].iter().flat_map(|title| one_cell(title)).collect(),
        None => headings(&titles[1..]),
    });
    if names.len() != row.len() {
        return None;
    }
    let key = match (dated, whitespace) {
        (true, true) => "column = \"time\", date = \"date\"",
        (true, false) => "column = \"time\", format = \"date-time\"",
        (false, _) => "column = \"time\", unit = \"s\", week = \"week\"",
    };
    let delimiter = separator.map_or("whitespace".to_owned(), |c| c.to_string());
    let list: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    let mut source = vec![
        format!("delimiter = {}", quoted(&delimiter)),
        "comment = \"%\"".to_owned(),
        format!("headings = [{}]", list.join(", ")),
        format!("time = {{ {key}, scale = \"{scale}\" }}"),
    ];
    source.extend(columns(&names));
    let velocity = names.iter().any(|name| name == "vel_n_mps");
    // Q, whose place is the same in all rows
    let quality = names.iter().position(|name| name == "Q").map(|k| layout.column(k));
    let codes = quality.unwrap_or_default();
    let class = codes.into_iter().filter_map(|q| class::of(class::RTKLIB, q)).max();
    let text = "the columns are taken for a solution of RTKLIB in GPS time";
    let questions = if own { vec![text.to_owned()] } else { Vec::new() };
    Some(Found { kind: "gnss", source, questions, velocity, class, ..Found::default() })
}

/// The heading of a title whose column is one cell.
fn one_cell(title: &str) -> Vec<String> {
    match SEXAGESIMAL.iter().find(|(name, _)| *name == title) {
        Some((_, channel)) => vec![format!("{channel} deg")],
        None => headings(&[title]),
    }
}

/// The keys of the columns that their headings do not describe.
fn columns(names: &[String]) -> Vec<String> {
    let has = |name: &str| names.iter().any(|n| n == name);
    let mut keys = Vec::new();
    for channel in ["lat", "lon"].into_iter().filter(|c| has(&format!("{c} deg"))) {
        keys.push(format!(
            "columns.{channel} = {{ column = \"{channel} deg\", unit = \"deg\", \
             notation = \"degrees-minutes-seconds\" }}"
        ));
    }
    for channel in ["lat", "lon", "height"].into_iter().filter(|_| has(EARTH_FIXED)) {
        keys.push(format!(
            "columns.{channel} = {{ column = \"{EARTH_FIXED}\", notation = \"earth-fixed\" }}"
        ));
    }
    if has("vu(m/s)") {
        let column = "columns.vel_d = { column = \"vu(m/s)\", unit = \"m/s\", scale = -1 }";
        keys.push(column.to_owned());
    }
    keys
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn a_solution_has_dates_or_weeks_and_degrees_or_coordinates() {
        let rest = "height(m)   Q  ns\n";
        let place = "48.1 11.5";
        for (titles, row, keys) in [
            (
                format!("%  GPST latitude(deg) longitude(deg) {rest}"),
                format!("2023/11/14 22:13:20.000 {place} 500.0 1 12\n"),
                ["date = \"date\", scale = \"gps\"", "\"lat_deg\""],
            ),
            (
                format!("%  GPST latitude(deg) longitude(deg) {rest}"),
                format!("2288 166418.000 {place} 500.0 1 12\n"),
                ["week = \"week\", scale = \"gps\"", "\"lat_deg\""],
            ),
            (
                format!("%  UTC latitude(d'\") longitude(d'\") {rest}"),
                "2023/11/14 22:13:20.000 48 06 00.1 11 30 00.2 500.0 1 12\n".to_owned(),
                ["scale = \"utc\"", "notation = \"degrees-minutes-seconds\""],
            ),
            (
                "%  GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns\n".to_owned(),
                "2023/11/14 22:13:20.000 4182.1e3 850.2e3 4723.3e3 1 12\n".to_owned(),
                ["\"x-ecef(m)\"", "notation = \"earth-fixed\""],
            ),
            (
                "%  GPST ; latitude(deg);longitude(deg); height(m); Q; ns\n".to_owned(),
                "2023/11/14 22:13:20.000; 48.1; 11.5; 500.0; 1; 12\n".to_owned(),
                ["delimiter = \";\"", "format = \"date-time\""],
            ),
        ] {
            let found = solution(&format!("{titles}{}", row.repeat(3))).unwrap();
            let source = found.source.join("\n");
            assert!(keys.iter().all(|key| source.contains(key)), "{source}");
        }
        assert!(solution("% a remark\n1 2 3\n").is_none());
    }
}
