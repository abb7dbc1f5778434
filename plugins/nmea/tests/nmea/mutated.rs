//! Recordings with changed bytes: no panic, times in order, and bounded time.

use crate::{ALL, assembled, recording};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;

/// Numbers that look random, the same in each run (SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % below.max(1) as u64) as usize
    }
}

/// Changes a file as cables, disks and people do.
fn mutate(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..1 + random.next(6) {
        let (at, length) = (random.next(bytes.len()), random.next(80));
        let end = (at + length).min(bytes.len());
        match random.next(7) {
            0 if at < bytes.len() => bytes[at] = random.next(256) as u8,
            1 if at < bytes.len() => bytes[at] ^= 1 << random.next(8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let part = bytes[at..end].to_vec();
                let to = random.next(bytes.len());
                bytes.splice(to..to, part);
            }
            // a digit of a number, with a checksum that fits
            5 => change_field(&mut bytes, at, random),
            _ => {
                let noise: Vec<u8> = (0..length).map(|_| random.next(256) as u8).collect();
                bytes.splice(at..at, noise);
            }
        }
    }
    bytes
}

/// Replaces a field of the sentence around a byte by an odd one, and repairs the checksum.
fn change_field(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    const ODD: [&str; 12] = [
        "",
        "-",
        "99999999999999999999",
        "1e400",
        "nan",
        "240000",
        "-1",
        "0000.0",
        "9999.99999",
        "\u{e9}",
        "311299",
        ".",
    ];
    let Some(start) = bytes[..at].iter().rposition(|b| *b == b'$') else { return };
    let Some(star) = bytes[start..].iter().position(|b| *b == b'*').map(|n| start + n) else {
        return;
    };
    let commas: Vec<usize> = (start..star).filter(|k| bytes[*k] == b',').collect();
    if commas.is_empty() || star + 3 > bytes.len() {
        return;
    }
    let k = random.next(commas.len());
    let end = commas.get(k + 1).copied().unwrap_or(star);
    let mut content = bytes[start + 1..=commas[k]].to_vec();
    content.extend_from_slice(ODD[random.next(ODD.len())].as_bytes());
    content.extend_from_slice(&bytes[end..star]);
    let checksum = content.iter().fold(0, |sum, b| sum ^ b);
    content.extend_from_slice(format!("*{checksum:02X}").as_bytes());
    bytes.splice(start + 1..star + 3, content);
}

fn read_mutated(count: u64) {
    let file = recording(4).into_bytes();
    let mut used = 0;
    for seed in 0..count {
        let mut random = Random(seed);
        let bytes = mutate(&file, &mut random);
        let Ok(sources) = assembled(&bytes, ALL) else { continue };
        for mut source in sources {
            let mut sample = Sample::empty(Time::MIN, SensorId(0));
            let mut last = Time::MIN;
            while source.next(&mut sample).is_ok_and(|more| more) {
                assert!(sample.time > last, "seed {seed}");
                last = sample.time;
                used += 1;
            }
            drop(source.warning());
        }
    }
    assert!(used > 2 * count, "most of the recording is used: {used} samples");
}

#[test]
fn a_recording_with_changed_bytes_is_read_or_rejected() {
    read_mutated(100);
}

/// `cargo test -p navfuse-nmea --release -- --ignored mutated`
#[test]
#[ignore = "100 000 recordings take minutes"]
fn many_recordings_with_changed_bytes_are_read_or_rejected() {
    read_mutated(100_000);
}
