//! Recordings with changed bytes: no panic, times in order, and bounded time.

use crate::{ALL, recording, registry, scenario, vendors};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::damage::{Random, damaged, files};
use navfuse_testing::recording::open;

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
    let k = random.below(commas.len());
    let end = commas.get(k + 1).copied().unwrap_or(star);
    let mut content = bytes[start + 1..=commas[k]].to_vec();
    content.extend_from_slice(ODD[random.below(ODD.len())].as_bytes());
    content.extend_from_slice(&bytes[end..star]);
    let checksum = content.iter().fold(0, |sum, b| sum ^ b);
    content.extend_from_slice(format!("*{checksum:02X}").as_bytes());
    bytes.splice(start + 1..star + 3, content);
}

#[test]
fn a_damaged_recording_is_read_or_rejected() {
    let file = [recording(4), vendors::recording(4)].concat().into_bytes();
    let other = vendors::recording(2).into_bytes();
    let keys = [ALL, vendors::KEYS].concat();
    let registry = registry();
    let (mut used, count) = (0, files(100));
    for seed in 0..count {
        let random = &mut Random(seed);
        let mut bytes = damaged(&file, &other, random);
        // a field of a sentence whose checksum fits
        for _ in 0..random.below(3) {
            let at = random.below(bytes.len());
            change_field(&mut bytes, at, random);
        }
        let folder = tempfile::tempdir().unwrap();
        let text = scenario(&folder, &bytes, &keys);
        let Ok((sources, _)) = open(&registry, folder.path(), &text) else { continue };
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
