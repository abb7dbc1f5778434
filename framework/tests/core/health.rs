//! The health of a sensor over time: what a finding about it changes, and until when.

use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::health::{Health, Judged, Judgement, Lane};
use navfuse_core::units::time::Time;

fn time(seconds: i64) -> Time {
    Time::from_nanos(seconds * 1_000_000_000)
}

/// A lane of a sensor with one sample a second, each with its outcome and NIS, that has a finding of
/// that severity at 40 s. Health and begin of its stretches, s.
fn lane(severity: Severity, sample: impl Fn(i64) -> (Health, f64)) -> Vec<(Health, f64)> {
    lane_of(&Finding { severity, ..Finding::default() }, sample)
}

fn lane_of(finding: &Finding, sample: impl Fn(i64) -> (Health, f64)) -> Vec<(Health, f64)> {
    let mut lane = Lane::default();
    for k in 0..200 {
        let (health, nis) = sample(k);
        let judgement = Judgement { channels: 1, nis, threshold: f64::INFINITY };
        let innovation = (!health.refuses()).then_some(judgement);
        lane.update(&Judged { time: time(k), health, present: 1, innovation });
        if k == 40 {
            lane.doubt(&Finding { time: time(k), ..finding.clone() });
        }
    }
    // before its first sample the sensor is silent
    lane.begun(1).map(|(health, from)| (health, from.seconds())).collect()
}

/// Refused from 20 to 59 s. The 25 samples from 60 to 84 s agree, and the doubt ends with the last
/// one; in a run that is doubtful it lasts.
#[test]
fn a_contained_fault_is_doubted_until_its_sensor_agrees_again() {
    use Health::{Doubted, Gated, Used};
    let sample = |k| if (20..60).contains(&k) { (Gated, 30.0) } else { (Used, 1.0) };
    let contained = [(Used, 0.0), (Gated, 20.0), (Doubted, 60.0), (Used, 84.0)];
    assert_eq!(lane(Severity::Contained, sample), contained);
    assert_eq!(lane(Severity::Doubtful, sample), contained[..3]);
    assert_eq!(lane(Severity::Note, sample)[2..], [(Used, 60.0)]);
    // after a silence the filter was off, and not the sensor
    let (severity, basis) = (Severity::Contained, Basis::Silence);
    let silence = lane_of(&Finding { severity, basis, ..Finding::default() }, sample);
    assert_eq!(silence[2..], [(Used, 60.0)]);
}

/// A mean NIS of 1.7 in place of 1 is 2.5 of its sigma, `sqrt(2 / 25)`: such samples do not agree,
/// though they are not shown as too noisy. A refused sample begins anew: those from 51 to 75 s are 25 in
/// a row.
#[test]
fn samples_that_are_off_or_refused_in_between_do_not_remove_a_doubt() {
    use Health::{Doubted, Gated, Used};
    let off = lane(Severity::Contained, |k| (Used, if k < 40 { 1.0 } else { 1.7 }));
    assert_eq!(off, [(Used, 0.0), (Doubted, 40.0)]);
    let once = lane(Severity::Contained, |k| match k {
        50 => (Gated, 30.0),
        _ => (Used, 1.0),
    });
    assert_eq!(once, [(Used, 0.0), (Doubted, 40.0), (Used, 75.0)]);
}
