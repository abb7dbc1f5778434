//! The arrows between the crates: those of the table in docs/src/explanation/design.md, and no
//! more.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The names in `[dependencies]` of a crate.
fn dependencies(folder: &Path) -> BTreeSet<String> {
    let file = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let table: toml::Table = text.parse().expect("Cargo.toml is TOML");
    let names = table.get("dependencies").and_then(toml::Value::as_table);
    names.map(|t| t.keys().cloned().collect()).unwrap_or_default()
}

/// The crates of this workspace in `[dependencies]`, without their prefix and without the
/// framework.
fn uses(folder: &Path) -> BTreeSet<String> {
    let names = dependencies(folder);
    let ours = names.iter().filter_map(|n| n.strip_prefix("navfuse-"));
    ours.filter(|n| *n != "core").map(Into::into).collect()
}

/// The crates below a folder, at any depth, each by its name without the prefix.
fn crates(room: &str) -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    add_crates(&root().join(room), &mut found);
    found
}

fn add_crates(folder: &Path, found: &mut Vec<(String, PathBuf)>) {
    for entry in std::fs::read_dir(folder).expect("the folder exists") {
        let path = entry.expect("the folder is readable").path();
        let file = path.join("Cargo.toml");
        if let Ok(text) = std::fs::read_to_string(&file) {
            let table: toml::Table = text.parse().expect("Cargo.toml is TOML");
            let name = table["package"]["name"].as_str().expect("a package has a name");
            found.push((name.trim_start_matches("navfuse-").to_owned(), path));
        } else if path.is_dir() {
            add_crates(&path, found);
        }
    }
}

/// The names in back-quotes.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(Into::into).collect()
}

/// The arrows of the table, each from the crate that is used to the one that uses it.
fn table() -> BTreeSet<(String, String)> {
    let text = std::fs::read_to_string(root().join("docs/src/explanation/design.md"))
        .expect("the page exists");
    let rows = text
        .lines()
        .skip_while(|l| !l.starts_with("| shared | by |"))
        .skip(2)
        .take_while(|l| l.starts_with('|'));
    let (mut arrows, mut shared) = (BTreeSet::new(), Vec::new());
    for row in rows {
        let cells: Vec<&str> = row.split('|').collect();
        let first = quoted(cells[1]);
        shared = if first.is_empty() { shared } else { first };
        let by = quoted(cells[2]);
        arrows.extend(shared.iter().flat_map(|s| by.iter().map(|b| (s.clone(), b.clone()))));
    }
    arrows
}

#[test]
fn no_crate_uses_another_but_as_the_design_says() {
    let mut found = BTreeSet::new();
    for (name, folder) in ["plugins", "tools"].into_iter().flat_map(crates) {
        found.extend(uses(&folder).into_iter().map(|shared| (shared, name.clone())));
    }
    let table = table();
    let (more, less): (Vec<_>, Vec<_>) =
        (found.difference(&table).collect(), table.difference(&found).collect());
    assert!(
        more.is_empty() && less.is_empty(),
        "not in design.md: {more:?}; not in a Cargo.toml: {less:?}"
    );
}

/// The folders of plugins, each with the folders of plugins that it uses.
const FOLDERS: [(&str, &[&str]); 9] = [
    ("sensors", &["sensors"]),
    ("estimators", &[]),
    ("formats", &["instruments"]),
    ("instruments", &[]),
    ("links", &["formats", "instruments"]),
    ("dds", &["formats", "instruments", "links"]),
    ("foxglove", &["formats"]),
    ("simulation", &["sensors"]),
    ("viewer", &[]),
];

#[test]
fn sensors_know_no_format_and_formats_know_no_sensor() {
    let plugins = crates("plugins");
    let folder = |path: &Path| {
        let below = path.strip_prefix(root().join("plugins")).expect("a plugin").components();
        below.map(|c| c.as_os_str().to_string_lossy().into_owned()).next().expect("a folder")
    };
    for (name, path) in &plugins {
        let (from, used) = (folder(path), uses(path));
        let allowed = FOLDERS.iter().find(|f| f.0 == from).expect("a folder of the list").1;
        let to = plugins.iter().filter(|(name, _)| used.contains(name));
        let wrong: Vec<_> = to.filter(|(_, p)| !allowed.contains(&&*folder(p))).collect();
        assert!(wrong.is_empty(), "{from}/{name} uses {wrong:?}");
    }
}

#[test]
fn no_plugin_depends_on_a_tool_and_no_tool_on_the_command() {
    let tools: BTreeSet<String> = crates("tools").into_iter().map(|(name, _)| name).collect();
    assert!(tools.contains("report"), "{tools:?}");
    for (name, folder) in crates("plugins") {
        let upwards: Vec<_> = uses(&folder).intersection(&tools).cloned().collect();
        assert!(upwards.is_empty(), "plugins/{name} depends on tools: {upwards:?}");
    }
    for room in ["framework", "plugins", "tools"] {
        let one = [(room.to_owned(), root().join(room))];
        let all = if room == "framework" { one.to_vec() } else { crates(room) };
        for (name, folder) in all {
            assert!(!dependencies(&folder).contains("navfuse"), "{room}: {name} uses the command");
        }
    }
}

#[test]
fn the_framework_knows_no_plugin_no_file_format_of_samples_and_no_viewer() {
    let framework = root().join("framework");
    let ours = uses(&framework);
    assert!(ours.is_empty(), "{ours:?}");
    let all = dependencies(&framework);
    for name in ["csv", "mcap", "rerun", "re_sdk", "plotters", "parquet"] {
        assert!(!all.contains(name), "{name}");
    }
}

#[test]
fn only_the_python_package_knows_python() {
    assert!(dependencies(&root().join("python")).contains("pyo3"));
    let below = ["plugins", "tools"].into_iter().flat_map(crates).map(|(_, folder)| folder);
    for folder in below.chain([root().join("framework"), root().to_owned()]) {
        let names = dependencies(&folder);
        let knows = names.contains("pyo3") || names.contains("navfuse-python");
        assert!(!knows, "{} knows Python", folder.display());
    }
}

/// The steps of the walk on the design page, each a file of the framework and its functions.
fn walk() -> Vec<(String, Vec<String>)> {
    let text = std::fs::read_to_string(root().join("docs/src/explanation/design.md"))
        .expect("the page exists");
    let steps = text.lines().skip_while(|l| !l.starts_with("## The walk of an IMU sample"));
    let steps = steps.filter(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    let step = |line: &str| {
        let mut names = quoted(line);
        (names.remove(0), names)
    };
    steps.map(step).collect()
}

/// The text of a method, from its name to its last brace.
fn body<'a>(text: &'a str, method: &str) -> Option<&'a str> {
    let start = ["(", "<"].iter().find_map(|next| text.find(&format!("fn {method}{next}")));
    let rest = &text[start?..];
    Some(&rest[..rest.find("\n    }\n")?])
}

/// Each function of the walk is called by one that the walk has named before it, and the functions
/// of a file are listed from top to bottom.
#[test]
fn the_walk_of_an_imu_sample_leads_forward_through_at_most_eight_files() {
    let steps = walk();
    assert!((2..=8).contains(&steps.len()), "{steps:#?}");
    let mut callers = String::new();
    for (file, functions) in &steps {
        let text = std::fs::read_to_string(root().join("framework/src").join(file));
        let text = text.unwrap_or_else(|e| panic!("{file}: {e}"));
        let mut last = 0;
        for function in functions {
            let body = body(&text, function).unwrap_or_else(|| panic!("{file} has no {function}"));
            let at = text.find(body).expect("the body is a part of the file");
            assert!(at > last, "{file}: {function} stands above the function before it");
            let called = callers.is_empty() || callers.contains(&format!(".{function}("));
            assert!(called, "nothing before it calls {function} of {file}");
            callers.push_str(body);
            last = at;
        }
    }
}

/// Limits of formats: the start of their row in SECURITY.md, the file, and its constants.
const LIMITS: &[(&str, &str, &[&str])] = &[
    ("scenarios", "framework/src/document/document.rs", &["LONGEST"]),
    ("scenarios", "framework/src/document/include.rs", &["MOST"]),
    ("recordings in CSV", "plugins/formats/csv/src/bounded.rs", &["LONGEST_ROW"]),
    ("recordings in CSV", "plugins/formats/csv/src/stamp.rs", &["LONGEST_DATE"]),
    ("logs of navfuse", "plugins/instruments/frames/src/mcap.rs", &["LONGEST"]),
    ("bags", "plugins/instruments/frames/src/mcap.rs", &["LONGEST"]),
    ("bags", "plugins/formats/ros2/src/bag/topics.rs", &["MOST_TOPICS"]),
    ("bags", "plugins/formats/ros2/src/bag/mcap.rs", &["MOST_DEFINITIONS", "LONGEST_DEFINITION"]),
    ("bags", "plugins/formats/ros2/src/program.rs", &["DEEPEST"]),
    ("bags", "plugins/formats/ros2/src/bag/table.rs", &["DEEPEST"]),
    ("bags", "plugins/formats/ros2/src/transforms.rs", &["DEEPEST"]),
    ("NMEA", "plugins/instruments/frames/src/sentences.rs", &["MAX"]),
    ("NMEA", "plugins/formats/nmea/src/vessel.rs", &["MOST"]),
    ("Nortek", "plugins/formats/dvl-files/src/ad2cp.rs", &["LARGEST"]),
    ("Water Linked", "plugins/formats/dvl-files/src/water_linked.rs", &["MAX"]),
    ("maps of heights", "plugins/sensors/terrain/src/grid.rs", &["LONGEST", "MOST"]),
    ("maps of heights", "plugins/sensors/seawater/src/column.rs", &["LONGEST"]),
    ("campaigns", "tools/campaign/src/journal.rs", &["LONGEST"]),
    ("campaigns", "tools/campaign/src/campaign.rs", &["MAX_RUNS"]),
];

/// The value of a constant in a source text: a number, a product or a shift.
fn constant(text: &str, name: &str) -> Option<u64> {
    let (_, rest) = text.split_once(&format!("const {name}: "))?;
    let (_, value) = rest.split_once(';')?.0.split_once("= ")?;
    let number = |text: &str| text.trim().replace('_', "").parse::<u64>().ok();
    if let Some((a, b)) = value.split_once("<<") {
        return Some(number(a)? << number(b)?);
    }
    value.split('*').try_fold(1, |product, factor| Some(product * number(factor)?))
}

/// The ways in which the table shows a limit: as bytes or as a count.
fn shown(value: u64) -> [String; 2] {
    let bytes = match value.trailing_zeros() {
        20.. => format!("{} MiB", value >> 20),
        10.. => format!("{} KiB", value >> 10),
        _ => format!("{value} bytes"),
    };
    [bytes, format!("{value} ")]
}

#[test]
fn the_limits_in_security_are_those_of_the_code() {
    let page = std::fs::read_to_string(root().join("SECURITY.md")).expect("the page exists");
    for (row, file, names) in LIMITS {
        let row = page.lines().find(|line| line.starts_with(&format!("| {row}")));
        let row = row.unwrap_or_else(|| panic!("{file}: no row")).replace(" 000", "000");
        let text = std::fs::read_to_string(root().join(file)).expect("the file exists");
        for name in *names {
            let value = constant(&text, name).unwrap_or_else(|| panic!("{file}: no {name}"));
            let words = shown(value);
            assert!(words.iter().any(|w| row.contains(w)), "{file}: {name} is {words:?}: {row}");
        }
    }
}
