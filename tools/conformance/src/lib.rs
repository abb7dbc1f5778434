//! Conformance tests for plugins: one call checks every type that a plugin registers.
//!
//! ```
//! # use navfuse_ins::InsPlugin as MyPlugin;
//! # const SCENARIO: &str = r#"
//! # [process.ins]
//! # attitude = { sigma = "0.1 deg" }
//! # velocity = { sigma = "1 cm/s" }
//! # position = { sigma = "1 m" }
//! # [sensor.imu]
//! # gyro_noise = "0.1 deg/h/sqrt(Hz)"
//! # accel_noise = "10 ug/sqrt(Hz)"
//! # simulation = { rate = "20 Hz" }
//! # [sensor.reference]
//! # simulation = { rate = "1 Hz" }
//! # [source.simulation]
//! # segments = [{ type = "surge", duration = "20 s", speed = "1 m/s" }]
//! # "#;
//! // under #[test]
//! fn it_conforms() -> Result<(), navfuse_conformance::Failed> {
//!     navfuse_conformance::check(&[&MyPlugin], SCENARIO)
//! }
//! # it_conforms().unwrap();
//! ```
//!
//! The scenario is the TOML of a run of one or a few minutes on simulated samples. If only sources
//! and sinks are checked, the samples may be recorded. The call checks the types in the scenario
//! that the given plugins register. The IMU, the strapdown process and the simulation are always
//! available.

mod channels;
mod consistency;
mod display;
mod jacobian;
mod lab;
mod noise;
mod parameters;
mod repeat;
mod seams;
mod sigma;
mod streams;
mod transition;

use lab::{Lab, Types};
use navfuse_core::plugin::{Kind, Plugin, Registry, SensorType};
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;

/// Checks every process, sensor, source and sink type that the plugins register and the scenario
/// (TOML) uses.
///
/// # Errors
/// All failed checks, each with the problem, the numbers, and the remedy.
pub fn check(plugins: &[&dyn Plugin], scenario: &str) -> Result<(), Failed> {
    check_with(plugins, &[], scenario)
}

/// Checks the types of `plugins` as [`check`] does, in a scenario that also uses types of `others`,
/// such as the sensors whose samples a source reads.
///
/// # Errors
/// As [`check`].
pub fn check_with(
    plugins: &[&dyn Plugin],
    others: &[&dyn Plugin],
    scenario: &str,
) -> Result<(), Failed> {
    let report = report_with(plugins, others, scenario);
    println!("{report}"); // shown by `cargo test -- --nocapture`
    if report.findings.iter().any(|f| f.outcome.is_err()) { Err(Failed(report)) } else { Ok(()) }
}

/// Checks one sensor type that a program registers without a plugin.
///
/// # Errors
/// As [`check`].
pub fn check_sensor<S: SensorType>(scenario: &str) -> Result<(), Failed> {
    struct Only<S>(PhantomData<S>);
    impl<S: SensorType> Plugin for Only<S> {
        fn build(&self, registry: &mut Registry) {
            registry.sensor::<S>();
        }
    }
    check(&[&Only::<S>(PhantomData)], scenario)
}

/// Runs the checks of [`check`], and returns all findings, also of checks that passed.
pub fn report(plugins: &[&dyn Plugin], scenario: &str) -> Report {
    report_with(plugins, &[], scenario)
}

fn report_with(plugins: &[&dyn Plugin], others: &[&dyn Plugin], scenario: &str) -> Report {
    report_types(&lab::registry(plugins, others), scenario)
}

/// Checks types of a registry, each a kind and a name, and returns all findings: for types that a
/// program registers without a plugin.
pub fn report_registered(registry: Registry, checked: &[(Kind, &str)], scenario: &str) -> Report {
    let checked = checked.iter().map(|(kind, name)| (*kind, Arc::from(*name))).collect();
    report_types(&Types { registry, checked }, scenario)
}

fn report_types(types: &Types, scenario: &str) -> Report {
    let mut report = Report::default();
    match Lab::new(types, scenario) {
        Err(message) => report.add("scenario", "the scenario", Err(message)),
        Ok(lab) => {
            if let Some(ended) = &lab.ended {
                report.add("scenario", "the scenario", Err(Failure::new(ended)));
            }
            parameters::check(&lab, &mut report);
            if lab.has_models() {
                channels::check(&lab, &mut report);
                display::check(&lab, &mut report);
                jacobian::check(&lab, &mut report);
                noise::check(&lab, &mut report);
                sigma::check(&lab, &mut report);
                transition::check(&lab, &mut report);
            }
            repeat::check(&lab, &mut report);
            if lab.has_models() {
                consistency::check(&lab, &mut report);
            }
            streams::check(&lab, &mut report);
            if lab.has_models() {
                report.next.push(NEXT.to_owned());
            }
        }
    }
    report
}

/// The last line of a report.
const NEXT: &str = "the runs judge the end of this scenario alone: now `navfuse monte-carlo SCENARIO --runs 100` \
                    with the widest prior and the longest dive that you expect";

/// Reason why a check fails.
#[derive(Debug)]
#[non_exhaustive]
pub struct Failure {
    /// The problem, the numbers, and the remedy.
    pub message: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Failure {
    fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), source: None }
    }

    /// Wraps an error of the framework.
    fn caused_by(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self { message: error.to_string(), source: Some(Box::new(error)) }
    }

    /// Wraps an error, and names the step of the check that failed.
    fn during(
        what: impl fmt::Display,
        error: impl std::error::Error + Send + Sync + 'static,
    ) -> Self {
        Self { message: format!("{what}: {error}"), source: Some(Box::new(error)) }
    }
}

impl From<String> for Failure {
    fn from(message: String) -> Self {
        Self::new(message)
    }
}

impl From<&str> for Failure {
    fn from(message: &str) -> Self {
        Self::new(message)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|cause| cause as &(dyn std::error::Error + 'static))
    }
}

/// The finding of one check about one type.
#[derive(Debug)]
pub struct Finding {
    /// The check: `jacobian`, `noise`, `transition`, ...
    pub check: &'static str,
    /// The type and its table: `sensor type dvl ([sensor.port])`.
    pub about: String,
    /// The numbers of a check that passed, or the reason why it failed.
    pub outcome: Result<String, Failure>,
}

/// The findings of all checks.
#[derive(Debug, Default)]
pub struct Report {
    /// Findings in the order of the checks.
    pub findings: Vec<Finding>,
    /// What the checks do not decide, and what to do next.
    pub next: Vec<String>,
}

impl Report {
    fn add(
        &mut self,
        check: &'static str,
        about: impl Into<String>,
        outcome: Result<String, Failure>,
    ) {
        self.findings.push(Finding { check, about: about.into(), outcome });
    }

    /// The findings that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|f| f.outcome.is_err())
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.outcome {
            Ok(measured) => write!(f, "ok    {:<12} {}: {measured}", self.check, self.about),
            Err(wrong) => write!(f, "WRONG {:<12} {}: {wrong}", self.check, self.about),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.findings.iter().try_for_each(|finding| writeln!(f, "{finding}"))?;
        self.next.iter().try_for_each(|next| writeln!(f, "next  {next}"))
    }
}

/// A plugin that does not conform.
pub struct Failed(
    /// All findings, also those that passed.
    pub Report,
);

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} checks failed", self.0.failures().count(), self.0.findings.len())?;
        self.0.failures().try_for_each(|finding| write!(f, "\n{finding}"))
    }
}

// a test that returns an error prints it with `Debug`
impl fmt::Debug for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Failed {}

/// The example in README.md is compiled with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
