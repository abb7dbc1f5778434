//! The server.

use navfuse_core::model::stream::StreamError;
use navfuse_mcap::{Definition, Outlet};
use std::io;
use std::net::SocketAddr;

#[cfg(feature = "server")]
pub use listening::Server;

/// A server, of which there is none.
#[cfg(not(feature = "server"))]
pub enum Server {}

#[cfg(not(feature = "server"))]
impl Server {
    pub fn listen(_: SocketAddr) -> Result<Self, StreamError> {
        Err(StreamError::scenario("this program was built without Foxglove")
            .with_remedy("build it with `cargo build --release --features foxglove`"))
    }

    pub fn announce(&self, _: &[Definition]) -> io::Result<Box<dyn Outlet>> {
        match *self {}
    }

    pub fn stop(&mut self) {
        match *self {}
    }
}

#[cfg(feature = "server")]
mod listening {
    use super::{Definition, Outlet, SocketAddr, StreamError, io};
    use foxglove::websocket::{ChannelView, Client, ServerListener};
    use foxglove::{Context, PartialMetadata, RawChannel, Schema, WebSocketServerHandle};
    use std::fmt;
    use std::sync::{Arc, Mutex, PoisonError};
    use std::thread::sleep;
    use std::time::Duration;

    /// Time in which the last messages leave.
    const LEAVE: Duration = Duration::from_secs(1);

    /// A server at an address.
    pub struct Server {
        context: Arc<Context>,
        topics: Arc<Topics>,
        /// Until it stops.
        handle: Option<WebSocketServerHandle>,
    }

    impl Server {
        /// Starts to listen.
        pub fn listen(address: SocketAddr) -> Result<Self, StreamError> {
            let (context, topics) = (Context::new(), Arc::<Topics>::default());
            let server = context.websocket_server().name("navfuse").listener(topics.clone());
            let handle = server.bind(address.ip().to_string(), address.port()).start_blocking();
            let handle = Some(handle.map_err(|e| {
                StreamError::network(format!("{address}: {e}"))
                    .at_key("address")
                    .with_remedy("give another address and port")
            })?);
            Ok(Self { context, topics, handle })
        }

        /// Announces the topics, to which the outlet then sends.
        pub fn announce(&self, definitions: &[Definition]) -> io::Result<Box<dyn Outlet>> {
            let mut topics = self.topics.0.lock().unwrap_or_else(PoisonError::into_inner);
            for definition in definitions {
                let schema = definition.schema;
                let schema = Schema::new(schema.name, "ros2msg", schema.text.as_bytes().to_vec());
                let channel = self.context.channel_builder(&definition.topic).schema(schema);
                let channel = channel.message_encoding("cdr").metadata(definition.metadata.clone());
                let channel = channel.build_raw().map_err(io::Error::other)?;
                topics.push(Topic { channel, newest: Vec::new(), log_time: 0 });
            }
            Ok(Box::new(Sender(self.topics.clone())))
        }

        /// Ends the connections, once the last messages, among them the verdict, had time to leave: the
        /// server drops those that still wait when it stops, and does not say whether any do.
        pub fn stop(&mut self) {
            if let Some(handle) = self.handle.take() {
                if handle.client_count() > 0 {
                    sleep(LEAVE);
                }
                handle.stop().wait_blocking();
            }
        }
    }

    /// The topics in the order of their channels, shared by the run and the threads of the server.
    #[derive(Default)]
    struct Topics(Mutex<Vec<Topic>>);

    struct Topic {
        channel: Arc<RawChannel>,
        /// The newest message; empty before the first.
        newest: Vec<u8>,
        log_time: u64,
    }

    impl ServerListener for Topics {
        /// Sends the newest message to the one who subscribes, who would else wait for the next one: the
        /// frames that do not move come only once.
        fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
            let topics = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let topic = topics.iter().find(|topic| topic.channel.id() == channel.id());
            if let Some(topic) = topic.filter(|topic| !topic.newest.is_empty()) {
                let meta = PartialMetadata { log_time: Some(topic.log_time) };
                topic.channel.log_with_meta_to_sink(&topic.newest, meta, client.sink_id());
            }
        }
    }

    /// Sends the messages of a run.
    struct Sender(Arc<Topics>);

    impl fmt::Debug for Sender {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("Sender")
        }
    }

    impl Outlet for Sender {
        fn message(&mut self, channel: u16, log_time: u64, message: &[u8]) {
            let mut topics = self.0.0.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(topic) = topics.get_mut(usize::from(channel)) else { return };
            topic.newest.clear();
            topic.newest.extend_from_slice(message);
            topic.log_time = log_time;
            let meta = PartialMetadata { log_time: Some(log_time) };
            topic.channel.log_with_meta(message, meta);
        }
    }
}
