//! Damaged logs: what is intact is used, and the rest is counted. No panic, in bounded time.

use crate::generate::{flight, logs, telemetry_of_flight};
use crate::read;
use navfuse_testing::damage::{Random, damaged, files};
use navfuse_vehicle_logs::Format;

fn format(name: &str) -> Format {
    Format::ALL.into_iter().find(|f| f.name() == name).unwrap()
}

#[test]
fn every_log_is_recognised_whole_and_cut() {
    for (name, log) in logs() {
        assert_eq!(Format::recognise(&log), Some(format(name)), "{name}");
        let half = &log[..log.len() / 2 + 3];
        assert_eq!(Format::recognise(half), Some(format(name)), "{name} cut");
    }
    for other in [&b""[..], b"time_s,depth_m\n0,1\n1,2\n", &[0xff; 4096]] {
        assert_eq!(Format::recognise(other), None);
    }
}

#[test]
fn a_log_that_is_cut_at_any_byte_gives_the_messages_before_the_cut() {
    for (name, log) in logs() {
        let (all, ..) = read(format(name), &log);
        // the last messages: a cut within an earlier one is no different
        for end in log.len() - 400..=log.len() {
            let (rows, _, damage) = read(format(name), &log[..end]);
            let before = all.iter().filter(|(r, _)| r.offset < end as u64).count();
            assert!((before - 1..=before).contains(&rows.len()), "{name} at {end}");
            for ((a, x), (b, y)) in rows.iter().zip(&all) {
                // not a number equals itself here
                let bits = |v: &[f64]| v.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                assert_eq!((a, bits(x)), (b, bits(y)), "{name} at {end}");
            }
            assert_eq!(damage.gaps() > 0, damage.cut().is_some(), "{name} at {end}");
        }
    }
}

#[test]
fn garbage_between_messages_costs_no_message_and_is_counted() {
    for (name, log) in logs() {
        let (all, ..) = read(format(name), &log);
        // bytes that cannot begin a message of any of the formats
        let garbage = [0xff; 37];
        let at = usize::try_from(all[all.len() / 2].0.offset).unwrap();
        let damaged = [&log[..at], &garbage, &log[at..]].concat();
        let (rows, _, damage) = read(format(name), &damaged);
        assert_eq!(rows.len(), all.len(), "{name}");
        assert_eq!((damage.gaps(), damage.bytes()), (1, 37), "{name}");
        assert_eq!(damage.first().next().unwrap().offset, at as u64, "{name}");
    }
}

#[test]
fn a_changed_byte_in_a_message_with_a_checksum_costs_this_message_alone() {
    let log = telemetry_of_flight(1);
    let (all, ..) = read(Format::Tlog, &log);
    let (first, second) = (all[20].0.offset as usize, all[21].0.offset as usize);
    // the first eight bytes are the time of reception, which no checksum protects
    for at in first + 8..second {
        let mut damaged = log.clone();
        damaged[at] ^= 0x10;
        let (rows, _, damage) = read(Format::Tlog, &damaged);
        assert_eq!(rows.len(), all.len() - 1, "byte {at}");
        assert_eq!(damage.bytes(), (second - first) as u64, "byte {at}");
    }
}

#[test]
fn a_lost_definition_costs_its_topic_alone() {
    let log = flight(2);
    let (all, topics, _) = read(Format::Ulog, &log);
    let text = b"vehicle_attitude:uint64_t";
    let at = log.windows(text.len()).position(|w| w == text).unwrap();
    let mut damaged = log;
    damaged[at + 3] = 0;
    let (rows, left, damage) = read(Format::Ulog, &damaged);
    let attitude = topics.iter().position(|t| t.name == "vehicle_attitude").unwrap();
    let lost = all.iter().filter(|(r, _)| r.topic == attitude).count();
    assert_eq!((rows.len(), left.len()), (all.len() - lost, topics.len() - 1));
    // the definition, the subscription and each message
    assert_eq!(damage.gaps(), 2 + lost as u64);
}

#[test]
fn a_damaged_log_is_read_to_its_end() {
    let count = files(300);
    // short logs, so that a change meets every part of them
    let logs: Vec<(&str, Vec<u8>)> = logs()
        .into_iter()
        .map(|(name, log)| {
            let definitions = if name == "ulog" { 1400 } else { 0 };
            (name, log[..log.len().min(definitions + 1500)].to_vec())
        })
        .collect();
    for (k, (name, log)) in logs.iter().enumerate() {
        let format = format(name);
        let other = &logs[(k + 1) % logs.len()].1;
        let (intact, ..) = read(format, log);
        let mut used = 0;
        for seed in 0..count {
            let bytes = damaged(log, other, &mut Random(seed));
            let (rows, _, damage) = read(format, &bytes);
            used += rows.len() as u64;
            // every byte is in a message, in a gap, or the end of a line
            let ends = bytes.iter().filter(|b| b"\r\n".contains(b)).count() as u64;
            let counted = damage.bytes() + damage.intact_bytes();
            let size = bytes.len() as u64;
            assert!((size - ends..=size).contains(&counted), "{name}, seed {seed}");
        }
        // a cut leaves half on average, and a log has one or none of three changes
        assert!(used > count * intact.len() as u64 / 4, "{name}: {used} messages");
        println!("{name}: {count} logs of {} bytes", log.len());
    }
}
