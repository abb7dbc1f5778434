//! The motion that a sensor measures.

use super::StreamSurvey;
use crate::axes::Senses;
use crate::beams::Row;
use crate::clocks::Measured;
use crate::track::Track;
use navfuse_core::units::sample::Sample;

/// The motion that a sensor measures, for the comparison of clocks.
pub(super) enum Motion {
    None,
    /// Indices of the first gyro and of the first accelerometer; set for increments.
    Inertial(Box<Senses>, [usize; 2], bool),
    /// Index of the first of three velocities.
    Velocity(Measured, usize),
    /// Index of the heading.
    Heading(Measured, usize),
    /// Indices of the velocities north and east, and the positions beside them.
    Course(Measured, [usize; 2], Option<Box<Motion>>),
    /// Indices of latitude and longitude, whose changes are a velocity.
    Place(Measured, [usize; 2], Track),
    /// Time and depth.
    Depth(Vec<[f64; 2]>),
    /// Number of the beams, and the velocities along them.
    Beams(usize, Vec<Row>),
}

impl Motion {
    pub(super) fn of(survey: &StreamSurvey) -> Self {
        let at = |name| survey.channel(name);
        if let Some((gyro, accel)) = at("gyro_x").zip(at("accel_x")) {
            Self::Inertial(Box::default(), [gyro, accel], false)
        } else if let Some((gyro, accel)) = at("dtheta_x").zip(at("dvel_x")) {
            Self::Inertial(Box::default(), [gyro, accel], true)
        } else if let Some(first) = at("vel_x") {
            Self::Velocity(Measured::Velocity(Vec::new()), first)
        } else if let Some(k) = at("yaw").or_else(|| at("heading")) {
            Self::Heading(Measured::Heading(Vec::new()), k)
        } else if let Some((north, east)) = at("vel_n").zip(at("vel_e")) {
            let place = Self::place(survey).map(Box::new);
            Self::Course(Measured::Ground(Vec::new()), [north, east], place)
        } else if let Some(place) = Self::place(survey) {
            place
        } else if at("depth") == Some(0) {
            Self::Depth(Vec::new())
        } else if at("beam_3").is_some() {
            Self::Beams(if at("beam_4").is_some() { 4 } else { 3 }, Vec::new())
        } else {
            Self::None
        }
    }

    fn place(survey: &StreamSurvey) -> Option<Self> {
        let (lat, lon) = survey.channel("lat").zip(survey.channel("lon"))?;
        Some(Self::Place(Measured::Ground(Vec::new()), [lat, lon], Track::default()))
    }

    pub(super) fn take(&mut self, sample: &Sample, interval: f64) {
        let time = sample.time.seconds();
        match self {
            Self::None => {}
            Self::Inertial(inertial, [gyro, accel], increments) => {
                let both = sample.array::<3>(*gyro).zip(sample.array::<3>(*accel));
                if let Some((rate, force)) = both.filter(|_| interval > 0.0) {
                    let scale = if *increments { 1.0 / interval } else { 1.0 };
                    let [rate, force] = [rate, force].map(|v| v.map(|x| x * scale));
                    inertial.add(time, interval, rate, force);
                }
            }
            Self::Velocity(measured, first) => {
                if let Some(velocity) = sample.array(*first) {
                    measured.velocity(time, velocity);
                }
            }
            Self::Heading(measured, k) => {
                if let Some(heading) = sample.get(*k) {
                    measured.heading(time, heading);
                }
            }
            Self::Course(measured, [north, east], place) => {
                if let Some(place) = place {
                    place.take(sample, interval);
                }
                if let Some((north, east)) = sample.get(*north).zip(sample.get(*east)) {
                    measured.ground(time, north, east);
                }
            }
            Self::Depth(rows) => rows.extend(sample.get(0).map(|depth| [time, depth])),
            Self::Beams(count, rows) => {
                let mut row = [0.0; 4];
                let whole = (0..*count).all(|k| sample.get(k).map(|v| row[k] = v).is_some());
                rows.extend(whole.then_some((time, row)));
            }
            Self::Place(measured, [lat, lon], track) => {
                let fix = sample.get(*lat).zip(sample.get(*lon));
                let moved = fix.and_then(|(lat, lon)| track.add(time, lat, lon));
                if let Some([middle, north, east]) = moved {
                    measured.ground(middle, north, east);
                }
            }
        }
    }

    pub(super) fn measured(&self) -> Option<&Measured> {
        match self {
            Self::Velocity(measured, _)
            | Self::Heading(measured, _)
            | Self::Course(measured, ..)
            | Self::Place(measured, ..) => Some(measured),
            Self::None | Self::Inertial(..) | Self::Depth(_) | Self::Beams(..) => None,
        }
    }
}
