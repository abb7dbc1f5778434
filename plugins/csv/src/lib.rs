//! navfuse-csv
