//! The sensitivities of a run on its page, in its JSON, and against a campaign with the error.

use crate::common::{command, scenario, stderr, stdout};
use serde_json::Value;

/// The output of a command on `quickstart`.
fn quickstart(verb: &str, arguments: &[&str]) -> String {
    let output = command().arg(verb).arg(scenario("quickstart")).args(arguments).output();
    let output = output.expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

fn json(verb: &str, arguments: &[&str]) -> Value {
    let text = quickstart(verb, &[arguments, &["--format", "json", "--no-output"]].concat());
    serde_json::from_str(&text).expect("JSON")
}

/// Mean errors of all components at the end of eight runs.
fn mean_errors(settings: &[&str]) -> Vec<f64> {
    let found = json("monte-carlo", &[&["--runs", "8"], settings].concat());
    let states = found["points"][0]["states"].as_array().expect("states");
    states.iter().map(|state| state["mean_error"].as_f64().expect("a number")).collect()
}

/// Eight runs with a bias of the instrument and eight without, with the same random numbers. Some 12
/// of the 2763 samples of the DVL are gated with the bias and not without, or in turn, which moves an
/// estimate by some sqrt(12 / 2763) = 0.07 of its sigma: hence the 0.15 for a single run.
#[test]
fn the_sensitivity_of_quickstart_to_a_bias_is_what_a_campaign_with_that_bias_shows() {
    let plain = mean_errors(&[]);
    let biased = [0, 1, 2].map(|axis| {
        let truth = [0, 1, 2].map(|k| if k == axis { "1 cm/s" } else { "0 cm/s" });
        let bias = format!("sensor.dvl.bias={{ initial = \"0 cm/s\", truth = {truth:?} }}");
        mean_errors(&["--set", &bias])
    });
    let found = &json("run", &["--sensitivity"])["sensitivity"];
    let things = found["things"].as_array().expect("things");
    let thing = things.iter().position(|thing| thing == "dvl: bias 1 cm/s").expect("the bias");
    let rows = found["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), plain.len());
    let mut marked = 0;
    for (k, row) in rows.iter().enumerate() {
        let number = |value: &Value| value.as_f64().expect("a number");
        let (sigma, moved) = (number(&row["sigma"]), number(&row["moves"][thing]));
        let sum: f64 = biased.iter().map(|errors| (errors[k] - plain[k]).powi(2)).sum();
        let (expected, exceeds) = (sum.sqrt(), moved > sigma);
        let name = format!("{} {}", row["state"], row["component"]);
        println!("{name}: {moved:.2e}, the campaign {expected:.2e}, sigma {sigma:.2e}");
        marked += usize::from(exceeds);
        let margin = if exceeds { 0.1 * expected } else { 0.15 * sigma };
        assert!((moved - expected).abs() < margin, "{name}: {moved} against {expected}");
    }
    assert!(marked >= 3, "scale, and pitch and yaw of the misalignment: {marked}");
}

#[test]
fn the_page_and_the_json_have_the_sensitivities_only_when_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = |name: &str, asked: &[&str]| {
        let path = folder.path().join(name);
        let out = ["--out", path.to_str().expect("text"), "--set", "estimator.stop=120 s"];
        quickstart("report", &[&out, asked].concat());
        std::fs::read_to_string(path).expect("the page")
    };
    let (plain, asked) = (page("plain.html", &[]), page("asked.html", &["--sensitivity"]));
    assert!(!plain.contains("#sensitivity") && asked.contains("href=\"#sensitivity\""));
    let section = asked.split("<section id=\"sensitivity\">").nth(1).expect("the section");
    let section = section.split("</section>").next().expect("its end");
    assert!(section.contains("<th>dvl: bias 1 cm/s</th>"), "{section}");
    assert!(section.contains("class=\"bad\""), "a change beyond sigma is marked: {section}");
    let short = ["--set", "estimator.stop=61 s"];
    assert_eq!(json("run", &short).get("sensitivity"), None);
}
