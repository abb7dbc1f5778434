//! The table and the pictures of `docs/src/explanation/gallery.md`: public recordings that `import` reads.
//!
//! `UPDATE=1 cargo test --workspace --test program gallery` writes them anew, with the recordings at hand.

use crate::common::{data, navfuse, root, stderr, stdout};
use navfuse_figures::{Axis, Curve, Figure, Look, Panel, svg};
use std::path::Path;

/// A recording: its name, its files below a folder of recordings, its answers, and the address and licence of the
/// original.
struct Recording {
    name: &'static str,
    folder: &'static str,
    files: &'static [&'static str],
    answers: &'static str,
    origin: &'static str,
}

const GALLERY: [Recording; 6] = [
    Recording {
        name: "drive",
        folder: "",
        files: &["drive/imu.csv", "formats/rtklib/drive_0708.pos"],
        answers: "",
        origin: "rtklibexplorer/GNSS_IMU, data/drive_0708, BSD-3-Clause",
    },
    Recording {
        name: "snapir",
        folder: "snapir/T01",
        files: &["imu.csv", "dvl.csv", "depth.csv", "reference.csv"],
        answers: "",
        origin: "ansfl/A-KIT, no licence stated",
    },
    Recording {
        name: "ring-laser",
        folder: "formats/psins",
        files: &["lasergyro.imu"],
        answers: "--position 34.246048,108.909664,380",
        origin: "WangShanpeng/PSINS, data/lasergyro.imu, BSD-2-Clause",
    },
    Recording {
        name: "cougars",
        folder: "formats",
        files: &["ros2-auv"],
        answers: "",
        origin: "BYU-FRoSt-Lab/cougars-ros2, Apache-2.0",
    },
    Recording {
        name: "ardusub",
        folder: "formats/dataflash",
        files: &["ardusub_small.BIN"],
        answers: "",
        origin: "clydemcqueen/ardusub_log_tools, MIT",
    },
    Recording {
        name: "copter",
        folder: "formats/dataflash",
        files: &["test.BIN"],
        answers: "",
        origin: "ArduPilot/pymavlink, a data file, LGPL-3.0",
    },
];

/// The row of a recording after its name: what `import` finds, and what the run is worth.
fn row(recording: &Recording, data: &Path, picture: bool) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("x.toml").display().to_string();
    let files: Vec<String> = recording
        .files
        .iter()
        .map(|file| data.join(recording.folder).join(file).display().to_string())
        .collect();
    let mut call = vec!["import"];
    call.extend(files.iter().map(String::as_str));
    call.extend(recording.answers.split_whitespace());
    call.extend(["--out", out.as_str()]);
    let imported = navfuse(&call);
    assert!(imported.status.success(), "{}: {}", recording.name, stderr(&imported));
    let printed = stdout(&imported) + &stderr(&imported);
    let questions = printed.matches("answer: ").count();
    let mut scenario = std::fs::read_to_string(&out).expect("the scenario");
    scenario += "[sink.csv]\n";
    std::fs::write(&out, scenario).expect("the test can write");
    let runs = folder.path().join("runs").display().to_string();
    let run = navfuse(&["run", &out, "--out", &runs, "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&stdout(&run)).expect("JSON");
    if picture {
        draw(recording.name, &folder.path().join("runs").join("estimate.csv"));
    }
    let sensors: Vec<&str> =
        json["samples"].as_object().expect("sensors").keys().map(String::as_str).collect();
    let seconds = json["duration_s"].as_f64().expect("a duration");
    let level = json["verdict"]["level"].as_str().expect("a verdict").replace('_', " ");
    format!("{} | {seconds:.0} s | {questions} | {level} |", sensors.join(", "))
}

/// Draws the track and the heading of a run.
fn draw(name: &str, estimates: &Path) {
    let text = std::fs::read_to_string(estimates).expect("the estimates");
    let mut lines = text.lines();
    let headings: Vec<&str> = lines.next().expect("headings").split(',').collect();
    let column = |name: &str| headings.iter().position(|h| *h == name).expect(name);
    let columns = [
        "time_s",
        "ins.position.latitude_deg",
        "ins.position.longitude_deg",
        "ins.attitude.yaw_sigma_deg",
    ]
    .map(column);
    let rows: Vec<[f64; 4]> = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.map(|k| cells[k].parse().unwrap_or(f64::NAN))
        })
        .collect();
    let rows: Vec<[f64; 4]> = rows.iter().step_by(rows.len().div_ceil(300)).copied().collect();
    let [begin, lat0, lon0, ..] = rows[0];
    let degree = 111_320.0;
    let place = |row: &[f64; 4]| {
        [(row[2] - lon0) * degree * lat0.to_radians().cos(), (row[1] - lat0) * degree]
    };
    let curve = |name: &str, look, points: Vec<[f64; 2]>| Curve { name: name.into(), look, points };
    let panel =
        |title: &str, x, y, curves| Panel { title: title.into(), x, y, curves, bands: Vec::new() };
    let track = rows.iter().map(place).collect();
    let of_time = |k: usize| rows.iter().map(|row| [row[0] - begin, row[k]]).collect();
    let figure = Figure {
        name: name.into(),
        title: String::new(),
        columns: 2,
        panels: vec![
            panel(
                "Track",
                Axis::map("east [m]"),
                Axis::map("north [m]"),
                vec![curve("estimate", Look::Data(0), track)],
            ),
            panel(
                "Uncertainty of the heading",
                Axis::linear("time [s]"),
                Axis::logarithmic("1 sigma [deg]"),
                vec![curve("sigma", Look::Sigma, of_time(3))],
            ),
        ],
    };
    let path = root().join("docs/src/images/gallery").join(format!("{name}.svg"));
    std::fs::write(path, svg(&figure).expect("a figure")).expect("the test can write");
}

/// The table in the page is that of the recordings at hand; a recording that is not there keeps its row.
#[test]
fn the_gallery_has_what_import_and_run_make_of_each_recording() {
    let path = root().join("docs/src/explanation/gallery.md");
    let mut page = std::fs::read_to_string(&path).expect("the page");
    let update = std::env::var_os("UPDATE").is_some();
    let mut wrong = Vec::new();
    for recording in &GALLERY {
        let first = recording.files[0].split('/').next().filter(|_| recording.folder.is_empty());
        let origin = format!("Its public original is {}", recording.origin);
        let Some(folder) = data(first.unwrap_or(recording.folder), &origin) else { continue };
        let depth = first.unwrap_or(recording.folder).split('/').count();
        let data = folder.ancestors().nth(depth).expect("the folder of all recordings");
        let begin = format!("| [{0}](#{0}) | ", recording.name);
        let new = begin.clone() + &row(recording, data, update);
        let old = page.lines().find(|line| line.starts_with(&begin)).unwrap_or_default().to_owned();
        if old != new {
            page = page.replace(&old, &new);
            wrong.push(format!("{old}\n{new}"));
        }
    }
    if update {
        std::fs::write(&path, page).expect("the test can write");
    } else {
        assert!(wrong.is_empty(), "UPDATE=1 writes the page anew:\n{}", wrong.join("\n"));
    }
}
