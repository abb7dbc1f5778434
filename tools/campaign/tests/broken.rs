//! A campaign detects a broken filter, and the verdict names the cause. The same filter without the
//! defect passes.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_campaign::{Options, PointReport, PointVerdict, report};
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::ScaleFactor;
use navfuse_core::document::Document;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{Jacobian, MeasurementModel};
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::plugin::{Registry, SensorType};
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Scalar, Vector};
use navfuse_core::state::{Handle, View};
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Sigma, Speed};
use schemars::JsonSchema;
use serde::Deserialize;

/// Sensor of an outsider: the velocity in navigation axes with a scale factor, `z = s v^n`, and a
/// hand-written Jacobian.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Velocimeter {
    /// 1-sigma noise of one sample.
    noise: Sigma<Speed>,
    /// Scale factor.
    #[serde(default)]
    scale: ScaleFactor,
    /// Reverses the sign of the derivative with respect to the scale factor.
    #[serde(default)]
    wrong_sign: bool,
}

struct VelocimeterModel {
    velocity: Handle<Vector<3>>,
    scale: Handle<Scalar>,
    sigma: f64,
    sign: f64,
}

impl SensorType for Velocimeter {
    const TYPE: &'static str = "velocimeter";

    fn channels(&self) -> Vec<Channel> {
        ["vel_n", "vel_e", "vel_d"].map(|name| Channel::new(name, "mps")).to_vec()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(VelocimeterModel {
            velocity: composer.find("process", "ins.velocity")?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            sigma: self.noise.value().si(),
            sign: if self.wrong_sign { -1.0 } else { 1.0 },
        }))
    }
}

impl MeasurementModel<3> for VelocimeterModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let scale = x.get(self.scale);
        x.get(self.velocity) * scale
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }

    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, 3>) -> bool {
        let scale = x.get(self.scale);
        h.set(self.velocity, &SMatrix::<f64, 3, 3>::from_diagonal_element(scale));
        h.set(self.scale, &(x.get(self.velocity) * self.sign));
        true
    }
}

/// Two minutes at 50 Hz in which all states are observed. The initial errors are so small that the
/// filter is linear: the largest, 0.5 deg of misalignment and 0.5 % of scale, leave second-order
/// terms of 2 m/s x 0.5 deg x 0.5 % = 0.1 mm/s, with a DVL noise of 1 cm/s.
const SCENARIO: &str = r#"
    name = "linear"
    seed = 1

    [process.ins]
    attitude = { sigma = "0.05 deg" }
    velocity = { sigma = "1 cm/s" }
    position = { sigma = "1 m" }
    gyro_bias = { sigma = "1 deg/h" }
    accel_bias = { sigma = "100 ug" }

    [sensor.imu]
    gyro_noise = "1 deg/h/sqrt(Hz)"
    accel_noise = "300 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.dvl]
    noise = "1 cm/s"
    scale = { sigma = "0.5 %" }
    misalignment = { sigma = "0.5 deg" }
    simulation = { rate = "5 Hz" }

    [sensor.velocimeter]
    noise = "2 cm/s"
    scale = { sigma = "1 %" }
    simulation = { rate = "1 Hz" }

    [sensor.reference]
    simulation = { rate = "10 Hz" }

    [source.simulation]
    segments = [
        { type = "surge", duration = "20 s", speed = "2 m/s" },
        { type = "descend", duration = "20 s", rate = "1 m/s" },
        { type = "turn", duration = "20 s", angle = "90 deg", bank = "8 deg" },
        { type = "pulse", duration = "20 s", speed_change = "1 m/s" },
        { type = "turn", duration = "20 s", angle = "-90 deg", bank = "8 deg" },
        { type = "cruise", duration = "20 s" },
    ]
"#;

fn campaign(settings: &[&str]) -> PointReport {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    registry.sensor::<Velocimeter>();
    let mut document = Document::parse("linear.toml", SCENARIO).expect("a scenario");
    settings.iter().for_each(|s| document.set(s).expect("a setting"));
    let options = Options { runs: 60, every: Some(2.0), ..Options::default() };
    let report = report(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    report.points.into_iter().next().expect("one point")
}

/// Returns the verdict of a campaign, and prints its findings.
fn verdict(settings: &[&str]) -> PointVerdict {
    let verdict = campaign(settings).verdict.expect("runs have a verdict");
    println!("{settings:?}: {}", verdict.text);
    verdict.findings.iter().for_each(|f| println!("  {}", f.text));
    verdict
}

/// Returns the ratio of a block's errors to their sigma in the verdict.
fn factor(verdict: &PointVerdict, of: &str) -> f64 {
    verdict.findings.iter().find(|f| f.of == of).map_or(1.0, |f| f.factor)
}

#[test]
fn the_unbroken_filter_is_consistent() {
    let verdict = verdict(&[]);
    assert!(verdict.consistent, "{verdict:#?}");
    assert_eq!((verdict.text.as_str(), verdict.findings.len()), ("consistent", 0));
}

/// The scale factor moves away from the truth while its sigma shrinks; no other error is as large.
#[test]
fn a_wrong_sign_in_a_jacobian_is_found_in_its_block() {
    let verdict = verdict(&["sensor.velocimeter.wrong_sign=true"]);
    assert!(verdict.text.starts_with("overconfident in velocimeter.scale by "), "{}", verdict.text);
    // an error of one sigma becomes one of several
    assert!(factor(&verdict, "velocimeter.scale") > 3.0, "{}", verdict.text);
}

/// `Q` is ten times too small: errors due to the IMU are 3.16 times their sigma, errors due to the
/// DVL agree with their sigma, and those of the velocity are between.
#[test]
fn an_imu_with_three_times_the_stated_noise_is_found_within_seconds() {
    let verdict = verdict(&["sensor.imu.simulation.noise=3.1623"]);
    assert!(verdict.text.starts_with("overconfident in "), "{}", verdict.text);
    for of in ["ins.velocity", "ins.attitude", "dvl"] {
        assert!((1.1..3.1623).contains(&factor(&verdict, of)), "{of}: {verdict:#?}");
        let finding = verdict.findings.iter().find(|f| f.of == of);
        assert!(finding.is_some_and(|f| f.since.is_some_and(|t| t <= 4.0)), "{of}: {verdict:#?}");
    }
}

/// The gate rejects half of the good samples and passes those that fit best, so the filter gains
/// less information than it assumes. The NIS is compared with the truncated chi-square
/// distribution, so the gate alone is not a finding: an expected NIS of 3, where 1.22 is correct,
/// would be a factor of 0.64.
#[test]
fn a_gate_that_rejects_half_of_the_good_samples_is_found_as_overconfidence() {
    let report = campaign(&["sensor.dvl.gate=0.5"]);
    let verdict = report.verdict.expect("runs have a verdict");
    assert!(verdict.text.starts_with("overconfident in ins.velocity by 1."), "{}", verdict.text);
    let dvl = report.nis.iter().find(|n| n.sensor == "dvl").expect("the DVL");
    assert!(dvl.gated >= 0.5, "{}", dvl.gated);
    assert!((factor(&verdict, "dvl") - 1.0).abs() < 0.05, "{verdict:#?}");
}

/// `R` four times too large is a sigma twice too large. With a quiet IMU the innovations are mainly
/// the DVL's noise: they are half as large as their sigma. The 20 components of the initial error,
/// which agree with their sigma, are in 20 of the 3 x 600 channels of a run: the mean square is at
/// most 0.25 + 0.75 x 20 / 1800 = 0.258, a factor of 1.97. The IMU's noise adds sqrt(q dt / R) =
/// 0.5 % to S, a factor of 1.96. The mean of 60 x 1800 squares is accurate to 0.4 %, 1-sigma: 3
/// sigma are 0.6 % of the factor.
#[test]
fn dvl_noise_of_half_the_stated_value_is_found_as_underconfidence_by_two() {
    let quiet =
        ["sensor.imu.accel_noise=10 ug/sqrt(Hz)", "sensor.imu.gyro_noise=0.1 deg/h/sqrt(Hz)"];
    let verdict = verdict(&[quiet[0], quiet[1], "sensor.dvl.simulation.noise=0.5"]);
    assert!(
        verdict.text.starts_with("underconfident in the innovations of dvl by "),
        "{}",
        verdict.text
    );
    let factor = 1.0 / factor(&verdict, "dvl");
    assert!((1.95..=2.01).contains(&factor), "{factor}");
    assert!(factor_of_the_text(&verdict.text) == format!("{factor:.2}"), "{}", verdict.text);
}

/// Returns the number after `by`.
fn factor_of_the_text(text: &str) -> String {
    text.split(" by ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap_or("").to_owned()
}
