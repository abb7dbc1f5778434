//! The sink: the newest estimate as topics.

use crate::diagnostics::Diagnostics;
use crate::lifecycle::{Lifecycle, State as NodeState};
use crate::link::{POSE, domain_of, join};
use crate::names::{of_topic, of_type};
use crate::port::{Node, Publication};
use navfuse_core::model::record::{Epoch, Record, UpdateRecord, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::state::{State, Vehicle};
use navfuse_core::units::time::{Span, Time};
use navfuse_core::units::{Date, Duration, Positive};
use navfuse_frames::Datum;
use navfuse_links::Blend;
use navfuse_mcap::{Encoder, Link, Motion, Moved, Pose, Stamp};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Time between two diagnoses, s.
const BETWEEN_DIAGNOSES: f64 = 1.0;
/// The frame of REP 105 in which the estimate may jump.
const MAP: &str = "map";
/// The frame of REP 105 in which it does not.
const ODOM: &str = "odom";
/// The body: forward, left, up.
const BODY: &str = "base_link";
/// Time in which a correction decays, s, where the scenario names none.
const BLEND: f64 = 2.0;

/// Publishes the newest estimate as topics of ROS 2, with the axes of REP 103 and the frames of REP 105:
/// `nav_msgs/Odometry` with the covariances, transforms, and the state of the sensors each second.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Ros2Sink {
    /// Topic of the estimate in the frame `map`, which jumps with a correction. Default:
    /// `/odometry/global`.
    pub global: Option<String>,
    /// Topic of the continuous estimate in the frame `odom`. Default: `/odometry/local`.
    pub local: Option<String>,
    /// Time in which a correction of the continuous estimate decays to 1/e. Default: 2 s.
    pub blend: Option<Positive<Duration>>,
    /// Topic of the estimate in `map` as `geometry_msgs/PoseWithCovarianceStamped`. Default: none.
    pub pose: Option<String>,
    /// Topic on which each use of a measurement is published as `diagnostic_msgs/DiagnosticArray`, for
    /// plots: outcome and reason, NIS, and the innovation and 1-sigma of each channel. Default: none.
    pub innovations: Option<String>,
    /// Publishes the transforms from `map` to `odom` and from `odom` to `base_link` at `/tf`. Default:
    /// false.
    pub tf: bool,
    /// Position of the origin of `map`. Default: the first estimate.
    pub datum: Option<Datum>,
    /// Date and time at which the run's clock is zero. Default: 1970-01-01T00:00:00, so that the
    /// times of the run are Unix times.
    pub origin: Option<Date>,
    /// Domain of DDS. Default: that in the variable `ROS_DOMAIN_ID`, or 0.
    pub domain: Option<u16>,
    /// Addresses of this computer over which it talks, such as `["127.0.0.1"]`. Default: all, as a
    /// program of ROS 2 does.
    pub interfaces: Vec<String>,
}

impl SinkType for Ros2Sink {
    const TYPE: &'static str = "ros2";
    const DEFAULT: bool = false;

    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let domain = domain_of(self.domain);
        let node = join(domain, &self.interfaces)?;
        let lifecycle = Lifecycle::of(domain, NodeState::Active);
        Ok(Box::new(Estimates { node, lifecycle, config: self, run: None }))
    }
}

/// The topics of a run.
struct Estimates {
    node: Node,
    /// The state of the node, by which it publishes.
    lifecycle: Arc<Lifecycle>,
    config: Ros2Sink,
    /// Once the run starts.
    run: Option<Run>,
}

/// What is published in a run.
struct Run {
    motion: Motion,
    origin: Span,
    vehicle: Vehicle,
    /// The continuous estimate, and its state.
    blend: Blend,
    shown: State,
    global: Publication,
    local: Publication,
    tf: Option<Publication>,
    pose: Option<Publication>,
    diagnoses: Publication,
    innovations: Option<Publication>,
    diagnostics: Diagnostics,
    diagnosed: Option<Time>,
    message: Vec<u8>,
}

impl Sink for Estimates {
    fn wants(&self) -> Wants {
        Wants::NEWEST | Wants::UPDATES | Wants::EPOCHS
    }

    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        let motion = Motion::of(&run.layout).ok_or_else(|| {
            StreamError::scenario("an odometry has a position and an attitude")
                .with_remedy("remove the sink, or estimate both, as [process.ins] does")
        })?;
        let Ros2Sink { global, local, pose, innovations, blend, tf, datum, origin, .. } =
            &self.config;
        let name =
            |topic: &Option<String>, usual: &str| topic.as_deref().unwrap_or(usual).to_owned();
        let offer = |topic: &str, kind: &str| self.node.publish(&of_topic(topic), &of_type(kind));
        let odometry = |topic: String| offer(&topic, "nav_msgs/msg/Odometry");
        let diagnoses = |topic: &str| offer(topic, "diagnostic_msgs/msg/DiagnosticArray");
        self.run = Some(Run {
            motion: motion.with_origin(datum.map(|datum| datum.position())),
            origin: Span::from_nanos(origin.map_or(0, |date| date.nanos)),
            vehicle: run.layout.vehicle(),
            blend: Blend::new(blend.map_or(BLEND, |time| time.value().si())),
            shown: State::default(),
            global: odometry(name(global, "/odometry/global"))?,
            local: odometry(name(local, "/odometry/local"))?,
            tf: tf.then(|| offer("/tf", "tf2_msgs/msg/TFMessage")).transpose()?,
            pose: pose.as_deref().map(|topic| offer(topic, POSE)).transpose()?,
            diagnoses: diagnoses("/diagnostics")?,
            innovations: innovations.as_deref().map(diagnoses).transpose()?,
            diagnostics: Diagnostics::new(run),
            diagnosed: None,
            message: Vec::new(),
        });
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match (record, &mut self.run) {
            (Record::Newest(epoch), Some(run)) => run.estimate(epoch, self.lifecycle.is_active()),
            (Record::Update(update), Some(run)) => {
                run.diagnostics.take(update);
                run.innovation(update, self.lifecycle.is_active())
            }
            (Record::Epoch(epoch), Some(run)) => {
                run.diagnostics.reach(epoch.state.time);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        Ok(None)
    }
}

impl Run {
    /// Publishes the use of a measurement.
    fn innovation(&mut self, update: &UpdateRecord<'_>, active: bool) -> Result<(), StreamError> {
        if let Some(topic) = self.innovations.as_ref().filter(|_| active)
            && let Some(diagnosis) = self.diagnostics.innovation(update)
        {
            let stamp = Stamp::new(update.time + self.origin)?;
            self.message.clear();
            Encoder::new(&mut self.message).diagnostics(stamp, &[diagnosis]);
            topic.send(&self.message);
        }
        Ok(())
    }

    /// Publishes an estimate of an active node.
    fn estimate(&mut self, epoch: &Epoch<'_>, active: bool) -> Result<(), StreamError> {
        let time = epoch.state.time;
        let stamp = Stamp::new(time + self.origin)?;
        self.shown.clone_from(epoch.state);
        // the motion is followed in every state, so that the output is continuous once it is published
        let offsets = self.blend.take(&self.vehicle, epoch, &mut self.shown);
        if !active {
            return Ok(());
        }
        let Moved { pose, velocity, .. } = self.motion.at(epoch);
        let continuous = self.motion.at(&Epoch { state: &self.shown, ..*epoch });
        let [pose, local] = [pose.of_ros(), continuous.pose.widened(offsets).of_ros()];
        let topics =
            [(&self.global, MAP, pose, velocity), (&self.local, ODOM, local, continuous.velocity)];
        for (topic, frame, pose, velocity) in topics {
            self.message.clear();
            Encoder::new(&mut self.message).odometry(
                stamp,
                [frame, BODY],
                &pose,
                &velocity.of_ros(),
            );
            topic.send(&self.message);
        }
        if let Some(topic) = &self.pose {
            self.message.clear();
            Encoder::new(&mut self.message).pose(stamp, MAP, &pose);
            topic.send(&self.message);
        }
        if let Some(tf) = &self.tf {
            self.message.clear();
            Encoder::new(&mut self.message)
                .transforms(stamp, transforms(&pose, &local).into_iter());
            tf.send(&self.message);
        }
        if self.diagnosed.is_none_or(|last| time.since(last).abs() >= BETWEEN_DIAGNOSES) {
            self.diagnosed = Some(time);
            for topic in [&self.global, &self.local] {
                self.diagnostics.refused(topic.refused());
            }
            self.message.clear();
            Encoder::new(&mut self.message).diagnostics(stamp, &self.diagnostics.all());
            self.diagnoses.send(&self.message);
        }
        Ok(())
    }
}

/// `odom` in `map`, and the body in `odom`: together they give the body in `map`.
fn transforms(global: &Pose, local: &Pose) -> [Link<'static>; 2] {
    let rotation = global.attitude * local.attitude.inverse();
    let correction = global.position - rotation * local.position;
    [
        Link { parent: MAP, child: ODOM, translation: correction, rotation },
        Link { parent: ODOM, child: BODY, translation: local.position, rotation: local.attitude },
    ]
}
