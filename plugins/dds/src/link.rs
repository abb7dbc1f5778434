//! The link: samples from the messages of topics, as they arrive.

use crate::names::{of_topic, of_type, ros_topic, ros_type};
use crate::port::{Node, Subscription};
use crate::service::Services;
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Feed, Source, StreamError};
use navfuse_core::plugin::{LinkType, OpenContext};
use navfuse_core::units::sample::Sample;
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
    /// Lets the services `/navfuse/reset`, `/navfuse/checkpoint` and `/navfuse/enable_SENSOR` command the
    /// run. Default: they refuse.
    #[serde(default)]
    pub commands: bool,
}

/// Joins the domain of a scenario, or of the environment.
pub fn join(domain: Option<u16>, interfaces: &[String]) -> Result<Node, StreamError> {
    let from_environment = || std::env::var(DOMAIN).ok()?.trim().parse().ok();
    let parsed: Result<Vec<IpAddr>, _> = interfaces.iter().map(|text| text.parse()).collect();
    let interfaces = parsed.map_err(|e| {
        StreamError::network(e.to_string())
            .at_key("interfaces")
            .with_remedy("give addresses of this computer, such as [\"127.0.0.1\"]")
    })?;
    Node::join(domain.or_else(from_environment).unwrap_or_default(), &interfaces)
}

impl LinkType for Ros2Link {
    const TYPE: &'static str = "ros2";

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
        let zero = self.clock.zero().map_err(|e| e.at_key("clock"))?;
        let messages = Messages::new(&self.sensors, self.stamp, zero, context)?;
        let (to, remarks) = channel();
        let node = join(self.domain, &self.interfaces)?;
        let sensors = context.composition.sensors.iter();
        let sensors: Vec<String> = sensors.map(|s| s.info.name.clone()).collect();
        let samples = Box::new(Topics {
            services: Services::offer(&node, &sensors, self.commands)?,
            node,
            awaited: messages.topics(),
            messages,
            subscriptions: Vec::new(),
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
        self.services.answer(&waker, &self.remarks);
        for (k, subscription) in self.subscriptions.iter().enumerate() {
            // before the messages, so that none is overlooked
            subscription.wake(&waker);
            while let Some(message) = subscription.take() {
                self.messages.take(k, unix_time(), &message, &mut self.ready);
            }
        }
    }
}

impl Source for Topics {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        if self.ready.is_empty() {
            self.look();
            self.receive();
        }
        if let Some(next) = self.ready.pop_front() {
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
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
