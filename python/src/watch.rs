//! What Python wants to know of a run while it goes on: progress, and whether Ctrl-C was pressed.

use navfuse_core::run::runner::{self, Progress};
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::Finished;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between two calls of Python. Rust computes without the interpreter's lock in between.
const EVERY: Duration = Duration::from_millis(50);

/// Watches over a run. An exception of Python ends the run.
pub struct Watch {
    callback: Option<Py<PyAny>>,
    last: Instant,
    /// Ends the run once set.
    pub stop: Arc<AtomicBool>,
    raised: Option<PyErr>,
}

impl Watch {
    /// A watch that passes progress as `callback(done, all)`, if there is one.
    pub fn new(callback: Option<Py<PyAny>>) -> Self {
        Self { callback, last: Instant::now(), stop: Arc::default(), raised: None }
    }

    /// Runs an assembly to its end, or until Python ends it.
    pub fn over(&mut self, assembly: Assembly) -> Finished {
        let stop = Arc::clone(&self.stop);
        runner::run(assembly, &stop, |progress| self.run(progress))
    }

    fn run(&mut self, progress: Progress) {
        let end = progress.end.map(|end| end.seconds());
        self.tick(progress.now.seconds(), end);
    }

    /// Takes the number of steps that are done, and of all, where it is known.
    pub fn tick(&mut self, done: f64, all: Option<f64>) {
        if self.last.elapsed() < EVERY || self.raised.is_some() {
            return;
        }
        self.last = Instant::now();
        let called = Python::attach(|py| {
            py.check_signals()?;
            self.callback.as_ref().map_or(Ok(()), |f| f.call1(py, (done, all)).map(drop))
        });
        if let Err(error) = called {
            self.raised = Some(error);
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    /// The exception that ended the run, if there is one.
    pub fn finish(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}
