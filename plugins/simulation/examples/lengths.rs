//! What smoothing takes against the length of a run: the dive of `scenarios/auv.toml`, cut at ten
//! minutes and followed by squares at the surface up to 1 h and 10 h. Each run is a process of its
//! own, filter and smoother in turn, with its processor time and its largest memory. Prints the
//! table of docs/src/explanation/smoothing.md and draws its figure:
//!
//! `cargo run -p navfuse-simulation --example lengths -- docs/src/images/lengths.svg`
//!
//! With `day` instead of the file: 24 h with an IMU of 10 Hz and estimates at 1 Hz, and a check that
//! every smoothed covariance is positive definite. The folder for temporary files (`TMPDIR`) needs
//! 2.5 GB.
#![allow(clippy::unwrap_used, reason = "a measurement that cannot start has nothing to report")]

use navfuse_core::document::Document;
use navfuse_core::model::record::Record;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::nalgebra::DMatrix;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_figures::{Axis, Curve, Figure, Look, Panel, svg};
use std::process::Command;
use std::sync::atomic::AtomicBool;

const SCENARIO: &str = include_str!("../../../scenarios/auv.toml");

/// Duration of that dive, s, and of a square after it.
const DIVE: u64 = 2880;
const SQUARE: u64 = 720;

/// The dive up to a length, s, with squares after it.
fn scenario(length: u64) -> String {
    let mut text = SCENARIO.to_owned();
    for _ in 0..length.saturating_sub(DIVE).div_ceil(SQUARE) {
        text.push_str("\n[[source.simulation.segments]]\ntype = 'square'\nduration = '720 s'\n");
        text.push_str("turn = '20 s'\nbank = '5 deg'\n");
    }
    text
}

/// Counts the estimates, and those of them whose covariance is not positive definite in units of
/// its sigmas.
#[derive(Default)]
struct Judge {
    judges: bool,
    count: u64,
    indefinite: u64,
}

impl Sink for Judge {
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        self.count += 1;
        if self.judges {
            let p = epoch.covariance.to_dense();
            let sigmas = p.diagonal().map(f64::sqrt);
            let scaled =
                DMatrix::from_fn(p.nrows(), p.nrows(), |i, j| p[(i, j)] / (sigmas[i] * sigmas[j]));
            self.indefinite += u64::from(scaled.cholesky().is_none());
        }
        Ok(())
    }
}

/// Runs the dive, smoothed or not.
fn run(length: u64, smooth: bool, more: &[&str]) -> Judge {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_doppler::DvlPlugin)
        .add(&navfuse_depth::DepthPlugin);
    registry.add(&navfuse_gnss::GnssPlugin).add(&navfuse_simulation::SimulationPlugin);
    let document = Document::parse("lengths.toml", scenario(length)).unwrap();
    let mut set =
        vec![format!("estimator.stop=\"{length} s\""), format!("estimator.smooth={smooth}")];
    set.extend(more.iter().map(|text| (*text).to_owned()));
    let mut assembly = Scenario::new(&registry, document, &set).unwrap().assemble(None).unwrap();
    let judges = !more.is_empty();
    assembly.sinks.push(("judge".to_owned(), Box::new(Judge { judges, ..Judge::default() })));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished.take_sink().unwrap()
}

/// Processor time of this process, s, in user mode.
fn user_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let ticks: f64 = stat.rsplit(')').next().unwrap().split(' ').nth(12).unwrap().parse().unwrap();
    ticks / 100.0
}

/// Largest memory of this process, MB.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with("VmHWM")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() / 1024.0
}

/// Processor time and memory of a run in a process of its own.
fn measure(length: u64, mode: &str) -> [f64; 2] {
    let program = std::env::current_exe().unwrap();
    let output = Command::new(program).args([mode, &length.to_string()]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().unwrap()).collect();
    [numbers[0], numbers[1]]
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [mode @ ("filter" | "smooth"), length] => {
            run(length.parse().unwrap(), mode == "smooth", &[]);
            println!("{} {}", user_time(), peak());
        }
        ["day"] => {
            let rates = [
                "sensor.imu.simulation.rate=\"10 Hz\"",
                "sensor.reference.simulation.rate=\"1 Hz\"",
                "estimator.output_rate=\"1 Hz\"",
            ];
            let judge = run(86_400, true, &rates);
            let Judge { count, indefinite, .. } = judge;
            println!("{count} smoothed estimates of 24 h, {indefinite} not positive definite");
            println!("{:.0} s, {:.0} MB", user_time(), peak());
            assert!(count > 80_000 && indefinite == 0);
        }
        _ => draw(arguments.first().map(String::as_str)),
    }
}

/// Measures, prints the table, and draws the figure.
fn draw(path: Option<&str>) {
    println!("{:>8}{:>10}{:>10}{:>7}{:>10}{:>10}", "length", "filter", "smoother", "ratio", "", "");
    let mut rows = Vec::new();
    for length in [600, 3600, 36_000] {
        let (filter, smoother) = (measure(length, "filter"), measure(length, "smooth"));
        let ([a, m], [b, n]) = (filter, smoother);
        println!("{length:>6} s{a:>8.2} s{b:>8.2} s{:>7.2}{m:>7.1} MB{n:>7.1} MB", b / a);
        rows.push((length as f64 / 60.0, filter, smoother));
    }
    let Some(path) = path else { return };
    let panel = |title: &str, unit: &str, k: usize| Panel {
        title: title.into(),
        x: Axis::logarithmic("length of the run [min]"),
        y: Axis::logarithmic(unit),
        curves: vec![
            Curve {
                name: "filter".into(),
                look: Look::Data(0),
                points: rows.iter().map(|(t, filter, _)| [*t, filter[k]]).collect(),
            },
            Curve {
                name: "smoother".into(),
                look: Look::Data(1),
                points: rows.iter().map(|(t, _, smoother)| [*t, smoother[k]]).collect(),
            },
        ],
        bands: Vec::new(),
    };
    let figure = Figure {
        name: "lengths".into(),
        title: "What smoothing takes against the length of a run".into(),
        columns: 2,
        panels: vec![
            panel("processor time", "time [s]", 0),
            panel("largest memory of the program", "memory [MB]", 1),
        ],
    };
    std::fs::write(path, svg(&figure).unwrap()).unwrap();
}
