//! Units from magnitudes: what the numbers of a table say about the units of its columns.
//!
//! Gravity decides the unit of the specific force. The rate at which gravity turns in the axes of
//! the body, `d u / dt = -w x u`, decides the unit of the angular rate where a vehicle tilts; else
//! the range of the rates and their noise do. Intervals and the date decide the unit of the time.

use navfuse_core::units::parse_unit;
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::RangeInclusive;

/// Standard gravity, m/s^2.
pub const GRAVITY: f64 = 9.806_65;
/// Range of a median norm, in units of gravity, that is gravity.
const NEAR: RangeInclusive<f64> = 0.8..=1.25;
/// Number of rows of a stretch whose norms are compared.
const QUIET: usize = 50;
/// Scatter of a norm, as a part of it, that is no gravity.
const LOOSE: f64 = 0.5;
/// Radians of a degree.
const DEGREE: f64 = PI / 180.0;
/// Rates beyond this are no rad/s of a vehicle: 2000 deg/s, the range of common gyros.
const RANGE: f64 = 35.0;
/// Spread of rates, rad/s, that no vehicle keeps up.
const SPREAD: f64 = 2.0;
/// Noise from sample to sample, rad/s, that few gyros exceed: 0.5 deg/s.
const NOISE: f64 = 8e-3;
/// Length of the means by which gravity is followed, s.
const BLOCK: f64 = 0.25;
/// Units of rates that the turn of gravity tells apart, and the largest logarithm of their ratio to it.
const TURNS: [&str; 5] = ["rad/s", "deg/s", "mrad/s", "deg/(1000*s)", "deg/h"];
const CLOSE: f64 = 1.1;
/// Correlation from which the turn of gravity decides.
const CORRELATED: f64 = 0.6;
/// Counts of one g in the ranges of usual accelerometers, and the largest factor between them and a norm that is gravity.
const COUNTS: [u32; 7] = [16_384, 8_192, 4_096, 2_048, 512, 256, 32_768];
const NEAR_COUNTS: f64 = 1.1;
/// Counts of one deg/s in the ranges of usual gyros, of InvenSense and Bosch, and of ST; one for rates in deg/s.
pub const RATE_COUNTS: [f64; 10] =
    [1.0, 131.0, 65.5, 32.8, 16.4, 262.4, 114.286, 57.143, 28.571, 14.286];
/// The largest rate of usual gyros, deg/s: larger numbers are counts.
const FASTEST: f64 = 2_000.0;
/// Usual intervals of an IMU and of an aiding sensor, s.
pub const IMU_INTERVAL: f64 = 0.01;
pub const AID_INTERVAL: f64 = 0.3;
/// Seconds since 1970 of the years 2000 and 2050, and of GPS time in the same years.
const UNIX: RangeInclusive<f64> = 9.4e8..=2.6e9;
/// Intervals that a recording can have, s.
const STEP: RangeInclusive<f64> = 1e-5..=1e3;
/// Units of a time with their factors.
const TIMES: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Units of a time whose steps are shorter than any of an IMU in seconds, and the part of a usual step that is
/// too short.
const SLOW_TIMES: [(&str, f64); 2] = [("min", 60.0), ("h", 3600.0)];
const SHORTEST: f64 = 2e-3;

/// A unit and the reason for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Decided {
    /// A unit expression.
    pub unit: String,
    /// The evidence, for a message.
    pub why: String,
    /// How much the numbers decide.
    pub evidence: Evidence,
}

/// The weight of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Evidence {
    /// The unit is assumed.
    None,
    /// The unit is likely; a heading with another one is right.
    Weak,
    /// Another unit is not possible.
    Strong,
}

fn decided(unit: &str, why: String, evidence: Evidence) -> Decided {
    Decided { unit: unit.to_owned(), why, evidence }
}

/// The unit of a quantity: the stated one, unless the numbers contradict it. A question names a
/// unit that no heading states.
pub fn settle(
    subject: &str,
    stated: Option<String>,
    shown: Decided,
    contradicted: bool,
    questions: &mut Vec<String>,
) -> String {
    let Decided { unit, why, evidence } = shown;
    match stated {
        Some(stated) if contradicted && !same(&stated, &unit) => {
            questions
                .push(format!("{subject}: its heading means {stated}, but {why}: {unit} is used"));
            unit
        }
        Some(stated) => stated,
        None => {
            let verb = if evidence == Evidence::Strong { "shown" } else { "assumed" };
            questions.push(format!("the unit of {subject}: {unit} is {verb} ({why})"));
            unit
        }
    }
}

/// Tests whether two units have the same size, within 3 %.
pub fn same(a: &str, b: &str) -> bool {
    (factor(a) / factor(b) - 1.0).abs() < 0.03
}

/// The factor of a unit to SI; NaN for an unknown unit, which nothing fits.
pub fn factor(unit: &str) -> f64 {
    parse_unit(unit).map_or(f64::NAN, |u| u.to_si(1.0))
}

pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Rows of three columns.
pub fn rows(columns: [&[f64]; 3]) -> Vec<[f64; 3]> {
    let [x, y, z] = columns;
    x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]).collect()
}

/// The mean norm of the stretch of rows in which it scatters least.
fn quietest(forces: &[[f64; 3]]) -> f64 {
    let scatter = |rows: &[[f64; 3]]| {
        let norms: Vec<f64> =
            rows.iter().map(|f| norm(*f)).filter(|size| size.is_finite()).collect();
        let mean = norms.iter().sum::<f64>() / norms.len() as f64;
        let spread = norms.iter().map(|size| (size - mean).powi(2)).sum::<f64>();
        (mean, spread / norms.len() as f64)
    };
    let stretches =
        forces.chunks(QUIET).filter(|rows| rows.len() == QUIET || rows.len() == forces.len());
    let best =
        stretches.map(scatter).filter(|(mean, spread)| mean.is_finite() && spread.is_finite());
    best.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(f64::NAN, |(mean, _)| mean)
}

/// The unit of specific forces, and `true` for increments; `interval` in s.
///
/// # Errors
/// With the norm that is no gravity in any unit.
pub fn accel(forces: &[[f64; 3]], interval: f64) -> Result<(Decided, bool), String> {
    let middle = median(forces.iter().map(|f| norm(*f)));
    let candidates = [
        ("m/s^2", GRAVITY, false),
        ("g", 1.0, false),
        ("m/s", GRAVITY * interval, true),
        ("g*s", interval, true),
        ("mg", 1000.0, false),
        ("cm/s^2", 100.0 * GRAVITY, false),
        ("ft/s^2", GRAVITY / 0.3048, false),
        ("ug", 1e6, false),
    ];
    let fits = |(_, gravity, _): &&(&str, f64, bool)| NEAR.contains(&(middle / gravity));
    let found = candidates.iter().find(fits);
    // mg and cm/s^2 differ by 2 %, and the median norm of a vehicle that drives by 1 %
    let quiet = quietest(forces);
    let distance = |gravity: f64| (quiet / gravity).ln().abs();
    let nearer =
        |unit: &str| candidates.iter().find(|c| c.0 == unit && distance(c.1) < distance(1e3));
    let found = found
        .and_then(|first| (first.0 == "mg").then(|| nearer("cm/s^2")).flatten().or(Some(first)));
    let whole = forces.iter().flatten().all(|f| !f.is_finite() || f.fract() == 0.0);
    let counts = |count: &&u32| {
        whole && (1.0 / NEAR_COUNTS..NEAR_COUNTS).contains(&(middle / f64::from(**count)))
    };
    let scatter = median(forces.iter().map(|f| (norm(*f) - middle).abs())) / middle;
    if let Some(count) = COUNTS.iter().find(counts).filter(|_| scatter < LOOSE && found.is_none()) {
        let why = format!("whole numbers with a median norm of {middle:.0} are counts");
        return Ok((decided(&format!("g/{count}"), why, Evidence::Weak), false));
    }
    let Some((unit, _, increments)) = found.filter(|_| scatter < LOOSE) else {
        let cause = match middle {
            m if m < 0.3 * GRAVITY => {
                "is gravity removed from them? The filter needs it: record the acceleration with gravity, or write \
                  the gravity of its own file beside them, under gravity_x to gravity_z"
            }
            m if m > 500.0 => "are they raw counts? The scale of the sensor is needed",
            _ => "check their columns",
        };
        return Err(format!(
            "the specific forces have a median norm of {middle:.4}, which is gravity in none of \
             m/s^2, g, mg or increments: {cause}"
        ));
    };
    let why = format!("the median norm {middle:.4} is gravity");
    Ok((decided(unit, why, Evidence::Strong), *increments))
}

/// Tests whether gravity turns against these rates.
pub fn turns_gravity(times: &[f64], rates: &[[f64; 3]], forces: &[[f64; 3]]) -> bool {
    by_gravity(times, rates, forces).is_some()
}

/// The factor of rates to rad/s by the turn of gravity, where the vehicle tilts enough.
fn by_gravity(times: &[f64], rates: &[[f64; 3]], forces: &[[f64; 3]]) -> Option<f64> {
    let mut blocks: Vec<(f64, [f64; 3], [f64; 3])> = Vec::new();
    let (mut end, mut count, mut sums) = (f64::NEG_INFINITY, 0.0, [0.0; 7]);
    for ((t, w), f) in times.iter().zip(rates).zip(forces) {
        let row = [*t, w[0], w[1], w[2], f[0], f[1], f[2]];
        if !row.iter().all(|x| x.is_finite()) {
            continue;
        }
        if *t >= end && count > 0.0 {
            let [t, w @ .., x, y, z] = sums.map(|s: f64| s / count);
            let size = norm([x, y, z]);
            blocks.push((t, w, [x / size, y / size, z / size]));
            (count, sums) = (0.0, [0.0; 7]);
        }
        if count == 0.0 {
            end = t + BLOCK;
        }
        count += 1.0;
        sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
    }
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for [(t, w, u), (t1, w1, u1)] in blocks.array_windows() {
        let mean: [f64; 3] = std::array::from_fn(|k| 0.5 * (w[k] + w1[k]) * (t1 - t));
        let turn = [
            u[1] * mean[2] - u[2] * mean[1],
            u[2] * mean[0] - u[0] * mean[2],
            u[0] * mean[1] - u[1] * mean[0],
        ];
        for k in 0..3 {
            let change = u1[k] - u[k];
            (xy, xx, yy) = (xy + turn[k] * change, xx + turn[k] * turn[k], yy + change * change);
        }
    }
    let correlation = xy.abs() / (xx * yy).sqrt();
    (blocks.len() > 20 && correlation > CORRELATED).then(|| (yy / xx).sqrt())
}

/// The unit of rates with these counts of one deg/s.
pub fn counted(per_degree: f64) -> String {
    match per_degree {
        1.0 => "deg/s".to_owned(),
        whole if whole.fract() == 0.0 => format!("deg/({whole}*s)"),
        other => {
            // 262.4 is 1312 / 5, and 114.286 is 800 / 7
            let whole = |q: &&u8| {
                (f64::from(**q) * other).fract().min(1.0 - (f64::from(**q) * other).fract()) < 0.01
            };
            let q = [2, 5, 7, 10].iter().find(whole).copied().unwrap_or(1);
            format!("{q}*deg/({:.0}*s)", f64::from(q) * other)
        }
    }
}

/// The counts of one deg/s that are nearest to a number of them.
pub fn nearest_counts(per_degree: f64) -> f64 {
    let distance = |count: &f64| (per_degree / count).ln().abs();
    let nearest = RATE_COUNTS.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.copied().unwrap_or(1.0)
}

/// The unit of angular rates beside specific forces that are counts: by the turn of gravity, else a guess.
pub fn counted_gyro(times: &[f64], rates: &[[f64; 3]], forces: &[[f64; 3]]) -> Decided {
    let largest = rates.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
    if let Some(factor) = by_gravity(times, rates, forces) {
        let why = "gravity turns at this rate in the axes of the IMU";
        let unit = counted(nearest_counts(DEGREE / factor));
        return decided(&unit, why.to_owned(), Evidence::Strong);
    }
    let unit = counted(if largest > FASTEST { 131.0 } else { 1.0 });
    decided(&unit, format!("rates up to {largest:.0} beside counts"), Evidence::None)
}

/// The unit of angular rates, with the specific forces in any unit; `in_g` if it is g.
pub fn gyro(times: &[f64], rates: &[[f64; 3]], forces: &[[f64; 3]], in_g: bool) -> Decided {
    let unit = |degrees: bool| if degrees { "deg/s" } else { "rad/s" };
    let largest = rates.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
    let by_turn = by_gravity(times, rates, forces);
    let distance = |unit: &&&str, size: f64| (size / factor(unit)).ln().abs();
    let nearest = by_turn.and_then(|size| {
        let units = TURNS.iter().min_by(|a, b| distance(a, size).total_cmp(&distance(b, size)));
        units.filter(|unit| distance(unit, size) < CLOSE)
    });
    if let Some(unit) = nearest.filter(|unit| **unit != "rad/s" || largest <= RANGE) {
        let why = "gravity turns at this rate in the axes of the IMU";
        return decided(unit, why.to_owned(), Evidence::Strong);
    }
    if largest > 1.2 * FASTEST {
        let why = format!("rates up to {largest:.0} are no deg/s");
        return decided("deg/(1000*s)", why, Evidence::None);
    }
    if largest > RANGE {
        let why = format!("rates up to {largest:.0} are no rad/s");
        return decided(unit(true), why, Evidence::Strong);
    }
    let axis = |k: usize| rates.iter().map(move |w| w[k]);
    let spread = |k: usize| {
        let middle = median(axis(k));
        median(axis(k).map(|w| (w - middle).abs()))
    };
    let spread = (0..3).map(spread).fold(0.0, f64::max);
    if spread > SPREAD {
        let why = format!("no vehicle keeps up a spread of {spread:.1} rad/s");
        return decided(unit(true), why, Evidence::Strong);
    }
    // the noise from sample to sample; a data sheet in g has deg/s, too
    let differences = |k: usize| rates.windows(2).map(move |w| (w[1][k] - w[0][k]).abs());
    let noise = (0..3).map(|k| median(differences(k)) / 0.954).fold(0.0, f64::max);
    let limit = if in_g { 0.3 * NOISE } else { NOISE };
    let clear = noise > 3.0 * limit || noise < limit / 3.0;
    let evidence = if clear { Evidence::Weak } else { Evidence::None };
    decided(unit(noise > limit), format!("the noise of the rates is {noise:.1e}"), evidence)
}

/// The usual step from row to row: the median, or the mean where most rows have the stamp of the row before, as
/// samples that arrive in one message do.
pub fn step(values: &[f64]) -> f64 {
    let usual = median(values.windows(2).map(|v| v[1] - v[0]));
    let ends = || values.iter().find(|v| v.is_finite()).zip(values.iter().rfind(|v| v.is_finite()));
    let mean = || ends().map_or(usual, |(first, last)| (last - first) / (values.len() - 1) as f64);
    if usual == 0.0 { mean() } else { usual }
}

/// The unit of a time: by the date if it has one, else by the usual interval.
pub fn time(values: &[f64], usual: f64) -> Option<Decided> {
    let first = values.iter().copied().find(|v| v.is_finite())?;
    let last = values.iter().rev().copied().find(|v| v.is_finite())?;
    let step = step(values);
    // a date in nanoseconds of a clock that counts from its start has no possible interval
    let possible = |factor: f64| step <= 0.0 || step.is_nan() || STEP.contains(&(step * factor));
    let dated = |(_, factor): &&(&str, f64)| UNIX.contains(&(last * factor)) && possible(*factor);
    if let Some((unit, _)) = TIMES.iter().find(dated) {
        let why = format!("{first} is a date in {unit} since 1970");
        return Some(decided(unit, why, Evidence::Strong));
    }
    if step.is_nan() || step <= 0.0 {
        return None;
    }
    let distance = |factor: f64| (step * factor / usual).ln().abs();
    let (unit, factor) = TIMES.iter().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)))?;
    // a count in hours has steps that no IMU has in seconds
    let slow = SLOW_TIMES.iter().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
    let (unit, factor) = match slow {
        Some((unit, factor)) if step < SHORTEST * usual => (unit, factor),
        _ => (unit, factor),
    };
    let rate = 1.0 / (step * factor);
    let why = format!("the interval {step:.6} gives {rate:.4} Hz");
    let mut others: Vec<f64> = TIMES.iter().map(|t| distance(t.1)).collect();
    others.sort_by(f64::total_cmp);
    // a factor of a thousand lies between the units; in its middle nothing decides
    let clear = others[1] - others[0] > 1.5;
    Some(decided(unit, why, if clear { Evidence::Weak } else { Evidence::None }))
}

/// The unit of the velocities of a log by their size: none is faster than 12 m/s.
pub fn speed(velocities: &[[f64; 3]]) -> &'static str {
    let usual = |v: &&[f64; 3]| v.iter().all(|x| x.is_finite() && x.abs() < 32_000.0);
    let mut sizes: Vec<f64> = velocities.iter().filter(usual).map(|v| norm(*v)).collect();
    sizes.sort_by(f64::total_cmp);
    match sizes.get(sizes.len() * 9 / 10) {
        Some(fast) if *fast > 300.0 => "mm/s",
        Some(fast) if *fast > 12.0 => "cm/s",
        _ => "m/s",
    }
}

/// The largest height of a vehicle, m, and the usual step from fix to fix beyond which heights are no metres.
const HIGHEST: f64 = 9_000.0;
const STEPS: f64 = 30.0;

/// Parts of a degree that programs count, from the largest.
const PARTS: [f64; 3] = [E7, 1e-8, 1e-9];
/// Degrees of the integers of latitudes and longitudes: 1e-7, and semicircles, 2^31 of which are 180.
pub const E7: f64 = 1e-7;
pub const SEMICIRCLE: f64 = 180.0 / 2_147_483_648.0;

/// Tests whether whole numbers of a height are millimetres: they are too large for metres, or no fixes are so far from
/// each other in metres.
pub fn in_millimetres(heights: &[f64]) -> bool {
    let largest = heights.iter().filter(|h| h.is_finite()).fold(0.0, |a: f64, h| a.max(h.abs()));
    let steps = heights.windows(2).map(|h| (h[1] - h[0]).abs()).filter(|step| *step > 0.0);
    largest > HIGHEST || median(steps) > STEPS
}

/// Tests whether the largest latitude and longitude may be minutes of an arc.
pub fn in_minutes(lat: f64, lon: f64) -> bool {
    lat <= 90.0 * 60.0 && lon <= 180.5 * 60.0
}

/// The unit of latitudes and longitudes: a unit, a factor, and `true` for ddmm.mmmm.
pub fn angle(latitudes: &[f64], longitudes: &[f64]) -> (&'static str, f64, bool) {
    let largest = |values: &[f64]| {
        values.iter().filter(|v| v.is_finite()).fold(0.0, |a: f64, b| a.max(b.abs()))
    };
    let (lat, lon) = (largest(latitudes), largest(longitudes));
    let minutes = |values: &[f64]| values.iter().all(|v| !v.is_finite() || v.abs() % 100.0 < 60.0);
    let within = |part: f64| lat * part <= 90.0 && lon * part <= 180.5;
    if !within(E7) && within(SEMICIRCLE) {
        ("deg", SEMICIRCLE, false)
    } else if !within(E7) {
        let part = PARTS.into_iter().find(|part| within(*part));
        ("deg", part.unwrap_or(SEMICIRCLE), false)
    } else if lat > 9_100.0 || lon > 18_100.0 {
        ("deg", E7, false)
    } else if (lat > 91.0 || lon > 361.0) && minutes(latitudes) && minutes(longitudes) {
        ("deg", 1.0, true)
    } else if (lat > 91.0 || lon > 361.0) && in_minutes(lat, lon) {
        ("arcmin", 1.0, false)
    } else if lat <= FRAC_PI_2 && lon <= PI && lat > 0.0 {
        ("rad", 1.0, false)
    } else {
        ("deg", 1.0, false)
    }
}
