//! Tests of the source: against bags that another program wrote, damaged bags, clocks and errors.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::expect_used,
    reason = "a test fails by panicking"
)]

mod damage;
mod import;
mod oracle;
mod recorder;
mod scenario;
mod speed;

use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_ros2::Ros2Plugin;
use std::collections::BTreeMap;
use std::path::Path;

const FILTER: &str = r#"
name = "test"
[process.ins]
attitude = { sigma = "1 deg", initial = "0 deg" }
velocity = { sigma = "1 cm/s", initial = "0 m/s" }
position = { sigma = "1 m", latitude = "54 deg", longitude = "10 deg", height = "0 m" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
"#;

/// The samples of each sensor: time in ns, and values by channel.
type Rows = BTreeMap<String, Vec<Row>>;
/// A sample.
type Row = (i64, BTreeMap<String, f64>);

/// The samples of a bag by sensor, with the values of their channels, and the source's warning.
#[derive(Debug, PartialEq)]
struct Read {
    samples: Rows,
    /// The sensors in the order of the samples.
    order: Vec<(i64, String)>,
    warning: Option<String>,
}

impl Read {
    fn count(&self, sensor: &str) -> usize {
        self.samples.get(sensor).map_or(0, Vec::len)
    }

    fn warning(&self) -> &str {
        self.warning.as_deref().unwrap_or_default()
    }
}

fn registry() -> Registry {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_heading::HeadingPlugin)
        .add(&navfuse_odometer::OdometerPlugin)
        .add(&Ros2Plugin);
    registry
}

/// Reads a bag in a folder with the keys of its source. Errors omit the path of the folder.
fn read(folder: &Path, sensors: &str, keys: &str) -> Result<Read, String> {
    let without = |text: String| text.replace(&format!("{}/", folder.display()), "");
    let text = format!("{FILTER}{sensors}[source.ros2]\n{keys}\n");
    let name = folder.join("test.toml").display().to_string();
    let registry = registry();
    let document = Document::parse(name, text).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).map_err(|e| without(e.to_string()))?;
    let mut assembly = scenario.assemble(None).map_err(|e| without(e.to_string()))?;
    let infos: Vec<_> = assembly.composition.sensors.iter().map(|s| s.info.clone()).collect();
    let source = &mut assembly.sources[0].1;
    let (mut samples, mut order) = (BTreeMap::<String, Vec<_>>::new(), Vec::new());
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    while source.next(&mut sample).map_err(|e| without(e.to_string()))? {
        let info = &infos[sample.sensor.0];
        let values = info.channels.iter().enumerate();
        let values = values.filter_map(|(k, c)| Some((c.name.to_owned(), sample.get(k)?)));
        let time = sample.time.nanos();
        samples.entry(info.name.clone()).or_default().push((time, values.collect()));
        order.push((time, info.name.clone()));
    }
    Ok(Read { samples, order, warning: source.warning().map(without) })
}
