//! Figures as a recording: a tab for each figure, and in it a plot for each panel over time.
//!
//! Before them stand the overview and the tracks.
//!
//! A curve is the entity `/FIGURE/PANEL/CURVE`, an edge of a band `/FIGURE/PANEL/BAND/lower` or
//! `upper`; a name that is repeated in one place has a number after it. The viewer's plots have
//! linear axes only, so the values of a logarithmic axis are recorded as decimal logarithms, unless
//! the largest is less than three times the smallest. The title of such a plot has the unit as
//! `[10^y deg]`, and one number of the axis in that unit.

use navfuse_core::model::stream::StreamError;
use navfuse_core::nalgebra::UnitQuaternion;
use navfuse_core::units::time::Time;
use navfuse_figures::{Axis as Side, Band, Figure, Look, Panel, Scale, Track};
use navfuse_rerun::overlay::{self, Overlaid, OverlaidPlace};
use navfuse_rerun::re_sdk::blueprint::{
    ContainerLike, Grid, Horizontal, Tabs, TextDocumentView, Vertical,
};
use navfuse_rerun::re_sdk_types::archetypes::TextDocument;
use navfuse_rerun::style::{BOUND, Colour, path as entity};
use navfuse_rerun::{Axis, Layout, Live, Recording, Series};
use std::borrow::Cow;
use std::path::Path;

/// Greatest number of plots in a tab: with three columns each is high enough for three numbers on
/// its axis.
const PLOTS: usize = 12;
/// Share of the time of a figure that does not count for a range, and how many times larger it must
/// make the range: otherwise a transient at the start flattens the rest.
const START: f64 = 0.1;
const FLATTENED: f64 = 4.0;
/// Ratio of the largest to the smallest value of a panel up to which its axis is linear: from -1.000 to -1.004
/// a reader sees no 10 %.
const NARROW: f64 = 3.0;

/// Space on the bar of tabs, in letters. If the titles need more, the tabs show the names of the
/// figures.
const TABS: usize = 160;

/// First tab of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Overview<'a> {
    /// Page in Markdown.
    pub page: &'a str,
    /// Plots below the page.
    pub figure: Option<&'a Figure>,
}

/// Writes figures as a recording for the viewer, with its layout. The viewer lists the recording as
/// `name`.
///
/// The overview comes first: its page, beside it the vehicles of all tracks, and its plots. Tracks
/// have the next tab, in three dimensions and on a map.
///
/// Only panels whose horizontal axis is time are recorded, since the viewer draws series over its
/// timeline alone. A figure without such a panel has no tab. The viewer draws lines neither dashed
/// nor dotted, and bands by their edges.
///
/// # Errors
/// When the file cannot be written.
pub fn record(
    path: &Path,
    name: &str,
    overview: Option<&Overview<'_>>,
    tracks: &[Track],
    figures: &[Figure],
) -> Result<(), StreamError> {
    let mut recording = Recording::open(path.to_owned(), &Live::default())?;
    recording.name(name)?;
    let mut layout = Layout::new(true);
    layout.span = span(figures);
    layout.axis = Axis::of(layout.span);
    recording.settle(layout.axis, layout.span);
    let tracks: Vec<Overlaid> = tracks.iter().map(overlaid).collect();
    overlay::draw(&recording, &tracks)?;
    let mut writer = Writer { recording: &recording, layout, names: Names::default() };
    let mut tabs = Vec::new();
    if let Some(overview) = overview {
        tabs.push(writer.overview(overview, &tracks)?);
    }
    tabs.extend(writer.layout.overlay(&tracks));
    let long = figures.iter().map(|f| f.title.chars().count()).sum::<usize>() > TABS;
    for figure in figures {
        let title = if long || figure.title.is_empty() { &figure.name } else { &figure.title };
        let pages = writer.pages(figure, 1)?;
        let several = pages.len() > 1;
        let named = |(page, name): (Grid, String)| match several {
            true => page.with_name(name),
            false => page.with_name(title.as_str()),
        };
        let inner: Vec<ContainerLike> = pages.into_iter().map(|page| named(page).into()).collect();
        match several {
            true => tabs.push(Tabs::new(inner).with_name(title.as_str()).into()),
            false => tabs.extend(inner),
        }
    }
    let root = Tabs::new(tabs).into();
    let messages = writer.layout.messages(root).map_err(|e| recording.error(e))?;
    recording.last_layout(&messages);
    recording.close().map(drop)
}

/// A recording of figures under construction.
struct Writer<'a> {
    recording: &'a Recording,
    layout: Layout,
    names: Names,
}

impl Writer<'_> {
    /// The page, the vehicles beside it, and the plots below.
    fn overview(
        &mut self,
        overview: &Overview<'_>,
        tracks: &[Overlaid],
    ) -> Result<ContainerLike, StreamError> {
        let page = TextDocument::from_markdown(overview.page);
        self.recording.log_static(&entity(&["overview"]), &page)?;
        let page = TextDocumentView::new("What differs").with_origin("/overview");
        let mut top = vec![ContainerLike::from(page)];
        top.extend(self.layout.vehicles(tracks));
        let mut rows = vec![Horizontal::new(top).into()];
        if let Some(figure) = overview.figure {
            rows.extend(self.pages(figure, 2)?.into_iter().next().map(|page| page.0.into()));
        }
        // the page has room for its tables
        let shares: Vec<f32> = [1.25, 1.0].into_iter().take(rows.len()).collect();
        Ok(Vertical::new(rows).with_row_shares(shares).with_name("Overview").into())
    }

    /// The plots of a figure, on pages with their names. A page fills that part of the window's
    /// height.
    fn pages(&mut self, figure: &Figure, part: usize) -> Result<Vec<(Grid, String)>, StreamError> {
        let stem = self.names.unique(&figure.name);
        let panels: Vec<&Panel> =
            figure.panels.iter().filter(|p| p.x.scale == Scale::Time).collect();
        let mut unique = Names::default();
        let mut pages = Vec::new();
        for panels in panels.chunks(PLOTS) {
            let columns = figure.columns.clamp(1, panels.len());
            // a page above takes a little more than its part
            self.layout.rows = part * panels.len().div_ceil(columns) + part - 1;
            let mut plots = Vec::new();
            let mut explained = None;
            for panel in panels {
                let panel = &*readable(panel);
                // one legend is enough for successive panels with the same curves
                let curves = legend(panel);
                let parts = [stem.as_str(), &unique.unique(&panel.title)];
                let Drawn { mut range, points } = write(self.recording, &parts, panel)?;
                self.layout.legend = explained.as_ref() != Some(&curves);
                if let Some(range) = range.as_mut().filter(|_| self.layout.legend) {
                    let names: Vec<&str> = curves.iter().map(|(name, _)| name.as_str()).collect();
                    *range = self.layout.legend_beside(&names, &points, columns, *range);
                }
                explained = Some(curves);
                let contents = [format!("+ {}/**", entity(&parts))];
                plots.push(self.layout.plot(&title(panel, range), &contents, range));
            }
            let page = Grid::new(plots).with_grid_columns(u32::try_from(columns).unwrap_or(1));
            let name = format!("{} to {}", panels[0].title, panels[panels.len() - 1].title);
            pages.push((page, name));
        }
        Ok(pages)
    }
}

/// The first and the last time of the panels over time, ns.
fn span(figures: &[Figure]) -> Option<(i64, i64)> {
    let panels =
        figures.iter().flat_map(|f| &f.panels).filter(|panel| panel.x.scale == Scale::Time);
    let times = panels.flat_map(|panel| {
        let curves = panel.curves.iter().flat_map(|c| c.points.iter().map(|p| p[0]));
        curves.chain(panel.bands.iter().flat_map(|b| b.points.iter().map(|p| p[0])))
    });
    let nanos = times.filter_map(|t| Time::from_seconds(t).map(|t| t.nanos()));
    let span = nanos.fold(None, |span: Option<(i64, i64)>, t| {
        Some(span.map_or((t, t), |(first, last)| (first.min(t), last.max(t))))
    });
    span.filter(|(first, last)| first < last)
}

/// Names that differ from each other.
#[derive(Default)]
struct Names(Vec<String>);

impl Names {
    /// The name, with a number after it where the name was used before.
    fn unique(&mut self, name: &str) -> String {
        let mut unique = name.to_owned();
        let mut k = 1;
        while unique.is_empty() || self.0.contains(&unique) {
            k += 1;
            unique = if name.is_empty() { format!("{}", k - 1) } else { format!("{name} {k}") };
        }
        self.0.push(unique.clone());
        unique
    }
}

/// The panel with a linear axis, where a logarithmic one would show a part of a decade.
fn readable(panel: &Panel) -> Cow<'_, Panel> {
    if panel.y.scale != Scale::Logarithmic || panel.y.limits.is_some() {
        return Cow::Borrowed(panel);
    }
    let curves = panel.curves.iter().flat_map(|c| c.points.iter().copied());
    let bands = panel.bands.iter().flat_map(|b| &b.points);
    let points = curves.chain(bands.flat_map(|p| [[p[0], p[1]], [p[0], p[2]]]));
    let points = points.filter(|p| p[0].is_finite() && p[1].is_finite() && p[1] > 0.0).collect();
    let [low, high] = Extremes { points }.usual();
    if !(low > 0.0 && high <= NARROW * low) {
        return Cow::Borrowed(panel);
    }
    let label = match panel.y.label.as_str() {
        label if label.is_empty() || label.contains('[') => label.to_owned(),
        unit => format!("[{unit}]"),
    };
    Cow::Owned(Panel { y: Side::linear(label), ..panel.clone() })
}

/// The entries of a legend.
fn legend(panel: &Panel) -> Vec<(String, Option<Look>)> {
    let curves = panel.curves.iter().map(|c| (c.name.clone(), Some(c.look)));
    curves.chain(panel.bands.iter().map(|b| (b.name.clone(), None))).collect()
}

/// The title of the panel with the label of its vertical axis, for which the viewer has no other
/// place.
fn title(panel: &Panel, range: Option<[f64; 2]>) -> String {
    let label = match panel.y.scale {
        Scale::Logarithmic => logarithmic(&panel.y.label, range),
        Scale::Linear | Scale::Time | Scale::Map => panel.y.label.clone(),
    };
    match (panel.title.is_empty(), label.is_empty()) {
        (true, _) => label,
        (false, true) => panel.title.clone(),
        (false, _) if label.starts_with('[') => format!("{} {label}", panel.title),
        (false, _) => format!("{}: {label}", panel.title),
    }
}

/// The label of a logarithmic axis: `sigma [10^y deg], -2 is 0.01 deg` for `sigma [deg]`. The
/// number is near the middle of the axis.
fn logarithmic(label: &str, range: Option<[f64; 2]>) -> String {
    let label = label.trim_end_matches(']');
    let (name, unit) = label.rsplit_once('[').unwrap_or(("", label));
    let space = if unit.is_empty() { "" } else { " " };
    let axis = format!("{name}[10^y{space}{unit}]");
    let Some([low, high]) = range else { return axis };
    let middle = 0.5 * (low + high);
    // a whole power where the axis has one
    let whole = middle.round();
    let at = if (low..=high).contains(&whole) { whole } else { (10.0 * middle).round() / 10.0 };
    let value = 10f64.powf(at);
    let value = match value {
        v if (1e-4..1e5).contains(&v) => {
            let decimals = (-at.floor()).max(0.0) as usize + usize::from(at != at.round());
            format!("{v:.decimals$}")
        }
        v => format!("{v:.0e}"),
    };
    // adding zero makes a negative zero positive
    format!("{axis}, {} is {value}{space}{unit}", at + 0.0)
}

/// The range of a panel: its limits, or that of all values, but without the start where that would
/// flatten the rest.
#[derive(Default)]
struct Extremes {
    points: Vec<[f64; 2]>,
}

impl Extremes {
    fn range(&self, panel: &Panel) -> Option<[f64; 2]> {
        if let Some(limits) = panel.y.limits {
            return Some(match panel.y.scale {
                Scale::Logarithmic => limits.map(f64::log10),
                Scale::Linear | Scale::Time | Scale::Map => limits,
            });
        }
        let range = self.usual();
        (range[0] <= range[1]).then_some(range)
    }

    /// The range of all values, but without the start where that would flatten the rest.
    fn usual(&self) -> [f64; 2] {
        let over = |k: usize, from: f64| {
            let values = self.points.iter().filter(|p| p[0] >= from).map(|p| p[k]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
        };
        let [first, last] = over(0, f64::NEG_INFINITY);
        let whole = over(1, f64::NEG_INFINITY);
        let later = over(1, first + START * (last - first));
        let flattened = whole[1] - whole[0] > FLATTENED * (later[1] - later[0]);
        let flat = later[1] <= later[0];
        if flattened && !flat { later } else { whole }
    }
}

/// What was drawn of a panel.
struct Drawn {
    range: Option<[f64; 2]>,
    /// The points of the curves.
    points: Vec<[f64; 2]>,
}

/// Writes the curves and bands of a panel.
fn write(recording: &Recording, parts: &[&str], panel: &Panel) -> Result<Drawn, StreamError> {
    let mut range = Extremes::default();
    let mut names = Names::default();
    for band in &panel.bands {
        let name = names.unique(&band.name);
        for (k, side) in [(1, "lower"), (2, "upper")] {
            let path = entity(&[parts, &[name.as_str(), side]].concat());
            let mut series = Series::lines(path, &[(band.name.clone(), Band::COLOUR, 2.0)]);
            let points = band.points.iter().map(|p| [p[0], p[k]]);
            send(recording, &mut series, points, panel.y.scale, &mut range)?;
        }
    }
    let bounds = range.points.len();
    for curve in &panel.curves {
        let path = entity(&[parts, &[names.unique(&curve.name).as_str()]].concat());
        let (colour, width) = stroke(curve.look);
        let mut series = match curve.look {
            Look::Points(_) => Series::points(path, &curve.name, colour, 3.0),
            _ => Series::lines(path, &[(curve.name.clone(), colour, width)]),
        };
        send(recording, &mut series, curve.points.iter().copied(), panel.y.scale, &mut range)?;
    }
    Ok(Drawn { range: range.range(panel), points: range.points.split_off(bounds) })
}

/// The track of a run as the viewer overlays it.
fn overlaid(track: &Track) -> Overlaid {
    let places = track.points.iter().filter_map(|p| {
        let attitude = p.roll_pitch_yaw.map(|angles| {
            let [roll, pitch, yaw] = angles.map(f64::to_radians);
            let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            [q.i, q.j, q.k, q.w].map(|x| x as f32)
        });
        Some(OverlaidPlace {
            time: Time::from_seconds(p.time)?.nanos(),
            ned: p.north_east_down.map(|x| x as f32),
            geo: p.latitude_longitude,
            attitude,
        })
    });
    let (colour, width) = stroke(track.look);
    Overlaid { name: track.name.clone(), colour, width, places: places.collect() }
}

/// The colour and width of a line: those of the figure, but a bound is grey, since its dark ink
/// would be invisible on the viewer's dark ground.
fn stroke(look: Look) -> (Colour, f32) {
    match look {
        Look::Bound => (BOUND, 1.0),
        Look::Data(_) | Look::Points(_) => (look.colour(), 1.9),
        Look::Sigma => (look.colour(), 1.4),
        Look::Truth => (look.colour(), 2.2),
    }
}

/// Sends the points of a series. A value that is no number on the axis breaks the line; a point
/// without a time breaks it right after the previous point.
fn send(
    recording: &Recording,
    series: &mut Series,
    points: impl Iterator<Item = [f64; 2]>,
    scale: Scale,
    range: &mut Extremes,
) -> Result<(), StreamError> {
    let mut last = None;
    for [seconds, value] in points {
        let value = if scale == Scale::Logarithmic { value.log10() } else { value };
        let time = Time::from_seconds(seconds);
        let after = || last.map(|t: Time| Time::from_nanos(t.nanos() + 1));
        let Some(at) = time.or_else(after) else { continue };
        let value = if time.is_some() && value.is_finite() { value } else { f64::NAN };
        if value.is_finite() {
            range.points.push([seconds, value]);
        }
        series.push(recording, at, &[value])?;
        last = Some(at);
    }
    series.flush(recording)
}
