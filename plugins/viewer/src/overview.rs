//! The overview: whether the run may be used, what converged, which sensor was bad and when.

mod bad;
mod determined;
mod errors;
mod live;

use crate::lane::SensorLane;
use crate::run::Run;
use crate::state::BlockSeries;
use errors::Errors;
use navfuse_core::model::record::answers::{Answers, Truth};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::{Criterion, Verdict};
use navfuse_core::units::time::Time;
use std::fmt::Write;

/// Greatest number of rows of the table of the sensors on the page, which has two sensors in a row if there
/// are more. Once the run is over, the table stands under the states if there are more than twice as many.
pub const MANY: usize = 7;
/// Number of sensors up to which the page of a run that goes on leaves room for a plot and the states.
pub const FEW: usize = 5;
/// Mark of a NIS outside its band.
const OUTSIDE: &str = " **!**";
/// The component with the largest error in sigma, as block and component; without a truth, the
/// component that converged least.
pub fn worst(blocks: &[BlockSeries]) -> Option<(usize, usize)> {
    let all = || {
        blocks.iter().enumerate().flat_map(|(b, block)| {
            block.components.iter().enumerate().map(move |(k, c)| (b, k, &c.tally))
        })
    };
    let error = all()
        .filter_map(|(b, k, tally)| Some((b, k, tally.worst?.sigmas)))
        .max_by(|x, y| x.2.total_cmp(&y.2));
    let sigma = || {
        all()
            .filter_map(|(b, k, tally)| Some((b, k, tally.converged()?)))
            .max_by(|x, y| x.2.total_cmp(&y.2))
    };
    error.or_else(sigma).map(|(b, k, _)| (b, k))
}

/// The page of the overview at a time; `left` is the weight that the prior of a component still has.
pub fn page(
    run: &Run,
    (verdict, now): (Option<&Verdict>, Time),
    left: &dyn Fn(&str, &str) -> Option<f64>,
) -> String {
    let mut page = String::new();
    let name = if run.smoothed { format!("{}, smoothed", run.name) } else { run.name.clone() };
    let errors = Errors::of(&run.blocks, run.simulated, run.reference);
    match verdict {
        Some(verdict) => write_verdict(&mut page, &name, verdict, &errors),
        None => live::write(&mut page, &name, run, now),
    }
    // the answers before the table: a small window shows them without scrolling
    bad::write(&mut page, &run.lanes, &run.sensors, verdict, now);
    determined::write(&mut page, &run.blocks, left);
    errors.answer(&mut page, verdict, &run.blocks);
    if on_page(run, verdict) {
        write_sensors(&mut page, &run.lanes, verdict);
    }
    if verdict.is_none() && run.lanes.len() > FEW {
        write_colours(&mut page);
    }
    page
}

/// Writes the meaning of the colours, which have no strip of their own while the run goes on.
fn write_colours(page: &mut String) {
    let _ = writeln!(page, "\nColours of the strips: {}.", crate::legend::in_words());
}

/// Returns `true` if the table of the sensors is on the page.
fn on_page(run: &Run, verdict: Option<&Verdict>) -> bool {
    verdict.is_none() || run.lanes.len() <= 2 * MANY
}

/// The table of the states, and that of many sensors, or the colours of the strips of few.
pub fn states(run: &Run, verdict: Option<&Verdict>) -> String {
    let mut page = errors::states(run);
    if verdict.is_none() && run.lanes.len() <= FEW {
        write_colours(&mut page);
    }
    if !on_page(run, verdict) {
        write_sensors(&mut page, &run.lanes, verdict);
    }
    page
}

/// The verdict of a run in words, and how severe it is, for the title and the strip.
pub fn judged(run: &Run, verdict: &Verdict) -> (String, Severity) {
    in_words(verdict, &Errors::of(&run.blocks, run.simulated, run.reference))
}

/// The same. The truth of a simulation may contradict what the run alone cannot find.
fn in_words(verdict: &Verdict, errors: &Errors) -> (String, Severity) {
    let (words, severity) = (verdict.words(), verdict.severity());
    if errors.contradict() && severity <= Severity::Contained {
        (format!("{words}, but the truth contradicts its sigma"), Severity::Doubtful)
    } else {
        (words.to_owned(), severity)
    }
}

fn write_verdict(page: &mut String, name: &str, verdict: &Verdict, errors: &Errors) {
    let given = verdict.answers();
    let Answers { because, sigma, sigma_because, .. } = &given;
    let _ = writeln!(page, "# {name}: {}\n", in_words(verdict, errors).0);
    let sigma = match sigma {
        // one judgement: the truth knows what no innovation shows
        Truth::True | Truth::TooLarge if errors.contradict() => {
            format!("**too small** by the truth{}", errors.most())
        }
        // the safe side of the noise of a sensor, and not that of the states
        Truth::TooLarge if errors.are_outside() => "**too large** by the innovations".to_owned(),
        // the same reason once
        sigma if sigma_because == because => format!("**{}**", sigma.words()),
        sigma => format!("**{}**{}", sigma.words(), more(sigma_because)),
    };
    let _ = writeln!(page, "{}\n", answers(&given, Some(&sigma)));
    for reason in &verdict.reasons {
        let words = match reason.criterion {
            // the reference is the evidence, and nothing says that it is bad
            Criterion::Reference => "against the reference",
            _ => reason.severity.words(),
        };
        let (about, text) = (&reason.about, sentence(&reason.text, &reason.remedy));
        // after a silence the noise of the driving sensor is in doubt, and none of its samples
        let what = if reason.criterion == Criterion::Silence { "stated noise of " } else { "" };
        let _ = writeln!(page, "- {words}: {what}**{about}**: {text}");
    }
}

/// A reason behind an answer, if there is any.
fn more(because: &str) -> String {
    if because.is_empty() { String::new() } else { format!(", {because}") }
}

/// The answers in one line: usable, is the sigma true, and what to look at.
fn answers(Answers { usable, because, change, .. }: &Answers, sigma: Option<&str>) -> String {
    let about: Vec<&str> = change.iter().map(|change| change.about.as_str()).collect();
    let about = if about.is_empty() { "nothing".to_owned() } else { about.join(", ") };
    let sigma = sigma.map_or_else(String::new, |sigma| format!(" · sigma: {sigma}"));
    format!("Usable: **{}**{}{sigma} · look at: **{about}**", usable.words(), more(because))
}

/// A finding and its remedy. The full stop belongs to the remedy: on a line of its own it would stand alone.
fn sentence(text: &str, remedy: &str) -> String {
    if remedy.is_empty() { format!("{text}.") } else { format!("{text}; *{remedy}.*") }
}

/// The numbers of samples of each sensor, two sensors in a row if there are many.
fn write_sensors(page: &mut String, lanes: &[SensorLane], verdict: Option<&Verdict>) {
    let beside = if lanes.len() > MANY { 2 } else { 1 };
    let marked = lanes.iter().any(|lane| cells(lane, verdict).ends_with(OUTSIDE));
    let nis = match verdict {
        Some(_) if marked => "NIS (expected), **!** unlikely",
        Some(_) => "NIS (expected)",
        None => "NIS of the last 25 (expected)",
    };
    let joined = |part: &str| vec![part; beside].join(" | ");
    let _ =
        writeln!(page, "\n| {} |", joined(&format!("sensor | used | gated | rejected | {nis}")));
    let _ = writeln!(page, "| {} |", joined("--- | --: | --: | --: | --:"));
    let rows = lanes.len().div_ceil(beside);
    for row in lanes[..rows].iter().enumerate().map(|(k, first)| [Some(first), lanes.get(rows + k)])
    {
        let cells = row.iter().take(beside).map(|lane| match lane {
            Some(lane) => cells(lane, verdict),
            None => " | | | |".to_owned(),
        });
        let _ = writeln!(page, "| {} |", cells.collect::<Vec<_>>().join(" | "));
    }
    let in_part = |lane: &SensorLane| {
        let count = lane.in_part.count;
        (count > 0).then(|| format!("{count} of **{}**", lane.name))
    };
    let in_part: Vec<String> = lanes.iter().filter_map(in_part).collect();
    if !in_part.is_empty() {
        let in_part = in_part.join(", ");
        let _ = writeln!(
            page,
            "\nCounted as refused and as used, since other channels were used: {in_part}."
        );
    }
}

/// The cells of a sensor: name, samples that were used, gated and rejected, and NIS.
fn cells(lane: &SensorLane, verdict: Option<&Verdict>) -> String {
    let whole = verdict.and_then(|v| v.sensor(&lane.name)).map(|s| {
        let mark = if s.inside { "" } else { OUTSIDE };
        format!("{:.2} ({:.2}){mark}", s.mean_nis, s.expected_nis)
    });
    let latest = lane.lane.nis().filter(|_| verdict.is_none());
    let latest = latest.map(|[mean, expected]| format!("{mean:.2} ({expected:.2})"));
    let used = lane.outcomes.accepted + lane.outcomes.placed;
    let nis = whole.or(latest).unwrap_or_default();
    let (gated, rejected) = (lane.outcomes.gated, lane.outcomes.all_rejected());
    format!("**{}** | {used} | {gated} | {rejected} | {nis}", lane.name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::record::verdict::Reason;

    fn reason(criterion: Criterion, severity: Severity, about: &str) -> Reason {
        let (text, remedy) = ("evidence".to_owned(), "remedy".to_owned());
        Reason { criterion, severity, about: about.to_owned(), text, remedy }
    }

    fn page_of(reasons: &[Reason]) -> String {
        let mut page = String::new();
        let errors = Errors::of(&[], true, None);
        write_verdict(&mut page, "dive", &Verdict::new(reasons.to_vec(), Vec::new()), &errors);
        page
    }

    #[test]
    fn a_contained_fault_is_usable_in_the_title_and_a_reference_is_not_bad() {
        let contained = reason(Criterion::Finding, Severity::Contained, "gnss");
        assert!(page_of(&[contained]).starts_with("# dive: usable, with a contained fault\n"));
        let fault = reason(Criterion::Finding, Severity::DoNotUse, "imu");
        let off = reason(Criterion::Reference, Severity::DoNotUse, "estimate");
        let page = page_of(&[fault, off]);
        assert!(page.contains("look at: **imu**\n"), "{page}");
        assert!(page.contains("- against the reference: **estimate**: evidence"), "{page}");
    }

    #[test]
    fn a_sigma_that_notes_doubt_slightly_is_true_to_their_size() {
        let note = reason(Criterion::Nis, Severity::Note, "dvl");
        assert!(page_of(&[note]).contains("sigma: **true**, to 20 % ·"));
        let drift = reason(Criterion::Drift, Severity::Doubtful, "gnss");
        let page = page_of(&[drift]);
        let words = "with care**, gnss: innovations drift · sigma: **too small** ·";
        assert!(page.contains(words), "{page}");
    }
}
