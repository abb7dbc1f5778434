//! Propagation of an error that a sensor measured: what is left of it tells whether the filter or the sensor
//! is wrong.

use super::Covariance;
use super::update::{Update, forward};
use crate::checkpoint::saved;
use crate::units::sample::{MAX_CHANNELS, channels};
use nalgebra::DMatrix;

/// Propagation of an error that a sensor measured at one time: `G`, one row per state; empty when
/// none is followed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reach {
    /// Channels that measured the error, one bit each.
    pub(super) channels: u16,
    /// Length of a row: the number of channels, padded to a multiple of four.
    pub(super) stride: usize,
    pub(super) g: Vec<f64>,
    /// Innovation `y0` that showed the error, by channel, and the part of it that an error of the
    /// states explains.
    pub(super) first: [f64; MAX_CHANNELS],
    pub(super) explained: [f64; MAX_CHANNELS],
}

saved!(Reach { channels, stride, g, first, explained });

impl Reach {
    /// Creates room for an error state of dimension `n` and up to `m` channels.
    pub(crate) fn with_capacity(n: usize, m: usize) -> Self {
        Self { g: Vec::with_capacity(n * m.next_multiple_of(4)), ..Self::default() }
    }

    /// Follows an offset of some channels of a sensor, which has not changed a state yet.
    pub(crate) fn of_offset(n: usize, channels: u16) -> Self {
        let stride = (channels.count_ones() as usize).next_multiple_of(4);
        Self { channels, stride, g: vec![0.0; n * stride], ..Self::default() }
    }

    /// Channels that measured the error, or are offset, one bit each.
    pub(crate) fn channels(&self) -> u16 {
        self.channels
    }

    /// `P = P + G A G'`: the error grows by random multiples of the columns of `G`, with the moments `A`.
    pub(crate) fn widen(&self, covariance: &mut Covariance, moments: &DMatrix<f64>) {
        let columns = self.channels.count_ones() as usize;
        let rows = || self.g.chunks_exact(self.stride.max(1)).map(|row| &row[..columns]);
        for (i, row) in rows().enumerate() {
            let mut own = [0.0; MAX_CHANNELS];
            for (own, column) in own.iter_mut().zip(moments.column_iter()) {
                *own = row.iter().zip(column.iter()).map(|(g, a)| g * a).sum();
            }
            for (j, other) in rows().enumerate() {
                let sum: f64 = own.iter().zip(other).map(|(own, g)| own * g).sum();
                covariance.p[i * covariance.stride + j] += sum;
            }
        }
        covariance.symmetrise();
    }

    /// `G y`.
    pub(crate) fn times(&self, y: &[f64]) -> Vec<f64> {
        let rows = self.g.chunks_exact(self.stride.max(1));
        rows.map(|row| row.iter().zip(y).map(|(g, y)| g * y).sum()).collect()
    }

    /// Keeps the innovation of some channels as one to compare with, and follows no error.
    pub(crate) fn remember(&mut self, channels: u16, innovation: &[f64]) {
        self.end();
        self.channels = channels;
        self::channels(channels).zip(innovation).for_each(|(c, y)| self.first[c] = *y);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.g.is_empty()
    }

    /// Ends the propagation, and keeps the innovation.
    pub(crate) fn end(&mut self) {
        self.g.clear();
    }

    /// Forgets the error.
    pub(crate) fn clear(&mut self) {
        self.g.clear();
        self.channels = 0;
    }
}

impl Update {
    /// Begins to follow the propagation of a measured error; follows none where there is no
    /// direction. Call after [`Self::innovate`], and before the next call of it.
    pub(crate) fn begin(
        &mut self,
        covariance: &Covariance,
        considered: &[bool],
        present: u16,
        reach: &mut Reach,
    ) {
        reach.clear();
        if !self.direction(covariance, considered) {
            return;
        }
        (reach.channels, reach.stride) = (present, self.m.next_multiple_of(4));
        channels(present).zip(&self.innovation).for_each(|(c, y)| reach.first[c] = *y);
        reach.g.resize(covariance.n * reach.stride, 0.0);
        for (c, row) in self.columns.iter().zip(self.l.chunks_exact(self.m)) {
            reach.g[c * reach.stride..][..self.m].copy_from_slice(row);
        }
        let mut explained = [0.0; MAX_CHANNELS];
        self.left(reach, &reach.first, &mut explained[..self.m]);
        channels(present).zip(explained).for_each(|(c, y)| reach.explained[c] = y);
    }

    /// Square of `sum y y0 / sum y0^2` over the channels that the first innovation `y0` has too, each in
    /// units of its sigma: the share of the error that is still there. Zero without a common channel, or where
    /// the error has changed its sign. Call after [`Self::innovate`].
    pub(crate) fn share(&self, present: u16, reach: &Reach) -> f64 {
        let (mut now, mut first) = (0.0, 0.0);
        for (a, channel) in channels(present).enumerate().take(self.m) {
            if reach.channels >> channel & 1 == 1 {
                let variance = self.s[a * self.m + a];
                now += self.innovation[a] * reach.first[channel] / variance;
                first += reach.first[channel] * reach.first[channel] / variance;
            }
        }
        if first > 0.0 { f64::max(now / first, 0.0).powi(2) } else { 0.0 }
    }

    /// Squares of the change of the innovation since the first one, and of that one, in units of the
    /// sigma of each common channel, and the number of channels. Call after [`Self::innovate`].
    pub(crate) fn changed(&self, present: u16, reach: &Reach) -> ([f64; 2], usize) {
        let rows = channels(present).enumerate().take(self.m);
        let common = rows.filter(|(_, channel)| reach.channels >> channel & 1 == 1);
        common.fold(([0.0; 2], 0), |([changes, sizes], count), (a, channel)| {
            let (first, s) = (reach.first[channel], self.s[a * self.m + a]);
            let change = self.innovation[a] - first;
            ([changes + change * change / s, sizes + first * first / s], count + 1)
        })
    }

    /// Square of `H G y0` relative to its value at the beginning, in the metric of `S`. `H G y0` is
    /// the innovation that would be left of the first one if the filter had been wrong: motion and
    /// updates by other sensors have changed that error. `None` if other channels are present now.
    /// Call after [`Self::innovate`].
    pub(crate) fn remaining(&self, present: u16, reach: &Reach) -> Option<f64> {
        if reach.g.is_empty() || reach.channels != present {
            return None;
        }
        let m = self.m;
        let (mut first, mut left) = ([0.0; MAX_CHANNELS], [0.0; MAX_CHANNELS]);
        channels(present).zip(&mut first).for_each(|(c, y)| *y = reach.explained[c]);
        self.left(reach, &reach.first, &mut left[..m]);
        let nis = |y: &mut [f64]| {
            forward(&self.lower, m, y);
            y.iter().map(|y| y * y).sum::<f64>()
        };
        Some(nis(&mut left[..m]) / nis(&mut first[..m]))
    }

    /// As [`Self::remaining`] for some channels alone, each in units of its sigma. `None` where the first
    /// innovation lacks them.
    pub(crate) fn remaining_of(&self, present: u16, reach: &Reach, group: u16) -> Option<f64> {
        if reach.g.is_empty() || reach.channels & group != present & group {
            return None;
        }
        let mut left = [0.0; MAX_CHANNELS];
        self.left(reach, &reach.first, &mut left[..self.m]);
        let rows = channels(present).enumerate().take(self.m);
        let rows = rows.filter(|(_, channel)| group >> channel & 1 == 1);
        let squares = rows.fold([0.0; 2], |[now, first], (a, channel)| {
            let variance = self.s[a * self.m + a];
            let explained = reach.explained[channel];
            [now + left[a] * left[a] / variance, first + explained * explained / variance]
        });
        Some(squares[0] / squares[1])
    }

    /// `N`, row-major `n` x `m`: the rows of `K = G (H G)^-1`, so that `H K = 1`, of the states
    /// that the sensor does not measure now, and zero for the others. Empty if the sensor measures
    /// too little of the error that it measured at the beginning.
    pub(crate) fn unseen(&self, considered: &[bool], channels: u16, reach: &Reach) -> Vec<f64> {
        let (m, w) = (self.m, self.columns.len());
        if reach.g.is_empty() || reach.channels != channels {
            return Vec::new();
        }
        let hg = DMatrix::from_fn(m, m, |a, b| self.seen(reach, a, b));
        // in units of each channel's sigma, at least a tenth of the error must still be measured
        let sigma = |a: usize| self.s[a * m + a].sqrt();
        let usable = |back: &DMatrix<f64>| {
            (0..m * m).all(|k| (back[(k / m, k % m)] * sigma(k % m) / sigma(k / m)).abs() <= 10.0)
        };
        let Some(back) = hg.try_inverse().filter(usable) else { return Vec::new() };
        let sees = |i: usize| {
            self.columns
                .iter()
                .position(|&c| c == i)
                .is_some_and(|k| (0..m).any(|a| self.h[a * w + k] != 0.0))
        };
        let mut rows = Vec::with_capacity(considered.len() * m);
        for (i, g) in reach.g.chunks_exact(reach.stride).enumerate() {
            let skip = considered[i] || sees(i);
            let share =
                |b: usize| if skip { 0.0 } else { (0..m).map(|a| g[a] * back[(a, b)]).sum() };
            rows.extend((0..m).map(share));
        }
        rows
    }

    /// `G = (I - K H) G`: an update by another sensor changes that error too. Call after
    /// [`Self::apply`].
    pub(crate) fn correct(&self, reach: &mut Reach) {
        let seen = self.seen_of_offset(reach, 0, 0);
        self.correct_for(reach, &seen);
    }

    /// `H G + D` for an offset: `D` is one where a channel of the sample is offset itself.
    pub(crate) fn seen_of_offset(&self, reach: &Reach, present: u16, own: u16) -> DMatrix<f64> {
        let columns = reach.channels.count_ones() as usize;
        let mut seen = DMatrix::from_fn(self.m, columns, |a, b| self.seen(reach, a, b));
        for (a, channel) in channels(present).enumerate().take(self.m) {
            let offset = channels(reach.channels & own).find(|offset| *offset == channel);
            if let Some(b) = offset.and_then(|c| channels(reach.channels).position(|k| k == c)) {
                seen[(a, b)] += 1.0;
            }
        }
        seen
    }

    /// `G = G - K T`, with `T` of [`Self::seen_of_offset`]. Call after [`Self::apply`].
    pub(crate) fn correct_for(&self, reach: &mut Reach, seen: &DMatrix<f64>) {
        let rows = reach.g.chunks_exact_mut(reach.stride.max(1));
        for (row, gain) in rows.zip(self.gain.chunks_exact(self.m)) {
            for (g, seen) in row.iter_mut().zip(seen.column_iter()) {
                *g -= gain.iter().zip(seen.iter()).map(|(k, t)| k * t).sum::<f64>();
            }
        }
    }

    /// Computes `H G y0` into `out`, with `y0` by channel.
    pub(super) fn left(&self, reach: &Reach, first: &[f64; MAX_CHANNELS], out: &mut [f64]) {
        for (a, out) in out.iter_mut().enumerate() {
            let parts = channels(reach.channels).enumerate();
            *out = parts.map(|(b, c)| self.seen(reach, a, b) * first[c]).sum();
        }
    }

    /// The element `(a, b)` of `H G`.
    pub(super) fn seen(&self, reach: &Reach, a: usize, b: usize) -> f64 {
        let h = &self.h[a * self.columns.len()..];
        self.columns.iter().zip(h).map(|(c, h)| h * reach.g[c * reach.stride + b]).sum()
    }
}
