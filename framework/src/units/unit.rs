//! Unit expressions such as `deg/h/sqrt(Hz)`.

use crate::document::did_you_mean;
use crate::units::dimension::{self, Exponents};
use crate::units::error::UnitError;
use std::borrow::Cow;
use std::f64::consts::PI;

/// A unit: its value in SI, and its dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    // a fraction, so that "3 cm" is 3/100, which is the same f64 as "0.03 m"
    numerator: f64,
    denominator: f64,
    exponents: Exponents,
}

const NONE: Exponents = [0, 0, 0, 0, 0, 0];
const LENGTH: Exponents = [2, 0, 0, 0, 0, 0];
const MASS: Exponents = [0, 2, 0, 0, 0, 0];
const TIME: Exponents = [0, 0, 2, 0, 0, 0];
const RATE: Exponents = [0, 0, -2, 0, 0, 0];
const SPEED: Exponents = [2, 0, -2, 0, 0, 0];
const ACCELERATION: Exponents = [2, 0, -4, 0, 0, 0];
const PRESSURE: Exponents = [-2, 2, -4, 0, 0, 0];
const ANGLE: Exponents = [0, 0, 0, 2, 0, 0];
const ANGULAR_RATE: Exponents = [0, 0, -2, 2, 0, 0];
const TEMPERATURE: Exponents = [0, 0, 0, 0, 2, 0];
const CURRENT: Exponents = [0, 0, 0, 0, 0, 2];
const VOLTAGE: Exponents = [4, 2, -6, 0, 0, -2];
const MAGNETIC_FIELD: Exponents = [0, 2, -4, 0, 0, -2];

/// Names, SI value as a fraction, dimension, and the prefixes that the unit takes.
pub(super) type Row = (&'static [&'static str], f64, f64, Exponents, &'static str);

pub(super) const UNITS: &[Row] = &[
    (&["%"], 1.0, 100.0, NONE, ""),
    (&["ppm"], 1.0, 1e6, NONE, ""),
    (&["ppb"], 1.0, 1e9, NONE, ""),
    (&["rad"], 1.0, 1.0, ANGLE, "mun"),
    (&["deg", "°"], PI, 180.0, ANGLE, "m"),
    (&["arcmin"], PI, 10_800.0, ANGLE, ""),
    (&["arcsec"], PI, 648_000.0, ANGLE, ""),
    (&["rev", "turn"], 2.0 * PI, 1.0, ANGLE, ""),
    (&["rpm"], PI, 30.0, ANGULAR_RATE, ""),
    (&["m"], 1.0, 1.0, LENGTH, "kcmu"),
    (&["ft"], 0.3048, 1.0, LENGTH, ""),
    (&["nmi"], 1852.0, 1.0, LENGTH, ""),
    (&["kn", "kt"], 1852.0, 3600.0, SPEED, ""),
    // standard gravity, CGPM 1901; the gram exists only as part of kg
    (&["g"], 9.80665, 1.0, ACCELERATION, "mun"),
    (&["Gal"], 1.0, 100.0, ACCELERATION, "mu"),
    (&["s"], 1.0, 1.0, TIME, "mun"),
    (&["min"], 60.0, 1.0, TIME, ""),
    (&["h", "hr"], 3600.0, 1.0, TIME, ""),
    (&["day"], 86_400.0, 1.0, TIME, ""),
    (&["Hz"], 1.0, 1.0, RATE, "kMm"),
    (&["kg"], 1.0, 1.0, MASS, ""),
    (&["Pa"], 1.0, 1.0, PRESSURE, "hkM"),
    (&["bar"], 1e5, 1.0, PRESSURE, "md"),
    (&["atm"], 101_325.0, 1.0, PRESSURE, ""),
    (&["psi"], 6_894.757_293_168_361, 1.0, PRESSURE, ""),
    (&["K"], 1.0, 1.0, TEMPERATURE, "m"),
    (&["A"], 1.0, 1.0, CURRENT, "mu"),
    (&["V"], 1.0, 1.0, VOLTAGE, "mu"),
    (&["T"], 1.0, 1.0, MAGNETIC_FIELD, "mun"),
];

/// Prefixes as fractions; the micro sign and the Greek letter mu both count as `u`.
const PREFIXES: [(char, f64, f64); 8] = [
    ('n', 1.0, 1e9),
    ('u', 1.0, 1e6),
    ('m', 1.0, 1e3),
    ('c', 1.0, 1e2),
    ('d', 1.0, 1e1),
    ('h', 1e2, 1.0),
    ('k', 1e3, 1.0),
    ('M', 1e6, 1.0),
];

/// Longest expression in bytes, which bounds the nesting.
const MAX_LENGTH: usize = 64;
/// Highest power of a unit; no physical unit has a higher one, and exponents stay within `i8`.
const MAX_POWER: i8 = 6;

impl Unit {
    /// The unit of a ratio.
    pub const ONE: Self = Self::of(NONE);
    /// The SI unit of an angle.
    pub const RADIAN: Self = Self::of(ANGLE);
    /// The SI unit of a length.
    pub const METRE: Self = Self::of(LENGTH);
    /// The SI unit of a speed.
    pub const METRE_PER_SECOND: Self = Self::of(SPEED);

    const fn of(exponents: Exponents) -> Self {
        Self { numerator: 1.0, denominator: 1.0, exponents }
    }

    /// Parses an SI unit: an expression (`m/s`), or the suffix of a column (`mps`).
    ///
    /// # Errors
    /// When the unit is unknown, malformed, or not SI.
    pub fn si(text: &str) -> Result<Self, UnitError> {
        let unit = column_suffix(text).map_or_else(|| parse_unit(text), Ok)?;
        if unit == Self::of(unit.exponents) {
            return Ok(unit);
        }
        let si = Self::of(unit.exponents).suffix();
        Err(UnitError::NotSi { unit: text.to_owned(), si })
    }

    /// The SI unit of its dimension in the usual notation: `m/s^2`, `Pa`; empty for a ratio.
    /// Borrowed for a dimension of the table.
    pub fn symbol(&self) -> Cow<'static, str> {
        let si = Self::of(self.exponents);
        let is_si = |name: &&&str| name.is_empty() || parse_unit(name) == Ok(si);
        let usual = dimension::find(self.exponents).and_then(|d| d.units.iter().find(is_si));
        usual.map_or_else(|| dimension::si_unit(self.exponents).into(), |name| (*name).into())
    }

    /// The SI unit of its dimension as the suffix of a column: `mps2`, `Pa`; `1` for a ratio.
    pub fn suffix(&self) -> String {
        match &*self.symbol() {
            "" => "1".to_owned(),
            symbol => symbol.replace('/', "p").replace(['^', '*', '(', ')'], ""),
        }
    }

    /// The unit in which people read the dimension, and the factor from SI to it: degrees for an
    /// angle.
    pub fn shown(&self) -> (Cow<'static, str>, f64) {
        let usual = dimension::find(self.exponents).map(|d| d.units[0]);
        match usual.map(|usual| (usual, parse_unit(usual))) {
            Some((usual, Ok(unit))) => (usual.into(), unit.denominator / unit.numerator),
            _ => (self.symbol(), 1.0),
        }
    }

    /// The SI value of the unit.
    pub fn factor(&self) -> f64 {
        self.numerator / self.denominator
    }

    /// Converts a number of this unit to SI, with less rounding than [`Self::factor`] gives.
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.numerator / self.denominator
    }

    /// The exponents of its dimension.
    pub fn exponents(&self) -> Exponents {
        self.exponents
    }

    /// The name of its dimension, such as "an angular rate".
    pub fn dimension(&self) -> String {
        dimension::name(self.exponents)
    }

    fn times(self, other: Self) -> Option<Self> {
        let mut exponents = self.exponents;
        for (e, o) in exponents.iter_mut().zip(other.exponents) {
            *e = e.checked_add(o)?;
        }
        let (numerator, denominator) =
            (self.numerator * other.numerator, self.denominator * other.denominator);
        Some(Self { numerator, denominator, exponents })
    }

    fn power(self, n: i8) -> Option<Self> {
        let mut exponents = self.exponents;
        for e in &mut exponents {
            *e = e.checked_mul(n)?;
        }
        let [a, b] =
            [self.numerator, self.denominator].map(|x| x.powi(i32::from(n.unsigned_abs())));
        let (numerator, denominator) = if n < 0 { (b, a) } else { (a, b) };
        Some(Self { numerator, denominator, exponents })
    }

    fn sqrt(self) -> Option<Self> {
        let even = self.exponents.iter().all(|e| e % 2 == 0);
        let (numerator, denominator) = (self.numerator.sqrt(), self.denominator.sqrt());
        even.then(|| Self { numerator, denominator, exponents: self.exponents.map(|e| e / 2) })
    }

    /// The unit of a name, with or without a prefix.
    fn named(name: &str) -> Option<Self> {
        let plain = |name: &str| UNITS.iter().find(|row| row.0.contains(&name));
        if let Some(&(_, numerator, denominator, exponents, _)) = plain(name) {
            return Some(Self { numerator, denominator, exponents });
        }
        let first = name.chars().next()?;
        let &(_, n, d, exponents, prefixes) = plain(&name[first.len_utf8()..])?;
        let letter = if matches!(first, 'µ' | 'μ') { 'u' } else { first };
        let &(_, up, down) =
            PREFIXES.iter().find(|p| p.0 == letter && prefixes.contains(letter))?;
        Some(Self { numerator: n * up, denominator: d * down, exponents })
    }
}

/// The dimensions that have a unit of their own, in the order of their units.
pub(super) fn dimensions() -> Vec<Exponents> {
    let mut found: Vec<Exponents> = Vec::new();
    for row in UNITS {
        if !found.contains(&row.3) {
            found.push(row.3);
        }
    }
    found
}

/// Every name of a unit, with its prefixes.
fn names() -> Vec<String> {
    let prefixed = |row: &Row, name: &str| {
        row.4.chars().map(move |p| format!("{p}{name}")).collect::<Vec<_>>()
    };
    let all = |row: &'static Row| {
        row.0.iter().flat_map(move |&n| [vec![n.to_owned()], prefixed(row, n)].concat())
    };
    UNITS.iter().flat_map(all).collect()
}

/// The name of a unit that is nearest to a text.
pub(super) fn nearest(text: &str) -> Option<String> {
    let names = names();
    did_you_mean(text, names.iter().map(String::as_str)).map(str::to_owned)
}

/// Parses a unit expression: units combined with `*`, `/`, `^n`, `sqrt(...)` and parentheses. The
/// signs `°`, `µ`, `·`, `²`, `³` and `√` are allowed too. `g` is standard gravity. A
/// whole number may be a factor: `100*us`.
///
/// # Errors
/// When a unit is unknown or the expression is malformed.
pub fn parse_unit(expr: &str) -> Result<Unit, UnitError> {
    let mut parser = Parser { whole: expr, rest: expr };
    if expr.len() > MAX_LENGTH {
        return Err(UnitError::Expression {
            unit: expr.chars().take(20).collect(),
            reason: "it is too long".into(),
        });
    }
    let unit = parser.expression()?;
    match parser.peek() {
        None => Ok(unit),
        Some(c) => Err(parser.malformed(format!("`*` or `/` is needed before '{c}'"))),
    }
}

/// A recursive descent parser.
struct Parser<'a> {
    whole: &'a str,
    rest: &'a str,
}

impl Parser<'_> {
    fn malformed(&self, reason: impl Into<String>) -> UnitError {
        UnitError::Expression { unit: self.whole.to_owned(), reason: reason.into() }
    }

    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.rest = &self.rest[wanted.len_utf8()..];
        }
        found
    }

    /// Takes the longest prefix of the rest whose characters satisfy the predicate.
    fn word(&mut self, belongs: impl Fn(char) -> bool) -> &str {
        self.peek();
        let end = self.rest.find(|c| !belongs(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        word
    }

    fn checked(&self, unit: Option<Unit>) -> Result<Unit, UnitError> {
        unit.filter(|u| u.numerator.is_normal() && u.denominator.is_normal())
            .ok_or_else(|| self.malformed("its powers belong to no physical quantity"))
    }

    fn expression(&mut self) -> Result<Unit, UnitError> {
        let mut unit = self.factor()?;
        loop {
            let next = if self.take('*') || self.take('·') {
                self.factor()?
            } else if self.take('/') {
                let factor = self.factor()?.power(-1);
                self.checked(factor)?
            } else {
                return Ok(unit);
            };
            unit = self.checked(unit.times(next))?;
        }
    }

    fn factor(&mut self) -> Result<Unit, UnitError> {
        let unit = self.primary()?;
        let n = if self.take('²') {
            2
        } else if self.take('³') {
            3
        } else if self.take('^') {
            let power = self.word(|c| c.is_ascii_digit() || c == '-').parse().ok();
            let power = power.filter(|n: &i8| (-MAX_POWER..=MAX_POWER).contains(n));
            power.ok_or_else(|| {
                self.malformed(format!("a power is an integer from -{MAX_POWER} to {MAX_POWER}"))
            })?
        } else {
            return Ok(unit);
        };
        self.checked(unit.power(n))
    }

    fn primary(&mut self) -> Result<Unit, UnitError> {
        if self.take('√') {
            let unit = self.primary()?.sqrt();
            return self.checked(unit);
        }
        if self.peek() == Some('(') {
            return self.parenthesised();
        }
        let digits = self.word(|c| c.is_ascii_digit());
        if let Some(number) = digits.parse().ok().filter(|n: &u16| *n > 0) {
            return Ok(Unit { numerator: f64::from(number), ..Unit::ONE });
        }
        let name = self.word(|c| c.is_alphabetic() || matches!(c, '°' | '%' | '_')).to_owned();
        match name.as_str() {
            "" => Err(match self.peek() {
                Some(c) => self.malformed(format!("a unit is needed before '{c}'")),
                None => self.malformed("a unit is needed at its end"),
            }),
            "sqrt" => {
                let unit = self.parenthesised()?.sqrt();
                self.checked(unit)
            }
            name => Unit::named(name)
                .ok_or_else(|| UnitError::Unknown { unit: name.to_owned(), usual: None }),
        }
    }

    fn parenthesised(&mut self) -> Result<Unit, UnitError> {
        if !self.take('(') {
            return Err(self.malformed("`(` is needed after sqrt"));
        }
        let unit = self.expression()?;
        if self.take(')') { Ok(unit) } else { Err(self.malformed("a parenthesis is not closed")) }
    }
}

/// The unit that a suffix of a column name stands for: see [`suffix_expression`].
pub fn column_suffix(suffix: &str) -> Option<Unit> {
    parse_unit(&suffix_expression(suffix)?).ok()
}

/// The expression of the unit that a suffix of a column name stands for: a plain unit (`m`, `deg`,
/// `ms`, `dbar`), one per second or per second squared (`mps`, `m_s`, `mps2`, `radps`, `dps`), or
/// `kgpm3`.
pub fn suffix_expression(suffix: &str) -> Option<Cow<'_, str>> {
    let per_second = || {
        let (name, power) = suffix.strip_suffix('2').map_or((suffix, ""), |rest| (rest, "^2"));
        let name = name.strip_suffix("ps").or_else(|| name.strip_suffix("_s"))?;
        // "h_s" is a column named h in seconds, not a number of hours per second
        let per_second = || Cow::Owned(format!("{name}/s{power}"));
        (Unit::named(name)?.exponents != TIME).then(per_second)
    };
    match suffix {
        "dps" => Some("deg/s".into()),
        "kgpm3" => Some("kg/m^3".into()),
        _ if Unit::named(suffix).is_some() => Some(suffix.into()),
        _ => per_second(),
    }
}
