//! Examples in the documentation of every trait, which the documentation tests compile and run.

use std::path::{Path, PathBuf};

/// All source files of the framework and the plugins.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs")
            && path.components().any(|c| c.as_os_str() == "src")
        {
            found.push(path);
        }
    }
}

#[test]
fn every_public_trait_has_an_example() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = Vec::new();
    sources(&root.join("framework"), &mut files);
    sources(&root.join("plugins"), &mut files);
    let (mut traits, mut without) = (0, Vec::new());
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for (k, line) in lines.iter().enumerate().filter(|(_, line)| line.starts_with("pub trait "))
        {
            traits += 1;
            let documentation =
                lines[..k].iter().rev().take_while(|l| l.starts_with("///") || l.starts_with("#["));
            if !documentation.clone().any(|l| l.starts_with("/// ```")) {
                without.push(format!("{}: {line}", file.display()));
            }
        }
    }
    assert!(traits > 15, "only {traits} traits were found");
    assert!(without.is_empty(), "no example: {without:#?}");
}
