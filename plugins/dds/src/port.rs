//! The network: a participant of DDS, by the crate `rustdds`.

use navfuse_core::model::stream::StreamError;
use rustdds::bytes::Bytes;
use rustdds::no_key::{
    DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter, SimpleDataReader,
};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, Publisher, QosPolicies,
    QosPolicyBuilder, RepresentationIdentifier, Subscriber, TopicKind,
};
use std::convert::Infallible;
use std::net::IpAddr;
use std::task::Waker;

/// Size of the encapsulation before the body of a message.
const ENCAPSULATION: usize = 4;
/// Messages of a sensor that are kept: 2 s of an IMU at 400 Hz.
const READ: i32 = 800;
/// Messages of an estimate that are kept, as ROS 2 does.
const WRITTEN: i32 = 10;

/// A message in CDR, with its encapsulation.
pub struct Encoded(Vec<u8>);

/// Passes messages on as they are.
pub struct AsIs;

impl DeserializerAdapter<Encoded> for AsIs {
    type Error = Infallible;
    type Decoded = Encoded;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }

    fn transform_decoded(decoded: Encoded) -> Encoded {
        decoded
    }
}

impl DefaultDecoder<Encoded> for AsIs {
    type Decoder = Copied;
    const DECODER: Copied = Copied;
}

/// Copies the bytes of a message.
#[derive(Clone)]
pub struct Copied;

impl Decode<'_, Encoded> for Copied {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Encoded, Infallible> {
        let little = u8::from(encoding == RepresentationIdentifier::CDR_LE);
        Ok(Encoded([&[0, little, 0, 0], bytes].concat()))
    }
}

impl SerializerAdapter<Encoded> for AsIs {
    type Error = Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(message: &Encoded) -> Result<Bytes, Infallible> {
        Ok(Bytes::copy_from_slice(message.0.get(ENCAPSULATION..).unwrap_or_default()))
    }
}

/// A participant of a domain.
pub struct Node {
    participant: DomainParticipant,
    subscriber: Subscriber,
    publisher: Publisher,
}

/// A topic that is read.
pub struct Subscription(SimpleDataReader<Encoded, AsIs>);

/// A topic that is written.
pub struct Publication(DataWriter<Encoded, AsIs>);

/// The quality of service of sensors: a message that is lost stays lost. It fits every publisher.
const SENSOR: QosPolicies = QosPolicyBuilder::new()
    .reliability(Reliability::BestEffort)
    .durability(Durability::Volatile)
    .history(History::KeepLast { depth: READ })
    .build();

/// The quality of service of an estimate: the default of ROS 2. It fits every subscriber.
const ESTIMATE: QosPolicies = QosPolicyBuilder::new()
    .reliability(Reliability::Reliable { max_blocking_time: Duration::ZERO })
    .durability(Durability::Volatile)
    .history(History::KeepLast { depth: WRITTEN })
    .build();

fn failed(error: impl std::fmt::Display) -> StreamError {
    StreamError::network(format!("DDS: {error}"))
}

impl Node {
    /// Joins a domain, on the interfaces with these addresses or, without any, on all.
    pub fn join(domain: u16, interfaces: &[IpAddr]) -> Result<Self, StreamError> {
        let mut builder = DomainParticipantBuilder::new(domain);
        if !interfaces.is_empty() {
            builder = builder.with_only_networks(interfaces.iter().copied());
        }
        let participant = builder.build().map_err(failed)?;
        let subscriber = participant.create_subscriber(&SENSOR).map_err(failed)?;
        let publisher = participant.create_publisher(&ESTIMATE).map_err(failed)?;
        Ok(Self { participant, subscriber, publisher })
    }

    /// The topics that other programs write, each with its type.
    pub fn written(&self) -> Vec<(String, String)> {
        let writers = self.participant.discovered_writers().into_iter();
        let names = writers.map(|writer| writer.publication_topic_data);
        names.map(|data| (data.topic_name, data.type_name)).collect()
    }

    /// Subscribes to a topic.
    pub fn subscribe(&self, topic: &str, kind: &str) -> Result<Subscription, StreamError> {
        let topic = self.topic(topic, kind, &SENSOR)?;
        let reader = self.subscriber.create_simple_datareader_no_key(&topic, Some(SENSOR));
        reader.map(Subscription).map_err(failed)
    }

    /// Offers a topic.
    pub fn publish(&self, topic: &str, kind: &str) -> Result<Publication, StreamError> {
        let topic = self.topic(topic, kind, &ESTIMATE)?;
        let writer = self.publisher.create_datawriter_no_key(&topic, Some(ESTIMATE));
        writer.map(Publication).map_err(failed)
    }

    fn topic(
        &self,
        topic: &str,
        kind: &str,
        qos: &QosPolicies,
    ) -> Result<rustdds::Topic, StreamError> {
        let (topic, kind) = (topic.to_owned(), kind.to_owned());
        self.participant.create_topic(topic, kind, qos, TopicKind::NoKey).map_err(failed)
    }
}

impl Subscription {
    /// Has the waker called with the next message.
    pub fn wake(&self, waker: &Waker) {
        self.0.set_waker(Some(waker.clone()));
    }

    /// The next message, if there is one.
    pub fn take(&self) -> Option<Vec<u8>> {
        self.0.drain_read_notifications();
        // an encoding that is not plain CDR is an error, and the message after it is read
        self.0.try_take_one().ok().flatten().map(|message| message.into_value().0)
    }
}

impl Publication {
    /// Sends a message in CDR with its encapsulation. A network that is full loses it.
    pub fn send(&self, message: &[u8]) {
        self.0.write(Encoded(message.to_vec()), None).ok();
    }
}
