//! Screening of the driving sensor.

pub(super) mod repeats;
pub(super) mod screened;
pub(super) mod screening;
pub(super) mod usual;
