//! A map of heights, as an ASCII grid of ESRI: a header of `ncols`, `nrows`, `xllcorner` or `xllcenter`,
//! `yllcorner` or `yllcenter`, `cellsize` and `NODATA_value`, then the rows from north to south.

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
    /// Size of a cell, rad.
    cell: f64,
    /// Heights, m, row by row from the south; NaN where the map has none.
    heights: Vec<f64>,
}

/// Largest number of cells.
const MOST: usize = 50_000_000;
/// Largest file, bytes.
pub(crate) const LONGEST: u64 = 1 << 30;

impl Grid {
    /// Reads an ASCII grid whose coordinates are in degrees.
    ///
    /// # Errors
    /// When a key of the header is missing or makes no grid, or the number of heights is another.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut words = text.split_ascii_whitespace().peekable();
        let mut header = BTreeMap::new();
        while let Some(key) = words.next_if(|word| word.starts_with(|c: char| c.is_alphabetic())) {
            let value = words.next().and_then(|word| word.parse::<f64>().ok());
            let value = value.ok_or_else(|| format!("the header has no number after {key}"))?;
            header.insert(key.to_ascii_lowercase(), value);
        }
        let of = |key: &str| header.get(key).copied();
        let need = |key: &str| of(key).ok_or_else(|| format!("the header has no {key}"));
        let cell = need("cellsize")?;
        let middle = |corner: &str, center: &str| match of(center) {
            Some(center) => Ok(center),
            None => need(corner).map(|corner| corner + cell / 2.0),
        };
        let corner = [middle("xllcorner", "xllcenter")?, middle("yllcorner", "yllcenter")?];
        let (columns, rows) = (need("ncols")?, need("nrows")?);
        let fits = |n: f64| n.fract() == 0.0 && (2.0..1e7).contains(&n);
        let degrees =
            corner[0].abs() <= 360.0 && corner[1].abs() <= 90.0 && cell > 0.0 && cell <= 90.0;
        if !(fits(columns) && fits(rows) && columns * rows <= MOST as f64 && degrees) {
            return Err("the header makes no grid of latitude and longitude in degrees, with at \
                        least two rows and columns"
                .into());
        }
        let (columns, rows) = (columns as usize, rows as usize);
        let missing = of("nodata_value").unwrap_or(-9999.0);
        let height = |word: &str| match word.parse() {
            Ok(height) if height == missing => Ok(f64::NAN),
            Ok(height) if !f64::is_infinite(height) => Ok(height),
            _ => Err(format!("{word:?} is no height")),
        };
        let from_north: Vec<f64> = words.map(height).collect::<Result<_, _>>()?;
        if from_north.len() != columns * rows {
            return Err(format!("{} heights for {columns} x {rows} cells", from_north.len()));
        }
        let heights = from_north.chunks(columns).rev().flatten().copied().collect();
        let [longitude, latitude] = corner.map(f64::to_radians);
        Ok(Self { columns, rows, corner: [longitude, latitude], cell: cell.to_radians(), heights })
    }

    /// Height of the bottom (m) at a place, bilinear between the middles of four cells; NaN beyond the
    /// map. The height of the place does not matter.
    pub fn height<T: Real>(&self, place: &Geodetic<T>) -> T {
        let cell = convert::<f64, T>(self.cell);
        let turn = (place.longitude - convert(self.corner[0])) / T::two_pi();
        // the longitude may count from -180 deg or from 0 deg
        let turn = turn - convert(number(turn).floor());
        let x = turn * T::two_pi() / cell;
        let y = (place.latitude - convert(self.corner[1])) / cell;
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
        let grid = Grid::parse(MAP).unwrap();
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
        let (a, b) = (Grid::parse(MAP).unwrap(), Grid::parse(&corner).unwrap());
        assert!((height(&a, 43.004, 5.003) - height(&b, 43.004, 5.003)).abs() < 1e-9);
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
            let error = Grid::parse(&MAP.replace(right, wrong)).unwrap_err();
            assert!(error.contains(message), "{wrong}: {error}");
        }
    }
}
