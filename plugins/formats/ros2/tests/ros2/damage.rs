//! Damaged bags: whatever is intact is used, the rest is reported with offset and number, and no
//! input makes the reader panic or fill the memory.

use crate::recorder::{SIZE, mcap, sqlite, usual};
use navfuse_ros2::{Bag, survey};
use navfuse_testing::damage::{Random, damaged, files};
use std::path::Path;

/// Rates and faults of the bag in a file.
fn rates(path: &Path, bytes: &[u8]) -> (Vec<f64>, Option<String>) {
    std::fs::write(path, bytes).unwrap();
    let Ok(mut bag) = Bag::open(&[path.to_owned()]) else { return (Vec::new(), None) };
    let mut found = Vec::new();
    while let Some(message) = bag.next(|_| true).unwrap() {
        if message.data.len() >= SIZE {
            let at = 20 + 13 * 8;
            found.push(f64::from_le_bytes(message.data[at..at + 8].try_into().unwrap()));
        }
    }
    (found, bag.faults())
}

fn kinds() -> [(Option<mcap::Compression>, Option<u64>); 4] {
    [
        (None, None),
        (None, Some(2048)),
        (Some(mcap::Compression::Zstd), Some(2048)),
        (Some(mcap::Compression::Lz4), Some(2048)),
    ]
}

#[test]
fn a_bag_cut_off_anywhere_gives_every_message_before_the_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    for (compression, chunk) in kinds() {
        let bytes = mcap(&usual(24), compression, chunk);
        let (all, faults) = rates(&path, &bytes);
        assert_eq!((all, faults), ((0..24).map(f64::from).collect(), None));
        let mut before = 0;
        for cut in (0..bytes.len()).step_by(7) {
            let (found, faults) = rates(&path, &bytes[..cut]);
            let expected: Vec<f64> = (0..found.len()).map(|k| k as f64).collect();
            assert_eq!(found, expected, "{compression:?} {cut}");
            assert!(found.len() >= before, "{compression:?} {cut}");
            before = found.len();
            if cut > 100 && found.len() < 24 {
                assert!(faults.unwrap().contains("cut off at byte"), "{compression:?} {cut}");
            }
        }
        assert_eq!(before, 24, "{compression:?}");
    }
}

#[test]
fn a_damaged_chunk_costs_its_messages_and_a_damaged_length_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    for (compression, chunk) in kinds() {
        let bytes = mcap(&usual(40), compression, chunk);
        let mut lost_most = 0;
        for at in (300..bytes.len() * 3 / 5).step_by(13) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x5a;
            let (found, _) = rates(&path, &damaged);
            // a chunk has six messages at most; without chunks one byte is in one message
            let intact = found.iter().filter(|r| (0.0..40.0).contains(*r) && r.fract() == 0.0);
            lost_most = lost_most.max(40 - intact.count().min(40));
        }
        let bound = if chunk.is_some() { 7 } else { 2 };
        // the first chunk has the description of the channel: its loss is that of all messages
        assert!(lost_most <= bound || lost_most == 40, "{compression:?}: {lost_most}");
    }
    let bytes = mcap(&usual(40), Some(mcap::Compression::Zstd), Some(2048));
    let mut damaged = bytes.clone();
    damaged[bytes.len() / 2] ^= 1;
    let (found, faults) = rates(&path, &damaged);
    let faults = faults.unwrap();
    assert!(found.len() >= 33, "{}: {faults}", found.len());
    assert!(faults.contains("1 chunk skipped, damaged, at byte"), "{faults}");
}

#[test]
fn garbage_between_records_is_skipped_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.mcap");
    let bytes = mcap(&usual(40), Some(mcap::Compression::Zstd), Some(2048));
    // at the second chunk: after the index of the first
    let chunk = (9..bytes.len() - 60)
        .filter(|k| bytes[*k] == 6 && bytes[k + 1 + 8 + 28..].starts_with(b"\x04\0\0\0zstd"));
    let at = chunk.clone().nth(1).unwrap();
    let garbage = b"\x05\x06 some garbage \x04\x03".repeat(9);
    let mixed = [&bytes[..at], &garbage, &bytes[at..]].concat();
    let (found, faults) = rates(&path, &mixed);
    assert_eq!(found.len(), 40);
    let faults = faults.unwrap();
    let words =
        format!("1 place without an intact record at byte {at}, {} bytes skipped", garbage.len());
    assert!(faults.contains(&words), "{faults}");
}

#[test]
fn a_database_cut_off_or_damaged_gives_the_rows_of_its_intact_pages() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.db3");
    let bytes = sqlite(&usual(30));
    let (all, faults) = rates(&path, &bytes);
    assert_eq!((all, faults), ((0..30).map(f64::from).collect(), None));
    let mut before = 0;
    for cut in (0..bytes.len()).step_by(97) {
        let (found, faults) = rates(&path, &bytes[..cut]);
        let expected: Vec<f64> = (0..found.len()).map(|k| k as f64).collect();
        assert_eq!(found, expected, "{cut}");
        assert!(found.len() >= before, "{cut}");
        before = found.len();
        if cut > 2048 {
            assert!(faults.unwrap().contains("skipped,"), "{cut}");
        }
    }
    assert!(before >= 29);
    // the type of one leaf: the page of the tenth row
    let mut damaged = bytes.clone();
    let leaf = 3 + 9 + 2;
    damaged[leaf * 512] = 0x77;
    let (found, faults) = rates(&path, &damaged);
    assert_eq!(found.len(), 29, "{faults:?}");
    assert!(faults.unwrap().contains(&format!("at byte {}", leaf * 512)));
}

/// Most memory that this process has had, bytes.
fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
}

#[test]
fn a_damaged_bag_makes_no_reader_panic_or_fill_the_memory() {
    let inputs = files(3000);
    let mut seeds: Vec<Vec<u8>> =
        kinds().iter().map(|(packing, chunk)| mcap(&usual(12), *packing, *chunk)).collect();
    seeds.push(sqlite(&usual(12)));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag");
    let (before, mut messages) = (peak(), 0);
    for k in 0..inputs {
        let (bag, other) = (k as usize % seeds.len(), (k as usize + 1) % seeds.len());
        let bytes = damaged(&seeds[bag], &seeds[other], &mut Random(k));
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(found) = survey(std::slice::from_ref(&path), || false) {
            messages += found.map_or(0, |s| s.topics.iter().map(|t| t.messages).sum::<u64>());
        }
    }
    // a test that reads nothing would pass as well
    assert!(messages > inputs, "{messages} messages of {inputs} bags");
    if let (Some(before), Some(after)) = (before, peak()) {
        // a chunk of 64 MiB, packed and unpacked, and the window on the file with it
        let grown = (after - before) >> 20;
        println!("{inputs} inputs, {messages} messages, {grown} MiB more");
        assert!(grown < 300, "{grown} MiB");
    }
}
