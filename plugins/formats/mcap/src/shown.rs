//! Topics for those who look at a log in Foxglove or RViz: the paths of the estimate and of the truth,
//! the pose of the truth, the ellipsoid of 3 sigma, the lever arms, and the verdict. Nothing reads
//! them again.

use crate::chunk::{Definitions, Topic};
use crate::log::StreamFailure;
use crate::message::{BODY_FRAME, Encoder, FIXED_FRAME, Stamp};
use crate::motion::Motion;
use crate::pose::Pose;
use crate::schema;
use crate::writer::LogWriter;
use nalgebra::{Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::model::stream::RunInfo;
use navfuse_core::units::thin::{Merge, Thin};
use navfuse_core::units::time::{Span, Time};

/// The body of the reference: forward, right, down.
pub const REFERENCE_FRAME: &str = "reference_frd";
/// Greatest number of poses of a path.
const POSES: usize = 256;
/// Time between two messages of a path at least, and the growth of the run between them: all topics of
/// this file add two or three per cent to a log.
const PATH: Span = Span::from_nanos(10_000_000_000);
const GROWTH: f64 = 0.25;
/// Time between two poses of the reference, and between two messages of the markers, at least.
const INTERVAL: Span = Span::from_nanos(1_000_000_000);
/// Colours of the ellipsoid and of the lever arms: red, green, blue and opacity.
const ELLIPSOID: [f32; 4] = [0.34, 0.71, 0.91, 0.35];
const ARMS: [f32; 4] = [0.55, 0.58, 0.63, 1.0];
/// Width of a lever arm, m.
const WIDTH: f64 = 0.02;

/// The topics.
#[derive(Debug)]
pub struct Shown {
    motion: Option<Moving>,
    verdict: Topic,
}

/// The topics of a run whose state has a position and an attitude.
#[derive(Debug)]
struct Moving {
    motion: Motion,
    estimate: Path,
    truth: Path,
    reference: Paced,
    markers: Paced,
    sensors: Vec<Mounting>,
}

/// A topic with a least time between its messages.
#[derive(Debug)]
struct Paced {
    topic: Topic,
    last: Option<Time>,
}

impl Paced {
    fn new(topic: Topic) -> Self {
        Self { topic, last: None }
    }

    /// Returns `true` at the first time, and each time after the interval.
    fn is_due(&mut self, now: Time) -> bool {
        let due = self.last.is_none_or(|last| now - last >= INTERVAL);
        if due {
            self.last = Some(now);
        }
        due
    }
}

/// A path, which grows.
#[derive(Debug)]
struct Path {
    topic: Topic,
    poses: Thin<Placed>,
    /// Time of the first pose and of the last message.
    begin: Option<[Time; 2]>,
}

/// A pose of a path.
#[derive(Clone, Copy, Debug)]
struct Placed {
    stamp: Stamp,
    position: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
}

impl Merge for Placed {
    /// Keeps the first pose.
    fn merge(&mut self, _: Self) {}
}

impl Path {
    fn new(topic: Topic) -> Self {
        Self { topic, poses: Thin::with_rows(POSES), begin: None }
    }

    /// Adds a pose, and writes the path where it has grown.
    fn push(&mut self, log: &mut LogWriter, time: Time, pose: &Pose) -> Result<(), StreamFailure> {
        let stamp = Stamp::new(time)?;
        self.poses.push(Placed { stamp, position: pose.position, attitude: pose.attitude });
        let [first, last] = *self.begin.get_or_insert([time; 2]);
        let since = time - last;
        if since < PATH || since.seconds() < GROWTH * (time - first).seconds() {
            return Ok(());
        }
        self.begin = Some([first, time]);
        log.send(&mut self.topic, time, |m| m.path(stamp, self.poses.rows()))
    }
}

impl Shown {
    /// Opens the topics.
    pub fn open(log: &mut Definitions, run: &RunInfo) -> Self {
        let motion = Motion::of(&run.layout).map(|motion| Moving {
            motion: motion.from_height_zero(),
            estimate: Path::new(log.topic("/estimate/path", &schema::PATH)),
            truth: Path::new(log.topic("/reference/path", &schema::PATH)),
            reference: Paced::new(log.topic("/reference/odometry", &schema::ODOMETRY)),
            markers: Paced::new(log.topic("/estimate/markers", &schema::MARKERS)),
            sensors: run.sensors.iter().map(|s| s.mounting.clone()).collect(),
        });
        Self { motion, verdict: log.topic("/verdict", &schema::VERDICT) }
    }

    pub fn epoch(&mut self, log: &mut LogWriter, epoch: &Epoch<'_>) -> Result<(), StreamFailure> {
        self.motion.as_mut().map_or(Ok(()), |motion| motion.epoch(log, epoch))
    }

    pub fn verdict(
        &mut self,
        log: &mut LogWriter,
        (time, stamp): (Time, Stamp),
        verdict: &Verdict,
    ) -> Result<(), StreamFailure> {
        log.send(&mut self.verdict, time, |m| m.verdict(stamp, verdict))
    }
}

impl Moving {
    fn epoch(&mut self, log: &mut LogWriter, epoch: &Epoch<'_>) -> Result<(), StreamFailure> {
        let time = epoch.state.time;
        let pose = self.motion.at(epoch).pose;
        self.estimate.push(log, time, &pose)?;
        if let Some((pose, velocity)) = self.motion.truth(epoch) {
            self.truth.push(log, time, &pose)?;
            if self.reference.is_due(time) {
                let stamp = Stamp::new(time)?;
                let frames = [FIXED_FRAME, REFERENCE_FRAME];
                let topic = &mut self.reference.topic;
                log.send(topic, time, |m| m.odometry(stamp, frames, &pose, &velocity))?;
            }
        }
        if self.markers.is_due(time) {
            let stamp = Stamp::new(time)?;
            let places = self.sensors.iter().filter(|mounting| mounting.is_placed());
            let arms = places.flat_map(|mounting| {
                let (place, _) = mounting.pose(epoch.layout, epoch.state);
                [Vector3::zeros(), place]
            });
            let arms: Vec<_> = arms.collect();
            let topic = &mut self.markers.topic;
            log.send(topic, time, |m| m.markers(stamp, &pose, &arms))?;
        }
        Ok(())
    }
}

/// Diameters and orientation of the ellipsoid of 3 sigma, m.
fn ellipsoid(covariance: Matrix3<f64>) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let eigen = SymmetricEigen::new(covariance);
    let mut axes = eigen.eigenvectors;
    // the eigenvectors may form a left-handed set
    if axes.determinant() < 0.0 {
        axes.column_mut(0).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    (eigen.eigenvalues.map(|variance| 6.0 * variance.max(0.0).sqrt()), turn)
}

/// A marker: its name and number, the frame, the kind, and its look.
struct Marker<'a> {
    frame: &'a str,
    name: &'a str,
    id: i32,
    kind: i32,
    pose: (Vector3<f64>, UnitQuaternion<f64>),
    scale: Vector3<f64>,
    colour: [f32; 4],
    points: &'a [Vector3<f64>],
}

impl Encoder<'_> {
    /// `nav_msgs/Path`.
    fn path(mut self, stamp: Stamp, poses: &[Placed]) {
        self.header(stamp, FIXED_FRAME);
        self.length(poses.len());
        for pose in poses {
            self.header(pose.stamp, FIXED_FRAME);
            self.numbers(pose.position.as_slice());
            self.quaternion(&pose.attitude);
        }
    }

    /// `navfuse_msgs/Verdict`.
    fn verdict(mut self, stamp: Stamp, verdict: &Verdict) {
        self.header(stamp, "");
        self.text(verdict.words());
        self.text(&verdict.text);
    }

    /// `visualization_msgs/MarkerArray`: the ellipsoid of 3 sigma about the position, and the lever
    /// arms, each between two points in body axes, m.
    fn markers(mut self, stamp: Stamp, pose: &Pose, arms: &[Vector3<f64>]) {
        const SPHERE: i32 = 2;
        const LINES: i32 = 5;
        let (scale, turn) = ellipsoid(pose.position_covariance());
        self.length(if arms.is_empty() { 1 } else { 2 });
        self.marker(
            stamp,
            &Marker {
                frame: FIXED_FRAME,
                name: "3 sigma",
                id: 0,
                kind: SPHERE,
                pose: (pose.position, turn),
                scale,
                colour: ELLIPSOID,
                points: &[],
            },
        );
        if !arms.is_empty() {
            self.marker(
                stamp,
                &Marker {
                    frame: BODY_FRAME,
                    name: "lever arms",
                    id: 1,
                    kind: LINES,
                    pose: (Vector3::zeros(), UnitQuaternion::identity()),
                    scale: Vector3::new(WIDTH, 0.0, 0.0),
                    colour: ARMS,
                    points: arms,
                },
            );
        }
    }

    /// One marker, which stays until the next one of its name and number.
    fn marker(&mut self, stamp: Stamp, marker: &Marker<'_>) {
        self.header(stamp, marker.frame);
        self.text(marker.name);
        // its number, its kind, and that it is added
        self.integers(&[marker.id, marker.kind, 0]);
        self.numbers(marker.pose.0.as_slice());
        self.quaternion(&marker.pose.1);
        self.numbers(marker.scale.as_slice());
        self.reals(&marker.colour);
        // no lifetime, and a frame that moves with the vehicle
        self.integers(&[0, 0]);
        self.flag(true);
        self.length(marker.points.len());
        marker.points.iter().for_each(|point| self.numbers(point.as_slice()));
        self.length(0); // one colour for all points
        self.text("");
        // an empty texture, without coordinates, text and mesh
        self.header(stamp, "");
        self.text("");
        self.length(0);
        self.length(0);
        self.text("");
        self.text("");
        self.text("");
        self.length(0);
        self.flag(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sigmas of 1, 2 and 3 m along axes that are turned by 30 deg about down: the ellipsoid's axes,
    /// scaled by a sixth of its diameters, give the covariance again.
    #[test]
    fn the_ellipsoid_has_the_axes_and_three_sigmas_of_the_covariance() {
        let turn = Rotation3::from_euler_angles(0.0, 0.0, 0.5);
        let variances = Matrix3::from_diagonal(&Vector3::new(1.0, 4.0, 9.0));
        let covariance = turn * variances * turn.inverse();
        let (scale, axes) = ellipsoid(covariance);
        let squares = Matrix3::from_diagonal(&scale.map(|d| (d / 6.0).powi(2)));
        let again = axes.to_rotation_matrix() * squares * axes.inverse().to_rotation_matrix();
        assert!((again - covariance).amax() < 1e-12, "{again}");
    }
}
