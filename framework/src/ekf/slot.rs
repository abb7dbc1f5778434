//! Filter state of one sensor: its gate, and the recovery from lock-out.

use crate::model::gate::{Action, Recovery};
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::model::sensor::{Role, Sensor};
use crate::state::covariance::Reach;
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// Number of gated samples in a row that causes a warning.
const IN_A_ROW: u64 = 5;

/// Largest number of gated samples in a row that is no lock-out, however long they took: an outlier
/// on either side of an outage.
const OUTLIERS: u64 = 2;

/// Filter state of one sensor.
#[derive(Clone)]
pub(super) struct SensorSlot {
    pub(super) name: String,
    /// Channels that the sensor measures or drives by, one bit each.
    pub(super) channels: u16,
    /// Time of the last sample.
    pub(super) last: Time,
    /// Current streak of gated samples.
    pub(super) gated: Option<Streak>,
    /// Propagation of the error that the first gated sample showed, for the inflation.
    pub(super) reach: Reach,
    /// Reason of the last rejection, which is reported once in a row.
    pub(super) refused: Option<Rejection>,
    pub(super) thresholds: [f64; MAX_CHANNELS + 1],
    pub(super) recovery: Recovery,
}

/// Consecutive gated samples of one sensor.
#[derive(Clone, Copy)]
pub(super) struct Streak {
    pub(super) since: Time,
    pub(super) count: u64,
    /// Set once the lock-out has been reported.
    reported: bool,
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
            gated: None,
            reach: Reach::with_capacity(n, sensor.info.channels.len()),
            refused: None,
            thresholds: sensor.gate.thresholds(),
            recovery: sensor.recovery,
        }
    }

    /// Decides on a sample with the given normalised innovation squared and `m` channels. A sample
    /// beyond the gate passes after a lock-out of `recovery.after`.
    pub(super) fn judge(
        &mut self,
        time: Time,
        nis: f64,
        m: usize,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let threshold = self.thresholds[m];
        let mut event =
            |level, text| observer.event(Event { time, level, about: self.name.clone(), text });
        if nis <= threshold && nis.is_finite() {
            if let Some(Streak { since, count, .. }) = self.gated.take() {
                event(
                    Level::Info,
                    format!("gate passes again after {count} gated samples since {since}"),
                );
            }
            return Verdict::Pass;
        }
        let after = self.recovery.after.value().si();
        let mut streak = self.gated.unwrap_or(Streak { since: time, count: 0, reported: false });
        streak.count += 1;
        let Streak { since, count, reported, .. } = streak;
        self.gated = Some(streak);
        // a single gated sample is expected; several in a row are worth a warning
        if count == 1 {
            event(Level::Info, format!("gate rejects: NIS {nis:.1} is above {threshold:.1}"));
        } else if count == IN_A_ROW {
            event(Level::Warning, format!("{count} samples gated in a row since {since}"));
        }
        if time.since(since) < after || count <= OUTLIERS || !nis.is_finite() {
            return Verdict::Gate;
        }
        let lock_out = format!("locked out: every one of {count} samples was gated since {since}");
        let verdict = match self.recovery.action {
            Action::Report if reported => return Verdict::Gate,
            Action::Report => {
                event(Level::Warning, lock_out);
                self.gated = Some(Streak { reported: true, ..streak });
                return Verdict::Gate;
            }
            Action::Inflate => {
                event(
                    Level::Warning,
                    format!("{lock_out}; the covariance is inflated and this one used"),
                );
                Verdict::Inflate
            }
            Action::Accept => {
                event(Level::Warning, format!("{lock_out}; this one is used"));
                Verdict::Pass
            }
        };
        self.gated = None;
        verdict
    }
}

/// Decision on a measured sample.
pub(super) enum Verdict {
    Pass,
    Gate,
    Inflate,
}
