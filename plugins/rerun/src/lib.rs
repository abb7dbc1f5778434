//! The sink `rerun`: a recording for the [rerun](https://rerun.io) viewer, laid out for navigation
//! runs.
//!
//! Everything follows from the layout of the state and the sensors' channels: this crate knows no
//! sensor by name. All data is on the timeline `t`, the clock of the run:
//!
//! | entity | content |
//! |---|---|
//! | `/world/estimate`, `/world/truth` | the tracks, north-east-down metres from the start |
//! | `/world/vehicle` | position and attitude over time |
//! | `/map/estimate`, `/map/truth`, `/map/vehicle` | the same in latitude and longitude |
//! | `/state/OWNER/BLOCK/COMPONENT/estimate` | estimate and its bounds of 3 sigma |
//! | `/state/OWNER/BLOCK/COMPONENT/truth` | truth, where it is known |
//! | `/state/OWNER/BLOCK/COMPONENT/error` | estimate minus truth, bounds of 3 sigma about zero |
//! | `/innovation/SENSOR/CHANNEL` | innovation and its bounds of 3 sigma; below it `gated` |
//! | `/innovation/SENSOR/nis` | normalised innovation squared and the gate's threshold; `gated` |
//! | `/samples/SENSOR` | the samples, one instance per channel, SI |
//! | `/events`, `/scenario` | the log, and the scenario in TOML |
//!
//! A [`Tab`] adds entities and a view of its own.
//!
//! The feature `serve` adds the page that shows a run in a browser (key `serve`).

mod blueprint;
mod columns;
mod file;
mod innovation;
mod live;
mod recording;
mod serve;
mod sink;
mod state;
pub mod style;
mod tab;
mod track;
pub mod viewer;

pub use blueprint::Layout;
pub use columns::{Range, Series};
pub use live::Live;
pub use recording::Recording;
pub use tab::Tab;
/// The viewer's library: the version that this crate writes with.
pub use {re_sdk, re_sdk_types};

use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::plugin::{OpenContext, Plugin, Registry, SinkType};
use schemars::JsonSchema;
use serde::Deserialize;
use std::net::AddrParseError;
use std::path::{Path, PathBuf};

/// A recording for the rerun viewer, with a layout for navigation runs: `rerun run.rrd` shows it.
/// The file is always written; a viewer can watch besides.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rerun {
    /// The file, from the output folder.
    pub path: PathBuf,
    /// Address of a running viewer that shows the run while it goes on: "127.0.0.1:9876".
    pub connect: Option<String>,
    /// Start the viewer and show the run in it while it goes on. Its program is `rerun`, or the one
    /// that RERUN_BIN names.
    pub spawn: bool,
    /// Show the run in a browser: `true` for http://127.0.0.1:9090, or an address and port. It needs a
    /// program built with the feature `serve`.
    pub serve: Serve,
    /// Record the samples of driving and reference sensors too; those of measuring sensors always
    /// are.
    pub samples: bool,
}

/// The address at which the run is shown in a browser.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Serve {
    /// `true`: 127.0.0.1:9090; `false`: no address.
    Local(bool),
    /// That address and port.
    At(String),
}

impl Default for Rerun {
    fn default() -> Self {
        Self {
            path: "run.rrd".into(),
            connect: None,
            spawn: false,
            serve: Serve::Local(false),
            samples: false,
        }
    }
}

impl Rerun {
    /// Opens the recording in the folder `output`, and connects the viewers; `tabs` stand beside
    /// those of the run.
    ///
    /// # Errors
    /// When the file cannot be written, an address is wrong, or a viewer does not answer.
    pub fn record(
        self,
        output: &Path,
        tabs: Vec<Box<dyn Tab>>,
    ) -> Result<Box<dyn Sink>, StreamError> {
        let serve = match self.serve {
            Serve::Local(yes) => yes.then_some(Live::LOCAL),
            Serve::At(address) => Some(address.parse().map_err(|cause: AddrParseError| {
                StreamError::network(format!("{address:?} is not an address and port"))
                    .at_key("serve")
                    .with_remedy("write it as \"127.0.0.1:9090\"")
                    .with_source(cause)
            })?),
        };
        let live = Live { connect: self.connect, spawn: self.spawn, serve };
        let recording = Recording::open(output.join(self.path), &live)?;
        Ok(Box::new(sink::RerunSink::new(recording, self.samples, tabs)))
    }
}

impl SinkType for Rerun {
    const TYPE: &'static str = "rerun";

    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        self.record(&context.output, Vec::new())
    }
}

/// Registers the sink type `rerun`.
#[derive(Clone, Copy, Debug)]
pub struct RerunPlugin;

impl Plugin for RerunPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sink::<Rerun>();
    }

    navfuse_core::named_after_crate!();
}
