//! Physical quantities as on a data sheet, checked by dimension: `"0.01 deg/h"`,
//! `"10 ug/sqrt(Hz)"`, `"2 cm/s"`; samples, and time.
//!
//! A [`Quantity`] is an `f64` in SI whose dimension is its type. A scenario that gives an angle
//! where an angular rate is needed is therefore rejected where it is read. A quantity prints in the
//! notation of the scenario, and the printed text reads back to the same bits.

mod any;
mod chart;
mod config;
mod date;
mod dimension;
mod error;
mod pattern;
mod print;
mod quantities;
mod quantity;
pub mod rhythm;
pub mod sample;
#[cfg(test)]
mod tests;
pub mod thin;
pub mod time;
mod unit;

pub use crate::calendar;
pub use any::AnyQuantity;
pub use chart::{Latitude, Longitude};
pub use config::{Components, NonNegative, Positive, Sigma, Triple};
pub use date::Date;
pub use dimension::Exponents;
pub(crate) use dimension::{example, name as dimension_name, usual_units};
pub use error::UnitError;
pub use quantities::*;
pub use quantity::Quantity;
pub use unit::{Unit, column_suffix, parse_unit, suffix_expression};
