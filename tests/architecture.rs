//! The dependencies between crates are those in the table in docs/src/explanation/design.md.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod common;

use common::root;
use std::collections::BTreeSet;
use std::path::Path;

/// Returns the workspace crates that a crate needs, without their prefix and without the framework,
/// and the other crates.
fn needs(folder: &Path) -> (BTreeSet<String>, BTreeSet<String>) {
    let file = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let table: toml::Table = text.parse().expect("Cargo.toml is TOML");
    let names = table
        .get("dependencies")
        .and_then(toml::Value::as_table)
        .map(|t| t.keys().cloned().collect());
    let names: Vec<String> = names.unwrap_or_default();
    let (ours, others): (BTreeSet<_>, BTreeSet<_>) =
        names.into_iter().partition(|n| n.starts_with("navfuse"));
    (
        ours.iter()
            .filter_map(|n| n.strip_prefix("navfuse-"))
            .filter(|n| *n != "core")
            .map(Into::into)
            .collect(),
        others,
    )
}

/// Returns the names in back-quotes.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(Into::into).collect()
}

/// Returns the arrows of the table, from the used crate to its user.
fn table() -> BTreeSet<(String, String)> {
    let text = std::fs::read_to_string(root().join("docs/src/explanation/design.md"))
        .expect("the page is there");
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
fn no_plugin_uses_another_but_as_the_design_says() {
    let folders = std::fs::read_dir(root().join("plugins")).expect("the folder is there");
    let mut found = BTreeSet::new();
    for folder in folders.map(|f| f.expect("it can be read").path()) {
        let name = folder.file_name().and_then(|n| n.to_str()).expect("a name").to_owned();
        found.extend(needs(&folder).0.into_iter().map(|shared| (shared, name.clone())));
    }
    let table = table();
    let (more, less): (Vec<_>, Vec<_>) =
        (found.difference(&table).collect(), table.difference(&found).collect());
    assert!(
        more.is_empty() && less.is_empty(),
        "not in design.md: {more:?}; not in a Cargo.toml: {less:?}"
    );
}

#[test]
fn the_framework_knows_no_plugin_no_file_format_of_samples_and_no_viewer() {
    let (ours, others) = needs(&root().join("framework"));
    assert!(ours.is_empty(), "{ours:?}");
    for name in ["csv", "mcap", "rerun", "plotters", "parquet"] {
        assert!(!others.contains(name), "{name}");
    }
}
