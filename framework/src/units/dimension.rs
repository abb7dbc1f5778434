//! What a dimension is called, and the units in which people write it.

use super::unit::{Exponents, parse_unit};

/// A dimension that data sheets and scenarios know.
pub(super) struct Dimension {
    pub exponents: Exponents,
    /// With its article, to read well in messages.
    pub name: &'static str,
    /// A value that could be in a scenario.
    pub example: &'static str,
    /// Units to print it in, the preferred first; messages name three.
    pub units: &'static [&'static str],
}

const fn row(
    exponents: Exponents,
    name: &'static str,
    example: &'static str,
    units: &'static [&'static str],
) -> Dimension {
    Dimension { exponents, name, example, units }
}

#[rustfmt::skip]
pub(super) const DIMENSIONS: [Dimension; 19] = [
    row([0, 0, 0, 0, 0], "a ratio", "200 ppm", &["", "ppm"]),
    row([0, 0, 0, 2, 0], "an angle", "-0.5 deg", &["deg", "mrad", "arcsec", "rad"]),
    row([0, 0, -2, 2, 0], "an angular rate", "0.01 deg/h", &["deg/s", "deg/h", "rad/s"]),
    row([0, 0, -1, 2, 0], "an angular rate noise", "0.1 deg/h/sqrt(Hz)", &["deg/h/sqrt(Hz)", "deg/sqrt(h)", "rad/s/sqrt(Hz)"]),
    row([0, 0, -3, 2, 0], "an angular rate random walk", "0.01 deg/h/sqrt(h)", &["deg/h/sqrt(h)", "deg/h/sqrt(s)", "rad/s/sqrt(s)"]),
    row([0, 0, -4, 2, 0], "an angular acceleration", "1 deg/s^2", &["deg/s^2", "rad/s^2"]),
    row([2, 0, 0, 0, 0], "a length", "0.2 m", &["m", "cm", "km"]),
    row([2, 0, -1, 0, 0], "a length random walk", "1 cm/sqrt(h)", &["cm/sqrt(h)", "m/sqrt(s)"]),
    row([2, 0, -2, 0, 0], "a speed", "2 cm/s", &["m/s", "cm/s", "kn"]),
    row([2, 0, -4, 0, 0], "an acceleration", "50 ug", &["m/s^2", "ug", "mg", "g"]),
    row([2, 0, -3, 0, 0], "an acceleration noise", "10 ug/sqrt(Hz)", &["ug/sqrt(Hz)", "m/s^2/sqrt(Hz)", "m/s/sqrt(h)"]),
    row([2, 0, -5, 0, 0], "an acceleration random walk", "1 ug/sqrt(h)", &["ug/sqrt(h)", "ug/sqrt(s)", "m/s^2/sqrt(s)"]),
    row([0, 0, 2, 0, 0], "a time", "10 ms", &["s", "ms", "min", "h", "us", "ns"]),
    row([0, 0, 1, 0, 0], "a time random walk", "1 ms/sqrt(h)", &["ms/sqrt(h)", "us/sqrt(s)", "s/sqrt(s)"]),
    row([0, 0, -2, 0, 0], "a frequency", "5 Hz", &["Hz", "kHz"]),
    row([-2, 2, -4, 0, 0], "a pressure", "0.2 bar", &["Pa", "kPa", "dbar", "bar"]),
    row([-6, 2, 0, 0, 0], "a density", "1025 kg/m^3", &["kg/m^3"]),
    row([0, 0, 0, 0, 2], "a temperature difference", "0.1 K", &["K", "mK"]),
    row([0, 0, -1, 0, 0], "a ratio random walk", "10 ppm/sqrt(h)", &["ppm/sqrt(h)", "1/sqrt(s)"]),
];

fn find(exponents: Exponents) -> Option<&'static Dimension> {
    DIMENSIONS.iter().find(|d| d.exponents == exponents)
}

/// The name with its article, such as "a speed"; a dimension without a name is its SI unit.
pub fn name(exponents: Exponents) -> String {
    find(exponents).map_or_else(|| si_unit(exponents), |d| d.name.to_owned())
}

/// The name without its article.
pub fn title(exponents: Exponents) -> String {
    let name = name(exponents);
    name.split_once(' ').map_or(name.clone(), |(_, bare)| bare.to_owned())
}

/// A value that could be in a scenario.
pub fn example(exponents: Exponents) -> String {
    find(exponents).map_or_else(|| format!("1 {}", si_unit(exponents)), |d| d.example.to_owned())
}

/// Up to three units, or for a ratio forms.
pub fn usual_units(exponents: Exponents) -> String {
    match find(exponents) {
        Some(d) if d.units[0].is_empty() => "0.002, 0.2 %, 200 ppm".to_owned(),
        Some(d) => d.units.iter().take(3).copied().collect::<Vec<_>>().join(", "),
        None => si_unit(exponents),
    }
}

/// The SI unit, such as `kg/m^3` or `m/sqrt(s^3)`.
fn si_unit(exponents: Exponents) -> String {
    let power = |base: &str, halves: u8| match halves {
        1 => format!("sqrt({base})"),
        2 => base.to_owned(),
        h if h % 2 == 0 => format!("{base}^{}", h / 2),
        h => format!("sqrt({base}^{h})"),
    };
    let powers = |sign: i8| {
        let bases = ["m", "kg", "s", "rad", "K"].into_iter().zip(exponents);
        bases
            .filter(|(_, e)| e.signum() == sign)
            .map(|(b, e)| power(b, e.unsigned_abs()))
            .collect::<Vec<_>>()
    };
    let (top, bottom) = (powers(1), powers(-1));
    let top = if top.is_empty() { "1".to_owned() } else { top.join("*") };
    bottom.iter().fold(top, |unit, b| format!("{unit}/{b}"))
}

/// A number in fewer characters than this is worth the unit it is in.
const SHORT: usize = 7;

/// A value and its unit as on a data sheet, which reads back as the very same `f64`: the first of the usual units in
/// which the number is short, else the first in which it can be written at all.
pub fn print(si: f64, exponents: Exponents) -> String {
    let units = find(exponents).map_or(&[][..], |d| d.units);
    let written: Vec<(String, &str)> =
        units.iter().filter_map(|u| Some((number_in(si, u)?, *u))).collect();
    let best = written.iter().find(|(number, _)| number.len() < SHORT).or_else(|| written.first());
    match best {
        Some((number, "")) => number.clone(),
        Some((number, unit)) => format!("{number} {unit}"),
        None => format!("{} {}", decimal(si), si_unit(exponents)),
    }
}

/// The shortest decimal of that unit which is `si` to the last bit, where there is one.
fn number_in(si: f64, unit: &str) -> Option<String> {
    let to_si =
        |x: f64| if unit.is_empty() { Some(x) } else { parse_unit(unit).ok().map(|u| u.to_si(x)) };
    let near = si / to_si(1.0)?;
    // 17 significant digits tell any f64 from the next
    (0..17)
        .filter_map(|digits| format!("{near:.digits$e}").parse().ok())
        .find(|x| to_si(*x).map(f64::to_bits) == Some(si.to_bits()))
        .map(decimal)
}

/// Decimal, or scientific where that is much shorter.
fn decimal(x: f64) -> String {
    let (plain, scientific) = (x.to_string(), format!("{x:e}"));
    if scientific.len() + SHORT < plain.len() { scientific } else { plain }
}
