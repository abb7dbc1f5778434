//! The rows that have a sample of a sensor: those that are valid, and those that neither lack it nor repeat one.

use super::columns::{BODY, ECEF, Table};
use super::vocabulary;
use navfuse_core::document::quoted;

/// Headings of a column by which a row counts as valid, with its least value.
const VALID: [(&str, f64); 10] = [
    ("fix", 1.0),
    ("fixtype", 2.0),
    ("gnssfix", 2.0),
    ("gpsfix", 2.0),
    ("statusstatus", 0.0),
    ("valid", 1.0),
    ("isvalid", 1.0),
    ("velocityvalid", 1.0),
    ("numgoodbeams", 3.0),
    ("gpsstatus", 3.0),
];
/// Words that name a velocity log beside a receiver.
const LOG: [&str; 4] = ["dvl", "bt", "bottom", "doppler"];
/// Share of rows that repeat the row before from which a sensor is slower than its table.
const REPEATED: f64 = 0.5;
/// Least number of rows of zeros that are no velocity, and of others that are one.
const ZEROS: usize = 3;
const MOVES: usize = 10;

impl Table<'_> {
    /// Tests whether some rows of a log hold zeros alone among velocities that are not.
    pub(super) fn has_zeros(&self) -> bool {
        let rows = self.vector(BODY);
        let zeros = rows.iter().filter(|v| **v == [0.0; 3]).count();
        let moves = rows.iter().filter(|v| v.iter().all(|x| x.is_finite() && *x != 0.0)).count();
        zeros >= ZEROS && moves > zeros.min(MOVES)
    }

    /// The key of the column by which a row of an aiding sensor counts as valid.
    pub(super) fn valid(&self, kind: &str) -> Option<String> {
        let found = |(k, heading): (usize, &String)| {
            let words = vocabulary::words(heading).concat();
            // the status of NavSatFix follows the name of its message
            let (_, least) = VALID.iter().find(|(name, _)| words.ends_with(name))?;
            let values = self.layout.column(k);
            let good = values.iter().any(|v| v >= least);
            (good && kind != "imu")
                .then(|| format!("valid = {{ column = {}, least = {least:?} }}", quoted(heading)))
        };
        self.layout.headings.iter().enumerate().find_map(found)
    }

    /// Tests whether most rows lack a measurement, or repeat that of the row before.
    pub(super) fn is_slower(&self, kind: &str) -> bool {
        let absent = self.values(kind).iter().filter(|v| v.is_nan()).count();
        absent as f64 > REPEATED * self.layout.rows.len() as f64 || self.repeats(kind)
    }

    /// Tests whether the velocities along the axes of the vehicle are those of a log by their headings.
    pub(super) fn of_log(&self) -> bool {
        let log = |channel: &&str| {
            let heading = self.find(channel).map_or("", |(k, _)| self.heading(*k));
            vocabulary::words(heading).iter().any(|word| LOG.contains(&word.as_str()))
        };
        BODY.iter().all(log)
    }

    /// Tests whether most rows repeat the measurement of the row before.
    pub(super) fn repeats(&self, kind: &str) -> bool {
        let channels: &[&str] = match kind {
            "gnss" if !self.has(&["lat", "lon"]) => &ECEF,
            "gnss" | "reference" => &["lat", "lon"],
            "dvl" => &BODY,
            "depth" => &["depth"],
            "yaw" | "dual-antenna" => &["yaw"],
            _ => &["speed"],
        };
        let columns: Vec<Vec<f64>> = channels.iter().map(|c| self.values(c)).collect();
        let rows = self.layout.rows.len();
        let bits = |column: &[f64], k: usize| column.get(k).map(|v| v.to_bits());
        let same = |k: &usize| columns.iter().all(|c| bits(c, *k) == bits(c, *k - 1));
        (1..rows).filter(same).count() as f64 > REPEATED * rows as f64
    }
}
