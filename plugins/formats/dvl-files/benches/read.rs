//! Throughput of the readers, on files in memory as the instruments write them.
//!
//! `cargo bench -p navfuse-dvl-files`
#![allow(missing_docs, reason = "criterion's macros define the functions")]

#[path = "../tests/dvl_files/generate.rs"]
mod generate;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use generate::{Ensemble, records};
use navfuse_dvl_files::{Decoder, Format};
use std::hint::black_box;
use std::io::Cursor;
use std::sync::Arc;

fn drain(mut decoder: Box<dyn Decoder>) -> usize {
    let mut count = 0;
    while let Ok(Some(ping)) = decoder.next() {
        black_box(&ping);
        count += 1;
    }
    count
}

fn read(c: &mut Criterion) {
    let mut group = c.benchmark_group("read");
    // PD0 with a profile of 30 cells and, as a velocity log sends it, without
    let pd0 = |cells: u8| {
        let ensemble = |k: u32| Ensemble { cells, ..Ensemble::default() }.at(10 * k).bytes();
        (0..10_000).flat_map(ensemble).collect::<Vec<u8>>()
    };
    let mut files = vec![("pd0 with 30 cells", Format::Pd0, pd0(30)), ("pd0", Format::Pd0, pd0(0))];
    for format in Format::ALL.into_iter().filter(|f| *f != Format::Pd0) {
        files.push((format.name(), format, records(format.name(), 500).concat().repeat(10)));
    }
    for (name, format, bytes) in files {
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        let bytes: Arc<[u8]> = bytes.into();
        group.bench_with_input(BenchmarkId::from_parameter(name), &bytes, |b, bytes| {
            b.iter(|| drain(format.decoder(Cursor::new(Arc::clone(bytes)))));
        });
    }
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
