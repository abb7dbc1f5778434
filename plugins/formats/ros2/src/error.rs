//! The reasons why a message or its definition cannot be read.

/// The reason why a message cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The message ends too early.
    #[error("it ends within the value at byte {at}")]
    Short {
        /// Offset of the value in the message.
        at: usize,
    },
    /// A sequence has more elements than the message has bytes.
    #[error("the sequence at byte {at} claims {count} elements")]
    Count {
        /// The claim.
        count: u32,
        /// Offset of the claim in the message.
        at: usize,
    },
    /// The encoding is not plain CDR.
    #[error("its encoding {0:#06x} is not plain CDR")]
    Representation(u16),
    /// A number is infinite.
    #[error("a number is infinite")]
    Infinite,
}

/// The reason why the definition of a type cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DefinitionError {
    /// The definition of a type that another one uses is missing.
    #[error("the definition of {0} is missing")]
    Missing(String),
    /// A line is no field.
    #[error("the definition of {of} has the line {line:?}")]
    Line {
        /// The type.
        of: String,
        /// The line.
        line: String,
    },
    /// A path names no field.
    #[error("{of} has no field {name:?}; it has {fields}")]
    Field {
        /// The type.
        of: String,
        /// The name.
        name: String,
        /// The fields of the type.
        fields: String,
    },
    /// A path ends at something that is no number.
    #[error("{0} is no number; a path such as \"twist.twist.linear.x\" or \"ranges[2]\" is needed")]
    NoNumber(String),
    /// A path gives an index to a field that has none, or none to one that needs it.
    #[error("{0}: an index in brackets is needed for a list, and only for a list")]
    Index(String),
    /// A wide string stands before the field; its encoding differs between programs.
    #[error("{0} is of type wstring, whose encoding differs between programs")]
    Wide(String),
    /// Types contain each other, or are very long.
    #[error("the definition of {0} is nested too deeply, or too long")]
    TooLarge(String),
}
