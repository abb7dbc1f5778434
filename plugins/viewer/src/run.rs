//! The series of a run.

use crate::innovation::SensorSeries;
use crate::lane::SensorLane;
use crate::samples::SampleSeries;
use crate::state::BlockSeries;
use crate::track::Motion;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::sensor::Accuracy;

/// The series of a run, from which the layout is made.
pub struct Run {
    /// The name of the scenario.
    pub name: String,
    /// The blocks that have an uncertainty.
    pub blocks: Vec<BlockSeries>,
    /// The sensors that correct the state.
    pub sensors: Vec<SensorSeries>,
    /// The samples that are recorded.
    pub samples: Vec<SampleSeries>,
    /// The health of the sensors.
    pub lanes: Vec<SensorLane>,
    /// The track, where there is a position.
    pub track: Option<Motion>,
    /// Set where every source simulates its samples: otherwise the truth is a recorded reference.
    pub simulated: bool,
    /// 1-sigma of a recorded reference.
    pub reference: Option<Accuracy>,
    /// Set for a run that is smoothed.
    pub smoothed: bool,
    /// The component with the largest error in sigma, once the run is over.
    pub worst: Option<(usize, usize)>,
    /// The heaviest finding of each part.
    pub findings: Vec<Finding>,
    /// The first and the last time of an epoch, ns.
    pub span: Option<(i64, i64)>,
    /// Place of each sensor, by its id, among those above.
    pub places: Vec<Places>,
}

/// Places of a sensor among the series.
#[derive(Clone, Copy, Default)]
pub struct Places {
    pub series: Option<usize>,
    pub samples: Option<usize>,
    pub lane: Option<usize>,
    pub mount: Option<usize>,
    pub body: Option<usize>,
}
