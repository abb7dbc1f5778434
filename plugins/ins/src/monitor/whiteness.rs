//! Rule: the white noise of the IMU is as strong as stated.
//!
//! Second differences of means over `m` samples remove the motion. For white noise their variance
//! falls as `1/m`; vibration and motion follow another law, and are not judged here.

use super::Fault;
use crate::imu::Imu;
use nalgebra::Vector3;
use navfuse_core::model::finding::{Basis, Severity};

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

impl Whiteness {
    pub(super) fn new(imu: &Imu) -> Self {
        let (gyro, accel) = (imu.gyro_noise.value().si(), imu.accel_noise.value().si());
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
            },
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
