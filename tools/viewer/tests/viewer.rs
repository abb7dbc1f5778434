//! The viewer shows a run: the recording in the real viewer, without a display, view by view.
//!
//! The viewer is `$RERUN_BIN`, or is fetched once with pip into the target folder; it renders in
//! software with Mesa's Vulkan driver. Where either is not available the test prints so and passes.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test ends where it fails"
)]

#[path = "../../../plugins/rerun/tests/common/mod.rs"]
mod common;
mod driver;

use common::Synthetic;
use driver::{Layout, Viewer};
use navfuse_viewer::Viewer as Config;

const RED: [u8; 3] = [235, 64, 82];
const GREEN: [u8; 3] = [38, 166, 91];
const BLUE: [u8; 3] = [56, 132, 255];
const TRUTH: [u8; 3] = [245, 166, 35];
const BOUND: [u8; 3] = [140, 148, 160];
const GATED: [u8; 3] = [255, 0, 200];

/// The names of views, and the colours that each shows.
type Views = &'static [(&'static str, &'static [[u8; 3]])];

/// The tabs.
const TABS: &[(&str, Views)] = &[
    ("3-D track", &[("3-D track", &[BLUE, TRUTH, RED, GREEN])]),
    ("Map", &[("Map", &[BLUE, TRUTH, RED])]),
    (
        "Attitude",
        &[
            ("roll error [deg]", &[RED, BOUND]),
            ("pitch error [deg]", &[GREEN, BOUND]),
            ("yaw error [deg]", &[BLUE, BOUND]),
            ("roll [deg]", &[TRUTH, BOUND]),
            ("yaw [deg]", &[TRUTH, BOUND]),
        ],
    ),
    ("Velocity", &[("north error [m/s]", &[RED, BOUND]), ("down error [m/s]", &[BLUE, BOUND])]),
    ("Position", &[("east error [m]", &[GREEN, BOUND]), ("down [m]", &[TRUTH])]),
    ("Gyro bias", &[("x [deg/h]", &[RED, TRUTH, BOUND])]),
    ("Accel bias", &[("z [ug]", &[BLUE, TRUTH, BOUND])]),
    (
        "dvl calibration",
        &[
            ("Scale k", &[RED, TRUTH, BOUND]),
            ("Misalignment yaw [deg]", &[BLUE, TRUTH, BOUND]),
            ("Lever arm y [m]", &[GREEN, TRUTH, BOUND]),
        ],
    ),
    (
        "dvl innovations",
        &[("vel_x [m/s]", &[RED, BOUND, GATED]), ("dvl NIS", &[BLUE, BOUND, GATED])],
    ),
    ("depth innovations", &[("depth [m]", &[RED, BOUND])]),
    (
        "Observability",
        // roll and pitch of the run have the same sigma: one line hides the other
        &[
            ("ins.attitude bits", &[RED, BLUE]),
            ("dvl.scale bits", &[RED]),
            ("What is determined", &[]),
        ],
    ),
    ("Samples", &[("dvl", &[RED, GREEN, BLUE])]),
];

/// The number of pixels of a colour. A line between two rows of pixels is blended with its
/// neighbours; the colours differ by at least 80 in some channel, so half of that separates them.
fn count(picture: &image::RgbImage, colour: [u8; 3]) -> usize {
    picture.pixels().filter(|p| (0..3).all(|k| p[k].abs_diff(colour[k]) <= 40)).count()
}

/// The least number of pixels: a line crosses a plot of 300 pixels or more, and at least a third of
/// it is visible between other lines and grid; the arrows of the vehicle, red and green, are 20
/// pixels or more.
fn least(view: &str, colour: [u8; 3]) -> usize {
    if view == "3-D track" && (colour == RED || colour == GREEN) { 20 } else { 100 }
}

#[test]
fn every_series_of_a_run_is_drawn_in_its_colour() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures");
    let mut sink = Config::default().record(&folder).unwrap();
    Synthetic::new(6000).feed(sink.as_mut()).unwrap();
    sink.finish().unwrap();
    let recording = folder.join("run.rrd");
    let layout = Layout::read(&recording);
    let end = Synthetic::time(5999).nanos();
    let mut viewer = Viewer::start(&program, Some(&recording.display().to_string()), &folder);
    viewer.wait(end);
    viewer.seek(end);
    let mut missing = Vec::new();
    for (tab, views) in TABS {
        viewer.show(&layout, &[tab]);
        viewer.screenshot(None, tab);
        for (view, colours) in *views {
            let picture = viewer.screenshot(Some(&layout.views[*view]), &format!("{tab} - {view}"));
            for colour in *colours {
                let n = count(&picture, *colour);
                if n < least(view, *colour) {
                    missing.push(format!("{view}: {n} pixels of {colour:?}"));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}\nsee {}", folder.display());
}

#[test]
fn a_viewer_shows_a_run_that_is_sent_to_it() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures/live");
    let mut viewer = Viewer::start(&program, None, &folder);
    let config = Config { connect: Some(viewer.address()), ..Config::default() };
    let mut sink = config.record(&folder).unwrap();
    Synthetic::new(500).feed(sink.as_mut()).unwrap();
    sink.finish().unwrap().unwrap();
    drop(sink);
    viewer.wait(Synthetic::time(499).nanos());
}

#[cfg(feature = "serve")]
#[test]
fn a_viewer_shows_a_run_that_is_sent_and_served_to_it() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures/served");
    let mut viewer = Viewer::start(&program, None, &folder);
    let connect = Some(viewer.address());
    let serve = navfuse_rerun::Serve::At("127.0.0.1:0".into());
    let mut sink = Config { connect, serve, ..Config::default() }.record(&folder).unwrap();
    Synthetic::new(500).feed(sink.as_mut()).unwrap();
    let place = sink.finish().unwrap().unwrap();
    drop(sink);
    let end = Synthetic::time(499).nanos();
    viewer.wait(end);
    drop(viewer);
    // the server still has the run when the run is over
    let url = place
        .split("url=")
        .nth(1)
        .unwrap()
        .replace("%2B", "+")
        .replace("%3A", ":")
        .replace("%2F", "/");
    Viewer::start(&program, Some(&url), &folder).wait(end);
}

/// Makes the pictures of the documentation from a recording:
/// `NAVFUSE_RECORDING=runs/pan-wu-3d/run.rrd NAVFUSE_TAB="dvl calibration" \
/// cargo test -p navfuse-viewer --test viewer -- --ignored`
#[test]
#[ignore = "makes a picture, tests nothing"]
fn picture_of_a_recording() {
    let (Some(program), Some(recording)) =
        (driver::program(), std::env::var_os("NAVFUSE_RECORDING"))
    else {
        return;
    };
    let tab = std::env::var("NAVFUSE_TAB").unwrap_or_else(|_| "dvl calibration".into());
    let recording = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(recording);
    let folder = driver::target("rerun-pictures");
    let layout = Layout::read(&recording);
    let mut viewer = Viewer::start(&program, Some(&recording.display().to_string()), &folder);
    std::thread::sleep(std::time::Duration::from_secs(5));
    viewer.show(&layout, &[&tab]);
    viewer.screenshot(None, "recording");
    println!("{}", folder.join("recording.png").display());
}
