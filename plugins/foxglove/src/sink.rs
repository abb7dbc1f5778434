//! The sink.

use crate::server::Server;
use navfuse_core::model::record::{Event, Record};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::plugin::{OpenContext, SinkType};
use navfuse_core::units::time::Time;
use navfuse_mcap::Messages;
use schemars::JsonSchema;
use serde::Deserialize;
use std::net::{Ipv4Addr, SocketAddr};

/// Port at which Foxglove looks for a server.
const PORT: u16 = 8765;

/// Shows the run in Foxglove while it goes on: serves the topics of the log over WebSocket, until the
/// run ends.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FoxgloveSink {
    /// Address at which the server listens. Default: `127.0.0.1:8765`, which only this computer
    /// reaches; `0.0.0.0:8765` lets any computer of the network watch.
    #[serde(default = "loopback")]
    pub address: SocketAddr,
}

fn loopback() -> SocketAddr {
    (Ipv4Addr::LOCALHOST, PORT).into()
}

impl SinkType for FoxgloveSink {
    const TYPE: &'static str = "foxglove";
    const DEFAULT: bool = false;

    fn open(self, _: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        let server = Server::listen(self.address)?;
        Ok(Box::new(Shown { server, run: None, messages: None, early: Vec::new() }))
    }
}

/// A run that is shown.
struct Shown {
    server: Server,
    run: Option<RunInfo>,
    /// From the first record with a time on.
    messages: Option<Messages>,
    /// Events before that.
    early: Vec<Event>,
}

impl Shown {
    /// Announces the topics, and sends the events so far.
    fn begin(&mut self, now: Time) -> Result<(), StreamError> {
        let Some(run) = &self.run else { return Ok(()) };
        let messages = Messages::open(run, now, |topics| self.server.announce(topics));
        let messages = messages.map_err(|e| StreamError::network(e.to_string()))?;
        let messages = self.messages.insert(messages);
        self.early.drain(..).try_for_each(|event| messages.send(&Record::Event(&event)))
    }
}

impl Sink for Shown {
    fn start(&mut self, run: &RunInfo) -> Result<(), StreamError> {
        self.run = Some(run.clone());
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        if self.messages.is_none() {
            // the time of the run is not known before its first sample
            match record {
                Record::Sample(sample) => self.begin(sample.time)?,
                Record::Event(event) => self.early.push((*event).clone()),
                _ => {}
            }
        }
        self.messages.as_mut().map_or(Ok(()), |messages| messages.send(record))
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        self.server.stop();
        Ok(None)
    }
}
