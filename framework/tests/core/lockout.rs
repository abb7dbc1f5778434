//! Gates, their warnings, and the recovery when every sample is gated.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::{Outcome, Rejection};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::plugin::{Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{Handle, View};
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Sigma, Speed};
use navfuse_testing::lab::{self, Bench, Lab, SCENARIO};
use schemars::JsonSchema;
use serde::Deserialize;

/// A log that measures the drift of the cart, which is its backward speed while the speedometer
/// reads zero.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct DriftLog {
    noise: Sigma<Speed>,
}

impl SensorType for DriftLog {
    const TYPE: &'static str = "drift-log";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("drift", "mps")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let drift = composer.find("drift", "cart.drift")?;
        Ok(Role::measurement(DriftModel { drift, sigma: self.noise.value().si() }))
    }
}

struct DriftModel {
    drift: Handle<Scalar>,
    sigma: f64,
}

impl MeasurementModel<1> for DriftModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.drift)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from([[self.sigma * self.sigma]])
    }
}

/// The laboratory with a log of 1 cm/s that has measured a cart at rest for 10 s, at 1 Hz.
fn logged() -> Bench {
    let mut registry = Registry::new();
    registry.add(&Lab);
    registry.sensor::<DriftLog>();
    let text = format!("{SCENARIO}[sensor.log]\ntype = \"drift-log\"\nnoise = \"1 cm/s\"\n");
    let document = Document::parse("lab.toml", &text).unwrap();
    let ekf = Ekf::new(Scenario::new(&registry, document, &[]).unwrap().compose().unwrap());
    let mut b = Bench { ekf, log: lab::Log::default() };
    for k in 0..10 {
        b.give("speed", f64::from(k), &[0.0]).give("log", f64::from(k), &[0.0]);
    }
    b
}

#[test]
fn the_thresholds_are_those_of_the_chi_square_table() {
    // Abramowitz & Stegun table 26.8, five or six digits; 0.9999 from the asymptotic expansion, to
    // two decimals
    for (p, thresholds) in [
        ("0.95", [3.84146, 5.99147, 7.81473]),
        ("0.99", [6.63490, 9.21034, 11.3449]),
        ("0.999", [10.828, 13.816, 16.266]),
        ("0.9999", [15.137, 18.421, 21.108]),
    ] {
        for channels in 1..=3 {
            let mut b = Bench::new(&[&format!("sensor.fix.gate={p}")]);
            b.give("speed", 0.0, &[1.0]).give("fix", 0.0, &[0.0; 3][..channels]);
            let (found, expected) = (b.log.threshold, thresholds[channels - 1]);
            // the last digit that is printed
            assert!(
                (found - expected).abs() < 6e-4,
                "{p}, {channels} channels: {found}, table {expected}"
            );
        }
    }
    let mut off = Bench::new(&["sensor.fix.gate=\"off\""]);
    off.give("speed", 0.0, &[1.0]).give("fix", 0.0, &[1e6]);
    assert_eq!(off.log.threshold, f64::INFINITY);
    assert_eq!(off.log.outcomes(), [Outcome::Accepted]);
}

#[test]
fn gated_samples_have_one_line_with_the_worst_channel_and_change_nothing() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]);
    let before = (b.ekf.state().clone(), b.ekf.covariance().into_owned());
    b.give("fix", 1.0, &[40.0]);
    // S = P + R: P = 1 + 0.01 + 0.25 after 1 s, R = 0.01; the innovation is 39
    let nis = 39.0_f64.powi(2) / 1.27;
    assert_eq!(b.log.outcomes(), [Outcome::Gated]);
    assert!((b.log.updates[0].2 - nis).abs() < 1e-9 * nis, "{} {nis}", b.log.updates[0].2);
    assert_eq!(before, (b.ekf.state().clone(), b.ekf.covariance().into_owned()));
    b.give("speed", 2.0, &[1.0]).give("fix", 2.0, &[40.0]);
    assert_eq!(b.log.says("gated"), 0, "{:?}", b.log.events);
    b.give("speed", 3.0, &[1.0]).give("fix", 3.0, &[3.0]);
    // the sigma of the innovation is sqrt(S); it grows, and the first sample is the worst
    let line = format!(
        "2 samples gated since 1.000 s, one is off by {:.1} sigma; the gate passes again",
        nis.sqrt()
    );
    assert_eq!(b.log.says(&line), 1, "{line}: {:?}", b.log.events);
    b.give("speed", 4.0, &[1.0]).give("fix", 4.0, &[99.0]);
    b.ekf.finish(&mut b.log);
    assert_eq!(b.log.says("the last sample was gated, "), 1);
}

/// A sensor that is off by 60 m for as long as it takes, at 1 Hz. It begins with 0.6 m, a NIS of 26
/// where the gate is at 18: an error that comes gradually may be the filter's.
fn locked_out(action: &str, seconds: i32) -> Bench {
    let mut b =
        Bench::new(&[&format!("sensor.fix.recovery={{ after = \"5 s\", action = \"{action}\" }}")]);
    // a fix whose three channels agree, so that the filter is sure of itself
    for k in 0..10 {
        b.give("speed", f64::from(k), &[0.0]).fix(f64::from(k), 0.0);
    }
    b.log = lab::Log::default();
    for k in 10..10 + seconds {
        let off = if k == 10 { 0.6 } else { 60.0 };
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[off, 2.0 * off]);
    }
    b
}

#[test]
fn report_says_once_that_everything_is_gated_and_does_no_more() {
    let b = locked_out("report", 40);
    assert_eq!(b.log.outcomes(), [Outcome::Gated; 40]);
    assert_eq!(
        b.log.says("locked out: every one of 6 samples since 10.000 s was outside the gate"),
        1,
        "{:?}",
        b.log.events
    );
    assert_eq!(b.log.says("locked out"), 1);
    assert!(b.value("cart.place").abs() < 0.2);
}

#[test]
fn accept_uses_the_first_sample_after_the_time() {
    let b = locked_out("accept", 6);
    let mut expected = [Outcome::Gated; 6];
    expected[5] = Outcome::Accepted; // the first at 5 s after the first
    assert_eq!(b.log.outcomes(), expected);
    assert_eq!(
        b.log.says(
            "locked out: every one of 6 samples since 10.000 s was outside the gate; this sample is used"
        ),
        1
    );
}

#[test]
fn inflation_lets_the_filter_believe_the_sensor_with_a_covariance_that_says_so() {
    let mut b = locked_out("inflate", 6);
    assert_eq!(b.log.outcomes().last(), Some(&Outcome::Accepted));
    assert_eq!(b.log.says("locked out"), 1);
    // the recorded NIS is that of the inflated covariance: 2 channels, at most 1.5 each
    let nis = b.log.updates.last().unwrap().2;
    assert!(nis <= 3.0 && nis > 1.0, "{nis}");
    // the prior sigma is now about as large as the innovation, so the gain is nearly one:
    // R / P = 0.002 / 60^2
    assert!((b.value("cart.place") - 60.0).abs() < 0.5, "{}", b.value("cart.place"));
    for k in 16..30 {
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[60.0, 120.0]);
    }
    assert_eq!(b.log.outcomes()[6..], [Outcome::Accepted; 14], "and it goes on as before");
    assert!((b.value("cart.place") - 60.0).abs() < 0.2);
}

#[test]
fn inflation_works_when_the_noise_outweighs_the_prior_a_million_times() {
    let mut b = Bench::new(&["sensor.fix.recovery.after=\"2 s\"", "sensor.fix.noise=\"1 km\""]);
    b.give("speed", 0.0, &[0.0]);
    for k in 1..=4 {
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[1e6]);
    }
    assert_eq!(
        b.log.outcomes(),
        [Outcome::Gated, Outcome::Gated, Outcome::Accepted, Outcome::Accepted]
    );
    assert!(b.log.updates[2].2 <= 1.5, "{}", b.log.updates[2].2);
    assert!(b.value("cart.place") > 9e5);
}

#[test]
fn inflation_leaves_what_is_considered_as_it_was() {
    let mut b = Bench::new(&[
        "sensor.fix.recovery.after=\"2 s\"",
        "sensor.fix.bias={ mode = \"consider\", sigma = \"3 cm\" }",
    ]);
    let variance = |b: &Bench| b.variance("fix.bias");
    b.give("speed", 0.0, &[0.0]);
    let before = variance(&b);
    for k in 1..=4 {
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[100.0]);
    }
    assert_eq!(
        b.log.outcomes(),
        [Outcome::Gated, Outcome::Gated, Outcome::Accepted, Outcome::Accepted]
    );
    assert_eq!(variance(&b).to_bits(), before.to_bits());
    assert_eq!(b.value("fix.bias"), 0.0);
    let p = b.ekf.covariance().to_dense();
    assert!(p.clone().cholesky().is_some(), "positive definite: {p}");
}

#[test]
fn one_outlier_on_either_side_of_an_outage_is_no_lock_out() {
    let mut b = Bench::new(&["sensor.fix.recovery={ after = \"5 s\", action = \"accept\" }"]);
    b.give("speed", 0.0, &[0.0]).give("fix", 0.0, &[50.0]);
    b.give("speed", 60.0, &[0.0]).give("fix", 60.0, &[500.0]);
    assert_eq!(b.log.outcomes(), [Outcome::Gated, Outcome::Gated]);
}

#[test]
fn an_absurd_number_is_gated_whatever_the_gate_and_never_used() {
    // its NIS overflows: no covariance could be inflated for it
    let mut b = Bench::new(&["sensor.fix.gate=\"off\"", "sensor.fix.recovery.after=\"1 s\""]);
    b.give("speed", 0.0, &[0.0]);
    for k in 1..=4 {
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[1e200]);
    }
    assert_eq!(b.log.outcomes(), [Outcome::Gated; 4]);
    assert_eq!(b.value("cart.place"), 0.0);
}

#[test]
fn a_wrong_speed_that_was_believed_leaves_a_place_as_uncertain_as_it_is_wrong() {
    let mut b = logged();
    // 22 m/s for 41 s while the cart stands still, then correct again: locked out twice, for 30 s
    // each. It begins with 5 cm/s, which is no jump
    for k in 10..130 {
        let wrong = [0.05, 22.0, 0.0][usize::from(k > 10) + usize::from(k > 50)];
        b.give("speed", f64::from(k), &[0.0]).give("log", f64::from(k), &[wrong]);
        let (error, sigma) = (b.value("cart.place"), b.variance("cart.place").sqrt());
        assert!(error.abs() <= 3.5 * sigma, "{k} s: {error} m from the truth, sigma {sigma} m");
    }
    assert_eq!(b.log.says("locked out"), 2, "{:?}", b.log.events);
    // 41 s at 22 m/s; each time, the innovations of 30 s show at most 30 * 22 m, so together 933 m
    let (error, sigma) = (b.value("cart.place").abs(), b.variance("cart.place").sqrt());
    assert!((error - 902.0).abs() < 30.0 && sigma < 940.0, "{error} {sigma}");
}

#[test]
fn a_place_that_another_sensor_holds_stays_as_certain_as_that_makes_it() {
    let mut b = logged();
    for k in 10..40 {
        let wrong = if k == 10 { 0.05 } else { 22.0 };
        b.give("speed", f64::from(k), &[0.0])
            .give("log", f64::from(k), &[wrong])
            .fix(f64::from(k), 0.0);
    }
    b.give("speed", 40.0, &[0.0]).give("log", 40.0, &[22.0]);
    assert_eq!(b.log.says("locked out"), 1);
    // 22 m/s make 22 m in the second since the last fix. The fix has the gain 0.85 (R = 0.01 / 5 of
    // its two channels, P = 0.0117 from P^2 - 0.01 P = 0.01 R), which leaves 0.15 of what was
    // before it: 22 / 0.85 = 25.8 m at most, and 22 / 0.85 / sqrt(1.5) = 21.1 m where the inflation
    // ends at NIS = 1.5
    let sigma = b.variance("cart.place").sqrt();
    assert!(sigma > 21.0 && sigma < 26.0, "{sigma}");
}

#[test]
fn a_sensor_slower_than_the_time_to_recovery_leaves_lock_out_all_the_same() {
    let mut b = Bench::new(&[]);
    for k in 0..10 {
        b.give("speed", f64::from(k), &[0.0]).fix(f64::from(k), 0.0);
    }
    b.log = lab::Log::default();
    // every 50 s, where recovery is due after 30 s
    for k in 1..=4 {
        b.give("speed", f64::from(k) * 50.0, &[0.0]).give("fix", f64::from(k) * 50.0, &[1000.0]);
    }
    assert_eq!(
        b.log.outcomes(),
        [Outcome::Gated, Outcome::Gated, Outcome::Accepted, Outcome::Accepted]
    );
    assert_eq!(
        b.log.says("every one of 3 samples since 50.000 s was outside the gate"),
        1,
        "{:?}",
        b.log.events
    );
}

/// Gives the two channels of the fix that are linear.
trait Place {
    fn place(&mut self, t: f64, p: f64) -> &mut Self;
}

impl Place for Bench {
    fn place(&mut self, t: f64, p: f64) -> &mut Self {
        self.give("fix", t, &[p, 2.0 * p])
    }
}

#[test]
fn after_silence_the_covariance_is_inflated_at_once() {
    let mut b = Bench::new(&[]);
    for k in 0..10 {
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), 0.0);
    }
    b.log = lab::Log::default();
    // 20 s without a fix, four times the 5 s after which a sensor at 1 Hz counts as lost
    for k in 29..36 {
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), 60.0);
    }
    let mut expected = [Outcome::Accepted; 7];
    expected[..2].fill(Outcome::Gated); // two may be outliers
    assert_eq!(b.log.outcomes(), expected);
    assert_eq!(b.log.says("after 20.0 s without a used sample of "), 1, "{:?}", b.log.events);
    assert_eq!(b.log.findings[0].severity, Severity::Contained);
    assert!((b.value("cart.place") - 60.0).abs() < 0.5, "{}", b.value("cart.place"));
}

/// A filter that was sure of its place, and fixes that jump by 60 m for the given time and come
/// back.
fn jumped(seconds: i32, settings: &[&str]) -> Bench {
    let mut b = Bench::new(settings);
    for k in 0..20 {
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), 0.0);
    }
    b.log = lab::Log::default();
    for k in 20..20 + seconds + 20 {
        let place = if k < 20 + seconds { 60.0 } else { 0.0 };
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), place);
    }
    b
}

#[test]
fn a_sensor_that_jumps_is_isolated_and_taken_back_when_it_agrees_again() {
    let b = jumped(60, &[]);
    let outcomes = b.log.outcomes();
    let isolated = Outcome::Rejected(Rejection::Isolated);
    assert_eq!(outcomes[..30], [Outcome::Gated; 30]);
    // 30 s of the jump, then four samples that agree; the fifth is used
    assert_eq!(outcomes[30..64], [isolated; 34]);
    assert_eq!(outcomes[64..], [Outcome::Accepted; 16]);
    let finding = &b.log.findings[0];
    assert_eq!((finding.about.as_str(), finding.severity), ("fix", Severity::Contained));
    assert!(finding.text.contains("its innovation jumped"), "{}", finding.text);
    assert_eq!(b.log.findings.len(), 1);
    assert_eq!(b.log.says("taken back, isolated since 50.000 s"), 1, "{:?}", b.log.events);
    assert!(b.log.updates[40].2 > 1000.0, "judged while it is isolated: {:?}", b.log.updates[40]);
    assert!(b.value("cart.place").abs() < 0.2, "{}", b.value("cart.place"));
}

#[test]
fn an_isolation_that_nothing_decides_ends_and_the_run_must_not_be_used() {
    let b = jumped(60, &["sensor.fix.recovery.isolate=\"10 s\""]);
    assert_eq!(b.log.outcomes()[40], Outcome::Accepted, "30 s gated and 10 s isolated");
    let severities: Vec<Severity> = b.log.findings.iter().map(|f| f.severity).collect();
    // the way back is a jump as well; after the fix was used nothing decides it
    assert_eq!(severities[..2], [Severity::Contained, Severity::DoNotUse]);
    assert!(b.log.findings[1].text.contains("isolated for 10 s"), "{}", b.log.findings[1].text);
}

#[test]
fn a_sensor_that_is_isolated_at_the_end_is_reported() {
    let mut b = Bench::new(&[]);
    for k in 0..60 {
        let place = if k < 20 { 0.0 } else { 60.0 };
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), place);
    }
    b.ekf.finish(&mut b.log);
    let last = b.log.findings.last().unwrap();
    assert_eq!(last.severity, Severity::DoNotUse);
    assert!(last.text.contains("isolated at the end"), "{}", last.text);
}

#[test]
fn a_growing_covariance_does_not_take_an_isolated_sensor_back() {
    // 1.5 m off from 70 s on: the sigma of the place is sqrt(0.01 * 600) = 2.4 m in the end, so that
    // the error would pass the gate
    let mut b = Bench::new(&["sensor.fix.recovery.isolate=\"1 h\""]);
    for k in 0..670 {
        let place = if k < 70 { 0.0 } else { 1.5 };
        b.give("speed", f64::from(k), &[0.0]).place(f64::from(k), place);
    }
    assert!(b.variance("cart.place").sqrt() > 2.4, "{:?}", b.log.events);
    let passes = b.log.updates.last().unwrap().2 < b.log.threshold;
    let isolated = Outcome::Rejected(Rejection::Isolated);
    assert!(passes && b.log.outcomes().last() == Some(&isolated), "{:?}", b.log.events);
}

#[test]
fn a_sensor_that_others_contradict_is_isolated_even_if_its_error_came_gradually() {
    // the second sensor measures the same place ten times a second
    let scenario = format!("{SCENARIO}[sensor.other]\ntype = \"fix\"\nnoise = \"10 cm\"\n");
    let mut b = Bench::of(&scenario, &[]);
    for k in 0..600 {
        let t = 0.1 * f64::from(k);
        b.give("speed", t, &[0.0]).give("other", t, &[0.0, 0.0]);
        if k % 10 == 0 {
            let off = if k < 200 { 0.0 } else { 0.03 * f64::from(k - 200) };
            b.give("fix", t, &[off, 2.0 * off]);
        }
    }
    let finding = &b.log.findings[0];
    assert!(finding.text.contains("other sensors contradict it"), "{}", finding.text);
    assert_eq!((finding.about.as_str(), finding.severity), ("fix", Severity::Contained));
    let (error, sigma) = (b.value("cart.place"), b.variance("cart.place").sqrt());
    assert!(error.abs() < 3.5 * sigma, "{error} {sigma}");
}

#[test]
fn two_sensors_that_are_gated_at_the_same_time_are_believed_against_the_filter() {
    let scenario = format!("{SCENARIO}[sensor.other]\ntype = \"fix\"\nnoise = \"10 cm\"\n");
    let mut b = Bench::of(&scenario, &[]);
    for k in 0..80 {
        // the speedometer loses 60 m at once, which both fixes see as a jump
        let (t, place) = (f64::from(k), if k < 20 { 0.0 } else { 60.0 });
        b.give("speed", t, &[0.0]).place(t, place).give("other", t, &[place, 2.0 * place]);
    }
    assert_eq!(b.log.says("isolated"), 0, "{:?}", b.log.events);
    assert!(b.log.says("another sensor is gated too") >= 1, "{:?}", b.log.events);
    assert!((b.value("cart.place") - 60.0).abs() < 0.5);
}
