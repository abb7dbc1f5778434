//! A calibration as one page, which opens offline: the estimates of all methods beside each other,
//! and over time; or the errors of each method over many runs.

mod repeated;

pub use repeated::page as repeated;

use crate::page::{document, footer, scenario_section, titled};
use crate::plots::{curve, over_time};
use maud::{Markup, html};
use navfuse_calibration::words::{COMPONENTS, decimals, found, notes, settles, unit, value};
use navfuse_calibration::{CalibrationData, Estimate};
use navfuse_figures::{Axis, Curve, Figure, FigureError, Look, Panel};
use navfuse_segments::Mounting;

/// Ratio of an error, or of the difference of two estimates, to its sigma above which it is marked.
const LARGE: f64 = 3.0;

/// A method and its result on the recording.
#[derive(Clone, Debug)]
pub struct Applied<'a> {
    /// Name of the method.
    pub name: &'a str,
    /// Sensors that it uses.
    pub sensors: &'a str,
    /// The estimate, or the reason why the method cannot be applied.
    pub result: Result<&'a Estimate, String>,
}

/// What the page shows beside the results.
struct Shown<'a> {
    methods: &'a [Applied<'a>],
    data: &'a CalibrationData,
    truth: Option<Mounting>,
}

/// Writes the page of the methods' results on a recording, with the text of its scenario.
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn page(
    scenario: &str,
    data: &CalibrationData,
    methods: &[Applied<'_>],
) -> Result<String, FigureError> {
    let truth = data.velocity().ok().and_then(|v| v.truth);
    let shown = Shown { methods, data, truth };
    let title = format!("{}: calibration", data.recording.name);
    let figures = [vec![shown.beside()], shown.over_time()].concat();
    let body = html! {
        header {
            h1 { (title) }
            p.lead { (found(data)) "; " (data.attitude_source()) }
            nav {
                a href="#result" { "Result" }
                a href="#methods" { "Methods" }
                a href="#plots" { "Figures" }
                a href="#scenario" { "Scenario" }
            }
        }
        main {
            section #result { h2 { "Result" } (shown.result()) }
            section #methods {
                h2 { "Methods" }
                (shown.table())
                p.note { (settles()) "." }
            }
            section #plots {
                h2 { "Figures" }
                (titled(figures.iter())?)
                p.note {
                    "The axes of the estimates end with those that have a sigma: one without a sigma that "
                    "is farther away is left out."
                }
            }
            (scenario_section("TOML, as it was used", scenario))
        }
        (footer())
    };
    Ok(document(&title, &body))
}

/// Values of `k` (1) and of the angles (rad) of a mounting.
fn values(mounting: &Mounting) -> [f64; 4] {
    let angles = mounting.angles();
    [mounting.k, angles.x, angles.y, angles.z]
}

/// Name and unit of a component.
fn label(i: usize) -> String {
    crate::plots::label(COMPONENTS[i], if i == 0 { "" } else { "deg" })
}

impl<'a> Shown<'a> {
    /// The methods that have an estimate, each with its number in the table.
    fn known(&self) -> impl Iterator<Item = (usize, &'a Applied<'a>, &'a Estimate)> {
        let numbered = self.methods.iter().enumerate();
        numbered.filter_map(|(k, method)| Some((k + 1, method, *method.result.as_ref().ok()?)))
    }

    /// The first estimate, what contradicts it, and the notes of all methods.
    fn result(&self) -> Markup {
        let findings = match &self.truth {
            Some(truth) => self.errors(truth),
            None => self.contradictions(),
        };
        let notes = notes(self.methods.iter().map(|m| (m.name, m.result.clone())));
        html! {
            @if let Some((_, first, estimate)) = self.known().next() {
                p.verdict {
                    b { (first.name) } ": "
                    @for i in 0..4 {
                        (COMPONENTS[i]) " " (value(estimate, i)) @if i > 0 { " deg" }
                        @if i < 3 { ", " } @else { "." }
                    }
                }
            }
            @if let Some(truth) = &self.truth {
                @let truth = values(truth);
                p {
                    "Truth: "
                    @for i in 0..4 {
                        (COMPONENTS[i]) " " (format!("{:.*}", decimals(i), truth[i] * unit(i)))
                        @if i > 0 { " deg" }
                        @if i < 3 { ", " } @else { "." }
                    }
                }
            }
            @if !findings.is_empty() {
                ul.reasons { @for finding in &findings { li.bad { (finding) } } }
            } @else if self.truth.is_some() {
                p { "Every error is within " (LARGE) " sigma." }
            } @else if self.known().count() > 1 {
                p { "No method contradicts the first one by more than " (LARGE) " sigma." }
            }
            @if !notes.is_empty() {
                ul { @for (note, names) in &notes { li { (names.join(", ")) ": " (note) } } }
            }
        }
    }

    /// The methods with an error that their sigma does not explain.
    fn errors(&self, truth: &Mounting) -> Vec<String> {
        let all = self.known().filter_map(|(_, method, estimate)| {
            let (error, sigma) = (estimate.error(truth), estimate.sigma()?);
            let (i, ratio) = largest(estimate, |i| error[i] / sigma[i])?;
            let text = format!("{}: error of {ratio:.1} sigma in {}", method.name, COMPONENTS[i]);
            (ratio > LARGE).then_some(text)
        });
        all.collect()
    }

    /// The methods that differ from the first one by more than their sigmas explain.
    fn contradictions(&self) -> Vec<String> {
        let mut known = self.known();
        let Some((_, first, one)) = known.next() else { return Vec::new() };
        let all = known.filter_map(|(_, method, other)| {
            let (a, b) = (one.sigma()?, other.sigma()?);
            let apart = other.error(&one.mounting);
            let sigmas = |i: usize| apart[i] / a[i].hypot(b[i]);
            let (i, ratio) = largest(other, |i| if one.determined[i] { sigmas(i) } else { 0.0 })?;
            let text = format!(
                "{} contradicts {}, by {ratio:.1} sigma in {}",
                method.name, first.name, COMPONENTS[i]
            );
            (ratio > LARGE).then_some(text)
        });
        all.collect()
    }

    fn table(&self) -> Markup {
        html! {
            div.wide { table {
                thead { tr {
                    th { "method" } th.name {}
                    @for i in 0..4 { th { (label(i)) } }
                    th { "settles after" } th.name { "sensors" }
                } }
                tbody {
                    @for (number, method, estimate) in self.known() {
                        tr.first {
                            th { (number) }
                            td.name { (method.name) }
                            @for i in 0..4 { td { (value(estimate, i)) } }
                            td {
                                @if let Some(t) = estimate.settled_after() { (format!("{t:.0} s")) }
                            }
                            td.text { (method.sensors) }
                        }
                        @if let Some(truth) = &self.truth { (error(estimate, truth)) }
                    }
                }
            } }
        }
    }

    /// Plots every estimate with its bounds of 3 sigma beside its name, in the order of the table.
    fn beside(&self) -> Figure {
        let count = self.methods.len();
        let place = |number: usize| (count + 1 - number) as f64;
        let panel = |i: usize| {
            let scale = unit(i);
            let known = || self.known().filter(move |(_, _, estimate)| estimate.determined[i]);
            let bars = known().filter_map(|(number, _, estimate)| {
                let (value, reach) = (estimate.values()[i], LARGE * estimate.sigma()?[i]);
                let ends = [value - reach, value + reach].map(|x| [scale * x, place(number)]);
                Some(curve("±3 sigma", Look::Data(0), ends.into_iter()))
            });
            let truth = self.truth.iter().map(|truth| {
                let value = scale * values(truth)[i];
                let ends = [0.5, count as f64 + 0.5].map(|y| [value, y]);
                curve("truth", Look::Truth, ends.into_iter())
            });
            let mut shown: Vec<Curve> = truth.chain(bars).collect();
            let [low, high] = self.reach(i, 0.05);
            let near = |point: &[f64; 2]| low >= high || (low..=high).contains(&point[0]);
            let points = known().map(|(number, _, e)| [scale * e.values()[i], place(number)]);
            shown.push(curve("estimate", Look::Points(0), points.filter(near)));
            Panel {
                title: String::new(),
                x: Axis::linear(label(i)),
                y: Axis::of_names(self.methods.iter().rev().map(|method| method.name)),
                curves: shown,
                bands: Vec::new(),
            }
        };
        Figure {
            name: "methods-beside".into(),
            title: "Estimates of the methods".into(),
            columns: 2,
            panels: (0..4).map(panel).collect(),
        }
    }

    /// Plots the methods that estimate over time, as many in a figure as there are colours.
    fn over_time(&self) -> Vec<Figure> {
        let known: Vec<_> = self.known().filter(|(_, _, e)| e.history.len() > 1).collect();
        let clock = |time: f64| self.data.recording.clock(time);
        let times = known.iter().flat_map(|(_, _, e)| e.used).map(clock);
        let (first, last) = times.fold((f64::MAX, f64::MIN), |(a, b), t| (a.min(t), b.max(t)));
        let panel = |methods: &[(usize, &Applied<'_>, &Estimate)], i: usize| {
            let scale = unit(i);
            let truth = self.truth.iter().map(|truth| {
                let value = scale * values(truth)[i];
                curve("truth", Look::Truth, [first, last].map(|t| [t, value]).into_iter())
            });
            let curves = methods.iter().enumerate().map(|(k, (_, method, estimate))| {
                let points = estimate.history.iter();
                let points = points.map(|e| [clock(e.time), scale * values(&e.mounting)[i]]);
                curve(method.name, Look::Data(k), points)
            });
            let curves = truth.chain(curves).collect();
            // the first estimates are wild
            let limits = self.reach(i, 0.5);
            over_time("", Axis::linear(label(i)).within(limits), curves, Vec::new())
        };
        let figure = |(k, methods): (usize, &[(usize, &Applied<'_>, &Estimate)])| Figure {
            name: match k {
                0 => "methods-over-time".into(),
                k => format!("methods-over-time-{}", k + 1),
            },
            title: match k {
                0 => "Estimates over time".into(),
                _ => "Estimates over time, further methods".into(),
            },
            columns: 2,
            panels: (0..4).map(|i| panel(methods, i)).collect(),
        };
        known.chunks(Look::COLOURS).enumerate().map(figure).collect()
    }

    /// The range of the truth and of the last estimates with their bounds of 3 sigma, with that margin on either
    /// side: an estimate without a sigma may be far away.
    fn reach(&self, i: usize, margin: f64) -> [f64; 2] {
        let bounds = self.known().filter(|(_, _, estimate)| estimate.determined[i]);
        let bounds = bounds.filter_map(|(_, _, estimate)| {
            let (value, reach) = (estimate.values()[i], LARGE * estimate.sigma()?[i]);
            Some([value - reach, value + reach])
        });
        let truth = self.truth.iter().map(|truth| values(truth)[i]);
        range(bounds.flatten().chain(truth).map(|x| unit(i) * x), margin)
    }
}

/// The determined component with the largest ratio, and the size of that ratio.
fn largest(estimate: &Estimate, ratio: impl Fn(usize) -> f64) -> Option<(usize, f64)> {
    let all = (0..4).filter(|i| estimate.determined[*i]).map(|i| (i, ratio(i).abs()));
    all.filter(|(_, ratio)| ratio.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// The range of values, with that margin on either side.
fn range(values: impl Iterator<Item = f64>, margin: f64) -> [f64; 2] {
    let values = values.filter(|x| x.is_finite());
    let [low, high] = values.fold([f64::MAX, f64::MIN], |[a, b], y| [a.min(y), b.max(y)]);
    let margin = margin * (high - low);
    [low - margin, high + margin]
}

/// The row of the errors of an estimate.
fn error(estimate: &Estimate, truth: &Mounting) -> Markup {
    let (error, sigma) = (estimate.error(truth), estimate.sigma());
    let large = |i: usize| sigma.is_some_and(|s| (error[i] / s[i]).abs() > LARGE);
    html! {
        tr {
            th {} td.name { "error" }
            @for i in 0..4 {
                td.bad[estimate.determined[i] && large(i)] {
                    @if estimate.determined[i] {
                        (format!("{:+.*}", decimals(i), error[i] * unit(i)))
                    }
                }
            }
            td {} td {}
        }
    }
}
