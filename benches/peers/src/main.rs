//! The time of an IMU sample: navfuse beside other filters, on the same samples of the same run.
//!
//! Each filter propagates its state and covariance through every IMU sample of
//! `scenarios/pan-wu-3d.toml` after its start; nobody is given an update. The rounds of all filters
//! alternate, each in another order, so that a busy machine slows all of them down. The clock is
//! the processor time of the thread. The program prints medians, the ratio to navfuse within each
//! round, and the spread of that ratio.
//!
//! ```text
//! cargo run --release -- [ROUNDS [FOLDER OF KF-GINS]]
//! ```
#![allow(clippy::unwrap_used, reason = "a measurement that cannot start has nothing to report")]

mod fusion;
mod kf_gins;
mod kinavis;
mod ours;

use rustix::time::{ClockId, clock_gettime};
use std::fs::read_to_string;
use std::path::Path;

/// Rounds, unless the command names another number.
const ROUNDS: usize = 10;

/// An IMU sample: the end of its interval and its length, s; mean angular rate, rad/s, and specific
/// force, m/s^2, along forward, right, down.
#[derive(Clone, Copy)]
pub struct Imu {
    time: f64,
    interval: f64,
    rate: [f64; 3],
    force: [f64; 3],
}

/// A filter that propagates through all samples.
pub trait Peer {
    /// Name, number of states and precision.
    fn name(&self) -> &'static str;
    /// Starts again from the same state.
    fn restart(&mut self);
    /// Propagates state and covariance through all samples.
    fn propagate(&mut self);
    /// Processor time of a propagation, s.
    fn time(&mut self) -> f64 {
        let begin = clock();
        self.propagate();
        clock() - begin
    }
}

/// Processor time of this thread, s.
fn clock() -> f64 {
    let spent = clock_gettime(ClockId::ThreadCPUTime);
    spent.tv_sec as f64 + 1e-9 * spent.tv_nsec as f64
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn machine() -> String {
    let cpu = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split(": ").nth(1));
    let load = read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?");
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{}, {cores} cores, load {load}", model.unwrap_or("processor unknown"))
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let rounds = arguments.next().map_or(ROUNDS, |text| text.parse().unwrap());
    let before = machine();
    let (mut peers, samples) = ours::filters();
    peers.push(Box::new(kinavis::filter(&samples)));
    peers.push(Box::new(fusion::filter(&samples)));
    if let Some(checkout) = arguments.next() {
        peers.push(Box::new(kf_gins::filter(Path::new(&checkout), &samples)));
    }
    let mut times = vec![Vec::new(); peers.len()];
    for round in 0..rounds {
        for k in 0..peers.len() {
            let k = (k + round) % peers.len();
            peers[k].restart();
            times[k].push(1e6 * peers[k].time() / samples.len() as f64);
        }
    }
    println!("{before}; at the end {}", machine());
    println!("{} IMU samples of scenarios/pan-wu-3d.toml, {rounds} rounds\n", samples.len());
    println!("{:34}{:>10}{:>10}{:>18}", "filter", "us", "ratio", "range of ratio");
    for (peer, each) in peers.iter().zip(&times) {
        let ratios: Vec<f64> = each.iter().zip(&times[0]).map(|(t, ours)| t / ours).collect();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let most = ratios.iter().copied().fold(0.0, f64::max);
        println!(
            "{:34}{:>10.3}{:>10.2}{:>18}",
            peer.name(),
            median(each.clone()),
            median(ratios),
            format!("{least:.2} to {most:.2}")
        );
    }
}
