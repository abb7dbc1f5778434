//! What the samples of a sensor show.

mod motion;

use crate::axes::{self, Mounted, Turn};
use crate::beams::{Aimed, Beams};
use crate::clocks::{self, ClockOffset, Measured};
use crate::earth;
use crate::sums::Sums;
use crate::track::RADIUS;
use crate::vertical;
use motion::Motion;
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::StreamError;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of intervals whose median is the interval of a sensor.
const INTERVALS: usize = 4096;
/// Intervals beyond this multiple of the usual one are gaps.
const GAP: f64 = 2.5;
/// Time between the positions that give a speed, s.
const TRAVEL: f64 = 5.0;
/// Deviation of the means of one second, m/s^2, below which an IMU is steady.
const STEADY: f64 = 0.05;
/// Length of the means by which rest is judged, s.
const BLOCK: f64 = 1.0;

/// The samples of one sensor.
#[derive(Clone, Debug)]
pub struct StreamSurvey {
    /// Name of the sensor.
    pub sensor: String,
    /// Registered type of the sensor.
    pub kind: String,
    /// Number of samples.
    pub samples: u64,
    /// Times of the first and the last sample.
    pub span: [Time; 2],
    /// Usual interval between two samples, s; zero for a single sample.
    pub interval: f64,
    /// Number of longer intervals, and the longest with the time at which it begins.
    pub gaps: (u64, f64, Time),
    /// Warnings and notes of the source.
    pub warnings: Vec<String>,
    /// The first sample.
    pub first: Sample,
    /// Names of the channels.
    pub channels: Vec<Arc<str>>,
    /// Mean of each channel.
    pub mean: [f64; MAX_CHANNELS],
    /// Standard deviation of the noise of each channel: that of differences of successive samples,
    /// divided by the square root of two.
    pub noise: [f64; MAX_CHANNELS],
    /// Standard deviation of the white noise of each channel: the least over blocks of several lengths.
    pub white: [f64; MAX_CHANNELS],
    /// Scatter of the means of each channel over one second.
    pub wander: [f64; MAX_CHANNELS],
    /// The least norm of the mean angular rate of an IMU over one second, rad/s: about that of the bias, where
    /// the vehicle rests for a while.
    pub quietest: Option<f64>,
    /// Largest speed over ground between positions some seconds apart, m/s.
    pub fastest: f64,
    /// The clock, compared with that of the IMU; `None` where the motion does not show it.
    pub clock: Option<ClockOffset>,
    /// The turn of a velocity log against the IMU.
    pub turn: Option<Turn>,
    /// The turn and the senses of the IMU against the course of a receiver.
    pub course: Option<Mounted>,
    /// Ratio of the turns of this course to those of the rates of the IMU.
    pub rate_ratio: Option<f64>,
    /// Set if the course of a receiver turns as if east and north were exchanged: by the turns alone, and
    /// by the accelerations too.
    pub mirrored: [bool; 2],
    /// Set for a velocity log whose velocities are along north and east; `false` for east and north.
    pub earth: Option<bool>,
    /// The beams of a log whose velocities are along them.
    pub aimed: Option<Aimed>,
    /// Share of the third velocity of a log in the rate of the depth, where it is no chance.
    pub sinks: Option<f64>,
    /// Twice the logarithm of the likelihood by which the accelerations are those of a log whose second axis points the
    /// other way.
    pub against_right: f64,
    /// Set for a receiver none of whose samples has a latitude and a longitude.
    pub nowhere: bool,
}

/// A sensor while its samples are read.
struct Running {
    survey: StreamSurvey,
    sums: [Sums; MAX_CHANNELS],
    intervals: Vec<f64>,
    block_end: f64,
    motion: Motion,
    /// An earlier time and position, for the speed over ground.
    place: Option<(Time, [f64; 2])>,
}

impl Running {
    /// Follows the speed over ground.
    fn travel(&mut self, sample: &Sample) {
        let at = |name| self.survey.channel(name).and_then(|k| sample.get(k));
        let Some((lat, lon)) = at("lat").zip(at("lon")) else { return };
        let (time, [lat0, lon0]) = *self.place.get_or_insert((sample.time, [lat, lon]));
        let seconds = sample.time.since(time);
        if seconds >= TRAVEL {
            let metres = RADIUS * (lat - lat0).hypot((lon - lon0) * lat.cos());
            self.survey.fastest = self.survey.fastest.max(metres / seconds);
            self.place = Some((sample.time, [lat, lon]));
        }
    }

    /// Follows the mean angular rate of the block that ends.
    fn rest(&mut self) {
        let Motion::Inertial(_, [first, _], increments) = self.motion else { return };
        let mean = |k: usize| self.sums[first + k].block_mean();
        let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(mean) else { return };
        let scale = if increments { 1.0 / self.survey.interval.max(1e-9) } else { 1.0 };
        let norm = scale * x.hypot(y).hypot(z);
        let quietest = &mut self.survey.quietest;
        *quietest = Some(quietest.map_or(norm, |least| least.min(norm)));
    }

    fn take(&mut self, sample: &Sample) {
        self.travel(sample);
        let survey = &mut self.survey;
        let since = if survey.samples > 0 { sample.time.since(survey.span[1]) } else { 0.0 };
        self.motion.take(sample, since);
        if survey.samples == 0 {
            survey.first = *sample;
            survey.span = [sample.time; 2];
            self.block_end = sample.time.seconds() + BLOCK;
        } else {
            let interval = sample.time.since(survey.span[1]);
            if self.intervals.len() < INTERVALS {
                self.intervals.push(interval);
                if self.intervals.len() == INTERVALS {
                    survey.interval = median(&self.intervals);
                }
            }
            let usual =
                if survey.interval > 0.0 { survey.interval } else { median(&self.intervals) };
            if interval > GAP * usual {
                survey.gaps.0 += 1;
                if interval > survey.gaps.1 {
                    (survey.gaps.1, survey.gaps.2) = (interval, survey.span[1]);
                }
            }
            survey.span[1] = sample.time;
        }
        survey.samples += 1;
        if sample.time.seconds() >= self.block_end {
            self.rest();
            self.sums.iter_mut().for_each(Sums::end_block);
            self.block_end = sample.time.seconds() + BLOCK;
        }
        for (k, sums) in self.sums.iter_mut().enumerate().take(self.survey.channels.len()) {
            if let Some(value) = sample.get(k) {
                sums.add(value);
            }
        }
    }

    /// The factors of the velocities east and north of a position whose latitude and longitude are
    /// exchanged: a degree along each has other metres then.
    fn exchanged(&self) -> [f64; 2] {
        let Motion::Place(_, [lat, lon], _) = self.motion else { return [1.0; 2] };
        let cos = |k: usize| self.sums[k].mean.cos().max(0.01);
        [1.0 / cos(lat), cos(lon)]
    }

    /// The mean of the specific force, or of its increments.
    fn force(&self) -> Option<[f64; 3]> {
        let Motion::Inertial(_, [_, first], _) = self.motion else { return None };
        Some([0, 1, 2].map(|k| self.sums[first + k].mean))
    }

    fn finish(mut self) -> StreamSurvey {
        let survey = &mut self.survey;
        survey.interval = median(&self.intervals);
        for (k, s) in self.sums.iter().enumerate() {
            survey.mean[k] = s.mean;
            survey.noise[k] = s.noise();
            survey.white[k] = s.white();
            survey.wander[k] = s.wander();
        }
        let angles = ["lat", "lon"].map(|name| survey.channel(name));
        survey.nowhere =
            survey.kind == "gnss" && angles.into_iter().flatten().any(|k| self.sums[k].is_empty());
        self.survey
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

impl StreamSurvey {
    /// Index of a channel.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|c| **c == *name)
    }

    /// Tests whether an IMU hardly accelerates: the means of the specific force over one second are
    /// nearly the same.
    pub fn is_steady(&self) -> bool {
        let increments = self.channel("dvel_x").is_some();
        let scale = if increments { 1.0 / self.interval.max(1e-9) } else { 1.0 };
        self.samples > 0 && self.wander[3..6].iter().all(|w| w * scale < STEADY)
    }

    /// The noise densities of an IMU: deg/h/sqrt(Hz) and ug/sqrt(Hz), the largest of the three axes.
    /// They are the white noise of its samples; of a steady IMU from second to second, where rounding has
    /// averaged out.
    pub fn densities(&self) -> [f64; 2] {
        let increments = self.channel("dvel_x").is_some();
        // a rate has the density s sqrt(dt), an increment over dt has s / sqrt(dt)
        let dt = self.interval.max(1e-9);
        let density = if increments { 1.0 / dt.sqrt() } else { dt.sqrt() };
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let steady = self.is_steady();
        let largest = |k: usize| {
            let fast = most(&self.white[k..k + 3]) * density;
            // the mean over one second of a rate has the density itself as its deviation
            let slow = most(&self.wander[k..k + 3]) * if increments { 1.0 / dt } else { 1.0 };
            if steady { fast.min(slow) } else { fast }
        };
        [largest(0).to_degrees() * 3600.0, largest(3) / 9.80665e-6]
    }

    /// The largest noise of the rates of an IMU from sample to sample, with all vibration,
    /// deg/h/sqrt(Hz).
    pub fn rate_scatter(&self) -> f64 {
        let density = self.interval.max(1e-9).sqrt().to_degrees() * 3600.0;
        self.noise[..3].iter().copied().fold(0.0, f64::max) * density
    }

    /// Tests whether two sensors have some time in common.
    pub fn meets(&self, other: &Self) -> bool {
        self.span[0] <= other.span[1] && other.span[0] <= self.span[1]
    }

    /// Time from the first to the last sample, s.
    pub fn length(&self) -> f64 {
        self.span[1].since(self.span[0])
    }

    /// Mean rate of the samples, Hz.
    pub fn rate(&self) -> f64 {
        let length = self.length();
        if length > 0.0 { (self.samples - 1) as f64 / length } else { 0.0 }
    }
}

/// Reads all samples of a scenario's sources, of which a log may have `beams`; `None` if `stop` was set.
///
/// # Errors
/// When a source cannot be read.
pub fn survey(
    assembly: Assembly,
    beams: Option<&Beams>,
    stop: &AtomicBool,
) -> Result<Option<Vec<StreamSurvey>>, StreamError> {
    let zero = Sample::empty(Time::MIN, SensorId(0));
    let mut running: Vec<Running> = (assembly.composition.sensors.iter())
        .map(|s| Running {
            survey: StreamSurvey {
                fastest: 0.0,
                clock: None,
                turn: None,
                course: None,
                rate_ratio: None,
                mirrored: [false; 2],
                earth: None,
                sinks: None,
                against_right: 0.0,
                nowhere: false,
                aimed: None,
                sensor: s.info.name.clone(),
                kind: s.info.kind.clone(),
                samples: 0,
                span: [Time::MIN; 2],
                interval: 0.0,
                gaps: (0, 0.0, Time::MIN),
                warnings: Vec::new(),
                first: zero,
                channels: s.info.channels.iter().map(|c| Arc::clone(&c.name)).collect(),
                mean: [0.0; MAX_CHANNELS],
                noise: [0.0; MAX_CHANNELS],
                white: [0.0; MAX_CHANNELS],
                wander: [0.0; MAX_CHANNELS],
                quietest: None,
            },
            sums: [Sums::default(); MAX_CHANNELS],
            intervals: Vec::new(),
            block_end: 0.0,
            motion: Motion::None,
            place: None,
        })
        .collect();
    running.iter_mut().for_each(|one| one.motion = Motion::of(&one.survey));
    for (_, mut source) in assembly.sources {
        let notes: Vec<String> = source
            .schedule()
            .into_iter()
            .filter(|event| event.level > Level::Info)
            .map(|event| event.text)
            .collect();
        let (mut sample, mut sensor) = (zero, None);
        while source.next(&mut sample)? {
            let Some(one) = running.get_mut(sample.sensor.0) else { continue };
            let composed = assembly.composition.sensors.get(sample.sensor.0);
            if let Some(converter) = composed.and_then(|s| s.conversion.as_ref()) {
                converter.apply(&mut sample);
            }
            // a conversion may leave nothing of a sample
            if sample.present() > 0 {
                one.take(&sample);
            }
            sensor = Some(sample.sensor.0);
            if one.survey.samples.is_multiple_of(4096) && stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
        }
        if let Some(one) = sensor.and_then(|k| running.get_mut(k)) {
            one.survey.warnings.extend(notes.into_iter().chain(source.warning()));
        }
    }
    compare(&mut running, beams);
    Ok(Some(running.into_iter().map(Running::finish).collect()))
}

/// Compares the clock and the axes of each sensor with those of the IMU.
fn compare(running: &mut [Running], beams: Option<&Beams>) {
    let inertial = |one: &Running| match &one.motion {
        Motion::Inertial(inertial, ..) => Some(inertial.clone()),
        _ => None,
    };
    let Some(imu) = running.iter().find_map(inertial) else { return };
    let force = running.iter().find_map(Running::force);
    let depth = running.iter().find_map(|one| match &one.motion {
        Motion::Depth(rows) => Some(rows.clone()),
        _ => None,
    });
    for one in running {
        if let (Motion::Beams(_, rows), Some(beams)) = (&one.motion, beams) {
            one.survey.sinks =
                depth.as_ref().and_then(|depth| beams.sinks(rows, depth, imu.as_they_are()));
            one.survey.aimed = force.and_then(|force| beams.aim(rows, imu.as_they_are(), force));
        }
        let Some(measured) = one.motion.measured() else { continue };
        let clock = |measured| clocks::compare(imu.as_they_are(), measured);
        let place = match &one.motion {
            Motion::Course(_, _, Some(place)) => place.measured().and_then(clock),
            _ => None,
        };
        let (clock, lag) = clocks::of_receiver(clock(measured), place);
        one.survey.clock = clock;
        one.survey.warnings.extend(lag.map(|[lag, sigma]| {
            format!(
                "its velocities are {lag:.3} s behind its positions, sigma {sigma:.3} s, as those of a filter: \
                 its clock is between both"
            )
        }));
        if let (Measured::Velocity(log), Some(depth)) = (measured, &depth) {
            one.survey.sinks = vertical::sinks(log, depth, imu.as_they_are());
        }
        match (force, measured) {
            (Some(force), Measured::Ground(rows)) => {
                one.survey.rate_ratio = axes::rate_ratio(imu.as_they_are(), force, rows);
                one.survey.course = axes::against_course(&imu, force, rows);
                one.survey.mirrored = axes::is_mirrored(&imu, force, rows, one.exchanged());
            }
            (Some(force), Measured::Velocity(rows)) => {
                one.survey.turn = axes::of_log(imu.as_they_are(), force, rows);
                one.survey.against_right = axes::against_right(imu.as_they_are(), force, rows);
                let down = axes::down(force);
                one.survey.earth = down.and_then(|d| earth::turns(imu.as_they_are(), d, rows));
            }
            _ => {}
        }
    }
}
