//! The `navfuse` command with the standard plugins.

fn main() -> std::process::ExitCode {
    navfuse::command(&navfuse::standard_plugins())
}
