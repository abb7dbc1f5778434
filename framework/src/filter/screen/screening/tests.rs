#![allow(clippy::panic, reason = "a test fails by panicking")]
use super::*;
use crate::model::process::screening::ChannelLimits;
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

/// A screen after 200 samples that alternate, as if the last two had been 4 and 0.
fn warm(integrals: bool) -> Screen {
    let limits = ChannelLimits { range: 1e9, change: None, noise: 0.0, step: 0.0, motion: 0.0 };
    let channels = vec![limits; 2];
    let mut screen = Screen::new(&Screening { channels, integrals, frozen: None, max_bridge: 0.1 });
    for k in 0..200 {
        assert!(take(&mut screen, k, usual(k)));
    }
    (screen.usual.before[0], screen.usual.last[0]) = (4.0, 4.0);
    (screen.usual.before[1], screen.usual.last[1]) = (0.0, 0.0);
    screen
}

/// Half of the roughness 0.3 and of the change from 4 to 7, for each sample of the spike. Increments
/// over 10 ms make a rate of 100 times their size.
#[test]
fn a_replaced_value_is_uncertain_by_half_the_roughness_and_change_times_the_samples() {
    for (integrals, unit) in [(false, 1.0), (true, 0.01)] {
        for samples in 1..=3 {
            let mut screen = warm(integrals);
            (screen.usual.rough[0], screen.usual.rough[1]) = (0.3, 5.0);
            for k in 0..samples {
                take(&mut screen, 200 + k, [504.0, 0.0]);
            }
            take(&mut screen, 200 + samples, [7.0, 0.0]);
            let Some(News::Spike { time, channel, jump, samples: count }) = screen.news else {
                panic!("{:?}", screen.news)
            };
            assert_eq!((time.nanos(), channel, count as i64), (2_000_000_000, 0, samples));
            assert!((jump * unit / 500.0 - 1.0).abs() < 1e-9, "{jump}");
            for k in 0..samples as usize {
                let (_, Some(spread)) = screen.ready[k] else { panic!("{k} is not uncertain") };
                assert!((spread[0] - 1.65 * samples as f64).abs() < 1e-12, "{}", spread[0]);
                assert_eq!(spread[1], 0.0, "the second channel keeps its values");
            }
            assert!(screen.ready[samples as usize].1.is_none(), "the sample after it passes");
        }
    }
}

/// Jumps of 100 and of 10. A roughness of less than a thousandth of the least jump, 9 here, counts
/// as 0.009, so that the second jump is 1111 times its size.
#[test]
fn the_size_of_a_jump_is_never_that_of_a_roughness_far_below_the_least_jump() {
    for (rough, named) in [(0.2, 1), (0.05, 0)] {
        let mut screen = warm(false);
        (screen.usual.rough[0], screen.usual.rough[1]) = (rough, 1e-5);
        (screen.usual.least[0], screen.usual.least[1]) = (0.0, 9.0);
        (screen.usual.before[0], screen.usual.last[0]) = (1000.0, 1000.0);
        take(&mut screen, 200, [1100.0, 10.0]);
        take(&mut screen, 201, [1000.0, 0.0]);
        let Some(News::Spike { channel, .. }) = screen.news else { panic!("{:?}", screen.news) };
        assert_eq!(channel, named, "{rough}");
    }
}

/// A jump by 300 that comes back to within a third, 100, was a spike. An oscillation was none, and
/// four samples away are a step.
#[test]
fn a_channel_that_comes_back_only_half_or_beyond_passes_as_it_came() {
    let spikes = |values: &[f64]| {
        let mut screen = warm(false);
        (screen.usual.before[0], screen.usual.last[0]) = (1000.0, 1000.0);
        for (k, x) in values.iter().enumerate() {
            take(&mut screen, 200 + k as i64, [1000.0 + x, 0.0]);
        }
        let passed = screen.ready.iter().map(|(s, _)| s.get(0).unwrap_or(f64::NAN) - 1000.0);
        (screen.spikes, passed.collect::<Vec<_>>())
    };
    for side in [1.0, -1.0] {
        assert_eq!(spikes(&[300.0 * side, 99.0 * side]).0, 1);
        assert_eq!(spikes(&[300.0 * side, -99.0 * side]).0, 1);
        assert_eq!(spikes(&[300.0 * side, 101.0 * side]), (0, vec![]));
        let away = [300.0, 310.0, 320.0, 330.0].map(|x| x * side);
        assert_eq!(spikes(&away), (0, away.to_vec()));
        let around = [300.0, -300.0, 0.0].map(|x| x * side);
        assert_eq!(spikes(&around), (0, around.to_vec()));
    }
}

#[test]
fn a_sample_that_is_held_at_the_end_gets_the_last_value_and_its_jump_as_uncertainty() {
    let mut screen = warm(false);
    take(&mut screen, 200, [-500.0, 0.25]);
    assert!(screen.ready.is_empty());
    screen.suspects = 0b01;
    screen.finish();
    let [(sample, Some(spread))] = screen.ready.make_contiguous() else {
        panic!("{:?}", screen.ready)
    };
    assert_eq!((sample.get(0), sample.get(1)), (Some(4.0), Some(0.25)));
    assert_eq!((spread[0], spread[1]), (504.0, 0.25));
}

/// A screen in a bridge of the first channel that began at 1 s: the mean is 7 and its change in a
/// second 0.2.
fn bridged(fault: Fault) -> Screen {
    let mut screen = screen();
    let from = Time::from_nanos(1_000_000_000);
    let (to, unknown) = (from, [0.0; MAX_CHANNELS]);
    screen.bridge = Some(Bridge { fault, channels: 0b01, from, to, unknown, reported: false });
    let usual = &mut screen.usual;
    (usual.cadence.interval, usual.mean[0], usual.motion[0], usual.rough[0]) =
        (0.01, 7.0, 0.2, 0.06);
    screen
}

/// Fills a bridge at that time, in seconds, with a sample of 10 and 20.
fn filled(screen: &mut Screen, time: f64) -> (Sample, f64) {
    let time = Time::from_nanos((time * 1e9).round() as i64);
    screen.fill(&Sample::new(time, SensorId(0), &[10.0, 20.0]));
    let Some((sample, Some(spread))) = screen.ready.pop_back() else { panic!("nothing is ready") };
    assert_eq!(spread[1], 0.0);
    assert_eq!(sample.get(1), Some(20.0));
    (sample, spread[0])
}

/// With `s(t) = 1.25 (0.2 sqrt(t) + 0.03)`, the squares of the integrals' uncertainties add up to
/// `(s(t) t)^2`, whatever the samples. After 25 s the rate stays.
#[test]
fn the_spreads_of_a_bridge_add_up_to_the_uncertainty_of_its_integral() {
    let mut screen = bridged(Fault::Frozen);
    let (mut before, mut sum) = (0.0, 0.0_f64);
    for age in [1.0, 4.0, 9.0, 25.0, 49.0_f64] {
        let (sample, spread) = filled(&mut screen, 1.0 + age);
        assert_eq!(sample.get(0), Some(7.0));
        sum += (spread * (age - before)).powi(2);
        let expected = 1.25 * (0.2 * age.min(25.0).sqrt() + 0.03) * age;
        assert!((sum.sqrt() / expected - 1.0).abs() < 1e-12, "{age}");
        before = age;
    }
    // two samples at once are half of the usual interval apart
    let mut screen = bridged(Fault::Frozen);
    let (spread, rate) = (filled(&mut screen, 1.001).1, 1.25 * (0.2 * 0.001_f64.sqrt() + 0.03));
    assert!((spread / (rate * 0.001 / 0.005) - 1.0).abs() < 1e-12, "{spread}");
}

/// The value 10 is 3 from the mean of 7, and half of it is 5; it is 8 from a mean of 2.
#[test]
fn a_stuck_channel_keeps_its_value_and_may_be_wrong_by_half_of_it_or_its_distance_to_the_mean() {
    for (mean, motion, expected) in [(7.0, 0.2, 5.0), (2.0, 0.2, 8.0), (7.0, 6.0, 6.0)] {
        let mut screen = bridged(Fault::Stuck);
        (screen.usual.mean[0], screen.usual.motion[0]) = (mean, motion);
        let (sample, spread) = filled(&mut screen, 2.0);
        assert_eq!(sample.get(0), Some(10.0));
        assert!((spread - 1.25 * (expected + 0.03)).abs() < 1e-12, "{spread}");
    }
}

/// The motion that is always possible is a rate: an increment over 10 ms has a hundredth of it.
#[test]
fn a_bridge_has_at_least_the_motion_that_is_always_possible() {
    for (integrals, least) in [(false, 3.0), (true, 0.03)] {
        let mut screen = bridged(Fault::Frozen);
        let limits = ChannelLimits { range: 1e3, change: None, noise: 0.0, step: 0.0, motion: 3.0 };
        let channels = vec![limits; 2];
        let limits = Screening { channels, integrals, frozen: None, max_bridge: 1.0 };
        let limits = Arc::new(limits);
        screen.usual = Usual::new(Arc::clone(&limits));
        (screen.usual.cadence.interval, screen.usual.mean[0], screen.limits) = (0.01, 7.0, limits);
        let (_, spread) = filled(&mut screen, 2.0);
        assert!((spread - 1.25 * least).abs() < 1e-12, "{integrals}: {spread}");
    }
}

/// Two repetitions count as frozen here. The bridge begins with the values that repeat, and one of
/// more than 0.1 s is reported while it lasts.
#[test]
fn a_bridge_is_reported_once_where_it_ends_or_becomes_too_long() {
    let limits = ChannelLimits { range: 1e3, change: None, noise: 0.0, step: 0.0, motion: 0.0 };
    let channels = vec![limits; 2];
    let frozen = Some(0.02);
    let mut screen =
        Screen::new(&Screening { channels, integrals: false, frozen, max_bridge: 0.1 });
    let mut k = 0;
    let mut news = |fresh: i64, still: i64| {
        let mut found = Vec::new();
        for step in 0..fresh + still {
            take(&mut screen, k, usual(if step < fresh { k } else { k - 1 - (step - fresh) }));
            k += 1;
            if let Some(News::Bridge { from, to, too_long, first, .. }) = screen.news.take() {
                found.push((k, from.nanos(), to.nanos(), too_long, first));
            }
        }
        found
    };
    assert_eq!(news(200, 5), []);
    let [(at, from, to, false, true)] = news(40, 0)[..] else { panic!("no end of the bridge") };
    // fresh values from the sample 205 on; 199 was the first of the identical ones
    assert_eq!((at, to), (206, 2_040_000_000));
    assert!((1_979_999_990..=1_990_000_000).contains(&from), "{from}");
    assert_eq!(news(0, 5), []);
    assert!(matches!(news(40, 0)[..], [(251, _, 2_490_000_000, false, false)]));
    let long = news(0, 30);
    let [(at, from, to, true, true)] = long[..] else { panic!("{long:?}") };
    assert_eq!(to, (at - 1) * 10_000_000);
    assert!(to - from > 100_000_000 && to - from <= 110_000_010, "{from} {to}");
    assert_eq!(news(40, 0), [], "it was reported");
    assert!(matches!(news(0, 30)[..], [(_, _, _, true, false)]));
}

/// The line from 0 to 4 is at 2 after a spike of one sample.
#[test]
fn a_spike_or_a_bridge_of_the_second_channel_leaves_the_first() {
    let mut screen = warm(false);
    screen.usual.rough[1] = 0.01;
    take(&mut screen, 200, [4.25, 500.0]);
    take(&mut screen, 201, [4.0, 4.0]);
    let Some((sample, Some(spread))) = screen.ready.pop_front() else { panic!("no spike") };
    assert_eq!((sample.get(0), sample.get(1)), (Some(4.25), Some(2.0)));
    assert_eq!((spread[0], spread[1]), (0.0, 0.5 * (0.01 + 4.0)));
    let mut screen = bridged(Fault::Frozen);
    screen.bridge.iter_mut().for_each(|bridge| bridge.channels = 0b10);
    screen.usual.mean[1] = 8.0;
    screen.fill(&Sample::new(Time::from_nanos(2_000_000_000), SensorId(0), &[10.0, 20.0]));
    let Some((sample, Some(spread))) = screen.ready.pop_front() else { panic!("no sample") };
    assert_eq!((sample.get(0), sample.get(1)), (Some(10.0), Some(8.0)));
    assert_eq!((spread[0], spread[1]), (0.0, 0.0));
}

#[test]
fn a_repetition_leaves_the_recent_mean() {
    let mut screen = warm(false);
    assert!(take(&mut screen, 200, [4.5, 0.05]));
    let mean = screen.usual.mean[0];
    take(&mut screen, 201, [4.5, 0.05]);
    assert_eq!(screen.usual.mean[0], mean);
    take(&mut screen, 202, [4.75, 0.05]);
    assert!((screen.usual.mean[0] - (mean + (4.75 - mean) / 16.0)).abs() < 1e-12);
}

/// A repetition in a bridge belongs to it, however few they are, unless only a channel was stuck.
#[test]
fn a_bridge_ends_with_a_good_sample_that_is_no_repetition() {
    let ends = |fault: Fault, in_a_row: u32| {
        let mut screen = bridged(fault);
        screen.repeats.in_a_row = in_a_row;
        let time = Time::from_nanos(1_010_000_000);
        let passes = screen.go_on(&Sample::new(time, SensorId(0), &[10.0, 20.0]), None);
        assert_eq!(passes, screen.bridge.is_none());
        passes
    };
    assert!(!ends(Fault::Frozen, 1) && !ends(Fault::Frozen, 2));
    assert!(ends(Fault::Frozen, 0) && ends(Fault::Stuck, 1) && ends(Fault::Stuck, 0));
}

#[test]
fn a_bridge_keeps_the_name_of_its_first_fault_unless_a_stuck_sensor_freezes() {
    let name = |first: Fault, then: Fault| {
        let mut screen = bridged(first);
        let time = Time::from_nanos(1_010_000_000);
        screen.go_on(&Sample::new(time, SensorId(0), &[10.0, 20.0]), Some((then, 0b11)));
        screen.bridge.map(|bridge| bridge.fault)
    };
    assert_eq!(name(Fault::Stuck, Fault::Frozen), Some(Fault::Frozen));
    assert_eq!(name(Fault::Stuck, Fault::Range), Some(Fault::Stuck));
    assert_eq!(name(Fault::Zeros, Fault::Frozen), Some(Fault::Zeros));
}

/// Six channels with repetitions, steps of a quantisation, spikes and values beyond the range: a
/// processor without vector instructions takes one channel at a time.
#[test]
fn the_screening_is_the_same_to_the_bit_on_any_processor() {
    let channel =
        |change, step| ChannelLimits { range: 50.0, change, noise: 1e-4, step, motion: 0.0 };
    let mut channels = vec![channel(None, 0.0); 4];
    channels.extend([channel(Some(900.0), 0.0), channel(None, 0.1)]);
    let limits = Screening { channels, integrals: false, frozen: None, max_bridge: 10.0 };
    let (mut wide, mut single) = (Screen::new(&limits), Screen::new(&limits));
    let mut seed = 7_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut passed, mut held) = (0, 0);
    for k in 0..20_000 {
        let mut values: [f64; 6] = std::array::from_fn(|_| uniform() - 0.5);
        values[5] = (10.0 * values[5]).round() / 10.0;
        if k % 997 == 500 {
            values[k as usize % 6] = if k % 2 == 0 { 40.0 } else { 60.0 };
        }
        let sample = Sample::new(Time::from_nanos(k * 10_000_000), SensorId(0), &values);
        let passes = wide.take(&sample);
        assert_eq!(passes, single.judge(Scalar::new(), &sample), "{k}");
        (passed, held) = (passed + u32::from(passes), held + u32::from(!passes));
        let bits = |screen: &Screen| {
            let usual = &screen.usual;
            [usual.rough, usual.mean, usual.least].map(|spread| spread.map(f64::to_bits))
        };
        assert_eq!(bits(&wide), bits(&single), "{k}");
        assert_eq!((&wide.ready, wide.news), (&single.ready, single.news), "{k}");
        wide.ready.clear();
        single.ready.clear();
    }
    assert!(passed > 19_000 && held > 20 && wide.spikes > 5, "{passed} {held} {}", wide.spikes);
}

/// Nothing is known to bridge them with: neither the last good sample nor the usual motion.
#[test]
fn zeros_and_values_out_of_range_at_the_beginning_are_skipped() {
    let mut screen = screen();
    assert!(!take(&mut screen, 0, [2e3, 0.1]) && !take(&mut screen, 1, [0.1, 2e3]));
    assert!((2..7).all(|k| !take(&mut screen, k, [0.0; 2])));
    assert!(screen.ready.is_empty() && screen.held.is_empty() && screen.bridge.is_none());
    assert!(take(&mut screen, 7, usual(7)));
    let skipped = |fault, to| {
        let (from, to) = (Time::from_nanos(0), Time::from_nanos(to));
        News::Skipped(Skipped { fault, channels: 0b11, from, to })
    };
    assert_eq!(screen.news.take(), Some(skipped(Fault::Range, 60_000_000)));
    assert!((8..200).all(|k| take(&mut screen, k, usual(k))));
    // a sensor that never works is reported too
    let mut dead = self::screen();
    assert!((0..5).all(|k| !take(&mut dead, k, [0.0; 2])));
    dead.finish();
    assert_eq!(dead.news, Some(skipped(Fault::Zeros, 40_000_000)));
}

/// A fault before the filter begins is reported once more if it reaches into the run.
#[test]
fn a_bridge_that_became_too_long_before_the_run_is_reported_in_it() {
    let mut screen = warm(false);
    let long = |screen: &mut Screen, samples: std::ops::Range<i64>| {
        samples
            .filter(|&k| {
                take(screen, k, [0.0; 2]);
                let news = screen.news.take();
                matches!(news, Some(News::Bridge { too_long: true, first: true, .. }))
            })
            .count()
    };
    assert_eq!(long(&mut screen, 200..230), 1);
    assert_eq!(long(&mut screen, 230..240), 0);
    screen.begin_run();
    assert_eq!(long(&mut screen, 240..250), 1);
}
