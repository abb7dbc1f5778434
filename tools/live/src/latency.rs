//! Latency of a run: from the arrival of a sample to its estimate.

use std::time::Duration;

/// Classes of latency in a factor of ten.
const IN_DECADE: f64 = 20.0;
/// Upper end of the first class, s, and the number of classes: up to 100 s.
const FIRST: f64 = 1e-6;
const CLASSES: usize = 160;

/// Distribution of latencies, in classes that are 12 % wide.
#[derive(Clone, Debug)]
pub struct Latency {
    counts: [u64; CLASSES],
    largest: Duration,
}

impl Default for Latency {
    fn default() -> Self {
        Self { counts: [0; CLASSES], largest: Duration::ZERO }
    }
}

impl Latency {
    /// Takes the latency of a sample.
    pub fn take(&mut self, latency: Duration) {
        let class = ((latency.as_secs_f64() / FIRST).log10() * IN_DECADE).ceil();
        self.counts[(class.max(0.0) as usize).min(CLASSES - 1)] += 1;
        self.largest = self.largest.max(latency);
    }

    /// The largest latency.
    pub fn largest(&self) -> Duration {
        self.largest
    }

    /// The latency that this share of the samples does not exceed, rounded up to its class; zero
    /// without samples.
    pub fn quantile(&self, share: f64) -> Duration {
        let wanted = share * self.counts.iter().sum::<u64>() as f64;
        let mut passed = 0;
        let class = self.counts.iter().position(|count| {
            passed += count;
            passed > 0 && passed as f64 >= wanted
        });
        let end = |class| FIRST * 10_f64.powf(class as f64 / IN_DECADE);
        class.map_or(Duration::ZERO, |k| Duration::from_secs_f64(end(k)).min(self.largest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_within_a_class_of_the_exact_ones() {
        let mut latency = Latency::default();
        assert_eq!(latency.quantile(0.5), Duration::ZERO);
        (1..=1000).for_each(|k| latency.take(Duration::from_micros(k)));
        for (share, exact) in [(0.5, 500e-6), (0.99, 990e-6)] {
            let found = latency.quantile(share).as_secs_f64() / exact;
            assert!((1.0..1.13).contains(&found), "{share}: {found}");
        }
        assert_eq!(latency.quantile(1.0), Duration::from_millis(1));
        assert_eq!(latency.largest(), Duration::from_millis(1));
    }
}
