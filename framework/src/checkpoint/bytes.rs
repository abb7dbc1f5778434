//! The bytes of a checkpoint: mark, format, length, layout by names, memory, checksum.

use super::error::CheckpointError;
use super::io::Io;
use super::saved;

const MARK: [u8; 8] = *b"NAVFUSE\x01";
/// Format of the memory. Raise it with every change of what a part saves.
const FORMAT: u32 = 1;
/// Lengths of the mark, the format and the length, and of the checksum.
const HEAD: usize = 8 + 4 + 8;
const TAIL: usize = 8;

/// Hash FNV-1a of some bytes. It is the same on every machine, and one changed byte changes it.
pub(crate) fn fnv1a(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
    })
}

/// A part of the layout: a state block, a sensor, a process or the estimator.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Part {
    /// What it is: `sensor`.
    pub(crate) kind: String,
    /// Its name in the scenario.
    pub(crate) name: String,
    /// Type and size.
    pub(crate) detail: String,
}

saved!(Part { kind, name, detail });

impl Part {
    fn is(&self, other: &Self) -> bool {
        (&self.kind, &self.name) == (&other.kind, &other.name)
    }

    /// Saves the parts of a layout, or refuses to restore another one.
    pub(crate) fn pass_all(here: &[Self], io: &mut Io<'_>) {
        let mut there = here.to_vec();
        io.pass(&mut there);
        if let Some(difference) = difference(here, &there) {
            io.end_with(CheckpointError::Layout(difference));
        }
    }
}

/// Names the first difference between the layout of the scenario and that of a checkpoint.
fn difference(here: &[Part], there: &[Part]) -> Option<String> {
    let lacks = |parts: &[Part], part: &&Part| !parts.iter().any(|other| other.is(part));
    if let Some(Part { kind, name, .. }) = there.iter().find(|part| lacks(here, part)) {
        return Some(format!("it has the {kind} {name}, which this scenario does not have"));
    }
    if let Some(Part { kind, name, .. }) = here.iter().find(|part| lacks(there, part)) {
        return Some(format!("it does not have the {kind} {name} of this scenario"));
    }
    let (here, there) = here.iter().zip(there).find(|(here, there)| here != there)?;
    let (kind, name) = (&there.kind, &there.name);
    Some(match here.is(there) {
        true => format!(
            "its {kind} {name} has {}, where this scenario has {}",
            there.detail, here.detail
        ),
        false => {
            format!(
                "its {kind} {name} stands where this scenario has the {} {}",
                here.kind, here.name
            )
        }
    })
}

/// The memory of a run, from which a run of the same scenario goes on:
/// [`Session::checkpoint`](crate::session::Session::checkpoint).
///
/// A checkpoint is bytes; the caller keeps them in a file or elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoint(Vec<u8>);

impl Checkpoint {
    /// Composes a checkpoint from what the function writes.
    pub(crate) fn write(memory: impl FnOnce(&mut Io<'_>)) -> Result<Self, CheckpointError> {
        let mut io = Io::writer();
        memory(&mut io);
        let memory = io.finish()?;
        let length = (HEAD + memory.len() + TAIL) as u64;
        let mut bytes = [&MARK[..], &FORMAT.to_le_bytes(), &length.to_le_bytes(), &memory].concat();
        bytes.extend_from_slice(&fnv1a(&bytes).to_le_bytes());
        Ok(Self(bytes))
    }

    /// Restores what [`Self::write`] wrote.
    pub(crate) fn read(&self, memory: impl FnOnce(&mut Io<'_>)) -> Result<(), CheckpointError> {
        let end = self.0.len() - TAIL;
        let mut io = Io::reader(&self.0[HEAD..end]);
        memory(&mut io);
        io.finish().map(drop)
    }

    /// The checkpoint in these bytes.
    ///
    /// # Errors
    /// When they are no checkpoint, or one of another format, or when bytes are missing or have
    /// changed.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let rest = bytes.strip_prefix(&MARK).ok_or(CheckpointError::Foreign)?;
        let truncated = |length| CheckpointError::Truncated { found: bytes.len() as u64, length };
        let (format, rest) = rest.split_first_chunk().ok_or(truncated(HEAD as u64))?;
        let (found, read) = (u32::from_le_bytes(*format), FORMAT);
        if found != read {
            return Err(CheckpointError::Version { found, read });
        }
        let (length, _) = rest.split_first_chunk().ok_or(truncated(HEAD as u64))?;
        let length = u64::from_le_bytes(*length);
        if (bytes.len() as u64) < length.max((HEAD + TAIL) as u64) {
            return Err(truncated(length));
        }
        match bytes.split_last_chunk() {
            Some((content, sum)) if u64::from_le_bytes(*sum) == fnv1a(content) => {
                Ok(Self(bytes.to_vec()))
            }
            _ => Err(CheckpointError::Damaged),
        }
    }

    /// The bytes, for a file.
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }
}
