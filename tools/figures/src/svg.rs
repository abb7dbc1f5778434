//! SVG output: positions of the title, legends and panels.

use crate::legend::Legend;
use crate::look::{Area, Drawn, FIGURE_TITLE, PANEL_TITLE, UNITS, fit, style_sheet, text, units};
use crate::panel::{Prepared, is_map};
use crate::{Figure, FigureError, Panel};
use plotters::backend::SVGBackend;
use plotters::drawing::IntoDrawingArea;
use plotters::element::Text;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, WHITE};

/// Width of a figure, page pixels; a figure is wider if its columns would be narrower than
/// `NARROWEST`.
const WIDTH: f64 = 900.0;
const NARROWEST: f64 = 180.0;
/// Distance at the edges of a figure and between panels, page pixels.
const GAP: f64 = 12.0;
/// Height of a title, page pixels.
const TITLES: [f64; 2] = [28.0, 20.0];

/// Attributes with default values that the backend writes for every point, a third of the file.
/// Quotation marks in texts are escaped, so every match is an attribute.
const DEFAULTS: [&str; 2] = [" opacity=\"1\"", " stroke=\"none\" stroke-width=\"0\""];
/// Attributes of nearly every text, which stand once at the root: all other elements have their own `fill`.
const SHARED: [&str; 2] = [" font-family=\"sans-serif\"", " fill=\"#222222\""];

/// Draws a figure for a width of 900 pixels. The same figure always gives the same bytes.
///
/// Points that are not finite or, on a logarithmic axis, not positive, are left out. A panel
/// without any points shows "no data".
///
/// # Errors
/// Returns an error if the drawing library fails.
pub fn svg(figure: &Figure) -> Result<String, FigureError> {
    let layout = Layout::new(figure);
    let size = [layout.width, layout.height].map(|s| units(s).unsigned_abs());
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, (size[0], size[1])).into_drawing_area();
    let drawn = layout.draw(&area).and_then(|()| area.present());
    drop(area);
    drawn.map_err(|e| FigureError::Draw { name: figure.name.clone(), reason: e.to_string() })?;
    // the drawing has finer units than the page
    let tag = format!("width=\"{}\" height=\"{}\"", size[0], size[1]);
    let page = size.map(|s| f64::from(s) / UNITS);
    let svg = svg.replacen(
        &tag,
        &format!(
            "class=\"navfuse\" width=\"{}\" height=\"{}\" data-plots='{}'",
            page[0],
            page[1],
            escaped(&layout.plots())
        ),
        1,
    );
    let svg = svg.replacen(">\n", &format!(">\n{}", style_sheet()), 1);
    let without = |svg: String, attribute: &&str| svg.replace(attribute, "");
    let svg = DEFAULTS.iter().chain(&SHARED).fold(svg, without);
    let svg = svg.replacen("class=", &format!("{} class=", SHARED.concat().trim_start()), 1);
    Ok(with_dots(&svg))
}

/// Draws the dots of a curve as one path, which needs a quarter of the bytes of their circles.
fn with_dots(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    let mut before = None;
    for line in svg.split_inclusive('\n') {
        let parts: Vec<&str> = line.trim_end().split('"').collect();
        let (place, look) = match parts[..] {
            ["<circle cx=", x, " cy=", y, " r=", r, " fill=", fill, "/>"] => {
                (Some((x, y)), Some((r, fill)))
            }
            _ => (None, None),
        };
        if look != before {
            if before.is_some() {
                out.push_str("\"/>\n");
            }
            if let Some((r, fill)) = look {
                let width = 2.0 * r.parse().unwrap_or(0.0);
                out.push_str(&format!(
                    "<path class=\"dots\" fill=\"none\" stroke=\"{fill}\" stroke-width=\"{width}\" \
                     stroke-linecap=\"round\" d=\""
                ));
            }
        }
        match place {
            Some((x, y)) => out.push_str(&format!("M{x} {y}h0")),
            None => out.push_str(line),
        }
        before = look;
    }
    out
}

struct Layout<'a> {
    figure: &'a Figure,
    width: f64,
    height: f64,
    /// Position below the title, if there is one.
    legend: Option<(Legend, f64)>,
    cells: Vec<Cell<'a>>,
}

/// Panel with its position.
struct Cell<'a> {
    panel: &'a Panel,
    prepared: Prepared<'a>,
    legend: Legend,
    /// Left, top, width and height of the plot.
    plot: [f64; 4],
    /// Set if the horizontal axis has a label; the panel below has the same one otherwise.
    labelled: bool,
}

/// Escapes a text for an attribute in single quotation marks, of which JSON has few.
fn escaped(text: &str) -> String {
    let replace = [('&', "&amp;"), ('\'', "&#39;"), ('<', "&lt;"), ('>', "&gt;")];
    replace.iter().fold(text.to_owned(), |text, (c, by)| text.replace(*c, by))
}

impl<'a> Layout<'a> {
    fn new(figure: &'a Figure) -> Self {
        let columns = figure.columns.clamp(1, figure.panels.len().max(1));
        let width = WIDTH.max(NARROWEST * columns as f64);
        let wide = (width - GAP) / columns as f64; // including the gap at its right
        let maps = figure.panels.iter().any(is_map);
        let high =
            if maps { (0.75 * wide).clamp(130.0, 460.0) } else { (0.5 * wide).clamp(130.0, 260.0) };
        let prepared: Vec<_> =
            figure.panels.iter().map(|p| Prepared::new(p, [wide - 60.0, high])).collect();
        // the plots of a column leave room for its widest numbers
        let widest = |of: fn(&Prepared<'a>) -> f64| -> Vec<f64> {
            let column = |c| {
                prepared.iter().skip(c).step_by(columns).map(of).fold(0.0, f64::max).min(0.5 * wide)
            };
            (0..columns).map(column).collect()
        };
        let (left, right) = (widest(Prepared::left), widest(Prepared::right));
        let mut y = if figure.title.is_empty() { GAP } else { GAP + TITLES[0] };
        let common = Legend::common(figure);
        let legend = common.clone().map(|l| (l, y));
        if let Some((legend, _)) = &legend {
            y += legend.height(width - 2.0 * GAP) + 0.5 * GAP;
        }
        let mut cells: Vec<Cell<'a>> = Vec::new();
        let mut prepared = prepared.into_iter().enumerate();
        for row in figure.panels.chunks(columns) {
            let own = |p: &Panel| if common.is_some() { Legend::default() } else { Legend::of(p) };
            let room = |c: usize| wide - left[c] - right[c].max(GAP);
            let tallest =
                row.iter().enumerate().map(|(c, p)| own(p).height(room(c))).fold(0.0, f64::max);
            let titles = if row.iter().all(|p| p.title.is_empty()) { 0.5 * GAP } else { TITLES[1] };
            let mut below: f64 = 0.0;
            for (c, (panel, (k, mut prepared))) in row.iter().zip(prepared.by_ref()).enumerate() {
                let labelled =
                    figure.panels.get(k + columns).is_none_or(|p| p.x.label != panel.x.label);
                below = below.max(prepared.below(labelled));
                let plot = [GAP + c as f64 * wide + left[c], y + titles + tallest, room(c), high];
                prepared.fit([plot[2], plot[3]]);
                cells.push(Cell { panel, prepared, legend: own(panel), plot, labelled });
            }
            y += titles + tallest + high + below + 0.5 * GAP;
        }
        if figure.panels.is_empty() {
            y += TITLES[0];
        }
        Self { figure, width, height: (y + 0.5 * GAP).ceil(), legend, cells }
    }

    /// Describes the plots as JSON, for a script that shows values: the place in drawing units, the
    /// axes, and the names and colours of the curves.
    fn plots(&self) -> String {
        let plots: Vec<String> =
            self.cells.iter().map(|c| c.prepared.description(c.plot)).collect();
        format!("[{}]", plots.join(","))
    }

    fn draw(&self, area: &Area<'_>) -> Drawn {
        area.fill(&WHITE)?;
        let title = |title: &str, size: f64, left: f64, middle: f64, room: f64| {
            let style = text(size, FontStyle::Bold).pos(Pos::new(HPos::Left, VPos::Center));
            area.draw(&Text::new(fit(title, size, room), (units(left), units(middle)), style))
        };
        if !self.figure.title.is_empty() {
            title(
                &self.figure.title,
                FIGURE_TITLE,
                GAP,
                GAP + 0.35 * TITLES[0],
                self.width - 2.0 * GAP,
            )?;
        }
        if let Some((legend, top)) = &self.legend {
            legend.draw(area, [GAP, *top], self.width - 2.0 * GAP)?;
        }
        for cell in &self.cells {
            let [left, top, wide, _] = cell.plot;
            let top = top - cell.legend.height(wide);
            cell.legend.draw(area, [left, top], wide)?;
            if !cell.panel.title.is_empty() {
                title(&cell.panel.title, PANEL_TITLE, left, top - 0.5 * TITLES[1], wide)?;
            }
            cell.prepared.draw(area, cell.plot, cell.labelled)?;
        }
        if self.cells.is_empty() {
            let style =
                text(PANEL_TITLE, FontStyle::Normal).pos(Pos::new(HPos::Center, VPos::Center));
            area.draw(&Text::new(
                "no data",
                (units(0.5 * self.width), units(self.height - 1.5 * GAP)),
                style,
            ))?;
        }
        Ok(())
    }
}
