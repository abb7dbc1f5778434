//! `navfuse export` as a user calls it: every format has the estimates of the log, and other
//! programs read them.

mod foreign;
mod ros2;

use crate::common::{navfuse, scenario, stderr, stdout};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A short run of the simplest scenario, and its log.
struct Run {
    _folder: tempfile::TempDir,
    log: PathBuf,
}

/// The formats with the endings of their files.
const FORMATS: [(&str, &str); 9] = [
    ("geojson", "geojson"),
    ("kml", "kml"),
    ("gpx", "gpx"),
    ("tum", "tum"),
    ("kitti", "kitti.txt"),
    ("csv", "csv"),
    ("nmea", "nmea"),
    ("sbet", "sbet"),
    ("parquet", "parquet"),
];

/// The log of a run, which all tests share, in a folder of its own.
fn run() -> Run {
    static LOG: OnceLock<Vec<u8>> = OnceLock::new();
    let bytes = LOG.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().display().to_string();
        let file = scenario("quickstart").display().to_string();
        let output = navfuse(&["run", &file, "--set", "estimator.stop=90 s", "--out", &out]);
        assert!(output.status.success(), "{}", stderr(&output));
        std::fs::read(folder.path().join("run.mcap")).expect("the log")
    });
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("run.mcap");
    std::fs::write(&log, bytes).expect("the test can write");
    Run { _folder: folder, log }
}

impl Run {
    /// Exports the log with further arguments, and returns the file.
    fn export(&self, format: &str, arguments: &[&str]) -> PathBuf {
        let log = self.log.display().to_string();
        let output = navfuse(&[&["export", &log, "--to", format], arguments].concat());
        assert!(output.status.success(), "{format}: {}", stderr(&output));
        let printed = stdout(&output);
        let (file, _) = printed.lines().next().and_then(|l| l.split_once(": ")).expect("a file");
        PathBuf::from(file)
    }
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The headings of a table, and its rows; an empty cell is NaN.
fn csv(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = text(path);
    let mut lines = text.lines();
    let header = lines.next().expect("a header").split(',').map(str::to_owned).collect();
    let number = |cell: &str| {
        if cell.is_empty() { f64::NAN } else { cell.parse().expect("a number") }
    };
    (header, lines.map(|line| line.split(',').map(number).collect()).collect())
}

#[test]
fn the_covariance_in_the_table_belongs_to_the_sigma_beside_it() {
    let run = run();
    let (header, rows) = csv(&run.export("csv", &[]));
    let column = |name: &str| {
        header.iter().position(|h| h == name).unwrap_or_else(|| panic!("no {name} in {header:?}"))
    };
    assert!(rows.len() > 30, "{}", rows.len());
    let mut pairs = 0;
    for (k, heading) in header.iter().enumerate() {
        let Some((pair, units)) = heading.split_once("_cov") else { continue };
        let (a, b) = pair.split_once('*').expect("two components");
        let (unit_a, unit_b) = units.split_once('*').unwrap_or((units, units));
        let sigma = |name: &str, unit: &str| {
            let unit = unit.trim_start_matches('_');
            let heading = format!("{name}_sigma_{unit}");
            header.iter().position(|h| *h == heading || *h == format!("{name}_sigma"))
        };
        let (Some(sa), Some(sb)) = (sigma(a, unit_a), sigma(b, unit_b)) else {
            panic!("{heading}: no sigma in {header:?}");
        };
        for row in &rows {
            let (bound, covariance) = (row[sa] * row[sb], row[k]);
            if a == b {
                // J P J' and the square of its root differ by a few roundings
                assert!((covariance - bound).abs() <= 1e-13 * bound, "{heading}: {covariance}");
            }
            // a correlation is within one
            assert!(covariance.abs() <= bound * (1.0 + 1e-12), "{heading}: {covariance}, {bound}");
        }
        pairs += 1;
    }
    // the sigma of a fixed state is zero
    let uncertain = |k: usize| header[k].contains("_sigma") && rows[0][k] > 0.0;
    let components = (0..header.len()).filter(|k| uncertain(*k)).count();
    assert!(components >= 12, "{components}");
    assert_eq!(pairs, components * (components + 1) / 2, "every pair of uncertain components");
    // a velocity and the heading that integrated it are correlated
    let at = column("ins.attitude.yaw*ins.velocity.north_cov_deg*mps");
    assert!(rows.iter().any(|row| row[at].abs() > 1e-9));
    // the table repeats the estimates of the run to the bit: those of the log
    let gpx = text(&run.export("gpx", &[]));
    let latitude = column("ins.position.latitude_deg");
    for (row, point) in rows.iter().zip(gpx.split("lat=\"").skip(1)) {
        assert_eq!(format!("{:.9}", row[latitude]), point.split('"').next().expect("a number"));
    }
}

#[test]
fn a_table_in_east_north_up_has_the_numbers_of_the_one_in_north_east_down() {
    let run = run();
    let other = run.log.with_file_name("enu.csv").display().to_string();
    let (ned_header, ned) = csv(&run.export("csv", &[]));
    let (header, enu) = csv(&run.export("csv", &["--axes", "enu", "--out", &other]));
    assert_eq!((ned.len(), ned_header.len()), (enu.len(), header.len()));
    assert!(header.iter().all(|name| !name.contains("down")), "{header:?}");
    let ned_column = |name: &str| ned_header.iter().position(|h| h == name);
    let mut turned = 0;
    for (k, name) in header.iter().enumerate() {
        // the same column of the other table; of a covariance, its two components may be exchanged
        let old = name.replace(".up", ".down");
        let exchanged = old.split_once("_cov").and_then(|(pair, unit)| {
            let (a, b) = pair.split_once('*')?;
            let unit = unit.strip_prefix('_').unwrap_or("");
            let unit = unit.split_once('*').map_or(unit.to_owned(), |(a, b)| format!("{b}*{a}"));
            let mark = if unit.is_empty() { "" } else { "_" };
            Some(format!("{b}*{a}_cov{mark}{unit}"))
        });
        let column = ned_column(&old).or_else(|| ned_column(&exchanged?));
        let column = column.unwrap_or_else(|| panic!("no {old}"));
        let ups = name.matches(".up").count();
        let sign = if ups == 1 && !name.contains("_sigma") { -1.0 } else { 1.0 };
        turned += usize::from(sign < 0.0);
        for (a, b) in enu.iter().zip(&ned) {
            // the order of the sum of a covariance may differ: both have 17 digits
            let (a, b) = (a[k], sign * b[column]);
            let close = (a - b).abs() <= 1e-14 * (a.abs() + b.abs()) + 1e-30;
            assert!(close || (a.is_nan() && b.is_nan()), "{name}: {a} {b}");
        }
    }
    // estimate and error of the velocity, the error of the position, and their covariances
    assert!(turned > 20, "{turned}");
    let log = run.log.display().to_string();
    let out = run.log.with_file_name("run").display().to_string();
    let set = "sink.csv={ covariance = true, axes = \"enu\" }";
    let output = navfuse(&["replay", &log, "--out", &out, "--set", set]);
    assert!(output.status.success(), "{}", stderr(&output));
    let of_run = text(&Path::new(&out).join("estimate.csv"));
    assert!(of_run == text(Path::new(&other)), "the table of the run differs from the export");
}

#[test]
fn every_format_has_a_row_for_each_epoch() {
    let run = run();
    let rows = csv(&run.export("csv", &[])).1.len();
    for (format, ending) in FORMATS {
        let file = run.export(format, &[]);
        assert_eq!(file, run.log.with_extension(ending), "beside the log");
        let bytes = std::fs::read(&file).expect("the file");
        let count = |what: &str| String::from_utf8_lossy(&bytes).matches(what).count();
        let found = match format {
            "geojson" => count("\"Point\""),
            "kml" => count("\n") - 6,
            "gpx" => count("<trkpt "),
            "tum" => count("\n") - 1,
            "kitti" => count("\n"),
            "csv" => count("\n") - 1,
            "nmea" => count("$INGGA,"),
            "sbet" => bytes.len() / (17 * 8),
            _ => rows, // a foreign reader counts the rows of Parquet
        };
        assert_eq!(found, rows, "{format}");
    }
    let accuracy = std::fs::read(run.log.with_extension("smrmsg")).expect("the accuracies");
    assert_eq!(accuracy.len(), rows * 10 * 8);
}

#[test]
fn the_clock_gives_dates_and_weeks_of_gps() {
    let run = run();
    let origin = ["--origin", "2026-06-01T23:58:50Z"];
    let gpx = text(&run.export("gpx", &origin));
    assert!(gpx.contains("<time>2026-06-02T00:00:10.000Z</time>"), "80 s into the run");
    let nmea = text(&run.export("nmea", &origin));
    assert!(
        nmea.contains("$INZDA,000010.000000,02,06,2026,00,00*"),
        "{}",
        &nmea[..nmea.len().min(400)]
    );
    let sbet = std::fs::read(run.export("sbet", &origin)).expect("the file");
    let record = |k: usize| {
        let bytes = &sbet[k * 136..k * 136 + 8];
        f64::from_le_bytes(bytes.try_into().expect("eight bytes"))
    };
    // 2026-06-01 is a Monday, the second day of the week of GPS, which is 18 s ahead of UTC
    let run_time = csv(&run.export("csv", &[])).1[0][0];
    assert_eq!(record(0), 2.0 * 86_400.0 - 70.0 + 18.0 + run_time);
    // without a date there is none
    assert!(!text(&run.export("gpx", &[])).contains("<time>"));
    assert!(!text(&run.export("nmea", &[])).contains("ZDA"));
}

#[test]
fn what_cannot_be_exported_is_an_error_with_a_remedy_and_leaves_no_file() {
    let run = run();
    let log = run.log.display().to_string();
    let refused = |arguments: &[&str]| {
        let output = navfuse(&[&["export"], arguments].concat());
        assert!(!output.status.success(), "{arguments:?}");
        stderr(&output)
    };
    let said = refused(&[&log, "--to", "gpx", "--axes", "enu"]);
    assert!(said.contains("--axes: only csv, parquet, tum and kitti have axes"), "{said}");
    let said = refused(&[&log, "--to", "gpx", "--output", &log]);
    assert!(
        said.contains("it is an input of this command; give another place for the result"),
        "{said}"
    );
    let said = refused(&[&log, "--to", "gpx", "--origin", "yesterday"]);
    assert!(said.contains("\"yesterday\" is no date"), "{said}");
    let said = refused(&["nothing.mcap", "--to", "gpx"]);
    assert!(said.contains("nothing.mcap: cannot be read"), "{said}");
    let text = run.log.with_file_name("scenario.toml");
    std::fs::write(&text, "seed = 1 # long enough for the first bytes of a log").expect("a file");
    for format in ["gpx", "csv"] {
        let said = refused(&[&text.display().to_string(), "--to", format]);
        assert!(said.contains("scenario.toml"), "{said}");
    }
    if cfg!(target_os = "linux") {
        for (format, _) in FORMATS {
            let said = refused(&[&log, "--to", format, "--output", "/dev/full"]);
            assert!(
                said.contains("/dev/full") && said.contains("No space left"),
                "{format}: {said}"
            );
        }
    }
    for (_, ending) in FORMATS {
        assert!(!run.log.with_extension(ending).exists(), "{ending}");
    }
}

#[test]
fn a_log_that_was_cut_off_is_exported_up_to_the_cut() {
    let run = run();
    let bytes = std::fs::read(&run.log).expect("the log");
    let part = run.log.with_file_name("cut.mcap.part");
    // the end of the log repeats its index; two thirds are within the samples
    std::fs::write(&part, &bytes[..bytes.len() * 2 / 3]).expect("a part");
    let output = navfuse(&["export", &part.display().to_string(), "--to", "tum"]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("warning: the log: cut off at byte"), "{}", stderr(&output));
    let (cut, whole) = (text(&run.log.with_file_name("cut.tum")), text(&run.export("tum", &[])));
    assert!(cut.lines().count() > 2 && whole.starts_with(&cut), "{cut}");
}
