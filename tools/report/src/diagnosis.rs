//! A diagnosis as one page, which opens offline: the best change, all changes that were tried on
//! the whole recording, and by how much the samples favour each.

use crate::page::{document, footer, picture, scenario_section};
use crate::plots::curve;
use maud::{Markup, html};
use navfuse_core::model::chi_square::band;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_diagnose::{Diagnosis, Trial};
use navfuse_figures::{Axis, Band, Figure, FigureError, Look, Panel};

/// Probability outside the band of the mean NIS.
const ALPHA: f64 = 0.05;

/// Writes the page of the diagnosis of a scenario, whose name and text it shows.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(name: &str, scenario: &str, diagnosis: &Diagnosis) -> Result<String, FigureError> {
    let title = format!("{name}: diagnosis");
    let body = html! {
        header {
            h1 { (title) }
            dl.facts {
                div { dt { "changes tried" } dd { (diagnosis.tried) } }
                @if diagnosis.unfit > 0 {
                    div { dt { "that do not fit" } dd { (diagnosis.unfit) } }
                }
                div.bad[bad(&diagnosis.unchanged)] {
                    dt { "verdict as it is" } dd { (diagnosis.unchanged.severity.verdict()) }
                }
            }
            nav {
                a href="#result" { "Result" }
                a href="#changes" { "Changes" }
                a href="#plots" { "Figures" }
                a href="#scenario" { "Scenario" }
            }
        }
        main {
            section #result { h2 { "Result" } (result(diagnosis)) }
            section #changes { h2 { "Changes" } (changes(diagnosis)) }
            section #plots {
                h2 { "Figures" }
                (picture(&figure(diagnosis), &html! {
                    "Each change at its number in the table; 0 is the scenario as it is. Score: "
                    "2 ln L less what its parameters and choices cost. The samples do not decide "
                    "between the changes in the band. Mean NIS: 1 is expected; chance leaves 95 of "
                    "100 consistent runs in the band, if their innovations are independent."
                })?)
            }
            (scenario_section("TOML, as it is", scenario))
        }
        (footer())
    };
    Ok(document(&title, &body))
}

fn bad(trial: &Trial) -> bool {
    trial.level != VerdictLevel::Consistent
}

/// The best change with its assignments, and what else the samples allow.
fn result(diagnosis: &Diagnosis) -> Markup {
    let rivals = diagnosis.rivals();
    html! {
        @if diagnosis.interrupted { p.bad { "Interrupted: not every change was tried." } }
        p.verdict.bad[diagnosis.best().is_some_and(bad)] { (sentence(&diagnosis.conclusion())) "." }
        @if let Some(best) = diagnosis.best() {
            (settings(best))
            p { "The run with it: " (best.verdict) "." }
        }
        p { "The scenario as it is: " (diagnosis.unchanged.verdict) "." }
        @if !rivals.is_empty() {
            p { "The samples do not decide between this change and:" }
            ul { @for rival in rivals { li { (rival) } } }
        }
    }
}

/// Words as the begin of a sentence.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The assignments of a change, as a command takes them.
fn settings(trial: &Trial) -> Markup {
    html! { pre { @for setting in &trial.settings { "--set '" (setting) "'\n" } } }
}

fn changes(diagnosis: &Diagnosis) -> Markup {
    let next = |k: usize| diagnosis.trials.get(k + 1).map(|next| next.score);
    html! {
        div.wide { table {
            thead { tr {
                th { "change" } th.name {} th.more { "2 ln L" } th { "score" } th.more { "margin" }
                th { "mean NIS" } th.name { "verdict" } th { "end moves" }
            } }
            tbody {
                (row(0, &Trial { change: "none".to_owned(), ..diagnosis.unchanged.clone() }, None))
                @for (k, trial) in diagnosis.trials.iter().enumerate() {
                    (row(k + 1, trial, next(k)))
                }
            }
        } }
        p.note {
            "2 ln L: twice the logarithm by which the samples become likelier. Margin: lead of the "
            "score over the next change; " (Diagnosis::CLEAR) " are odds of 150 : 1. End moves: "
            "distance between the last positions with and without the change."
        }
        details {
            summary { "Assignments of each change" }
            @for (k, trial) in diagnosis.trials.iter().enumerate() {
                p { (k + 1) ": " (trial.change) }
                (settings(trial))
            }
        }
    }
}

fn row(number: usize, trial: &Trial, next: Option<f64>) -> Markup {
    html! {
        tr.first {
            th { (number) }
            td.text { (trial.words()) }
            td.more { (format!("{:.0}", trial.gain)) }
            td { (format!("{:.0}", trial.score)) }
            td.more { @if let Some(next) = next { (format!("{:.0}", trial.score - next)) } }
            td { @if trial.mean_nis.is_finite() { (format!("{:.2}", trial.mean_nis)) } }
            td.name { span.bad[bad(trial)] { (trial.severity.verdict()) } }
            td { (trial.moves()) }
        }
    }
}

/// The score and the mean NIS of each change.
fn figure(diagnosis: &Diagnosis) -> Figure {
    let all = || [&diagnosis.unchanged].into_iter().chain(&diagnosis.trials);
    let places = || all().enumerate().map(|(k, trial)| (k as f64, trial));
    let edges = [-0.5, diagnosis.trials.len() as f64 + 0.5];
    let most = diagnosis.trials.iter().map(|t| t.score).fold(0.0, f64::max);
    let axis = || Axis::linear("number of the change");
    let score = Panel {
        title: String::new(),
        x: axis(),
        y: Axis::linear("score"),
        curves: vec![
            curve(
                "least that counts",
                Look::Bound,
                edges.map(|x| [x, Diagnosis::CLEAR]).into_iter(),
            ),
            curve("change", Look::Points(0), places().map(|(x, t)| [x, t.score])),
        ],
        bands: vec![Band {
            name: "without a clear margin".into(),
            points: edges.map(|x| [x, most - Diagnosis::CLEAR, most]).to_vec(),
        }],
    };
    let chance = places().flat_map(|(x, trial)| {
        let n = trial.values as f64;
        let limits = band(n, 2.0 * n, ALPHA);
        [x - 0.5, x + 0.5].map(|x| [x, limits.low / n, limits.high / n])
    });
    let nis = Panel {
        title: String::new(),
        x: axis(),
        y: Axis::logarithmic("mean NIS"),
        curves: vec![
            curve("expected", Look::Bound, edges.map(|x| [x, 1.0]).into_iter()),
            curve("change", Look::Points(0), places().map(|(x, t)| [x, t.mean_nis])),
        ],
        bands: vec![Band { name: "95 % band".into(), points: chance.collect() }],
    };
    Figure { name: "changes".into(), title: String::new(), columns: 2, panels: vec![score, nis] }
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use navfuse_core::model::record::finding::Severity;

    fn trial(change: &str, score: f64, severity: Severity) -> Trial {
        Trial {
            change: change.into(),
            settings: vec![format!("sensor.{change}.noise=\"1 m\"")],
            gain: score + 7.0,
            score,
            mean_nis: 1.02,
            values: 800,
            level: severity.into(),
            severity,
            verdict: format!("{} of {change}", severity.verdict()),
            moved: Some(1.5),
            estimate: None,
            unmended: None,
        }
    }

    fn diagnosis(trials: Vec<Trial>) -> Diagnosis {
        let unchanged = Trial { mean_nis: 40.0, ..trial("as it is", 0.0, Severity::DoNotUse) };
        Diagnosis { unchanged, trials, tried: 120, unfit: 3, interrupted: false }
    }

    /// The section of a page.
    fn section<'a>(page: &'a str, id: &str) -> &'a str {
        let (_, section) = page.split_once(&format!("<section id=\"{id}\">")).expect(id);
        section.split_once("</section>").expect("it ends").0
    }

    #[test]
    fn the_page_names_the_remedy_its_assignments_and_the_rivals_without_a_clear_margin() {
        let trials = vec![
            trial("usbl", 300.0, Severity::DoNotUse),
            trial("dvl", 295.0, Severity::Note),
            trial("<depth>", 100.0, Severity::DoNotUse),
        ];
        let page = page("dive", "name = \"dive\"", &diagnosis(trials)).expect("it is drawn");
        let result = section(&page, "result");
        // of two changes within the margin the consistent one comes first
        assert!(result.contains("Remedy, with which the run is consistent: dvl"), "{result}");
        assert!(result.contains("--set 'sensor.dvl.noise=&quot;1 m&quot;'"), "{result}");
        assert!(result.contains("<li>usbl</li>") && !result.contains("&lt;depth&gt;"), "{result}");
        let changes = section(&page, "changes");
        assert_eq!(changes.matches("<tr class=\"first\">").count(), 4, "{changes}");
        // a narrow page leaves out the same columns of the heading and of the four rows
        let left_out = |cell: &str| changes.matches(&format!("<{cell} class=\"more\">")).count();
        assert_eq!([left_out("th"), left_out("td")], [2, 8], "{changes}");
        assert!(changes.contains("&lt;depth&gt;") && !page.contains("<depth>"), "{changes}");
        let facts = page.split_once("<nav>").expect("it has links").0;
        assert!(facts.contains("do not use"), "the verdict as it is: {facts}");
    }

    /// A mean of n squared Gaussian values of unit variance has the variance 2 / n: 1 +- 1.96
    /// sqrt(2 / 800) is 0.902 to 1.098, and the band of chi-square differs from it by its skewness,
    /// less than 0.005.
    #[test]
    fn the_figure_has_the_margin_below_the_best_score_and_the_band_of_the_mean_nis() {
        let trials = vec![trial("usbl", 300.0, Severity::DoNotUse)];
        let figure = figure(&diagnosis(trials));
        let [score, nis] = &figure.panels[..] else { unreachable!("two panels") };
        assert!(score.bands[0].points.iter().all(|p| p[1..] == [290.0, 300.0]), "{score:?}");
        let [_, low, high] = nis.bands[0].points[0];
        assert!((low - 0.902).abs() < 0.005 && (high - 1.098).abs() < 0.005, "{low} {high}");
        let points = &nis.curves[1].points;
        assert_eq!(points, &[[0.0, 40.0], [1.0, 1.02]]);
    }

    #[test]
    fn a_page_without_any_change_reports_that_none_explains_the_samples() {
        let page = page("dive", "", &diagnosis(Vec::new())).expect("it is drawn");
        assert!(section(&page, "result").contains("No change explains the samples better"));
    }

    #[test]
    fn a_long_way_has_no_centimetres() {
        let moves =
            |metres: f64| Trial { moved: Some(metres), ..trial("a", 0.0, Severity::Note) }.moves();
        let expected = ["1.50 m", "99.99 m", "1500 m", "146 km"];
        assert_eq!([1.5, 99.994, 1500.4, 146_168.9].map(moves), expected);
    }
}
