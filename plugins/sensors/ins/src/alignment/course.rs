//! Coarse alignment of a vehicle that drives: attitude from the velocity of GNSS and the
//! accelerometers, for gyros that cannot find north.
//!
//! The navigation equation, integrated from the first fix on with Earth rate and transport rate
//! left out (they change the velocity by less than 1 mg, as the accelerometers do), gives for every
//! later fix
//! ```text
//! C_b0^n int C_b^b0 f^b dt = v^n(t) - v^n(0) - g t
//! ```
//! and the assumption that the vehicle moves along its forward axis gives
//! ```text
//! C_b0^n C_b^b0 [1 0 0]' = v^n / |v^n|
//! ```
//! `C_b^b0` is integrated from the gyros. The constant `C_b0^n` is fitted to all fixes. The first
//! pair determines the tilt, and the heading as far as the vehicle accelerates; the second one
//! determines the heading within the mounting of the IMU and the side slip. A vehicle that reverses moves
//! against its forward axis, so both senses are fitted; the accelerations decide. A receiver without
//! velocity has the mean velocities between its positions ([`fixes`]); a vertical velocity that is
//! missing counts as zero.

mod fixes;

use super::config::AlignmentConfig;
use super::error::AlignmentError;
use super::inertial::Integral;
use super::optimisation::Pairs;
use super::sensors::{Channels, Model, model, receiver};
use crate::earth::LocalEarth;
use crate::imu::Imu;
use crate::mechanisation::Increments;
use crate::navigation::Navigation;
use fixes::{Fix, Positions};
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::ProcessError;
use navfuse_core::model::process::start::{
    AlignmentReport, FilterView, InitialAlignment, Progress,
};
use navfuse_core::model::record::Level;
use navfuse_core::model::sensor::Sensor;
use navfuse_core::model::sensor::measurement::At;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;

/// Expected angle between the direction of motion and the forward axis of the IMU, rad: mounting and
/// side slip.
const SLIP: f64 = 0.2;
/// Expected error of one velocity of GNSS, m/s.
const VELOCITY: f64 = 0.1;
/// Twice the logarithm of the likelihood ratio from which a vehicle reverses: 1e5 : 1.
const REVERSES: f64 = 23.0;
/// Least number of fixes in motion.
const FEWEST: usize = 4;
/// Prior sigma of the filter, rad: tilt, and heading.
const PRIOR: [f64; 2] = [0.05, 0.2];

/// Settings of an alignment by the course, in SI.
#[derive(Clone, Debug)]
pub(crate) struct CourseSettings {
    /// Shortest time, s.
    duration: f64,
    /// Speed from which the course is used, m/s.
    min_speed: f64,
    /// GNSS receiver that the scenario names.
    wanted: Option<String>,
    /// Largest prior sigma of the gyro biases, rad/s, and of the accelerometer biases, m/s^2.
    bias: (f64, f64),
}

impl CourseSettings {
    pub fn new(config: &AlignmentConfig, bias: (f64, f64)) -> Self {
        Self {
            duration: config.duration.map_or(10.0, |d| d.value().si()),
            min_speed: config.min_speed.map_or(2.0, |v| v.value().si()),
            wanted: config.velocity.clone(),
            bias,
        }
    }

    /// Prior sigma of the attitude about the coarse solution, rad: wide, since the filter uses the
    /// same samples again.
    pub fn attitude_prior() -> Vector3<f64> {
        Vector3::new(PRIOR[0], PRIOR[0], PRIOR[1])
    }

    /// Prior sigma of the velocity, m/s: the vehicle accelerates between its start and the first
    /// fix.
    pub fn velocity_prior() -> f64 {
        1.0
    }
}

/// The first fix and its gravity.
#[derive(Clone, Copy, Debug, Default)]
struct First {
    fix: Fix,
    gravity: f64,
}

saved!(First { fix, gravity });

/// Sums over the fixes by successive positions, each by the time between them: the time, velocity, integral of the
/// specific force, and stamp since the beginning. The errors of all positions but the first and the last cancel in them.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    time: f64,
    velocity: Vector3<f64>,
    dvel: Vector3<f64>,
    stamp: f64,
}

saved!(Sums { time, velocity, dvel, stamp });

impl Sums {
    fn add(&mut self, fix: &Fix, since: f64) {
        // the error of the way is the same for all
        let dt = 1.0 / fix.sigma[0];
        self.time += dt;
        self.velocity += fix.velocity * dt;
        self.dvel += fix.dvel * dt;
        self.stamp += since * dt;
    }
}

/// The coarse solution: time since the beginning, s, and attitude, rad.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    elapsed: f64,
    roll: f64,
    pitch: f64,
    yaw: f64,
}

saved!(Found { elapsed, roll, pitch, yaw });

/// Sensors of the alignment, and the first channels of position and velocity.
#[derive(Clone, Copy, Debug)]
struct Sensed {
    driver: usize,
    gnss: usize,
    position: usize,
    /// `None` for a receiver without velocity.
    velocity: Option<usize>,
}

/// Finds attitude, velocity and position of a vehicle that drives.
#[derive(Clone)]
pub(crate) struct CourseAlignment {
    settings: CourseSettings,
    navigation: Navigation,
    imu: (String, Imu),
    /// Set if the scenario does not give the position.
    finds_position: bool,
    sensed: Option<Sensed>,
    /// Model of the receiver, whose noise counts for positions without velocity.
    model: Option<Model>,
    /// Time of the beginning and of the last driving sample.
    span: Option<(Time, Time)>,
    integral: Integral,
    positions: Positions,
    first: Option<First>,
    sums: Sums,
    /// Pairs of a vehicle that moves ahead, and of one that reverses.
    pairs: [Pairs; 2],
    /// Number of fixes in motion.
    moving: usize,
    found: Option<Found>,
}

saved!(CourseAlignment {
    span, integral, positions, first, sums, pairs, moving, found,
} except {
    settings, navigation, imu, finds_position, sensed, model,
});

impl CourseAlignment {
    pub fn new(
        settings: CourseSettings,
        imu: (String, Imu),
        navigation: Navigation,
        finds_position: bool,
    ) -> Self {
        Self {
            settings,
            navigation,
            imu,
            finds_position,
            sensed: None,
            model: None,
            span: None,
            integral: Integral::default(),
            positions: Positions::default(),
            first: None,
            sums: Sums::default(),
            pairs: [Pairs::default(); 2],
            moving: 0,
            found: None,
        }
    }

    /// Adds the pairs of vectors of a fix.
    fn fix(&mut self, fix: Fix) {
        if let Some((begin, _)) = self.span {
            self.sums.add(&fix, fix.time.since(begin));
        }
        let Some(first) = self.first else {
            let place = fix.place.1;
            let gravity = LocalEarth::at(place.latitude, place.height).gravity;
            self.first = Some(First { fix, gravity });
            return;
        };
        let t = fix.time.since(first.fix.time);
        let force = fix.velocity - first.fix.velocity - Vector3::z() * (first.gravity * t);
        let measured = fix.dvel - first.fix.dvel;
        // accelerometer bias, and tilt by the gyro bias
        let (gyro, accel) = self.settings.bias;
        let sigma = (accel * t).hypot(0.5 * first.gravity * gyro * t * t).hypot(fix.sigma[0]);
        let moves = fix.velocity.xy().norm() >= self.settings.min_speed;
        for (pairs, sense) in self.pairs.iter_mut().zip([1.0, -1.0]) {
            pairs.add(&(force / sigma), &(measured / sigma));
            if moves {
                let course = fix.velocity.normalize() * sense;
                pairs.add(&(course / fix.sigma[1]), &(fix.forward / fix.sigma[1]));
            }
        }
        self.moving += usize::from(moves);
    }

    /// The 1-sigma of a position, horizontal and vertical, m.
    fn noise(&self, position: usize, at: &At<'_>) -> [f64; 2] {
        let Some(model) = &self.model else { return [0.0; 2] };
        let count = model.channels();
        let mut noise = vec![0.0; count * count];
        model.noise(at, &mut noise);
        let sigma = |k: usize| noise.get(k * (count + 1)).map_or(0.0, |variance| variance.sqrt());
        [sigma(position).max(sigma(position + 1)), sigma(position + 2)]
    }

    /// The velocity that a sample of GNSS gives.
    fn velocity(&mut self, sensed: &Sensed, at: &At<'_>) -> Option<Fix> {
        let sample = at.sample;
        let channel = |k: usize| sample.get(sensed.position + k);
        let height = channel(2).or(self.first.map(|first| first.fix.place.1.height)).unwrap_or(0.0);
        let place =
            (sample.time, Geodetic { latitude: channel(0)?, longitude: channel(1)?, height });
        let Some(first) = sensed.velocity else {
            let noise = self.noise(sensed.position, at);
            return self.positions.take(place, noise);
        };
        let [north, east] = sample.array(first)?;
        let velocity = Vector3::new(north, east, sample.get(first + 2).unwrap_or(0.0));
        Some(Fix::measured(place, velocity, &self.integral))
    }

    /// Velocity and position at the beginning, to which the means between positions are carried
    /// back; a measured velocity is near enough.
    fn beginning(
        &self,
        First { fix, gravity }: First,
        c_b0_n: &UnitQuaternion<f64>,
    ) -> (Vector3<f64>, Geodetic<f64>) {
        let (at, place) = fix.place;
        let measured = self.sensed.is_none_or(|sensed| sensed.velocity.is_some());
        let Some((begin, _)) = self.span.filter(|_| !measured) else {
            return (fix.velocity, place);
        };
        let Sums { time, velocity, dvel, stamp } = self.sums;
        let velocity = (velocity - c_b0_n * dvel - Vector3::z() * (gravity * stamp)) / time;
        (velocity, place.displaced(&(velocity * -at.since(begin))))
    }

    /// Sets the blocks of the process, if there are enough fixes.
    fn find(&mut self, layout: &Layout, state: &mut State, elapsed: f64) -> Option<()> {
        let first = self.first.filter(|_| self.moving >= FEWEST)?;
        let [ahead, back] = self.pairs.map(|pairs| pairs.solve());
        let ahead = ahead?;
        let fit = back.filter(|back| back.residual + REVERSES < ahead.residual).unwrap_or(ahead);
        let n = &self.navigation;
        state.set(layout, n.attitude, &fit.rotation.to_rotation_matrix());
        let (velocity, position) = self.beginning(first, &fit.rotation);
        state.set(layout, n.velocity, &velocity);
        if self.finds_position {
            state.set(layout, n.position, &position);
        }
        let (roll, pitch, yaw) = fit.rotation.euler_angles();
        self.found = Some(Found { elapsed, roll, pitch, yaw });
        Some(())
    }
}

impl InitialAlignment for CourseAlignment {
    fn connect(&mut self, sensors: &[Sensor]) -> Result<(), ComposeError> {
        let Some((gnss, channels)) = receiver(sensors, self.settings.wanted.as_deref()) else {
            let text = "an alignment by the course needs a sensor that measures the position, such \
                        as [sensor.gnss]; name it with alignment.velocity";
            return Err(ComposeError::new("alignment", text));
        };
        let driver = sensors.iter().position(|s| s.info.name == self.imu.0).unwrap_or_default();
        let Channels { position, velocity } = channels;
        self.model = model(&sensors[gnss]).ok();
        self.sensed = Some(Sensed { driver, gnss, position, velocity });
        Ok(())
    }

    fn search(
        &mut self,
        layout: &Layout,
        state: &mut State,
        sample: &Sample,
    ) -> Result<Progress, ProcessError> {
        let Some(sensed) = self.sensed else { return Ok(Progress::Found) };
        let (begin, last) = *self.span.get_or_insert((state.time, state.time));
        if sample.sensor.0 == sensed.driver {
            let dt = sample.time.since(last);
            if dt > 0.0
                && let Some((w, f)) = self.imu.1.rates(sample, dt)
            {
                let [gyro, accel] = self.navigation.biases(layout, state);
                let (w, f) = (w - gyro, f - accel);
                self.integral.advance(&Increments { dtheta: w * dt, dvel: f * dt, dt });
                self.positions.advance(&self.integral, dt);
                self.span = Some((begin, sample.time));
            }
        } else if sample.sensor.0 == sensed.gnss
            && let Some(fix) = self.velocity(&sensed, &At { layout, state, sample })
        {
            self.fix(fix);
            let elapsed = sample.time.since(begin);
            if elapsed >= self.settings.duration && self.find(layout, state, elapsed).is_some() {
                return Ok(Progress::Found);
            }
        }
        Ok(Progress::Searching)
    }

    fn unfinished(&self, _: &FilterView<'_>) -> Option<(Level, String)> {
        if self.found.is_some() {
            return None;
        }
        let error = AlignmentError::NoCourse {
            count: self.moving,
            least: FEWEST,
            speed: self.settings.min_speed,
            duration: self.settings.duration,
        };
        self.span.map(|_| (Level::Error, error.to_string()))
    }

    fn report(&self) -> Option<AlignmentReport> {
        let Found { elapsed, roll, pitch, yaw } = self.found?;
        let heading = yaw.to_degrees().rem_euclid(360.0);
        let text = format!(
            "aligned by the course, {elapsed:.1} s: heading {heading:.1} deg at the start, coarse"
        );
        let values = serde_json::json!({
            "method": "course",
            "duration_s": elapsed,
            "coarse_heading_deg": heading,
            "coarse_roll_deg": roll.to_degrees(),
            "coarse_pitch_deg": pitch.to_degrees(),
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
