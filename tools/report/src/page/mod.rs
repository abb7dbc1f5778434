//! The report of a run as one HTML page. Figures, tables, style and script are in the page, so that
//! it opens offline. Without the script it is complete.

mod facts;
mod sensitivity;
mod strips;
pub(crate) mod tables;

use crate::history::{BlockHistory, RunHistory};
use crate::innovations::{innovations, nis};
use crate::{plots, quality};
use facts::{facts, seconds, verdicts};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use navfuse_figures::{Figure, FigureError, svg};
use navfuse_observability::ObservabilityReport;
use std::borrow::Borrow;

/// Script of every page, without which the page is complete: values under the pointer, and zoom.
const SCRIPT: &str = include_str!("../page.js");
/// Style of every page.
const STYLE: &str = include_str!("../page.css");

/// Sections of the report: the anchor and the name.
const SECTIONS: [(&str, &str); 13] = [
    ("result", "Result"),
    (SMOOTHING, "Smoothed run"),
    ("trajectory", "Trajectory"),
    ("calibration", "Calibration"),
    (SENSITIVITY, "Sensitivity"),
    ("sensors", "Sensors"),
    ("states", "States"),
    ("innovations", "Innovations"),
    ("quality", "Quality"),
    ("observability", "Observability"),
    ("samples", "Samples"),
    ("events", "Events"),
    ("scenario", "Scenario"),
];

/// Anchor of the section of a smoothed run.
const SMOOTHING: &str = "smoothing";
/// Anchor of the section of what the scenario does not model.
const SENSITIVITY: &str = "sensitivity";

/// Creates a page with a title and a content.
pub(crate) fn document(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (body)
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    // a browser or a terminal may obey the controls in a name
    let controls = |c: char| {
        let directs = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        directs || c.is_control() && c != '\n'
    };
    page.into_string().replace(controls, "\u{fffd}")
}

/// Creates a figure with a caption.
pub(crate) fn picture(figure: &Figure, caption: &Markup) -> Result<Markup, FigureError> {
    let drawing = svg(figure)?;
    Ok(html! {
        figure id=(figure.name) {
            div.drawing role="img" aria-label=(figure.name) { (PreEscaped(drawing)) }
            figcaption { (caption) }
        }
    })
}

/// A figure without its title, which is a heading of the page.
pub(crate) fn untitled(figure: &Figure) -> Figure {
    Figure { title: String::new(), ..figure.clone() }
}

/// Figures one below the other, each below its title.
pub(crate) fn titled(
    figures: impl IntoIterator<Item = impl Borrow<Figure>>,
) -> Result<Markup, FigureError> {
    Ok(html! {
        @for figure in figures {
            @let figure = figure.borrow();
            h3 { (figure.title) }
            (picture(&untitled(figure), &html! {})?)
        }
    })
}

/// The section with the text of a scenario, folded below some words.
pub(crate) fn scenario_section(words: &str, scenario: &str) -> Markup {
    html! {
        section #scenario {
            h2 { "Scenario" }
            details { summary { (words) } pre { (scenario) } }
        }
    }
}

/// The last line of a page.
pub(crate) fn footer() -> Markup {
    html! {
        footer { "Written by navfuse " (env!("CARGO_PKG_VERSION")) ". This page needs no network." }
    }
}

/// Returns `true` if the page of a run has a section.
fn has(history: &RunHistory, section: &str) -> bool {
    match section {
        SMOOTHING => history.smoothed().next().is_some(),
        SENSITIVITY => history.sensitivity.is_some(),
        _ => true,
    }
}

/// Creates the report of a run, with its observability if that was evaluated.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn report(
    history: &RunHistory,
    observed: Option<&ObservabilityReport>,
) -> Result<String, FigureError> {
    let (constant, moving): (Vec<&BlockHistory>, Vec<&BlockHistory>) =
        history.blocks.iter().partition(|b| b.constant());
    let standard = history.standard();
    let measuring = || {
        history
            .sensors
            .iter()
            .filter(|s| s.updates.outcomes.accepted + s.updates.outcomes.gated > 0)
    };
    let body = html! {
        header {
            h1 { (history.name) }
            @if let Some(text) = &history.description { p.lead { (text) } }
            (facts(history))
            nav {
                @for (id, name) in SECTIONS {
                    @if has(history, id) {
                        a href={ "#" (id) } { (name) }
                    }
                }
            }
        }
        main {
            section #result {
                h2 { "Result" }
                (verdicts(history))
                (strips::strips(history))
                (tables::findings(history))
                h3 { "Navigation at the end" }
                (tables::end(&moving, standard))
            }
            (tables::smoothing(history, SMOOTHING))
            @if let Some(figure) = plots::trajectory(history) {
                section {
                    h2 { "Trajectory" }
                    (picture(&figure, &html! {
                        "North and east from the first position, of the " (standard.word())
                        " if it is known; height above the ellipsoid."
                    })?)
                }
            }
            section #calibration {
                h2 { "Calibration" }
                (tables::calibration(&constant, standard))
                p.note {
                    "Prior: the first estimate"
                    @if history.is_smoothed() { " of the filter" }
                    @if let Some([from, _]) = history.span() { ", at " (seconds(from)) } ". "
                    @if history.is_smoothed() { "Filter and smoothed: the last estimates. " }
                    @else { "Result: the last estimate. " }
                    "A remaining sigma near 1 means that the run held no information on the state."
                }
                (tables::fixed(history))
            }
            @if let Some(found) = &history.sensitivity {
                section id=(SENSITIVITY) { h2 { "Sensitivity" } (sensitivity::table(found)) }
            }
            section #sensors {
                h2 { "Sensors" }
                (tables::sensors(history))
                p.note {
                    "Mean NIS: the mean normalised innovation squared of the accepted samples. "
                    "Expected: the number of channels, less what the gate removes. A mean outside "
                    "the band is a reason against the run, since no consistent run has it by chance."
                }
            }
            section #states {
                h2 { "States" }
                p.note {
                    "Above: a constant with its bounds of 3 sigma and the " (standard.word()) ", if it is known, "
                    "near its final value; of a state that moves, the estimate less the "
                    (standard.word()) ". Below: sigma and the magnitude of that difference over the "
                    "whole run, on a logarithmic scale, which cuts off what is near zero."
                }
                @for block in history.blocks.iter().filter(|b| b.uncertain()) {
                    @if let Some(figure) = plots::state(block, standard) {
                        h3 { (block.name) @if !block.unit.is_empty() { " [" (block.unit) "]" } }
                        (picture(&figure, &html! {})?)
                    }
                }
            }
            section #innovations {
                h2 { "Innovations" }
                @if measuring().next().is_none() { p { "No sensor corrected the state." } }
                @for sensor in measuring() {
                    h3 { (sensor.name) }
                    @let place = history.position().map(|p| &p.last);
                    @let figures = [innovations(sensor, place), nis(sensor)];
                    @for (k, figure) in figures.iter().flatten().enumerate() {
                        (picture(figure, &html! { @if k == 1 { (tables::shown(sensor)) } })?)
                    }
                }
            }
            section #quality {
                h2 { "Quality" }
                p.note {
                    "These figures need no truth. The innovations of a consistent filter, divided by "
                    "their sigma, follow the normal distribution, and each is independent of the one "
                    "before. Gated samples count."
                }
                @for sensor in measuring() {
                    @let place = history.position().map(|p| &p.last);
                    @if let Some(figure) = quality::residuals(sensor, place) {
                        h3 { (sensor.name) }
                        (picture(&figure, &html! {})?)
                    }
                }
                @if let Some(figure) = quality::separation(history.blocks.iter()) {
                    h3 { "Filter against smoother" }
                    (picture(&figure, &html! {
                        "The difference of the two estimates over its sigma. A value beyond 3 "
                        "contradicts one of the two sigmas."
                    })?)
                }
                @if let Some(figure) = quality::forward_backward(history.blocks.iter()) {
                    h3 { "Forward against backward" }
                    (picture(&figure, &html! {
                        "The estimate from the samples before a time minus that from the samples after it, of "
                        "states that move, where neither is more than three times as uncertain as the other."
                    })?)
                }
                @if let Some(figure) = observed.and_then(|observed| observed.shares.figure()) {
                    h3 { "Information of each sensor" }
                    (picture(&figure, &html! {
                        "The share of each sensor in the information about each state, of all samples so far."
                    })?)
                }
            }
            section #observability {
                h2 { "Observability" }
                @if let Some(observed) = observed { (tables::verdicts(observed)) }
                @for derived in &history.derived { (tables::derived(derived)) }
                (picture(&plots::normalised(history), &html! {
                    "Sigma relative to the prior. A state whose sigma falls is observed from then on; a "
                    "state whose sigma stays at 1 is not."
                    @if history.is_smoothed() { " A smoothed sigma uses the whole run at each time." }
                })?)
            }
            section #samples {
                h2 { "Samples" }
                @for sensor in history.sensors.iter().filter(|s| s.read > 0) {
                    details {
                        summary { (sensor.name) ": " (sensor.read) " samples" }
                        (picture(&plots::samples(sensor), &html! {
                            @if sensor.samples.each() > 1 {
                                "The smallest and the largest of " (sensor.samples.each())
                                " samples at a time."
                            }
                        })?)
                    }
                }
            }
            (tables::events(history))
            (scenario_section("TOML, as it was run", &history.scenario))
        }
        (footer())
    };
    Ok(document(&history.name, &body))
}
