//! Rule: the white noise of the IMU is as strong as stated.
//!
//! Second differences of means over `m` samples remove the motion. For white noise their variance
//! falls as `1/m`; vibration and motion follow another law, and are not judged here.

use super::fault::Fault;
use crate::imu::Imu;
use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::model::record::finding::{Basis, Severity};

/// Number of averaging lengths: 1, 2, 4, 8 and 16 samples.
const LEVELS: usize = 5;
/// Number of samples of a block, and of the pause after it: the rule looks at a quarter of them.
const BLOCK: u32 = 2048;
const PAUSE: u32 = 3 * BLOCK;
/// Number of blocks in which a channel must be too noisy.
const BLOCKS: u32 = 2;
/// Multiple of the stated noise at which a result is doubtful, and at which it is useless.
const DOUBTFUL: f64 = 2.0;
const USELESS: f64 = 3.0;
/// Ratios that hint at degrees for radians, 57.3.
const DEGREES: std::ops::Range<f64> = 52.0..63.0;

const CHANNELS: [&str; 6] = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"];

/// Second differences of one channel at one averaging length.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    half: Option<f64>,
    last: f64,
    before: f64,
    count: u32,
    sum: f64,
}

saved!(Level { half, last, before, count, sum });

impl Level {
    /// Takes a mean; returns the mean of two at every second one.
    #[inline]
    fn take(&mut self, x: f64) -> Option<f64> {
        if self.count >= 2 {
            let bend = x - 2.0 * self.last + self.before;
            self.sum += bend * bend;
        }
        self.count += 1;
        (self.before, self.last) = (self.last, x);
        match self.half.take() {
            Some(half) => Some(0.5 * (half + x)),
            None => {
                self.half = Some(x);
                None
            }
        }
    }

    /// Variance of a mean: the second difference has six times that of white noise.
    fn variance(&self) -> f64 {
        self.sum / (6.0 * f64::from(self.count.saturating_sub(2).max(1)))
    }
}

/// Second differences of all channels.
#[derive(Clone)]
pub(super) struct Whiteness {
    density: [f64; 6],
    step: [f64; 6],
    levels: [[Level; LEVELS]; 6],
    taken: u32,
    time: f64,
    noisy: [u32; 6],
    reported: bool,
}

saved!(Whiteness { levels, taken, time, noisy, reported } except { density, step });

impl Whiteness {
    pub(super) fn new(imu: &Imu) -> Self {
        let (gyro, accel) = (imu.gyro_noise(), imu.accel_noise());
        let (w, f) = (imu.gyro_step(), imu.accel_step());
        Self {
            density: [gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z],
            step: [w, w, w, f, f, f],
            levels: Default::default(),
            taken: 0,
            time: 0.0,
            noisy: [0; 6],
            reported: false,
        }
    }

    #[inline]
    pub(super) fn take(&mut self, w: &Vector3<f64>, f: &Vector3<f64>, dt: f64) -> Option<Fault> {
        self.taken += 1;
        if self.taken > BLOCK {
            if self.taken == BLOCK + PAUSE {
                (self.taken, self.time) = (0, 0.0);
                self.levels = Default::default();
            }
            return None;
        }
        self.time += dt;
        let x = [w.x, w.y, w.z, f.x, f.y, f.z];
        for (levels, x) in self.levels.iter_mut().zip(x) {
            let mut mean = x;
            for level in levels {
                match level.take(mean) {
                    Some(next) => mean = next,
                    None => break,
                }
            }
        }
        if self.taken == BLOCK { self.judge() } else { None }
    }

    #[cold]
    fn judge(&mut self) -> Option<Fault> {
        if self.reported {
            return None;
        }
        let dt = self.time / f64::from(BLOCK);
        let mut worst: Option<(f64, usize)> = None;
        for (c, levels) in self.levels.iter().enumerate() {
            let variance = levels[0].variance();
            let stated = self.density[c].powi(2) / dt + self.step[c].powi(2) / 12.0;
            let ratio = (variance / stated).sqrt();
            if !is_white(levels) || ratio < DOUBTFUL {
                continue;
            }
            self.noisy[c] += 1;
            if self.noisy[c] >= BLOCKS && worst.is_none_or(|(w, _)| ratio > w) {
                worst = Some((ratio, c));
            }
        }
        let (ratio, c) = worst?;
        self.reported = true;
        let degrees = c < 3 && DEGREES.contains(&ratio);
        let hint = if degrees { ", as if the gyros were in deg/s" } else { "" };
        Some(Fault {
            severity: if ratio < USELESS { Severity::Doubtful } else { Severity::DoNotUse },
            basis: Basis::Samples,
            text: format!(
                "the white noise of {} is {ratio:.1} times the stated one{hint}",
                CHANNELS[c]
            ),
            remedy: if degrees {
                "convert the gyros to rad/s, or name their columns with the unit, such as gyro_x_dps"
            } else {
                "set gyro_noise and accel_noise of the IMU to the noise that it shows on the \
                     vehicle"
            }
            .to_owned(),
        })
    }
}

/// Returns `true` if the variances fall as those of white noise. The variance of a variance from
/// `n` overlapping second differences is about `4/n` of its square; the bound is three times its
/// root.
fn is_white(levels: &[Level; LEVELS]) -> bool {
    let first = levels[0].variance();
    levels.iter().enumerate().skip(1).all(|(l, level)| {
        let ratio = level.variance() * f64::from(1_u32 << l) / first;
        (ratio - 1.0).abs() < 3.0 * (4.0 / f64::from(level.count.max(1))).sqrt()
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::panic, reason = "a test fails by panicking")]
    use super::*;
    use crate::testing::{Uniform, imu};
    use serde_json::json;

    const INTERVAL: f64 = 0.01;
    /// Density of the bench's noise, 1 mrad/s/sqrt(Hz) and 0.02 m/s^2/sqrt(Hz), as 1-sigma of a
    /// sample at 100 Hz.
    const SIGMA: [f64; 2] = [1e-3 * 10.0, 0.02 * 10.0];

    /// The first fault in four minutes, with the number of samples, where the noise is this many
    /// times the stated one in each channel. Each sample contains `memory` times the noise before.
    /// The vehicle turns faster and faster, and the accelerometers show gravity.
    fn fault(factors: [f64; 6], memory: f64) -> Option<(u32, Fault)> {
        let keys = json!({
            "gyro_noise": "1e-3 rad/s/sqrt(Hz)", "accel_noise": "0.02 m/s^2/sqrt(Hz)",
        });
        let (mut rule, mut random) = (Whiteness::new(&imu(&keys)), Uniform::new(1));
        let mut before = [0.0; 6];
        (1..=24_000).find_map(|k| {
            // twelve uniform numbers within a half have the variance of one
            let mut normal = || (0..12).map(|_| random.within(0.5)).sum::<f64>();
            let now: [f64; 6] = std::array::from_fn(|c| factors[c] * SIGMA[c / 3] * normal());
            let [w, f] =
                [0, 3].map(|at| Vector3::from_fn(|c, _| now[at + c] + memory * before[at + c]));
            before = now;
            let (turn, up) = (1e-5 * f64::from(k), Vector3::new(0.0, 0.0, -9.81));
            rule.take(&w.add_scalar(turn), &(f + up), INTERVAL).map(|fault| (k, fault))
        })
    }

    /// So many times the stated noise in one channel, and the stated one in the others.
    fn alone(channel: usize, factor: f64) -> [f64; 6] {
        std::array::from_fn(|c| if c == channel { factor } else { 1.0 })
    }

    /// The variance from 2046 second differences has a sigma of 4.4 % (`4/n` of its square), so the
    /// factor has 2.2 %: 10 % are more than four sigma. Two blocks of 2048 samples are needed, with
    /// 6144 between them.
    #[test]
    fn a_channel_with_more_noise_than_stated_is_named_with_its_factor() {
        for (channel, name) in CHANNELS.into_iter().enumerate() {
            assert!(fault(alone(channel, 1.8), 0.0).is_none(), "{name}");
            for (factor, severity) in
                [(2.3, Severity::Doubtful), (3.4, Severity::DoNotUse), (57.3, Severity::DoNotUse)]
            {
                let Some((samples, found)) = fault(alone(channel, factor), 0.0) else {
                    panic!("{name}: {factor} is not found")
                };
                assert_eq!((samples, found.severity), (2 * 2048 + 6144, severity), "{name}");
                let rest = found.text.strip_prefix(&format!("the white noise of {name} is "));
                let shown = rest.and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
                let off = shown.map_or(1.0, |shown| shown / factor - 1.0);
                assert!(off.abs() < 0.1, "{}", found.text);
                let degrees = found.text.ends_with("deg/s");
                assert_eq!(degrees, channel < 3 && factor > 50.0, "{}", found.text);
            }
        }
    }

    #[test]
    fn of_several_noisy_channels_the_worst_is_named() {
        for factors in [[3.0, 6.0, 1.0, 4.0, 1.0, 1.0], [6.0, 3.0, 1.0, 4.0, 1.0, 1.0]] {
            let worst = if factors[0] > factors[1] { "gyro_x" } else { "gyro_y" };
            let text = fault(factors, 0.0).map_or_else(String::new, |(_, fault)| fault.text);
            assert!(text.contains(&format!("noise of {worst} is")), "{text}");
        }
    }

    /// Samples rounded to 0.2 m/s^2, twenty times the sigma of their noise: on a vehicle that moves
    /// the error of the rounding is uniform within a step. The noise is as stated with that error,
    /// six times the stated one without it.
    #[test]
    fn rounding_is_no_noise_of_the_sensor() {
        let found = |quantisation: Option<&str>, factor: f64| {
            let keys = json!({
                "accel_noise": "1e-3 m/s^2/sqrt(Hz)", "accel_quantisation": quantisation,
            });
            let (mut rule, mut random) = (Whiteness::new(&imu(&keys)), Uniform::new(1));
            (1..=24_000).any(|_| {
                let noise = random.vector(3_f64.sqrt() * 0.01);
                let f = (noise + random.vector(0.1)) * factor;
                rule.take(&Vector3::zeros(), &f, INTERVAL).is_some()
            })
        };
        assert!(found(None, 1.0) && !found(Some("0.2 m/s^2"), 1.0));
        assert!(found(Some("0.2 m/s^2"), 3.0));
    }

    /// Noise of which each sample contains half of the one before: its power at low frequencies is
    /// `1.5^2` of the white noise, that of its second differences `(1 + 1.5^2 + 0.5^2) / 6`, so that
    /// the variance of means falls 3.9 times less than it should.
    #[test]
    fn noise_of_another_colour_is_not_judged() {
        assert!(fault(alone(4, 10.0), 0.5).is_none());
    }

    /// The bound for means of two, of which there are 1024, is three times `sqrt(4 / 1024)`.
    #[test]
    fn noise_is_white_within_three_sigma_of_its_variance() {
        // sum of the squares of `n - 2` second differences at one level
        let level = |n: u32, variance: f64| Level {
            count: n,
            sum: 6.0 * f64::from(n - 2) * variance,
            ..Level::default()
        };
        let white = |ratio: f64| {
            is_white(&[
                level(2048, 1.0),
                level(1024, ratio / 2.0),
                level(512, 0.25),
                level(256, 0.125),
                level(128, 0.0625),
            ])
        };
        assert!(white(0.8126) && white(1.0) && white(1.1874));
        assert!(!white(0.8124) && !white(0.8125) && !white(1.1875) && !white(1.1876));
    }
}
