//! Times of the recorded epochs.

use navfuse_core::units::time::Time;

/// Selects the first epoch at or after each multiple of an interval.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    every: i64,
    last: Option<i64>,
}

impl Grid {
    /// Creates a grid with an interval in ns.
    pub fn new(every: i64) -> Self {
        Self { every: every.max(1), last: None }
    }

    /// Returns the number of the epoch if it is the first of its interval.
    pub fn due(&mut self, time: Time) -> Option<i64> {
        let number = time.nanos().div_euclid(self.every);
        (self.last.is_none_or(|last| number > last)).then(|| {
            self.last = Some(number);
            number
        })
    }

    /// Returns the number of an epoch that ends the run off the grid.
    pub fn end(&self) -> i64 {
        self.last.map_or(0, |last| last + 1)
    }
}

/// Returns the shortest round interval with at most `epochs` epochs: 1, 2 or 5 times a power of
/// ten, ns.
pub fn interval(duration: f64, epochs: f64) -> i64 {
    let least = (duration / epochs).max(1e-9);
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= least * (1.0 - 1e-9))
        .unwrap_or(10.0);
    ((factor * power * 1e9).round() as i64).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_round_and_gives_at_most_the_given_number_of_epochs() {
        for (duration, seconds) in
            [(1460.0, 5.0), (300.0, 1.0), (301.0, 2.0), (3000.0, 10.0), (0.3, 0.001)]
        {
            assert_eq!(interval(duration, 300.0), (seconds * 1e9) as i64, "{duration}");
        }
    }

    #[test]
    fn each_interval_gives_its_first_epoch() {
        let mut grid = Grid::new(5_000_000_000);
        let seen: Vec<Option<i64>> = [7.0, 9.9, 10.0, 12.0, 21.0]
            .map(|t| grid.due(Time::from_seconds(t).unwrap_or_default()))
            .to_vec();
        assert_eq!(seen, [Some(1), None, Some(2), None, Some(4)]);
        assert_eq!(grid.end(), 5);
    }
}
