//! A map of heights: a GeoTIFF, or an ASCII grid of ESRI, which has a header of `ncols`, `nrows`, `xllcorner`
//! or `xllcenter`, `yllcorner` or `yllcenter`, `cellsize` (or `dx` and `dy`, as GDAL writes them) and
//! `NODATA_value`, then the rows from north to south.

use crate::geotiff;

use navfuse_core::nalgebra::convert;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::{Real, number};
use std::collections::BTreeMap;

/// Heights above the ellipsoid on a grid of latitude and longitude.
#[derive(Clone, Debug)]
pub struct Grid {
    columns: usize,
    rows: usize,
    /// Longitude and latitude of the middle of the south-western cell, rad.
    corner: [f64; 2],
    /// Size of a cell along longitude and latitude, rad.
    cell: [f64; 2],
    /// Heights, m, row by row from the south; NaN where the map has none.
    heights: Vec<f64>,
}

/// Largest number of cells.
pub(crate) const MOST: usize = 50_000_000;
/// Largest file, bytes.
pub(crate) const LONGEST: u64 = 1 << 30;

impl Grid {
    /// Reads a map whose coordinates are in degrees.
    ///
    /// # Errors
    /// When the file is neither a GeoTIFF of latitude and longitude nor an ASCII grid, a key of the header
    /// is missing or makes no grid, or the number of heights is another.
    pub fn read(bytes: &[u8]) -> Result<Self, String> {
        if geotiff::is_tiff(bytes) {
            return geotiff::read(bytes);
        }
        let text = std::str::from_utf8(bytes);
        Self::parse(text.map_err(|_| "it is neither a GeoTIFF nor an ASCII grid of ESRI")?)
    }

    /// Reads an ASCII grid.
    fn parse(text: &str) -> Result<Self, String> {
        let mut words = text.split_ascii_whitespace().peekable();
        let mut header = BTreeMap::new();
        while let Some(key) = words.next_if(|word| word.starts_with(|c: char| c.is_alphabetic())) {
            let value = words.next().and_then(|word| word.parse::<f64>().ok());
            let value = value.ok_or_else(|| format!("the header has no number after {key}"))?;
            header.insert(key.to_ascii_lowercase(), value);
        }
        let of = |key: &str| header.get(key).copied();
        let need = |key: &str| of(key).ok_or_else(|| format!("the header has no {key}"));
        let cell = match (of("dx"), of("dy")) {
            (Some(dx), Some(dy)) => [dx, dy],
            _ => [need("cellsize")?; 2],
        };
        let middle = |corner: &str, center: &str, cell: f64| match of(center) {
            Some(center) => Ok(center),
            None => need(corner).map(|corner| corner + cell / 2.0),
        };
        let corner = [
            middle("xllcorner", "xllcenter", cell[0])?,
            middle("yllcorner", "yllcenter", cell[1])?,
        ];
        let whole =
            |n: f64| if n.fract() == 0.0 && (0.0..1e7).contains(&n) { n as usize } else { 0 };
        let size = [whole(need("ncols")?), whole(need("nrows")?)];
        let missing = of("nodata_value").unwrap_or(-9999.0);
        let height = |word: &str| match word.parse() {
            Ok(height) if height == missing => Ok(f64::NAN),
            Ok(height) if !f64::is_infinite(height) => Ok(height),
            _ => Err(format!("{word:?} is no height")),
        };
        Self::new(size, corner, cell, words.map(height).collect::<Result<_, _>>()?)
    }

    /// A grid of columns and rows, whose rows begin in the north. `corner` is the middle of the
    /// south-western cell, longitude and latitude, and `cell` is the size of a cell, both in degrees.
    pub(crate) fn new(
        [columns, rows]: [usize; 2],
        corner: [f64; 2],
        cell: [f64; 2],
        from_north: Vec<f64>,
    ) -> Result<Self, String> {
        let degrees = corner[0].abs() <= 360.0
            && corner[1].abs() <= 90.0
            && cell.iter().all(|cell| *cell > 0.0 && *cell <= 90.0);
        if !(columns >= 2 && rows >= 2 && columns.saturating_mul(rows) <= MOST && degrees) {
            return Err("the header makes no grid of latitude and longitude in degrees, with at \
                        least two rows and columns"
                .into());
        }
        if from_north.len() != columns * rows {
            return Err(format!("{} heights for {columns} x {rows} cells", from_north.len()));
        }
        let heights = from_north.chunks(columns).rev().flatten().copied().collect();
        let (corner, cell) = (corner.map(f64::to_radians), cell.map(f64::to_radians));
        Ok(Self { columns, rows, corner, cell, heights })
    }

    // ANCHOR: height
    /// Height of the bottom (m) at a place, bilinear between the middles of four cells; NaN beyond the
    /// map. The height of the place does not matter.
    pub fn height<T: Real>(&self, place: &Geodetic<T>) -> T {
        let [width, height] = self.cell.map(convert::<f64, T>);
        let turn = (place.longitude - convert(self.corner[0])) / T::two_pi();
        // the longitude may count from -180 deg or from 0 deg
        let turn = turn - convert(number(turn).floor());
        let x = turn * T::two_pi() / width;
        let y = (place.latitude - convert(self.corner[1])) / height;
        let (column, row) = (number(x).floor(), number(y).floor());
        let inside = |k: f64, n: usize| k >= 0.0 && k + 1.0 < n as f64;
        if !(inside(column, self.columns) && inside(row, self.rows)) {
            return convert(f64::NAN);
        }
        let (x, y) = (x - convert(column), y - convert(row));
        let first = row as usize * self.columns + column as usize;
        let at = |k: usize| convert::<f64, T>(self.heights[first + k]);
        let along = |k: usize| at(k) + (at(k + 1) - at(k)) * x;
        along(0) + (along(self.columns) - along(0)) * y
    }
    // ANCHOR_END: height
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const MAP: &str = "ncols 3\nnrows 2\nxllcenter 5\nyllcenter 43\ncellsize 0.01\n\
                       NODATA_value -9999\n-10 -20 -9999\n-30 -50 -70\n";

    fn height(grid: &Grid, latitude: f64, longitude: f64) -> f64 {
        let [latitude, longitude] = [latitude, longitude].map(f64::to_radians);
        grid.height(&Geodetic { latitude, longitude, height: 0.0 })
    }

    /// The first row of the file is the northern one.
    #[test]
    fn a_height_is_bilinear_between_the_middles_of_the_cells() {
        let grid = Grid::read(MAP.as_bytes()).unwrap();
        for (latitude, longitude, expected) in [
            (43.000001, 5.000001, -30.0),
            (43.0099999, 5.000001, -10.0),
            (43.000001, 5.005, -40.0),
            (43.005, 5.005, -27.5),
            (43.005, 365.005, -27.5),
        ] {
            let found = height(&grid, latitude, longitude);
            assert!((found - expected).abs() < 0.02, "{latitude} {longitude}: {found}");
        }
        for (latitude, longitude) in [(43.005, 5.015), (42.99, 5.0), (43.0, 4.99), (43.02, 5.0)] {
            assert!(height(&grid, latitude, longitude).is_nan(), "{latitude} {longitude}");
        }
    }

    #[test]
    fn a_corner_is_half_a_cell_from_its_middle() {
        let corner = MAP
            .replace("xllcenter 5", "XLLCORNER 4.995")
            .replace("yllcenter 43", "yllcorner 42.995");
        let (a, b) = (Grid::read(MAP.as_bytes()).unwrap(), Grid::read(corner.as_bytes()).unwrap());
        assert!((height(&a, 43.004, 5.003) - height(&b, 43.004, 5.003)).abs() < 1e-9);
    }

    #[test]
    fn a_cell_may_have_two_sizes() {
        let oblong = MAP.replace("cellsize 0.01", "dx 0.01\ndy 0.02");
        let grid = Grid::read(oblong.as_bytes()).unwrap();
        assert!((height(&grid, 43.01, 5.005) + 27.5).abs() < 1e-6);
    }

    #[test]
    fn a_file_that_is_no_map_is_refused() {
        for (wrong, right, message) in [
            ("nrows 3", "nrows 2", "6 heights"),
            ("", "cellsize 0.01", "cellsize"),
            ("cellsize 0", "cellsize 0.01", "no grid"),
            ("yllcenter 5e6", "yllcenter 43", "no grid"),
            ("ncols x", "ncols 3", "after ncols"),
            ("-30 1,5 -70", "-30 -50 -70", "no height"),
            ("-30 inf -70", "-30 -50 -70", "no height"),
            ("cellsize inf", "cellsize 0.01", "no grid"),
        ] {
            let error = Grid::read(MAP.replace(right, wrong).as_bytes()).unwrap_err();
            assert!(error.contains(message), "{wrong}: {error}");
        }
    }
}
