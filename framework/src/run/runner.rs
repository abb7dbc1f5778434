//! The runner: merges the sources in order of time, and pushes their samples into a session.

use crate::run::converted::converted;
use crate::run::delayed::delayed;
use crate::run::merge::Merge;
use crate::run::scenario::Assembly;
use crate::session::{End, Finished, RunError, Session};
use crate::units::sample::Sample;
use crate::units::time::Time;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The time that the run has reached.
    pub now: Time,
    /// The time of the last sample, where the sources know it.
    pub end: Option<Time>,
}

/// Samples between two calls of the progress function.
const PROGRESS: u64 = 4096;

/// Runs an assembly to its end, or until `stop` is set, and calls `progress` from time to time.
///
/// The runner asks a source for a sample only when it needs it to choose the next one: each sample
/// is through the filter and the sinks before that.
pub fn run(assembly: Assembly, stop: &AtomicBool, mut progress: impl FnMut(Progress)) -> Finished {
    let clock = Instant::now();
    let Assembly { composition, sources, sinks } = assembly;
    let sources = delayed(converted(sources, &composition), &composition);
    let mut merge = Merge::new(sources, &composition.sensors);
    let mut session = Session::new(composition, sinks);
    session.announce(merge.schedule());
    let end = push_all(&mut session, &mut merge, stop, &mut progress);
    for (source, text) in merge.warnings() {
        session.warn_at_end(source, text);
    }
    let mut finished = session.finish(end.unwrap_or_else(End::Failed));
    finished.summary.wall_s = clock.elapsed().as_secs_f64();
    progress(Progress { now: finished.time, end: Some(finished.time) });
    finished
}

/// Passes the samples of all sources of an assembly to a function, in the order in which a run takes
/// them, until it returns `false`.
///
/// # Errors
/// When a source fails.
pub fn pass_samples(
    assembly: Assembly,
    mut take: impl FnMut(&Sample) -> bool,
) -> Result<(), RunError> {
    let Assembly { composition, sources, .. } = assembly;
    let sources = delayed(converted(sources, &composition), &composition);
    let mut merge = Merge::new(sources, &composition.sensors);
    while let Some(sample) = merge.next(true)? {
        if !take(sample) {
            break;
        }
    }
    Ok(())
}

/// Pushes the samples of all sources into the session.
fn push_all(
    session: &mut Session,
    merge: &mut Merge,
    stop: &AtomicBool,
    progress: &mut impl FnMut(Progress),
) -> Result<End, RunError> {
    let mut count = 0_u64;
    while !session.is_over() {
        if stop.load(Ordering::Relaxed) {
            return Ok(End::Interrupted);
        }
        let Some(sample) = merge.next(session.running())? else { break };
        let now = sample.time;
        session.push(sample)?;
        count += 1;
        if count.is_multiple_of(PROGRESS) {
            let end = merge.end().map(|end| session.stop().map_or(end, |stop| stop.min(end)));
            progress(Progress { now, end });
        }
    }
    Ok(End::Complete)
}
