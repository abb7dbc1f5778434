//! The estimator of a run: its type by name, and what only the filters of the framework can do.

use crate::compose::Composition;
use crate::compose::estimator::{Creator, Estimator};
use crate::document::{DocumentError, Node, unknown};
use crate::filter::{Ekf, Timeline, Ukf};

use crate::model::error::ComposeError;
use crate::model::record::Epoch;
use crate::model::sensor::Role;
use crate::plugin::Registry;
use crate::smooth::Relinearised;
use crate::units::time::Time;
use std::any::Any;

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

/// Rejects a composition that its estimator cannot run.
pub(crate) fn check(composition: &Composition, root: &Node<'_>) -> Result<(), DocumentError> {
    let place = root.get("estimator").unwrap_or_else(|| root.clone());
    if composition.estimator.lag().is_some() && composition.estimator.passes() > 1 {
        let message = "a further pass needs the whole run; remove `passes` or `lag`";
        return Err(ComposeError::new("passes", message).at(&place));
    }
    let creator = composition.creator;
    (creator.check)(composition).map_err(|e| e.at(&place))?;
    if [Creator::of::<Ekf>().name, Creator::of::<Ukf>().name].contains(&creator.name) {
        return Ok(());
    }
    // late samples and the smoother need snapshots of a filter of the framework
    let late = composition.sensors.iter().find(|sensor| sensor.late.is_some());
    let lacks = if composition.estimator.smooths() {
        Some("the smoother runs with type = \"ekf\" only; remove `smooth`".to_owned())
    } else {
        late.map(|sensor| {
            format!(
                "late samples need type = \"ekf\" or \"ukf\"; remove `late` of [sensor.{}]",
                sensor.info.name
            )
        })
    };
    lacks.map_or(Ok(()), |message| Err(ComposeError::new("type", message).at(&place)))
}

/// Creates the estimator of a composition.
pub(crate) fn create(composition: Composition) -> Box<dyn Estimator> {
    match composition.estimator.relinearise() {
        Some(span) => Box::new(Relinearised::new(composition, span)),
        None => (composition.creator.create)(composition),
    }
}

/// Lets each sample be linearised once where its estimator cannot linearise it again, with a note.
pub(crate) fn settle(composition: &mut Composition) {
    if composition.estimator.relinearise().is_none() {
        return;
    }
    let transient = composition.layout.blocks.iter().find(|b| b.label.is_some());
    let text = if composition.estimator.smooths() {
        "`relinearise` has no effect on a smoothed run; `passes` linearises all its samples again"
            .to_owned()
    } else if composition.creator.name != Creator::of::<Ekf>().name {
        let name = composition.creator.name;
        format!("`relinearise` has no effect with type = {name:?}, but with type = \"ekf\"")
    } else if let Some(block) = transient {
        format!("`relinearise` has no effect with blocks that come and go, such as {}", block.name)
    } else {
        return;
    };
    composition.estimator.linearise_once();
    composition.notes.push(("estimator".to_owned(), text));
}

/// The filter of the framework behind an estimator, if it is one.
pub(crate) fn filter(estimator: &dyn Estimator) -> Option<&Ekf> {
    let any: &dyn Any = estimator;
    any.downcast_ref::<Ekf>().or_else(|| any.downcast_ref::<Ukf>().map(Ukf::filter))
}

/// The filter of the framework behind an estimator, to be changed.
pub(crate) fn filter_mut(estimator: &mut dyn Estimator) -> Option<&mut Ekf> {
    own(estimator)
}

fn own(any: &mut dyn Any) -> Option<&mut Ekf> {
    if any.is::<Ekf>() {
        return any.downcast_mut::<Ekf>();
    }
    any.downcast_mut::<Ukf>().map(Ukf::filter_mut)
}

/// The filter of the framework that takes samples once no late one can precede them.
pub(crate) fn settled_mut(estimator: &mut dyn Estimator) -> Option<&mut Ekf> {
    let any: &mut dyn Any = estimator;
    if any.is::<Relinearised>() {
        return any.downcast_mut::<Relinearised>().map(Relinearised::filter_mut);
    }
    own(any)
}

/// Returns `true` once after the filter has linearised samples again: copies of it are of the past.
pub(crate) fn has_jumped(estimator: &mut dyn Estimator) -> bool {
    let any: &mut dyn Any = estimator;
    any.downcast_mut::<Relinearised>().is_some_and(Relinearised::has_jumped)
}

/// Shows the estimate after all samples that have arrived; the filter itself stays where it is.
pub(crate) fn newest<T>(
    timeline: &mut Option<Timeline>,
    estimator: &mut dyn Estimator,
    look: impl FnOnce(&Epoch<'_>) -> T,
) -> Option<T> {
    let pooled = estimator.composition().estimator.covariance_period().is_some();
    match (timeline, settled_mut(estimator)) {
        (Some(timeline), Some(filter)) => timeline.newest(filter, look),
        // the covariance of a copy is brought to the time of the estimate
        (None, Some(filter)) if pooled && filter.running() => {
            let kept = filter.snapshot();
            filter.settle(&mut ());
            let seen = look(&filter.epoch());
            filter.restore(&kept);
            Some(seen)
        }
        _ => estimator.running().then(|| look(&estimator.epoch())),
    }
}

/// The reason for which the filter never started, and the remedy.
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
