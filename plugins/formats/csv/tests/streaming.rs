//! Speed and memory of reading files.
#![allow(clippy::unwrap_used)] // a failed test may panic

mod common;

use common::{IMU, IMU_HEADER, assemble, folder};
use navfuse_core::model::stream::Source;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::speed::measure;
use std::fmt::Write;

fn imu(rows: usize) -> String {
    let mut text = IMU_HEADER.to_owned();
    for k in 0..rows {
        let (s, x) = (k as f64 * 0.01, (k % 977) as f64 * 1e-4);
        writeln!(
            text,
            "{s:.2},{:.6},{:.6},{:.6},{:.6},{:.6},{:.6}",
            x,
            -x,
            0.5 * x,
            x + 0.1,
            x - 0.2,
            x - 9.8
        )
        .unwrap();
    }
    text
}

fn count(source: &mut dyn Source) -> usize {
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    (0..).take_while(|_| source.next(&mut sample).unwrap()).count()
}

#[test]
fn no_row_allocates_after_the_first() {
    let folder = folder(&[("imu.csv", imu(20_000))]);
    let mut sources = assemble(folder.path(), IMU, "[source.csv]\n", false).unwrap().sources;
    let source = sources[0].1.as_mut();
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    // later rows are at most 4 digits of time longer, and the doubled record buffer already holds
    // them
    (0..100).for_each(|_| assert!(source.next(&mut sample).unwrap()));
    let mut rows = 0;
    let allocations = allocation_counter::measure(|| rows = count(source));
    assert_eq!((rows, allocations.count_total), (19_900, 0));
}

#[test]
#[ignore = "it measures"]
fn speed_of_reading() {
    let (rows, text) = (1_000_000, imu(1_000_000));
    let folder = folder(&[("imu.csv", &text)]);
    measure("csv", text.len(), rows, || {
        let mut sources = assemble(folder.path(), IMU, "[source.csv]\n", false).unwrap().sources;
        count(sources[0].1.as_mut())
    });
}
