//! What the methods work on: a recording, its segments, and an attitude.

use crate::CalibrationError;
use nalgebra::{Matrix3, Matrix4, Vector3};
use navfuse_segments::{
    Attitude, AttitudeStart, BodyVelocity, Directions, Kind, Mounting, Recording, Segment,
    SegmentError, Settings, find,
};
use serde::Serialize;

/// Where the attitude comes from that the methods take as known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AttitudeSource {
    /// The gyros, integrated from the first attitude of the reference, or from the scenario's initial value; their bias is
    /// taken off where the vehicle is at rest.
    #[default]
    Gyros,
    /// The reference: that of a simulation is the truth, as the paper says these methods assume.
    Reference,
}

/// A recording made ready.
#[derive(Clone, Debug)]
pub struct CalibrationData {
    /// All samples.
    pub recording: Recording,
    /// How segments are found.
    pub settings: Settings,
    /// The segments in order of time.
    pub segments: Vec<Segment>,
    /// The attitude.
    pub attitude: Attitude,
    /// Where it comes from.
    pub source: AttitudeSource,
}

impl CalibrationData {
    /// Finds the segments of a recording, and its attitude.
    ///
    /// # Errors
    /// When no attitude is known to begin from, or there is no reference and it is asked for.
    pub fn new(recording: Recording, source: AttitudeSource) -> Result<Self, SegmentError> {
        let settings = Settings::of(&recording);
        let (segments, attitude) = find(&recording, &settings)?;
        let mut data = Self { recording, settings, segments, attitude, source };
        if source == AttitudeSource::Reference && data.recording.reference.is_none() {
            return Err(SegmentError::Missing(
                "there is no reference to take the attitude from: add [sensor.reference], or take the gyros' attitude"
                    .into(),
            ));
        }
        let mounting = data.recording.velocities.first().map(|v| v.initial);
        data.attitude = data.attitude_with(mounting.as_ref());
        Ok(data)
    }

    /// The attitude with a mounting for the transport rate.
    pub(crate) fn attitude_with(&self, mounting: Option<&Mounting>) -> Attitude {
        let Attitude { start, gyro_bias, .. } = self.attitude;
        let mut attitude = Attitude::integrate(&self.recording, start, gyro_bias, mounting);
        if self.source == AttitudeSource::Reference {
            attitude.anchor(&self.recording);
        }
        attitude
    }

    /// The sensor that is calibrated: the first body velocity.
    ///
    /// # Errors
    /// When there is none, it has no samples, or it measures the velocity through the water.
    pub fn velocity(&self) -> Result<&BodyVelocity, CalibrationError> {
        let Some(velocity) = self.recording.velocities.first() else {
            return Err(CalibrationError::new(
                "there is no sensor of the body's velocity along three axes: add [sensor.dvl], with a `scale` and a \
                 `misalignment` of its own",
            ));
        };
        if velocity.samples.is_empty() {
            return Err(CalibrationError(format!(
                "[sensor.{}] has no samples: check its source",
                velocity.samples.name
            )));
        }
        Ok(velocity)
    }

    /// As [`Self::velocity`], for a method that compares with what is over the ground.
    ///
    /// # Errors
    /// Also when the velocity is that through the water.
    pub(crate) fn over_ground(&self) -> Result<&BodyVelocity, CalibrationError> {
        let velocity = self.velocity()?;
        if velocity.water {
            return Err(CalibrationError(format!(
                "[sensor.{}] tracks the water, whose current would be taken for a misalignment: this method needs bottom track",
                velocity.samples.name
            )));
        }
        Ok(velocity)
    }

    /// The segments of a kind.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Segment> {
        self.segments.iter().filter(move |s| s.kind == kind)
    }

    /// The time in segments of a kind, s.
    pub fn duration(&self, kind: Kind) -> f64 {
        self.of(kind).fold(0.0, |sum, s| sum + s.duration())
    }

    /// The time at rest, s.
    pub fn rest(&self) -> f64 {
        self.duration(Kind::Static)
    }

    /// A span on the run's clock, in words.
    pub(crate) fn span(&self, from: f64, to: f64) -> String {
        format!("{:.0} s to {:.0} s", self.recording.clock(from), self.recording.clock(to))
    }

    /// The segments of Type I that the velocity covers, and in how many directions their specific force varies.
    ///
    /// # Errors
    /// When there is none, or none that is long enough and without a gap.
    pub(crate) fn type_one(
        &self,
        gaps: Gaps,
    ) -> Result<(Vec<Segment>, Directions, Vec<String>), CalibrationError> {
        let velocity = self.velocity()?;
        let limit = (3.0 * velocity.samples.period()).max(1.0);
        let mut notes = Vec::new();
        let mut segments = Vec::new();
        for segment in self.of(Kind::TypeI) {
            let gap = velocity.samples.gaps(segment.from, segment.to, limit).into_iter().next();
            match gap {
                None => segments.push(*segment),
                Some([from, to]) => {
                    let name = &velocity.samples.name;
                    let (gap, whole) = (self.span(from, to), self.span(segment.from, segment.to));
                    if gaps == Gaps::Bridged
                        && velocity.samples.within(segment.from, segment.to).len() > 10
                    {
                        notes.push(format!(
                            "{name} is silent from {gap}, inside the segment of Type I from {whole}: bridged by the IMU"
                        ));
                        segments.push(*segment);
                    } else {
                        notes.push(format!(
                            "{name} is silent from {gap}: the segment of Type I from {whole} is not used"
                        ));
                    }
                }
            }
        }
        if segments.is_empty() {
            return Err(self.no_type_one(notes));
        }
        let directions = Directions::of(&self.recording, &self.settings, &self.attitude, &segments);
        if directions.rank == 0 {
            return Err(CalibrationError(format!(
                "the specific force varies by less than the noise on the segments of Type I ({:.1e} m/s^3): accelerate more, \
                 or longer",
                directions.noise
            )));
        }
        if directions.rank == 1 {
            let axis = directions.axes.column(0);
            notes.push(format!(
                "the specific force varies in one direction only, [{:.2}, {:.2}, {:.2}] forward, right, down (second singular \
                 value {:.1e}, noise {:.1e} m/s^3): the angle about it is not, or hardly, determined; dive, or thrust \
                 sideways, at constant attitude (Theorem 1, Remark 2)",
                axis[0], axis[1], axis[2], directions.singular_values[1], directions.noise
            ));
        }
        if self.rest() == 0.0 {
            notes.push(format!(
                "there is no time at rest (below {:.0} mm/s for {:.0} s): the gyro bias is taken as zero, within its prior; \
                 the sigma is optimistic",
                1e3 * self.settings.rest_speed,
                self.settings.shortest[0]
            ));
        }
        Ok((segments, directions, notes))
    }

    fn no_type_one(&self, notes: Vec<String>) -> CalibrationError {
        if !notes.is_empty() {
            return CalibrationError(format!("no segment of Type I is left: {}", notes.join("; ")));
        }
        let turning = self.duration(Kind::TypeII);
        let straight = self.duration(Kind::Steady);
        CalibrationError(format!(
            "there is no segment of Type I, constant attitude (below {:.2} deg/s, within {:.1} deg) and varying specific force \
             (above {:.1e} m/s^3) for {:.0} s or more: {turning:.0} s are turning, {straight:.0} s steady or too short, {:.0} s \
             at rest; accelerate, dive or thrust sideways on a straight course",
            self.settings.turn_rate.to_degrees(),
            self.settings.turn_angle.to_degrees(),
            self.settings.force_rate,
            self.settings.shortest[1],
            self.rest(),
        ))
    }

    /// 1-sigma of the gyro bias that is left, rad/s: what the rest does not tell.
    pub(crate) fn gyro_bias_sigma(&self) -> Vector3<f64> {
        let imu = &self.recording.imu;
        match self.rest() {
            0.0 => imu.gyro_bias,
            rest => imu.gyro_noise / rest.sqrt(),
        }
    }

    /// What the error of the attitude adds to the covariance of a method that takes it as known, by `k` and `δ`: the sigma
    /// that the scenario starts with, the gyros' noise and what is left of their bias, as if the course were one. Nothing where
    /// the attitude is the reference's, whose error no scenario tells.
    pub(crate) fn attitude_covariance(&self, mounting: &Mounting, used: [f64; 2]) -> Matrix4<f64> {
        let mut covariance = Matrix4::zeros();
        if self.source == AttitudeSource::Gyros {
            let time = (0.5 * (used[0] + used[1]) - self.attitude.start.time).abs();
            let square = |v: Vector3<f64>| v.component_mul(&v);
            let drift = square(self.gyro_bias_sigma() * time)
                + square(self.recording.imu.gyro_noise) * time;
            let body = Matrix3::from_diagonal(&(square(self.recording.attitude_sigma) + drift));
            let turned = mounting.c_b_d * body * mounting.c_b_d.inverse();
            covariance.fixed_view_mut::<3, 3>(1, 1).copy_from(&turned);
        }
        covariance
    }

    /// The start of the attitude, in words.
    pub fn attitude_source(&self) -> String {
        let AttitudeStart { time, .. } = self.attitude.start;
        match self.source {
            AttitudeSource::Reference => "attitude from the reference".into(),
            AttitudeSource::Gyros => {
                let clock = self.recording.clock(time);
                let bias = if self.rest() > 0.0 {
                    format!("their bias found in {:.0} s at rest", self.rest())
                } else {
                    "their bias taken as zero".into()
                };
                let whose = if self.recording.initial_attitude.is_some() {
                    "the scenario's"
                } else {
                    "the reference's"
                };
                format!("attitude from the gyros, integrated from {whose} at {clock:.1} s, {bias}")
            }
        }
    }
}

/// What a method does where the velocity has a gap inside a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gaps {
    /// It leaves the segment out.
    Refused,
    /// It goes on: what it integrates is the IMU.
    Bridged,
}
