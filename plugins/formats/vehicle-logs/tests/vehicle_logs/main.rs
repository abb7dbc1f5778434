//! Tests of the readers and of the source.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod connected;
mod damage;
mod foreign;
mod generate;
mod imc;
mod inertial;
mod lcm;
mod mscl;
mod scenario;

use navfuse_frames::Damage;
use navfuse_testing::speed::measure;
use navfuse_vehicle_logs::{Format, Options, Record, Topic};
use std::io::Cursor;
use std::sync::Arc;

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

#[test]
#[ignore = "it measures"]
fn speed_of_reading() {
    for (name, log) in [
        ("ulog", generate::flight(600)),
        ("tlog", generate::telemetry_of_flight(600)),
        ("novatel", generate::binary_span(600)),
        ("ubx", generate::ublox(600)),
        ("sbf", generate::septentrio(600)),
        ("sbg-ecom", generate::units::sbg(600)),
        ("vectornav-binary", generate::units::vectornav_binary(600)),
        ("mip", generate::units::mip(600, false)),
        ("lcm", generate::units::lcm(30_000)),
        ("imc", generate::dune::log(600)),
    ] {
        let format = Format::ALL.into_iter().find(|f| f.name() == name).unwrap();
        let (all, size) = (read(format, &log).0.len(), log.len());
        let log: Arc<[u8]> = log.into();
        measure(name, size, all, || {
            let log = Cursor::new(Arc::clone(&log));
            let mut decoder = format.decoder(log, &Options::default());
            let mut values = Vec::new();
            (0..).take_while(|_| decoder.next(&mut values).unwrap().is_some()).count()
        });
    }
}
