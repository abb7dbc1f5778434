//! The estimates of a log in the formats of other programs.
//!
//! [`export`] reads position, velocity and attitude from a log and writes them as GeoJSON, KML,
//! GPX, NMEA 0183, SBET, TUM or KITTI, in constant memory. [`TableSink`] writes every state with
//! its full covariance as CSV or Parquet during a run, which may be the replay of a log.
//! [`BagSink`] does the same for a bag of ROS 2, with pose and velocity.

mod maps;
mod nmea;
mod sbet;
mod table;
mod track;
mod trajectory;

pub use navfuse_csv::Axes;
pub use navfuse_mcap::BagSink;
pub use table::{Table, TableSink};
pub use track::{Fix, Fixes};

use navfuse_core::files::WholeFile;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::calendar::{Calendar, GPS_ZERO};
use navfuse_core::units::time::Time;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A format of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// GeoJSON (RFC 7946): the track, and a point with all properties for each epoch.
    GeoJson,
    /// KML 2.2: the track.
    Kml,
    /// GPX 1.1: the track.
    Gpx,
    /// NMEA 0183: GGA, RMC, GST, HDT, ZDA and PASHR.
    Nmea,
    /// SBET of Applanix, with the accuracy in a second file.
    Sbet,
    /// Trajectory of the TUM benchmark: time, position and quaternion.
    Tum,
    /// Trajectory of the KITTI benchmark: the pose as a matrix.
    Kitti,
}

impl Format {
    /// The ending of the file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::GeoJson => "geojson",
            Self::Kml => "kml",
            Self::Gpx => "gpx",
            Self::Nmea => "nmea",
            Self::Sbet => "sbet",
            Self::Tum => "tum",
            Self::Kitti => "kitti.txt",
        }
    }

    /// The files of this format, with the path of the first.
    fn files(self, first: &Path, options: &Options) -> Vec<(PathBuf, Box<dyn Form>)> {
        let name = options.name.clone();
        let form: Box<dyn Form> = match self {
            Self::GeoJson => Box::new(maps::GeoJson::new(name, options.clock)),
            Self::Kml => Box::new(maps::Kml::new(name)),
            Self::Gpx => Box::new(maps::Gpx::new(name, options.clock)),
            Self::Nmea => Box::new(nmea::Sentences::new(options.clock)),
            Self::Sbet => Box::new(sbet::Trajectory::new(options.clock)),
            Self::Tum => Box::new(trajectory::Tum::new(options.axes)),
            Self::Kitti => Box::new(trajectory::Kitti::new(options.axes)),
        };
        let mut files = vec![(first.to_path_buf(), form)];
        if self == Self::Sbet {
            let accuracy = first.with_extension("smrmsg");
            files.push((accuracy, Box::new(sbet::Accuracy::new(options.clock))));
        }
        files
    }
}

/// The clock of a run beside UTC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UtcClock {
    /// UTC of the run's zero, in nanoseconds since 1970.
    pub origin: i64,
}

impl UtcClock {
    /// UTC in nanoseconds since 1970; `None` before the zero of GPS time, where the run's clock has
    /// no date.
    fn utc(self, time: Time) -> Option<i64> {
        Some(self.origin.saturating_add(time.nanos())).filter(|utc| *utc >= GPS_ZERO)
    }

    /// Date and time as ISO 8601 with milliseconds.
    fn iso(self, time: Time) -> Option<String> {
        let c = Calendar::of_unix_nanos(self.utc(time)?);
        Some(format!(
            "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z",
            c.year,
            c.month,
            c.day,
            c.hour,
            c.minute,
            c.second,
            c.nanos / 1_000_000
        ))
    }
}

/// Parameters of an export.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Name of the track.
    pub name: String,
    /// Axes of TUM and KITTI trajectories, with the body forward, right, down or forward, left, up.
    pub axes: Axes,
    /// UTC, for the formats that have it.
    pub clock: UtcClock,
}

/// The result of an export.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Number of epochs.
    pub epochs: u64,
    /// Warnings about the log.
    pub warnings: Vec<String>,
}

/// The text of one file.
trait Form {
    /// Number of times that the estimates are needed.
    fn passes(&self) -> usize {
        1
    }
    fn begin(&mut self, out: &mut dyn Write) -> io::Result<()>;
    fn fix(&mut self, pass: usize, fix: &Fix, out: &mut dyn Write) -> io::Result<()>;
    /// The end of a pass.
    fn end_pass(&mut self, _pass: usize, _out: &mut dyn Write) -> io::Result<()> {
        Ok(())
    }
    fn end(&mut self, out: &mut dyn Write) -> io::Result<()>;
}

/// Writes the estimates of a log to a file, and for SBET to a second one. `progress` receives the
/// read bytes and all bytes, and returns `false` to end the export without a file.
///
/// # Errors
/// When the log cannot be read or has no position, or a file cannot be written.
pub fn export(
    log: &Path,
    format: Format,
    file: &Path,
    options: &Options,
    mut progress: impl FnMut([u64; 2]) -> bool,
) -> Result<Option<Exported>, StreamError> {
    let mut exported = Exported::default();
    let mut parts = Vec::new();
    for (path, form) in format.files(file, options) {
        let part = WholeFile::create(&path).map_err(|e| StreamError::write(&path, e))?;
        parts.push((path, form, BufWriter::new(part)));
    }
    for (path, form, out) in &mut parts {
        form.begin(out).map_err(|e| StreamError::write(&*path, e))?;
        for pass in 0..form.passes() {
            let mut track = Fixes::open(log)?;
            exported.epochs = 0;
            while let Some(fix) = track.next()? {
                form.fix(pass, &fix, out).map_err(|e| StreamError::write(&*path, e))?;
                exported.epochs += 1;
                if exported.epochs.is_multiple_of(1024) && !progress(track.progress()) {
                    return Ok(None);
                }
            }
            track.check(exported.epochs)?;
            form.end_pass(pass, out).map_err(|e| StreamError::write(&*path, e))?;
            exported.warnings = track.warnings();
        }
        form.end(out).map_err(|e| StreamError::write(&*path, e))?;
    }
    for (path, _, out) in parts {
        let file = out.into_inner().map_err(|e| StreamError::write(&path, e.into_error()))?;
        file.finish().map_err(|e| StreamError::write(&path, e))?;
        exported.files.push(path);
    }
    Ok(Some(exported))
}
