//! Buffers of dense series, sent in blocks of columns: 40 ns a value, where row by row takes 5 us.

use crate::guides::Guides;
use crate::history::Gaps;
use crate::recording::Recording;
use crate::style::{BOUND, Colour};
use navfuse_core::model::record::health::Health;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::thin::{Merge, Thin};
use navfuse_core::units::time::Time;
use re_sdk::{
    AsComponents, ComponentDescriptor, EntityPath, SerializationResult, SerializedComponentBatch,
    SerializedComponentColumn,
};
use re_sdk_types::archetypes::{Scalars, SeriesLines, SeriesPoints};
use re_sdk_types::components::{Color, MarkerShape};
use re_sdk_types::external::arrow::array::Float32Array;
use std::sync::Arc;

/// Number of rows of one block: the size to which the viewer compacts its own blocks.
pub const ROWS: usize = 4096;

/// The round times from which the viewer counts the ticks of a run that goes on, ns: as far apart as the
/// ticks of the latest five minutes.
const ROUND: i64 = 100_000_000_000;

/// The name of bounds of 3 sigma.
pub const BOUNDS: &str = "±3σ";

/// The scalars of one entity over time, one column per instance.
pub struct Series {
    /// The entity.
    pub path: EntityPath,
    width: usize,
    times: Vec<i64>,
    values: Vec<f64>,
    style: Option<Box<dyn AsComponents + Send>>,
    jump: f64,
    last: f64,
    for_viewers: bool,
    /// Set for lines, and not for marks.
    line: bool,
    /// Finds outages, in which the lines break.
    gaps: Option<Gaps>,
    /// The lines that give the vertical axis its range while the run goes on.
    guides: Option<Guides>,
}

impl Series {
    fn new(path: EntityPath, width: usize, style: impl AsComponents + Send + 'static) -> Self {
        let style: Box<dyn AsComponents + Send> = Box::new(style);
        let (times, values) = (Vec::new(), Vec::new());
        let (style, jump, last) = (Some(style), f64::INFINITY, f64::NAN);
        let (for_viewers, line, gaps, guides) = (false, true, None, None);
        Self { path, width, times, values, style, jump, last, for_viewers, line, gaps, guides }
    }

    /// A series of lines, each with a name, a colour and a stroke width.
    pub fn lines(path: EntityPath, lines: &[(String, Colour, f32)]) -> Self {
        let style = SeriesLines::new()
            .with_names(lines.iter().map(|l| l.0.as_str()))
            .with_colors(lines.iter().map(|l| l.1))
            .with_widths(lines.iter().map(|l| l.2));
        Self::new(path, lines.len(), style)
    }

    /// A series of a line and its bounds of 3 sigma.
    pub fn bounded(path: EntityPath, name: String, colour: Colour, width: f32) -> Self {
        Self::between(path, (name, colour, width), (BOUNDS, BOUND))
    }

    /// A series of a line and its two bounds, which share a name and with it a line of the legend.
    pub fn between(
        path: EntityPath,
        line: (String, Colour, f32),
        (bounds, colour): (&str, Colour),
    ) -> Self {
        let bound = || (bounds.to_owned(), colour, 1.2);
        Self::lines(path, &[line, bound(), bound()])
    }

    /// A series of points.
    pub fn points(path: EntityPath, name: &str, colour: Colour, size: f32) -> Self {
        Self::marked(path, name, colour, size, MarkerShape::Circle)
    }

    /// A series of points with a marker.
    pub fn marked(
        path: EntityPath,
        name: &str,
        colour: Colour,
        size: f32,
        marker: MarkerShape,
    ) -> Self {
        let style = SeriesPoints::new()
            .with_names([name])
            .with_colors([colour])
            .with_markers([marker])
            .with_marker_sizes([size]);
        Self { line: false, ..Self::new(path, 1, style) }
    }

    /// A series of a line and its bounds of 3 sigma for the viewers that watch the run, and not for the
    /// file. The lines break where rows are missing for longer than usual.
    pub fn live(path: EntityPath, name: &str, [r, g, b]: Colour, width: f32) -> Self {
        // lines without a width, which share the line of the bounds in the legend, give the axis its range
        let names = [name, BOUNDS, BOUNDS, BOUNDS, BOUNDS];
        let [own, of_bound] = [[r, g, b], BOUND].map(|[r, g, b]| Color::from_rgb(r, g, b));
        let style = SeriesLines::new()
            .with_names(names)
            .with_colors([own, of_bound, of_bound, of_bound, of_bound])
            .with_widths([width, 1.2, 1.2, 0.0, 0.0]);
        let series = Self::new(path, names.len(), style);
        let (gaps, guides) = (Some(Gaps::default()), Some(Guides::default()));
        Self { for_viewers: true, gaps, guides, ..series }
    }

    /// A thick line at zero while a sensor is silent, for the viewers that watch the run.
    pub fn silence(path: EntityPath) -> Self {
        let [r, g, b] = Health::Silent.colour();
        let style = SeriesLines::new()
            .with_names(["silent: no samples"])
            .with_colors([Color::from_rgb(r, g, b)])
            .with_widths([5.0]);
        Self { for_viewers: true, ..Self::new(path, 1, style) }
    }

    /// Breaks the lines where the first value jumps by more than `jump`, so that an angle that
    /// wraps draws no line across the plot.
    pub fn broken_at(mut self, jump: f64) -> Self {
        self.jump = jump;
        self
    }

    /// Adds a row with one value for each line.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn push(
        &mut self,
        recording: &Recording,
        time: Time,
        values: &[f64],
    ) -> Result<(), StreamError> {
        let guides = self.guides.as_mut().map(|guides| guides.take(time, values));
        debug_assert_eq!(values.len() + guides.map_or(0, |guides| guides.len()), self.width);
        let jump = ((values[0] - self.last).abs() > self.jump).then(|| time.nanos() - 1);
        let outage = self.gaps.as_mut().and_then(|gaps| gaps.after(time));
        if let Some(at) = outage.or(jump) {
            self.times.push(at);
            self.values.extend(std::iter::repeat_n(f64::NAN, self.width));
        }
        self.last = values[0];
        self.times.push(time.nanos());
        self.values.extend_from_slice(values);
        self.values.extend(guides.into_iter().flatten());
        if self.times.len() >= ROWS { self.flush(recording) } else { Ok(()) }
    }

    /// Sends the buffered rows; names and colours go before the first block.
    ///
    /// # Errors
    /// When the recording cannot be written.
    pub fn flush(&mut self, recording: &Recording) -> Result<(), StreamError> {
        if self.times.is_empty() {
            return Ok(());
        }
        if let Some(style) = self.style.take() {
            // the viewer counts its ticks from the first time of a plot
            let origin = match self.for_viewers {
                true => Some(self.times[0].div_euclid(ROUND) * ROUND),
                false => recording.origin(),
            };
            if let Some(origin) = origin.filter(|origin| self.line && *origin < self.times[0]) {
                self.times.insert(0, origin);
                self.values.splice(..0, std::iter::repeat_n(f64::NAN, self.width));
            }
            if self.for_viewers {
                recording.log_static_to_viewers(&self.path, style.as_ref())?;
            } else {
                recording.log_static(&self.path, style.as_ref())?;
            }
        }
        let columns = numbers(&self.values, self.width).map_err(|e| recording.error(e))?;
        let columns = std::iter::once(columns);
        if self.for_viewers {
            recording.columns_to_viewers(&self.path, &self.times, columns)?;
        } else {
            recording.columns(&self.path, &self.times, columns)?;
        }
        self.times.clear();
        self.values.clear();
        Ok(())
    }
}

/// The column of rows of that many values each: half the bytes of the archetype's own type, and more digits
/// than a plot has pixels.
pub(crate) fn numbers(
    values: &[f64],
    width: usize,
) -> SerializationResult<SerializedComponentColumn> {
    let rows = std::iter::repeat_n(width, values.len() / width.max(1));
    let values = Float32Array::from_iter_values(values.iter().map(|value| *value as f32));
    let numbers = ComponentDescriptor { component_type: None, ..Scalars::descriptor_scalars() };
    SerializedComponentBatch::new(Arc::new(values), numbers).partitioned(rows)
}

/// A thinned sequence of unknown length: every n-th item and the last.
#[derive(Debug)]
pub struct Thinned<T> {
    items: Thin<First<T>>,
    last: Option<T>,
}

/// The first of the items that a row represents.
#[derive(Debug)]
struct First<T>(T);

impl<T> Merge for First<T> {
    fn merge(&mut self, _: Self) {}
}

impl<T: Copy> Thinned<T> {
    /// Creates a sequence that keeps at most `capacity` items and the last.
    pub fn new(capacity: usize) -> Self {
        Self { items: Thin::with_rows(capacity), last: None }
    }

    /// Adds an item.
    pub fn push(&mut self, item: T) {
        self.items.push(First(item));
        self.last = Some(item).filter(|_| self.items.last() > 1);
    }

    /// The items that remain, in order.
    pub fn iter(&self) -> impl Iterator<Item = T> + '_ {
        self.items.rows().iter().map(|first| first.0).chain(self.last)
    }

    /// The number of items that remain.
    pub fn len(&self) -> usize {
        self.items.rows().len() + usize::from(self.last.is_some())
    }
}

/// The range of a plot: that of the line, and that of its bounds once they have begun to converge.
#[derive(Debug)]
pub struct Range {
    low: f64,
    high: f64,
    bounds: Thinned<[f64; 2]>,
}

impl Default for Range {
    fn default() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY, bounds: Thinned::new(256) }
    }
}

impl Range {
    /// Adds a point of the line.
    pub fn include(&mut self, value: f64) {
        // min and max ignore NaN
        self.low = self.low.min(value);
        self.high = self.high.max(value);
    }

    /// Adds a lower and an upper bound.
    pub fn bound(&mut self, low: f64, high: f64) {
        self.bounds.push([low, high]);
    }

    /// The range with a margin. The bounds of the first tenth do not count, so that a wide prior
    /// does not flatten the rest of the plot.
    pub fn axis(&self) -> Option<[f64; 2]> {
        let later = self.bounds.iter().skip(self.bounds.len() / 10);
        let (low, high) = later.fold((self.low, self.high), |(l, h), [a, b]| (l.min(a), h.max(b)));
        let margin = 0.06 * (high - low);
        (low.is_finite() && high.is_finite() && margin > 0.0)
            .then_some([low - margin, high + margin])
    }
}
