//! The alignment from its beginning to its end.

use super::search::Search;
use super::{Alignment, Coarse, Method};
use crate::earth::EARTH_RATE;
use crate::imu::Imu;
use crate::navigation::Navigation;
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};
use navfuse_core::Real;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::measurement::{AnyMeasurement, MeasurementModel};
use navfuse_core::model::process::ProcessError;
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::sensor::{Role, Sensor};
use navfuse_core::model::start::{
    AlignmentReport, FilterView, InitialAlignment, Progress, Supervision,
};
use navfuse_core::state::display;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Handle, Layout, State, View};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::time::Time;
use std::sync::Arc;

/// The name under which the zero velocity of a vehicle at rest is recorded.
pub(crate) const NAME: &str = "zero_velocity";

/// How often zero velocity is taken as measured, and the heading is looked at.
const PERIOD: Time = Time::from_nanos(1_000_000_000);
/// So many zero velocities that do not fit in a row are a motion.
const MOVED: u64 = 3;
/// The shortest alignment, s: by then gravity has turned by 0.1 deg at most.
const SHORTEST: f64 = 10.0;
/// The prior of the fine alignment, as a multiple of the coarse one's expected error: its information then is a hundredth.
const PRIOR: f64 = 10.0;
/// Beyond that error of the heading, rad, nothing can be linearised.
const HOPELESS: f64 = 0.5;

/// Trials end when the attitude changes by less, rad: half of what 240 s of a good IMU leave.
const SETTLED: f64 = 3.5e-4;

/// Zero velocity as if it were measured.
pub(crate) struct AtRest {
    velocity: Handle<Vector<3>>,
    sigma: f64,
}

impl MeasurementModel<3> for AtRest {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.velocity)
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal_element(self.sigma * self.sigma)
    }
}

/// The sensors that it uses, in their places.
#[derive(Clone)]
pub(crate) struct Sensed {
    pub imu: Imu,
    pub driver: usize,
    /// The one that measures the velocity.
    pub velocity: Option<(usize, Arc<dyn AnyMeasurement + Sync>)>,
}

/// What the alignment is told, in SI.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub method: Method,
    pub duration: f64,
    /// How long samples are only looked at.
    pub coarse_duration: f64,
    pub coarse: Coarse,
    pub gate: f64,
    pub rest_velocity: f64,
    pub max_gap: f64,
    /// The largest prior sigma of the gyros' and the accelerometers' biases.
    pub bias: (f64, f64),
}

impl Plan {
    /// The error of heading that the coarse alignment is expected to have, rad, with `north` the horizontal Earth rate: gyro bias,
    /// gyro noise, and the velocity that is not known, over the time that it takes.
    fn heading_error(&self, imu: &Imu, north: f64) -> f64 {
        let t = self.coarse_duration;
        let rate = self.bias.0.hypot(1.2 * imu.gyro_noise.value().si().amax() / t.sqrt());
        let turned = crate::earth::normal_gravity(0.8, 0.0) * 0.5 * t * t;
        rate.hypot(self.rest_velocity * std::f64::consts::SQRT_2 / turned) / north
    }

    fn tilt_error(&self) -> f64 {
        let gravity = crate::earth::normal_gravity(0.8, 0.0);
        (self.bias.1 / gravity).hypot(self.rest_velocity / (gravity * self.coarse_duration))
    }
}

#[derive(Clone)]
enum Phase {
    /// Before it begins.
    Waiting,
    Searching(Box<Search>),
    /// Fine: since when, when it looks next, and whether it told that it takes longer.
    Fine {
        begin: Time,
        next: Time,
        late: bool,
    },
    Done,
}

/// Finds attitude and velocity at the start, and tells when they are good enough.
#[derive(Clone)]
pub(crate) struct Aligner {
    plan: Plan,
    navigation: Navigation,
    /// The sensor that the scenario names.
    wanted: Option<String>,
    imu: (String, Imu),
    sensed: Option<Sensed>,
    phase: Phase,
    /// The attitude that was found coarsely, and the one after the last trial.
    coarse: Option<UnitQuaternion<f64>>,
    before: Option<UnitQuaternion<f64>>,
    /// What is to be said at the start, beside the coarse attitude.
    warning: Option<String>,
    report: Option<AlignmentReport>,
}

impl Aligner {
    /// The alignment that a scenario asks for; `None` where attitude and velocity are given.
    ///
    /// # Errors
    /// When keys do not fit one another.
    pub fn plan(config: &Alignment, bias: (f64, f64)) -> Result<Option<Plan>, ComposeError> {
        let c = &config.0;
        let error =
            |key: &str, text: String| Err(ComposeError::new(format!("alignment.{key}"), text));
        let at_rest = [
            ("coarse", c.coarse.is_some()),
            ("coarse_duration", c.coarse_duration.is_some()),
            ("rest_velocity", c.rest_velocity.is_some()),
        ];
        let moving = [("velocity", c.velocity.is_some()), ("max_gap", c.max_gap.is_some())];
        let any = [("duration", c.duration.is_some()), ("heading_gate", c.heading_gate.is_some())];
        let (of_no_use, why): (Vec<_>, _) = match c.method {
            Method::Given => (
                [&at_rest[..], &moving, &any].concat(),
                "of no use where attitude and velocity are given",
            ),
            Method::Static => (moving.to_vec(), "of no use at rest"),
            Method::InMotion => (at_rest.to_vec(), "of no use in motion"),
        };
        if let Some((key, _)) = of_no_use.iter().find(|k| k.1) {
            return error(key, format!("{why}: remove it, or set another alignment.method"));
        }
        if c.method == Method::Given {
            return Ok(None);
        }
        let moving = c.method == Method::InMotion;
        let duration = c.duration.map_or(if moving { 240.0 } else { 600.0 }, |d| d.value().si());
        if duration < SHORTEST {
            let text = format!(
                "{duration} s is too short to see the Earth turn: give {SHORTEST} s at least, minutes rather"
            );
            return error("duration", text);
        }
        let default = (0.2 * duration).clamp(20.0, 120.0).min(duration);
        let coarse_duration =
            c.coarse_duration.map_or(if moving { duration } else { default }, |d| d.value().si());
        if !(SHORTEST..=duration).contains(&coarse_duration) {
            let text = format!(
                "{coarse_duration} s is not possible: give {SHORTEST} s to the duration of {duration} s"
            );
            return error("coarse_duration", text);
        }
        Ok(Some(Plan {
            method: c.method,
            duration,
            coarse_duration,
            coarse: c.coarse.unwrap_or_default(),
            gate: c.heading_gate.map_or_else(|| 1_f64.to_radians(), |g| g.value().si()),
            rest_velocity: if moving {
                0.0
            } else {
                c.rest_velocity.map_or(5e-3, |v| v.value().si())
            },
            max_gap: c.max_gap.map_or(5.0, |g| g.value().si()),
            bias,
        }))
    }

    pub fn new(config: &Alignment, plan: Plan, imu: (String, Imu), navigation: Navigation) -> Self {
        let wanted = config.0.velocity.clone();
        Self {
            plan,
            navigation,
            wanted,
            imu,
            sensed: None,
            phase: Phase::Waiting,
            coarse: None,
            before: None,
            warning: None,
            report: None,
        }
    }

    /// The sensor that the scenario names, or else the only one that could be it: one of three channels or more that are speeds.
    fn velocity_sensor(
        &self,
        sensors: &[Sensor],
    ) -> Result<(usize, Arc<dyn AnyMeasurement + Sync>), ComposeError> {
        let measures = |s: &&Sensor| s.info.purpose == Purpose::Measurement && !s.constraint;
        let names = |list: &[&Sensor]| {
            list.iter().map(|s| s.info.name.clone()).collect::<Vec<_>>().join(", ")
        };
        let all: Vec<&Sensor> = sensors.iter().filter(measures).collect();
        let speeds = |s: &&&Sensor| s.info.channels.iter().filter(|c| c.unit == "mps").count() >= 3;
        let fitting: Vec<&Sensor> = match &self.wanted {
            Some(name) => all.iter().copied().filter(|s| s.info.name == *name).collect(),
            None => all.iter().filter(speeds).copied().collect(),
        };
        let [one] = fitting.as_slice() else {
            let what = match (&self.wanted, fitting.len()) {
                (Some(name), _) => format!("there is no [sensor.{name}] that corrects the state"),
                (None, 0) => {
                    "an alignment in motion needs a sensor that measures the velocity, such as [sensor.dvl]".into()
                }
                (None, _) => format!("more than one sensor measures the velocity: {}", names(&fitting)),
            };
            let text = format!(
                "{what}; name one with alignment.velocity (sensors that correct the state: {})",
                names(&all)
            );
            return Err(ComposeError::new("alignment", text));
        };
        let index = sensors.iter().position(|s| s.info.name == one.info.name).unwrap_or_default();
        match &one.role {
            Role::Measurement(model) => Ok((index, Arc::clone(model))),
            Role::Input(_) | Role::Reference(_) => {
                Err(ComposeError::new("alignment", "the sensor measures nothing"))
            }
        }
    }

    /// Heading and its 1-sigma, rad.
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
        let degrees = |rad: f64| rad.to_degrees().rem_euclid(360.0);
        let (heading, sigma) = (degrees(heading), sigma.to_degrees());
        let method = if self.plan.method == Method::Static { "static" } else { "in-motion" };
        let coarse = self.coarse.as_ref().map(|found| degrees(found.euler_angles().2));
        let from =
            coarse.map_or_else(String::new, |c| format!(" (coarse, at the start: {c:.2} deg)"));
        let text = format!(
            "aligned, {method}, {elapsed:.0} s: heading {heading:.3} deg{from}, 1-sigma {sigma:.3} deg"
        );
        let values = serde_json::json!({
            "method": method,
            "duration_s": elapsed,
            "heading_deg": heading,
            "heading_sigma_deg": sigma,
            "coarse_heading_deg": coarse,
        });
        self.report = Some(AlignmentReport { text, values });
        self.phase = Phase::Done;
    }
}

impl Plan {
    /// What is known of a vehicle at rest.
    pub fn constraint(&self, velocity: Handle<Vector<3>>) -> Option<AtRest> {
        (self.method == Method::Static).then_some(AtRest { velocity, sigma: self.rest_velocity })
    }

    /// Prior sigma of the attitude about what the coarse alignment finds, rad: so wide that it tells nothing of what the
    /// same samples tell again.
    pub fn attitude_prior(&self, imu: &Imu) -> Vector3<f64> {
        let heading = PRIOR * self.heading_error(imu, EARTH_RATE * std::f64::consts::FRAC_1_SQRT_2);
        let (tilt, least) = match self.method {
            // an error of the velocity's scale factor is one of the coarse attitude
            Method::InMotion => (1_f64.to_radians(), 10_f64.to_radians()),
            Method::Given | Method::Static => (0.05_f64.to_radians(), 1_f64.to_radians()),
        };
        let tilt = (PRIOR * self.tilt_error()).clamp(tilt, 5_f64.to_radians());
        Vector3::new(tilt, tilt, heading.clamp(least, 30_f64.to_radians()))
    }

    /// Prior sigma of the velocity, m/s: at rest that of the rest, in motion so wide that it tells nothing.
    pub fn velocity_prior(&self) -> f64 {
        if self.method == Method::Static { self.rest_velocity } else { 10.0 }
    }
}

/// The channels of zero velocity.
impl AtRest {
    pub const CHANNELS: [Channel; 3] =
        [Channel::new("vel_n", "mps"), Channel::new("vel_e", "mps"), Channel::new("vel_d", "mps")];
}

impl InitialAlignment for Aligner {
    fn connect(&mut self, sensors: &[Sensor]) -> Result<(), ComposeError> {
        let driver = sensors.iter().position(|s| s.info.name == self.imu.0).unwrap_or_default();
        let velocity = match self.plan.method {
            Method::InMotion => Some(self.velocity_sensor(sensors)?),
            Method::Given | Method::Static => None,
        };
        self.sensed = Some(Sensed { imu: self.imu.1.clone(), driver, velocity });
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
            let error = self.plan.heading_error(&sensed.imu, EARTH_RATE * latitude.cos());
            if error > HOPELESS {
                return Err(ProcessError(format!(
                    "the gyros cannot find north: with this bias and noise the heading would be {:.0} deg wrong, 1-sigma, after \
                     {} s at latitude {:.1} deg; give the heading (alignment = \"given\"), or more time to quiet gyros",
                    error.to_degrees(),
                    self.plan.coarse_duration,
                    latitude.to_degrees()
                )));
            }
            self.phase = Phase::Searching(Box::new(Search::new(layout, state, self.navigation)));
        }
        let Phase::Searching(search) = &mut self.phase else { return Ok(Progress::Found) };
        if !search.take(layout, sensed, &self.plan, sample).map_err(ProcessError)? {
            return Ok(Progress::Searching);
        }
        let found = search.find(sensed, &self.plan).map_err(ProcessError)?;
        found.set(layout, &self.navigation, state);
        self.warning = search.unverified(layout, sensed);
        self.coarse = Some(found.c_b_n);
        self.before = Some(found.c_b_n);
        // at rest nothing else is uncertain that could be in the way
        Ok(if self.plan.method == Method::InMotion { Progress::Trial } else { Progress::Found })
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
        let found = search.find(sensed, &self.plan).map_err(ProcessError)?;
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
                        self.plan.coarse_duration
                    ),
                )
            });
            return Ok(Supervision { constrain: false, message: found });
        }
        if let Some(text) = self.warning.take() {
            return Ok(Supervision { constrain: false, message: Some((Level::Warning, text)) });
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
        let (begin, told, plan) = (*begin, *late, &self.plan);
        let (elapsed, sigma) = (time.since(begin), self.heading(now).1);
        let good = sigma <= plan.gate;
        let deg = |rad: f64| format!("{:.3} deg", rad.to_degrees());
        if let Some((since, _)) = now.gated.filter(|(_, count)| *count >= MOVED) {
            let moved = format!(
                "the vehicle moved at {since}, {:.1} s into a static alignment",
                since.since(begin)
            );
            let sigma_text =
                format!("1-sigma of the heading {}, gate {}", deg(sigma), deg(plan.gate));
            if !good {
                return Err(ProcessError(format!(
                    "{moved}: {sigma_text}; start later or stay longer at rest, align in motion (alignment.method = \
                     \"in-motion\"), raise alignment.rest_velocity if that was sway, or alignment.heading_gate if that will do"
                )));
            }
            let text = format!("{moved} of {} s, which ends so: {sigma_text}", plan.duration);
            self.finish(now, elapsed);
            return Ok(Supervision { constrain: false, message: Some((Level::Warning, text)) });
        }
        if elapsed >= plan.duration && good {
            self.finish(now, elapsed);
            let said = self.report.as_ref().map(|r| (Level::Info, r.text.clone()));
            return Ok(Supervision { constrain: false, message: said });
        }
        let mut said = None;
        if elapsed >= plan.duration && !told {
            let (duration, gate) = (plan.duration, deg(plan.gate));
            let text = format!(
                "after {duration} s the heading has a 1-sigma of {}, gate {gate}: it goes on",
                deg(sigma)
            );
            said = Some((Level::Warning, text));
            if let Phase::Fine { late, .. } = &mut self.phase {
                *late = true;
            }
        }
        Ok(Supervision { constrain: self.plan.method == Method::Static, message: said })
    }

    fn unfinished(&self, now: &FilterView<'_>) -> Option<(Level, String)> {
        let plan = &self.plan;
        let need = match plan.method {
            Method::Static => format!("an alignment at rest of {} s", plan.duration),
            Method::Given | Method::InMotion => {
                format!("an alignment in motion of {} s", plan.duration)
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
                let (sigma, gate) = (self.heading(now).1, plan.gate);
                let reached = format!(
                    "the samples end {elapsed:.1} s into {need}, with a 1-sigma of the heading of {:.3} deg, gate {:.3} deg",
                    sigma.to_degrees(),
                    gate.to_degrees()
                );
                match (sigma <= gate, elapsed < plan.duration) {
                    (true, true) => Some((Level::Warning, format!("{reached}: {shorter}"))),
                    (true, false) => None,
                    (false, _) => {
                        let remedy = "more time or turns, better gyros (noise, bias), or a wider alignment.heading_gate";
                        Some((Level::Error, format!("{reached}: it needs {remedy}")))
                    }
                }
            }
        }
    }

    fn report(&self) -> Option<AlignmentReport> {
        self.report.clone()
    }

    fn boxed_clone(&self) -> Box<dyn InitialAlignment> {
        Box::new(self.clone())
    }
}
