//! Results of a calibration as readers see them, in a terminal and on a page.

use crate::{CalibrationData, Estimate};
use navfuse_segments::Kind;

/// Names of the components of a calibration.
pub const COMPONENTS: [&str; 4] = ["k", "roll", "pitch", "yaw"];

/// Factor from `k` (1) or an angle (rad) to what is printed: degrees for angles.
pub fn unit(i: usize) -> f64 {
    if i == 0 { 1.0 } else { 1_f64.to_degrees() }
}

/// Decimals of `k`, and of an angle in degrees.
pub fn decimals(i: usize) -> usize {
    if i == 0 { 5 } else { 3 }
}

/// Formats `k` (1) or an angle (rad) with its 1-sigma, if that is known; a dash where the component
/// is not determined.
pub fn value(estimate: &Estimate, i: usize) -> String {
    if !estimate.determined[i] {
        return "-".to_owned();
    }
    let (decimals, value) = (decimals(i), estimate.values()[i] * unit(i));
    let sigma = estimate.sigma();
    let sigma = sigma.map_or_else(String::new, |s| format!(" ± {:.decimals$}", s[i] * unit(i)));
    format!("{value:.decimals$}{sigma}")
}

/// The explanation of "settles after" and of the dash.
pub fn settles() -> String {
    let (k, yaw) = Estimate::SETTLED;
    let yaw = yaw.to_degrees();
    format!(
        "settles: k within {k} and yaw within {yaw:.1} deg of the end from then on; \
         -: not determined"
    )
}

/// The segments that were found.
pub fn found(data: &CalibrationData) -> String {
    let of =
        |kind: Kind| format!("{kind} {:.0} s ({})", data.duration(kind), data.of(kind).count());
    let kinds = [Kind::Static, Kind::TypeI, Kind::TypeII, Kind::Steady].map(of);
    kinds.join(", ")
}

/// The notes of all methods, each with the names of the methods that have it, and the reasons why a
/// method cannot be applied.
pub fn notes<'a>(
    methods: impl Iterator<Item = (&'a str, Result<&'a Estimate, String>)>,
) -> Vec<(String, Vec<&'a str>)> {
    let mut notes: Vec<(String, Vec<&str>)> = Vec::new();
    for (name, result) in methods {
        let all = match result {
            Ok(estimate) => estimate.notes.clone(),
            Err(why) => vec![format!("not possible: {why}")],
        };
        for note in all {
            match notes.iter_mut().find(|(text, _)| *text == note) {
                Some((_, names)) => names.push(name),
                None => notes.push((note, vec![name])),
            }
        }
    }
    notes
}
