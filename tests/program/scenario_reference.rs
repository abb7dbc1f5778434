//! The page `docs/src/reference/scenario.md` is generated from the registered types.
//!
//! `UPDATE=1 cargo test --test program scenario_reference` writes it anew, and the schema beside the
//! shipped scenarios.

use navfuse_core::document::Document;
use navfuse_core::plugin::{Entry, Kind, Registry};
use navfuse_core::run::scenario::{Scenario, common_keys};
use navfuse_core::run::schema::{Parameter, parameters, scenario_schema};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/src/reference/scenario.md");

const HEAD: &str = "\
# Scenario reference

<!-- Generated from doc comments by `UPDATE=1 cargo test --test program scenario_reference`. -->

A scenario is a TOML file. `navfuse list TYPE` prints the tables of this page, and `navfuse schema` prints
the JSON Schema. A quantity is a string with a unit; see
[Conventions and units](conventions.md#units-in-a-scenario). *(required)* marks a key that a table must have.
For a key with the default `-`, the last column states what happens without the key.
";

/// Writes the rows of a table; an empty table is left out.
fn table(out: &mut String, rows: impl IntoIterator<Item = Parameter>) {
    let cell = |text: &str| text.replace('|', "\\|");
    let mut head = "| key | takes | default | meaning |\n|---|---|---|---|\n";
    for p in rows {
        let takes = match p.takes.strip_prefix("calibration") {
            Some(value) => {
                format!("[calibration](../how-to/scenario.md#calibration-states){}", cell(value))
            }
            None => cell(&p.takes),
        };
        let _ = writeln!(
            out,
            "{head}| `{}` | {takes} | {} | {} |",
            p.key,
            cell(&p.default),
            cell(&p.meaning)
        );
        head = "";
    }
    if head.is_empty() {
        out.push('\n');
    }
}

/// Returns the keys of a table without a registered type.
fn keys(schema: &Value) -> Vec<Parameter> {
    let text = |v: &Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
    let takes = |v: &Value| {
        let example = v.get("examples").and_then(|e| e.get(0)).map(|e| format!("e.g. {e}"));
        // an optional key takes its type or null
        let kind = || {
            let kind = v.get("type")?;
            kind.as_str().or_else(|| kind.as_array()?.first()?.as_str()).map(str::to_owned)
        };
        example.or_else(kind).unwrap_or_else(|| "a choice".into())
    };
    let required =
        |key: &str| schema["required"].as_array().is_some_and(|r| r.iter().any(|k| k == key));
    (schema["properties"].as_object().unwrap().iter())
        .map(|(key, v)| Parameter {
            key: key.clone(),
            takes: takes(v),
            default: v
                .get("default")
                .map_or_else(|| if required(key) { "(required)".into() } else { "-".into() }, text),
            meaning: v
                .get("description")
                .and_then(Value::as_str)
                .unwrap_or_default()
                .replace('\n', " "),
        })
        .collect()
}

/// Returns `true` for a parameter that all types of a kind have.
fn is_common(kind: Kind, p: &Parameter) -> bool {
    p.key.split('.').next().is_some_and(|key| common_keys(kind).contains(&key))
}

/// Writes the section of one type, with its own keys.
fn section(entry: &Entry) -> String {
    let description = entry.schema.get("description").and_then(Value::as_str).unwrap_or_default();
    let mut out = format!("### `[{}.{}]`\n\n{description}\n\n", entry.kind.table(), entry.name);
    table(&mut out, parameters(entry).into_iter().filter(|p| !is_common(entry.kind, p)));
    out
}

/// Writes the whole page.
fn page(registry: &Registry) -> String {
    let schema = scenario_schema(registry);
    let mut out = format!("{HEAD}\n## Top\n\n");
    let top = keys(&schema)
        .into_iter()
        .filter(|p| ["name", "description", "seed"].contains(&p.key.as_str()));
    table(&mut out, top);
    out += "## `[estimator]`\n\n";
    table(&mut out, keys(&schema["properties"]["estimator"]));
    for kind in Kind::ALL {
        let _ = write!(out, "## `[{}.NAME]`\n\nCommon keys:\n\n", kind.table());
        let of_kind = || registry.entries().filter(move |e| e.kind == kind);
        let first = of_kind().next().unwrap();
        let common = parameters(first).into_iter().filter(|p| is_common(kind, p));
        table(
            &mut out,
            common.map(|p| Parameter {
                takes: p.takes.replace(&format!("{:?}", first.name), "a type"),
                ..p
            }),
        );
        of_kind().for_each(|e| out += &section(e));
    }
    out.truncate(out.trim_end().len());
    out + "\n"
}

#[test]
fn the_page_agrees_with_the_types() {
    let registry = navfuse::standard_plugins();
    if cfg!(feature = "rerun") {
        let page = page(&registry);
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(PAGE, &page).unwrap();
        }
        let written = std::fs::read_to_string(PAGE).unwrap();
        let differs = written.lines().zip(page.lines()).find(|(a, b)| a != b);
        assert!(written == page, "the page is out of date at {differs:?}; write it with UPDATE=1");
    } else {
        // the page has an additional section
        let written = std::fs::read_to_string(PAGE).unwrap();
        for entry in registry.entries() {
            assert!(
                written.contains(section(entry).trim_end()),
                "the page is out of date at {entry:?}"
            );
        }
    }
}

/// Editors complete and check the shipped scenarios with this file, which their first line names.
#[test]
fn the_schema_beside_the_scenarios_agrees_with_the_types() {
    if !cfg!(feature = "rerun") {
        return; // the file has the keys of the viewer too
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/navfuse.schema.json");
    let schema = scenario_schema(&navfuse::standard_plugins());
    let schema = serde_json::to_string_pretty(&schema).unwrap();
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&path, format!("{schema}\n")).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(written.trim_end() == schema, "{} is out of date; UPDATE=1", path.display());
    let names = |text: &str| {
        text.lines().next().and_then(|l| l.strip_prefix("#:schema ").map(str::to_owned))
    };
    let folder = path.parent().unwrap();
    let mut folders = vec![folder.to_owned()];
    let mut checked = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let file = entry.unwrap().path();
            if file.is_dir() {
                folders.push(file);
            } else if file.extension().is_some_and(|e| e == "toml") {
                let name = names(&std::fs::read_to_string(&file).unwrap());
                let named = file.with_file_name(name.unwrap_or_default()).canonicalize().ok();
                assert_eq!(named, path.canonicalize().ok(), "{}: #:schema", file.display());
                checked += 1;
            }
        }
    }
    assert!(checked > 20, "{checked} scenarios");
}

#[test]
fn every_parameter_is_documented() {
    for entry in navfuse::standard_plugins().entries() {
        for p in parameters(entry) {
            assert!(!p.meaning.is_empty(), "{entry:?}: {} has no documentation", p.key);
            assert!(!p.takes.is_empty(), "{entry:?}: {} does not say what it takes", p.key);
        }
    }
}

/// Returns the TOML examples of a page.
fn examples(page: &str) -> Vec<toml::Table> {
    let blocks = page.split("```toml\n").skip(1);
    blocks.map(|block| block.split("```").next().unwrap().parse().unwrap()).collect()
}

/// Adds a fault that every sensor can have to each simulated sensor of a scenario.
fn add_fault(scenario: &mut toml::Table) {
    let fault: toml::Table = r#"faults = [{ type = "frozen", from = "1 s" }]"#.parse().unwrap();
    for (_, sensor) in scenario["sensor"].as_table_mut().unwrap() {
        if let Some(simulation) = sensor.get_mut("simulation") {
            simulation.as_table_mut().unwrap().extend(fault.clone());
        }
    }
}

#[test]
fn every_sensor_takes_simulated_faults() {
    let registry = navfuse::standard_plugins();
    for entry in registry.entries().filter(|e| e.kind == Kind::Sensor) {
        let keys: Vec<String> = parameters(entry).into_iter().map(|p| p.key).collect();
        for key in ["type", "from", "to", "channels", "size", "unit"] {
            let key = format!("simulation.faults.N.{key}");
            assert!(keys.contains(&key), "{entry:?} has no key {key}");
        }
    }
}

/// The front pages of the crates below a folder.
fn add_pages(folder: &Path, pages: &mut Vec<PathBuf>) {
    let page = folder.join("README.md");
    if page.is_file() {
        pages.push(page);
        return;
    }
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            add_pages(&path, pages);
        }
    }
}

#[test]
fn the_example_of_every_plugin_composes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let registry = navfuse::standard_plugins();
    let quickstart = std::fs::read_to_string(root.join("scenarios/quickstart.toml")).unwrap();
    let quickstart: toml::Table = quickstart.parse().unwrap();
    let (mut composed, output) = (0, tempfile::tempdir().unwrap());
    let mut pages = Vec::new();
    add_pages(&root.join("plugins"), &mut pages);
    for page in pages {
        let text = std::fs::read_to_string(&page).unwrap();
        for example in examples(&text) {
            let mut scenario = quickstart.clone();
            for (kind, named) in example {
                let table = scenario.entry(&kind).or_insert_with(|| toml::Table::new().into());
                table.as_table_mut().unwrap().extend(named.as_table().unwrap().clone());
            }
            add_fault(&mut scenario);
            let text = toml::to_string(&scenario).unwrap();
            let document = Document::parse(page.display().to_string(), text).unwrap();
            let scenario = Scenario::new(&registry, document, &[]).unwrap();
            if let Err(error) = scenario.assemble(Some(output.path())) {
                // the examples of recordings have no files here
                let missing = [
                    "there is none of imu.csv",
                    "dive.pd0: cannot be opened",
                    "nav.nmea: cannot be opened",
                    "flight.ulg: cannot be opened",
                    "dive: cannot be opened",
                    "bottom.asc: there is no such file",
                ];
                assert!(missing.iter().any(|m| error.to_string().contains(m)), "{error}");
            }
            composed += 1;
        }
    }
    assert!(composed > 6, "only {composed} examples were found");
}
