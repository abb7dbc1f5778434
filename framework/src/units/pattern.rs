//! Regular expressions of the quantities of a dimension, for the JSON Schema: an editor then marks a
//! speed of `"1 m"`.
//!
//! A regular expression cannot add exponents. It lists the forms in which a dimension is written,
//! such as length/time, and lets any expression pass that has a product or an unusual power; the
//! program checks these.

use crate::units::dimension::Exponents;
use crate::units::unit::{UNITS, dimensions};

/// A number, as the quantities read it.
const NUMBER: &str = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?";

/// Expressions that only the program checks: with a product, a quotient of one, a root of a compound
/// unit, or a power other than 2.
const UNUSUAL: &str = r".*[*·³].*|1\s*/.*|.*\^\s*-?[013-6].*|.*(sqrt\s*\(|√\s*\()[^)]*/.*";

/// A unit of one dimension in a quotient: itself, its square or its root.
#[derive(Clone, Copy)]
struct Factor {
    exponents: Exponents,
    form: Form,
}

#[derive(Clone, Copy)]
enum Form {
    Plain,
    Square,
    Root,
}

/// The regular expression of the quantities of a dimension.
pub fn pattern(exponents: Exponents) -> String {
    let ratio = exponents == [0; 6];
    let factors = factors();
    let below: Vec<_> = factors.iter().filter(|f| f.divides()).collect();
    // what divides has a length and a time alone
    let others =
        |[_, mass, _, angle, temperature, current]: Exponents| [mass, angle, temperature, current];
    let above =
        |f: &&Factor| matches!(f.form, Form::Plain) && others(f.exponents) == others(exponents);
    let mut forms = Vec::new();
    for a in factors.iter().filter(above) {
        let mut add = |rest: &[Factor]| {
            let total = rest.iter().fold(a.exponents, |sum, f| difference(sum, f.exponents));
            if total == exponents {
                let below = rest.iter().map(|f| format!(r"\s*/\s*{}", f.pattern()));
                forms.push(format!("{}{}", a.pattern(), below.collect::<String>()));
            }
        };
        add(&[]);
        // a ratio is written as a number or in per cent
        if !ratio {
            for b in &below {
                add(&[**b]);
                below.iter().for_each(|c| add(&[**b, **c]));
            }
        }
    }
    forms.push(UNUSUAL.to_owned());
    let unit = forms.join("|");
    let optional = if ratio { "?" } else { "" };
    format!(r"^\s*{NUMBER}\s*({unit}){optional}\s*$")
}

/// Every dimension that has a unit of its own, in its forms.
fn factors() -> Vec<Factor> {
    let plain = |exponents: Exponents| Factor { exponents, form: Form::Plain };
    let square =
        |exponents: Exponents| Factor { exponents: exponents.map(|e| 2 * e), form: Form::Square };
    let root =
        |exponents: Exponents| Factor { exponents: exponents.map(|e| e / 2), form: Form::Root };
    let forms = |e: Exponents| [plain(e), square(e), root(e)];
    dimensions().into_iter().flat_map(forms).collect()
}

fn difference(a: Exponents, b: Exponents) -> Exponents {
    std::array::from_fn(|k| a[k] - b[k])
}

impl Factor {
    /// The dimension of the unit itself.
    fn base(&self) -> Exponents {
        match self.form {
            Form::Plain => self.exponents,
            Form::Square => self.exponents.map(|e| e / 2),
            Form::Root => self.exponents.map(|e| 2 * e),
        }
    }

    /// True for the factors that stand below a fraction line: times, rates and lengths.
    fn divides(&self) -> bool {
        matches!(self.base(), [0, 0, -2 | 2, 0, 0, 0] | [2, 0, 0, 0, 0, 0])
    }

    fn pattern(&self) -> String {
        let names = names(self.base());
        match self.form {
            Form::Plain => format!("({names})"),
            Form::Square => format!(r"({names})\s*(\^\s*2|²)"),
            Form::Root => format!(r"(sqrt\s*\(\s*({names})\s*\)|√\s*\(?\s*({names})\s*\)?)"),
        }
    }
}

/// The names of the units of a dimension with their prefixes.
fn names(exponents: Exponents) -> String {
    let mut names = Vec::new();
    for (units, _, _, _, prefixes) in UNITS.iter().filter(|row| row.3 == exponents) {
        let prefixes: String =
            prefixes.chars().map(|p| if p == 'u' { "uµμ".to_owned() } else { p.into() }).collect();
        let prefix = if prefixes.is_empty() { prefixes } else { format!("[{prefixes}]?") };
        names.extend(units.iter().map(|unit| format!("{prefix}{unit}")));
    }
    names.join("|")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_or_a_root_in_a_quotient_is_one_of_a_unit_that_divides() {
        let (time, rate, length) = ([0, 0, 2, 0, 0, 0], [0, 0, -2, 0, 0, 0], [2, 0, 0, 0, 0, 0]);
        let [plain, square, root] = [Form::Plain, Form::Square, Form::Root];
        for base in [time, rate, length, [0, 2, 0, 0, 0, 0], [2, 0, -2, 0, 0, 0]] {
            for (form, exponents) in
                [(plain, base), (square, base.map(|e| 2 * e)), (root, base.map(|e| e / 2))]
            {
                let factor = Factor { exponents, form };
                assert_eq!(factor.base(), base);
                assert_eq!(factor.divides(), [time, rate, length].contains(&base), "{base:?}");
            }
        }
    }

    #[test]
    fn the_names_in_the_pattern_of_a_dimension_are_its_units() {
        for exponents in dimensions() {
            let names = names(exponents);
            for name in names.split('|') {
                let unit = name.rsplit("]?").next().unwrap_or_default();
                let found = crate::units::parse_unit(unit).map(|unit| unit.exponents());
                assert_eq!(found.ok(), Some(exponents), "{unit} of {names}");
            }
        }
        assert_eq!(names([2, 0, 0, 0, 0, 0]), "[kcmuµμ]?m|ft|nmi");
    }

    /// A speed is a length over a time, and an acceleration one over its square; a schema that
    /// lacked these would mark right values.
    #[test]
    fn a_pattern_lists_the_quotients_of_a_dimension_and_no_others() {
        let (time, length) = (names([0, 0, 2, 0, 0, 0]), names([2, 0, 0, 0, 0, 0]));
        let speed = format!(r"({length})\s*/\s*({time})|");
        let acceleration = format!(r"({length})\s*/\s*({time})\s*(\^\s*2|²)|");
        for (exponents, form) in
            [([2, 0, -2, 0, 0, 0], &speed), ([2, 0, -4, 0, 0, 0], &acceleration)]
        {
            let text = pattern(exponents);
            assert!(text.contains(form.as_str()), "{form} in {text}");
        }
        assert!(!pattern([2, 0, -4, 0, 0, 0]).contains(&speed));
        // a ratio may have no unit
        assert!(
            pattern([0; 6]).ends_with(r")?\s*$")
                && !pattern([2, 0, 0, 0, 0, 0]).ends_with(r")?\s*$")
        );
    }
}
