//! The headline of a run that goes on: the verdict so far and since when, and what the sensors do now.

use crate::axis::{self, short};
use crate::run::Run;
use crate::state::Component;
use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::model::record::health::Health;
use navfuse_core::model::record::verdict::{Criterion, Reason, Verdict};
use navfuse_core::units::time::Time;
use std::fmt::Write;

/// Writes the headline.
pub fn write(page: &mut String, name: &str, run: &Run, now: Time) {
    let at = now.seconds();
    let worst = run.findings.iter().max_by_key(|f| (f.severity, std::cmp::Reverse(f.time)));
    let worst = worst.filter(|finding| finding.severity > Severity::Note);
    let Some(Finding { time, about, severity, text, remedy, .. }) = worst else {
        let _ = writeln!(page, "# {name}: no fault found so far, at {at:.0} s\n");
        write_answers(page, &run.findings);
        return write_now(page, run);
    };
    let (words, since) = (severity.verdict(), time.seconds());
    let _ = writeln!(page, "# {name}: {words} so far, at {at:.0} s\n");
    write_answers(page, &run.findings);
    let _ = writeln!(page, "Since {since:.0} s: **{about}**: {}", super::sentence(text, remedy));
    let others: Vec<String> = (run.findings.iter())
        .filter(|f| f.about != *about && f.severity > Severity::Note)
        .map(|f| format!("**{}** since {:.0} s", f.about, f.time.seconds()))
        .collect();
    if !others.is_empty() {
        let _ = writeln!(page, "\nFaults were also found of {}.", others.join(", "));
    }
    page.push('\n');
    write_now(page, run);
}

/// Writes whether the estimates are usable so far, and which part to look at, in the words of a run that has
/// ended.
fn write_answers(page: &mut String, findings: &[Finding]) {
    let reason = |finding: &Finding| Reason {
        criterion: match finding.basis {
            Basis::Silence => Criterion::Silence,
            _ => Criterion::Finding,
        },
        severity: finding.severity,
        about: finding.about.clone(),
        text: finding.text.clone(),
        remedy: finding.remedy.clone(),
    };
    let verdict = Verdict::new(findings.iter().map(reason).collect(), Vec::new());
    let _ = writeln!(page, "{}\n", super::answers(&verdict.answers(), None));
}

/// Writes which sensors are silent, refused or doubted at present, and which are used.
fn write_now(page: &mut String, run: &Run) {
    let mut parts = Vec::new();
    for health in Health::ALL.into_iter().rev() {
        let names: Vec<String> = (run.lanes.iter())
            .filter_map(|lane| Some((lane, lane.lane.current().filter(|c| c.0 == health)?)))
            .map(|(lane, (_, since))| match health {
                Health::Used => format!("**{}**", lane.name),
                // its first stretch goes on
                Health::Silent if lane.lane.stretches.is_empty() => {
                    format!("**{}** (no sample yet)", lane.name)
                }
                _ => format!("**{}** since {:.0} s", lane.name, since.seconds()),
            })
            .collect();
        if !names.is_empty() {
            parts.push(format!("{}: {}", health.word(), names.join(", ")));
        }
    }
    if !parts.is_empty() {
        let _ = writeln!(page, "Now {}.", parts.join(" · "));
    }
    write_sigma(page, run);
}

/// Writes the sigma of the position at present.
fn write_sigma(page: &mut String, run: &Run) {
    let blocks = run.blocks.iter().filter(|block| block.is_position);
    for block in blocks {
        let largest = block.components.iter().map(|c| c.tally.sigma).fold(0.0, f64::max);
        let Some(first) = block.components.first() else { continue };
        let scale = axis::table(first.unit, largest);
        let sigma = |c: &Component| format!("{} {}", c.name, short(c.tally.sigma / scale.size));
        let all: Vec<String> = block.components.iter().map(sigma).collect();
        let _ = writeln!(page, "\nSigma of the position now: {} {}.", all.join(", "), scale.unit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lane::SensorLane;
    use navfuse_core::model::sensor::{Purpose, SensorInfo};

    fn time(seconds: i64) -> Time {
        Time::from_nanos(seconds * 1_000_000_000)
    }

    /// A sensor that sends a sample every second until a time, s.
    fn lane(name: &str, until: i64, now: i64) -> Option<SensorLane> {
        let info = SensorInfo {
            name: name.into(),
            kind: name.into(),
            channels: Vec::new(),
            purpose: Purpose::Input,
            mounting: Default::default(),
        };
        let mut lane = SensorLane::new(&info)?;
        lane.lane.tick(time(0));
        (0..=until).for_each(|k| lane.lane.sample(time(k)));
        lane.lane.tick(time(now));
        Some(lane)
    }

    fn run(findings: Vec<Finding>) -> Run {
        Run {
            name: "dive".into(),
            full: false,
            blocks: Vec::new(),
            sensors: Vec::new(),
            samples: Vec::new(),
            lanes: [("imu", 90), ("gnss", 20), ("usbl", -1)]
                .into_iter()
                .filter_map(|(name, until)| lane(name, until, 90))
                .collect(),
            track: None,
            simulated: true,
            reference: None,
            smoothed: false,
            worst: None,
            clock: Default::default(),
            findings,
            span: None,
            begun: None,
            corrected: Vec::new(),
            places: Vec::new(),
        }
    }

    #[test]
    fn the_headline_has_the_verdict_so_far_and_since_when_and_what_is_silent_now() {
        let mut page = String::new();
        write(&mut page, "dive", &run(Vec::new()), time(90));
        let silent = "Now silent: **gnss** since 21 s, **usbl** (no sample yet) · used: **imu**.\n";
        let usable = "Usable: **yes** · look at: **nothing**";
        assert_eq!(page, format!("# dive: no fault found so far, at 90 s\n\n{usable}\n\n{silent}"));
        let finding = |seconds, about: &str, severity| Finding {
            time: time(seconds),
            about: about.into(),
            severity,
            basis: Basis::Comparison,
            text: "it jumped".into(),
            remedy: "look at it".into(),
        };
        let findings = vec![
            finding(40, "gnss", Severity::Contained),
            finding(60, "imu", Severity::DoNotUse),
            finding(50, "dvl", Severity::Note),
        ];
        let mut page = String::new();
        write(&mut page, "dive", &run(findings), time(90));
        let expected = [
            "# dive: do not use so far, at 90 s",
            "Usable: **no**, imu: a fault was found · look at: **imu, gnss, dvl**",
            "Since 60 s: **imu**: it jumped; *look at it.*",
            "Faults were also found of **gnss** since 40 s.",
            silent.trim(),
        ];
        let lines: Vec<&str> = page.lines().filter(|line| !line.is_empty()).collect();
        assert_eq!(lines, expected);
    }
}
