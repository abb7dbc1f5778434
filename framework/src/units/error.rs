//! Errors of quantities and units.

use super::unit::nearest;

/// The reason why a text is not a quantity of the dimension needed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum UnitError {
    /// A number without the unit that its dimension needs.
    #[error("{dimension} needs a unit, e.g. \"{example}\"")]
    Missing {
        /// The dimension needed, with its article.
        dimension: String,
        /// A value of that dimension.
        example: String,
    },
    /// A unit that does not exist.
    #[error("unknown unit '{unit}'{}", remedy(unit, usual.as_deref()))]
    Unknown {
        /// The unit as found.
        unit: String,
        /// The usual units of what is needed, which the text names if no unit is near the one found.
        usual: Option<String>,
    },
    /// A unit of a channel that is not SI.
    #[error("'{unit}' is not SI, as samples are: declare '{si}', and convert in the source")]
    NotSi {
        /// The unit as found.
        unit: String,
        /// The SI unit of its dimension.
        si: String,
    },
    /// A unit of another dimension.
    #[error("found '{unit}' which is {found}, {needed} is needed, e.g. {examples}")]
    Dimension {
        /// The unit as found.
        unit: String,
        /// The dimension of that unit.
        found: String,
        /// The dimension needed.
        needed: String,
        /// Some units of the dimension needed.
        examples: String,
    },
    /// A unit expression that cannot be parsed.
    #[error("cannot read the unit '{unit}': {reason}")]
    Expression {
        /// The expression as found.
        unit: String,
        /// The violation of the syntax.
        reason: String,
    },
    /// A text that does not start with a number.
    #[error(
        "found \"{text}\", which does not start with a number; {needed} is needed, \
         e.g. \"{example}\""
    )]
    Number {
        /// The text as found.
        text: String,
        /// The dimension needed.
        needed: String,
        /// A value of that dimension.
        example: String,
    },
    /// A value that is NaN, infinite, or too large for an `f64`.
    #[error("found \"{text}\", a finite number is needed")]
    NotFinite {
        /// The text as found.
        text: String,
    },
    /// A latitude or longitude that is not written as charts have it.
    #[error("found \"{text}\": {reason}; a {needed} is needed, e.g. \"{example}\"")]
    Coordinate {
        /// The text as found.
        text: String,
        /// The mistake.
        reason: String,
        /// The coordinate needed.
        needed: &'static str,
        /// A value of that coordinate.
        example: &'static str,
    },
    /// A value in a scenario that is too large to be meant.
    #[error("found \"{text}\", which is beyond {limit}; check the number and its unit")]
    TooLarge {
        /// The value as printed.
        text: String,
        /// The largest value, in SI.
        limit: String,
    },
}

/// The nearest unit, or the usual ones. Programs try texts as units: only an error that is shown looks for them.
fn remedy(unit: &str, usual: Option<&str>) -> String {
    let near = nearest(unit).map(|near| format!("; did you mean '{near}'?"));
    near.or_else(|| usual.map(|usual| format!("; {usual}"))).unwrap_or_default()
}
