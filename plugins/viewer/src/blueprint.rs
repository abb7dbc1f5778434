//! A layout under construction: views with the properties that the builder of the viewer's library
//! does not set.

use crate::axis;
use crate::corner::Place;
use crate::legend::{CLOCK, WATCHED_CLOCK};
use crate::recording::{APPLICATION, Axis, SECONDS, TIMELINE};
use crate::style::path;
use crate::time_axis::end_of_axis;
use re_sdk::blueprint::components::{Corner2D, PanelState, PlayState, ViewClass};
use re_sdk::blueprint::{
    BarChartView, Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, SelectionPanel,
    TextLogView, TimePanel, TimeSeriesView,
};
use re_sdk::log::{Chunk, LogMsg};
use re_sdk::{AsComponents, EntityPath, RecordingStreamBuilder, RecordingStreamResult, StoreKind};
use re_sdk_types::blueprint::archetypes::{
    PlotLegend, ScalarAxis, TextLogColumns, TimeAxis, ViewBlueprint,
};
use re_sdk_types::blueprint::components::{LinkAxis, TextLogColumn, TimelineColumn};
use re_sdk_types::blueprint::datatypes::{self, TextLogColumnKind};
use re_sdk_types::datatypes::{TimeInt, TimeRange, TimeRangeBoundary};

/// Height of a window at 1600x1000 without its panels and two bars of tabs, pixels.
const WINDOW: f64 = 890.0;
/// Height of a plot's title and of its time axis, pixels.
pub const FRAME: f64 = 46.0;

/// Width of a window, of a letter of a title, and of the icons beside it, pixels.
const TITLES: [f64; 3] = [1600.0, 7.0, 120.0];

/// The timeline of layouts.
const BLUEPRINT: &str = "blueprint";

/// Entity of the view whose time axis all linked views share; viewers have its id built in.
const ALL_VIEWS: &str = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc";

/// The message without the time at which it was written, and without an origin at the root, which is the viewer's
/// default: each takes an eighth of the bytes of a layout.
fn slim(message: LogMsg) -> RecordingStreamResult<LogMsg> {
    Ok(match message {
        LogMsg::ArrowMsg(store, message) => {
            let mut chunk = Chunk::from_arrow_msg(&message)?.timeline_sliced(BLUEPRINT.into());
            let origin = ViewBlueprint::descriptor_space_origin().component;
            let origins = chunk.iter_slices::<String>(origin);
            if origins.flatten().all(|path| path.as_str() == "/") {
                chunk = chunk.component_dropped(origin);
            }
            LogMsg::ArrowMsg(store, chunk.to_arrow_msg()?)
        }
        other => other,
    })
}

/// The height of a plot that has that many plots in its column, at 1600x1000.
pub fn height(rows: usize) -> f64 {
    WINDOW / rows.max(1) as f64 - FRAME
}

/// A layout under construction.
///
/// The builder of this version of the viewer's library sets no properties of views, so the layout
/// logs them beside the views.
pub struct Layout {
    properties: Vec<(EntityPath, Box<dyn AsComponents>)>,
    /// Set where the plots' ranges are known.
    pub(crate) ranges: bool,
    /// The number of plots above one another, from which follows which ticks have numbers.
    pub rows: usize,
    /// Set where the titles of plots end with their time.
    pub(crate) timed: bool,
    /// The number of plots beside one another, from which follows how long their titles are.
    pub(crate) columns: usize,
    /// The time of the run, ns, where it is known: the plots' horizontal axis.
    pub span: Option<(i64, i64)>,
    /// Length of the latest time that plots show of a run that goes on, ns; they then follow
    /// the cursor.
    pub(crate) latest: Option<i64>,
    /// The timeline of the plots.
    pub axis: Axis,
    /// Gives the next plots a legend.
    pub legend: bool,
    /// The corner of the legend.
    pub corner: Corner2D,
}

impl Layout {
    /// A layout without views; with `ranges` where the plots' ranges are known.
    pub fn new(ranges: bool) -> Self {
        let (legend, corner) = (true, Corner2D::RightTop);
        let mut properties: Vec<(EntityPath, Box<dyn AsComponents>)> = Vec::new();
        if !ranges {
            // viewers since 0.41 show 30 s around the cursor where linked views have no range
            let whole = TimeAxis::new().with_view_range(TimeRange {
                start: TimeRangeBoundary::Infinite,
                end: TimeRangeBoundary::Infinite,
            });
            properties.push((format!("{ALL_VIEWS}/TimeAxis").into(), Box::new(whole)));
        }
        let (span, latest, timed, axis) = (None, None, false, Axis::default());
        Self { properties, ranges, timed, rows: 3, columns: 4, span, latest, axis, legend, corner }
    }

    /// The messages of the layout with that container around all views.
    ///
    /// # Errors
    /// When the viewer's library cannot encode the layout.
    pub fn messages(self, root: ContainerLike) -> RecordingStreamResult<Vec<LogMsg>> {
        let time = TimePanel::new()
            .with_timeline(self.axis.timeline())
            .with_state(PanelState::Collapsed)
            // the cursor stands at the end, of a finished run too
            .with_play_state(PlayState::Following);
        let blueprint = Blueprint::new(root)
            .with_auto_views(false)
            .with_auto_layout(false)
            .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
            .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
            .with_time_panel(time);
        let (carrier, stored) = RecordingStreamBuilder::new(APPLICATION).enabled(true).memory()?;
        blueprint.send(&carrier, BlueprintActivation::default())?;
        let of_layout = |m: &LogMsg| {
            m.store_id().kind() == StoreKind::Blueprint
                && !matches!(m, LogMsg::BlueprintActivationCommand(_))
        };
        let mut messages: Vec<LogMsg> = stored.take().into_iter().filter(of_layout).collect();
        if let Some(id) = messages.first().map(|m| m.store_id().clone()) {
            let (stream, stored) =
                RecordingStreamBuilder::from_store_id(&id).enabled(true).memory()?;
            stream.set_time_sequence(BLUEPRINT, 0);
            for (path, property) in &self.properties {
                stream.log(path.clone(), property.as_ref())?;
            }
            messages
                .extend(stored.take().into_iter().filter(|m| matches!(m, LogMsg::ArrowMsg(..))));
        }
        messages.into_iter().map(slim).collect()
    }

    /// Gives the next plot a legend where that covers no line, and one that `needs` it in any case: returns
    /// the range of a plot of that many pixels with room for it.
    pub(crate) fn legend_at(
        &mut self,
        place: &Place,
        needs: bool,
        (range, pixels): ([f64; 2], f64),
    ) -> [f64; 2] {
        (self.legend, self.corner) = (needs || place.free, place.corner);
        if needs { place.room(range, pixels) } else { range }
    }

    /// The name of a plot with its time: the viewer's axis has numbers without a unit.
    fn timed(&self, name: &str, start: Option<i64>) -> String {
        let seconds = |nanos: i64| format!("{:.0}", nanos as f64 * 1e-9);
        let timed = match (self.latest, self.span.filter(|_| self.timed)) {
            (Some(latest), _) => format!("{name}, last {} s", seconds(latest)),
            (_, Some((first, last))) => {
                format!("{name}, {}–{} s", seconds(start.unwrap_or(first)), seconds(last))
            }
            _ => name.to_owned(),
        };
        let [window, letter, icons] = TITLES;
        let needed = letter * timed.chars().count() as f64 + icons;
        if needed <= window / self.columns as f64 { timed } else { name.to_owned() }
    }

    /// A plot of those entities over the whole run. Its vertical axis has at least the range, and
    /// three ticks with numbers.
    pub fn plot(
        &mut self,
        name: &str,
        contents: &[String],
        range: Option<[f64; 2]>,
    ) -> ContainerLike {
        self.plot_of(name, contents, range, None, height(self.rows))
    }

    /// The same for the time from `start` on, ns, or from the begin; the plot is that many pixels
    /// high.
    pub(crate) fn plot_of(
        &mut self,
        name: &str,
        contents: &[String],
        range: Option<[f64; 2]>,
        start: Option<i64>,
        pixels: f64,
    ) -> ContainerLike {
        let view = TimeSeriesView::new(self.timed(name, start)).with_origin("/");
        let view = ContainerLike::from(view.with_contents(contents));
        let range_of_time = self.range_of_time(start);
        self.set(&view, "TimeAxis", TimeAxis::new().with_view_range(range_of_time));
        // the viewer's own corner is another one in each version
        let legend = match self.legend {
            true => PlotLegend::new().with_corner(self.corner),
            false => PlotLegend::new().with_visible(false),
        };
        self.set(&view, "PlotLegend", legend);
        if let Some([low, high]) = range.filter(|_| self.ranges) {
            let range = axis::range(low, high, pixels);
            self.set(&view, "ScalarAxis", ScalarAxis::new().with_range(range));
        }
        view
    }

    /// The time that a plot shows: from `start` on, ns, or the whole run, or the latest time.
    fn range_of_time(&self, start: Option<i64>) -> TimeRange {
        if let Some(latest) = self.latest {
            let relative = |time| TimeRangeBoundary::CursorRelative(TimeInt(self.axis.time(time)));
            return TimeRange { start: relative(-latest), end: relative(0) };
        }
        let bound = |time: Option<i64>| {
            time.map_or(TimeRangeBoundary::Infinite, |t| TimeRangeBoundary::Absolute(TimeInt(t)))
        };
        let start = start.or(self.span.map(|s| s.0));
        let end = start.zip(self.span).map(|(start, span)| end_of_axis(start, span.1));
        let [start, end] = [start, end].map(|time| time.map(|nanos| self.axis.time(nanos)));
        TimeRange { start: bound(start), end: bound(end) }
    }

    /// One lane over time for each of those entities, which have states instead of numbers.
    pub fn lanes(&mut self, name: &str, contents: &[String]) -> ContainerLike {
        let view =
            ContainerLike::from(TimeSeriesView::new(name).with_origin("/").with_contents(contents));
        if let ContainerLike::View(view) = &view {
            // the library has no builder for this class of views
            let class = ViewClass("StateTimeline".into());
            let class = ViewBlueprint::update_fields().with_class_identifier(class);
            self.properties.push((view.blueprint_path(), Box::new(class)));
        }
        // viewers since 0.41 show 30 s around the cursor without it. In a run that goes on, strips of
        // earlier ones keep the range of their begin, unless they have the one of all views
        let time = match self.ranges {
            true => TimeAxis::new().with_view_range(self.range_of_time(None)),
            false => TimeAxis::new().with_link(LinkAxis::LinkToGlobal),
        };
        self.set(&view, "TimeAxis", time);
        view
    }

    /// The query of the strip of seconds.
    pub fn clock(&self) -> String {
        let strip = if self.latest.is_some() { path(&WATCHED_CLOCK) } else { path(&CLOCK) };
        format!("+ {strip}")
    }

    /// A chart of the bars of all entities below one. Their colours are explained by the title.
    pub fn bars(&mut self, name: &str, origin: &EntityPath) -> ContainerLike {
        let view = BarChartView::new(name).with_origin(origin.clone());
        let view = ContainerLike::from(view);
        self.set(&view, "PlotLegend", PlotLegend::new().with_visible(false));
        view
    }

    /// The log of events.
    pub(crate) fn log(&mut self, name: &str) -> ContainerLike {
        let view = TextLogView::new(name).with_origin("/").with_contents(["+ /events"]);
        let log = ContainerLike::from(view);
        let column = |kind| TextLogColumn(datatypes::TextLogColumn { visible: true.into(), kind });
        let columns = [TextLogColumnKind::LogLevel, TextLogColumnKind::Body].map(column);
        // the text has the time, which the viewer's own column cuts
        let timelines = [TIMELINE, SECONDS].map(|timeline| {
            TimelineColumn(datatypes::TimelineColumn {
                timeline: timeline.into(),
                visible: false.into(),
            })
        });
        let columns =
            TextLogColumns::new().with_text_log_columns(columns).with_timeline_columns(timelines);
        self.set(&log, "TextLogColumns", columns);
        log
    }

    /// Sets a property of a view.
    pub(crate) fn set(
        &mut self,
        view: &ContainerLike,
        property: &str,
        value: impl AsComponents + 'static,
    ) {
        if let ContainerLike::View(view) = view {
            let path = view.blueprint_path().join(&EntityPath::from(property));
            self.properties.push((path, Box::new(value)));
        }
    }
}
