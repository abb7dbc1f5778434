//! A map of heights as a GeoTIFF (OGC 19-008r4): one band on a grid of latitude and longitude.

use crate::grid::{Grid, MOST};
use std::io::Cursor;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

/// `GTModelTypeGeoKey` and its value for latitude and longitude.
const MODEL: (u16, u16) = (1024, 2);
/// `GTRasterTypeGeoKey` and its value where a tie point is the middle of a cell and not its corner.
const RASTER: (u16, u16) = (1025, 2);
const REMEDY: &str = "write it anew with gdalwarp -t_srs EPSG:4326";

/// Returns whether a file begins as a TIFF or a BigTIFF of either byte order.
pub(crate) fn is_tiff(bytes: &[u8]) -> bool {
    [b"II\x2a\0", b"MM\0\x2a", b"II\x2b\0", b"MM\0\x2b"].iter().any(|m| bytes.starts_with(*m))
}

/// Reads the map in the first image of a file.
pub(crate) fn read(bytes: &[u8]) -> Result<Grid, String> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 8 * MOST;
    let readable = |e: TiffError| format!("the TIFF cannot be read: {e}");
    let mut tiff = Decoder::new(Cursor::new(bytes)).map_err(readable)?.with_limits(limits);
    let (columns, rows) = tiff.dimensions().map_err(readable)?;
    let heights_only = matches!(
        tiff.colortype().map_err(readable)?,
        ColorType::Gray(_) | ColorType::Multiband { num_samples: 1, .. }
    );
    if !heights_only {
        return Err("it has more than one band: a map has one band of heights".into());
    }
    let numbers = |tiff: &mut Decoder<_>, tag| tiff.get_tag_f64_vec(tag).unwrap_or_default();
    let (scale, tie) =
        (numbers(&mut tiff, Tag::ModelPixelScaleTag), numbers(&mut tiff, Tag::ModelTiepointTag));
    let (&[width, height, ..], &[i, j, _, longitude, latitude, ..]) = (&scale[..], &tie[..]) else {
        let lacks =
            "it has no ModelPixelScale with ModelTiepoint, which place the map on the Earth";
        return Err(format!("{lacks}: {REMEDY}"));
    };
    let keys = tiff.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).unwrap_or_default();
    // a key is four numbers, of which the last is the value where it fits
    let key = |id| keys.chunks_exact(4).skip(1).find(|key| key[0] == id).map(|key| key[3]);
    if key(MODEL.0).is_some_and(|model| model != MODEL.1) {
        return Err(format!("its axes are those of a projection: {REMEDY}"));
    }
    let to_middle = if key(RASTER.0) == Some(RASTER.1) { 0.0 } else { 0.5 };
    let missing = tiff.get_tag_ascii_string(Tag::GdalNodata).ok();
    let missing = missing.and_then(|text| text.trim_matches(['\0', ' ']).parse::<f64>().ok());
    let west = longitude + (to_middle - i) * width;
    let north = latitude - (to_middle - j) * height;
    let heights = match tiff.read_image().map_err(readable)? {
        DecodingResult::U8(cells) => numbers_of(cells),
        DecodingResult::U16(cells) => numbers_of(cells),
        DecodingResult::U32(cells) => numbers_of(cells),
        DecodingResult::I8(cells) => numbers_of(cells),
        DecodingResult::I16(cells) => numbers_of(cells),
        DecodingResult::I32(cells) => numbers_of(cells),
        // the value of a missing cell is stated in double precision, and stored in single
        DecodingResult::F32(cells) => {
            let single = missing.map(|missing| missing as f32);
            let known = |cell: f32| if Some(cell) == single { f64::NAN } else { f64::from(cell) };
            cells.into_iter().map(known).collect()
        }
        DecodingResult::F64(cells) => cells,
        _ => return Err("its heights are neither floats nor whole numbers of 32 bits".into()),
    };
    let known = |height: f64| if Some(height) == missing { f64::NAN } else { height };
    let from_north = heights.into_iter().map(known).collect();
    let south = north - (f64::from(rows) - 1.0) * height;
    Grid::new([columns as usize, rows as usize], [west, south], [width, height], from_north)
}

fn numbers_of<T: Into<f64>>(cells: Vec<T>) -> Vec<f64> {
    cells.into_iter().map(Into::into).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use navfuse_core::state::geodesy::Geodetic;
    use tiff::encoder::{TiffEncoder, colortype};

    /// Three columns and two rows, the first one in the north, whose north-western corner, or its
    /// middle, is at 43 N and 5 E.
    fn map(keys: &[u16], tags: bool) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let mut image = encoder.new_image::<colortype::Gray32Float>(3, 2).unwrap();
        let directory = image.encoder();
        if tags {
            let tie = [0.0, 0.0, 0.0, 5.0, 43.0, 0.0];
            directory.write_tag(Tag::ModelPixelScaleTag, &[0.01, 0.02, 0.0][..]).unwrap();
            directory.write_tag(Tag::ModelTiepointTag, &tie[..]).unwrap();
        }
        directory.write_tag(Tag::GdalNodata, "-3.4028234663852886e+38").unwrap();
        let keys = [&[1, 1, 0, keys.len() as u16 / 4], keys].concat();
        directory.write_tag(Tag::GeoKeyDirectoryTag, &keys[..]).unwrap();
        image.write_data(&[-10.0, -20.0, f32::MIN, -30.0, -50.0, -70.0]).unwrap();
        file.into_inner()
    }

    fn height(grid: &Grid, latitude: f64, longitude: f64) -> f64 {
        let [latitude, longitude] = [latitude, longitude].map(f64::to_radians);
        grid.height(&Geodetic { latitude, longitude, height: 0.0 })
    }

    #[test]
    fn the_tie_point_is_a_corner_or_the_middle_of_a_cell() {
        for (keys, [north, west]) in [
            (&[1024_u16, 0, 1, 2, 1025, 0, 1, 1][..], [42.99, 5.005]),
            (&[1024, 0, 1, 2, 1025, 0, 1, 2], [43.0, 5.0]),
            (&[], [42.99, 5.005]),
        ] {
            let grid = read(&map(keys, true)).unwrap();
            for (south, east, expected) in
                [(1e-9, 1e-9, -10.0), (0.02 - 1e-9, 0.01 - 1e-9, -50.0), (0.01, 0.005, -27.5)]
            {
                let found = height(&grid, north - south, west + east);
                assert!((found - expected).abs() < 1e-3, "{keys:?} {south} {east}: {found}");
            }
            assert!(height(&grid, north - 0.01, west + 0.015).is_nan(), "a cell is missing");
        }
    }

    #[test]
    fn a_tiff_that_is_no_map_of_latitude_and_longitude_is_refused() {
        for (file, message) in [
            (map(&[1024, 0, 1, 1], true), "projection"),
            (map(&[], false), "ModelTiepoint"),
            (map(&[], true)[..40].to_vec(), "cannot be read"),
        ] {
            let error = read(&file).unwrap_err();
            assert!(error.contains(message), "{message}: {error}");
        }
    }
}
