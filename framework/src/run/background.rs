//! A sink that works on a thread of its own, while the filter goes on.

mod batch;

use crate::model::record::verdict::Verdict;
use crate::model::record::{Epoch, Event, Repetition, UpdateRecord};
use crate::model::stream::{RunInfo, Sink, StreamError};
use crate::state::Layout;
use crate::state::covariance::{Transition, Update};
use crate::units::sample::Sample;
use batch::{Batch, Estimate};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

/// Number of batches that wait for the sink. A sink that is slower than the filter makes it wait
/// from then on, so that the memory does not grow.
const QUEUE: usize = 4;

/// Longest time for which an estimate waits until its batch is full: a viewer that watches shows a
/// run as it goes on.
const DELAY: Duration = Duration::from_millis(100);

/// A sink that receives the records of a run on a thread of its own, in their order.
///
/// The run waits for it only when it is some hundred records behind, and at the end. The sink is
/// started, judged and finished as any other. If it fails, the run notices with one of the next
/// batches; what the sink does at its end is up to it.
///
/// Choose it for a sink that works much, such as one that writes a recording. It costs a copy of
/// every record.
pub struct Background<S> {
    /// The sink; `None` while it is on its thread.
    sink: Option<S>,
    thread: Option<Thread<S>>,
    /// Set if the sink receives the transitions and corrections.
    follows: bool,
    compares: bool,
    repeats: bool,
    wants_newest: bool,
}

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
    /// Ends the thread once the sink has received everything.
    fn end(self) -> std::thread::Result<(S, Result<(), StreamError>)> {
        if !self.batch.is_empty() {
            // a thread that has failed takes no batch, and returns its error
            self.batches.send(self.batch).ok();
        }
        drop(self.batches);
        self.handle.join()
    }
}

impl<S: Sink> Background<S> {
    /// A sink on a thread that begins when the run starts. The sink receives no
    /// [`Sink::transition`] and no [`Sink::correction`].
    pub fn new(sink: S) -> Self {
        Self {
            thread: None,
            follows: false,
            compares: sink.compares(),
            repeats: sink.repeats(),
            wants_newest: sink.wants_newest(),
            sink: Some(sink),
        }
    }

    /// As [`Self::new`], for a sink that follows the error through transitions and corrections.
    pub fn following(sink: S) -> Self {
        let mut sink = Self::new(sink);
        sink.follows = true;
        sink
    }

    /// Adds a record to the batch, and sends it once it is full.
    fn add(&mut self, record: impl FnOnce(&mut Thread<S>)) -> Result<(), StreamError> {
        let Some(thread) = &mut self.thread else { return Ok(()) };
        record(thread);
        if thread.batch.is_full() { self.send() } else { Ok(()) }
    }

    fn estimate(&mut self, kind: Estimate, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.add(|thread| thread.batch.epoch(kind, epoch))?;
        match &self.thread {
            Some(thread) if thread.sent.elapsed() >= DELAY => self.send(),
            _ => Ok(()),
        }
    }

    /// Sends the batch. Waits while the queue is full.
    fn send(&mut self) -> Result<(), StreamError> {
        let Some(thread) = &mut self.thread else { return Ok(()) };
        let empty = thread.empty.try_recv().unwrap_or_default();
        let batch = std::mem::replace(&mut thread.batch, empty);
        thread.sent = Instant::now();
        // the thread ends early only with an error
        if thread.batches.send(batch).is_ok() { Ok(()) } else { self.join() }
    }

    /// Ends the thread; the sink goes on here.
    fn join(&mut self) -> Result<(), StreamError> {
        let Some(thread) = self.thread.take() else { return Ok(()) };
        let (sink, passed) = thread.end().unwrap_or_else(|panic| resume_unwind(panic));
        self.sink = Some(sink);
        passed
    }
}

/// Starts the thread of a sink.
fn start<S: Sink>(sink: S, layout: Layout) -> Result<Thread<S>, StreamError> {
    let (batches, queue) = sync_channel::<Batch>(QUEUE);
    let (returned, empty) = channel();
    let work = move || {
        let (mut sink, mut places) = (sink, Transition::default());
        for mut batch in queue {
            if let Err(error) = batch.pass_to(&mut sink, &layout, &mut places) {
                return (sink, Err(error));
            }
            batch.clear();
            // once the run is over, nobody takes the batch back
            returned.send(batch).ok();
        }
        (sink, Ok(()))
    };
    let handle = Builder::new().name("sink".into()).spawn(work).map_err(|cause| {
        StreamError::new("the system gives no thread to the sink").with_source(cause)
    })?;
    let (batch, sent) = (Batch::default(), Instant::now());
    Ok(Thread { batch, places: None, sent, batches, empty, handle })
}

impl<S: Sink> Sink for Background<S> {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.sink.as_mut().map_or(Ok(()), |sink| sink.start(run))?;
        if let Some(sink) = self.sink.take() {
            self.thread = Some(start(sink, run.layout.clone())?);
        }
        Ok(())
    }

    fn sample(&mut self, sample: &Sample) -> Result<(), StreamError> {
        self.add(|thread| thread.batch.sample(sample))
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.estimate(Estimate::Epoch, epoch)
    }

    fn wants_newest(&self) -> bool {
        self.wants_newest
    }

    fn newest(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.estimate(Estimate::Newest, epoch)
    }

    fn filtered(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        self.estimate(Estimate::Filtered, epoch)
    }

    fn compares(&self) -> bool {
        self.compares
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        self.add(|thread| thread.batch.update(update))
    }

    fn transition(&mut self, transition: &Transition) -> Result<(), StreamError> {
        if !self.follows {
            return Ok(());
        }
        self.add(|thread| thread.batch.transition(transition, &mut thread.places))
    }

    fn correction(&mut self, update: &Update) -> Result<(), StreamError> {
        if !self.follows {
            return Ok(());
        }
        self.add(|thread| thread.batch.correction(update))
    }

    fn repeats(&self) -> bool {
        self.repeats
    }

    fn repetition(&mut self, repetition: Repetition<'_>) -> Result<(), StreamError> {
        self.add(|thread| thread.batch.repetition(repetition))
    }

    fn event(&mut self, event: &Event) -> Result<(), StreamError> {
        match &mut self.sink {
            // there may be events before the run and after its verdict
            Some(sink) => sink.event(event),
            None => self.add(|thread| thread.batch.event(event)),
        }
    }

    fn verdict(&mut self, verdict: &Verdict) -> Result<(), StreamError> {
        self.join()?;
        self.sink.as_mut().map_or(Ok(()), |sink| sink.verdict(verdict))
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
            thread.end().ok();
        }
    }
}
