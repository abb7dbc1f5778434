//! Types of links: ports through which the samples of a vehicle arrive.

use crate::model::stream::{Feed, StreamError};
use crate::plugin::OpenContext;
use crate::plugin::entry::{Kind, Make, Open, Prepare};
use crate::plugin::registry::Registry;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

/// A type of link. A run on the vehicle opens the links of a scenario in place of its sources.
///
/// ```
/// use navfuse_core::model::stream::{Feed, Inbox};
/// use navfuse_core::plugin::LinkType;
/// use navfuse_core::prelude::*;
/// /// The bus of a vehicle.
/// #[derive(Clone, Debug, Deserialize, JsonSchema)]
/// #[serde(deny_unknown_fields)]
/// struct Bus {
///     /// Name of the sensor that receives the depth.
///     depth: String,
/// }
/// struct Open(SensorId);
/// impl LinkType for Bus {
///     const TYPE: &'static str = "bus";
///     fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError> {
///         let sensor = context.sensor(&self.depth).map_err(|e| e.at_key("depth"))?;
///         let (sensor, _) = sensor.ok_or_else(|| StreamError::scenario("it is disabled"))?;
///         Ok(Box::new(Open(sensor)))
///     }
/// }
/// impl Feed for Open {
///     fn run(self: Box<Self>, inbox: &mut Inbox) {
///         // of a real bus: wait for a frame, and look at `is_closed` from time to time
///         while !inbox.is_closed() {
///             inbox.offer(&Sample::new(Time::from_nanos(0), self.0, &[12.5]));
///         }
///     }
/// }
/// let mut registry = Registry::new();
/// registry.link::<Bus>(); // [link.bus]
/// ```
pub trait LinkType: DeserializeOwned + JsonSchema + 'static {
    /// The name in TOML.
    const TYPE: &'static str;
    /// Opens the port, or prepares a feed that opens it and keeps trying.
    ///
    /// # Errors
    /// When the parameters do not fit the scenario, or the port is in use.
    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Feed>, StreamError>;
}

impl Registry {
    /// Registers a type of link.
    pub fn link<L: LinkType>(&mut self) -> &mut Self {
        let prepare: Prepare<Open<Box<dyn Feed>>> = Box::new(|node| {
            let config = node.parse::<L>()?;
            Ok(Box::new(|context| config.open(context)))
        });
        self.insert::<L>(Kind::Link, L::TYPE, Make::Link { prepare });
        self
    }
}
