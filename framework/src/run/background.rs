//! A sink that works on a thread of its own, while the filter goes on.

mod batch;

use crate::model::record::{Record, Wants};
use crate::model::stream::{RunInfo, Sink, StreamError};
use crate::state::Layout;
use crate::state::covariance::Transition;
use batch::Batch;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Number of batches that wait for the sink. A sink that is slower than the filter makes it wait
/// from then on, so that the memory does not grow.
const QUEUE: usize = 4;

/// Number of batches that wait for the sink of a run that never waits: a minute of estimates.
const LONG_QUEUE: usize = 600;

/// Time that a run which never waits gives a sink at its end.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time after which a run that waits for its end looks again.
const PAUSE: Duration = Duration::from_millis(1);

/// Longest time for which an estimate waits until its batch is full: a viewer that watches shows a
/// run as it goes on.
const DELAY: Duration = Duration::from_millis(100);

/// A sink that receives the records of a run on a thread of its own, in their order.
///
/// The run waits for it only when it is some hundred records behind, and at the end. The sink is
/// started, judged and finished as any other. If it fails, the run notices with one of the next
/// batches; what the sink does at its end is up to it.
///
/// After [`Sink::never_wait`] the queue is longer, and a sink that falls behind its end fails. Its
/// thread then takes what is in the queue, and nobody waits for it.
///
/// Choose it for a sink that works much, such as one that writes a recording. It costs a copy of
/// every record.
pub struct Background<S> {
    /// The sink; `None` while it is on its thread.
    sink: Option<S>,
    thread: Option<Thread<S>>,
    wants: Wants,
    /// Set for a run that never waits for the sink.
    hurries: bool,
}

/// A sink that has received everything, and its failure.
type Ended<S> = std::thread::Result<(S, Result<(), StreamError>)>;

/// A thread, and the batch that is filled for it.
struct Thread<S> {
    batch: Batch,
    /// A transition with the places that the thread knows.
    places: Option<Transition>,
    sent: Instant,
    batches: SyncSender<Batch>,
    /// Batches that the sink has received, and whose memory is used again.
    empty: Receiver<Batch>,
    handle: JoinHandle<(S, Result<(), StreamError>)>,
}

impl<S> Thread<S> {
    /// Ends the thread once the sink has received everything; `None` where that takes longer than
    /// the patience.
    fn end(self, patience: Option<Duration>) -> Option<Ended<S>> {
        let Self { batch, batches, handle, .. } = self;
        let until = patience.map(|patience| Instant::now() + patience);
        let waits = || until.is_none_or(|until| Instant::now() < until);
        let mut rest = (!batch.is_empty()).then_some(batch);
        while let Some(batch) = rest.take() {
            match batches.try_send(batch) {
                Err(TrySendError::Full(batch)) if waits() => rest = Some(batch),
                // a thread that has failed takes no batch, and returns its error
                _ => break,
            }
            std::thread::sleep(PAUSE);
        }
        drop(batches);
        while until.is_some() && !handle.is_finished() {
            if !waits() {
                return None;
            }
            std::thread::sleep(PAUSE);
        }
        Some(handle.join())
    }
}

impl<S: Sink> Background<S> {
    /// A sink on a thread that begins when the run starts.
    pub fn new(sink: S) -> Self {
        Self { thread: None, wants: sink.wants(), sink: Some(sink), hurries: false }
    }

    /// Adds a record to the batch, and sends it once it is due.
    fn add(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let Some(thread) = &mut self.thread else { return Ok(()) };
        thread.batch.push(record, &mut thread.places);
        let estimate = Wants::EPOCHS | Wants::NEWEST | Wants::FILTERED;
        let late = || estimate.contains(record.kind()) && thread.sent.elapsed() >= DELAY;
        if thread.batch.is_full() || late() { self.send() } else { Ok(()) }
    }

    /// Sends the batch. Where the queue is full, it waits, or gives the sink up.
    fn send(&mut self) -> Result<(), StreamError> {
        let Some(thread) = &mut self.thread else { return Ok(()) };
        let empty = thread.empty.try_recv().unwrap_or_default();
        let batch = std::mem::replace(&mut thread.batch, empty);
        thread.sent = Instant::now();
        let sent = match self.hurries {
            true => thread.batches.try_send(batch),
            false => thread.batches.send(batch).map_err(|e| TrySendError::Disconnected(e.0)),
        };
        match sent {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => self.give_up("it does not keep up with the run"),
            // the thread ends early only with an error
            Err(TrySendError::Disconnected(_)) => self.join(),
        }
    }

    /// Leaves the sink to its thread.
    fn give_up(&mut self, why: &str) -> Result<(), StreamError> {
        self.thread = None;
        Err(StreamError::new(why))
    }

    /// Ends the thread; the sink goes on here.
    fn join(&mut self) -> Result<(), StreamError> {
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let patience = self.hurries.then_some(PATIENCE);
        let Some(ended) = thread.end(patience) else { return self.give_up("it does not end") };
        let (sink, passed) = ended.unwrap_or_else(|panic| resume_unwind(panic));
        self.sink = Some(sink);
        passed
    }
}

/// Starts the thread of a sink, for which so many batches wait at most.
fn start<S: Sink>(sink: S, layout: Layout, most: usize) -> Result<Thread<S>, StreamError> {
    let (batches, queue) = sync_channel::<Batch>(most);
    let (returned, empty) = sync_channel(QUEUE);
    let work = move || {
        let (mut sink, mut places) = (sink, Transition::default());
        for mut batch in queue {
            if let Err(error) = batch.pass_to(&mut sink, &layout, &mut places) {
                return (sink, Err(error));
            }
            batch.clear();
            // a few are used again: a queue that was long once leaves no memory behind it
            returned.try_send(batch).ok();
        }
        (sink, Ok(()))
    };
    let handle = Builder::new().name("sink".into()).spawn(work).map_err(|cause| {
        StreamError::new("the system cannot start a thread for the sink").with_source(cause)
    })?;
    let (batch, sent) = (Batch::default(), Instant::now());
    Ok(Thread { batch, places: None, sent, batches, empty, handle })
}

impl<S: Sink> Sink for Background<S> {
    fn wants(&self) -> Wants {
        self.wants
    }

    fn never_wait(&mut self) {
        self.hurries = true;
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.sink.as_mut().map_or(Ok(()), |sink| sink.start(run))?;
        if let Some(sink) = self.sink.take() {
            let most = if self.hurries { LONG_QUEUE } else { QUEUE };
            self.thread = Some(start(sink, run.layout.clone(), most)?);
        }
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if matches!(record, Record::Verdict(_)) {
            self.join()?;
        }
        match &mut self.sink {
            // there may be events before the run and after its verdict
            Some(sink) => sink.take(record),
            None => self.add(record),
        }
    }

    fn reopen(&mut self) -> Result<(), StreamError> {
        match (&mut self.sink, &mut self.thread) {
            (Some(sink), _) => sink.reopen(),
            (None, Some(thread)) => {
                thread.batch.push_reopening();
                self.send()
            }
            (None, None) => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let passed = self.join();
        // a sink that failed may still save what it has
        let finished = self.sink.as_mut().map_or(Ok(None), Sink::finish);
        passed.and(finished)
    }
}

impl<S> Drop for Background<S> {
    /// Waits until the sink has received everything, so that a run that was aborted leaves it.
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            thread.end(self.hurries.then_some(PATIENCE));
        }
    }
}
