//! The damage of a bag: what was skipped, with offsets and numbers.

use navfuse_frames::Count;

/// The parts of a bag that could not be read. An offset counts from the beginning of the first
/// file.
#[derive(Clone, Debug, Default)]
pub struct Faults {
    /// Chunks whose checksum differs, or that do not unpack.
    pub chunks: Count,
    /// Places at which no record begins, and the bytes from there to the next record.
    pub places: Count,
    /// Number of these bytes.
    pub bytes: u64,
    /// Pages of a table that are damaged or missing.
    pub pages: Count,
    /// Rows and records whose content contradicts itself.
    pub records: Count,
    /// Messages of a channel that was never described.
    pub strangers: Count,
    /// Offset at which a file ends too early.
    pub cuts: Vec<u64>,
    /// Other notes.
    pub notes: Vec<String>,
}

impl Faults {
    /// Describes the faults; `None` if there are none.
    pub fn describe(&self) -> Option<String> {
        let mut parts = self.notes.clone();
        parts.extend(self.chunks.describe("chunk", "skipped, damaged,"));
        if let Some(places) = self.places.describe("place", "without an intact record") {
            parts.push(format!("{places}, {} bytes skipped", self.bytes));
        }
        parts.extend(self.pages.describe("page", "of a table skipped, damaged or missing,"));
        parts.extend(self.records.describe("record", "skipped, contradictory,"));
        parts.extend(self.strangers.describe("message", "skipped, of a channel without a name,"));
        let cut = |at: &u64| format!("cut off at byte {at}; everything before was read");
        parts.extend(self.cuts.iter().map(cut));
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}
