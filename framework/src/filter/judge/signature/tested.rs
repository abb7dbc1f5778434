//! The sensors that are tested.

use crate::model::sensor::{Role, Sensor};

/// Largest number of sensors that are tested. Every test follows the samples of all sensors, so that
/// without a bound a run of many sensors would cost the square of their number.
const TESTED: usize = 64;

/// True for a sensor whose samples can show an error that stays.
fn suits(sensor: &Sensor) -> bool {
    let Role::Measurement(model) = &sensor.role else { return false };
    let judged = !sensor.constraint && sensor.detector.is_none();
    judged && !sensor.is_noise_free() && model.observations() == 1
}

/// The sensors that are tested: the first ones that suit.
pub(super) fn tested(sensors: &[Sensor]) -> Vec<bool> {
    let mut left = TESTED;
    let tested = |sensor| {
        let tested = left > 0 && suits(sensor);
        left -= usize::from(tested);
        tested
    };
    sensors.iter().map(tested).collect()
}

/// The note of a run with more sensors than are tested.
pub(crate) fn untested(sensors: &[Sensor]) -> Option<String> {
    let count = sensors.iter().filter(|sensor| suits(sensor)).count();
    (count > TESTED).then(|| {
        format!(
            "only the first {TESTED} of {count} sensors are tested for offsets and wrong parameters"
        )
    })
}
