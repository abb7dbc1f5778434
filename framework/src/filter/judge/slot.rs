//! Filter state of one sensor: its gate, and the fault that its innovations show.

use crate::checkpoint::saved;
use crate::filter::judge::bias::BiasTest;
use crate::filter::judge::curvature::Curvature;
use crate::filter::judge::factor::Factor;
use crate::filter::judge::groups::groups;
use crate::filter::judge::lockout::{Isolation, Lockout};
use crate::filter::judge::noise_level::NoiseLevel;
use crate::filter::judge::scatter::Scatter;
use crate::filter::judge::stuck::Repeats;
use crate::model::record::Rejection;
use crate::model::sensor::gate::{Action, Recovery};
use crate::model::sensor::limits::Limit;
use crate::model::sensor::robust::Robust;
use crate::model::sensor::{Role, Sensor};
use crate::state::covariance::Reach;
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;

/// Filter state of one sensor.
#[derive(Clone)]
pub(in crate::filter) struct SensorSlot {
    pub(in crate::filter) name: String,
    /// Channels that the sensor measures or drives by, one bit each.
    pub(in crate::filter) channels: u16,
    /// Set if several samples may have one time.
    pub(in crate::filter) several: bool,
    /// Time of the last sample.
    pub(in crate::filter) last: Time,
    /// Gated samples in a row, and the isolation that may follow.
    pub(in crate::filter) lockout: Lockout,
    /// Propagation of the error that the first gated sample showed, for the inflation.
    pub(in crate::filter) reach: Reach,
    /// Reason of the last rejection, which is reported once in a row.
    pub(in crate::filter) refused: Option<Rejection>,
    pub(in crate::filter) thresholds: [f64; MAX_CHANNELS + 1],
    pub(in crate::filter) recovery: Recovery,
    pub(in crate::filter) robust: Robust,
    /// Channels that fail alone, one bit each.
    pub(in crate::filter) groups: Vec<u16>,
    /// Scatter of the samples that are refused; none where the recovery only reports or accepts.
    pub(in crate::filter) scatter: Option<Scatter>,
    /// Level of the noise that follows the innovations, and whether it is used.
    pub(in crate::filter) noise: Option<NoiseLevel>,
    pub(in crate::filter) adaptive: bool,
    /// Repetitions of samples; none where samples may repeat for ever, or several may have one
    /// time.
    pub(in crate::filter) repeats: Option<Repeats>,
    /// Sequential test on the innovations; none for a constraint, or where several samples may have
    /// one time.
    pub(in crate::filter) bias: Option<BiasTest>,
    /// Sign and unit of the channels; none for a constraint, or where several samples may have one
    /// time.
    pub(in crate::filter) factor: Option<Factor>,
    /// Check of the linearisation; none where a constraint gives the samples.
    pub(in crate::filter) curvature: Option<Curvature>,
    limits: Vec<(usize, Limit)>,
    /// Last plausible sample.
    plausible: Option<Sample>,
}

saved!(SensorSlot {
    last, lockout, reach, refused, adaptive, plausible,
} each {
    scatter, noise, repeats, bias, factor, curvature,
} except {
    name, channels, several, thresholds, recovery, robust, groups, limits,
});

impl SensorSlot {
    /// Creates the slot for an error state of dimension `n`.
    pub(in crate::filter) fn new(sensor: &Sensor, n: usize) -> Self {
        let used = match &sensor.role {
            Role::Measurement(model) => model.channels(),
            Role::Input(_) | Role::Reference(_) => sensor.info.channels.len(),
        };
        let several = match &sensor.role {
            Role::Measurement(model) => model.observations() > 1,
            Role::Input(_) | Role::Reference(_) => false,
        };
        let corrects = matches!(sensor.role, Role::Measurement(_)) && !sensor.is_noise_free();
        let watched = corrects && !sensor.constraint;
        let thresholds = sensor.gate.thresholds();
        let single = watched && !several;
        let inflates = sensor.recovery.action == Action::Inflate;
        let groups = if single { groups(&sensor.info.channels, used) } else { Vec::new() };
        let measures = !sensor.constraint && sensor.detector.is_none();
        Self {
            name: sensor.info.name.clone(),
            channels: ((1u32 << used) - 1) as u16,
            several,
            last: Time::MIN,
            lockout: Lockout::new(sensor.timeout, &sensor.info.channels, measures),
            reach: Reach::with_capacity(n, sensor.info.channels.len()),
            refused: None,
            thresholds,
            recovery: sensor.recovery,
            robust: sensor.robust,
            scatter: (single && inflates).then(|| Scatter::new(&groups)),
            groups,
            noise: corrects.then(|| NoiseLevel::new(&thresholds)),
            adaptive: sensor.adaptive_noise,
            // successive observations are not of one channel
            repeats: single.then(Repeats::default),
            bias: single.then(|| BiasTest::new(used)),
            factor: single.then(|| Factor::new(&sensor.info, used)),
            curvature: watched.then(Curvature::default),
            limits: sensor.limits.clone(),
            plausible: None,
        }
    }

    /// Reason to reject a sample before it is used; `all` asks for every channel of the sensor.
    pub(in crate::filter) fn refuses(
        &self,
        sensor: &Sensor,
        sample: &Sample,
        all: bool,
    ) -> Option<Rejection> {
        if let Some(channel) = sample.not_finite() {
            return Some(Rejection::NotFinite(channel));
        }
        if self.is_out_of_order(sample) {
            return Some(Rejection::OutOfOrder);
        }
        let present = sample.present() & self.channels;
        let missing = if all { present != self.channels } else { present == 0 };
        if missing && !sensor.is_event(sample) {
            return Some(Rejection::Missing);
        }
        if sensor.excludes(sample.time) {
            return Some(Rejection::Excluded);
        }
        if sensor.is_unset(sample) {
            return Some(Rejection::Unset);
        }
        self.implausible(sample)
    }

    /// Returns `true` if time does not go on to the sample as the sensor demands.
    fn is_out_of_order(&self, sample: &Sample) -> bool {
        sample.time < self.last || sample.time == self.last && !self.several
    }

    /// Takes a sample in order of time.
    pub(in crate::filter) fn take(&mut self, sample: &Sample) {
        self.last = sample.time;
        if !self.limits.is_empty() {
            self.plausible = Some(*sample);
        }
    }

    /// Reason to reject a sample that is outside its plausible range, or has changed too fast.
    fn implausible(&self, sample: &Sample) -> Option<Rejection> {
        self.limits.iter().find_map(|(channel, limit)| {
            let channel = *channel;
            let value = sample.get(channel)?;
            if !(limit.low..=limit.high).contains(&value) {
                return Some(Rejection::OutOfRange(channel));
            }
            let before = self.plausible.as_ref()?;
            let change = (value - before.get(channel)?).abs();
            let most = limit.rate * sample.time.since(before.time);
            (change > most).then_some(Rejection::TooFast(channel))
        })
    }

    /// Ends a lock-out that a wider noise explains; the noise follows the innovations from now on.
    pub(in crate::filter) fn explain(&mut self) {
        self.adaptive = true;
        self.excuse();
    }

    /// Ends a lock-out that an error of a clock or of the driving sensor explains.
    pub(in crate::filter) fn excuse(&mut self) {
        self.lockout.explain();
        self.reach.clear();
    }

    /// Level of the noise, where it follows the innovations.
    pub(in crate::filter) fn level(&mut self) -> Option<&mut NoiseLevel> {
        self.noise.as_mut().filter(|_| self.adaptive)
    }

    /// Isolation of the sensor, if it is isolated.
    pub(in crate::filter) fn isolation(&self) -> Option<&Isolation> {
        self.lockout.isolation.as_ref()
    }
}
