//! Top of the page: facts of the run, and the results to inspect first.

use super::tables;
use crate::history::RunHistory;
use crate::results::Standard;
use maud::{Markup, html};
use navfuse_core::model::chi_square::beyond;
use navfuse_core::model::record::Level;
use navfuse_core::model::record::answers::Answers;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::Verdict;

/// Creates the list of facts of the run.
pub(super) fn facts(history: &RunHistory) -> Markup {
    html! {
        dl.facts {
            @if let Some([from, to]) = history.span() {
                div { dt { "time" } dd { (seconds(from)) " to " (seconds(to)) } }
                div { dt { "duration" } dd { (seconds(to - from)) } }
            }
            @if let Some(metres) = history.distance() {
                div { dt { "distance" } dd { (format!("{metres:.0} m")) } }
            }
            @if let Some(seed) = history.seed { div { dt { "seed" } dd { (seed) } } }
            div { dt { "states" } dd { (number_of_states(history)) } }
            div { dt { "run by" } dd { "navfuse " (history.version) } }
        }
    }
}

/// Creates the list of results to inspect first.
pub(super) fn verdicts(history: &RunHistory) -> Markup {
    let worst = history.worst_error();
    let level = history.level();
    let simulated = history.standard() == Standard::Truth;
    html! {
        @for warning in &history.warnings { p.bad { "Warning: " (warning) } }
        (judged(history.verdict.as_ref()))
        ul {
            @if let Some((last, rms, percent)) = history.horizontal_error() {
                @let sigma = history.horizontal_sigma();
                li {
                    @if simulated { "Horizontal error " } @else { "Horizontal difference from the reference " }
                    b { (format!("{last:.2} m")) } " at the end"
                    @if let Some(sigma) = sigma { (format!(" (stated: ± {sigma:.2} m)")) }
                    @if let Some(percent) = percent {
                        (format!(", {percent:.3} % of the distance"))
                        @if let Some(sigma) = sigma.filter(|_| last > 0.0) {
                            (format!(" (stated: ± {:.3} %)", percent * sigma / last))
                        }
                    }
                    (format!("; {rms:.2} m rms.")) }
            }
            @if let Some((block, k, [error, sigma])) = worst {
                @let ratio = (error / sigma).abs();
                @let large = ratio > 4.0 && simulated;
                li.bad[large] {
                    @if simulated { "Largest error at the end: " }
                    @else { "Largest difference from the reference at the end: " }
                    b { (format!("{ratio:.1} sigma")) }
                    ", of " (block.name) " " (block.axis(k)) ": "
                    (tables::with_sigma(error, sigma))
                    @if !block.unit.is_empty() { " " (block.unit) }
                    @if large {
                        "; for a consistent sigma, only one error in " (one_in(ratio))
                        " is that large"
                    }
                    @if !simulated {
                        "; the sigma leaves out the reference's own error"
                    }
                    "."
                }
            } @else { li { "No truth is known, so no error can be computed." } }
            @if worst.is_some() && !simulated {
                li { "The reference is a recording. If it shares sensors with the filter, their "
                     "common errors do not show in these numbers." }
            }
            @for sensor in history.sensors.iter().filter(|s| s.updates.nis[1] > 0.0) {
                @let [nis, freedom] = sensor.updates.nis;
                @let judged = history.verdict.as_ref().and_then(|v| v.sensor(&sensor.name));
                @let inside = judged.is_none_or(|s| s.inside);
                @let small = judged.is_some_and(|s| s.mean_nis < s.expected_nis);
                li.bad[!inside && !small] {
                    "Innovations of " (sensor.name) ": NIS "
                    b { (format!("{:.3}", nis / freedom)) } " per channel"
                    @if judged.is_none() { "." }
                    @else if inside { ", as the filter expects." }
                    @else if small {
                        ", smaller than the filter expects: the stated noise is too large."
                    }
                    @else {
                        ", larger than the filter expects: the stated noise is too small, or an "
                        "effect is not modelled."
                    }
                }
            }
            @if level > Level::Info {
                li { a href="#events" { (loud(history)) } }
            }
        }
    }
}

/// Counts the warnings and errors among the events, in words.
fn loud(history: &RunHistory) -> String {
    let count = |level| history.events.iter().filter(|e| e.level == level).count();
    let words = |count: usize, what: &str| match count {
        0 => None,
        1 => Some(format!("1 {what}")),
        _ => Some(format!("{count} {what}s")),
    };
    let both = [(Level::Error, "error"), (Level::Warning, "warning")];
    let both: Vec<String> =
        both.into_iter().filter_map(|(level, what)| words(count(level), what)).collect();
    format!("{} among the events", both.join(" and "))
}

/// Creates the verdict with its reasons and remedies.
fn judged(verdict: Option<&Verdict>) -> Markup {
    // a contained fault is no reason not to use the result
    let bad = verdict.is_some_and(|v| v.reasons.iter().any(|r| r.severity > Severity::Contained));
    html! {
        p.verdict.bad[bad] {
            "Verdict: "
            b { (verdict.map_or("not judged", Verdict::words)) }
            @if verdict.is_none() {
                ". The log holds no verdict, and its filter could not run again."
            }
        }
        @if let Some(verdict) = verdict { (answers(&verdict.answers())) }
        @if let Some(verdict) = verdict.filter(|v| !v.reasons.is_empty()) {
            ul.reasons {
                @for reason in &verdict.reasons {
                    li.bad[reason.severity > Severity::Contained] {
                        (reason.severity.words()) ": " b { (reason.about) } ": "
                        (reason.text)
                        @if !reason.remedy.is_empty() { "; " (reason.remedy) }
                        "."
                    }
                }
            }
        }
    }
}

/// Creates the answers to the three questions.
fn answers(answers: &Answers) -> Markup {
    let Answers { usable, because, sigma, sigma_because, change } = answers;
    let parts: Vec<&str> = change.iter().map(|change| change.about.as_str()).collect();
    html! {
        dl.facts {
            div {
                dt { "Is the estimate usable?" }
                dd { (usable.words()) @if !because.is_empty() { ", " (because) } }
            }
            div {
                dt { "Is its sigma true?" }
                dd { (sigma.words()) @if !sigma_because.is_empty() { ", " (sigma_because) } }
            }
            div {
                dt { "What should be changed?" }
                dd { @if parts.is_empty() { "nothing" } @else { (parts.join(", ")) } }
            }
        }
    }
}

/// Formats how many Gaussian errors there are to one beyond this number of sigmas.
fn one_in(sigmas: f64) -> String {
    let count = 1.0 / beyond(sigmas);
    let power = count.log10().floor();
    match power {
        p if p > 300.0 => "more than 1e300".to_owned(),
        p if p >= 6.0 => format!("{count:.0e}"),
        p => {
            let digit = 10_f64.powf(p - 1.0);
            format!("{:.0}", (count / digit).round() * digit)
        }
    }
}

/// Formats seconds without trailing zeros.
pub(super) fn seconds(s: f64) -> String {
    let text = format!("{s:.3}");
    format!("{} s", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Returns the number of uncertain components.
fn number_of_states(history: &RunHistory) -> usize {
    history.blocks.iter().filter(|b| b.uncertain()).map(|b| b.components.len()).sum()
}
