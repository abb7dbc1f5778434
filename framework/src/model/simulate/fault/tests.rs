//! Each type of fault does as its name reads, within its span and there alone.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::{Fault, FaultType, Injector};
use crate::document::Document;
use crate::model::sensor::mounting::Mounting;
use crate::model::sensor::{Purpose, SensorInfo};
use crate::units::sample::{Channel, Sample, SensorId};
use crate::units::time::Time;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::{Error as ValueError, StrDeserializer};

/// An instrument of two speeds and a depth.
fn sensor() -> SensorInfo {
    let channels = vec![
        Channel::new("vel_x", "mps"),
        Channel::new("vel_y", "mps"),
        Channel::new("depth", "m"),
    ];
    let (name, kind) = ("port".to_owned(), "instrument".to_owned());
    let (purpose, mounting) = (Purpose::Measurement, Mounting::default());
    SensorInfo { name, kind, channels, purpose, mounting }
}

fn faults(text: &str) -> Vec<Fault> {
    let document = Document::parse("faults.toml", format!("faults = [{text}]")).unwrap();
    document.root().get("faults").unwrap().parse().unwrap()
}

fn injector(text: &str) -> Injector {
    Injector::new(&faults(text), &sensor(), 7).unwrap()
}

fn seconds(seconds: f64) -> Time {
    Time::from_seconds(seconds).unwrap()
}

/// Samples at 10 Hz from 0 s to 10 s with values that never repeat; the second speed is missing in
/// every third.
fn good() -> Vec<Sample> {
    let sample = |k: u32| {
        let t = f64::from(k) / 10.0;
        let values = [t.sin(), 2.0 + t.cos(), 1.0 + t];
        let mut sample = Sample::new(seconds(t), SensorId(0), &values);
        if k.is_multiple_of(3) {
            sample.clear(1);
        }
        sample
    };
    (0..=100).map(sample).collect()
}

/// The samples with faults, `None` for a lost one.
fn faulty(text: &str) -> Vec<Option<Sample>> {
    let mut injector = injector(text);
    let apply = |mut sample: Sample| injector.apply(&mut sample).then_some(sample);
    good().into_iter().map(apply).collect()
}

/// Pairs of good and faulty samples within 4 s and 6 s.
fn within(text: &str) -> Vec<(Sample, Option<Sample>)> {
    let span = |s: &Sample| s.time >= seconds(4.0) && s.time < seconds(6.0);
    good().into_iter().zip(faulty(text)).filter(|(good, _)| span(good)).collect()
}

const SPAN: &str = r#"from = "4 s", to = "6 s""#;

/// A fault of each type, as a scenario has it; the spans are left out.
const EACH: [(FaultType, &str); 19] = [
    (FaultType::Bias, r#"size = "3 cm/s""#),
    (FaultType::Step, r#"from = "4 s", size = "3 m""#),
    (FaultType::Drift, r#"size = "2 cm/s^2""#),
    (FaultType::Stuck, ""),
    (FaultType::Frozen, ""),
    (FaultType::Spike, r#"size = "5 m/s", probability = "30 %""#),
    (FaultType::Saturation, r#"size = "50 cm/s""#),
    (FaultType::Dropout, r#"probability = "50 %""#),
    (FaultType::Unit, r#"unit = "kn""#),
    (FaultType::Swap, r#"channels = ["vel_x", "vel_y"]"#),
    (FaultType::Scale, r#"size = "1 %""#),
    (FaultType::ScaleDrift, r#"size = "1 %/s""#),
    (FaultType::Turn, r#"size = "2 deg", channels = ["vel_x", "vel_y"]"#),
    (FaultType::Sign, ""),
    (FaultType::ClockOffset, r#"size = "20 ms""#),
    (FaultType::ClockStep, r#"from = "4 s", size = "-20 ms""#),
    (FaultType::ClockDrift, r#"size = "100 ppm""#),
    (FaultType::Quantisation, r#"size = "10 cm""#),
    (FaultType::Vibration, r#"size = "1 m/s", frequency = "3 Hz""#),
];

fn of(kind: FaultType, span: &str) -> String {
    let keys = EACH.iter().find(|(k, _)| *k == kind).unwrap().1;
    let all = [&format!("type = {:?}", kind.name()), keys, span];
    let all: Vec<&str> = all.into_iter().filter(|part| !part.is_empty()).collect();
    format!("{{ {} }}", all.join(", "))
}

/// Bits of a sample: equal only for equal presence, values and time.
fn bits(sample: &Sample) -> (Time, u16, [Option<u64>; 3]) {
    let values = [0, 1, 2].map(|k| sample.get(k).map(f64::to_bits));
    (sample.time, sample.present(), values)
}

#[test]
fn the_name_of_each_type_is_the_one_that_a_scenario_has() {
    for (kind, _) in EACH {
        let name: StrDeserializer<'_, ValueError> = kind.name().into_deserializer();
        assert_eq!(FaultType::deserialize(name), Ok(kind));
    }
}

#[test]
fn a_fault_changes_samples_within_its_span_and_no_bit_outside() {
    for (kind, keys) in EACH {
        let lasts = keys.contains("from");
        let span = if lasts { "" } else { SPAN };
        let (mut changed, end) = (0, if lasts { 10.1 } else { 6.0 });
        for (good, faulty) in good().iter().zip(faulty(&of(kind, span))) {
            if good.time < seconds(4.0) || good.time >= seconds(end) {
                let faulty = faulty.unwrap();
                assert_eq!(bits(good), bits(&faulty), "{} at {}", kind.name(), good.time);
            } else {
                changed += usize::from(faulty.is_none_or(|f| bits(&f) != bits(good)));
            }
        }
        // random faults hit 30 % and 50 % of 20 samples: fewer than 2 in 1 of 130 sequences of
        // random numbers, of which the seed gives one
        assert!(changed >= 2, "{}: {changed} samples", kind.name());
    }
}

#[test]
fn an_error_is_added_to_the_channels_of_its_dimension_alone() {
    for (good, faulty) in within(&format!(r#"{{ type = "bias", {SPAN}, size = "3 cm/s" }}"#)) {
        let faulty = faulty.unwrap();
        assert_eq!(faulty.get(0), good.get(0).map(|v| v + 0.03));
        assert_eq!(faulty.get(1), good.get(1).map(|v| v + 0.03), "a missing one stays missing");
        assert_eq!(faulty.get(2), good.get(2), "a depth has no error in cm/s");
    }
    for (good, faulty) in within(r#"{ type = "step", from = "4 s", size = "3 m" }"#) {
        assert_eq!(faulty.unwrap().get(2), good.get(2).map(|v| v + 3.0));
    }
    let drift = r#"{ type = "drift", from = "4 s", size = "2 cm/s^2", channels = ["vel_x"] }"#;
    for (good, faulty) in within(drift) {
        let error = 0.02 * good.time.since(seconds(4.0));
        assert_eq!(faulty.unwrap().get(0), good.get(0).map(|v| v + error));
        assert_eq!(faulty.unwrap().get(1), good.get(1));
    }
}

#[test]
fn a_stuck_channel_keeps_its_last_value_or_the_given_one() {
    let last = good()[39];
    for (good, faulty) in within(&format!(r#"{{ type = "stuck", {SPAN} }}"#)) {
        let faulty = faulty.unwrap();
        assert_eq!((faulty.time, faulty.present()), (good.time, good.present()));
        assert_eq!((faulty.get(0), faulty.get(2)), (last.get(0), last.get(2)));
        // the last sample before the fault has no second speed: the first one of the fault stays
        assert!(good.get(1).is_none() || faulty.get(1) == super::tests::good()[40].get(1));
    }
    for (_, faulty) in within(&format!(r#"{{ type = "stuck", {SPAN}, size = 0 }}"#)) {
        assert_eq!((faulty.unwrap().get(0), faulty.unwrap().get(2)), (Some(0.0), Some(0.0)));
    }
}

#[test]
fn a_frozen_instrument_repeats_its_last_sample_with_new_time_stamps() {
    let last = good()[39];
    for (good, faulty) in within(&of(FaultType::Frozen, SPAN)) {
        let mut expected = last;
        expected.time = good.time;
        assert_eq!(bits(&faulty.unwrap()), bits(&expected));
    }
}

#[test]
fn a_spike_hits_one_sample_or_the_given_share_with_both_signs() {
    let spike = format!(r#"{{ type = "spike", {SPAN}, size = "5 m/s", channels = ["vel_x"] }}"#);
    for (k, (good, faulty)) in within(&spike).into_iter().enumerate() {
        let error = if k == 0 { 5.0 } else { 0.0 };
        assert_eq!(faulty.unwrap().get(0), good.get(0).map(|v| v + error));
    }
    let mut injector =
        injector(r#"{ type = "spike", size = "1 m", probability = "30 %", channels = ["depth"] }"#);
    let mut count = |_| {
        let mut sample = Sample::new(Time::default(), SensorId(0), &[0.0; 3]);
        assert!(injector.apply(&mut sample));
        sample.get(2).unwrap()
    };
    let errors: Vec<f64> = (0..10_000).map(&mut count).collect();
    let (up, down) = (share(&errors, 1.0), share(&errors, -1.0));
    // 15 % each: sigma of a share of 10 000 is 0.36 %, of which 4 are 1.4 %
    assert!((up - 0.15).abs() < 0.014 && (down - 0.15).abs() < 0.014, "{up} {down}");
}

/// Share of a value.
fn share(all: &[f64], value: f64) -> f64 {
    all.iter().filter(|v| **v == value).count() as f64 / all.len() as f64
}

#[test]
fn a_saturated_channel_stays_within_the_limit_and_a_quantised_one_on_the_steps() {
    for (good, faulty) in within(&of(FaultType::Saturation, SPAN)) {
        assert_eq!(faulty.unwrap().get(0), good.get(0).map(|v| v.clamp(-0.5, 0.5)));
    }
    for (good, faulty) in within(&of(FaultType::Quantisation, SPAN)) {
        let (good, faulty) = (good.get(2).unwrap(), faulty.unwrap().get(2).unwrap());
        // half a step and the rounding of a number below 16
        assert!((faulty - good).abs() <= 0.05 + 1e-14);
        assert!((faulty / 0.1 - (faulty / 0.1).round()).abs() < 1e-12, "{faulty}");
    }
}

#[test]
fn a_dropout_loses_samples_or_the_named_channels() {
    assert!(within(&format!(r#"{{ type = "dropout", {SPAN} }}"#)).iter().all(|p| p.1.is_none()));
    let named = format!(r#"{{ type = "dropout", {SPAN}, channels = ["depth"] }}"#);
    for (good, faulty) in within(&named) {
        assert_eq!(faulty.unwrap().present(), good.present() & 0b011);
    }
    let lost = faulty(r#"{ type = "dropout", probability = "50 %" }"#);
    let lost = lost.iter().filter(|s| s.is_none()).count();
    // 101 samples: mean 50.5, sigma 5.0
    assert!((31..=70).contains(&lost), "{lost}");
}

#[test]
fn numbers_in_another_unit_swapped_channels_and_wrong_signs_are_what_a_driver_would_get_wrong() {
    for (good, faulty) in within(&of(FaultType::Unit, SPAN)) {
        // 1 m/s is 3600/1852 kn; two roundings
        let knots = good.get(0).unwrap() * 3600.0 / 1852.0;
        assert!((faulty.unwrap().get(0).unwrap() - knots).abs() < 4.0 * f64::EPSILON);
        assert_eq!(faulty.unwrap().get(2), good.get(2), "a depth is not in knots");
    }
    for (good, faulty) in within(&of(FaultType::Swap, SPAN)) {
        let faulty = faulty.unwrap();
        assert_eq!((faulty.get(0), faulty.get(1)), (good.get(1), good.get(0)));
    }
    for (good, faulty) in within(&of(FaultType::Sign, r#"channels = ["vel_y"]"#)) {
        let faulty = faulty.unwrap();
        assert_eq!((faulty.get(0), faulty.get(1)), (good.get(0), good.get(1).map(|v| -v)));
    }
}

#[test]
fn a_scale_multiplies_a_drifting_one_grows_and_a_turn_keeps_the_length() {
    for (good, faulty) in within(&of(FaultType::Scale, SPAN)) {
        assert_eq!(faulty.unwrap().get(2), good.get(2).map(|v| v * 1.01));
    }
    for (good, faulty) in within(&of(FaultType::ScaleDrift, SPAN)) {
        let factor = 1.0 + 0.01 * good.time.since(seconds(4.0));
        assert_eq!(faulty.unwrap().get(0), good.get(0).map(|v| v * factor));
    }
    let length = |s: &Sample| Some(s.get(0)?.hypot(s.get(1)?));
    for (good, faulty) in within(&of(FaultType::Turn, SPAN)) {
        let faulty = faulty.unwrap();
        let both = length(&good).zip(length(&faulty));
        assert!(both.is_none_or(|(a, b)| (a - b).abs() < 1e-14), "{both:?}");
        let x = good.get(1).zip(good.get(0)).map(|(y, x)| x - y * 2_f64.to_radians());
        // the cosine of 2 deg is off one by 6e-4
        assert!(x.is_none_or(|x| (faulty.get(0).unwrap() - x).abs() < 3e-3), "{x:?}");
    }
}

#[test]
fn a_clock_moves_the_time_stamp_and_no_value() {
    let moved = |text: &str| {
        let pairs = within(text).into_iter().map(|(good, faulty)| {
            let faulty = faulty.unwrap();
            assert_eq!(bits(&faulty).2, bits(&good).2);
            (good.time, faulty.time - good.time)
        });
        pairs.collect::<Vec<_>>()
    };
    let offset = moved(&of(FaultType::ClockOffset, SPAN));
    assert!(offset.iter().all(|(_, by)| by.nanos() == 20_000_000));
    let step = moved(&of(FaultType::ClockStep, ""));
    assert!(step.iter().all(|(_, by)| by.nanos() == -20_000_000));
    for (time, by) in moved(&of(FaultType::ClockDrift, SPAN)) {
        // 100 ppm of the time since the begin, rounded to nanoseconds
        assert_eq!(by.nanos(), (time.nanos() - 4_000_000_000) / 10_000);
    }
}

#[test]
fn a_vibration_has_its_amplitude_and_frequency_and_moves_each_channel_by_itself() {
    let pairs = within(&of(FaultType::Vibration, SPAN));
    let error = |k: usize| {
        let of = move |(good, faulty): &(Sample, Option<Sample>)| {
            Some(faulty.as_ref()?.get(k)? - good.get(k)?)
        };
        pairs.iter().map(of).collect::<Vec<_>>()
    };
    let (x, y): (Vec<_>, Vec<_>) = (error(0), error(1));
    // 20 samples in 2 s are 6 periods of 3 Hz: the mean square of a sinusoid is a half
    let square = x.iter().flatten().map(|e| e * e).sum::<f64>() / x.len() as f64;
    assert!((square - 0.5).abs() < 1e-9, "{square}");
    // after a second, 3 periods later, it repeats
    assert!((0..10).all(|k| (x[k].unwrap() - x[k + 10].unwrap()).abs() < 1e-9));
    let apart = x.iter().zip(&y).filter_map(|(x, y)| Some((*x)? - (*y)?));
    assert!(apart.fold(0.0_f64, |most, d| most.max(d.abs())) > 1e-3, "the phases are the same");
}

#[test]
fn faults_apply_in_their_order() {
    let both = r#"{ type = "bias", size = "1 m" }, { type = "saturation", size = "2 m" }"#;
    assert!(faulty(both).iter().all(|s| s.unwrap().get(2).unwrap() <= 2.0));
    let reverse = r#"{ type = "saturation", size = "2 m" }, { type = "bias", size = "1 m" }"#;
    assert_eq!(faulty(reverse)[100].unwrap().get(2), Some(3.0));
}

#[test]
fn a_fault_of_another_type_changes_no_draw_of_a_random_fault() {
    let lost = |text: &str| faulty(text).iter().map(Option::is_none).collect::<Vec<_>>();
    let dropout = of(FaultType::Dropout, "");
    let after = format!("{}, {dropout}", of(FaultType::Vibration, ""));
    assert_eq!(lost(&dropout), lost(&after));
}

/// Every rejected fault names its key, and the remedy.
#[test]
fn a_fault_that_does_not_fit_is_rejected_with_key_and_remedy() {
    let cases = [
        (r#"type = "bias""#, "faults.0: ", "size = \""),
        (r#"type = "step", size = "1 m""#, "faults.0: ", "from = \"250 s\""),
        (r#"type = "swap""#, "faults.0: ", r#"channels = ["vel_x", "vel_y"]"#),
        (r#"type = "vibration", size = "1 m""#, "faults.0: ", "frequency = \"20 Hz\""),
        (r#"type = "frozen", channels = ["depth"]"#, "channels: ", "it takes: from, to"),
        (r#"type = "step", from = "1 s", to = "2 s", size = "1 m""#, "to: ", "remove it"),
        (r#"type = "bias", size = "1 bar""#, "size: ", "m/s"),
        (r#"type = "bias", size = 3"#, "size: ", "m/s"),
        (r#"type = "bias", size = "1 m", channels = ["vel_x"]"#, "size: vel_x: ", "m/s"),
        (r#"type = "drift", size = "1 bar""#, "size: ", "m/s^2"),
        (r#"type = "clock-step", from = "1 s", size = "1 m""#, "size: ", "ms"),
        (r#"type = "clock-drift", size = "1 s""#, "size: ", "ppm"),
        (r#"type = "quantisation", size = 0"#, "size: ", "greater than zero"),
        (r#"type = "unit", unit = "knt""#, "unit: ", "kn"),
        (r#"type = "unit", unit = "bar""#, "unit: ", "m/s"),
        (r#"type = "unit", unit = "kn", channels = ["depth"]"#, "unit: ", "length"),
        (r#"type = "sign", channels = ["vel_w"]"#, "channels.0: ", "did you mean \"vel_"),
        (r#"type = "sign", channels = ["depth", "depth"]"#, "channels.1: ", "remove one"),
        (r#"type = "sign", channels = []"#, "channels: ", "name a channel"),
        (r#"type = "swap", channels = ["vel_x", "depth"]"#, "channels: ", "same unit"),
        (r#"type = "swap", channels = ["vel_x"]"#, "channels: ", "name two"),
        (r#"type = "scale", size = "1 m/s""#, "size: ", "ppm"),
        (r#"type = "turn", size = "1 deg", channels = ["vel_x"]"#, "channels: ", "name two"),
        (r#"type = "turn", size = 2, channels = ["vel_x", "vel_y"]"#, "size: ", "deg"),
        (r#"type = "stuck", from = "2 s", to = "1 s""#, "to: ", "after it begins, at 2.000 s"),
        (r#"type = "stuck", from = "1e12 s""#, "from: ", "73 years"),
        (r#"type = "dropout", probability = 2"#, "probability: ", "such as \"2 %\""),
    ];
    for (text, key, remedy) in cases {
        let error = Injector::new(&faults(&format!("{{ {text} }}")), &sensor(), 1).unwrap_err();
        let message = error.to_string();
        assert!(message.starts_with("simulation.faults.0"), "{text}: {message}");
        assert!(message.contains(key) && message.contains(remedy), "{text}: {message}");
    }
}

/// Keys that each type needs, and those that it takes beside: the table of the manual.
const TAKES: [(FaultType, &[&str], &[&str]); 19] = [
    (FaultType::Bias, &["size"], &["from", "to", "channels"]),
    (FaultType::Step, &["from", "size"], &["channels"]),
    (FaultType::Drift, &["size"], &["from", "to", "channels"]),
    (FaultType::Stuck, &[], &["from", "to", "channels", "size"]),
    (FaultType::Frozen, &[], &["from", "to"]),
    (FaultType::Spike, &["size"], &["from", "to", "channels", "probability"]),
    (FaultType::Saturation, &["size"], &["from", "to", "channels"]),
    (FaultType::Dropout, &[], &["from", "to", "channels", "probability"]),
    (FaultType::Unit, &["unit"], &["from", "to", "channels"]),
    (FaultType::Swap, &["channels"], &["from", "to"]),
    (FaultType::Scale, &["size"], &["from", "to", "channels"]),
    (FaultType::ScaleDrift, &["size"], &["from", "to", "channels"]),
    (FaultType::Turn, &["size", "channels"], &["from", "to"]),
    (FaultType::Sign, &[], &["from", "to", "channels"]),
    (FaultType::ClockOffset, &["size"], &["from", "to"]),
    (FaultType::ClockStep, &["from", "size"], &[]),
    (FaultType::ClockDrift, &["size"], &["from", "to"]),
    (FaultType::Quantisation, &["size"], &["from", "to", "channels"]),
    (FaultType::Vibration, &["size", "frequency"], &["from", "to", "channels"]),
];

#[test]
fn a_fault_without_a_key_that_its_type_needs_or_with_one_that_it_does_not_take_is_refused() {
    const VALUES: [(&str, &str); 7] = [
        ("from", "\"1 s\""),
        ("to", "\"2 s\""),
        ("channels", "[\"vel_x\"]"),
        ("size", "\"1 m\""),
        ("unit", "\"kn\""),
        ("frequency", "\"1 Hz\""),
        ("probability", "\"50 %\""),
    ];
    let error = |kind: FaultType, keys: &[&str]| {
        let given = VALUES.iter().filter(|(key, _)| keys.contains(key));
        let given: String = given.map(|(key, value)| format!(", {key} = {value}")).collect();
        let all = faults(&format!("{{ type = {:?}{given} }}", kind.name()));
        Injector::new(&all, &sensor(), 7).err().map(|e| e.to_string()).unwrap_or_default()
    };
    for (kind, needed, optional) in TAKES {
        for missing in needed {
            let others: Vec<&str> = needed.iter().copied().filter(|key| key != missing).collect();
            let found = error(kind, &others);
            assert!(found.contains(&format!("missing key {missing:?}")), "{kind:?}: {found}");
        }
        for (key, _) in VALUES {
            let found = error(kind, &[needed, &[key][..]].concat());
            let taken = needed.contains(&key) || optional.contains(&key);
            assert!(!found.contains("missing key"), "{kind:?}: {found}");
            assert_eq!(!found.contains("no such key"), taken, "{kind:?} {key}: {found}");
            assert!(taken || found.contains(&format!(".{key}")), "{kind:?} {key}: {found}");
        }
    }
}
