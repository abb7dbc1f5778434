//! Reasons for which a run is not saved, or does not go on.

/// Reason for which a run is not saved, or a checkpoint not used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The bytes do not begin as a checkpoint does.
    #[error("these bytes are no checkpoint of navfuse")]
    Foreign,
    /// Another version of the program wrote the checkpoint.
    #[error(
        "the checkpoint has format {found}, and this program reads format {read}: continue with \
         the version that wrote it, or begin the run again"
    )]
    Version {
        /// Format of the checkpoint.
        found: u32,
        /// Format that this program reads.
        read: u32,
    },
    /// The end is missing.
    #[error("the checkpoint is cut off: it has {found} of {length} bytes")]
    Truncated {
        /// Number of bytes.
        found: u64,
        /// Number of bytes that were written.
        length: u64,
    },
    /// Bytes have changed.
    #[error("the checkpoint is damaged: its checksum is wrong")]
    Damaged,
    /// The checkpoint is of a scenario with another layout.
    #[error("the checkpoint is of another scenario: {0}")]
    Layout(String),
    /// The memory of a part differs from what the scenario builds.
    #[error("the checkpoint does not fit the scenario: {part}: {problem}")]
    Part {
        /// Path of the part, such as `process ins`.
        part: String,
        /// Difference.
        problem: String,
    },
    /// The run cannot be saved at this time, or not at all.
    #[error("the run cannot be saved: {0}")]
    Refused(String),
}
