//! Snapshots of an estimator.

use crate::checkpoint::{Io, Saved};
use crate::state::State;
use std::any::Any;

/// State of a filter that its snapshot keeps.
///
/// ```
/// use navfuse_core::compose::snapshot::{Kept, Snapshot};
/// use navfuse_core::state::State;
/// /// A filter whose whole memory is its estimate.
/// #[derive(Clone)]
/// struct Estimate(State);
/// impl Kept for Estimate {
///     fn boxed_clone(&self) -> Box<dyn Kept> {
///         Box::new(self.clone())
///     }
///     fn state(&self) -> &State {
///         &self.0
///     }
///     fn offset(&self) -> &[f64] {
///         &[]
///     }
///     fn size(&self) -> usize {
///         size_of_val(&self.0.values[..])
///     }
/// }
/// fn snapshot(estimate: &Estimate) -> Snapshot {
///     Snapshot::new(estimate.clone())
/// }
/// ```
pub trait Kept: Any + Send {
    /// Copies it.
    fn boxed_clone(&self) -> Box<dyn Kept>;
    /// Estimate of the filter.
    fn state(&self) -> &State;
    /// Estimate relative to a given trajectory; empty without one.
    fn offset(&self) -> &[f64];
    /// Approximate size, bytes.
    fn size(&self) -> usize;
    /// Saves or restores the state in a checkpoint. Default: refuses.
    fn memory(&mut self, io: &mut Io<'_>) {
        io.refuse("its estimator keeps its state to itself (Kept::memory)");
    }
}

/// A complete estimator at one time, to return to.
pub struct Snapshot {
    kept: Box<dyn Kept>,
    own: Vec<u8>,
}

impl Clone for Snapshot {
    fn clone(&self) -> Self {
        Self { kept: self.kept.boxed_clone(), own: self.own.clone() }
    }
}

impl Saved for Snapshot {
    fn saved(&mut self, io: &mut Io<'_>) {
        self.kept.memory(io);
        io.part("estimator", |io| io.pass(&mut self.own));
    }
}

impl std::fmt::Debug for Snapshot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "snapshot at {}", self.state().time)
    }
}

impl Snapshot {
    /// Snapshot of a filter.
    pub fn new(kept: impl Kept) -> Self {
        Self { kept: Box::new(kept), own: Vec::new() }
    }

    /// The snapshot with what an estimator on top of the filter keeps, in its own coding.
    #[must_use]
    pub fn with(self, own: &[u8]) -> Self {
        Self { own: own.to_vec(), ..self }
    }

    /// What the estimator on top of the filter keeps.
    pub fn own(&self) -> &[u8] {
        &self.own
    }

    /// State of the filter, if it is a filter of that type.
    pub fn kept<K: Kept>(&self) -> Option<&K> {
        let kept: &dyn Any = self.kept.as_ref();
        kept.downcast_ref()
    }

    /// The same, to be changed.
    pub fn kept_mut<K: Kept>(&mut self) -> Option<&mut K> {
        let kept: &mut dyn Any = self.kept.as_mut();
        kept.downcast_mut()
    }

    /// Estimate at the time of the snapshot.
    pub fn state(&self) -> &State {
        self.kept.state()
    }

    /// Estimate relative to the state in a further pass of the smoother; empty otherwise.
    pub(crate) fn offset(&self) -> &[f64] {
        self.kept.offset()
    }

    /// Approximate size, bytes.
    pub(crate) fn size(&self) -> usize {
        self.kept.size() + self.own.len()
    }
}
