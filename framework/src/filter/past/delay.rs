//! Sensors with a time offset: recall of the past state, and the measurement matrix with respect to
//! the present state.
//!
//! A sample stamped `t` of a sensor with the time offset `tau` measures the state at `t - tau`. The
//! filter keeps a history of its state and evaluates the model there:
//! ```text
//! z = h(x(t - tau)),   x(t - tau) between two entries of the history, along the manifold
//! dz/dtau = -d/ds h(x(s)) at s = t - tau,   along the history
//! H = dh/dx (I - A),   A = sum over the delay of (Phi_k - I): maps the present error to the past
//! ```
//! A correction of the state also corrects past states: the filter reads each entry with all later
//! corrections applied. Differences along the history are therefore motion, never corrections.
//!
//! The slope contains the noise of the driving sensor. If the filter mistook this noise for motion,
//! every sample would add information about `tau`, even on a straight course, where `tau` is
//! unobservable. The slope is therefore computed over 0.2 s, where part of the noise averages out,
//! and reduced by the share that noise explains: with the information `I = sum (dz/dtau)^2 / R`
//! over the channels, and `I_n` the mean information that process noise gives,
//! ```text
//! dz/dtau := max(0, 1 - 5 I_n / I) dz/dtau
//! ```

use crate::checkpoint::saved;
use crate::compose::time_offset::{LONGEST, SIGMAS};
use crate::compose::{Composition, moved};
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::state::covariance::{Transition, Update};
use crate::state::manifold::{MAX_TANGENT, Scalar};
use crate::state::{Block, Dynamics, Handle, Layout, State};
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::{Span, Time};

/// Shortest time between entries: a motion of 5 m/s^3 deviates from a straight line by 0.25 mm/s
/// over it.
const SPACING: Span = Span::from_nanos(20_000_000);

/// Half of the time over which the slope is taken, s. For a motion with a period of 1 s the slope
/// is then 6 % too small.
const HALF: f64 = 0.1;

/// Ratio of the information to its expectation from noise, below which a slope is discarded.
const NOISE_RATIO: f64 = 5.0;

/// A block that processes move.
#[derive(Clone, Copy)]
struct Moving {
    slot: usize,
    estimated: bool,
}

/// Recent states in a ring; a new entry replaces the oldest.
#[derive(Clone)]
pub(in crate::filter) struct RecentStates {
    moving: Vec<Moving>,
    /// Row and column of each element of `Phi` that processes fill, and its value in the identity.
    places: Vec<(usize, usize, f64)>,
    entries: Vec<Entry>,
    /// Index of the oldest entry.
    first: usize,
    len: usize,
    /// Start of the filter.
    start: Time,
    /// Sum of the elements of `Phi` since the start, and the number of steps.
    drift: Vec<f64>,
    steps: f64,
    /// Time of the last propagation, and the density of its process noise for each error, unit^2/s.
    last: Time,
    density: Vec<f64>,
    /// State that a sample measures, and the states at the ends of the slope.
    at: State,
    around: [State; 2],
    scratch: Vec<f64>,
    /// One row of the Jacobian.
    row: Vec<f64>,
    columns: Vec<usize>,
    /// Set for each error state that a sample reads, now or in the past.
    reads: Vec<bool>,
    /// Column of a sample for each error state; and for each element of `Phi` in these rows its
    /// place, its column and the sum that has passed through it since.
    index: Vec<Option<usize>>,
    seen: Vec<(usize, usize, f64)>,
    wide: Vec<f64>,
}

saved!(RecentStates {
    first, len, start, steps, last,
} each {
    entries, drift, density,
} except {
    moving, places, at, around, scratch, row, columns, reads, index, seen, wide,
});

/// The state at one time.
#[derive(Clone)]
struct Entry {
    time: Time,
    values: Vec<f64>,
    signals: Vec<f64>,
    drift: Vec<f64>,
    steps: f64,
    /// Correction between this entry and the next, if there was one.
    corrected: bool,
    correction: Vec<f64>,
}

saved!(Entry { time, steps, corrected } each { values, signals, drift, correction });

impl RecentStates {
    /// Creates a history for the sensors of a composition that have a time offset; `None` where
    /// none has.
    pub(in crate::filter) fn new(composition: &Composition) -> Option<Self> {
        let layout = &*composition.layout;
        let offsets = composition
            .sensors
            .iter()
            .filter_map(|s| s.time_offset)
            .map(|handle| layout.block(handle));
        let spans = offsets.map(|block| match block.spec.dynamics {
            Dynamics::RandomWalk(_) => LONGEST,
            _ => block.spec.initial[0].abs() + SIGMAS * block.spec.sigma[0],
        });
        let span = spans.reduce(f64::max)?.min(LONGEST);
        // the slope reaches beyond the span, and two more entries allow interpolation
        let capacity = ((span.max(HALF) + HALF) / SPACING.seconds()).ceil() as usize + 3;
        let moved = moved(layout, &composition.processes);
        let moves = |slot: &usize| {
            moved[*slot] || composition.transition.moves(&layout.blocks[*slot].tangent_range())
        };
        let slots = (0..layout.blocks.len()).filter(moves);
        let identity = composition.transition.identity();
        let declared = composition.transition.places().iter();
        let places: Vec<(usize, usize, f64)> =
            declared.zip(identity).map(|(&(i, j), identity)| (i, j, identity)).collect();
        let elements = places.len();
        let state = layout.initial_state();
        let entry = Entry {
            time: Time::MIN,
            values: state.values.clone(),
            signals: state.signals.clone(),
            drift: vec![0.0; places.len()],
            steps: 0.0,
            corrected: false,
            correction: vec![0.0; layout.tangent],
        };
        Some(Self {
            moving: slots
                .map(|slot| Moving { slot, estimated: layout.blocks[slot].estimated() })
                .collect(),
            drift: vec![0.0; places.len()],
            places,
            entries: vec![entry; capacity],
            first: 0,
            len: 0,
            start: Time::MIN,
            steps: 0.0,
            last: Time::MIN,
            density: vec![0.0; layout.tangent],
            at: state.clone(),
            around: [state.clone(), state],
            scratch: vec![0.0; layout.ambient],
            row: vec![0.0; layout.tangent],
            columns: Vec::with_capacity(layout.tangent),
            reads: vec![false; layout.tangent],
            index: vec![None; layout.tangent],
            seen: Vec::with_capacity(elements),
            wide: Vec::with_capacity(layout.tangent * MAX_CHANNELS),
        })
    }

    /// Approximate size, bytes.
    pub(in crate::filter) fn size(&self) -> usize {
        let numbers =
            |e: &Entry| e.values.len() + e.signals.len() + e.drift.len() + e.correction.len();
        let entry = self.entries.first().map_or(0, numbers) * size_of::<f64>();
        self.entries.len() * (size_of::<Entry>() + entry)
    }

    /// Clears the history at the start of the filter.
    pub(in crate::filter) fn begin(&mut self, state: &State) {
        (self.first, self.len, self.start, self.last) = (0, 0, state.time, state.time);
        self.drift.fill(0.0);
        self.steps = 0.0;
        self.push(state);
    }

    /// Records a propagation.
    pub(in crate::filter) fn moved(&mut self, state: &State, transition: &Transition) {
        transition.add_to(&mut self.drift);
        self.steps += 1.0;
        transition.noise_density(state.time.since(self.last), &mut self.density);
        self.last = state.time;
        if self.len == 0 || state.time - self.entry(self.len - 1).time >= SPACING {
            self.push(state);
        }
    }

    /// Records a correction.
    pub(in crate::filter) fn corrected(&mut self, delta: &[f64]) {
        let Some(newest) = self.len.checked_sub(1) else { return };
        let at = (self.first + newest) % self.entries.len();
        let entry = &mut self.entries[at];
        entry.corrected = true;
        entry.correction.iter_mut().zip(delta).for_each(|(sum, d)| *sum += d);
    }

    fn push(&mut self, state: &State) {
        let capacity = self.entries.len();
        if self.len == capacity {
            self.first = (self.first + 1) % capacity;
            self.len -= 1;
        }
        let entry = &mut self.entries[(self.first + self.len) % capacity];
        entry.time = state.time;
        entry.values.copy_from_slice(&state.values);
        entry.signals.copy_from_slice(&state.signals);
        entry.drift.copy_from_slice(&self.drift);
        entry.steps = self.steps;
        entry.corrected = false;
        entry.correction.fill(0.0);
        self.len += 1;
    }

    /// Entry number `k`, counted from the oldest.
    fn entry(&self, k: usize) -> &Entry {
        &self.entries[(self.first + k) % self.entries.len()]
    }

    /// Segment of the history, from one entry to a later entry or the state, that contains the
    /// state `back` seconds ago, and the share of the segment up to it. Before the first entry and
    /// after the state the motion is extrapolated.
    fn piece(&self, now: Time, back: f64) -> (usize, Option<usize>, f64) {
        let newest = self.len - 1;
        let age = |k: usize| now.since(self.entry(k).time);
        // entries are in order of time: the newest that is old enough
        let (mut low, mut high) = (0, newest);
        while low < high {
            let middle = (low + high).div_ceil(2);
            if age(middle) >= back { low = middle } else { high = middle - 1 }
        }
        // the segment up to the state may be too short for an extrapolation
        if back < 0.0 && low > 0 && age(low) < 0.5 * SPACING.seconds() {
            low -= 1;
            return (low, None, (age(low) - back) / age(low));
        }
        let to = (low < newest).then_some(low + 1);
        let length = age(low) - to.map_or(0.0, age);
        (low, to, if length > 0.0 { (age(low) - back) / length } else { 0.0 })
    }

    /// Value of a block at an entry, with all later corrections applied.
    fn value(&self, block: &Block, estimated: bool, k: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.entry(k).values[block.range()]);
        if estimated {
            for entry in (k..self.len).map(|k| self.entry(k)).filter(|e| e.corrected) {
                (block.operations.retract)(out, &entry.correction[block.tangent_range()]);
            }
        }
    }

    /// Recalls the state `back` seconds ago into `out`.
    fn recall(&self, layout: &Layout, state: &State, back: f64, out: &mut State, from: &mut [f64]) {
        let (k, to, share) = self.piece(state.time, back);
        out.time = state.time - Span::from_seconds(back).unwrap_or_default();
        out.values.copy_from_slice(&state.values);
        out.labels.copy_from_slice(&state.labels);
        for &Moving { slot, estimated } in &self.moving {
            let block = &layout.blocks[slot];
            let mut delta = [0.0; MAX_TANGENT];
            let delta = &mut delta[..block.operations.tangent];
            let (from, value) = (&mut from[block.range()], &mut out.values[block.range()]);
            self.value(block, estimated, k, from);
            if let Some(to) = to {
                self.value(block, estimated, to, value);
            }
            (block.operations.local)(value, from, delta);
            delta.iter_mut().for_each(|d| *d *= share);
            value.copy_from_slice(from);
            (block.operations.retract)(value, delta);
        }
        let (from, to) =
            (&self.entry(k).signals, to.map_or(&state.signals, |to| &self.entry(to).signals));
        let signals = from.iter().zip(to).map(|(from, to)| from + share * (to - from));
        out.signals.iter_mut().zip(signals).for_each(|(out, signal)| *out = signal);
    }

    /// Computes innovation, Jacobian and noise of a sample at the state's time from a sensor with
    /// that offset. Returns `false` where the measured state lies before the start.
    pub(in crate::filter) fn linearise(
        &mut self,
        model: &dyn AnyMeasurement,
        offset: Handle<Scalar>,
        layout: &Layout,
        state: &State,
        sample: &Sample,
        update: &mut Update,
    ) -> bool {
        let back = state.get(layout, offset);
        let known = state.time.since(self.start);
        if self.len == 0 || back > known || known < 0.5 * SPACING.seconds() {
            return false;
        }
        let near = (back - HALF).max(0.0);
        let far = (near + 2.0 * HALF).min(known);
        let (mut at, mut around) = (std::mem::take(&mut self.at), std::mem::take(&mut self.around));
        let mut scratch = std::mem::take(&mut self.scratch);
        self.recall(layout, state, back, &mut at, &mut scratch);
        model.linearise(&At { layout, state: &at, sample }, update);
        let column = layout.block(offset).tangent;
        let mut slopes = [0.0; MAX_CHANNELS];
        if column.is_some() {
            self.recall(layout, state, far, &mut around[0], &mut scratch);
            self.recall(layout, state, near, &mut around[1], &mut scratch);
            let [from, to] = [&around[0], &around[1]].map(|state| At { layout, state, sample });
            model.change(&from, &to, &mut slopes[..model.channels()]);
            let share = self.informative_share(&slopes, far - near, sample, update);
            slopes.iter_mut().for_each(|slope| *slope *= -share / (far - near));
        }
        (self.at, self.around, self.scratch) = (at, around, scratch);
        self.lead_back(state.time, back, sample, column.map(|c| (c, slopes)), update);
        true
    }

    /// Share of a change over `span` seconds that process noise does not explain.
    fn informative_share(
        &self,
        change: &[f64; MAX_CHANNELS],
        span: f64,
        sample: &Sample,
        update: &Update,
    ) -> f64 {
        let (m, w) = (update.m, update.columns.len());
        let present = (0..MAX_CHANNELS).filter(|&i| sample.get(i).is_some());
        let (mut all, mut noise) = (0.0, 0.0);
        for (a, channel) in (0..m).zip(present) {
            let r = update.r[a * m + a];
            let seen = update.columns.iter().zip(&update.h[a * w..a * w + w]);
            noise += seen.map(|(&c, h)| h * h * self.density[c]).sum::<f64>() * span / r;
            all += change[channel] * change[channel] / r;
        }
        if all > 0.0 { (1.0 - NOISE_RATIO * noise / all).max(0.0) } else { 0.0 }
    }

    /// Converts the Jacobian with respect to the past state into one with respect to the present
    /// state and the offset.
    fn lead_back(
        &mut self,
        now: Time,
        back: f64,
        sample: &Sample,
        offset: Option<(usize, [f64; MAX_CHANNELS])>,
        update: &mut Update,
    ) {
        let (from, to, share) = self.piece(now, back);
        let capacity = self.entries.len();
        let entry = |k: usize| &self.entries[(self.first + k) % capacity];
        let from = entry(from);
        let (to, steps) =
            to.map_or((&self.drift, self.steps), |to| (&entry(to).drift, entry(to).steps));
        let steps = self.steps - (from.steps + share * (steps - from.steps));
        // present columns through which the past columns are observed
        self.reads.fill(false);
        self.seen.clear();
        self.index.fill(None);
        for (at, &column) in update.columns.iter().enumerate() {
            (self.index[column], self.reads[column]) = (Some(at), true);
        }
        for (n, &(i, j, one)) in self.places.iter().enumerate() {
            let Some(at) = self.index[i] else { continue };
            let passed = self.drift[n] - (from.drift[n] + share * (to[n] - from.drift[n]));
            self.seen.push((at, j, passed - one * steps));
            self.reads[j] = true;
        }
        offset.iter().for_each(|(column, _)| self.reads[*column] = true);
        self.columns.clear();
        self.columns.extend((0..self.reads.len()).filter(|column| self.reads[*column]));
        let (w, wide) = (update.columns.len(), self.columns.len());
        self.wide.clear();
        let present = (0..MAX_CHANNELS).filter(|&i| sample.get(i).is_some());
        for (a, channel) in (0..update.m).zip(present) {
            self.row.fill(0.0);
            let h = &update.h[a * w..][..w];
            update.columns.iter().zip(h).for_each(|(&c, h)| self.row[c] = *h);
            self.seen.iter().for_each(|&(at, j, passed)| self.row[j] -= h[at] * passed);
            if let Some((column, slopes)) = &offset {
                self.row[*column] = slopes[channel];
            }
            self.wide.extend(self.columns.iter().map(|&c| self.row[c]));
        }
        update.columns.clear();
        update.columns.extend_from_slice(&self.columns);
        update.h.clear();
        update.h.extend_from_slice(&self.wide[..update.m * wide]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring with entries at these times, in ms, the oldest one at place `first`.
    fn history(times: &[i64], first: usize) -> RecentStates {
        let entry = |&ms: &i64| Entry {
            time: Time::from_nanos(ms * 1_000_000),
            values: Vec::new(),
            signals: Vec::new(),
            drift: Vec::new(),
            steps: 0.0,
            corrected: false,
            correction: Vec::new(),
        };
        let mut entries: Vec<Entry> = times.iter().map(entry).collect();
        entries.rotate_right(first);
        RecentStates {
            moving: Vec::new(),
            places: Vec::new(),
            first,
            len: entries.len(),
            entries,
            start: Time::default(),
            drift: Vec::new(),
            steps: 0.0,
            last: Time::default(),
            density: Vec::new(),
            at: State::default(),
            around: [State::default(), State::default()],
            scratch: Vec::new(),
            row: Vec::new(),
            columns: Vec::new(),
            reads: Vec::new(),
            index: Vec::new(),
            seen: Vec::new(),
            wide: Vec::new(),
        }
    }

    /// Entries at 0, 20 and 40 ms. A segment of 20 ms is halved at 10 ms. At 45 ms the segment from
    /// 40 ms is shorter than half of a spacing, so that 50 ms is 30/25 of the one from 20 ms; at
    /// 55 ms, 60 ms is 20/15 of the one from 40 ms.
    #[test]
    fn a_past_state_is_interpolated_within_its_segment_and_extrapolated_beyond_the_history() {
        for first in 0..3 {
            let history = history(&[0, 20, 40], first);
            let piece = |now: i64, back: f64| {
                let (from, to, share) =
                    history.piece(Time::from_nanos(now * 1_000_000), back / 1e3);
                (from, to, (share * 1e9).round() / 1e9)
            };
            assert_eq!(piece(45, 35.0), (0, Some(1), 0.5));
            assert_eq!(piece(45, 20.0), (1, Some(2), 0.25));
            assert_eq!(piece(45, 2.5), (2, None, 0.5));
            assert_eq!(piece(45, -5.0), (1, None, 1.2));
            assert_eq!(piece(55, -5.0), (2, None, 1.333_333_333));
            assert_eq!(piece(45, 55.0), (0, Some(1), -0.5), "before the first entry");
            // the state is the newest entry
            assert_eq!(piece(40, 0.0), (2, None, 0.0));
        }
    }
}
