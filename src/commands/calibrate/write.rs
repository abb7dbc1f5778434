//! Writing a scenario with the calibration that was found.

use super::edit;
use crate::error::{CommandError, Result};
use navfuse_calibration::{CalibrationData, Estimate};
use navfuse_core::document::{Document, key};
use navfuse_core::files::write_whole;
use std::path::Path;

/// Writes the scenario with the estimate. A component that is not determined keeps its value.
pub fn scenario(
    document: &mut Document,
    path: &Path,
    data: &CalibrationData,
    e: &Estimate,
    keep_prior: bool,
) -> Result<()> {
    let velocity = data.velocity()?;
    let name = &velocity.samples.name;
    let (found, initial) = (e.values(), velocity.initial.angles());
    let (before, prior) =
        ([velocity.initial.k, initial.x, initial.y, initial.z], velocity.angle_sigma);
    let prior = [velocity.scale_sigma, prior.x, prior.y, prior.z];
    let value = |i: usize| if e.determined[i] { found[i] } else { before[i] };
    let sigma = |i: usize| match e.sigma() {
        Some(s) if !keep_prior && e.determined[i] => s[i],
        _ => prior[i],
    };
    if !keep_prior && e.sigma().is_none() {
        return Err(CommandError::Request(
            "this method has no sigma to write: use --method io-dvlc, or --initialise, which keeps \
             the prior"
                .to_owned(),
        ));
    }
    let degrees = |x: f64| format!("\"{:.6} deg\"", x.to_degrees());
    let angles =
        |of: &dyn Fn(usize) -> f64| format!("[{}]", [1, 2, 3].map(|i| degrees(of(i))).join(", "));
    let sensor = key(name);
    let mut set = |block: &str, initial: String, sigma: String| -> Result<()> {
        let whole =
            document.root().get("sensor").and_then(|s| s.get(name)).and_then(|s| s.get(block));
        if whole.is_some_and(|node| node.value().is_table()) {
            document.set(&format!("sensor.{sensor}.{block}.initial={initial}"))?;
            document.set(&format!("sensor.{sensor}.{block}.sigma={sigma}"))?;
        } else {
            document.set(&format!(
                "sensor.{sensor}.{block}={{ initial = {initial}, sigma = {sigma} }}"
            ))?;
        }
        Ok(())
    };
    if sigma(0) > 0.0 {
        set("scale", format!("{:.8}", value(0)), format!("{:.8}", sigma(0)))?;
    }
    if (1..4).all(|i| sigma(i) > 0.0) {
        set("misalignment", angles(&value), angles(&sigma))?;
    }
    write_whole(path, edit::text(document)?.as_bytes()).map_err(CommandError::cannot_write(path))
}
