//! Samples in and out of order, whole and damaged: what the filter does with each.

use navfuse_core::model::record::{Outcome, Rejection};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{At, jacobian_error};
use navfuse_core::units::sample::{Sample, SensorId, words};
use navfuse_testing::lab::{self, Bench, SCENARIO, seconds};

fn rejected(why: Rejection) -> Outcome {
    Outcome::Rejected(why)
}

/// The two filters agree: twelve operations of 2^-53 on numbers of at most 10 leave 1.4e-14.
fn agree(a: &Bench, b: &Bench) {
    for block in ["cart.place", "cart.drift"] {
        assert!(
            (a.value(block) - b.value(block)).abs() < 1e-13,
            "{block}: {} {}",
            a.value(block),
            b.value(block)
        );
        assert!((a.variance(block) - b.variance(block)).abs() < 1e-13, "{block}");
    }
}

#[test]
fn a_measurement_inside_an_interval_splits_it_there() {
    let mut split = Bench::new(&[]);
    split.give("speed", 0.0, &[1.0]).fix(1.3, 1.5).give("speed", 2.0, &[1.0]);
    let mut two = Bench::new(&[]);
    two.give("speed", 0.0, &[1.0]).give("speed", 1.3, &[1.0]).fix(1.3, 1.5).give(
        "speed",
        2.0,
        &[1.0],
    );
    agree(&split, &two);
    // the nearest epoch, 0.7 s on, is another thing altogether: the cart moves on by 0.7 m
    let mut nearest = Bench::new(&[]);
    nearest.give("speed", 0.0, &[1.0]).give("speed", 2.0, &[1.0]).fix(2.0, 1.5);
    assert!((split.value("cart.place") - nearest.value("cart.place")).abs() > 0.5);
}

#[test]
fn a_measurement_ahead_of_the_driving_sensor_waits_for_it() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]).fix(0.5, 0.5);
    assert!(b.log.updates.is_empty(), "it waits");
    assert_eq!(b.ekf.state().time, seconds(0.0));
    b.give("speed", 1.0, &[1.0]);
    assert_eq!(b.log.outcomes(), [Outcome::Accepted]);
    assert_eq!(b.ekf.state().time, seconds(1.0));
}

#[test]
fn a_measurement_with_the_driving_sample_is_used_whichever_comes_first() {
    let (mut before, mut after) = (Bench::new(&[]), Bench::new(&[]));
    before.give("speed", 0.0, &[1.0]).fix(1.0, 1.1).give("speed", 1.0, &[1.0]);
    after.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]).fix(1.0, 1.1);
    assert_eq!(before.ekf.state().values, after.ekf.state().values);
    assert_eq!(before.ekf.covariance(), after.ekf.covariance());
}

#[test]
fn sensors_that_wait_are_used_in_order_of_time_whatever_order_they_came_in() {
    let scenario = format!("{SCENARIO}[sensor.other]\ntype = \"fix\"\nnoise = \"20 cm\"\n");
    let run = |order: [(&str, f64); 2]| {
        let mut b = Bench::of(&scenario, &[]);
        b.give("speed", 0.0, &[1.0]);
        for (sensor, t) in order {
            b.give(sensor, t, &[t, 2.0 * t, 0.1 * t * t]);
        }
        b.give("speed", 1.0, &[1.0]);
        assert_eq!(b.log.outcomes(), [Outcome::Accepted; 2]);
        b
    };
    let (a, b) = (run([("fix", 0.4), ("other", 0.6)]), run([("other", 0.6), ("fix", 0.4)]));
    assert_eq!(a.ekf.state(), b.ekf.state());
    assert_eq!(a.ekf.covariance(), b.ekf.covariance());
}

#[test]
fn excluded_samples_change_nothing_and_the_span_is_half_open() {
    let excluding = ["sensor.fix.exclude=[[\"0.4 s\", \"0.8 s\"]]"];
    let mut b = Bench::new(&excluding);
    b.give("speed", 0.0, &[1.0]);
    b.fix(0.3, 0.4).fix(0.4, 99.0).fix(0.6, 99.0).fix(0.8, 0.7).give("speed", 1.0, &[1.0]);
    let mut without = Bench::new(&[]);
    without.give("speed", 0.0, &[1.0]).fix(0.3, 0.4).fix(0.8, 0.7).give("speed", 1.0, &[1.0]);
    assert_eq!(b.ekf.state(), without.ekf.state());
    assert_eq!(b.ekf.covariance(), without.ekf.covariance());
    let excluded = b.log.outcomes().iter().filter(|o| **o == rejected(Rejection::Excluded)).count();
    assert_eq!((excluded, b.log.outcomes().len()), (2, 4));
    assert_eq!(b.log.says("the scenario excludes this time"), 1);
}

#[test]
fn late_repeated_and_backward_samples_are_rejected_counted_and_said_once_in_a_row() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]);
    let before = (b.ekf.state().clone(), b.ekf.covariance().into_owned());
    b.fix(0.4, 0.4).fix(0.5, 0.5).fix(0.5, 0.5).fix(0.3, 0.3);
    let (late, order) = (rejected(Rejection::Late), rejected(Rejection::OutOfOrder));
    assert_eq!(b.log.outcomes(), [late, late, order, order]);
    b.give("speed", 1.0, &[1.0]).give("speed", 0.9, &[1.0]);
    assert_eq!(
        b.log.inputs[2..],
        [(1.0, Some(Rejection::OutOfOrder)), (0.9, Some(Rejection::OutOfOrder))]
    );
    assert_eq!(
        before,
        (b.ekf.state().clone(), b.ekf.covariance().into_owned()),
        "the filter is untouched"
    );
    assert_eq!(b.log.says("fix sample rejected: 0.400 s is before the state's 1.000 s"), 1);
    assert_eq!(b.log.says("before the state's"), 1);
    assert_eq!(
        b.log.says("the sensor already has a sample of this time"),
        2,
        "one of each sensor: {:?}",
        b.log.events
    );
    b.fix(1.0, 1.0).give("speed", 2.0, &[1.0]).fix(1.5, 1.5);
    assert_eq!(b.log.says("before the state's"), 2, "after a good one it is news again");
}

#[test]
fn a_sample_that_is_not_finite_is_rejected_by_the_name_of_its_channel() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut b = Bench::new(&[]);
        b.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]).give("fix", 1.0, &[0.5, bad, 0.0]);
        assert_eq!(b.log.outcomes(), [rejected(Rejection::NotFinite(1))]);
        assert_eq!(b.log.says("channel two is"), 1, "{:?}", b.log.events);
        b.give("speed", 2.0, &[bad]);
        assert_eq!(b.log.inputs.last(), Some(&(2.0, Some(Rejection::NotFinite(0)))));
        assert_eq!(b.ekf.state().time, seconds(1.0));
        b.give("speed", 3.0, &[1.0]);
        assert!((b.value("cart.place") - 3.0).abs() < 1e-12, "the next good sample bridges it");
    }
}

#[test]
fn a_missing_channel_leaves_an_update_with_the_others() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]);
    let p = b.ekf.covariance().to_dense();
    let id = SensorId(b.ekf.composition().sensor("fix").unwrap());
    let mut sample = Sample::new(seconds(1.0), id, &[1.2, 2.4, 0.2]);
    sample.clear(1);
    b.ekf.process(&sample, &mut b.log).unwrap();
    assert_eq!(b.log.present, 0b101);
    // h of the channels that are there at p = 1: 1 and 0.1; dh/dp = 1 and 0.2
    assert!((b.log.innovation[0] - 0.2).abs() < 1e-15 && (b.log.innovation[1] - 0.1).abs() < 1e-15);
    // the posterior of the place by hand: information of both channels, 1/r + 0.04/r with r = 0.01
    let expected = 1.0 / (1.0 / p[(0, 0)] + 1.04 / 0.01);
    assert!(
        (b.variance("cart.place") - expected).abs() < 1e-15,
        "{} {expected}",
        b.variance("cart.place")
    );
}

#[test]
fn a_sample_without_any_of_the_sensors_channels_is_rejected() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]).give("speed", 1.0, &[1.0]).give("fix", 1.0, &[]);
    let id = SensorId(b.ekf.composition().sensor("fix").unwrap());
    let mut foreign = Sample::empty(seconds(1.5), id);
    foreign.set(7, 1.0); // a channel that the sensor does not have
    b.ekf.process(&foreign, &mut b.log).unwrap();
    b.give("speed", 2.0, &[]);
    assert_eq!(b.log.outcomes(), [rejected(Rejection::Missing); 2]);
    assert_eq!(b.log.inputs.last(), Some(&(2.0, Some(Rejection::Missing))));
}

#[test]
fn the_filter_starts_at_the_first_driving_sample_from_its_start_on() {
    let mut b = Bench::new(&["estimator.start=\"1 s\""]);
    b.give("speed", 0.0, &[9.0])
        .fix(0.5, 3.0)
        .give("speed", 0.9, &[9.0])
        .fix(1.0, 1.0)
        .fix(1.2, 0.1);
    assert!(!b.ekf.running());
    b.give("speed", 1.2, &[9.0]);
    assert!(b.ekf.running());
    // the one before the start was never the filter's; the one at the start's own time is used
    assert_eq!(b.log.updates.iter().map(|u| u.0).collect::<Vec<_>>(), [1.2]);
    assert_eq!(b.log.outcomes(), [Outcome::Accepted]);
    assert_eq!(b.ekf.state().time, seconds(1.2));
    assert_eq!(b.log.says("before the state's"), 0);
}

/// The lab with a reference that tells the place.
fn with_reference() -> Bench {
    Bench::of(&format!("[sensor.survey]\n{SCENARIO}"), &[])
}

#[test]
fn a_reference_before_the_first_driving_sample_starts_nothing() {
    let mut b = with_reference();
    b.give("survey", 0.0, &[7.0]).give("speed", 0.01, &[1.0]);
    assert!(!b.ekf.running(), "how it moved from 0 to 0.01 s is not known");
    b.give("speed", 0.5, &[1.0]).give("survey", 1.0, &[8.0]).give("speed", 1.5, &[1.0]);
    assert_eq!(b.log.epochs, [seconds(1.0)]);
    assert!((b.value("cart.place") - 8.5).abs() < 1e-15, "from 8 m at 1 s");
}

#[test]
fn a_reference_with_the_first_driving_sample_starts_the_filter_whichever_comes_first() {
    let (mut before, mut after) = (with_reference(), with_reference());
    before.give("survey", 1.0, &[8.0]).give("speed", 1.0, &[1.0]);
    after.give("speed", 1.0, &[1.0]).give("survey", 1.0, &[8.0]);
    for b in [before, after] {
        assert!(b.ekf.running());
        assert_eq!((b.ekf.state().time, b.value("cart.place")), (seconds(1.0), 8.0));
    }
}

#[test]
fn a_reference_is_compared_after_what_else_waits_for_its_time() {
    let run = |order: [&str; 2]| {
        let mut b = with_reference();
        b.give("speed", 0.0, &[1.0]).give("survey", 0.0, &[0.0]);
        for sensor in order {
            b.give(sensor, 1.0, &[1.1, 2.2, 0.121]);
        }
        b.give("speed", 1.0, &[1.0]);
        assert_eq!(b.log.epochs.len(), 2);
        (b.log.last_value, b.value("cart.place"))
    };
    let (first, last) = (run(["survey", "fix"]), run(["fix", "survey"]));
    assert!(first.0 == first.1 && last.0 == last.1, "told as corrected: {first:?} {last:?}");
    assert_eq!(first, last);
}

#[test]
fn what_waits_at_the_end_or_for_too_long_is_counted_as_without_input() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[1.0]);
    for k in 0..1030 {
        b.fix(1.0 + f64::from(k), 1.0);
    }
    assert_eq!(b.log.outcomes(), [rejected(Rejection::NoInput); 6], "1024 wait");
    b.ekf.finish(&mut b.log);
    assert_eq!(b.log.updates.len(), 1030);
    assert_eq!(b.log.says("no driving sample covers its time"), 1);
    let at_end = "1024 samples unused: they are after the last one of the driving sensor";
    assert_eq!(b.log.says(at_end), 1, "{:?}", b.log.events);
}

#[test]
fn a_snapshot_continues_to_the_bit_and_a_run_repeats_to_the_bit() {
    let drive = |b: &mut Bench, from: i32, to: i32| {
        for k in from..to {
            let t = f64::from(k) * 0.1;
            let p = t + 0.3 * (7.0 * t).sin();
            if k % 3 == 0 {
                b.fix(t + 0.03, p); // waits over the end of the first half
            }
            b.give("speed", t + 0.1, &[1.0 + (3.0 * t).cos()]);
            if k % 50 == 30 {
                b.fix(t + 0.1, p + 50.0); // gated: a streak in the memory
            }
        }
    };
    let (mut whole, mut again, mut halves) = (Bench::new(&[]), Bench::new(&[]), Bench::new(&[]));
    for b in [&mut whole, &mut again] {
        drive(b, 0, 131);
        b.fix(13.15, 13.0);
        drive(b, 132, 300);
    }
    drive(&mut halves, 0, 131);
    halves.fix(13.15, 13.0);
    let snapshot = halves.ekf.snapshot();
    drive(&mut halves, 132, 250); // goes elsewhere, and comes back
    halves.ekf.restore(&snapshot);
    let mut other = Bench::new(&[]);
    other.ekf.restore(&snapshot); // another filter of the same composition
    for b in [&mut halves, &mut other] {
        b.log = lab::Log::default();
        drive(b, 132, 300);
    }
    let tail = whole.log.updates.len() - other.log.updates.len();
    for b in [&again, &halves, &other] {
        assert_eq!(whole.ekf.state(), b.ekf.state());
        assert_eq!(whole.ekf.covariance(), b.ekf.covariance());
    }
    assert_eq!(whole.log.updates, again.log.updates);
    assert_eq!(whole.log.updates[tail..], other.log.updates);
}

#[test]
fn a_value_out_of_range_and_a_change_that_is_too_fast_are_rejected_by_channel() {
    let limits = "sensor.fix.limits={ one = { range = [\"-5 m\", \"5 m\"], rate = \"2 m/s\" } }";
    let mut b = Bench::new(&[limits]);
    b.give("speed", 0.0, &[0.0]);
    for (t, place) in [(1.0, 0.1), (2.0, -5.1), (3.0, 4.3), (4.0, 4.3), (5.0, 0.2)] {
        b.give("speed", t, &[0.0]).give("fix", t, &[place]);
    }
    let outcomes = b.log.outcomes();
    assert_eq!(outcomes[..2], [Outcome::Accepted, rejected(Rejection::OutOfRange(0))]);
    // 4.2 m from the last plausible sample: 2.1 m/s over 2 s, and 1.4 m/s over 3 s
    let fast = rejected(Rejection::TooFast(0));
    assert_eq!((outcomes[2], outcomes[3] == fast, outcomes[4]), (fast, false, fast));
    assert_eq!(b.log.says("channel one = -5.1 is outside its limits"), 1, "{:?}", b.log.events);
    assert_eq!(b.log.says("channel one = 4.3 changes faster than its limits"), 1);
}

#[test]
fn limits_that_do_not_fit_are_errors_with_the_key_and_a_remedy() {
    let refused = |limits: &str| lab::refused(SCENARIO, &[&format!("sensor.fix.limits={limits}")]);
    for (limits, parts) in [
        ("{ on = { rate = \"1 m/s\" } }", ["limits.on", "did you mean \"one\"?"]),
        ("{ one = { rate = \"1 m\" } }", ["limits.one.rate", "m/s"]),
        ("{ one = { range = [\"1 m/s\", \"2 m\"] } }", ["limits.one.range", "length"]),
        ("{ one = { range = [\"2 m\", \"1 m\"] } }", ["limits.one.range", "exchange them"]),
        ("{ one = { range = [\"1 m\", \"1 m\"] } }", ["limits.one.range", "is not below"]),
    ] {
        let message = refused(limits);
        assert!(parts.iter().all(|part| message.contains(part)), "{limits}: {message}");
    }
}

#[test]
fn a_sensor_that_repeats_itself_while_the_cart_moves_is_stuck_until_it_changes() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[0.0]);
    // five equal samples span 1.2 m; the corrections that they cause have a variance of 0.0063 m^2
    // each, so that the motion is 1.2 / sqrt(4 * 0.0063 + 0.02) = 5.6 sigma
    for k in 1..=60 {
        let t = f64::from(k);
        let place = if (20..50).contains(&k) { 6.0 } else { 0.3 * t };
        b.give("speed", t, &[0.3]).give("fix", t, &[place, 2.0 * place]);
    }
    let outcomes = b.log.outcomes();
    assert_eq!(outcomes[..23], [Outcome::Accepted; 23], "four equal ones may be chance");
    assert_eq!(outcomes[23..49], [rejected(Rejection::Repeated); 26]);
    assert_eq!(outcomes[49..], [Outcome::Accepted; 11]);
    assert_eq!(b.log.findings.len(), 1, "{:?}", b.log.events);
    assert!(b.log.findings[0].text.contains("stuck"), "{}", b.log.findings[0].text);
    let (error, sigma) = (b.value("cart.place") - 18.0, b.variance("cart.place").sqrt());
    assert!(error.abs() < 3.5 * sigma, "{error} {sigma}");
}

#[test]
fn a_sensor_that_repeats_itself_at_rest_is_not_stuck() {
    let mut b = Bench::new(&[]);
    b.give("speed", 0.0, &[0.0]);
    for k in 1..=300 {
        b.give("speed", f64::from(k), &[0.0]).give("fix", f64::from(k), &[0.5, 1.0]);
    }
    assert_eq!(b.log.outcomes(), [Outcome::Accepted; 300]);
    assert!(b.log.findings.is_empty(), "{:?}", b.log.findings);
}

/// With the weight `w` of the innovation the noise is `R / w`, so that the gain is `P / (P + R / w)`.
#[test]
fn a_robust_update_divides_the_noise_by_the_weight_of_the_innovation() {
    let place = |robust: &str| {
        let mut b = Bench::new(&["sensor.fix.noise=\"10 m\"", robust]);
        b.give("speed", 0.0, &[0.0]).give("speed", 1.0, &[0.0]);
        let p = b.variance("cart.place");
        b.give("fix", 1.0, &[30.0]);
        (p, b.value("cart.place"))
    };
    let (p, _) = place("sensor.fix.robust=\"off\"");
    let e = 30.0 / (p + 100.0).sqrt();
    for (robust, weight) in [
        ("\"off\"", 1.0),
        ("\"huber\"", 1.345 / e),
        ("{ kind = \"huber\", threshold = 2 }", 2.0 / e),
        ("\"student-t\"", 5.0 / (4.0 + e * e)),
        ("{ kind = \"student-t\", freedom = 10 }", 11.0 / (10.0 + e * e)),
    ] {
        let (_, found) = place(&format!("sensor.fix.robust={robust}"));
        let expected = 30.0 * p / (p + 100.0 / weight);
        assert!((found - expected).abs() < 1e-9, "{robust}: {found} {expected}");
    }
    let message = lab::refused(SCENARIO, &["sensor.fix.robust={ kind = \"huber\", freedom = 4 }"]);
    assert!(message.contains("huber takes threshold"), "{message}");
}

/// One channel with an error of 2 m that lasts for 10 s, by hand: `P = p + s^2`, and the gain of
/// each state is its variance over `S`. The error decays with `exp(-dt / 10 s)`.
#[test]
fn a_correlated_error_is_a_state_that_the_prediction_is_shifted_by() {
    let error = "sensor.fix.correlated_error={ sigma = \"2 m\", correlation_time = \"10 s\", \
                 channels = [\"one\"] }";
    let mut b = Bench::new(&[error]);
    b.give("speed", 0.0, &[0.0]).give("speed", 1.0, &[0.0]);
    let p = b.variance("cart.place");
    assert!((b.variance("fix.error_one") - 4.0).abs() < 1e-12, "stationary");
    b.give("fix", 1.0, &[3.0]);
    let s = p + 4.0 + 0.01;
    assert!((b.value("cart.place") - 3.0 * p / s).abs() < 1e-12);
    assert!((b.value("fix.error_one") - 3.0 * 4.0 / s).abs() < 1e-12);
    let before = b.value("fix.error_one");
    b.give("speed", 6.0, &[0.0]);
    assert!((b.value("fix.error_one") - before * (-0.5_f64).exp()).abs() < 1e-12);
    // a sample without that channel says nothing about the error directly
    let mut other = Bench::new(&[error]);
    other.give("speed", 0.0, &[0.0]).give("speed", 1.0, &[0.0]);
    let id = SensorId(other.ekf.composition().sensor("fix").unwrap());
    let mut sample = Sample::new(seconds(1.0), id, &[0.0, 2.0]);
    sample.clear(0);
    other.ekf.process(&sample, &mut other.log).unwrap();
    assert_eq!(other.value("fix.error_one"), 0.0);
    for (error, part) in [
        ("{ sigma = \"2 m/s\", correlation_time = \"10 s\" }", "no channel of the sensor"),
        ("{ sigma = \"2 m\", correlation_time = \"10 s\", channels = [\"on\"] }", "\"one\"?"),
        ("{ sigma = \"0 m\", correlation_time = \"10 s\" }", "above zero"),
    ] {
        let message = lab::refused(SCENARIO, &[&format!("sensor.fix.correlated_error={error}")]);
        assert!(message.contains(part), "{message}");
    }
}

/// The derivative of a channel with respect to its own error is one.
#[test]
fn the_jacobian_of_a_sensor_with_a_correlated_error_is_that_of_differences() {
    let error = "sensor.fix.correlated_error={ sigma = \"2 m\", correlation_time = \"10 s\" }";
    let composition = lab::compose(SCENARIO, &[error, "sensor.fix.bias={ sigma = \"1 m\" }"]);
    let (layout, id) = (&*composition.layout, composition.sensor("fix").unwrap());
    let Role::Measurement(model) = &composition.sensors[id].role else { panic!("a measurement") };
    let sample = Sample::new(seconds(1.0), SensorId(id), &[1.0, 2.0, 3.0]);
    let mut state = layout.initial_state();
    state.values.iter_mut().zip([1.5, 0.3, 0.2]).for_each(|(value, truth)| *value = truth);
    let error = jacobian_error(model.as_ref(), &At { layout, state: &state, sample: &sample });
    assert!(error < 1e-6, "{error}");
}

/// The filter has no motion over which to recall a state until 10 ms, half of the spacing of its
/// history, after the start.
#[test]
fn a_sensor_with_a_time_offset_is_used_from_10_ms_after_the_start_on() {
    let offset = "sensor.fix.time_offset={ initial = \"0 s\", sigma = \"0.1 s\" }";
    let mut b = Bench::new(&[offset]);
    b.give("speed", 0.0, &[1.0]).fix(0.009, 0.0).fix(0.011, 0.0).give("speed", 0.02, &[1.0]);
    let used: Vec<(f64, Outcome)> = b.log.updates.iter().map(|u| (u.0, u.1)).collect();
    assert_eq!(used, [(0.011, Outcome::Accepted)]);
}

/// The reference gives the place alone, so that the draw from the prior of the drift, which is a
/// state too, is left to the scenario.
#[test]
fn a_drawn_start_displaces_what_the_reference_gives_and_nothing_else() {
    let scenario = format!("[sensor.survey]\n{SCENARIO}");
    let mut b = Bench::of(&scenario, &["estimator.draw=\"start\""]);
    b.give("speed", 0.0, &[1.0]).give("survey", 0.0, &[7.0]);
    assert!(b.ekf.running());
    let (place, drift) = (b.value("cart.place"), b.value("cart.drift"));
    assert!(place != 7.0 && (place - 7.0).abs() < 5.0, "{place}: the prior has a sigma of 1 m");
    assert_eq!(drift, 0.0);
}

#[test]
fn channels_have_words_and_names_that_are_no_abbreviation_stay() {
    assert_eq!(words("vel_e"), "velocity east");
    assert_eq!(words("vel_x"), "velocity x");
    assert_eq!(words("gyro_z"), "angular rate z");
    assert_eq!(words("lat"), "latitude");
    assert_eq!(words("h_acc"), "horizontal accuracy");
    for (name, same) in [("depth", "depth"), ("beam_1", "beam 1"), ("n", "n"), ("", "")] {
        assert_eq!(words(name), same);
    }
}
