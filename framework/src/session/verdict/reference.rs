//! Comparison of the estimate with a reference at the end.
//!
//! A simulated reference is the truth. A recorded one has errors of its own: it counts with its
//! stated accuracy, or else with the accuracy of a poor satellite receiver, so that only a gross
//! difference contradicts the estimate.

use super::report::{Report, reason};
use crate::compose::Composition;
use crate::model::chi_square::sigmas;
use crate::model::record::finding::Severity;
use crate::model::record::verdict::Criterion;
use crate::model::sensor::{Accuracy, Role};
use crate::session::comparison::Compared;
use crate::units::time::Time;

/// Accuracy of a recorded reference that states none.
const ASSUMED: Accuracy = Accuracy { position: 10.0, velocity: 0.5, attitude: 0.035 };

/// Distance in sigmas from which a result must not be used, as from a prior.
const FAR: f64 = 6.0;

/// A reference, with its 1-sigma (SI) for each slot of the state that it gives.
#[derive(Clone, Debug)]
pub(crate) struct ReferenceStatistics {
    name: String,
    blocks: Vec<Stated>,
}

/// A slot of the state with the 1-sigma that the reference has there.
#[derive(Clone, Copy, Debug)]
struct Stated {
    slot: usize,
    sigma: f64,
}

/// A component of the state beside the reference.
struct Difference {
    name: String,
    error: f64,
    unit: &'static str,
    sigmas: f64,
}

/// Name and 1-sigma of the first reference of a composition: stated, or assumed for a recorded one.
pub(crate) fn accuracy(composition: &Composition) -> Option<(&str, Accuracy)> {
    let (name, stated) = composition.sensors.iter().find_map(|sensor| match &sensor.role {
        Role::Reference(reference) => Some((sensor.info.name.as_str(), reference.accuracy())),
        Role::Measurement(_) | Role::Input(_) => None,
    })?;
    let assumed = if composition.simulated { Accuracy::default() } else { ASSUMED };
    Some((name, stated.unwrap_or(assumed)))
}

impl ReferenceStatistics {
    /// Follows the first reference of a composition, if there is one.
    pub(crate) fn new(composition: &Composition) -> Option<Self> {
        let (name, Accuracy { position, velocity, attitude }) = accuracy(composition)?;
        let vehicle = composition.layout.vehicle();
        let stated = |slot: usize, sigma: f64| Stated { slot, sigma };
        let blocks = [
            vehicle.position.map(|block| stated(block.slot(), position)),
            vehicle.velocity.map(|block| stated(block.slot(), velocity)),
            vehicle.attitude.map(|block| stated(block.slot(), attitude)),
        ];
        Some(Self { name: name.to_owned(), blocks: blocks.into_iter().flatten().collect() })
    }

    /// Judges the component that is farthest from the reference, at `alpha`, the probability of a
    /// false alarm of one test. `compared` has the last comparison of each slot, and `end` is the time of the last epoch.
    pub(crate) fn judge(&self, alpha: f64, compared: &[Compared], end: Time, report: &mut Report) {
        let differences = self.blocks.iter().filter_map(|stated| {
            let compared = compared.get(stated.slot).filter(|c| c.holds_at(end))?;
            Some(differences(compared, stated.sigma))
        });
        let farthest = differences.flatten().max_by(|a, b| a.sigmas.total_cmp(&b.sigmas));
        let Some(Difference { name, error, unit, sigmas: distance }) =
            farthest.filter(|d| d.sigmas > sigmas(0.5 * alpha))
        else {
            return;
        };
        let severity = if distance >= FAR { Severity::DoNotUse } else { Severity::Doubtful };
        let text = format!(
            "at the end {name} is {error:.3} {unit} off {}, {distance:.1} sigma of estimate and \
             reference together",
            self.name
        );
        let remedy = "an error of a sensor is not modelled: look at the sensors and priors that \
                      determine the state, and at the accuracy of the reference";
        report.reasons.push(reason(Criterion::Reference, severity, "estimate", text, remedy));
    }
}

/// The components of a block beside the reference of that accuracy.
fn differences(compared: &Compared, accuracy: f64) -> impl Iterator<Item = Difference> {
    let block = compared.block();
    let display = block.spec.display.clone();
    let own = accuracy / display.scale;
    let name = block.name.clone();
    let sides = compared.error().into_iter().zip(compared.sigma()).enumerate();
    sides.filter_map(move |(k, (error, sigma))| {
        let component = display.components.get(k).copied().unwrap_or_default();
        let name = format!("{name} {component}").trim_end().to_owned();
        let sigmas = (error / sigma.hypot(own)).abs();
        sigmas.is_finite().then_some(Difference { name, error, unit: display.unit, sigmas })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::comparison::tests::velocity;

    /// A velocity that is off by `error` m/s to the east at 10 s, with a sigma of 0.3 m/s.
    fn compared(error: f64) -> Compared {
        Compared::beside(&velocity(), Time::from_nanos(10_000_000_000), [0.0, error, 0.0], 0.3)
    }

    fn judged(accuracy: f64, error: f64, end: i64) -> Option<(Severity, String)> {
        let blocks = vec![Stated { slot: 0, sigma: accuracy }];
        let reference = ReferenceStatistics { name: "reference".to_owned(), blocks };
        let mut report = Report::default();
        let end = Time::from_nanos(end * 1_000_000_000);
        reference.judge(1e-3, &[compared(error)], end, &mut report);
        report.reasons.pop().map(|reason| (reason.severity, reason.text))
    }

    /// The sigma of 0.3 m/s and an accuracy of 0.4 m/s are 0.5 m/s; the limit is 3.29 sigma.
    #[test]
    fn a_reference_counts_with_its_own_accuracy() {
        let severity = |error| judged(0.4, error, 10).map(|(severity, _)| severity);
        for sign in [1.0, -1.0] {
            assert_eq!(severity(1.64 * sign), None);
            assert_eq!(severity(1.65 * sign), Some(Severity::Doubtful));
            assert_eq!(severity(2.99 * sign), Some(Severity::Doubtful));
            assert_eq!(severity(3.01 * sign), Some(Severity::DoNotUse));
        }
        // an exact one
        let text = judged(0.0, 1.5, 10).map(|(_, text)| text).unwrap_or_default();
        assert!(text.contains("ins.velocity east is 1.500 m/s off reference, 5.0 sigma"), "{text}");
    }

    #[test]
    fn a_reference_that_ended_before_the_run_is_no_evidence() {
        assert_eq!((judged(0.0, 9.0, 12).is_some(), judged(0.0, 9.0, 13)), (true, None));
    }
}
