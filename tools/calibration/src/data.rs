//! Input of the methods: a recording, its segments, and an attitude.

use crate::CalibrationError;
use nalgebra::{Matrix3, Matrix4, Vector3};
use navfuse_segments::{
    Attitude, AttitudeStart, BodyVelocity, Directions, Kind, Mounting, Recording, Segment,
    SegmentError, Settings, find,
};
use serde::Serialize;

/// Source of the attitude that the methods take as known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AttitudeSource {
    /// Gyros, integrated from the first attitude of the reference or from the scenario's initial
    /// value. Their bias is the mean rate at rest.
    #[default]
    Gyros,
    /// Reference. In a simulation it is the truth, which the paper assumes for these methods.
    Reference,
}

/// Recording with its segments and attitude.
#[derive(Clone, Debug)]
pub struct CalibrationData {
    /// All samples.
    pub recording: Recording,
    /// Thresholds of the segments.
    pub settings: Settings,
    /// Segments in order of time.
    pub segments: Vec<Segment>,
    /// Attitude over time.
    pub attitude: Attitude,
    /// Source of the attitude.
    pub source: AttitudeSource,
}

impl CalibrationData {
    /// Finds the segments of a recording, and its attitude.
    ///
    /// # Errors
    /// Returns an error if no initial attitude is known, or if the reference is selected but
    /// missing.
    pub fn new(recording: Recording, source: AttitudeSource) -> Result<Self, SegmentError> {
        let settings = Settings::of(&recording);
        let (segments, attitude) = find(&recording, &settings)?;
        let mut data = Self { recording, settings, segments, attitude, source };
        if source == AttitudeSource::Reference && data.recording.reference.is_none() {
            return Err(SegmentError::Missing(
                "there is no reference for the attitude: add [sensor.reference], or use the \
                 attitude of the gyros"
                    .into(),
            ));
        }
        let mounting = data.recording.velocities.first().map(|v| v.initial);
        data.attitude = data.attitude_with(mounting.as_ref());
        Ok(data)
    }

    /// Returns the attitude with the transport rate of a mounting.
    pub(crate) fn attitude_with(&self, mounting: Option<&Mounting>) -> Attitude {
        let Attitude { start, gyro_bias, .. } = self.attitude;
        let mut attitude = Attitude::integrate(&self.recording, start, gyro_bias, mounting);
        if self.source == AttitudeSource::Reference {
            attitude.anchor(&self.recording);
        }
        attitude
    }

    /// Returns the sensor that is calibrated: the first body velocity.
    ///
    /// # Errors
    /// Returns an error if there is none, or if it has no samples.
    pub fn velocity(&self) -> Result<&BodyVelocity, CalibrationError> {
        let Some(velocity) = self.recording.velocities.first() else {
            return Err(CalibrationError::Sensor(
                "there is no sensor of the body velocity along three axes: add [sensor.dvl] with \
                 its own `scale` and `misalignment`"
                    .into(),
            ));
        };
        if velocity.samples.is_empty() {
            return Err(CalibrationError::Sensor(format!(
                "[sensor.{}] has no samples: check its source",
                velocity.samples.name
            )));
        }
        Ok(velocity)
    }

    /// Returns the same sensor for a method that compares it with the velocity over the ground.
    ///
    /// # Errors
    /// Returns an error also if the sensor measures the velocity through the water.
    pub(crate) fn over_ground(&self) -> Result<&BodyVelocity, CalibrationError> {
        let velocity = self.velocity()?;
        if velocity.water {
            return Err(CalibrationError::Sensor(format!(
                "[sensor.{}] tracks the water, and a current would bias the misalignment: this \
                 method needs bottom track",
                velocity.samples.name
            )));
        }
        Ok(velocity)
    }

    /// Iterates over the segments of a kind.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Segment> {
        self.segments.iter().filter(move |s| s.kind == kind)
    }

    /// Returns the time in segments of a kind, s.
    pub fn duration(&self, kind: Kind) -> f64 {
        self.of(kind).fold(0.0, |sum, s| sum + s.duration())
    }

    /// Returns the time at rest, s.
    pub fn rest(&self) -> f64 {
        self.duration(Kind::Static)
    }

    /// Formats a span on the run's clock.
    pub(crate) fn span(&self, from: f64, to: f64) -> String {
        format!("{:.0} s to {:.0} s", self.recording.clock(from), self.recording.clock(to))
    }

    /// Returns the segments of Type I with samples of the velocity, the directions of their
    /// specific-force rate, and notes for the user.
    ///
    /// # Errors
    /// Returns an error if no segment is long enough and without a gap, or if the specific force
    /// does not vary.
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
                            "{name} has no samples from {gap}, inside the segment of Type I from \
                             {whole}: the IMU bridges the gap"
                        ));
                        segments.push(*segment);
                    } else {
                        notes.push(format!(
                            "{name} has no samples from {gap}: the segment of Type I from {whole} \
                             is not used"
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
            return Err(CalibrationError::Motion(format!(
                "on the segments of Type I the specific force varies by less than the noise \
                 ({:.1e} m/s^3): accelerate more, \
                 or longer",
                directions.noise
            )));
        }
        if directions.rank == 1 {
            let axis = directions.axes.column(0);
            notes.push(format!(
                "the specific force varies in one direction only, [{:.2}, {:.2}, {:.2}] forward, \
                 right, down (second singular value {:.1e}, noise {:.1e} m/s^3): the misalignment \
                 about this axis is not, or hardly, determined; dive, or thrust sideways, at \
                 constant attitude (Theorem 1, Remark 2)",
                axis[0], axis[1], axis[2], directions.singular_values[1], directions.noise
            ));
        }
        if self.rest() == 0.0 {
            notes.push(format!(
                "there is no time at rest (below {:.0} mm/s for {:.0} s): the gyro bias is taken \
                 as zero with its prior uncertainty; the sigma is optimistic",
                1e3 * self.settings.rest_speed,
                self.settings.shortest[0]
            ));
        }
        Ok((segments, directions, notes))
    }

    fn no_type_one(&self, notes: Vec<String>) -> CalibrationError {
        if !notes.is_empty() {
            return CalibrationError::Motion(format!(
                "no segment of Type I is left: \
                                                     {}",
                notes.join("; ")
            ));
        }
        let turning = self.duration(Kind::TypeII);
        let straight = self.duration(Kind::Steady);
        CalibrationError::Motion(format!(
            "there is no segment of Type I, with constant attitude (below {:.2} deg/s, within \
             {:.1} deg) and varying specific force (above {:.1e} m/s^3) for {:.0} s or more: \
             {turning:.0} s are turning, {straight:.0} s steady or too short, {:.0} s at rest; \
             accelerate, dive or thrust sideways on a straight course",
            self.settings.turn_rate.to_degrees(),
            self.settings.turn_angle.to_degrees(),
            self.settings.force_rate,
            self.settings.shortest[1],
            self.rest(),
        ))
    }

    /// Returns the 1-sigma of the remaining gyro bias, rad/s: the noise of the mean at rest, or the
    /// prior.
    pub(crate) fn gyro_bias_sigma(&self) -> Vector3<f64> {
        let imu = &self.recording.imu;
        match self.rest() {
            0.0 => imu.gyro_bias,
            rest => imu.gyro_noise / rest.sqrt(),
        }
    }

    /// Returns the contribution of the attitude error to the covariance of `k` and `δ`, for a
    /// method that takes the attitude as known. An attitude error acts on the estimate like a
    /// misalignment: the initial uncertainty, the gyro noise and the remaining bias, at the middle
    /// of the used samples and as if the course were constant. It is zero for the attitude of the
    /// reference, whose error the scenario does not state.
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

    /// Describes the source of the attitude.
    pub fn attitude_source(&self) -> String {
        let AttitudeStart { time, .. } = self.attitude.start;
        match self.source {
            AttitudeSource::Reference => "attitude from the reference".into(),
            AttitudeSource::Gyros => {
                let clock = self.recording.clock(time);
                let bias = if self.rest() > 0.0 {
                    format!("their bias is the mean of {:.0} s at rest", self.rest())
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

/// Treatment of a gap of the velocity inside a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Gaps {
    /// The segment is left out.
    Refused,
    /// The segment is used: the method integrates the IMU across the gap.
    Bridged,
}
