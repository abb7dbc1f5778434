//! Logs of DUNE: packets of IMC.

use crate::generate::dune::{FIRST, fix, log, packet};
use crate::read;
use crate::scenario::{near, read as samples};
use navfuse_core::units::time::Time;
use navfuse_vehicle_logs::Format;

#[test]
fn each_entity_is_an_instance_and_another_vehicle_is_left_out() {
    let (rows, topics, damage) = read(Format::Imc, &log(1));
    let names: Vec<_> = topics.iter().map(|t| (t.name.as_str(), t.instance)).collect();
    let expected = [
        ("AngularVelocity", 30),
        ("Acceleration", 30),
        ("AngularVelocity", 31),
        ("Acceleration", 31),
        ("GroundVelocity", 40),
        ("Depth", 41),
        ("GpsFix", 42),
        ("EstimatedState", 43),
    ];
    assert_eq!((names, damage.bytes()), (expected.to_vec(), 0));
    // the third velocity of the second ping is not valid
    let pings = rows.iter().filter(|(record, _)| record.topic == 4);
    let pings: Vec<&[f64]> = pings.map(|(_, values)| &values[1..]).collect();
    assert_eq!(pings[0], [1.5, -0.1, 0.05]);
    assert!(pings[1][..2] == [1.5, -0.1] && pings[1][2].is_nan());
    // four packets of the inertial units, and four others with every tenth
    assert_eq!(rows.len(), 50 * 4 + 5 * 4);
}

#[test]
fn a_log_fills_sensors_with_what_is_valid() {
    let keys = "sensors.imu = { message = \"AngularVelocity\", instance = 31, with = \"Acceleration\" }\n\
                sensors.depth = { message = \"Depth\" }\n\
                sensors.gnss = { message = \"GpsFix\" }\n\
                sensors.reference = { message = \"EstimatedState\" }";
    let read = samples(&log(1), keys).unwrap();
    let [depth, gnss, imu, reference] = read.samples.as_slice() else { panic!("four") };
    near(&imu[3], &[0.001, -0.002, 0.1, 0.05, 0.5, -9.8], 1e-12);
    near(&depth[1], &[3.25], 1e-12);
    assert_eq!(gnss.len(), 2, "three fixes without a valid position");
    // east at 1.5 m/s; height, accuracies
    let fix: Vec<f64> = (0..8).filter_map(|k| gnss[0].get(k)).collect();
    for (found, expected) in fix.iter().zip([0.7, -0.15, 52.5, 0.0, 1.5]) {
        assert!((found - expected).abs() < 1e-6, "{fix:?}");
    }
    // 100 m north of 0.7 rad on a sphere of the radius of PX4
    let north = reference[0].get(0).unwrap() - 0.7;
    assert!((north * 6_371_000.0 - 100.0).abs() < 0.01, "{north}");
    assert!((reference[0].get(2).unwrap() - 47.0).abs() < 1e-9);
    assert_eq!(imu[1].time, Time::from_nanos(1_700_000_000_270_000_000));
}

#[test]
fn a_changed_byte_costs_its_packet_alone_and_a_simulated_fix_is_none() {
    let one = packet(253, FIRST, (1, 2), &fix(0x7f, 4));
    let (rows, ..) = read(Format::Imc, &one);
    assert_eq!(rows[0].1[0], 0.0);
    let log = [one.clone(), one.clone(), one.clone()].concat();
    for at in one.len()..2 * one.len() {
        let mut damaged = log.clone();
        damaged[at] ^= 0x10;
        assert_eq!(read(Format::Imc, &damaged).0.len(), 2, "byte {at}");
    }
}
