//! Plots of a campaign.

use crate::campaign::Campaign;
use crate::folder::Results;
use crate::statistics::{EpochStatistics, PointStatistics};
use crate::verdict::{anees_band, nis_band};
use navfuse_core::model::chi_square::Band;
use navfuse_core::units::parse_unit;
use navfuse_figures::{Axis, Band as Shade, Curve, Figure, Look, Panel};

/// Probability outside the plotted bands.
const ALPHA: f64 = 0.05;

/// Plots one point over time, or a grid at the end of its runs with those components that `shown`
/// selects.
pub fn figures(
    campaign: &Campaign,
    results: &Results,
    shown: impl Fn(&crate::Component) -> bool,
) -> Vec<Figure> {
    let ran = |p: &PointStatistics| p.epochs().next().is_some();
    match results.points.as_slice() {
        [point] if ran(point) => vec![consistency(campaign, point), states(campaign, point)],
        // no plot if the campaign was interrupted before the bound was computed
        [point] => point.bound.iter().map(|_| bound(campaign, point)).collect(),
        _ => grid(campaign, results, shown),
    }
}

fn curve(name: &str, look: Look, points: impl Iterator<Item = [f64; 2]>) -> Curve {
    Curve { name: name.into(), look, points: points.collect() }
}

/// Plots ANEES and NIS over time with their bands.
fn consistency(campaign: &Campaign, point: &PointStatistics) -> Figure {
    let columns = &campaign.columns;
    let panel = |title: &str,
                 what: &str,
                 level: f64,
                 seen: &dyn Fn(&EpochStatistics) -> Option<(f64, Band)>| {
        let seen: Vec<(f64, f64, Band)> = point
            .epochs()
            .filter_map(|(_, e)| seen(e).map(|(value, band)| (e.time, value, band)))
            .collect();
        let band = Shade {
            name: "95 % band".into(),
            points: seen.iter().map(|s| [s.0, s.2.low, s.2.high]).collect(),
        };
        let expected = curve("expected", Look::Bound, seen.iter().map(|s| [s.0, level]));
        let mean = curve("mean", Look::Data(0), seen.iter().map(|s| [s.0, s.1]));
        Panel {
            title: title.into(),
            x: Axis::time(),
            y: Axis::linear(what),
            curves: vec![expected, mean],
            bands: vec![band],
        }
    };
    let nees = |of: usize, dimension: usize| {
        move |e: &EpochStatistics| {
            e.anees(of).map(|(value, runs)| (value, anees_band(dimension, runs, ALPHA)))
        }
    };
    let whole = columns.known();
    let mut panels = vec![panel("whole state", "ANEES", whole as f64, &nees(0, whole))];
    for (k, block) in columns.blocks.iter().enumerate().filter(|(_, b)| b.known) {
        panels.push(panel(
            &block.name,
            "ANEES",
            block.dimension as f64,
            &nees(k + 1, block.dimension),
        ));
    }
    for (k, sensor) in columns.sensors.iter().enumerate() {
        let all = point.nis(k);
        panels.push(panel(
            &format!("innovations of {sensor}"),
            "mean NIS",
            all.expected / all.used,
            &|e| {
                let nis = e.nis(k);
                nis_band(&nis, ALPHA).map(|band| (nis.nis / nis.used, band))
            },
        ));
    }
    let title = format!("{}: errors against uncertainty, {} runs", campaign.scenario, point.runs);
    Figure { name: "consistency".into(), title, columns: 3, panels }
}

/// Plots RMSE, sigma and bound of every component over time.
fn states(campaign: &Campaign, point: &PointStatistics) -> Figure {
    let components = campaign.columns.components.iter().enumerate();
    let panels = components.map(|(k, component)| {
        let over_time = |of: &dyn Fn(&EpochStatistics) -> Option<f64>| -> Vec<[f64; 2]> {
            point.epochs().filter_map(|(_, e)| of(e).map(|value| [e.time, value])).collect()
        };
        let least = |r: &(i64, f64, Vec<f64>, Vec<f64>)| {
            [r.1, if campaign.smooths { r.3[k] } else { r.2[k] }]
        };
        let bound = point.bound.iter().flat_map(|b| &b.rows).map(least);
        let curves = vec![
            curve("RMSE", Look::Data(0), over_time(&|e| e.rmse(k)).into_iter()),
            curve("1-sigma", Look::Sigma, over_time(&|e| e.sigma(k)).into_iter()),
            curve("bound", Look::Bound, bound),
        ];
        let y =
            Axis::logarithmic(if component.unit.is_empty() { "ratio" } else { &component.unit });
        Panel { title: component.name(), x: Axis::time(), y, curves, bands: Vec::new() }
    });
    let title =
        format!("{}: RMSE of {} runs, sigma and Cramer-Rao bound", campaign.scenario, point.runs);
    Figure { name: "states".into(), title, columns: 3, panels: panels.collect() }
}

/// Plots the bound of every component over time.
fn bound(campaign: &Campaign, point: &PointStatistics) -> Figure {
    let rows = || point.bound.iter().flat_map(|b| &b.rows);
    let components = campaign.columns.components.iter().enumerate();
    let panels = components.map(|(k, component)| {
        let curves = vec![
            curve("filter", Look::Data(0), rows().map(|r| [r.1, r.2[k]])),
            curve("smoother", Look::Sigma, rows().map(|r| [r.1, r.3[k]])),
        ];
        let y =
            Axis::logarithmic(if component.unit.is_empty() { "ratio" } else { &component.unit });
        Panel { title: component.name(), x: Axis::time(), y, curves, bands: Vec::new() }
    });
    let title = format!("{}: smallest possible 1-sigma", campaign.scenario);
    Figure { name: "bound".into(), title, columns: 3, panels: panels.collect() }
}

/// Plots every shown component at the end against the first key, with a curve for each combination
/// of the other keys.
fn grid(
    campaign: &Campaign,
    results: &Results,
    shown: impl Fn(&crate::Component) -> bool,
) -> Vec<Figure> {
    let Some(key) = campaign.keys.first() else { return Vec::new() };
    let (mut values, mut others): (Vec<&str>, Vec<&[String]>) = Default::default();
    for point in &campaign.points {
        if !values.contains(&point.values[0].as_str()) {
            values.push(&point.values[0]);
        }
        if !others.contains(&&point.values[1..]) {
            others.push(&point.values[1..]);
        }
    }
    let (places, x) = axis(key, &values);
    let components = campaign.columns.components.iter().enumerate().filter(|(_, c)| shown(c));
    let panels: Vec<Panel> = components
        .map(|(k, component)| {
            let mut curves = Vec::new();
            for (number, rest) in others.iter().enumerate() {
                let points = results.report.points.iter().filter(|p| p.values[1..] == **rest);
                let place = |value: &str| {
                    values.iter().position(|v| *v == value).map_or(f64::NAN, |at| places[at])
                };
                let of = |what: &dyn Fn(&crate::StateReport) -> Option<f64>| -> Vec<[f64; 2]> {
                    let each = points
                        .clone()
                        .filter_map(|p| what(&p.states[k]).map(|y| [place(&p.values[0]), y]));
                    each.collect()
                };
                let name = |what: &str| {
                    let rest = rest.join(", ");
                    if rest.is_empty() { what.to_owned() } else { format!("{what}, {rest}") }
                };
                if campaign.runs > 0 {
                    curves.push(curve(
                        &name("RMSE"),
                        Look::Points(number),
                        of(&|s| s.rmse).into_iter(),
                    ));
                }
                curves.push(curve(
                    &name("bound"),
                    Look::Data(number),
                    of(&|s| s.bound).into_iter(),
                ));
            }
            let y = Axis::logarithmic(if component.unit.is_empty() {
                "ratio"
            } else {
                &component.unit
            });
            Panel { title: component.name(), x: x.clone(), y, curves, bands: Vec::new() }
        })
        .collect();
    let title = format!(
        "{}: 1-sigma at the end against {}",
        campaign.scenario,
        campaign.keys.join(" and ")
    );
    vec![Figure { name: "sweep".into(), title, columns: panels.len().clamp(1, 3), panels }]
}

/// Positions of a key's values on an axis: their numbers in the unit of the first one if all are of one
/// dimension, otherwise 1, 2, 3 and so on.
fn axis(key: &str, values: &[&str]) -> (Vec<f64>, Axis) {
    let split = |value: &str| {
        let value = value.trim_matches(['"', '\'']);
        let end = value
            .find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)))
            .unwrap_or(value.len());
        value[..end].parse::<f64>().ok().map(|number| (number, value[end..].trim().to_owned()))
    };
    let numbers: Option<Vec<(f64, String)>> = values.iter().map(|v| split(v)).collect();
    match numbers.and_then(in_unit_of_first) {
        Some((numbers, unit)) => {
            let label = if unit.is_empty() { key.to_owned() } else { format!("{key} [{unit}]") };
            let (low, high) =
                numbers.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), p| (l.min(*p), h.max(*p)));
            // the values span more than one decade
            let logarithmic = low > 0.0 && high / low > 10.0;
            (numbers, if logarithmic { Axis::logarithmic(label) } else { Axis::linear(label) })
        }
        _ => (
            (1..=values.len()).map(|k| k as f64).collect(),
            Axis::linear(format!("{key}: {}", values.join(", "))),
        ),
    }
}

/// The numbers in the unit of the first one, and that unit; `None` for units of several dimensions.
fn in_unit_of_first(values: Vec<(f64, String)>) -> Option<(Vec<f64>, String)> {
    let unit = values.first().map_or_else(String::new, |value| value.1.clone());
    if values.iter().all(|value| value.1 == unit) {
        return Some((values.into_iter().map(|value| value.0).collect(), unit));
    }
    let first = parse_unit(&unit).ok()?;
    let convert = |(value, own): (f64, String)| {
        let own = parse_unit(&own).ok().filter(|own| own.exponents() == first.exponents())?;
        Some(own.to_si(value) / first.to_si(1.0))
    };
    Some((values.into_iter().map(convert).collect::<Option<_>>()?, unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_figures::Scale;

    #[test]
    fn values_of_one_unit_share_an_axis_and_others_are_numbered() {
        let (places, x) = axis("latitude", &["0 deg", "30 deg", "60 deg"]);
        assert_eq!((places, x.label.as_str()), (vec![0.0, 30.0, 60.0], "latitude [deg]"));
        let (places, x) = axis("noise", &["1e-3", "0.1"]);
        assert_eq!((places, x.scale), (vec![0.001, 0.1], Scale::Logarithmic));
        let (places, x) = axis("noise", &["1 cm/s", "2 mm/s"]);
        assert_eq!((x.label.as_str(), x.scale), ("noise [cm/s]", Scale::Linear));
        assert!((places[0] - 1.0).abs() < 1e-12 && (places[1] - 0.2).abs() < 1e-12, "{places:?}");
        assert_eq!(axis("noise", &["1 cm/s", "2 mm"]).0, [1.0, 2.0]);
        assert_eq!(axis("mode", &["fixed", "estimate"]).0, [1.0, 2.0]);
    }
}
