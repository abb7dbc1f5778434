//! Feeds: ports whose samples arrive on threads of their own, and the queue that takes them.

use crate::model::record::Level;
use crate::units::sample::{Sample, SensorId};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Samples of one feed that wait at most: 10 s of an IMU at 400 Hz.
const MOST_SAMPLES: usize = 4096;
/// Reports and commands of one feed that wait at most.
const MOST_REPORTS: usize = 64;
/// Time after which a feed with a full queue looks again.
const PAUSE: Duration = Duration::from_millis(1);

/// A port whose samples arrive at their own time: a socket, a serial line, a bus.
///
/// ```
/// use navfuse_core::model::stream::{Feed, Inbox};
/// use navfuse_core::prelude::*;
/// use std::io::{BufRead, BufReader, Read};
/// /// An echo sounder that prints a depth in each line, in m.
/// struct Sounder<R>(SensorId, R);
/// impl<R: Read + Send> Feed for Sounder<R> {
///     fn run(self: Box<Self>, inbox: &mut Inbox) {
///         for line in BufReader::new(self.1).lines().map_while(Result::ok) {
///             if let (Ok(depth), false) = (line.parse(), inbox.is_closed()) {
///                 // of a real instrument: the time at which the sound met the bottom
///                 inbox.offer(&Sample::new(Time::from_nanos(0), self.0, &[depth]));
///             }
///         }
///     }
/// }
/// ```
pub trait Feed: Send {
    /// Hands the samples over as they arrive, on a thread of its own, until nothing more can
    /// arrive or [`Inbox::is_closed`]. A feed whose port is lost opens it again by itself.
    fn run(self: Box<Self>, inbox: &mut Inbox);
}

/// A feed with its name in the scenario.
pub type NamedFeed = (String, Box<dyn Feed>);

/// What a feed handed over.
#[derive(Clone, Debug, PartialEq)]
pub enum Parcel {
    /// A sample.
    Sample(Sample),
    /// A remark for the log of the run: a port that was opened or lost, bytes that are damaged.
    Report(Level, String),
    /// A command, of a link that the scenario lets command.
    Command(Command),
    /// The feed has ended.
    End,
}

/// A command to a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Ends the run, and begins another one of the same scenario.
    Reset,
    /// Saves the run.
    Checkpoint,
    /// Leaves the samples of a sensor out (`false`), or uses them again.
    Use(SensorId, bool),
}

/// A parcel with its feed and the moment at which it was handed over.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// Index of the feed, in the order of [`Arrivals::inbox`].
    pub feed: usize,
    /// The moment.
    pub at: Instant,
    /// The content.
    pub parcel: Parcel,
}

/// The counts of one feed.
#[derive(Debug, Default)]
struct Counts {
    samples: AtomicUsize,
    reports: AtomicUsize,
    dropped: AtomicU64,
}

/// The bounded queue of one feed. A feed that floods it loses its own samples, not the samples of
/// others.
#[derive(Debug)]
pub struct Inbox {
    feed: usize,
    counts: Arc<Counts>,
    closed: Arc<AtomicBool>,
    to: Sender<Arrival>,
}

impl Inbox {
    /// Hands a sample over. A full queue drops it, and counts it: then `false`.
    pub fn offer(&mut self, sample: &Sample) -> bool {
        let room = self.counts.samples.load(Ordering::Relaxed) < MOST_SAMPLES;
        if room {
            self.counts.samples.fetch_add(1, Ordering::Relaxed);
            self.send(Parcel::Sample(*sample));
        } else {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
        room
    }

    /// Hands a sample over, once the queue has room: for a port that makes its sender wait.
    pub fn deliver(&mut self, sample: &Sample) {
        while self.counts.samples.load(Ordering::Relaxed) >= MOST_SAMPLES {
            if self.is_closed() {
                return;
            }
            std::thread::sleep(PAUSE);
        }
        self.offer(sample);
    }

    /// Reports something to the log of the run.
    pub fn report(&mut self, level: Level, text: impl Into<String>) {
        self.remark(Parcel::Report(level, text.into()));
    }

    /// Passes a command on.
    pub fn command(&mut self, command: Command) {
        self.remark(Parcel::Command(command));
    }

    fn remark(&mut self, parcel: Parcel) {
        if self.counts.reports.load(Ordering::Relaxed) < MOST_REPORTS {
            self.counts.reports.fetch_add(1, Ordering::Relaxed);
            self.send(parcel);
        }
    }

    /// Returns `true` once the run is over, so that the feed ends.
    pub fn is_closed(&self) -> bool {
        self.closed.load(Ordering::Relaxed)
    }

    fn send(&self, parcel: Parcel) {
        // nobody receives after the end of the run
        self.to.send(Arrival { feed: self.feed, at: Instant::now(), parcel }).ok();
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        self.send(Parcel::End);
    }
}

/// The queues of all feeds, in the order of arrival.
#[derive(Debug)]
pub struct Arrivals {
    from: Receiver<Arrival>,
    to: Sender<Arrival>,
    feeds: Vec<Arc<Counts>>,
    closed: Arc<AtomicBool>,
}

impl Default for Arrivals {
    fn default() -> Self {
        let (to, from) = channel();
        Self { from, to, feeds: Vec::new(), closed: Arc::default() }
    }
}

impl Arrivals {
    /// Adds the queue of a feed.
    pub fn inbox(&mut self) -> Inbox {
        let (feed, counts) = (self.feeds.len(), Arc::<Counts>::default());
        self.feeds.push(Arc::clone(&counts));
        Inbox { feed, counts, closed: Arc::clone(&self.closed), to: self.to.clone() }
    }

    /// Waits for the next parcel; `None` if none arrives in this time.
    pub fn next(&self, patience: Duration) -> Option<Arrival> {
        let arrival = self.from.recv_timeout(patience).ok()?;
        let counts = &self.feeds[arrival.feed];
        match arrival.parcel {
            Parcel::Sample(_) => counts.samples.fetch_sub(1, Ordering::Relaxed),
            Parcel::Report(..) | Parcel::Command(_) => {
                counts.reports.fetch_sub(1, Ordering::Relaxed)
            }
            Parcel::End => 0,
        };
        Some(arrival)
    }

    /// Number of samples that a feed lost to its full queue so far.
    pub fn dropped(&self, feed: usize) -> u64 {
        self.feeds[feed].dropped.load(Ordering::Relaxed)
    }
}

impl Drop for Arrivals {
    /// Lets the feeds end.
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::sample::SensorId;
    use crate::units::time::Time;

    fn sample(nanos: i64) -> Sample {
        Sample::new(Time::from_nanos(nanos), SensorId(0), &[1.0])
    }

    #[test]
    fn a_feed_that_floods_loses_its_own_samples_and_they_are_counted() {
        let mut arrivals = Arrivals::default();
        let (mut flood, mut calm) = (arrivals.inbox(), arrivals.inbox());
        (0..MOST_SAMPLES as i64 + 7)
            .for_each(|k| assert_eq!(flood.offer(&sample(k)), k < MOST_SAMPLES as i64));
        assert!(calm.offer(&sample(-1)));
        assert_eq!((arrivals.dropped(0), arrivals.dropped(1)), (7, 0));
        let mut received = [0, 0];
        while let Some(arrival) = arrivals.next(Duration::ZERO) {
            received[arrival.feed] += 1;
        }
        assert_eq!(received, [MOST_SAMPLES, 1]);
        assert!(flood.offer(&sample(0)), "there is room again");
        assert_eq!(arrivals.dropped(0), 7);
    }

    #[test]
    fn a_feed_that_waits_for_room_loses_nothing_and_ends_with_the_run() {
        let mut arrivals = Arrivals::default();
        let mut inbox = arrivals.inbox();
        let thread = std::thread::spawn(move || {
            (0..2 * MOST_SAMPLES as i64).for_each(|k| inbox.deliver(&sample(k)));
            while !inbox.is_closed() {
                inbox.deliver(&sample(0));
            }
        });
        for k in 0..2 * MOST_SAMPLES as i64 {
            let next = arrivals.next(Duration::from_secs(10)).map(|arrival| arrival.parcel);
            assert_eq!(next, Some(Parcel::Sample(sample(k))));
        }
        drop(arrivals);
        assert!(thread.join().is_ok());
    }

    #[test]
    fn reports_are_bounded_and_the_end_of_a_feed_arrives_last() {
        let mut arrivals = Arrivals::default();
        let mut inbox = arrivals.inbox();
        (0..1000).for_each(|k| inbox.report(Level::Warning, format!("{k}")));
        drop(inbox);
        let all: Vec<_> = std::iter::from_fn(|| arrivals.next(Duration::ZERO)).collect();
        assert_eq!(all.len(), MOST_REPORTS + 1);
        assert_eq!(all.last().map(|arrival| &arrival.parcel), Some(&Parcel::End));
    }
}
