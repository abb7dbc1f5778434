//! The wheel of the Python package: assembled from the library that Cargo has built, installed into
//! an environment of its own, and tested there by pytest.
#![cfg(unix)]
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_testing::python::{Packages, output};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The extension module, beside the program of this test.
fn library() -> PathBuf {
    let name = format!("{}_navfuse{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::env::current_exe().expect("the path of this test").with_file_name(name)
}

/// Runs a program, and returns what it prints.
fn run(command: &mut Command) -> String {
    output(command).unwrap_or_else(|error| panic!("{command:?}: {error}"))
}

#[test]
fn the_wheel_installs_and_passes_its_tests() {
    let packages = Packages {
        names: "maturin, numpy and the programs that test the package",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("wheel"),
        variable: None,
        check: "import distributed, maturin, matplotlib, mypy, numpy, pandas, polars, pyarrow, pytest",
        install: &[&[
            "maturin==1.16.0",
            "mypy==2.4.1",
            "distributed",
            "matplotlib",
            "numpy",
            "pandas",
            "polars",
            "pyarrow",
            "pytest",
        ]],
    };
    let Some(python) = packages.python() else { return };
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = packages.folder.join("built");
    let script = package.join("tests/assemble.py");
    let wheel = run(Command::new(&python).arg(script).arg(library()).arg(&folder));
    let pip = ["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps", wheel.trim()];
    run(Command::new(&python).args(pip));
    let command = std::env::current_exe().expect("the path of this test");
    let command = command.parent().and_then(Path::parent).map(|debug| debug.join("navfuse"));
    let tests = Command::new(&python)
        .args(["-m", "pytest", "-p", "no:cacheprovider"])
        .env("NAVFUSE", command.unwrap_or_default())
        .current_dir(package.join("tests"))
        .output()
        .expect("Python starts");
    assert!(tests.status.success(), "{}", String::from_utf8_lossy(&tests.stdout));
}
