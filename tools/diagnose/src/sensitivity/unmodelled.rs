//! What a scenario does not model, with its usual size.

use crate::patch::path;
use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::plugin::Kind;
use navfuse_core::state::{Block, Layout};

/// A velocity bias of a Doppler instrument, such as one of its usual sizes, 0.2 % of 5 m/s.
const BIAS: &str = "1 cm/s";
/// Angle of the axes of an IMU.
const AXES: &str = "10 arcsec";
/// Gravity of a deflection of the vertical of 10 arcsec.
const DEFLECTION: &str = "47.5 ug";
/// Error of a lever arm, m.
const LEVER_ARM: f64 = 0.02;
/// One metre a second in the speed of sound, as a share of it.
const SOUND: f64 = 1.0 / 1500.0;

/// Something that a scenario does not model.
pub(super) struct Thing {
    /// What it is, with its size.
    pub text: String,
    /// The setting of each axis that puts it into the model.
    pub axes: Vec<String>,
}

/// Everything of usual size that a scenario does not model.
pub(super) fn things(document: &Document, composition: &Composition) -> Vec<Thing> {
    let scenario = Unmodelled { document, layout: &composition.layout };
    let sensors = composition.sensors.iter().map(|sensor| &sensor.info);
    let gravity = composition.processes.iter().filter(|p| p.kind == "ins").map(|process| {
        let text = format!("{}: deflection 10 arcsec", process.name);
        let path = path(Kind::Process, &process.name, "gravity_disturbance");
        Thing { text, axes: scenario.absent(&process.name, &path, DEFLECTION, 2) }
    });
    let things = sensors.flat_map(|sensor| scenario.of(sensor)).chain(gravity);
    things.filter(|thing| !thing.axes.is_empty()).collect()
}

/// A scenario that is looked at.
struct Unmodelled<'a> {
    document: &'a Document,
    layout: &'a Layout,
}

impl Unmodelled<'_> {
    /// What is not modelled of a sensor.
    fn of(&self, sensor: &SensorInfo) -> Vec<Thing> {
        let name = &sensor.name;
        let thing = |what: &str, axes: Vec<String>| Thing { text: format!("{name}: {what}"), axes };
        let key = |key: &str| path(Kind::Sensor, name, key);
        let mut things = Vec::new();
        match sensor.kind.as_str() {
            "imu" => {
                let axes = ["gyro_misalignment", "gyro_axes", "accel_axes"];
                let axes = axes.iter().flat_map(|k| self.absent(name, &key(k), AXES, 3));
                things.push(thing(&format!("axes {AXES}"), axes.collect()));
            }
            kind @ ("dvl" | "dvl-beams" | "laser-doppler") => {
                let bias = self.absent(name, &key("bias"), BIAS, 3);
                things.push(thing(&format!("bias {BIAS}"), bias));
                if kind != "laser-doppler" {
                    let sound = self.changed(name, "scale", |k, _| k * (1.0 - SOUND), "");
                    things.push(thing("speed of sound 1 m/s", sound));
                }
            }
            _ => {}
        }
        if sensor.purpose == Purpose::Measurement {
            let arm =
                self.changed(name, "lever_arm", |x, own| if own { x - LEVER_ARM } else { x }, " m");
            things.push(thing("lever arm 2 cm", arm));
        }
        things
    }

    /// The settings that give a key which is absent a value of the other sign on one axis at a time.
    fn absent(&self, owner: &str, path: &str, size: &str, axes: usize) -> Vec<String> {
        let key = path.rsplit('.').next().unwrap_or(path);
        if self.layout.find(&format!("{owner}.{key}")).is_some() {
            return Vec::new();
        }
        let zero = format!("0{}", &size[size.find(' ').unwrap_or(size.len())..]);
        let less = format!("-{size}");
        let value = |axis: usize| {
            let components = (0..3).map(|k| if k == axis { &less } else { &zero });
            format!("{path}={:?}", components.collect::<Vec<_>>())
        };
        (0..axes).map(value).collect()
    }

    /// The settings that change each component of a state with a fixed value; `change` knows whether
    /// a component is the one that changes.
    fn changed(
        &self,
        owner: &str,
        key: &str,
        change: impl Fn(f64, bool) -> f64,
        unit: &str,
    ) -> Vec<String> {
        let fixed = |block: &&Block| block.tangent.is_none();
        let Some(block) = self.layout.find(&format!("{owner}.{key}")).filter(fixed) else {
            return Vec::new();
        };
        let path = path(Kind::Sensor, owner, key);
        let place = self.document.root().get("sensor").and_then(|t| t.get(owner)?.get(key));
        let inside = place.is_some_and(|node| node.value().is_table());
        let path = if inside { format!("{path}.initial") } else { path };
        let values = &block.spec.initial;
        let value = |axis: usize| {
            let components = values.iter().enumerate();
            let all: Vec<String> = components
                .map(|(k, x)| format!("{:e}", change(*x, k == axis)))
                .map(|x| if unit.is_empty() { x } else { format!("\"{x}{unit}\"") })
                .collect();
            match &all[..] {
                [one] => format!("{path}={one}"),
                _ => format!("{path}=[{}]", all.join(", ")),
            }
        };
        (0..values.len()).map(value).collect()
    }
}
