//! Figures for navigation engineers: the estimate of a filter and its uncertainty against the
//! truth.
//!
//! A figure is plain data: panels in a grid, with curves and shaded bands over two axes each.
//! [`svg`] draws it, and the plugin for the rerun viewer shows the same data.
//!
//! ```
//! use navfuse_figures::{Axis, Curve, Figure, Look, Panel, svg};
//! let points = |f: fn(f64) -> f64| (0..300).map(|k| f64::from(k)).map(|t| [t, f(t)]).collect();
//! let curves = vec![
//!     Curve {
//!         name: "error".into(),
//!         look: Look::Data(0),
//!         points: points(|t| 0.1 * (t / 9.0).sin()),
//!     },
//!     Curve {
//!         name: "sigma".into(),
//!         look: Look::Sigma,
//!         points: points(|t| 1.0 / (1.0 + t).sqrt()),
//!     },
//! ];
//! let panel = Panel {
//!     title: "north".into(),
//!     x: Axis::time(),
//!     y: Axis::linear("error [m]"),
//!     curves,
//!     bands: Vec::new(),
//! };
//! let figure = Figure {
//!     name: "position".into(),
//!     title: "Position".into(),
//!     columns: 1,
//!     panels: vec![panel],
//! };
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

/// Panels in a grid, with a common title.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Stem of the file name and entity in a recording, such as `consistency`; not drawn.
    pub name: String,
    /// Title above all panels; none if empty.
    pub title: String,
    /// Number of columns, at least one.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

/// Curves and bands over two axes, whose ranges follow from the data.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Title above the panel; none if empty.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves in the order of drawing, the last on top.
    pub curves: Vec<Curve>,
    /// Bands, drawn below the curves.
    pub bands: Vec<Band>,
}

/// Axis of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Label with the unit: `error [m]`.
    pub label: String,
    /// Scale.
    pub scale: Scale,
    /// Limits of a vertical axis; values outside are cut off. Without limits the axis covers all
    /// values.
    pub limits: Option<[f64; 2]>,
    /// Names of the places 1, 2 and so on of a vertical axis, from below; they replace its numbers and its range.
    pub names: Vec<String>,
}

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Linear scale.
    Linear,
    /// Logarithmic scale, suited to a sigma that falls from kilometres to centimetres. It drops
    /// values that are not positive.
    Logarithmic,
    /// Linear scale in seconds of the run's clock, which a viewer can put on its timeline.
    Time,
    /// Linear scale with equal units on both axes, if both have it: a map.
    Map,
}

impl Axis {
    fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale, limits: None, names: Vec::new() }
    }

    /// Creates a vertical axis with names at the places 1, 2 and so on, from below.
    pub fn of_names(names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let names = names.into_iter().map(Into::into).collect();
        Self { names, ..Self::linear("") }
    }

    /// Returns the axis with limits; none if the lower one is not below the upper one.
    #[must_use]
    pub fn within(self, limits: [f64; 2]) -> Self {
        Self { limits: (limits[0] < limits[1]).then_some(limits), ..self }
    }

    /// Creates a time axis, s of the run's clock.
    pub fn time() -> Self {
        Self::new("time [s]", Scale::Time)
    }

    /// Creates a linear axis.
    pub fn linear(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Linear)
    }

    /// Creates an axis of a map.
    pub fn map(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Map)
    }

    /// Creates a logarithmic axis.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self::new(label, Scale::Logarithmic)
    }
}

/// Line, or single points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend, which lists curves of a panel with the same name and look once, such as
    /// `±3 sigma`.
    pub name: String,
    /// Meaning of the curve, which determines its colour and stroke.
    pub look: Look,
    /// Points (x, y). A NaN breaks the line.
    pub points: Vec<[f64; 2]>,
}

/// Shaded area, such as the 95 % band of a chi-square statistic.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Name in the legend.
    pub name: String,
    /// Points (x, lower edge, upper edge). A NaN breaks the area.
    pub points: Vec<[f64; 3]>,
}

/// Track of a vehicle, which a viewer shows in three dimensions and on a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Name in the legend.
    pub name: String,
    /// Meaning of the track, which determines its colour.
    pub look: Look,
    /// Places in order of time.
    pub points: Vec<TrackPoint>,
}

/// Place of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackPoint {
    /// Time, s of the run's clock.
    pub time: f64,
    /// Position from an origin that all tracks share, m.
    pub north_east_down: [f64; 3],
    /// Latitude and longitude, deg.
    pub latitude_longitude: [f64; 2],
    /// Roll, pitch and yaw, deg, where they are known.
    pub roll_pitch_yaw: Option<[f64; 3]>,
}

/// Meaning of a curve. The colours are those of Okabe and Ito, which colour-blind readers can
/// distinguish.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Look {
    /// Data, measured or computed: a solid line in the k-th of five colours, which then repeat.
    Data(usize),
    /// Uncertainty of a filter: dashed.
    Sigma,
    /// Limit: thin, dark, dotted.
    Bound,
    /// Truth: wide.
    Truth,
    /// Single points in the k-th colour.
    Points(usize),
}

/// Error of drawing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// The drawing library failed.
    #[error("cannot draw the figure {name}: {reason}")]
    Draw {
        /// Name of the figure.
        name: String,
        /// Message of the library.
        reason: String,
    },
}

/// The example in README.md is compiled with the documentation.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
