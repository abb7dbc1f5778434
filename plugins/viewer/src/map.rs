//! The map: its zoom, a graticule with names and a scale, and coastlines, which need no network.

use crate::coast;
use crate::plan::{distance, round};
use crate::recording::Recording;
use crate::strokes::{strokes, width};
use crate::style::{BOUND, Colour, path};
use crate::track::Extent;
use navfuse_core::model::stream::StreamError;
use re_sdk_types::archetypes::GeoLineStrings;
use re_sdk_types::components::Radius;

/// Height and width of the graticule on the map, pixels: it fits into the map of a small window (1280x720),
/// 290 high and 550 wide, with the names of the meridians above it and those of the parallels at its left.
const MAP_PIXELS: [f64; 2] = [244.0, 390.0];
/// Height and width of the map of a usual window (1600x1000), pixels: what is within view.
const VIEW: [f64; 2] = [450.0, 700.0];
/// The size of one pixel of the map at zoom 0 on the equator, m: the circumference of the Earth
/// over the 256 pixels of the one tile.
const MAP_SCALE: f64 = 40_075_016.7 / 256.0;
/// Length of a minute of latitude, m.
const MINUTE: f64 = 1852.0;
/// Height of a letter, and its distance from a line, pixels.
const LETTER: f64 = 10.0;
const APART: f64 = 4.0;
/// Number of meshes over the longer side, about.
const MESHES: f64 = 5.0;
/// Least side of the area, minutes: 2 m.
const LEAST: f64 = 1e-3;
/// Enlargement of the map's projection from which on its title names it: from 80 deg of latitude on.
const STRETCHED: f64 = 5.76;
/// Letters of north and south, and of east and west.
pub const LETTERS: [[char; 2]; 2] = [['N', 'S'], ['E', 'W']];
/// Half the width of a line of the graticule, points. Half a point vanishes between two pixels.
const GRID_WIDTH: f32 = 0.8;
/// Colours of the graticule and of the coast.
const GRID: Colour = [92, 98, 110];
const COAST: Colour = [194, 178, 128];

/// The title of the map of a track. Near a pole it names by how much the map's projection enlarges.
pub fn title(extent: &Extent, graticule: Option<&Graticule>) -> String {
    let mut title = "Map".to_owned();
    let farthest = extent.geo.map(|place| place[0].abs()).into_iter().fold(0.0, f64::max);
    let stretch = 1.0 / farthest.to_radians().cos().abs().max(1e-9);
    if farthest <= 90.0 && stretch > STRETCHED {
        title += &format!(", Mercator: up to x {stretch:.0} near the pole");
    }
    if let Some(graticule) = graticule {
        title += &format!(", {}", graticule.title());
    }
    title
}

/// Lines of equal latitude and longitude around a track.
pub struct Graticule {
    /// Distance of the lines, minutes.
    spacing: f64,
    /// The first and the last line of latitude, and of longitude, in spacings.
    lines: [[f64; 2]; 2],
}

impl Graticule {
    /// The graticule around a track; `None` before the first place, and across the date line.
    pub fn new(extent: &Extent) -> Option<Self> {
        let [low, high] = extent.geo.map(|place| place.map(|degrees| 60.0 * degrees));
        let side = (0..2).map(|k| high[k] - low[k]).fold(LEAST, f64::max);
        if !(low[0] <= high[0] && side < 60.0 * 180.0) {
            return None;
        }
        let spacing = round(side / MESHES);
        let lines = [0, 1].map(|k| [(low[k] / spacing).floor(), (high[k] / spacing).ceil()]);
        Some(Self { spacing, lines })
    }

    /// The zoom of the map at which the graticule fits, which is the middle of the map: a pixel is
    /// `MAP_SCALE cos(latitude) / 2^zoom` metres, of a minute of latitude 1852.
    pub fn zoom(&self) -> f64 {
        let [latitude, longitude] = self.lines.map(|[first, last]| (last - first) * self.spacing);
        let cosine = self.cosine();
        let sides = [MINUTE * latitude, MINUTE * cosine * longitude];
        let scale = |k: usize| MAP_SCALE * cosine * MAP_PIXELS[k] / sides[k].max(1.0);
        scale(0).min(scale(1)).log2().clamp(1.0, 19.0)
    }

    /// Cosine of the latitude in the middle.
    fn cosine(&self) -> f64 {
        let middle = 0.5 * (self.lines[0][0] + self.lines[0][1]) * self.spacing / 60.0;
        middle.to_radians().cos().abs()
    }

    /// The words for a title: the viewer's map draws no labels.
    pub fn title(&self) -> String {
        let decimals = (-self.spacing.log10().floor()).max(0.0) as usize;
        let [latitude, longitude] = self.lines.map(|[first, _]| first * self.spacing);
        let [latitude, longitude] =
            [(latitude, LETTERS[0]), (longitude, LETTERS[1])].map(|(m, s)| angle(m, s, decimals));
        let coast = match self.coast().is_empty() {
            true => String::new(),
            false => format!("; coast to {}", coast::ACCURACY),
        };
        format!("lines every {:.decimals$}' from {latitude} {longitude}{coast}", self.spacing)
    }

    /// Minutes of latitude and of longitude in a pixel at the zoom.
    fn pixels(&self) -> [f64; 2] {
        let cosine = self.cosine().max(1e-3);
        let pixel = MAP_SCALE * cosine / self.zoom().exp2() / MINUTE;
        [pixel, pixel / cosine]
    }

    /// The coastlines within view, deg.
    fn coast(&self) -> Vec<Vec<[f64; 2]>> {
        let pixels = self.pixels();
        let edge = |k: usize, side: f64| {
            let middle = 0.5 * (self.lines[k][0] + self.lines[k][1]) * self.spacing;
            (middle + 0.5 * side * VIEW[k] * pixels[k]) / 60.0
        };
        coast::within([-1.0, 1.0].map(|side| [0, 1].map(|k| edge(k, side))))
    }

    /// Draws the lines.
    pub fn draw(&self, recording: &Recording) -> Result<(), StreamError> {
        let degrees = |line: f64| line * self.spacing / 60.0;
        let lines = |k: usize| {
            let [first, last] = self.lines[k];
            (0..=(last - first) as usize).map(move |n| degrees(first + n as f64))
        };
        let [south, north] = self.lines[0].map(degrees);
        let [west, east] = self.lines[1].map(degrees);
        let parallels = lines(0).map(|latitude| [[latitude, west], [latitude, east]]);
        let meridians = lines(1).map(|longitude| [[south, longitude], [north, longitude]]);
        let lines = GeoLineStrings::from_lat_lon(parallels.chain(meridians))
            .with_colors([GRID])
            .with_radii([Radius::new_ui_points(GRID_WIDTH)]);
        recording.log_static(&path(&["map", "graticule"]), &lines)?;
        let coast = self.coast();
        if !coast.is_empty() {
            let coast = GeoLineStrings::from_lat_lon(coast)
                .with_colors([COAST])
                .with_radii([Radius::new_ui_points(1.0)]);
            recording.log_static(&path(&["map", "coast"]), &coast)?;
        }
        let labels = GeoLineStrings::from_lat_lon(self.labels())
            .with_colors([BOUND])
            .with_radii([Radius::new_ui_points(0.8)]);
        recording.log_static(&path(&["map", "labels"]), &labels)
    }

    /// The names of the lines and a scale as strokes, deg, where no track is: parallels have their names beyond
    /// their west end, meridians in the middle above their north end, and the scale is below the south-east.
    fn labels(&self) -> Vec<Vec<[f64; 2]>> {
        let [[south, north], [west, east]] =
            self.lines.map(|lines| lines.map(|line| line * self.spacing));
        let cosine = (0.5 * (south + north) / 60.0).to_radians().cos().abs().max(1e-3);
        let pixels = self.pixels();
        let write = |text: &str, latitude: f64, longitude: f64| {
            let place = |[x, y]: [f64; 2]| {
                [(latitude + y * pixels[0]) / 60.0, (longitude + x * pixels[1]) / 60.0]
            };
            let all = strokes(text, LETTER).into_iter();
            all.map(|stroke| stroke.into_iter().map(place).collect()).collect::<Vec<_>>()
        };
        let decimals = (-self.spacing.log10().floor()).max(0.0) as usize;
        let names = |k: usize| {
            let [first, last] = self.lines[k];
            let signs = LETTERS[k];
            (0..=(last - first) as usize).map(move |n| {
                let line = (first + n as f64) * self.spacing;
                (line, angle(line, signs, decimals))
            })
        };
        let mut labels = Vec::new();
        for (line, name) in names(0) {
            let start = west - (width(&name, LETTER) + APART) * pixels[1];
            labels.extend(write(&name, line - 0.5 * LETTER * pixels[0], start));
        }
        // names that need more than a mesh leave out every second one, and so on
        let widths = names(1).map(|(_, name)| width(&name, LETTER));
        let wide = widths.fold(0.0, f64::max) + 2.0 * APART;
        let every = (wide * pixels[1] / self.spacing).ceil().max(1.0) as usize;
        for (line, name) in names(1).step_by(every) {
            let middle = line - 0.5 * width(&name, LETTER) * pixels[1];
            // above the half of a letter by which the name of the parallel there is higher
            let above = north + (0.5 * LETTER + 2.0 * APART) * pixels[0];
            labels.extend(write(&name, above, middle));
        }
        // half of the next round length fits into half of the width
        let metres = MINUTE * cosine * (east - west);
        let length = 0.5 * round(0.3 * metres);
        let (name, side) = (distance(length as f32, length as f32), length / MINUTE / cosine);
        let (at, end) = (south - (LETTER + 3.0 * APART) * pixels[0], east);
        let tick = at + APART * pixels[0];
        let bar = [[tick, end - side], [at, end - side], [at, end], [tick, end]];
        labels.push(bar.map(|place| place.map(|minutes| minutes / 60.0)).to_vec());
        let start = end - width(&name.replace(' ', ""), LETTER) * pixels[1];
        labels.extend(write(&name.replace(' ', ""), tick + APART * pixels[0], start));
        labels
    }
}

/// An angle in degrees and minutes, such as `43°06.2'N`.
pub fn angle(minutes: f64, [positive, negative]: [char; 2], decimals: usize) -> String {
    let side = if minutes < 0.0 { negative } else { positive };
    // a whole number of the last decimal
    let unit = 10f64.powi(decimals as i32);
    let whole = (minutes.abs() * unit).round();
    let (degrees, minutes) = ((whole / (60.0 * unit)).floor(), whole % (60.0 * unit) / unit);
    let width = if decimals > 0 { 3 + decimals } else { 2 };
    format!("{degrees:.0}°{minutes:0width$.decimals$}'{side}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(geo: [[f64; 2]; 2]) -> Extent {
        Extent { low: [0.0; 3], high: [500.0, 1200.0, 30.0], geo }
    }

    /// 5 minutes of latitude are 9260 m, and at 60 deg 4 minutes of longitude 3704 m: the height
    /// decides.
    #[test]
    fn the_graticule_spans_the_intended_pixels_of_the_map() {
        let lines = [[3597.5, 3602.5], [0.0, 4.0]];
        let zoom = Graticule { spacing: 1.0, lines }.zoom();
        // at zoom z a pixel is the circumference cos(latitude) / 256 / 2^z metres
        let pixel = 40_075_016.7 * 0.5 / 256.0 / zoom.exp2();
        assert!((9260.0 / pixel - MAP_PIXELS[0]).abs() < 1e-6, "{pixel} m");
    }

    #[test]
    fn a_graticule_names_its_corner_and_surrounds_the_track() {
        // 43 deg 6.24' N 5 deg 21.38' W, with a longer side of 1.02'
        let geo = [[43.104, -5.3733], [43.121, -5.3563]];
        let graticule = Graticule::new(&extent(geo));
        let title = graticule.as_ref().map(Graticule::title);
        assert_eq!(title.as_deref(), Some("lines every 0.5' from 43°06.0'N 5°22.5'W"));
        assert_eq!(graticule.map(|g| g.lines), Some([[5172.0, 5175.0], [-645.0, -642.0]]));
        assert!(Graticule::new(&Extent::NONE).is_none());
    }

    /// At 60 deg the projection enlarges by two, and at 89 deg by 57; a track around the pole has no
    /// graticule.
    #[test]
    fn near_a_pole_the_title_names_how_much_the_projection_enlarges() {
        let titled = |south: f64, north: f64, west: f64| {
            let extent = extent([[south, west], [north, 5.01]]);
            title(&extent, Graticule::new(&extent).as_ref())
        };
        assert!(titled(59.99, 60.0, 5.0).starts_with("Map, lines every"));
        let polar = titled(88.99, 89.0, 5.0);
        assert!(polar.starts_with("Map, Mercator: up to x 57 near the pole, lines"), "{polar}");
        assert_eq!(titled(88.99, 89.0, -180.0), "Map, Mercator: up to x 57 near the pole");
        assert_eq!(title(&Extent::NONE, None), "Map");
    }

    /// Off Brittany, 3 km from Pointe du Raz, the coast is within view; in the Gulf of Lions it is not.
    #[test]
    fn a_coast_is_drawn_where_it_is_within_view() {
        let view = |[latitude, longitude]: [f64; 2]| {
            let geo = [[latitude, longitude], [latitude + 0.03, longitude + 0.03]];
            Graticule::new(&extent(geo)).map(|g| (g.coast().len(), g.title()))
        };
        let near = view([48.01, -4.77]).unwrap_or_default();
        assert!(near.0 > 0 && near.1.ends_with("; coast to 3 km"), "{near:?}");
        let far = view([43.0, 5.0]).unwrap_or_default();
        assert!(far.0 == 0 && !far.1.contains("coast"), "{far:?}");
    }

    /// No track is outside of the graticule. The four parallels have their names west of it, the meridians
    /// above it, each in the middle of its line, and the scale is below it.
    #[test]
    fn names_are_beyond_the_ends_of_their_lines() {
        let graticule = Graticule::new(&extent([[43.104, -5.3733], [43.121, -5.3563]]));
        let labels = graticule.map(|g| g.labels()).unwrap_or_default();
        let points = || labels.iter().flatten();
        // half a mesh, 0.25', beside the first or the last line, and above the name of the last parallel
        let above = |[lat, lon]: &[f64; 2]| {
            (43.126..43.128).contains(lat) && (-5.375 - 0.0042..-5.35 + 0.0042).contains(lon)
        };
        // a graticule of 1.5' is 244 pixels high: half a letter, 5 pixels, above and below a line
        let half = 5.01 * 1.5 / 244.0 / 60.0;
        let beside = |[lat, lon]: &[f64; 2]| {
            let line = (lat * 120.0).round() / 120.0;
            (lat - line).abs() < half && *lon < -5.375
        };
        // 22 pixels below the last parallel
        let below = |[lat, lon]: &[f64; 2]| {
            (43.1 - 4.4 * half..43.1).contains(lat) && (-5.375..-5.35 + 1e-9).contains(lon)
        };
        assert!(points().all(|p| above(p) || beside(p) || below(p)), "{labels:?}");
        assert!(points().any(below));
        // 9 letters with a stroke at least, four times, and the scale
        assert!(labels.len() > 37, "{}", labels.len());
    }

    #[test]
    fn an_angle_rounds_its_minutes_up_to_a_degree() {
        assert_eq!(angle(59.99999, ['N', 'S'], 1), "1°00.0'N");
        assert_eq!(angle(-61.0, ['N', 'S'], 0), "1°01'S");
    }
}
