//! The range of the vertical axis of a plot while the run goes on. The viewer takes it from the lines, and an
//! axis between two powers of ten shows the number of zero alone. So two invisible lines are at the ends of a
//! range whose ticks have numbers.

use crate::axis;
use navfuse_core::units::time::Time;

/// Height of the lowest plots of a run that goes on, in a usual window (1600x1000), pixels.
const PIXELS: f64 = 176.0;
/// Time for which a value counts at least, and at most twice as long, s. The two lines stay in view for the time
/// that the plots show: longer times would keep ranges of values that have left the plot.
const LASTS: f64 = 30.0;
/// Height of what is kept free for the legend above the lines, as a share of their own height.
const LEGEND: f64 = 0.4;
/// The range of no value.
const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// The ranges of the latest values, and of those before.
#[derive(Clone, Copy, Debug)]
pub struct Guides {
    latest: [f64; 2],
    before: [f64; 2],
    begun: Option<Time>,
}

impl Default for Guides {
    fn default() -> Self {
        Self { latest: NOTHING, before: NOTHING, begun: None }
    }
}

impl Guides {
    /// Takes the values of a time, and returns the places of the two lines.
    pub fn take(&mut self, time: Time, values: &[f64]) -> [f64; 2] {
        let begun = *self.begun.get_or_insert(time);
        if time.since(begun) > LASTS {
            (self.before, self.latest, self.begun) = (self.latest, NOTHING, Some(time));
        }
        for value in values.iter().filter(|value| value.is_finite()) {
            self.latest = [self.latest[0].min(*value), self.latest[1].max(*value)];
        }
        let [low, high] = [self.latest[0].min(self.before[0]), self.latest[1].max(self.before[1])];
        let high = high + LEGEND * (high - low);
        if low <= high { axis::range(low, high, PIXELS) } else { [f64::NAN; 2] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{TICKS, ticks};

    #[test]
    fn the_axis_of_a_run_that_goes_on_has_three_numbers_and_forgets() {
        let mut guides = Guides::default();
        let at = |seconds: i64| Time::from_nanos(seconds * 1_000_000_000);
        // 0.4 in 176 pixels has one number, that of zero
        assert_eq!(ticks([-0.4, 0.4], PIXELS), 1);
        let wide = guides.take(at(0), &[7.0, f64::NAN]);
        assert!(wide[0] < 7.0 && wide[1] > 7.0 && ticks(wide, PIXELS) >= TICKS, "{wide:?}");
        for k in 1..=100 {
            let range = guides.take(at(k), &[0.1, 0.4, -0.4]);
            assert!(ticks(range, PIXELS) >= TICKS && range[0] <= -0.4, "{k}: {range:?}");
            // the legend has room above the lines
            assert!(range[1] >= 0.4 + LEGEND * 0.8, "{k}: {range:?}");
            assert_eq!(range[1] > 7.0, k <= 61, "{k}: {range:?}");
        }
    }
}
