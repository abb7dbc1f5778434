//! The sink `rerun`: a recording for the [rerun](https://rerun.io) viewer, laid out for navigation
//! runs.
//!
//! Everything follows from the layout of the state and the sensors' channels: this crate knows no
//! sensor by name. All data is on the timeline `seconds`, the whole seconds of the run's clock, or on `t`, the
//! clock itself, in a short run and in one with every row:
//!
//! | entity | content |
//! |---|---|
//! | `/overview`, `/states` | the verdict and its reasons, the sensors, the states that converged; the errors |
//! | `/health/SENSOR` | used, NIS too large, doubted, gated, rejected, isolated or silent; a space behind the word of a stretch that is too short for it |
//! | `/assessment`, `/colour_legend`, `/clock` | the verdict in its colour; the colours of the health with their words; the time in seconds |
//! | `/plan/estimate`, `/plan/truth` | the tracks from above, with a grid; coloured by sigma |
//! | `/world/estimate`, `/world/truth` | the tracks, north-east-down metres from the start |
//! | `/world/vehicle` | position and attitude over time, with its sensors; `velocity`, `uncertainty` beside it |
//! | `/world/vehicle/beams/SENSOR` | the beams of a sensor, at their length where its samples give it |
//! | `/world/bodies/NAME` | position and attitude of a body beside the vehicle; its track in `/world/tracks/NAME`, `/plan/bodies/NAME`, `/map/bodies/NAME` |
//! | `/map/estimate`, `/map/truth`, `/map/vehicle` | the same in latitude and longitude |
//! | `/world/distances` | distances north and east at the edges of the grid |
//! | `/plan/ellipses`, `/map/ellipses`, `/world/ellipses`, `/world/tube` | 3 sigma along the track, enlarged as the titles name it |
//! | `/map/graticule`, `/map/labels` | lines of equal latitude and longitude; their names and a scale |
//! | `/plan/polar` | lines of equal latitude and longitude around a pole, in the plan |
//! | `/map/coast` | the coastlines within view |
//! | `/state/OWNER/BLOCK/COMPONENT/estimate` | estimate and its bounds of 3 sigma |
//! | `/state/OWNER/BLOCK/COMPONENT/truth` | truth, where it is known |
//! | `/state/OWNER/BLOCK/COMPONENT/error` | estimate minus truth, bounds of 3 sigma about zero |
//! | `/state/OWNER/BLOCK/COMPONENT/sigma` | decimal logarithms of the size of the error and of sigma |
//! | `/innovation/SENSOR/CHANNEL/accepted` | innovation; beside it `bounds` of 3 sigma and `gated` |
//! | `/innovation/SENSOR/nis/accepted` | decimal logarithm of the NIS per channel; beside it `limits` with the mean, `gated`, `rejected` |
//! | `/innovation/SENSOR/CHANNEL/abandoned`, `/innovation/SENSOR/nis/abandoned` | shades of the time in which samples were refused |
//! | `/samples/SENSOR/CHANNEL` | the samples |
//! | `/events`, `/scenario` | the log, and the scenario in TOML |
//!
//! Values are in units that fit the end of the run, such as mm/s; the titles of the plots name
//! them. So the file is written when the run is over. Viewers that watch see `/live/state` and
//! `/live/innovation` before.
//!
//! A [`Tab`] adds entities and a view of its own.
//!
//! The feature `serve` adds the page that shows a run in a browser (key `serve`).

mod arrangement;
mod axis;
mod blueprint;
mod bodies;
mod coast;
pub mod colours;
mod columns;
mod corner;
mod derived;
mod ellipses;
mod eye;
mod file;
mod guides;
mod history;
mod innovation;
mod lane;
mod legend;
mod live;
mod map;
pub mod overlay;
mod overview;
mod plan;
mod plots;
mod polar;
mod quantity;
mod recording;
mod rig;
mod run;
mod samples;
mod scene;
mod serve;
mod shade;
mod sink;
mod state;
pub mod strip;
mod strokes;
pub mod style;
mod tab;
mod tally;
mod time_axis;
mod track;
pub mod viewer;

pub use blueprint::Layout;
pub use columns::{Range, Series};
pub use live::Live;
pub use recording::{Axis, Recording};
pub use tab::Tab;
/// The viewer's library: the version that this crate writes with.
pub use {re_sdk, re_sdk_types};

use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::plugin::{OpenContext, Plugin, Registry, SinkType};
use navfuse_core::run::background::Background;
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
    /// Record the samples of driving and reference sensors too; samples of measuring sensors always
    /// are.
    pub samples: bool,
    /// Record every row. Otherwise a series has at most 1280 rows, which keep its extremes: a plot
    /// has no more pixels.
    pub full: bool,
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
            full: false,
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
        mut tabs: Vec<Box<dyn Tab>>,
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
        tabs.push(Box::new(derived::DerivedTab::default()));
        let sink = sink::RerunSink::new(recording, self.samples, self.full, tabs);
        Ok(Box::new(Background::new(sink)))
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
