//! The layout: track and map at the left, one tab for each block, calibration and sensor at the
//! right, the log below.

use crate::recording::{APPLICATION, TIMELINE};
use crate::sink::Run;
use crate::state::BlockSeries;
use crate::style::title;
use crate::tab::Tab;
use crate::track::Extent;
use re_sdk::blueprint::components::{Corner2D, PanelState, PlayState};
use re_sdk::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Horizontal, MapView,
    SelectionPanel, Spatial3DView, Tabs, TextDocumentView, TextLogView, TimePanel, TimeSeriesView,
    Vertical,
};
use re_sdk::log::LogMsg;
use re_sdk::{AsComponents, EntityPath, RecordingStreamBuilder, RecordingStreamResult, StoreKind};
use re_sdk_types::blueprint::archetypes::{
    EyeControls3D, LineGrid3D, MapZoom, PlotLegend, ScalarAxis, TextLogColumns, TimeAxis,
};
use re_sdk_types::blueprint::components::TextLogColumn;
use re_sdk_types::blueprint::datatypes::{self, TextLogColumnKind};
use re_sdk_types::datatypes::{TimeRange, TimeRangeBoundary};

/// The span of a track on the map, pixels.
const MAP_PIXELS: f64 = 450.0;
/// The size of one pixel of the map at zoom 0 on the equator, m: the circumference of the Earth
/// over the 256 pixels of the one tile.
const MAP_SCALE: f64 = 40_075_016.7 / 256.0;

/// The messages of the layout of a run; with `ranges` after the run, when the plots' ranges are
/// known.
///
/// # Errors
/// When the viewer's library cannot encode the layout.
pub fn messages(
    run: &Run,
    tabs: &[Box<dyn Tab>],
    ranges: bool,
) -> RecordingStreamResult<Vec<LogMsg>> {
    let mut layout = Layout::new(ranges);
    let root = layout.root(run, tabs);
    layout.messages(root)
}

/// A layout under construction.
///
/// The builder of this version of the viewer's library sets no properties of views, so the layout
/// logs them beside the views.
pub struct Layout {
    properties: Vec<(EntityPath, Box<dyn AsComponents>)>,
    ranges: bool,
    /// Gives the next plots a legend. One per tab is enough, since a colour means the same in all
    /// plots.
    pub legend: bool,
    /// The corner of the legend.
    pub corner: Corner2D,
}

impl Layout {
    /// A layout without views; with `ranges` where the plots' ranges are known.
    pub fn new(ranges: bool) -> Self {
        Self { properties: Vec::new(), ranges, legend: true, corner: Corner2D::RightTop }
    }

    /// The messages of the layout with that container around all views.
    ///
    /// # Errors
    /// When the viewer's library cannot encode the layout.
    pub fn messages(self, root: ContainerLike) -> RecordingStreamResult<Vec<LogMsg>> {
        let play = if self.ranges { PlayState::Paused } else { PlayState::Following };
        let time = TimePanel::new()
            .with_timeline(TIMELINE)
            .with_state(PanelState::Collapsed)
            .with_play_state(play);
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
            stream.set_time_sequence("blueprint", 0);
            for (path, property) in &self.properties {
                stream.log(path.clone(), property.as_ref())?;
            }
            messages
                .extend(stored.take().into_iter().filter(|m| matches!(m, LogMsg::ArrowMsg(..))));
        }
        Ok(messages)
    }

    fn root(&mut self, run: &Run, tabs: &[Box<dyn Tab>]) -> ContainerLike {
        let mut right: Vec<ContainerLike> = Vec::new();
        let sensor = |name: &str| run.sensors.iter().any(|s| s.name == name);
        let (calibrations, own): (Vec<_>, Vec<_>) =
            run.blocks.iter().partition(|b| sensor(&b.owner));
        let one_owner = own.iter().all(|b| b.owner == own[0].owner);
        for block in own {
            let name = if one_owner {
                title(&block.name)
            } else {
                format!("{} {}", block.owner, title(&block.name))
            };
            let follows = if self.ranges { block.known } else { run.reference };
            right.push(self.process_block(&name, block, follows && !block.constant));
        }
        for s in &run.sensors {
            let blocks: Vec<_> = calibrations.iter().filter(|b| b.owner == s.name).collect();
            if !blocks.is_empty() {
                self.legend = true;
                let rows: Vec<_> = blocks.iter().map(|b| self.calibration_row(b)).collect();
                right.push(Vertical::new(rows).with_name(format!("{} calibration", s.name)).into());
            }
        }
        let all = !self.ranges;
        for s in run.sensors.iter().filter(|s| s.measures && (s.updated || all)) {
            self.legend = true;
            let mut plots = Vec::new();
            for q in &s.quantities {
                plots.push(self.plot(
                    &q.label,
                    &[format!("+ {}/**", q.accepted.path)],
                    q.range.axis(),
                ));
                self.legend = false;
            }
            right.push(Vertical::new(plots).with_name(format!("{} innovations", s.name)).into());
        }
        right.extend(tabs.iter().filter_map(|tab| tab.view(self)));
        self.legend = true; // the channels differ between sensors
        let samples: Vec<_> = (run.sensors.iter())
            .filter_map(|s| {
                s.samples.as_ref().map(|series| (&s.name, format!("+ {}", series.path)))
            })
            .map(|(name, contents)| self.plot(name, &[contents], None))
            .collect();
        if !samples.is_empty() {
            right.push(Vertical::new(samples).with_name("Samples").into());
        }
        let log = ContainerLike::from(
            TextLogView::new("Events").with_origin("/").with_contents(["+ /events"]),
        );
        let column = |kind| TextLogColumn(datatypes::TextLogColumn { visible: true.into(), kind });
        let columns = [TextLogColumnKind::LogLevel, TextLogColumnKind::Body].map(column);
        self.set(&log, "TextLogColumns", TextLogColumns::new().with_text_log_columns(columns));
        let scenario = TextDocumentView::new("Scenario").with_origin("/scenario").into();
        let verdict = TextDocumentView::new("Verdict").with_origin("/verdict").into();
        let left = self.left(run);
        let top = match (left, right.is_empty()) {
            (Some(left), false) => Horizontal::new([left, Tabs::new(right).into()])
                .with_column_shares(vec![1.0, 1.6])
                .into(),
            (Some(only), true) => only,
            (None, _) => Tabs::new(right).into(),
        };
        Vertical::new([top, Tabs::new([log, verdict, scenario]).into()])
            .with_row_shares(vec![4.5, 1.0])
            .into()
    }

    /// The track and the map.
    fn left(&mut self, run: &Run) -> Option<ContainerLike> {
        let track = run.track.as_ref()?;
        let space = ContainerLike::from(Spatial3DView::new("3-D track").with_origin("/world"));
        let map = ContainerLike::from(MapView::new("Map").with_origin("/map"));
        if let Some((middle, side)) = track.extent.middle().filter(|_| self.ranges) {
            self.set(&space, "EyeControls3D", eye(middle, side));
            let spacing = 10f32.powf((side / 20.0).log10().floor()).max(1.0);
            self.set(&space, "LineGrid3D", LineGrid3D::new().with_spacing(spacing));
            self.set(&map, "MapZoom", MapZoom::new(zoom(&track.extent)));
        }
        Some(Tabs::new([space, map]).into())
    }

    /// One row for each component: the value and, where the truth moves, the error beside it.
    fn process_block(&mut self, name: &str, block: &BlockSeries, errors: bool) -> ContainerLike {
        let mut rows = Vec::new();
        for (k, c) in block.components.iter().enumerate() {
            self.legend = k == 0;
            let value = self.value(&c.label, c);
            rows.push(if errors {
                let contents = [format!("+ {}", c.error.path)];
                let error = self.plot(&c.error_label, &contents, c.error_range.axis());
                Horizontal::new([error, value]).into()
            } else {
                value
            });
        }
        Vertical::new(rows).with_name(name).into()
    }

    /// The components of one block side by side.
    fn calibration_row(&mut self, block: &BlockSeries) -> ContainerLike {
        let name = title(&block.name);
        let mut plots = Vec::new();
        for c in &block.components {
            plots.push(self.value(&format!("{name} {}", c.label), c));
            self.legend = false;
        }
        Horizontal::new(plots).into()
    }

    fn value(&mut self, name: &str, c: &crate::state::Component) -> ContainerLike {
        let mut paths = vec![&c.estimate.path, &c.truth.path];
        if c.smoothed {
            paths.push(&c.filtered.path);
        }
        let contents: Vec<String> = paths.iter().map(|path| format!("+ {path}")).collect();
        self.plot(name, &contents, c.range.axis())
    }

    /// A plot of those entities over the whole run, with that range of its vertical axis.
    pub fn plot(
        &mut self,
        name: &str,
        contents: &[String],
        range: Option<[f64; 2]>,
    ) -> ContainerLike {
        let view =
            ContainerLike::from(TimeSeriesView::new(name).with_origin("/").with_contents(contents));
        let whole =
            TimeRange { start: TimeRangeBoundary::Infinite, end: TimeRangeBoundary::Infinite };
        self.set(&view, "TimeAxis", TimeAxis::new().with_view_range(whole));
        let corner = PlotLegend::new().with_corner(self.corner);
        self.set(&view, "PlotLegend", corner.with_visible(self.legend));
        if let Some(range) = range.filter(|_| self.ranges) {
            self.set(&view, "ScalarAxis", ScalarAxis::new().with_range(range));
        }
        view
    }

    fn set(&mut self, view: &ContainerLike, property: &str, value: impl AsComponents + 'static) {
        if let ContainerLike::View(view) = view {
            let path = view.blueprint_path().join(&EntityPath::from(property));
            self.properties.push((path, Box::new(value)));
        }
    }
}

/// The eye south of the track and above it, so that north is ahead and east to the right.
fn eye(middle: [f32; 3], side: f32) -> EyeControls3D {
    let offset = [-1.05, -0.35, -0.85];
    let position: [f32; 3] = std::array::from_fn(|k| middle[k] + side * offset[k]);
    EyeControls3D::new()
        .with_position(position)
        .with_look_target(middle)
        .with_eye_up([0.0, 0.0, -1.0])
}

/// The zoom of the map at which a track fits: a pixel is `MAP_SCALE cos(latitude) / 2^zoom` metres.
fn zoom(extent: &Extent) -> f64 {
    let side = (0..2).map(|k| f64::from(extent.high[k] - extent.low[k])).fold(1.0, f64::max);
    let metres = MAP_SCALE * extent.latitude.to_radians().cos().abs();
    (metres * MAP_PIXELS / side).log2().clamp(1.0, 19.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_spans_the_intended_pixels_of_the_map() {
        // at zoom z a pixel is the circumference cos(latitude) / 256 / 2^z metres
        let extent = Extent { low: [0.0; 3], high: [500.0, 1200.0, 30.0], latitude: 60.0 };
        let pixel = 40_075_016.7 * 0.5 / 256.0 / zoom(&extent).exp2();
        assert!((1200.0 / pixel - MAP_PIXELS).abs() < 1e-6, "{pixel} m");
    }
}
