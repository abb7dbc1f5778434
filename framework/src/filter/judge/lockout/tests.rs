use super::*;
use crate::model::record::Event;
use crate::model::record::finding::Finding;

#[test]
fn an_outlier_on_either_side_of_an_outage_causes_no_suspicion_and_a_third_one_does() {
    let suspects = |count: u64| {
        let streak = Streak { count, ..Streak::default() };
        Lockout { streak: Some(streak), ..Lockout::new(None, &[], true) }.suspects()
    };
    assert_eq!([1, 2, 3].map(suspects), [false, false, true]);
    assert!(!Lockout::new(None, &[], true).suspects());
}

/// Findings by their severity, and events by their level, of a run.
#[derive(Default)]
struct Reports {
    findings: Vec<(Severity, String)>,
    events: Vec<(Level, String)>,
}

impl Observer for Reports {
    fn finding(&mut self, finding: Finding) {
        self.findings.push((finding.severity, finding.text));
    }

    fn event(&mut self, event: Event) {
        self.events.push((event.level, event.text));
    }
}

/// A lock-out with its recovery and what it reports.
struct Sensor {
    lockout: Lockout,
    recovery: Recovery,
    reports: Reports,
}

/// A sample that passes, and one that is gated.
const GOOD: Evidence = Evidence {
    passes: true,
    shared: false,
    contradicted: None,
    repeated: false,
    replaced: Time::MIN,
};
const BAD: Evidence = Evidence { passes: false, ..GOOD };

impl Sensor {
    /// A sensor without a sample.
    fn unused(action: Action) -> Self {
        let recovery = Recovery { action, ..Recovery::default() };
        Self { lockout: Lockout::new(None, &[], true), recovery, reports: Reports::default() }
    }

    /// A sensor of which samples with a NIS of 1 passed at 0, 1, 2 to 10 s.
    fn new(action: Action) -> Self {
        let mut sensor = Self::unused(action);
        for k in 0..=10 {
            assert_eq!(sensor.judge(f64::from(k), 1.0, 1.0, GOOD), Verdict::Pass);
        }
        sensor
    }

    /// Judges a sample against the threshold 10.
    fn judge(&mut self, time: f64, nis: f64, share: f64, evidence: Evidence) -> Verdict {
        let time = Time::from_nanos((time * 1e9).round() as i64);
        let largest = Largest { channel: 0, sigmas: nis };
        let (m, channels) = (1, 1);
        let sample = Judged {
            sensor: "depth",
            driver: None,
            time,
            nis,
            threshold: 10.0,
            m,
            channels,
            share,
            largest,
        };
        self.lockout.judge(&sample, evidence, &self.recovery, &mut self.reports)
    }

    /// Judges gated samples with one NIS at those times, and returns the last verdict and its time.
    /// Those before are gated.
    fn until(&mut self, times: impl IntoIterator<Item = f64>, nis: f64) -> (f64, Verdict) {
        let mut found = (f64::NAN, Verdict::Gate);
        for time in times {
            found = (time, self.judge(time, nis, 1.0, BAD));
            if found.1 != Verdict::Gate {
                break;
            }
        }
        found
    }

    fn severities(&self) -> Vec<Severity> {
        self.reports.findings.iter().map(|finding| finding.0).collect()
    }
}

/// Times from one on, a second apart.
fn from(first: f64) -> impl Iterator<Item = f64> {
    (0..100).map(move |k| first + f64::from(k))
}

/// Two samples at once have no interval.
#[test]
fn the_filter_is_suspected_after_the_silence_of_a_lost_sensor_or_the_given_one() {
    let silence = |timeout: Option<f64>, times: &[f64]| {
        let recovery = Recovery::default();
        let (lockout, reports) = (Lockout::new(timeout, &[], true), Reports::default());
        let mut sensor = Sensor { lockout, recovery, reports };
        times.iter().for_each(|&time| {
            sensor.judge(time, 1.0, 1.0, GOOD);
        });
        sensor.lockout.silence()
    };
    assert_eq!(silence(None, &[0.0, 0.0]), f64::INFINITY);
    assert_eq!(silence(Some(7.0), &[0.0, 9.0]), 7.0);
    assert_eq!(silence(None, &[0.0, 1.0]), 5.0);
    assert_eq!(silence(None, &[0.0, 3.0, 6.0, 60.0]), 9.0);
}

/// Every sample was gated for 30 s, and there were three.
#[test]
fn a_gated_sample_is_accepted_after_half_a_minute_and_not_before_the_third() {
    let accepted = |times: &[f64], nis: f64| {
        let mut sensor = Sensor::new(Action::Accept);
        sensor.until(times.iter().copied(), nis)
    };
    let seconds: Vec<f64> = from(11.0).collect();
    assert_eq!(accepted(&seconds, 90.0), (41.0, Verdict::Accept));
    assert_eq!(accepted(&[11.0, 51.0, 52.0], 90.0), (52.0, Verdict::Accept));
    assert_eq!(accepted(&seconds, f64::INFINITY).1, Verdict::Gate);
}

#[test]
fn a_lock_out_is_reported_once_and_its_fifth_sample_warned_of() {
    let mut sensor = Sensor::new(Action::Report);
    for k in 0..60_u32 {
        let nis = if k == 2 { 95.0 } else { 90.0 };
        assert_eq!(sensor.judge(11.0 + f64::from(k), nis, 1.0, BAD), Verdict::Gate);
        assert_eq!(sensor.reports.events.len(), 1.min(k as usize / 4) + 1.min(k as usize / 30));
    }
    let worst = &sensor.reports.events[0];
    assert!(worst.1.contains("5 samples") && worst.1.contains("95.0 sigma"), "{}", worst.1);
    assert!(sensor.reports.events.iter().all(|event| event.0 == Level::Warning));
    assert!(sensor.reports.findings.is_empty());
    assert!(sensor.lockout.suspects() && sensor.lockout.disagrees());
    assert_eq!(sensor.judge(71.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert!(!sensor.lockout.suspects() && !sensor.lockout.disagrees());
}

/// The silence is longer than 5 s here. It need not be before the first gated sample.
#[test]
fn the_covariance_is_inflated_at_the_third_sample_after_a_silence() {
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until(from(16.0), 90.0), (18.0, Verdict::Adopt));
    assert_eq!(sensor.severities(), [Severity::Contained]);
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until([11.0, 17.0, 18.0], 39.0), (18.0, Verdict::Adopt));
    // 5 s are no silence, and the jump came after a gap of more than three intervals
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until(from(15.0), 90.0), (45.0, Verdict::Inflate));
    assert_eq!(sensor.severities(), [Severity::DoNotUse]);
    // only the inflation is due at once
    let mut sensor = Sensor::new(Action::Accept);
    assert_eq!(sensor.until(from(16.0), 90.0), (46.0, Verdict::Accept));
}

/// A jump is a NIS of four times the threshold of 10, within three intervals of the last used
/// sample.
#[test]
fn a_sensor_that_jumped_is_isolated_and_one_that_drifted_inflates() {
    let found = |first: f64, nis: f64| {
        let mut sensor = Sensor::new(Action::Inflate);
        let verdict = sensor.until(from(first), nis).1;
        (verdict, sensor.severities())
    };
    let (isolated, inflated) = (
        (Verdict::Isolate, vec![Severity::Contained]),
        (Verdict::Inflate, vec![Severity::DoNotUse]),
    );
    assert_eq!(found(11.0, 41.0), isolated);
    assert_eq!(found(11.0, 39.0), inflated);
    assert_eq!(found(13.0, 41.0), isolated);
    assert_eq!(found(13.5, 41.0), inflated);
}

/// The basis of the findings is not kept here; the words are.
#[test]
fn a_sensor_that_the_filter_follows_in_vain_three_times_has_an_error_that_lasts() {
    let lasting = |sensor: &Sensor| {
        let lasts = |(_, text): &&(Severity, String)| text.contains("has an error that lasts");
        sensor.reports.findings.iter().filter(lasts).count()
    };
    let follow = |measures: bool, first: Evidence, between: u32| {
        let mut sensor = Sensor::new(Action::Inflate);
        sensor.lockout.measures = measures;
        let mut time = 15.0;
        for round in 0..3 {
            let evidence = if round == 0 { first } else { BAD };
            while sensor.judge(time, 30.0, 1.0, evidence) != Verdict::Inflate {
                time += 1.0;
            }
            (0..between).for_each(|k| {
                assert_eq!(sensor.judge(time + f64::from(k), 1.0, 1.0, GOOD), Verdict::Pass);
            });
            time += f64::from(between) + 1.0;
        }
        lasting(&sensor)
    };
    assert_eq!(follow(true, BAD, 1), 1);
    // if others contradict the filter too at first, it is the driving sensor
    assert_eq!(follow(true, Evidence { shared: true, ..BAD }, 1), 0);
    // a rule that the scenario states is none
    assert_eq!(follow(false, BAD, 1), 0);
    // 31 samples are gated in 30 s: ten times as many that agree end the account
    assert_eq!(follow(true, BAD, 312), 0);
}

/// With the weight 1/50 the mean NIS of each channel is `2 - 0.98^n` after `n` samples with 2: the
/// bound of a jump is 40 times that.
#[test]
fn a_jump_is_judged_by_the_usual_nis_of_the_samples_that_passed() {
    for (nis, expected) in [(70.0, Verdict::Inflate), (80.0, Verdict::Isolate)] {
        let mut sensor = Sensor::new(Action::Inflate);
        for k in 11..=110 {
            sensor.judge(f64::from(k), 2.0, 1.0, GOOD);
        }
        let usual = 2.0 - 0.98_f64.powi(100);
        assert!((sensor.lockout.spread - usual).abs() < 1e-12, "{}", sensor.lockout.spread);
        assert!(70.0 < 40.0 * usual && 40.0 * usual < 80.0);
        assert_eq!(sensor.until(from(111.0), nis).1, expected, "{nis}");
    }
    // two channels share the NIS
    let mut sensor = Sensor::new(Action::Inflate);
    let time = Time::from_nanos(11_000_000_000);
    let largest = Largest { channel: 0, sigmas: 1.0 };
    let (nis, threshold, m, channels, share) = (6.0, 10.0, 2, 0b11, 1.0);
    let sample =
        Judged { sensor: "depth", driver: None, time, nis, threshold, m, channels, share, largest };
    sensor.lockout.judge(&sample, GOOD, &sensor.recovery, &mut sensor.reports);
    assert!((sensor.lockout.spread - 1.04).abs() < 1e-12, "{}", sensor.lockout.spread);
}

/// The inflation may have adopted a wrong sensor: a jump after it may be the right one.
#[test]
fn after_a_lock_out_that_nothing_decided_a_jump_is_no_evidence() {
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until(from(11.0), 39.0), (41.0, Verdict::Inflate));
    assert_eq!(sensor.judge(42.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert_eq!(sensor.until(from(43.0), 90.0), (73.0, Verdict::Inflate));
    // one that a silence explained leaves the evidence
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until(from(20.0), 39.0), (22.0, Verdict::Adopt));
    assert_eq!(sensor.judge(23.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert_eq!(sensor.until(from(24.0), 90.0), (54.0, Verdict::Isolate));
}

#[test]
fn other_sensors_decide_by_their_last_word_and_by_being_gated_too() {
    let found = |words: [Option<bool>; 2], shared: bool, nis: f64| {
        let mut sensor = Sensor::new(Action::Inflate);
        let judged = from(11.0).map(|time| {
            let contradicted = words[usize::from(time > 20.0)];
            sensor.judge(time, nis, 1.0, Evidence { shared, contradicted, ..BAD })
        });
        judged.take(31).last()
    };
    assert_eq!(found([None, None], false, 39.0), Some(Verdict::Inflate));
    assert_eq!(found([Some(true), None], false, 39.0), Some(Verdict::Isolate));
    assert_eq!(found([Some(true), Some(false)], false, 39.0), Some(Verdict::Inflate));
    assert_eq!(found([Some(false), Some(true)], false, 39.0), Some(Verdict::Isolate));
    assert_eq!(found([Some(true), None], true, 90.0), Some(Verdict::Inflate));
}

/// The gate passes again where the covariance has grown. The innovation is gone below half of its
/// size, a quarter of its square.
#[test]
fn a_jump_that_the_gate_passes_again_is_isolated_unless_it_has_gone() {
    let passed = |action: Action, gated: u32, nis: f64, share: f64, shared: bool| {
        let mut sensor = Sensor::new(action);
        for k in 0..gated {
            assert_eq!(sensor.judge(11.0 + f64::from(k), nis, 1.0, BAD), Verdict::Gate);
        }
        let verdict =
            sensor.judge(11.0 + f64::from(gated), 5.0, share, Evidence { shared, ..GOOD });
        assert_eq!(sensor.lockout.disagrees(), verdict == Verdict::Isolate);
        verdict
    };
    assert_eq!(passed(Action::Inflate, 3, 90.0, 0.26, false), Verdict::Isolate);
    assert_eq!(passed(Action::Inflate, 3, 90.0, 0.25, false), Verdict::Pass);
    assert_eq!(passed(Action::Inflate, 2, 90.0, 0.26, false), Verdict::Pass);
    assert_eq!(passed(Action::Inflate, 3, 39.0, 0.26, false), Verdict::Pass);
    assert_eq!(passed(Action::Inflate, 3, 90.0, 0.26, true), Verdict::Pass);
    assert_eq!(passed(Action::Accept, 3, 90.0, 0.26, false), Verdict::Pass);
}

#[test]
fn an_isolated_sensor_is_taken_back_when_five_samples_in_a_row_agree() {
    let mut sensor = Sensor::new(Action::Inflate);
    assert_eq!(sensor.until(from(11.0), 90.0), (41.0, Verdict::Isolate));
    let mut time = 41.0;
    let mut agree = |count: u32, share: f64, evidence: Evidence| {
        let judged = (0..count).map(|_| {
            time += 1.0;
            sensor.judge(time, 5.0, share, evidence)
        });
        judged.last()
    };
    assert_eq!(agree(4, 0.25, GOOD), Some(Verdict::Isolate));
    assert_eq!(agree(1, 0.25, BAD), Some(Verdict::Isolate));
    assert_eq!(agree(4, 0.25, GOOD), Some(Verdict::Isolate));
    assert_eq!(agree(5, 0.26, GOOD), Some(Verdict::Isolate), "it has not gone");
    assert_eq!(agree(4, 0.25, GOOD), Some(Verdict::Isolate));
    assert_eq!(agree(1, 0.25, GOOD), Some(Verdict::Pass));
    assert!(!sensor.lockout.disagrees());
}

/// The isolation begins at 41 s and lasts for 300 s at most, unless other sensors contradict.
#[test]
fn an_isolation_ends_after_five_minutes_where_no_other_sensor_contradicts() {
    let mut jumped = Sensor::new(Action::Inflate);
    assert_eq!(jumped.until(from(11.0), 90.0), (41.0, Verdict::Isolate));
    assert_eq!(jumped.judge(340.9, 90.0, 1.0, BAD), Verdict::Isolate);
    jumped.lockout.finish(("depth", Time::MIN), false, &mut jumped.reports);
    assert_eq!(jumped.severities(), [Severity::Contained, Severity::DoNotUse]);
    assert_eq!(jumped.judge(341.0, f64::INFINITY, 1.0, BAD), Verdict::Isolate);
    assert_eq!(jumped.judge(342.0, 90.0, 1.0, BAD), Verdict::Inflate);
    assert_eq!(jumped.severities()[2..], [Severity::DoNotUse]);
    // the sensor is used again, and a new jump is no evidence
    assert_eq!(jumped.judge(343.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert_eq!(jumped.until(from(344.0), 90.0), (374.0, Verdict::Inflate));

    let mut wrong = Sensor::new(Action::Inflate);
    let contradicted = Some(true);
    let last = from(11.0).map(|t| wrong.judge(t, 39.0, 1.0, Evidence { contradicted, ..BAD }));
    assert_eq!(last.take(31).last(), Some(Verdict::Isolate));
    assert_eq!(wrong.judge(1000.0, 39.0, 1.0, BAD), Verdict::Isolate);
    wrong.lockout.finish(("depth", Time::MIN), false, &mut wrong.reports);
    assert_eq!(wrong.severities(), [Severity::Contained; 2]);
    // the filter has gone on without any sensor
    assert_eq!(wrong.lockout.mostly_isolated_since(), Time::from_seconds(11.0));
    wrong.lockout.finish(("depth", Time::MIN), true, &mut wrong.reports);
    assert_eq!(wrong.severities()[2..], [Severity::DoNotUse]);
}

/// The isolation begins at 41 s. Its innovation has not gone: the covariance has grown.
#[test]
fn a_sensor_that_was_contradicted_is_tried_again_once_the_filter_knows_no_better() {
    let mut wrong = Sensor::new(Action::Inflate);
    let contradicted = Some(true);
    let last = from(11.0).map(|t| wrong.judge(t, 39.0, 1.0, Evidence { contradicted, ..BAD }));
    assert_eq!(last.take(31).last(), Some(Verdict::Isolate));
    assert_eq!(wrong.judge(340.9, 9.0, 1.0, GOOD), Verdict::Isolate);
    assert_eq!(wrong.judge(342.0, 11.0, 1.0, BAD), Verdict::Isolate);
    assert_eq!(wrong.judge(343.0, 9.0, 1.0, GOOD), Verdict::Try);
    assert_eq!(wrong.judge(344.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert_eq!(wrong.severities(), [Severity::Contained, Severity::Doubtful]);
    assert!(!wrong.lockout.disagrees());
}

#[test]
fn a_sensor_that_is_gated_at_the_end_is_warned_of() {
    let mut sensor = Sensor::new(Action::Report);
    sensor.lockout.finish(("depth", Time::MIN), false, &mut sensor.reports);
    assert!(sensor.reports.events.is_empty());
    sensor.until([11.0, 12.0], 90.0);
    sensor.lockout.finish(("depth", Time::MIN), false, &mut sensor.reports);
    let [(Level::Warning, text)] = &sensor.reports.events[..] else { unreachable!() };
    assert!(text.contains("last 2 samples"), "{text}");
}

/// Eleven samples were used before. Those that are gated agree with each other.
#[test]
fn gated_samples_that_agree_win_once_they_are_ten_times_as_many_as_the_used_ones() {
    let repeated = Evidence { repeated: true, ..BAD };
    let found = |evidence: Evidence, nis: f64| {
        let mut sensor = Sensor::new(Action::Inflate);
        let verdicts: Vec<Verdict> =
            (11..121).map(|time| sensor.judge(f64::from(time), nis, 1.0, evidence)).collect();
        (verdicts[108], verdicts[109], sensor.severities())
    };
    // a jump isolates the sensor at first
    let both = vec![Severity::Contained, Severity::Doubtful];
    assert_eq!(found(repeated, 90.0), (Verdict::Isolate, Verdict::Follow, both));
    // they contradict each other, or other sensors contradict them
    assert_eq!(found(BAD, 90.0).1, Verdict::Isolate);
    assert_eq!(found(Evidence { contradicted: Some(true), ..repeated }, 39.0).1, Verdict::Isolate);
}

/// The first sample of a sensor is an outlier, which a wide prior lets pass.
#[test]
fn a_first_sample_that_was_wrong_costs_ten_samples() {
    let repeated = Evidence { repeated: true, ..BAD };
    let mut sensor = Sensor::unused(Action::Inflate);
    assert_eq!(sensor.judge(0.0, 1.0, 1.0, GOOD), Verdict::Pass);
    let verdicts: Vec<Verdict> =
        from(1.0).take(10).map(|time| sensor.judge(time, 90.0, 1.0, repeated)).collect();
    assert_eq!(verdicts[8..], [Verdict::Gate, Verdict::Follow]);
    // a second time is not quick: the sensor may have been right before
    assert_eq!(sensor.severities(), [Severity::Doubtful]);
    let mut again = from(11.0).take(20).map(|time| sensor.judge(time, 90.0, 1.0, repeated));
    assert!(again.all(|verdict| verdict == Verdict::Gate));
}

/// The last used sample was at 10 s. A stop that was taken for a spike makes the filter wrong at once.
#[test]
fn a_jump_after_replaced_samples_of_the_driving_sensor_is_the_filters() {
    let found = |seconds: f64| {
        let mut sensor = Sensor::new(Action::Inflate);
        let evidence = Evidence { replaced: Time::from_nanos((seconds * 1e9) as i64), ..BAD };
        let verdicts = [11.0, 12.0, 13.0].map(|time| sensor.judge(time, 90.0, 1.0, evidence));
        (verdicts[2], sensor.severities())
    };
    assert_eq!(found(10.5), (Verdict::Inflate, vec![Severity::Contained]));
    assert_eq!(found(9.5), (Verdict::Gate, vec![]), "a sample was used since then");
}

#[test]
fn a_sensor_that_is_obeyed_sets_the_estimate_with_its_first_gated_sample() {
    let mut sensor = Sensor::new(Action::Obey);
    assert_eq!(sensor.judge(11.0, f64::INFINITY, 1.0, BAD), Verdict::Gate);
    assert_eq!(sensor.judge(12.0, 1e6, 1.0, BAD), Verdict::Obey);
    assert_eq!(sensor.judge(13.0, 1.0, 1.0, GOOD), Verdict::Pass);
    assert!(sensor.severities().is_empty(), "an operator is no fault");
}
