//! Printing results for people and programs, and writing files.

pub mod budget;
pub mod campaign;
pub mod compare;
pub mod dashboard;
pub mod detect;
pub mod diagnose;
mod files;
pub mod progress;
pub mod run;
pub mod scenarios;
pub mod sensitivity;
mod tables;
pub mod terminal;
pub mod warnings;

pub use files::{check, write, write_files};
pub use tables::{
    Table, aside, check_standard_output, line, marked_line, marked_table, mistake, raw, right,
    table, warn,
};

use clap::ValueEnum;

/// Form of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Tables for people
    Text,
    /// One JSON object on standard output, and nothing else there
    Json,
}
