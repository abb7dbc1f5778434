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
mod relative;
mod scenario;
mod speed;

use navfuse_core::plugin::Registry;
use navfuse_ros2::Ros2Plugin;
use navfuse_testing::recording::{self, INERTIAL, Values};
use std::collections::BTreeMap;
use std::path::Path;

/// The samples of each sensor: time in ns, and values by channel.
type Rows = BTreeMap<String, Vec<Row>>;
/// A sample.
type Row = (i64, Values);

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
        .add(&navfuse_relative_pose::RelativePosePlugin)
        .add(&Ros2Plugin);
    registry
}

/// Reads a bag in a folder with the keys of its source. Errors omit the path of the folder.
fn read(folder: &Path, sensors: &str, keys: &str) -> Result<Read, String> {
    let text = format!("{INERTIAL}{sensors}[source.ros2]\n{keys}\n");
    let mut reading = recording::read(&registry(), folder, &text)?;
    let (mut samples, mut order) = (Rows::new(), Vec::new());
    for (sample, sensor, values) in reading.rows(0) {
        let time = sample.time.nanos();
        samples.entry(sensor.to_owned()).or_default().push((time, values));
        order.push((time, sensor.to_owned()));
    }
    Ok(Read { samples, order, warning: reading.warnings.remove(0) })
}
