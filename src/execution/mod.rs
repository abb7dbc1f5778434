//! The work that several subcommands share: reading a scenario or a log, one run, a campaign.

pub mod campaign;
pub mod history;
pub mod input;
pub mod run;
pub mod screen;
pub mod sensitivity;
pub mod service;
pub mod worst;
