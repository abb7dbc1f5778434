//! The rerun viewer for navfuse: the sink `rerun` with the tabs *Observability* and *Quality*, and figures as
//! recordings.
//!
//! The tabs add to the entities of [`navfuse_rerun`]:
//!
//! | entity | content |
//! |---|---|
//! | `/observability/OWNER/BLOCK/COMPONENT` | bits gained as a state: how many times sigma was halved |
//! | `/observability/verdicts` | which states the run determines, and what is missing |
//! | `/quality/SENSOR/CHANNEL/distribution`, `autocorrelation` | innovations over their sigma: a histogram beside the normal distribution, and their correlation |
//! | `/quality/separation/BLOCK` | of a smoothed run: filter minus smoother over the sigma of their difference |
//! | `/quality/opposed/COMPONENT` | of a smoothed run: the estimate from before each time minus that from after it |
//! | `/quality/information/BLOCK` | the share of each sensor in the information about a block of the state |

pub mod figures;
mod observability;
mod quality;

pub use navfuse_rerun::viewer;
pub use observability::Observability;
pub use quality::Quality;

use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::plugin::{OpenContext, Plugin, Registry, SinkType};
use navfuse_rerun::{Rerun, Serve, Tab};
use schemars::JsonSchema;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A recording for the rerun viewer, with a layout for navigation runs: `rerun run.rrd` shows it.
/// The file is always written; a viewer can watch besides.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Viewer {
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
    /// Follow what the run determines of each state, and what is missing.
    pub observability: bool,
}

impl Default for Viewer {
    fn default() -> Self {
        let Rerun { path, connect, spawn, serve, samples, full } = Rerun::default();
        Self { path, connect, spawn, serve, samples, full, observability: true }
    }
}

impl Viewer {
    /// Opens the recording in the folder `output`, and connects the viewers.
    ///
    /// # Errors
    /// When the file cannot be written, an address is wrong, or a viewer does not answer.
    pub fn record(self, output: &Path) -> Result<Box<dyn Sink>, StreamError> {
        let Self { path, connect, spawn, serve, samples, full, observability } = self;
        let mut tabs: Vec<Box<dyn Tab>> = Vec::new();
        let shares = Arc::default();
        if observability {
            tabs.push(Box::new(Observability::handing_over(Arc::clone(&shares))));
        }
        tabs.push(Box::new(Quality::with_shares(shares)));
        Rerun { path, connect, spawn, serve, samples, full }.record(output, tabs)
    }
}

impl SinkType for Viewer {
    const TYPE: &'static str = Rerun::TYPE;

    fn files(&self) -> Vec<PathBuf> {
        vec![self.path.clone()]
    }

    fn open(self, context: &OpenContext<'_>) -> Result<Box<dyn Sink>, StreamError> {
        self.record(&context.output)
    }
}

/// Registers the sink type `rerun`, in the place of [`navfuse_rerun::RerunPlugin`].
#[derive(Clone, Copy, Debug)]
pub struct ViewerPlugin;

impl Plugin for ViewerPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sink::<Viewer>();
    }

    navfuse_core::named_after_crate!();
}
