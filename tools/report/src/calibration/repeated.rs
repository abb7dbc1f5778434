//! The errors of each method over many runs, compared with its sigma.

use super::label;
use crate::bar::{ALPHA, Bar};
use crate::histogram::histogram;
use crate::page::{document, footer, scenario_section, titled};
use maud::{Markup, html};
use navfuse_calibration::Repeated;
use navfuse_calibration::words::{COMPONENTS, decimals, settles, unit};
use navfuse_core::model::chi_square;
use navfuse_core::model::chi_square::Band;
use navfuse_figures::{Axis, Figure, FigureError};
use statrs::distribution::{ContinuousCDF, Normal};

/// Fewest runs of which a histogram shows something.
const FEWEST: usize = 20;
/// Right edge of a histogram, sigma, and number of its bars; the outer ones hold everything beyond.
const EDGE: f64 = 4.0;
const BARS: usize = 8;

/// Writes the page of the methods' errors over runs with these seeds, with the text of the scenario.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(
    name: &str,
    scenario: &str,
    seeds: &[u64],
    methods: &[Repeated],
) -> Result<String, FigureError> {
    let title = format!("{name}: calibration of {} runs", seeds.len());
    let known = || methods.iter().filter(|method| !method.runs.is_empty());
    let body = html! {
        header {
            h1 { (title) }
            nav {
                a href="#result" { "Result" }
                a href="#methods" { "Methods" }
                a href="#plots" { "Figures" }
                a href="#scenario" { "Scenario" }
            }
        }
        main {
            section #result { h2 { "Result" } (result(methods, seeds.len())) }
            section #methods {
                h2 { "Methods" }
                (table(known()))
                p.note {
                    "R.m.s. over the runs. Error/sigma: 1 is expected; outside the band of 95 % it "
                    "is marked, which chance does to one value in 20. " (settles()) "; its median."
                }
            }
            section #plots {
                h2 { "Figures" }
                @let figures: Vec<Figure> = known().filter_map(figure).collect();
                p.note {
                    @if figures.is_empty() {
                        "A figure shows the distribution of error over sigma in " (FEWEST)
                        " runs or more. Here are " (seeds.len()) "."
                    } @else {
                        "Error over sigma of each run. A consistent method follows the dotted line; "
                        "chance leaves 95 of 100 bars in the band. The outer bars hold everything "
                        "beyond. A method without sigma, or with fewer than " (FEWEST)
                        " runs, has no figure."
                    }
                }
                (titled(figures)?)
            }
            (scenario_section("TOML, as it was run", scenario))
        }
        (footer())
    };
    Ok(document(&title, &body))
}

/// The band of the r.m.s. of `n` values of unit variance.
fn band(n: usize, alpha: f64) -> Band {
    let n = n as f64;
    let squares = chi_square::band(n, 2.0 * n, alpha);
    Band { low: (squares.low / n).sqrt(), high: (squares.high / n).sqrt() }
}

/// The components of a method whose errors its sigma does not explain; `None` for a method without
/// a sigma. The probability of one false alarm among all components of all methods is 5 %.
fn outside(method: &Repeated, all: usize) -> Option<Vec<String>> {
    let [_, _, ratios] = method.figures();
    let band = band(method.runs.len(), ALPHA / (4 * all) as f64);
    let known = || ratios.iter().enumerate().filter_map(|(i, ratio)| Some((i, (*ratio)?)));
    known().next()?;
    let far = known().filter(|(_, ratio)| !band.holds(*ratio));
    Some(far.map(|(i, ratio)| format!("{} {ratio:.2}", COMPONENTS[i])).collect())
}

/// The verdict on each method, and the reasons why one cannot be applied.
fn result(methods: &[Repeated], runs: usize) -> Markup {
    let judged: Vec<_> =
        methods.iter().filter_map(|m| Some((m, outside(m, methods.len())?))).collect();
    html! {
        ul.reasons {
            @for (method, far) in &judged {
                li.bad[!far.is_empty()] {
                    b { (method.name) } ": "
                    @if far.is_empty() { "errors and sigmas are consistent" }
                    @else { "INCONSISTENT, r.m.s. of error/sigma: " (far.join(", ")) }
                    "."
                }
            }
        }
        @for method in methods {
            @if let Some(why) = &method.refused {
                p {
                    (method.name) ": not possible in " (runs - method.runs.len()) " of " (runs)
                    " runs: " (why)
                }
            }
        }
    }
}

fn table<'a>(methods: impl Iterator<Item = &'a Repeated>) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "method" } th.name {}
                @for i in 0..4 { th { (label(i)) } }
                th { "settles after" } th { "runs" } th.name { "sensors" }
            } }
            tbody { @for method in methods {
                @let [errors, sigmas, ratios] = method.figures();
                @let band = band(method.runs.len(), ALPHA);
                tr.first {
                    th { (method.name) } td.name { "error" } (cells(errors))
                    td { @if let Some(t) = method.settled_after() { (format!("{t:.0} s")) } }
                    td { (method.runs.len()) } td.text { (method.sensors) }
                }
                @if ratios.iter().any(Option::is_some) {
                    tr { th {} td.name { "sigma" } (cells(sigmas)) td {} td {} td {} }
                    tr {
                        th {} td.name { "error/sigma" }
                        @for ratio in ratios {
                            td.bad[ratio.is_some_and(|ratio| !band.holds(ratio))] {
                                (ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.2}")))
                            }
                        }
                        td {} td {} td {}
                    }
                }
            } }
        } }
    }
}

/// The cells of four values.
fn cells(values: [Option<f64>; 4]) -> Markup {
    let text = |i: usize, value: f64| format!("{:.*}", decimals(i), value * unit(i));
    html! {
        @for (i, value) in values.into_iter().enumerate() {
            td { (value.map_or("-".to_owned(), |value| text(i, value))) }
        }
    }
}

/// Plots the errors over sigma of a method as one histogram for each component that all runs
/// determined.
fn figure(method: &Repeated) -> Option<Figure> {
    let normal = Normal::standard();
    let place = |bar: usize| 2.0 * EDGE * bar as f64 / BARS as f64 - EDGE;
    let below = |edge: usize| match edge {
        0 => 0.0,
        BARS => 1.0,
        _ => normal.cdf(place(edge)),
    };
    let panel = |i: usize| {
        let ratios: Option<Vec<f64>> =
            method.runs.iter().map(|r| r.ratio(i).filter(|_| r.determined[i])).collect();
        let ratios = ratios.filter(|ratios| ratios.len() >= FEWEST)?;
        let bar = |ratio: f64| (0.5 * (ratio / EDGE + 1.0) * BARS as f64) as usize;
        let count = |k| ratios.iter().filter(|r| bar(**r).min(BARS - 1) == k).count() as u64;
        let bars = (0..BARS).map(|k| Bar {
            edges: [place(k), place(k + 1)],
            seen: count(k),
            probability: below(k + 1) - below(k),
        });
        let x = Axis::linear(format!("{} error / sigma", COMPONENTS[i]));
        Some(histogram("", x, ("runs", ratios.len() as u64), bars))
    };
    let panels: Vec<_> = (0..4).filter_map(panel).collect();
    (!panels.is_empty()).then(|| Figure {
        name: format!("errors-{}", method.name.replace([',', ' '], "-")),
        title: method.name.clone(),
        columns: 2,
        panels,
    })
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use navfuse_calibration::Run;

    /// A method whose errors are quantiles of a normal distribution, times a factor.
    fn method(name: &str, factor: f64) -> Repeated {
        let normal = Normal::standard();
        let runs = (0..40).map(|k| {
            let z = normal.inverse_cdf((f64::from(k) + 0.5) / 40.0);
            Run {
                error: [1e-4, 1e-3, 1e-3, 1e-3].map(|sigma| factor * z * sigma),
                sigma: Some([1e-4, 1e-3, 1e-3, 1e-3]),
                determined: [true, true, false, true],
                settled_after: Some(12.0),
            }
        });
        Repeated {
            name: name.into(),
            sensors: "IMU, DVL".into(),
            runs: runs.collect(),
            refused: None,
        }
    }

    #[test]
    fn the_page_judges_each_method_by_the_chance_band_of_its_errors() {
        let mut refused = method("tang", 1.0);
        (refused.runs, refused.refused) = (Vec::new(), Some("it needs fixes".into()));
        let methods = [method("io-dvlc", 1.0), method("troni", 1.8), refused];
        let seeds: Vec<u64> = (1..=40).collect();
        let page = page("dive", "name = \"dive\"", &seeds, &methods).expect("it is drawn");
        let (_, result) = page.split_once("<section id=\"result\">").expect("a result");
        let result = result.split_once("</section>").expect("it ends").0;
        assert!(result.contains("<b>io-dvlc</b>: errors and sigmas are consistent"), "{result}");
        assert!(result.contains("<b>troni</b>: INCONSISTENT"), "{result}");
        assert!(!result.contains("pitch"), "no run determined it: {result}");
        assert!(result.contains("tang: not possible in 40 of 40 runs: it needs fixes"), "{result}");
        for id in ["errors-io-dvlc", "errors-troni"] {
            assert!(page.contains(&format!("<figure id=\"{id}\">")), "{id}");
        }
    }

    /// The mean square of 40 values scatters by sqrt(2 / 40), its root by half of that, 0.112: the
    /// band is 1 -+ 1.96 times as much, and skewed by less than 0.02.
    #[test]
    fn the_band_of_a_ratio_follows_from_the_number_of_runs() {
        let band = band(40, 0.05);
        assert!((band.low - 0.78).abs() < 0.02 && (band.high - 1.22).abs() < 0.02, "{band:?}");
    }

    #[test]
    fn the_histogram_counts_every_run_and_follows_the_expected_line() {
        let figure = figure(&method("io-dvlc", 1.0)).expect("enough runs");
        assert_eq!(figure.panels.len(), 3, "a component that no run determined has none");
        let heights = |k: usize| {
            let curve = &figure.panels[0].curves[k];
            curve.points.iter().step_by(2).map(|p| p[1]).collect::<Vec<f64>>()
        };
        let [expected, seen] = [heights(0), heights(1)];
        assert_eq!(seen.iter().sum::<f64>(), 40.0);
        // quantiles at the middles of 40 equal shares: an edge of a bar cuts at most one share
        assert!(expected.iter().zip(&seen).all(|(e, s)| (e - s).abs() <= 1.0 + 1e-9), "{seen:?}");
        assert!(figure_of_few().is_none());
    }

    fn figure_of_few() -> Option<Figure> {
        let mut few = method("io-dvlc", 1.0);
        few.runs.truncate(FEWEST - 1);
        figure(&few)
    }
}
