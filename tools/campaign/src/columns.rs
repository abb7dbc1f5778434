//! What is compared: the uncertain components of a state, its blocks and its sensors.

use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::sensor::Sensor;
use navfuse_core::state::Layout;
use navfuse_core::state::manifold::Reading;
use serde::{Deserialize, Serialize};

/// One number of a state block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Component {
    /// Its block: `dvl.scale`.
    pub state: String,
    /// Its name: `roll`, `north`.
    pub component: String,
    /// The unit of error and sigma; empty for a ratio.
    pub unit: String,
}

impl Component {
    /// `ins.attitude.yaw`, or the state alone where it has one component.
    pub fn name(&self) -> String {
        format!("{}.{}", self.state, self.component)
    }

    /// Name and unit for a person.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.name() } else { format!("{} [{}]", self.name(), self.unit) }
    }
}

/// One state block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockColumns {
    /// Its full name.
    pub name: String,
    /// The number of its components.
    pub dimension: usize,
    /// Whether its truth is known, so that its error is.
    pub known: bool,
}

/// All that is compared, in the order of the tables.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Columns {
    /// Every component of every uncertain block.
    pub components: Vec<Component>,
    /// The uncertain blocks.
    pub blocks: Vec<BlockColumns>,
    /// The sensors that correct the state.
    pub sensors: Vec<String>,
}

/// Where a layout's blocks stand in the columns.
#[derive(Clone, Debug)]
pub struct Places {
    /// For each uncertain block: its slot, its number among the blocks, and its first component.
    pub blocks: Vec<(usize, usize, usize)>,
    /// For each sensor of the composition: its number among those that correct the state.
    pub sensors: Vec<Option<usize>>,
}

impl Columns {
    /// Adds what a composition has and the columns do not have yet.
    pub fn add(&mut self, composition: &Composition) {
        let known = composition.known();
        for (block, known) in
            composition.layout.blocks.iter().zip(known).filter(|(b, _)| b.tangent.is_some())
        {
            if self.blocks.iter().any(|b| b.name == block.name) {
                continue;
            }
            let names = match block.operations.reading {
                Reading::Tangent => &["north", "east", "down"],
                _ => block.spec.display.components,
            };
            let dimension = block.operations.tangent;
            self.blocks.push(BlockColumns { name: block.name.clone(), dimension, known });
            self.components.extend((0..dimension).map(|k| Component {
                state: block.name.clone(),
                component: names.get(k).map_or_else(|| k.to_string(), |n| (*n).to_owned()),
                unit: block.spec.display.unit.to_owned(),
            }));
        }
        // a constraint is no sensor with a noise: a vehicle at rest is slower than the constraint allows it to be
        let measures = |s: &&Sensor| s.info.purpose == Purpose::Measurement && !s.constraint;
        for sensor in composition.sensors.iter().filter(measures) {
            if !self.sensors.contains(&sensor.info.name) {
                self.sensors.push(sensor.info.name.clone());
            }
        }
    }

    /// The number of components whose error is known: the degrees of freedom of the whole state's NEES.
    pub fn known(&self) -> usize {
        self.blocks.iter().filter(|b| b.known).map(|b| b.dimension).sum()
    }

    /// The components of a block.
    pub fn of_block(&self, index: usize) -> std::ops::Range<usize> {
        let first = self.blocks[..index].iter().map(|b| b.dimension).sum();
        first..first + self.blocks[index].dimension
    }

    /// Where a layout and its sensors stand in them.
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
