//! PD0 and AD2CP equal MHKiT's dolfyn, a reader written by others, on its sample files and on
//! generated ones.
//!
//! The tests install MHKiT from PyPI into the target folder, or use the interpreter that
//! NAVFUSE_PYTHON names. Without Python or PyPI they are skipped.

use crate::generate::{Ensemble, ad2cp};
use crate::read;
use navfuse_dvl_files::{Coordinates, Format, Ping, Stamp, TrackedVelocity};
use navfuse_testing::absent::data;
use navfuse_testing::python::Packages;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Finds or installs an interpreter with MHKiT.
fn python() -> Option<PathBuf> {
    Packages {
        names: "MHKiT",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("mhkit"),
        variable: Some("NAVFUSE_PYTHON"),
        check: "import mhkit.dolfyn",
        // the packages that dolfyn imports, and MHKiT without the others
        install: &[
            &["numpy", "scipy", "xarray", "netCDF4", "pandas", "matplotlib"],
            &["--no-deps", "mhkit"],
        ],
    }
    .python()
}

/// A ping as dolfyn reads it; NaN where it has nothing.
struct Row {
    nanos: i64,
    velocity: [f64; 4],
    /// The velocity in instrument coordinates.
    turned: [f64; 4],
    range: [f64; 4],
    correlation: [f64; 4],
    percent_good: [f64; 4],
    /// Heading, pitch, roll, deg.
    attitude: [f64; 3],
    sound_speed: f64,
    depth: f64,
    merit: [f64; 4],
}

/// Reads files with dolfyn, in one process.
fn dolfyn(python: &Path, files: &[PathBuf]) -> Vec<Vec<Row>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dvl_files/dolfyn.py");
    let output = Command::new(python).arg(script).args(files).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let row = |line: &str| {
        let (time, rest) = line.split_once(' ').unwrap();
        let v: Vec<f64> = rest.split(' ').map(|x| x.parse().unwrap()).collect();
        let four = |at: usize| [v[at], v[at + 1], v[at + 2], v[at + 3]];
        Row {
            nanos: time.parse().unwrap(),
            velocity: four(0),
            range: four(4),
            correlation: four(8),
            percent_good: four(12),
            merit: four(16),
            turned: four(20),
            attitude: [v[24], v[25], v[26]],
            sound_speed: v[27],
            depth: v[28],
        }
    };
    let files = text.strip_suffix("end\n").unwrap().split("end\n");
    files.map(|file| file.lines().map(row).collect()).collect()
}

/// Reads files with dolfyn that it did not see yet; dolfyn writes an index beside a file.
fn dolfyn_of_bytes(python: &Path, files: &[Vec<u8>], extension: &str) -> Vec<Vec<Row>> {
    let folder = tempfile::tempdir().unwrap();
    let write = |(k, bytes): (usize, &Vec<u8>)| {
        let path = folder.path().join(format!("{k}.{extension}"));
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let paths: Vec<PathBuf> = files.iter().enumerate().map(write).collect();
    dolfyn(python, &paths)
}

/// Compares a number that may be missing. dolfyn computes in single precision.
fn same(ours: Option<f64>, theirs: f64, bad: impl Fn(f64) -> bool, what: &str, k: usize) {
    let theirs = Some(theirs).filter(|t| !t.is_nan() && !bad(*t));
    let close = match (ours, theirs) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-6 * b.abs().max(1.0),
        (None, None) => true,
        _ => false,
    };
    assert!(close, "ping {k}: {what} {ours:?}, dolfyn {theirs:?}");
}

/// Compares all pings; returns the number of those with a velocity, and of those that dolfyn turned
/// to instrument coordinates.
fn same_teledyne(pings: &[Ping], rows: &[Row]) -> (usize, usize) {
    // dolfyn leaves the last ensemble out of some files
    assert!(
        (rows.len()..=rows.len() + 1).contains(&pings.len()),
        "{}, {}",
        pings.len(),
        rows.len()
    );
    let (mut valid, mut turned) = (0, 0);
    for (k, (ping, row)) in pings.iter().zip(rows).enumerate() {
        let Stamp::Date(nanos) = ping.stamp else { panic!("ping {k} has no date") };
        // dolfyn keeps times as seconds since 1970 in double precision, 240 ns
        assert!((nanos - row.nanos).abs() < 1000, "ping {k}: {nanos}, {}", row.nanos);
        let a = ping.attitude.unwrap();
        for (ours, theirs) in [a.heading, a.pitch, a.roll].into_iter().zip(row.attitude) {
            same(Some(ours.to_degrees()), theirs, |_| false, "attitude", k);
        }
        same(ping.sound_speed, row.sound_speed, |_| false, "speed of sound", k);
        same(ping.depth, row.depth, |_| false, "depth", k);
        let track = ping.bottom.unwrap_or_default();
        for i in 0..4 {
            same(track.recorded[i], row.velocity[i], |v| v < -32.0, "velocity", k);
            same(track.range[i], row.range[i], |r| r == 0.0, "range", k);
            let none = |_| ping.bottom.is_none();
            let (correlation, good) = (track.correlation[i], track.percent_good[i]);
            same(correlation.map(|c| c * 255.0), row.correlation[i], none, "correlation", k);
            same(good.map(|p| p * 100.0), row.percent_good[i], none, "percent good", k);
        }
        if !track.recorded[..3].iter().all(Option::is_some) {
            continue;
        }
        valid += 1;
        let [x, y, z, _] = row.turned;
        if x.is_finite() {
            turned += 1;
            let axes = track.axes.unwrap();
            for (ours, theirs) in axes.into_iter().zip([-y, -x, z]) {
                same(Some(ours), theirs, |_| false, "velocity of the vehicle", k);
            }
        }
    }
    (valid, turned)
}

/// The sample files of dolfyn.
fn samples(folder: &str) -> Option<PathBuf> {
    let origin = "The files are examples/data/dolfyn of the public repository \
                  MHKiT-Software/MHKiT-Python";
    data(&format!("formats/{folder}"), origin)
}

#[test]
fn pd0_samples_equal_dolfyn() {
    let Some((folder, python)) = samples("pd0").zip(python()) else { return };
    // the numbers of velocities are those that dolfyn gives
    let expected = [
        ("winriver01.PD0", 261, (261, 0)),
        ("RDI_withBT.000", 1721, (901, 901)),
        ("vmdas01_wh.ENX", 3713, (0, 0)),
        ("RDI_test01.000", 22, (0, 0)),
        ("RDI_7f79_2.000", 2, (0, 0)),
    ];
    let paths = expected.map(|(name, ..)| folder.join(name));
    for ((name, count, velocities), (path, rows)) in
        expected.into_iter().zip(paths.iter().zip(dolfyn(&python, &paths)))
    {
        let (pings, _) = read(Format::Pd0, &std::fs::read(path).unwrap());
        assert_eq!(rows.len(), count, "{name}");
        assert_eq!(same_teledyne(&pings, &rows), velocities, "{name}");
    }
}

#[test]
fn generated_pd0_equals_dolfyn_in_every_coordinate_system() {
    let Some(python) = python() else { return };
    let cases = (0..4).flat_map(|c| [(c, 20, false), (c, 30, true)]);
    let file = |(coordinates, beam_angle, up)| {
        let ensemble = |k: u32| {
            let v = |f: f64| (f * f64::from(k + 1)) as i16;
            let bad = k % 5 == 4;
            let attitude = [v(700.0), v(-90.0), v(130.0)];
            let bottom = if bad { [i16::MIN; 4] } else { [v(31.0), v(-57.0), v(13.0), v(2.0)] };
            let percent_good = [100 - k as u8, 3, k as u8, 99];
            let base = Ensemble { coordinates, beam_angle, up, attitude, ..Ensemble::default() };
            Ensemble { bottom, percent_good, ..base }.at(70 * k).bytes()
        };
        (0..30).flat_map(ensemble).collect::<Vec<u8>>()
    };
    let files: Vec<Vec<u8>> = cases.clone().map(file).collect();
    let read_by_dolfyn = dolfyn_of_bytes(&python, &files, "PD0");
    for ((case, bytes), rows) in cases.zip(&files).zip(read_by_dolfyn) {
        let (pings, damage) = read(Format::Pd0, bytes);
        assert_eq!(damage.gaps(), 0);
        let turned = if case.0 == 2 { 0 } else { 24 };
        assert_eq!(same_teledyne(&pings, &rows), (24, turned), "{case:?}");
    }
}

/// Gives the bottom track of a sample valid values, since its own never saw the bottom.
fn with_bottom(bytes: &[u8]) -> Vec<u8> {
    let (mut out, mut at, mut count) = (Vec::new(), 0, 0);
    while at + 10 <= bytes.len() && bytes[at] == 0xa5 {
        let size = usize::from(u16::from_le_bytes([bytes[at + 4], bytes[at + 5]]));
        let Some(record) = bytes.get(at..at + 10 + size) else { break };
        if record[2] == 0x17 {
            let mut content = record[10..].to_vec();
            let data = usize::from(content[1]);
            for k in 0..4 {
                let mut put = |from: usize, new: &[u8]| {
                    content[from..from + new.len()].copy_from_slice(new);
                };
                let lost = (count + k) % 7 == 0;
                let merit = if lost { u16::MAX } else { 5 + k as u16 };
                put(data + 4 * k, &(1000 * (count as i32) - 70_000 * k as i32).to_le_bytes());
                put(data + 16 + 4 * k, &(20_000 + 10 * k as i32 + count as i32).to_le_bytes());
                put(data + 32 + 2 * k, &merit.to_le_bytes());
            }
            count += 1;
            out.extend(ad2cp(0x17, &content, false));
        } else {
            out.extend(record);
        }
        at += record.len();
    }
    out
}

#[test]
fn ad2cp_samples_equal_dolfyn_as_recorded_and_with_a_bottom() {
    let Some((folder, python)) = samples("ad2cp").zip(python()) else { return };
    let recorded = std::fs::read(folder.join("VelEchoBT01.ad2cp")).unwrap();
    let files = [with_bottom(&recorded), recorded];
    let read_by_dolfyn = dolfyn_of_bytes(&python, &files, "ad2cp");
    for ((bytes, seen), rows) in files.iter().zip([true, false]).zip(read_by_dolfyn) {
        let (pings, _) = read(Format::Ad2cp, bytes);
        assert_eq!(rows.len(), 159);
        // dolfyn leaves out the ensemble that the end of the file cuts off
        assert!((rows.len()..rows.len() + 2).contains(&pings.len()), "{}", pings.len());
        for (k, (ping, row)) in pings.iter().zip(&rows).enumerate() {
            let Stamp::Date(nanos) = ping.stamp else { panic!("ping {k} has no date") };
            assert!((nanos - row.nanos).abs() < 1000, "ping {k}: {nanos}, {}", row.nanos);
            let a = ping.attitude.unwrap();
            for (ours, theirs) in [a.heading, a.pitch, a.roll].into_iter().zip(row.attitude) {
                same(Some(ours.to_degrees()), theirs, |_| false, "attitude", k);
            }
            let track: TrackedVelocity = ping.bottom.unwrap();
            assert_eq!(track.coordinates, Coordinates::Beam);
            for i in 0..4 {
                let lost = row.merit[i] == 65_535.0 || row.range[i] <= 0.0;
                assert_eq!(track.recorded[i].is_some(), seen && !lost, "ping {k}");
                same(track.recorded[i], row.velocity[i], |_| lost, "velocity", k);
                same(track.range[i], row.range[i], |r| r <= 0.0, "range", k);
            }
            same(ping.sound_speed, row.sound_speed, |_| false, "speed of sound", k);
        }
    }
    for name in ["Sig1000_online.ad2cp", "Sig1000_dp_echo.ad2cp", "Sig_SkippedPings01.ad2cp"] {
        let (pings, damage) = read(Format::Ad2cp, &std::fs::read(folder.join(name)).unwrap());
        // no bottom track, and the samples end within a record
        assert_eq!(pings.len(), 0, "{name}");
        assert!(damage.gaps() <= 2, "{name}: {:?}", damage.describe("record"));
    }
}

#[test]
fn the_log_of_an_a50_is_read_around_its_flaws() {
    let Some(folder) = samples("waterlinked") else { return };
    let bytes = std::fs::read(folder.join("a50_log_2021.json")).unwrap();
    let (pings, damage) = read(Format::WaterLinkedJson, &bytes);
    // an independent count with Python's json: 412 objects, 13 of them equal to the one before, and
    // one at 30813 with a line break within a string
    assert!(pings.len() > 200, "{}", pings.len());
    assert!(
        damage.first().any(|g| (30_800..30_814).contains(&g.offset)),
        "{:?}",
        damage.describe("report")
    );
    assert!(pings.iter().all(|p| matches!(p.stamp, Stamp::Elapsed(_))));
}
