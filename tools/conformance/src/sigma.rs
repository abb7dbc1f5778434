//! Size of the noise: `R` grows with the square of the sigmas in the sensor's table.

use crate::lab::{Lab, Moment, Part};
use crate::{Failure, Report};
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::At;
use navfuse_core::plugin::Kind;

/// Largest relative error of a ratio of variances: rounding of units, and of differences of `R`.
const BOUND: f64 = 1e-6;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for (part, _) in lab.models() {
        let outcome = of_sensor(lab, &part);
        if !matches!(&outcome, Ok(None)) {
            report.add("sigma", part.about, outcome.map(Option::unwrap_or_default));
        }
    }
}

/// Compares `R` with that of sigmas twice as large; `None` if the table has no sigma that `R`
/// depends on.
fn of_sensor(lab: &Lab<'_>, part: &Part) -> Result<Option<String>, Failure> {
    let info = &lab.composition.sensors[part.index].info;
    let moments = lab.moments_of(part.index, &lab.composition.layout);
    let variances = |settings: &[String]| -> Result<Vec<f64>, Failure> {
        Ok(of_moments(&lab.compose(settings)?, part.index, &moments))
    };
    let (plain, mut keys, mut all) = (variances(&[])?, Vec::new(), Vec::new());
    for key in sigmas(lab, &info.kind) {
        let [Some(double), Some(triple)] = [2.0, 3.0].map(|by| times(lab, &info.name, &key, by))
        else {
            continue; // the scenario leaves it at its default
        };
        let (twice, thrice) = (variances(std::slice::from_ref(&double))?, variances(&[triple])?);
        let mut depends = false;
        for ((one, two), three) in plain.iter().zip(&twice).zip(&thrice) {
            // R = A + B s^2, so that (R(3 s) - R(s)) / (R(2 s) - R(s)) = 8 / 3
            let (first, second) = (two - one, three - one);
            if first.abs() <= BOUND * one.abs().max(f64::MIN_POSITIVE) {
                continue;
            }
            depends = true;
            let ratio = second / first;
            if (ratio * 3.0 / 8.0 - 1.0).abs() > BOUND {
                return Err(Failure::new(format!(
                    "a variance of R changes from {one:.6e} to {two:.6e} with twice the {key}, and \
                     to {three:.6e} with three times; R holds variances, so square {key} once"
                )));
            }
        }
        if depends {
            keys.push(key);
            all.push(double);
        }
    }
    if keys.is_empty() {
        return Ok(None);
    }
    let doubled = variances(&all)?;
    let wrong = plain.iter().zip(&doubled).find(|(one, two)| {
        two.abs() > 0.0 && (*two / (4.0 * *one) - 1.0).abs() > BOUND && differs(**one, **two)
    });
    let names = keys.join(", ");
    match wrong {
        None => Ok(Some(format!("R is four times as large with twice the {names}"))),
        Some((one, two)) => Err(Failure::new(format!(
            "a variance of R changes from {one:.6e} to {two:.6e} with twice the {names}, which is \
             {:.3} times and not 4; give the rest of the noise a key of its own",
            two / one
        ))),
    }
}

/// Tests whether a variance depends on the sigmas at all: that of a channel may come from the
/// sample.
fn differs(one: f64, two: f64) -> bool {
    (two - one).abs() > BOUND * one.abs()
}

/// Diagonals of `R` at all moments, one after the other.
fn of_moments(composition: &Composition, sensor: usize, moments: &[Moment]) -> Vec<f64> {
    let Role::Measurement(model) = &composition.sensors[sensor].role else { return Vec::new() };
    let n = model.channels();
    let mut r = vec![0.0; n * n];
    let of_moment = |Moment { state, sample }: &Moment| {
        model.noise(&At { layout: &composition.layout, state, sample }, &mut r);
        let present = (0..n).filter(|&i| sample.get(i).is_some());
        present.map(|i| r[i * n + i]).collect::<Vec<_>>()
    };
    moments.iter().flat_map(of_moment).collect()
}

/// Keys of a sensor type that are a standard deviation: a quantity that is zero at least.
fn sigmas(lab: &Lab<'_>, kind: &str) -> Vec<String> {
    let Some(entry) = lab.types.registry.get(Kind::Sensor, kind) else { return Vec::new() };
    let schema = entry.schema.as_value();
    let properties = schema.get("properties").and_then(|p| p.as_object());
    let is_sigma = |key: &String| {
        let property = &schema["properties"][key];
        let variants = property.get("anyOf").and_then(|v| v.as_array()).into_iter().flatten();
        variants.chain([property]).any(|schema| {
            schema.get("examples").is_some()
                && schema.get("minimum").and_then(|v| v.as_f64()) == Some(0.0)
        })
    };
    properties.into_iter().flatten().map(|(key, _)| key.clone()).filter(is_sigma).collect()
}

/// Setting that multiplies a quantity of a sensor's table; `None` where the table does not have it.
fn times(lab: &Lab<'_>, sensor: &str, key: &str, factor: f64) -> Option<String> {
    let document = Document::parse("scenario", lab.text).ok()?;
    let node = document.root().get("sensor")?.get(sensor)?.get(key)?;
    let scaled = |text: &str| -> Option<String> {
        let text = text.trim();
        let unit = text.find(|c: char| c.is_whitespace() || c == '%').unwrap_or(text.len());
        let number: f64 = text[..unit].parse().ok()?;
        Some(format!("{:e}{}", number * factor, &text[unit..]))
    };
    let (value, sensor) = (node.value(), navfuse_core::document::key(sensor));
    if let Some(text) = value.as_str() {
        return Some(format!("sensor.{sensor}.{key}={}", scaled(text)?));
    }
    if let Some(number) = value.as_float().or(value.as_integer().map(|n| n as f64)) {
        return Some(format!("sensor.{sensor}.{key}={:e}", number * factor));
    }
    let axes = value.as_array()?.iter().map(|axis| scaled(axis.as_str()?));
    let axes: Option<Vec<String>> = axes.map(|axis| Some(format!("\"{}\"", axis?))).collect();
    Some(format!("sensor.{sensor}.{key}=[{}]", axes?.join(", ")))
}
