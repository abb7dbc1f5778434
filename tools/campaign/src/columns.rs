//! Columns of the tables: the uncertain components of a state, its blocks and its sensors.

use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::sensor::Sensor;
use navfuse_core::state::Layout;
use serde::{Deserialize, Serialize};

/// One component of a state block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Component {
    /// Name of its block: `dvl.scale`.
    pub state: String,
    /// Name of the component: `roll`, `north`.
    pub component: String,
    /// Unit of error and sigma; empty for a ratio.
    pub unit: String,
}

impl Component {
    /// Returns the full name: `ins.attitude.yaw`.
    pub fn name(&self) -> String {
        format!("{}.{}", self.state, self.component)
    }

    /// Returns the full name with the unit.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name() } else { format!("{} [{}]", self.name(), self.unit) }
    }
}

/// One state block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockColumns {
    /// Full name.
    pub name: String,
    /// Number of components.
    pub dimension: usize,
    /// Set if the truth of the block, and so its error, is known.
    pub known: bool,
}

/// All columns, in the order of the tables.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Columns {
    /// Every component of every uncertain block.
    pub components: Vec<Component>,
    /// Uncertain blocks.
    pub blocks: Vec<BlockColumns>,
    /// Sensors that update the state.
    pub sensors: Vec<String>,
}

/// Position of a layout's blocks and sensors in the columns.
#[derive(Clone, Debug)]
pub struct Places {
    /// For each uncertain block: its slot, its index among the blocks, and its first component.
    pub blocks: Vec<(usize, usize, usize)>,
    /// For each sensor of the composition: its index among the sensors that update the state.
    pub sensors: Vec<Option<usize>>,
}

impl Columns {
    /// Adds the blocks and sensors of a composition that the columns lack.
    pub fn add(&mut self, composition: &Composition) {
        let known = composition.known();
        for (block, known) in
            composition.layout.blocks.iter().zip(known).filter(|(b, _)| b.tangent.is_some())
        {
            if self.blocks.iter().any(|b| b.name == block.name) {
                continue;
            }
            let dimension = block.operations.tangent;
            self.blocks.push(BlockColumns { name: block.name.clone(), dimension, known });
            self.components.extend((0..dimension).map(|k| Component {
                state: block.name.clone(),
                component: block.component(k),
                unit: block.spec.display.unit.to_owned(),
            }));
        }
        // a constraint has no noise of a sensor: a vehicle at rest moves less than the constraint
        // allows, so its NIS is too small by design
        let measures = |s: &&Sensor| s.info.purpose == Purpose::Measurement && !s.constraint;
        for sensor in composition.sensors.iter().filter(measures) {
            if !self.sensors.contains(&sensor.info.name) {
                self.sensors.push(sensor.info.name.clone());
            }
        }
    }

    /// Returns the number of components with a known error: the degrees of freedom of the whole
    /// state's NEES.
    pub fn known(&self) -> usize {
        self.blocks.iter().filter(|b| b.known).map(|b| b.dimension).sum()
    }

    /// Returns the range of a block's components.
    pub fn of_block(&self, index: usize) -> std::ops::Range<usize> {
        let first = self.blocks[..index].iter().map(|b| b.dimension).sum();
        first..first + self.blocks[index].dimension
    }

    /// Finds the blocks of a layout and its sensors in the columns.
    pub fn places<'a>(&self, layout: &Layout, sensors: impl Iterator<Item = &'a str>) -> Places {
        let uncertain = layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
        let place = |name: &str| self.blocks.iter().position(|b| b.name == name);
        let blocks = uncertain
            .filter_map(|(slot, b)| place(&b.name).map(|at| (slot, at, self.of_block(at).start)));
        Places {
            blocks: blocks.collect(),
            sensors: sensors.map(|name| self.sensors.iter().position(|s| s == name)).collect(),
        }
    }
}
