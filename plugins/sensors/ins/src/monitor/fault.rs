//! What a rule of the monitor has found.

use navfuse_core::model::record::finding::{Basis, Severity};

/// A contradiction: its severity, the evidence and the remedy.
pub(super) struct Fault {
    pub(super) severity: Severity,
    pub(super) basis: Basis,
    pub(super) text: String,
    pub(super) remedy: &'static str,
}
