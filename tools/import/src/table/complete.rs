//! Columns that complete an inertial unit of which others are known by their headings.

use super::columns::{ACCEL, DTHETA, DVEL, GYRO, Table};
use super::units::{self, IMU_INTERVAL};
use super::vocabulary::{self, Meaning, fitting};

/// Distance of a median norm from gravity, as a part of it, within which a vector without a known heading is a force.
const HEAVY: f64 = 0.05;

impl Table<'_> {
    /// Names columns that complete an inertial unit of which others are known.
    pub(super) fn complete_inertial(&mut self) {
        for channels in [GYRO, ACCEL] {
            self.third_in_line(channels);
        }
        let knows = |table: &Self, of: [&str; 3]| of.iter().any(|c| table.has(&[c]));
        let found = match () {
            () if self.has(&GYRO) && !knows(self, ACCEL) && !knows(self, DVEL) => {
                self.heaviest().map(|first| (first, ACCEL))
            }
            () if self.has(&ACCEL) && !knows(self, GYRO) && !knows(self, DTHETA) => {
                let first = self.free_in_unit("rad/s").or_else(|| self.turning());
                first.map(|first| (first, GYRO))
            }
            () => None,
        };
        for (k, channel) in found.into_iter().flat_map(|(first, c)| (first..).zip(c)) {
            let unit = self.unit_of(k, vocabulary::si(channel));
            self.columns.push((k, Meaning { channel, unit, sign: 1.0, rank: 0 }));
        }
    }

    /// The unit of a column by its own line or by its brackets, if it fits.
    fn unit_of(&self, k: usize, si: &str) -> Option<String> {
        let heading = self.layout.headings.get(k)?;
        let bracketed = || heading.split_once(['[', '(', '{']).map(|(_, unit)| unit);
        let unit = self.layout.units.get(k).map(String::as_str).or_else(bracketed)?;
        fitting(unit.trim_end_matches([']', ')', '}']), si)
    }

    /// Tests whether a column has numbers and no meaning.
    fn is_free(&self, k: usize) -> bool {
        let words = vocabulary::words(self.heading(k));
        let field = words.iter().any(|w| w.starts_with("mag"));
        let free = self.columns.iter().all(|(used, _)| *used != k) && !field;
        free && self.layout.column(k).iter().any(|v| v.is_finite())
    }

    /// Names the third column of a vector that stands in line with two others: `Heading Rate` beside `Roll Rate` and
    /// `Pitch Rate`.
    fn third_in_line(&mut self, channels: [&'static str; 3]) {
        let place = |table: &Self, axis: usize| table.find(channels[axis]).map(|(k, _)| *k as i64);
        let Some(axis) = (0..3).find(|axis| place(self, *axis).is_none()) else { return };
        let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
        let Some((at, bt)) = place(self, a).zip(place(self, b)) else { return };
        let line = [a, b, axis].map(|k| k as i64);
        let step = (bt - at) / (line[1] - line[0]);
        let even = step * (line[1] - line[0]) == bt - at && step > 0;
        let k = at + step * (line[2] - line[0]);
        let Ok(k) = usize::try_from(k) else { return };
        let Some((_, meaning)) = self.find(channels[a]).cloned() else { return };
        let free = even && k < self.layout.width() && self.is_free(k);
        let si = vocabulary::si(channels[axis]);
        let fits =
            self.layout.units.get(k).is_none_or(|u| u.is_empty() || fitting(u, si).is_some());
        if free && fits {
            let unit = self.unit_of(k, si);
            self.columns.push((k, Meaning { channel: channels[axis], unit, ..meaning }));
        }
    }

    /// The first of three free columns beside each other whose norm is nearest to gravity.
    fn heaviest(&self) -> Option<usize> {
        let interval = self.clock(IMU_INTERVAL).map_or(IMU_INTERVAL, |c| units::step(&c.seconds));
        let distance = |first: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| self.layout.column(first + k));
            let rows = units::rows([&x, &y, &z]);
            let (decided, increments) = units::accel(&rows, interval).ok()?;
            let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
            let size = units::median(rows.iter().map(norm)) * units::factor(&decided.unit);
            let distance = (size / units::GRAVITY).ln().abs();
            (!increments && distance < HEAVY).then_some((first, distance))
        };
        // a temperature beside two constants may have the norm of gravity
        let changes = |k: usize| self.layout.column(k).windows(2).any(|v| v[0] != v[1]);
        let free = |first: &usize| (*first..first + 3).all(|k| self.is_free(k) && changes(k));
        let firsts = (0..self.layout.width().saturating_sub(2)).filter(free);
        let best = firsts.filter_map(distance).min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(best.0)
    }

    /// The first of three free columns beside each other whose headings differ by their axes alone, and against which the
    /// specific forces turn.
    fn turning(&self) -> Option<usize> {
        let seconds = self.clock(IMU_INTERVAL).ok()?.seconds;
        let stem = |k: usize| {
            let mut words = vocabulary::words(self.heading(k));
            let axis = words.iter().position(|word| ["x", "y", "z"].contains(&word.as_str()))?;
            let axis = words.remove(axis);
            (!words.is_empty()).then_some((words, axis))
        };
        let vector = |first: usize| {
            let [x, y, z] = [0, 1, 2].map(|k| stem(first + k));
            let [(x, _), (y, _), (z, last)] = [x?, y?, z?];
            let free = (first..first + 3).all(|k| self.is_free(k));
            (free && x == y && y == z && last == "z").then_some(first)
        };
        let forces = self.vector(ACCEL);
        let turns = |first: &usize| {
            let [x, y, z] = [0, 1, 2].map(|k| self.layout.column(first + k));
            units::turns_gravity(&seconds, &units::rows([&x, &y, &z]), &forces)
        };
        (0..self.layout.width().saturating_sub(2)).filter_map(vector).find(turns)
    }

    /// The first of three free columns beside each other that state a unit, if no others do.
    fn free_in_unit(&self, si: &str) -> Option<usize> {
        let states = |k: usize| self.is_free(k) && self.unit_of(k, si).is_some();
        let fits = |first: &usize| (0..3).all(|k| states(first + k));
        let mut found = (0..self.layout.width().saturating_sub(2)).filter(fits);
        found.next().filter(|_| found.next().is_none())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use crate::table::recognise;

    /// The keys of the inertial unit of a table with these headings.
    fn keys(headings: &str) -> String {
        let row = |k: usize| {
            let [w, n] = [k % 7, k % 5].map(|n| n as f64 / 100.0);
            format!("0.{k:03},{w},{n},-{w},0.{k:03},{},-9.8{}\n", n + 0.2, k % 9)
        };
        let text = format!("{headings}\n") + &(0..200).map(row).collect::<String>();
        recognise(&text, "").map_or_else(|why| why, |found| found[0].source.join("\n"))
    }

    #[test]
    fn a_column_in_line_with_two_of_a_vector_is_its_third() {
        let keys = keys("t,Roll Rate [deg/s],Pitch Rate [deg/s],Bearing Rate [deg/s],ax,ay,az");
        let key = "columns.gyro_z = { column = \"Bearing Rate [deg/s]\", unit = \"deg/s\" }";
        assert!(keys.contains(key), "{keys}");
    }

    #[test]
    fn three_columns_whose_norm_is_gravity_are_the_forces_beside_rates() {
        let found = keys("t,gx,gy,gz,Schub längs [m/s²],Schub quer [m/s²],Schub hoch [m/s²]");
        let key = "columns.accel_z = { column = \"Schub hoch [m/s²]\", unit = \"m/s^2\" }";
        assert!(found.contains(key), "{found}");
        // of a magnetic field none are taken
        let found = keys("t,gx,gy,gz,mag_x,mag_y,mag_z");
        assert!(!found.contains("accel_z"), "{found}");
    }

    #[test]
    fn a_temperature_beside_constants_is_no_force() {
        let row = |k: usize| format!("0.{k:03},0.0{},0.01,0.02,31.2,0,1\n", k % 7);
        let text = "t,gx,gy,gz,celsius,errors,samples\n".to_owned()
            + &(0..200).map(row).collect::<String>();
        let found = recognise(&text, "").unwrap();
        assert_eq!(found[0].kind, "gyros");
    }

    #[test]
    fn three_columns_in_a_unit_of_rates_are_the_gyros_beside_forces() {
        let found = keys("t,Dreh 1 (deg/s),Dreh 2 (deg/s),Dreh 3 (deg/s),ax,ay,az");
        assert!(found.contains("columns.gyro_y = { column = \"Dreh 2 (deg/s)\""), "{found}");
    }
}
