//! The unit of angular rates, by another sensor that turns.

use crate::recording::{Reader, Recording};
use crate::samples::find;
use crate::stream::StreamSurvey;
use crate::table::{counted, factor, nearest_counts};

/// Rates, rad/s, above which the unit of an IMU is looked at, and below which a vehicle hardly turns.
const FAST: f64 = 0.5;
const STILL: f64 = 0.005;
/// Ratio of rates in deg/s to the changes of the attitude in rad/s: 57, or less by the noise of the
/// changes.
const DEGREES: std::ops::RangeInclusive<f64> = 10.0..=110.0;
/// Largest difference, as a factor, of the turns of a course from those of rates in the right unit: slip of tyres and
/// the noise of a slow vehicle.
const NEAR: f64 = 1.3;

/// Tests whether a key describes a column of a rate.
fn of_rates(key: &&mut String) -> bool {
    ["columns.gyro_", "columns.dtheta_"].iter().any(|name| key.starts_with(name))
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

    /// Changes the unit of rates that turn 57 times as far as the course of a receiver, or as little.
    pub fn rates_by_course(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(ratio) = find(streams, "gnss").and_then(|s| s.rate_ratio) else { return false };
        let degree = 1_f64.to_radians();
        let near = |factor: f64| (1.0 / NEAR..NEAR).contains(&(ratio / factor));
        if self.count_by_course(ratio) {
            return true;
        }
        let [factor, unit] = match () {
            () if near(degree) => [(degree, "deg/s"), (degree, "deg")],
            () if near(1.0 / degree) => [(1.0 / degree, "rad/s"), (1.0 / degree, "rad")],
            () => return false,
        };
        let Some(part) = self.part_mut("imu").filter(|part| part.samples.rates.is_none()) else {
            return false;
        };
        let keys = part.found.source.iter_mut().chain(part.more.iter_mut().flat_map(|(k, _)| k));
        let others = ["rad/s", "deg/s", "rad", "deg"];
        let mut named = 0;
        for key in keys.filter(of_rates) {
            let other = others.iter().find(|other| key.contains(&format!("unit = \"{other}\"")));
            let Some(other) = other.filter(|other| **other != factor.1 && **other != unit.1) else {
                continue;
            };
            let right = if other.ends_with("/s") { factor.1 } else { unit.1 };
            *key = key.replace(&format!("unit = \"{other}\""), &format!("unit = \"{right}\""));
            named += 1;
        }
        // one where the keys of the table are changed
        part.samples.rates = Some(if named == 3 { 1.0 } else { factor.0 });
        let text = format!("the course of the receiver turns as if the rates were in {}", factor.1);
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
        for key in keys.filter(of_rates) {
            *key = key.replace(&format!("unit = \"{before}\""), &format!("unit = \"{unit}\""));
        }
        part.samples.rates = Some(1.0);
        let text = format!("the course of the receiver turns as if the rates were in {unit}");
        part.found.questions.push(format!("{text}: this unit is used"));
        self.notes.push(format!("imu: {text}"));
        true
    }
}
