//! Motion segments of the table, their checks, and their conversion to smooth phases.

use crate::error::TrajectoryError;
use crate::phase::{Phase, Pose};
use navfuse_core::units::{Angle, Duration, Speed};
use schemars::JsonSchema;
use serde::Deserialize;

/// Range of the duration of a phase, s: the shortest has eight integration steps of the position.
const DURATION: std::ops::RangeInclusive<f64> = 1.0..=1e7;
/// The greatest speed, m/s.
pub(crate) const MAX_SPEED: f64 = 1e3;
/// The greatest tilt, rad.
const MAX_TILT: f64 = 89.0 * std::f64::consts::PI / 180.0;
/// The greatest change of heading of one turn, rad.
const MAX_TURN: f64 = 3600.0 * std::f64::consts::PI / 180.0;

/// One row of the table: a motion. Quantities that it does not change keep the value at the end of
/// the row before.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum SegmentConfig {
    /// At rest. The segments before must have brought the speed to zero.
    Static {
        /// Duration.
        duration: Duration,
    },
    /// Straight and level at constant speed and attitude.
    Cruise {
        /// Duration.
        duration: Duration,
    },
    /// Straight and level at constant attitude: the forward speed changes smoothly.
    Surge {
        /// Duration.
        duration: Duration,
        /// Forward speed at the end.
        speed: Speed,
    },
    /// Straight and level at constant attitude: the forward speed changes and returns.
    Pulse {
        /// Duration.
        duration: Duration,
        /// The change of forward speed in the middle.
        speed_change: Speed,
    },
    /// Down at constant attitude, by ballast: the vertical speed rises and falls back to zero, at
    /// constant forward speed. The descent is 16/35 of the peak rate times the duration.
    Descend {
        /// Duration.
        duration: Duration,
        /// The vertical speed in the middle, above zero.
        rate: Speed,
    },
    /// Up at constant attitude, by ballast: as `descend`, upwards.
    Ascend {
        /// Duration.
        duration: Duration,
        /// The vertical speed in the middle, above zero.
        rate: Speed,
    },
    /// Sideways at constant attitude, by thrusters: the speed to starboard rises and falls back to
    /// zero, at constant forward speed. The distance to starboard is 16/35 of the peak speed times
    /// the duration.
    Sway {
        /// Duration.
        duration: Duration,
        /// The speed to starboard in the middle: negative is to port.
        speed: Speed,
    },
    /// Up a slope and level again, as on a road: the pitch rises and falls back, and the velocity
    /// follows it, at constant horizontal speed.
    Slope {
        /// Duration.
        duration: Duration,
        /// The slope in the middle: positive is up.
        angle: Angle,
    },
    /// A turn at constant speed; the velocity turns with the heading.
    Turn {
        /// Duration.
        duration: Duration,
        /// The change of heading, positive to starboard.
        angle: Angle,
        /// Additional roll in the middle: positive leans into the turn. Default: zero.
        bank: Option<Angle>,
        /// Additional pitch in the middle: positive is nose up. Default: zero.
        pitch: Option<Angle>,
    },
    /// Four equal legs at constant speed, each a straight part and then a turn by 90 deg.
    Square {
        /// Duration of the four legs.
        duration: Duration,
        /// Duration of each turn.
        turn: Duration,
        /// As in a turn.
        bank: Option<Angle>,
        /// As in a turn.
        pitch: Option<Angle>,
        /// Side to which it turns. Default: starboard.
        #[serde(default)]
        direction: Direction,
    },
}

/// The side to which a square turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// Clockwise seen from above.
    #[default]
    Starboard,
    /// Anticlockwise seen from above.
    Port,
}

/// Checks the numbers of one segment; errors name the segment.
struct Check {
    number: usize,
    kind: &'static str,
}

impl Check {
    fn error(&self, key: &'static str, value: impl ToString, remedy: String) -> TrajectoryError {
        TrajectoryError::Segment {
            number: self.number,
            kind: self.kind,
            key,
            value: value.to_string(),
            remedy,
        }
    }

    fn duration(&self, key: &'static str, value: Duration) -> Result<f64, TrajectoryError> {
        let s = value.si();
        if DURATION.contains(&s) {
            return Ok(s);
        }
        let remedy = format!("give a duration from {} s to {} s", DURATION.start(), DURATION.end());
        Err(self.error(key, value, remedy))
    }

    fn speed(&self, key: &'static str, value: Speed) -> Result<f64, TrajectoryError> {
        let v = value.si();
        if v.abs() <= MAX_SPEED {
            return Ok(v);
        }
        Err(self.error(key, value, format!("give a speed within {MAX_SPEED} m/s")))
    }

    fn rate(&self, value: Speed) -> Result<f64, TrajectoryError> {
        let v = self.speed("rate", value)?;
        if v > 0.0 {
            return Ok(v);
        }
        let remedy = "give a rate above zero: `descend` goes down, `ascend` goes up".into();
        Err(self.error("rate", value, remedy))
    }

    fn angle(&self, key: &'static str, value: Angle, limit: f64) -> Result<f64, TrajectoryError> {
        let a = value.si();
        if a.abs() <= limit {
            return Ok(a);
        }
        let remedy = format!("give an angle within {:.0} deg", limit.to_degrees());
        Err(self.error(key, value, remedy))
    }

    /// Bank and pitch of a turn, zero when left out.
    fn tilt(
        &self,
        bank: Option<Angle>,
        pitch: Option<Angle>,
    ) -> Result<(f64, f64), TrajectoryError> {
        let zero = Angle::from_si(0.0);
        let [bank, pitch] = [("bank", bank), ("pitch", pitch)]
            .map(|(k, a)| self.angle(k, a.unwrap_or(zero), MAX_TILT));
        Ok((bank?, pitch?))
    }
}

impl SegmentConfig {
    /// Its name in TOML.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Static { .. } => "static",
            Self::Cruise { .. } => "cruise",
            Self::Surge { .. } => "surge",
            Self::Pulse { .. } => "pulse",
            Self::Descend { .. } => "descend",
            Self::Ascend { .. } => "ascend",
            Self::Sway { .. } => "sway",
            Self::Slope { .. } => "slope",
            Self::Turn { .. } => "turn",
            Self::Square { .. } => "square",
        }
    }

    /// Duration.
    pub fn duration(&self) -> Duration {
        match self {
            Self::Static { duration }
            | Self::Cruise { duration }
            | Self::Surge { duration, .. }
            | Self::Pulse { duration, .. }
            | Self::Descend { duration, .. }
            | Self::Ascend { duration, .. }
            | Self::Sway { duration, .. }
            | Self::Slope { duration, .. }
            | Self::Turn { duration, .. }
            | Self::Square { duration, .. } => *duration,
        }
    }

    /// Appends the phases that begin at the time `start` (s) and at `pose`; `number` is the row of
    /// the segment, from 1. Returns the time and the pose at the end.
    pub(crate) fn append(
        &self,
        phases: &mut Vec<Phase>,
        number: usize,
        start: f64,
        pose: Pose,
    ) -> Result<(f64, Pose), TrajectoryError> {
        let check = Check { number, kind: self.kind() };
        let duration = check.duration("duration", self.duration())?;
        let mut phase = Phase::new(number, self.kind().into(), start, duration, &pose);
        match self {
            Self::Static { .. } => {
                if pose.speed != 0.0 {
                    let remedy =
                        "put a `surge` with speed = \"0 m/s\" before it, or use `cruise`".into();
                    return Err(check.error("speed", Speed::from_si(pose.speed), remedy));
                }
            }
            Self::Cruise { .. } => {}
            Self::Surge { speed, .. } => {
                phase.speed.step = check.speed("speed", *speed)? - pose.speed
            }
            Self::Pulse { speed_change, .. } => {
                phase.speed.bump = check.speed("speed_change", *speed_change)?
            }
            Self::Descend { rate, .. } => phase.down.bump = check.rate(*rate)?,
            Self::Ascend { rate, .. } => phase.down.bump = -check.rate(*rate)?,
            Self::Sway { speed, .. } => phase.side.bump = check.speed("speed", *speed)?,
            Self::Slope { angle, .. } => {
                phase = phase.sloping(check.angle("angle", *angle, MAX_TILT)?)
            }
            Self::Turn { angle, bank, pitch, .. } => {
                let angle = check.angle("angle", *angle, MAX_TURN)?;
                let (bank, pitch) = check.tilt(*bank, *pitch)?;
                phase = phase.turning(angle, bank, pitch);
            }
            Self::Square { turn, bank, pitch, direction, .. } => {
                let corner = check.duration("turn", *turn)?;
                let (bank, pitch) = check.tilt(*bank, *pitch)?;
                let straight = (duration - 4.0 * corner) / 4.0;
                if !DURATION.contains(&straight) {
                    let remedy = format!(
                        "four turns leave nothing of {duration} s: shorten them or lengthen the \
                         square"
                    );
                    return Err(check.error("turn", turn, remedy));
                }
                let angle = match direction {
                    Direction::Starboard => std::f64::consts::FRAC_PI_2,
                    Direction::Port => -std::f64::consts::FRAC_PI_2,
                };
                let (mut t, mut pose) = (start, pose);
                for leg in 1..=4 {
                    phases.push(Phase::new(
                        number,
                        format!("square leg {leg}"),
                        t,
                        straight,
                        &pose,
                    ));
                    t += straight;
                    let phase = Phase::new(number, format!("square turn {leg}"), t, corner, &pose);
                    let phase = phase.turning(angle, bank, pitch);
                    t += corner;
                    pose = phase.end_pose();
                    phases.push(phase);
                }
                return Ok((t, pose));
            }
        }
        let after = (phase.end, phase.end_pose());
        phases.push(phase);
        Ok(after)
    }
}
