//! The extension module `navfuse._navfuse` of the Python package navfuse.
//!
//! It passes arrays, and texts in JSON; the classes that a user sees are written in Python, in
//! `python/navfuse`.

mod error;
mod live;
mod log;
mod names;
mod process;
mod recorder;
mod run;
mod samples;
mod scenario;
mod sensor;
mod session;
mod states;
mod table;
mod tools;
mod watch;

/// Scenarios, runs and the command.
#[pyo3::pymodule]
mod _navfuse {
    use pyo3::prelude::*;
    use std::ffi::OsString;
    use std::process::ExitCode;

    #[pymodule_export]
    use crate::log::read_log;
    #[pymodule_export]
    use crate::scenario::Scenario;
    #[pymodule_export]
    use crate::session::Session;
    #[pymodule_export]
    use crate::tools::{calibrate, campaign, conformance, diagnose, merge, observability};

    /// Runs the command with its arguments, and returns its exit code.
    #[pyfunction]
    fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        let name = std::iter::once("navfuse".into());
        let arguments = name.chain(arguments);
        let registry = navfuse::standard_plugins();
        let code = py.detach(|| navfuse::command_with(&registry, arguments));
        (0..=u8::MAX).find(|number| ExitCode::from(*number) == code).unwrap_or(1)
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("QUICKSTART", include_str!("../../scenarios/quickstart.toml"))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
