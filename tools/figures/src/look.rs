//! Colours, strokes and sizes, the same for every figure.

use crate::{Band, Look};
use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::style::{Color, FontStyle, IntoFont, RGBColor, ShapeStyle, TextStyle};

/// Drawing area of the backend.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Result of drawing an element.
pub type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Drawing units in a page pixel; plotters rounds to whole units, which would show as steps in a
/// curve.
pub const UNITS: f64 = 4.0;

/// Size of a figure's title, page pixels.
pub const FIGURE_TITLE: f64 = 17.0;
/// Size of a panel's title, page pixels.
pub const PANEL_TITLE: f64 = 13.0;
/// Size of axis labels and legends, page pixels.
pub const LABEL: f64 = 12.0;
/// Size of the numbers at the ticks, page pixels.
pub const TICK: f64 = 11.0;

/// Colour of text.
pub const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
/// Colour of frames.
pub const FRAME: RGBColor = RGBColor(0x66, 0x66, 0x66);
/// Colour of grid lines at ticks.
pub const GRID: RGBColor = RGBColor(0xDC, 0xDC, 0xDC);
/// Colour of grid lines between ticks of a logarithmic axis.
pub const FINE_GRID: RGBColor = RGBColor(0xF0, 0xF0, 0xF0);

// Okabe and Ito, "Color Universal Design"; the yellow, too bright for a line on white, fills bands.
// A single curve is blue and the truth is orange, as in the viewer.
const DATA: [RGBColor; 5] = [
    RGBColor(0x00, 0x72, 0xB2), // blue
    RGBColor(0xD5, 0x5E, 0x00), // vermilion
    RGBColor(0x00, 0x9E, 0x73), // bluish green
    RGBColor(0x56, 0xB4, 0xE9), // sky blue
    RGBColor(0x99, 0x99, 0x99), // grey
];
const SIGMA: RGBColor = RGBColor(0xCC, 0x79, 0xA7); // reddish purple
const TRUTH: RGBColor = RGBColor(0xE6, 0x9F, 0x00); // orange
const BOUND: RGBColor = RGBColor(0x33, 0x33, 0x33);
// yellow: blind to red, green or blue, one still tells it from every curve
const BAND: RGBColor = RGBColor(0xF0, 0xE4, 0x42);

/// Converts page pixels to drawing units.
pub fn units(pixels: f64) -> i32 {
    (pixels * UNITS).round() as i32
}

impl Look {
    /// Number of colours of data, after which they repeat.
    pub const COLOURS: usize = DATA.len();

    /// Returns the colour, red, green and blue.
    pub fn colour(self) -> [u8; 3] {
        let RGBColor(red, green, blue) = colour(self);
        [red, green, blue]
    }
}

impl Band {
    /// Colour of every band, red, green and blue, drawn pale.
    pub const COLOUR: [u8; 3] = [BAND.0, BAND.1, BAND.2];
}

fn colour(look: Look) -> RGBColor {
    match look {
        Look::Data(k) | Look::Points(k) => DATA[k % DATA.len()],
        Look::Sigma => SIGMA,
        Look::Bound => BOUND,
        Look::Truth => TRUTH,
    }
}

/// Returns the stroke of a curve.
pub fn stroke(look: Look) -> ShapeStyle {
    let pixels = match look {
        Look::Bound => 1.0,
        Look::Sigma => 1.8,
        Look::Truth => 2.2,
        Look::Data(_) | Look::Points(_) => 1.4,
    };
    line(colour(look), pixels)
}

/// Returns the filling of a point.
pub fn dot(look: Look) -> ShapeStyle {
    ShapeStyle { color: colour(look).to_rgba(), filled: true, stroke_width: 0 }
}

/// Returns a solid stroke of a width in page pixels.
pub fn line(colour: RGBColor, pixels: f64) -> ShapeStyle {
    ShapeStyle {
        color: colour.to_rgba(),
        filled: false,
        stroke_width: units(pixels).unsigned_abs(),
    }
}

/// Returns the filling of a band.
pub fn band() -> ShapeStyle {
    BAND.mix(0.5).filled()
}

/// Returns the style of text of a size in page pixels.
pub fn text(pixels: f64, style: FontStyle) -> TextStyle<'static> {
    // the backend divides by 1.24, as for the size of a box around the letters
    let font = ("sans-serif", pixels * UNITS * 1.24).into_font().style(style);
    TextStyle::from(font).color(&INK)
}

/// Estimates the width of a text in page pixels, rather too wide, since the font is unknown.
pub fn width(text: &str, pixels: f64) -> f64 {
    let letter = |c: char| match c {
        'f' | 'i' | 'j' | 'l' | 'r' | 't' | 'I' | ' ' | '.' | ',' | ':' | ';' | '\'' | '|'
        | '!' | '(' | ')' | '[' | ']' | '-' => 0.36,
        'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.9,
        c if c.is_uppercase() => 0.7,
        c if c.is_ascii_digit() => 0.64,
        c if c.is_ascii() => 0.6,
        _ => 1.0,
    };
    pixels * text.chars().map(letter).sum::<f64>()
}

/// Truncates a text to a width, with an ellipsis.
pub fn fit(text: &str, pixels: f64, room: f64) -> String {
    let text = clean(text);
    if width(&text, pixels) <= room {
        return text;
    }
    let mut left = room - width("…", pixels);
    let fitting = text.chars().take_while(|c| {
        left -= width(c.encode_utf8(&mut [0; 4]), pixels);
        left >= 0.0
    });
    fitting.chain(['…']).collect()
}

/// Removes the control characters that XML does not allow.
pub fn clean(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() || matches!(c, '\u{FFFE}' | '\u{FFFF}') { ' ' } else { c })
        .collect()
}

/// Style sheet for dashes and dots, which the drawing library lacks, selected by the colour of a
/// line.
pub fn style_sheet() -> String {
    let rule = |colour: RGBColor, rule: &str| {
        let RGBColor(r, g, b) = colour;
        format!("svg.navfuse polyline[stroke=\"#{r:02X}{g:02X}{b:02X}\"]{{{rule}}}\n")
    };
    let dashes = |on: f64, off: f64| format!("stroke-dasharray:{} {}", units(on), units(off));
    let joins = "svg.navfuse polyline{stroke-linejoin:round}\n";
    format!(
        "<style>\n{joins}{}{}</style>\n",
        rule(SIGMA, &dashes(7.0, 4.0)),
        rule(BOUND, &dashes(1.5, 2.5))
    )
}
