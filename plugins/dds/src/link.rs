//! The link: samples from the messages of topics, as they arrive.

use crate::clock::{SimulatedTime, TOPIC};
use crate::lifecycle::{Lifecycle, State};
use crate::names::{of_topic, of_type, ros_topic, ros_type};
use crate::port::{Node, Subscription};
use crate::service::Services;
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Command, Feed, Source, StreamError};
use navfuse_core::plugin::{LinkType, OpenContext};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_frames::TimeConfig;
use navfuse_links::{PortFeed, Remark, unix_time};
use navfuse_ros2::{Messages, Stamping, TopicConfig};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::{BTreeMap, VecDeque};
use std::io::{Error, ErrorKind};
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::task::{Wake, Waker};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// Longest wait for a message, after which the link notices the end of the run.
const PATIENCE: Duration = Duration::from_millis(50);
/// Time between two looks for topics that were not there.
const LOOK: Duration = Duration::from_millis(200);
/// Variable with the domain of the programs of ROS 2.
const DOMAIN: &str = "ROS_DOMAIN_ID";
/// Name of a topic by which an operator sets the pose.
const SET_POSE: &str = "set_pose";
/// The type of messages with a pose.
pub const POSE: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";

/// Subscribes to topics of ROS 2, with the quality of service of sensors. The type of a topic is that of
/// its publisher.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ros2Link {
    /// Topics by the sensor that receives their messages: `imu = { topic = "/imu/data" }`.
    pub sensors: BTreeMap<String, TopicConfig>,
    /// Time of a message: that in its header (default), or that at which it was received.
    #[serde(default)]
    pub stamp: Stamping,
    /// The clock of the stamps, which counts from 1970.
    #[serde(default)]
    pub clock: TimeConfig,
    /// Domain of DDS. Default: that in the variable `ROS_DOMAIN_ID`, or 0.
    pub domain: Option<u16>,
    /// Addresses of this computer over which it talks, such as `["127.0.0.1"]`. Default: all, as a
    /// program of ROS 2 does.
    #[serde(default)]
    pub interfaces: Vec<String>,
    /// Lets the services `/navfuse/reset`, `/navfuse/checkpoint`, `/navfuse/enable_SENSOR` and
    /// `/navfuse/change_state` command the run. Default: they refuse.
    #[serde(default)]
    pub commands: bool,
    /// Begins in the state `active` of a lifecycle node. `false` begins in `unconfigured`, and the sink
    /// publishes nothing until a lifecycle manager activates the node. Default: true.
    #[serde(default = "yes")]
    pub autostart: bool,
    /// Takes the time at which messages are received from the topic `/clock` of a simulator; a clock that
    /// goes back begins the run anew. Default: false.
    #[serde(default)]
    pub use_sim_time: bool,
}

fn yes() -> bool {
    true
}

/// The domain of a scenario, or of the environment.
pub fn domain_of(domain: Option<u16>) -> u16 {
    let from_environment = || std::env::var(DOMAIN).ok()?.trim().parse().ok();
    domain.or_else(from_environment).unwrap_or_default()
}

/// Joins a domain.
pub fn join(domain: u16, interfaces: &[String]) -> Result<Node, StreamError> {
    let parsed: Result<Vec<IpAddr>, _> = interfaces.iter().map(|text| text.parse()).collect();
    let interfaces = parsed.map_err(|e| {
        StreamError::network(e.to_string())
            .at_key("interfaces")
            .with_remedy("give addresses of this computer, such as [\"127.0.0.1\"]")
    })?;
    Node::join(domain, &interfaces)
}

impl LinkType for Ros2Link {
    const TYPE: &'static str = "ros2";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        if !self.autostart && !self.commands {
            let text = "no lifecycle manager can activate the node, since commands are refused";
            let remedy = "set commands = true";
            return Err(StreamError::scenario(text).at_key("autostart").with_remedy(remedy));
        }
        let zero = self.clock.zero().map_err(|e| e.at_key("clock"))?;
        let sets_pose = |topic: &str| topic.rsplit('/').next() == Some(SET_POSE);
        let mut topics = self.sensors;
        let set = topics.values_mut().filter(|t| t.topic.as_deref().is_some_and(sets_pose));
        // from the command line, a pose has no stamp
        set.for_each(|topic| topic.stamp = topic.stamp.or(Some(Stamping::Receive)));
        let mut messages = Messages::new(&topics, self.stamp, zero, context)?;
        let (to, remarks) = channel();
        let domain = domain_of(self.domain);
        let node = join(domain, &self.interfaces)?;
        let start = if self.autostart { State::Active } else { State::Unconfigured };
        let lifecycle = Lifecycle::of(domain, start);
        let sensors = context.composition.sensors.iter();
        let sensors: Vec<String> = sensors.map(|s| s.info.name.clone()).collect();
        // an operator may never publish, so these topics await nobody
        let topics = messages.topics().into_iter();
        let (poses, awaited): (Vec<_>, Vec<_>) = topics.partition(|topic| sets_pose(topic));
        let mut subscriptions = Vec::new();
        for topic in &poses {
            messages.add(topic, POSE)?;
            subscriptions.push(node.subscribe(&of_topic(topic), &of_type(POSE))?);
        }
        let clock = self.use_sim_time.then(|| SimulatedTime::subscribe(&node)).transpose()?;
        let samples = Box::new(Topics {
            services: Services::offer(&node, &sensors, &poses, self.commands, lifecycle)?,
            node,
            awaited,
            messages,
            poses: poses.len(),
            subscriptions,
            clock,
            newest: None,
            ready: VecDeque::new(),
            looked: None,
            remarks: to,
        });
        Ok(Box::new(PortFeed { samples, remarks, waits: false }))
    }
}

/// The samples of all topics.
struct Topics {
    node: Node,
    services: Services,
    messages: Messages,
    /// Topics without a publisher so far.
    awaited: Vec<String>,
    /// In the order in which `messages` knows their topics.
    subscriptions: Vec<Subscription>,
    /// Number of the first topics, by which an operator sets the pose.
    poses: usize,
    /// The clock of a simulation.
    clock: Option<SimulatedTime>,
    /// The latest time of a sample, which is that of a pose that is set.
    newest: Option<Time>,
    ready: VecDeque<Sample>,
    looked: Option<Instant>,
    remarks: Sender<Remark>,
}

/// Wakes a thread that waits for messages.
struct Unpark(Thread);

impl Wake for Unpark {
    fn wake(self: Arc<Self>) {
        self.0.unpark();
    }
}

impl Topics {
    /// Subscribes to the topics that have a publisher by now.
    fn look(&mut self) {
        if self.awaited.is_empty() || self.looked.is_some_and(|last| last.elapsed() < LOOK) {
            return;
        }
        self.looked = Some(Instant::now());
        for (topic, kind) in self.node.written() {
            let names = ros_topic(&topic).zip(ros_type(&kind));
            let Some((topic, kind)) = names else { continue };
            let Some(k) = self.awaited.iter().position(|name| *name == topic) else { continue };
            self.awaited.swap_remove(k);
            let opened = self.subscribe(&topic, &kind);
            let (level, text) = match opened {
                Ok(()) => (Level::Info, format!("subscribed to {topic} ({kind})")),
                Err(error) => (Level::Error, error.to_string()),
            };
            // the feed that logs it ends with this source
            self.remarks.send(Remark::Report(level, text)).ok();
        }
    }

    fn subscribe(&mut self, topic: &str, kind: &str) -> Result<(), StreamError> {
        let subscription = self.node.subscribe(&of_topic(topic), &of_type(kind))?;
        self.messages.add(topic, kind)?;
        self.subscriptions.push(subscription);
        Ok(())
    }

    /// Takes all messages that are there.
    fn receive(&mut self) {
        let waker = Waker::from(Arc::new(Unpark(std::thread::current())));
        let set = self.services.answer(&waker, &self.remarks);
        if self.clock.as_mut().is_some_and(|clock| clock.advance(&waker)) {
            let text = format!("{TOPIC} went back: the run begins anew");
            self.newest = None;
            // the feed that takes them ends with this source
            self.remarks.send(Remark::Report(Level::Warning, text)).ok();
            self.remarks.send(Remark::Command(Command::Reset)).ok();
        }
        let received = match &self.clock {
            Some(clock) => clock.now(),
            None => Some(unix_time()),
        };
        for (k, subscription) in self.subscriptions.iter().enumerate() {
            // before the messages, so that none is overlooked
            subscription.wake(&waker);
            while let Some(message) = subscription.take() {
                // before its first message, a simulation has no time
                let Some(received) = received else { continue };
                if k < self.poses {
                    self.ready.extend(pose(&mut self.messages, k, &message, self.newest));
                } else {
                    self.messages.take(k, received, &message, &mut self.ready);
                }
            }
        }
        for (k, message) in set {
            self.ready.extend(pose(&mut self.messages, k, &message, self.newest));
        }
    }
}

/// The samples of a pose that is set, for the time of the newest sample: an operator sets the pose of now,
/// whatever the stamp. Before the first sample there is none.
fn pose(
    messages: &mut Messages,
    topic: usize,
    message: &[u8],
    newest: Option<Time>,
) -> VecDeque<Sample> {
    let mut samples = VecDeque::new();
    if let Some(newest) = newest {
        messages.take(topic, unix_time(), message, &mut samples);
        samples.iter_mut().for_each(|sample| sample.time = newest);
    }
    samples
}

impl Source for Topics {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        if self.ready.is_empty() {
            self.look();
            self.receive();
        }
        if let Some(next) = self.ready.pop_front() {
            self.newest = self.newest.max(Some(next.time));
            *sample = next;
            return Ok(true);
        }
        std::thread::park_timeout(PATIENCE);
        Err(StreamError::read("ros2", Error::from(ErrorKind::WouldBlock)))
    }

    fn warning(&mut self) -> Option<String> {
        let mut parts: Vec<String> = self.messages.warning().into_iter().collect();
        if !self.awaited.is_empty() {
            parts.push(format!("no publisher of {}", self.awaited.join(", ")));
        }
        if self.clock.as_ref().is_some_and(|clock| clock.now().is_none()) {
            parts.push(format!("use_sim_time = true, and no time on {TOPIC}"));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
