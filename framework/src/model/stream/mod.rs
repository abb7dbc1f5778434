//! Where samples come from and where records go: sources, feeds and sinks.

mod feed;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod stream;
mod stream_error;

pub use feed::{Arrival, Arrivals, Command, Feed, Inbox, NamedFeed, Parcel};
pub use stream::{NamedSink, NamedSource, RunInfo, Sink, Source};
pub use stream_error::{StreamError, StreamErrorKind, StreamPlace};
