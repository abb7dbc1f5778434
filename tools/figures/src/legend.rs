//! Legends: names of curves with a sample of each, once for the figure if they are unambiguous,
//! otherwise once per panel.

use crate::look::{Area, Drawn, LABEL, band, clean, dot, stroke, text, units, width};
use crate::{Figure, Look, Panel};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::FontStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Height of a row, page pixels.
const ROW: f64 = 17.0;
/// Width of the sample of a curve, page pixels.
const PIECE: f64 = 22.0;
/// Distance from a sample to its name, and from a name to the next sample, page pixels.
const GAPS: [f64; 2] = [5.0, 14.0];

/// Names with their looks; a band has the look `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend(Vec<(Option<Look>, String)>);

impl Legend {
    /// Lists the entries of a panel.
    pub fn of(panel: &Panel) -> Self {
        let mut legend = Self::default();
        legend.extend(panel);
        legend
    }

    /// Returns one legend for the whole figure, if all panels have the same one, or if each name
    /// has a single look and each look a single name.
    pub fn common(figure: &Figure) -> Option<Self> {
        let mut all = Self::default();
        figure.panels.iter().for_each(|p| all.extend(p));
        let entries = &all.0;
        let unique =
            |k: usize| entries[..k].iter().all(|e| e.0 != entries[k].0 && e.1 != entries[k].1);
        let same = || figure.panels.iter().all(|p| Self::of(p) == all);
        ((0..entries.len()).all(unique) || same()).then_some(all)
    }

    fn extend(&mut self, panel: &Panel) {
        let curves = panel.curves.iter().map(|c| (Some(c.look), clean(&c.name)));
        for entry in curves.chain(panel.bands.iter().map(|b| (None, clean(&b.name)))) {
            if !entry.1.trim().is_empty() && !self.0.contains(&entry) {
                self.0.push(entry);
            }
        }
    }

    /// Returns the position of each entry and the height of all rows, page pixels.
    fn places(&self, room: f64) -> (Vec<[f64; 2]>, f64) {
        let (mut x, mut y) = (0.0, 0.0);
        let mut places = Vec::new();
        for (_, name) in &self.0 {
            let wide = PIECE + GAPS[0] + width(name, LABEL);
            if x > 0.0 && x + wide > room {
                (x, y) = (0.0, y + ROW);
            }
            places.push([x, y]);
            x += wide + GAPS[1];
        }
        (places, if self.0.is_empty() { 0.0 } else { y + ROW })
    }

    /// Returns the height of the legend for a width, page pixels.
    pub fn height(&self, room: f64) -> f64 {
        self.places(room).1
    }

    /// Draws the legend with its upper left corner at a position, page pixels.
    pub fn draw(&self, area: &Area<'_>, [left, top]: [f64; 2], room: f64) -> Drawn {
        let style = text(LABEL, FontStyle::Normal).pos(Pos::new(HPos::Left, VPos::Center));
        for ((look, name), [x, y]) in self.0.iter().zip(self.places(room).0) {
            let (x, y) = (left + x, top + y + 0.5 * ROW);
            let at = |dx: f64, dy: f64| (units(x + dx), units(y + dy));
            match look {
                None => area.draw(&Rectangle::new([at(0.0, -5.0), at(PIECE, 5.0)], band()))?,
                Some(look @ Look::Points(_)) => {
                    let radius = units(crate::panel::RADIUS);
                    area.draw(&Circle::new(at(0.5 * PIECE, 0.0), radius, dot(*look)))?;
                }
                Some(look) => {
                    area.draw(&PathElement::new([at(0.0, 0.0), at(PIECE, 0.0)], stroke(*look)))?
                }
            }
            area.draw(&Text::new(name.as_str(), at(PIECE + GAPS[0], 0.0), style.clone()))?;
        }
        Ok(())
    }
}
