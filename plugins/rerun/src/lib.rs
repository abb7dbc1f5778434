//! navfuse-rerun
