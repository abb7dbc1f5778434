//! Applying methods of calibration to the samples of a scenario.

use super::filter;
use super::outcome::Outcome;
use crate::error::{CommandError, Result};
use navfuse_calibration::{AttitudeSource, CalibrationData, Method};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::Scenario;
use navfuse_segments::Recording;

/// The methods to apply.
pub struct Request {
    /// The methods of the literature.
    pub methods: Vec<Method>,
    /// The attitude that they use.
    pub attitude: AttitudeSource,
    /// True if the scenario's filter is one of the methods.
    pub filter: bool,
}

/// Applies the methods to the samples of a scenario.
pub fn outcomes(
    registry: &Registry,
    document: &Document,
    request: &Request,
    progress: &dyn Fn(Progress),
) -> Result<(CalibrationData, Vec<Outcome>)> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording =
        Recording::gather(scenario.assemble(None)?, |now, end| progress(Progress { now, end }))?;
    let data = CalibrationData::new(recording, request.attitude)?;
    let outcome = |m: &Method| Outcome {
        name: m.name().into(),
        sensors: m.sensors().into(),
        result: m.estimate(&data).map_err(CommandError::from),
    };
    let mut outcomes: Vec<Outcome> = request.methods.iter().map(outcome).collect();
    if request.filter {
        outcomes.extend(filter::outcomes(registry, document, &data, progress)?);
    }
    Ok((data, outcomes))
}
