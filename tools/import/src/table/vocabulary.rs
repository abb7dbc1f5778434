//! One vocabulary of headings: the words of many programs for the channels of sensors.

mod heights;
mod languages;
mod lists;
mod vectors;

use heights::{height, is_zero};
use languages::{english, plain};
use lists::{BEHIND, FOLLOWING, LOG, NOISE, OTHERS, SCALARS};
use navfuse_core::units::{Unit, column_suffix, parse_unit, suffix_expression};
use vectors::{AXES, OWN_AXES, VECTORS};

/// The quantity of a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Meaning {
    /// Channel of a sensor, `time`, or `week`.
    pub channel: &'static str,
    /// Unit in the heading, as a unit expression.
    pub unit: Option<String>,
    /// -1 for an axis that points the other way, 2 for half of an angle.
    pub sign: f64,
    /// Place among the words for the channel: the first is the best.
    pub rank: usize,
}

/// A heading in words: lower case, without separators and accents.
pub fn words(heading: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    let mut letters = heading.chars().peekable();
    while let Some(c) = letters.next() {
        let begins = before.is_uppercase() && letters.peek().is_some_and(|c| c.is_lowercase());
        let turns =
            c.is_uppercase() && (before.is_lowercase() || before.is_ascii_digit() || begins);
        if !c.is_alphanumeric() || turns {
            words.push(String::new());
        }
        if c.is_alphanumeric() {
            words.iter_mut().last().into_iter().for_each(|w| w.extend(c.to_lowercase().map(plain)));
        }
        before = c;
    }
    words.retain(|w| !w.is_empty());
    words
}

/// The units that programs write, as an expression.
pub fn expression(text: &str) -> Option<String> {
    let clean = text.trim().trim_matches(['(', ')', '[', ']', '{', '}']).trim();
    // the zero of a height, as in `ft msl`
    let zero = clean.rsplit_once(' ').filter(|(_, zero)| is_zero(&zero.to_lowercase()));
    let clean = zero.map_or(clean, |(unit, _)| unit.trim());
    let known =
        match clean.to_ascii_lowercase().as_str() {
            "g" | "gee" => Some("g"),
            "mg" => Some("mg"),
            "mdps" => Some("deg/(1000*s)"),
            "degph" | "dph" | "deg_h" | "deg/hr" => Some("deg/h"),
            "g force" | "gs" => Some("g"),
            "m/(s^2)" => Some("m/s^2"),
            "arc-min" | "arcminutes" | "minutes of arc" => Some("arcmin"),
            "arc-sec" | "arcseconds" | "as" => Some("arcsec"),
            "degrees/sec" | "degree/sec" | "°/sec" | "dps" | "°/s" | "deg/sec" | "degrees/s"
            | "degree/s" | "deg s^-1" | "deg.s^-1" | "deg s-1" => Some("deg/s"),
            "rps" | "rad/sec" | "rad_per_sec" | "rad s^-1" | "rad.s^-1" | "rad s-1"
            | "radians/s" => Some("rad/s"),
            "m/s/s" | "m/sec^2" | "m/s2" | "m/s²" | "m s^-2" | "m.s^-2" | "m s-2" | "mps2"
            | "meters/sec2" | "m/(s^2" | "meter/s^2" => Some("m/s^2"),
            "mms" => Some("mm/s"),
            "cms" => Some("cm/s"),
            "cmps2" | "cm/s2" | "cm/s²" | "gal" => Some("cm/s^2"),
            "meters/sec" | "meter/sec" | "metres/sec" | "m s^-1" | "m.s^-1" | "m/sec" | "m s-1"
            | "mps" => Some("m/s"),
            "kph" | "kmh" => Some("km/h"),
            "mph" => Some("5280*ft/h"),
            "knots" | "kts" | "kt" => Some("kn"),
            "degree" | "degrees" | "°" => Some("deg"),
            "radian" | "radians" => Some("rad"),
            "sec" | "secs" | "second" | "seconds" => Some("s"),
            "msec" | "millisecond" | "milliseconds" => Some("ms"),
            "usec" | "microsecond" | "microseconds" | "μs" | "µs" => Some("us"),
            "nsec" | "nanosecond" | "nanoseconds" => Some("ns"),
            "days" | "tage" | "jours" | "dias" | "giorni" | "dagen" => Some("day"),
            "meter" | "meters" | "metres" => Some("m"),
            "kpa" => Some("kPa"),
            "psig" | "psia" => Some("psi"),
            "barg" | "bara" => Some("bar"),
            "hpa" | "mbar" | "mbars" => Some("hPa"),
            "ft" | "feet" | "foot" | "fuß" | "pies" | "pieds" | "piedi" | "pés" | "voet"
            | "fot" => Some("ft"),
            "ft/sec" | "fps" => Some("ft/s"),
            "fpm" | "ft/min" => Some("ft/min"),
            "fathom" | "fathoms" | "fm" | "ftm" => Some("6*ft"),
            "db" | "dbars" | "decibar" | "decibars" => Some("dbar"),
            "atmosphere" | "atmospheres" => Some("atm"),
            _ => None,
        };
    let valid = |text: &str| parse_unit(text).is_ok().then(|| text.to_owned());
    let suffix = || suffix_expression(clean).and_then(|e| valid(&e));
    known.map(str::to_owned).or_else(|| valid(clean)).or_else(suffix)
}

/// The unit of a heading, if it fits the channel. Gyros may name the angle alone, and velocities the
/// length.
pub fn fitting(unit: &str, si: &str) -> Option<String> {
    let text = expression(unit)?;
    let exponents = |text: &str| parse_unit(text).ok().as_ref().map(Unit::exponents);
    if exponents(&text) == exponents(si) {
        Some(text)
    } else {
        let rate = format!("{text}/s");
        (["rad/s", "m/s"].contains(&si) && exponents(&rate) == exponents(si)).then_some(rate)
    }
}

/// The SI unit of a channel.
pub fn si(channel: &str) -> &'static str {
    let scalar = SCALARS.iter().find(|(name, ..)| *name == channel).map(|s| s.1);
    let vector = || VECTORS.iter().find(|(names, ..)| names.contains(&channel)).map(|v| v.1);
    scalar.or_else(vector).unwrap_or_default()
}

/// Rank of an axis whose word names the axes of one vector alone.
const OWN: usize = 50;
/// Words for increments of the attitude as a quaternion.
const QUATERNIONS: [&str; 3] = ["dq", "oriinc", "oriincq"];
/// Directions, which are velocities where their unit is one of a speed.
const DIRECTIONS: [(&str, &str, f64); 4] = [
    ("north", "vel_n", 1.0),
    ("east", "vel_e", 1.0),
    ("down", "vel_d", 1.0),
    ("up", "vel_d", -1.0),
];
/// Words for a receiver, and the beginnings of the channels of an inertial unit.
const RECEIVER: [&str; 3] = ["gps", "gnss", "rtk"];
const INERTIAL: [&str; 2] = ["gyro_", "accel_"];
/// Increments, and the rates that they are where their unit is one of a rate.
const RATES: [(&str, &str); 6] = [
    ("dtheta_x", "gyro_x"),
    ("dtheta_y", "gyro_y"),
    ("dtheta_z", "gyro_z"),
    ("dvel_x", "accel_x"),
    ("dvel_y", "accel_y"),
    ("dvel_z", "accel_z"),
];

/// The channel that has this unit: itself, or the rate of an increment. `None` for a unit of another
/// quantity.
fn of_unit(channel: &'static str, unit: Option<&str>) -> Option<&'static str> {
    let Some(unit) = unit.filter(|unit| expression(unit).is_some()) else { return Some(channel) };
    let fits = |channel: &str| si(channel).is_empty() || fitting(unit, si(channel)).is_some();
    let rate = || RATES.iter().find(|(of, rate)| *of == channel && fits(rate)).map(|(_, r)| *r);
    if fits(channel) { Some(channel) } else { rate() }
}

/// The channel of words beside a unit, and its sign and rank.
fn channel(words: &[String], unit: Option<&str>) -> Option<(&'static str, f64, usize)> {
    let whole = words.concat();
    let kept: Vec<&str> = words.iter().map(String::as_str).filter(|w| !NOISE.contains(w)).collect();
    let joined = kept.concat();
    let number = |text: &str| {
        let text = english(text);
        SCALARS.iter().find_map(|(name, _, sign, words)| {
            let rank = words.iter().position(|w| *w == text)?;
            Some((of_unit(name, unit)?, *sign, rank))
        })
    };
    let vector = |text: &str, word: &str| {
        let text = english(text);
        let any = AXES.iter().find(|(axis, ..)| *axis == word);
        let own = |names: &[&str; 3]| {
            let (_, axes) = OWN_AXES.iter().find(|(first, _)| *first == names[0])?;
            let axis = axes.iter().position(|words| words.contains(&word))?;
            (text.len() > 2).then_some((axis, 1.0))
        };
        VECTORS.iter().find_map(|(names, _, words)| {
            let rank = words.iter().position(|w| *w == text)?;
            // positions have x and y on maps, too
            let counted = names.contains(&"lat") && word.parse::<usize>().is_err();
            let any = any.filter(|_| !counted);
            let (axis, sign) = any.map(|(_, axis, sign)| (*axis, *sign)).or_else(|| own(names))?;
            // an axis of its own is named better by x, y and z
            let rank = rank + if any.is_some() { 0 } else { OWN };
            // the vector of a quaternion has half of the angle
            let sign = if QUATERNIONS.contains(&text) { 2.0 * sign } else { sign };
            Some((of_unit(names[axis], unit)?, sign, rank))
        })
    };
    let split = |text: &str| -> Option<(&'static str, f64, usize)> {
        // the axis at the end or at the beginning of the words
        let cut = |at: usize| text.is_char_boundary(at).then(|| text.split_at(at));
        let own = OWN_AXES.iter().flat_map(|(_, axes)| axes.iter().copied().flatten().copied());
        let ends = AXES.iter().map(|(word, ..)| *word).chain(own);
        let ends = ends.filter(|word| text.len() > word.len());
        ends.clone()
            .filter_map(|word| cut(text.len() - word.len()))
            .find_map(|(stem, axis)| vector(stem, axis))
            .or_else(|| {
                // a number before a vector counts instruments, as in `GPS(0):acc`
                let named = |(axis, _): &(&str, &str)| axis.parse::<usize>().is_err();
                let mut parts = ends.filter_map(|word| cut(word.len())).filter(named);
                parts.find_map(|(axis, stem)| vector(stem, axis))
            })
    };
    // a direction with a speed
    let direction = || {
        let (_, channel, sign) = DIRECTIONS.iter().find(|(word, ..)| *word == joined)?;
        let unit = expression(unit?)?;
        (unit.contains('/') && fitting(&unit, "m/s").is_some()).then_some((*channel, *sign, 0))
    };
    // a velocity among words of a log, as `bt.vx`
    let of_log = || {
        let kept: Vec<&str> = kept.iter().copied().filter(|w| !LOG.contains(w)).collect();
        let fewer = kept.len() < words.len() && words.iter().any(|w| LOG.contains(&w.as_str()));
        let found = || split(&kept.concat()).filter(|(name, ..)| name.starts_with("vel_"));
        fewer.then(found).flatten()
    };
    let above = || Some((of_unit("height", unit)?, 1.0, height(&kept)?));
    // a letter beside words that say nothing is no pressure, as in `axisP[1]`
    let fewer = || number(&joined).filter(|(name, ..)| *name != "pressure" || joined.len() > 2);
    let plainly = number(&whole).or_else(fewer).or_else(direction).or_else(above);
    plainly.or_else(|| split(&whole)).or_else(|| split(&joined)).or_else(of_log)
}

/// The meaning of a heading.
pub fn meaning(heading: &str) -> Option<Meaning> {
    let heading = heading.trim().trim_start_matches(['%', '#']);
    let bracket = |open: char, close: char| {
        let (name, rest) = heading.split_once(open)?;
        let (inner, after) = rest.split_once(close)?;
        let index = inner.trim().parse::<usize>().is_ok();
        (!index).then(|| (format!("{name} {after}"), inner.to_owned()))
    };
    let bracketed = bracket('[', ']').or_else(|| bracket('(', ')'));
    let (name, stated) = match bracketed.or_else(|| bracket('{', '}')) {
        // the time of a week, in weeks and in their seconds
        Some((_, unit)) if unit.to_lowercase().ends_with("week") => (unit, None),
        Some((name, unit)) => (name, Some(unit)),
        None => (heading.to_owned(), None),
    };
    let (stated, negative) = stated.map_or((None, false), |unit| {
        let (unit, negative) = without_side(&unit);
        (Some(unit), negative)
    });
    let mut words = words(&name);
    words.dedup();
    let mut behind = (1..words.len()).take_while(|k| !OTHERS.contains(&words[k - 1].as_str()));
    let path = name.contains(['.', '/']);
    let meaning = read(&words, stated.as_deref()).or_else(|| {
        behind.find_map(|k| {
            let long = words[k..].concat().len() > 2 || (path && words[k..] == ["t"]);
            let meaning = read(&words[k..], stated.as_deref()).filter(|_| long)?;
            let follows = FOLLOWING.contains(&meaning.channel);
            follows.then_some(Meaning { rank: meaning.rank + BEHIND * k, ..meaning })
        })
    });
    // velocities that an inertial unit integrates are none of a log
    let integrated = words.iter().any(|w| w == "imu");
    let log = |meaning: &Meaning| ["vel_x", "vel_y", "vel_z"].contains(&meaning.channel);
    let meaning = meaning.filter(|meaning| !(integrated && log(meaning)));
    // accelerations that a receiver derives from its velocity are no specific forces
    let derived = words.iter().any(|w| RECEIVER.contains(&w.as_str()));
    meaning.map(|meaning| {
        let inertial = INERTIAL.iter().any(|vector| meaning.channel.starts_with(vector));
        let rank = meaning.rank + if derived && inertial { BEHIND } else { 0 };
        let meaning = Meaning { rank, ..meaning };
        let angle = ["lat", "lon"].contains(&meaning.channel);
        let sign = if negative && angle { -meaning.sign } else { meaning.sign };
        Meaning { sign, ..meaning }
    })
}

/// The unit of a latitude or longitude without the side that is positive, `°W`, and `true` for the south and the west.
fn without_side(unit: &str) -> (String, bool) {
    const SIDES: [(&str, bool); 8] = [
        ("north", false),
        ("south", true),
        ("east", false),
        ("west", true),
        ("n", false),
        ("s", true),
        ("e", false),
        ("w", true),
    ];
    let unit = unit.trim();
    let found = SIDES.iter().find_map(|(side, negative)| {
        let cut = unit.len().checked_sub(side.len()).filter(|cut| unit.is_char_boundary(*cut))?;
        let (rest, end) = unit.split_at(cut);
        // a letter alone is a capital, and no plural
        let letter = side.len() == 1 && end == side.to_uppercase() && !rest.is_empty();
        let word = side.len() > 1 && end.eq_ignore_ascii_case(side);
        let plural = letter && rest.ends_with(|c: char| c.is_ascii_uppercase());
        let rest = rest.trim().to_lowercase();
        let degrees = rest.is_empty() || ["°", "deg", "degree", "degrees"].contains(&rest.as_str());
        (degrees && (word || letter) && !plural).then_some(*negative)
    });
    found.map_or_else(|| (unit.to_owned(), false), |negative| ("deg".to_owned(), negative))
}

/// The axis that a heading names alone, its sign, and the unit in its brackets.
pub fn axis(heading: &str) -> Option<(usize, f64, Option<String>)> {
    let (name, unit) = heading.split_once(['[', '(', '{']).unwrap_or((heading, ""));
    let mut words = words(name);
    words.retain(|word| !["axis", "value", "val"].contains(&word.as_str()));
    let words = words.concat();
    let (_, axis, sign) = AXES.iter().find(|(word, ..)| *word == words)?;
    let named = words.parse::<usize>().is_err();
    named.then(|| (*axis, *sign, expression(unit.trim_end_matches([']', ')', '}', ' ']))))
}

/// The axis that the words of a heading name, without the unit in its brackets.
pub fn axis_of(heading: &str) -> Option<usize> {
    let name = heading.split(['[', '(']).next().unwrap_or_default();
    let words = words(name);
    words.iter().rev().find_map(|word| AXES[..3].iter().position(|(axis, ..)| axis == word))
}

/// A heading whose axes count from 1 to 3, as `dv[1]`, with those from 0 to 2, or with the letters of a quaternion, as
/// `OriInc_q1` beside `OriInc_q0`.
pub fn from_zero(heading: &str, all: &[String]) -> String {
    let index = |c: char| c.is_ascii_digit();
    if let Some((at, digit @ '0'..='3')) = heading.char_indices().next_back() {
        let stem = &heading[..at];
        let four = ('0'..='3').all(|digit| all.contains(&format!("{stem}{digit}")));
        if four && QUATERNIONS.contains(&words(stem).concat().as_str()) {
            return format!("{stem}{}", ["w", "x", "y", "z"][digit as usize - '0' as usize]);
        }
    }
    // the last digit may be one of a unit, as in `a1_mps2`
    let counted = |(at, digit): (usize, char)| {
        let (stem, rest) = (&heading[..at], &heading[at + 1..]);
        let has = |digit: char| all.iter().any(|h| *h == format!("{stem}{digit}{rest}"));
        let counts = has('1') && has('2') && has('3') && !has('0') && !has('4');
        let axis = ('1'..='3').contains(&digit) && !stem.ends_with(index);
        (counts && axis).then(|| format!("{stem}{}{rest}", char::from(digit as u8 - 1)))
    };
    let digits = heading.char_indices().rev().filter(|(_, c)| index(*c));
    digits.filter_map(counted).next().unwrap_or_else(|| heading.to_owned())
}

/// The meaning of words with a unit in brackets, or with one at their end.
fn read(words: &[String], stated: Option<&str>) -> Option<Meaning> {
    let found = |words: &[String], unit: Option<&str>| {
        let (channel, sign, rank) = channel(words, unit)?;
        let unit = unit.and_then(|unit| fitting(unit, si(channel)));
        Some(Meaning { channel, unit, sign, rank })
    };
    let last = |w: &&String| w.parse::<usize>().is_ok() || ["x", "y", "z"].contains(&w.as_str());
    let index = words.last().filter(last).cloned();
    let body = &words[..words.len() - usize::from(index.is_some())];
    // the longest end of the heading that is a unit
    let ending = (1..body.len()).find_map(|at| {
        let stem = [&body[..at], index.as_slice()].concat();
        [body[at..].join("_"), body[at..].concat()].into_iter().find_map(|unit| {
            let known = column_suffix(&unit).is_some() || expression(&unit).is_some();
            known.then(|| found(&stem, Some(&unit)).filter(|m| m.unit.is_some())).flatten()
        })
    });
    match stated {
        Some(unit) => found(words, Some(unit)).or(ending),
        None => ending.or_else(|| found(words, None)),
    }
}

#[cfg(test)]
mod tests;
