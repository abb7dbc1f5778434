//! Reading of recordings by the sources of a scenario.

use navfuse_core::document::Document;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::Source;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::path::Path;

/// A filter with an IMU; further sensors and the source follow.
pub const INERTIAL: &str = r#"
name = "test"
[process.ins]
attitude = { sigma = "1 deg", initial = "0 deg" }
velocity = { sigma = "1 cm/s", initial = "0 m/s" }
position = { sigma = "1 m", latitude = "32 deg", longitude = "34 deg", height = "0 m" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
"#;

/// Sensors that most recordings fill: GNSS, heading, depth and a reference.
pub const AIDS: &str = r#"
[sensor.gnss]
horizontal_noise = "2 m"
vertical_noise = "3 m"
velocity_noise = "10 cm/s"
[sensor.compass]
type = "dual-antenna"
noise = "0.5 deg"
[sensor.depth]
noise = "10 cm"
[sensor.reference]
"#;

/// The samples of each source, its warning, and the sensors of the scenario.
#[derive(Debug)]
pub struct Reading {
    pub samples: Vec<Vec<Sample>>,
    pub warnings: Vec<Option<String>>,
    pub sensors: Vec<SensorInfo>,
}

/// The sources of a scenario.
type Sources = Vec<Box<dyn Source>>;

/// Opens the sources of a scenario in a folder. Errors omit the path of the folder.
pub fn open(
    registry: &Registry,
    folder: &Path,
    text: &str,
) -> Result<(Sources, Vec<SensorInfo>), String> {
    let document = Document::parse(folder.join("test.toml").display().to_string(), text).unwrap();
    let short = |text: String| text.replace(&format!("{}/", folder.display()), "");
    let scenario = Scenario::new(registry, document, &[]).map_err(|e| short(e.to_string()))?;
    let assembly = scenario.assemble(None).map_err(|e| short(e.to_string()))?;
    let sensors = assembly.composition.sensors.iter().map(|s| s.info.clone()).collect();
    Ok((assembly.sources.into_iter().map(|(_, source)| source).collect(), sensors))
}

/// Reads the sources of a scenario in a folder to their ends. Errors and warnings omit the path of
/// the folder.
pub fn read(registry: &Registry, folder: &Path, text: &str) -> Result<Reading, String> {
    let (sources, sensors) = open(registry, folder, text)?;
    let short = |text: String| text.replace(&format!("{}/", folder.display()), "");
    let mut reading = Reading { samples: Vec::new(), warnings: Vec::new(), sensors };
    for mut source in sources {
        let (mut samples, mut sample) = (Vec::new(), Sample::empty(Time::MIN, SensorId(0)));
        while source.next(&mut sample).map_err(|e| short(e.to_string()))? {
            samples.push(sample);
        }
        reading.samples.push(samples);
        reading.warnings.push(source.warning().map(short));
    }
    Ok(reading)
}

impl Reading {
    /// The name of the sensor and the values of the channels of each sample of a source.
    pub fn rows(&self, source: usize) -> impl Iterator<Item = (&Sample, &str, Values)> {
        self.samples[source].iter().map(|sample| {
            let info = &self.sensors[sample.sensor.0];
            let values = info.channels.iter().enumerate();
            let values = values.filter_map(|(k, c)| Some((c.name.to_string(), sample.get(k)?)));
            (sample, info.name.as_str(), values.collect())
        })
    }
}

/// Values by the names of their channels.
pub type Values = std::collections::BTreeMap<String, f64>;
