//! How the steps of a pool carry the noise of those before them: see [`super::pool`].

/// The noise of a pool beside the sum of its steps. Of a single step, nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Carried {
    /// Share of `Q` that comes before `Phi`; the rest comes after it.
    pub(super) early: f64,
    /// `(row, column)` of further elements after it, and their values, which are those on the other side of
    /// the diagonal too.
    pub(super) places: Vec<(usize, usize)>,
    pub(super) values: Vec<f64>,
}
