//! A sensor as the filter follows it: its gate, and the way out of lock-out.

use crate::model::gate::{Action, Recovery};
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::model::sensor::{Role, Sensor};
use crate::state::covariance::Reach;
use crate::units::sample::MAX_CHANNELS;
use crate::units::time::Time;

/// So many gated samples in a row are worth a warning.
const IN_A_ROW: u64 = 5;

/// So few gated samples in a row are no lock-out, however long they took: an outlier on either side of an outage.
const OUTLIERS: u64 = 2;

/// A sensor as the filter sees it.
#[derive(Clone)]
pub(super) struct SensorSlot {
    pub(super) name: String,
    /// The channels that it measures or drives by, one bit each.
    pub(super) channels: u16,
    /// The time of its last sample.
    pub(super) last: Time,
    /// The samples gated in a row until now.
    pub(super) gated: Option<Streak>,
    /// Where the error that the first of them showed has gone since, for the inflation.
    pub(super) reach: Reach,
    /// Why its last sample was rejected, if it was: said once in a row.
    pub(super) refused: Option<Rejection>,
    pub(super) thresholds: [f64; MAX_CHANNELS + 1],
    pub(super) recovery: Recovery,
}

/// Samples of one sensor that were gated, without one between them that passed.
#[derive(Clone, Copy)]
pub(super) struct Streak {
    pub(super) since: Time,
    pub(super) count: u64,
    /// Whether it was said that the filter is locked out.
    told: bool,
}

impl SensorSlot {
    /// For an error state of dimension `n`.
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

    /// What becomes of a sample of that normalised innovation squared, with `m` channels: accepted, gated, or accepted
    /// all the same because everything was gated for too long.
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
        let mut streak = self.gated.unwrap_or(Streak { since: time, count: 0, told: false });
        streak.count += 1;
        let Streak { since, count, told, .. } = streak;
        self.gated = Some(streak);
        // one is what a gate is for; several in a row are worth a warning
        if count == 1 {
            event(Level::Info, format!("gate rejects: NIS {nis:.1} is above {threshold:.1}"));
        } else if count == IN_A_ROW {
            event(Level::Warning, format!("{count} samples gated in a row since {since}"));
        }
        if time.since(since) < after || count <= OUTLIERS || !nis.is_finite() {
            return Verdict::Gate;
        }
        let said = format!("locked out: every one of {count} samples was gated since {since}");
        let verdict = match self.recovery.action {
            Action::Report if told => return Verdict::Gate,
            Action::Report => {
                event(Level::Warning, said);
                self.gated = Some(Streak { told: true, ..streak });
                return Verdict::Gate;
            }
            Action::Inflate => {
                event(
                    Level::Warning,
                    format!("{said}; the covariance is inflated and this one used"),
                );
                Verdict::Inflate
            }
            Action::Accept => {
                event(Level::Warning, format!("{said}; this one is used"));
                Verdict::Pass
            }
        };
        self.gated = None;
        verdict
    }
}

/// What becomes of a measured sample.
pub(super) enum Verdict {
    Pass,
    Gate,
    Inflate,
}
