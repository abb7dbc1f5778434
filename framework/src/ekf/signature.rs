//! Score test for a time offset that is not modelled.
//!
//! A sensor that lags by `tau` has innovations of the mean `tau g`, and moves the error of the state
//! by `tau s`. With the slope `d = -dh/dt` of the prediction and the gain `K`,
//! ```text
//! g = H s + d        s := s - K g  (its own sample),   s := s - K H s  (another sensor's sample)
//!                    s := Phi s    (propagation, to first order between two corrections)
//! b = sum g' S^-1 y,   i = sum g' S^-1 g,   tau = b / i,   z = b / sqrt(i) ~ N(0, 1)
//! ```
//! (Willsky & Jones 1976, the generalised likelihood ratio). What the estimated states can absorb is
//! projected out exactly, since `s` contains it, and `tau s` is the error that the offset has left in
//! each state.
//!
//! `d` is the slope between the two samples before, so that the noise of the driving sensor in the
//! innovation is not in it: `b` is then a martingale for a consistent filter. Real innovations are
//! wider and correlated. `i` in `z` is therefore at least the sum of the squares of `b - tau i` over
//! spans of 10 s, which contains any correlation within them.
//!
//! An offset may begin at any time: four sums run in parallel, one from the start, and three that
//! begin again in turn.

use crate::compose::Composition;
use crate::model::finding::{Basis, Finding, Severity};
use crate::model::measurement::{AnyMeasurement, At};
use crate::model::sensor::Role;
use crate::state::covariance::{Covariance, Transition, Update, backward, cholesky, forward};
use crate::state::{Layout, Mode, State};
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Sums in parallel.
const SUMS: usize = 4;
/// Time from the begin of one sum to that of the next, s.
const TURN: f64 = 120.0;
/// Length of the spans of which the scatter is taken, s.
const SPAN: f64 = 10.0;
/// Least time over which the slope is taken, and the longest, s.
const SLOPE: (f64, f64) = (0.1, 1.5);
/// Score in sigma at which an offset is significant: while a car with an IMU of MEMS finds its heading,
/// the curvature of its track gives one of 5.2 in 3 of 200 runs.
const SIGNIFICANT: f64 = 6.0;
/// Error of a state in units of its sigma at which a run is doubtful, and at which it is useless.
const DOUBTFUL: f64 = 0.5;
const USELESS: f64 = 2.0;

/// Score of an offset since one time.
#[derive(Clone, Copy, Debug, Default)]
struct Score {
    since: Time,
    b: f64,
    i: f64,
    /// Sums of the span so far, and of `b^2`, `b i` and `i^2` over the spans before.
    span: [f64; 2],
    squares: [f64; 3],
}

impl Score {
    fn add(&mut self, b: f64, i: f64) {
        self.b += b;
        self.i += i;
        self.span[0] += b;
        self.span[1] += i;
    }

    fn end_span(&mut self) {
        let [b, i] = std::mem::take(&mut self.span);
        self.squares[0] += b * b;
        self.squares[1] += b * i;
        self.squares[2] += i * i;
    }

    fn offset(&self) -> f64 {
        self.b / self.i
    }

    /// Score in sigma; NaN without information.
    fn sigmas(&self) -> f64 {
        let (tau, [bb, bi, ii]) = (self.offset(), self.squares);
        let scatter = bb - 2.0 * tau * bi + tau * tau * ii;
        self.b / self.i.max(scatter).sqrt()
    }
}

/// Test of one sensor.
#[derive(Clone)]
struct Test {
    /// Sensitivity of the error states, one row of [`SUMS`] per state.
    s: Vec<[f64; SUMS]>,
    scores: [Score; SUMS],
    /// The next sum to begin again.
    next: usize,
    /// State after the sample at which the slope begins, and the slope.
    base: Option<State>,
    slope: [f64; MAX_CHANNELS],
    /// Set if the next slope begins at the present sample.
    due: bool,
    span: Time,
    severity: Option<Severity>,
}

/// A significant offset.
#[derive(Clone, Copy, Debug)]
pub(super) struct Found {
    severity: Severity,
    score: Score,
    /// Error of a state in units of its sigma, and the row of the state.
    size: f64,
    row: usize,
}

impl Found {
    /// Finding about the sensor.
    pub(super) fn finding(&self, time: Time, sensor: &str, layout: &Layout) -> Finding {
        let &Self { severity, ref score, size, row } = self;
        let block = layout.blocks.iter().find(|b| b.tangent_range().contains(&row));
        let state = block.map_or_else(String::new, |block| {
            let component = block.spec.display.components.get(row - block.tangent_range().start);
            format!("{} {}", block.name, component.copied().unwrap_or_default())
        });
        Finding {
            time,
            about: sensor.to_owned(),
            severity,
            basis: Basis::Comparison,
            text: format!(
                "since {} its samples fit a time offset of {:+.3} s ({:.1} sigma), which is not \
                 modelled: it has moved {} by {size:.1} times its sigma",
                score.since,
                score.offset(),
                score.sigmas().abs(),
                state.trim_end(),
            ),
            remedy: format!(
                "check the clock of {sensor} and the time stamps; if the offset is constant, \
                 estimate it: time_offset = {{ sigma = \"{:.1} s\" }}",
                (2.0 * score.offset().abs()).max(0.1)
            ),
        }
    }
}

/// Score tests of all sensors.
#[derive(Clone)]
pub(super) struct Signatures {
    tests: Vec<Option<Test>>,
    /// Row and column of each element of `Phi`, and its value in the identity.
    places: Vec<(usize, usize, f64)>,
    /// Times up to which the sensitivities are carried, and up to which the state is, and the length
    /// of the last step, s.
    settled: Time,
    time: Time,
    step: f64,
    moved: Vec<[f64; SUMS]>,
}

impl Test {
    fn new(n: usize, start: Time) -> Self {
        Self {
            s: vec![[0.0; SUMS]; n],
            scores: [Score { since: start, ..Score::default() }; SUMS],
            next: 1,
            base: None,
            slope: [0.0; MAX_CHANNELS],
            due: false,
            span: start,
            severity: None,
        }
    }

    /// Begins at the start of the filter.
    fn begin(&mut self, time: Time) {
        self.span = time;
        self.scores.iter_mut().for_each(|score| score.since = time);
    }

    /// `g = H s`, with the slope for a sample of the sensor itself.
    fn seen(&self, update: &Update, present: Option<u16>) -> [[f64; SUMS]; MAX_CHANNELS] {
        let w = update.columns.len();
        let mut g = [[0.0; SUMS]; MAX_CHANNELS];
        for (g, h) in g.iter_mut().zip(update.h.chunks_exact(w.max(1))).take(update.m) {
            for (&column, h) in update.columns.iter().zip(h) {
                g.iter_mut().zip(&self.s[column]).for_each(|(g, s)| *g += h * s);
            }
        }
        if let Some(present) = present {
            let channels = (0..MAX_CHANNELS).filter(|channel| present >> channel & 1 == 1);
            for (g, channel) in g.iter_mut().zip(channels).take(update.m) {
                g.iter_mut().for_each(|g| *g -= self.slope[channel]);
            }
        }
        g
    }

    /// Adds the innovation to the sums, and corrects the sensitivity.
    fn take(&mut self, update: &Update, lower: &[f64], present: Option<u16>) {
        let m = update.m;
        let g = self.seen(update, present);
        let mut y = [0.0; MAX_CHANNELS];
        y[..m].copy_from_slice(&update.innovation[..m]);
        forward(lower, m, &mut y[..m]);
        backward(lower, m, &mut y[..m]);
        for (k, score) in self.scores.iter_mut().enumerate() {
            let mut column = [0.0; MAX_CHANNELS];
            column.iter_mut().zip(&g).for_each(|(c, g)| *c = g[k]);
            let b = column.iter().zip(&y).take(m).map(|(g, y)| g * y).sum();
            forward(lower, m, &mut column[..m]);
            score.add(b, column[..m].iter().map(|c| c * c).sum());
        }
        for (s, gain) in self.s.iter_mut().zip(update.gain().chunks_exact(m.max(1))) {
            for (gain, g) in gain.iter().zip(&g) {
                s.iter_mut().zip(g).for_each(|(s, g)| *s -= gain * g);
            }
        }
    }

    /// Takes the slope of the prediction up to the state, for the next sample.
    fn follow(&mut self, model: &dyn AnyMeasurement, at: &At<'_>) -> bool {
        let Some(base) = &self.base else { return true };
        let dt = at.state.time.since(base.time);
        if dt < SLOPE.0 {
            return false;
        }
        self.slope.fill(0.0);
        if dt <= SLOPE.1 {
            let (from, n) = (At { state: base, ..*at }, model.channels());
            model.change(&from, at, &mut self.slope[..n]);
            self.slope.iter_mut().for_each(|s| *s = if s.is_finite() { *s / dt } else { 0.0 });
        }
        true
    }

    /// Ends a span, begins a sum again where it is due, and returns the significant score with its
    /// severity, if that is a new one.
    fn judge(&mut self, time: Time, covariance: &Covariance, considered: &[bool]) -> Option<Found> {
        self.span = time;
        self.scores.iter_mut().for_each(Score::end_span);
        let mut worst: Option<Found> = None;
        for (k, score) in self.scores.iter().enumerate() {
            let significant = score.sigmas().abs() >= SIGNIFICANT;
            if !significant {
                continue;
            }
            let error = |i: usize| {
                let sigma = covariance.get(i, i).sqrt();
                if sigma > 0.0 && !considered[i] {
                    (score.offset() * self.s[i][k] / sigma).abs()
                } else {
                    0.0
                }
            };
            let (size, row) = (0..considered.len())
                .map(|i| (error(i), i))
                .fold((0.0, 0), |worst, next| if next.0 > worst.0 { next } else { worst });
            let severity = match size {
                e if e >= USELESS => Severity::DoNotUse,
                e if e >= DOUBTFUL => Severity::Doubtful,
                _ => continue,
            };
            let weight = |f: &Found| (f.severity, f.score.sigmas().abs());
            let found = Found { severity, score: *score, size, row };
            if worst.as_ref().is_none_or(|worst| weight(worst) < weight(&found)) {
                worst = Some(found);
            }
        }
        let newest = self.scores.iter().map(|score| score.since).max().unwrap_or(time);
        if time.since(newest) >= TURN {
            self.scores[self.next] = Score { since: time, ..Score::default() };
            self.s.iter_mut().for_each(|s| s[self.next] = 0.0);
            self.next = 1 + self.next % (SUMS - 1);
        }
        let found = worst.filter(|w| self.severity.is_none_or(|before| before < w.severity))?;
        self.severity = Some(found.severity);
        Some(found)
    }
}

impl Signatures {
    /// Tests for the sensors of a composition whose offset is not estimated; `None` where the
    /// innovations of a consistent filter are not white, or where blocks come and go.
    pub(super) fn new(composition: &Composition, transition: &Transition) -> Option<Self> {
        let layout = &*composition.layout;
        let considers = layout.blocks.iter().any(|b| b.spec.mode == Mode::Consider);
        if considers || layout.labels > 0 {
            return None;
        }
        let tests = composition.sensors.iter().map(|sensor| {
            let Role::Measurement(model) = &sensor.role else { return None };
            let tested = !sensor.constraint
                && sensor.detector.is_none()
                && !sensor.is_noise_free()
                && sensor.time_offset.is_none()
                && model.observations() == 1;
            tested.then(|| Test::new(layout.tangent, Time::MIN))
        });
        let tests: Vec<_> = tests.collect();
        if tests.iter().all(Option::is_none) {
            return None;
        }
        let identity = transition.identity();
        let places = transition.places().iter().zip(identity);
        let places: Vec<_> = places.map(|(&(i, j), one)| (i, j, one)).collect();
        let moved = vec![[0.0; SUMS]; layout.tangent];
        Some(Self { tests, places, settled: Time::MIN, time: Time::MIN, step: 0.0, moved })
    }

    /// Records a propagation of the state to a time.
    #[inline]
    pub(super) fn moved(&mut self, time: Time) {
        self.step = if self.time == Time::MIN { 0.0 } else { time.since(self.time) };
        self.time = time;
    }

    /// Carries the sensitivities to the present with the rate of the last step, which changes little
    /// between two corrections: `s := s + (Phi - I) s t / dt`.
    fn settle(&mut self, transition: &Transition) {
        let since = std::mem::replace(&mut self.settled, self.time);
        if since == Time::MIN || self.step <= 0.0 {
            return;
        }
        let steps = self.time.since(since) / self.step;
        for test in self.tests.iter_mut().flatten() {
            self.moved.iter_mut().for_each(|m| *m = [0.0; SUMS]);
            for (&(i, j, one), (.., phi)) in self.places.iter().zip(transition.elements()) {
                let a = steps * (phi - one);
                let s = test.s[j];
                self.moved[i].iter_mut().zip(s).for_each(|(m, s)| *m += a * s);
            }
            for (s, moved) in test.s.iter_mut().zip(&self.moved) {
                s.iter_mut().zip(moved).for_each(|(s, m)| *s += m);
            }
        }
    }

    /// Takes an accepted sample before the state is corrected. Call after [`Update::apply`].
    pub(super) fn take(
        &mut self,
        (index, present): (usize, u16),
        model: &dyn AnyMeasurement,
        (at, transition): (&At<'_>, &Transition),
        update: &Update,
        lower: &mut Vec<f64>,
    ) {
        self.settle(transition);
        if !cholesky(&update.s, update.m, lower) {
            return;
        }
        for (k, test) in self.tests.iter_mut().enumerate() {
            let Some(test) = test else { continue };
            if test.span == Time::MIN {
                test.begin(at.state.time);
            }
            test.take(update, lower, (k == index).then_some(present));
            if k == index && test.follow(model, at) {
                test.due = true;
            }
        }
    }

    /// Keeps the corrected state, from which the next slope is taken, and judges the sensor.
    pub(super) fn corrected(
        &mut self,
        index: usize,
        state: &State,
        covariance: &Covariance,
        considered: &[bool],
    ) -> Option<Found> {
        let test = self.tests[index].as_mut()?;
        if std::mem::take(&mut test.due) {
            match &mut test.base {
                Some(base) => {
                    base.time = state.time;
                    base.values.copy_from_slice(&state.values);
                    base.signals.clone_from(&state.signals);
                }
                base => *base = Some(state.clone()),
            }
        }
        if state.time.since(test.span) < SPAN {
            return None;
        }
        test.judge(state.time, covariance, considered)
    }
}
