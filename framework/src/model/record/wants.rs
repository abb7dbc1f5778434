//! The records that a sink receives, and the choice among them.

use crate::model::record::finding::Finding;
use crate::model::record::verdict::Verdict;
use crate::model::record::{Derived, Epoch, Event, InputRejection, Repetition, UpdateRecord};
use crate::state::covariance::{Transition, Update};
use crate::units::sample::Sample;
use std::ops::BitOr;

/// A record of a run, as sinks receive it. Each kind has its flag in [`Wants`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Record<'a> {
    /// A sample, in the order in which the estimator processes it.
    Sample(&'a Sample),
    /// An estimate, at the output rate. In a run that is smoothed it is the smoothed one: all of
    /// them come after the last sample, update and event of the filter, or with a fixed lag once
    /// the filter is the lag ahead.
    Epoch(&'a Epoch<'a>),
    /// The estimate after all samples that have arrived, at the output rate and at once after the
    /// sample. Another sample of that time may still change it, or a late one (`late`);
    /// [`Self::Epoch`] is the final estimate of that time once no sample can.
    Newest(&'a Epoch<'a>),
    /// The filter's own estimate in a run that is smoothed, when the filter makes it.
    Filtered(&'a Epoch<'a>),
    /// A measurement was accepted, gated or rejected.
    Update(&'a UpdateRecord<'a>),
    /// A sample of a driving sensor was rejected.
    InputRejection(&'a InputRejection),
    /// The error state moved: see [`crate::model::record::Observer::transition`].
    Transition(&'a Transition),
    /// A measurement corrected the state: see [`crate::model::record::Observer::correction`].
    Correction(&'a Update),
    /// A filter took its samples again: see [`crate::model::record::Observer::repetition`].
    Repetition(Repetition<'a>),
    /// An event for the log.
    Event(&'a Event),
    /// A fault that the filter or a monitor found.
    Finding(&'a Finding),
    /// A quantity that a sink derives: see [`crate::model::stream::Sink::derive`].
    Derived(&'a Derived),
    /// The verdict of the run, after everything else.
    Verdict(&'a Verdict),
}

impl Record<'_> {
    /// The flag of the record's kind.
    pub fn kind(&self) -> Wants {
        match self {
            Self::Sample(_) => Wants::SAMPLES,
            Self::Epoch(_) => Wants::EPOCHS,
            Self::Newest(_) => Wants::NEWEST,
            Self::Filtered(_) => Wants::FILTERED,
            Self::Update(_) => Wants::UPDATES,
            Self::InputRejection(_) => Wants::INPUT_REJECTIONS,
            Self::Transition(_) => Wants::TRANSITIONS,
            Self::Correction(_) => Wants::CORRECTIONS,
            Self::Repetition(_) => Wants::REPETITIONS,
            Self::Event(_) => Wants::EVENTS,
            Self::Finding(_) => Wants::FINDINGS,
            Self::Derived(_) => Wants::DERIVED,
            Self::Verdict(_) => Wants::VERDICT,
        }
    }
}

/// The kinds of records that a sink receives; a run spends nothing on the others.
///
/// The default is every record that costs nothing to make: all but the newest estimates, comparisons,
/// transitions, corrections and repetitions.
///
/// ```
/// use navfuse_core::model::record::Wants;
/// let wants = Wants::default() | Wants::COMPARISONS;
/// assert!(wants.contains(Wants::EPOCHS | Wants::COMPARISONS));
/// assert!(!wants.contains(Wants::TRANSITIONS));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wants(u16);

impl Wants {
    /// No record.
    pub const NOTHING: Self = Self(0);
    /// [`Record::Sample`].
    pub const SAMPLES: Self = Self(1);
    /// [`Record::Epoch`].
    pub const EPOCHS: Self = Self(1 << 1);
    /// A [`Record::Epoch`] at every sample of a reference, even where these come faster than the
    /// output rate: for a sink that judges the estimates.
    pub const COMPARISONS: Self = Self(1 << 2);
    /// [`Record::Newest`]: for a display or a controller.
    pub const NEWEST: Self = Self(1 << 3);
    /// [`Record::Filtered`].
    pub const FILTERED: Self = Self(1 << 4);
    /// [`Record::Update`].
    pub const UPDATES: Self = Self(1 << 5);
    /// [`Record::InputRejection`].
    pub const INPUT_REJECTIONS: Self = Self(1 << 6);
    /// [`Record::Transition`].
    pub const TRANSITIONS: Self = Self(1 << 7);
    /// [`Record::Correction`].
    pub const CORRECTIONS: Self = Self(1 << 8);
    /// [`Record::Repetition`], and the transitions and corrections of each repetition: for a sink
    /// that follows a filter through it.
    pub const REPETITIONS: Self = Self(1 << 9);
    /// [`Record::Event`].
    pub const EVENTS: Self = Self(1 << 10);
    /// [`Record::Finding`].
    pub const FINDINGS: Self = Self(1 << 11);
    /// [`Record::Verdict`].
    pub const VERDICT: Self = Self(1 << 12);

    /// [`Record::Derived`].
    pub const DERIVED: Self = Self(1 << 13);

    /// Returns `true` if every kind of `other` is among these.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl Default for Wants {
    fn default() -> Self {
        Self::SAMPLES
            | Self::EPOCHS
            | Self::FILTERED
            | Self::UPDATES
            | Self::INPUT_REJECTIONS
            | Self::EVENTS
            | Self::FINDINGS
            | Self::DERIVED
            | Self::VERDICT
    }
}

impl BitOr for Wants {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}
