//! Tabs that a program adds beside those of the run.

use crate::blueprint::Layout;
use crate::recording::Recording;
use navfuse_core::model::record::{Record, Wants};
use navfuse_core::model::stream::{RunInfo, StreamError};
use re_sdk::blueprint::ContainerLike;

/// A tab of its own: it follows the run, writes to the recording and adds a view to the layout.
///
/// A program hands its tabs to [`Rerun::record`](crate::Rerun::record), from a sink type of its own
/// where a scenario switches them on:
/// ```
/// use navfuse_core::prelude::*;
/// use navfuse_rerun::re_sdk::blueprint::ContainerLike;
/// use navfuse_rerun::{Layout, Range, Recording, Rerun, Series, Tab, style};
///
/// /// The trace of the covariance over time.
/// struct Trace {
///     series: Series,
///     range: Range,
/// }
///
/// impl Trace {
///     fn new() -> Self {
///         let line = ("trace".to_owned(), style::axis(0), 2.0);
///         let series = Series::lines(style::path(&["covariance", "trace"]), &[line]);
///         Self { series, range: Range::default() }
///     }
/// }
///
/// impl Tab for Trace {
///     fn wants(&self) -> Wants {
///         Wants::EPOCHS
///     }
///
///     fn take(&mut self, record: &Record<'_>, to: &Recording) -> Result<(), StreamError> {
///         let Record::Epoch(epoch) = record else { return Ok(()) };
///         let trace = (0..epoch.layout.tangent).map(|i| epoch.covariance.get(i, i)).sum();
///         self.range.include(trace);
///         self.series.push(to, epoch.state.time, &[trace])
///     }
///
///     fn flush(&mut self, to: &Recording) -> Result<(), StreamError> {
///         self.series.flush(to)
///     }
///
///     fn view(&self, layout: &mut Layout) -> Option<ContainerLike> {
///         let contents = [format!("+ {}", self.series.path)];
///         Some(layout.plot("Trace of P", &contents, self.range.axis()))
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let folder = tempfile::tempdir()?;
/// let sink = Rerun::default().record(folder.path(), vec![Box::new(Trace::new())])?;
/// # drop(sink);
/// # Ok(())
/// # }
/// ```
pub trait Tab: Send {
    /// Starts with a run.
    ///
    /// # Errors
    /// When the recording cannot be written. The run and its other sinks go on.
    fn start(&mut self, _run: &RunInfo, _recording: &Recording) -> Result<(), StreamError> {
        Ok(())
    }

    /// The records that the tab receives. The transitions and corrections of a repetition come to
    /// every tab that wants such records, if one tab wants repetitions.
    fn wants(&self) -> Wants {
        Wants::default()
    }

    /// Takes a record.
    ///
    /// # Errors
    /// When the recording cannot be written.
    fn take(&mut self, record: &Record<'_>, recording: &Recording) -> Result<(), StreamError>;

    /// Sends what the tab has buffered: at the end, and before it as often as a viewer is
    /// refreshed.
    ///
    /// # Errors
    /// When the recording cannot be written.
    fn flush(&mut self, _recording: &Recording) -> Result<(), StreamError> {
        Ok(())
    }

    /// Writes what is known at the end of the run; [`Tab::flush`] follows.
    ///
    /// # Errors
    /// When the recording cannot be written.
    fn finish(&mut self, _recording: &Recording) -> Result<(), StreamError> {
        Ok(())
    }

    /// The weight that the prior still has in the estimate of a component of a block, for a tab that follows
    /// it: zero where the samples determine the component, and one where nothing does.
    fn left(&self, _block: &str, _component: &str) -> Option<f64> {
        None
    }

    /// The view, once when the run starts and once when it is over; `None` leaves the tab out.
    fn view(&self, layout: &mut Layout) -> Option<ContainerLike>;
}
