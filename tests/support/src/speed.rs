//! Speed of readers.

use std::time::Instant;

/// Times of a reading of which the best counts.
const TIMES: u32 = 5;

/// Prints the speed of reading a file of some bytes. The reader returns the number of its records,
/// which is that of the file.
pub fn measure(name: &str, bytes: usize, records: usize, mut read: impl FnMut() -> usize) {
    let once = || {
        let started = Instant::now();
        assert_eq!(read(), records, "{name}");
        started.elapsed().as_secs_f64()
    };
    let seconds = std::iter::repeat_with(once).take(TIMES as usize).fold(f64::INFINITY, f64::min);
    let (speed, each) = (bytes as f64 / seconds * 1e-6, seconds / records as f64 * 1e6);
    println!("{name}: {speed:.0} MB/s of {:.0} MB, {each:.2} us a record", bytes as f64 * 1e-6);
}
