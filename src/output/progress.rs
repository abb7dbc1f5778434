//! The progress bar, and Ctrl-C.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use navfuse_campaign::JobCount;
use navfuse_core::run::runner::Progress;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an interrupted command, as a shell defines it.
pub const INTERRUPTED: u8 = 130;

/// A flag that Ctrl-C sets, so that a run ends in order. If the handler cannot be installed, Ctrl-C
/// ends the process at once.
pub fn stop_on_ctrl_c() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).ok();
    stop
}

/// The progress bar, on standard error.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar; a hidden one prints nothing.
    pub fn new(shown: bool) -> Self {
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
