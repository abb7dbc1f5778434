//! Shades in the plots of a sensor: the stretches in which its samples were refused.

use crate::columns::numbers;
use crate::recording::Recording;
use crate::style::Colour;
use navfuse_core::model::record::health::Stretch;
use navfuse_core::model::stream::StreamError;
use re_sdk::EntityPath;
use re_sdk_types::archetypes::SeriesLines;
use re_sdk_types::components::AggregationPolicy;

/// A span of time, ns.
type Span = (i64, i64);

/// Colour of the shades: dark, so that lines and marks before them stand out.
const SHADE: Colour = [74, 34, 66];
/// Number of strokes over the whole run: a plot is at most 1600 pixels wide.
const STROKES: f64 = 800.0;
/// Entity below that of a plot: the first one in their order, so that everything is drawn before it.
const LEAF: &str = "abandoned";
/// Width of a stroke, points.
const STROKE: f32 = 2.6;

/// The shades of a sensor.
#[derive(Debug, Default)]
pub struct Shades {
    spans: Vec<Span>,
    /// Length of the run, ns.
    run: i64,
}

/// The spans in which a sensor's samples were refused: those that follow each other as one.
fn refused(stretches: &[Stretch]) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for stretch in stretches.iter().filter(|s| s.health.refuses()) {
        let (from, to) = (stretch.from.nanos(), stretch.to.nanos());
        match spans.last_mut() {
            Some(last) if last.1 == from => last.1 = to,
            _ => spans.push((from, to)),
        }
    }
    spans
}

impl Shades {
    /// The shades of a sensor with those stretches, in a run of that length, ns.
    pub fn new(stretches: &[Stretch], run: i64) -> Self {
        Self { spans: refused(stretches), run }
    }

    /// Number of lines of a legend: one where there are shades.
    pub fn lines(&self) -> usize {
        usize::from(!self.spans.is_empty())
    }

    /// Shades a plot whose values have that range. The viewer draws no areas, so that each shade is a
    /// row of vertical strokes.
    pub fn write(
        &self,
        recording: &Recording,
        plot: &EntityPath,
        [low, high]: [f64; 2],
    ) -> Result<(), StreamError> {
        let reach = high - low;
        if self.spans.is_empty() || reach.is_nan() || reach <= 0.0 {
            return Ok(());
        }
        // the axis reaches beyond the range of the values
        let ends = [low - reach, high + reach];
        let (mut times, mut values) = (Vec::new(), Vec::new());
        let strokes = self.spans.iter().flat_map(|span| strokes(*span, self.run));
        for (k, at) in strokes.enumerate() {
            let [from, to] = if k % 2 == 0 { ends } else { [ends[1], ends[0]] };
            times.extend([at, at + 1, at + 2]);
            values.extend([from, to, f64::NAN]);
        }
        let look = SeriesLines::new()
            .with_names(["refused"])
            .with_colors([SHADE])
            .with_widths([STROKE])
            .with_aggregation_policy(AggregationPolicy::Off);
        let entity = plot.join(&EntityPath::from(LEAF));
        recording.log_static(&entity, &look)?;
        let column = numbers(&values, 1).map_err(|e| recording.error(e))?;
        recording.columns(&entity, &times, std::iter::once(column))
    }
}

/// The times of the strokes in a span.
fn strokes((from, to): Span, run: i64) -> impl Iterator<Item = i64> {
    let step = (run as f64 / STROKES).max(3.0);
    let count = ((to - from) as f64 / step).ceil().max(1.0) as i64;
    (0..=count).map(move |k| from + (to - from) * k / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use navfuse_core::model::record::health::Health;
    use navfuse_core::units::time::Time;

    #[test]
    fn a_shade_covers_the_refused_stretches_alone() {
        let stretch = |health, from: i64, to: i64| {
            let [from, to] = [from, to].map(|s| Time::from_nanos(s * 1_000_000_000));
            Stretch { health, from, to }
        };
        let stretches = [
            stretch(Health::Used, 0, 250),
            stretch(Health::Gated, 250, 280),
            stretch(Health::Isolated, 280, 312),
            stretch(Health::Doubted, 312, 500),
            stretch(Health::Rejected, 500, 501),
        ];
        let spans = refused(&stretches);
        assert_eq!(spans, [(250_000_000_000, 312_000_000_000), (500_000_000_000, 501_000_000_000)]);
        let times: Vec<i64> = strokes(spans[0], 630_000_000_000).collect();
        assert_eq!((times[0], times[times.len() - 1]), spans[0]);
        // 62 of 630 s are 79 of 800 strokes
        assert_eq!(times.len(), 80);
        assert_eq!(strokes(spans[1], 630_000_000_000).count(), 3);
    }
}
