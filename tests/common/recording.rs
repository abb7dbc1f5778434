//! A small recording of a vehicle at rest, which the tests of bad input damage.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Latitude of the vehicle, deg.
const LATITUDE: f64 = 30.0;

/// A folder with `imu.csv`, `dvl.csv`, `reference.csv` and the scenario `rest.toml`.
pub struct Recording {
    folder: tempfile::TempDir,
}

impl Recording {
    /// Twenty seconds at rest: IMU at 100 Hz, DVL and reference at 1 Hz.
    pub fn new() -> Self {
        let recording = Self { folder: tempfile::tempdir().expect("a folder for the test") };
        let earth = 7.292_115e-5;
        let (sin, cos) = LATITUDE.to_radians().sin_cos();
        let mut imu =
            "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n"
                .to_owned();
        for k in 1..=2000 {
            // an instrument never repeats itself: noise within +-1, whose mean square is 1/3, about
            // half of the stated noise of one sample (1 deg/h and 1 mm/s^2)
            let noise = |axis: i32| f64::from(k * 7919 * axis % 2003) / 1001.0 - 1.0;
            let [gyro, accel] = [5e-6, 1e-3];
            let _ = writeln!(
                imu,
                "{:.2},{:e},{:e},{:e},{:e},{:e},{:e}",
                f64::from(k) * 0.01,
                earth * cos + gyro * noise(1),
                gyro * noise(2),
                -earth * sin + gyro * noise(3),
                accel * noise(4),
                accel * noise(5),
                -9.7932 + accel * noise(6)
            );
        }
        let mut dvl = "time_s,vel_x_mps,vel_y_mps,vel_z_mps\n".to_owned();
        let heading = "time_s,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps,\
                       roll_deg,pitch_deg,yaw_deg\n";
        let mut reference = heading.to_owned();
        for k in 1..=20 {
            let _ = writeln!(dvl, "{k}.0,0.001,-0.002,0.001");
            let _ = writeln!(reference, "{k}.0,{LATITUDE},5.0,0.0,0,0,0,0,0,0");
        }
        recording.write("imu.csv", &imu);
        recording.write("dvl.csv", &dvl);
        recording.write("reference.csv", &reference);
        recording.write("rest.toml", SCENARIO);
        recording
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).expect("the test can write");
    }

    /// Replaces a line, from 1, of a file.
    pub fn replace_line(&self, name: &str, line: usize, with: &str) {
        let text = std::fs::read_to_string(self.path(name)).expect("it is there");
        let lines: Vec<&str> =
            text.lines().enumerate().map(|(k, l)| if k + 1 == line { with } else { l }).collect();
        self.write(name, &(lines.join("\n") + "\n"));
    }

    /// Removes lines, from 1, of a file.
    pub fn remove_lines(&self, name: &str, lines: std::ops::RangeInclusive<usize>) {
        let text = std::fs::read_to_string(self.path(name)).expect("it is there");
        let kept: Vec<&str> = text
            .lines()
            .enumerate()
            .filter(|(k, _)| !lines.contains(&(k + 1)))
            .map(|(_, l)| l)
            .collect();
        self.write(name, &(kept.join("\n") + "\n"));
    }

    /// Replaces a text in the scenario.
    pub fn change(&self, from: &str, to: &str) {
        assert!(SCENARIO.contains(from), "the scenario has no {from}");
        self.write("rest.toml", &SCENARIO.replace(from, to));
    }
}

const SCENARIO: &str = r#"[process.ins]
attitude = { sigma = "0.1 deg" }
velocity = { sigma = "1 cm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "100 ug" }

[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"

[sensor.dvl]
noise = "2 cm/s"
scale = { sigma = "1 %" }
gate = 0.999

[sensor.reference]

[source.csv]
directory = "."
"#;
