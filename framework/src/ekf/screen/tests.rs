#![allow(clippy::panic, reason = "a test fails by panicking")]
use super::*;
use crate::model::screening::ChannelLimits;
use crate::units::sample::SensorId;

/// Two channels at 100 Hz.
fn screen() -> Screen {
    let limits = ChannelLimits { range: 1e3, change: None, noise: 0.0, step: 0.0, motion: 0.0 };
    let channels = vec![limits; 2];
    Screen::new(&Screening { channels, integrals: false, frozen: None, max_bridge: 10.0 })
}

fn take(screen: &mut Screen, k: i64, values: [f64; 2]) -> bool {
    screen.take(&Sample::new(Time::from_nanos(k * 10_000_000), SensorId(0), &values))
}

/// Values that alternate with the period 4, with a size of 1 and of 0.01.
fn usual(k: i64) -> [f64; 2] {
    let x = [0.5, 1.0, 0.3, -1.0][k.rem_euclid(4) as usize];
    [x, 0.01 * x]
}

/// A jump of 100 is 100 times the size of the first channel, and one of 10 is 1000 times that
/// of the second.
#[test]
fn a_spike_is_named_by_the_channel_whose_jump_is_largest_for_its_roughness() {
    let mut screen = screen();
    for k in 0..200 {
        assert!(take(&mut screen, k, usual(k)));
    }
    assert!(!take(&mut screen, 200, [100.0, 10.0]));
    take(&mut screen, 201, usual(201));
    let Some(News::Spike { channel, samples, .. }) = screen.news else {
        panic!("{:?}", screen.news)
    };
    assert_eq!((channel, samples, screen.spikes), (1, 1, 1));
}

/// The first channel is stuck after 25 equal samples. Once the second one repeats its value too,
/// the sensor is frozen, and both channels of the replaced samples are uncertain.
#[test]
fn a_bridge_names_every_channel_that_was_faulty_within_it() {
    let mut screen = screen();
    for k in 0..1100 {
        take(&mut screen, k, usual(k));
    }
    let mut bridged = |k: i64, second: f64| {
        take(&mut screen, k, [0.5, second]);
        screen.bridge.map(|bridge| (bridge.fault, bridge.channels))
    };
    let moving: Vec<_> = (1100..1140).map(|k| bridged(k, 1e-4 * k as f64)).collect();
    assert_eq!(moving.last(), Some(&Some((Fault::Stuck, 0b01))));
    let still: Vec<_> = (1140..1180).map(|k| bridged(k, 0.0)).collect();
    assert_eq!(still.last(), Some(&Some((Fault::Frozen, 0b11))));
}

/// Between 4 before a spike of two samples and 7 after it are 5 and 6.
#[test]
fn the_samples_of_a_spike_are_replaced_by_those_on_a_line() {
    let mut screen = screen();
    for k in 0..200 {
        let [x, y] = usual(k);
        take(&mut screen, k, [4.0 + x, y]);
    }
    take(&mut screen, 200, [4.0, 0.0]);
    screen.ready.clear();
    take(&mut screen, 201, [500.0, 0.0]);
    take(&mut screen, 202, [500.0, 0.0]);
    take(&mut screen, 203, [7.0, 0.0]);
    let found: Vec<f64> = screen.ready.iter().filter_map(|(s, _)| s.get(0)).collect();
    assert_eq!(found, [5.0, 6.0, 7.0]);
}
