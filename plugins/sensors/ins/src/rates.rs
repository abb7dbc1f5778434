//! The rates of the last inertial samples, and the angular rate at a time within the last one.

use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::units::time::Time;

/// Mean angular rate and specific force over the time that a sample covers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rates {
    /// End of the sample.
    pub time: Time,
    /// Length of the sample, s.
    pub duration: f64,
    /// Angular rate, rad/s.
    pub w: Vector3<f64>,
    /// Specific force, m/s^2.
    pub f: Vector3<f64>,
}

saved!(Rates { time, duration, w, f });

/// Samples that a line is fitted to at most, and the longest time that they may cover, s.
const KEPT: usize = 32;
const LONGEST: f64 = 0.32;
/// Sigma of the angular rate that needs no longer line, rad/s: a lever arm of 1 m makes 0.05 mm/s of it, a
/// twentieth of the noise of the best DVL.
const NEGLIGIBLE: f64 = 5e-5;
/// Time since the origin of the times after which a new one begins, s: the sums lose `(FAR / LONGEST)^2`
/// of their precision, one digit.
const FAR: f64 = 3.0 * LONGEST;
/// Number of differences that determine the noise.
const MEMORY: f64 = 256.0;
/// Difference from a shorter line in its sigma at which a longer one does not follow the rate.
const APART: f64 = 3.0;

/// Line through the rates of some samples: at the end of the last one, rad/s, its slope, and their number.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    rate: Vector3<f64>,
    slope: Vector3<f64>,
    samples: usize,
}

saved!(Line { rate, slope, samples });

/// Numbers of samples of the lines.
const LINES: [usize; 5] = [2, 4, 8, 16, KEPT];

/// Sums over the last samples of a line: of the rates and the middle since the origin, s, and of these
/// times the middle.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    values: [f64; 4],
    moments: [f64; 4],
}

saved!(Sums { values, moments });

impl Sums {
    /// Adds a sample that many times.
    #[inline]
    fn add(&mut self, sample: &[f64; 4], times: f64) {
        for k in 0..4 {
            self.values[k] += times * sample[k];
            self.moments[k] += times * sample[k] * sample[3];
        }
    }
}

/// The last samples.
#[derive(Clone, Debug, Default)]
pub(crate) struct LastRates {
    before: Option<Rates>,
    last: Option<Rates>,
    /// Rates of the last samples, where these have noise, with the middle of each since the origin, s; their
    /// number, and the sums of each line over them.
    recent: [[f64; 4]; KEPT],
    count: usize,
    sums: [Sums; LINES.len()],
    /// Origin of the times, which is never long ago: the sums lose little to a large time.
    origin: Option<Time>,
    /// Rates at the ends of the last samples on their lines, the place of the newest among these and the samples, and the rate
    /// before those of the last line.
    lines: [[f64; 3]; KEPT],
    newest: usize,
    earlier: Option<Vector3<f64>>,
    /// Mean square of the noise of a sample by axis, of its second differences, and their number.
    scatter: [f64; 3],
    differences: f64,
    line: Option<Line>,
    /// Noise density of the gyros, rad/sqrt(s).
    noise: f64,
}

saved!(LastRates {
    before, last, recent, count, sums, origin, lines, newest, earlier, scatter, differences, line,
} except { noise });

impl LastRates {
    /// The samples of gyros of that noise density, rad/sqrt(s).
    pub fn new(noise: f64) -> Self {
        Self { noise, ..Self::default() }
    }

    /// Takes a sample, unless it is the last one again.
    #[inline]
    pub fn take(&mut self, rates: Rates) {
        if self.last.is_some_and(|last| last.time == rates.time) {
            return;
        }
        self.before = self.last.replace(rates);
        if self.sigma(&rates) > NEGLIGIBLE {
            let end = self.add(&rates);
            self.scatter();
            self.line = self.fit(end, &rates);
            // the place of the newest still has the rate of as many samples ago as a line may have
            self.earlier = self.line.map(|line| self.lines[self.place(line.samples)].into());
            self.lines[self.newest] = self.line.map_or(rates.w, |line| line.rate).into();
        }
    }

    /// Place of so many samples before the newest.
    #[inline]
    fn place(&self, before: usize) -> usize {
        (self.newest + KEPT - before) % KEPT
    }

    /// Adds a sample to the sums of all lines, which the oldest of each leaves, and returns its end since the origin, s.
    #[inline]
    fn add(&mut self, rates: &Rates) -> f64 {
        for (samples, sums) in LINES.iter().zip(&mut self.sums) {
            if self.count >= *samples {
                let oldest = (self.newest + KEPT + 1 - samples) % KEPT;
                sums.add(&self.recent[oldest], -1.0);
            }
        }
        let Rates { time, duration, w, .. } = *rates;
        let mut end = time.since(*self.origin.get_or_insert(time));
        let new = [w.x, w.y, w.z, end - 0.5 * duration];
        self.newest = (self.newest + 1) % KEPT;
        self.recent[self.newest] = new;
        self.count = KEPT.min(self.count + 1);
        if self.newest == 0 || end > FAR {
            self.sum_again(end);
            self.origin = Some(time);
            end = 0.0;
        } else {
            self.sums.iter_mut().for_each(|sums| sums.add(&new, 1.0));
        }
        end
    }

    /// Moves the origin of the times, and computes all sums from the samples: rounding does not add up.
    fn sum_again(&mut self, origin: f64) {
        self.recent.iter_mut().for_each(|sample| sample[3] -= origin);
        self.sums = Default::default();
        for before in 0..self.count {
            let sample = self.recent[self.place(before)];
            let lines = LINES.iter().zip(&mut self.sums).filter(|(samples, _)| before < **samples);
            lines.for_each(|(_, sums)| sums.add(&sample, 1.0));
        }
    }

    /// The angular rate at the end of the last sample before those of the line through the last ones, rad/s: its noise is
    /// another one. `None` where the noise is negligible.
    pub fn earlier(&self) -> Option<Vector3<f64>> {
        self.earlier
    }

    /// Sigma of the mean rate of a sample, rad/s.
    fn sigma(&self, rates: &Rates) -> f64 {
        self.noise / rates.duration.sqrt()
    }

    /// Change of angular rate and specific force from the sample before to the last one; the last
    /// one's values without a sample before.
    pub fn change(&self) -> [Vector3<f64>; 2] {
        let Some(Rates { w, f, .. }) = self.last else { return Default::default() };
        self.before.map_or([w, f], |before| [w - before.w, f - before.f])
    }

    /// Computes the angular rate at a time within the last sample, rad/s, on the line through both
    /// means, each of which is the rate in the middle of its sample.
    ///
    /// The mean of the last sample alone is late by half an interval `T` at the end of the sample.
    /// Its error `w' T/2` keeps its sign while a turn begins or ends; no noise of a sensor accounts
    /// for it, and it biases the estimate of a lever arm. The error of the line is at most
    /// `w'' T^2 / 3`. The price is white noise: that of the mean in the middle of the sample, and
    /// `sqrt(10)/2` = 1.58 times that at its end, the least that two samples allow without the
    /// bias. For a gyro of `0.1 deg/h/sqrt(Hz)` at 100 Hz and a lever arm of 3 m it grows from
    /// 0.015 to 0.023 mm/s.
    ///
    /// That is much for other gyros: the derivative of a velocity by its lever arm is the rate, and one that is
    /// noise makes the lever arm known that it does not show, and zero. Where the noise is not negligible, the line
    /// goes through 4, 8, 16 and 32 samples, as long as each line agrees with the shorter ones within their noise
    /// (Lepski 1991), which is the stated one or that of the second differences, whichever is smaller. The noise at the end of 32 is a fifth of that of two.
    #[inline]
    pub fn angular_rate(&self, at: Time) -> Option<Vector3<f64>> {
        let last = self.last.as_ref()?;
        if let Some(line) = self.line {
            return Some(line.rate + line.slope * at.since(last.time));
        }
        let Some(before) = self.before.as_ref() else { return Some(last.w) };
        let between = last.time.since(before.time) - 0.5 * (last.duration - before.duration);
        let ahead = at.since(last.time) + 0.5 * last.duration;
        // samples that overlap have no line
        let part = if between > 0.5 * last.duration { ahead / between } else { 0.0 };
        Some(last.w + (last.w - before.w) * part)
    }

    /// Follows the noise: a stated one may be too large by far, and a line would then be too long.
    fn scatter(&mut self) {
        if self.count < 3 {
            return;
        }
        let [new, before, oldest] = [0, 1, 2].map(|before| self.recent[self.place(before)]);
        self.differences = (self.differences + 1.0).min(MEMORY);
        for (k, scatter) in self.scatter.iter_mut().enumerate() {
            let second = new[k] - 2.0 * before[k] + oldest[k];
            *scatter += (second * second / 6.0 - *scatter) / self.differences;
        }
    }

    /// The rate at the end of the last sample and its slope, on the longest line that agrees with the shorter ones.
    fn fit(&self, end: f64, last: &Rates) -> Option<Line> {
        let scatter = self.scatter.iter().copied().fold(0.0, f64::max).sqrt();
        let limit = APART * self.sigma(last).min(scatter);
        let mut lines = [(Line::default(), 0.0); 5];
        let mut count = 0;
        for (samples, sums) in LINES.into_iter().zip(&self.sums) {
            if self.count < samples {
                break;
            }
            let (n, t) = (samples as f64, self.recent[self.place(samples - 1)][3] - end);
            let Sums { values, moments } = sums;
            // samples that overlap have no line
            if -t <= 0.5 * n * last.duration {
                continue;
            }
            // the times since the end of the last sample
            let w0 = Vector3::new(values[0], values[1], values[2]);
            let w1 = Vector3::new(moments[0], moments[1], moments[2]) - w0 * end;
            let t1 = values[3] - n * end;
            let t2 = moments[3] - end * (values[3] + t1);
            let scale = (n * t2 - t1 * t1).recip();
            let rate = (w0 * t2 - w1 * t1) * scale;
            let line = Line { rate, slope: (w1 * n - w0 * t1) * scale, samples };
            let agrees = |(shorter, variance): &(Line, f64)| {
                (line.rate - shorter.rate).amax() <= limit * variance.sqrt()
            };
            if t < -LONGEST || !lines[..count].iter().all(agrees) {
                break;
            }
            lines[count] = (line, t2 * scale);
            count += 1;
        }
        lines[..count].last().map(|(line, _)| *line)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::testing::Uniform;

    fn time(seconds: f64) -> Time {
        Time::from_seconds(seconds).unwrap()
    }

    /// A turn that begins and ends: `w = A sin^2(pi t / D)`, and its mean between two times.
    const AMPLITUDE: f64 = 0.2;
    const TURN: f64 = 8.0;

    fn rate(t: f64) -> f64 {
        AMPLITUDE * (std::f64::consts::PI * t / TURN).sin().powi(2)
    }

    fn mean(from: f64, to: f64) -> f64 {
        let k = std::f64::consts::TAU / TURN;
        let angle = |t: f64| 0.5 * AMPLITUDE * (t - (k * t).sin() / k);
        (angle(to) - angle(from)) / (to - from)
    }

    /// The largest errors over a turn at times within samples: of the line, and of the mean alone.
    fn worst(interval: impl Fn(u32) -> f64) -> (f64, f64) {
        let (mut last, mut t, mut worst, mut random) =
            (LastRates::default(), 0.0, (0.0_f64, 0.0_f64), Uniform::new(1));
        for k in 0.. {
            let (from, to) = (t, t + interval(k));
            if to > TURN {
                break;
            }
            let w = Vector3::z() * mean(from, to);
            last.take(Rates { time: time(to), duration: to - from, w, f: Vector3::zeros() });
            for _ in 0..5 {
                let at = to - (to - from) * random.within(0.5).abs() * 2.0;
                // the first sample has none before it
                if k > 0 {
                    worst.0 =
                        worst.0.max((last.angular_rate(time(at)).unwrap().z - rate(at)).abs());
                }
            }
            if k > 0 {
                let end = last.angular_rate(time(to)).unwrap().z - rate(to);
                worst = (worst.0.max(end.abs()), worst.1.max((w.z - rate(to)).abs()));
            }
            t = to;
        }
        worst
    }

    #[test]
    fn the_error_of_the_rate_in_a_turn_falls_with_the_square_of_the_interval() {
        let errors = [0.1, 0.05, 0.025].map(|interval| worst(|_| interval));
        for (pair, interval) in errors.windows(2).zip([0.1, 0.05]) {
            // the next term of the series is smaller by T w'''/w'' < T k, 0.08 at most
            assert!((pair[0].0 / pair[1].0 / 4.0 - 1.0).abs() < 0.1, "{errors:?}");
            assert!((pair[0].1 / pair[1].1 / 2.0 - 1.0).abs() < 0.1, "the mean alone: {errors:?}");
            let second = 0.5 * AMPLITUDE * (std::f64::consts::TAU / TURN).powi(2);
            let bound = second / 3.0 * interval * interval;
            assert!(pair[0].0 < 1.1 * bound && pair[0].0 > 0.8 * bound, "{} {bound}", pair[0].0);
        }
    }

    /// Samples that are late by a quarter of the interval in turn: 75 and 125 ms after one another.
    #[test]
    fn it_does_so_where_samples_come_unevenly() {
        let uneven = |mean: f64| worst(|k| if k % 2 == 0 { 0.75 * mean } else { 1.25 * mean }).0;
        let errors = [0.1, 0.05, 0.025].map(uneven);
        assert!(
            errors.windows(2).all(|pair| (pair[0] / pair[1] / 4.0 - 1.0).abs() < 0.15),
            "{errors:?}"
        );
    }

    /// Sigma of the noise of a sample, rad/s, and the interval, s: gyros of 344 deg/h/sqrt(Hz).
    const SIGMA: f64 = 1e-2;
    const INTERVAL: f64 = 0.01;

    /// The root mean squares of the error of the rate at the end of a sample in [`SIGMA`], of gyros whose noise is
    /// known, and of such for which it is taken to be none.
    fn noisy(angle: impl Fn(f64) -> f64, rate: impl Fn(f64) -> f64) -> [f64; 2] {
        let mut random = Uniform::new(2);
        let mut last = [LastRates::new(SIGMA * INTERVAL.sqrt()), LastRates::default()];
        let (mut squares, n) = ([0.0; 2], 20_000);
        for k in 0..n {
            let (from, to) = (f64::from(k) * INTERVAL, f64::from(k + 1) * INTERVAL);
            // an even distribution of sigma one is within sqrt(3)
            let noise = SIGMA * random.within(3_f64.sqrt());
            let w = Vector3::z() * ((angle(to) - angle(from)) / INTERVAL + noise);
            for (last, squares) in last.iter_mut().zip(&mut squares) {
                last.take(Rates { time: time(to), duration: INTERVAL, w, f: Vector3::zeros() });
                let error = last.angular_rate(time(to)).unwrap().z - rate(to);
                *squares += (error / SIGMA).powi(2);
            }
        }
        squares.map(|sum| (sum / f64::from(n)).sqrt())
    }

    /// The variance at the end of a line through 32 samples is `4 / 32`, and that of two is 2.5.
    #[test]
    fn the_noise_of_coarse_gyros_is_that_of_a_long_line_while_the_rate_is_steady() {
        for rate in [0.0, 0.3] {
            let [long, short] = noisy(|t| rate * t, |_| rate);
            assert!(long < 0.45 && (short - 2.5_f64.sqrt()).abs() < 0.03, "{long} {short}");
        }
    }

    /// A roll of 0.5 rad/s at 1 Hz: the line through 32 samples is off by up to `w'' T^2 / 6`, 34 sigma.
    #[test]
    fn a_rate_that_changes_fast_is_followed_as_by_a_short_line() {
        let k = std::f64::consts::TAU;
        let [long, short] = noisy(|t| -0.5 / k * (k * t).cos(), |t| 0.5 * (k * t).sin());
        assert!(long < 1.3 * short, "{long} {short}");
    }

    /// The mean products of the noise of both rates, over the variance of the first one, of 20 000 samples: with correlations
    /// within a line of 32, 0.04 is 1 sigma. A roll of 0.2 rad/s and 6 s is in both.
    #[test]
    fn the_earlier_rate_follows_the_vehicle_with_a_noise_of_its_own() {
        let k = std::f64::consts::TAU / 6.0;
        let mut random = Uniform::new(3);
        let mut last = LastRates::new(SIGMA * INTERVAL.sqrt());
        let [mut noise, mut rolls, mut square, mut roll] = [0.0; 4];
        for n in 0..20_000 {
            let to = f64::from(n + 1) * INTERVAL;
            let w = 0.2 * (k * (to - 0.5 * INTERVAL)).sin();
            let measured = Vector3::new(SIGMA * random.within(3_f64.sqrt()), 0.0, w);
            let rates =
                Rates { time: time(to), duration: INTERVAL, w: measured, f: Vector3::zeros() };
            last.take(rates);
            if n >= 100 {
                let now = last.angular_rate(time(to)).unwrap();
                let before = last.earlier().unwrap();
                noise += now.x * before.x;
                square += now.x * now.x;
                rolls += before.z * w;
                roll += w * w;
            }
        }
        assert!((noise / square).abs() < 0.12, "{}", noise / square);
        // 0.32 s earlier the roll has 0.94 of its value
        assert!(rolls / roll > 0.9, "{}", rolls / roll);
    }

    /// Least squares over the last samples alone, for a minute at 100 Hz, and at rates of which few samples fit into
    /// the longest time.
    #[test]
    fn the_line_is_that_of_least_squares_through_the_last_samples() {
        for (interval, count) in [(0.01, 6000), (0.02, 500), (0.1, 40)] {
            let mut random = Uniform::new(5);
            let mut last = LastRates::new(1.0);
            let mut all = Vec::new();
            for n in 1..=count {
                let end = f64::from(n) * interval;
                let w = Vector3::new(0.3 + 0.1 * end, random.within(0.01), -0.2);
                all.push((end - 0.5 * interval, w));
                last.take(Rates { time: time(end), duration: interval, w, f: Vector3::zeros() });
                let Some(line) = last.line else { continue };
                let of = &all[all.len() - line.samples..];
                let share = (line.samples as f64).recip();
                let (t, mean) = of.iter().fold((0.0, Vector3::zeros()), |(t, mean), (at, w)| {
                    (t + share * (at - end), mean + w * share)
                });
                let spread: f64 = of.iter().map(|(at, _)| (at - end - t).powi(2)).sum();
                let slope: Vector3<f64> =
                    of.iter().map(|(at, w)| (w - mean) * ((at - end - t) / spread)).sum();
                let rate = mean - slope * t;
                // the sums of two samples have a rounding of 1e-16 of 13 rad/s, over their spread of 1e-4 s^2
                assert!((line.slope - slope).amax() < 1e-9, "{n}: {} {slope}", line.slope);
                assert!((line.rate - rate).amax() < 1e-10, "{n}: {} {rate}", line.rate);
            }
        }
    }

    #[test]
    fn without_a_sample_before_it_is_the_mean() {
        let mut last = LastRates::default();
        assert!(last.angular_rate(time(1.0)).is_none());
        let rates = Rates { time: time(1.0), duration: 0.1, w: Vector3::x(), f: Vector3::zeros() };
        last.take(rates);
        assert_eq!(last.angular_rate(time(1.0)), Some(Vector3::x()));
        last.take(rates);
        assert!(last.before.is_none(), "the same sample again");
    }
}
