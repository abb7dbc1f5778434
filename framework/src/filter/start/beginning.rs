//! What a filter knows of its start.

use super::stage::Stage;
use crate::checkpoint::{Io, Saved};
use crate::compose::Composition;
use crate::compose::draw::Draw;
use crate::model::process::start::{AlignmentReport, InitialAlignment};
use crate::model::simulate::Random;
use crate::units::sample::Sample;
use crate::units::time::Time;

/// Stage of a filter, its initial draws and its alignments.
#[derive(Clone)]
pub(in crate::filter) struct Beginning {
    pub(super) stage: Stage,
    pub(super) draws: Option<Random>,
    /// Initial alignments, one place per process.
    pub(super) alignments: Vec<Option<Box<dyn InitialAlignment>>>,
    /// Slot of a block without an initial value, which the latest reference did not give either.
    pub(super) lacking: Option<usize>,
}

// the initial draws of a build follow again from their seed
impl Saved for Beginning {
    fn saved(&mut self, io: &mut Io<'_>) {
        let Self { stage, draws: _, alignments, lacking } = self;
        io.pass(stage);
        io.pass(lacking);
        alignments.iter_mut().for_each(|alignment| io.each(alignment));
    }
}

impl Beginning {
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        let start = composition.start();
        let from_reference = composition.estimator.from_reference();
        let draws = composition.estimator.draw != Draw::Nothing;
        Self {
            stage: if from_reference { Stage::FromReference(start) } else { Stage::At(start) },
            draws: draws.then(|| Random::new(composition.seed, "initial")),
            alignments: composition.processes.iter().map(|p| p.alignment.clone()).collect(),
            lacking: None,
        }
    }

    /// Returns `true` once the filter runs.
    pub(in crate::filter) fn runs(&self) -> bool {
        matches!(self.stage, Stage::Running)
    }

    /// Returns `true` while an alignment searches for the initial values.
    pub(in crate::filter) fn searches(&self) -> bool {
        matches!(self.stage, Stage::Searching(_))
    }

    /// Returns `true` if the initial values are found, and the filter begins with the next sample.
    pub(in crate::filter) fn has_found(&self) -> bool {
        matches!(self.stage, Stage::Found(_))
    }

    /// Returns `true` until the filter begins, or the search for its initial values.
    pub(in crate::filter) fn waits(&self) -> bool {
        matches!(self.stage, Stage::At(_) | Stage::FromReference(_))
    }

    /// Returns `true` if a driving sample of this time starts the filter, or a measurement if no
    /// sensor drives.
    pub(in crate::filter) fn is_due(&self, time: Time) -> bool {
        matches!(self.stage, Stage::At(start) if time >= start)
    }

    /// Slot of a block without an initial value for which the filter waits.
    pub(in crate::filter) fn lacking(&self) -> Option<usize> {
        self.lacking
    }

    /// Samples of a search that has just ended.
    pub(in crate::filter) fn take_found(&mut self) -> Option<Vec<Sample>> {
        match &mut self.stage {
            Stage::Found(samples) if !samples.is_empty() => Some(std::mem::take(samples)),
            _ => None,
        }
    }

    /// Reports of the alignments, each with the index of its process.
    pub(in crate::filter) fn reports(&self) -> impl Iterator<Item = (usize, AlignmentReport)> + '_ {
        let alignments = self.alignments.iter().enumerate();
        alignments.filter_map(|(k, alignment)| Some((k, alignment.as_ref()?.report()?)))
    }
}
