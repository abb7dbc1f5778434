//! The health of a sensor over time: what a finding about it changes, and until when.

use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::health::{Health, Judged, Judgement, Lane, Stretch};
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
    lane.begun(0).map(|(health, from)| (health, from.seconds())).collect()
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

/// A sensor begins with its first sample, and one that has none for 5 s with a silence.
#[test]
fn a_lane_begins_with_its_first_sample_or_with_a_silence() {
    let begun = |lane: &Lane| -> Vec<(Health, f64)> {
        lane.begun(0).map(|(health, from)| (health, from.seconds())).collect()
    };
    let used = Judged { time: time(3), health: Health::Used, present: 1, innovation: None };
    let mut soon = Lane::default();
    soon.tick(time(0));
    assert_eq!(begun(&soon), []);
    soon.update(&used);
    assert_eq!(begun(&soon), [(Health::Used, 3.0)]);
    let mut late = Lane::default();
    (1..9).for_each(|k| late.tick(time(k)));
    late.update(&Judged { time: time(9), ..used });
    assert_eq!(begun(&late), [(Health::Silent, 1.0), (Health::Used, 9.0)]);
    let mut never = Lane::default();
    never.tick(time(0));
    never.finish(time(2));
    let silent = Stretch { health: Health::Silent, from: time(0), to: time(2) };
    assert_eq!(never.stretches, [silent]);
}
