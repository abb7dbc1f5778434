//! Damaged files: whatever is intact is used, and the rest is reported with offset and number.

use crate::generate::records;
use crate::read;
use navfuse_dvl_files::{Format, Ping};
use navfuse_testing::damage::{Random, damaged, files};
use proptest::prelude::*;

/// The content of a ping without its place in the file.
fn content(pings: &[Ping]) -> Vec<Ping> {
    pings.iter().map(|p| Ping { offset: 0, ..*p }).collect()
}

/// A file of some records, their first bytes and its length, and its pings.
fn file(format: Format, count: u32) -> (Vec<u8>, Vec<usize>, Vec<Ping>) {
    let records = records(format.name(), count);
    let mut starts = vec![0];
    starts.extend(records.iter().scan(0, |at, r| {
        *at += r.len();
        Some(*at)
    }));
    let bytes = records.concat();
    let (pings, damage) = read(format, &bytes);
    assert_eq!((pings.len(), damage.describe("record")), (records.len(), None), "{format:?}");
    for (ping, start) in pings.iter().zip(&starts) {
        assert_eq!(ping.offset, *start as u64, "{format:?}");
        let axes = ping.bottom.unwrap().axes.unwrap();
        let error = axes.iter().zip([1.5, -0.1, 0.02]).map(|(a, b)| (a - b).abs());
        assert!(error.fold(0.0, f64::max) < 1e-6, "{format:?}: {axes:?}");
    }
    (bytes, starts, pings)
}

/// Tests whether an ensemble consists of several records with a meaning of their own.
fn in_sentences(format: Format) -> bool {
    format == Format::Pd6
}

#[test]
fn a_file_cut_off_anywhere_gives_every_ping_before_the_cut() {
    for format in Format::ALL {
        let (bytes, starts, pings) = file(format, 3);
        for cut in 0..bytes.len() {
            let (found, damage) = read(format, &bytes[..cut]);
            let whole = starts.iter().filter(|s| **s > 0 && **s <= cut).count();
            if in_sentences(format) {
                // the last ensemble may have lost a part
                assert!(found.len() >= whole && found.len() <= whole + 1, "{cut}");
                assert_eq!(found[..whole], pings[..whole], "{cut}");
                continue;
            }
            // the line end after the checksum is not needed
            let whole = whole.max(found.len());
            assert!(starts[whole] <= cut + 2, "{format:?} {cut}");
            assert_eq!(found, pings[..whole], "{format:?} {cut}");
            if cut > starts[whole] {
                let separator =
                    |b: &&u8| format == Format::WaterLinkedJson && b",[] \r\n".contains(b);
                let lost = bytes[starts[whole]..cut].iter().filter(|b| !separator(b));
                assert_eq!(damage.bytes(), lost.count() as u64, "{format:?} {cut}");
                assert_eq!(damage.cut(), Some(starts[whole] as u64), "{format:?} {cut}");
            }
        }
        for from in 1..starts[1] {
            let (found, damage) = read(format, &bytes[from..]);
            if !in_sentences(format) {
                assert_eq!(content(&found), content(&pings[1..]), "{format:?} from {from}");
                assert!(damage.bytes() <= (starts[1] - from) as u64);
            }
        }
    }
}

#[test]
fn a_changed_byte_costs_the_record_that_it_is_in() {
    for format in Format::ALL.into_iter().filter(|f| !in_sentences(*f)) {
        let (bytes, starts, pings) = file(format, 3);
        for at in starts[1]..starts[2] {
            let mut changed = bytes.clone();
            changed[at] ^= 0x15;
            let (found, damage) = read(format, &changed);
            if format == Format::WaterLinkedJson && damage.gaps() == 0 {
                // JSON has no checksum, so that a digit or a name can become another
                continue;
            }
            // the last two bytes may be a line end, which is not part of a sentence
            if found.len() == 3 {
                assert!(at + 2 >= starts[2], "{format:?} {at}");
                continue;
            }
            assert_eq!(found, [pings[0], pings[2]], "{format:?} {at}");
            let gap = damage.first().next().unwrap();
            assert_eq!((damage.gaps(), gap.offset), (1, starts[1] as u64), "{format:?} {at}");
        }
    }
}

#[test]
fn garbage_and_sentences_of_others_between_the_records_are_counted() {
    let other = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n";
    let noise: Vec<u8> = (0..=255).chain((0..=255).rev()).collect();
    let marks = [0x7f, 0x7f, 0xff, 0xff, 0x7d, 0x00, 45, 0, 0xa5, 10, b'{', b'"', b'w', b'$', b':'];
    for format in Format::ALL {
        let (_, _, pings) = file(format, 5);
        for garbage in [&other[..], &noise, &marks, &[0; 300]] {
            let mut bytes = Vec::new();
            let mut last = 0;
            for record in records(format.name(), 5) {
                bytes.extend(garbage);
                last = bytes.len() as u64;
                bytes.extend(record);
            }
            let (found, damage) = read(format, &bytes);
            assert_eq!(content(&found), content(&pings), "{format:?}");
            assert_eq!(found[4].offset, last, "{format:?}");
            // sentences of others are intact NMEA
            let known = format == Format::NortekNmea && garbage.starts_with(b"$");
            if !known {
                let text = damage.describe("record").unwrap();
                assert!(damage.gaps() >= 5 && text.contains("at byte 0: "), "{format:?}: {text}");
                assert!(damage.bytes() <= 5 * garbage.len() as u64, "{format:?}");
            }
        }
    }
}

#[test]
fn a_lost_beginning_of_a_pd6_ensemble_does_not_mix_two_ensembles() {
    let records = records("pd6", 3);
    let text = String::from_utf8(records[1].clone()).unwrap();
    let without = text.split_once("\r\n").unwrap().1;
    let (found, _) =
        read(Format::Pd6, &[&records[0][..], without.as_bytes(), &records[2]].concat());
    let (whole, _) = read(Format::Pd6, &records.concat());
    assert_eq!(found.len(), 3);
    for (f, w) in found.iter().zip(&whole) {
        assert_eq!((f.stamp, f.bottom), (w.stamp, w.bottom));
    }
}

#[test]
fn a_report_that_was_logged_twice_is_used_once() {
    let records = records("water-linked-json", 2);
    let bytes = [&records[0][..], &records[0], &records[1]].concat();
    let (found, damage) = read(Format::WaterLinkedJson, &bytes);
    assert_eq!((found.len(), damage.gaps()), (2, 0));
}

/// A checksum that fits again, so that a change reaches the reader behind the framing.
fn repair(format: Format, record: &mut Vec<u8>) {
    match format {
        Format::Pd0 | Format::Pd4 if record.len() > 8 => {
            let at = record.len() - 2;
            let length = (at as u16).to_le_bytes();
            record[2..4].copy_from_slice(&length);
            let sum = record[..at].iter().fold(0_u16, |s, b| s.wrapping_add(u16::from(*b)));
            record[at..].copy_from_slice(&sum.to_le_bytes());
        }
        Format::Ad2cp if record.len() > 10 => {
            let (id, content) = (record[2], record[10..].to_vec());
            *record = crate::generate::ad2cp(id, &content, false);
        }
        Format::NortekNmea | Format::WaterLinkedSerial => {
            let text: String = String::from_utf8_lossy(record)
                .chars()
                .filter(|c| (' '..='~').contains(c) && !"$*!".contains(*c))
                .collect();
            *record = if format == Format::NortekNmea {
                crate::generate::nmea(&text)
            } else {
                crate::generate::water_linked(&text)
            };
        }
        _ => {}
    }
}

/// Checks what holds for any bytes.
fn sound(format: Format, bytes: &[u8]) {
    let (pings, damage) = read(format, bytes);
    assert!(damage.bytes() + damage.intact_bytes() <= bytes.len() as u64);
    assert!(pings.is_sorted_by_key(|p| p.offset));
    assert!(pings.iter().all(|p| p.offset < bytes.len().max(1) as u64));
    for track in pings.iter().flat_map(|p| [p.bottom, p.water]).flatten() {
        let axes = track.axes.iter().flatten().copied();
        let rest = [track.recorded, track.range].concat().into_iter().flatten();
        assert!(axes.chain(rest).all(f64::is_finite), "{track:?}");
    }
}

#[test]
fn damaged_files_and_records_are_read_to_their_end() {
    for seed in 0..files(200) {
        let random = &mut Random(seed);
        let format = Format::ALL[random.below(Format::ALL.len())];
        let other = records(Format::ALL[random.below(Format::ALL.len())].name(), 1).concat();
        let mut records = records(format.name(), 4);
        if random.below(2) == 0 {
            sound(format, &damaged(&records.concat(), &other, random));
        } else {
            records[1] = damaged(&records[1], &other, random);
            repair(format, &mut records[1]);
            sound(format, &records.concat());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 200, failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn any_bytes_are_read_to_their_end(
        format in prop::sample::select(Format::ALL.to_vec()),
        bytes in prop::collection::vec(any::<u8>(), 0..600)
    ) {
        sound(format, &bytes);
    }
}

/// Bytes that begin a record at many places. A reader that judged each of them up to the largest
/// record would take the product of the sizes of file and record: 0.5 GB for the first one, and
/// half a minute in a test without optimisation.
#[test]
fn hostile_bytes_take_bounded_time() {
    let hostile: [(Format, Vec<u8>); 7] = [
        (Format::Pd0, [0x7f, 0x7f, 0xf0, 0x7f, 0, 1, 8, 0].repeat(2000)),
        (Format::Pd4, [0x7d, 0, 45, 0].repeat(4000)),
        (Format::Ad2cp, [0xa5, 10].repeat(8000)),
        (Format::WaterLinkedJson, b"{\"a\":[".repeat(10_000)),
        (Format::WaterLinkedJson, b"{".repeat(64_000)),
        (Format::WaterLinkedJson, b"{\"\\{".repeat(16_000)),
        (Format::NortekNmea, b"$PNORBT7,1".repeat(2000)),
    ];
    for (format, bytes) in hostile {
        let started = std::time::Instant::now();
        sound(format, &bytes);
        assert!(started.elapsed().as_secs() < 10, "{format:?}: {:?}", started.elapsed());
    }
}
