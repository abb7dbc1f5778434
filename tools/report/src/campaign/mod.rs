//! A campaign as one page, which opens offline: the verdict, the tables, the figures with their
//! chance bands, and the runs to look at.

mod nees;

use crate::page::{document, footer, picture, scenario_section, titled};
use maud::{Markup, html};
use navfuse_campaign::words::{band, begins, number, ratio, three};
use navfuse_campaign::{
    Band, Campaign, Component, Job, Judged, PointReport, PointStatistics, Results, StateReport,
    WorstRun,
};
use navfuse_figures::{Figure, FigureError};

/// Number of runs of a campaign that the page lists, the largest NEES first.
const LISTED: usize = 5;

/// Returns the runs to look at: those that ended early, then those with the largest NEES; of a sweep, the
/// worst run of each point.
pub fn to_look_at(results: &Results) -> Vec<Job> {
    if let [statistics] = &results.points[..] {
        let failed = statistics.failures.iter().map(|(run, _)| *run);
        let runs = failed.chain(statistics.worst().into_iter().map(|(run, _)| run));
        return runs.take(LISTED).map(|run| Job { point: 0, run }).collect();
    }
    let points = results.report.points.iter().enumerate();
    let mut worst: Vec<_> =
        points.filter_map(|(point, report)| Some((point, report.worst.as_ref()?))).collect();
    // a run that ended early has no NEES
    let nees = |worst: &WorstRun| worst.nees.unwrap_or(f64::INFINITY);
    worst.sort_by(|a, b| nees(b.1).total_cmp(&nees(a.1)));
    worst.into_iter().map(|(point, worst)| Job { point, run: worst.run }).collect()
}

/// Writes the page of a campaign, a bound or a sweep with its figures. `shown` selects the
/// components in the tables of a sweep; `pages` has the files of the first runs to look at, beside the page.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(
    campaign: &Campaign,
    results: &Results,
    figures: &[Figure],
    shown: impl Fn(&Component) -> bool,
    pages: &[String],
) -> Result<String, FigureError> {
    let point = match (&results.report.points[..], &results.points[..]) {
        ([report], [statistics]) => Some((report, statistics)),
        _ => None,
    };
    let ran = point.filter(|_| campaign.runs > 0);
    let histogram = ran.and_then(|(_, statistics)| {
        let values: Vec<f64> = statistics.nees.iter().map(|(_, nees)| *nees).collect();
        nees::histogram_of(campaign.columns.known(), &values)
    });
    let title = format!("{}: {}", campaign.scenario, kind(campaign));
    let body = html! {
        header {
            h1 { (title) }
            (facts(campaign, point.map(|(report, _)| report)))
            nav {
                a href="#result" { "Result" }
                a href="#tables" { "Tables" }
                @if campaign.runs > 0 { a href="#runs" { "Runs" } }
                a href="#plots" { "Figures" }
                a href="#scenario" { "Scenario" }
            }
        }
        main {
            section #result {
                h2 { "Result" }
                @for point in &results.report.points { (verdict(campaign, point)) }
                @if campaign.runs == 0 {
                    p { "No filter and no smoother of these sensors on this trajectory can have a "
                        "smaller sigma (Cramer-Rao bound)." }
                }
            }
            section #tables {
                h2 { "Tables" }
                @if let Some((report, statistics)) = point {
                    @if campaign.runs > 0 { (states(campaign, report)) (consistency(report)) }
                    @else { (bound(report, statistics)) }
                } @else { (grid(campaign, results, shown)) }
            }
            @if campaign.runs > 0 {
                section #runs {
                    h2 { "Runs" }
                    @if let Some((figure, beyond)) = &histogram {
                        (picture(figure, &html! {
                            "NEES of the whole state at the end of each run. A consistent filter "
                            "follows the dotted line; chance leaves 95 of 100 bars in the band."
                            @if *beyond > 0 { " " (beyond) " runs lie beyond the right edge." }
                        })?)
                    }
                    (worst(campaign, results, pages))
                }
            }
            section #plots {
                h2 { "Figures" }
                (titled(figures)?)
            }
            (scenario_section("TOML, as it was run", &campaign.text))
        }
        (footer())
    };
    Ok(document(&title, &body))
}

/// Names the kind of a campaign.
fn kind(campaign: &Campaign) -> &'static str {
    match (campaign.keys.is_empty(), campaign.runs) {
        (false, _) => "sweep",
        (true, 0) => "Cramer-Rao bound",
        (true, _) => "campaign",
    }
}

fn facts(campaign: &Campaign, point: Option<&PointReport>) -> Markup {
    html! {
        dl.facts {
            @if campaign.runs > 0 {
                div { dt { "runs" } dd { (campaign.runs) } }
                div { dt { "seed" } dd { (campaign.seed) } }
            }
            @if let Some(point) = point {
                @if point.failed > 0 { div.bad { dt { "ended early" } dd { (point.failed) } } }
                div { dt { "duration" } dd { (format!("{:.0} s", point.end_s)) } }
            } @else {
                div { dt { "points" } dd { (campaign.points.len()) } }
                div { dt { "keys" } dd { (campaign.keys.join(", ")) } }
            }
            @if let Some(from) = campaign.from {
                div { dt { "judged from" } dd { (from) " s" } }
            }
            @if campaign.smooths { div { dt { "estimates" } dd { "smoothed" } } }
            div { dt { "run by" } dd { "navfuse " (campaign.version) } }
        }
    }
}

/// Creates the verdict of a point with its findings, and the verdicts of its runs.
fn verdict(campaign: &Campaign, point: &PointReport) -> Markup {
    let Judged { consistent, doubtful, do_not_use } = point.judged;
    let at = |(key, value): (&String, &String)| format!("{key} = {value}");
    let place: Vec<String> = campaign.keys.iter().zip(&point.values).map(at).collect();
    html! {
        @if let Some(verdict) = &point.verdict {
            p.verdict.bad[!verdict.consistent] {
                @if place.is_empty() { "Errors" } @else { (place.join(", ")) ": errors" }
                " and sigmas are "
                b { @if verdict.consistent { "consistent" } @else { "INCONSISTENT" } }
                ". Each run judged alone: " (consistent) " consistent, " (doubtful)
                " doubtful, " (do_not_use) " do not use."
            }
            @if !verdict.findings.is_empty() {
                ul.reasons { @for finding in &verdict.findings { li.bad { (finding.text) } } }
            }
        }
    }
}

/// Returns the class of a value that lies outside its band.
fn outside(value: Option<f64>, band: Option<Band>) -> Option<&'static str> {
    value.zip(band).filter(|(value, band)| !band.holds(*value)).map(|_| "bad")
}

/// Creates the cell with the name of a state, on the row of its first component only.
fn name(states: &[StateReport], k: usize) -> Markup {
    html! { th { @if begins(states, k) { (states[k].component.state) } } }
}

fn states(campaign: &Campaign, point: &PointReport) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "state" } th {} th { "RMSE" } th { "1-sigma" } th { "RMSE/" wbr; "sigma" }
                th.more { "bound" } th { "RMSE/" wbr; "bound" } th.more { "mean error" }
                th.name { "unit" }
            } }
            tbody {
                @for (k, s) in point.states.iter().enumerate() {
                    tr class=[begins(&point.states, k).then_some("first")] {
                        (name(&point.states, k))
                        td.name { (s.component.component) }
                        td { (three(s.rmse)) } td { (three(s.sigma)) }
                        td { (ratio(s.rmse_over_sigma)) }
                        td.more { (three(s.bound)) } td { (ratio(s.rmse_over_bound)) }
                        td.more { (three(s.mean_error)) } td.name { (s.component.unit) }
                    }
                }
            }
        } }
        p.note {
            @if campaign.smooths { "Root mean square over the run, of smoothed estimates. " }
            @else { "At the end of the runs. " }
            "Bound: the smallest sigma that an estimator can reach on this trajectory."
        }
    }
}

/// Creates the tables of NEES and NIS.
fn consistency(point: &PointReport) -> Markup {
    html! {
        h3 { "Errors against sigma" }
        div.wide { table {
            thead { tr {
                th { "NEES" } th { "states" } th { "mean" } th { "95 % band" }
                th { "epochs inside" }
            } }
            tbody { @for a in &point.anees {
                tr.first {
                    th { (a.of) } td { (a.dimension) }
                    td class=[outside(a.value, a.band)] { (number(a.value)) }
                    td { (band(a.band)) }
                    td { @if let Some(share) = a.inside { (format!("{:.1} %", 100.0 * share)) } }
                }
            } }
        } }
        @if !point.nis.is_empty() {
            h3 { "Innovations against sigma" }
            div.wide { table {
                thead { tr {
                    th { "NIS" } th { "used" } th { "gated" } th { "mean" } th { "expected" }
                    th { "95 % band" }
                } }
                tbody { @for n in &point.nis {
                    tr.first {
                        th { (n.sensor) } td { (n.used) }
                        td { (format!("{:.2} %", 100.0 * n.gated)) }
                        td class=[outside(n.mean, n.band)] { (number(n.mean)) }
                        td { (number(n.expected)) } td { (band(n.band)) }
                    }
                } }
            } }
        }
    }
}

fn bound(point: &PointReport, statistics: &PointStatistics) -> Markup {
    let rows = statistics.bound.as_ref().map(|b| &b.rows[..]).unwrap_or_default();
    html! {
        @if let (Some(start), Some(end)) = (rows.first(), rows.last()) {
            div.wide { table {
                thead { tr {
                    th { "state" } th {} th { (format!("{:.0} s", start.1)) }
                    th { (format!("{:.0} s", end.1)) } th { "smoothed, rms" } th.name { "unit" }
                } }
                tbody { @for (k, s) in point.states.iter().enumerate() {
                    tr class=[begins(&point.states, k).then_some("first")] {
                        (name(&point.states, k))
                        td.name { (s.component.component) }
                        td { (number(Some(start.2[k]))) } td { (number(Some(end.2[k]))) }
                        td { (number(s.smoothed)) } td.name { (s.component.unit) }
                    }
                } }
            } }
            p.note {
                "1-sigma of the best filter at the begin and at the end. Smoothed, rms: that of the best "
                "estimate from all samples, as root mean square over the run."
            }
        }
    }
}

/// Creates the table of a sweep: a row for each shown component, a column for each point.
fn grid(campaign: &Campaign, results: &Results, shown: impl Fn(&Component) -> bool) -> Markup {
    let components = campaign.columns.components.iter().enumerate();
    html! {
        div.wide { table {
            thead { @for (k, key) in campaign.keys.iter().enumerate() {
                tr {
                    th { (key) } th {}
                    @for point in &results.report.points { th { (point.values[k]) } }
                }
            } }
            tbody { @for (k, component) in components.filter(|(_, c)| shown(c)) {
                tr.first {
                    th { (component.name()) } td.name { (component.unit) }
                    @for point in &results.report.points {
                        @let state = &point.states[k];
                        td {
                            @if campaign.runs > 0 { (number(state.rmse)) " / " }
                            (number(state.bound))
                        }
                    }
                }
            } }
        } }
        p.note {
            @if campaign.runs > 0 { "RMSE of " (campaign.runs) " runs, and the bound, at the end." }
            @else { "1-sigma bound at the end." }
        }
    }
}

/// Lists the runs to look at, each with a link to its page or with the command that writes one.
fn worst(campaign: &Campaign, results: &Results, pages: &[String]) -> Markup {
    let reason = |job: Job| {
        let failures = &results.points[job.point].failures;
        failures.iter().find(|failure| failure.0 == job.run).map(|failure| &failure.1)
    };
    let nees = |job: Job| {
        let all = &results.points[job.point].nees;
        all.iter().find(|nees| nees.0 == job.run).map(|nees| nees.1)
    };
    let expected = results.report.points.first().and_then(|point| point.anees.first());
    html! {
        h3 { "Runs to look at" }
        div.wide { table {
            thead { tr {
                @for key in &campaign.keys { th { (key) } }
                th { "run" } th { "NEES" } th.name { "run it again" }
            } }
            tbody { @for (k, job) in to_look_at(results).into_iter().enumerate() {
                @let reason = reason(job);
                tr.first {
                    @for value in &results.report.points[job.point].values { th { (value) } }
                    th { @match pages.get(k) {
                        Some(page) => a href=(page) { (job.run) },
                        None => (job.run),
                    } }
                    td {
                        @match nees(job).filter(|_| reason.is_none()) {
                            Some(nees) => (format!("{nees:.1}")),
                            None => "-",
                        }
                    }
                    td.text {
                        @if let Some(reason) = reason { span.bad { (reason) ": " } }
                        code { "navfuse report SCENARIO " (campaign.again(job.point, job.run)) }
                    }
                }
            } }
        } }
        p.note {
            @if !campaign.keys.is_empty() { "The worst run of each point. " }
            "Expected NEES: " (expected.map_or(0, |a| a.dimension)) ", the number of "
            "states with a known error. "
            @if !pages.is_empty() { "A number with a link leads to the page of that run. " }
            "SCENARIO is the file of " (campaign.scenario) "."
        }
    }
}
