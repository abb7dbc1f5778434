//! The Cramer-Rao bound against independently derived figures, and against the filter.

mod closed_forms;
mod runs;
mod table;

use crate::common::scenario;
use navfuse_campaign::{
    BoundRecord, Campaign, Columns, Component, Extent, Options, Record, RunRecord, execute,
};
use navfuse_core::document::Document;
use std::fmt::Write as _;
use std::sync::atomic::AtomicBool;

/// The instruments of the paper, and the priors of the table. The initial position is given: the
/// table has the error that accumulates.
const HEAD: &str = r#"
[estimator]
start = "600 s"
[process.ins]
attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 mm" }
gyro_bias = { sigma = "0.01 deg/h", truth = "0.01 deg/h" }
accel_bias = { sigma = "50 ug", truth = "50 ug" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "10 Hz" }
[sensor.dvl]
noise = "2 cm/s"
scale = { initial = 0.8, sigma = 0.2, truth = 0.9998 }
misalignment = { sigma = "3 deg", truth = ["-0.1 deg", "-0.2 deg", "0.5 deg"] }
simulation = { rate = "1 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "28.2 deg"
roll = "3 deg"
heading = "-10 deg"
"#;

/// Dive and ascent of the table have the vertical speed `W sin^2(pi x)`, ours `w 64 x^3 (1 - x)^3`.
/// The square of the vertical speed determines the roll misalignment: its mean is `3/8 W^2` there
/// and `4096 B(7, 7) w^2 = 1024/3003 w^2` here, so that `w = sqrt(3/8 * 3003/1024) W = 1.0487 W`.
const DIVE: f64 = 1.0487;

/// Returns a segment of a trajectory: its type, its duration in seconds, and its other keys.
fn segment(kind: &str, duration: f64, more: &str) -> String {
    format!(
        "[[source.simulation.segments]]\ntype = \"{kind}\"\nduration = \"{duration} s\"\n{more}\n"
    )
}

fn square(duration: f64) -> String {
    segment("square", duration, "turn = \"30 s\"\nbank = \"15 deg\"")
}

fn start(speed: f64, duration: f64) -> String {
    segment("static", 600.0, "") + &segment("surge", duration, &format!("speed = \"{speed} m/s\""))
}

/// Returns the manoeuvre of the table, with `count` squares in the time of one.
fn squares(speed: f64, dive: f64, count: u8) -> String {
    let rate = format!("rate = \"{} m/s\"", DIVE * dive);
    let mut text =
        start(speed, 60.0) + &segment("descend", 60.0, &rate) + &segment("cruise", 30.0, "");
    (0..count).for_each(|_| text += &square(1220.0 / f64::from(count)));
    text + &segment("cruise", 30.0, "") + &segment("ascend", 60.0, &rate)
}

fn manoeuvre(speed: f64, dive: f64) -> String {
    squares(speed, dive, 1)
}

/// A bound over time.
struct Bound {
    columns: Columns,
    record: BoundRecord,
}

impl Bound {
    /// Computes the bound of a document, and runs.
    fn of(mut document: Document, settings: &[&str], runs: usize) -> (Self, Vec<RunRecord>) {
        let registry = navfuse::standard_plugins();
        settings.iter().try_for_each(|s| document.set(s)).expect("the settings fit");
        let options = Options { runs, every: Some(20.0), ..Options::default() };
        let plan = Campaign::new(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
        let (mut bound, mut records) = (None, Vec::new());
        let keep = |record| {
            match record {
                Record::Bound(record) => bound = Some(record),
                Record::Run(run) => records.push(run),
            }
            Ok(())
        };
        let stop = AtomicBool::new(false);
        execute(
            &plan,
            &registry,
            &document,
            Extent { threads: 2, ..Extent::default() },
            &stop,
            |_| {},
            keep,
        )
        .unwrap_or_else(|e| panic!("{e}"));
        (Self { columns: plan.columns, record: bound.expect("a bound") }, records)
    }

    /// Computes the bound of a manoeuvre with the instruments and priors of the table.
    fn limit(segments: &str, settings: &[&str]) -> Self {
        let document =
            Document::parse("limits.toml", format!("{HEAD}{segments}")).expect("it is TOML");
        Self::of(document, settings, 0).0
    }

    /// Computes the bound of a scenario of the repository.
    fn scenario(name: &str) -> Self {
        Self::of(Document::from_file(scenario(name)).expect("the scenario is there"), &[], 0).0
    }

    fn component(&self, name: &str) -> usize {
        let found = self.columns.components.iter().position(|c| c.name() == name);
        found.unwrap_or_else(|| panic!("no component {name}"))
    }

    /// Returns the final filtered bound, in the component's display unit.
    fn end(&self, name: &str) -> f64 {
        self.record.rows.last().expect("rows").2[self.component(name)]
    }

    /// Returns the filtered and the smoothed bound at a time.
    fn at(&self, time: f64, name: &str) -> (f64, f64) {
        let row = self
            .record
            .rows
            .iter()
            .find(|r| (r.1 - time).abs() < 1e-6)
            .expect("an epoch at that time");
        let k = self.component(name);
        (row.2[k], row.3[k])
    }
}

/// Compares many figures and reports all deviations.
#[derive(Default)]
struct Check {
    wrong: String,
}

impl Check {
    fn within(&mut self, what: &str, found: f64, expected: f64, share: f64) {
        if (found / expected - 1.0).abs() > share || !found.is_finite() {
            let off = 100.0 * (found / expected - 1.0);
            let _ = writeln!(self.wrong, "{what}: {found:.4e} against {expected:.4e}, {off:+.1} %");
        }
    }

    /// Compares the final bounds of components with the table, within 10 %.
    fn limits(&mut self, what: &str, bound: &Bound, figures: &[(&str, f64)]) {
        for (name, expected) in figures {
            self.within(&format!("{what}, {name}"), bound.end(name), *expected, 0.1);
        }
    }
}

impl Drop for Check {
    fn drop(&mut self) {
        assert!(self.wrong.is_empty() || std::thread::panicking(), "\n{}", self.wrong);
    }
}

const K: &str = "dvl.scale.k";
const HEADING: &str = "ins.attitude.yaw";
const YAW: &str = "dvl.misalignment.yaw";
const PITCH: &str = "dvl.misalignment.pitch";
const ROLL: &str = "dvl.misalignment.roll";
const ALONG: &str = "ins.velocity.north";
const ACCEL: [&str; 3] = ["ins.accel_bias.x", "ins.accel_bias.y", "ins.accel_bias.z"];
const GYRO: [&str; 3] = ["ins.gyro_bias.x", "ins.gyro_bias.y", "ins.gyro_bias.z"];
const NORTH: &str = "ins.position.north";
const EAST: &str = "ins.position.east";
const DOWN: &str = "ins.position.down";

fn rate(hz: f64) -> String {
    format!("sensor.dvl.simulation.rate=\"{hz} Hz\"")
}
