//! The velocity of positions: the slopes of lines through the fixes of a short time.
//!
//! Fixes with the noise `s` at an interval `d` give a slope over the time `T` the noise `s sqrt(12 d / T^3)`, for many
//! fixes, in place of `s sqrt(2) / T` for the difference of two.

use std::collections::VecDeque;

/// Time over which a line fits fixes, and from one line to the next, s.
const LENGTH: f64 = 2.0;
const STEP: f64 = 1.0;
/// Part of a time that its fixes may lack.
const NEARLY: f64 = 0.95;
/// Largest number of fixes in this time.
const MOST: usize = 256;
/// Radius of the Earth, m.
pub const RADIUS: f64 = 6.371e6;

/// The fixes of a short time.
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Time (s), latitude and longitude (rad).
    fixes: VecDeque<[f64; 3]>,
    /// Middle of the line before.
    before: Option<f64>,
}

impl Track {
    /// Takes a fix at a time (s), with latitude and longitude (rad); the middle (s) of a line and its velocity north and
    /// east (m/s), if the fixes make one.
    pub fn add(&mut self, time: f64, latitude: f64, longitude: f64) -> Option<[f64; 3]> {
        self.fixes.push_back([time, latitude, longitude]);
        // two fixes of a slow receiver make a line too
        let old = |fixes: &VecDeque<[f64; 3]>| {
            fixes.len() > MOST || fixes.get(1).is_some_and(|f| time - f[0] > LENGTH)
        };
        while old(&self.fixes) {
            self.fixes.pop_front();
        }
        let n = self.fixes.len() as f64;
        let [first, ..] = *self.fixes.front()?;
        let middle = self.fixes.iter().map(|f| f[0]).sum::<f64>() / n;
        let due = self.before.is_none_or(|before| middle - before >= NEARLY * STEP);
        if time - first < NEARLY * LENGTH || !due {
            return None;
        }
        self.before = Some(middle);
        let square = self.fixes.iter().map(|f| (f[0] - middle).powi(2)).sum::<f64>();
        let slope = |k: usize| {
            self.fixes.iter().map(|f| (f[0] - middle) * f[k]).sum::<f64>() / square * RADIUS
        };
        Some([middle, slope(1), slope(2) * latitude.cos()])
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn a_line_through_fixes_has_less_noise_than_two_of_them() {
        // 5 Hz for 400 s at 3 m/s north and 4 m/s east, with 1 m of noise: the slope through the n = 12 fixes of T = 2.2 s,
        // the first of them older than two seconds, has the noise sqrt(12 (n - 1) / (n (n + 1))) / T = 0.42 m/s; the
        // difference of two fixes a second apart has 1.4 m/s
        let mut state = 5_u64;
        let mut noise = || {
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let (mut track, mut found) = (Track::default(), Vec::new());
        for k in 0..2000 {
            let t = 0.2 * f64::from(k);
            let north = (3.0 * t + noise()) / RADIUS;
            let east = (4.0 * t + noise()) / RADIUS / 0.8_f64.cos();
            found.extend(track.add(t, 0.8 + north, east));
        }
        assert!((395..=400).contains(&found.len()));
        let n = found.len() as f64;
        for (k, speed) in [(1, 3.0), (2, 4.0)] {
            let mean = found.iter().map(|v| v[k]).sum::<f64>() / n;
            let scatter = (found.iter().map(|v| (v[k] - mean).powi(2)).sum::<f64>() / n).sqrt();
            // the sigma of the scatter of 200 independent lines is a twentieth of it: three of them
            assert!((mean - speed).abs() < 0.1, "{mean}");
            assert!((0.36..0.48).contains(&scatter), "{scatter}");
        }
        // a receiver that is slower than a line
        let mut track = Track::default();
        assert_eq!(track.add(0.0, 0.0, 0.0), None);
        let [middle, north, _] = track.add(5.0, 10.0 / RADIUS, 0.0).unwrap();
        assert!((middle - 2.5).abs() < 1e-12 && (north - 2.0).abs() < 1e-9);
    }
}
