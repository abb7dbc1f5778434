//! The viewer shows a run: the recording in the real viewer, without a display, view by view.
//!
//! The viewers are those of `$RERUN_BIN`, or are fetched once with pip into the target folder; they
//! render in software with Mesa's Vulkan driver. Without either, a test prints so and passes.

use crate::common::Synthetic;
use crate::driver::control::Seen;
use crate::driver::{self, Layout, SECONDS, Viewer, whole};
use navfuse_rerun::re_sdk::{StoreKind, TimelineName};
use navfuse_rerun::re_sdk_types::archetypes::Scalars;
use navfuse_viewer::Viewer as Config;
use re_chunk_store::{ChunkStore, ChunkStoreConfig};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

const RED: [u8; 3] = [235, 64, 82];
const BEAM: [u8; 3] = [240, 228, 66];
const GREEN: [u8; 3] = [38, 166, 91];
const BLUE: [u8; 3] = [56, 132, 255];
const TRUTH: [u8; 3] = [245, 166, 35];
const BOUND: [u8; 3] = [140, 148, 160];
const GATED: [u8; 3] = [255, 0, 200];
const BAND: [u8; 3] = [0, 158, 115];
const USED: [u8; 3] = [0, 158, 115];
const MARK: [u8; 3] = [225, 228, 232];
/// The colours of gated and isolated in a strip, which is drawn at 200 of 255 of its brightness.
const STRIP: [[u8; 3]; 2] = [[200, 0, 157], [125, 16, 47]];

/// The names of views, and the colours that each shows.
type Views = &'static [(&'static str, &'static [[u8; 3]])];

/// The pages, by the names of the tabs that lead there.
const PAGES: &[(&[&str], Views)] = &[
    (
        &["Overview"],
        &[
            ("From above; ", &[TRUTH, MARK]),
            ("Follows the vehicle", &[BEAM]),
            ("Verdict and reasons", &[]),
            ("Health of the sensors", &[USED, STRIP[0], STRIP[1]]),
            ("States at the end", &[]),
        ],
    ),
    (
        &["Track"],
        &[
            ("3-D track", &[TRUTH, MARK]),
            ("3-D, follows the vehicle; ", &[BEAM]),
            ("Map, lines every ", &[TRUTH, RED]),
        ],
    ),
    (
        &["Navigation states", "Attitude"],
        &[
            ("roll error [deg]", &[RED, BOUND]),
            ("pitch error, end [deg]", &[GREEN, BOUND]),
            ("yaw sigma [10^y deg]", &[BLUE]),
            ("roll [deg]", &[TRUTH, BOUND]),
            ("yaw [deg]", &[TRUTH, BOUND]),
        ],
    ),
    (
        &["Navigation states", "Velocity"],
        &[("north error [mm/s]", &[RED, BOUND]), ("down error, end [mm/s]", &[BLUE, BOUND])],
    ),
    (
        &["Navigation states", "Position"],
        &[("east error [m]", &[GREEN, BOUND]), ("down [m]", &[TRUTH])],
    ),
    (&["Navigation states", "Gyro bias"], &[("x [deg/h]", &[RED, TRUTH, BOUND])]),
    (&["Navigation states", "Accel bias"], &[("z, end [ug]", &[BLUE, TRUTH, BOUND])]),
    (
        &["Calibration states", "dvl: scale, misalignment"],
        &[("scale, end", &[RED, TRUTH, BOUND]), ("misalignment yaw [deg]", &[BLUE, TRUTH, BOUND])],
    ),
    (&["Calibration states", "dvl: lever arm"], &[("y [m]", &[GREEN, TRUTH, BOUND])]),
    (
        &["Sensors", "dvl"],
        &[
            ("innovation of dvl velocity x [mm/s]", &[RED, BOUND, GATED]),
            ("dvl NIS per channel [10^y]", &[BLUE, MARK, BAND, GATED]),
        ],
    ),
    (&["Sensors", "depth"], &[("innovation of depth [mm]", &[RED, BOUND])]),
    (&["Sensors", "Samples"], &[("dvl samples [m/s]", &[RED, GREEN, BLUE])]),
    (&["Observability"], &[("What is determined", &[])]),
    (
        &["Quality", "dvl"],
        &[
            ("velocity x, ±5 sigma [%]; white: normal", &[MARK]),
            ("velocity x, correlation by lag; grey: chance", &[]),
        ],
    ),
    (&["Events"], &[]),
];

/// The number of pixels of a colour. A line between two rows of pixels is blended with its
/// neighbours; the colours differ by at least 80 in some channel, so half of that separates them.
fn count(picture: &image::RgbImage, colour: [u8; 3]) -> usize {
    picture.pixels().filter(|p| (0..3).all(|k| p[k].abs_diff(colour[k]) <= 40)).count()
}

/// The least number of pixels: a line crosses a plot of 300 pixels or more, and at least a third of
/// it is visible between other lines and grid; arrows and marks are 20 pixels or more.
fn least(view: &str, colour: [u8; 3]) -> usize {
    let mark = view.starts_with("3-D") || view.starts_with("From above") || view.starts_with("Map");
    if mark && colour != TRUTH { 20 } else { 100 }
}

/// Records a synthetic run into a folder.
fn recorded(folder: &Path) -> PathBuf {
    let mut sink = Config::default().record(folder).unwrap();
    Synthetic::new(6000).feed(sink.as_mut()).unwrap();
    sink.finish().unwrap();
    folder.join("run.rrd")
}

#[test]
fn every_series_of_a_run_is_drawn_in_its_colour() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures");
    let recording = recorded(&folder);
    let layout = Layout::read(&recording);
    let end = Synthetic::time(5999).nanos();
    let mut viewer = Viewer::start(&program, Some(&recording.display().to_string()), &folder);
    viewer.wait(end);
    viewer.seek(end);
    let mut missing = Vec::new();
    for (page, views) in PAGES {
        viewer.show(&layout, page);
        let tab = page.join(" - ");
        viewer.settled(&tab);
        for (view, colours) in *views {
            let id = layout.view(view);
            let picture = viewer.screenshot(Some(id), &format!("{tab} - {view}"));
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

/// The places of views in the window of 1600x1000, as shares of its width and height: the view that
/// follows the vehicle, and the strips of health without their names at the left.
const FOLLOWS: [f64; 4] = [0.25, 0.1, 0.465, 0.6];
const STRIPS: [f64; 4] = [0.03, 0.66, 0.44, 0.96];

fn part(window: &image::RgbImage, [left, top, right, bottom]: [f64; 4]) -> image::RgbImage {
    let (w, h) = (f64::from(window.width()), f64::from(window.height()));
    let [x, y, width, height] =
        [left * w, top * h, (right - left) * w, (bottom - top) * h].map(|x| x as u32);
    image::imageops::crop_imm(window, x, y, width, height).to_image()
}

/// Both sensors are used over the whole run, each in a strip of 20 rows: nearly all of both halves of the
/// strips is green.
fn whole_strips(strips: &image::RgbImage, folder: &Path) {
    let half = strips.width() / 2;
    for left in [0, half] {
        let half = image::imageops::crop_imm(strips, left, 0, half, strips.height()).to_image();
        let green = count(&half, USED) as f64 / (20.0 * f64::from(half.width()));
        assert!(green > 2.0 * 0.8, "{green} strips: see {}", folder.display());
    }
}

/// The strips of a run that goes on are where those of a run are that is over. Viewers since 0.41 show 30 s
/// around the cursor unless all views have a range, and 30 of 600 s would leave the right half empty.
#[test]
fn every_version_of_the_viewer_shows_the_whole_health_of_a_run_that_goes_on() {
    let Some(programs) = driver::programs() else { return };
    for (k, program) in programs.iter().enumerate() {
        let folder = driver::target(&format!("rerun-pictures/goes-on-{k}"));
        let mut viewer = Seen::start(program, None, &folder);
        let config = Config { connect: Some(viewer.address()), ..Config::default() };
        let mut sink = config.record(&folder).unwrap();
        Synthetic::new(6000).feed(sink.as_mut()).unwrap();
        // the last rows are sent when the run ends
        viewer.wait(Synthetic::time(4000).nanos());
        whole_strips(&part(&viewer.settled("goes on"), STRIPS), &folder);
    }
}

/// A recording as it opens, before anything is clicked: it verifies, its cursor stands at its end,
/// and the strips of health have the whole run. The eye follows the vehicle, whose beams are in the
/// middle third of their view, wherever the vehicle is; the whole vehicle is visible.
#[test]
fn every_version_of_the_viewer_opens_a_recording_at_its_end_and_follows_the_vehicle() {
    let Some(programs) = driver::programs() else { return };
    for (k, program) in programs.iter().enumerate() {
        let folder = driver::target(&format!("rerun-pictures/version-{k}"));
        let recording = recorded(&folder);
        let verified = Command::new(program).args(["rrd", "verify"]).arg(&recording).output();
        let verified = verified.unwrap();
        let text = String::from_utf8_lossy(&verified.stderr);
        assert!(verified.status.success(), "{text}");
        let end = Synthetic::time(5999).nanos();
        let mut viewer = Seen::open(program, &recording, &folder, end);
        let window = viewer.settled("as it opens");
        assert_eq!(viewer.cursor(), Some(whole(end)), "{}", program.display());
        whole_strips(&part(&window, STRIPS), &folder);
        for at in [1500, 4500] {
            viewer.seek(Synthetic::time(at).nanos());
            let picture = part(&viewer.settled(&format!("vehicle at {at}")), FOLLOWS);
            let (w, h) = (picture.width() / 3, picture.height() / 3);
            let middle = image::imageops::crop_imm(&picture, w, h, w, h).to_image();
            assert!(count(&middle, BEAM) >= 20, "{at}: see {}", folder.display());
            // the hull, which is the brightest part, is not cut off
            let (w, h) = picture.dimensions();
            let edge =
                |x: u32, y: u32| x < w / 40 || y < h / 40 || x >= w - w / 40 || y >= h - h / 40;
            let bright = picture
                .enumerate_pixels()
                .filter(|(x, y, p)| edge(*x, *y) && p.0.iter().all(|c| *c > 170));
            assert!(bright.count() < 20, "{at}: see {}", folder.display());
        }
    }
}

/// The scalars of a recording: entities with the times, s, of their finite values.
fn scalars(recording: &Path) -> BTreeMap<String, Vec<i64>> {
    let mut file = std::fs::File::open(recording).unwrap();
    let stores = ChunkStore::from_rrd_reader(&ChunkStoreConfig::ALL_DISABLED, &mut file).unwrap();
    let component = Scalars::descriptor_scalars().component;
    let mut times = BTreeMap::<_, Vec<i64>>::new();
    for store in stores.values().filter(|s| s.id().kind() == StoreKind::Recording) {
        for chunk in store.iter_physical_chunks() {
            let rows = chunk.iter_component_indices(TimelineName::from(SECONDS), component);
            let finite = rows
                .zip(chunk.iter_slices::<f32>(component))
                .filter(|(_, values)| values.iter().any(|v| v.is_finite()))
                .map(|((time, _), _)| time.as_i64());
            let entity = chunk.entity_path().to_string();
            times.entry(entity).or_default().extend(finite);
        }
    }
    times
}

/// The ticks that the viewer labels: it puts ticks at multiples of powers of ten, and labels those
/// of the smallest power whose ticks are more than 20 points apart. Labels within 6 points of the
/// edge are cut.
fn labelled_ticks([low, high]: [f64; 2], height: f64) -> usize {
    let mut step = 1e-12;
    while step / (high - low) * height <= 20.0 {
        step *= 10.0;
    }
    let edge = 6.0 / height * (high - low);
    let inside = |k: i64| (low + edge..=high - edge).contains(&(k as f64 * step));
    let first = (low / step).floor() as i64;
    (first..=first + 400).filter(|k| inside(*k)).count()
}

#[test]
fn every_plot_has_three_labelled_ticks_and_data_and_a_title_that_fits() {
    let folder = driver::target("rerun-pictures/layout");
    let recording = match std::env::var_os("NAVFUSE_RECORDING") {
        Some(path) => Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path),
        None => recorded(&folder),
    };
    let (layout, data) = (Layout::read(&recording), scalars(&recording));
    let views = driver::geometry::views(&layout);
    let mut wrong = Vec::new();
    let mut plots = 0;
    for view in &views {
        // a letter is 7 pixels wide on the average; icons before and behind need 120
        if 7.0 * view.name.chars().count() as f64 + 120.0 > view.width {
            wrong.push(format!("the title {:?} needs more than {} px", view.name, view.width));
        }
        let Some(range) = view.range else { continue };
        plots += 1;
        let ticks = labelled_ticks(range, view.height);
        if ticks < 3 {
            wrong.push(format!("{}: {ticks} ticks in {range:?}, {} px", view.name, view.height));
        }
        for query in &view.contents {
            let path = query.trim_start_matches("+ ");
            let holds = |entity: &String| match path.strip_suffix("/**") {
                Some(above) => entity.starts_with(&format!("{above}/")) || entity == above,
                None => entity == path,
            };
            // a truth may be unknown; what is plotted beside it is not
            let optional = path.ends_with("/truth");
            if !optional && !data.iter().any(|(entity, times)| holds(entity) && !times.is_empty()) {
                wrong.push(format!("{}: no data for {query}", view.name));
            }
        }
    }
    for (k, a) in views.iter().enumerate() {
        if views[..k].iter().any(|b| b.name == a.name && b.container == a.container) {
            wrong.push(format!("two views named {:?} side by side", a.name));
        }
    }
    // 22 components: three plots for constants, four for the attitude, velocity and position
    assert!(std::env::var_os("NAVFUSE_RECORDING").is_some() || plots > 70, "{plots} plots");
    assert!(wrong.is_empty(), "{wrong:#?}");
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
