//! The estimator of a run: its type by name, and what it can do.

use crate::compose::Composition;
use crate::compose::estimator::{Creator, Estimator};
use crate::document::{DocumentError, Node, unknown};
use crate::filter::{Ekf, Timeline, Ukf, Unscented, untested};
use crate::model::error::ComposeError;
use crate::model::record::Epoch;
use crate::model::sensor::Role;
use crate::model::sensor::rule::RuleType;
use crate::plugin::Registry;
use crate::session::outputs::Outputs;
use crate::smooth::{Relinearised, products_matter};
use crate::units::time::Time;

/// Finds the type of estimator of that name.
pub(crate) fn find(
    registry: &Registry,
    root: &Node<'_>,
    name: &str,
) -> Result<Creator, DocumentError> {
    let all: Vec<Creator> = [Creator::of::<Ekf>(), Creator::of::<Ukf>()]
        .into_iter()
        .chain(registry.estimators())
        .collect();
    all.iter().find(|creator| creator.name == name).copied().ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|creator| creator.name).collect();
        let place = root.get("estimator").and_then(|table| table.get("type"));
        place.unwrap_or_else(|| root.clone()).error(unknown("estimator type", name, &names))
    })
}

/// Ends the estimator. Where that changes its estimate, the comparisons of other times do not hold.
pub(crate) fn finish(estimator: &mut dyn Estimator, outputs: &mut Outputs) {
    estimator.has_jumped();
    estimator.finish(outputs);
    if estimator.has_jumped() {
        outputs.statistics.forget_comparisons(estimator.time());
    }
}

/// Rejects a composition that its estimator cannot run.
pub(crate) fn check(composition: &Composition, root: &Node<'_>) -> Result<(), DocumentError> {
    let place = root.get("estimator").unwrap_or_else(|| root.clone());
    if composition.estimator.lag().is_some() && composition.estimator.passes() > 1 {
        let message = "a further pass needs the whole run; remove `passes` or `lag`";
        return Err(ComposeError::new("passes", message).at(&place));
    }
    let creator = composition.creator;
    if creator.name == Creator::of::<Ukf>().name {
        check_rules(root)?;
    }
    (creator.check)(composition).map_err(|e| e.at(&place))?;
    // late samples and the smoother need snapshots, and linear steps
    let late = composition.sensors.iter().find(|sensor| sensor.late.is_some());
    let lacks = if composition.estimator.smooths() && !creator.smooths {
        let message = "the smoother needs an estimator that linearises, such as type = \"ekf\"; \
                       remove `smooth`";
        Some(message.to_owned())
    } else {
        late.filter(|_| !creator.linearises).map(|sensor| {
            format!(
                "late samples need an estimator that returns to snapshots, such as type = \"ekf\"; \
                 remove `late` of [sensor.{}]",
                sensor.info.name
            )
        })
    };
    lacks.map_or(Ok(()), |message| Err(ComposeError::new("type", message).at(&place)))
}

/// Creates the estimator of a composition.
pub(crate) fn create(composition: Composition) -> Box<dyn Estimator> {
    let again = composition.estimator.relinearise();
    let decides = composition.estimator.decides_to_relinearise();
    let watches = decides && products_matter(&composition);
    let estimator = (composition.creator.create)(composition);
    match again {
        Some(span) => Box::new(Relinearised::new(estimator, span)),
        None if watches => Box::new(Relinearised::watching(estimator)),
        None => estimator,
    }
}

/// Limits the run to one linearisation of each sample if its estimator cannot repeat it, with a
/// note. Another note is about sensors that are not tested.
pub(crate) fn settle(composition: &mut Composition) {
    let untested = untested(&composition.sensors);
    composition.notes.extend(untested.map(|text| ("estimator".to_owned(), text)));
    let Some(obstacle) = obstacle(composition) else { return };
    let text = if composition.estimator.relinearise().is_some() {
        Some(format!("`relinearise` has no effect {obstacle}"))
    } else if composition.estimator.passes() == 1 && products_matter(composition) {
        Some(format!("{PRODUCTS}, and `relinearise` has no effect {obstacle}"))
    } else {
        None
    };
    composition.estimator.linearise_once();
    composition.notes.extend(text.map(|text| ("estimator".to_owned(), text)));
}

/// What a run neglects if it cannot linearise its samples again.
const PRODUCTS: &str = "with priors as wide as these, the processes neglect products of errors that \
                        matter, at rest above all: states may be wrong beyond their sigma";

/// The reason why a composition cannot linearise samples again.
fn obstacle(composition: &Composition) -> Option<String> {
    let transient = composition.layout.blocks.iter().find(|b| b.label.is_some());
    if composition.estimator.smooths() {
        let text = "on a smoothed run; `passes` linearises all its samples again";
        Some(text.to_owned())
    } else if !composition.creator.smooths {
        let name = composition.creator.name;
        Some(format!("with type = {name:?}, but with type = \"ekf\""))
    } else {
        transient.map(|block| format!("with blocks that come and go, such as {}", block.name))
    }
}

/// Rejects update rules other than the unscented filter's.
fn check_rules(root: &Node<'_>) -> Result<(), DocumentError> {
    let sensors = root.get("sensor").map_or_else(|| Ok(Vec::new()), |table| table.entries())?;
    let tables = sensors.into_iter().map(|(_, node)| node).chain(root.get("estimator"));
    for rule in tables.filter_map(|table| table.get("update")) {
        if rule.parse::<String>()? != Unscented::TYPE {
            return Err(rule.error(
                "with estimator.type = \"ukf\" every sensor has the rule \"ukf\"; remove it, or set \
                 estimator.type = \"ekf\"",
            ));
        }
    }
    Ok(())
}

/// Shows the estimate after all samples that have arrived; the filter itself stays where it is.
pub(crate) fn newest<T>(
    timeline: &mut Option<Timeline>,
    estimator: &mut dyn Estimator,
    look: impl FnOnce(&Epoch<'_>) -> T,
) -> Option<T> {
    match (timeline, estimator.settled()) {
        (Some(timeline), Some(filter)) => timeline.newest(filter, look),
        _ => estimator.running().then(|| look(&estimator.epoch())),
    }
}

/// The reason why the filter never started, and the remedy.
pub(crate) fn never_started(estimator: &dyn Estimator) -> String {
    let start = estimator.composition().start();
    let reference =
        estimator.composition().sensors.iter().find(|s| matches!(s.role, Role::Reference(_)));
    if let Some(stop) = estimator.composition().estimator.stop().filter(|stop| *stop < start) {
        return format!(
            "the filter never started: estimator.stop = {stop} is before \
             estimator.start = {start}; give a later one"
        );
    }
    let since = match start {
        Time::MIN => String::new(),
        start => format!(" at or after estimator.start = {start}"),
    };
    match reference {
        Some(r) if let Some(block) = estimator.lacking() => format!(
            "the filter never started: no sample of [sensor.{}] gives {}; give its initial value, \
             or let an alignment find it",
            r.info.name, block.name
        ),
        Some(r) if estimator.composition().estimator.from_reference() => format!(
            "the filter never started: no sample of [sensor.{}]{since}; check the time stamps, or \
             give the initial values and estimator.initial = \"given\"",
            r.info.name
        ),
        _ => format!("the filter never started: no sample of the driving sensor{since}"),
    }
}
