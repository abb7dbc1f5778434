//! The source: the samples of all sensors, from one pass through the bag.

use crate::bag::{Bag, Message};
use crate::config::Ros2;
use crate::intake::Intake;
use crate::order::Order;
use crate::route::Route;
use navfuse_core::model::stream::{Source, StreamError};
use navfuse_core::plugin::{OpenContext, SourceType};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};

/// Longest delay of messages, in seconds, where no key gives another.
const WAIT: f64 = 10.0;
/// Largest number of topics that a message lists.
const LISTED: usize = 20;

impl SourceType for Ros2 {
    const TYPE: &'static str = "ros2";

    fn open(self, context: &OpenContext<'_>) -> Result<Vec<Box<dyn Source>>, StreamError> {
        let paths: Vec<_> =
            std::iter::once(&self.path).chain(&self.more).map(|p| context.base.join(p)).collect();
        if self.time.first_day.is_some() {
            let text = "a bag has dates of its own";
            return Err(StreamError::scenario(text)
                .at_key("time.first_day")
                .with_remedy("remove it, or set time.origin"));
        }
        let zero = self.time.zero()?;
        let wait = self.wait.map_or(WAIT, |w| w.si());
        let window = Span::from_seconds(wait).filter(|w| w.nanos() >= 0).ok_or_else(|| {
            StreamError::scenario("it is a time from 0 s to 73 years").at_key("wait")
        })?;
        let intake = Intake::new(&self.sensors, self.stamp, zero, context)?;
        let mut stream = Stream {
            bag: Bag::open(&paths)?,
            intake,
            order: Order::new(window.nanos()),
            ready: None,
            ended: false,
        };
        if !stream.intake.routes.is_empty() {
            stream.start()?;
        }
        Ok(vec![Box::new(stream)])
    }
}

/// The samples of a bag.
struct Stream {
    bag: Bag,
    /// The topics of the bag so far.
    intake: Intake,
    order: Order,
    /// The first sample, which was read when the bag was opened.
    ready: Option<Sample>,
    ended: bool,
}

impl Stream {
    /// Reads up to the first sample, so that a bag that does not fit is rejected at once.
    fn start(&mut self) -> Result<(), StreamError> {
        self.ready = self.advance()?;
        if self.ready.is_some() {
            return Ok(());
        }
        let wanted: Vec<&str> = self.intake.routes.iter().map(|r| r.topic.as_str()).collect();
        let topics: Vec<String> = self
            .bag
            .topics()
            .iter()
            .take(LISTED)
            .map(|t| format!("{} ({})", t.name, t.kind))
            .collect();
        let why = self.warnings().map_or_else(String::new, |text| format!(" ({text})"));
        let has = if topics.is_empty() { "none".to_owned() } else { topics.join(", ") };
        Err(StreamError::format(format!(
            "no sample from {}{why}; topics of the bag: {has}",
            wanted.join(", ")
        ))
        .in_file(self.bag.path())
        .with_remedy("name other topics with `sensors`"))
    }

    /// Reads up to the next sample; `None` at the end.
    fn advance(&mut self) -> Result<Option<Sample>, StreamError> {
        loop {
            while let Some(mut sample) = self.order.pop() {
                if self.intake.chains.increment(&mut sample) {
                    return Ok(Some(sample));
                }
            }
            if self.ended {
                return Ok(None);
            }
            let routes = &mut self.intake.routes;
            let wanted = |name: &str| routes.iter().any(|r| r.topic == name);
            let Some(message) = self.bag.next(|topic| wanted(&topic.name))? else {
                self.ended = true;
                for route in routes {
                    route.clock.finish();
                    release(route, &mut self.order, 0);
                }
                self.order.finish();
                continue;
            };
            self.order.now(message.received);
            let topic = message.topic;
            if topic < self.intake.added() {
                read(&mut self.intake, &mut self.order, &message);
                continue;
            }
            let data = message.data.to_vec();
            let (received, offset) = (message.received, message.offset);
            for topic in &self.bag.topics()[self.intake.added()..] {
                self.intake.add(topic).map_err(|e| e.in_file(self.bag.path()))?;
            }
            let message = Message { topic, received, offset, data: &data };
            read(&mut self.intake, &mut self.order, &message);
        }
    }

    /// All that was wrong with the bag so far.
    fn warnings(&self) -> Option<String> {
        let mut parts = Vec::new();
        parts.extend(self.bag.faults());
        parts.extend(self.intake.warnings());
        let late = "left out, received too long after messages with later stamps, raise `wait`,";
        parts.extend(self.order.late.describe("message", late));
        for route in self.intake.routes.iter().filter(|r| r.messages == 0) {
            parts.push(format!("{}: no message for {}", route.topic, route.name));
        }
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// Reads a message for each of its routes.
fn read(intake: &mut Intake, order: &mut Order, message: &Message<'_>) {
    for (route, reading) in intake.of(message.topic) {
        route.take(reading, message);
        release(route, order, message.offset);
    }
}

/// Passes on the samples whose time is known.
fn release(route: &mut Route, order: &mut Order, offset: u64) {
    while let Some((nanos, (received, mut sample))) = route.clock.pop() {
        sample.time = Time::from_nanos(nanos);
        route.samples += 1;
        order.push(received, offset, sample);
    }
}

impl Source for Stream {
    fn next(&mut self, sample: &mut Sample) -> Result<bool, StreamError> {
        let next = self.ready.take().map_or_else(|| self.advance(), |s| Ok(Some(s)))?;
        Ok(next.map(|next| *sample = next).is_some())
    }

    fn warning(&mut self) -> Option<String> {
        self.warnings().map(|text| format!("{}: {text}", self.bag.path().display()))
    }
}
