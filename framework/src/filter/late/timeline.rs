//! Samples in the order of their arrival: late samples take their place in order of time.
//!
//! A timeline holds the samples of the last `W` seconds, where `W` is the longest `late` of the
//! sensors. Two filters follow it:
//! ```text
//!            t - W                                   t
//!   ---------+---------------------------------------+--------> time
//!   filter   |  samples that a late one may precede  |  newest estimate
//! ```
//! The filter takes a sample once no other can precede it, `W` after its time. Everything that it
//! reports is therefore final, reported once, and equal bit for bit to a run whose samples arrive
//! in order. The newest estimate is computed on demand: a copy of the filter starts from a snapshot
//! before the earliest late sample, and takes all samples up to the present.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::compose::{estimator::Linearised, snapshot::Snapshot};
use crate::filter::propagate::pace::MAX_PENDING;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::{Epoch, Observer, Rejection};
use crate::model::sensor::Role;
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::{Span, Time};
use std::cmp::Ordering;
use std::collections::VecDeque;

/// Number of snapshots over the span of the timeline: the replay of a late sample starts at most
/// one 32nd of the span before the sample.
const SNAPSHOTS: i64 = 32;

/// Samples that wait until no late sample can precede them, in order of time.
///
/// ```
/// use navfuse_core::filter::{Ekf, EstimatorError, Timeline};
/// use navfuse_core::model::record::Observer;
/// use navfuse_core::units::sample::Sample;
/// /// Runs a filter on samples in the order of their arrival.
/// fn run(
///     ekf: &mut Ekf,
///     arrivals: &[Sample],
///     log: &mut dyn Observer,
/// ) -> Result<(), EstimatorError> {
///     let Some(mut timeline) = Timeline::new(ekf.composition()) else {
///         return arrivals.iter().try_for_each(|sample| ekf.process(sample, log));
///     };
///     for sample in arrivals {
///         timeline.arrive(sample, ekf, log);
///         while let Some(next) = timeline.release(ekf.running()) {
///             ekf.process(&next, log)?;
///         }
///         timeline.newest(ekf, |epoch| println!("{:?}", epoch.state.values));
///     }
///     timeline.close();
///     while let Some(next) = timeline.release(ekf.running()) {
///         ekf.process(&next, log)?;
///     }
///     ekf.finish(log);
///     Ok(())
/// }
/// ```
pub struct Timeline {
    /// Longest `late` of the sensors.
    window: Span,
    /// The key `late` of each sensor.
    late: Vec<Option<Span>>,
    /// For each sensor, true for a reference.
    references: Vec<bool>,
    /// Sensor whose clock is the clock of the timeline; without one, every sensor's is.
    driver: Option<usize>,
    /// Latest time on that clock.
    now: Option<Time>,
    /// Samples that the filter has not taken, in order of time, sensor and channels.
    samples: VecDeque<Sample>,
    closed: bool,
    ahead: Ahead,
}

saved!(Timeline { now, samples, closed } except { window, late, references, driver, ahead });

/// Copies of the filter ahead of the samples that it has taken.
#[derive(Default)]
struct Ahead {
    /// The filter after the sample of that place.
    newest: Option<(Snapshot, Place)>,
    /// Snapshots in order of time, each taken before every sample of its time.
    snapshots: VecDeque<(Time, Snapshot)>,
    /// Samples of one time during a replay.
    group: VecDeque<Sample>,
}

/// Place of the last sample that a copy has taken.
#[derive(Clone, Copy)]
struct Place {
    sample: Sample,
    /// Set if the filter ran before the first sample of this time, so that references came last.
    ran: bool,
}

/// Beginning of a replay.
enum Start {
    /// Before the samples of this time.
    Before(Time),
    /// After this place.
    After(Place),
}

impl Timeline {
    /// Creates a timeline; `None` where no sensor may be late.
    pub fn new(composition: &Composition) -> Option<Self> {
        let sensors = &composition.sensors;
        let late: Vec<Option<Span>> = sensors.iter().map(|s| s.late).collect();
        Some(Self {
            window: late.iter().flatten().copied().max()?,
            late,
            references: sensors.iter().map(|s| matches!(s.role, Role::Reference(_))).collect(),
            driver: composition.driver(),
            now: None,
            samples: VecDeque::new(),
            closed: false,
            ahead: Ahead::default(),
        })
    }

    /// Longest time for which a sample waits.
    pub fn window(&self) -> Span {
        self.window
    }

    /// Latest time of a driving sample, or of any sample where no sensor drives.
    pub fn now(&self) -> Option<Time> {
        self.now
    }

    /// Takes a sample that arrives; `false` if it is too late and therefore rejected.
    pub fn arrive(
        &mut self,
        sample: &Sample,
        ekf: &mut dyn Linearised,
        observer: &mut dyn Observer,
    ) -> bool {
        let index = sample.sensor.0;
        let limit = self.late[index].unwrap_or(self.window);
        if self.now.is_some_and(|now| now - sample.time > limit) {
            ekf.reject(sample, Rejection::Late, observer);
            return false;
        }
        if self.driver.is_none_or(|driver| driver == index) {
            self.now = self.now.max(Some(sample.time));
        }
        let before = |other: &Sample| order(other, sample) != Ordering::Greater;
        let at = self.samples.iter().rposition(before).map_or(0, |k| k + 1);
        self.samples.insert(at, *sample);
        self.ahead.forget_after(sample, &self.references);
        true
    }

    /// Advances the clock of the timeline without a sample.
    pub(crate) fn reach(&mut self, now: Time) {
        self.now = self.now.max(Some(now));
    }

    /// Ends the waiting: no further sample arrives.
    pub fn close(&mut self) {
        self.closed = true;
    }

    /// Forgets the copies of a filter whose estimate has been replaced.
    pub(crate) fn forget_copies(&mut self) {
        self.ahead = Ahead::default();
    }

    /// Removes the next sample that no late sample can precede; the filter has to process it.
    /// Samples of one time come in the order of their sensors; a running filter takes references
    /// last.
    pub fn release(&mut self, running: bool) -> Option<Sample> {
        let first = self.samples.front()?.time;
        let settled = self.now.is_some_and(|now| first < now - self.window);
        let sample = if settled || self.closed {
            next_of_group(&mut self.samples, running, &self.references)?
        } else {
            // without a driving sample, the filter itself bounds the samples that wait for one
            let ahead = self.samples.partition_point(|s| self.now.is_some_and(|now| s.time <= now));
            if self.samples.len() - ahead <= MAX_PENDING {
                return None;
            }
            self.samples.remove(ahead)?
        };
        self.ahead.forget_until(sample.time);
        Some(sample)
    }

    /// Shows the estimate after all samples that have arrived, which a late sample may still
    /// change; the filter itself stays where it is. If samples still on their way leave a gap that
    /// the process cannot bridge, it shows the estimate before the gap. It shows nothing before the
    /// filter runs.
    pub fn newest<T>(
        &mut self,
        ekf: &mut dyn Linearised,
        look: impl FnOnce(&Epoch<'_>) -> T,
    ) -> Option<T> {
        let (mut copy, start) = self.ahead.resume(|| ekf.snapshot());
        ekf.exchange(&mut copy);
        let replayed = self.replay(ekf, start);
        let seen = ekf.running().then(|| look(&ekf.epoch()));
        ekf.exchange(&mut copy);
        // after a gap, the next replay begins at a snapshot before it
        self.ahead.newest = replayed.ok().flatten().map(|place| (copy, place));
        seen
    }

    /// Takes a copy of the filter through the samples from the start on, and returns the place of
    /// the last one.
    fn replay(
        &mut self,
        ekf: &mut dyn Linearised,
        start: Start,
    ) -> Result<Option<Place>, EstimatorError> {
        let Self { samples, references, ahead, .. } = self;
        let spacing = Span::from_nanos(self.window.nanos() / SNAPSHOTS);
        let (time, mut last) = match start {
            Start::Before(time) => (time, None),
            Start::After(place) => (place.sample.time, Some(place)),
        };
        let mut at = samples.partition_point(|s| s.time < time);
        while let Some(time) = samples.get(at).map(|s| s.time) {
            let resumed = last.filter(|place: &Place| place.sample.time == time);
            let ran = resumed.map_or(ekf.running(), |place| place.ran);
            let end = at + samples.range(at..).take_while(|s| s.time == time).count();
            let left = samples.range(at..end);
            let left = left.filter(|s| resumed.is_none_or(|place| place.precedes(s, references)));
            ahead.group.clear();
            ahead.group.extend(left);
            let due = ahead.snapshots.back().is_none_or(|(before, _)| *before + spacing <= time);
            if due && resumed.is_none() {
                ahead.snapshots.push_back((time, ekf.snapshot()));
            }
            while let Some(sample) = next_of_group(&mut ahead.group, ekf.running(), references) {
                ekf.process(&sample, &mut ())?;
                last = Some(Place { sample, ran });
            }
            at = end;
        }
        Ok(last)
    }
}

impl Place {
    /// Returns `true` if a copy at this place still has to take the sample, and can.
    fn precedes(&self, sample: &Sample, references: &[bool]) -> bool {
        let rank = |s: &Sample| (s.time, references[s.sensor.0]);
        let (here, there) = (rank(&self.sample), rank(sample));
        let later = here.cmp(&there).then_with(|| order(&self.sample, sample)).is_lt();
        here.0 < there.0 || self.ran && later
    }
}

impl Ahead {
    /// Forgets the copies that have passed the place of an arriving sample.
    fn forget_after(&mut self, sample: &Sample, references: &[bool]) {
        self.snapshots.retain(|(time, _)| *time <= sample.time);
        self.newest.take_if(|(_, place)| !place.precedes(sample, references));
    }

    /// Forgets the copies that the filter overtakes with a sample of that time.
    fn forget_until(&mut self, time: Time) {
        self.snapshots.retain(|(before, _)| *before > time);
        self.newest.take_if(|(_, place)| place.sample.time <= time);
    }

    /// Latest copy of the filter, and the place where it continues.
    fn resume(&mut self, settled: impl FnOnce() -> Snapshot) -> (Snapshot, Start) {
        match (self.newest.take(), self.snapshots.back()) {
            (Some((copy, place)), _) => (copy, Start::After(place)),
            (None, Some((time, copy))) => (copy.clone(), Start::Before(*time)),
            (None, None) => (settled(), Start::Before(Time::MIN)),
        }
    }
}

/// Order of samples in a timeline: a function of the samples alone, never of their arrival.
fn order(a: &Sample, b: &Sample) -> Ordering {
    let channels = |s| (0..MAX_CHANNELS).map(move |c| Sample::get(s, c).map(f64::to_bits));
    let place = |s: &Sample| (s.time, s.sensor);
    place(a).cmp(&place(b)).then_with(|| channels(a).cmp(channels(b)))
}

/// Removes the next sample of the earliest time: a running filter takes references last.
fn next_of_group(
    samples: &mut VecDeque<Sample>,
    running: bool,
    references: &[bool],
) -> Option<Sample> {
    let time = samples.front()?.time;
    let mut group = samples.iter().take_while(|s| s.time == time);
    let first = group.position(|s| !(running && references[s.sensor.0]));
    samples.remove(first.unwrap_or(0))
}
