//! A sensor that a script could define, with channels and keys that are known at run time only,
//! conforms as one with types does.
#![allow(missing_docs, reason = "a test")]

use navfuse_conformance::{Failed, check};
use navfuse_core::prelude::*;
use schemars::json_schema;

const SCENARIO: &str = r#"
    [process.ins]
    attitude = { sigma = "0.1 deg" }
    velocity = { sigma = "1 cm/s" }
    position = { sigma = "1 m" }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "10 ug/sqrt(Hz)"
    simulation = { rate = "20 Hz" }

    [sensor.baro]
    sigmas = ["50 cm", "0.8 m", "20 cm"]
    simulation = { rate = "1 Hz" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    segments = [{ type = "surge", duration = "60 s", speed = "1 m/s" }]
"#;

/// Heights, as many as the table has sigmas.
struct Heights {
    position: AnyHandle,
    sigmas: Vec<f64>,
}

impl DynamicModel for Heights {
    fn predict(&self, x: &View<'_, f64>, z: &mut [f64]) {
        let mut position = [0.0; 3];
        x.read(self.position, &mut position);
        z.fill(position[2]);
    }
    fn noise(&self, _: &View<'_, f64>, r: &mut [f64]) {
        let n = self.sigmas.len();
        self.sigmas.iter().enumerate().for_each(|(k, sigma)| r[k * n + k] = sigma * sigma);
    }
}

struct Script;

impl Plugin for Script {
    fn build(&self, registry: &mut Registry) {
        let schema = json_schema!({
            "type": "object",
            "description": "Heights of several barometers",
            "properties": { "sigmas": {
                "type": "array", "items": { "type": "string" }, "description": "Sigmas with a unit of length"
            } }
        });
        registry.sensor_dyn("baro", schema, |table, composer| {
            let given = table.get("sigmas").and_then(|list| list.as_array());
            let given = given.into_iter().flatten().filter_map(|sigma| sigma.as_str());
            let sigmas: Vec<f64> =
                given.filter_map(|sigma| Some(sigma.parse::<Length>().ok()?.si())).collect();
            let position = composer.find_any("position", "ins.position")?;
            let channels = (1..=sigmas.len()).map(|k| Channel::new(format!("h{k}"), "m"));
            let (n, channels) = (sigmas.len(), channels.collect());
            Ok((channels, Role::dynamic(n, Heights { position, sigmas })))
        });
    }
}

#[test]
fn a_sensor_that_is_known_at_run_time_only_conforms() -> Result<(), Failed> {
    check(&[&Script], SCENARIO)
}
