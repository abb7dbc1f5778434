//! A table without headings: its columns by their content.

use super::clock::{counts_rows, second_of_text};
use super::columns::{ACCEL, DTHETA, DVEL, GYRO};
use super::layout::Layout;
use super::place;
use super::units::{self, median};
use super::vocabulary::{meaning, words};

/// What is asked of a table whose columns have no headings.
pub const BY_CONTENT: &str = "named by their content";
/// Share of the steps of a time that must be near the usual one.
const EVEN: f64 = 0.8;
/// Distance of a median norm from gravity, as a part of it, that accelerometers keep.
const NEAR: f64 = 0.05;
/// Relative spread of a norm that is gravity.
const STEADY: f64 = 0.3;

/// Tests whether a column increases from row to row, at usual steps.
pub fn increases(values: &[f64]) -> bool {
    let steps: Vec<f64> = values.windows(2).map(|v| v[1] - v[0]).collect();
    let usual = median(steps.iter().copied());
    let even = steps.iter().filter(|s| **s > 0.0 && **s < 3.0 * usual).count();
    !steps.is_empty() && even as f64 >= EVEN * steps.len() as f64
}

/// Tests whether a column counts the rows, of which those of another sensor may be missing.
fn counts(values: &[f64]) -> bool {
    let ones = values.windows(2).filter(|v| v[1] - v[0] == 1.0).count();
    ones as f64 >= EVEN * (values.len() - 1) as f64 && values.iter().all(|v| v.fract() == 0.0)
}

/// The column with a date or a time of the day as text.
pub fn stamps(layout: &Layout) -> Option<usize> {
    let cells = |k: usize| layout.rows.iter().map(move |row| row.get(k).map_or("", String::as_str));
    let is_stamp = |k: &usize| {
        cells(*k).next().is_some_and(|cell| cell.contains(':'))
            && cells(*k).all(|cell| second_of_text(cell).is_finite())
    };
    (0..layout.width()).find(is_stamp)
}

/// The column before a time of the day that has its date.
pub fn day_before(layout: &Layout, time: usize) -> Option<usize> {
    let day = |cell: &String| ['/', '-', '.'].iter().any(|c| cell.matches(*c).count() == 2);
    let before = time.checked_sub(1)?;
    layout.rows.iter().all(|row| row.get(before).is_some_and(day)).then_some(before)
}

/// Tests whether a column has the nanoseconds of the whole seconds in the column before it.
fn wraps(columns: &[Vec<f64>], k: usize) -> bool {
    let (seconds, nanos) = (&columns[k - 1], &columns[k]);
    let whole =
        seconds.iter().all(|t| t.fract() == 0.0) && nanos.iter().all(|n| (0.0..1e9).contains(n));
    let pairs = || seconds.windows(2).zip(nanos.windows(2));
    let goes_on = pairs().all(|(t, n)| t[1] > t[0] || (t[1] == t[0] && n[1] > n[0]));
    whole && goes_on && pairs().any(|(t, n)| t[1] > t[0] && n[1] < n[0])
}

fn norms(columns: &[Vec<f64>], first: usize) -> Vec<f64> {
    let rows = units::rows([&columns[first], &columns[first + 1], &columns[first + 2]]);
    rows.iter().map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt()).collect()
}

/// Size of the mean of a vector, against its scatter from row to row.
fn lopsided(columns: &[Vec<f64>], first: usize) -> f64 {
    let axis = |k: usize| {
        let values = &columns[first + k];
        let middle = median(values.iter().copied());
        let scatter = median(values.windows(2).map(|v| (v[1] - v[0]).abs()));
        (middle.abs(), scatter)
    };
    let axes = [axis(0), axis(1), axis(2)];
    let sum = |part: fn(&(f64, f64)) -> f64| axes.iter().map(part).sum::<f64>();
    sum(|a| a.0) / sum(|a| a.1).max(1e-12)
}

/// The headings of a table without, of an inertial unit or of positions, and a question.
pub fn headings(layout: &Layout) -> Option<(Vec<String>, String)> {
    let names = names(layout)?;
    let question = format!("the columns are {BY_CONTENT}: {}", names.join(", "));
    Some((names, question))
}

/// The headings of a table without, of a time and three numbers, by the name of its file: `gyro.txt`.
pub fn by_file(layout: &Layout, name: &str) -> Option<(Vec<String>, String)> {
    let time = (layout.width() == 4 && increases(&layout.column(0))).then(|| "time".to_owned());
    let axes = |word: &String| {
        let names = ["x", "y", "z"].map(|axis| format!("{word} {axis}"));
        let channel = meaning(&names[0])?.channel;
        [GYRO[0], ACCEL[0]].contains(&channel).then_some(names)
    };
    let names = words(name).iter().filter(|word| word.len() > 2).find_map(axes)?;
    let names: Vec<String> = time.into_iter().chain(names).collect();
    let question =
        format!("the columns are {BY_CONTENT} and the name of the file: {}", names.join(", "));
    (names.len() == 4).then_some((names, question))
}

fn names(layout: &Layout) -> Option<Vec<String>> {
    let width = layout.width();
    let of_text = |k: usize| -> Vec<f64> {
        let cell = |row: &Vec<String>| row.get(k).map_or(f64::NAN, |cell| second_of_text(cell));
        layout.rows.iter().map(cell).collect()
    };
    let dated = stamps(layout);
    let column = |k: usize| if dated == Some(k) { of_text(k) } else { layout.column(k) };
    let columns: Vec<Vec<f64>> = (0..width).map(column).collect();
    let counter = |k: usize| layout.headings.get(k).is_some_and(|h| counts_rows(h, &columns[k]));
    let rising = (0..width).filter(|k| increases(&columns[*k]) && !counter(*k));
    let rising: Vec<usize> = rising.collect();
    let nanos = rising.iter().find(|k| **k > 0 && wraps(&columns, **k));
    let named = |k: &&usize| {
        let heading = layout.headings.get(**k);
        heading.and_then(|h| meaning(h)).is_some_and(|m| m.channel == "time")
    };
    let time = *nanos
        .or(dated.as_ref().filter(|k| rising.contains(*k)))
        .or_else(|| rising.iter().find(named))
        .or_else(|| rising.iter().find(|k| !counts(&columns[**k])))
        .or(rising.first())?;
    let factor = |usual: f64| match dated == Some(time) {
        true => Some(1.0),
        false => Some(units::factor(&units::time(&columns[time], usual)?.unit)),
    };
    let seconds = factor(units::IMU_INTERVAL)?;
    let step = median(columns[time].windows(2).map(|v| (v[1] - v[0]) * seconds));
    let free = |first: usize| (first..first + 3).all(|k| k != time);
    let change = |v: &[f64]| v[0] != v[1] && v[0].is_finite();
    let moves = |first: usize| (first..first + 3).all(|k| columns[k].windows(2).any(change));
    let apart = |first: usize| !(first..first + 3).any(|k| place::in_quaternion(&columns, k));
    let triples = || (0..width.saturating_sub(2)).filter(|k| free(*k) && moves(*k) && apart(*k));
    let gravity = |first: usize| {
        let norms = norms(&columns, first);
        let middle = median(norms.iter().copied());
        let spread = median(norms.iter().map(|n| (n - middle).abs())) / middle;
        let rows = units::rows([&columns[first], &columns[first + 1], &columns[first + 2]]);
        let (decided, increments) = units::accel(&rows, step).ok().filter(|_| spread < STEADY)?;
        // its distance from gravity: angles may have a norm near one by chance
        let per = if increments { step } else { 1.0 };
        let size = middle / per * units::factor(&decided.unit);
        let plain = decided.unit == "m/s^2";
        Some((increments, (size / units::GRAVITY).ln().abs(), plain))
    };
    let mut names: Vec<String> = (1..=width).map(|k| format!("column_{k}")).collect();
    match nanos {
        Some(_) => {
            names[time - 1..=time].clone_from_slice(&["sec".to_owned(), "nanosec".to_owned()])
        }
        None => names[time] = "time".to_owned(),
    }
    if let Some(k) = day_before(layout, time).filter(|_| dated == Some(time)) {
        names[k] = "date".to_owned();
    }
    let mut name = |first: usize, channels: [&str; 3]| {
        for (k, channel) in channels.iter().enumerate() {
            names[first + k] = (*channel).to_owned();
        }
    };
    let forces = || triples().filter_map(|k| Some((k, gravity(k)?)));
    // a heading near 1 rad has the norm of a force in g, but few numbers have the norm of one in m/s^2
    let near = || forces().filter(|(_, (_, distance, _))| *distance < NEAR);
    let plain = near().find(|(_, (.., plain))| *plain).or_else(|| near().next());
    let inertial = plain.or_else(|| forces().next()).map(|(k, (increments, ..))| (k, increments));
    let usual = if inertial.is_some() { units::IMU_INTERVAL } else { units::AID_INTERVAL };
    let unit = factor(usual)?;
    let seconds: Vec<f64> = columns[time].iter().map(|t| t * unit).collect();
    let place = (0..width.saturating_sub(2)).filter(|k| free(*k));
    let place = place.filter_map(|k| Some((k, place::order(&seconds, &columns, k)?)));
    let found = || place.clone().next();
    // beside an inertial unit, columns of angles may resemble a place
    let far = place.clone().find(|(k, _)| place::is_far(&columns, *k));
    let beside_place = |k: usize| found().is_none_or(|(place, _)| k.abs_diff(place) >= 3);
    let gyro = |accel: usize| {
        let beside = [accel.checked_sub(3), Some(accel + 3)].into_iter().flatten();
        let fits = |k: &usize| *k + 3 <= width && free(*k) && moves(*k) && apart(*k);
        let fits = beside.filter(fits).filter(|k| beside_place(*k));
        let least =
            |a: &usize, b: &usize| lopsided(&columns, *a).total_cmp(&lopsided(&columns, *b));
        let other = |k: &usize| k.abs_diff(accel) >= 3 && beside_place(*k);
        fits.min_by(least).or_else(|| triples().filter(other).min_by(least))
    };
    let inertial = inertial.filter(|(accel, _)| beside_place(*accel));
    let unit = inertial.and_then(|(accel, increments)| Some((accel, gyro(accel)?, increments)));
    let Some((accel, gyro, increments)) = unit else {
        let (first, channels) = found()?;
        name(first, channels);
        return Some(names);
    };
    name(accel, if increments { DVEL } else { ACCEL });
    name(gyro, if increments { DTHETA } else { GYRO });
    let apart = |k: usize| [accel, gyro].iter().all(|other| k.abs_diff(*other) >= 3);
    if let Some((first, channels)) = far.filter(|(k, _)| apart(*k)) {
        name(first, channels);
    }
    Some(names)
}
