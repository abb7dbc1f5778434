//! The strapdown process: mechanisation and error model as a process model of the framework.

use crate::alignment::{
    Aligner, Alignment, AlignmentMethod, AlignmentSettings, CourseAlignment, CourseSettings,
    ZeroVelocity,
};
use crate::error_model::transition;
use crate::errors::ImuErrors;
use crate::grade::Grade;
use crate::imu::{Imu, STANDARD_GRAVITY, SimulatedImu};
use crate::initial::{InitialPosition, InitialValue, spec, start};
use crate::integrator::{Integrator, MechanisationKey};
use crate::mechanisation::{Increments, MAX_LATITUDE_DEG, NavState};
use crate::monitor::ImuMonitor;
use crate::navigation::Navigation;
use crate::places::Places;
use crate::rates::{LastRates, Rates};
use crate::wander::{self, Frame, FramePlaces, WanderPlaces};
use nalgebra::{Matrix3, Vector3};
use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{AccelBias, GyroBias};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::screening::Spread;
use navfuse_core::model::process::{BuiltProcess, Product, SecondOrder};
use navfuse_core::model::process::{Input, Interval, ProcessError, ProcessModel};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::plugin::ProcessType;
use navfuse_core::state::covariance::Transition;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::{Vector, load_quaternion, store_quaternion};
use navfuse_core::state::{Display, Handle, Signal, display};
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::Channel;
use navfuse_core::units::time::Time;
use navfuse_core::units::{Angle, Speed, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Strapdown inertial navigation in north, east, down on WGS-84, driven by an IMU: attitude,
/// velocity, position, gyro and accelerometer bias.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Strapdown {
    /// IMU that drives the process: the name of its `[sensor.NAME]` table.
    #[serde(default = "imu")]
    pub imu: String,
    /// Source of attitude and velocity at the start: `given` (default), `static`, `in-motion`,
    /// `in-flight` or `course`, or a table with that `method` and its keys.
    #[serde(default)]
    pub alignment: Alignment,
    /// Integration of the navigation equations: `two-sample` (default) or `integration-formulae`, or
    /// a table with that `method` and its keys.
    #[serde(default)]
    pub mechanisation: MechanisationKey,
    /// Axes of the errors: `north-east-down` (default), or `wander-azimuth`, which leads through a pole.
    #[serde(default)]
    pub frame: Frame,
    /// Roll, pitch and yaw: prior sigma, and the initial value where no reference gives it. Not
    /// used with an alignment.
    pub attitude: Option<InitialValue<Triple<Angle>>>,
    /// Velocity north, east, down: prior sigma, and the initial value where no reference gives it.
    /// Not used with an alignment.
    pub velocity: Option<InitialValue<Triple<Speed>>>,
    /// Position: prior sigma north, east, down, and the initial value where no reference gives it.
    pub position: InitialPosition,
    /// Gyro bias. Default: none, or that of the IMU's `grade`.
    pub gyro_bias: Option<GyroBias>,
    /// Accelerometer bias. Default: none, or that of the IMU's `grade`.
    pub accel_bias: Option<AccelBias>,
    /// Gravity beyond normal gravity, north, east, down: a deflection of the vertical of 10 arcsec is
    /// 48 ug. Default: none.
    pub gravity_disturbance: Option<AccelBias>,
}

fn imu() -> String {
    "imu".into()
}

impl ProcessType for Strapdown {
    const TYPE: &'static str = "ins";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let imu: Imu = composer.input::<Imu>("imu", &self.imu)?.clone();
        let gyro_bias =
            self.gyro_bias.or_else(|| imu.grade.map(Grade::gyro_bias)).unwrap_or_default();
        let accel_bias =
            self.accel_bias.or_else(|| imu.grade.map(Grade::accel_bias)).unwrap_or_default();
        let bias = (
            gyro_bias.sigma.map_or(0.0, |s| s.value().si().amax()),
            // an alignment levels by the accelerometers, whose axes it takes as they are
            accel_bias.sigma.map_or(0.0, |s| s.value().si().amax()).hypot(imu.levelling_error()),
        );
        let settings = AlignmentSettings::new(&self.alignment, bias)?;
        let course = (self.alignment.0.method == AlignmentMethod::Course)
            .then(|| CourseSettings::new(&self.alignment.0, bias));
        let p = &self.position;
        let wanders = self.frame == Frame::WanderAzimuth;
        let position = p.initial_within(if wanders { 90.0 } else { MAX_LATITUDE_DEG })?;
        if wanders && imu.coast.is_some() {
            let text = "a process that coasts has axes of north, east and down: remove it, or coast of \
                        its IMU";
            return Err(ComposeError::new("frame", text));
        }
        // an alignment finds roll and pitch from the IMU itself, which cannot contradict them
        let tilt_prior =
            self.attitude.filter(|_| settings.is_none() && course.is_none()).map(|a| {
                let sigma = a.sigma.value().si();
                sigma.x.max(sigma.y)
            });
        let found = settings.as_ref().map(|s| s.attitude_prior(&imu));
        let found = found.or(course.as_ref().map(|_| CourseSettings::attitude_prior()));
        let attitude = start(composer, "attitude", self.attitude, found, display::ANGLES)?;
        let attitude = composer.block("attitude", attitude)?;
        let found = settings.as_ref().map(AlignmentSettings::velocity_prior);
        let found = found.or(course.as_ref().map(|_| CourseSettings::velocity_prior()));
        let found = found.map(Vector3::repeat);
        let velocity = start(composer, "velocity", self.velocity, found, display::VELOCITY)?;
        let velocity = composer.block("velocity", velocity)?;
        // the first fix gives it where the scenario does not
        let finds_position = course.is_some() && position.is_none();
        let position = if finds_position { Some([0.0; 3]) } else { position };
        let position =
            spec(composer, "position", p.sigma.value().si(), position, display::POSITION)?;
        let position = composer.block("position", position)?;
        composer.turns_with_heading(velocity, attitude);
        let gyro_bias = gyro_bias.block(composer, "gyro_bias", &[0.0; 3], display::GYRO_BIAS)?;
        let accel_bias =
            accel_bias.block(composer, "accel_bias", &[0.0; 3], display::ACCEL_BIAS)?;
        let [phi, ba, p] =
            [composer.tangent(attitude), composer.tangent(accel_bias), composer.tangent(position)];
        let t = composer.transition();
        let curved = [
            phi.zip(ba)
                .map(|(phi, ba)| SecondOrder::of_tilt(t, attitude, [phi, ba], STANDARD_GRAVITY)),
            phi.zip(p).map(|(phi, p)| SecondOrder::of_heading(t, [phi, p])),
        ];
        let gravity = (self.gravity_disturbance)
            .map(|gravity| gravity.block(composer, "gravity_disturbance", &[0.0; 3], GRAVITY))
            .transpose()?;
        let angular_rate = composer.signal("angular_rate");
        let earlier = composer.earlier(angular_rate);
        let navigation = Navigation {
            gyro_bias: Some(gyro_bias),
            accel_bias: Some(accel_bias),
            angular_rate: Some(angular_rate),
            ..Navigation::provide(composer, attitude, velocity, position)
        };
        let places = if wanders {
            composer.carries(position, attitude, velocity);
            FramePlaces::Wander(WanderPlaces::new(composer, &navigation, gravity, &self.imu))
        } else {
            FramePlaces::North(Places::new(composer, &navigation, gravity, &self.imu))
        };
        if let Some(model) = settings.as_ref().and_then(|s| s.constraint(velocity)) {
            let channels = Channel::all(ZeroVelocity::CHANNELS);
            composer.constraint(ZeroVelocity::NAME, channels, model);
        }
        let aligner = settings.map(|settings| {
            Aligner::new(&self.alignment, settings, (self.imu.clone(), imu.clone()), navigation)
        });
        let driving = || (self.imu.clone(), imu.clone());
        let course = course
            .map(|settings| CourseAlignment::new(settings, driving(), navigation, finds_position));
        let product =
            composer.tangent(attitude).zip(composer.tangent(gyro_bias)).map(|(tilt, bias)| {
                Product {
                    // roll and pitch: the yaw of a vehicle at rest does not tilt the axes of a bias
                    errors: [tilt..tilt + 2, bias..bias + 3],
                    moving: tilt + 2..tilt + 3,
                    noise: imu.gyro_noise().amax(),
                }
            });
        let simulator = SimulatedImu { imu: imu.clone(), gyro_bias, accel_bias, gravity };
        let gyro = imu.gyro_noise();
        let accel = imu.accel_noise();
        let isotropic =
            gyro.x == gyro.y && gyro.y == gyro.z && accel.x == accel.y && accel.y == accel.z;
        let mechanisation = self.mechanisation.integrator(wanders)?;
        let screening = imu.screening();
        let monitor = ImuMonitor::new(&self.imu, &imu, navigation, tilt_prior);
        let rates = LastRates::new(imu.gyro_noise().amax());
        let model = StrapdownModel {
            imu,
            navigation,
            earlier,
            gravity,
            places,
            mechanisation,
            isotropic,
            rates,
        };
        let built = match model.imu.coast {
            Some(_) => {
                let gap = model.imu.max_gap.value().si();
                BuiltProcess::new(model).coasts_after(gap)
            }
            None => BuiltProcess::new(model),
        };
        let built = match ImuErrors::find(composer, &self.imu) {
            Some(errors) => built.correcting(&self.imu, errors),
            None => built,
        };
        let built = built
            .driven_by(self.imu, simulator)
            .neglecting(product)
            .curved_by(curved.into_iter().flatten());
        let built = match screening {
            Some(screening) => {
                let built = built.screened_by(screening).watched_by(monitor);
                built.with_bias(gyro_bias).with_bias(accel_bias)
            }
            None => built,
        };
        Ok(match (aligner, course) {
            (Some(aligner), _) => built.aligned_by(aligner),
            (None, Some(course)) => built.aligned_by(course),
            (None, None) => built,
        })
    }
}

/// North, east and down in millionths of standard gravity.
const GRAVITY: Display = Display { components: &["north", "east", "down"], ..display::ACCEL_BIAS };

#[derive(Clone)]
struct StrapdownModel {
    imu: Imu,
    navigation: Navigation,
    /// The angular rate earlier, whose noise is another one.
    earlier: Signal<3>,
    gravity: Option<Handle<Vector<3>>>,
    places: FramePlaces,
    mechanisation: Integrator,
    isotropic: bool,
    /// Rates of the current sample and of the one before.
    rates: LastRates,
}

saved!(StrapdownModel { mechanisation, rates } except {
    imu, navigation, earlier, gravity, places, isotropic,
});

impl StrapdownModel {
    /// Process noise over `dt` in navigation axes, `C_b^n Q_b C_b^n'` (compare Groves section
    /// 14.2.6). The rotation is omitted where all axes have the same noise, since it changes
    /// nothing there.
    #[inline(always)]
    fn noise(
        &self,
        c_b_n: &Matrix3<f64>,
        density: Vector3<f64>,
        step: f64,
        dt: f64,
        duration: f64,
    ) -> Matrix3<f64> {
        if self.isotropic {
            return Matrix3::from_diagonal_element(Imu::variance(density.x, step, dt, duration));
        }
        let variance = density.map(|n| Imu::variance(n, step, dt, duration));
        c_b_n * Matrix3::from_diagonal(&variance) * c_b_n.transpose()
    }

    /// Variance that bridging adds over `dt`. Where samples are missing for `hole` of `duration`
    /// seconds, the mean rate in the hole is uncertain by the change of the rate over it, which is
    /// taken as one sigma on each axis.
    fn bridged(change: &Vector3<f64>, hole: f64, dt: f64, duration: f64) -> Matrix3<f64> {
        Matrix3::identity() * (change.norm_squared() * hole * hole * dt / duration)
    }

    /// Variance, in navigation axes, of the integral of a rate with a 1-sigma of `spread` times
    /// `share` in body axes: the filter replaced a faulty sample. A part `dt` of an interval
    /// `duration` has the share `time` = `dt duration` of the square of the whole.
    fn unknown(c_b_n: &Matrix3<f64>, spread: &[f64], share: f64, time: f64) -> Matrix3<f64> {
        let variance =
            Vector3::from_column_slice(spread).map(|sigma| (sigma * share).powi(2) * time);
        c_b_n * Matrix3::from_diagonal(&variance) * c_b_n.transpose()
    }

    /// Variances of attitude and velocity, in navigation axes, over a part `dt` of an interval whose
    /// sample is missing for a time or was replaced.
    #[cold]
    fn doubt(
        &self,
        c_b_n: &Matrix3<f64>,
        spread: Option<&Spread>,
        dt: f64,
        usual: f64,
        duration: f64,
    ) -> [Matrix3<f64>; 2] {
        let mut q = [Matrix3::zeros(); 2];
        if usual < duration {
            let [change_w, change_f] = self.rates.change();
            q[0] += Self::bridged(&change_w, duration - usual, dt, duration);
            q[1] += Self::bridged(&change_f, duration - usual, dt, duration);
        }
        if let Some(spread) = spread {
            let share = self.imu.share(usual);
            q[0] += Self::unknown(c_b_n, &spread[0..3], share, dt * duration);
            q[1] += Self::unknown(c_b_n, &spread[3..6], share, dt * duration);
        }
        q
    }

    /// Noise of attitude and velocity over a part `dt` of an interval, in navigation axes.
    #[inline(always)]
    fn noises(
        &self,
        c_b_n: &Matrix3<f64>,
        input: Input<'_>,
        dt: f64,
        usual: f64,
        duration: f64,
    ) -> [Matrix3<f64>; 2] {
        let (gyro, accel) = (self.imu.gyro_noise(), self.imu.accel_noise());
        let q_phi = self.noise(c_b_n, gyro, self.imu.gyro_step(), dt, duration);
        let q_v = self.noise(c_b_n, accel, self.imu.accel_step(), dt, duration);
        if usual < duration || input.spread.is_some() {
            let more = self.doubt(c_b_n, input.spread, dt, usual, duration);
            [q_phi + more[0], q_v + more[1]]
        } else {
            [q_phi, q_v]
        }
    }

    /// Publishes the angular rate at a time, for the sensors that read it then.
    #[inline(always)]
    fn publish(&self, state: &mut State, at: Time) {
        if let Some(w) = self.rates.angular_rate(at) {
            self.navigation.publish(state, &[w.x, w.y, w.z]);
            let w = self.rates.earlier().unwrap_or(w);
            state.publish(self.earlier, &[w.x, w.y, w.z]);
        }
    }
}

impl ProcessModel for StrapdownModel {
    fn prepare(&mut self, _layout: &Layout, state: &mut State, input: &Input<'_>) {
        let dt = if input.usual > 0.0 { input.usual } else { 1.0 };
        if let Some((w, f)) = self.imu.rates(input.sample, dt) {
            let time = input.sample.time;
            self.rates.take(Rates { time, duration: input.usual, w, f });
            self.publish(state, time);
        }
    }

    fn restart(&mut self) {
        self.mechanisation.restart();
    }

    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        out: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let Some(input) = interval.input else {
            let (Some(coast), FramePlaces::North(places)) = (self.imu.coast, &self.places) else {
                return Err(ProcessError::input("no IMU sample covers this time"));
            };
            self.mechanisation.restart();
            coast.propagate(&self.navigation, places, layout, state, dt, out);
            return Ok(());
        };
        let gap = self.imu.max_gap.value().si();
        let hole = input.duration.max(input.sample.time.since(interval.from));
        if hole > gap {
            return Err(ProcessError::input(format!(
                "no IMU sample for {:.3} s before {}, more than max_gap = {gap} s: the track cannot be bridged; repair \
                 the recording, start after the gap (estimator.start), or raise max_gap of the IMU",
                hole, input.sample.time
            )));
        }
        // without an earlier sample, the rate of the first one holds since the start of the filter
        let duration = if input.duration > 0.0 { input.duration } else { dt };
        let usual = if input.usual > 0.0 { input.usual } else { duration };
        let Some((w, f)) = self.imu.rates(input.sample, usual) else {
            return Err(ProcessError::input("channels of the IMU are missing"));
        };
        self.rates.take(Rates { time: input.sample.time, duration: usual, w, f });
        let n = &self.navigation;
        let at = |slot: usize| layout.blocks[slot].offset;
        let (a, v, p) = (at(n.attitude.slot()), at(n.velocity.slot()), at(n.position.slot()));
        let [bg, ba] = n.biases(layout, state);
        let gravity = self.gravity.map(|gravity| state.get(layout, gravity));
        let x = &mut state.values;
        let nav = NavState {
            c_b_n: load_quaternion(&x[a..a + 4]),
            velocity: Vector3::new(x[v], x[v + 1], x[v + 2]),
            position: Geodetic { latitude: x[p], longitude: x[p + 1], height: x[p + 2] },
        };
        let mut increments = Increments { dtheta: (w - bg) * dt, dvel: (f - ba) * dt, dt };
        if let Some(gravity) = gravity {
            // the axes of the beginning: over a step of 10 ms at 1 rad/s, 5e-3 of 50 ug is omitted
            increments.dvel += nav.c_b_n.inverse() * gravity * dt;
        }
        let (next, rates) = (self.mechanisation.step_part(&nav, &increments, duration.max(dt)))
            .map_err(|e| ProcessError::domain(e.to_string()).with_source(e))?;
        store_quaternion(&next.c_b_n, &mut x[a..a + 4]);
        x[v..v + 3].copy_from_slice(next.velocity.as_slice());
        x[p..p + 3].copy_from_slice(&[
            next.position.latitude,
            next.position.longitude,
            next.position.height,
        ]);
        self.publish(state, interval.to);
        // w = share z - b_g and f = share z - b_a: a channel acts as a bias of the other sign
        let share = self.imu.share(usual);
        let s = match &self.places {
            FramePlaces::North(places) => places,
            FramePlaces::Wander(places) => {
                let phi = wander::transition(&rates);
                places.fill(&phi, share, out);
                places.noise(&self.noises(&phi.c_b_n, input, dt, usual, duration), out);
                return Ok(());
            }
        };
        let phi = transition(&rates);
        out.set(s.phi_phi, &phi.phi_phi);
        out.set(s.phi_v, &phi.phi_v);
        out.set(s.phi_p[0], &phi.phi_p[0]);
        out.set(s.phi_p[1], &phi.phi_p[1]);
        out.set(s.phi_bg, &phi.phi_bg);
        out.set(s.v_phi, &phi.v_phi);
        out.set(s.v_v, &phi.v_v);
        out.set(s.v_p[0], &phi.v_p[0]);
        out.set(s.v_p[1], &phi.v_p[1]);
        out.set(s.v_ba, &phi.v_ba);
        out.set_diagonal(s.p_v, &[dt; 3]);
        out.set_diagonal(s.v_g, &[dt; 3]);
        out.set(s.p_p, &phi.p_p);
        if out.has_inputs() {
            out.set_input(s.phi_gyro, &(phi.phi_bg * -share));
            out.set_input(s.v_accel, &(phi.v_ba * -share));
        }
        let [q_phi, q_v] = self.noises(&rates.c_b_n, input, dt, usual, duration);
        out.set_noise(s.q_phi, &q_phi);
        out.set_noise(s.q_v, &q_v);
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let n = &self.navigation;
        state.set(layout, n.attitude, &motion.c_b_n.to_rotation_matrix());
        state.set(layout, n.velocity, &motion.velocity);
        state.set(layout, n.position, &motion.position);
        let w = motion.w_ib_b + n.biases(layout, state)[0];
        n.publish(state, &[w.x, w.y, w.z]);
        for slot in [n.attitude.slot(), n.velocity.slot(), n.position.slot()] {
            known[slot] = true;
        }
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests;
