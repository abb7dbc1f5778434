//! The dialects in which programs write tables of an IMU and of GNSS.

use crate::import_layouts::Recorded;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Random numbers of a linear congruence (Knuth's MMIX), the same on every machine.
pub struct Random(pub u64);

impl Random {
    /// One of the items.
    fn choose<T: Copy>(&mut self, items: &[T]) -> T {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        items[(self.0 >> 33) as usize % items.len()]
    }
}

/// Headings of rates and forces, with `#` for the axis; none for a table without headings.
const NAMES: [Option<[&str; 2]>; 15] = [
    Some(["gyro_#", "accel_#"]),
    Some(["w#", "a#"]),
    Some(["w_RS_S_#", "a_RS_S_#"]),
    Some(["omega_#", "alpha_#"]),
    Some(["field.angular_velocity.#", "field.linear_acceleration.#"]),
    Some(["Gyr_#", "Acc_#"]),
    Some(["GYRO #", "ACC #"]),
    Some(["Gyroscope #", "Accelerometer #"]),
    Some(["#gyro", "#acc"]),
    Some(["Gyr#", "Acc#"]),
    Some(["UncompGyro#", "UncompAcc#"]),
    Some(["imu.angularVelocity.#", "imu.linearAcceleration.#"]),
    Some(["g#", "a#"]),
    Some(["rotationRate#", "acceleration#"]),
    None,
];
/// Headings of the time.
const TIMES: [&str; 8] =
    ["time", "timestamp", "t", "Time", "stamp", "%time", "header.stamp", "seconds_elapsed"];
/// Units of the time, with their nanoseconds.
const CLOCKS: [(&str, i64); 4] =
    [("s", 1_000_000_000), ("ms", 1_000_000), ("us", 1_000), ("ns", 1)];
/// Units of rates and forces, with what they are in SI.
const RATES: [(&str, &str, f64); 2] =
    [("rad/s", "radps", 1.0), ("deg/s", "dps", std::f64::consts::PI / 180.0)];
const FORCES: [(&str, &str, f64); 2] = [("m/s^2", "mps2", 1.0), ("g", "g", 9.80665)];
/// Separators, with a decimal comma or without.
const SEPARATORS: [(&str, bool); 6] =
    [(",", false), (", ", false), (";", false), (";", true), ("\t", false), (" ", false)];
/// Lines before the headings.
const PREAMBLES: [&str; 5] =
    ["", "\u{feff}", "sep=SEP\n", "// Update Rate: 100.0Hz\n// Device 7\n", "# log\n"];
/// Headings of latitude and longitude, with the unit of the numbers as parts of a degree.
const PLACES: [([&str; 3], f64); 4] = [
    (["lat", "lon", "alt"], 1.0),
    (["Latitude [deg]", "Longitude [deg]", "Height [m]"], 1.0),
    (["lat", "lon", "height"], 180.0 / std::f64::consts::PI),
    (["latitude", "longitude", "altitude"], 1e-7),
];
/// Headings of the velocity, `vel_d` or upward.
const VELOCITIES: [Option<([&str; 3], f64)>; 4] = [
    Some((["vel_n_mps", "vel_e_mps", "vel_d_mps"], 1.0)),
    Some((["vn", "ve", "vu"], -1.0)),
    Some((["VelNorth (m/s)", "VelEast (m/s)", "VelUp (m/s)"], -1.0)),
    None,
];

/// How the unit stands in a heading.
#[derive(Clone, Copy, Debug)]
enum Units {
    Brackets,
    Parentheses,
    Suffix,
    None,
}

/// A layout of the recording.
#[derive(Debug)]
pub struct Layout {
    names: Option<[&'static str; 2]>,
    time: &'static str,
    clock: (&'static str, i64),
    /// Nanoseconds that are added: zero, or a date since 1970.
    pub origin: i64,
    rate: (&'static str, &'static str, f64),
    force: (&'static str, &'static str, f64),
    units: Units,
    separator: (&'static str, bool),
    preamble: &'static str,
    commented: bool,
    upward: bool,
    forces_first: bool,
    place: ([&'static str; 3], f64),
    velocity: Option<([&'static str; 3], f64)>,
    /// Set if the fix stands in each row of the IMU.
    together: bool,
}

impl Layout {
    /// Draws a layout.
    pub fn draw(random: &mut Random) -> Self {
        let names = random.choose(&NAMES);
        Self {
            names,
            time: random.choose(&TIMES),
            clock: random.choose(&CLOCKS),
            origin: random.choose(&[0, 1_700_000_000_000_000_000]),
            rate: random.choose(&RATES),
            force: random.choose(&FORCES),
            units: random.choose(&[
                Units::Brackets,
                Units::Parentheses,
                Units::Suffix,
                Units::None,
            ]),
            separator: random.choose(&SEPARATORS),
            preamble: random.choose(&PREAMBLES),
            commented: random.choose(&[false, false, true]),
            upward: random.choose(&[false, true]),
            forces_first: random.choose(&[false, true]),
            place: random.choose(&PLACES),
            velocity: random.choose(&VELOCITIES),
            together: names.is_some() && random.choose(&[false, false, true]),
        }
    }

    fn heading(&self, name: &str, (unit, suffix, _): (&str, &str, f64)) -> String {
        match self.units {
            Units::Brackets => format!("{name} [{unit}]"),
            Units::Parentheses => format!("{name} ({unit})"),
            Units::Suffix => format!("{name}_{suffix}"),
            Units::None => name.to_owned(),
        }
    }

    /// The time in the unit of the clock.
    fn stamp(&self, nanos: i64) -> String {
        let (whole, rest) =
            ((nanos + self.origin) / self.clock.1, (nanos + self.origin) % self.clock.1);
        let digits = self.clock.1.ilog10() as usize;
        if digits == 0 { whole.to_string() } else { format!("{whole}.{rest:0digits$}") }
    }

    /// The text of a table.
    fn table(&self, headings: &[String], rows: &[Vec<String>]) -> String {
        let (separator, comma) = self.separator;
        let number = |cell: &String| if comma { cell.replace('.', ",") } else { cell.clone() };
        let mut text = self.preamble.replace("SEP", separator.trim_end_matches(' '));
        if self.names.is_some() {
            // words with spaces cannot stand between spaces
            let spaced = |h: &String| if separator == " " { h.replace(' ', "") } else { h.clone() };
            let list: Vec<String> = headings.iter().map(spaced).collect();
            let _ = writeln!(
                text,
                "{}{}",
                if self.commented { "# " } else { "" },
                list.join(separator)
            );
        }
        for row in rows {
            let cells: Vec<String> = row.iter().map(number).collect();
            let _ = writeln!(text, "{}", cells.join(separator));
        }
        text
    }

    fn inertial(&self, recorded: &Recorded) -> (Vec<String>, Vec<Vec<String>>) {
        let [rate, force] = self.names.unwrap_or(["", ""]);
        let axes = ["X", "Y", "Z"].map(|axis| {
            if rate.contains(['_', '.']) || rate.len() < 3 || rate.starts_with('#') {
                axis.to_lowercase()
            } else {
                axis.to_owned()
            }
        });
        let vector = |name: &str, unit| axes.clone().map(|a| (name.replace('#', &a), unit));
        let mut columns = [vector(rate, self.rate), vector(force, self.force)].concat();
        let sign = |k: usize| if self.upward && !k.is_multiple_of(3) { -1.0 } else { 1.0 };
        let order: Vec<usize> =
            if self.forces_first { (3..6).chain(0..3).collect() } else { (0..6).collect() };
        columns = order.iter().map(|k| columns[*k].clone()).collect();
        let headings = columns.iter().map(|(name, unit)| self.heading(name, *unit));
        let headings = std::iter::once(self.time_heading()).chain(headings).collect();
        let rows = recorded["imu"].iter().map(|(nanos, values)| {
            let value = |k: &usize| {
                let (_, _, size) = if *k < 3 { self.rate } else { self.force };
                format!("{:.7}", sign(*k) * values[*k] / size)
            };
            std::iter::once(self.stamp(*nanos)).chain(order.iter().map(value)).collect()
        });
        (headings, rows.collect())
    }

    fn time_heading(&self) -> String {
        match self.units {
            Units::Brackets => format!("{} [{}]", self.time, self.clock.0),
            Units::Parentheses => format!("{} ({})", self.time, self.clock.0),
            Units::Suffix => format!("{}_{}", self.time, self.clock.0),
            Units::None => self.time.to_owned(),
        }
    }

    fn fixes(&self, recorded: &Recorded) -> (Vec<String>, Vec<Vec<String>>) {
        let (place, size) = self.place;
        let mut headings = vec![self.time_heading()];
        headings.extend(place.map(str::to_owned));
        headings.extend(self.velocity.iter().flat_map(|(names, _)| names.map(str::to_owned)));
        let rows = recorded["gnss"].iter().map(|(nanos, v)| {
            let angle = |radians: f64| {
                let number = radians.to_degrees() / size;
                if size < 1e-3 { format!("{number:.0}") } else { format!("{number:.9}") }
            };
            let height = if size < 1e-3 { v[2] * 1e3 } else { v[2] };
            let height = if size < 1e-3 { format!("{height:.0}") } else { format!("{height:.3}") };
            let mut row = vec![self.stamp(*nanos), angle(v[0]), angle(v[1]), height];
            if let Some((_, up)) = self.velocity {
                row.extend([v[3], v[4], up * v[5]].map(|v| format!("{v:.3}")));
            }
            row
        });
        (headings, rows.collect())
    }

    /// Writes the files of the recording.
    pub fn write(&self, folder: &Path, recorded: &Recorded) -> Vec<PathBuf> {
        let (mut headings, mut rows) = self.inertial(recorded);
        let (fix_headings, fixes) = self.fixes(recorded);
        let path = |name: &str, text: String| {
            let path = folder.join(name);
            std::fs::write(&path, text).expect("the test can write");
            path
        };
        if self.together {
            headings.extend(fix_headings[1..].iter().cloned());
            let times: Vec<i64> = recorded["gnss"].iter().map(|(nanos, _)| *nanos).collect();
            for (row, (nanos, _)) in rows.iter_mut().zip(&recorded["imu"]) {
                let newest = times.partition_point(|t| t <= nanos);
                let none = || vec![String::new(); fixes[0].len() - 1];
                // spaces have no empty cell
                let first = if self.separator.0 == " " { Some(0) } else { None };
                let fix = newest.checked_sub(1).or(first).map(|k| fixes[k][1..].to_vec());
                row.extend(fix.unwrap_or_else(none));
            }
            return vec![path("log.csv", self.table(&headings, &rows))];
        }
        let imu = path("one.csv", self.table(&headings, &rows));
        vec![imu, path("two.csv", self.table(&fix_headings, &fixes))]
    }
}
