//! The axes of a velocity log: upwards or downwards by a depth, and turned by the accelerations of the IMU.

use crate::axes::{self, EITHER, EVIDENT, Turn};
use crate::recording::Recording;
use crate::samples::find;
use crate::stream::StreamSurvey;

/// Yaw of a velocity log, rad, from which it is no error of the mounting: 3 deg.
const MOUNTED: f64 = 0.052;
/// Share of the forward velocity that the mean velocity to the side has, for a vehicle that moves ahead: 20 deg.
const ASIDE: f64 = 0.36;
/// Mean velocity, m/s, from which a vehicle moves.
const MOVES: f64 = 0.2;

/// Tests whether a vehicle moves along the first axis of its log.
fn ahead(log: &StreamSurvey) -> bool {
    let mean = |name: &str| log.channel(name).map(|k| log.mean[k]);
    let moved = mean("vel_x").zip(mean("vel_y"));
    moved.is_some_and(|(x, y)| x > MOVES && y.abs() < ASIDE * x)
}

impl Recording {
    /// Turns the axes of a velocity log that point up, by the depth, or to the left, by the accelerations.
    pub fn turn_log(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(log) = find(streams, "dvl") else { return false };
        let up = log.sinks.is_some_and(|sinks| sinks < 0.0);
        let (axes, text) = match up {
            // forward, left, up is the usual set with a third axis that points up
            true if log.against_right < -EITHER => (
                ["x", "y", "-z"],
                "its third velocity is positive upwards, by the depth, and its second one to the right, by the \
                 accelerations: z is turned",
            ),
            true => (
                ["x", "-y", "-z"],
                "its third velocity is positive upwards, by the depth: forward, left, up is assumed, and y and \
                 z are turned",
            ),
            // beside a third axis that points down, one to the left is the error of a program, and no usual set
            false if log.against_right > if log.sinks.is_some() { EVIDENT } else { EITHER } => (
                ["x", "-y", "z"],
                "its second velocity is positive to the left, by the accelerations: y is turned",
            ),
            false => return false,
        };
        let part = self.part_mut("dvl").filter(|p| p.found.beams.is_none());
        let Some(part) = part.filter(|p| p.samples.axes.is_none()) else { return false };
        part.samples.axes = Some(axes.map(str::to_owned));
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("dvl: {text}"));
        true
    }

    /// Notes the mounting of a velocity log whose yaw is no error of a mounting.
    pub fn mount(&mut self, streams: &[StreamSurvey]) -> bool {
        let turn = find(streams, "dvl").and_then(|s| s.turn);
        let large = |t: &Turn| t.angle.abs() > MOUNTED.max(5.0 * t.sigma);
        let Some(turn) = turn.filter(large) else { return false };
        if std::mem::replace(&mut self.mounted, true) {
            return false;
        }
        let quarters = axes::quarters(turn).filter(|quarters| *quarters != 0);
        let quarters = quarters.filter(|quarters| {
            let rest = turn.angle - f64::from(*quarters) * std::f64::consts::FRAC_PI_2;
            // an instrument stands along the axes of its vehicle more often than beside them
            rest.abs() < MOUNTED.max(5.0 * turn.sigma)
        });
        if let Some(quarters) = quarters.filter(|_| find(streams, "dvl").is_some_and(ahead)) {
            return self.turn_by_log(quarters);
        }
        let Some(part) = self.part_mut("dvl") else { return false };
        match quarters.and_then(|quarters| axes::named([0.0, 0.0, -1.0], quarters)) {
            Some(relative) => {
                part.samples.turn(relative);
            }
            None => part.samples.mounting = Some(turn),
        }
        let text = format!(
            "its axes are rotated by {:.1} deg about down relative to the IMU, sigma {:.1} deg, according \
             to the accelerations that both measure",
            turn.angle.to_degrees(),
            turn.sigma.to_degrees()
        );
        part.found.questions.push(text.clone());
        self.notes.push(format!("dvl: {text}"));
        true
    }

    /// Turns the IMU in place of a log along whose first axis the vehicle moves: this axis is forward.
    fn turn_by_log(&mut self, quarters: i32) -> bool {
        let Some(relative) = axes::named([0.0, 0.0, -1.0], -quarters) else { return false };
        let Some(part) = self.part_mut("imu") else { return false };
        part.samples.turn(relative);
        let text = format!(
            "the velocity log, along whose first axis the vehicle moves, fits its accelerations after a turn by {} deg \
             about down",
            -90 * quarters
        );
        part.found.questions.push(text.clone());
        self.notes.push(format!("imu: {text}"));
        true
    }

    /// Takes the beams of a log as the motion shows them, and turns the sign of velocities that a depth
    /// contradicts; `true` if the sign changed.
    pub fn turn_beams(&mut self, streams: &[StreamSurvey]) -> bool {
        let Some(shown) = find(streams, "dvl") else { return false };
        let Some(part) = self.part_mut("dvl") else { return false };
        let Some(beams) = part.found.beams.as_ref() else { return false };
        part.samples.aimed.clone_from(&shown.aimed);
        let away = shown.sinks.is_some_and(|sinks| sinks < 0.0);
        if !away || part.samples.beams > 0 {
            return false;
        }
        part.samples.beams = beams.count;
        let text = "the velocities along its beams are positive for a vehicle that rises, by the depth: their \
                    signs are turned";
        part.found.questions.push(text.to_owned());
        self.notes.push(format!("dvl: {text}"));
        true
    }
}
