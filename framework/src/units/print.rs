//! Prints a value in the unit that makes it short.

use crate::units::dimension::{Exponents, find, si_unit};
use crate::units::unit::parse_unit;

/// Length in characters below which a number counts as short.
const SHORT: usize = 7;

/// A value and its unit as on a data sheet. The text reads back as the same `f64`. The unit is the
/// first usual one in which the number is short, else the first in which it can be written at all.
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

/// The shortest decimal in that unit that reads back as `si` to the last bit, if there is one.
fn number_in(si: f64, unit: &str) -> Option<String> {
    let to_si =
        |x: f64| if unit.is_empty() { Some(x) } else { parse_unit(unit).ok().map(|u| u.to_si(x)) };
    let near = si / to_si(1.0)?;
    // 17 significant digits distinguish every f64 from its neighbours
    (0..17)
        .filter_map(|digits| format!("{near:.digits$e}").parse().ok())
        .find(|x| to_si(*x).map(f64::to_bits) == Some(si.to_bits()))
        .map(decimal)
}

/// Decimal notation, or scientific where that is much shorter.
fn decimal(x: f64) -> String {
    let (plain, scientific) = (x.to_string(), format!("{x:e}"));
    if scientific.len() + SHORT < plain.len() { scientific } else { plain }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_in_scientific_notation_where_that_saves_eight_characters() {
        // 5 characters against 12, then 13; 8 against 15, then 16
        assert_eq!(decimal(1e-10), "0.0000000001");
        assert_eq!(decimal(1e-11), "1e-11");
        assert_eq!(decimal(1.25e-11), "0.0000000000125");
        assert_eq!(decimal(1.25e-12), "1.25e-12");
        // 4 against 11, then 12
        assert_eq!(decimal(1e10), "10000000000");
        assert_eq!(decimal(1e11), "1e11");
    }
}
