//! The names of the dimensions, and the units in which people write them.

/// Exponents of length, mass, time, angle, temperature and current, counted in halves: `1/sqrt(Hz)` is
/// `[0, 0, 1, 0, 0, 0]`.
pub type Exponents = [i8; 6];

/// A dimension that data sheets and scenarios use.
pub(super) struct Dimension {
    pub exponents: Exponents,
    /// The name with its article, as messages need it.
    pub name: &'static str,
    /// A value as a scenario would have it.
    pub example: &'static str,
    /// Units in which it is printed, the preferred one first; messages name three of them.
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
pub(super) const DIMENSIONS: &[Dimension] = &[
    row([0, 0, 0, 0, 0, 0], "a ratio", "200 ppm", &["", "ppm"]),
    row([0, 0, 0, 2, 0, 0], "an angle", "-0.5 deg", &["deg", "mrad", "arcsec", "rad"]),
    row([0, 0, -2, 2, 0, 0], "an angular rate", "0.01 deg/h", &["deg/s", "deg/h", "rad/s"]),
    row([0, 0, -1, 2, 0, 0], "an angular rate noise", "0.1 deg/h/sqrt(Hz)", &["deg/h/sqrt(Hz)", "deg/sqrt(h)", "rad/s/sqrt(Hz)"]),
    row([0, 0, -3, 2, 0, 0], "an angular rate random walk", "0.01 deg/h/sqrt(h)", &["deg/h/sqrt(h)", "deg/h/sqrt(s)", "rad/s/sqrt(s)"]),
    row([0, 0, -4, 2, 0, 0], "an angular acceleration", "1 deg/s^2", &["deg/s^2", "rad/s^2"]),
    row([2, 0, 0, 0, 0, 0], "a length", "0.2 m", &["m", "cm", "km"]),
    row([2, 0, -1, 0, 0, 0], "a length random walk", "1 cm/sqrt(h)", &["cm/sqrt(h)", "m/sqrt(s)"]),
    row([2, 0, -2, 0, 0, 0], "a speed", "2 cm/s", &["m/s", "cm/s", "kn"]),
    row([2, 0, -4, 0, 0, 0], "an acceleration", "50 ug", &["m/s^2", "ug", "mg", "g"]),
    row([2, 0, -3, 0, 0, 0], "an acceleration noise", "10 ug/sqrt(Hz)", &["ug/sqrt(Hz)", "m/s^2/sqrt(Hz)", "m/s/sqrt(h)"]),
    row([2, 0, -5, 0, 0, 0], "an acceleration random walk", "1 ug/sqrt(h)", &["ug/sqrt(h)", "ug/sqrt(s)", "m/s^2/sqrt(s)"]),
    row([0, 0, 2, 0, 0, 0], "a time", "10 ms", &["s", "ms", "min", "h", "us", "ns"]),
    row([0, 0, 1, 0, 0, 0], "a time random walk", "1 ms/sqrt(h)", &["ms/sqrt(h)", "us/sqrt(s)", "s/sqrt(s)"]),
    row([0, 0, -2, 0, 0, 0], "a frequency", "5 Hz", &["Hz", "kHz"]),
    row([-2, 2, -4, 0, 0, 0], "a pressure", "0.2 bar", &["Pa", "kPa", "dbar", "bar"]),
    row([-6, 2, 0, 0, 0, 0], "a density", "1025 kg/m^3", &["kg/m^3"]),
    row([0, 0, 0, 0, 2, 0], "a temperature difference", "0.1 K", &["K", "mK"]),
    row([-2, 2, -5, 0, 0, 0], "a pressure random walk", "1 hPa/sqrt(h)", &["hPa/sqrt(h)", "Pa/sqrt(s)"]),
    row([0, 0, 0, 0, 0, 2], "an electric current", "2 A", &["A", "mA"]),
    row([4, 2, -6, 0, 0, -2], "a voltage", "12 V", &["V", "mV"]),
    row([0, 2, -4, 0, 0, -2], "a magnetic field", "50 uT", &["uT", "nT", "T"]),
    row([0, 2, -5, 0, 0, -2], "a magnetic field random walk", "10 nT/sqrt(h)", &["nT/sqrt(h)", "T/sqrt(s)"]),
    row([-2, 0, 2, 2, 0, 0], "a g-sensitivity", "1 deg/h/g", &["deg/h/g", "deg/s/g"]),
    row([-2, 0, 1, 2, 0, 0], "a g-sensitivity random walk", "0.1 deg/h/g/sqrt(h)", &["deg/h/g/sqrt(h)"]),
    row([0, 0, -1, 0, 0, 0], "a ratio random walk", "10 ppm/sqrt(h)", &["ppm/sqrt(h)", "1/sqrt(s)"]),
];

pub(super) fn find(exponents: Exponents) -> Option<&'static Dimension> {
    DIMENSIONS.iter().find(|d| d.exponents == exponents)
}

/// The name with its article, such as "a speed"; its SI unit for a dimension without a name.
pub fn name(exponents: Exponents) -> String {
    find(exponents).map_or_else(|| si_unit(exponents), |d| d.name.to_owned())
}

/// The name without its article.
pub fn title(exponents: Exponents) -> String {
    let name = name(exponents);
    name.split_once(' ').map_or(name.clone(), |(_, bare)| bare.to_owned())
}

/// A value as a scenario would have it.
pub fn example(exponents: Exponents) -> String {
    find(exponents).map_or_else(|| format!("1 {}", si_unit(exponents)), |d| d.example.to_owned())
}

/// Up to three usual units; for a ratio, its forms.
pub fn usual_units(exponents: Exponents) -> String {
    match find(exponents) {
        Some(d) if d.units[0].is_empty() => "0.002, 0.2 %, 200 ppm".to_owned(),
        Some(d) => d.units.iter().take(3).copied().collect::<Vec<_>>().join(", "),
        None => si_unit(exponents),
    }
}

/// The SI unit, such as `kg/m^3` or `m/sqrt(s^3)`.
pub(super) fn si_unit(exponents: Exponents) -> String {
    let power = |base: &str, halves: u8| match halves {
        1 => format!("sqrt({base})"),
        2 => base.to_owned(),
        h if h % 2 == 0 => format!("{base}^{}", h / 2),
        h => format!("sqrt({base}^{h})"),
    };
    let powers = |sign: i8| {
        let bases = ["m", "kg", "s", "rad", "K", "A"].into_iter().zip(exponents);
        bases
            .filter(|(_, e)| e.signum() == sign)
            .map(|(b, e)| power(b, e.unsigned_abs()))
            .collect::<Vec<_>>()
    };
    let (top, bottom) = (powers(1), powers(-1));
    let top = if top.is_empty() { "1".to_owned() } else { top.join("*") };
    bottom.iter().fold(top, |unit, b| format!("{unit}/{b}"))
}
