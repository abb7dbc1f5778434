//! The transfer of a memory to bytes, and back.

use super::error::CheckpointError;

/// Something that remembers, such as a filter, and whose memory a checkpoint saves.
///
/// One function saves and restores, so that the two cannot disagree. The macro
/// [`saved!`](crate::saved) writes it:
/// ```
/// use navfuse_core::checkpoint::saved;
///
/// #[derive(Default)]
/// struct Mean {
///     weight: f64,
///     sum: f64,
///     last: Option<f64>,
/// }
/// // a new build has the weight, which a key of the scenario gives
/// saved!(Mean { sum, last } except { weight });
/// ```
pub trait Saved {
    /// Passes every value that changes during a run to [`Io::pass`], in a fixed order.
    fn saved(&mut self, io: &mut Io<'_>);
}

/// Direction of a transfer.
enum Way<'a> {
    Write(Vec<u8>),
    Read(&'a [u8]),
}

/// Writes a memory, or reads it back into a part that the same scenario has built. After the first
/// problem it reads nothing more, and the run does not go on.
pub struct Io<'a> {
    way: Way<'a>,
    /// Names of the parts around the present value.
    path: Vec<String>,
    failed: Option<CheckpointError>,
}

impl<'a> Io<'a> {
    /// A transfer that writes.
    pub fn writer() -> Self {
        Self { way: Way::Write(Vec::new()), path: Vec::new(), failed: None }
    }

    /// A transfer that reads what another one wrote.
    pub fn reader(bytes: &'a [u8]) -> Self {
        Self { way: Way::Read(bytes), path: Vec::new(), failed: None }
    }

    /// Ends the transfer, and returns what was written.
    ///
    /// # Errors
    /// The first problem, or [`CheckpointError::Part`] if bytes are left.
    pub fn finish(mut self) -> Result<Vec<u8>, CheckpointError> {
        self.end();
        match (self.failed, self.way) {
            (Some(error), _) => Err(error),
            (None, Way::Write(bytes)) => Ok(bytes),
            (None, Way::Read(_)) => Ok(Vec::new()),
        }
    }

    /// Returns `true` if the transfer restores a memory.
    pub fn restores(&self) -> bool {
        matches!(self.way, Way::Read(_))
    }

    /// Saves or restores a value.
    pub fn pass<T: Saved + ?Sized>(&mut self, value: &mut T) {
        value.saved(self);
    }

    /// Saves or restores values whose number the scenario decides.
    pub fn each<'v, T: Saved + 'v>(
        &mut self,
        values: impl IntoIterator<Item = &'v mut T, IntoIter: ExactSizeIterator>,
    ) {
        let values = values.into_iter();
        let (here, mut there) = (values.len(), values.len());
        self.pass(&mut there);
        if here == there {
            values.for_each(|value| value.saved(self));
        } else {
            self.fail(format!("{there} values, where the scenario has {here}"));
        }
    }

    /// Saves or restores a part that the scenario builds, and that may end during the run.
    pub fn while_there<T: Saved>(&mut self, part: &mut Option<T>) {
        let mut there = part.is_some();
        self.pass(&mut there);
        match part {
            Some(part) if there => self.pass(part),
            None if there => self.fail("this scenario does not have it"),
            _ => *part = None,
        }
    }

    /// Saves or restores a part, whose name is in the message if it does not fit.
    pub fn part(&mut self, name: impl Into<String>, transfer: impl FnOnce(&mut Io<'_>)) {
        let mut path = std::mem::take(&mut self.path);
        path.push(name.into());
        let length = if self.restores() { self.count(0) } else { 0 };
        let way = match &mut self.way {
            Way::Write(_) => Way::Write(Vec::new()),
            Way::Read(bytes) => Way::Read(bytes.split_off(..length).unwrap_or_default()),
        };
        let mut inner = Io { way, path, failed: self.failed.take() };
        transfer(&mut inner);
        inner.end();
        let Io { way, path, failed } = inner;
        (self.path, self.failed) = (path, failed);
        self.path.pop();
        if let Way::Write(written) = way {
            self.count(written.len());
            self.write(&written);
        }
    }

    /// Refuses to save a run, with the reason.
    pub fn refuse(&mut self, why: impl Into<String>) {
        self.end_with(CheckpointError::Refused(why.into()));
    }

    /// Saves or restores bytes.
    pub(super) fn bytes(&mut self, bytes: &mut [u8]) {
        match &mut self.way {
            Way::Write(_) => self.write(bytes),
            Way::Read(from) => match from.split_off(..bytes.len()) {
                Some(read) => bytes.copy_from_slice(read),
                None => self.fail("its memory is shorter"),
            },
        }
    }

    /// Saves or restores a number of values of at least one byte each, which the bytes can hold.
    pub(super) fn count(&mut self, count: usize) -> usize {
        let mut written = (count as u64).to_le_bytes();
        self.bytes(&mut written);
        let Way::Read(left) = &self.way else { return count };
        match usize::try_from(u64::from_le_bytes(written)) {
            Ok(count) if self.failed.is_none() && count <= left.len() => count,
            _ => {
                self.fail("it has more values than bytes");
                0
            }
        }
    }

    /// Saves or restores the name of a variant, one of these.
    #[doc(hidden)]
    pub fn variant(&mut self, name: &'static str, all: &[&'static str]) -> &'static str {
        let place = all.iter().position(|one| *one == name).unwrap_or_default();
        let mut place = [place as u8];
        self.bytes(&mut place);
        match all.get(usize::from(place[0])) {
            Some(name) => name,
            None => {
                self.fail(format!("variant {} does not exist", place[0]));
                name
            }
        }
    }

    /// Notes a difference between checkpoint and scenario, and ends the reading.
    pub(super) fn fail(&mut self, problem: impl Into<String>) {
        let (part, problem) = (self.path.join(": "), problem.into());
        self.end_with(CheckpointError::Part { part, problem });
    }

    /// Ends the transfer with an error, unless it has one.
    pub(super) fn end_with(&mut self, error: CheckpointError) {
        self.failed.get_or_insert(error);
        if let Way::Read(bytes) = &mut self.way {
            *bytes = &[];
        }
    }

    fn write(&mut self, bytes: &[u8]) {
        if let Way::Write(to) = &mut self.way {
            to.extend_from_slice(bytes);
        }
    }

    /// Notes bytes that nobody has read.
    fn end(&mut self) {
        if let Way::Read(bytes) = &self.way
            && !bytes.is_empty()
        {
            self.fail(format!("its memory is longer, by {} bytes", bytes.len()));
        }
    }
}

/// Implements [`Saved`](crate::checkpoint::Saved) for a struct or an enum.
///
/// Every field is named, so that a new one is not forgotten:
/// - a field without a word is passed on;
/// - a field of `each` holds a number of parts that the scenario decides, such as a `Vec` with one
///   place for each sensor, or an `Option` that a key fills;
/// - a field of `except` is work space, or the same in every build of the scenario.
///
/// Values of an `Option`, a `Vec` or a variant come and go during a run, and have a default.
/// ```
/// use navfuse_core::checkpoint::{Io, saved};
///
/// #[derive(Debug, Default, PartialEq)]
/// enum Phase {
///     #[default]
///     Waiting,
///     Counting(u32),
/// }
/// saved!(enum Phase { Waiting, Counting(count) });
///
/// struct Counter { phases: Vec<Phase>, limit: u32 }
/// saved!(Counter {} each { phases } except { limit });
///
/// let mut before = Counter { phases: vec![Phase::Counting(3), Phase::Waiting], limit: 7 };
/// let mut io = Io::writer();
/// io.pass(&mut before);
/// let bytes = io.finish()?;
/// let mut after = Counter { phases: vec![Phase::Waiting, Phase::Waiting], limit: 7 };
/// let mut io = Io::reader(&bytes);
/// io.pass(&mut after);
/// io.finish()?;
/// assert_eq!(after.phases, [Phase::Counting(3), Phase::Waiting]);
/// # Ok::<(), navfuse_core::checkpoint::CheckpointError>(())
/// ```
#[macro_export]
macro_rules! saved {
    (enum $type:ident {
        $($variant:ident $(($($place:ident),+))? $({ $($field:ident),+ })?),+ $(,)?
    }) => {
        impl $crate::checkpoint::Saved for $type {
            fn saved(&mut self, io: &mut $crate::checkpoint::Io<'_>) {
                let before = match self { $(Self::$variant { .. } => stringify!($variant),)+ };
                let now = io.variant(before, &[$(stringify!($variant)),+]);
                $(if now != before && now == stringify!($variant) {
                    $($(let $place = Default::default();)+)?
                    *self = Self::$variant
                        $(($($place),+))?
                        $({ $($field: Default::default()),+ })?;
                })+
                match self {
                    $(Self::$variant $(($($place),+))? $({ $($field),+ })? => {
                        $($(io.pass($place);)+)?
                        $($(io.pass($field);)+)?
                    })+
                }
            }
        }
    };
    ($type:ident($($field:ident),+)) => {
        impl $crate::checkpoint::Saved for $type {
            fn saved(&mut self, io: &mut $crate::checkpoint::Io<'_>) {
                let Self($($field),+) = self;
                $(io.pass($field);)+
            }
        }
    };
    ($type:ty { $($field:ident),* $(,)? }
        $(each { $($part:ident),+ $(,)? })? $(except { $($built:ident),+ $(,)? })?) => {
        impl $crate::checkpoint::Saved for $type {
            fn saved(&mut self, io: &mut $crate::checkpoint::Io<'_>) {
                let Self { $($field,)* $($($part,)+)? $($($built: _,)+)? } = self;
                $(io.pass($field);)*
                $($(io.each($part);)+)?
            }
        }
    };
}
