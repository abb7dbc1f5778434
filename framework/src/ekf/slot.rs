//! Filter state of one sensor: its gate, and the fault that its innovations show.

use super::lockout::{Isolation, Lockout};
use crate::model::gate::Recovery;
use crate::model::record::Rejection;
use crate::model::sensor::{Role, Sensor};
use crate::state::covariance::Reach;
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Filter state of one sensor.
#[derive(Clone)]
pub(super) struct SensorSlot {
    pub(super) name: String,
    /// Channels that the sensor measures or drives by, one bit each.
    pub(super) channels: u16,
    /// Time of the last sample.
    pub(super) last: Time,
    /// Gated samples in a row, and the isolation that may follow.
    pub(super) lockout: Lockout,
    /// Propagation of the error that the first gated sample showed, for the inflation.
    pub(super) reach: Reach,
    /// Reason of the last rejection, which is reported once in a row.
    pub(super) refused: Option<Rejection>,
    pub(super) thresholds: [f64; MAX_CHANNELS + 1],
    pub(super) recovery: Recovery,
}

impl SensorSlot {
    /// Creates the slot for an error state of dimension `n`.
    pub(super) fn new(sensor: &Sensor, n: usize) -> Self {
        let used = match &sensor.role {
            Role::Measurement(model) => model.channels(),
            Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
        };
        Self {
            name: sensor.info.name.clone(),
            channels: ((1u32 << used) - 1) as u16,
            last: Time::MIN,
            lockout: Lockout::new(sensor.timeout),
            reach: Reach::with_capacity(n, sensor.info.channels.len()),
            refused: None,
            thresholds: sensor.gate.thresholds(),
            recovery: sensor.recovery,
        }
    }

    /// Isolation of the sensor, if it is isolated.
    pub(super) fn isolation(&self) -> Option<&Isolation> {
        self.lockout.isolation.as_ref()
    }
}
