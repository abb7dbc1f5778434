//! The biases of an IMU, by its noise and by what the samples show.

use super::text::{Text, round};
use crate::Heading;
use crate::stream::StreamSurvey;
use navfuse_ins::earth::normal_gravity;

/// Noise of gyros, deg/h/sqrt(Hz), from which their bias may be far larger than it: those of MEMS.
const MEMS: f64 = 7.3;
/// Rate of the Earth, deg/h: the error of the rates of gyros where nobody knows which way north is.
const EARTH_RATE: f64 = 15.0;
/// Usual bias of an accelerometer, mg, beside gyros of a better class and beside those of MEMS, whose data sheets state 3 to
/// 20 mg at any noise.
const ACCEL: [f64; 2] = [1.0, 5.0];
/// Gravity on the Earth, m/s^2, at the equator with 5 km of height and at a pole.
const GRAVITY: [f64; 2] = [9.765, 9.833];
const MG: f64 = 9.80665e-3;

/// The bias of the gyros, deg/h: some times the noise of one hour, or a tenth of it for an alignment at rest, which only
/// gyros with less permit.
pub(super) fn gyro_bias(imu: Option<&StreamSurvey>, aligned_at_rest: bool) -> f64 {
    let [noise, _] = imu.map_or([0.3, 100.0], StreamSurvey::densities);
    let usual = if aligned_at_rest { 0.1 * noise } else { 3.0 * noise };
    let rest = imu.and_then(|imu| imu.quietest).filter(|_| noise > MEMS && !aligned_at_rest);
    usual.max(rest.map_or(0.0, |rate| rate.to_degrees() * 3600.0))
}

/// Writes the priors of the biases; `place` is latitude (deg), longitude and height (m), if they are known.
pub(super) fn biases(
    out: &mut Text,
    imu: Option<&StreamSurvey>,
    heading: Option<Heading>,
    place: Option<[f64; 3]>,
) {
    let shown = gyro_bias(imu, out.aligned_at_rest);
    let relative = out.relative || matches!(heading, Some(Heading::Relative));
    let gyro = round(if relative { shown.hypot(EARTH_RATE) } else { shown });
    out.ask(&format!("gyro_bias = {{ sigma = \"{gyro} deg/h\" }}"), "bias of the data sheet");
    let mems = imu.is_some_and(|imu| imu.densities()[0] > MEMS);
    let usual = ACCEL[usize::from(mems)];
    let accel = round(1.5 * imu.map_or(0.0, |imu| excess(imu, place)) / MG).max(usual);
    out.ask(&format!("accel_bias = {{ sigma = \"{accel} mg\" }}"), "bias of the data sheet");
}

/// Size by which the mean specific force differs from gravity, m/s^2: that of a bias, or less.
fn excess(imu: &StreamSurvey, place: Option<[f64; 3]>) -> f64 {
    let first =
        imu.channel("accel_x").or_else(|| imu.channel("dvel_x")).filter(|_| imu.samples > 0);
    let Some(k) = first else { return 0.0 };
    let scale = if imu.channel("dvel_x").is_some() { 1.0 / imu.interval.max(1e-9) } else { 1.0 };
    let norm = scale * imu.mean[k].hypot(imu.mean[k + 1]).hypot(imu.mean[k + 2]);
    let [least, most] =
        place.map_or(GRAVITY, |[lat, _, height]| [normal_gravity(lat.to_radians(), height); 2]);
    if norm.is_finite() { (least - norm).max(norm - most).max(0.0) } else { 0.0 }
}
