//! The bytes of a stream that belong to no intact frame.

use std::fmt::Write;

/// Largest number of gaps that are kept with their offsets.
const LISTED: usize = 4;

/// Bytes between two intact frames that belong to no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Offset of the first of them in the stream.
    pub offset: u64,
    /// Their number, without the bytes that may stand between frames.
    pub bytes: u64,
    /// Set if a checksum differs within the gap.
    pub checksum: bool,
}

/// The count of skipped bytes, beside that of the bytes in intact frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Damage {
    intact: u64,
    gaps: u64,
    bytes: u64,
    checksums: u64,
    first: Vec<Gap>,
    /// The gap that no intact frame has closed yet.
    open: Option<Gap>,
    /// Offset of the first mark in the open gap whose frame the stream's end cuts off.
    unfinished: Option<u64>,
}

impl Damage {
    /// Number of bytes in intact frames.
    pub fn intact_bytes(&self) -> u64 {
        self.intact
    }

    /// Number of gaps.
    pub fn gaps(&self) -> u64 {
        self.gaps + u64::from(self.open.is_some_and(|g| g.bytes > 0))
    }

    /// Number of skipped bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes + self.open.map_or(0, |g| g.bytes)
    }

    /// Number of gaps in which a checksum differs.
    pub fn checksums(&self) -> u64 {
        self.checksums + u64::from(self.open.is_some_and(|g| g.checksum))
    }

    /// The first gaps.
    pub fn first(&self) -> impl Iterator<Item = Gap> + '_ {
        let open = self.open.filter(|g| g.bytes > 0 && self.first.len() < LISTED);
        self.first.iter().copied().chain(open)
    }

    /// Offset of the frame that the end of the stream cuts off.
    pub fn cut(&self) -> Option<u64> {
        self.unfinished
    }

    /// Describes the damage with offsets and counts, where `frame` is the format's word for a
    /// frame; `None` if there is none.
    pub fn describe(&self, frame: &str) -> Option<String> {
        if self.gaps() == 0 {
            return None;
        }
        let plural = |n: u64, noun: &str| {
            if n == 1 { format!("1 {noun}") } else { format!("{n} {noun}s") }
        };
        let (gaps, bytes) = (self.gaps(), self.bytes());
        let mut text = format!(
            "skipped {} in {} that {} no intact {frame}",
            plural(bytes, "byte"),
            plural(gaps, "place"),
            if gaps == 1 { "holds" } else { "hold" }
        );
        let mut separator = " (";
        for gap in self.first() {
            let cause = if gap.checksum { ", wrong checksum" } else { "" };
            let size = plural(gap.bytes, "byte");
            let _ = write!(text, "{separator}at byte {}: {size}{cause}", gap.offset);
            separator = "; ";
        }
        let more = if gaps > LISTED as u64 { "; ..." } else { "" };
        let _ = write!(text, "{more})");
        if self.checksums() > 0 {
            let _ = write!(text, "; wrong checksums in {}", plural(self.checksums(), "place"));
        }
        if let Some(offset) = self.cut() {
            let _ = write!(text, "; the file ends within the {frame} at byte {offset}");
        }
        Some(text)
    }

    /// An intact frame follows.
    pub(crate) fn intact(&mut self, bytes: u64) {
        self.intact += bytes;
        self.unfinished = None;
        if let Some(gap) = self.open.take().filter(|g| g.bytes > 0) {
            self.close(gap);
        }
    }

    /// One byte is skipped.
    pub(crate) fn skipped(&mut self, offset: u64) {
        self.open_at(offset).bytes += 1;
    }

    /// The checksum of a possible frame differs.
    pub(crate) fn checksum(&mut self, offset: u64) {
        self.open_at(offset).checksum = true;
    }

    /// The stream ends within a possible frame.
    pub(crate) fn unfinished(&mut self, offset: u64) {
        self.unfinished.get_or_insert(offset);
    }

    /// A whole frame is damage.
    pub(crate) fn whole(&mut self, offset: u64, bytes: u64) {
        self.intact -= bytes;
        self.close(Gap { offset, bytes, checksum: false });
    }

    fn open_at(&mut self, offset: u64) -> &mut Gap {
        self.open.get_or_insert(Gap { offset, bytes: 0, checksum: false })
    }

    fn close(&mut self, gap: Gap) {
        self.gaps += 1;
        self.bytes += gap.bytes;
        self.checksums += u64::from(gap.checksum);
        if self.first.len() < LISTED {
            self.first.push(gap);
        }
    }
}
