//! Layout and drawing of one panel.

use crate::line::{clipped, simplified};
use crate::look::{
    Area, Drawn, FINE_GRID, FRAME, GRID, INK, LABEL, TICK, band, dot, fit, line, stroke, text,
    units, width,
};
use crate::scale::{Ruler, place, same_unit};
use crate::{Axis, Curve, Look, Panel, Scale};
use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement, Polygon, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontStyle, FontTransform};

/// Radius of a point, page pixels.
pub const RADIUS: f64 = 1.8;
/// Number of points up to which each is one to look at, such as a method or a change, and their radius, page
/// pixels.
const FEW: usize = 30;
const FEW_RADIUS: f64 = 3.2;
/// Length of a tick, page pixels.
const MARK: f64 = 4.0;
/// Height of a line of text, page pixels.
const TEXT: f64 = 16.0;
/// Smallest distances between numbers side by side and above each other, page pixels.
const APART: [f64; 2] = [62.0, 32.0];

/// Returns `true` if the units of both axes have the same length.
pub fn is_map(panel: &Panel) -> bool {
    panel.x.scale == Scale::Map && panel.y.scale == Scale::Map
}

/// Panel with its axes, before it has a position.
pub struct Prepared<'a> {
    panel: &'a Panel,
    x: Ruler,
    y: Ruler,
}

impl<'a> Prepared<'a> {
    /// Sets the ranges for a plot of about a size in page pixels.
    pub fn new(panel: &'a Panel, [wide, high]: [f64; 2]) -> Self {
        // a point counts if it lies on both axes; an edge of a band that is zero or infinite does
        // not count
        let there = |x: f64, y: f64| place(panel.x.scale, x).and(place(panel.y.scale, y)).is_some();
        let curves = panel.curves.iter().flat_map(|c| c.points.iter().copied());
        let bands = panel
            .bands
            .iter()
            .flat_map(|b| b.points.iter().flat_map(|p| [[p[0], p[1]], [p[0], p[2]]]));
        let points: Vec<[f64; 2]> = curves.chain(bands).filter(|p| there(p[0], p[1])).collect();
        let has_points = panel.curves.iter().any(|c| matches!(c.look, Look::Points(_)));
        let map = is_map(panel);
        let margin = if map {
            0.05
        } else if has_points {
            0.02
        } else {
            0.0
        };
        let counts = [wide / APART[0], high / APART[1]];
        let x = Ruler::new(panel.x.scale, points.iter().map(|p| p[0]), margin, counts[0]);
        let y = match panel.y.limits {
            _ if !panel.y.names.is_empty() && !points.is_empty() => Ruler::named(&panel.y.names),
            Some(limits) if !points.is_empty() => {
                Ruler::new(panel.y.scale, limits.into_iter(), 0.0, counts[1])
            }
            _ => Ruler::new(panel.y.scale, points.iter().map(|p| p[1]), 0.05, counts[1]),
        };
        let mut prepared = Self { panel, x, y };
        prepared.fit([wide, high]);
        prepared
    }

    /// Fits a map into a plot of a size in page pixels; other panels hardly depend on the size.
    pub fn fit(&mut self, size: [f64; 2]) {
        if is_map(self.panel) {
            same_unit([&mut self.x, &mut self.y], size, [size[0] / APART[0], size[1] / APART[1]]);
        }
    }

    /// Returns the width of the labels left of the plot, page pixels.
    pub fn left(&self) -> f64 {
        let numbers = self.y.ticks.iter().map(|t| width(&t.1, TICK)).fold(12.0, f64::max);
        let label = if self.panel.y.label.is_empty() { 0.0 } else { TEXT };
        label + numbers + MARK + 6.0
    }

    /// Returns the width right of the plot, page pixels: half of a number at its edge.
    pub fn right(&self) -> f64 {
        let at_edge = |t: &&(f64, String)| t.0 > self.x.high - 0.1 * (self.x.high - self.x.low);
        self.x.ticks.last().filter(at_edge).map_or(0.0, |t| 0.5 * width(&t.1, TICK))
    }

    /// Returns the height of the labels below the plot, page pixels.
    pub fn below(&self, labelled: bool) -> f64 {
        MARK + TEXT + if labelled && !self.panel.x.label.is_empty() { TEXT } else { 0.0 }
    }

    /// Draws the plot with its numbers, and the labels of the axes. The plot is a rectangle in page
    /// pixels.
    pub fn draw(
        &self,
        area: &Area<'_>,
        [left, top, wide, high]: [f64; 4],
        labelled: bool,
    ) -> Drawn {
        let (beside, below) = (self.left(), self.below(false));
        let whole = area.clone().shrink(
            (units(left - beside), units(top)),
            (units(wide + beside) + 1, units(high + below) + 1),
        );
        let mut chart = ChartBuilder::on(&whole)
            .x_label_area_size(units(below))
            .y_label_area_size(units(beside))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .bold_line_style(line(GRID, 0.75))
            .light_line_style(line(FINE_GRID, 0.75))
            .axis_style(line(FRAME, 0.75))
            .set_all_tick_mark_size(units(MARK))
            .label_style(text(TICK, FontStyle::Normal))
            .draw()?;
        let unit = [(self.x.high - self.x.low) / wide, (self.y.high - self.y.low) / high];
        for pieces in self.bands() {
            chart.draw_series(
                pieces.into_iter().map(|p| Polygon::new(simplified(p, unit), band())),
            )?;
        }
        for curve in &self.panel.curves {
            let style = stroke(curve.look);
            let points = matches!(curve.look, Look::Points(_));
            let radius = if points && curve.points.len() <= FEW { FEW_RADIUS } else { RADIUS };
            // a line of one point would be invisible
            let (dots, lines): (Vec<_>, Vec<_>) =
                self.pieces(curve).into_iter().partition(|p| points || p.len() == 1);
            chart.draw_series(
                lines.into_iter().map(|p| PathElement::new(simplified(p, unit), style)),
            )?;
            chart.draw_series(
                dots.into_iter().flatten().map(|p| Circle::new(p, units(radius), dot(curve.look))),
            )?;
        }
        let corner = |x: f64, y: f64| (units(x), units(y));
        area.draw(&Rectangle::new(
            [corner(left, top), corner(left + wide, top + high)],
            line(FRAME, 0.75),
        ))?;
        let middle = [left + 0.5 * wide, top + 0.5 * high];
        let centre = Pos::new(HPos::Center, VPos::Center);
        let style = text(LABEL, FontStyle::Normal).pos(centre);
        if self.y.ticks.is_empty() {
            area.draw(&Text::new(
                "no data",
                corner(middle[0], middle[1]),
                style.color(&INK.mix(0.6)),
            ))?;
        }
        let style = text(LABEL, FontStyle::Normal).pos(centre);
        let label = &self.panel.x.label;
        if labelled && !label.is_empty() {
            let place = corner(middle[0], top + high + below + 0.45 * TEXT);
            area.draw(&Text::new(fit(label, LABEL, wide + beside), place, style.clone()))?;
        }
        let label = &self.panel.y.label;
        if !label.is_empty() {
            let place = corner(left - beside + 0.5 * TEXT, middle[1]);
            let style = style.transform(FontTransform::Rotate270);
            area.draw(&Text::new(fit(label, LABEL, high + below), place, style))?;
        }
        Ok(())
    }

    /// Describes the plot at a place in page pixels as JSON. An axis has its range in its own
    /// measure, which is the decimal logarithm on a logarithmic axis.
    pub fn description(&self, plot: [f64; 4]) -> String {
        let axis = |axis: &Axis, ruler: &Ruler| {
            format!(
                "{{\"label\":{},\"low\":{:?},\"high\":{:?},\"log\":{},\"map\":{}}}",
                quoted(&axis.label),
                ruler.low,
                ruler.high,
                axis.scale == Scale::Logarithmic,
                axis.scale == Scale::Map
            )
        };
        let curve = |c: &Curve| {
            let [red, green, blue] = c.look.colour();
            let name = quoted(&c.name);
            format!("{{\"name\":{name},\"colour\":\"#{red:02X}{green:02X}{blue:02X}\"}}")
        };
        let curves: Vec<String> = self.panel.curves.iter().map(curve).collect();
        let bands: Vec<String> = self.panel.bands.iter().map(|b| quoted(&b.name)).collect();
        format!(
            "{{\"at\":{:?},\"x\":{},\"y\":{},\"curves\":[{}],\"bands\":[{}]}}",
            plot.map(units),
            axis(&self.panel.x, &self.x),
            axis(&self.panel.y, &self.y),
            curves.join(","),
            bands.join(",")
        )
    }

    /// Splits a curve at points that do not lie on the axes.
    fn pieces(&self, curve: &Curve) -> Vec<Vec<(f64, f64)>> {
        let (x, y) = (self.panel.x.scale, self.panel.y.scale);
        let points = curve.points.iter().map(|p| Some((place(x, p[0])?, place(y, p[1])?)));
        let pieces = split(points);
        match (self.panel.y.limits, curve.look) {
            (None, _) => pieces.collect(),
            (Some(_), Look::Points(_)) => {
                let within = |p: &(f64, f64)| (self.y.low..=self.y.high).contains(&p.1);
                pieces.map(|piece| piece.into_iter().filter(within).collect()).collect()
            }
            (Some(_), _) => {
                pieces.flat_map(|piece| clipped(&piece, [self.y.low, self.y.high])).collect()
            }
        }
    }

    /// Returns the outlines of the pieces of the bands. If only one edge lies on the axis, the side
    /// of the plot replaces the other.
    fn bands(&self) -> Vec<Vec<Vec<(f64, f64)>>> {
        let (x, y) = (self.panel.x.scale, self.panel.y.scale);
        let edges = |[_, low, high]: &[f64; 3]| match (place(y, *low), place(y, *high)) {
            (None, None) => None,
            _ if low.is_nan() || high.is_nan() => None,
            (low, high) => {
                let [low, high] = [low.unwrap_or(self.y.low), high.unwrap_or(self.y.high)];
                Some([low, high].map(|v| v.clamp(self.y.low, self.y.high)))
            }
        };
        let outline = |b: Vec<(f64, [f64; 2])>| -> Vec<(f64, f64)> {
            let lower = b.iter().map(|(x, [low, _])| (*x, *low));
            lower.chain(b.iter().rev().map(|(x, [_, high])| (*x, *high))).collect()
        };
        let pieces = |b: &crate::Band| {
            split(b.points.iter().map(|p| Some((place(x, p[0])?, edges(p)?))))
                .map(outline)
                .collect()
        };
        self.panel.bands.iter().map(pieces).collect()
    }
}

/// Returns a text as JSON.
fn quoted(text: &str) -> String {
    let escaped = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        c if c.is_control() => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// Returns the runs of values that are present.
fn split<T>(items: impl Iterator<Item = Option<T>>) -> impl Iterator<Item = Vec<T>> {
    let mut items = items;
    std::iter::from_fn(move || {
        let first = items.find_map(|item| item)?;
        let mut run = vec![first];
        run.extend(items.by_ref().map_while(|item| item));
        Some(run)
    })
}
