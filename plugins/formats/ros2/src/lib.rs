//! Bags of ROS 2: MCAP and SQLite, split, packed or damaged.
//!
//! The source type `ros2` gives the samples of a scenario's sensors. A [`Bag`] gives the messages
//! to any program. Messages are read by the definitions in the bag, or by built-in ones for bags of
//! versions before Iron. Damaged parts are skipped and reported with their offset and number.

mod axes;
mod bag;
mod cdr;
mod config;
mod definition;
mod error;
mod form;
mod intake;
mod order;
mod program;
mod relative;
mod route;
mod source;
mod survey;
mod transforms;

pub use axes::Axes;
pub use bag::{Bag, Message, Topic};
pub use config::{MessageField, Ros2, Stamping, TopicConfig, Tracked};
pub use error::{DefinitionError, MessageError};
pub use intake::Messages;
pub use navfuse_frames::Datum;
pub use survey::{Survey, TopicSurvey, Use, survey};
pub use transforms::{Mounting, Transforms};

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `ros2`.
#[derive(Clone, Copy, Debug)]
pub struct Ros2Plugin;

impl Plugin for Ros2Plugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Ros2>();
    }

    navfuse_core::named_after_crate!();
}
