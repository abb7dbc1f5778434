//! Damages the files of the corpus, reads each by its reader, and counts: inputs, panics, the
//! longest time of an input, the largest memory. Without a fuzzer, on a stable compiler.
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "it reports to a person")]

use clap::Parser;
use clap::builder::PossibleValuesParser;
use navfuse_fuzzing::{TARGETS, Target, corpus, named};
use navfuse_testing::damage::Random;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// Damages the files of the corpus and reads each by its reader. Counts inputs and panics, and
/// prints the longest time of an input and the largest memory. An input that makes a reader panic
/// is written to TARGET-SEED.bin.
#[derive(Parser)]
struct Arguments {
    /// Number of inputs, spread over the targets by their weights.
    #[arg(default_value_t = 100_000)]
    inputs: u64,
    /// The first seed: the same seed gives the same input.
    #[arg(default_value_t = 0)]
    first: u64,
    /// The readers; all without one.
    #[arg(value_parser = PossibleValuesParser::new(TARGETS.map(|target| target.name)))]
    targets: Vec<String>,
}

/// The result of a target.
struct Outcome {
    inputs: u64,
    /// Inputs of which a part was understood.
    understood: u64,
    panics: u64,
    longest: Duration,
    longest_seed: u64,
    /// Processor time, s.
    seconds: f64,
}

fn run(target: Target, inputs: u64, first: u64) -> Outcome {
    let (mut files, mut good) = (Vec::new(), Vec::new());
    for (path, bytes) in corpus(target.name) {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with("good") {
            good.push(bytes.clone());
        }
        files.push(bytes);
    }
    let mut outcome = Outcome {
        inputs,
        understood: 0,
        panics: 0,
        longest: Duration::ZERO,
        longest_seed: 0,
        seconds: 0.0,
    };
    let started = processor_time();
    for seed in first..first + inputs {
        let random = &mut Random(seed);
        let pool = if target.mostly_good && random.below(8) > 0 { &good } else { &files };
        let file = &pool[random.below(pool.len())];
        let other = &files[random.below(files.len())];
        let bytes = (target.damage)(file, other, random);
        let begun = Instant::now();
        match catch_unwind(AssertUnwindSafe(|| (target.read)(&bytes))) {
            Ok(count) => outcome.understood += u64::from(count > 0),
            Err(_) => {
                outcome.panics += 1;
                std::fs::write(format!("{}-{seed}.bin", target.name), &bytes).unwrap();
            }
        }
        let time = begun.elapsed();
        if time > outcome.longest {
            (outcome.longest, outcome.longest_seed) = (time, seed);
        }
    }
    outcome.seconds = processor_time() - started;
    outcome
}

/// Processor time of this process in user and system mode, s.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit_once(") ").map_or("", |(_, fields)| fields).split(' ');
    // clock ticks of 10 ms
    fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// Largest memory of this process, MB.
fn peak() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|l| l.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok());
    kilobytes.map_or(f64::NAN, |kb| kb * 1024e-6)
}

fn main() {
    let Arguments { inputs, first, targets } = Arguments::parse();
    let named: Vec<Target> = targets.iter().map(|name| named(name)).collect();
    let targets = if named.is_empty() { TARGETS.to_vec() } else { named };
    let weights: u64 = targets.iter().map(|t| t.weight).sum();
    let (mut total, mut panics) = (0, 0);
    for target in targets {
        let o = run(target, (inputs * target.weight).div_ceil(weights), first);
        println!(
            "{:20} {:>10} inputs, {:>7.0} a processor second, {:>3.0} % understood in part, {} panics, \
             longest {:.1} ms (seed {}), peak {:.0} MB",
            target.name,
            o.inputs,
            o.inputs as f64 / o.seconds,
            100.0 * o.understood as f64 / o.inputs as f64,
            o.panics,
            o.longest.as_secs_f64() * 1e3,
            o.longest_seed,
            peak()
        );
        (total, panics) = (total + o.inputs, panics + o.panics);
    }
    println!("{total} inputs, {panics} panics");
    if panics > 0 {
        std::process::exit(1);
    }
}
