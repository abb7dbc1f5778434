//! Vertical axes: the unit in which a plot is read, and the range in which its ticks have numbers.
//!
//! The viewer puts ticks at multiples of powers of ten, and writes the number of a tick only where
//! the ticks are far enough apart. A range between two powers shows then a single number, "0". So
//! the ranges here are chosen together with the height of the plot.

/// Least distance between two ticks that have a readable number, pixels. Between 20 and 30 pixels
/// the viewer fades the numbers in.
const TICK_PIXELS: f64 = 24.0;
/// Distance of a tick from the edge of the plot below which its number is cut off, pixels.
const EDGE_PIXELS: f64 = 8.0;
/// Least size of a value in its unit; in a unit larger than the block's own it is 1.
pub const LEAST: f64 = 0.2;
/// Greatest number of rounds in the search for a range.
const ROUNDS: usize = 20;
/// Number of ticks that a plot shows at least.
pub const TICKS: usize = 3;

/// A unit and its size in the unit of the block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale<'a> {
    /// The unit, such as `mm/s`.
    pub unit: &'a str,
    /// The size of the unit, in the block's unit.
    pub size: f64,
}

/// The units of a quantity, each with its size in the first one, from large to small.
const UNITS: &[&[(&str, f64)]] = &[
    &[("deg", 1.0), ("mdeg", 1e-3), ("udeg", 1e-6)],
    &[("m/s", 1.0), ("mm/s", 1e-3), ("um/s", 1e-6)],
    &[("km", 1e3), ("m", 1.0), ("mm", 1e-3), ("um", 1e-6)],
    &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6)],
    &[("deg/h", 1.0), ("mdeg/h", 1e-3)],
    &[("mg", 1e3), ("ug", 1.0), ("ng", 1e-3)],
    &[("m/s^2", 1.0), ("mm/s^2", 1e-3), ("um/s^2", 1e-6)],
    &[("deg/s", 1.0), ("mdeg/s", 1e-3)],
    &[("uT", 1.0), ("nT", 1e-3)],
    &[("", 1.0), ("%", 1e-2), ("ppm", 1e-6)],
];

/// The unit in which a size is at least [`LEAST`], or else the smallest one. A unit that is not known
/// stays.
pub fn scale(unit: &str, size: f64) -> Scale<'_> {
    let base = Scale { unit, size: 1.0 };
    let Some(units) = UNITS.iter().find(|units| units.iter().any(|u| u.0 == unit)) else {
        return base;
    };
    let own = units.iter().find(|u| u.0 == unit).map_or(1.0, |u| u.1);
    if !(size.is_finite() && size > 0.0) {
        return base;
    }
    let least = |u: &(&str, f64)| if u.1 > own { 1.0 } else { LEAST };
    let fits = units.iter().find(|u| size >= least(u) * u.1 / own);
    fits.or(units.last()).map_or(base, |u| Scale { unit: u.0, size: u.1 / own })
}

/// The range around `low` and `high` in which a plot of that many pixels has ticks with numbers.
pub fn range(low: f64, high: f64, pixels: f64) -> [f64; 2] {
    let margin = 0.04 * (high - low);
    let (mut low, mut high) = (low - margin, high + margin);
    if !(low.is_finite() && high.is_finite()) {
        return [-1.0, 1.0];
    }
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-9);
    if high - low < least {
        // a constant
        (low, high) = (low - least, high + least);
    }
    // each round adds a tick or makes the step ten times as large
    for _ in 0..ROUNDS {
        let step = step(high - low, pixels);
        if ticks([low, high], pixels) >= TICKS {
            return [low, high];
        }
        // to the next tick on the side that is nearer to one, if the step stays
        // the next tick beyond those that count, and room for its number
        let edge = EDGE_PIXELS / pixels * (high - low);
        let room = 1.3 * EDGE_PIXELS / pixels * (high - low + step);
        let below = (((low + edge) / step).ceil() - 1.0) * step - room;
        let above = (((high - edge) / step).floor() + 1.0) * step + room;
        if low - below <= above - high { low = below } else { high = above }
    }
    [low, high]
}

/// The distance of the ticks with numbers: the smallest power of ten that is far enough apart.
pub fn step(span: f64, pixels: f64) -> f64 {
    10f64.powf((span * TICK_PIXELS / pixels).log10().ceil())
}

/// The number of ticks with whole numbers in a range.
pub fn ticks([low, high]: [f64; 2], pixels: f64) -> usize {
    let step = step(high - low, pixels);
    let edge = EDGE_PIXELS / pixels * (high - low);
    let (low, high) = (low + edge, high - edge);
    let count = (high / step).floor() - (low / step).ceil() + 1.0;
    if count.is_finite() { count.max(0.0) as usize } else { 0 }
}

/// A number with three digits.
pub fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    // the power of the rounded number: 9.999 is 10.0
    let rounded = format!("{x:.2e}");
    let Some(power) = rounded.split_once('e').and_then(|(_, power)| power.parse::<i32>().ok())
    else {
        return format!("{x}");
    };
    let digits = 2 - power;
    if (0..=7).contains(&digits) {
        format!("{x:.*}", digits as usize)
    } else if digits < 0 {
        let unit = 10f64.powi(-digits);
        format!("{:.0}", (x / unit).round() * unit)
    } else {
        rounded
    }
}

/// A value and its sigma: a smaller value has the decimals of its sigma.
pub fn with_sigma(value: f64, sigma: f64) -> String {
    let text = short(sigma);
    let value = match text.split_once('.') {
        Some((_, decimals)) if value.abs() < sigma && !text.contains('e') => {
            let parts = 10f64.powi(decimals.len() as i32);
            // adding zero makes a negative zero positive
            format!("{:.*}", decimals.len(), (parts * value).round() / parts + 0.0)
        }
        _ => short(value),
    };
    format!("{value} ± {text}")
}

/// Size of a length from which on tables and plots of errors have it in metres, m.
const METRES: f64 = 0.005;

/// The unit of errors of that size in plots and in the table of states: a length is in metres, as in the report
/// and in the pages of other runs, unless it is very small.
pub fn table(unit: &str, size: f64) -> Scale<'_> {
    match unit {
        "m" if size >= METRES => Scale { unit, size: 1.0 },
        _ => scale(unit, size),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two runs of a scenario, and the report of one, have their positions in the same unit.
    #[test]
    fn a_table_has_lengths_in_metres_unless_they_are_very_small() {
        let of = |name, size| table(name, size).unit;
        assert_eq!([0.082, 0.3, 5200.0].map(|size| of("m", size)), ["m"; 3]);
        assert_eq!([of("m", 0.0021), of("m/s", 0.0008)], ["mm", "mm/s"]);
    }

    #[test]
    fn every_range_has_three_ticks_with_numbers_and_is_no_wider_than_they_need() {
        for pixels in [130.0, 180.0, 250.0, 700.0] {
            for k in 0..2000 {
                let width = 10f64.powf(-6.0 + 0.0061 * f64::from(k));
                for middle in [0.0, 0.37 * width, 1.0, -45.2] {
                    let (low, high) = (middle - width, middle + width);
                    let [a, b] = range(low, high, pixels);
                    assert!(ticks([a, b], pixels) >= TICKS, "{low} {high} {pixels}: {a} {b}");
                    assert!(a <= low && b >= high, "{low} {high}: {a} {b}");
                    // a range with pixels / 24 steps just holds its ticks; a little wider, a step
                    // is ten times as large, and three ticks need two of them, and room outside
                    let most = (10.0 * 2.9 / (pixels / TICK_PIXELS)).max(1.5) * 2.0 * width;
                    assert!(b - a <= most + 1e-7, "{low} {high} {pixels}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn a_constant_has_a_range() {
        for value in [0.0, 1.0, -3e5] {
            let [a, b] = range(value, value, 200.0);
            assert!(a < value && value < b && ticks([a, b], 200.0) >= TICKS, "{value}: {a} {b}");
        }
    }

    #[test]
    fn the_unit_follows_the_size() {
        let is = |unit, size, name, factor| {
            assert_eq!(scale(unit, size), Scale { unit: name, size: factor }, "{size} {unit}");
        };
        is("m/s", 0.004, "mm/s", 1e-3);
        is("m/s", 0.21, "m/s", 1.0);
        is("m/s", 3.0, "m/s", 1.0);
        is("ug", 12_000.0, "mg", 1e3);
        is("ug", 30.0, "ug", 1.0);
        is("", 2e-4, "ppm", 1e-6);
        is("", 0.017, "%", 1e-2);
        is("m", 5200.0, "km", 1e3);
        is("m", 300.0, "m", 1.0);
        is("deg", 1e-12, "udeg", 1e-6);
        is("furlong", 1e-3, "furlong", 1.0);
        is("deg", f64::NAN, "deg", 1.0);
    }

    #[test]
    fn a_value_below_its_sigma_has_the_decimals_of_its_sigma() {
        let of = |value, sigma| with_sigma(value, sigma);
        assert_eq!(of(-4.88e-6, 0.101), "0.000 ± 0.101");
        assert_eq!(of(-0.00546, 0.00112), "-0.00546 ± 0.00112");
        assert_eq!(of(0.262, 0.781), "0.262 ± 0.781");
        assert_eq!(of(12.0, 105.0), "12.0 ± 105");
    }

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!([0.0012345, -12.345, 98765.0].map(short), ["0.00123", "-12.3", "98800"]);
        assert_eq!(short(1.5e-9), "1.50e-9");
        // rounded up to the next power, and no negative zero
        assert_eq!([0.0099999, 9.9999, -0.0].map(short), ["0.0100", "10.0", "0"]);
    }
}
