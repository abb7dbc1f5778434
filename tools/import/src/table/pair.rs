//! A position whose latitude and longitude stand in one cell, such as `57.1 N 11.9 E` or `(57.1, 11.9)`.

use super::columns::Table;
use super::vocabulary::words;
use navfuse_core::document::quoted;
use navfuse_csv::coordinates;

/// Words for such a column, of which a text without N, S, E and W needs one.
pub const NAMES: [&str; 16] = [
    "position",
    "pos",
    "coordinates",
    "coordinate",
    "coord",
    "coords",
    "location",
    "latlon",
    "latlong",
    "latlng",
    "lonlat",
    "point",
    "geometry",
    "geom",
    "gps",
    "gnss",
];
/// Share of the cells that must have both.
const SHARE: f64 = 0.9;
/// Largest latitude, deg.
const POLE: f64 = 90.0;

/// The order of the text of a position, as a notation.
pub const LATITUDE_FIRST: &str = "latitude-longitude";
pub const LONGITUDE_FIRST: &str = "longitude-latitude";

/// What is asked of a text that does not show its order.
pub const ORDER: &str = "the order of latitude and longitude is assumed";

/// Tests whether a text names north or east, or is a point, which has its order.
fn sided(cell: &str) -> bool {
    cell.contains(['N', 'S', 'E', 'W'])
}

impl Table<'_> {
    /// The keys of a position in one column, and a question.
    pub(super) fn in_one_column(&self) -> Option<(Vec<String>, String)> {
        let (k, order) = (0..self.layout.width()).find_map(|k| Some((k, self.pair(k)?)))?;
        let column = quoted(self.heading(k));
        let key = |channel: &str| {
            let unit = if channel == "height" { "m" } else { "deg" };
            format!(
                "columns.{channel} = {{ column = {column}, unit = \"{unit}\", notation = \"{order}\" }}"
            )
        };
        let cells = self.layout.rows.iter().filter_map(|row| row.get(k)).filter(|c| !c.is_empty());
        let high = cells
            .filter_map(|cell| coordinates(cell, order == LONGITUDE_FIRST))
            .all(|[.., height]| height.is_finite());
        let channels: &[&str] = if high && !self.has(&["height"]) {
            &["lat", "lon", "height"]
        } else {
            &["lat", "lon"]
        };
        let question =
            match self.layout.rows.iter().filter_map(|row| row.get(k)).all(|cell| sided(cell)) {
                true => format!("{column} is taken for a latitude and a longitude"),
                false => {
                    format!("{column} is taken for a latitude and a longitude, {order}: {ORDER}")
                }
            };
        Some((channels.iter().map(|channel| key(channel)).collect(), question))
    }

    /// The order of latitude and longitude in the cells of a column; `None` for another column.
    fn pair(&self, k: usize) -> Option<&'static str> {
        let cells =
            || self.layout.rows.iter().filter_map(|row| row.get(k)).filter(|c| !c.is_empty());
        let name = words(self.heading(k));
        let named = name.iter().any(|word| NAMES.contains(&word.as_str()))
            || NAMES.contains(&name.concat().as_str());
        let sided = sided(cells().next()?);
        let several = |cell: &&String| cell.parse::<f64>().is_err();
        let fits = |order: bool| {
            let both = cells().filter(several).filter(|c| coordinates(c, order).is_some()).count();
            both as f64 > SHARE * cells().count() as f64
        };
        if !named && !sided {
            return None;
        }
        let longitude_first = name.concat().contains("lonlat");
        let beyond =
            |cell: &String| coordinates(cell, true).is_some_and(|[_, lon, _]| lon.abs() > POLE);
        match (fits(longitude_first), fits(true)) {
            (true, _) if longitude_first => Some(LONGITUDE_FIRST),
            (true, _) => Some(LATITUDE_FIRST),
            (false, true) if cells().any(beyond) => Some(LONGITUDE_FIRST),
            _ => None,
        }
    }
}
