//! The example of a campaign on a cluster, in a real Slurm on this machine.

use crate::common::{Need, navfuse, root, scenario, skip, stderr, stdout};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Returns `true` if there is a Slurm; without one, the test is skipped.
fn has_slurm() -> bool {
    let programs = "for p in munged slurmctld slurmd sbatch; do command -v $p || exit 1; done";
    let line = format!("PATH=$PATH:/usr/sbin; {programs}");
    let found = Command::new("sh").args(["-c", &line]).stdin(Stdio::null()).output();
    let found = found.is_ok_and(|o| o.status.success());
    if !found {
        skip(Need::Slurm, "slurmctld, slurmd, slurm-client and munge");
    }
    found
}

/// A folder for the campaign, another for the files of Slurm, and the scripts of the example.
struct Cluster {
    folder: tempfile::TempDir,
}

impl Cluster {
    fn new() -> Self {
        let cluster = Self { folder: tempfile::tempdir().expect("a folder for the test") };
        std::fs::create_dir(cluster.temporary()).expect("a folder in the folder");
        cluster
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn temporary(&self) -> PathBuf {
        self.path("tmp")
    }

    /// Returns `one-machine.sh`, with the command `navfuse` of this build on its path.
    fn one_machine(&self) -> Command {
        let built =
            Path::new(env!("CARGO_BIN_EXE_navfuse")).parent().expect("the program is in a folder");
        let path = std::env::var_os("PATH").unwrap_or_default();
        let path = std::iter::once(built.to_owned()).chain(std::env::split_paths(&path));
        let mut command = Command::new(example("one-machine.sh"));
        command
            .current_dir(self.folder.path())
            .env("PATH", std::env::join_paths(path).expect("a path"))
            .env("TMPDIR", self.temporary())
            .stdin(Stdio::null());
        command
    }

    /// Submits a campaign of three shards into `campaign` and waits for it.
    fn submit(&self, arguments: &[&str]) -> Output {
        let mut command = self.one_machine();
        command.env("SHARDS", "3").arg(example("submit.sh")).arg("campaign").args(arguments);
        command.output().expect("the script starts")
    }

    /// Returns the output of the scripts and the jobs.
    fn output(&self, output: &Output) -> String {
        let mut text = stdout(output) + &stderr(output);
        for (name, bytes) in files(&self.path("campaign")) {
            if name.ends_with(".out") {
                text += &format!("{name}:\n{}", String::from_utf8_lossy(&bytes));
            }
        }
        text
    }

    /// Checks that Slurm has ended, without a remaining file, daemon or job.
    fn assert_nothing_left(&self) {
        let temporary = self.temporary().display().to_string();
        assert_eq!(
            std::fs::read_dir(&temporary).expect("the folder is there").count(),
            0,
            "in {temporary}"
        );
        for process in std::fs::read_dir("/proc").expect("Linux").flatten() {
            for file in ["cmdline", "environ"] {
                let text = std::fs::read(process.path().join(file)).unwrap_or_default();
                let text = String::from_utf8_lossy(&text).replace('\0', " ");
                assert!(!text.contains(&temporary), "{} is left: {text}", process.path().display());
            }
        }
    }
}

fn example(name: &str) -> PathBuf {
    root().join("docs/examples/slurm").join(name)
}

/// Reads all files below a folder, by their relative paths, without the lists of own files.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            all.extend(
                files(&entry.path())
                    .into_iter()
                    .map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)),
            );
        } else if name != ".navfuse" {
            all.insert(name, std::fs::read(entry.path()).unwrap_or_default());
        }
    }
    all
}

#[test]
fn a_job_array_and_its_merge_write_the_bytes_of_one_machine() {
    if !has_slurm() {
        return;
    }
    let cluster = Cluster::new();
    let quickstart = scenario("quickstart").display().to_string();
    // five runs do not divide into three shards
    let campaign = [&quickstart, "--runs", "5", "--seed", "3"];

    let output = cluster.submit(&campaign);
    assert!(output.status.success(), "{}", cluster.output(&output));
    assert!(stdout(&output).contains("campaign  job 1\nmerge     job 2"), "{}", stdout(&output));

    let alone = cluster.path("alone").display().to_string();
    let output = navfuse(&[&["monte-carlo"], &campaign[..], &["--out", &alone]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let alone = files(Path::new(&alone));
    let merged = files(&cluster.path("campaign/merged"));
    assert!(!alone.is_empty());
    assert_eq!(merged.keys().collect::<Vec<_>>(), alone.keys().collect::<Vec<_>>());
    // the viewer's library writes a new random id into every recording
    for (name, bytes) in alone.iter().filter(|(name, _)| !name.ends_with(".rrd")) {
        assert!(merged[name] == *bytes, "{name} differs from that of one machine");
    }
    cluster.assert_nothing_left();
}

#[test]
fn a_failed_shard_prevents_the_merge_and_is_reported() {
    if !has_slurm() {
        return;
    }
    let cluster = Cluster::new();
    let output = cluster.submit(&["not-there.toml", "--runs", "5"]);
    assert_eq!(output.status.code(), Some(1), "{}", cluster.output(&output));
    for line in ["1_1 navfuse FAILED", "1_3 navfuse FAILED", "2 navfuse-merge CANCELLED"] {
        assert!(stderr(&output).contains(line), "{}", stderr(&output));
    }
    assert!(cluster.output(&output).contains("not-there.toml"), "{}", cluster.output(&output));
    assert!(!cluster.path("campaign/merged").exists());
    cluster.assert_nothing_left();
}

#[test]
fn an_interrupt_ends_the_jobs_and_slurm() {
    if !has_slurm() {
        return;
    }
    let cluster = Cluster::new();
    let mut command = cluster.one_machine();
    command
        .args(["sbatch", "--wrap", "touch started; sleep 1000"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    let mut script = command.spawn().expect("the script starts");
    let mut lines =
        BufReader::new(script.stderr.take().expect("a pipe")).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("waiting for 1 jobs")));
    let begun = Instant::now();
    while !cluster.path("started").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60), "the job does not start");
        std::thread::sleep(Duration::from_millis(50));
    }
    // not INT, which a background shell and the scripts that it starts ignore
    let interrupted = Command::new("kill").args(["-TERM", &script.id().to_string()]).status();
    assert!(interrupted.is_ok_and(|s| s.success()));
    assert_eq!(script.wait().expect("it ends").code(), Some(143));
    cluster.assert_nothing_left();
}
