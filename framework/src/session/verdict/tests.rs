//! The criteria on innovations that are white by construction, and on those that are not.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::innovations::SensorStatistics;
use super::report::{FALSE_ALARM, Report};
use super::states::StateStatistics;
use super::{Judge, of_each_part, superseded};
use crate::compose::Composer;
use crate::model::chi_square::gated_moments;
use crate::model::record::answers::Truth;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::verdict::{Criterion, Verdict};
use crate::model::record::{Outcome, Rejection, UpdateRecord};
use crate::model::sensor::gate::Gate;
use crate::model::sensor::mounting::Mounting;
use crate::model::sensor::{Purpose, SensorInfo};
use crate::model::simulate::Random;
use crate::state::covariance::{Covariance, Update};
use crate::state::manifold::Scalar;
use crate::state::{BlockSpec, Dynamics, Mode, display};
use crate::units::sample::SensorId;
use crate::units::time::Time;

/// Innovation covariance of three channels: variances 4, 1 and 0.25.
const S: [f64; 9] = [4.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.25];

/// Judges a sensor with three channels whose normalised innovations at 1 Hz are `u(second)`.
fn judge(samples: i64, u: impl FnMut(i64) -> [f64; 3]) -> Report {
    let sensor = statistics(samples, u);
    let mut report = Report::default();
    sensor.judge(FALSE_ALARM / sensor.tests(true) as f64, true, &mut report);
    report
}

fn statistics(samples: i64, mut u: impl FnMut(i64) -> [f64; 3]) -> SensorStatistics {
    let channels = ["x", "y", "z"].map(str::to_owned).to_vec();
    let mut sensor = SensorStatistics::new("dvl".to_owned(), channels, false);
    let threshold = Gate::default().thresholds()[3];
    for second in 0..samples {
        let u = u(second);
        let nis = u.iter().map(|u| u * u).sum();
        let innovation = [2.0 * u[0], u[1], 0.5 * u[2]];
        sensor.update(&UpdateRecord {
            time: Time::from_nanos(second * 1_000_000_000),
            sensor: SensorId(0),
            outcome: if nis > threshold { Outcome::Gated } else { Outcome::Accepted },
            nis,
            threshold,
            present: 0b111,
            innovation: &innovation,
            covariance: &S,
        });
    }
    sensor.finish();
    sensor
}

fn white(random: &mut Random) -> [f64; 3] {
    std::array::from_fn(|_| random.normal())
}

/// The criteria that 900 samples violate.
fn violated(u: impl FnMut(i64) -> [f64; 3]) -> Vec<(Criterion, Severity)> {
    judge(900, u).reasons.iter().map(|r| (r.criterion, r.severity)).collect()
}

/// At most 0.5 % of consistent sensors are doubted: 5 of 1000 runs of 10 minutes are expected at
/// most, and 14 or more occur with a probability of 1 in 1000.
#[test]
fn white_innovations_are_doubted_at_the_stated_rate() {
    let mut random = Random::new(1, "white");
    let doubted =
        (0..1000).filter(|_| !judge(600, |_| white(&mut random)).reasons.is_empty()).count();
    assert!(doubted < 14, "{doubted} of 1000");
}

#[test]
fn each_departure_from_white_noise_has_its_criterion() {
    let mut random = Random::new(2, "coloured");
    // 1.5 times as large in one minute of 15, where the mean NIS is 6.75 instead of 3
    let minute = |random: &mut Random, k: i64| {
        white(random).map(|u| if (300..360).contains(&k) { 1.5 * u } else { u })
    };
    assert_eq!(
        violated(|k| minute(&mut random, k)),
        [(Criterion::NisOfMinute, Severity::Doubtful)]
    );
    // one channel 1.3 times as large, one smaller, so that the mean NIS is 3
    let channel = |random: &mut Random| {
        let [x, y, z] = white(random);
        [1.3 * x, y, (2.0_f64 - 1.69).sqrt() * z]
    };
    let found = violated(|_| channel(&mut random));
    assert_eq!(found, [(Criterion::Channel, Severity::Doubtful)]);
    // a mean of 0.2 sigma is 6 sigma of the mean of 900
    let found = violated(|_| white(&mut random).map(|u| u + 0.2));
    assert!(found.contains(&(Criterion::Bias, Severity::Doubtful)), "{found:?}");
    // an autoregression of variance 1 and correlation 0.3; the standard deviation of r is 0.033
    let mut last = white(&mut random);
    let found = violated(|_| {
        let new = white(&mut random);
        last = std::array::from_fn(|i| 0.3 * last[i] + (1.0_f64 - 0.09).sqrt() * new[i]);
        last
    });
    assert!(found.contains(&(Criterion::Correlation, Severity::Doubtful)), "{found:?}");
    // a slow sinusoid of 0.4 sigma: the means of a minute have a sigma of 0.13
    let found = violated(|k| {
        let slow = 0.4 * (k as f64 / 60.0).sin();
        white(&mut random).map(|u| u + slow)
    });
    assert!(found.iter().any(|f| f.0 == Criterion::Drift), "{found:?}");
}

#[test]
fn innovations_of_twice_their_sigma_must_not_be_used_and_of_half_are_a_note() {
    let mut random = Random::new(3, "scaled");
    // the gate of three channels cuts 37 % of the innovations of 2.6 sigma off, so that the others
    // have 1.85: the share of gated samples shows the factor
    for (factor, criterion, severity) in
        [(2.6, Criterion::Gated, Severity::DoNotUse), (0.5, Criterion::Nis, Severity::Note)]
    {
        let found = violated(|_| white(&mut random).map(|u| factor * u));
        assert!(found.contains(&(criterion, severity)), "{factor}: {found:?}");
    }
}

#[test]
fn the_band_of_the_mean_nis_is_that_of_the_gated_distribution() {
    let mut random = Random::new(4, "band");
    let report = judge(900, |_| white(&mut random));
    let sensor = &report.sensors[0];
    let (mean, variance) = gated_moments(3, Gate::default().thresholds()[3]);
    // rounded to a millionth
    assert!((sensor.expected_nis - mean).abs() < 1e-6, "{sensor:?}");
    let width = 0.5 * (sensor.band.high - sensor.band.low) / (variance / 900.0_f64).sqrt();
    // 15 tests at 0.005 together: the two-sided quantile of 3.3e-4 is 3.59 sigma, wider if
    // successive NIS happen to be correlated
    assert!((3.5..4.2).contains(&width), "{width}");
}

#[test]
fn shares_of_gated_faulty_and_missing_samples_are_judged_apart() {
    let mut sensor = SensorStatistics::new("dvl".to_owned(), vec!["x".to_owned()], false);
    let mut take = |second: i64, outcome| {
        let (nis, threshold, innovation) = (1.0, 15.1, [1.0]);
        let (time, covariance) = (Time::from_nanos(second * 1_000_000_000), [1.0]);
        let (sensor_id, present) = (SensorId(0), 1);
        sensor.update(&UpdateRecord {
            time,
            sensor: sensor_id,
            outcome,
            nis,
            threshold,
            present,
            innovation: &innovation,
            covariance: &covariance,
        });
    };
    for k in 0..30 {
        take(3 * k, Outcome::Gated);
        take(3 * k + 1, Outcome::Rejected(Rejection::Missing));
        take(3 * k + 2, Outcome::Rejected(Rejection::NotFinite(0)));
    }
    let mut report = Report::default();
    sensor.judge(1e-4, true, &mut report);
    let found: Vec<Criterion> = report.reasons.iter().map(|r| r.criterion).collect();
    assert_eq!(found, [Criterion::Gated, Criterion::Rejected, Criterion::Unused]);
    assert!(
        report.reasons[0].text.contains("30 of 30 samples were refused (100 %"),
        "{:?}",
        report.reasons[0]
    );
    assert!(report.reasons[1].text.contains("30 of 60"), "{:?}", report.reasons[1]);
}

/// A noise that is stated too small moves the estimate as a fault of the IMU would, until it is known.
#[test]
fn a_doubt_before_the_error_of_another_sensor_was_contained_is_none() {
    let finding = |time: f64, about: &str, severity, basis| Finding {
        time: Time::from_nanos((time * 1e9) as i64),
        about: about.to_owned(),
        severity,
        basis,
        ..Finding::default()
    };
    let noise = finding(41.0, "gnss", Severity::Contained, Basis::Explanation);
    let severity = |about: &str, time: f64, severity| {
        let doubt = finding(time, about, severity, Basis::Comparison);
        superseded(&[doubt, noise.clone()])[0].severity
    };
    assert_eq!(severity("imu", 40.0, Severity::Doubtful), Severity::Contained);
    assert_eq!(severity("imu", 42.0, Severity::Doubtful), Severity::Doubtful);
    assert_eq!(severity("gnss", 40.0, Severity::Doubtful), Severity::Doubtful);
    assert_eq!(severity("imu", 40.0, Severity::DoNotUse), Severity::DoNotUse);
}

/// A DVL that is a second late is locked out, the turns look like a bias of the gyro, and the DVL is locked
/// out again: the bias explains nothing. One after which the DVL agrees is the cause.
#[test]
fn an_error_after_which_the_sensor_is_lost_again_is_no_cause() {
    let finding = |time: i64, about: &str, severity, basis| Finding {
        time: Time::from_nanos(time * 1_000_000_000),
        about: about.to_owned(),
        severity,
        basis,
        ..Finding::default()
    };
    let findings = [
        finding(55, "dvl", Severity::Contained, Basis::Comparison),
        finding(311, "imu", Severity::DoNotUse, Basis::Explanation),
        finding(356, "dvl", Severity::DoNotUse, Basis::Comparison),
    ];
    let first = |findings: &[Finding]| corrected(0.0, findings).reasons[0].about.clone();
    assert_eq!(first(&findings), "dvl");
    assert_eq!(first(&findings[..2]), "imu");
}

/// The accelerations show that one of two is turned, the senses which one.
#[test]
fn a_part_that_contradicts_physics_comes_before_a_pair_of_which_one_does() {
    let finding = |about: &str| Finding {
        about: about.to_owned(),
        severity: Severity::DoNotUse,
        basis: Basis::Samples,
        ..Finding::default()
    };
    let verdict = corrected(0.0, &[finding("imu, dvl"), finding("dvl")]);
    let about: Vec<&str> = verdict.reasons.iter().map(|r| r.about.as_str()).collect();
    assert_eq!(about[..2], ["dvl", "imu, dvl"]);
}

/// A later finding of the same part replaces an earlier one if it is worse, or names an error that
/// explains the comparison, or rests on the samples of that part alone.
#[test]
fn of_the_findings_of_a_part_the_one_that_says_most_counts() {
    let finding = |about: &str, severity, basis, text: &str| Finding {
        time: Time::MIN,
        about: about.to_owned(),
        severity,
        basis,
        text: text.to_owned(),
        remedy: String::new(),
    };
    let findings = [
        finding("imu", Severity::DoNotUse, Basis::Comparison, "its bias has moved"),
        finding("dvl", Severity::DoNotUse, Basis::Comparison, "locked out"),
        finding("imu", Severity::DoNotUse, Basis::Samples, "its axes are swapped"),
        finding("imu", Severity::Doubtful, Basis::Samples, "many spikes"),
        finding("dvl", Severity::DoNotUse, Basis::Comparison, "locked out again"),
        finding("gnss", Severity::DoNotUse, Basis::Comparison, "its innovations have a mean"),
        finding("gnss", Severity::DoNotUse, Basis::Explanation, "its clock is late"),
        finding("gnss", Severity::Doubtful, Basis::Samples, "many repetitions"),
    ];
    let texts: Vec<&str> = of_each_part(&findings).iter().map(|f| f.text.as_str()).collect();
    assert_eq!(texts, ["its axes are swapped", "locked out", "its clock is late"]);
}

/// Judges one sensor that corrects one constant state, whose prior is 0 with a sigma of 1: one
/// sample with a noise of 1.
fn corrected(innovation: f64, findings: &[Finding]) -> Verdict {
    judged(innovation, findings, None)
}

/// The same beside the statistics of the sensor.
fn judged(innovation: f64, findings: &[Finding], sensor: Option<SensorStatistics>) -> Verdict {
    let mut composer = Composer::default();
    composer.begin("dvl");
    let spec = BlockSpec {
        mode: Mode::Estimate,
        initial: vec![0.0],
        sigma: vec![1.0],
        truth: None,
        dynamics: Dynamics::Constant,
        display: display::LENGTH,
    };
    composer.block::<Scalar>("bias", spec).unwrap();
    let states = StateStatistics::new(&composer.finish().0, &[false], true, 1);
    let driver = SensorInfo {
        name: "imu".to_owned(),
        kind: String::new(),
        channels: Vec::new(),
        purpose: Purpose::Input,
        mounting: Mounting::default(),
    };
    let (infos, sensors, reasons) = (vec![driver], vec![sensor], Vec::new());
    let mut judge = Judge {
        infos,
        sensors,
        states,
        white: true,
        last: 0,
        wide: Vec::new(),
        reference: None,
        reasons,
    };
    let mut p = Covariance::zero(1);
    p.set(0, 0, 1.0);
    let mut update = Update::with_capacity(1, 1);
    update.m = 1;
    update.columns.push(0);
    update.h.push(1.0);
    update.r.push(1.0);
    update.innovation.push(innovation);
    update.innovate(&p).unwrap();
    update.apply(&mut p, &[false]);
    judge.correction(&update);
    judge.verdict(findings, None, &[], None)
}

#[test]
fn gated_samples_of_a_contained_fault_are_part_of_it() {
    let reason_of = |criterion, severity, about: &str| {
        super::report::reason(criterion, severity, about, String::new(), "")
    };
    for fault in [Severity::Contained, Severity::Doubtful] {
        let mut reasons = [
            reason_of(Criterion::Finding, fault, "gnss"),
            reason_of(Criterion::Gated, Severity::DoNotUse, "gnss"),
            reason_of(Criterion::Gated, Severity::Doubtful, "dvl"),
            reason_of(Criterion::Bias, Severity::Doubtful, "gnss"),
        ];
        super::contain(&mut reasons, &[]);
        let gated = if fault == Severity::Contained { fault } else { Severity::DoNotUse };
        let severities = reasons.map(|r| r.severity);
        assert_eq!(severities, [fault, gated, Severity::Doubtful, Severity::Doubtful]);
    }
}

/// The driving sensor carries the state through a silence of another one, whose gated samples are no fault.
#[test]
fn a_filter_that_is_off_after_a_silence_is_about_the_driving_sensor() {
    let finding = |basis| Finding {
        time: Time::MIN,
        about: "gnss".to_owned(),
        severity: Severity::Contained,
        basis,
        text: "the filter was off".to_owned(),
        remedy: "raise its noise".to_owned(),
    };
    let silence = corrected(0.0, &[finding(Basis::Silence)]);
    let reason = &silence.reasons[0];
    assert_eq!((reason.criterion, reason.about.as_str()), (Criterion::Silence, "imu"));
    let answers = silence.answers();
    assert!(answers.because.starts_with("after a silence"), "{}", answers.because);
    assert_eq!(answers.change[0].about, "imu");
    // a fault that was found in the same sensor counts instead
    let both = corrected(0.0, &[finding(Basis::Silence), finding(Basis::Comparison)]);
    assert_eq!(both.answers().because, "a fault of gnss was found and contained");
    let gated =
        super::report::reason(Criterion::Gated, Severity::Doubtful, "gnss", String::new(), "");
    let mut reasons = [gated];
    super::contain(&mut reasons, &[finding(Basis::Silence)]);
    assert_eq!(reasons[0].severity, Severity::Contained);
}

/// The gain is 1/2 and the correction of sigma `sqrt(1/2)`; the prior variance may be wrong by 5 %
/// of sigma.
#[test]
fn a_state_that_its_samples_move_far_from_its_prior_is_doubted() {
    assert!(corrected(1.0, &[]).reasons.is_empty());
    let reasons = corrected(10.0, &[]).reasons;
    let sigmas = 5.0 / (0.5_f64 + 1.05 * 1.05 - 1.0).sqrt();
    assert_eq!(reasons[0].criterion, Criterion::Prior);
    assert!(reasons[0].text.contains(&format!("moved {sigmas:.1} sigma")), "{}", reasons[0].text);
}

#[test]
fn of_reasons_of_one_severity_those_that_the_samples_of_a_part_show_come_first() {
    let finding = |about: &str, basis| Finding {
        time: Time::MIN,
        about: about.to_owned(),
        severity: Severity::Doubtful,
        basis,
        text: String::new(),
        remedy: String::new(),
    };
    let (compared, own) = (finding("dvl", Basis::Comparison), finding("imu", Basis::Samples));
    for findings in [[compared.clone(), own.clone()], [own, compared]] {
        let reasons = corrected(0.0, &findings).reasons;
        let parts: Vec<&str> = reasons.iter().map(|r| r.about.as_str()).collect();
        assert_eq!(parts, ["imu", "dvl"]);
    }
}

/// An innovation of 10 moves the state far from its prior. A fault that names itself explains that, and
/// one that only comparisons show does not. The driving sensor explains several others, and where its own
/// samples show its fault, also what other samples fit.
#[test]
fn what_the_first_fault_explains_is_left_out() {
    let finding = |about: &str, basis| Finding {
        time: Time::MIN,
        about: about.to_owned(),
        severity: Severity::DoNotUse,
        basis,
        text: String::new(),
        remedy: String::new(),
    };
    let parts = |findings: &[Finding]| -> Vec<String> {
        corrected(10.0, findings).reasons.into_iter().map(|r| r.about).collect()
    };
    let compared = ["depth", "dvl", "imu"].map(|about| finding(about, Basis::Comparison));
    assert_eq!(parts(&compared[..2]), ["depth", "dvl", "dvl.bias"]);
    assert_eq!(parts(&compared[1..]), ["dvl", "imu", "dvl.bias"]);
    assert_eq!(parts(&compared), ["imu", "depth", "dvl", "dvl.bias"]);
    for basis in [Basis::Explanation, Basis::Samples] {
        let all = [&compared[..], &[finding("gnss", basis)]].concat();
        assert_eq!(parts(&all), ["gnss"]);
        let verdict = corrected(10.0, &all);
        assert_eq!(verdict.answers().sigma, Truth::TooSmall);
    }
    let explained = finding("gnss", Basis::Explanation);
    let own = ["imu", "dvl"].map(|about| finding(about, Basis::Samples));
    assert_eq!(parts(&[explained.clone(), own[0].clone()]), ["imu"]);
    assert_eq!(parts(&[explained, own[1].clone()]), ["dvl", "gnss"]);
}

/// A finding by which the result must not be used.
fn useless(about: &str, seconds: i64, basis: Basis) -> Finding {
    Finding {
        time: Time::from_nanos(seconds * 1_000_000_000),
        about: about.to_owned(),
        severity: Severity::DoNotUse,
        basis,
        text: String::new(),
        remedy: String::new(),
    }
}

/// Of 100 samples 9 or 11 are used.
#[test]
fn what_is_found_without_a_sensor_does_not_explain_what_it_contradicted() {
    let first = |used: i64, explained: i64| {
        let findings =
            [useless("dvl", 40, Basis::Comparison), useless("imu", explained, Basis::Explanation)];
        let sensor = statistics(100, |second| if second < used { [1.0; 3] } else { [9.0; 3] });
        judged(0.0, &findings, Some(sensor)).reasons[0].about.clone()
    };
    assert_eq!(first(9, 300), "dvl");
    assert_eq!(first(11, 300), "imu");
    assert_eq!(first(9, 30), "imu");
}

/// The gyro bias is far off. The filter gives way to the compass three times in vain, and has found by then what is
/// wrong with the IMU; the first doubt was about the compass.
#[test]
fn of_two_explanations_the_first_found_is_the_cause() {
    let findings = [
        useless("compass", 50, Basis::Comparison),
        useless("imu", 60, Basis::Explanation),
        useless("compass", 190, Basis::Explanation),
    ];
    let reasons = corrected(0.0, &findings).reasons;
    let parts: Vec<&str> = reasons.iter().map(|r| r.about.as_str()).collect();
    assert_eq!(parts, ["imu", "compass"]);
}
