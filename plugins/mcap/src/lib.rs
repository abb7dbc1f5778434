//! navfuse-mcap
