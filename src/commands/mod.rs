//! The subcommands, each with its arguments.

pub mod bound;
pub mod calibrate;
pub mod check;
pub mod compare;
pub mod completions;
pub mod diagnose;
pub mod export;
pub mod figures;
pub mod import;
pub mod list;
pub mod live;
pub mod merge;
pub mod monte_carlo;
pub mod new_plugin;
pub mod observability;
pub mod play;
pub mod replay;
pub mod report;
pub mod run;
pub mod schema;
pub mod sensitivity;
pub mod smooth;
pub mod status;
pub mod sweep;
#[cfg(feature = "rerun")]
pub mod view;
