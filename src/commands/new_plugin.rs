//! `navfuse new-plugin`: a crate with a sensor of one's own, which builds, passes its test and runs
//! at once.

use crate::error::{CommandError, Result};
use crate::output::line;
use clap::Args;
use navfuse_core::plugin::{Kind, Registry};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The files of the crate, and their templates.
const FILES: [(&str, &str); 8] = [
    ("Cargo.toml", include_str!("../templates/plugin/cargo.txt")),
    ("README.md", include_str!("../templates/plugin/readme.txt")),
    ("scenario.toml", include_str!("../templates/plugin/scenario.txt")),
    ("src/lib.rs", include_str!("../templates/plugin/lib.txt")),
    ("src/main.rs", include_str!("../templates/plugin/main.txt")),
    ("tests/conformance.rs", include_str!("../templates/plugin/test.txt")),
    ("rustfmt.toml", include_str!("../templates/plugin/rustfmt.txt")),
    (".cargo/config.toml", include_str!("../templates/plugin/alias.txt")),
];

/// Names that a crate cannot have: keywords, and the crates that it uses itself.
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

/// Arguments of `new-plugin`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse new-plugin my-sensor
  navfuse new-plugin my-sensor --path ../sensors/mine --navfuse ~/navfuse")]
pub struct NewPlugin {
    /// Name of the crate and of its sensor type: lower-case letters, digits, - and _
    pub name: String,
    /// Folder to write it to [default: ./NAME]
    #[arg(long, value_name = "DIR")]
    pub path: Option<PathBuf>,
    /// Folder of navfuse's source [default: the one that this program was built from, or else the
    /// published version]
    #[arg(long, value_name = "PATH")]
    pub navfuse: Option<PathBuf>,
}

/// Writes the crate.
pub fn new_plugin(registry: &Registry, arguments: &NewPlugin) -> Result<ExitCode> {
    let name = arguments.name.as_str();
    check_name(name)?;
    if registry.get(Kind::Sensor, name).is_some() {
        return Err(CommandError::Request(format!(
            "there is a sensor type {name} already; see `navfuse list {name}`"
        )));
    }
    let folder = arguments.path.clone().unwrap_or_else(|| PathBuf::from(name));
    if folder.exists() {
        return Err(CommandError::Request(format!(
            "{} is there already; remove it, or give another --path",
            folder.display()
        )));
    }
    let checkout = checkout(arguments.navfuse.as_deref())?;
    for (file, template) in FILES {
        let path = folder.join(file);
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let text = filled(template, name, checkout.as_deref())?;
        written
            .and_then(|()| std::fs::write(&path, text))
            .map_err(CommandError::cannot_write(&path))?;
    }
    // the dependencies of the checkout are downloaded already, so that the crate builds offline
    if let Some(lock) = checkout.map(|c| c.join("Cargo.lock")).filter(|l| l.is_file()) {
        std::fs::copy(&lock, folder.join("Cargo.lock")).map_err(CommandError::file(
            &lock,
            "cannot be copied",
            "",
        ))?;
    }
    line(format_args!(
        "{} is a plugin with one sensor, {}. Next:",
        folder.display(),
        folder.join("src/lib.rs").display()
    ));
    line(format_args!("  cd {}", folder.display()));
    line("  cargo test                              tests the sensor for conformance");
    line("  cargo navfuse run scenario.toml         runs a simulated scenario with it");
    line(format_args!("  cargo navfuse list {name:<21}lists its parameters"));
    Ok(ExitCode::SUCCESS)
}

/// Rejects a text that cannot be the name of a crate.
fn check_name(name: &str) -> Result<()> {
    let refuse = |why: &str| {
        Err(CommandError::Request(format!("{name:?} is not a valid crate name: {why}")))
    };
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return refuse("start with a lower-case letter");
    }
    if !name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_') {
        return refuse("use lower-case letters, digits, - and _");
    }
    if name.len() > 64 {
        return refuse("give at most 64 characters");
    }
    if TAKEN.contains(&name.replace('_', "-").as_str()) {
        return refuse("it is taken");
    }
    Ok(())
}

/// The folder of navfuse's source: the one given, or the one that this program was built from, if
/// it still exists.
fn checkout(given: Option<&Path>) -> Result<Option<PathBuf>> {
    let is_one = |path: &Path| {
        path.join("framework/Cargo.toml").is_file() && path.join("plugins/sensors/ins").is_dir()
    };
    match given {
        None => {
            let built = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
            Ok(is_one(&built).then_some(built))
        }
        Some(path) if is_one(path) => path.canonicalize().map(Some).map_err(CommandError::file(
            path,
            "--navfuse cannot be read",
            "",
        )),
        Some(path) => Err(CommandError::argument(
            format!("--navfuse {}", path.display()),
            "this is no checkout of navfuse (framework/ is not there)",
        )),
    }
}

/// The template with the names and the place of navfuse filled in.
fn filled(template: &str, name: &str, checkout: Option<&Path>) -> Result<String> {
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
        // so that the type does not hide one that it uses, such as Speed or Rotation
        camel.push_str("Sensor");
    }
    Ok(text
        .replace("my_sensor", &name.replace('-', "_"))
        .replace("my-sensor", name)
        .replace("MySensor", &camel))
}

/// A dependency: a path in the checkout, or the version of this program.
fn place(checkout: Option<&Path>, folder: &str) -> Result<String> {
    let Some(checkout) = checkout else {
        return Ok(format!("version = \"{}\"", env!("CARGO_PKG_VERSION")));
    };
    let path = if folder.is_empty() { checkout.to_owned() } else { checkout.join(folder) };
    let text = path.to_str().ok_or_else(|| {
        CommandError::Request(format!("{}: this path is not valid UTF-8", path.display()))
    })?;
    Ok(format!("path = {}", serde_json::to_string(text)?))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn a_name_is_that_of_a_crate() {
        for good in ["usbl", "my-sensor", "radar_2"] {
            assert!(check_name(good).is_ok(), "{good}");
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
        assert!(
            text.contains("navfuse-ins = { path = \"/a b/navfuse/plugins/sensors/ins\" }\n"),
            "{text}"
        );
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
    fn the_sensor_is_one_file_of_a_page() {
        assert!(FILES[3].1.lines().count() <= 60);
        assert!(FILES[4].1.lines().count() < 10);
    }
}
