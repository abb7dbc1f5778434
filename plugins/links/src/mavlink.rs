//! The estimate in messages of MAVLink, as ArduPilot and PX4 take the estimate of another computer.

use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::units::time::Time;
use navfuse_frames::Datum;
use navfuse_frames::mavlink::{Kind, Sender};
use navfuse_mcap::{Motion, Moved};
use schemars::JsonSchema;
use serde::Deserialize;

const HEARTBEAT: Kind = Kind { id: 0, seed: 50 };
const GLOBAL_VISION_POSITION_ESTIMATE: Kind = Kind { id: 101, seed: 102 };
const ODOMETRY: Kind = Kind { id: 331, seed: 91 };
const VISION_POSITION_DELTA: Kind = Kind { id: 11011, seed: 106 };

/// Time between two heartbeats, s.
const BETWEEN_HEARTBEATS: f64 = 1.0;
/// A computer on board that is no autopilot and is active, in version 3 of the messages.
const ON_BOARD: [u8; 5] = [18, 8, 0, 4, 3];
/// `MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY`.
const COMPONENT: u8 = 197;
/// `MAV_FRAME_BODY_FRD`.
const BODY_FRD: u8 = 12;
/// `MAV_ESTIMATOR_TYPE_VIO`: PX4 refuses the estimate of a computer that is not one of vision.
const ESTIMATOR: u8 = 3;
/// Sigma of a velocity, m/s, at a confidence of 100 % and of 0 %: `VIS_VERR_MIN` and `VIS_VERR_MAX` of
/// ArduPilot as delivered.
const SIGMA_OF_CONFIDENCE: [f64; 2] = [0.1, 0.9];

/// Messages of MAVLink 2, and a heartbeat each second.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MavlinkFormat {
    /// `odometry`, `vision-position-delta` or `global-vision-position-estimate`. Default: `odometry`.
    pub message: MavlinkMessage,
    /// `ardupilot` or `px4`, each of which takes an odometry in a frame of its own. Default:
    /// `ardupilot`.
    pub autopilot: Autopilot,
    /// Position at which the coordinates are zero, which is the origin of the autopilot's estimate.
    /// Default: the first estimate.
    pub datum: Option<Datum>,
    /// System, the identifier of the vehicle. Default: 1.
    pub system: Option<u8>,
    /// Component. Default: 197, an odometry.
    pub component: Option<u8>,
}

/// The message with the estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MavlinkMessage {
    /// `ODOMETRY`: pose and velocity with their covariance.
    #[default]
    Odometry,
    /// `VISION_POSITION_DELTA`: the motion since the message before.
    VisionPositionDelta,
    /// `GLOBAL_VISION_POSITION_ESTIMATE`: the pose with its covariance.
    GlobalVisionPositionEstimate,
}

/// The program that receives the messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Autopilot {
    /// ArduPilot, such as ArduSub.
    #[default]
    Ardupilot,
    /// PX4.
    Px4,
}

impl Autopilot {
    /// The frame of an odometry whose axes are north, east, down: ArduPilot takes `MAV_FRAME_LOCAL_FRD`
    /// alone, and PX4 uses the heading only in `MAV_FRAME_LOCAL_NED`.
    fn frame(self) -> u8 {
        match self {
            Self::Ardupilot => 20,
            Self::Px4 => 1,
        }
    }
}

/// The numbers of a payload, in the order of the wire.
#[derive(Debug, Default)]
struct Payload(Vec<u8>);

impl Payload {
    fn micros(&mut self, nanos: i64) -> &mut Self {
        self.0.extend(nanos.div_euclid(1000).to_le_bytes());
        self
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f64>) -> &mut Self {
        self.0.extend(values.into_iter().flat_map(|value| (value as f32).to_le_bytes()));
        self
    }

    /// The upper triangle of a symmetric matrix of six rows.
    fn triangle(&mut self, element: impl Fn(usize, usize) -> f64) -> &mut Self {
        self.floats((0..6).flat_map(|i| (i..6).map(move |j| (i, j))).map(|(i, j)| element(i, j)))
    }
}

/// Attitude and velocity at a time, from which the motion to the next message counts.
type Before = (Time, UnitQuaternion<f64>, Vector3<f64>);

/// The messages of a run.
#[derive(Debug)]
pub struct Mavlink {
    format: MavlinkFormat,
    motion: Motion,
    sender: Sender,
    payload: Payload,
    out: Vec<u8>,
    alive: Option<Time>,
    before: Option<Before>,
}

impl Mavlink {
    /// The messages of a run in a format.
    ///
    /// # Errors
    /// When the run has no position, attitude or velocity.
    pub fn new(format: MavlinkFormat, run: &RunInfo) -> Result<Self, StreamError> {
        let motion = Motion::of(&run.layout).filter(|_| run.layout.vehicle().velocity.is_some());
        let motion = motion.ok_or_else(|| {
            StreamError::scenario("a message of MAVLink has position, attitude and velocity")
                .at_key("mavlink")
                .with_remedy("remove it, or estimate all three, as [process.ins] does")
        })?;
        let address = [format.system.unwrap_or(1), format.component.unwrap_or(COMPONENT)];
        Ok(Self {
            motion: motion.with_origin(format.datum.map(|datum| datum.position())),
            format,
            sender: Sender { address, sequence: 0 },
            payload: Payload::default(),
            out: Vec::new(),
            alive: None,
            before: None,
        })
    }

    /// The messages of an estimate, which a continuous output has moved by offsets of position, m, and
    /// attitude, rad; `unix` is its time in nanoseconds since 1970.
    pub fn messages(&mut self, epoch: &Epoch<'_>, offsets: [[f64; 3]; 2], unix: i64) -> &[u8] {
        self.out.clear();
        let time = epoch.state.time;
        let mut moved = self.motion.at(epoch);
        moved.pose = moved.pose.widened(offsets);
        self.heartbeat(time);
        self.payload.0.clear();
        match self.format.message {
            MavlinkMessage::Odometry => self.odometry(unix, &moved),
            MavlinkMessage::VisionPositionDelta => self.delta(time, unix, &moved),
            MavlinkMessage::GlobalVisionPositionEstimate => self.pose(unix, &moved),
        }
        &self.out
    }

    fn heartbeat(&mut self, time: Time) {
        if self.alive.is_some_and(|last| time.since(last).abs() < BETWEEN_HEARTBEATS) {
            return;
        }
        self.alive = Some(time);
        self.payload.0.clear();
        self.payload.0.extend([0; 4]); // no mode of its own
        self.payload.0.extend(ON_BOARD);
        self.sender.write(&mut self.out, HEARTBEAT, &self.payload.0);
    }

    fn odometry(&mut self, unix: i64, Moved { pose, velocity, .. }: &Moved) {
        let q = pose.attitude;
        let twist = |i: usize, j: usize| if j < 3 { velocity.covariance[(i, j)] } else { f64::NAN };
        self.payload
            .micros(unix)
            .floats(pose.position.iter().copied())
            .floats([q.w, q.i, q.j, q.k])
            .floats(velocity.body.iter().copied())
            .floats([f64::NAN; 3]) // no angular rate
            .triangle(|i, j| pose.covariance[(i, j)])
            .triangle(twist);
        // no resets are counted, and the quality is in the covariance
        self.payload.0.extend([self.format.autopilot.frame(), BODY_FRD, 0, ESTIMATOR, 0]);
        self.sender.write(&mut self.out, ODOMETRY, &self.payload.0);
    }

    fn pose(&mut self, unix: i64, Moved { pose, .. }: &Moved) {
        let (roll, pitch, yaw) = pose.attitude.euler_angles();
        self.payload
            .micros(unix)
            .floats(pose.position.iter().copied())
            .floats([roll, pitch, yaw])
            .triangle(|i, j| pose.covariance[(i, j)]);
        self.payload.0.push(0);
        self.sender.write(&mut self.out, GLOBAL_VISION_POSITION_ESTIMATE, &self.payload.0);
    }

    /// The motion since the message before: by the velocity, so that a correction of the position is no
    /// motion.
    fn delta(&mut self, time: Time, unix: i64, Moved { pose, velocity, .. }: &Moved) {
        let attitude = pose.attitude;
        let ned = attitude * velocity.body;
        let Some((last, past, before)) = self.before.replace((time, attitude, ned)) else { return };
        let dt = time.since(last);
        let turn = past.inverse() * attitude;
        let moved = attitude.inverse() * ((before + ned) * (0.5 * dt));
        let sigma = velocity.covariance.diagonal().max().sqrt();
        let [least, most] = SIGMA_OF_CONFIDENCE;
        let confidence = 100.0 * ((most - sigma) / (most - least)).clamp(0.0, 1.0);
        self.payload
            .micros(unix)
            .micros((dt * 1e9).round() as i64)
            .floats(turn.scaled_axis().iter().copied())
            .floats(moved.iter().copied())
            .floats([confidence]);
        self.sender.write(&mut self.out, VISION_POSITION_DELTA, &self.payload.0);
    }
}
