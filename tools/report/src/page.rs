//! The report of a run as one HTML page: figures, tables and style are in it, so that it opens offline, and it needs no script.

use crate::history::{BlockHistory, History, SensorHistory};
use crate::plots;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::Purpose;
use navfuse_figures::{Figure, FigureError, svg};
use navfuse_observability::{ObservabilityReport, Verdict};

/// The style of every page.
const STYLE: &str = include_str!("page.css");

/// A page with a title; `body` is its content.
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
            body { (body) }
        }
    };
    page.into_string()
}

/// A figure with a caption.
pub(crate) fn picture(figure: &Figure, caption: &Markup) -> Result<Markup, FigureError> {
    let drawing = svg(figure)?;
    Ok(html! {
        figure id=(figure.name) {
            div.drawing role="img" aria-label=(figure.name) { (PreEscaped(drawing)) }
            figcaption { (caption) }
        }
    })
}

/// The report of a run, with what it determined of each state where that was judged.
///
/// # Errors
/// When the drawing library gives up.
pub fn report(
    history: &History,
    observed: Option<&ObservabilityReport>,
) -> Result<String, FigureError> {
    let facts = Facts::of(history);
    let (constant, moving): (Vec<&BlockHistory>, Vec<&BlockHistory>) =
        history.blocks.iter().partition(|b| b.constant());
    let measuring = || history.sensors.iter().filter(|s| s.updates.accepted + s.updates.gated > 0);
    let body = html! {
        header {
            h1 { (history.name) }
            @if let Some(text) = &facts.description { p.lead { (text) } }
            (facts.table(history))
            nav {
                @for (id, name) in [("result", "Result"), ("trajectory", "Trajectory"), ("calibration", "Calibration"),
                    ("sensors", "Sensors"), ("states", "States"), ("innovations", "Innovations"),
                    ("observability", "Observability"), ("samples", "Samples"), ("events", "Events"), ("scenario", "Scenario")] {
                    a href={ "#" (id) } { (name) }
                }
            }
        }
        main {
            section #result {
                h2 { "Result" }
                (facts.verdicts(history))
                h3 { "Navigation at the end" }
                (end(&moving))
            }
            @if let Some(figure) = plots::trajectory(history) {
                section {
                    h2 { "Trajectory" }
                    (picture(&figure, &html! { "North, east and up from the first position: the true one, where it is known." })?)
                }
            }
            section #calibration {
                h2 { "Calibration, before and after" }
                (calibration(&constant))
                p.note {
                    "Before: the first estimate" @if let Some([from, _]) = history.span() { ", at " (seconds(from)) }
                    ". After: the last. The part of sigma that is left says what the run told of a state: near 1, nothing."
                }
            }
            section #sensors {
                h2 { "Sensors" }
                (sensors(history))
                p.note {
                    "NIS a channel: the mean normalised innovation squared of the accepted samples over the number of their "
                    "channels; 1 is what the filter expects, and the band is where it lies in nineteen cases of twenty for "
                    "white innovations without a gate."
                }
            }
            section #states {
                h2 { "States" }
                p.note {
                    "Above: a constant between its bounds of 3 sigma, beside the truth where that is known, and near where it ended; of what "
                    "moves, the error. Below: the whole run, sigma and the size of the error by decades; where an "
                    "error goes through zero it is cut off."
                }
                @for block in history.blocks.iter().filter(|b| b.uncertain()) {
                    @if let Some(figure) = plots::state(block) {
                        h3 { (block.name) @if !block.unit.is_empty() { " [" (block.unit) "]" } }
                        (picture(&figure, &html! {})?)
                    }
                }
                (fixed(history))
            }
            section #innovations {
                h2 { "Innovations" }
                @if measuring().next().is_none() { p { "No sensor corrected the state." } }
                @for sensor in measuring() {
                    h3 { (sensor.name) }
                    @for figure in [plots::innovations(sensor), plots::nis(sensor)].iter().flatten() {
                        (picture(figure, &shown(sensor))?)
                    }
                }
            }
            section #observability {
                h2 { "Observability" }
                @if let Some(observed) = observed { (verdicts(observed)) }
                (picture(&plots::normalised(history), &html! {
                    "Sigma as a part of the first sigma: what falls was observed, from then on. What stays at 1 was not."
                })?)
            }
            section #samples {
                h2 { "Samples" }
                @for sensor in history.sensors.iter().filter(|s| s.read > 0) {
                    details {
                        summary { (sensor.name) ": " (sensor.read) " samples" }
                        (picture(&plots::samples(sensor), &html! {
                            @if sensor.samples.each() > 1 {
                                "The least and the greatest of " (sensor.samples.each()) " samples at a time."
                            }
                        })?)
                    }
                }
            }
            (events(history))
            section #scenario {
                h2 { "Scenario" }
                details { summary { "TOML, as it was run" } pre { (history.scenario) } }
            }
        }
        footer { "Written by navfuse " (env!("CARGO_PKG_VERSION")) ". This page needs no network." }
    };
    Ok(document(&history.name, &body))
}

/// What stands at the top.
struct Facts {
    description: Option<String>,
    seed: Option<i64>,
}

impl Facts {
    fn of(history: &History) -> Self {
        let table: toml::Table = history.scenario.parse().unwrap_or_default();
        let description = table.get("description").and_then(|d| d.as_str()).map(str::to_owned);
        let simulated = table.get("source").and_then(|s| s.get("simulation")).is_some();
        // 1 where a scenario says none
        let seed = table.get("seed").map_or(Some(1), toml::Value::as_integer).filter(|_| simulated);
        Self { description, seed }
    }

    fn table(&self, history: &History) -> Markup {
        html! {
            dl.facts {
                @if let Some([from, to]) = history.span() {
                    div { dt { "time" } dd { (seconds(from)) " to " (seconds(to)) } }
                    div { dt { "duration" } dd { (seconds(to - from)) } }
                }
                @if let Some(metres) = distance(history) { div { dt { "distance" } dd { (format!("{metres:.0} m")) } } }
                @if let Some(seed) = self.seed { div { dt { "seed" } dd { (seed) } } }
                div { dt { "states" } dd { (history.blocks.iter().filter(|b| b.uncertain()).map(|b| b.components.len()).sum::<usize>()) } }
                div { dt { "run by" } dd { "navfuse " (history.version) } }
            }
        }
    }

    /// What to look at first.
    fn verdicts(&self, history: &History) -> Markup {
        let worst = worst(history);
        let level = history.level();
        html! {
            @for warning in &history.warnings { p.bad { "Warning: " (warning) } }
            ul {
                @if let Some((last, rms, percent)) = horizontal(history) {
                    li { "Horizontal error " b { (format!("{last:.2} m")) } " at the end"
                        @if let Some(percent) = percent { (format!(", {percent:.3} % of the distance")) }
                        (format!("; {rms:.2} m rms.")) }
                }
                @if let Some((name, ratio)) = worst {
                    li class=[(ratio > 4.0).then_some("bad")] {
                        "Largest error at the end: " b { (format!("{ratio:.1} sigma")) } ", of " (name)
                        @if ratio > 4.0 { ": where sigma is right, one error in 15 000 is that large" } "."
                    }
                } @else { li { "No truth is known: the errors are not." } }
                @for sensor in history.sensors.iter().filter(|s| s.updates.nis[1] > 0.0) {
                    @let [nis, freedom] = sensor.updates.nis;
                    @let inside = plots::band(freedom).is_some_and(|[low, high]| (low..=high).contains(&(nis / freedom)));
                    li class=[(!inside).then_some("bad")] {
                        "Innovations of " (sensor.name) ": NIS " b { (format!("{:.3}", nis / freedom)) } " a channel, "
                        @if inside { "as the filter expects." }
                        @else if nis < freedom { "smaller than the filter expects: its noise is stated too large." }
                        @else { "larger than the filter expects: its noise is stated too small, or something is not modelled." }
                    }
                }
                @if level > Level::Info { li { a href="#events" { "There are warnings or errors." } } }
            }
        }
    }
}

/// Seconds, without digits that say nothing.
fn seconds(s: f64) -> String {
    let text = format!("{s:.3}");
    format!("{} s", text.trim_end_matches('0').trim_end_matches('.'))
}

/// Whether the truth is known to the end, or nearly: as the summary of a run has it.
fn to_the_end(block: &BlockHistory) -> bool {
    block.compared.as_ref().is_some_and(|c| block.last.time - c.time <= 2.0)
}

/// Horizontal path length: of the truth where it is known to the end, else of the estimate.
fn distance(history: &History) -> Option<f64> {
    let position = history.position()?;
    Some(if to_the_end(position) { position.travelled.truth } else { position.travelled.estimate })
}

/// The horizontal error at the last time that the truth was known, its rms, and the former in per cent of the path.
fn horizontal(history: &History) -> Option<(f64, f64, Option<f64>)> {
    let position = history.position()?;
    let error = &position.compared.as_ref()?.error;
    let (squares, count) = position.travelled.squares;
    let last = error.first()?.hypot(*error.get(1)?);
    let percent =
        (position.travelled.truth >= 1.0).then(|| 100.0 * last / position.travelled.truth);
    Some((last, (squares / count.max(1) as f64).sqrt(), percent))
}

/// The component with the largest error in sigmas at the end, and how large that is.
fn worst(history: &History) -> Option<(String, f64)> {
    let blocks = history.blocks.iter().filter(|b| b.uncertain() && to_the_end(b));
    let all = blocks.flat_map(|b| {
        let row = b.compared.as_ref();
        let ratios = row
            .map(|r| r.error.iter().zip(&r.sigma).map(|(e, s)| (e / s).abs()).collect::<Vec<_>>());
        ratios
            .into_iter()
            .flatten()
            .enumerate()
            .map(|(k, ratio)| (format!("{} {}", b.name, b.axis(k)), ratio))
    });
    all.filter(|(_, ratio)| ratio.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// A number with the digits that its sigma leaves a meaning, and one more.
fn number(value: f64, sigma: f64) -> String {
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

/// The cells of an error and of its ratio to sigma.
fn judged(error: Option<(f64, f64)>) -> Markup {
    let ratio = error.filter(|e| e.1 > 0.0).map(|(error, sigma)| error / sigma);
    html! {
        td { @if let Some((error, sigma)) = error { (number(error, sigma)) } }
        td class=[ratio.filter(|r| r.abs() > 3.0).map(|_| "bad")] {
            @if let Some(ratio) = ratio { (format!("{ratio:.1}")) }
        }
    }
}

/// The error and its sigma of a component at the last time that the truth was known.
fn last_error(block: &BlockHistory, k: usize) -> Option<(f64, f64)> {
    let row = block.compared.as_ref().filter(|_| to_the_end(block))?;
    Some((*row.error.get(k)?, *row.sigma.get(k)?))
}

/// The states that move: where they ended.
fn end(blocks: &[&BlockHistory]) -> Markup {
    html! {
        div.wide { table {
            thead { tr { th { "state" } th {} th { "estimate" } th { "1-sigma" } th { "error" } th { "error/sigma" } th.name { "unit" } } }
            tbody {
                @for block in blocks {
                    @for k in 0..block.components.len() {
                        @let sigma = block.last.sigma[k];
                        @let angle = block.geodetic && k < 2;
                        tr class=[(k == 0).then_some("first")] {
                            th { @if k == 0 { (block.name) } }
                            td.name { (block.components[k]) }
                            td { @if angle { (format!("{:.7} deg", block.last.estimate[k])) }
                                 @else { (number(block.last.estimate[k], sigma)) } }
                            td { @if block.uncertain() { (number(sigma, sigma)) } @else { "fixed" } }
                            (judged(last_error(block, k)))
                            td.name { (block.unit) }
                        }
                    }
                }
            }
        } }
    }
}

/// The states that do not move: what was known of them before and after.
fn calibration(blocks: &[&BlockHistory]) -> Markup {
    let with_truth = blocks.iter().any(|b| b.compared.is_some());
    html! {
        @if blocks.is_empty() { p { "No state is constant in this run." } } @else {
            div.wide { table {
                thead { tr {
                    th { "state" } th {} th { "before" } th { "after" }
                    @if with_truth { th { "truth" } th { "error" } th { "error/sigma" } }
                    th { "sigma left" } th.name { "unit" }
                } }
                tbody {
                    @for block in blocks {
                        @for k in 0..block.components.len() {
                            @let (before, after) = (&block.first, &block.last);
                            @let error = last_error(block, k);
                            tr class=[(k == 0).then_some("first")] {
                                th { @if k == 0 { (block.name) } }
                                td.name { (block.components[k]) }
                                @if block.uncertain() {
                                    td { (number(before.estimate[k], before.sigma[k])) " ± " (number(before.sigma[k], before.sigma[k])) }
                                    td { (number(after.estimate[k], after.sigma[k])) " ± " (number(after.sigma[k], after.sigma[k])) }
                                } @else {
                                    td { (number(before.estimate[k], 0.0)) } td { "fixed" }
                                }
                                @if with_truth {
                                    td { @if let Some((e, s)) = error { (number(after.estimate[k] - e, s)) } }
                                    (judged(error))
                                }
                                td { @if block.uncertain() && before.sigma[k] > 0.0 { (part(after.sigma[k] / before.sigma[k])) } }
                                td.name { (block.unit) }
                            }
                        }
                    }
                }
            } }
        }
    }
}

/// A part of one: two digits.
fn part(ratio: f64) -> String {
    number(ratio, ratio)
}

/// What became of each sensor's samples.
fn sensors(history: &History) -> Markup {
    let word = |s: &SensorHistory| match s.purpose {
        Some(Purpose::Input) => "drives the process",
        Some(Purpose::Measurement) => "corrects the state",
        Some(Purpose::Reference) => "start and comparison",
        None => "",
    };
    let measures = |s: &SensorHistory| s.updates != crate::Updates::default();
    html! {
        div.wide { table {
            thead { tr { th { "sensor" } th.name { "type" } th.name { "for" } th { "read" } th { "used" } th { "gated" } th { "rejected" }
                th { "NIS a channel" } th { "95 % band" } } }
            tbody {
                @for sensor in &history.sensors {
                    @let updates = &sensor.updates;
                    @let [nis, freedom] = updates.nis;
                    tr.first {
                        th { (sensor.name) }
                        td.name { (sensor.kind.as_deref().unwrap_or_default()) }
                        td.name { (word(sensor)) }
                        td { (sensor.read) }
                        @if measures(sensor) {
                            td { (updates.accepted) } td { (updates.gated) }
                            td { (updates.rejected.iter().map(|r| r.1).sum::<u64>()) }
                        } @else { td {} td {} td {} }
                        td { @if freedom > 0.0 { (format!("{:.3}", nis / freedom)) } }
                        td { @if let Some([low, high]) = plots::band(freedom) { (format!("{low:.3} to {high:.3}")) } }
                    }
                    @for (why, count) in &updates.rejected {
                        tr { th {} td.name colspan="8" { (count) " rejected: " (why) } }
                    }
                }
            }
        } }
    }
}

/// What the run determined, since when and by what, and what is missing.
fn verdicts(observed: &ObservabilityReport) -> Markup {
    let told = |by: &std::collections::BTreeMap<String, f64>| {
        let mut by: Vec<_> = by.iter().filter(|(_, bits)| **bits >= 0.05).collect();
        by.sort_by(|a, b| b.1.total_cmp(a.1));
        by.iter().map(|(name, bits)| format!("{name} {bits:.1}")).collect::<Vec<_>>().join(", ")
    };
    html! {
        div.wide { table {
            thead { tr { th { "state" } th.name { "verdict" } th { "since" } th { "sigma left" } th { "bits" }
                th.name { "told by, bits" } th.name { "missing" } } }
            tbody {
                @for state in &observed.states {
                    tr.first {
                        th { (state.title) }
                        td.name { span class=[(state.verdict != Verdict::Determined).then_some("bad")] { (state.verdict.text()) } }
                        td { @if let Some(since) = state.since_s { (seconds(since)) } }
                        td { (number(state.normalised, state.normalised)) }
                        td { (format!("{:.1}", state.bits)) }
                        td.name { (told(&state.information)) }
                        td.text { (state.missing.as_deref().unwrap_or_default()) }
                    }
                }
            }
        } }
        p.note {
            "Sigma left: at the end, over what it would be by the state's own dynamics if nothing had been measured. Bits: how many "
            "times sigma was halved. `navfuse observability` tells more, and which manoeuvre would help."
        }
        @if !observed.undetermined.is_empty() {
            p { "What is left of the errors at the start:" }
            ul { @for direction in &observed.undetermined { li { (direction.text) } } }
        }
    }
}

/// Blocks that are held fixed have no plot: their values.
fn fixed(history: &History) -> Markup {
    let mut fixed = history.blocks.iter().filter(|b| !b.uncertain()).peekable();
    html! {
        @if fixed.peek().is_some() {
            p.note { "Held fixed: "
                @for (i, block) in fixed.enumerate() {
                    @if i > 0 { "; " }
                    (block.name) " = "
                    (block.last.estimate.iter().map(|v| number(*v, 0.0)).collect::<Vec<_>>().join(", ")) " " (block.unit)
                }
            }
        }
    }
}

/// How many of a sensor's innovations are drawn.
fn shown(sensor: &SensorHistory) -> Markup {
    let (accepted, gated) = (sensor.updates.innovations.each(), sensor.updates.outliers.each());
    html! {
        @if accepted > 1 { "One of " (accepted) " accepted samples is drawn" @if gated > 1 { ", and of " (gated) " gated ones" } "." }
    }
}

fn events(history: &History) -> Markup {
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
                            td { (event.time) } td.name { (word(event.level)) } td.name { (event.about) } td.text { (event.text) }
                        }
                    }
                }
            } }
            @if history.events_left_out > 0 { p.note { "And " (history.events_left_out) " more, which are in the log." } }
        }
    }
}
