//! Sensors of one table with a stamp each, as PlotJuggler writes the topics of a bag: rows of one sensor have empty cells
//! for the others.

use super::clock::Clock;
use super::columns::Table;
use super::vocabulary::{Meaning, words};

/// A channel that each sample of a sensor has, by the type of the sensor.
const CHANNELS: [(&str, &[&str]); 9] = [
    ("imu", &["gyro_x", "dtheta_x"]),
    ("gyros", &["gyro_x"]),
    ("accels", &["accel_x"]),
    ("gnss", &["lat"]),
    ("reference", &["lat"]),
    ("dvl", &["vel_x"]),
    ("depth", &["depth", "pressure", "z"]),
    ("attitude", &["roll"]),
    ("dual-antenna", &["yaw"]),
];

impl Table<'_> {
    /// The time of a sensor in a column of its own, which has a number in the rows of the sensor alone: one that begins with
    /// the same word as the columns of the sensor, or the only one.
    pub(super) fn stamped(&self, kind: &str, usual: f64) -> Option<Clock> {
        let (_, channels) = CHANNELS.iter().find(|(name, _)| *name == kind)?;
        let (column, _) = channels.iter().find_map(|channel| self.find(channel))?;
        let values = self.layout.column(*column);
        let topic = |k: usize| words(self.heading(k)).into_iter().next();
        let own = |(k, meaning): &&(usize, Meaning)| {
            let times = self.layout.column(*k);
            meaning.channel == "time"
                && times.iter().any(|t| t.is_nan())
                && times.iter().any(|t| t.is_finite())
                && times.iter().zip(&values).all(|(t, v)| t.is_finite() == v.is_finite())
        };
        let own: Vec<&(usize, Meaning)> = self.columns.iter().filter(own).collect();
        let named = || own.iter().find(|(k, _)| topic(*k) == topic(*column));
        let (k, meaning) = match own.as_slice() {
            [one] => one,
            _ => named()?,
        };
        Some(self.number(*k, meaning, usual))
    }
}
