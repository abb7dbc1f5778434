//! The delays of a sensor's samples, from which offset and drift of its clock follow.
//!
//! A sample arrives when its clock says, plus the offset of that clock, plus the way over its link. The
//! way is never shorter than its least delay, so the least delay in a window of time shows the clock.

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Length of a window, s, and the number of windows that are kept: ten minutes.
const WINDOW: f64 = 10.0;
const WINDOWS: usize = 60;
/// Windows from which a drift is computed.
const ENOUGH: usize = 6;

/// The clock of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ClockStatus {
    /// Delay of the samples behind those of the driving sensor, s: the offset of the clock and the way
    /// over the link. A time offset of the sensor's model contains it.
    pub delay_s: Option<f64>,
    /// Drift against the clock of this computer, ppm, and its 1-sigma; positive where the sensor's
    /// clock is slow.
    pub drift_ppm: Option<[f64; 2]>,
}

/// The least delays of one sensor.
#[derive(Clone, Debug, Default)]
pub struct Delays {
    /// End and least delay of each window, s.
    windows: VecDeque<[f64; 2]>,
    /// Begin and least delay of the window that goes on.
    current: Option<[f64; 2]>,
}

impl Delays {
    /// Takes a sample that arrives at a time of this computer's clock, s, with a delay, s.
    pub fn take(&mut self, now: f64, delay: f64) {
        let [begin, least] = *self.current.get_or_insert([now, delay]);
        self.current = Some([begin, least.min(delay)]);
        if now - begin >= WINDOW {
            if self.windows.len() == WINDOWS {
                self.windows.pop_front();
            }
            self.windows.push_back([now, least.min(delay)]);
            self.current = None;
        }
    }

    /// The least delay of the last whole window, s; before, the least so far.
    pub fn least(&self) -> Option<f64> {
        let window = self.windows.back().or(self.current.as_ref());
        window.map(|[_, least]| *least)
    }

    /// The change of the delay with time and its 1-sigma, ppm: a straight line by least squares.
    pub fn drift(&self) -> Option<[f64; 2]> {
        let n = self.windows.len();
        if n < ENOUGH {
            return None;
        }
        let mean = |k: usize| self.windows.iter().map(|w| w[k]).sum::<f64>() / n as f64;
        let (t, d) = (mean(0), mean(1));
        let moment = |f: &dyn Fn(&[f64; 2]) -> f64| self.windows.iter().map(f).sum::<f64>();
        let spread = moment(&|w| (w[0] - t).powi(2));
        let slope = moment(&|w| (w[0] - t) * (w[1] - d)) / spread;
        let rest = moment(&|w| (w[1] - d - slope * (w[0] - t)).powi(2)) / (n - 2) as f64;
        Some([slope, (rest / spread).sqrt()].map(|x| 1e6 * x))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn offset_and_drift_of_a_clock_are_found_behind_the_jitter_of_its_link() {
        let mut delays = Delays::default();
        // 30 ppm, 12 ms, and up to 20 ms of jitter, 5 samples a second for 5 min
        for k in 0..1500_u32 {
            let now = 0.2 * f64::from(k);
            let jitter = 0.02 * f64::from(k * 7919 % 101) / 101.0;
            delays.take(now, 0.012 + 30e-6 * now + jitter);
        }
        let [drift, sigma] = delays.drift().unwrap();
        assert!((drift - 30.0).abs() < 3.0 * sigma.max(1.0) && sigma < 5.0, "{drift} {sigma}");
        let least = delays.least().unwrap();
        assert!((least - 0.012 - 30e-6 * 295.0).abs() < 1e-3, "{least}");
        assert_eq!(Delays::default().drift(), None);
    }
}
