//! `navfuse schema`.

use crate::error::Result;
use crate::output::line;
use navfuse_core::plugin::Registry;
use navfuse_core::run::schema::scenario_schema;
use std::process::ExitCode;

/// Prints the JSON Schema of scenarios.
pub fn schema(registry: &Registry) -> Result<ExitCode> {
    line(serde_json::to_string_pretty(&scenario_schema(registry))?);
    Ok(ExitCode::SUCCESS)
}
