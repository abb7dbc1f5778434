//! The result of a run as tables.

use super::terminal::{Detail, Tone};
use super::{Table, line, marked_line, marked_table, right, table, warn};
use navfuse_core::model::record::answers::Answers;
use navfuse_core::model::record::verdict::{Reason, Verdict, VerdictLevel};
use navfuse_core::model::record::{Event, Level, Record, Wants};
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::session::summary::{Recorded, StateRow, Summary};
use navfuse_core::smooth::QualityReport;
use navfuse_core::state::Mode;
use navfuse_core::units::time::Time;

/// Length of the end of a warning, bytes, from which on it is printed once.
const REPEATED: usize = 40;

/// Prints the result of a run.
pub fn summary(summary: &Summary) {
    line(&summary.scenario);
    let mut states = table(&["state", "", "estimate", "1-sigma", "error", "error/sigma", "unit"]);
    for row in &summary.rows {
        state(row, &mut states);
    }
    right(&mut states, 2..6);
    line(format_args!("{states}\n"));
    for (row, since) in summary.rows.iter().filter_map(|row| Some((row, row.since?))) {
        line(format_args!(
            "{}: fixed by the scenario, found to be wrong, and estimated since {since}\n",
            row.name
        ));
    }
    let mut sensors =
        table(&["sensor", "read", "used", "gated", "rejected", "mean NIS", "expected", "band", ""]);
    for (name, value) in &summary.samples {
        let text = |key: &str| value.get(key).map_or_else(String::new, ToString::to_string);
        let used = value
            .get("used")
            .or_else(|| value.get("accepted"))
            .map_or_else(String::new, ToString::to_string);
        let nis = value
            .get("mean_nis")
            .and_then(serde_json::Value::as_f64)
            .map_or_else(String::new, |n| format!("{n:.2}"));
        let mut rejected = text("rejected");
        if let Some(excluded) = value.get("excluded") {
            let and = if rejected.is_empty() { "" } else { ", " };
            rejected += &format!("{and}{excluded} excluded");
        }
        let [expected, band, mark] = consistency(&summary.verdict, name);
        let counts = [name.clone(), text("read"), used, text("gated"), rejected, nis];
        sensors.add_row([&counts[..], &[expected, band, mark]].concat());
    }
    right(&mut sensors, 1..8);
    marked_table(&sensors, &[("outside", Tone::Bad)]);
    line("");
    rejected(summary);
    for (name, start) in &summary.starts {
        line(format_args!("{name} {}", start["text"].as_str().unwrap_or_default()));
    }
    line(format_args!(
        "{:.0} s and {:.0} m in {:.2} s",
        summary.duration_s, summary.distance_m, summary.wall_s
    ));
    if let Some(e) = &summary.horizontal_error_m {
        let percent = e
            .percent_of_distance
            .map_or_else(String::new, |p| format!(", {p:.3} % of the distance"));
        line(format_args!(
            "horizontal error {:.2} m at the end{percent}; {:.2} m rms",
            e.last, e.rms
        ));
    }
    if let Some(e) = &summary.filtered_horizontal_error_m {
        line(format_args!("the filter alone: {:.2} m at the end; {:.2} m rms", e.last, e.rms));
    }
    if let Some(quality) = &summary.smoothing {
        smoothing(quality);
    }
}

/// Prints the quality of a smoothed run.
fn smoothing(quality: &QualityReport) {
    let mut fits = table(&[
        "smoothed fit",
        "used",
        "mean square",
        "expected",
        "outliers",
        "gated",
        "good among gated",
    ]);
    for fit in &quality.sensors {
        let mean = fit.mean.map_or_else(String::new, |mean| fixed(mean, 2));
        let (used, outliers) = (fit.used.to_string(), fit.outliers.to_string());
        let (gated, plausible) = (fit.gated.to_string(), fit.plausible.to_string());
        let expected = "1.00".to_owned();
        fits.add_row([fit.sensor.clone(), used, mean, expected, outliers, gated, plausible]);
    }
    right(&mut fits, 1..7);
    line(format_args!("\n{fits}\n"));
    quality.passes.iter().for_each(|passes| line(format_args!("passes: {}", passes.text)));
    quality.weak.iter().for_each(|text| line(format_args!("weak: {text}")));
    if !quality.unobserved.is_empty() {
        let names = quality.unobserved.join(", ");
        line(format_args!("not observed: {names}: 1-sigma never below 90 % of its initial value"));
    }
    quality.contradictions.iter().for_each(|text| line(format_args!("contradiction: {text}")));
    quality.reconsidered.iter().for_each(|text| line(format_args!("reconsidered: {text}")));
}

/// Prints the reasons of the rejected samples, a line for each, and how many were used in part.
fn rejected(summary: &Summary) {
    for (name, value) in &summary.samples {
        let reasons = value.get("rejected_for").and_then(serde_json::Value::as_object);
        for (reason, count) in reasons.into_iter().flatten() {
            line(format_args!("{name}: {count} rejected: {reason}"));
        }
        if let Some(count) = value.get("used_in_part") {
            line(format_args!(
                "{name}: {count} gated or rejected samples were used in part, by other channels"
            ));
        }
    }
}

/// The expected NIS of a sensor, the band of its mean, and a mark if the mean is outside.
fn consistency(verdict: &Verdict, sensor: &str) -> [String; 3] {
    verdict.sensor(sensor).map_or_else(Default::default, |s| {
        let mark = if s.inside { "" } else { "outside" };
        [
            format!("{:.2}", s.expected_nis),
            format!("{:.2} to {:.2}", s.band.low, s.band.high),
            mark.to_owned(),
        ]
    })
}

/// Prints the reasons of a verdict with their remedies, and the verdict in the last line. Where
/// results alone are printed, the verdict is alone.
pub fn verdict(verdict: &Verdict) {
    let (words, tone) = (verdict.words(), tone(verdict.level));
    if Detail::is_quiet() {
        return marked_line(format_args!("verdict: {verdict}"), &[(words, tone)]);
    }
    grounds(verdict);
    marked_line(format_args!("verdict: {}", verdict.headline()), &[(words, tone)]);
}

/// Prints the reasons with their remedies, the three answers, and the command that looks further.
fn grounds(verdict: &Verdict) {
    for reason in &verdict.reasons {
        let (words, level) = (reason.severity.words(), VerdictLevel::from(reason.severity));
        let remedy =
            if reason.remedy.is_empty() { String::new() } else { format!("; {}", reason.remedy) };
        marked_line(format!("{words}: {reason}{remedy}"), &[(words, tone(level))]);
    }
    if !verdict.reasons.is_empty() {
        answers(&verdict.answers());
    }
    if verdict.level != VerdictLevel::Consistent {
        line("cause:  `navfuse diagnose` with this scenario or log tries each plausible change");
    }
}

/// Prints the answers to the three questions, a line for each.
fn answers(answers: &Answers) {
    let Answers { usable, because, sigma, sigma_because, change } = answers;
    let more = |text: &str| if text.is_empty() { String::new() } else { format!(", {text}") };
    line(format_args!("usable: {}{}", usable.words(), more(because)));
    line(format_args!("sigma:  {}{}", sigma.words(), more(sigma_because)));
    let parts: Vec<&str> = change.iter().map(|change| change.about.as_str()).collect();
    if !parts.is_empty() {
        line(format_args!("change: {}", parts.join(", ")));
    }
}

/// The tone of a verdict.
pub fn tone(level: VerdictLevel) -> Tone {
    match level {
        VerdictLevel::Consistent => Tone::Good,
        VerdictLevel::Doubtful => Tone::Doubtful,
        VerdictLevel::DoNotUse => Tone::Bad,
    }
}

fn state(row: &StateRow, table: &mut Table) {
    if row.mode == Mode::Fixed && row.error.is_none() && row.since.is_none() {
        return;
    }
    for (k, component) in row.components.iter().enumerate() {
        let sigma = row.sigma[k];
        let angle =
            row.estimate.len() == 3 && row.unit == "m" && k < 2 && component.ends_with("itude");
        let estimate = if angle {
            format!("{:.7} deg", row.estimate[k])
        } else {
            number(row.estimate[k], sigma)
        };
        let error = row.error.as_ref().map(|e| e[k]);
        let then = row.error_sigma[k]; // at the error's time
        let ratio = error.filter(|_| then > 0.0).map_or_else(String::new, |e| fixed(e / then, 1));
        let sigma_text = match row.mode {
            Mode::Fixed if row.since.is_some() => number(sigma, sigma),
            Mode::Fixed => "fixed".to_owned(),
            Mode::Consider => format!("{} considered", number(sigma, sigma)),
            Mode::Estimate => number(sigma, sigma),
        };
        table.add_row([
            if k == 0 { row.name.clone() } else { String::new() },
            (*component).to_owned(),
            estimate,
            sigma_text,
            error.map_or_else(String::new, |e| number(e, sigma)),
            ratio,
            row.unit.to_owned(),
        ]);
    }
}

/// A number with the digits that are significant given its sigma, and one more.
pub fn number(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() {
        (1.0 - sigma.log10().floor()).clamp(0.0, 9.0)
    } else {
        6.0
    };
    fixed(value, decimals as usize)
}

/// A number with this many decimals; a zero has no sign.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let zero = value.is_finite() && !text.contains(|c: char| c.is_ascii_digit() && c != '0');
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Prints the places that the sinks wrote to.
pub fn recorded(recorded: &[Recorded]) {
    for r in recorded {
        line(format_args!("{:<6} {}", r.sink, r.place));
    }
}

/// Prints warnings and errors on standard error: all errors, and at most 20 warnings, or as many as
/// the amount of output asks for.
pub fn events(events: &[Event]) {
    let shown = match Detail::get() {
        Detail::Quiet => 0,
        Detail::Usual => 20,
        Detail::Verbose => usize::MAX,
    };
    let short = without_repetition(events);
    short.iter().filter(|e| e.level < Level::Error).take(shown).for_each(|e| event(e, 0));
    let more = events.iter().filter(|e| e.level < Level::Error).count().saturating_sub(shown);
    if more > 0 && Detail::get() != Detail::Quiet {
        warn(format_args!("and {more} more warnings: see the log"));
    }
    short.iter().filter(|e| e.level == Level::Error).for_each(|e| event(e, 0));
}

/// The events without those that a reason of the verdict states, which is printed after them.
pub fn unstated(events: &[Event], verdict: &Verdict) -> Vec<Event> {
    let states = |reason: &Reason, event: &Event| {
        let whole = match reason.remedy.as_str() {
            "" => reason.text.clone(),
            remedy => format!("{}; {remedy}", reason.text),
        };
        reason.about == event.about
            && whole.ends_with(&event.text)
            && reason.text.contains(&event.time.to_string())
    };
    let stated = |event: &Event| verdict.reasons.iter().any(|reason| states(reason, event));
    events.iter().filter(|event| !stated(event)).cloned().collect()
}

/// The events, of which one that ends as an earlier one about the same part, such as with the same remedy,
/// refers to that.
fn without_repetition(events: &[Event]) -> Vec<Event> {
    let repeated = |(k, event): (usize, &Event)| {
        let parts = event.text.match_indices([',', ';']).map(|(at, _)| at);
        let mut long = parts.filter(|at| event.text.len() - at >= REPEATED);
        let before = |tail: &str| {
            events[..k].iter().any(|e| e.about == event.about && e.text.ends_with(tail))
        };
        let mut short = event.clone();
        if let Some(at) = long.find(|at| before(&event.text[*at..])) {
            short.text = format!("{}: see above", &event.text[..at]);
        }
        short
    };
    events.iter().enumerate().map(repeated).collect()
}

/// Prints an event on standard error, and the number of those about its part that are in the log alone.
pub fn event(event: &Event, more: u64) {
    let word = match event.level {
        Level::Info => "note",
        Level::Warning => "warning",
        Level::Error => "error",
    };
    let more = match more {
        0 => String::new(),
        more => format!("; {more} more warnings about it came before: see the log"),
    };
    warn(format_args!("{word}: {}{}{more}", when(event), said(event)));
}

/// Sink that prints the notes of a run on standard error as they come.
#[derive(Clone, Copy, Debug)]
pub struct Notes;

impl Sink for Notes {
    fn wants(&self) -> Wants {
        Wants::EVENTS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if let Record::Event(note) = record
            && note.level == Level::Info
        {
            event(note, 0);
        }
        Ok(())
    }
}

/// The time of an event with a space, or nothing for one without a time.
pub fn when(event: &Event) -> String {
    if event.time == Time::MIN { String::new() } else { format!("{} ", event.time) }
}

/// What an event reports, and about which part: `gnss lost: no sample for 5 s` names it already.
pub fn said(Event { about, text, .. }: &Event) -> String {
    if text.starts_with(about) { text.clone() } else { format!("{about}: {text}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::record::finding::Severity;
    use navfuse_core::model::record::verdict::Criterion;

    fn warning(seconds: i64, text: &str) -> Event {
        let time = Time::from_nanos(seconds * 1_000_000_000);
        Event { time, level: Level::Warning, about: "dvl".into(), text: text.into() }
    }

    #[test]
    fn a_finding_is_printed_once_as_a_reason_and_a_remedy_once_as_a_warning() {
        let (text, remedy) = ("at 310.500 s: its lever arm is wrong".into(), "measure it".into());
        let (criterion, severity) = (Criterion::Finding, Severity::DoNotUse);
        let reason = Reason { criterion, severity, about: "dvl".into(), text, remedy };
        let verdict = Verdict::new(vec![reason], Vec::new());
        let found = |ms: i64| Event {
            time: Time::from_nanos(ms * 1_000_000),
            ..warning(0, "its lever arm is wrong; measure it")
        };
        let events = [found(310_500), found(320_000), warning(400, "lost")];
        assert_eq!(unstated(&events, &verdict), events[1..]);
        let mean = |mean: &str| {
            format!(
                "velocity z has a mean of {mean}, where a filter has none; look at the sensor, at its axes"
            )
        };
        let events = [warning(10, &mean("1")), warning(20, &mean("2")), warning(30, "lost; look")];
        let short: Vec<String> = without_repetition(&events).into_iter().map(|e| e.text).collect();
        assert_eq!(short[0], mean("1"));
        assert_eq!(short[1..], ["velocity z has a mean of 2: see above", "lost; look"]);
    }
}
