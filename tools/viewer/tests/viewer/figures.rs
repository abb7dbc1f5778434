//! A recording of figures holds their values, and the real viewer shows them; `run.rs` lists the
//! programs that the test requires.

use crate::driver::{self, Layout, SECONDS, Viewer};
use navfuse_figures::{Axis, Band, Curve, Figure, Look, Panel, Track, TrackPoint};
use navfuse_rerun::re_sdk::{EntityPath, StoreKind, TimelineName};
use navfuse_rerun::re_sdk_types::archetypes::{Points3D, Scalars, Transform3D};
use navfuse_viewer::figures::{Overview, record};
use re_chunk_store::{ChunkStore, ChunkStoreConfig};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

const POINTS: usize = 300;
const STEP: f64 = 6.9;

fn curve(name: &str, look: Look, f: impl Fn(f64) -> f64) -> Curve {
    let points = (0..POINTS).map(|k| STEP * k as f64).map(|t| [t, f(t)]).collect();
    Curve { name: name.into(), look, points }
}

fn panel(title: &str, y: Axis, curves: Vec<Curve>) -> Panel {
    Panel { title: title.into(), x: Axis::time(), y, curves, bands: Vec::new() }
}

/// The error of a state and its bounds, the mean NEES and its band, and a track, which has no time
/// axis.
fn figures() -> Vec<Figure> {
    let sigma = |t: f64| 0.02 + (-t / 300.0).exp();
    let error = |title: &str, phase: f64| {
        let curves = vec![
            curve("error", Look::Data(0), move |t| 1.5 * sigma(t) * (t / 40.0 + phase).sin()),
            curve("±3 sigma", Look::Sigma, move |t| 3.0 * sigma(t)),
            curve("±3 sigma", Look::Sigma, move |t| -3.0 * sigma(t)),
        ];
        panel(title, Axis::linear("error [deg]"), curves)
    };
    let decay = vec![
        curve("rms error", Look::Data(1), move |t| sigma(t) * 1.3),
        curve("mean sigma", Look::Sigma, sigma),
        curve("limit", Look::Bound, |t| if t < 1000.0 { f64::NAN } else { 0.01 }),
    ];
    let mut errors: Vec<Panel> = ["roll", "pitch", "yaw"]
        .into_iter()
        .zip([0.0, 1.0, 2.0])
        .map(|(n, p)| error(n, p))
        .collect();
    errors.push(panel("yaw", Axis::logarithmic("sigma [deg]"), decay));
    let nees = Panel {
        bands: vec![Band {
            name: "95 %".into(),
            points: (0..2).map(|k| [2000.0 * f64::from(k), 0.8, 1.2]).collect(),
        }],
        ..panel(
            "NEES",
            Axis::linear("NEES / n"),
            vec![curve("mean NEES", Look::Data(2), |t| 1.0 + 0.3 * (t / 17.0).sin())],
        )
    };
    let track = Panel {
        x: Axis::linear("east [m]"),
        ..panel("track", Axis::linear("north [m]"), vec![curve("truth", Look::Truth, |t| t)])
    };
    let points = vec![
        curve("innovation", Look::Points(0), |t| (t * t).sin()),
        curve("truth", Look::Truth, |t| 0.5 * (t / 300.0).cos()),
    ];
    let figure = |name: &str, title: &str, columns, panels| Figure {
        name: name.into(),
        title: title.into(),
        columns,
        panels,
    };
    vec![
        figure("errors", "Errors", 2, errors),
        figure(
            "consistency",
            "Consistency",
            1,
            vec![nees, track.clone(), panel("vel_x", Axis::linear("[m/s]"), points)],
        ),
        figure("track", "Track", 1, vec![track]),
    ]
}

/// The times, s, and values of every entity, by its path.
fn scalars(path: &Path) -> BTreeMap<String, Vec<(f64, f64)>> {
    let stores = ChunkStore::from_rrd_reader(
        &ChunkStoreConfig::ALL_DISABLED,
        &mut File::open(path).unwrap(),
    )
    .unwrap();
    let component = Scalars::descriptor_scalars().component;
    let mut rows = BTreeMap::<_, Vec<_>>::new();
    for store in stores.values().filter(|s| s.id().kind() == StoreKind::Recording) {
        for chunk in store.iter_physical_chunks() {
            // a short recording has the clock
            let of = |name: &'static str| {
                chunk.iter_component_indices(TimelineName::from(name), component)
            };
            let seconds = of(SECONDS).map(|(t, _)| t.as_i64() as f64);
            let times = seconds.chain(of("t").map(|(t, _)| t.as_i64() as f64 / 1e9));
            let values = chunk.iter_slices::<f32>(component).map(|v| f64::from(v[0]));
            let parts: Vec<_> =
                chunk.entity_path().iter().map(|part| part.unescaped_str()).collect();
            let of = rows.entry(parts.join("/")).or_default();
            of.extend(times.zip(values));
        }
    }
    rows.retain(|_, r| !r.is_empty());
    rows
}

/// Compares rows with points: times to the nanosecond or in whole seconds, values as numbers of 32 bits.
fn same(rows: &[(f64, f64)], points: &[[f64; 2]]) -> bool {
    let equal = |a: f64, b: f64| a == f64::from(b as f32) || (a.is_nan() && b.is_nan());
    let at = |a: f64, b: f64| (a - b).abs() <= 1e-9 || a == b.floor();
    rows.len() == points.len()
        && rows.iter().zip(points).all(|(r, p)| at(r.0, p[0]) && equal(r.1, p[1]))
}

/// A sigma from 1 to 1.1 m is a line from 0 to 0.04 on an axis of decimal logarithms.
#[test]
fn a_logarithmic_axis_of_a_part_of_a_decade_is_linear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figures.rrd");
    let sigma = |f: fn(f64) -> f64| vec![curve("sigma", Look::Sigma, f)];
    let panels = vec![
        panel("north", Axis::logarithmic("m"), sigma(|t| 1.0 + t / 20_000.0)),
        panel("down", Axis::logarithmic("m"), sigma(|t| 1.0 + t)),
    ];
    let figure = Figure { name: "bound".into(), title: "Bound".into(), columns: 2, panels };
    record(&path, "a bound", None, &[], std::slice::from_ref(&figure)).unwrap();
    assert!(same(&scalars(&path)["bound/north/sigma"], &figure.panels[0].curves[0].points));
    let views: Vec<String> = Layout::read(&path).views.into_keys().collect();
    assert!(views.contains(&"north [m]".to_owned()), "{views:?}");
    assert!(views.iter().any(|view| view.starts_with("down [10^y m]")), "{views:?}");
}

#[test]
fn a_recording_holds_every_point_of_the_panels_over_time_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/figures.rrd");
    let figures = figures();
    record(&path, "a campaign", None, &[], &figures).unwrap();
    let rows = scalars(&path);
    let expected = [
        "consistency/NEES/95 %/lower",
        "consistency/NEES/95 %/upper",
        "consistency/NEES/mean NEES",
        "consistency/vel_x/innovation",
        "consistency/vel_x/truth",
        "errors/pitch/error",
        "errors/pitch/±3 sigma",
        "errors/pitch/±3 sigma 2",
        "errors/roll/error",
        "errors/roll/±3 sigma",
        "errors/roll/±3 sigma 2",
        "errors/yaw 2/limit",
        "errors/yaw 2/mean sigma",
        "errors/yaw 2/rms error",
        "errors/yaw/error",
        "errors/yaw/±3 sigma",
        "errors/yaw/±3 sigma 2",
    ];
    assert_eq!(rows.keys().collect::<Vec<_>>(), expected);
    for (k, name) in ["error", "±3 sigma", "±3 sigma 2"].iter().enumerate() {
        assert!(
            same(&rows[&format!("errors/pitch/{name}")], &figures[0].panels[1].curves[k].points),
            "{name}"
        );
    }
    assert!(same(&rows["consistency/NEES/95 %/upper"], &[[0.0, 1.2], [2000.0, 1.2]]));
    // a logarithmic axis: decimal logarithms, and the gap remains
    let limit: Vec<_> =
        figures[0].panels[3].curves[2].points.iter().map(|p| [p[0], p[1].log10()]).collect();
    assert!(same(&rows["errors/yaw 2/limit"], &limit));
    assert!(limit[0][1].is_nan() && limit[POINTS - 1][1] == -2.0);
    let layout = Layout::read(&path);
    assert!(
        layout.views.contains_key("roll: error [deg]")
            && layout.views.contains_key("yaw: sigma [10^y deg], -1 is 0.1 deg")
    );
    assert_eq!(
        layout.views.len(),
        6,
        "the track is no series over time: {:?}",
        layout.views.keys()
    );
}

#[test]
fn a_comparison_begins_with_its_page_and_the_vehicles_of_all_runs_in_one_scene() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("compare.rrd");
    let point = |k: i32, east: f64, roll_pitch_yaw| TrackPoint {
        time: f64::from(k),
        north_east_down: [10.0 * f64::from(k), east, 5.0],
        latitude_longitude: [43.0 + 9e-5 * f64::from(k), 5.0],
        roll_pitch_yaw,
    };
    let track = |name: &str, look, east, turn| Track {
        name: name.into(),
        look,
        points: (0..POINTS as i32).map(|k| point(k, east, turn)).collect(),
    };
    // B is 4 m east of A, and the truth has no attitude
    let turn = Some([0.0, 0.0, 90.0]);
    let tracks = [
        track("truth", Look::Truth, 0.0, None),
        track("A", Look::Data(0), 0.0, turn),
        track("B", Look::Data(2), 4.0, turn),
    ];
    let figures = figures();
    let overview = Overview { page: "# A against B", figure: Some(&figures[1]) };
    record(&path, "two runs", Some(&overview), &tracks, &figures[..1]).unwrap();
    let layout = Layout::read(&path);
    let pages = layout.pages();
    assert_eq!(pages[..2], [["Overview"], ["Track"]], "{pages:?}");
    let views = ["What differs", "Vehicles of all runs, 8.00 m long", "NEES: NEES / n"];
    let map = "Map, lines every 0.5' from 43°00.0'N 5°00.0'E";
    for view in views.iter().chain(&["3-D track, depth x 10", map]) {
        assert!(layout.views.contains_key(*view), "{view}: {:?}", layout.views.keys());
    }
    let stores = ChunkStore::from_rrd_reader(
        &ChunkStoreConfig::ALL_DISABLED,
        &mut File::open(path).unwrap(),
    )
    .unwrap();
    let store = stores.values().find(|s| s.id().kind() == StoreKind::Recording).unwrap();
    let rows = |parts: [&str; 3], component| {
        let of = |path: &EntityPath| path.iter().map(|p| p.unescaped_str()).eq(parts);
        let chunks = store.iter_physical_chunks().filter(|c| of(c.entity_path()));
        let times = chunks
            .map(|c| c.iter_component_indices(TimelineName::from(SECONDS), component).count());
        times.sum::<usize>()
    };
    let positions = Points3D::descriptor_positions().component;
    let places = Transform3D::descriptor_translation().component;
    for (name, turned) in [("1 truth", 0), ("2 A", POINTS), ("3 B", POINTS)] {
        assert_eq!(rows(["world", name, "now"], positions), POINTS, "{name}");
        assert_eq!(rows(["world", name, "vehicle"], places), turned, "{name}");
    }
    // each vehicle has the name of its run, and the eye sees the space around the first one
    let names = store.iter_physical_chunks().filter(|chunk| {
        let mut parts = chunk.entity_path().iter().map(|p| p.unescaped_str());
        parts.next_back() == Some("name")
    });
    let labels = Points3D::descriptor_labels().component;
    let texts = names.flat_map(|c| {
        let texts = c.iter_slices::<String>(labels).flatten();
        texts.map(|text| text.to_string()).collect::<Vec<_>>()
    });
    let mut names: Vec<String> = texts.collect();
    names.sort();
    assert_eq!(names, ["A", "B"]);
}

#[test]
fn what_has_no_time_breaks_a_line_after_the_point_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figures.rrd");
    let nan = f64::NAN;
    let points = vec![[nan, nan], [1.0, 5.0], [nan, nan], [2.0, 6.0], [3.0, f64::INFINITY]];
    let curve = Curve { name: String::new(), look: Look::Data(0), points };
    let panel = panel("", Axis::linear(""), vec![curve]);
    record(
        &path,
        "",
        None,
        &[],
        &[Figure { name: "f".into(), title: String::new(), columns: 0, panels: vec![panel] }],
    )
    .unwrap();
    assert!(same(
        &scalars(&path)["f/1/1"],
        &[[1.0, 5.0], [1.0 + 1e-9, nan], [2.0, 6.0], [3.0, nan]]
    ));
}

#[test]
fn a_recording_without_figures_opens_and_one_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figures.rrd");
    record(&path, "nothing", None, &[], &[]).unwrap();
    assert!(scalars(&path).is_empty());
    let error =
        record(Path::new("/dev/full"), "full", None, &[], &figures()).unwrap_err().to_string();
    assert!(error.contains("/dev/full"), "{error}");
}

#[test]
fn tabs_have_the_names_of_figures_whose_titles_need_more_than_a_bar() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tabs.rrd");
    let tabs = |count: usize| {
        let figure = |k: usize| Figure {
            name: format!("figure-{k}"),
            title: "x".repeat(40),
            ..figures().remove(0)
        };
        record(&path, "", None, &[], &(0..count).map(figure).collect::<Vec<_>>()).unwrap();
        Layout::read(&path).tabs.into_iter().map(|(_, name, _)| name).collect::<Vec<_>>()
    };
    assert!(tabs(4).contains(&"x".repeat(40)));
    let names = tabs(5);
    assert!(names.contains(&"figure-4".into()) && !names.contains(&"x".repeat(40)), "{names:?}");
}

#[test]
fn every_curve_of_every_figure_is_drawn_in_its_colour() {
    let Some(program) = driver::program() else { return };
    let folder = driver::target("rerun-pictures/figures");
    let path = folder.join("figures.rrd");
    record(&path, "a campaign", None, &[], &figures()).unwrap();
    let layout = Layout::read(&path);
    let mut viewer = Viewer::start(&program, Some(&path.display().to_string()), &folder);
    // 299 steps of 6.9 s
    let end = 2_063_100_000_000;
    viewer.wait(end);
    viewer.seek(end);
    let (bound, band) = ([140, 148, 160], Band::COLOUR);
    let [blue, red, green] = [0, 1, 2].map(|k| Look::Data(k).colour());
    let (sigma, truth) = (Look::Sigma.colour(), Look::Truth.colour());
    let errors = vec![
        ("roll: error [deg]", vec![blue, sigma]),
        ("pitch: error [deg]", vec![blue, sigma]),
        ("yaw: error [deg]", vec![blue, sigma]),
        ("yaw: sigma [10^y deg], -1 is 0.1 deg", vec![red, sigma, bound]),
    ];
    let consistency =
        vec![("NEES: NEES / n", vec![green, band]), ("vel_x [m/s]", vec![blue, truth])];
    let mut missing = Vec::new();
    for (tab, views) in [("Errors", errors), ("Consistency", consistency)] {
        viewer.show(&layout, &[tab]);
        viewer.settled(tab);
        for (view, colours) in views {
            let picture = viewer.screenshot(Some(&layout.views[view]), view);
            for colour in colours {
                // the colours are 60 or more apart in some channel; a line crosses a plot of 300
                // pixels or more, and a third of it is visible between others and the grid
                let near = |p: &&image::Rgb<u8>| (0..3).all(|k| p[k].abs_diff(colour[k]) <= 30);
                let n = picture.pixels().filter(near).count();
                if n < 100 {
                    missing.push(format!("{view}: {n} pixels of {colour:?}"));
                }
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}\nsee {}", folder.display());
}
