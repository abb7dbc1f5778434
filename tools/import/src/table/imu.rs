//! The inertial unit of a table: rates or increments, in the units that the numbers show.

use super::clock::Clock;
use super::columns::{ACCEL, DTHETA, DVEL, GYRO, Table};
use super::units::{self, Decided, Evidence, same, settle};
use crate::found::Found;

/// Number of rows from which the norm of the specific force is a rule.
const FEW: usize = 10;
/// Part of gravity below which specific forces lack it.
const FALLING: f64 = 0.3;

impl Table<'_> {
    /// The inertial unit.
    ///
    /// # Errors
    /// When the specific forces hold no gravity in any unit, and their headings state none.
    pub(super) fn imu(&self, clock: &Clock) -> Result<Found, String> {
        let named = !(self.has(&GYRO) && self.has(&ACCEL));
        let (turns, speeds) = if named { (DTHETA, DVEL) } else { (GYRO, ACCEL) };
        let interval = units::step(&clock.seconds);
        let mut questions = Vec::new();
        let (accel, increments) = self.forces(named, speeds, interval, &mut questions)?;
        let per = if increments { interval } else { 1.0 };
        let in_g = accel.as_deref().is_some_and(|unit| ["g", "mg", "g*s"].contains(&unit));
        let counts = accel.as_deref().is_some_and(|unit| unit.starts_with("g/"));
        let gyro = if counts && !self.any_stated(turns) {
            let [rates, forces] = [turns, speeds].map(|vector| self.vector(vector));
            let shown = units::counted_gyro(&clock.seconds, &rates, &forces);
            Some(settle("the angular rate", None, shown, false, &mut questions))
        } else {
            self.rates(turns, (clock, per, in_g), &self.vector(speeds), &mut questions)
        };
        let targets = if increments { [DTHETA, DVEL] } else { [GYRO, ACCEL] };
        let mut source = Vec::new();
        for (names, targets, unit) in [(turns, targets[0], gyro), (speeds, targets[1], accel)] {
            for (name, target) in names.iter().zip(targets) {
                source.extend(self.key(name, target, unit.as_deref(), &mut questions));
            }
        }
        let sensor =
            if increments { vec!["output = \"increments\"".to_owned()] } else { Vec::new() };
        Ok(Found { kind: "imu", sensor, source, questions, ..Found::default() })
    }

    /// The gyros or the accelerometers of an inertial unit whose other half is in another file.
    ///
    /// # Errors
    /// When the specific forces hold no gravity in any unit, and their headings state none.
    pub(super) fn half(&self, clock: &Clock) -> Result<Found, String> {
        let interval = units::step(&clock.seconds);
        let mut questions = Vec::new();
        let forces = [ACCEL, DVEL].into_iter().find(|names| self.has(names));
        let (kind, names, unit, increments) = if let Some(names) = forces {
            let (unit, increments) = self.forces(names == DVEL, names, interval, &mut questions)?;
            ("accels", names, unit, increments)
        } else {
            let increments = !self.has(&GYRO);
            let names = if increments { DTHETA } else { GYRO };
            let per = if increments { interval } else { 1.0 };
            let unit = self.rates(names, (clock, per, false), &[], &mut questions);
            ("gyros", names, unit, increments)
        };
        let targets = match (kind, increments) {
            ("accels", true) => DVEL,
            ("accels", false) => ACCEL,
            (_, true) => DTHETA,
            (_, false) => GYRO,
        };
        let keys = names.iter().zip(targets);
        let keys = keys
            .filter_map(|(name, target)| self.key(name, target, unit.as_deref(), &mut questions));
        let source = keys.collect();
        let sensor =
            if increments { vec!["output = \"increments\"".to_owned()] } else { Vec::new() };
        Ok(Found { kind, sensor, source, questions, ..Found::default() })
    }

    /// The unit of the specific forces, and `true` for increments; no unit where each heading has
    /// its own.
    fn forces(
        &self,
        named: bool,
        channels: [&str; 3],
        interval: f64,
        questions: &mut Vec<String>,
    ) -> Result<(Option<String>, bool), String> {
        let (forces, stated) = (self.vector(channels), self.stated(channels));
        if stated.is_none() && self.any_stated(channels) {
            return Ok((None, named));
        }
        match units::accel(&forces, interval) {
            Ok((shown, increments)) if stated.is_none() || named == increments => {
                let unit = settle("the specific force", stated, shown, true, questions);
                Ok((Some(unit), increments))
            }
            Err(why) if forces.len() > FEW && self.falls(channels, &forces, &stated) => Err(why),
            _ => Ok((stated, named)),
        }
    }

    /// Tests whether specific forces without gravity are refused: in a unit that nothing states, or that a stranger's
    /// heading states for less than the part of gravity that a vehicle keeps up.
    fn falls(&self, channels: [&str; 3], forces: &[[f64; 3]], stated: &Option<String>) -> bool {
        let Some(unit) = stated else { return true };
        let own = self.find(channels[0]).is_some_and(|(k, _)| self.usual(*k, channels[0]));
        let size = |f: &[f64; 3]| f.iter().map(|x| x * x).sum::<f64>().sqrt();
        let middle = units::median(forces.iter().map(size)) * units::factor(unit);
        channels == ACCEL && !own && middle < FALLING * units::GRAVITY
    }

    /// The unit of the angular rates, which are `per` s for increments.
    fn rates(
        &self,
        channels: [&str; 3],
        (clock, per, in_g): (&Clock, f64, bool),
        forces: &[[f64; 3]],
        questions: &mut Vec<String>,
    ) -> Option<String> {
        let scaled: Vec<[f64; 3]> =
            self.vector(channels).iter().map(|w| w.map(|w| w / per)).collect();
        let shown = units::gyro(&clock.seconds, &scaled, forces, in_g);
        let increments = channels == DTHETA || per != 1.0;
        let increment = |rate: &str| match rate.strip_suffix("/s") {
            Some(angle) => angle.to_owned(),
            None => format!("{rate}*s"),
        };
        let unit = if increments { increment(&shown.unit) } else { shown.unit.clone() };
        let shown = Decided { unit, ..shown };
        let (strong, stated) = (shown.evidence == Evidence::Strong, self.stated(channels));
        if stated.is_none() && self.any_stated(channels) {
            return None;
        }
        // the numbers decide between radians and degrees alone
        let compared =
            |unit: &String| ["rad/s", "deg/s", "rad", "deg"].iter().any(|u| same(unit, u));
        let differs = stated.as_ref().is_some_and(|u| compared(u) && !same(u, &shown.unit));
        Some(settle("the angular rate", stated, shown, strong && differs, questions))
    }
}
