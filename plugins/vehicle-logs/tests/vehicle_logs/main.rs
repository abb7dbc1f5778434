//! Tests of the readers and of the source.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod damage;
mod foreign;
mod generate;
mod scenario;

use navfuse_frames::Damage;
use navfuse_vehicle_logs::{Format, Options, Record, Topic};
use std::io::Cursor;

/// Messages with the values of their fields.
type Rows = Vec<(Record, Vec<f64>)>;

/// All messages of a log, its topics, and its damage.
fn read(format: Format, bytes: &[u8]) -> (Rows, Vec<Topic>, Damage) {
    let mut decoder = format.decoder(Cursor::new(bytes.to_vec()), &Options::default());
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    while let Some(record) = decoder.next(&mut values).unwrap() {
        rows.push((record, values.clone()));
    }
    (rows, decoder.topics().to_vec(), decoder.damage().clone())
}
