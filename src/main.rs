//! The navfuse command.
fn main() {}
