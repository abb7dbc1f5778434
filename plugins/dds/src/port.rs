//! The network: a participant of DDS, by the crate `rustdds`.

use navfuse_core::model::stream::StreamError;
use rustdds::bytes::Bytes;
use rustdds::no_key::{
    DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter, SimpleDataReader,
};
use rustdds::policy::{Durability, History, Reliability};

use rustdds::rpc::SampleIdentity;
use rustdds::{
    DataWriterStatus, DomainParticipant, DomainParticipantBuilder, Duration, Publisher,
    QosPolicies, QosPolicyBuilder, RepresentationIdentifier, StatusEvented, Subscriber, TopicKind,
    WriteOptionsBuilder,
};
use std::convert::Infallible;
use std::net::IpAddr;
use std::task::Waker;
use std::time::Instant;

/// Size of the encapsulation before the body of a message.
const ENCAPSULATION: usize = 4;
/// Messages of a sensor that are kept: 2 s of an IMU at 400 Hz.
const READ: i32 = 800;
/// Messages of an estimate that are kept, as ROS 2 does.
const WRITTEN: i32 = 10;

/// Longest wait until a client is known to listen, and the time between two looks.
const KNOWN: std::time::Duration = std::time::Duration::from_millis(100);
const PAUSE: std::time::Duration = std::time::Duration::from_millis(2);

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

/// A service: its requests and its answers.
pub struct Server {
    participant: DomainParticipant,
    /// Topic of the answers.
    topic: String,
    requests: SimpleDataReader<Encoded, AsIs>,
    answers: DataWriter<Encoded, AsIs>,
}

/// The request that an answer is for.
pub struct Asker(SampleIdentity);

/// The quality of service of sensors: a message that is lost stays lost. It fits every publisher.
const SENSOR: QosPolicies = QosPolicyBuilder::new()
    .reliability(Reliability::BestEffort)
    .durability(Durability::Volatile)
    .history(History::KeepLast { depth: READ })
    .build();

/// The quality of service of an estimate and of services: the default of ROS 2. It fits every subscriber.
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

    /// Offers a service: topic and type of its requests, and of its answers.
    pub fn serve(&self, requests: [&str; 2], answers: [&str; 2]) -> Result<Server, StreamError> {
        let topic = |[topic, kind]: [&str; 2]| self.topic(topic, kind, &ESTIMATE);
        let (asked, answered) = (topic(requests)?, topic(answers)?);
        let reader = self.subscriber.create_simple_datareader_no_key(&asked, Some(ESTIMATE));
        let writer = self.publisher.create_datawriter_no_key(&answered, Some(ESTIMATE));
        Ok(Server {
            participant: self.participant.clone(),
            topic: answers[0].to_owned(),
            requests: reader.map_err(failed)?,
            answers: writer.map_err(failed)?,
        })
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

impl Server {
    /// Has the waker called with the next request.
    pub fn wake(&self, waker: &Waker) {
        self.requests.set_waker(Some(waker.clone()));
    }

    /// The next request, if there is one, in CDR with its encapsulation.
    pub fn take(&self) -> Option<(Vec<u8>, Asker)> {
        self.requests.drain_read_notifications();
        let request = self.requests.try_take_one().ok().flatten()?;
        let (writer_guid, sequence_number) = (request.writer_guid, request.sequence_number);
        let asker = Asker(SampleIdentity { writer_guid, sequence_number });
        Some((request.into_value().0, asker))
    }

    /// Answers a request, once somebody who listens to answers is known: a client may ask before.
    pub fn answer(&self, to: Asker, message: &[u8]) {
        let begin = Instant::now();
        let heard = || {
            let readers = self.participant.discovered_readers();
            readers.iter().any(|r| *r.subscription_topic_data.topic_name() == self.topic)
        };
        while begin.elapsed() < KNOWN && !heard() {
            std::thread::sleep(PAUSE);
        }
        let options = WriteOptionsBuilder::new().related_sample_identity(to.0).build();
        self.answers.write_with_options(Encoded(message.to_vec()), options).ok();
    }
}

impl Publication {
    /// Sends a message in CDR with its encapsulation. A network that is full loses it.
    pub fn send(&self, message: &[u8]) {
        self.0.write(Encoded(message.to_vec()), None).ok();
    }

    /// The quality of service that a subscriber has asked for since the last call and does not get, so that
    /// it receives nothing.
    pub fn refused(&self) -> Option<String> {
        let mut refused = None;
        while let Some(status) = self.0.try_recv_status() {
            if let DataWriterStatus::OfferedIncompatibleQos { last_policy_id, .. } = status {
                refused = Some(format!("{last_policy_id:?}"));
            }
        }
        refused
    }
}
