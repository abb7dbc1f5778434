//! Noise of another size than the scenario states, or with memory.

use crate::patch::{Patch, path};
use crate::scene::{Instrument, Scene};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::plugin::Kind;
use navfuse_core::run::schema::parameters;

/// Factors on the stated noise.
const FACTORS: [f64; 5] = [0.3, 2.0, 3.0, 6.0, 20.0];

/// The sensor with its noise multiplied, and, for one that measures, with noise that follows the
/// innovations or has memory.
pub(super) fn larger(scene: &Scene<'_>, sensor: &Instrument) -> Vec<Patch> {
    let name = sensor.info.name.as_str();
    let mut all: Vec<Patch> =
        FACTORS.iter().filter_map(|factor| multiplied(scene, sensor, *factor)).collect();
    if sensor.info.purpose == Purpose::Measurement {
        let setting = format!("{}=true", path(Kind::Sensor, name, "adaptive_noise"));
        all.push(Patch::new(format!("{name}: noise follows the innovations"), vec![setting]));
        all.extend(correlated(sensor));
    }
    all
}

/// The sensor with its noise multiplied; `None` if its table states none.
pub(crate) fn multiplied(scene: &Scene<'_>, sensor: &Instrument, factor: f64) -> Option<Patch> {
    let name = sensor.info.name.as_str();
    let table = scene.document.root().get(Kind::Sensor.table())?.get(name)?;
    let entry = scene.registry.get(Kind::Sensor, &sensor.info.kind)?;
    let keys = parameters(entry).into_iter().map(|p| p.key).filter(|k| k.ends_with("noise"));
    let mut settings: Vec<String> = keys
        .filter_map(|key| {
            let value = times(table.get(&key)?.value(), factor)?;
            Some(format!("{}={value}", path(Kind::Sensor, name, &key)))
        })
        .collect();
    let reported = sensor.info.channels.iter().position(|c| c.name.ends_with("_acc"));
    let reports = |k: usize| scene.recording.of(name).any(|sample| sample.get(k).is_some());
    if reported.is_some_and(reports) {
        settings.push(format!("{}={factor}", path(Kind::Sensor, name, "accuracy_factor")));
    }
    // the simulated noise is a multiple of the stated one, and the change is not about the former
    if let Some(simulation) = table.get("simulation").filter(|_| !settings.is_empty()) {
        let noise = simulation.get("noise").and_then(|noise| times(noise.value(), 1.0 / factor));
        let noise = noise.unwrap_or_else(|| format!("{:?}", 1.0 / factor));
        settings.push(format!("{}={noise}", path(Kind::Sensor, name, "simulation.noise")));
    }
    (!settings.is_empty()).then(|| Patch {
        parameters: 1,
        noise: Some((name.to_owned(), factor)),
        ..Patch::new(format!("{name}: noise times {factor}"), settings)
    })
}

/// A quantity times a factor, as TOML.
fn times(value: &toml::Value, factor: f64) -> Option<String> {
    match value {
        toml::Value::String(text) => {
            let end = text.find(|c: char| !(c.is_ascii_digit() || ".+-eE".contains(c)))?;
            let number: f64 = text[..end].trim().parse().ok()?;
            let product: f64 = format!("{:.5e}", number * factor).parse().ok()?;
            Some(format!("\"{product}{}\"", &text[end..]))
        }
        toml::Value::Float(number) => Some(format!("{:?}", number * factor)),
        toml::Value::Integer(number) => Some(format!("{:?}", *number as f64 * factor)),
        toml::Value::Array(items) => {
            let items: Option<Vec<String>> = items.iter().map(|item| times(item, factor)).collect();
            Some(format!("[{}]", items?.join(", ")))
        }
        _ => None,
    }
}

/// A time-correlated error in the channels of one unit.
fn correlated(sensor: &Instrument) -> Option<Patch> {
    let name = sensor.info.name.as_str();
    let sigma = match sensor.info.channels.first()?.unit.suffix().as_str() {
        "m" => "1 m",
        "mps" => "5 cm/s",
        "rad" if sensor.info.channels.len() == 1 => "2 deg",
        _ => return None,
    };
    let value = format!("{{ sigma = \"{sigma}\", correlation_time = \"60 s\" }}");
    let setting = format!("{}={value}", path(Kind::Sensor, name, "correlated_error"));
    let text = format!("{name}: error of {sigma} with a memory of 60 s");
    Some(Patch { parameters: 1, ..Patch::new(text, vec![setting]) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_multiplied_in_their_unit() {
        let text = |text: &str| toml::Value::String(text.to_owned());
        assert_eq!(times(&text("3 mm"), 3.0).as_deref(), Some("\"9 mm\""));
        assert_eq!(
            times(&text("0.2 deg/h/sqrt(Hz)"), 2.0).as_deref(),
            Some("\"0.4 deg/h/sqrt(Hz)\"")
        );
        let both = toml::Value::Array(vec![text("1e-2 m"), toml::Value::Integer(2)]);
        assert_eq!(times(&both, 0.5).as_deref(), Some("[\"0.005 m\", 1.0]"));
        assert_eq!(times(&toml::Value::Boolean(true), 2.0), None);
    }
}
