//! The unit of angular rates, by another sensor that turns.

use crate::recording::{Reader, Recording};
use crate::samples::find;
use crate::stream::StreamSurvey;
use crate::table::{counted, factor, nearest_counts};
use navfuse_core::document::quoted;

/// Rates, rad/s, above which the unit of an IMU is looked at, and below which a vehicle hardly turns.
const FAST: f64 = 0.5;
const STILL: f64 = 0.005;
/// Ratio of rates in deg/s to the changes of the attitude in rad/s: 57, or less by the noise of the
/// changes.
const DEGREES: std::ops::RangeInclusive<f64> = 10.0..=110.0;
/// Largest difference, as a factor, of the turns of a course from those of rates in the right unit: slip of tyres and
/// the noise of a slow vehicle.
const NEAR: f64 = 1.3;

/// Units of rates that programs write, the usual ones first, and those of them that are no angle over a second.
const UNITS: [&str; 8] =
    ["rad/s", "deg/s", "mrad/s", "deg/(1000*s)", "deg/h", "deg/min", "rpm", "rev/s"];
const RATES: [&str; 4] = ["deg/(1000*s)", "deg/h", "deg/min", "rpm"];

/// Tests whether a key describes a column of a rate.
fn of_rates(key: &str) -> bool {
    ["columns.gyro_", "columns.dtheta_"].iter().any(|name| key.starts_with(name))
}

/// The unit in a key.
fn unit_of(key: &str) -> Option<&str> {
    key.split_once("unit = \"")?.1.split_once('"').map(|(unit, _)| unit)
}

impl Recording {
    /// Scales the rates of a bag's IMU that are in degrees: they exceed the changes of the
    /// vehicle's own roll and pitch by far.
    pub fn scale_rates(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some((imu, own)) = find(streams, "imu").zip(find(streams, "attitude")) else {
            return false;
        };
        let fits = |(gyro, angle): (&str, &str)| {
            let Some((k, a)) = imu.channel(gyro).zip(own.channel(angle)) else { return false };
            let rate = imu.mean[k].hypot(imu.wander[k]).hypot(imu.noise[k]);
            let turn = std::f64::consts::SQRT_2 * own.noise[a] / own.interval.max(1e-9);
            rate > FAST && turn > STILL && DEGREES.contains(&(rate / turn))
        };
        let fast = [("gyro_x", "roll"), ("gyro_y", "pitch")].map(fits).iter().all(|f| *f);
        let Some(part) = self.part_mut("imu").filter(|p| p.reader == Reader::Bag) else {
            return false;
        };
        if !fast || part.samples.rates.replace(1_f64.to_radians()).is_some() {
            return false;
        }
        let text =
            "the vehicle's own attitude turns as if the rates were in deg/s: they are scaled";
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("imu: {text}"));
        true
    }

    /// Changes the unit of rates that turn by another factor than the course of a receiver, which is that of another unit.
    pub fn rates_by_course(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(ratio) = find(streams, "gnss").and_then(|s| s.rate_ratio) else { return false };
        let near = |factor: f64| (1.0 / NEAR..NEAR).contains(&(ratio / factor));
        if self.count_by_course(ratio) {
            return true;
        }
        let Some(part) = self.part_mut("imu").filter(|part| part.samples.rates.is_none()) else {
            return false;
        };
        if near(1.0) {
            return false;
        }
        let keys = part.found.source.iter().chain(part.more.iter().flat_map(|(k, _)| k));
        let before = keys.filter(|key| of_rates(key)).find_map(|key| unit_of(key));
        let before = before.unwrap_or("rad/s").to_owned();
        let size = factor(&before);
        let Some(unit) = UNITS.iter().find(|unit| near(factor(unit) / size)) else { return false };
        let of_increments = !before.ends_with("/s") && !RATES.contains(&before.as_str());
        let unit = if of_increments { unit.trim_end_matches("/s") } else { unit };
        let keys = part.found.source.iter_mut().chain(part.more.iter_mut().flat_map(|(k, _)| k));
        let mut named = 0;
        for key in keys.filter(|key| of_rates(key)) {
            let (old, new) = (quoted(&before), quoted(unit));
            named += usize::from(key.contains(&old));
            *key = key.replace(&format!("unit = {old}"), &format!("unit = {new}"));
        }
        // one where the keys of the table are changed
        part.samples.rates = Some(if named == 3 { 1.0 } else { factor(unit) / size });
        let text = format!("the course of the receiver turns as if the rates were in {unit}");
        part.found.questions.retain(|q| !q.starts_with("the unit of the angular rate"));
        part.found.questions.push(format!("{text}: this unit is used"));
        self.notes.push(format!("imu: {text}"));
        true
    }

    /// Changes the counts of one deg/s to the usual number of them that is nearest by the course.
    fn count_by_course(&mut self, ratio: f64) -> bool {
        let Some(part) = self.part_mut("imu") else { return false };
        let guess = "beside counts)";
        let asked = part.found.questions.iter().position(|q| q.ends_with(guess));
        let Some(asked) = asked else { return false };
        let text = part.found.questions.remove(asked);
        let before = text.split(": ").nth(1).and_then(|rest| rest.split(" is ").next());
        let before = before.unwrap_or("deg/s").to_owned();
        let count = 1_f64.to_radians() / factor(&before);
        let unit = counted(nearest_counts(count / ratio));
        let keys = part.found.source.iter_mut();
        for key in keys.filter(|key| of_rates(key)) {
            *key = key.replace(&format!("unit = \"{before}\""), &format!("unit = \"{unit}\""));
        }
        part.samples.rates = Some(1.0);
        let text = format!("the course of the receiver turns as if the rates were in {unit}");
        part.found.questions.push(format!("{text}: this unit is used"));
        self.notes.push(format!("imu: {text}"));
        true
    }
}
