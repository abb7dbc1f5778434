//! The tabs of a run: the overview first, then what it is made of.

mod sensors;
mod states;

use crate::blueprint::{FRAME, Layout};
use crate::eye::{EYE, FOLLOWING, SEEING_ALL, eye};
use crate::legend::ASSESSMENT;
use crate::map::Graticule;
use crate::overview;
use crate::polar::Polar;
use crate::recording::Axis;
use crate::run::Run;
use crate::scene::{AROUND, BALL, DISTANCE, LIVE_VEHICLE, VEHICLE};
use crate::state::BlockSeries;
use crate::style::{powers, title};
use crate::tab::Tab;
use crate::track::{Extent, Motion};
use re_sdk::RecordingStreamResult;
use re_sdk::blueprint::components::Corner2D;
use re_sdk::blueprint::{
    ContainerLike, Horizontal, MapView, Spatial2DView, Spatial3DView, Tabs, TextDocumentView,
    Vertical,
};
use re_sdk::log::LogMsg;
use re_sdk_types::blueprint::archetypes::{Background, LineGrid3D, MapZoom};
use re_sdk_types::blueprint::components::BackgroundKind;
use re_sdk_types::components::{self, Plane3D};

/// Background of the views in three dimensions.
const GROUND: [u8; 3] = [14, 16, 20];
/// Height of a lane of the viewer, and of what is above the lanes, pixels.
const LANE: [f64; 2] = [40.0, 56.0];
/// Number of lanes beside those of the sensors: time, and verdict and colours once a run is over.
const LEGENDS: usize = 3;
/// Height of a small window (1280x720) and of a usual one (1600x1000) without their panels, pixels.
const SMALL: f64 = 645.0;
const USUAL: f64 = 900.0;
/// Least and greatest share of the lanes in the height; the last one is for many sensors.
const LANES: [f64; 3] = [0.36, 0.66, 0.7];
/// Share of plot and table below the page: the error from -4 to 4 sigma has a number at every sigma of a
/// small window, and all rows of the table are there.
const BELOW_PAGE: f64 = 0.4;
/// Widths of the left and the right half, and of track and vehicle.
const HALVES: [f32; 2] = [1.0, 1.13];
const TRACK_AND_VEHICLE: [f32; 2] = [1.1, 1.0];
/// Width of the right half of a usual window, of the columns of the table beside the names, and of a letter of
/// a name, pixels.
const TABLE: [f64; 3] = [849.0, 315.0, 6.4];
/// Least and greatest share of the table beside its plot.
const TABLES: [f64; 2] = [0.53, 0.66];
/// Greatest number of components in a tab.
const ROWS: usize = 4;

/// The stage of a run that a layout shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// It begins, and nobody watches.
    Begins,
    /// It goes on, and viewers watch.
    Watched,
    /// It has ended: the plots' ranges are known.
    Ended,
}

/// The latest time that a viewer shows of a run that goes on, ns.
const LATEST: i64 = 300_000_000_000;

/// The messages of the layout of a run.
///
/// # Errors
/// When the viewer's library cannot encode the layout.
pub fn messages(
    run: &Run,
    tabs: &[Box<dyn Tab>],
    stage: Stage,
) -> RecordingStreamResult<Vec<LogMsg>> {
    let ranges = stage == Stage::Ended;
    let mut layout = Layout::new(ranges);
    layout.timed = true;
    layout.latest = (stage == Stage::Watched).then_some(LATEST);
    layout.span = run.span.filter(|(first, last)| ranges && first < last);
    layout.axis = if ranges { run.axis() } else { Axis::default() };
    let root = layout.root(run, tabs);
    layout.messages(root)
}

impl Layout {
    fn root(&mut self, run: &Run, tabs: &[Box<dyn Tab>]) -> ContainerLike {
        let mut all = vec![self.overview(run)];
        if self.ranges || self.latest.is_some() {
            self.parts(run, tabs, &mut all);
        }
        all.push(self.log("Events"));
        all.push(TextDocumentView::new("Scenario").with_origin("/scenario").into());
        Tabs::new(all).into()
    }

    /// The tabs whose series viewers see during the run, and the file has from its end on.
    fn parts(&mut self, run: &Run, tabs: &[Box<dyn Tab>], all: &mut Vec<ContainerLike>) {
        all.extend(self.track(run));
        let sensor = |name: &str| run.sensors.iter().any(|s| s.name == name);
        let (own, calibrations): (Vec<_>, Vec<_>) =
            run.blocks.iter().partition(|b| !sensor(&b.owner));
        let one_owner = own.iter().all(|b| b.owner == own[0].owner);
        let mut states = Vec::new();
        for block in own {
            let name = title(&block.name);
            let name = if one_owner { name } else { format!("{} {name}", block.owner) };
            states.push(self.states(&name, &[block]));
        }
        all.extend(group("Navigation states", states));
        let mut states = Vec::new();
        for sensor in &run.sensors {
            let blocks: Vec<_> =
                calibrations.iter().filter(|b| b.owner == sensor.name).copied().collect();
            for part in in_parts(&blocks) {
                let names: Vec<String> = part.iter().map(|b| b.name.replace('_', " ")).collect();
                let name = format!("{}: {}", sensor.name, names.join(", "));
                states.push(self.states(&name, part));
            }
        }
        all.extend(group("Calibration states", states));
        let mut sensors = Vec::new();
        for sensor in &run.sensors {
            sensors.extend(self.innovations(sensor));
        }
        sensors.extend(self.samples(&run.samples));
        all.extend(group("Sensors", sensors));
        (self.legend, self.rows, self.columns) = (true, 3, 4);
        self.corner = Corner2D::RightTop;
        all.extend(tabs.iter().filter_map(|tab| tab.view(self)));
    }

    /// Track, verdict, health of the sensors, the worst state and all states on one page. The lanes of all
    /// sensors are below the track, and the answers beside both.
    fn overview(&mut self, run: &Run) -> ContainerLike {
        let page = ContainerLike::from(
            TextDocumentView::new("Verdict and reasons").with_origin("/overview"),
        );
        let places = run.track.as_ref().map(|motion| self.places(motion));
        let mut contents = vec![self.clock(), "+ /colour_legend".into(), "+ /health/**".into()];
        if self.ranges {
            contents.push(format!("+ /{ASSESSMENT}"));
        }
        let lanes = self.lanes("Health of the sensors", &contents);
        let shares = |below: f64| [1.0 - below, below].map(|share| share as f32);
        // while the run goes on, the page of many sensors needs the whole height
        let few = self.latest.is_some() && run.lanes.len() <= overview::FEW;
        let below = match self.ranges {
            true => self.worst_and_states(run),
            false if few => self.position_and_states(run),
            false => Vec::new(),
        };
        let right = match below.is_empty() {
            true => page,
            false => {
                let below = Horizontal::new(below).with_column_shares(plot_and_table(run)).into();
                Vertical::new([page, below]).with_row_shares(shares(BELOW_PAGE)).into()
            }
        };
        let left = match places {
            Some(places) => {
                let top = Horizontal::new(places).with_column_shares(TRACK_AND_VEHICLE).into();
                let shares = shares(share_of(run.lanes.len() + LEGENDS));
                Vertical::new([top, lanes]).with_row_shares(shares).into()
            }
            None => lanes,
        };
        Horizontal::new([left, right]).with_column_shares(HALVES).with_name("Overview").into()
    }

    /// The track from above, and the view that follows the vehicle.
    fn places(&mut self, motion: &Motion) -> [ContainerLike; 2] {
        let name = enlarged("From above", motion, self.ranges);
        // while a run goes on, its plan is moved into the square that the view shows
        let watched = self.latest.is_some();
        let view =
            Spatial2DView::new(name.as_str()).with_origin(if watched { "/" } else { "/plan" });
        let contents = ["+ /plan/**", "- /plan/polar/**"];
        let view = ContainerLike::from(view.with_contents(contents));
        let plan = crate::plan::Plan::new(&motion.extent).filter(|_| self.ranges);
        let square = watched.then(crate::plan::square);
        if let Some(bounds) = plan.map(|plan| plan.bounds()).or(square) {
            self.set(&view, "VisualBounds2D", bounds);
        }
        [view, self.follow("Follows the vehicle", motion)]
    }

    /// The plot of the worst state, and the table of all states.
    fn worst_and_states(&mut self, run: &Run) -> Vec<ContainerLike> {
        let mut below = Vec::new();
        // the titles of four plots beside one another would be as long
        self.columns = 4;
        if let Some((b, k)) = run.worst
            && let Some(plots) = &run.blocks[b].components[k].plots
        {
            let block = &run.blocks[b];
            let name = format!("Worst: {}", block.full_name(k));
            let pixels = BELOW_PAGE * USUAL - FRAME;
            // without a truth the worst state is the one whose sigma fell least; the legend names the ratio
            let (leaf, name, range) = match block.components[k].tally.worst {
                Some(worst) => {
                    let size = worst.sigmas.max(4.0);
                    let range = ([-size, size], pixels);
                    let range = self.legend_at(&plots.legends.normalised, true, range);
                    ("normalised", name, range)
                }
                None => {
                    let range = (plots.logarithms, pixels);
                    let range = self.legend_at(&plots.legends.sigma, true, range);
                    ("sigma", format!("{name}, sigma {}", powers(plots.error.unit)), range)
                }
            };
            let contents = [format!("+ {}", block.entity(k, leaf))];
            below.push(self.plot_of(&name, &contents, Some(range), None, pixels));
        }
        let states = TextDocumentView::new("States at the end").with_origin("/states");
        below.push(states.into());
        below
    }

    /// The plot of a component of the position, and the table of all states, while the run goes on.
    fn position_and_states(&mut self, run: &Run) -> Vec<ContainerLike> {
        let mut below = Vec::new();
        self.columns = 4;
        if let Some(block) = run.blocks.iter().find(|block| block.is_position) {
            let name = block.live_title(&block.full_name(0), 0);
            below.push(self.plot(&name, &[format!("+ {}", block.live_entity(0))], None));
        }
        below.push(TextDocumentView::new("States now").with_origin("/states").into());
        below
    }

    /// The track in three dimensions, with an eye that sees all and one that follows, and the map.
    fn track(&mut self, run: &Run) -> Option<ContainerLike> {
        let track = run.track.as_ref()?;
        let depth = if self.ranges { track.extent.exaggeration() } else { 1.0 };
        let name = match depth > 1.0 {
            true => format!("3-D track, depth x {depth}"),
            false => "3-D track".to_owned(),
        };
        let name = enlarged(&name, track, self.ranges);
        let [whole, mut map] = self.overviews(&name, &track.extent);
        if let Some(polar) = Polar::of(track).filter(|_| self.ranges) {
            // the projection of the map has no pole
            let title = polar.title();
            // without the grid and the header of the plan
            let without = ["grid", "distances", "named/**", "scale", "legend", "north"];
            let without = without.iter().map(|part| format!("- /plan/{part}"));
            let contents = std::iter::once("+ /plan/**".to_owned()).chain(without);
            let view = Spatial2DView::new(title.as_str()).with_origin("/plan");
            map = view.with_contents(contents).into();
        }
        let follow = enlarged("3-D, follows the vehicle", track, self.ranges);
        let follow = self.follow(&follow, track);
        let right = Vertical::new([follow, map]).into();
        let both = Horizontal::new([whole, right]).with_column_shares(vec![1.3, 1.0]);
        Some(both.with_name("Track").into())
    }

    /// The view in three dimensions whose eye follows the vehicle.
    fn follow(&mut self, name: &str, track: &Motion) -> ContainerLike {
        // the marks of start and end would cover the vehicle there
        let contents =
            ["+ /world/**", "- /world/marks", "- /world/distances", "- /world/vehicle/here"];
        let view = self.space(name, "/world", &track.extent, &contents);
        let side = track.extent.middle().map(|(_, side)| side).filter(|_| self.ranges);
        let length = side.map_or(LIVE_VEHICLE, |side| VEHICLE * side);
        self.eye_follows(&view, "/world/vehicle/around", AROUND * length);
        view
    }

    /// Lets the eye of a view in three dimensions follow the points [`crate::scene::around`] of that
    /// reach. The viewer derives the distance of the eye from the points, if they have arrived with
    /// the layout, and otherwise from its place: both are the same.
    pub(crate) fn eye_follows(&mut self, view: &ContainerLike, entity: &str, reach: f32) {
        let eye = eye([0.0; 3], DISTANCE * reach, FOLLOWING)
            .with_tracking_entity(components::EntityPath::from(entity));
        self.set(view, "EyeControls3D", eye);
    }

    /// The views of all tracks in that box: in three dimensions and on the map.
    pub(crate) fn overviews(&mut self, name: &str, extent: &Extent) -> [ContainerLike; 2] {
        let depth = if self.ranges { extent.exaggeration() } else { 1.0 };
        let contents = ["+ /world/**", "- /world/vehicle/**", "+ /world/vehicle/here"];
        let whole = self.space(name, "/", extent, &contents);
        let graticule = Graticule::new(extent).filter(|_| self.ranges);
        let name = match self.ranges {
            true => crate::map::title(extent, graticule.as_ref()),
            false => "Map".to_owned(),
        };
        let plane = ContainerLike::from(MapView::new(name.as_str()).with_origin("/map"));
        if let Some(graticule) = graticule {
            self.set(&plane, "MapZoom", MapZoom::new(graticule.zoom()));
        }
        // while a run goes on, its track is moved into the ball that the eye sees
        let ball = if self.ranges { extent.ball(depth) } else { Some(([0.0; 3], BALL)) };
        if let Some((middle, radius)) = ball {
            self.set(&whole, "EyeControls3D", eye(middle, EYE * radius, SEEING_ALL));
        }
        [whole, plane]
    }

    /// A view in three dimensions of those entities, with a grid; above `/world` depths are enlarged.
    pub(crate) fn space(
        &mut self,
        name: &str,
        origin: &str,
        extent: &Extent,
        contents: &[&str],
    ) -> ContainerLike {
        let view = Spatial3DView::new(name).with_origin(origin);
        let view = ContainerLike::from(view.with_contents(contents.iter().copied()));
        if let Some((_, side)) = extent.middle().filter(|_| self.ranges) {
            let spacing = crate::plan::round(f64::from(side) / 20.0) as f32;
            let depth = if origin == "/" { extent.exaggeration() } else { 1.0 };
            let level = Plane3D::new([0.0, 0.0, 1.0], depth * extent.level());
            let grid = LineGrid3D::new().with_spacing(spacing).with_plane(level);
            self.set(&view, "LineGrid3D", grid);
        }
        let dark = Background::new(BackgroundKind::SolidColor).with_color(GROUND);
        self.set(&view, "Background", dark);
        view
    }
}

/// The widths of plot and table: all columns of the table are there in a usual window.
fn plot_and_table(run: &Run) -> [f32; 2] {
    let names =
        run.blocks.iter().flat_map(|b| (0..b.components.len()).map(|k| b.full_name(k).len()));
    let [half, columns, letter] = TABLE;
    let needed = columns + letter * names.max().unwrap_or(0) as f64;
    let share = (needed / half).clamp(TABLES[0], TABLES[1]) as f32;
    [1.0 - share, share]
}

/// Tabs with a name; `None` without any.
fn group(name: &str, tabs: Vec<ContainerLike>) -> Option<ContainerLike> {
    (!tabs.is_empty()).then(|| Tabs::new(tabs).with_name(name).into())
}

/// Blocks in groups of at most [`ROWS`] components.
fn in_parts<'a, 'b>(blocks: &'b [&'a BlockSeries]) -> Vec<&'b [&'a BlockSeries]> {
    let mut parts = Vec::new();
    let (mut begin, mut count) = (0, 0);
    for (k, block) in blocks.iter().enumerate() {
        let more = block.components.len();
        if k > begin && count + more > ROWS {
            parts.push(&blocks[begin..k]);
            (begin, count) = (k, 0);
        }
        count += more;
    }
    if begin < blocks.len() {
        parts.push(&blocks[begin..]);
    }
    parts
}

/// The share of that many lanes in the height: each is visible in a small window.
fn share_of(lanes: usize) -> f64 {
    let most = LANES[if lanes > overview::MANY + LEGENDS { 2 } else { 1 }];
    ((LANE[0] * lanes as f64 + LANE[1]) / SMALL).clamp(LANES[0], most)
}

/// The name of a view with ellipses or ellipsoids, and by how much they are enlarged where the run
/// is over.
fn enlarged(name: &str, track: &Motion, over: bool) -> String {
    match crate::ellipses::enlargement(track) {
        enlarged if over && enlarged > 1.0 => format!("{name}; 3 sigma x {enlarged}"),
        _ => format!("{name}; 3 sigma"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nobody scrolls to the sensor that was bad.
    #[test]
    fn the_lanes_of_six_sensors_fit_into_a_small_window_and_those_of_eleven_into_a_usual_one() {
        for (sensors, height) in (1..=6).map(|n| (n, SMALL)).chain((7..=11).map(|n| (n, USUAL))) {
            let lanes = sensors + LEGENDS;
            let strips = LANE[0] * lanes as f64 + LANE[1];
            let room = share_of(lanes) * height;
            assert!(room >= strips - 1e-9, "{sensors} sensors: {room} of {strips}");
        }
    }
}
