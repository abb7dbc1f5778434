//! The progress bar, and the signals that end a command.

use super::terminal::Detail;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use navfuse_campaign::JobCount;
use navfuse_core::run::runner::Progress;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Exit code of an interrupted command, as a shell defines it for Ctrl-C.
pub const INTERRUPTED: u8 = 130;

/// A flag that Ctrl-C and the signals SIGTERM and SIGHUP set, so that a run ends in order. Where a
/// handler cannot be installed, the signal ends the process at once.
pub fn stop_on_signal() -> Arc<AtomicBool> {
    let stop = end_on_signal();
    hang_up(&stop);
    stop
}

/// A flag that Ctrl-C and the signal SIGTERM set.
pub fn end_on_signal() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    install(&stop);
    stop
}

/// A flag that the signal SIGHUP sets, where there is one.
pub fn flag_on_hang_up() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    hang_up(&flag);
    flag
}

#[cfg(unix)]
fn install(stop: &Arc<AtomicBool>) {
    use signal_hook::consts::{SIGINT, SIGTERM};
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(stop)).ok();
    }
}

#[cfg(unix)]
fn hang_up(flag: &Arc<AtomicBool>) {
    use signal_hook::consts::SIGHUP;
    // `nohup` starts a program that is not to end with its terminal
    if ignored_signals() & (1 << (SIGHUP - 1)) == 0 {
        signal_hook::flag::register(SIGHUP, Arc::clone(flag)).ok();
    }
}

/// The signals that the process was started to ignore, bit n - 1 for signal n, where the system
/// lists them.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(not(unix))]
fn install(stop: &Arc<AtomicBool>) {
    let flag = Arc::clone(stop);
    ctrlc::set_handler(move || flag.store(true, std::sync::atomic::Ordering::Relaxed)).ok();
}

#[cfg(not(unix))]
fn hang_up(_: &Arc<AtomicBool>) {}

/// The progress bar, on standard error.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar; a hidden one prints nothing.
    pub fn new(shown: bool) -> Self {
        let shown = shown && !Detail::is_quiet();
        let target =
            if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Self(ProgressBar::with_draw_target(None, target))
    }

    /// Shows the time that a run reached.
    pub fn run(&self, progress: Progress) {
        let now = progress.now.seconds().max(0.0);
        if let Some(end) = progress.end {
            self.length(end.seconds().max(0.0) as u64, "s of run time");
        }
        self.0.set_position(now as u64);
    }

    /// Shows the bytes of a log that were read, out of its length.
    pub fn log(&self, [read, length]: [u64; 2]) {
        self.length(length >> 20, "MiB");
        self.0.set_position(read >> 20);
    }

    /// Shows the jobs that a campaign has done.
    pub fn campaign(&self, done: JobCount) {
        self.length(done.asked as u64, "jobs");
        self.0.set_position(done.done as u64);
    }

    /// Shows the runs of a diagnosis that are done; each of its steps adds some.
    pub fn trials(&self, done: usize, all: usize) {
        self.length(all as u64, "runs");
        self.0.set_length(all as u64);
        self.0.set_position(done as u64);
    }

    fn length(&self, length: u64, of: &str) {
        if self.0.length().is_none() {
            self.0.set_length(length);
            let template = format!("{{bar:32.cyan}} {{pos}} of {{len}} {of}, {{eta}} left");
            if let Ok(style) = ProgressStyle::with_template(&template) {
                self.0.set_style(style);
            }
        }
    }

    /// Removes the bar.
    pub fn done(&self) {
        self.0.finish_and_clear();
    }
}
