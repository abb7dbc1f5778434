//! Estimates of the fixed blocks that sensors read.

use super::calibration::Calibration;
use super::contain::Containment;
use super::effect::{Effect, WIDE, Whitened};
use super::lanes::Seen;
use crate::checkpoint::saved;
use crate::model::record::Corrected;
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::time::Time;
use std::ops::Range;

/// Correction of fixed blocks that were found to be wrong.
pub(in crate::filter) struct Correction {
    /// What their errors have moved the state by.
    pub(in crate::filter) delta: Vec<f64>,
    /// Set if one was found just now, or its estimate has changed by more than its sigma: what other tests have
    /// seen is in part the effect of that.
    pub(in crate::filter) news: bool,
}

/// What an error of the components of a block has moved a row of the state by.
pub(super) fn moved(
    effects: &[Effect<WIDE>],
    components: Range<usize>,
    a: &[f64],
    row: usize,
) -> f64 {
    let of = components.zip(a);
    of.map(|(k, a)| a * f64::from(effects[k / WIDE].s[row][k % WIDE])).sum()
}

/// The estimates.
#[derive(Clone, Default)]
pub(super) struct Calibrations {
    blocks: Vec<Calibration>,
    /// Set while corrections are due.
    due: bool,
}

saved!(Calibrations { blocks, due });

impl Calibrations {
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(super) fn add(&mut self, components: Range<usize>) {
        self.blocks.push(Calibration::new(components));
    }

    pub(super) fn blocks(&self) -> &[Calibration] {
        &self.blocks
    }

    /// Returns `true` for a component of a block that is corrected.
    pub(super) fn corrects(&self, component: usize) -> bool {
        self.blocks.iter().any(|block| block.corrects && block.components().contains(&component))
    }

    /// Takes a sample with the sensitivities `f` to the components of a chunk, and with `L^-1 f` and `L^-1 g`.
    pub(super) fn take(
        &mut self,
        chunk: Range<usize>,
        f: &Seen<WIDE>,
        white: [&Seen<WIDE>; 2],
        sample: &Whitened<'_>,
    ) {
        let own = |block: &&mut Calibration| chunk.contains(&block.components().start);
        for block in self.blocks.iter_mut().filter(own) {
            block.take(block.components().start - chunk.start, f, white, sample);
        }
    }

    /// Ends a span.
    pub(super) fn measure(&mut self) {
        self.blocks.iter_mut().for_each(Calibration::measure);
        self.due = self.blocks.iter().any(|block| block.corrects);
    }

    /// Begins to correct the block of a component that is wrong by a size. The others begin again: what they have is
    /// in part the effect of this one.
    pub(super) fn begin(&mut self, component: usize, size: f64, time: Time) {
        for block in self.blocks.iter_mut().filter(|block| !block.corrects) {
            if block.components().contains(&component) {
                *block = block.usual(size);
                (block.corrects, block.since) = (true, time);
            } else {
                block.forget();
            }
        }
        self.due = true;
    }

    /// Returns the corrections that are due, by component, and whether they are news.
    pub(super) fn due(&mut self) -> Option<(Vec<(usize, f64)>, bool)> {
        if !std::mem::take(&mut self.due) {
            return None;
        }
        let (mut due, mut news) = (Vec::new(), false);
        for block in self.blocks.iter_mut().filter(|block| block.corrects) {
            let (changes, moves) = block.correct();
            due.extend(block.components().zip(changes));
            news |= moves;
        }
        Some((due, news))
    }

    /// The blocks that are corrected; `of` is that of a component.
    pub(super) fn corrected<'a>(
        &self,
        state: &State,
        of: impl Fn(usize) -> &'a Block,
    ) -> Vec<Corrected> {
        let blocks = self.blocks.iter().filter(|block| block.corrects);
        let corrected =
            |b: &Calibration| Corrected::new(of(b.components().start), state, b.since, b.spread());
        blocks.filter_map(corrected).collect()
    }

    /// Widens the covariance where it does not contain what is not known of the blocks that are corrected.
    pub(super) fn contain(
        &self,
        effects: &[Effect<WIDE>],
        covariance: &mut Covariance,
        containment: &mut Containment,
    ) {
        for block in self.blocks.iter().filter(|block| block.corrects) {
            for share in block.spread() {
                let moved = |row: usize| moved(effects, block.components(), &share, row);
                containment.contain_along(moved, 1.0, covariance);
            }
        }
    }
}
