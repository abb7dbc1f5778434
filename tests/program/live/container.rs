//! The image of the Containerfile, without a builder: its root directory, in which its command runs.
#![cfg(target_os = "linux")]

use super::desk::{Desk, dive, result};
use navfuse_testing::absent::{Need, skip};
use serde_json::Value;
use std::fs::{copy, create_dir_all};
use std::path::Path;
use std::process::{Command, Stdio};

const CONTAINERFILE: &str = include_str!("../../../docs/examples/container/Containerfile");

/// The instructions of the image, each with its arguments; lines that go on are one.
fn instructions() -> Vec<(String, String)> {
    let joined = CONTAINERFILE.replace("\\\n", " ");
    let lines = joined.lines().filter(|line| !line.starts_with('#'));
    let parts = lines.filter_map(|line| line.split_once(' '));
    parts.map(|(name, rest)| (name.to_owned(), rest.trim().to_owned())).collect()
}

/// The list of an instruction of that name.
fn list(name: &str) -> Vec<String> {
    let all = instructions();
    let (_, text) = all.iter().find(|(own, _)| own == name).unwrap();
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{name} {text}: {e}"))
}

#[test]
fn the_command_of_the_image_runs_in_a_root_directory_with_the_program_alone() {
    let desk = Desk::new("[link.stdin]\n");
    let root = desk.path("root");
    let inside = |path: &str| root.join(path.trim_start_matches('/'));
    let put = |from: &Path, to: &str| {
        create_dir_all(inside(to).parent().unwrap()).unwrap();
        copy(from, inside(to)).unwrap_or_else(|e| panic!("{}: {e}", from.display()));
    };
    // the program, where the image has it
    let program = Path::new(env!("CARGO_BIN_EXE_navfuse"));
    let copied = instructions().into_iter().find(|(_, rest)| rest.starts_with("--from=build"));
    let place = copied.unwrap().1.rsplit(' ').next().unwrap().to_owned();
    assert_eq!(place, list("ENTRYPOINT")[0]);
    put(program, &place);
    // the C library, which is all that the base of the image gives it
    let libraries = Command::new("ldd").arg(program).output();
    let Ok(libraries) = libraries else { return skip(Need::Unix, "`ldd`") };
    let text = String::from_utf8_lossy(&libraries.stdout).into_owned();
    for library in text.split_whitespace().filter(|word| word.starts_with('/')) {
        put(Path::new(library), library);
    }
    for folder in list("VOLUME") {
        create_dir_all(inside(&folder)).unwrap();
    }
    let command = list("CMD");
    put(&desk.path("desk.toml"), &command[1]);

    let input = desk.path("samples");
    std::fs::write(&input, &dive().sentences).unwrap();
    let mut run = Command::new("unshare");
    run.arg("-r").arg("chroot").arg(&root).args(list("ENTRYPOINT")).args(&command);
    run.args(["--speed", "inf", "--format", "json"]).env_clear().env("PATH", "/usr/sbin:/usr/bin");
    run.stdin(Stdio::from(std::fs::File::open(&input).unwrap()));
    let output = match run.output() {
        Ok(output) if !String::from_utf8_lossy(&output.stderr).contains("unshare: ") => output,
        _ => return skip(Need::Unix, "`unshare`, which enters a root directory"),
    };
    assert_eq!(result(output)["states"], dive().states);
    assert!(inside("/var/lib/navfuse/run.mcap").is_file());
}

#[test]
fn the_labels_of_the_image_are_those_of_an_extension_of_blueos() {
    let labels: Vec<(String, String)> = instructions()
        .into_iter()
        .filter(|(name, _)| name == "LABEL")
        .filter_map(|(_, rest)| rest.split_once('=').map(|(k, v)| (k.to_owned(), v.to_owned())))
        .collect();
    let label = |name: &str| {
        let found = labels.iter().find(|(own, _)| own == name);
        found
            .unwrap_or_else(|| panic!("{name} of {labels:?}"))
            .1
            .trim_matches(['\'', '"'])
            .to_owned()
    };
    assert_eq!(label("version"), env!("CARGO_PKG_VERSION"));
    let permissions: Value = serde_json::from_str(&label("permissions")).unwrap();
    assert_eq!(permissions["HostConfig"]["NetworkMode"], "host");
    let binds = permissions["HostConfig"]["Binds"].as_array().unwrap();
    for folder in list("VOLUME") {
        assert!(binds.iter().any(|bind| bind.as_str().unwrap().ends_with(&folder)), "{folder}");
    }
    for name in ["type", "tags", "requirements"] {
        assert!(!label(name).is_empty());
    }
}
