//! The rates of the last two inertial samples, and the angular rate at a time within the last one.

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

/// The last two samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LastRates {
    before: Option<Rates>,
    last: Option<Rates>,
}

saved!(LastRates { before, last });

impl LastRates {
    /// Takes a sample, unless it is the last one again.
    #[inline]
    pub fn take(&mut self, rates: Rates) {
        if self.last.is_none_or(|last| last.time != rates.time) {
            self.before = self.last.replace(rates);
        }
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
    #[inline]
    pub fn angular_rate(&self, at: Time) -> Option<Vector3<f64>> {
        let last = self.last.as_ref()?;
        let Some(before) = self.before.as_ref() else { return Some(last.w) };
        let between = last.time.since(before.time) - 0.5 * (last.duration - before.duration);
        let ahead = at.since(last.time) + 0.5 * last.duration;
        // samples that overlap have no line
        let part = if between > 0.5 * last.duration { ahead / between } else { 0.0 };
        Some(last.w + (last.w - before.w) * part)
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
