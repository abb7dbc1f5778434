//! The NIS of the latest accepted samples of a sensor together, and what is expected of it.

use crate::model::chi_square::gated_moments;
use crate::model::record::health::Judgement;
use std::collections::VecDeque;

/// Number of latest accepted samples whose NIS is judged together.
pub const LATEST: usize = 25;

/// The latest accepted samples.
#[derive(Clone, Debug, Default)]
pub struct Latest {
    samples: VecDeque<Sums>,
    /// Number of channels and bits of the threshold for which the moments were computed.
    moments: Option<((usize, u64), [f64; 2])>,
}

/// Sums over samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Number of samples.
    pub count: usize,
    /// Number of their channels.
    pub channels: usize,
    /// NIS.
    pub nis: f64,
    /// Expectation of the NIS behind the gate.
    pub mean: f64,
    /// Variance of the NIS behind the gate.
    pub variance: f64,
}

impl Latest {
    /// Takes an accepted sample; returns the sums over the latest ones, of which this is one.
    pub fn take(&mut self, innovation: &Judgement) -> Sums {
        let Judgement { channels, nis, threshold } = *innovation;
        let key = (channels, threshold.to_bits());
        let [mean, variance] = match self.moments {
            Some((of, moments)) if of == key => moments,
            _ => gated_moments(channels, threshold).into(),
        };
        self.moments = Some((key, [mean, variance]));
        if self.samples.len() == LATEST {
            self.samples.pop_front();
        }
        self.samples.push_back(Sums { count: 1, channels, nis, mean, variance });
        self.sums()
    }

    /// The sums over the latest samples.
    pub fn sums(&self) -> Sums {
        self.samples.iter().fold(Sums::default(), |a, b| Sums {
            count: a.count + b.count,
            channels: a.channels + b.channels,
            nis: a.nis + b.nis,
            mean: a.mean + b.mean,
            variance: a.variance + b.variance,
        })
    }
}
