//! Numbers of a report as its readers see them, in a terminal and on a page.

use crate::StateReport;
use navfuse_core::model::chi_square::Band;

/// Formats four significant digits; nothing for a value that is not known.
pub fn number(value: Option<f64>) -> String {
    significant(value, 4)
}

/// Formats three significant digits, so that the errors of a campaign have room in a terminal of 80 columns
/// and on a phone; nothing for a value that is not known.
pub fn three(value: Option<f64>) -> String {
    significant(value, 3)
}

/// Formats that many significant digits.
fn significant(value: Option<f64>, digits: u8) -> String {
    let Some(value) = value.filter(|v| v.is_finite()) else { return String::new() };
    let decimals = f64::from(digits) - 1.0 - value.abs().max(1e-12).log10().floor();
    format!("{value:.*}", decimals.clamp(0.0, 9.0) as usize)
}

/// Formats a ratio with two decimals.
pub fn ratio(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| format!("{v:.2}"))
}

/// Formats a band with two decimals.
pub fn band(band: Option<Band>) -> String {
    band.map_or_else(String::new, |b| format!("{:.2} to {:.2}", b.low, b.high))
}

/// Returns `true` for the first component of a state, whose row has the name.
pub fn begins(states: &[StateReport], k: usize) -> bool {
    k == 0 || states[k - 1].component.state != states[k].component.state
}
