//! `navfuse report`, `compare` and `figures` as a user calls them, and the page in a browser.

use crate::common::recording::Recording;
use crate::common::{Need, command, navfuse, scenario, skip, stderr, stdout};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn a_scenario_and_the_log_of_its_run_give_the_same_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, direct) = (folder.path().join("run"), folder.path().join("direct.html"));
    let short = ["--set", "estimator.stop=200 s"];
    let output = command()
        .arg("run")
        .arg(scenario("quickstart"))
        .args(short)
        .arg("--out")
        .arg(&run)
        .output();
    assert!(output.is_ok_and(|o| o.status.success()));
    let output =
        command().arg("report").arg(run.join("run.mcap")).output().expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let page = run.join("report.html");
    let printed = stdout(&output);
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(
        lines,
        [page.display().to_string().as_str(), "verdict: consistent"],
        "the output names the page, beside the log, and the verdict"
    );
    let output = command()
        .arg("report")
        .arg(scenario("quickstart"))
        .args(short)
        .arg("--out")
        .arg(&direct)
        .output();
    assert!(output.is_ok_and(|o| o.status.success()));
    assert!(read(&page) == read(&direct), "the pages differ");
    // the verdict is at the end of the log; without it, the filter runs again and is judged
    let log = std::fs::read(run.join("run.mcap")).expect("the log");
    let cut = run.join("cut.mcap");
    std::fs::write(&cut, &log[..log.len() * 9 / 10]).expect("a shorter log");
    let output = command().arg("report").arg(&cut).output().expect("the command starts");
    assert_eq!(stdout(&output).lines().last(), Some("verdict: consistent"), "{}", stderr(&output));
}

#[test]
fn the_page_shows_the_verdict_with_its_reasons() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("page.html");
    let output = command()
        .arg("report")
        .arg(scenario("quickstart"))
        .args([
            "--set",
            "estimator.stop=200 s",
            "--set",
            "sensor.dvl.samples={ axes = [\"y\", \"-x\", \"z\"] }",
        ])
        .arg("--out")
        .arg(&page)
        .output()
        .expect("the command starts");
    let printed = stdout(&output);
    let last = printed.lines().last().expect("a verdict");
    assert!(last.starts_with("verdict: do not use: dvl"), "{last}");
    let page = read(&page);
    assert!(page.contains("Verdict: <b>do not use</b>"));
    assert!(page.contains("locked out"), "the reason is on the page");
}

/// Runs a command for its result in JSON.
fn json_of(command: &str, of: &Path, settings: &[&str], out: &Path) -> Value {
    let output = crate::common::command()
        .args([command, "--format", "json", "--accept-inconsistent"])
        .arg(of)
        .args(settings.iter().flat_map(|set| ["--set", set]))
        .arg("--out")
        .arg(out)
        .output()
        .expect("the command starts");
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|e| panic!("{e}: {}", stderr(&output)))
}

/// The gyros saturate at 254 s, which is found 2 s later.
#[test]
fn a_finding_and_a_rejected_sample_of_the_imu_are_in_result_log_page_and_replay() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, again) = (folder.path().join("run"), folder.path().join("again"));
    let settings = ["estimator.stop=\"258 s\"", "sensor.imu.exclude=[[\"230 s\", \"230.045 s\"]]"];
    let result = json_of("run", &scenario("faults/gyro-saturated"), &settings, &run);
    let findings = result["findings"].as_array().expect("a list");
    let found = findings.iter().find(|f| f["about"] == "imu").expect("a finding about the IMU");
    assert_eq!((&found["severity"], &found["basis"]), (&"do_not_use".into(), &"samples".into()));
    let log = run.join("run.mcap");
    let history = navfuse_report::read_log(&log, |_| {}).expect("the log");
    let logged: Vec<(f64, &str, &str)> = history
        .findings
        .iter()
        .map(|f| (f.time.seconds(), f.text.as_str(), f.remedy.as_str()))
        .collect();
    let told = |f: &'_ Value, key: &str| f[key].as_str().expect("a text").to_owned();
    let told: Vec<(f64, String, String)> = findings
        .iter()
        .map(|f| (f["time_s"].as_f64().expect("a time"), told(f, "text"), told(f, "remedy")))
        .collect();
    assert!(logged.iter().copied().eq(told.iter().map(|(t, a, b)| (*t, a.as_str(), b.as_str()))));
    let excluded = result["samples"]["imu"]["excluded"].as_u64().expect("a number");
    let imu = history.sensor("imu").expect("the IMU");
    let why = "the scenario excludes this time".to_owned();
    assert!(excluded > 0);
    assert_eq!(imu.updates.outcomes.rejected, [(why, excluded)]);
    let output = command().arg("report").arg(&log).output().expect("the command starts");
    let page = read(&run.join("report.html"));
    // among the reasons of the verdict, and not a second time
    let text = found["text"].as_str().expect("a text");
    let (top, _) = page.split_once("<h3>Navigation at the end</h3>").expect("the result");
    assert_eq!(top.matches(text).count(), 1, "{text}: {}", stderr(&output));
    assert!(page.contains(&format!("{excluded} rejected: the scenario excludes this time")));
    assert_eq!(json_of("replay", &log, &[], &again)["findings"], result["findings"]);
}

/// The command `observability` counts the bits of each sensor from the same log.
#[test]
fn the_share_of_each_sensor_in_the_information_is_in_log_and_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = ["estimator.stop=\"200 s\"", "sink.information={ every = \"20 s\" }"];
    json_of("run", &scenario("quickstart"), &settings, folder.path());
    let log = folder.path().join("run.mcap");
    let history = navfuse_report::read_log(&log, |_| {}).expect("the log");
    let [information] = &history.derived[..] else { panic!("{:?}", history.derived) };
    assert_eq!((&*information.name, information.time.seconds()), ("information", 200.0));
    let output = navfuse(&["observability", &log.display().to_string(), "--format", "json"]);
    let observed: Value = serde_json::from_str(&stdout(&output)).expect("a result in JSON");
    let states = observed["states"].as_array().expect("a list");
    assert_eq!(states.len(), information.rows.len());
    for (state, (name, shares)) in states.iter().zip(information.iter()) {
        assert_eq!(state["title"], name);
        let bits = |sensor: &String| state["told_by"][sensor].as_f64().unwrap_or(0.0);
        let bits: Vec<f64> = information.columns.iter().map(bits).collect();
        let sum: f64 = bits.iter().sum();
        for (share, bits) in shares.iter().zip(&bits) {
            let expected = if sum > 0.0 { bits / sum } else { 0.0 };
            assert!((share - expected).abs() < 1e-9, "{name}: {shares:?} {bits}");
        }
    }
    let output = command().arg("report").arg(&log).output().expect("the command starts");
    let page = read(&folder.path().join("report.html"));
    assert!(page.contains("<h3>information"), "{}", stderr(&output));
    // nothing derives it unless the scenario asks
    let plain = folder.path().join("plain");
    json_of("run", &scenario("quickstart"), &settings[..1], &plain);
    let history = navfuse_report::read_log(&plain.join("run.mcap"), |_| {}).expect("the log");
    assert!(history.derived.is_empty());
}

/// Of a receiver that jumps, velocities are used while positions are refused: its row of the table alone does
/// not add up.
#[test]
fn the_page_counts_the_samples_that_were_used_in_part_as_the_result_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = ["estimator.stop=\"300 s\""];
    let result = json_of("run", &scenario("faults/gnss-jump"), &settings, folder.path());
    let count = result["samples"]["gnss"]["used_in_part"].as_u64().expect("a count");
    let output = command().arg("report").arg(folder.path()).output().expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let page = read(&folder.path().join("report.html"));
    let words = format!("{count} gated or rejected samples were used in part, by other channels");
    assert!(count > 10 && page.contains(&words), "{count}");
}

#[test]
fn a_run_that_ends_in_an_error_has_its_page_and_a_failure() {
    let recording = Recording::new();
    recording.replace_line("dvl.csv", 15, "14.0,0.001,north,0.001");
    let page = recording.path("page.html");
    let output =
        command().arg("report").arg(recording.path("rest.toml")).arg("--out").arg(&page).output();
    let output = output.expect("the command starts");
    assert!(!output.status.success() && stderr(&output).contains("dvl.csv"), "{}", stderr(&output));
    assert!(read(&page).contains("dvl.scale"), "the estimate until then is in the page");
}

/// A simulation knows the truth. A recording has a reference, which may share sensors.
#[test]
fn a_recorded_reference_is_not_called_the_truth() {
    let recording = Recording::new();
    let simulated = scenario("quickstart");
    let page = |of: &Path| -> String {
        let page = recording.path("page.html");
        let stop = ["--set", "estimator.stop=100 s"];
        let output = command().arg("report").arg(of).args(stop).arg("--out").arg(&page).output();
        assert!(output.is_ok_and(|o| o.status.success()));
        read(&page)
    };
    let (recorded, simulated) = (page(&recording.path("rest.toml")), page(&simulated));
    assert!(recorded.contains(">reference</th>") && !recorded.contains(">truth</th>"));
    assert!(recorded.contains("difference from the reference"));
    assert!(!simulated.contains("difference from the reference"));
    assert!(simulated.contains(">truth</th>"));
}

#[test]
fn what_is_no_log_and_settings_of_a_log_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notes.txt");
    std::fs::write(&path, "no log at all, but long enough to be one").expect("the test can write");
    let output = navfuse(&["report", &path.display().to_string()]);
    assert!(!output.status.success());
    let said = stderr(&output);
    assert!(said.contains("notes.txt") && said.contains("not an MCAP file"), "{said}");
    let output = navfuse(&["report", &path.display().to_string(), "--set", "seed=2"]);
    assert!(stderr(&output).contains("navfuse replay"), "{}", stderr(&output));
}

/// A comparison of a scenario with a change of it agrees with the summaries of both runs.
#[test]
fn a_pair_that_differs_in_one_key_shows_that_key_first_and_the_errors_of_both_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = scenario("quickstart").display().to_string();
    let short = ["--set", "estimator.stop=200 s"];
    let single = |noise: &str| -> (Value, String) {
        let out = folder.path().join(noise.replace(' ', "-")).display().to_string();
        let change = format!("sensor.dvl.noise={noise}");
        let arguments = ["run", &path, "--format=json", "--out", &out, "--set", &change];
        let output = navfuse(&[&arguments[..], &short].concat());
        (serde_json::from_str(&stdout(&output)).expect("JSON"), out)
    };
    let (first, second) = (single("1 cm/s"), single("2 cm/s"));
    let out = folder.path().join("compare").display().to_string();
    let vary = ["--vary", "sensor.dvl.noise=2 cm/s", "--format=json", "--out", &out];
    let output = navfuse(&[&["compare", &path], &vary[..], &short].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let result: Value = serde_json::from_str(&stdout(&output)).expect("one JSON object");
    assert_eq!(result["scenario"].as_array().map(Vec::len), Some(1), "{}", result["scenario"]);
    assert_eq!(result["scenario"][0]["key"], "sensor.dvl.noise");
    assert_eq!(result["scenario"][0]["values"][1], "\"2 cm/s\"");
    for (k, (run, _)) in [&first, &second].into_iter().enumerate() {
        let compared = &result["runs"][k];
        assert_eq!(compared["final_error_m"], run["horizontal_error_m"]["final"]);
        let rms = [&compared["rms_error_m"], &run["horizontal_error_m"]["rms"]];
        let [a, b] = rms.map(|v| v.as_f64().expect("a number"));
        assert!((a - b).abs() < 1e-9, "{a} and {b}: the reference and the epochs have one rate");
        assert_eq!(compared["verdict"], run["verdict"]["level"]);
        for sensor in result["sensors"].as_array().expect("sensors") {
            let name = sensor["sensor"].as_str().expect("a name");
            assert_eq!(sensor["runs"][k]["used"], run["samples"][name]["accepted"], "{name}");
        }
    }
    let yaw = (result["states"].as_array().expect("states").iter())
        .find(|s| s["state"] == "dvl.misalignment yaw")
        .expect("the yaw of the DVL");
    let of = |run: &Value, key: &str| run["states"]["dvl.misalignment"][key][2].as_f64();
    let [a, b] = [&first.0, &second.0].map(|run| of(run, "error").expect("an error"));
    let [s, t] = [&first.0, &second.0].map(|run| of(run, "sigma").expect("a sigma"));
    let second_run = &yaw["runs"][1];
    let close = |key: &str, to: f64| {
        let value = second_run[key].as_f64().unwrap_or(f64::NAN);
        assert!((value - to).abs() <= 1e-12 * to.abs().max(1.0), "{key}: {value} and {to}");
    };
    close("difference", b - a);
    close("difference_sigma", s.hypot(t));
    // what differs comes first, the largest first, and no state ends farther apart than that
    let differences = result["differences"].as_array().expect("differences");
    let sizes = differences.iter().map(|d| d["sigmas"].as_f64().expect("a number").abs());
    assert!(sizes.is_sorted_by(|a, b| a >= b), "{differences:?}");
    for state in result["states"].as_array().expect("states") {
        let run = &state["runs"][1];
        let end = run["difference"].as_f64().zip(run["difference_sigma"].as_f64());
        let largest = differences.iter().find(|d| d["state"] == state["state"]);
        let Some((difference, sigma)) = end.filter(|e| e.1 > 0.0) else { continue };
        let largest = largest.and_then(|d| d["sigmas"].as_f64()).expect("a largest difference");
        assert!((difference / sigma).abs() <= largest.abs() + 1e-9, "{state}: {largest}");
    }
    // the logs of the same runs give the same table, and the key is in the first row
    let logs = [&first.1, &second.1];
    let output = navfuse(&["compare", logs[0], logs[1], "--no-output"]);
    let printed = stdout(&output);
    let heading = printed.lines().position(|l| l.trim().starts_with("scenario ")).expect("a table");
    let row = printed.lines().nth(heading + 2).expect("a row");
    let words: Vec<&str> = row.split('"').map(str::trim).collect();
    assert_eq!(words, ["sensor.dvl.noise", "1 cm/s", "", "2 cm/s", ""]);
    // every figure and every key is on the page
    let page = read(&Path::new(&out).join("compare.html"));
    assert!(page.contains("sensor.dvl.noise") && page.contains("B - A"));
    let at = |heading: &str| page.find(&format!("<h2>{heading}</h2>")).expect("a heading");
    assert!(at("What differs") < at("Runs") && at("Runs") < at("Sensors"));
    assert!(page.matches("<svg").count() >= 10, "{}", page.matches("<svg").count());
    assert!(!page.contains("no data") && !page.contains("NaN"));
    #[cfg(feature = "rerun")]
    assert!(Path::new(&out).join("compare.rrd").is_file());
}

/// The columns of the differences are empty, which a sentence explains.
#[test]
fn runs_that_end_at_different_times_have_a_sentence_instead_of_a_difference() {
    let path = scenario("quickstart").display().to_string();
    let stop = ["--set", "estimator.stop=75 s", "--vary", "estimator.stop=70 s", "--no-output"];
    let printed = stdout(&navfuse(&[&["compare", &path], &stop[..]].concat()));
    let words: Vec<&str> = printed.split_whitespace().collect();
    assert!(words.join(" ").contains("B ends at another time than A: the"), "{printed}");
}

#[test]
fn a_comparison_that_cannot_be_made_is_rejected_with_a_remedy() {
    let path = scenario("quickstart").display().to_string();
    let rejected = |arguments: &[&str], remedy: &str| {
        let output = navfuse(&[&["compare", "--no-output"], arguments].concat());
        assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
        assert!(stderr(&output).contains(remedy), "{}", stderr(&output));
    };
    rejected(&[&path], "--vary");
    rejected(&[&path, "--vary", "seed=1,2,3,4,5,6"], "sweep");
    rejected(&["a.mcap", "b.mcap", "--set", "seed=1"], "replay");
    rejected(&["a.mcap", "b.mcap"], "a.mcap");
}

/// The figures have the paper's numbers and titles.
#[test]
fn the_figures_of_pan_wu_are_made_by_an_installed_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("figures");
    // a folder without the repository's scenarios
    let output = command()
        .current_dir(folder.path())
        .args(["figures", "pan-wu", "--out"])
        .arg(&out)
        .output();
    let output = output.expect("the command starts");
    assert!(output.status.success(), "{}", stderr(&output));
    let titles = [
        (1, "trajectory"),
        (2, "DVL outputs"),
        (3, "gyroscope and accelerometer outputs"),
        (4, "DVL scale factor by the ideal observer IO-DVLC, 3D run"),
        (5, "DVL misalignment by the ideal observer IO-DVLC, 3D run"),
        (6, "DVL scale factor by the EKF, 3D run"),
        (7, "DVL misalignment by the EKF, 3D run"),
        (8, "gyroscope bias"),
        (9, "accelerometer bias"),
        (10, "attitude error by the EKF, 3D run"),
        (11, "horizontal position error by the EKF, 3D run"),
        (12, "normalised standard deviations"),
        (13, "DVL scale factor by the EKF, 2D run"),
        (14, "DVL misalignment by the EKF, 2D run"),
        (15, "attitude error by the EKF, 2D run"),
        (16, "horizontal position error by the EKF, 2D run"),
    ];
    let index = read(&out.join("index.html"));
    for (number, title) in titles {
        let figure = read(&out.join(format!("figure-{number:02}.svg")));
        assert!(figure.contains(&format!("Figure {number}: {title}")), "{number}");
        assert!(
            figure.len() < 150_000 && !figure.contains("no data"),
            "{number}: {} bytes",
            figure.len()
        );
        assert!(index.contains(&format!("Figure {number}. ")), "{number}");
    }
    #[cfg(feature = "rerun")]
    assert!(out.join("figures.rrd").is_file());
}

/// Returns Chromium, if it is installed.
fn chromium() -> Option<PathBuf> {
    let paths = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&paths)
        .flat_map(|folder| names.map(|n| folder.join(n)))
        .find(|p| p.is_file())
}

/// What a browser without a network finds in a page: the title that a script in its head sets.
/// Without Chromium, the test is skipped.
fn probed(folder: &Path, page: &str, script: &str) -> Option<String> {
    let Some(chromium) = chromium() else {
        skip(Need::Browser, "the page is opened in Chromium");
        return None;
    };
    let script = format!(
        "<script>window.onerror = e => {{ document.title = 'error ' + e }};\
         addEventListener('load', () => {{ {script} }});</script></head>"
    );
    let probed = folder.join("probed.html");
    std::fs::write(&probed, page.replacen("</head>", &script, 1)).expect("the test can write");
    let headless = [
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--window-size=1000,1200",
        "--dump-dom",
        "--host-resolver-rules=MAP * ~NOTFOUND",
    ];
    let output = Command::new(chromium)
        .args(headless)
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", probed.display()))
        .output()
        .expect("Chromium starts");
    let dom = stdout(&output);
    let from = dom.find("<title>").unwrap_or_else(|| panic!("no page: {}", stderr(&output)));
    let title = &dom[from + 7..from + dom[from..].find("</title>").expect("a title ends")];
    Some(title.to_owned())
}

/// The page of a short run.
fn short_page(folder: &Path) -> String {
    let path = folder.join("report.html");
    let mut report = command();
    report.arg("report").arg(scenario("quickstart")).args(["--set", "estimator.stop=200 s"]);
    assert!(report.arg("--out").arg(&path).output().is_ok_and(|o| o.status.success()));
    read(&path)
}

/// Every drawing has a size, no text of the page is wider than the window, and nothing was loaded.
#[test]
fn a_browser_opens_the_page_offline_and_draws_every_figure() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = short_page(folder.path());
    let count = "document.querySelectorAll('details').forEach(d => d.open = true);\
        const drawn = [...document.querySelectorAll('figure svg')]\
            .filter(s => s.getBoundingClientRect().height > 50);\
        const wide = document.documentElement.scrollWidth > innerWidth;\
        const loaded = performance.getEntriesByType('resource').length;\
        document.title = `drawn ${drawn.length} wide ${wide} loaded ${loaded}`;";
    let Some(title) = probed(folder.path(), &page, count) else { return };
    let figures = page.matches("<figure").count();
    assert_eq!(title, format!("drawn {figures} wide false loaded 0"));
}

/// The second plot of the trajectory shows time and height: the pointer over it, a part of it
/// enlarged, the same value there, and the whole plot again.
#[test]
fn the_pointer_shows_values_and_a_drag_enlarges_a_plot() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = short_page(folder.path());
    let script = "const svg = document.querySelector('#trajectory svg');\
        const plot = JSON.parse(svg.dataset.plots)[1];\
        const [left, top, wide, high] = plot.at;\
        const pixel = t => left + (t - plot.x.low) / (plot.x.high - plot.x.low) * wide;\
        const send = (type, x) => {\
            const p = new DOMPoint(x, top + high / 2).matrixTransform(svg.getScreenCTM());\
            svg.dispatchEvent(new PointerEvent(type, { clientX: p.x, clientY: p.y, button: 0,\
                bubbles: true, pointerType: 'mouse' })); };\
        const tip = () => document.querySelector('.tip').textContent.split('\\n')\
            .map(line => Number(line.split(': ')[1]));\
        send('pointermove', pixel(100));\
        const first = tip();\
        send('pointerdown', pixel(80));\
        send('pointermove', pixel(120));\
        send('pointerup', pixel(120));\
        send('pointermove', left + wide / 2);\
        const second = tip();\
        send('pointermove', 0);\
        send('dblclick', pixel(100));\
        const ticks = svg.querySelectorAll('g').length;\
        document.title = JSON.stringify([first, second, ticks]);";
    let Some(title) = probed(folder.path(), &page, script) else { return };
    let values: serde_json::Value =
        serde_json::from_str(&title).unwrap_or_else(|_| panic!("{title}"));
    let number = |a: usize, b: usize| values[a][b].as_f64().unwrap_or_else(|| panic!("{title}"));
    // time, truth and estimate; 200 s are 1500 units, and 40 s enlarged as many
    assert!((number(0, 0) - 100.0).abs() < 0.5 && (number(1, 0) - 100.0).abs() < 0.1, "{title}");
    for k in [1, 2] {
        let (a, b) = (number(0, k), number(1, k));
        assert!((a - b).abs() <= 0.02 * (a.abs() + b.abs()) + 0.05, "{title}");
    }
    assert_eq!(values[2], 0, "the ticks of the part are gone");
}
