//! `navfuse new-plugin`: a crate with a sensor of one's own, which builds, passes its test and runs at once.

use crate::arguments::NewPlugin;
use crate::print::line;
use navfuse_core::plugin::{Kind, Registry};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The files of the crate, and their templates.
const FILES: [(&str, &str); 8] = [
    ("Cargo.toml", include_str!("templates/plugin/cargo.txt")),
    ("README.md", include_str!("templates/plugin/readme.txt")),
    ("scenario.toml", include_str!("templates/plugin/scenario.txt")),
    ("src/lib.rs", include_str!("templates/plugin/lib.txt")),
    ("src/main.rs", include_str!("templates/plugin/main.txt")),
    ("tests/conformance.rs", include_str!("templates/plugin/test.txt")),
    ("rustfmt.toml", include_str!("templates/plugin/rustfmt.txt")),
    (".cargo/config.toml", include_str!("templates/plugin/alias.txt")),
];

/// Names that a crate cannot have: words of the language, and what the crate itself uses.
const TAKEN: [&str; 50] = [
    "as",
    "async",
    "await",
    "box",
    "break",
    "const",
    "continue",
    "crate",
    "do",
    "dyn",
    "else",
    "enum",
    "extern",
    "false",
    "fn",
    "for",
    "gen",
    "if",
    "impl",
    "in",
    "let",
    "loop",
    "match",
    "mod",
    "move",
    "mut",
    "pub",
    "ref",
    "return",
    "self",
    "static",
    "struct",
    "super",
    "trait",
    "true",
    "try",
    "type",
    "unsafe",
    "use",
    "where",
    "while",
    "core",
    "std",
    "test",
    "navfuse",
    "navfuse-core",
    "navfuse-conformance",
    "navfuse-ins",
    "schemars",
    "serde",
];

/// `navfuse new-plugin`
pub fn new_plugin(registry: &Registry, arguments: &NewPlugin) -> Result<ExitCode, Box<dyn Error>> {
    let name = arguments.name.as_str();
    check_name(name)?;
    if registry.get(Kind::Sensor, name).is_some() {
        return Err(
            format!("there is a sensor type {name} already; see `navfuse list {name}`").into()
        );
    }
    let folder = arguments.path.clone().unwrap_or_else(|| PathBuf::from(name));
    if folder.exists() {
        return Err(format!(
            "{} is there already; remove it, or give another --path",
            folder.display()
        )
        .into());
    }
    let checkout = checkout(arguments.navfuse.as_deref())?;
    for (file, template) in FILES {
        let path = folder.join(file);
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let text = filled(template, name, checkout.as_deref())?;
        written
            .and_then(|()| std::fs::write(&path, text))
            .map_err(|e| format!("{}: {e}", path.display()))?;
    }
    // the versions that the checkout was built with: they are there, also without a network
    if let Some(lock) = checkout.map(|c| c.join("Cargo.lock")).filter(|l| l.is_file()) {
        std::fs::copy(&lock, folder.join("Cargo.lock"))
            .map_err(|e| format!("{}: {e}", lock.display()))?;
    }
    line(format_args!(
        "{} is a plugin with one sensor, {}. Next:",
        folder.display(),
        folder.join("src/lib.rs").display()
    ));
    line(format_args!("  cd {}", folder.display()));
    line("  cargo test                              what every sensor must hold");
    line("  cargo navfuse run scenario.toml         a run with it, simulated");
    line(format_args!("  cargo navfuse list {name:<21}its parameters"));
    Ok(ExitCode::SUCCESS)
}

/// Refuses what is no name of a crate.
fn check_name(name: &str) -> Result<(), String> {
    let refuse = |why: &str| Err(format!("{name:?} is no name of a crate: {why}"));
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return refuse("start with a small letter");
    }
    if !name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_') {
        return refuse("use small letters, digits, - and _");
    }
    if name.len() > 64 {
        return refuse("give at most 64 characters");
    }
    if TAKEN.contains(&name.replace('_', "-").as_str()) {
        return refuse("it is taken");
    }
    Ok(())
}

/// The folder of navfuse's source: the one given, or the one that this program was built from, if it is still there.
fn checkout(given: Option<&Path>) -> Result<Option<PathBuf>, String> {
    let is_one = |path: &Path| {
        path.join("framework/Cargo.toml").is_file() && path.join("plugins/ins").is_dir()
    };
    match given {
        None => {
            let built = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
            Ok(is_one(&built).then_some(built))
        }
        Some(path) if is_one(path) => {
            path.canonicalize().map(Some).map_err(|e| format!("--navfuse {}: {e}", path.display()))
        }
        Some(path) => Err(format!(
            "--navfuse {}: this is no checkout of navfuse (framework/ is not there)",
            path.display()
        )),
    }
}

/// The template with the names, and where navfuse is.
fn filled(template: &str, name: &str, checkout: Option<&Path>) -> Result<String, String> {
    let mut text = String::new();
    for line in template.lines() {
        let line = match line.find("{ NAVFUSE").zip(line.find([',', '}'].as_slice())) {
            Some((start, end)) => {
                let folder = line[start + "{ NAVFUSE".len()..end].trim().trim_start_matches('/');
                format!(
                    "{}{{ {}{}{}",
                    &line[..start],
                    place(checkout, folder)?,
                    if line[end..].starts_with('}') { " " } else { "" },
                    &line[end..]
                )
            }
            None => line.to_owned(),
        };
        text.push_str(&line);
        text.push('\n');
    }
    let words = name.split(['-', '_']).filter(|w| !w.is_empty());
    let mut camel: String = words.map(|w| w[..1].to_uppercase() + &w[1..]).collect();
    if !camel.ends_with("Sensor") {
        camel.push_str("Sensor"); // so that it hides nothing that it uses: Speed, Rotation, Sample
    }
    Ok(text
        .replace("my_sensor", &name.replace('-', "_"))
        .replace("my-sensor", name)
        .replace("MySensor", &camel))
}

/// A dependency: a path in the checkout, or the version of this program.
fn place(checkout: Option<&Path>, folder: &str) -> Result<String, String> {
    let Some(checkout) = checkout else {
        return Ok(format!("version = \"{}\"", env!("CARGO_PKG_VERSION")));
    };
    let path = if folder.is_empty() { checkout.to_owned() } else { checkout.join(folder) };
    let text =
        path.to_str().ok_or_else(|| format!("{}: a path that is no text", path.display()))?;
    serde_json::to_string(text).map(|quoted| format!("path = {quoted}")).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn a_name_is_that_of_a_crate() {
        for good in ["usbl", "my-sensor", "radar_2"] {
            assert_eq!(check_name(good), Ok(()));
        }
        let long = "a".repeat(65);
        for bad in [
            "",
            "2d",
            "-a",
            "My",
            "a b",
            "../a",
            "fn",
            "serde",
            "navfuse-core",
            "navfuse_conformance",
            "é",
            &long,
        ] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn dependencies_are_paths_of_a_checkout_or_versions() {
        let cargo = FILES[0].1;
        let text = filled(cargo, "usbl", Some(Path::new("/a b/navfuse"))).unwrap();
        assert!(text.contains("name = \"usbl\"\n"), "{text}");
        assert!(
            text.contains(
                "navfuse = { path = \"/a b/navfuse\", default-features = false, optional = true }"
            ),
            "{text}"
        );
        assert!(text.contains("navfuse-ins = { path = \"/a b/navfuse/plugins/ins\" }\n"), "{text}");
        let text = filled(cargo, "usbl", None).unwrap();
        assert!(
            text.contains(concat!(
                "navfuse-core = { version = \"",
                env!("CARGO_PKG_VERSION"),
                "\" }\n"
            )),
            "{text}"
        );
    }

    #[test]
    fn the_type_is_named_after_the_crate_and_hides_nothing() {
        assert!(filled(FILES[3].1, "speed", None).unwrap().contains("pub struct SpeedSensor {"));
        assert!(
            filled(FILES[4].1, "sea-sensor", None).unwrap().contains("<sea_sensor::SeaSensor>")
        );
    }

    #[test]
    fn the_sensor_is_one_file_of_at_most_40_lines() {
        assert!(FILES[3].1.lines().count() <= 40);
        assert!(FILES[4].1.lines().count() < 10);
    }
}
