//! Initial alignment of a strapdown process, from the first sample to the end of the fine stage.

use super::coarse::{CoarseAlignment, Sensed};
use super::config::{Alignment, AlignmentMethod, Formula};
use super::error::AlignmentError;
use super::sensors::{Channels, body_velocity, model, receiver};
use super::settings::AlignmentSettings;
use crate::earth::EARTH_RATE;
use crate::imu::Imu;
use crate::navigation::Navigation;
use nalgebra::UnitQuaternion;
use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::ProcessError;
use navfuse_core::model::process::start::{
    AlignmentReport, FilterView, InitialAlignment, Progress, Supervision,
};
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::Sensor;
use navfuse_core::state::display;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};

/// Interval of the zero-velocity updates and of the checks of the heading.
const PERIOD: Span = Span::from_nanos(1_000_000_000);
/// Number of consecutive gated zero-velocity updates that indicate motion.
const MOVED: u64 = 3;
/// Largest expected error of the coarse heading, rad: beyond it the filter cannot linearise.
const HOPELESS: f64 = 0.5;

/// Change of the attitude below which trials end, rad: half of the error that a navigation-grade
/// IMU leaves after 240 s.
const SETTLED: f64 = 3.5e-4;

#[derive(Clone)]
enum Phase {
    /// Before the first sample.
    Waiting,
    Searching(Box<CoarseAlignment>),
    /// The fine stage: its beginning, the time of the next check, and whether the delay was
    /// reported.
    Fine {
        begin: Time,
        next: Time,
        late: bool,
    },
    Done,
}

saved!(enum Phase { Waiting, Searching(search), Fine { begin, next, late }, Done });

/// The end of an alignment.
#[derive(Clone, Copy, Default)]
struct Aligned {
    /// Time since the beginning of the fine stage, s.
    elapsed: f64,
    /// Heading and its 1-sigma, rad.
    heading: f64,
    sigma: f64,
}

saved!(Aligned { elapsed, heading, sigma });

/// Finds attitude and velocity at the start, and supervises the filter until they are good enough.
#[derive(Clone)]
pub(crate) struct Aligner {
    settings: AlignmentSettings,
    navigation: Navigation,
    /// Sensor that the scenario names.
    wanted: Option<String>,
    imu: (String, Imu),
    sensed: Option<Sensed>,
    phase: Phase,
    /// Attitude of the first coarse solution.
    coarse: Option<UnitQuaternion<f64>>,
    /// Attitude of the latest coarse solution.
    before: Option<UnitQuaternion<f64>>,
    /// Warning to report at the start of the fine stage.
    doubt: Option<(String, String)>,
    aligned: Option<Aligned>,
}

saved!(Aligner {
    phase, coarse, before, doubt, aligned,
} except {
    settings, navigation, wanted, imu, sensed,
});

impl Aligner {
    pub fn new(
        config: &Alignment,
        settings: AlignmentSettings,
        imu: (String, Imu),
        navigation: Navigation,
    ) -> Self {
        let wanted = config.0.velocity.clone();
        Self {
            settings,
            navigation,
            wanted,
            imu,
            sensed: None,
            phase: Phase::Waiting,
            coarse: None,
            before: None,
            doubt: None,
            aligned: None,
        }
    }

    fn formula(&self, channels: Channels) -> Result<Formula, ComposeError> {
        match (self.settings.formula, channels.velocity) {
            (Some(Formula::Velocity), None) => {
                let text = "the receiver measures no velocity: give its velocity_noise, or formula = \
                            \"position\"";
                Err(ComposeError::new("alignment.formula", text))
            }
            (Some(stated), _) => Ok(stated),
            (None, velocity) => Ok(velocity.map_or(Formula::Position, |_| Formula::Velocity)),
        }
    }

    /// Finds the sensors that the method needs.
    fn sensed(&self, sensors: &[Sensor]) -> Result<Sensed, ComposeError> {
        let driver = sensors.iter().position(|s| s.info.name == self.imu.0).unwrap_or_default();
        let wanted = self.wanted.as_deref();
        let (index, gnss) = match self.settings.method {
            AlignmentMethod::InMotion => (Some(body_velocity(sensors, wanted)?), None),
            AlignmentMethod::InFlight => {
                let (index, channels) = receiver(sensors, wanted).ok_or_else(|| {
                    let text = "an alignment in flight needs a sensor that measures the position, \
                                such as [sensor.gnss]; name it with alignment.velocity";
                    ComposeError::new("alignment", text)
                })?;
                (Some(index), Some((channels, self.formula(channels)?)))
            }
            AlignmentMethod::Given | AlignmentMethod::Static | AlignmentMethod::Course => {
                (None, None)
            }
        };
        let velocity = index.map(|k| Ok((k, model(&sensors[k])?))).transpose()?;
        let (navigation, imu) = (self.navigation, self.imu.1.clone());
        Ok(Sensed { navigation, imu, driver, velocity, gnss })
    }

    /// Heading and 1-sigma of the heading, rad.
    fn heading(&self, now: &FilterView<'_>) -> (f64, f64) {
        let block = now.layout.block(self.navigation.attitude);
        let (mut angles, mut sigma) = ([0.0; 3], [0.0; 3]);
        block.show(&now.state.values, &mut angles);
        block.show_sigma(&now.state.values, now.covariance, &mut sigma);
        let scale = display::ANGLES.scale;
        (angles[2] * scale, sigma[2] * scale)
    }

    fn finish(&mut self, now: &FilterView<'_>, elapsed: f64) {
        let (heading, sigma) = self.heading(now);
        self.aligned = Some(Aligned { elapsed, heading, sigma });
        self.phase = Phase::Done;
    }
}

impl InitialAlignment for Aligner {
    fn connect(&mut self, sensors: &[Sensor]) -> Result<(), ComposeError> {
        self.sensed = Some(self.sensed(sensors)?);
        Ok(())
    }

    fn search(
        &mut self,
        layout: &Layout,
        state: &mut State,
        sample: &Sample,
    ) -> Result<Progress, ProcessError> {
        let Some(sensed) = &self.sensed else { return Ok(Progress::Found) };
        if matches!(self.phase, Phase::Waiting) {
            let latitude = state.get(layout, self.navigation.position).latitude;
            let error = self.settings.heading_error(&sensed.imu, EARTH_RATE * latitude.cos());
            if error > HOPELESS {
                return Err(AlignmentError::GyrosTooCoarse {
                    heading: error.to_degrees(),
                    duration: self.settings.coarse_duration,
                    latitude: latitude.to_degrees(),
                }
                .into());
            }
            self.phase =
                Phase::Searching(Box::new(CoarseAlignment::new(layout, state, self.navigation)));
        }
        let Phase::Searching(search) = &mut self.phase else { return Ok(Progress::Found) };
        if !search.take(layout, sensed, &self.settings, sample)? {
            return Ok(Progress::Searching);
        }
        let found = search.find(sensed, &self.settings)?;
        found.set(layout, &self.navigation, state);
        self.doubt = search.unverified(layout, sensed);
        self.coarse = Some(found.c_b_n);
        self.before = Some(found.c_b_n);
        // at rest no other state disturbs the linearisation, so no trial is needed
        Ok(if self.settings.method == AlignmentMethod::InMotion {
            Progress::Trial
        } else {
            Progress::Found
        })
    }

    fn search_again(
        &mut self,
        layout: &Layout,
        state: &mut State,
    ) -> Result<Progress, ProcessError> {
        let (Some(sensed), Phase::Searching(search)) = (&self.sensed, &mut self.phase) else {
            return Ok(Progress::Found);
        };
        search.measure_again(layout, sensed, state);
        let found = search.find(sensed, &self.settings)?;
        found.set(layout, &self.navigation, state);
        let before = self.before.replace(found.c_b_n);
        let settled = before.is_some_and(|before| before.angle_to(&found.c_b_n) < SETTLED);
        Ok(if settled { Progress::Found } else { Progress::Trial })
    }

    fn supervise(&mut self, now: &FilterView<'_>) -> Result<Supervision, ProcessError> {
        let time = now.state.time;
        if matches!(self.phase, Phase::Waiting | Phase::Searching(_)) {
            self.phase = Phase::Fine { begin: time, next: time + PERIOD, late: false };
            let found = self.coarse.as_ref().map(|found| {
                let yaw = found.euler_angles().2.to_degrees().rem_euclid(360.0);
                (
                    Level::Info,
                    format!(
                        "coarse alignment: heading {yaw:.2} deg, from {:.1} s",
                        self.settings.coarse_duration
                    ),
                )
            });
            return Ok(Supervision { message: found, ..Supervision::default() });
        }
        if let Some(doubt) = self.doubt.take() {
            return Ok(Supervision { doubt: Some(doubt), ..Supervision::default() });
        }
        let Phase::Fine { begin, next, late } = &mut self.phase else {
            return Ok(Supervision::default());
        };
        if time < *next {
            return Ok(Supervision::default());
        }
        while *next <= time {
            *next = *next + PERIOD;
        }
        let (begin, reported, settings) = (*begin, *late, &self.settings);
        let (elapsed, sigma) = (time.since(begin), self.heading(now).1);
        let good = sigma <= settings.gate;
        let deg = |rad: f64| format!("{:.3} deg", rad.to_degrees());
        if let Some((since, _)) = now.gated.filter(|(_, count)| *count >= MOVED) {
            if !good {
                return Err(AlignmentError::Moved {
                    at: since,
                    elapsed: since.since(begin),
                    sigma: sigma.to_degrees(),
                    gate: settings.gate.to_degrees(),
                }
                .into());
            }
            let text = format!(
                "the vehicle moved at {since}, {:.1} s into a static alignment of {} s, which ends \
                 so: 1-sigma of the heading {}, gate {}",
                since.since(begin),
                settings.duration,
                deg(sigma),
                deg(settings.gate)
            );
            self.finish(now, elapsed);
            let message = Some((Level::Warning, text));
            return Ok(Supervision { message, ..Supervision::default() });
        }
        if elapsed >= settings.duration && good {
            self.finish(now, elapsed);
            let message = self.report().map(|report| (Level::Info, report.text));
            return Ok(Supervision { message, ..Supervision::default() });
        }
        let mut message = None;
        if elapsed >= settings.duration && !reported {
            let (duration, gate) = (settings.duration, deg(settings.gate));
            let text = format!(
                "after {duration} s the heading has a 1-sigma of {}, gate {gate}: it goes on",
                deg(sigma)
            );
            message = Some((Level::Warning, text));
            if let Phase::Fine { late, .. } = &mut self.phase {
                *late = true;
            }
        }
        let constrain = self.settings.method == AlignmentMethod::Static;
        Ok(Supervision { constrain, message, doubt: None })
    }

    fn unfinished(&self, now: &FilterView<'_>) -> Option<(Level, String)> {
        let settings = &self.settings;
        let need = match settings.method {
            AlignmentMethod::Static => format!("an alignment at rest of {} s", settings.duration),
            AlignmentMethod::Given
            | AlignmentMethod::InMotion
            | AlignmentMethod::InFlight
            | AlignmentMethod::Course => {
                format!("an alignment in motion of {} s", settings.duration)
            }
        };
        let shorter = "begin earlier (estimator.start), or give alignment.duration less";
        match &self.phase {
            Phase::Waiting | Phase::Done => None,
            Phase::Searching(search) => Some((
                Level::Error,
                format!("the samples end {:.1} s into {need}: {shorter}", search.elapsed()),
            )),
            Phase::Fine { begin, .. } => {
                let elapsed = now.state.time.since(*begin);
                let (sigma, gate) = (self.heading(now).1, settings.gate);
                let reached = format!(
                    "the samples end {elapsed:.1} s into {need}, with a 1-sigma of the heading of \
                     {:.3} deg, gate {:.3} deg",
                    sigma.to_degrees(),
                    gate.to_degrees()
                );
                match (sigma <= gate, elapsed < settings.duration) {
                    (true, true) => Some((Level::Warning, format!("{reached}: {shorter}"))),
                    (true, false) => None,
                    (false, _) => {
                        let remedy = "more time or turns, better gyros (noise, bias), or a wider \
                                      alignment.heading_gate";
                        Some((Level::Error, format!("{reached}: it needs {remedy}")))
                    }
                }
            }
        }
    }

    fn report(&self) -> Option<AlignmentReport> {
        let Aligned { elapsed, heading, sigma } = self.aligned?;
        let degrees = |rad: f64| rad.to_degrees().rem_euclid(360.0);
        let (heading, sigma) = (degrees(heading), sigma.to_degrees());
        let method = self.settings.method.name();
        let coarse = self.coarse.as_ref().map(|found| degrees(found.euler_angles().2));
        let from =
            coarse.map_or_else(String::new, |c| format!(" (coarse, at the start: {c:.2} deg)"));
        let text = format!(
            "aligned, {method}, {elapsed:.0} s: heading {heading:.3} deg{from}, \
             1-sigma {sigma:.3} deg"
        );
        let values = serde_json::json!({
            "method": method,
            "duration_s": elapsed,
            "heading_deg": heading,
            "heading_sigma_deg": sigma,
            "coarse_heading_deg": coarse,
        });
        Some(AlignmentReport { text, values })
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }

    fn boxed_clone(&self) -> Box<dyn InitialAlignment> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests;
