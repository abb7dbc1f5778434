//! Tables and lists of the page.

use super::facts::seconds;
use crate::history::{BlockHistory, Row, RunHistory};
use crate::results::Standard;
use crate::sensors::SensorHistory;
use maud::{Markup, html};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Derived, Level, Outcomes};
use navfuse_core::model::sensor::Purpose;
use navfuse_observability::words::{MEASURES, still_prior, tenths};
use navfuse_observability::{Determination, ObservabilityReport};

/// Formats a number with the digits that are significant for its sigma, and one more.
pub(crate) fn number(value: f64, sigma: f64) -> String {
    let decimals = if sigma > 0.0 && sigma.is_finite() {
        (1.0 - sigma.log10().floor()).clamp(0.0, 9.0)
    } else {
        6.0
    };
    let text = format!("{value:.*}", decimals as usize);
    let text = if sigma > 0.0 {
        text
    } else {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    if text.trim_start_matches(['-', '0', '.']).is_empty() {
        text.trim_start_matches('-').to_owned()
    } else {
        text
    }
}

/// Creates the cells of an error and of its ratio to sigma, which is marked where it is large and alone on a
/// narrow screen. A recorded reference has an error of its own, and marks nothing.
fn judged(error: Option<(f64, f64)>, standard: Standard) -> Markup {
    let ratio = error.filter(|e| e.1 > 0.0).map(|(error, sigma)| error / sigma);
    let bad = ratio.is_some_and(|r| r.abs() > 3.0) && standard == Standard::Truth;
    html! {
        td.more { @if let Some((error, sigma)) = error { (number(error, sigma)) } }
        td.bad[bad] {
            @if let Some(ratio) = ratio { (format!("{ratio:.1}")) }
        }
    }
}

/// Creates the heading of the ratio of a difference to its sigma.
fn over_sigma(standard: Standard) -> Markup {
    html! {
        th {
            @if standard == Standard::Truth { "error/" } @else { "difference/" }
            wbr; "sigma"
        }
    }
}

/// Returns the error and its sigma of a component at the last known truth.
fn last_error(block: &BlockHistory, k: usize) -> Option<(f64, f64)> {
    let row = block.compared.as_ref().filter(|_| block.compared_to_the_end())?;
    let corrected = block.corrected.as_ref().and_then(|found| found.sigma.get(k));
    Some((*row.error.get(k)?, *corrected.or(row.sigma.get(k))?))
}

/// Creates the table of the states that move, at the end.
pub(super) fn end(blocks: &[&BlockHistory], standard: Standard) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "state" } th {} th { "estimate" } th { "1-sigma" }
                th.more { (standard.difference()) } (over_sigma(standard)) th.name { "unit" }
            } }
            tbody {
                @for block in blocks {
                    @for k in 0..block.components.len() {
                        @let sigma = block.last.sigma[k];
                        @let angle = block.geodetic && k < 2;
                        tr class=[(k == 0).then_some("first")] {
                            th { @if k == 0 { (breakable(&block.name)) } }
                            td.name { (block.components[k]) }
                            td { @if angle { (format!("{:.7} deg", block.last.estimate[k])) }
                                 @else { (number(block.last.estimate[k], sigma)) } }
                            td {
                                @if block.uncertain() { (number(sigma, sigma)) } @else { "fixed" }
                            }
                            (judged(last_error(block, k), standard))
                            td.name { (block.unit) }
                        }
                    }
                }
            }
        } }
    }
}

/// Creates the table of the constant states: the prior and the result, of the filter and of the
/// smoother where the run is smoothed.
pub(super) fn calibration(blocks: &[&BlockHistory], standard: Standard) -> Markup {
    // those that are held fixed stand below the table
    let listed = blocks.iter().copied().filter(|b| b.uncertain() || b.corrected.is_some());
    let blocks: Vec<&BlockHistory> = listed.collect();
    let compared = blocks.iter().any(|b| b.compared.is_some());
    let smoothed = blocks.iter().any(|b| b.filtered.is_some());
    html! {
        @if blocks.is_empty() { p { "No state is constant in this run." } } @else {
            div.wide { table {
                thead { tr {
                    th { "state" } th {} th.more { "prior" }
                    @if smoothed { th.more { "filter" } th { "smoothed" } } @else { th { "result" } }
                    @if compared {
                        th.more { (standard.word()) } th.more { (standard.difference()) }
                        (over_sigma(standard))
                    }
                    th { "remaining" wbr; " sigma" } th.name { "unit" }
                } }
                tbody {
                    @for block in blocks {
                        @for k in 0..block.components.len() {
                            @let (prior, result) = (block.prior(), &block.last);
                            @let error = last_error(block, k);
                            tr class=[(k == 0).then_some("first")] {
                                th { @if k == 0 { (breakable(&block.name)) } }
                                td.name { (block.components[k]) }
                                @if block.uncertain() {
                                    td.more { (estimate(prior, k)) }
                                    @if let Some(filtered) = &block.filtered {
                                        td.more { (estimate(&filtered.last, k)) }
                                    }
                                    td { (estimate(result, k)) }
                                } @else {
                                    td.more { (number(prior.estimate[k], 0.0)) }
                                    @if smoothed { td.more {} }
                                    td {
                                        @if let Some(found) = &block.corrected {
                                            (with_sigma(found.estimate[k], found.sigma[k]))
                                            " since " (seconds(found.since.seconds()))
                                        }
                                    }
                                }
                                @if compared {
                                    td.more {
                                        @if let Some((e, s)) = error {
                                            (number(result.estimate[k] - e, s))
                                        }
                                    }
                                    (judged(error, standard))
                                }
                                td {
                                    @if block.uncertain() && prior.sigma[k] > 0.0 {
                                        (part(result.sigma[k] / prior.sigma[k]))
                                    }
                                }
                                td.name { (block.unit) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

/// A name that a narrow screen may break behind its dot.
fn breakable(name: &str) -> Markup {
    html! {
        @match name.split_once('.') {
            Some((owner, rest)) => { (owner) "." wbr; (rest) }
            None => { (name) }
        }
    }
}

/// Formats an estimate with its 1-sigma; a line may end before the sign, not behind it.
fn estimate(row: &Row, k: usize) -> String {
    with_sigma(row.estimate[k], row.sigma[k])
}

/// Formats a value with its 1-sigma.
pub(super) fn with_sigma(value: f64, sigma: f64) -> String {
    format!("{} ±\u{a0}{}", number(value, sigma), number(sigma, sigma))
}

/// Formats a ratio with two digits.
fn part(ratio: f64) -> String {
    number(ratio, ratio)
}

/// Creates the table of the sensors and the outcomes of their samples.
pub(super) fn sensors(history: &RunHistory) -> Markup {
    let word = |s: &SensorHistory| match s.purpose {
        Some(Purpose::Input) => "drives the process",
        Some(Purpose::Measurement) => "corrects the state",
        Some(Purpose::Reference) => "start and comparison",
        None => "",
    };
    html! {
        div.wide { table {
            thead { tr {
                th { "sensor" } th.name.more { "type" } th.name.more { "for" } th.more { "read" }
                th { "used" }
                th { "gated" } th { "rejected" } th { "mean NIS" } th { "expected" } th { "band" }
            } }
            tbody {
                @for sensor in &history.sensors {
                    @let updates = &sensor.updates;
                    @let used = updates.outcomes.accepted as f64;
                    @let judged = history.verdict.as_ref().and_then(|v| v.sensor(&sensor.name));
                    @let bad = judged.is_some_and(|s| !s.inside).then_some("bad");
                    tr.first {
                        th { (sensor.name) }
                        td.name.more { (sensor.kind.as_deref().unwrap_or_default()) }
                        td.name.more { (word(sensor)) }
                        td.more { (sensor.read) }
                        @if sensor.measures() {
                            td { (updates.outcomes.accepted + updates.outcomes.placed) } td { (updates.outcomes.gated) }
                            td { (updates.outcomes.all_rejected()) }
                        } @else {
                            td {} td {}
                            td { @if updates.outcomes != Outcomes::default() { (updates.outcomes.all_rejected()) } }
                        }
                        td class=[bad] {
                            @if used > 0.0 { (format!("{:.2}", updates.nis[0] / used)) }
                        }
                        td { @if let Some(s) = judged { (format!("{:.2}", s.expected_nis)) } }
                        td {
                            @if let Some(s) = judged {
                                (format!("{:.2} to {:.2}", s.band.low, s.band.high))
                            }
                        }
                    }
                    @for (why, count) in &updates.outcomes.rejected {
                        tr { th {} td.name colspan="9" { (count) " rejected: " (why) } }
                    }
                    @if updates.in_part.count > 0 {
                        tr { th {} td.name colspan="9" {
                            (updates.in_part.count) " gated or rejected samples were used in part, by other channels"
                        } }
                    }
                }
            }
        } }
    }
}

/// Creates the table of the states' observability: the verdict, its time, the sensors, and what is
/// missing.
pub(crate) fn verdicts(observed: &ObservabilityReport) -> Markup {
    let contributions = |by: &std::collections::BTreeMap<String, f64>| {
        let mut by: Vec<_> = by.iter().filter(|(_, bits)| **bits >= 0.05).collect();
        by.sort_by(|a, b| b.1.total_cmp(a.1));
        by.iter().map(|(name, bits)| format!("{name} {bits:.1}")).collect::<Vec<_>>().join(", ")
    };
    html! {
        div.wide { table {
            thead { tr {
                th { "state" } th.name { "verdict" } th { "since" } th { "still prior" }
                th { "remaining sigma" } th { "bits" } th.name.more { "bits by sensor" }
            } }
            tbody {
                @for state in &observed.states {
                    tr.first {
                        th { (breakable(&state.title)) }
                        td.name {
                            span class=[(state.verdict != Determination::Determined).then_some("bad")] {
                                (state.verdict.text())
                            }
                        }
                        td { @if let Some(since) = state.since_s { (seconds(since)) } }
                        td { (still_prior(state.prior_weight)) }
                        td { (number(state.normalised, state.normalised)) }
                        td { (tenths(state.bits)) }
                        td.name.more { (contributions(&state.information)) }
                    }
                    @if let Some(missing) = &state.missing {
                        tr { th {} td.text colspan="6" { (missing) } }
                    }
                }
            }
        } }
        p.note {
            (MEASURES) " Remaining sigma: final sigma relative to the sigma without measurements. "
            code { "navfuse observability" } " has the details, and suggests manoeuvres."
        }
        @if !observed.undetermined.is_empty() {
            p { "Directions that the measurements left open, and the share of their prior variance:" }
            ul { @for direction in &observed.undetermined {
                li { (still_prior(direction.left)) " of " (direction.text) }
            } }
        }
    }
}

/// Formats the estimate of a fixed block.
fn values(block: &BlockHistory) -> String {
    let values: Vec<String> = block.last.estimate.iter().map(|v| number(*v, 0.0)).collect();
    values.join(", ")
}

/// Lists the values of the blocks that are held fixed, which have no plots.
pub(super) fn fixed(history: &RunHistory) -> Markup {
    let fixed = history.blocks.iter().filter(|b| !b.uncertain() && b.corrected.is_none());
    let mut fixed = fixed.peekable();
    html! {
        @if fixed.peek().is_some() {
            p.note { "Held fixed: "
                @for (i, block) in fixed.enumerate() {
                    @if i > 0 { "; " }
                    (block.name) " = "
                    (values(block)) " " (block.unit)
                }
            }
        }
    }
}

/// Describes the thinning of a sensor's innovations.
pub(super) fn shown(sensor: &SensorHistory) -> Markup {
    let (accepted, gated) = (sensor.updates.innovations.each(), sensor.updates.outliers.each());
    html! {
        @if accepted > 1 {
            "One of " (accepted) " accepted samples is drawn"
            @if gated > 1 { ", and one of " (gated) " gated samples" }
            "."
        }
    }
}

/// Creates the section of a smoothed run: where it is weak, and what contradicts it.
pub(super) fn smoothing(history: &RunHistory, anchor: &str) -> Markup {
    html! {
        @if history.smoothed().next().is_some() {
            section id=(anchor) {
                h2 { "Smoothed run" }
                ul {
                    @for event in history.smoothed() {
                        li class=[(event.level > Level::Info).then_some("bad")] { (event.text) }
                    }
                }
                p.note {
                    "Every estimate of this page has all samples of the run. Weak: a 1-sigma far "
                    "above its median over the run, with the sensors that were used less than "
                    "usual."
                }
            }
        }
    }
}

/// Creates the table of a derived quantity.
pub(super) fn derived(derived: &Derived) -> Markup {
    html! {
        h3 {
            (derived.name) @if !derived.unit.is_empty() { " [" (derived.unit) "]" }
            ", at " (derived.time)
        }
        div.wide { table {
            thead { tr { th {} @for column in derived.columns.iter() { th { (column) } } } }
            tbody {
                @for (row, values) in derived.iter() {
                    tr { th { (row) } @for value in values { td { (format!("{value:.3}")) } } }
                }
            }
        } }
    }
}

/// Creates the table of the findings that the reasons of the verdict do not have, if there are any.
pub(super) fn findings(history: &RunHistory) -> Markup {
    let reasons = history.verdict.iter().flat_map(|verdict| &verdict.reasons);
    let reasons: Vec<_> = reasons.collect();
    let known = |f: &&Finding| {
        let at = f.time.to_string();
        reasons
            .iter()
            .any(|r| r.about == f.about && r.text.contains(&f.text) && r.text.contains(&at))
    };
    let findings: Vec<&Finding> = history.findings.iter().filter(|f| !known(f)).collect();
    html! {
        @if !findings.is_empty() {
            h3 { "Further findings" }
            div.wide { table.events {
                tbody {
                    @for finding in findings {
                        tr.bad {
                            td { (finding.time) }
                            td.name { (finding.severity.words()) }
                            td.name { (finding.about) } td.text { (finding) }
                        }
                    }
                }
            } }
        }
    }
}

/// Creates the table of the events.
pub(super) fn events(history: &RunHistory) -> Markup {
    let word = |level| match level {
        Level::Info => "",
        Level::Warning => "warning",
        Level::Error => "error",
    };
    html! {
        section #events {
            h2 { "Events" }
            div.wide { table.events {
                tbody {
                    @for event in &history.events {
                        tr class=[(event.level > Level::Info).then_some("bad")] {
                            td { (event.time) } td.name.more { (word(event.level)) }
                            td.name { (event.about) } td.text { (event.text) }
                        }
                    }
                }
            } }
            @if history.events_left_out > 0 {
                p.note { (history.events_left_out) " more events are in the log." }
            }
        }
    }
}
