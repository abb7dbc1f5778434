//! Comparison of runs as one page, which opens offline.

use super::{Comparison, SensorCounts, StateNumbers};
use crate::page::tables::number;
use crate::page::{document, footer, picture, titled, untitled};
use maud::{Markup, html};
use navfuse_figures::{Figure, FigureError};

/// Ratio of a difference to its sigma above which it is marked.
const LARGE: f64 = 3.0;
/// Number of states in the table of the largest differences.
const STATES: usize = 8;

/// Writes the page of a comparison with the figure of the largest differences, and the others.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn comparison(
    comparison: &Comparison,
    largest: Option<&Figure>,
    figures: &[Figure],
) -> Result<String, FigureError> {
    let names: Vec<&str> = comparison.runs.iter().map(|r| r.letter.as_str()).collect();
    let title = format!("Comparison of {} runs", names.len());
    let first = names.first().copied().unwrap_or_default();
    let body = html! {
        header {
            h1 { (title) }
            dl.facts {
                @for run in &comparison.runs {
                    div.bad[run.is_doubted()] {
                        dt { (run.letter) ": " (run.origin) }
                        dd { (run.words()) }
                    }
                }
            }
            nav {
                a href="#differs" { "What differs" } a href="#runs" { "Runs" }
                a href="#sensors" { "Sensors" } a href="#end" { "States" }
                a href="#figures" { "Figures" }
            }
        }
        main {
            section #differs {
                h2 { "What differs" }
                (differences(comparison, first))
                (keys(comparison))
                @if let Some(figure) = largest {
                    (picture(&untitled(figure), &html! {
                        "The states that differ most, all on one scale. Sigma: of the difference of "
                        "two estimates with independent errors."
                    })?)
                }
            }
            section #runs { h2 { "Runs" } (runs(comparison)) }
            section #sensors { h2 { "Sensors" } (sensors(comparison)) }
            section #end {
                h2 { "States at the end" }
                (states(comparison))
                p.note {
                    "Difference: from run " (first) ". Its sigma holds for two estimates with "
                    "independent errors. Runs that share their samples differ by less, so a "
                    "difference beyond 3 sigma contradicts one of the two uncertainties. "
                    (comparison.other_ends().unwrap_or_default())
                }
            }
            section #figures {
                h2 { "Figures" }
                (titled(figures)?)
            }
        }
        (footer())
    };
    Ok(document(&title, &body))
}

fn runs(comparison: &Comparison) -> Markup {
    let metres = |m: Option<f64>| m.map_or_else(String::new, |m| format!("{m:.2} m"));
    html! {
        div.wide { table {
            thead { tr {
                th { "run" } th.name { "of" } th.more { "seed" } th.more { "duration" }
                th.more { "distance" } th { "final error" } th { "rms error" } th.more { "warnings" }
                th.name { "verdict" }
            } }
            tbody {
                @for run in &comparison.runs {
                    tr.first {
                        th { (run.letter) }
                        td.text { (run.origin) }
                        td.more { @if let Some(seed) = run.seed { (seed) } }
                        td.more { (format!("{:.1} s", run.duration_s)) }
                        td.more {
                            @if let Some(distance) = run.distance_m { (format!("{distance:.0} m")) }
                        }
                        td { (metres(run.final_error_m)) }
                        td { (metres(run.rms_error_m)) }
                        td.more { (run.warnings) }
                        td.name.bad[run.is_doubted()] { (run.words()) }
                    }
                }
            }
        } }
        p.note { "Errors: horizontal, against the reference." }
        // the reasons are too long for a column
        ul { @for run in &comparison.runs {
            li.bad[run.is_doubted()] {
                b { (run.letter) } ": " (run.verdict_text.as_deref().unwrap_or("not judged"))
            }
        } }
    }
}

fn keys(comparison: &Comparison) -> Markup {
    html! {
        @if comparison.scenario.is_empty() { p { "The scenarios are equal." } } @else {
            div.wide { table {
                thead { tr {
                    th { "key" } @for run in &comparison.runs { th.name { (run.letter) } }
                } }
                tbody {
                    @for key in &comparison.scenario {
                        tr.first {
                            th { (key.key) }
                            @for value in &key.values {
                                td.text { (value.as_deref().unwrap_or("not set")) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

fn differences(comparison: &Comparison, first: &str) -> Markup {
    html! {
        @if comparison.differences.is_empty() {
            p { "The runs have no state and time in common." }
        } @else {
            div.wide { table {
                thead { tr {
                    th { "state" } th.name { "run" } th { "largest difference" } th { "at" }
                } }
                tbody { @for largest in comparison.differences.iter().take(STATES) {
                    tr.first {
                        th { (largest.state) }
                        td.name { (largest.run) " - " (first) }
                        td.bad[largest.sigmas.abs() > LARGE] {
                            (format!("{:.2} sigma", largest.sigmas))
                        }
                        td { (format!("{:.1} s", largest.time_s)) }
                    }
                } }
            } }
        }
    }
}

fn sensors(comparison: &Comparison) -> Markup {
    let row = |s: &SensorCounts| {
        html! {
            td { (s.used) } td { (s.gated) } td { (s.rejected) }
            td class=[(!s.inside).then_some("bad")] {
                @if let Some(nis) = s.mean_nis { (format!("{nis:.2}")) }
            }
            td { @if let Some(nis) = s.expected_nis { (format!("{nis:.2}")) } }
        }
    };
    html! {
        div.wide { table {
            thead { tr {
                th { "sensor" } th.name { "run" } th { "used" } th { "gated" } th { "rejected" }
                th { "mean NIS" } th { "expected" }
            } }
            tbody {
                @for sensor in &comparison.sensors {
                    @for (k, (run, result)) in comparison.runs.iter().zip(&sensor.runs).enumerate() {
                        tr class=[(k == 0).then_some("first")] {
                            th { @if k == 0 { (sensor.sensor) } }
                            td.name { (run.letter) }
                            @if let Some(result) = result { (row(result)) }
                            @else { td.name colspan="5" { "not in this run" } }
                        }
                    }
                }
            }
        } }
    }
}

fn states(comparison: &Comparison) -> Markup {
    let row = |s: &StateNumbers| {
        let shown = |v: Option<f64>| v.map_or_else(String::new, |v| number(v, s.sigma));
        let ratio = s.difference.zip(s.difference_sigma).map(|(d, sigma)| d / sigma);
        let ratio = ratio.filter(|r| r.is_finite());
        html! {
            td { (shown(s.error)) } td.more { (shown(s.rms_error)) }
            td { (number(s.sigma, s.sigma)) } td { (shown(s.difference)) }
            td.more { (shown(s.difference_sigma)) }
            td class=[ratio.filter(|r| r.abs() > LARGE).map(|_| "bad")] {
                // no sign before a zero
                @if let Some(ratio) = ratio { (format!("{:.1}", (10.0 * ratio).round() / 10.0 + 0.0)) }
            }
        }
    };
    html! {
        div.wide { table {
            thead { tr {
                th { "state" } th.name { "run" } th { "error" } th.more { "rms error" }
                th { "1-sigma" } th { "difference" } th.more { "its sigma" } th { "ratio" }
                th.name { "unit" }
            } }
            tbody {
                @for state in &comparison.states {
                    @for (k, (run, result)) in comparison.runs.iter().zip(&state.runs).enumerate() {
                        tr class=[(k == 0).then_some("first")] {
                            th { @if k == 0 { (state.state) } }
                            td.name { (run.letter) }
                            @if let Some(result) = result { (row(result)) }
                            @else { td.name colspan="6" { "not in this run" } }
                            td.name { (state.unit) }
                        }
                    }
                }
            }
        } }
    }
}
