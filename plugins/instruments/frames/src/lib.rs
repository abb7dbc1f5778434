//! Frames in a stream of bytes.
//!
//! An instrument writes frames: a mark at which a frame begins, its length, its content and a
//! checksum. A real recording has more: it begins within a frame, bytes are lost or changed, other
//! programs write between the frames, and it ends where the disk was full. [`Frames`] finds the
//! intact frames, skips everything else, and counts what it skipped, with offsets. It reads in
//! constant memory.
//!
//! A format implements [`Framing`]. Text formats use [`Sentences`]. [`Clock`] puts the records of
//! an instrument on the clock of the run. [`validity`] knows
//! the numbers that stand for no measurement. [`mcap`] has the outer form of MCAP files, for logs and bags;
//! [`mavlink`] the outer form of MAVLink, for logs and ports.

mod clock;
mod config;
mod damage;
mod file;
pub mod mavlink;
pub mod mcap;
mod number;
mod sentences;
pub mod validity;
mod window;

pub use clock::{Clock, Count, Stamp, Zero};
pub use config::{ChecksumUse, Datum, TimeConfig};
pub use damage::{Damage, Gap};
pub use file::{open, recognise};
pub use number::Number;
pub use sentences::{Check, Sentences, crc8};
pub use window::Window;

use std::io::{Read, Result};

/// Rules by which a format marks, measures and checks its frames.
///
/// ```
/// use navfuse_frames::{Frames, Framing, Judgement, Fault};
/// /// A frame is `#`, its length, and that many bytes.
/// struct Counted;
/// impl Framing for Counted {
///     const MAX: usize = 201;
///     fn find(&self, bytes: &[u8]) -> Option<usize> {
///         bytes.iter().position(|b| *b == b'#')
///     }
///     fn judge(&self, bytes: &[u8]) -> Judgement {
///         match bytes {
///             [_, n, ..] if *n >= 200 => Judgement::Rejected(Fault::Form),
///             [_, n, rest @ ..] if rest.len() >= usize::from(*n) => {
///                 Judgement::Frame(2 + usize::from(*n))
///             }
///             _ => Judgement::Incomplete,
///         }
///     }
/// }
/// let mut frames = Frames::new(&b"?!#\x02ab#\x01c#\x09cut"[..], Counted);
/// assert_eq!(frames.next()?.map(|f| (f.offset, f.bytes.to_vec())), Some((2, b"#\x02ab".to_vec())));
/// assert_eq!(frames.next()?.map(|f| f.offset), Some(6));
/// assert!(frames.next()?.is_none());
/// assert_eq!((frames.damage().bytes(), frames.damage().cut()), (2 + 5, Some(9)));
/// # Ok::<(), std::io::Error>(())
/// ```
pub trait Framing {
    /// Size in bytes of the largest frame.
    const MAX: usize;

    /// Finds the first byte at which a frame may begin. A mark that the end of `bytes` cuts off
    /// counts, too.
    fn find(&self, bytes: &[u8]) -> Option<usize>;

    /// Judges whether a frame begins with the first of `bytes`.
    fn judge(&self, bytes: &[u8]) -> Judgement;

    /// Tests whether a byte may stand between frames, such as the end of a line. Such bytes are not
    /// damage.
    fn separates(&self, _byte: u8) -> bool {
        false
    }
}

/// The judgement on bytes at which a frame may begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// An intact frame of this size in bytes.
    Frame(usize),
    /// The bytes so far may be the beginning of a frame.
    Incomplete,
    /// No frame begins here.
    Rejected(Fault),
}

/// The reason why no frame begins at a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Length or content do not follow the format.
    Form,
    /// The checksum differs.
    Checksum,
}

/// An intact frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Offset of its first byte in the stream.
    pub offset: u64,
    /// All its bytes.
    pub bytes: &'a [u8],
}

/// The frames of a stream.
#[derive(Debug)]
pub struct Frames<R, F> {
    window: Window<R>,
    framing: F,
    /// Size of the frame at the beginning of the window that was returned.
    used: usize,
    damage: Damage,
    /// Offset and size of the frame that was returned last.
    last: (u64, usize),
}

impl<R: Read, F: Framing> Frames<R, F> {
    /// The frames of `reader`.
    pub fn new(reader: R, framing: F) -> Self {
        Self {
            window: Window::new(reader),
            framing,
            used: 0,
            damage: Damage::default(),
            last: (0, 0),
        }
    }

    /// Finds the next intact frame; `None` at the end of the stream.
    ///
    /// # Errors
    /// When the stream cannot be read.
    #[allow(clippy::should_implement_trait, reason = "a frame borrows from the buffer")]
    pub fn next(&mut self) -> Result<Option<Frame<'_>>> {
        self.window.skip(std::mem::take(&mut self.used));
        let size = loop {
            let Some(found) = self.framing.find(self.window.bytes()) else {
                self.skip(self.window.bytes().len());
                if self.window.more()? {
                    continue;
                }
                return Ok(None);
            };
            self.skip(found);
            let bytes = self.window.bytes();
            match self.framing.judge(bytes) {
                Judgement::Frame(size) if (1..=bytes.len()).contains(&size) => break size,
                Judgement::Frame(_) => self.reject(Fault::Form),
                Judgement::Rejected(fault) => self.reject(fault),
                Judgement::Incomplete if bytes.len() >= F::MAX => self.reject(Fault::Form),
                Judgement::Incomplete => {
                    if !self.window.more()? {
                        self.damage.unfinished(self.window.offset());
                        self.skip(1);
                    }
                }
            }
        };
        self.damage.intact(size as u64);
        self.last = (self.window.offset(), size);
        self.used = size;
        Ok(Some(Frame { offset: self.last.0, bytes: &self.window.bytes()[..size] }))
    }

    /// Counts the frame that was returned last as damage: its content contradicts the format in a
    /// way that the framing cannot see.
    pub fn reject_last(&mut self) {
        let (offset, size) = std::mem::take(&mut self.last);
        if size > 0 {
            self.damage.whole(offset, size as u64);
        }
    }

    /// The rules of the format, for a format whose records define those that follow.
    pub fn framing(&mut self) -> &mut F {
        &mut self.framing
    }

    /// The bytes that were skipped so far.
    pub fn damage(&self) -> &Damage {
        &self.damage
    }

    /// Skips the mark at which no frame begins.
    fn reject(&mut self, fault: Fault) {
        if fault == Fault::Checksum {
            self.damage.checksum(self.window.offset());
        }
        self.skip(1);
    }

    fn skip(&mut self, count: usize) {
        for (at, byte) in (self.window.offset()..).zip(&self.window.bytes()[..count]) {
            if !self.framing.separates(*byte) {
                self.damage.skipped(at);
            }
        }
        self.window.skip(count);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use proptest::prelude::*;
    use std::io::Cursor;

    const SERIAL: Sentences =
        Sentences { marks: b"w", check: Check::Crc8, marks_are_reserved: false };
    const LINES: Sentences =
        Sentences { marks: b":", check: Check::None, marks_are_reserved: true };

    /// A reader that gives a few bytes at a time.
    struct Slow<'a>(&'a [u8], usize);

    impl Read for Slow<'_> {
        fn read(&mut self, out: &mut [u8]) -> Result<usize> {
            let count = self.0.len().min(self.1).min(out.len());
            let (now, later) = self.0.split_at(count);
            out[..count].copy_from_slice(now);
            self.0 = later;
            Ok(count)
        }
    }

    fn all<F: Framing>(reader: impl Read, framing: F) -> (Vec<(u64, Vec<u8>)>, Damage) {
        let mut frames = Frames::new(reader, framing);
        let mut found = Vec::new();
        while let Some(frame) = frames.next().unwrap() {
            found.push((frame.offset, frame.bytes.to_vec()));
        }
        (found, frames.damage().clone())
    }

    fn count(text: &[u8], framing: Sentences) -> (usize, u64) {
        let (found, damage) = all(text, framing);
        (found.len(), damage.bytes())
    }

    #[test]
    fn sentences_with_their_published_checksums_are_intact() {
        let nmea = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n\
                     $PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3D\r\n";
        assert_eq!(count(nmea, Sentences::NMEA), (2, 0));
        assert_eq!(count(b"wru,0,0.070,1.10,-40,-95*9c\nwrc,1480,20,n,y*59\n", SERIAL), (2, 0));
        // CRC-8 of the catalogue: the check of 123456789 is f4
        assert_eq!(crc8(b"123456789"), 0xf4);
        // the end of the file after the checksum is enough, lower case too
        assert_eq!(
            count(
                b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47",
                Sentences::NMEA
            ),
            (1, 0)
        );
        assert_eq!(
            count(b"$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3d", Sentences::NMEA),
            (1, 0)
        );
    }

    #[test]
    fn a_sentence_that_lost_its_end_does_not_swallow_the_next() {
        let text = b"$GPGGA,1235$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3D\r\n$GP\x00";
        let (found, damage) = all(&text[..], Sentences::NMEA);
        assert_eq!((found.len(), found[0].0), (1, 11));
        let gaps: Vec<_> = damage.first().collect();
        assert_eq!(
            gaps.iter().map(|g| (g.offset, g.bytes)).collect::<Vec<_>>(),
            [(0, 11), (62, 4)]
        );
        assert_eq!(count(b":SA,1\r\n:TS,2:SA,3\n:BI,4", LINES), (2, 5 + 5));
    }

    #[test]
    fn damage_is_described_with_offsets_and_counts() {
        let sentence = b"$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3D\r\n";
        let wrong = b"$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.4*3D\r\n";
        let text = [&sentence[..], wrong, sentence, b"??", sentence, b"$PNO"].concat();
        let (found, damage) = all(&text[..], Sentences::NMEA);
        assert_eq!(found.len(), 3);
        assert_eq!(
            damage.describe("sentence").unwrap(),
            "skipped 55 bytes in 3 places that hold no intact sentence (at byte 51: 49 bytes, \
             wrong checksum; at byte 153: 2 bytes; at byte 206: 4 bytes); wrong checksums in 1 \
             place; the file ends within the sentence at byte 206"
        );
        assert_eq!((damage.gaps(), damage.checksums(), damage.cut()), (3, 1, Some(206)));
        assert_eq!(all(&sentence[..], Sentences::NMEA).1.describe("sentence"), None);
    }

    #[test]
    fn a_frame_that_is_longer_than_the_largest_is_no_frame() {
        let mut text = b"$".to_vec();
        text.extend([b'a'; 5000]);
        text.extend(b"$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3D");
        assert_eq!(count(&text, Sentences::NMEA), (1, 5001));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_byte_is_in_a_frame_or_damage_or_separates_however_the_stream_arrives(
            parts in prop::collection::vec(prop_oneof![
                Just(b"$PNORBT4,1.234,-1.234,1.234,23.4,12.34567,12.3*3D\r\n".to_vec()),
                prop::collection::vec(any::<u8>(), 0..20),
                "[$!*0-9A-F,\\r\\n]{0,20}".prop_map(String::into_bytes),
            ], 0..12),
            step in 1..40_usize
        ) {
            let bytes = parts.concat();
            let (found, damage) = all(Cursor::new(&bytes), Sentences::NMEA);
            prop_assert_eq!(&all(Slow(&bytes, step), Sentences::NMEA), &(found.clone(), damage.clone()));
            let mut used = vec![false; bytes.len()];
            for (offset, frame) in &found {
                let at = *offset as usize;
                prop_assert_eq!(&bytes[at..at + frame.len()], &frame[..]);
                used[at..at + frame.len()].fill(true);
            }
            let rest = bytes.iter().zip(&used).filter(|(b, u)| !**u && !b"\r\n".contains(b));
            prop_assert_eq!(damage.bytes(), rest.count() as u64);
            prop_assert_eq!(damage.intact_bytes(), used.iter().filter(|u| **u).count() as u64);
        }
    }
}
