//! Where samples come from and where records go: sources and sinks.

#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod stream;
mod stream_error;

pub use stream::{NamedSink, NamedSource, RunInfo, Sink, Source};
pub use stream_error::{StreamError, StreamErrorKind, StreamPlace};
