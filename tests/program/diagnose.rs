//! `navfuse diagnose`: the change that mends a simulated fault comes first, and the run with it is
//! consistent.

use crate::common::{navfuse, stderr, stdout};
use navfuse_core::document::Document;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::simulate::Random;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_diagnose::{Diagnosis, Options, apply, diagnose, sensitivity};
use std::sync::atomic::AtomicBool;

/// A minute of a vehicle below water, with IMU, DVL, depth and an acoustic position.
pub(crate) const DIVE: &str = r#"
[estimator]
draw = "start"
[process.ins]
attitude = { sigma = "0.3 deg" }
velocity = { sigma = "5 cm/s" }
position = { sigma = "50 cm" }
gyro_bias = { sigma = "5 deg/h", truth = ["3 deg/h", "-4 deg/h", "2 deg/h"] }
accel_bias = { sigma = "500 ug", truth = ["300 ug", "-200 ug", "400 ug"] }
[sensor.imu]
gyro_noise = "1 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "25 Hz" }
[sensor.dvl]
noise = "1 cm/s" # of the data sheet
simulation = { rate = "4 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "4 Hz" }
[sensor.gnss]
horizontal_noise = "30 cm"
vertical_noise = "60 cm"
simulation = { rate = "2 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "43.1 deg", longitude = "5.5 deg", height = "-8 m", heading = "35 deg" }
segments = [
  { type = "static", duration = "4 s" },
  { type = "surge", duration = "5 s", speed = "2 m/s" },
  { type = "turn", duration = "8 s", angle = "80 deg" },
  { type = "descend", duration = "8 s", rate = "0.4 m/s" },
  { type = "turn", duration = "9 s", angle = "-110 deg" },
  { type = "sway", duration = "6 s", speed = "0.5 m/s" },
  { type = "surge", duration = "5 s", speed = "0.8 m/s" },
  { type = "turn", duration = "9 s", angle = "150 deg" },
  { type = "surge", duration = "5 s", speed = "1.8 m/s" },
  { type = "cruise", duration = "6 s" },
]
"#;

/// A fault that is put into the simulation, and the begin of the change that mends it.
struct Case {
    settings: String,
    change: String,
}

/// Draws of the size, place and sign of a fault.
struct Draw(Random);

impl Draw {
    fn new(seed: u64, kind: &str) -> Self {
        Self(Random::new(seed, kind))
    }

    /// A number of either sign, with a size between the limits.
    fn either(&mut self, low: f64, high: f64) -> f64 {
        let (size, sign) = (low + (high - low) * self.0.uniform(), self.0.uniform() - 0.5);
        size.copysign(sign)
    }

    fn one<T: Copy>(&mut self, choices: &[T]) -> T {
        let at = (self.0.uniform() * choices.len() as f64) as usize;
        choices[at.min(choices.len() - 1)]
    }
}

/// Sensors with a clock, each with its rate, Hz.
const CLOCKS: [(&str, u32); 3] = [("gnss", 2), ("dvl", 4), ("depth", 4)];

fn fault(sensor: &str, rate: u32, faults: &str, change: String) -> Case {
    let settings =
        format!("sensor.{sensor}.simulation={{ rate = \"{rate} Hz\", faults = [{faults}] }}");
    Case { settings, change }
}

fn lag(draw: &mut Draw) -> Case {
    let (sensor, rate) = draw.one(&CLOCKS);
    let size = draw.either(0.2, 0.9);
    let faults = format!("{{ type = \"clock-offset\", size = \"{size:.3} s\" }}");
    fault(sensor, rate, &faults, format!("{sensor}: time_offset"))
}

fn leap_seconds(draw: &mut Draw) -> Case {
    let (sensor, rate) = draw.one(&CLOCKS[..2]);
    let jump = draw.one(&[17, 18, 19, -17, -18, -19]);
    let faults = format!("{{ type = \"clock-offset\", size = \"{jump} s\" }}");
    fault(sensor, rate, &faults, format!("{sensor}: clock {:+} s", -jump))
}

fn sign(_: &mut Draw) -> Case {
    fault("depth", 4, "{ type = \"sign\" }", "depth: depth with the other sign".to_owned())
}

fn unit(draw: &mut Draw) -> Case {
    let (sensor, rate, unit, change) = draw.one(&[
        ("depth", 4, "ft", "depth: depth in feet"),
        ("depth", 4, "cm", "depth: depth in cm"),
        ("dvl", 4, "mm/s", "dvl: vel_x, vel_y, vel_z in mm/s"),
        ("dvl", 4, "kn", "dvl: vel_x, vel_y, vel_z in knots"),
        ("imu", 25, "g", "imu: accel_x, accel_y, accel_z in g"),
        ("imu", 25, "deg/s", "imu: gyro_x, gyro_y, gyro_z in deg"),
    ]);
    fault(sensor, rate, &format!("{{ type = \"unit\", unit = \"{unit}\" }}"), change.to_owned())
}

/// Turned and mirrored axes.
fn axes(draw: &mut Draw) -> Case {
    let (sensor, rate, vectors) =
        draw.one(&[("imu", 25, &["gyro", "accel"][..]), ("dvl", 4, &["vel"][..])]);
    let swapped = draw.one(&["xy", "xz", "yz"]);
    let reversed = draw.one(&["x", "y", "z", "xy", "yz"]);
    let mut faults = Vec::new();
    for vector in vectors {
        let (a, b) = swapped.split_at(1);
        faults.push(format!(
            "{{ type = \"swap\", channels = [\"{vector}_{a}\", \"{vector}_{b}\"] }}"
        ));
        for axis in reversed.chars() {
            faults.push(format!("{{ type = \"sign\", channels = [\"{vector}_{axis}\"] }}"));
        }
    }
    let direction = |axis: char| {
        let of = match swapped.find(axis) {
            Some(at) => swapped.chars().nth(1 - at).unwrap_or(axis),
            None => axis,
        };
        let at = "xyz".find(of).unwrap_or_default();
        if reversed.contains(axis) {
            ["back", "left", "up"][at]
        } else {
            ["forward", "right", "down"][at]
        }
    };
    let words: Vec<&str> = "xyz".chars().map(direction).collect();
    fault(sensor, rate, &faults.join(", "), format!("{sensor}: axes {}", words.join(", ")))
}

/// One channel whose range is set apart from the others'.
fn channel(draw: &mut Draw) -> Case {
    let (sensor, rate, channel) = draw.one(&[
        ("imu", 25, "accel_x"),
        ("imu", 25, "accel_z"),
        ("imu", 25, "gyro_z"),
        ("dvl", 4, "vel_x"),
    ]);
    let (size, words) = draw.one(&[("100 %", "doubled"), ("-50 %", "halved")]);
    let faults = format!("{{ type = \"scale\", size = \"{size}\", channels = [\"{channel}\"] }}");
    fault(sensor, rate, &faults, format!("{sensor}: {channel} {words}"))
}

fn bias(draw: &mut Draw) -> Case {
    let axis = draw.one(&["x", "y", "z"]);
    let gyro = draw.0.uniform() < 0.5;
    let (channel, size, unit) = match gyro {
        true => ("gyro", draw.either(0.1, 1.0), "deg/s"),
        false => ("accel", draw.either(10.0, 60.0), "mg"),
    };
    let faults = format!(
        "{{ type = \"bias\", size = \"{size:.3} {unit}\", channels = [\"{channel}_{axis}\"] }}"
    );
    fault("imu", 25, &faults, format!("ins: {channel}_bias"))
}

fn noise(draw: &mut Draw) -> Case {
    let sensor = draw.one(&["gnss", "dvl", "depth"]);
    let factor = draw.either(2.0, 8.0).abs();
    let settings = format!("sensor.{sensor}.simulation.noise={factor:.2}");
    Case { settings, change: format!("{sensor}: noise times") }
}

/// A calibration value that the scenario does not know.
fn calibration(draw: &mut Draw) -> Case {
    let size = draw.either(0.6, 2.0);
    let other = draw.either(0.1, 1.0);
    let (state, initial, truth) = match draw.one(&[0, 1, 2, 3]) {
        0 => {
            ("dvl.lever_arm", "\"0 m\"", format!("[\"{size:.2} m\", \"{other:.2} m\", \"0.2 m\"]"))
        }
        1 => {
            let yaw = 5.0 * size;
            (
                "dvl.misalignment",
                "\"0 deg\"",
                format!("[\"{other:.2} deg\", \"1 deg\", \"{yaw:.2} deg\"]"),
            )
        }
        2 => ("dvl.scale", "1.0", format!("{:.3}", 1.0 + 0.07 * size)),
        _ => ("depth.bias", "\"0 m\"", format!("\"{:.2} m\"", 3.0 * size)),
    };
    let initial = match truth.starts_with('[') {
        true => format!("[{initial}, {initial}, {initial}]"),
        false => initial.to_owned(),
    };
    let settings = format!("sensor.{state}={{ initial = {initial}, truth = {truth} }}");
    Case { settings, change: state.replace('.', ": ") }
}

/// The first reason of the run itself, which no diagnosis follows.
fn first_reason(settings: &[String]) -> String {
    let mut document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    settings.iter().for_each(|s| document.set(s).expect("the setting is one"));
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, document, &[]).expect("the scenario has tables");
    let assembly = scenario.assemble(None).expect("the scenario composes");
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    finished.summary.verdict.reasons.first().map_or_else(String::new, ToString::to_string)
}

/// An IMU that is turned by quarters, in draws of rate and seed, whether gravity or only the accelerations
/// show it.
#[test]
fn a_run_names_the_turned_axes_of_an_imu_without_a_diagnosis() {
    let swap = |a: &str, b: &str| {
        let of =
            |v: &str| format!("{{ type = \"swap\", channels = [\"{v}_{a}\", \"{v}_{b}\"] }}, ");
        of("gyro") + &of("accel")
    };
    let sign = |axis: &str| {
        format!("{{ type = \"sign\", channels = [\"gyro_{axis}\", \"accel_{axis}\"] }}, ")
    };
    let kinds = [
        (swap("x", "y") + &sign("x"), "axes are turned"),
        (swap("x", "y") + &sign("y"), "axes are turned"),
        (sign("x") + &sign("y"), "axes are turned"),
        (sign("y") + &sign("z"), "upside down"),
        (sign("x") + &sign("z"), "upside down"),
        (swap("x", "z") + &sign("x"), "axes are turned"),
        (swap("y", "z") + &sign("z"), "axes are turned"),
    ];
    for (faults, words) in &kinds {
        for (seed, rate) in [(1, 40), (2, 50), (3, 80)] {
            let simulation = format!("{{ rate = \"{rate} Hz\", faults = [{faults}] }}");
            let settings = [format!("seed={seed}"), format!("sensor.imu.simulation={simulation}")];
            let first = first_reason(&settings);
            let named = first.starts_with("imu") && first.contains(words);
            assert!(named, "{rate} Hz, {faults}: {first}");
        }
    }
}

pub(crate) fn run(text: &str, settings: &[String]) -> Diagnosis {
    run_within(30.0, text, settings)
}

/// The diagnosis where the runs of all changes have that time, s.
fn run_within(seconds: f64, text: &str, settings: &[String]) -> Diagnosis {
    let mut document = Document::parse("dive.toml", text).expect("the scenario is TOML");
    settings.iter().for_each(|s| document.set(s).expect("the setting is one"));
    let options = Options { threads: 2, seconds };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    diagnose(&registry, &document, &options, &stop, &|_, _| {}).expect("the scenario runs")
}

#[test]
fn the_page_of_a_diagnosis_has_the_remedy_that_the_command_prints() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = folder.path().join("dive.toml");
    std::fs::write(&scenario, DIVE).expect("the folder is writable");
    let (scenario, out) = (scenario.display().to_string(), folder.path().join("out"));
    let turned = "sensor.dvl.samples.factor.vel_x=-1";
    let place = out.display().to_string();
    let command = ["diagnose", &scenario, "--set", turned, "--out", &place];
    let output = navfuse(&command);
    assert!(output.status.success(), "{}", stderr(&output));
    let printed = stdout(&output);
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let (page, json) = (read("diagnosis.html"), read("diagnosis.json"));
    let found: serde_json::Value = serde_json::from_str(&json).expect("it is JSON");
    let change = found["trials"][0]["change"].as_str().expect("a change");
    assert!(printed.contains(&format!("the run is consistent: {change}")), "{printed}");
    let (_, result) = page.split_once("<section id=\"result\">").expect("a result");
    assert!(result.contains(&format!("the run is consistent: {change}.")), "{change}");
    assert!(page.contains("sensor.dvl.samples.factor.vel_x") && page.contains("factor"), "{page}");
    assert!(page.len() < 2_000_000 && !page.contains("NaN") && !page.contains("src="));
}

/// Each kind of fault in two draws of its size, sign, axis and sensor: the right change comes first
/// in 95 % of them, alone or among those that are named together (a depth in cm and one in hPa differ
/// by half a per cent), and the run with the first one is consistent.
#[test]
fn the_change_that_mends_a_fault_comes_first() {
    type Kind = (&'static str, fn(&mut Draw) -> Case);
    let kinds: [Kind; 9] = [
        ("lag", lag),
        ("leap seconds", leap_seconds),
        ("sign", sign),
        ("unit", unit),
        ("axes", axes),
        ("channel", channel),
        ("bias", bias),
        ("noise", noise),
        ("calibration", calibration),
    ];
    let mut wrong = Vec::new();
    let (mut count, mut mended) = (0, 0);
    for (name, kind) in kinds {
        for seed in 0..2 {
            let case = kind(&mut Draw::new(seed, name));
            let diagnosis = run(DIVE, &[format!("seed={}", 100 + seed), case.settings.clone()]);
            let best = diagnosis.best();
            count += 1;
            mended += usize::from(best.is_some_and(|b| b.level == VerdictLevel::Consistent));
            let right = diagnosis.near().any(|near| near.change.starts_with(&case.change));
            if !right {
                wrong.push((case.settings, best.map(|best| best.change.clone())));
            }
        }
    }
    assert!(20 * wrong.len() <= count, "{} of {count}: {wrong:#?}", wrong.len());
    assert!(20 * mended >= 19 * count, "{mended} of {count} are consistent");
}

/// The receiver's first fix comes 70 s after the start, ten seconds after the part on which each change is
/// tried where there is little time.
#[test]
fn a_fault_that_shows_after_a_minute_is_named_where_there_is_little_time() {
    let more = r#"
  { type = "cruise", duration = "20 s" },
  { type = "turn", duration = "15 s", angle = "120 deg" },
  { type = "cruise", duration = "15 s" },
  { type = "turn", duration = "15 s", angle = "-90 deg" },
  { type = "cruise", duration = "10 s" },
]"#;
    let (head, _) = DIVE.rsplit_once(']').expect("the segments end");
    let text = format!("{head}{more}");
    let late = "sensor.gnss.simulation={ rate = \"2 Hz\", outages = [[\"0 s\", \"70 s\"]], faults = \
                [{ type = \"clock-offset\", size = \"18 s\" }] }";
    let diagnosis = run_within(0.1, &text, &[late.to_owned()]);
    let best = diagnosis.best().map(|best| best.change.as_str());
    assert_eq!(best, Some("gnss: clock -18 s"));
}

#[test]
fn nothing_is_blamed_in_a_healthy_run() {
    let diagnosis = run(DIVE, &["seed=7".to_owned()]);
    let best = diagnosis.best().map(|best| &best.change);
    assert_eq!(best, None);
}

#[test]
fn the_change_that_is_written_into_a_scenario_makes_it_consistent_and_keeps_its_comments() {
    let text = DIVE.replacen(
        "noise = \"5 cm\"",
        "noise = \"5 cm\"\nsamples = { factor = { depth = -1 } }",
        1,
    );
    let diagnosis = run(&text, &[]);
    let best = diagnosis.best().expect("a change mends it");
    let written = apply(&text, &best.settings).expect("the text is TOML");
    assert!(written.contains("# of the data sheet"));
    let again = run(&written, &[]);
    assert_eq!(again.unchanged.level, VerdictLevel::Consistent);
}

/// Estimates of a state at the end of the dive, in its unit.
fn estimates(settings: &[String], state: &str) -> Vec<f64> {
    let document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, document, settings).expect("the settings fit");
    let assembly = scenario.assemble(None).expect("the scenario composes");
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    let row = finished.summary.rows.into_iter().find(|row| row.name == state);
    row.expect("the state is there").estimate
}

/// The same noise with a bias of the instrument of 1 cm/s on each axis in turn moves the end by what
/// the runs with that bias in the model have moved it, to 1 %: the filter is nearly linear.
#[test]
fn the_sensitivity_to_a_velocity_bias_is_what_the_bias_of_the_instrument_does() {
    let state = "sensor.dvl.misalignment={ sigma = \"2 deg\" }";
    let mut document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    document.set(state).expect("the setting is one");
    let options = Options { threads: 2, seconds: 1.0 };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    let found = sensitivity(&registry, &document, &options, &stop, &|_, _| {}).expect("it runs");
    let thing = found.things.iter().position(|thing| thing == "dvl: bias 1 cm/s");
    let thing = thing.expect("the scenario does not model it");
    let biased = |axis: usize| {
        let truth = [0, 1, 2].map(|k| if k == axis { "1 cm/s" } else { "0 cm/s" });
        let bias = format!("sensor.dvl.bias={{ initial = \"0 cm/s\", truth = {truth:?} }}");
        estimates(&[state.to_owned(), bias], "dvl.misalignment")
    };
    let (plain, moved) =
        (estimates(&[state.to_owned()], "dvl.misalignment"), [0, 1, 2].map(biased));
    let rows = found.rows.iter().filter(|row| row.state == "dvl.misalignment");
    for (k, row) in rows.enumerate() {
        let sum: f64 = moved.iter().map(|values| (values[k] - plain[k]).powi(2)).sum();
        let (ratio, exceeds) = (row.moves[thing] / sum.sqrt(), row.moves[thing] > row.sigma);
        println!("{}: {:.4} of {:.4} {}", row.component, row.moves[thing], row.sigma, row.unit);
        assert!((ratio - 1.0).abs() < 0.01, "{}: {ratio}", row.component);
        assert!(row.exceeds || !exceeds, "{row:?}");
    }
    // a bias that is a state is not unmodelled
    document.set("sensor.dvl.bias={ sigma = \"1 cm/s\" }").expect("the setting is one");
    let found = sensitivity(&registry, &document, &options, &stop, &|_, _| {}).expect("it runs");
    assert!(!found.things.iter().any(|thing| thing.contains("bias")), "{:?}", found.things);
}

#[test]
fn a_run_that_ends_early_has_no_sensitivity_but_an_error_with_the_reason() {
    let mut document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    let gap = "sensor.imu.simulation.outages=[[\"20 s\", \"22 s\"]]";
    document.set(gap).expect("the setting is one");
    let options = Options { threads: 1, seconds: 1.0 };
    let (registry, stop) = (navfuse::standard_plugins(), AtomicBool::new(false));
    let found = sensitivity(&registry, &document, &options, &stop, &|_, _| {});
    let error = found.expect_err("the gap ends the run").to_string();
    assert!(error.starts_with("the run ends early: ") && error.contains("max_gap"), "{error}");
}

/// The heading is far from north, so that roll and pitch are not the tilts about north and east.
#[test]
fn the_sigmas_beside_the_sensitivities_are_those_of_the_run() {
    let document = Document::parse("dive.toml", DIVE).expect("the scenario is TOML");
    let registry = navfuse::standard_plugins();
    let scenario = Scenario::new(&registry, document.clone(), &[]).expect("it is a scenario");
    let assembly = scenario.assemble(None).expect("the scenario composes");
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    let expected = finished.summary.rows.iter().filter(|row| row.sigma.iter().any(|s| *s > 0.0));
    let expected: Vec<f64> = expected.flat_map(|row| row.sigma.clone()).collect();
    let options = Options { threads: 1, seconds: 1.0 };
    let stop = AtomicBool::new(false);
    let found = sensitivity(&registry, &document, &options, &stop, &|_, _| {}).expect("it runs");
    assert_eq!(found.rows.iter().map(|row| row.sigma).collect::<Vec<_>>(), expected);
    let position = found.rows.iter().filter(|row| row.state == "ins.position");
    assert!(position.map(|row| row.component.as_str()).eq(["north", "east", "down"]));
}
