//! Rule: a sensor that measures velocities has the clock of the IMU.
//!
//! Between two velocities the vehicle changes its speed by `a` and turns its course by `c`, each over time. A
//! level vehicle that moves forward has seen the same with its IMU, at the time `t - L` of a clock that
//! is late by `L`:
//! ```text
//! d = a - f_x(t - L),    e = |v| (c - w_z(t - L)),    Q(L) = sum (d - mean d)^2 + sum e^2
//! ```
//! The mean of `d` is the tilt and the bias of the accelerometer. Since a slope of the road is in `d` too,
//! the turns are also compared alone. All whole seconds up to a minute are
//! compared, each with `Q(0)` of the same spans. Offsets below two seconds are left to the filter's test of
//! innovations, which resolves them.

use super::fault::Fault;
use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::monitor::MeasuredVelocity;
use navfuse_core::model::record::finding::{Basis, Severity};
use navfuse_core::units::time::Time;
use std::collections::VecDeque;

/// Largest offset that is tried, and the least one that is reported, s.
const LARGEST: i32 = 60;
const SMALLEST: i32 = 2;
/// Number of offsets.
const LAGS: usize = 2 * LARGEST as usize + 1;
/// Length of a span between two velocities, s.
const SPAN: f64 = 2.0;
/// Time between two sums of the IMU that are kept, and the longest gap between its samples, s.
const STEP: f64 = 0.5;
const GAP: f64 = 0.5;
/// Number of sums and of spans that are kept at most.
const PAST: usize = (2.0 * (LARGEST as f64 + SPAN) / STEP) as usize + 4;
const SPANS: usize = (LARGEST as f64 / SPAN) as usize + 4;
/// Number of spans before a decision.
const COUNT: f64 = 6.0;
/// Ratio of the residuals that is evidence, and the least change that the offset has to explain, (m/s^2)^2.
const EVIDENCE: f64 = 9.0;
const LEAST: f64 = 1.0;
/// Ratio of the residuals of the next best offset, more than two seconds away: a motion that
/// repeats itself fits several.
const ALONE: f64 = 3.0;
/// Ratio of the residuals of an offset one or two seconds beside it, and the number of spans from which on it may be less:
/// half a second between two offsets fits both.
const BESIDE: f64 = 2.0;
const MANY: f64 = 3.0 * COUNT;
/// Least speed at which a course turns, m/s.
const MOVING: f64 = 1.0;

/// Offsets between clocks that computers and receivers use, s.
const KNOWN: [(i32, &str); 4] = [
    (17, "the leap seconds between GPS time and UTC until 2016"),
    (18, "the leap seconds between GPS time and UTC"),
    (19, "the difference of TAI and GPS time"),
    (37, "the leap seconds between TAI and UTC"),
];

/// Sums of the IMU from its first sample to a time.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    time: f64,
    forward: f64,
    turned: f64,
}

saved!(Sums { time, forward, turned });

/// What the sensor shows of a span.
#[derive(Clone, Copy, Debug, Default)]
struct Span {
    begin: f64,
    end: f64,
    /// Change of the speed over time, and of the course, times the speed, m/s^2.
    faster: f64,
    across: f64,
    speed: f64,
    /// Number of seconds after it whose samples of the IMU it was compared with.
    later: i32,
}

saved!(Span { begin, end, faster, across, speed, later });

/// Sums over the spans that are compared with one offset; the forward ones with their mean.
#[derive(Clone, Copy, Debug, Default)]
struct Compared {
    count: f64,
    /// Without an offset, with it, and of the changes themselves.
    without: Squares,
    with: Squares,
    change: Squares,
}

saved!(Compared { count, without, with, change });

/// Changes of the velocity that are compared.
#[derive(Clone, Copy)]
enum Changes {
    All,
    Turns,
}

/// Share of the changes that is left with an offset.
struct Share {
    lag: i32,
    count: f64,
    left: f64,
    /// What the offset explains, and the residuals without it over those with it.
    explained: f64,
    ratio: f64,
}

/// Sum and squares of forward residuals, and squares of those across.
#[derive(Clone, Copy, Debug, Default)]
struct Squares {
    sum: f64,
    forward: f64,
    across: f64,
}

saved!(Squares { sum, forward, across });

impl Squares {
    fn add(&mut self, [forward, across]: [f64; 2]) {
        self.sum += forward;
        self.forward += forward * forward;
        self.across += across * across;
    }

    /// Sum of squares, of the forward ones about their mean.
    fn residual(&self, count: f64, compared: Changes) -> f64 {
        match compared {
            Changes::All => (self.forward - self.sum * self.sum / count).max(0.0) + self.across,
            Changes::Turns => self.across,
        }
    }
}

/// Comparison of the IMU with the sensor that measured the first velocity in axes of the Earth.
#[derive(Clone, Default)]
pub(super) struct Clock {
    sensor: Option<String>,
    /// Time of the first sample of the IMU after it, from which all times count.
    start: Option<Time>,
    last: Sums,
    /// Sums of two minutes.
    past: VecDeque<Sums>,
    /// Velocity at the begin of the present span, with its time.
    velocity: Option<(f64, [f64; 2])>,
    /// A span that ends after the last sums, and spans whose later samples of the IMU are not known yet.
    fresh: Option<Span>,
    waiting: VecDeque<Span>,
    lags: Vec<Compared>,
    due: bool,
    reported: bool,
}

saved!(Clock { sensor, start, last, past, velocity, fresh, waiting, lags, due, reported });

impl Clock {
    /// Ends the comparison: the samples show another fault.
    pub(super) fn end(&mut self) {
        self.reported = true;
    }

    /// Takes a velocity that a sensor measures.
    pub(super) fn measured(&mut self, measured: &MeasuredVelocity<'_>) {
        if measured.own_axes && self.sensor.as_deref() == Some(measured.sensor) {
            self.end(); // its axes were those of the Earth by chance
        }
        if self.reported || measured.own_axes {
            return;
        }
        let Some(sensor) = &self.sensor else { return self.begin(measured.sensor) };
        if sensor != measured.sensor || self.past.is_empty() {
            return;
        }
        let (now, [north, east, _]) = (self.last.time, measured.velocity);
        let Some((begin, [n, e])) = self.velocity.filter(|(begin, _)| now - begin <= 2.0 * SPAN)
        else {
            self.velocity = Some((now, [north, east]));
            return;
        };
        if now - begin < SPAN {
            return;
        }
        self.velocity = Some((now, [north, east]));
        let (before, after) = (n.hypot(e), north.hypot(east));
        let course = (n * east - e * north).atan2(n * north + e * east);
        let moving = before.min(after) > MOVING;
        let speed = if moving { 0.5 * (before + after) } else { 0.0 };
        let span = now - begin;
        let (faster, across) = ((after - before) / span, speed * course / span);
        self.fresh = Some(Span { begin, end: now, faster, across, speed, later: 0 });
    }

    /// Begins with the first velocity of a sensor. All room is allocated here.
    fn begin(&mut self, sensor: &str) {
        self.sensor = Some(sensor.to_owned());
        self.past.reserve(PAST);
        self.waiting.reserve(SPANS);
        self.lags.resize(LAGS, Compared::default());
    }

    /// Adds a sample of the IMU, and decides after a span.
    #[inline]
    pub(super) fn take(
        &mut self,
        w: &Vector3<f64>,
        f: &Vector3<f64>,
        time: Time,
        dt: f64,
    ) -> Option<(Fault, &str)> {
        if self.reported || self.sensor.is_none() {
            return None;
        }
        let time = time.since(*self.start.get_or_insert(time));
        if time - self.last.time > GAP {
            self.past.clear();
            self.waiting.clear();
            (self.velocity, self.fresh) = (None, None);
        }
        let Sums { forward, turned, .. } = self.last;
        self.last = Sums { time, forward: forward + f.x * dt, turned: turned + w.z * dt };
        if self.past.back().is_none_or(|past| time - past.time >= STEP) {
            self.keep();
        }
        if !std::mem::take(&mut self.due) {
            return None;
        }
        let lag = self.offset(Changes::All).or_else(|| self.offset(Changes::Turns))?;
        self.reported = true;
        let sensor = self.sensor.as_deref()?;
        Some((fault(lag, sensor), sensor))
    }

    /// Keeps the present sums, and compares the spans that they complete.
    fn keep(&mut self) {
        let oldest = self.last.time - 2.0 * (f64::from(LARGEST) + SPAN);
        while self.past.front().is_some_and(|past| past.time < oldest) {
            self.past.pop_front();
        }
        self.past.push_back(self.last);
        if let Some(span) = self.fresh.take() {
            (0..=LARGEST).for_each(|lag| self.compare(&span, lag));
            self.waiting.push_back(span);
            self.due = true;
        }
        for k in 0..self.waiting.len() {
            let Some(mut span) = self.waiting.get(k).copied() else { continue };
            while span.later < LARGEST && span.end + f64::from(span.later) + 1.0 < self.last.time {
                span.later += 1;
                self.compare(&span, -span.later);
            }
            self.waiting[k] = span;
        }
        while self.waiting.front().is_some_and(|span| span.later == LARGEST) {
            self.waiting.pop_front();
        }
    }

    /// Means of the IMU over a span, where they are known.
    fn means(&self, begin: f64, end: f64) -> Option<[f64; 2]> {
        let at = |time: f64| {
            let after = self.past.partition_point(|past| past.time < time);
            let (a, b) = (self.past.get(after.checked_sub(1)?)?, self.past.get(after)?);
            let part = (time - a.time) / (b.time - a.time);
            let between = |a: f64, b: f64| a + part * (b - a);
            Some([between(a.forward, b.forward), between(a.turned, b.turned)])
        };
        let ([x0, z0], [x1, z1]) = (at(begin)?, at(end)?);
        Some([(x1 - x0) / (end - begin), (z1 - z0) / (end - begin)])
    }

    fn compare(&mut self, span: &Span, lag: i32) {
        let seconds = f64::from(lag);
        let shifted = self.means(span.begin - seconds, span.end - seconds);
        let Some((now, then)) = self.means(span.begin, span.end).zip(shifted) else {
            return;
        };
        let rest = |[x, z]: [f64; 2]| [span.faster - x, span.across - span.speed * z];
        let Some(compared) = self.lags.get_mut((lag + LARGEST) as usize) else { return };
        compared.count += 1.0;
        compared.without.add(rest(now));
        compared.with.add(rest(then));
        compared.change.add([span.faster, span.across]);
    }

    /// The offset of the sensor's clock, s, if the changes show one.
    fn offset(&self, changes: Changes) -> Option<i32> {
        let share = |(lag, compared): (i32, &Compared)| {
            let Compared { count, without, with, change } = compared;
            let of = |squares: &Squares| squares.residual(*count, changes);
            let [without, with, change] = [of(without), of(with), of(change)];
            let (left, explained, ratio) = (with / change, without - with, without / with);
            let enough = *count >= COUNT && change > LEAST;
            enough.then_some(Share { lag, count: *count, left, explained, ratio })
        };
        let shares = (-LARGEST..=LARGEST).zip(&self.lags).filter_map(share);
        let best = shares.clone().min_by(|a, b| a.left.total_cmp(&b.left))?;
        // a motion to and fro may fit the opposite offset as well, and the one beside it fits almost as well
        let compared = |lag: i32| {
            let known = usize::try_from(LARGEST + lag).ok().and_then(|at| self.lags.get(at));
            known.is_none_or(|compared| compared.count >= COUNT)
        };
        let rivals = [-best.lag, best.lag - 2, best.lag - 1, best.lag + 1, best.lag + 2];
        let rivals = rivals.into_iter().all(compared);
        let other = ALONE * best.left.max(1.0 / EVIDENCE / ALONE);
        let alone = |share: &Share| match (share.lag - best.lag).abs() {
            0 => true,
            1 | 2 => best.count >= MANY || share.left >= BESIDE * best.left,
            _ => share.left >= other,
        };
        let clear = best.lag.abs() >= SMALLEST && best.left * EVIDENCE <= 1.0;
        let better = best.explained >= LEAST && best.ratio >= EVIDENCE;
        (rivals && clear && better && shares.clone().all(|share| alone(&share))).then_some(best.lag)
    }
}

fn fault(lag: i32, sensor: &str) -> Fault {
    let known = KNOWN.iter().find(|(known, _)| *known == lag.abs());
    let known = known.map(|(_, words)| format!(", {words}")).unwrap_or_default();
    let when = if lag > 0 { "before" } else { "after" };
    let (lag, back) = (lag.abs(), if lag > 0 { '-' } else { '+' });
    Fault {
        severity: Severity::DoNotUse,
        basis: Basis::Samples,
        text: format!(
            "its velocities fit the accelerations and turns that the IMU saw {lag} s {when} them{known}: one \
             of the two clocks is off by that much"
        ),
        remedy: format!(
            "check what the stamps count from; put samples = {{ clock = \"{back}{lag} s\" }} into \
             [sensor.{sensor}] (good to a second, and not tried); `navfuse diagnose` tries offsets"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of a drive: the change of the speed and the turn, for each span of so many seconds.
    const DRIVE: [(f64, f64, f64); 9] = [
        (70.0, 0.0, 0.0),
        (8.0, 1.5, 0.0),
        (10.0, 0.0, 0.15),
        (14.0, 0.3, 0.0),
        (8.0, -0.8, -0.2),
        (25.0, 0.0, 0.03),
        (6.0, -1.0, 0.0),
        (11.0, 0.7, -0.1),
        (90.0, 0.0, 0.0),
    ];
    const DT: f64 = 0.0625;

    /// The finding in a motion with these rates, for velocities at 4 Hz whose stamps are late by `lag`.
    fn found(lag: f64, rates: impl Fn(f64) -> [f64; 2]) -> Option<String> {
        seen(lag, 1.0, rates)
    }

    /// The same where the velocity to the east has a factor.
    fn seen(lag: f64, factor: f64, rates: impl Fn(f64) -> [f64; 2]) -> Option<String> {
        shown(lag, factor, rates, |_| 0.3)
    }

    /// The same where gravity adds to the forward acceleration.
    fn shown(
        lag: f64,
        factor: f64,
        rates: impl Fn(f64) -> [f64; 2],
        slope: impl Fn(f64) -> f64,
    ) -> Option<String> {
        let mut rule = Clock::default();
        let (mut speed, mut course) = (5.0, 0.3_f64);
        let samples: Vec<([f64; 2], [f64; 2])> = (0..(250.0 / DT) as usize)
            .map(|k| {
                let [a, w] = rates(k as f64 * DT);
                speed += a * DT;
                course += w * DT;
                ([a, w], [speed * course.cos(), speed * course.sin()])
            })
            .collect();
        (0..samples.len()).find_map(|k| {
            let [a, w] = samples[k].0;
            let (f, w) =
                (Vector3::new(a + slope(k as f64 * DT), 0.0, -9.8), Vector3::new(0.0, 0.0, w));
            let time = Time::from_nanos((k as f64 * DT * 1e9) as i64);
            let fault = rule.take(&w, &f, time, DT).map(|(fault, _)| fault.text);
            // the sample that was taken `lag` before
            let at = (k as f64 - lag / DT).clamp(0.0, samples.len() as f64 - 1.0) as usize;
            let [north, east] = samples[at].1;
            if k % 4 == 0 {
                let velocity = [north, factor * east, 0.0];
                rule.measured(&MeasuredVelocity { sensor: "gnss", velocity, own_axes: false });
            }
            fault
        })
    }

    fn drive(time: f64) -> [f64; 2] {
        let mut end = 0.0;
        let part = DRIVE.iter().find(|(length, ..)| {
            end += length;
            time < end
        });
        part.map_or([0.0; 2], |&(_, a, w)| [a, w])
    }

    #[test]
    fn a_clock_that_is_off_by_seconds_is_named_with_its_size_and_sign() {
        for lag in [-60.0, -37.0, -18.0, -3.0, 3.0, 17.0, 18.0, 19.0, 37.0, 60.0] {
            let when = if lag > 0.0 { "before" } else { "after" };
            let words = format!("the IMU saw {} s {when} them", f64::abs(lag));
            let text = found(lag, drive);
            assert!(text.as_ref().is_some_and(|text| text.contains(&words)), "{lag}: {text:?}");
        }
        let text = found(18.0, drive).unwrap_or_default();
        assert!(text.contains("leap seconds between GPS time and UTC: one"), "{text}");
    }

    /// The stamps of half a second between two that are compared fit both about as well.
    #[test]
    fn an_offset_that_is_no_whole_second_is_named_by_the_nearest() {
        let text = found(18.5, drive).unwrap_or_default();
        assert!(text.contains("saw 18 s before") || text.contains("saw 19 s before"), "{text}");
    }

    /// Of a hilly road the accelerometers see the slopes, which velocities do not.
    #[test]
    fn turns_alone_show_an_offset() {
        let hills = |time: f64| (0.7 * time).sin() + (0.31 * time).sin();
        let text = shown(18.0, 1.0, drive, hills).unwrap_or_default();
        assert!(text.contains("saw 18 s before"), "{text}");
        assert_eq!(shown(0.0, 1.0, drive, hills), None);
    }

    /// An offset of a second is left to the innovations.
    #[test]
    fn clocks_that_agree_are_no_fault() {
        for lag in [-1.0, 0.0, 0.25, 1.0] {
            assert_eq!(found(lag, drive), None, "{lag}");
        }
    }

    /// Where the sign of the east is wrong, turns to and fro every 20 s fit offsets of 10 s to both sides.
    #[test]
    fn a_motion_that_repeats_itself_shows_no_offset() {
        let rates = |time: f64| [0.0, 0.2 * (std::f64::consts::TAU * time / 20.0).sin()];
        for factor in [1.0, -1.0] {
            assert_eq!(seen(0.0, factor, rates), None, "{factor}");
        }
    }

    /// Velocities that never change fit every time at which the vehicle rests.
    #[test]
    fn a_velocity_that_is_stuck_is_no_offset() {
        assert_eq!(found(1000.0, drive), None);
    }
}
