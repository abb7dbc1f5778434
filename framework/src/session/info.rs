//! The facts about a run.

use crate::compose::Composition;
use crate::model::stream::RunInfo;
use crate::session::verdict::accuracy;

/// The facts about a run that its sinks receive first.
pub(super) fn run_info(composition: &Composition) -> RunInfo {
    RunInfo {
        name: composition.name.clone(),
        description: composition.description.clone(),
        scenario: composition.text.clone(),
        seed: composition.seed,
        simulated: composition.simulated,
        smoothed: composition.estimator.smooths(),
        reference: accuracy(composition).map(|(_, accuracy)| accuracy),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        layout: (*composition.layout).clone(),
        sensors: composition.sensors.iter().map(|s| s.info.clone()).collect(),
    }
}
