//! Long work for Python: it goes on without the interpreter's lock, shows its progress, and ends on
//! Ctrl-C.

use navfuse_core::run::runner::{self, Progress};
use navfuse_core::run::scenario::Assembly;
use navfuse_core::session::Finished;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Time between two calls of Python while the work goes on.
const EVERY: Duration = Duration::from_millis(50);

/// The first exception of a sensor's model, which has no other way to the run.
#[derive(Default)]
pub struct Failure {
    happened: AtomicBool,
    error: Mutex<Option<PyErr>>,
}

impl Failure {
    /// Returns `true` once there was an exception that nobody has taken.
    pub fn happened(&self) -> bool {
        self.happened.load(Ordering::Relaxed)
    }

    /// Keeps an exception, unless there is one.
    pub fn keep(&self, error: PyErr) {
        locked(&self.error).get_or_insert(error);
        self.happened.store(true, Ordering::Relaxed);
    }

    /// Takes the exception.
    ///
    /// # Errors
    /// The exception, if there was one.
    pub fn take(&self) -> PyResult<()> {
        self.happened.store(false, Ordering::Relaxed);
        locked(&self.error).take().map_or(Ok(()), Err)
    }
}

/// What the work and the thread that called it tell each other.
#[derive(Default)]
pub struct Watch {
    /// Set once the work is to end early.
    pub stop: AtomicBool,
    /// Steps or seconds that are done, and all of them where it is known.
    progress: Mutex<Option<(f64, Option<f64>)>>,
    /// The first exception of a part that is written in Python.
    raised: Mutex<Option<PyErr>>,
}

/// The value of a mutex, also after a panic of another thread.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Watch {
    /// Takes the number of steps or seconds that are done, and of all.
    pub fn done(&self, done: f64, all: Option<f64>) {
        *locked(&self.progress) = Some((done, all));
    }

    /// Takes the progress of a run.
    pub fn show(&self, Progress { now, end }: Progress) {
        self.done(now.seconds(), end.map(|end| end.seconds()));
    }

    /// Ends the work early, by an exception of Python.
    pub fn fail(&self, error: PyErr) {
        locked(&self.raised).get_or_insert(error);
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Runs an assembly to its end, or until it is to end early, as after a failure of a sensor.
    pub fn run(&self, assembly: Assembly, failure: &Failure) -> Finished {
        let show = |progress| {
            self.stop.fetch_or(failure.happened(), Ordering::Relaxed);
            self.show(progress);
        };
        runner::run(assembly, &self.stop, show)
    }

    /// Lets Python handle its signals, and show the progress.
    fn call(&self, callback: Option<&Py<PyAny>>) -> PyResult<()> {
        let progress = *locked(&self.progress);
        Python::attach(|py| {
            py.check_signals()?;
            match callback.zip(progress) {
                Some((callback, progress)) => callback.call1(py, progress).map(drop),
                None => Ok(()),
            }
        })
    }
}

/// Does work on a thread of its own, and calls `callback(done, all)` meanwhile. The first exception of
/// Python, such as that of Ctrl-C, ends the work early.
///
/// # Errors
/// The exception.
pub fn watched<T: Send>(
    py: Python<'_>,
    callback: Option<&Py<PyAny>>,
    work: impl FnOnce(&Arc<Watch>) -> T + Send,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let wait = || {
        thread::scope(|scope| {
            let (working, over) = channel::<()>();
            // attached once: a state of the interpreter for each call would cost more than most calls
            let worker = scope.spawn(|| {
                let _working = working;
                Python::attach(|py| py.detach(|| work(&watch)))
            });
            while over.recv_timeout(EVERY) == Err(RecvTimeoutError::Timeout) {
                if !watch.stop.load(Ordering::Relaxed)
                    && let Err(error) = watch.call(callback)
                {
                    watch.fail(error);
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    };
    let result = py.detach(wait);
    locked(&watch.raised).take().map_or(Ok(result), Err)
}
