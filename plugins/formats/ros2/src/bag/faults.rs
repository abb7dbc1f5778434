//! The damage of a bag: what was skipped, with offsets and numbers.

use navfuse_frames::Count;
use navfuse_frames::mcap::Lost;

/// The parts of a bag that could not be read. An offset counts from the beginning of the first
/// file.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Parts of an MCAP file without an intact record.
    pub lost: Lost,
    /// Pages of a table that are damaged or missing.
    pub pages: Count,
    /// Rows and records whose content contradicts itself.
    pub records: Count,
    /// Messages of a channel that was never described.
    pub strangers: Count,
    /// Other notes.
    pub notes: Vec<String>,
}

impl Faults {
    /// Describes the faults; `None` if there are none.
    pub fn describe(&self) -> Option<String> {
        let mut parts = self.notes.clone();
        parts.extend(self.lost.describe());
        parts.extend(self.pages.describe("page", "of a table skipped, damaged or missing,"));
        parts.extend(self.records.describe("record", "skipped, contradictory,"));
        parts.extend(self.strangers.describe("message", "skipped, of a channel without a name,"));
        let cut = |at: &u64| format!("cut off at byte {at}; everything before was read");
        parts.extend(self.lost.cuts.iter().map(cut));
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
