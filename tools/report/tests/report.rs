//! The history of a run and of its log, and the page of both.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_report::{Recorder, RunHistory, Standard, page, plots, read_log};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// All parts of a report: dropouts, gated outliers, a fixed state, and a scale factor without
/// truth.
const SCENARIO: &str = r#"
name = "short <dive> & back"
seed = 3

[estimator]
start = "1 s"
draw = "start"

[process.ins]
attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.01 deg/h", truth = "0.01 deg/h" }
accel_bias = { sigma = "50 ug", truth = "50 ug" }

[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }

[sensor.dvl]
noise = "2 cm/s"
gate = 0.999
scale = { sigma = 0.01 }
misalignment = { sigma = "1 deg", truth = ["0.1 deg", "0 deg", "0 deg"] }
simulation = { rate = "5 Hz", dropout = 0.1, outliers = 0.05 }

[sensor.depth]
noise = "5 cm"
simulation = { rate = "2 Hz" }

[sensor.reference]
simulation = { rate = "10 Hz" }

[source.simulation.start]
latitude = "30 deg"
height = "0 m"
heading = "10 deg"

[[source.simulation.segments]]
type = "static"
duration = "5 s"

[[source.simulation.segments]]
type = "surge"
duration = "75 s"
speed = "2 m/s"

[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "90 deg"
bank = "2 deg"
"#;

/// A run of the scenario with its history and its log.
fn run(settings: &[&str], output: &Path) -> (RunHistory, Finished) {
    run_text(SCENARIO, settings, output)
}

/// A run of another scenario.
fn run_text(text: &str, settings: &[&str], output: &Path) -> (RunHistory, Finished) {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin)
        .add(&navfuse_constraints::ConstraintsPlugin)
        .add(&navfuse_simulation::SimulationPlugin)
        .add(&navfuse_mcap::McapPlugin);
    let document = Document::parse("short.toml", text).unwrap();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    let mut assembly = scenario.assemble(Some(output)).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("report".into(), Box::new(Recorder::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| ());
    assert!(finished.error.is_none(), "{:?}", finished.error);
    (finished.take_sink::<Recorder>().unwrap().into_history(), finished)
}

#[test]
fn a_log_has_the_same_history_as_the_run_that_wrote_it() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&[], folder.path());
    let read = read_log(&folder.path().join("run.mcap"), |_| ()).unwrap();
    // compared as text, since a NaN is not equal to itself
    assert_eq!(format!("{history:#?}"), format!("{read:#?}"));
    assert_eq!(page::report(&history, None).unwrap(), page::report(&read, None).unwrap());
}

#[test]
fn the_history_has_the_counts_of_the_summary() {
    let folder = tempfile::tempdir().unwrap();
    let (history, Finished { summary, .. }) = run(&[], folder.path());
    for sensor in &history.sensors {
        let counts = &summary.samples[&sensor.name];
        assert_eq!(counts["read"], sensor.read, "{}", sensor.name);
        if sensor.name == "dvl" {
            let updates = &sensor.updates;
            assert!(updates.outcomes.gated > 0, "the outliers should be gated");
            assert_eq!(
                (counts["accepted"].as_u64(), counts["gated"].as_u64()),
                (Some(updates.outcomes.accepted), Some(updates.outcomes.gated))
            );
            let mean = counts["mean_nis"].as_f64().unwrap();
            assert!((mean - updates.nis[0] / updates.outcomes.accepted as f64).abs() < 1e-9);
        }
    }
    for row in &summary.rows {
        let block = history.block(&row.name).unwrap();
        assert_eq!(
            (&block.last.estimate, &block.last.sigma),
            (&row.estimate, &row.sigma),
            "{}",
            row.name
        );
        assert_eq!(
            (!block.last.error.is_empty()).then(|| block.last.error.clone()),
            row.error,
            "{}",
            row.name
        );
    }
    // this path is computed from degrees, the summary's from radians: equal to a micrometre
    let position = history.position().unwrap();
    assert!((position.travelled.truth - summary.distance_m).abs() < 1e-6);
    let rms = (position.travelled.squares.0 / position.travelled.squares.1 as f64).sqrt();
    assert!((rms - summary.horizontal_error_m.unwrap().rms).abs() < 1e-9);
}

#[test]
fn constant_states_are_listed_with_prior_and_result_and_moving_states_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&[], folder.path());
    let constant: Vec<&str> =
        history.blocks.iter().filter(|b| b.constant()).map(|b| b.name.as_str()).collect();
    let expected =
        ["ins.gyro_bias", "ins.accel_bias", "dvl.scale", "dvl.misalignment", "dvl.lever_arm"];
    assert_eq!(constant[..5], expected);
    assert_eq!(constant[5..], ["depth.bias", "depth.lever_arm"]);
    assert_eq!(history.block("dvl.scale").unwrap().first.sigma, [0.01], "the prior");
    assert_eq!(
        history.block("dvl.misalignment").unwrap().first.estimate,
        [0.0; 3],
        "the initial value"
    );
}

#[test]
fn every_state_has_its_plots_and_every_measuring_sensor_its_innovations() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&[], folder.path());
    let page = page::report(&history, None).unwrap();
    let mut components = 0;
    for block in history.blocks.iter().filter(|b| b.uncertain()) {
        let from = page
            .find(&format!("id=\"state-{}\"", block.name))
            .unwrap_or_else(|| panic!("{}", block.name));
        let figure = &page[from..from + page[from..].find("</figure>").unwrap()];
        for k in 0..block.components.len() {
            let name = if block.geodetic {
                format!("{} {}", block.name, block.axis(k))
            } else {
                block.component(k)
            };
            assert!(figure.contains(&name), "{name}");
            components += 1;
        }
        assert!(!figure.contains("no data"), "{}", block.name);
    }
    assert_eq!(components, 19);
    for figure in [
        "trajectory",
        "observability",
        "innovations-dvl",
        "nis-dvl",
        "innovations-depth",
        "nis-depth",
        "samples-imu",
    ] {
        assert!(page.contains(&format!("id=\"{figure}\"")), "{figure}");
    }
    assert!(page.contains("Held fixed: dvl.lever_arm = 0, 0, 0 m"));
}

/// The page has no attributes or style sheets that would load anything.
#[test]
fn the_page_is_one_file_that_loads_nothing_and_escapes_what_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&["description=\"<script>alert(1)</script>\""], folder.path());
    let page = page::report(&history, None).unwrap();
    let script = include_str!("../src/page.js");
    assert!(script.len() < 12_000, "{} bytes", script.len());
    for loading in ["fetch", "import", "XMLHttp", "src", "innerHTML", "eval"] {
        assert!(!script.contains(loading), "{loading}");
    }
    let rest = page.replacen(&format!("<script>{script}</script>"), "", 1);
    assert!(rest.len() < page.len(), "the page has its script");
    for loading in [
        "<script",
        "<link",
        "<img",
        "<iframe",
        "<object",
        "<embed",
        "src=",
        "@import",
        "url(",
        "xlink:href",
    ] {
        assert!(!rest.contains(loading), "{loading}");
    }
    for at in page.match_indices("href=\"").map(|(at, found)| at + found.len()) {
        assert!(page[at..].starts_with('#'), "a link that leaves the page: {}", &page[at..at + 40]);
    }
    assert!(
        page.contains("<h1>short &lt;dive&gt; &amp; back</h1>")
            && page.contains("&lt;script&gt;alert(1)")
    );
    assert!(page.len() < 2_000_000, "{} bytes", page.len());
}

/// The DVL reads 5 times a second, and is silent for a quarter of a minute.
#[test]
fn the_page_has_a_strip_of_health_for_each_sensor_with_its_outage() {
    let folder = tempfile::tempdir().unwrap();
    let silent = "sensor.dvl.simulation.outages=[[\"60 s\", \"75 s\"]]";
    let (history, _) = run(&[silent], folder.path());
    let [_, last] = history.span().unwrap();
    let spans =
        |name: &str| navfuse_report::spans(&history.sensor(name).unwrap().health, last, false);
    let dvl = spans("dvl");
    let outage = dvl.iter().find(|s| s.word == "silent" && s.times[0] > 10.0).unwrap();
    // it begins an interval after the last sample, one in ten of which is lost
    assert!((outage.times[0] - 60.0).abs() < 1.0 && (outage.times[1] - 75.0).abs() < 1.0);
    assert!(dvl.windows(2).all(|pair| pair[0].times[1] == pair[1].times[0]), "{dvl:?}");
    assert_eq!(spans("imu").last().map(|s| (s.word, s.times[1])), Some(("used", last)));
    assert!(spans("reference").is_empty());
    let page = page::report(&history, None).unwrap();
    let (_, strips) = page.split_once("<div class=\"strips\"").unwrap();
    let strips = strips.split_once("<p class=\"note\"").unwrap().0;
    assert!(strips.contains("<title>dvl: silent, 60 s to 75 s</title>"), "{strips}");
    assert!(strips.contains("<title>imu: used, "), "{strips}");
}

/// The samples of a constraint have no channels, and its innovations have two.
#[test]
fn a_constraint_has_the_nis_and_the_strip_of_its_innovations() {
    let folder = tempfile::tempdir().unwrap();
    let noise = "sensor.non-holonomic.lateral_noise=\"10 cm/s\"";
    let other = "sensor.non-holonomic.vertical_noise=\"10 cm/s\"";
    let (history, _) = run(&[noise, other], folder.path());
    let of_log = read_log(&folder.path().join("run.mcap"), |_| ()).unwrap();
    for history in [&history, &of_log] {
        let constraint = history.sensor("non-holonomic").unwrap();
        let used = constraint.updates.outcomes.accepted as f64;
        assert_eq!(constraint.updates.nis[1], 2.0 * used);
        let [_, last] = history.span().unwrap();
        let spans = navfuse_report::spans(&constraint.health, last, false);
        assert!(spans.iter().all(|s| ["used", "silent"].contains(&s.word)), "{spans:?}");
    }
}

#[test]
fn the_errors_at_the_end_have_the_sigma_that_the_run_states_beside_them() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&[], folder.path());
    let page = page::report(&history, None).unwrap();
    let last = history.position().unwrap().compared.clone().unwrap();
    let stated = last.sigma[0].hypot(last.sigma[1]);
    let travelled = history.position().unwrap().travelled.truth;
    let percent = 100.0 * stated / travelled;
    let both = [format!("(stated: ± {stated:.2} m)"), format!("(stated: ± {percent:.3} %)")];
    assert!(both.iter().all(|part| page.contains(part)), "{both:?}");
    let (block, k, [error, sigma]) = history.worst_error().unwrap();
    let row = block.compared.clone().unwrap();
    assert_eq!([row.error[k], row.sigma[k]], [error, sigma]);
    let ratio = (error / sigma).abs();
    let (_, text) = page.split_once("Largest error at the end: ").unwrap();
    let (text, _) = text.split_once("</li>").unwrap();
    let begin = format!("<b>{ratio:.1} sigma</b>, of {} {}: ", block.name, block.axis(k));
    assert!(text.starts_with(&begin) && text.contains(" ±\u{a0}"), "{text}");
}

/// A recording has no seed: neither a legend nor an axis nor a heading of its page calls its reference the
/// truth, or a difference from it an error.
#[test]
fn a_recorded_reference_is_called_the_truth_in_no_figure_and_no_table() {
    let folder = tempfile::tempdir().unwrap();
    let (mut history, _) = run(&[], folder.path());
    let words = |history: &RunHistory| -> Vec<String> {
        let states = history.blocks.iter();
        let states = states.filter_map(|block| plots::state(block, history.standard()));
        let figures = plots::trajectory(history).into_iter().chain(states);
        let panels = figures.flat_map(|figure| figure.panels);
        let words = panels.flat_map(|p| p.curves.into_iter().map(|c| c.name).chain([p.y.label]));
        words.collect()
    };
    let names = |words: &[String], name: &str| words.iter().any(|w| w.contains(name));
    let simulated = words(&history);
    assert!(names(&simulated, "truth") && names(&simulated, "error"), "{simulated:?}");
    history.seed = None;
    assert_eq!(history.standard(), Standard::Reference);
    let recorded = words(&history);
    assert!(!names(&recorded, "truth") && !names(&recorded, "error"), "{recorded:?}");
    assert!(names(&recorded, "reference"), "{recorded:?}");
    let page = page::report(&history, None).unwrap();
    assert!(!page.contains("<th>truth</th>") && !page.contains("<th>error"), "a heading");
    assert!(!page.contains("Horizontal error"));
}

/// The height begins 100 m off, by one sigma of the prior, and the pressure sensor corrects it with
/// 5 cm: the plot shows the heights and not the fall.
#[test]
fn the_first_height_of_a_wide_prior_does_not_flatten_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&["process.ins.position.sigma=\"100 m\""], folder.path());
    let figure = plots::trajectory(&history).unwrap();
    let height = figure.panels.last().unwrap();
    let [low, high] = height.y.limits.unwrap();
    let estimate = height.curves.iter().find(|c| c.name == "estimate").unwrap();
    let beyond = estimate.points.iter().filter(|p| !(low..=high).contains(&p[1])).count();
    let first = estimate.points[0][1];
    assert!((1..=estimate.points.len() / 20).contains(&beyond), "{beyond} beyond {low} to {high}");
    assert!(
        !(low..=high).contains(&first) && high - low < 0.1 * first.abs(),
        "{low} {high} {first}"
    );
    let truth = height.curves.iter().find(|c| c.name == "truth").unwrap();
    assert!(truth.points.iter().all(|p| (low..=high).contains(&p[1])));
}

#[test]
fn a_run_without_truth_and_without_measurements_has_a_page_too() {
    let folder = tempfile::tempdir().unwrap();
    let settings = [
        "sensor.dvl.enabled=false",
        "sensor.depth.enabled=false",
        "sensor.reference.enabled=false",
        "estimator.draw=nothing",
        "process.ins.attitude.initial=\"0 deg\"",
        "process.ins.velocity.initial=\"0 m/s\"",
        "process.ins.position.latitude=\"30 deg\"",
        "process.ins.position.longitude=\"0 deg\"",
        "process.ins.position.height=\"0 m\"",
        "process.ins.gyro_bias={ sigma = \"0.01 deg/h\" }",
        "process.ins.accel_bias={ sigma = \"50 ug\" }",
    ];
    let (history, _) = run(&settings, folder.path());
    let page = page::report(&history, None).unwrap();
    assert!(page.contains("No truth is known") && page.contains("No sensor corrected the state"));
    assert!(page.contains("id=\"state-ins.position\"") && !page.contains("NaN"));
}

/// IMU, DVL and depth observe no horizontal position.
#[test]
fn the_page_of_a_smoothed_run_reports_in_words_where_the_run_is_weak() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&["estimator.smooth=true"], folder.path());
    let page = page::report(&history, None).unwrap();
    let (_, section) = page.split_once("<section id=\"smoothing\">").unwrap();
    let section = section.split_once("</section>").unwrap().0;
    assert!(
        section.contains("not observed: ") && section.contains("ins.position longitude"),
        "{section}"
    );
    let (plain, _) = run(&[], folder.path());
    assert!(!page::report(&plain, None).unwrap().contains("#smoothing"));
}

/// The first smoothed estimate knows the whole run, so a constant state has the same sigma from the
/// first smoothed epoch to the last. Only the filter's first estimate is the prior.
#[test]
fn a_smoothed_run_is_compared_with_the_prior_of_the_filter_in_the_run_and_in_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&["estimator.smooth=true"], folder.path());
    let read = read_log(&folder.path().join("run.mcap"), |_| ()).unwrap();
    assert_eq!(format!("{history:#?}"), format!("{read:#?}"));
    let scale = history.block("dvl.scale").unwrap();
    let filtered = scale.filtered.as_ref().unwrap();
    assert_eq!(scale.prior().sigma, [0.01]);
    assert!(scale.first.sigma[0] <= filtered.last.sigma[0] * 1.001, "the smoothed one is constant");
    assert!(filtered.last.sigma[0] < 0.5 * scale.prior().sigma[0], "the run determines the scale");
    let page = page::report(&history, None).unwrap();
    let (_, table) = page.split_once("<section id=\"calibration\">").unwrap();
    let (head, rows) = table.split_once("</thead>").unwrap();
    let names = ["prior", "filter", "smoothed"].map(|name| head.find(&format!(">{name}</th>")));
    assert!(names.is_sorted() && names[0].is_some(), "{head}");
    let (_, row) = rows.split_once("scale").unwrap();
    let cells: Vec<&str> = row.split("<td").filter_map(|c| Some(c.split_once('>')?.1)).collect();
    assert!(cells[1] != cells[2], "{cells:?}");
}

/// A phone of 390 pixels has room for the name, the result, its error in sigma, and what remains of the prior.
#[test]
fn a_narrow_page_leaves_out_the_same_columns_of_the_heading_and_of_each_row() {
    let folder = tempfile::tempdir().unwrap();
    let (history, _) = run(&["estimator.smooth=true"], folder.path());
    let page = page::report(&history, None).unwrap();
    for (section, count) in [("result", 1), ("calibration", 4), ("sensors", 3)] {
        let (_, table) = page.split_once(&format!("<section id=\"{section}\">")).unwrap();
        let (table, _) = table.split_once("</table>").unwrap();
        for row in table.split("<tr").skip(1).filter(|row| !row.contains("colspan")) {
            assert_eq!(row.matches("more\">").count(), count, "{section}: {row}");
        }
    }
}

#[test]
fn a_simulation_of_any_name_is_a_simulated_run_and_a_replay_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let renamed = SCENARIO
        .replace(
            "[source.simulation.start]",
            "[source.sea]\ntype = \"simulation\"\n[source.sea.start]",
        )
        .replace("source.simulation", "source.sea");
    let (history, _) = run_text(&renamed, &["estimator.stop=5 s"], folder.path());
    assert_eq!(history.seed, Some(3));
    let log = folder.path().join("run.mcap");
    assert_eq!(read_log(&log, |_| ()).unwrap().seed, Some(3));
    let source = format!("source={{ mcap = {{ path = {:?} }} }}", log.display().to_string());
    let again = tempfile::tempdir().unwrap();
    let (history, _) = run_text(SCENARIO, &[&source], again.path());
    assert_eq!(history.seed, None);
    assert_eq!(read_log(&again.path().join("run.mcap"), |_| ()).unwrap().seed, None);
}
