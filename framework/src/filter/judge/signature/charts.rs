//! Cumulative sums of the innovations, which show whether an error has begun (Page 1954).

use super::effect::Whitened;
use super::shift::{Place, Shift};
use crate::checkpoint::saved;
use crate::units::sample::channels;

/// Half of the shift that the cumulative sums find fastest, in the sigma of an innovation.
const SHIFT: f64 = 1.0;

/// Cumulative sum up to which no large error has begun: one that takes an innovation 3 sigma off exceeds it.
const NEAR: f64 = 2.0;

/// Cumulative sums of the innovations of a channel, one for each sign.
#[derive(Clone, Debug, Default)]
struct Chart {
    of: (usize, usize),
    up: f64,
    down: f64,
}

saved!(Chart { up, down } except { of });

impl Chart {
    fn zero(&self) -> bool {
        self.up == 0.0 && self.down == 0.0
    }
}

/// The sums of all channels that are compared.
#[derive(Clone, Debug, Default)]
pub(super) struct Charts {
    charts: Vec<Chart>,
}

saved!(Charts {} each { charts });

impl Charts {
    pub(super) fn new(axes: &[Shift]) -> Self {
        let chart = |axis: &Shift| match axis.place {
            Place::Channel(channel) => {
                Some(Chart { of: (axis.sensor, channel), ..Chart::default() })
            }
            Place::State(_) | Place::Drift(_) => None,
        };
        Self { charts: axes.iter().filter_map(chart).collect() }
    }

    /// Adds the innovations of a sample to the cumulative sums of their channels.
    pub(super) fn take(&mut self, (index, present): (usize, u16), sample: &Whitened<'_>) {
        let update = sample.update;
        for (row, channel) in channels(present).enumerate().take(update.m) {
            let e = update.innovation[row] / update.s[row * update.m + row].sqrt();
            if let Some(chart) = self.charts.iter_mut().find(|c| c.of == (index, channel)) {
                chart.up = (chart.up + e - SHIFT).max(0.0);
                chart.down = (chart.down - e - SHIFT).max(0.0);
            }
        }
    }

    /// Returns `true` if all sums are at zero: no error has begun that is larger than their sigma.
    pub(super) fn quiet(&self) -> bool {
        self.charts.iter().all(Chart::zero)
    }

    /// Returns `true` if no sum shows a large error: that begins with samples which are not far off.
    pub(super) fn near(&self) -> bool {
        self.charts.iter().all(|chart| chart.up.max(chart.down) <= NEAR)
    }

    /// Returns `true` if the sums of a channel of a sensor are at zero.
    pub(super) fn still(&self, of: (usize, usize)) -> bool {
        self.charts.iter().filter(|chart| chart.of == of).all(Chart::zero)
    }
}
