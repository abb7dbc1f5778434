//! Errors in a table of motion segments.

const EMPTY: &str = "the table is empty: give at least one segment, such as \
                     { type = \"static\", duration = \"600 s\" }";

/// Error in a table of motion segments.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// There are no segments.
    #[error("segments: {EMPTY}")]
    Empty,
    /// A number of a segment does not fit.
    #[error("segment {number} (`{kind}`): {key} = \"{value}\": {remedy}")]
    Segment {
        /// Row of the table, from 1.
        number: usize,
        /// Its type.
        kind: &'static str,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What to do.
        remedy: String,
    },
    /// A number of the start does not fit.
    #[error("start: {key} = \"{value}\": give a value within {limit}")]
    Start {
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// The greatest magnitude allowed.
        limit: &'static str,
    },
    /// The path is so long that it may leave the region in which the equations hold.
    #[error(
        "segment {number}: the path so far may lead to a {key} of {value:.1} {unit}, beyond \
         {limit} {unit}: shorten the path or start elsewhere"
    )]
    Reach {
        /// Row of the table, from 1.
        number: usize,
        /// Latitude or height.
        key: &'static str,
        /// The bound on it.
        value: f64,
        /// The greatest magnitude allowed.
        limit: f64,
        /// The unit of both.
        unit: &'static str,
    },
}

impl TrajectoryError {
    /// Path of the key below the table of the source, with the place of a segment from 0.
    pub(crate) fn key(&self) -> String {
        match self {
            Self::Empty => "segments".to_owned(),
            Self::Segment { number, key, .. } => format!("segments.{}.{key}", number - 1),
            Self::Start { key, .. } => format!("start.{key}"),
            Self::Reach { number, .. } => format!("segments.{}", number - 1),
        }
    }

    /// What is wrong, beside the key and its value.
    pub(crate) fn message(&self) -> String {
        match self {
            Self::Segment { number, kind, remedy, .. } => {
                format!("segment {number} (`{kind}`): {remedy}")
            }
            Self::Start { limit, .. } => format!("give a value within {limit}"),
            Self::Empty => EMPTY.to_owned(),
            Self::Reach { .. } => self.to_string(),
        }
    }
}
