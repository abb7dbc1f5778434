//! A folder with CSV files and a scenario that reads them.
// each test file uses a part; a failed test may panic
#![allow(dead_code, clippy::unwrap_used, clippy::panic)]

use navfuse_core::document::Document;
use navfuse_core::model::stream::Source;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use std::path::Path;
use tempfile::TempDir;

/// The filter that the scenarios compose; sensors and source follow.
const FILTER: &str = r#"
name = "test"
[process.ins]
attitude = { sigma = "1 deg", initial = "0 deg" }
velocity = { sigma = "1 cm/s", initial = "0 m/s" }
position = { sigma = "1 m", latitude = "32 deg", longitude = "34 deg", height = "0 m" }
"#;
pub const IMU: &str =
    "[sensor.imu]\ngyro_noise = \"0.1 deg/h/sqrt(Hz)\"\naccel_noise = \"10 ug/sqrt(Hz)\"\n";
pub const DVL: &str = "[sensor.dvl]\nnoise = \"2 cm/s\"\n";
pub const DEPTH: &str = "[sensor.depth]\nnoise = \"5 cm\"\n";
pub const REFERENCE: &str = "[sensor.reference]\n";

pub const IMU_HEADER: &str =
    "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
pub const DVL_HEADER: &str = "time_s,vel_x_mps,vel_y_mps,vel_z_mps\n";

/// A folder with the given files.
pub fn folder<T: AsRef<[u8]>>(files: &[(&str, T)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    folder
}

/// Assembles a scenario of these sensors and this source table in a folder. Errors omit the path of
/// the folder.
pub fn assemble(
    folder: &Path,
    sensors: &str,
    source: &str,
    output: bool,
) -> Result<Assembly, String> {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_csv::CsvPlugin);
    let name = folder.join("test.toml").display().to_string();
    let document = Document::parse(name, format!("{FILTER}{sensors}{source}")).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    scenario.assemble(output.then_some(folder)).map_err(|e| without(folder, &e.to_string()))
}

fn without(folder: &Path, text: &str) -> String {
    text.replace(&format!("{}/", folder.display()), "").replace(&folder.display().to_string(), "")
}

/// Everything that a stream gives: its samples, then its error or its warning.
#[derive(Debug)]
pub struct Read {
    pub samples: Vec<Sample>,
    pub error: Option<String>,
    pub warning: Option<String>,
    pub end: Option<Time>,
}

impl Read {
    pub fn nanos(&self) -> Vec<i64> {
        self.samples.iter().map(|s| s.time.nanos()).collect()
    }

    /// The channels of a sample that are there.
    pub fn values(&self, k: usize) -> Vec<Option<f64>> {
        (0..usize::try_from(16 - self.samples[k].present().leading_zeros()).unwrap())
            .map(|c| self.samples[k].get(c))
            .collect()
    }
}

/// Reads a stream to its end.
pub fn drain(folder: &Path, source: &mut dyn Source) -> Read {
    let mut read = Read { samples: Vec::new(), error: None, warning: None, end: source.end() };
    let mut sample = Sample::empty(Time::MIN, navfuse_core::units::sample::SensorId(0));
    loop {
        match source.next(&mut sample) {
            Ok(true) => read.samples.push(sample),
            Ok(false) => break,
            Err(e) => {
                read.error = Some(without(folder, &e.to_string()));
                break;
            }
        }
    }
    read.warning = source.warning().map(|w| without(folder, &w));
    read
}

/// Reads one sensor's file; `keys` are those of `[source.csv.files.SENSOR]`.
pub fn read_as(sensor: &str, toml: &str, file: &[u8], keys: &str) -> Result<Read, String> {
    let name = format!("{sensor}.csv");
    let folder = folder(&[(name.as_str(), file)]);
    let source = format!("[source.csv.files.{sensor}]\n{keys}\n");
    let mut assembly = assemble(folder.path(), toml, &source, false)?;
    Ok(drain(folder.path(), assembly.sources[0].1.as_mut()))
}

/// Reads dvl.csv.
pub fn read_dvl(file: impl AsRef<[u8]>, keys: &str) -> Result<Read, String> {
    read_aid("dvl", DVL, file, keys)
}

/// Reads the file of a measuring sensor.
pub fn read_aid(
    sensor: &str,
    toml: &str,
    file: impl AsRef<[u8]>,
    keys: &str,
) -> Result<Read, String> {
    // a driving sensor needs a file, so it has one and is first
    let name = format!("{sensor}.csv");
    let folder = folder(&[(name.as_str(), file.as_ref()), ("imu.csv", IMU_HEADER.as_bytes())]);
    let source = format!("[source.csv.files.{sensor}]\n{keys}\n");
    let mut assembly = assemble(folder.path(), &[IMU, toml].concat(), &source, false)?;
    Ok(drain(folder.path(), assembly.sources[1].1.as_mut()))
}
