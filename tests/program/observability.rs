//! Observability: Theorem 1 of Pan & Wu (2016) and its remarks, each with a scenario whose report
//! agrees with it, and independent checks of the report.

use crate::common::{command, navfuse, parallel, root, stderr, stdout};
use navfuse_campaign::{Columns, bound};
use navfuse_core::document::Document;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_observability::plan::{self, Options};
use navfuse_observability::{Determination, ObservabilityReport, Tracker, TrackerSink};
use navfuse_segments::{Gatherer, Recording, Settings, find};
use serde_json::Value;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

const SEEDS: [u64; 3] = [1, 2, 3];

fn path(name: &str) -> PathBuf {
    root().join("scenarios").join(format!("{name}.toml"))
}

/// Runs a scenario, as it is or at the truth.
fn tracked(name: &str, settings: &[String], at_truth: bool) -> Tracker {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(path(name)).expect("the scenario is there");
    let scenario = Scenario::new(&registry, document, settings).expect("the settings fit");
    let assembly = if at_truth { scenario.assemble_at_truth() } else { scenario.assemble(None) };
    let mut assembly = assembly.unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("tracker".into(), Box::new(TrackerSink::new(1.0))));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    TrackerSink::take(&mut finished).expect("the run is over")
}

fn report(name: &str, settings: &[&str]) -> ObservabilityReport {
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(path(name)).expect("the scenario is there");
    let scenario = Scenario::new(&registry, document, &settings).expect("the settings fit");
    let mut assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    assembly.sinks.push(("tracker".into(), Box::new(TrackerSink::new(1.0))));
    assembly.sinks.push(("gatherer".into(), Box::new(Gatherer::new(&assembly.composition))));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let composition = scenario.compose().unwrap_or_else(|e| panic!("{e}"));
    let recording = Gatherer::take(&mut finished, &composition);
    let tracker = TrackerSink::take(&mut finished).expect("the run is over");
    let mut report = ObservabilityReport::new(name, &tracker);
    report.judge(recording, &tracker);
    report
}

/// The gathered samples of the IMU are joined by fours, to 25 Hz.
#[test]
fn gathered_samples_give_the_segments_of_all_samples() {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(path("pan-wu-3d")).expect("the scenario is there");
    let scenario = Scenario::new(&registry, document, &[]).expect("there are no settings");
    let all = Recording::read(&scenario).unwrap_or_else(|e| panic!("{e}"));
    let (segments, _) = find(&all, &Settings::of(&all)).unwrap_or_else(|e| panic!("{e}"));
    let report = report("pan-wu-3d", &[]);
    let gathered = &report.segments.as_ref().expect("there are segments").segments;
    assert_eq!(gathered.len(), segments.len());
    for (a, b) in gathered.iter().zip(&segments) {
        assert_eq!(a.kind, b.kind);
        // bins of a second, which begin at the first sample in both
        assert!((a.from_s - b.from).abs() < 1e-6 && (a.to_s - b.to).abs() < 1e-6, "{a:?} {b:?}");
    }
}

/// Reports of several seeds.
fn reports(name: &str) -> Vec<ObservabilityReport> {
    parallel(&SEEDS, |seed| report(name, &[&format!("seed={seed}")]))
}

fn verdict(report: &ObservabilityReport, title: &str) -> Determination {
    report.state(title).unwrap_or_else(|| panic!("{title}")).verdict
}

/// Returns the applicable theorem and remarks, after checking that the filter agrees with each.
fn agreed(report: &ObservabilityReport) -> Vec<&str> {
    let view = report.segments.as_ref().expect("there are segments");
    for v in &view.verdicts {
        assert!(v.agrees, "{}: {}: {}", report.scenario, v.about, v.text);
    }
    view.verdicts.iter().map(|v| v.about).collect()
}

fn all_determined(report: &ObservabilityReport, titles: &[&str]) {
    for title in titles {
        assert_eq!(
            verdict(report, title),
            Determination::Determined,
            "{}: {title}",
            report.scenario
        );
    }
}

const ROLL: &str = "dvl.misalignment roll";
const PITCH_YAW_K: [&str; 3] = ["dvl.misalignment pitch", "dvl.misalignment yaw", "dvl.scale"];
const ACCEL: [&str; 3] = ["ins.accel_bias x", "ins.accel_bias y", "ins.accel_bias z"];
const ATTITUDE: [&str; 3] = ["ins.attitude roll", "ins.attitude pitch", "ins.attitude yaw"];
const VELOCITY: [&str; 3] = ["ins.velocity north", "ins.velocity east", "ins.velocity down"];

#[test]
fn theorem_1_both_conditions_and_all_but_slow_gyro_biases_are_determined() {
    for r in reports("observability/theorem-1") {
        assert!(agreed(&r).contains(&"theorem-1"));
        let view = r.segments.as_ref().expect("segments");
        assert_eq!(view.type_i.rank, 2);
        assert_eq!(view.type_ii.as_ref().expect("turns").rank, 3);
        // the dive begins at 180 s; the second of the turns that differ ends at 380 s
        let (one, two) = (view.type_i_since_s.expect("met"), view.type_ii_since_s.expect("met"));
        assert!((180.0..240.0).contains(&one) && (280.0..=381.0).contains(&two), "{one} {two}");
        for titles in [&PITCH_YAW_K[..], &[ROLL], &ACCEL, &ATTITUDE, &VELOCITY] {
            all_determined(&r, titles);
        }
        // the initial position is not observable
        assert_eq!(verdict(&r, "ins.position north"), Determination::NotDetermined);
        // roll of the DVL only with the dive: Remark 4
        let since = r.state(ROLL).and_then(|s| s.since_s).expect("determined");
        assert!(since > 180.0, "{since}");
    }
}

#[test]
fn remark_1_thrust_ahead_and_sideways_determines_the_whole_misalignment() {
    for r in reports("observability/remark-1") {
        assert!(agreed(&r).contains(&"remark-1"));
        all_determined(&r, &PITCH_YAW_K);
        // sideways from 180 s on
        assert!(r.state(ROLL).and_then(|s| s.since_s).expect("determined") > 180.0);
    }
}

#[test]
fn remark_2_with_one_thruster_the_angle_about_it_is_not_observable() {
    for r in reports("observability/remark-2") {
        assert!(agreed(&r).contains(&"remark-2"));
        assert_eq!(r.segments.as_ref().expect("segments").type_i.rank, 1);
        all_determined(&r, &PITCH_YAW_K);
        let roll = r.state(ROLL).expect("it is estimated");
        assert_eq!(roll.verdict, Determination::NotDetermined);
        let why = roll.missing.as_deref().expect("something is missing");
        assert_eq!(
            why,
            "all specific-force rates so far are along the body's x axis; thrust sideways or dive"
        );
        // it is an unobservable direction by itself
        let alone = r.undetermined.iter().find(|d| d.text == ROLL).expect("named");
        assert!(alone.left > 0.9, "{}", alone.left);
        // without a turn, a tilt is not separable from an accelerometer bias
        for title in &ACCEL[..2] {
            let state = r.state(title).expect("it is estimated");
            assert!(
                state.verdict != Determination::Determined
                    && state.missing.as_deref().expect("why").contains("turn by 90 deg")
            );
        }
    }
}

#[test]
fn remark_3_with_turns_all_else_is_determined() {
    for r in reports("observability/remark-3").into_iter().chain([report("pan-wu-2d", &[])]) {
        let verdicts = agreed(&r);
        assert!(verdicts.contains(&"remark-2") && verdicts.contains(&"remark-3"), "{verdicts:?}");
        for titles in [&PITCH_YAW_K[..], &ACCEL, &ATTITUDE, &VELOCITY] {
            all_determined(&r, titles);
        }
        assert_ne!(verdict(&r, ROLL), Determination::Determined, "{}", r.scenario);
    }
}

#[test]
fn remark_4_a_dive_gives_the_second_direction() {
    for r in reports("observability/remark-4").into_iter().chain([report("pan-wu-3d", &[])]) {
        assert!(agreed(&r).contains(&"remark-4"));
        all_determined(&r, &PITCH_YAW_K);
        let dive = if r.scenario == "pan-wu-3d" { 660.0 } else { 180.0 };
        let since = r.state(ROLL).and_then(|s| s.since_s).expect("determined");
        assert!((dive..dive + 60.0).contains(&since), "{}: {since}", r.scenario);
    }
}

/// Theorem 1 is sufficient, not necessary: with a bank of 0.01 deg in the turns, the points alpha
/// are coplanar.
#[test]
fn flat_turns_determine_the_accelerometer_biases_though_alpha_is_coplanar() {
    for r in reports("observability/not-necessary") {
        assert!(agreed(&r).contains(&"not-necessary"));
        let view = r.segments.as_ref().expect("segments");
        let sphere = view.type_ii.as_ref().expect("turns");
        assert!(sphere.rank < 3 && sphere.singular_values[2] < sphere.noise, "{sphere:?}");
        all_determined(&r, &ACCEL);
        // the first turn is from 360 s to 390 s
        for title in &ACCEL[..2] {
            let since = r.state(title).and_then(|s| s.since_s).expect("determined");
            assert!((360.0..510.0).contains(&since), "{title}: {since}");
        }
    }
}

/// For a constant, the remaining initial variance is the present variance: `M_ii = P_ii / P_0ii`,
/// exactly if the filter is at the truth. The tolerance is the rounding of 7300 corrections.
#[test]
fn what_is_left_of_a_constant_is_its_variance_over_its_prior() {
    let t = tracked("pan-wu-3d", &["estimator.stop=1100 s".to_owned()], true);
    let n = t.components().len();
    let mut checked = 0;
    for (i, (c, now)) in t.components().iter().zip(t.status()).enumerate() {
        if t.driven(c.slot) {
            continue;
        }
        let (left, ratio) = (t.left()[i * n + i], (now.sigma / now.prior).powi(2));
        println!("{} {}: {left:.6e} {ratio:.6e}", c.state, c.name);
        // below this, a subtraction from 1 has no significant digits
        assert!(
            (left - ratio).abs() < 1e-5 * ratio + 1e-11,
            "{} {}: {left} {ratio}",
            c.state,
            c.name
        );
        checked += 1;
    }
    assert_eq!(checked, 10);
}

/// The injections of a filter in steady motion are tiny, but those of a filter that starts 0.2 off
/// in scale and a degree off in angles are not: the remaining initial variance follows the
/// covariance through them.
#[test]
fn corrections_of_a_degree_do_not_break_what_is_left() {
    // with 15 s, the filter takes its first samples again, with other gains
    for span in ["0 s", "15 s"] {
        let settings = ["estimator.stop=1100 s", &format!("estimator.relinearise={span}")];
        let t = tracked("pan-wu-3d", &settings.map(str::to_owned), false);
        let n = t.components().len();
        for (i, (c, now)) in t.components().iter().zip(t.status()).enumerate() {
            if t.driven(c.slot) {
                continue;
            }
            let (left, ratio) = (t.left()[i * n + i], (now.sigma / now.prior).powi(2));
            println!("{span}, {} {}: {left:.3e} {ratio:.3e}", c.state, c.name);
            // a degree squared is 0.0003, the rows of the largest injections change by more
            assert!((left / ratio).ln().abs() < 0.02, "{} {}: {left} {ratio}", c.state, c.name);
        }
    }
}

/// With a heading uncertainty of 5 or 10 degrees, each correction rotates the velocity far. `M`
/// remains a covariance: no component gains variance, and no correlation exceeds one.
#[test]
fn what_is_left_of_a_wide_heading_prior_is_a_covariance() {
    for (name, stop) in
        [("tactical", "estimator.stop=760 s"), ("alignment-in-motion", "estimator.stop=460 s")]
    {
        let t = tracked(name, &[stop.to_owned()], false);
        let (n, left) = (t.components().len(), t.left());
        let title = |i: usize| t.components()[i].title(t.layout());
        let variance = |i: usize| left[i * n + i];
        assert!((0..n).any(|i| variance(i) < 0.5), "{name}: no information was gained");
        for i in 0..n {
            // both are exact but for the rounding of thousands of updates
            assert!(variance(i) <= 1.0 + 1e-6, "{name}: {} of {} is left", variance(i), title(i));
            for j in 0..n {
                let (both, most) = (left[i * n + j], (variance(i) * variance(j)).sqrt());
                assert!(
                    both.abs() <= most * (1.0 + 1e-6),
                    "{name}: {} with {}: {}",
                    title(i),
                    title(j),
                    both / most
                );
            }
        }
    }
}

#[test]
fn the_planner_ranks_by_the_bound_and_sends_the_single_thruster_down_or_sideways() {
    let registry = navfuse::standard_plugins();
    let document =
        Document::from_file(path("observability/remark-2")).expect("the scenario is there");
    let options = Options { at: None, of: vec!["dvl.misalignment".into()] };
    let plan = plan::suggest(&registry, &document, &options, &AtomicBool::new(false), |_, _| {});
    let plan = plan.unwrap_or_else(|e| panic!("{e}")).expect("not stopped");
    let best = &plan.suggestions[0];
    assert!(
        best.name.contains("thrust to starboard") || best.name.contains("dive"),
        "{}",
        best.name
    );
    assert_eq!(best.improves[0].title, ROLL);
    // neither straight acceleration nor a roll about the thrust helps
    for useless in ["accelerate ahead", "roll to 15 deg"] {
        let s = plan.suggestions.iter().find(|s| s.name.starts_with(useless)).expect("a candidate");
        assert!(s.bits < 0.2 * best.bits, "{}: {} against {}", s.name, s.bits, best.bits);
    }
    // the predicted sigma is the Cramer-Rao bound of the scenario with the manoeuvre
    let dive = plan.suggestions.iter().find(|s| s.name == "dive").expect("a candidate");
    let predicted =
        dive.improves.iter().find(|i| i.title == ROLL).expect("it improves the roll").with;
    let mut document = document;
    let node = document
        .root()
        .get("source")
        .and_then(|s| s.get("simulation"))
        .and_then(|s| s.get("segments"));
    let rows = node.expect("segments").value().as_array().expect("a list").clone();
    let rows: Vec<String> =
        rows.iter().map(ToString::to_string).chain(dive.segments.iter().cloned()).collect();
    document.set(&format!("source.simulation.segments=[{}]", rows.join(", "))).expect("it is TOML");
    let assembly = Scenario::new(&registry, document, &[]).expect("it fits").assemble_at_truth();
    let assembly = assembly.unwrap_or_else(|e| panic!("{e}"));
    let mut columns = Columns::default();
    columns.add(&assembly.composition);
    let record = bound(assembly, &columns, 0, 1_000_000_000, &AtomicBool::new(false));
    let record = record.unwrap_or_else(|e| panic!("{e}")).expect("not stopped");
    let roll = columns
        .components
        .iter()
        .position(|c| c.name() == "dvl.misalignment.roll")
        .expect("it is there");
    let least = record.rows.last().expect("rows").2[roll];
    assert!((predicted / least - 1.0).abs() < 1e-9, "{predicted} deg, the bound is {least} deg");
}

#[test]
fn errors_of_use_give_warnings() {
    let warns = |settings: &[&str], what: &str| {
        let r = report("observability/remark-4", settings);
        let view = r.segments.as_ref().expect("segments");
        assert!(view.warnings.iter().any(|w| w.contains(what)), "{what}: {:?}", view.warnings);
        r
    };
    let gap = "sensor.dvl.simulation={ rate = \"5 Hz\", outages = [[\"150 s\", \"155 s\"]] }";
    warns(&[gap], "dvl has no samples from 150 s to 155 s, inside the type I segment");
    let rest = |seconds: u32| format!("{{ type = \"static\", duration = \"{seconds} s\" }}");
    let surge = |seconds: u32| {
        format!("{{ type = \"surge\", duration = \"{seconds} s\", speed = \"2 m/s\" }}")
    };
    let of = |rest: String, surge: String| {
        format!(
            "source.simulation.segments=[{rest}, {surge}, {{ type = \"cruise\", duration = \"100 \
             s\" }}]"
        )
    };
    warns(&[&of(rest(15), surge(60)), "estimator.start=10 s"], "static alignment is not possible");
    let r = warns(&[&of(rest(120), surge(3))], "a segment of Type I takes 10 s");
    let why =
        r.state("dvl.misalignment roll").and_then(|s| s.missing.clone()).expect("it is missing");
    assert!(why.contains("has not varied at constant attitude"), "{why}");
    // fewer than two directions
    let r = report("observability/remark-4", &[&of(rest(120), surge(60))]);
    let view = r.segments.as_ref().expect("segments");
    assert!(
        view.verdicts[0]
            .text
            .contains("all specific-force rates are along one direction, the body's x axis")
    );
    // a manoeuvre after the end
    let document =
        Document::from_file(path("observability/remark-4")).expect("the scenario is there");
    let options = Options { at: Some(1e5), of: Vec::new() };
    let registry = navfuse::standard_plugins();
    let refused = plan::suggest(&registry, &document, &options, &AtomicBool::new(false), |_, _| {});
    let why = refused.expect_err("there is nothing at that time").to_string();
    assert!(why.contains("--at 100000 s: the segments end at"), "{why}");
}

#[test]
fn a_composition_without_dvl_has_verdicts_too() {
    let without = ["sensor.dvl.enabled=false", "estimator.stop=300 s"];
    let r = report("surface-dive", &without);
    assert!(r.segments.as_ref().is_none_or(|s| s.sensor.is_none() && s.verdicts.is_empty()));
    all_determined(&r, &["ins.position north", "ins.position down"]);
    // a sensor without samples, and one that measures only the height
    let silent = [
        "sensor.gnss.simulation={ rate = \"1 Hz\", outages = [[\"0 s\", \"9999 s\"]] }",
        "estimator.stop=200 s",
    ];
    let r = report("surface-dive", &silent);
    let why = |title: &str| {
        r.state(title).and_then(|s| s.missing.clone()).unwrap_or_else(|| panic!("{title}"))
    };
    assert_eq!(why("gnss.bias north"), "no sample of gnss was used");
    assert!(
        why("ins.position north").starts_with("no enabled sensor reads it"),
        "{}",
        why("ins.position north")
    );
    assert_eq!(verdict(&r, "ins.position down"), Determination::Determined);
}

#[test]
fn a_log_has_the_report_of_its_run_and_the_figure_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = path("observability/remark-4");
    let json = |arguments: &[&str]| -> Value {
        let output = navfuse(arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_str(&stdout(&output)).expect("one JSON object")
    };
    let out = folder.path().join("out");
    let (scenario, out) = (scenario.display().to_string(), out.display().to_string());
    let direct = json(&["observability", &scenario, "--format", "json", "--out", &out]);
    let run =
        command().args(["run", &scenario, "--out"]).arg(folder.path()).output().expect("it starts");
    assert!(run.status.success(), "{}", stderr(&run));
    let log = folder.path().join("run.mcap").display().to_string();
    let replayed = json(&["observability", &log, "--format", "json"]);
    for (a, b) in direct["states"]
        .as_array()
        .expect("states")
        .iter()
        .zip(replayed["states"].as_array().expect("states"))
    {
        let (x, y) = (a["sigma"].as_f64().expect("sigma"), b["sigma"].as_f64().expect("sigma"));
        assert!((x / y - 1.0).abs() < 1e-6, "{}: {x} {y}", a["title"]);
        assert_eq!(a["verdict"], b["verdict"]);
    }
    assert_eq!(direct["segments"]["type_i"]["rank"], replayed["segments"]["type_i"]["rank"]);
    let svg = std::fs::read_to_string(folder.path().join("out/normalised-sigma.svg"))
        .expect("the figure");
    for state in ["ins.attitude", "dvl.misalignment"] {
        assert!(svg.contains(state));
    }
    let refused = navfuse(&[
        "observability",
        &log,
        "--suggest",
        "--set",
        "source={ csv = { directory = \"x\" } }",
    ]);
    assert!(
        !refused.status.success()
            && stderr(&refused).contains("no manoeuvre can be suggested for a recording")
    );
}
