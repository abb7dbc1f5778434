use super::*;
use crate::model::process::screening::ChannelLimits;
use pulp::Scalar;

/// One channel at 100 Hz whose stated noise hides no step of 1.
fn usual() -> Usual {
    let limits = ChannelLimits { range: 1e9, change: None, noise: 1e-4, step: 0.0, motion: 0.0 };
    let channels = vec![limits];
    let limits = Screening { channels, integrals: false, frozen: None, max_bridge: 1.0 };
    Usual::new(Arc::new(limits))
}

/// Feeds the values, and returns how many of them jump.
fn jumps(usual: &mut Usual, values: impl IntoIterator<Item = f64>) -> usize {
    let jumps = |x: f64| {
        let time = Time::from_nanos(usual.time.nanos().max(0) + 10_000_000);
        let mut values = [0.0; MAX_CHANNELS];
        values[0] = x;
        usual.tick(time);
        let jumping = usual.jumping(Scalar::new(), &values) != 0;
        usual.learn(Scalar::new(), &values, time, true);
        jumping
    };
    values.into_iter().map(jumps).filter(|jumps| *jumps).count()
}

/// One step of the quantisation in 150 samples: the mean second difference is 4/150 of a step,
/// and a step bends the line by 2 steps, 75 times as much. In the second half a text with 8
/// digits rounds each value.
#[test]
fn a_step_of_a_quiet_quantised_sensor_is_no_jump() {
    let quantised = |k: usize| f64::from(u8::from(k % 150 == 149)) - 9.8;
    let rounded = move |k: usize| quantised(k) + 1e-8 * (k % 3) as f64;
    let mut usual = usual();
    assert_eq!(jumps(&mut usual, (0..6000).map(quantised)), 0);
    assert_eq!(jumps(&mut usual, (6000..12_000).map(rounded)), 0);
    assert_eq!(jumps(&mut usual, [40.0]), 1, "40 steps are a jump");
}

#[test]
fn a_jump_of_60_sigma_of_white_noise_is_found_and_one_of_20_is_not() {
    // the sum of 12 uniform numbers has the variance 1; the sequence is a linear congruence
    let mut seed = 1_u64;
    let mut uniform = move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut noise = std::iter::repeat_with(|| (0..12).map(|_| uniform()).sum::<f64>() - 6.0);
    let mut usual = usual();
    assert_eq!(jumps(&mut usual, noise.by_ref().take(5000)), 0);
    // sqrt(6) sigma times sqrt(2/pi)
    assert!((usual.rough[0] / 1.95 - 1.0).abs() < 0.15, "{}", usual.rough[0]);
    assert_eq!(jumps(&mut usual.clone(), [20.0]), 0);
    assert_eq!(jumps(&mut usual, [60.0]), 1);
}

/// Ticks at that interval, in seconds, and returns the least jump.
fn least(usual: &mut Usual, interval: f64, ticks: u32) -> f64 {
    for _ in 0..ticks {
        let now = usual.time.nanos().max(0) + (interval * 1e9).round() as i64;
        usual.tick(Time::from_nanos(now));
        usual.count += 1;
    }
    usual.least[0]
}

/// The noise of one sample is its density over the root of the interval. The limits change
/// where the interval changes by 0.1 % in one step of 1/64 of the difference: they stay within
/// 6.4 % of the interval, or 3.2 % of its root.
#[test]
fn the_least_jump_is_50_sigma_of_one_sample_and_25_steps_at_any_rate() {
    let of = |integrals: bool| {
        let limits =
            ChannelLimits { range: 1e9, change: None, noise: 1e-4, step: 1e-5, motion: 0.0 };
        let channels = vec![limits];
        Usual::new(Arc::new(Screening { channels, integrals, frozen: None, max_bridge: 1.0 }))
    };
    for interval in [0.0005_f64, 0.01, 1.0] {
        let expected = 50.0 * 1e-4 / interval.sqrt() + 25.0 * 1e-5;
        let rate = least(&mut of(false), interval, 2);
        assert!((rate / expected - 1.0).abs() < 1e-12, "{interval}: {rate}");
        // an increment is the rate times the interval
        let increment = least(&mut of(true), interval, 2);
        assert!((increment / (expected * interval) - 1.0).abs() < 1e-12, "{interval}");
    }
    let mut usual = of(false);
    least(&mut usual, 0.01, 20);
    let (found, expected) = (least(&mut usual, 0.005, 500), 50.0 * 1e-4 / 0.005_f64.sqrt());
    assert!((found / (expected + 25.0 * 1e-5) - 1.0).abs() < 0.035, "{found}");
}

/// The first 16 samples have equal weights. After those the mean keeps 15/16 of itself at each
/// sample. A repetition leaves it.
#[test]
fn the_recent_mean_is_that_of_16_samples_and_fades_after() {
    let mut usual = usual();
    jumps(&mut usual, (1..=16).map(f64::from));
    assert!((usual.mean[0] - 8.5).abs() < 1e-12, "{}", usual.mean[0]);
    jumps(&mut usual, [0.0; 4]);
    let faded = 8.5 * (15.0_f64 / 16.0).powi(4);
    assert!((usual.mean[0] - faded).abs() < 1e-12, "{}", usual.mean[0]);
    usual.learn(Scalar::new(), &[0.0; MAX_CHANNELS], usual.time, false);
    assert!((usual.mean[0] - faded).abs() < 1e-12, "{}", usual.mean[0]);
}

/// Equal second differences of 3 have a roughness of `3 g` with `g = 2/pi`. With half of the
/// weight, one of `8 * 3 g` makes it `g (9 + (24 g)^2) / (3 + 24 g)`.
#[test]
fn one_large_second_difference_counts_as_8_times_the_roughness() {
    let mut usual = usual();
    usual.roughen(Scalar::new(), &[3.0; MAX_CHANNELS], 1.0);
    assert!((usual.rough[0] - 3.0 * GAUSSIAN).abs() < 1e-15, "{}", usual.rough[0]);
    usual.count = WARM + 1;
    usual.roughen(Scalar::new(), &[1e9; MAX_CHANNELS], 0.5);
    let most = 24.0 * GAUSSIAN;
    let expected = GAUSSIAN * (9.0 + most * most) / (3.0 + most);
    assert!((usual.rough[0] - expected).abs() < 1e-13, "{} {expected}", usual.rough[0]);
}

/// Each interval from two thirds of the usual one to three halves weighs 1/64.
#[test]
fn a_gap_a_burst_or_a_repeated_time_leaves_the_usual_interval() {
    for (nanos, expected) in [
        (14_800_000, 0.0048 / 64.0),
        (15_200_000, 0.0),
        (7_000_000, -0.003 / 64.0),
        (6_000_000, 0.0),
        (0, 0.0),
        (-10_000_000, 0.0),
    ] {
        let mut usual = usual();
        for nanos in [0, 10_000_000, 10_000_000 + nanos] {
            usual.tick(Time::from_nanos(nanos));
        }
        let found = usual.interval() - 0.01;
        assert!((found - expected).abs() < 1e-15, "{nanos}: {found}");
    }
}

/// Two samples, 1 and 4, let the line expect 7.
#[test]
fn a_learnt_jump_leaves_the_line_by_25_roughnesses_and_by_the_least_jump() {
    let jumping = |rough: f64, least: f64, x: f64| {
        let mut usual = usual();
        (usual.before[0], usual.last[0], usual.count) = (1.0, 4.0, WARM);
        (usual.rough[0], usual.least[0]) = (rough, least);
        let mut values = [0.0; MAX_CHANNELS];
        values[0] = x;
        let warm = usual.jumping(Scalar::new(), &values) == 1;
        usual.count = WARM - 1;
        assert_eq!(usual.jumping(Scalar::new(), &values), 0, "too few samples to judge");
        warm
    };
    for side in [1.0, -1.0] {
        assert!(jumping(0.1, 1.0, 7.0 + 2.6 * side));
        assert!(!jumping(0.1, 1.0, 7.0 + 2.4 * side));
        assert!(!jumping(0.1, 3.0, 7.0 + 2.9 * side));
        assert!(jumping(0.1, 3.0, 7.0 + 3.1 * side));
        assert!(!jumping(0.0, 0.0, 7.0 + 9.0 * side), "no step was seen yet");
    }
}

/// The change is a rate, 2 per sample or, at intervals of half a second, an increment of 1.
#[test]
fn a_stated_change_between_two_samples_replaces_the_learnt_jump() {
    let limits =
        ChannelLimits { range: 1e9, change: Some(2.0), noise: 0.0, step: 0.0, motion: 0.0 };
    for (integrals, change) in [(false, 2.0), (true, 1.0)] {
        let channels = vec![limits; 2];
        let limits = Screening { channels, integrals, frozen: None, max_bridge: 1.0 };
        let mut usual = Usual::new(Arc::new(limits));
        (usual.cadence.interval, usual.count) = (0.5, WARM);
        (usual.last[1], usual.before[1]) = (5.0, 0.0);
        for (away, jumping) in [(0.9, 0), (1.1, 0b10), (-0.9, 0), (-1.1, 0b10)] {
            let mut values = [0.0; MAX_CHANNELS];
            values[1] = 5.0 + away * change;
            assert_eq!(usual.jumping(Scalar::new(), &values), jumping, "{integrals} {away}");
        }
    }
}

/// The values 100, 101, 104 and 103 have second differences of 2 and 4, from the third value
/// on. Both weigh the same, so the roughness is `g (4 + 16) / (2 + 4)`.
#[test]
fn the_roughness_begins_with_the_third_sample_and_a_line_has_none() {
    let mut line = usual();
    jumps(&mut line, [100.0, 101.0, 102.0, 103.0, 104.0]);
    assert_eq!(line.rough[0], 0.0);
    let mut bent = usual();
    jumps(&mut bent, [100.0, 101.0, 104.0, 103.0]);
    let expected = GAUSSIAN * 20.0 / 6.0;
    assert!((bent.rough[0] - expected).abs() < 1e-14, "{}", bent.rough[0]);
}

/// After a first 3, a second difference of 300 with half of the weight counts whole.
#[test]
fn a_large_second_difference_is_not_limited_among_the_first_100() {
    let mut usual = usual();
    usual.count = WARM;
    usual.roughen(Scalar::new(), &[3.0; MAX_CHANNELS], 1.0);
    usual.roughen(Scalar::new(), &[300.0; MAX_CHANNELS], 0.5);
    let expected = GAUSSIAN * (9.0 + 9e4) / 303.0;
    assert!((usual.rough[0] / expected - 1.0).abs() < 1e-14, "{}", usual.rough[0]);
}

/// At 100 Hz the mean is compared at the samples 101, 201 and so on. A step of the value by `h`
/// at the sample 202 moves the mean by `h (1 - (15/16)^100)` until the sample 301.
#[test]
fn the_largest_change_of_the_mean_in_a_second_is_kept_and_fades_by_a_600th() {
    let mut usual = usual();
    jumps(&mut usual, [0.0; 201]);
    assert_eq!(usual.motion[0], 0.0);
    let part = |samples: i32| 1.0 - (15.0_f64 / 16.0).powi(samples);
    jumps(&mut usual, [-2.0; 99]);
    assert_eq!(usual.motion[0], 0.0, "the second has not passed");
    jumps(&mut usual, [-2.0]);
    assert!((usual.motion[0] - 2.0 * part(100)).abs() < 1e-12, "{}", usual.motion[0]);
    jumps(&mut usual, [-2.0; 200]);
    let faded = 2.0 * part(100) * (1.0 - 1.0 / 600.0_f64).powi(2);
    assert!((usual.motion[0] - faded).abs() < 1e-12, "{}", usual.motion[0]);
    // a larger change replaces it
    let before = -2.0 * part(300);
    jumps(&mut usual, [1.0; 100]);
    let change = (1.0 - before) * part(100);
    assert!((usual.motion[0] - change).abs() < 1e-12, "{}", usual.motion[0]);
}

/// At intervals of 10.3 ms the mean is first compared after 98 of them, at the sample 99; at
/// those of 10.2 ms it is at the sample 100.
#[test]
fn a_change_of_the_mean_among_the_first_99_samples_is_no_motion() {
    let motion = |nanos: i64| {
        let mut usual = usual();
        for k in 1..=100_i64 {
            let mut values = [0.0; MAX_CHANNELS];
            values[0] = if k < 50 { 0.0 } else { 5.0 };
            usual.learn(Scalar::new(), &values, Time::from_nanos(k * nanos), true);
        }
        usual.motion[0]
    };
    assert_eq!(motion(10_300_000), 0.0);
    assert!(motion(10_200_000) > 4.0, "{}", motion(10_200_000));
}
