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
use navfuse_testing::speed::measure;
use std::io::Cursor;
use std::sync::Arc;

/// Reads all pings of a file.
fn read(format: Format, bytes: &[u8]) -> (Vec<Ping>, Damage) {
    let mut decoder = format.decoder(Cursor::new(bytes.to_vec()));
    let mut pings = Vec::new();
    while let Some(ping) = decoder.next().unwrap() {
        pings.push(ping);
    }
    (pings, decoder.damage().clone())
}

#[test]
#[ignore = "it measures"]
fn speed_of_reading() {
    for format in Format::ALL {
        let file: Arc<[u8]> = generate::records(format.name(), 500).concat().repeat(10).into();
        let pings = read(format, &file).0.len();
        measure(format.name(), file.len(), pings, || {
            let mut decoder = format.decoder(Cursor::new(Arc::clone(&file)));
            (0..).take_while(|_| decoder.next().unwrap().is_some()).count()
        });
    }
}
