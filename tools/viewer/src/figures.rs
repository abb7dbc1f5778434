//! Figures as a recording: a tab for each figure, and in it a plot for each panel over time.
//!
//! A curve is the entity `/FIGURE/PANEL/CURVE`, an edge of a band `/FIGURE/PANEL/BAND/lower` or
//! `upper`; a name that is repeated in one place has a number after it. The viewer's plots have
//! linear axes only, so the values of a logarithmic axis are recorded as decimal logarithms, and
//! the title of the plot has `log10` before the label.

use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use navfuse_figures::{Band, Figure, Look, Panel, Scale};
use navfuse_rerun::re_sdk::blueprint::{ContainerLike, Grid, Tabs};
use navfuse_rerun::style::{BOUND, Colour, path as entity};
use navfuse_rerun::{Layout, Live, Range, Recording, Series};
use std::path::Path;

/// Space on the bar of tabs, in letters. If the titles need more, the tabs show the names of the
/// figures.
const TABS: usize = 160;

/// Writes figures as a recording for the viewer, with its layout. The viewer lists the recording as
/// `name`.
///
/// Only panels whose horizontal axis is time are recorded, since the viewer draws series over its
/// timeline alone. A figure without such a panel has no tab. The viewer draws lines neither dashed
/// nor dotted, and bands by their edges.
///
/// # Errors
/// When the file cannot be written.
pub fn record(path: &Path, name: &str, figures: &[Figure]) -> Result<(), StreamError> {
    let mut recording = Recording::open(path.to_owned(), &Live::default())?;
    recording.name(name)?;
    let mut layout = Layout::new(true);
    let mut tabs: Vec<ContainerLike> = Vec::new();
    let mut names = Names::default();
    let long = figures.iter().map(|f| f.title.chars().count()).sum::<usize>() > TABS;
    for figure in figures {
        let stem = names.unique(&figure.name);
        let mut plots = Vec::new();
        let mut panels = Names::default();
        let mut explained = None;
        for panel in figure.panels.iter().filter(|p| p.x.scale == Scale::Time) {
            // one legend is enough for successive panels with the same curves
            let curves = legend(panel);
            layout.legend = explained.as_ref() != Some(&curves);
            explained = Some(curves);
            let parts = [stem.as_str(), &panels.unique(&panel.title)];
            let range = write(&recording, &parts, panel)?;
            plots.push(layout.plot(
                &title(panel),
                &[format!("+ {}/**", entity(&parts))],
                range.axis(),
            ));
        }
        if !plots.is_empty() {
            let columns = u32::try_from(figure.columns.clamp(1, plots.len())).unwrap_or(1);
            let title = if long || figure.title.is_empty() { &figure.name } else { &figure.title };
            tabs.push(Grid::new(plots).with_grid_columns(columns).with_name(title.as_str()).into());
        }
    }
    let messages = layout.messages(Tabs::new(tabs).into()).map_err(|e| recording.error(e))?;
    recording.layout(&messages);
    recording.close().map(drop)
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

/// The entries of a legend.
fn legend(panel: &Panel) -> Vec<(String, Option<Look>)> {
    let curves = panel.curves.iter().map(|c| (c.name.clone(), Some(c.look)));
    curves.chain(panel.bands.iter().map(|b| (b.name.clone(), None))).collect()
}

/// The title of the panel with the label of its vertical axis, for which the viewer has no other
/// place.
fn title(panel: &Panel) -> String {
    let logarithm = if panel.y.scale == Scale::Logarithmic { "log10 " } else { "" };
    let label = format!("{logarithm}{}", panel.y.label);
    match (panel.title.is_empty(), panel.y.label.is_empty()) {
        (true, _) => label,
        (false, true) if logarithm.is_empty() => panel.title.clone(),
        (false, _) if label.starts_with('[') => format!("{} {label}", panel.title),
        (false, _) => format!("{}: {label}", panel.title),
    }
}

/// Writes the curves and bands of a panel, and returns their range.
fn write(recording: &Recording, parts: &[&str], panel: &Panel) -> Result<Range, StreamError> {
    let mut range = Range::default();
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
    for curve in &panel.curves {
        let path = entity(&[parts, &[names.unique(&curve.name).as_str()]].concat());
        let (colour, width) = stroke(curve.look);
        let mut series = match curve.look {
            Look::Points(_) => Series::points(path, &curve.name, colour, 3.0),
            _ => Series::lines(path, &[(curve.name.clone(), colour, width)]),
        };
        send(recording, &mut series, curve.points.iter().copied(), panel.y.scale, &mut range)?;
    }
    Ok(range)
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
    range: &mut Range,
) -> Result<(), StreamError> {
    let mut last = None;
    for [seconds, value] in points {
        let value = if scale == Scale::Logarithmic { value.log10() } else { value };
        let time = Time::from_seconds(seconds);
        let after = || last.map(|t: Time| Time::from_nanos(t.nanos() + 1));
        let Some(at) = time.or_else(after) else { continue };
        let value = if time.is_some() && value.is_finite() { value } else { f64::NAN };
        range.include(value);
        series.push(recording, at, &[value])?;
        last = Some(at);
    }
    series.flush(recording)
}
