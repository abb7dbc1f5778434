//! Figures for navigation engineers: what a filter believes against what is true, over time or over anything else.
//!
//! A figure is plain data: panels in a grid, each with curves and shaded bands over two axes. [`svg`] draws it; the
//! plugin for the rerun viewer shows the same data.
//!
//! ```
//! use navfuse_figures::{Axis, Curve, Figure, Look, Panel, svg};
//! let points = |f: fn(f64) -> f64| (0..300).map(|k| f64::from(k)).map(|t| [t, f(t)]).collect();
//! let curves = vec![
//!     Curve { name: "error".into(), look: Look::Data(0), points: points(|t| 0.1 * (t / 9.0).sin()) },
//!     Curve { name: "sigma".into(), look: Look::Sigma, points: points(|t| 1.0 / (1.0 + t).sqrt()) },
//! ];
//! let panel =
//!     Panel { title: "north".into(), x: Axis::time(), y: Axis::linear("error [m]"), curves, bands: Vec::new() };
//! let figure = Figure { name: "position".into(), title: "Position".into(), columns: 1, panels: vec![panel] };
//! assert!(svg(&figure)?.starts_with("<svg "));
//! # Ok::<(), navfuse_figures::FigureError>(())
//! ```

mod legend;
mod line;
mod look;
mod panel;
mod scale;
mod svg;

pub use svg::svg;

/// Panels in a grid, under one title.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// The stem of its file and its entity in a recording, such as `consistency`; not drawn.
    pub name: String,
    /// Above all panels; none where empty.
    pub title: String,
    /// Panels side by side, at least one.
    pub columns: usize,
    /// Row by row.
    pub panels: Vec<Panel>,
}

/// Curves and bands over two axes, whose ranges follow from them.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Above the panel; none where empty.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// In the order in which they are drawn, the last on top.
    pub curves: Vec<Curve>,
    /// Drawn below the curves.
    pub bands: Vec<Band>,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// With its unit: `error [m]`.
    pub label: String,
    /// How values lie on it.
    pub scale: Scale,
    /// Of a vertical axis: from where to where it goes; what lies beyond is cut off. Without it goes as far as the values.
    pub limits: Option<[f64; 2]>,
}

/// How values lie on an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By decades: right for a sigma that falls from kilometres to centimetres. What is not positive is left out.
    Logarithmic,
    /// Evenly, and in seconds of the run's clock, so that a viewer can put it on its timeline.
    Time,
    /// Evenly, and where both axes of a panel have it, with the same length for a unit: a map.
    Map,
}

impl Axis {
    fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale, limits: None }
    }

    /// The same axis between limits; without them where the lower one is not below the other.
    #[must_use]
    pub fn within(self, limits: [f64; 2]) -> Self {
        Self { limits: (limits[0] < limits[1]).then_some(limits), ..self }
    }

    /// The run's clock, s.
    pub fn time() -> Self {
        Self::new("time [s]", Scale::Time)
    }

    /// A linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Linear)
    }

    /// An axis of a map.
    pub fn map(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Map)
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Logarithmic)
    }
}

/// A line, or points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// In the legend, once for all curves of a panel that have the same name and look, such as `±3 sigma`.
    pub name: String,
    /// What it means, and so how it looks.
    pub look: Look,
    /// x and y. A NaN breaks the line.
    pub points: Vec<[f64; 2]>,
}

/// A shaded area, such as what a chi-square statistic stays in with 95 %.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// In the legend.
    pub name: String,
    /// x, the lower and the upper edge. A NaN breaks the area.
    pub points: Vec<[f64; 3]>,
}

/// What a curve means. The colours are of Okabe and Ito, and told apart by the colour-blind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Look {
    /// What was measured or computed: the k-th colour, solid. There are five; then they repeat.
    Data(usize),
    /// What a filter believes: dashed.
    Sigma,
    /// A limit: thin, dark, dotted.
    Bound,
    /// What is true: wide.
    Truth,
    /// Single points in the k-th colour.
    Points(usize),
}

/// Why a figure could not be drawn.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The drawing library gave up.
    #[error("cannot draw the figure {name}: {reason}")]
    Draw {
        /// The figure's name.
        name: String,
        /// What the library says.
        reason: String,
    },
}

/// The example in README.md is compiled with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
