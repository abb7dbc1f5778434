//! The files of programs and data sets that a stranger brings, each a kind of its own.

mod apart;
mod binary;
mod clocks;
mod exports;
mod folders;
mod labels;
mod loggers;
pub mod mounted;
mod notations;
mod positions;
mod records;
mod senses;
mod several;
mod strangers;
mod times;
mod tracks;
mod untidy;
mod written;

use crate::import_layouts::Recorded;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::calendar::{Calendar, utc_of_gps};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.80665;
/// 2023-11-14T22:13:20Z, in nanoseconds.
const DATE: i64 = 1_700_000_000_000_000_000;
/// Zero of GPS time, and its difference from UTC in 2023, in nanoseconds.
const GPS_ZERO: i64 = 315_964_800_000_000_000;
const LEAP: i64 = 18_000_000_000;
const WEEK: i64 = 604_800_000_000_000;

/// A sample: time in nanoseconds and channels.
type Row = (i64, Vec<f64>);

/// The recording as a program writes it.
pub struct Written {
    /// Files or folders to import.
    pub given: Vec<PathBuf>,
    /// Nanoseconds from the clock of the recording to that of the IMU.
    pub offset: i64,
}

/// A program.
pub struct Program {
    pub name: &'static str,
    write: fn(&Recorded, &Path) -> Written,
}

impl Program {
    /// Writes the recording into a folder.
    pub fn write(&self, recorded: &Recorded, folder: &Path) -> Written {
        (self.write)(recorded, folder)
    }
}

fn put(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("the test can write");
    std::fs::write(&path, text).expect("the test can write");
    path
}

fn flu(v: &[f64]) -> [f64; 6] {
    [v[0], -v[1], -v[2], v[3], -v[4], -v[5]]
}

/// Right, forward, up, as a phone in its holder.
fn phone(v: &[f64]) -> [f64; 6] {
    [v[1], v[0], -v[2], v[4], v[3], -v[5]]
}

fn cells(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{v:.7}")).collect::<Vec<_>>().join(",")
}

fn seconds(nanos: i64) -> String {
    format!("{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000)
}

/// The lines of a table, below its headings.
fn table(headings: &str, rows: &[Row], line: impl Fn(&Row) -> String) -> String {
    let lines = rows.iter().map(|row| line(row) + "\n");
    headings.to_owned() + "\n" + &lines.collect::<String>()
}

fn position(v: &[f64]) -> String {
    format!("{:.9},{:.9},{:.3}", v[0].to_degrees(), v[1].to_degrees(), v[2])
}

/// Speed over ground and course, m/s and deg.
fn course(v: &[f64]) -> [f64; 2] {
    [v[3].hypot(v[4]), v[4].atan2(v[3]).rem_euclid(TAU).to_degrees()]
}

fn plain_imu(recorded: &Recorded, offset: i64) -> String {
    let headings =
        "time_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";
    table(headings, &recorded["imu"], |(t, v)| {
        format!("{},{}", seconds(t + offset), cells(v.iter().copied()))
    })
}

fn plain_gnss(recorded: &Recorded, offset: i64) -> String {
    let headings = "time_s,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps";
    table(headings, &recorded["gnss"], |(t, v)| {
        format!("{},{},{:.3},{:.3},{:.3}", seconds(t + offset), position(v), v[3], v[4], v[5])
    })
}

/// A date as the parts of a text, in the order that the text has.
fn date(nanos: i64) -> Calendar {
    Calendar::of_unix_nanos(nanos)
}

/// Year, month and day, as ISO 8601 writes them.
fn day(nanos: i64) -> String {
    let c = date(nanos);
    format!("{:04}-{:02}-{:02}", c.year, c.month, c.day)
}

fn clock(nanos: i64) -> String {
    let c = date(nanos);
    format!("{:02}:{:02}:{:02}.{:03}", c.hour, c.minute, c.second, c.nanos / 1_000_000)
}

/// An IMU in a form of its own, beside plain fixes.
fn imu_of(recorded: &Recorded, folder: &Path, text: &str, offset: i64) -> Written {
    let given =
        vec![put(folder, "imu.txt", text), put(folder, "g.csv", &plain_gnss(recorded, offset))];
    Written { given, offset }
}

/// Fixes in a form of their own, beside a plain IMU.
fn fixes_of(recorded: &Recorded, folder: &Path, text: &str, offset: i64) -> Written {
    let given =
        vec![put(folder, "i.csv", &plain_imu(recorded, offset)), put(folder, "sol.pos", text)];
    Written { given, offset }
}

/// An IMU along other axes.
fn axes(recorded: &Recorded, folder: &Path, turn: fn(&[f64]) -> [f64; 6]) -> Written {
    let turned = |(t, v): &Row| format!("{},{}", seconds(*t), cells(turn(v)));
    let text = table("time,gx,gy,gz,ax,ay,az", &recorded["imu"], turned);
    imu_of(recorded, folder, &text, 0)
}

/// The newest fix of a time, if it is newer than the time before.
fn new_fix(recorded: &Recorded, before: i64, now: i64) -> Option<&Row> {
    recorded["gnss"].iter().rev().find(|(t, _)| *t <= now).filter(|(t, _)| *t > before)
}

fn week(nanos: i64) -> (i64, i64) {
    let gps = nanos + DATE - GPS_ZERO + LEAP;
    assert_eq!(utc_of_gps(gps + GPS_ZERO), nanos + DATE);
    (gps / WEEK, gps % WEEK)
}

/// A solution of RTKLIB with these titles.
fn rtklib(
    recorded: &Recorded,
    folder: &Path,
    titles: &str,
    line: impl Fn(&Row, String) -> String,
) -> Written {
    let text = table(
        &format!("% program   : RTKPOST ver.2.4.3\n%\n%  GPST  {titles}"),
        &recorded["gnss"],
        |row| {
            let c = date(row.0 + DATE + LEAP);
            line(
                row,
                format!("{:04}/{:02}/{:02} {}", c.year, c.month, c.day, clock(row.0 + DATE + LEAP)),
            )
        },
    );
    fixes_of(recorded, folder, &text, DATE)
}

fn sexagesimal(radians: f64) -> (i64, i64, f64) {
    let degrees = radians.to_degrees();
    let minutes = degrees.fract() * 60.0;
    (degrees as i64, minutes as i64, minutes.fract() * 60.0)
}

const ACCURACY: &str = "1 12 1.5000 1.5000 2.5000 0.0 0.0 0.0 0.00 10.0";
const ACCURACIES: &str = "Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio";

/// All programs.
pub fn all() -> impl Iterator<Item = &'static Program> {
    folders::PROGRAMS
        .iter()
        .chain(&times::PROGRAMS)
        .chain(&tracks::PROGRAMS)
        .chain(&positions::PROGRAMS)
        .chain(&senses::PROGRAMS)
        .chain(&labels::PROGRAMS)
        .chain(&clocks::PROGRAMS)
        .chain(&mounted::PROGRAMS)
        .chain(&binary::PROGRAMS)
        .chain(&untidy::PROGRAMS)
        .chain(&exports::PROGRAMS)
        .chain(&strangers::PROGRAMS)
        .chain(&notations::PROGRAMS)
        .chain(&loggers::PROGRAMS)
        .chain(&written::PROGRAMS)
        .chain(&records::PROGRAMS)
        .chain(&apart::PROGRAMS)
        .chain(&several::PROGRAMS)
}
