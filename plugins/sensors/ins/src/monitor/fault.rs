//! What a rule of the monitor has found.

use navfuse_core::model::record::finding::{Basis, Finding, Severity};
use navfuse_core::units::time::Time;

/// A contradiction: its severity, the evidence and the remedy.
pub(super) struct Fault {
    pub(super) severity: Severity,
    pub(super) basis: Basis,
    pub(super) text: String,
    pub(super) remedy: String,
}

impl Fault {
    /// Finding about a part, at a time.
    pub(super) fn about(self, time: Time, about: String) -> Finding {
        let Self { severity, basis, text, remedy } = self;
        Finding { time, about, severity, basis, text, remedy }
    }
}
