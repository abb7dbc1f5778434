//! Rows that give no sample: what a sensor marks as no measurement, and what is out of order.

use crate::config::FileConfig;
use csv::ByteRecord;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_frames::validity::Missing;
use std::path::Path;

/// The reason why a row is not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unused {
    Order,
    NoStamp,
    NoPlace,
    NoVelocity,
    Invalid,
}

impl From<Missing> for Unused {
    fn from(missing: Missing) -> Self {
        match missing {
            Missing::Place => Self::NoPlace,
            Missing::Velocity => Self::NoVelocity,
        }
    }
}

/// The reasons with their words.
const REASONS: [(Unused, &str); 5] = [
    (Unused::Order, "left out, not later than the row before"),
    (Unused::NoStamp, "without a stamp: its time is zero"),
    (Unused::NoPlace, "without a position, such as 0 N 0 E"),
    (Unused::NoVelocity, "without a velocity, such as -32.768 m/s"),
    (Unused::Invalid, "not valid by the column of `valid`"),
];

/// The numbers of rows that are not used, with the line of the first of each kind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally([Option<(u64, u64)>; 5]);

impl Tally {
    /// Tests whether there was such a row.
    pub fn has(&self, why: Unused) -> bool {
        self.0[why as usize].is_some()
    }

    /// Counts a row on a line.
    pub fn add(&mut self, why: Unused, line: u64) {
        self.0[why as usize].get_or_insert((0, line)).0 += 1;
    }

    /// What was not used, in words.
    pub fn texts(self, path: &Path) -> Vec<String> {
        let text = |(why, words): &(Unused, &str)| {
            let (count, first) = self.0[*why as usize]?;
            let rows = if count == 1 { "row is".to_owned() } else { format!("{count} rows are") };
            Some(format!("{}:{first}: {rows} {words}", path.display()))
        };
        REASONS.iter().filter_map(text).collect()
    }
}

/// The column by which a row counts as valid, and its least value.
pub struct Status(Option<(usize, f64)>);

impl Status {
    /// Finds the column.
    ///
    /// # Errors
    /// When it is missing.
    pub fn find(
        info: &SensorInfo,
        config: &FileConfig,
        headings: &[String],
    ) -> Result<Self, StreamError> {
        let Some(valid) = &config.valid else { return Ok(Self(None)) };
        let Some(column) = headings.iter().position(|h| *h == valid.column) else {
            return Err(StreamError::format(format!("no column {:?}", valid.column))
                .with_remedy(format!("set files.{}.valid.column", info.name)));
        };
        Ok(Self(Some((column, valid.least))))
    }

    /// Tests whether a row is declared invalid.
    pub fn refuses(&self, record: &ByteRecord) -> bool {
        self.0.is_some_and(|(k, least)| status(record.get(k)) < least)
    }
}

/// The number of a cell that may hold a word; NaN, which no row fails by, where it holds none.
fn status(cell: Option<&[u8]>) -> f64 {
    let text = std::str::from_utf8(cell.unwrap_or_default().trim_ascii()).unwrap_or_default();
    match text.to_ascii_lowercase().as_str() {
        "true" | "y" | "yes" | "a" | "valid" => 1.0,
        "false" | "n" | "no" | "v" | "invalid" => 0.0,
        number => number.parse().unwrap_or(f64::NAN),
    }
}
