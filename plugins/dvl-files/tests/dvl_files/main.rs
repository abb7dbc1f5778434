//! Tests of the readers and of the source.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::expect_used,
    reason = "a test fails by panicking"
)]

mod damage;
mod foreign;
mod generate;
mod scenario;
mod velocities;

use navfuse_dvl_files::{Damage, Format, Ping};
use std::io::Cursor;

/// Reads all pings of a file.
fn read(format: Format, bytes: &[u8]) -> (Vec<Ping>, Damage) {
    let mut decoder = format.decoder(Cursor::new(bytes.to_vec()));
    let mut pings = Vec::new();
    while let Some(ping) = decoder.next().unwrap() {
        pings.push(ping);
    }
    (pings, decoder.damage().clone())
}
