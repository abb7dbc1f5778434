//! The observability of a run as one page, which opens offline.

use crate::page::tables::verdicts;
use crate::page::{document, footer, picture};
use maud::html;
use navfuse_figures::{Figure, FigureError};
use navfuse_observability::ObservabilityReport;

/// Writes the page of a report: the verdict on each state, the segments of the trajectory, and the
/// sigmas over time.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(report: &ObservabilityReport) -> Result<String, FigureError> {
    let title = format!("{}: observability", report.scenario);
    // the heading of the figure is on the page, not in the drawing
    let figure = Figure { title: String::new(), ..report.figure() };
    let body = html! {
        header {
            h1 { (title) }
            p.lead { (format!("{:.0} s to {:.0} s", report.start_s, report.end_s)) }
            nav {
                a href="#states" { "States" }
                a href="#segments" { "Segments" }
                a href="#plots" { "Figures" }
            }
        }
        main {
            section #states { h2 { "States" } (verdicts(report)) }
            section #segments {
                h2 { "Segments" }
                @if let Some(why) = &report.no_segments { p { "Not judged: " (why) "." } }
                @if let Some(view) = &report.segments {
                    ul {
                        @for verdict in &view.verdicts {
                            li class=[(!verdict.agrees).then_some("bad")] {
                                (verdict.about) ": " (verdict.text)
                                @if !verdict.agrees { "; the filter disagrees" }
                            }
                        }
                        @for warning in &view.warnings { li.bad { (warning) } }
                    }
                }
                p.note { "Theorem 1 of Pan & Wu (2016), evaluated on the trajectory alone." }
            }
            section #plots {
                h2 { "Sigma relative to that without measurements" }
                (picture(&figure, &html! {
                    "A state whose sigma falls is observed from then on; a state whose sigma stays "
                    "at 1 is not."
                })?)
            }
        }
        (footer())
    };
    Ok(document(&title, &body))
}
