//! A sensor whose name, keys and channels are known at run time only, as a script defines it: it
//! corrects the filter as a sensor with types does.

use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::lab::{self, Bench, Lab, SCENARIO};
use schemars::json_schema;
use std::f64::consts::{PI, TAU};

const SIGMAS: [f64; 2] = [0.02, 0.05];
const OFFSET: f64 = 30.0;

/// Range and bearing from a mark beside the line, with correlated noise.
fn noise() -> [f64; 4] {
    let [a, b] = SIGMAS;
    [a * a, 0.3 * a * b, 0.3 * a * b, b * b]
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

struct Typed(Handle<Scalar>);

impl MeasurementModel<2> for Typed {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let (place, offset) = (x.get(self.0), convert::<f64, T>(OFFSET));
        SVector::from([(place * place + offset * offset).sqrt(), place.atan2(-offset)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::from_row_slice(&noise())
    }
    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        if channel == 1 { wrapped(measured - predicted) } else { measured - predicted }
    }
}

struct Scripted(AnyHandle);

impl DynamicModel for Scripted {
    fn predict(&self, x: &View<'_, f64>, z: &mut [f64]) {
        let mut place = [0.0];
        x.read(self.0, &mut place);
        z.copy_from_slice(&[place[0].hypot(OFFSET), place[0].atan2(-OFFSET)]);
    }
    fn noise(&self, _: &View<'_, f64>, r: &mut [f64]) {
        r.copy_from_slice(&noise());
    }
    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        if channel == 1 { wrapped(measured - predicted) } else { measured - predicted }
    }
}

/// Registers the same sensor twice: `typed` and `scripted`; the key `unit` replaces that of the
/// range.
fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.add(&Lab);
    for typed in [true, false] {
        let schema = json_schema!({ "type": "object", "properties": { "unit": {} } });
        let name = if typed { "typed" } else { "scripted" };
        registry.sensor_dyn(name, schema, move |table, composer| {
            let unit = table.get("unit").and_then(|unit| unit.as_str()).unwrap_or("m");
            let channels = vec![Channel::new("range", unit), Channel::new("bearing", "rad")];
            let role = if typed {
                Role::measurement(Typed(composer.find("place", "cart.place")?))
            } else {
                Role::dynamic(2, Scripted(composer.find_any("place", "cart.place")?))
            };
            Ok((channels, role))
        });
    }
    registry
}

fn compose(table: &str) -> Result<Ekf, String> {
    let document = Document::parse("mark.toml", format!("{SCENARIO}{table}\n")).unwrap();
    let registry = registry();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    scenario.compose().map(Ekf::new).map_err(|e| e.to_string())
}

/// The central differences are exact to 1e-10, relative; the bearing begins at half a turn, where it
/// wraps, and some samples lack a channel.
#[test]
fn it_corrects_as_a_sensor_with_types_does() {
    let run = |kind: &str| {
        let mut b =
            Bench { ekf: compose(&format!("[sensor.{kind}]")).unwrap(), log: lab::Log::default() };
        let id = SensorId(b.ekf.composition().sensor(kind).unwrap());
        let mut found = Vec::new();
        for k in 0..200 {
            let t = f64::from(k);
            let place = 0.2 * t;
            b.give("speed", t, &[0.2]);
            let bearing = wrapped(place.atan2(-OFFSET) + 0.04 * (1.7 * t).sin());
            let mut sample =
                Sample::new(lab::seconds(t), id, &[place.hypot(OFFSET) + 0.01, bearing]);
            if k % 3 == 1 {
                sample.clear(k as usize % 2);
            }
            b.ekf.process(&sample, &mut b.log).unwrap();
            found.extend([b.value("cart.place"), b.variance("cart.place").sqrt()]);
        }
        assert!(b.log.outcomes().len() == 200 && found[398].is_finite());
        found
    };
    let (typed, scripted) = (run("typed"), run("scripted"));
    assert!((typed[398] - 39.8).abs() < 0.1 && typed[399] < 0.1, "it measures the place");
    for (a, b) in typed.iter().zip(&scripted) {
        assert!((a - b).abs() <= 1e-6 * a.abs().max(1.0), "{a} {b}");
    }
}

#[test]
fn a_key_that_its_schema_lacks_is_refused_with_place_and_remedy() {
    let text = compose("[sensor.scripted]\nunits = 1").err().unwrap();
    assert!(text.contains("mark.toml:") && text.contains("sensor.scripted.units"), "{text}");
    assert!(text.contains("did you mean \"unit\""), "{text}");
}

/// The unit stands in the code of the type; the message names the table that has the type.
#[test]
fn a_channel_whose_unit_is_unknown_or_not_si_is_refused_at_composition() {
    let refused = |unit: &str| {
        let text = compose(&format!("[sensor.scripted]\nunit = \"{unit}\"")).err().unwrap();
        assert!(text.contains("mark.toml:") && text.contains("channel range"), "{text}");
        text
    };
    assert!(refused("metre").contains("unknown unit 'metre'"));
    assert!(refused("radps3").contains("did you mean 'rad'?"));
    assert!(refused("cm").contains("'cm' is not SI") && refused("cm").contains("declare 'm'"));
    assert!(compose("[sensor.scripted]\nunit = \"m\"").is_ok());
}
