//! A run in Foxglove while it goes on: the topics of the MCAP log over Foxglove's WebSocket protocol.
//!
//! Who connects during the run gets the newest message of each topic at once: the frames that do not
//! move and the paths so far are there, as in the log.

mod server;
mod sink;

pub use sink::FoxgloveSink;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the sink type `foxglove`.
#[derive(Clone, Copy, Debug)]
pub struct FoxglovePlugin;

impl Plugin for FoxglovePlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sink::<FoxgloveSink>();
    }

    navfuse_core::named_after_crate!();
}
