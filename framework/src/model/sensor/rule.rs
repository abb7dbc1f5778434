//! Update rules: how a sample corrects the estimate.

use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::{Covariance, Update};

/// An update rule: what it does to the linearisation of a sample, and when. Each sensor has a rule
/// of its own, with its work space.
///
/// The filter linearises the model at the estimate, shows the result to [`Rule::linearised`], judges
/// the innovation by the gate, shows an accepted one to [`Rule::accepted`], and updates. A rule
/// that changes nothing is the extended Kalman filter.
///
/// A rule that trusts a curved model less, here by a noise that grows with the prior:
/// ```
/// use navfuse_core::model::sensor::rule::{Prior, Rule, RuleType};
/// use navfuse_core::plugin::Registry;
/// use navfuse_core::state::covariance::Update;
///
/// #[derive(Default)]
/// struct Wary;
///
/// impl Rule for Wary {
///     fn linearised(&mut self, prior: &Prior<'_>, update: &mut Update) {
///         let spread: f64 = update.columns.iter().map(|&c| prior.covariance.get(c, c)).sum();
///         update.r.iter_mut().for_each(|r| *r *= 1.0 + spread);
///     }
/// }
///
/// impl RuleType for Wary {
///     const TYPE: &'static str = "wary"; // [sensor.NAME] update = "wary"
/// }
/// Registry::new().rule::<Wary>();
/// ```
pub trait Rule: Send {
    /// Changes innovation, Jacobian and noise before the gate judges the sample.
    fn linearised(&mut self, _prior: &Prior<'_>, _update: &mut Update) {}

    /// Changes the linearisation of a sample that the gate accepts. Returns `true` if it did, and
    /// the filter computes the covariance of the innovation again.
    fn accepted(&mut self, _prior: &Prior<'_>, _update: &mut Update) -> bool {
        false
    }

    /// Changes the correction of the error state, `K y`, before it is injected.
    fn corrects(&self, _delta: &mut [f64]) {}

    /// Place at which the filter checks whether the neglected curvature of a model is small.
    fn check(&self) -> Check {
        Check::Before
    }
}

/// Place of the check of the curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// At the estimate before the update.
    Before,
    /// At the estimate after the update.
    After,
    /// None: the rule treats the curvature as noise.
    Never,
}

/// Estimate before an update, and the model of its sample.
#[derive(Clone, Copy)]
pub struct Prior<'a> {
    /// Layout, state and sample.
    pub at: At<'a>,
    /// Model of the sensor.
    pub model: &'a dyn AnyMeasurement,
    /// Covariance of the error state.
    pub covariance: &'a Covariance,
    /// Marks the considered error states, which no update moves.
    pub considered: &'a [bool],
}

impl std::fmt::Debug for Prior<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Prior").field("at", &self.at).finish_non_exhaustive()
    }
}

/// A type of update rule: `update = "..."` of a sensor or of `[estimator]`.
///
/// ```
/// use navfuse_core::model::sensor::rule::{Rule, RuleType};
/// /// The extended Kalman filter under another name.
/// #[derive(Default)]
/// struct Plain;
/// impl Rule for Plain {}
/// impl RuleType for Plain {
///     const TYPE: &'static str = "plain";
/// }
/// ```
pub trait RuleType: Rule + Default + 'static {
    /// The name in TOML.
    const TYPE: &'static str;

    /// Set if the rule evaluates the model itself. A sensor with a time offset measures a past
    /// state, at which only the filter evaluates models, so it cannot have such a rule.
    const EVALUATES: bool = false;
}

/// A registered type of update rule.
#[derive(Clone, Copy)]
pub struct UpdateRule {
    pub(crate) name: &'static str,
    pub(crate) evaluates: bool,
    pub(crate) create: fn() -> Box<dyn Rule>,
}

impl UpdateRule {
    /// The rule of a type.
    pub fn of<R: RuleType>() -> Self {
        Self { name: R::TYPE, evaluates: R::EVALUATES, create: || Box::new(R::default()) }
    }
}

impl std::fmt::Debug for UpdateRule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "update rule {}", self.name)
    }
}

/// Extended Kalman filter: one linearisation, at the estimate before the update.
#[derive(Clone, Copy, Debug, Default)]
pub struct Linear;

impl Rule for Linear {}

impl RuleType for Linear {
    const TYPE: &'static str = "ekf";
}

impl Default for UpdateRule {
    fn default() -> Self {
        Self::of::<Linear>()
    }
}
