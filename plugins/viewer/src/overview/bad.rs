//! Which sensor was bad, and when: the culprits first, then the sensors that were refused because of
//! them, and the silences, which are no faults.

mod words;

use crate::innovation::SensorSeries;
use crate::lane::SensorLane;
use navfuse_core::model::record::finding::{Basis, Severity};
use navfuse_core::model::record::health::{Health, Stretch};
use navfuse_core::model::record::verdict::{Criterion, Verdict};
use navfuse_core::units::time::Time;
use std::fmt::Write;
use words::{APART, found_at, in_words, joined, longest, span, why};

/// Shortest fault in the line of a sensor, and shortest silence, s.
const SHORTEST: f64 = 1.0;
const SHORTEST_SILENCE: f64 = 5.0;
/// Number of gated samples from which on their share in turns counts.
const GATED: u64 = 20;
/// Share of gated samples in turns that names the turns, and how many times larger than the share
/// of all samples it is then.
const IN_TURNS: f64 = 0.7;
const MORE_OFTEN: f64 = 2.0;

/// Writes the answer.
pub fn write(
    page: &mut String,
    lanes: &[SensorLane],
    sensors: &[SensorSeries],
    verdict: Option<&Verdict>,
    now: Time,
) {
    let accused = |lane: &SensorLane| Accusation::of(lane, verdict);
    let mut culprits: Vec<(&SensorLane, Accusation)> =
        lanes.iter().filter_map(|lane| Some((lane, accused(lane)?))).collect();
    // a driving sensor that is useless explains what contradicts it, unless its own samples do
    let driver = culprits.iter().find(|(lane, a)| lane.drives && a.useless).map(|(lane, _)| *lane);
    if let Some(driver) = driver {
        let own = |lane: &SensorLane| lane.found.is_some_and(|found| found.1 == Basis::Samples);
        culprits.retain(|(lane, _)| lane.name == driver.name || own(lane));
    }
    culprits.sort_by_key(|(_, accusation)| accusation.order);
    let guilty = |lane: &SensorLane| culprits.iter().any(|(culprit, _)| culprit.name == lane.name);
    let mut lines = Vec::new();
    for (lane, accusation) in &culprits {
        lines.push(line(lane, sensors, accusation.whole, (now, verdict.is_some())));
    }
    let (mut victims, mut others) = (Vec::new(), Vec::new());
    for lane in lanes.iter().filter(|lane| !guilty(lane)) {
        let faults = faults(lane, now);
        if length(&faults) < SHORTEST {
            continue;
        }
        let of = driver.or_else(|| culprits.iter().map(|c| c.0).find(|c| meet(c, lane, now)));
        match of {
            Some(culprit) => victims.push(format!(
                "**{}**: refused because of {}: {}",
                lane.name,
                culprit.name,
                in_words(lane, sensors, &faults)
            )),
            None => others.push(line(lane, sensors, false, (now, verdict.is_some()))),
        }
    }
    lines.extend(victims.into_iter().chain(others));
    page.push_str("\n**Which sensor was bad, and when?** ");
    let drivers = lanes.iter().filter(|lane| lane.drives).map(|lane| format!("**{}**", lane.name));
    let drivers = drivers.collect::<Vec<_>>().join(" and ");
    let off: Vec<String> = lanes.iter().filter_map(|lane| off(lane, &drivers, now)).collect();
    if lines.is_empty() {
        let refused = |lane: &SensorLane| lane.outcomes.gated + lane.outcomes.all_rejected();
        match (off.is_empty(), lanes.iter().map(refused).sum::<u64>()) {
            (false, _) => page.push_str("None is known to have sent wrong samples."),
            (true, 0) => page.push_str("None: no sample was gated or rejected."),
            (true, _) => {
                let single = "None for longer than a second: single samples were gated or rejected";
                let _ = write!(page, "{single}{}.", reasons(lanes, sensors));
            }
        }
        let others =
            verdict.map(|verdict| parts_without_a_lane(lanes, verdict)).unwrap_or_default();
        if !others.is_empty() {
            let _ = write!(page, " The verdict is about **{}**, no sensor.", others.join("**, **"));
        }
    }
    lines.extend(off);
    page.push_str("\n\n");
    lines.iter().for_each(|line| _ = writeln!(page, "- {line}"));
    write_silences(page, lanes, now);
}

/// The reasons for which samples were rejected before the gate, in brackets.
fn reasons(lanes: &[SensorLane], sensors: &[SensorSeries]) -> String {
    let rejected = |lane: &SensorLane| {
        let count = lane.outcomes.all_rejected();
        (count > 0).then(|| format!("{count} of **{}**{}", lane.name, why(lane, sensors)))
    };
    let all: Vec<String> = lanes.iter().filter_map(rejected).collect();
    if all.is_empty() { String::new() } else { format!(" ({})", all.join("; ")) }
}

/// What the verdict doubts that is no sensor: a state of a process, the alignment, the estimate.
fn parts_without_a_lane<'a>(lanes: &[SensorLane], verdict: &'a Verdict) -> Vec<&'a str> {
    let mut others: Vec<&str> = Vec::new();
    for reason in verdict.reasons.iter().filter(|r| r.severity > Severity::Contained) {
        let known = others.contains(&reason.about.as_str());
        if !known && !lanes.iter().any(|lane| reason.is_about(&lane.name)) {
            others.push(&reason.about);
        }
    }
    others
}

/// That the filter was off after the last silence of a sensor that it needs, which is no fault of the sensor:
/// the driving sensors may have been off meanwhile.
fn off(lane: &SensorLane, drivers: &str, now: Time) -> Option<String> {
    let until = *lane.after_silence.last()?;
    let silent = |s: &Stretch| s.health == Health::Silent && s.to <= until;
    let silence = lane.stretches(now).into_iter().rfind(silent);
    let when = silence.map_or_else(String::new, |s| format!(", silent {} s", span(s.from, s.to)));
    let until = until.seconds();
    let (name, by) = (&lane.name, if drivers.is_empty() { "the process" } else { drivers });
    Some(format!(
        "without **{name}**{when}, the filter went off by more than its sigma, until {until:.0} s: look at \
         {by}, which drove it meanwhile; the silence is no fault of {name}"
    ))
}

/// What speaks against a sensor.
struct Accusation {
    /// Place among the reasons of the verdict, or among the severities so far.
    order: usize,
    /// Set where a finding makes the result useless.
    useless: bool,
    /// Set for statistics of the whole run, which doubt the sensor throughout.
    whole: bool,
}

impl Accusation {
    /// The heaviest reason against a sensor, or the heaviest finding while there is no verdict.
    fn of(lane: &SensorLane, verdict: Option<&Verdict>) -> Option<Self> {
        let Some(verdict) = verdict else {
            let (severity, _) = lane.found.filter(|found| found.0 > Severity::Note)?;
            let order = usize::from(severity != Severity::DoNotUse);
            return Some(Self { order, useless: order == 0, whole: false });
        };
        let of = |criterion: &dyn Fn(Criterion) -> bool, least: Severity| {
            verdict.reasons.iter().position(|r| {
                criterion(r.criterion) && r.severity > least && r.is_about(&lane.name)
            })
        };
        // a finding has a time; a statistic of the whole run has none
        let found = of(&|c| c == Criterion::Finding, Severity::Note);
        let whole = of(&Criterion::is_of_the_whole_run, Severity::Contained);
        let order = found.or(whole)?;
        let useless = found.is_some_and(|k| verdict.reasons[k].severity == Severity::DoNotUse);
        Some(Self { order, useless, whole: whole.is_some() })
    }
}

/// The stretches in which the samples of a sensor were refused, or too far off.
fn faults(lane: &SensorLane, now: Time) -> Vec<Stretch> {
    let bad = |s: &Stretch| s.health.refuses() || s.health == Health::Noisy;
    // the filter was off after a silence, and the sensor was not
    let of_silence = |s: &Stretch| {
        lane.after_silence.iter().any(|found| s.from <= *found && found.since(s.to) <= APART)
    };
    lane.stretches(now).into_iter().filter(|s| bad(s) && !of_silence(s)).collect()
}

fn length(stretches: &[Stretch]) -> f64 {
    stretches.iter().map(|s| s.to.since(s.from)).sum()
}

/// Returns `true` if a fault of one sensor began while the other one was at fault or doubted.
fn meet(culprit: &SensorLane, lane: &SensorLane, now: Time) -> bool {
    let bad = |s: &&Stretch| !matches!(s.health, Health::Used | Health::Silent);
    let stretches = culprit.stretches(now);
    let inside = |from: Time| stretches.iter().filter(bad).any(|s| s.from <= from && from <= s.to);
    faults(lane, now).iter().any(|fault| inside(fault.from))
}

/// The line of a sensor: its fault from its begin to its end, in what it consists, and for how long
/// its samples were used with doubt; `over` once the run has ended.
fn line(
    lane: &SensorLane,
    sensors: &[SensorSeries],
    whole: bool,
    (now, over): (Time, bool),
) -> String {
    let faults = faults(lane, now);
    let mut line = format!("**{}**", lane.name);
    let turns = if is_bad_in_turns(lane) {
        ", mostly in turns: look at its lever arm, mounting angles and clock"
    } else {
        ""
    };
    if whole {
        let _ = write!(line, ", over the run (see the verdict){turns}");
    }
    let mut parts = Vec::new();
    if whole && !faults.is_empty() {
        parts.push(in_words(lane, sensors, &faults));
    } else if length(&faults) >= SHORTEST {
        let spans = joined(&faults);
        let (first, last) = (spans[0].0, spans[spans.len() - 1].1);
        let when = match spans.len() {
            1 => format!("fault {} s", span(first, last)),
            n => format!(
                "{n} faults between {} s, {:.0} s in all",
                span(first, last),
                length(&faults)
            ),
        };
        parts.push(format!("{when}{turns} ({})", in_words(lane, sensors, &faults)));
    }
    let apart = |time: &&Time| {
        !faults.iter().any(|s| s.from.since(**time) <= APART && time.since(s.to) <= APART)
    };
    let found: Vec<Time> = lane.findings.iter().filter(apart).copied().collect();
    if !found.is_empty() {
        parts.push(found_at(&found));
    }
    let stretches = lane.stretches(now);
    let doubted: Vec<Stretch> =
        stretches.iter().copied().filter(|s| s.health == Health::Doubted).collect();
    let doubted = if whole { Vec::new() } else { doubted };
    match (stretches.last().map(|s| s.health), doubted.first(), doubted.last()) {
        (Some(Health::Isolated), ..) => {
            let when = if over { "at the end" } else { "now" };
            parts.push(format!("the sensor is isolated {when}"));
        }
        (Some(Health::Doubted), Some(first), _) => parts.push(match doubted.len() {
            1 => format!("used with doubt from {:.0} s on", first.from.seconds()),
            n => format!("used with doubt from {:.0} s on, in {n} stretches", first.from.seconds()),
        }),
        (_, _, Some(last)) => parts.push(format!(
            "used with doubt until {:.0} s, when it agreed again",
            last.to.seconds()
        )),
        _ => {}
    }
    if !parts.is_empty() {
        let _ = write!(line, ": {}", parts.join("; "));
    }
    line
}

/// Set where the gate rejects samples in turns above all.
fn is_bad_in_turns(lane: &SensorLane) -> bool {
    let share = |part: u64, whole: u64| part as f64 / whole.max(1) as f64;
    let gated = share(lane.in_turns[1], lane.outcomes.gated);
    lane.outcomes.gated >= GATED
        && gated >= IN_TURNS
        && gated
            >= MORE_OFTEN * share(lane.in_turns[0], lane.outcomes.accepted + lane.outcomes.gated)
}

/// Writes when the sensors had no samples, in a line of its own: a dive has no satellites, and the
/// verdict counts no silence as a fault.
fn write_silences(page: &mut String, lanes: &[SensorLane], now: Time) {
    let of = |lane: &SensorLane| {
        let silent =
            |s: &Stretch| s.health == Health::Silent && s.to.since(s.from) >= SHORTEST_SILENCE;
        let silent: Vec<Stretch> = lane.stretches(now).into_iter().filter(silent).collect();
        (!silent.is_empty()).then(|| format!("**{}** {}", lane.name, longest(silent)))
    };
    let parts: Vec<String> = lanes.iter().filter_map(of).collect();
    if !parts.is_empty() {
        let _ = writeln!(page, "\nSilent, which is no fault by itself: {}.", parts.join("; "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::record::Rejection;
    use navfuse_core::model::record::verdict::Reason;
    use navfuse_core::model::sensor::{Purpose, SensorInfo};

    fn time(seconds: i64) -> Time {
        Time::from_nanos(seconds * 1_000_000_000)
    }

    /// A sensor with those stretches: health and end, s; the first one begins at zero.
    fn lane(name: &str, purpose: Purpose, stretches: &[(Health, i64)]) -> SensorLane {
        let info = SensorInfo {
            name: name.into(),
            kind: name.into(),
            channels: Vec::new(),
            purpose,
            mounting: Default::default(),
        };
        let Some(mut lane) = SensorLane::new(&info) else { unreachable!("no reference") };
        let mut from = time(0);
        for (health, to) in stretches {
            lane.lane.stretches.push(Stretch { health: *health, from, to: time(*to) });
            from = time(*to);
        }
        lane
    }

    fn reason(criterion: Criterion, severity: Severity, about: &str) -> Reason {
        let about = about.to_owned();
        Reason { criterion, severity, about, text: String::new(), remedy: String::new() }
    }

    fn lines(lanes: &[SensorLane], reasons: &[Reason]) -> Vec<String> {
        let mut page = String::new();
        write(&mut page, lanes, &[], Some(&Verdict::new(reasons.to_vec(), Vec::new())), time(630));
        page.lines().filter(|l| l.len() > 2).map(str::to_owned).collect()
    }

    /// A fault lasts from its first refused sample to its last, and the time for which later samples
    /// are doubted is another number.
    #[test]
    fn a_fault_is_as_long_as_its_samples_were_refused() {
        use Health::{Doubted, Gated, Isolated, Used};
        let stretches = [(Used, 250), (Gated, 280), (Isolated, 312), (Doubted, 630)];
        let depth = lane("depth", Purpose::Measurement, &stretches);
        let found = [reason(Criterion::Finding, Severity::Contained, "depth")];
        let expected = "- **depth**: fault 250–312 s (gated 250–280 s; isolated 280–312 s); used with \
                        doubt from 312 s on";
        assert_eq!(lines(&[depth], &found)[1..], [expected]);
        let agrees = [(Used, 250), (Gated, 280), (Doubted, 305), (Used, 630)];
        let agrees = lane("depth", Purpose::Measurement, &agrees);
        let expected = "- **depth**: fault 250–280 s (gated 250–280 s); used with doubt until 305 s, when it \
                        agreed again";
        assert_eq!(lines(&[agrees], &found)[1..], [expected]);
        let to_the_end = lane("depth", Purpose::Measurement, &[(Used, 250), (Isolated, 630)]);
        let expected =
            "- **depth**: fault 250–630 s (isolated 250–630 s); the sensor is isolated at the end";
        assert_eq!(lines(&[to_the_end], &found)[1..], [expected]);
    }

    /// A driving sensor that is useless comes first, and the others are refused because of it, even
    /// where the verdict names them; a fault that the samples of one show by themselves stays its own.
    #[test]
    fn the_culprit_comes_before_the_sensors_that_were_refused_because_of_it() {
        use Health::{Doubted, Gated, Used};
        let mut lanes = [
            lane("depth", Purpose::Measurement, &[(Used, 256), (Gated, 630)]),
            lane("dvl", Purpose::Measurement, &[(Used, 66), (Gated, 630)]),
            lane("imu", Purpose::Input, &[(Used, 206), (Doubted, 630)]),
        ];
        let useless = |about| reason(Criterion::Finding, Severity::DoNotUse, about);
        let reasons = [useless("imu"), useless("dvl")];
        let found = lines(&lanes, &reasons);
        assert_eq!(
            found[1..],
            [
                "- **imu**: used with doubt from 206 s on",
                "- **depth**: refused because of imu: gated 256–630 s",
                "- **dvl**: refused because of imu: gated 66–630 s",
            ]
        );
        lanes[1].found = Some((Severity::DoNotUse, Basis::Samples));
        assert!(lines(&lanes, &reasons)[2].starts_with("- **dvl**: fault 66–630 s"));
        // a sensor that is refused while another one is at fault, and that nothing names
        let lanes = [
            lane("dvl", Purpose::Measurement, &[(Used, 260), (Gated, 270), (Used, 630)]),
            lane("gnss", Purpose::Measurement, &[(Used, 250), (Gated, 280), (Used, 630)]),
            lane("depth", Purpose::Measurement, &[(Used, 400), (Gated, 410), (Used, 630)]),
        ];
        let found = lines(&lanes, &[reason(Criterion::Finding, Severity::Contained, "gnss")]);
        assert_eq!(
            found[1..],
            [
                "- **gnss**: fault 250–280 s (gated 250–280 s)",
                "- **dvl**: refused because of gnss: gated 260–270 s",
                "- **depth**: fault 400–410 s (gated 400–410 s)",
            ]
        );
    }

    /// A note about a stated noise accuses nobody; a doubt about the whole run has no times.
    #[test]
    fn a_sensor_is_bad_where_a_reason_doubts_it_and_silence_is_no_fault() {
        let lanes =
            [lane("gnss", Purpose::Measurement, &[(Health::Silent, 9), (Health::Used, 630)])];
        let silent = "Silent, which is no fault by itself: **gnss** 0–9 s.";
        let note = lines(&lanes, &[reason(Criterion::Nis, Severity::Note, "gnss")]);
        assert!(note[0].contains("None: no sample was gated"), "{note:?}");
        assert_eq!(note[1..], [silent]);
        let doubt = lines(&lanes, &[reason(Criterion::Drift, Severity::Doubtful, "gnss")]);
        assert_eq!(doubt[1..], ["- **gnss**, over the run (see the verdict)", silent]);
        let state = lines(&lanes, &[reason(Criterion::Prior, Severity::Doubtful, "ins.gyro_bias")]);
        assert!(
            state[0].ends_with("The verdict is about **ins.gyro_bias**, no sensor."),
            "{state:?}"
        );
    }

    /// A strip that is green all the time beside "doubtful" contradicts it.
    #[test]
    fn a_sensor_that_the_verdict_doubts_over_the_run_has_a_strip_of_doubt() {
        use Health::{Doubted, Gated, Used};
        let reasons = [reason(Criterion::Drift, Severity::Doubtful, "gnss")];
        let verdict = Verdict::new(reasons.to_vec(), Vec::new());
        for (name, expected) in [("gnss", [Doubted, Gated, Doubted]), ("dvl", [Used, Gated, Used])]
        {
            let mut lane =
                lane(name, Purpose::Measurement, &[(Used, 90), (Gated, 91), (Used, 630)]);
            lane.finish(time(630), Some(&verdict));
            let strip: Vec<Health> = lane.lane.stretches.iter().map(|s| s.health).collect();
            assert_eq!(strip, expected, "{name}");
        }
    }

    /// A bias that moved was found at 580 s, and explained as a step at 590.5 s, the time of the verdict.
    #[test]
    fn the_line_of_a_sensor_has_the_time_of_every_finding() {
        use Health::{Doubted, Gated, Used};
        let seconds = |times: &[f64]| times.iter().filter_map(|t| Time::from_seconds(*t)).collect();
        let mut imu = lane("imu", Purpose::Input, &[(Used, 580), (Doubted, 630)]);
        imu.findings = seconds(&[580.01, 590.5]);
        let found = [reason(Criterion::Finding, Severity::DoNotUse, "imu")];
        let expected = "- **imu**: found at 580.0 and 590.5 s; used with doubt from 580 s on";
        assert_eq!(lines(&[imu], &found)[1..], [expected]);
        // a finding in the time of a fault has no time of its own
        let mut dvl = lane("dvl", Purpose::Measurement, &[(Used, 250), (Gated, 280), (Used, 630)]);
        dvl.findings = seconds(&[249.8, 400.0]);
        let found = [reason(Criterion::Finding, Severity::Contained, "dvl")];
        let expected = "- **dvl**: fault 250–280 s (gated 250–280 s); found at 400.0 s";
        assert_eq!(lines(&[dvl], &found)[1..], [expected]);
    }

    /// The filter is off after a silence, and gates the first samples of the sensor, which is not at fault.
    #[test]
    fn a_filter_that_is_off_after_a_silence_is_no_fault_of_the_sensor() {
        use Health::{Gated, Silent, Used};
        let stretches = [(Used, 250), (Silent, 265), (Gated, 268), (Used, 400)];
        let mut gnss = lane("gnss", Purpose::Measurement, &stretches);
        gnss.after_silence.push(time(268));
        let imu = lane("imu", Purpose::Input, &[(Used, 400)]);
        let found = lines(&[gnss, imu], &[reason(Criterion::Silence, Severity::Contained, "imu")]);
        assert!(found[0].ends_with("None is known to have sent wrong samples."), "{found:?}");
        let expected = "- without **gnss**, silent 250–265 s, the filter went off by more than its sigma, \
                        until 268 s: look at **imu**, which drove it meanwhile; the silence is no fault of gnss";
        assert_eq!(found[1], expected);
        assert!(found[2].starts_with("Silent"), "{found:?}");
    }

    /// A velocity log whose last sample comes after the last one of the IMU.
    #[test]
    fn a_single_sample_that_was_rejected_has_its_reason() {
        let mut dvl = lane("dvl", Purpose::Measurement, &[(Health::Used, 630)]);
        dvl.outcomes.reject(Rejection::NoInput);
        let found = lines(&[dvl], &[]);
        let expected =
            "single samples were gated or rejected (1 of **dvl**, the driving sensor is silent).";
        assert!(found[0].ends_with(expected), "{found:?}");
    }

    #[test]
    fn a_sensor_is_bad_in_turns_where_the_gate_rejects_more_there_than_elsewhere() {
        let turns = |in_turns: [u64; 2]| {
            let stretches = [(Health::Used, 10), (Health::Gated, 16), (Health::Used, 630)];
            let mut lane = lane("dvl", Purpose::Measurement, &stretches);
            (lane.outcomes.accepted, lane.outcomes.gated) = (900, 100);
            lane.in_turns = in_turns;
            lines(&[lane], &[]).pop().is_some_and(|line| line.contains("mostly in turns"))
        };
        // a fifth of all samples are in turns, and with them 90 or 20 of the 100 gated ones
        assert!(turns([200, 90]) && !turns([200, 20]));
        // a vehicle that turns all the time says nothing about turns
        assert!(!turns([950, 95]));
    }
}
