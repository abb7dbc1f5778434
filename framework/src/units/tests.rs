#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // a test fails by panicking

use super::quantity::LARGEST;
use super::*;
use proptest::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

fn read<Q: FromStr<Err = UnitError>>(text: &str) -> Q {
    text.parse().unwrap_or_else(|e| panic!("{text}: {e}"))
}

fn refused<Q: FromStr<Err = UnitError>>(text: &str) -> String {
    text.parse::<Q>().err().unwrap_or_else(|| panic!("{text} was accepted")).to_string()
}

/// Within 4 roundings of 2^-53 each, which a product of at most four factors needs.
fn close(found: f64, wanted: f64) {
    assert!(
        (found - wanted).abs() <= 4.0 * f64::EPSILON / 2.0 * wanted.abs(),
        "{found} is not {wanted}"
    );
}

#[test]
fn data_sheet_values_are_read_in_si() {
    let deg = PI / 180.0;
    close(read::<AngularRate>("0.01 deg/h").si(), 0.01 * deg / 3600.0);
    close(read::<AngularRateNoise>("0.1 deg/h/sqrt(Hz)").si(), 0.1 * deg / 3600.0);
    close(read::<AngularRateNoise>("0.003 deg/sqrt(h)").si(), 0.003 * deg / 60.0);
    close(read::<AngularRateNoise>("0.003 °/√h").si(), 0.003 * deg / 60.0);
    close(read::<AngularRateRandomWalk>("1 deg/h/sqrt(h)").si(), deg / 216_000.0);
    close(read::<AngularAcceleration>("2 deg/s²").si(), 2.0 * deg);
    close(read::<Acceleration>("50 ug").si(), 50.0 * 9.80665e-6);
    close(read::<Acceleration>("5 mGal").si(), 5e-5);
    close(read::<AccelerationNoise>("10 µg/sqrt(Hz)").si(), 9.80665e-5);
    close(read::<AccelerationNoise>("10 μg/√Hz").si(), 9.80665e-5);
    close(read::<AccelerationNoise>("0.06 m/s/sqrt(h)").si(), 0.001);
    close(read::<AccelerationRandomWalk>("1 m/s^2/sqrt(s)").si(), 1.0);
    close(read::<Angle>("-0.5 deg").si(), -0.5 * deg);
    close(read::<Angle>("20 arcsec").si(), 20.0 * deg / 3600.0);
    close(read::<Angle>("3 mrad").si(), 0.003);
    close(read::<Speed>("2 cm/s").si(), 0.02);
    close(read::<Speed>("2 kn").si(), 3704.0 / 3600.0);
    close(read::<Length>("1 km").si(), 1000.0);
    close(read::<LengthRandomWalk>("6 cm/sqrt(h)").si(), 0.001);
    close(read::<Duration>("1.5 h").si(), 5400.0);
    close(read::<Duration>("10 min").si(), 600.0);
    close(read::<Frequency>("5 Hz").si(), 5.0);
    close(read::<Frequency>("5 1/s").si(), 5.0);
    close(read::<Pressure>("0.2 bar").si(), 2e4);
    close(read::<Pressure>("1 dbar").si(), 1e4);
    close(read::<Density>("1025 kg/m^3").si(), 1025.0);
    close(read::<Temperature>("0.1 K").si(), 0.1);
    close(read::<Ratio>("200 ppm").si(), 2e-4);
    close(read::<Ratio>("0.3 %").si(), 0.003);
    close(read::<Ratio>("1").si(), 1.0);
    close(read::<RatioRandomWalk>("60 ppm/sqrt(h)").si(), 1e-6);
    close(read::<RatioRandomWalk>("1e-6 1/sqrt(s)").si(), 1e-6);
    close(read::<Length>(" +1.5e3mm ").si(), 1.5);
}

#[test]
fn decimal_prefixes_give_the_same_f64_as_the_shifted_decimal() {
    for k in 1..2000 {
        assert_eq!(
            read::<Length>(&format!("{k} cm")),
            read::<Length>(&format!("{} m", f64::from(k) / 100.0)),
            "{k}"
        );
        assert_eq!(read::<Ratio>(&format!("{k} ppm")).si(), f64::from(k) / 1e6, "{k}");
    }
}

#[test]
fn a_refused_text_says_what_was_found_and_what_is_needed() {
    assert_eq!(refused::<Speed>("2"), "a speed needs a unit, e.g. \"2 cm/s\"");
    assert_eq!(
        refused::<Speed>("2 deg/h"),
        "found 'deg/h' which is an angular rate, a speed is needed, e.g. m/s, cm/s, kn"
    );
    assert_eq!(
        refused::<AngularRateNoise>("0.1 deg"),
        "found 'deg' which is an angle, an angular rate noise is needed, e.g. deg/h/sqrt(Hz), \
         deg/sqrt(h), rad/s/sqrt(Hz)"
    );
    assert_eq!(refused::<Angle>("2 dge"), "unknown unit 'dge'; did you mean 'deg'?");
    assert_eq!(refused::<Frequency>("2 hz"), "unknown unit 'hz'; did you mean 'Hz'?");
    assert_eq!(
        refused::<Speed>("2 furlong/h"),
        "unknown unit 'furlong'; a speed is needed, e.g. m/s, cm/s, kn"
    );
    assert_eq!(
        refused::<Ratio>("2 m"),
        "found 'm' which is a length, a ratio is needed, e.g. 0.002, 0.2 %, 200 ppm"
    );
    assert_eq!(
        refused::<Length>("two m"),
        "found \"two m\", which does not start with a number; a length is needed, e.g. \"0.2 m\""
    );
    for text in ["NaN m", "nan m", "inf m", "-inf m", "1e400 m", "1e308 km"] {
        assert_eq!(refused::<Length>(text), format!("found \"{text}\", a finite number is needed"));
    }
    for text in ["", "m", ".", "-", "1,5 m", "1.2.3 m", "1_000 m", "e5 m"] {
        assert!(refused::<Length>(text).contains("does not start with a number"), "{text}");
    }
    for text in [
        "1 m/",
        "1 /m",
        "1 m m",
        "1 (m",
        "1 m)",
        "1 sqrt m",
        "1 m^",
        "1 m^0.5",
        "1 m^99",
        "1 sqrt(sqrt(m))",
        "1 m*",
        "1 m*((ppm^6)^6)^6",
    ] {
        assert!(
            refused::<Length>(text).starts_with("cannot read the unit"),
            "{text}: {}",
            refused::<Length>(text)
        );
    }
    assert!(refused::<Length>(&format!("1 {}", "(".repeat(1_000_000))).contains("too long"));
}

#[test]
fn a_quantity_prints_in_the_unit_it_is_usually_given_in() {
    let same = [
        "-0.5 deg",
        "3 mrad",
        "20 arcsec",
        "0.01 deg/h",
        "300 deg/s",
        "0.1 deg/h/sqrt(Hz)",
        "9.8 m/s^2",
    ];
    fn print(text: &str) -> Option<String> {
        fn try_as<Q: FromStr + fmt::Display>(text: &str) -> Option<String> {
            text.parse::<Q>().ok().map(|q| q.to_string())
        }
        try_as::<Angle>(text)
            .or_else(|| try_as::<AngularRate>(text))
            .or_else(|| try_as::<AngularRateNoise>(text))
            .or_else(|| try_as::<Acceleration>(text))
            .or_else(|| try_as::<Speed>(text))
            .or_else(|| try_as::<Ratio>(text))
            .or_else(|| try_as::<Duration>(text))
    }
    for text in same.into_iter().chain([
        "50 ug",
        "0.02 m/s",
        "2 kn",
        "20 ppm",
        "0.9998",
        "0.001 m/s",
        "10 s",
        "0 s",
    ]) {
        assert_eq!(print(text).as_deref(), Some(text));
    }
    assert_eq!(Quantity::<2, 2, -3, 0, 1>::from_si(2.0).to_string(), "2 m*kg*sqrt(K)/sqrt(s^3)");
}

#[test]
fn every_row_of_the_dimension_table_is_of_its_dimension() {
    for d in dimension::DIMENSIONS {
        let example = d.example.split_once(' ').map(|(_, unit)| unit);
        for unit in d.units.iter().copied().chain(example).filter(|u| !u.is_empty()) {
            assert_eq!(parse_unit(unit).unwrap().exponents(), d.exponents, "{unit}");
        }
    }
}

/// Serialises, reads back, and compares the bits; the text goes through TOML too.
fn survives<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>(si: f64) {
    let q = Quantity::<L, M, T, A, K, I>::from_si(si);
    let text = q.to_string();
    assert_eq!(read::<Quantity<L, M, T, A, K, I>>(&text).si().to_bits(), si.to_bits(), "{text}");
    if si.abs() > LARGEST {
        return; // a scenario cannot have it
    }
    let table = toml::to_string(&BTreeMap::from([("q", q)])).unwrap();
    let back: BTreeMap<String, Quantity<L, M, T, A, K, I>> = toml::from_str(&table).unwrap();
    assert_eq!(back["q"].si().to_bits(), si.to_bits(), "{table}");
}

proptest! {
    #[test]
    fn what_a_quantity_prints_reads_back_to_the_bit(
        any in any::<f64>(), plain in -1e4..1e4f64, k in -9999..9999i32
    ) {
        let deg_per_hour = parse_unit("deg/h").unwrap().to_si(f64::from(k) / 100.0);
        for si in [any, plain, deg_per_hour, f64::from(k)].into_iter().filter(|x| x.is_finite()) {
            survives::<0, 0, 0, 0, 0, 0>(si);
            survives::<0, 0, 0, 2, 0, 0>(si);
            survives::<0, 0, -2, 2, 0, 0>(si);
            survives::<0, 0, -1, 2, 0, 0>(si);
            survives::<2, 0, -2, 0, 0, 0>(si);
            survives::<2, 0, -4, 0, 0, 0>(si);
            survives::<-2, 2, -4, 0, 0, 0>(si);
            survives::<0, 2, -4, 0, 0, -2>(si);
            survives::<1, -3, 5, 0, -6, 4>(si);
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in "\\PC*", unit in "[0-9 .e+*/^()a-z°µ√²%-]{0,24}") {
        let _ = text.parse::<Speed>();
        let _ = unit.parse::<Speed>();
        let _ = parse_unit(&unit);
        let _ = column_suffix(&text);
    }
}

#[test]
fn column_suffixes_are_units() {
    let same = [
        ("radps", "rad/s"),
        ("degps", "deg/s"),
        ("dps", "deg/s"),
        ("mps2", "m/s^2"),
        ("mps", "m/s"),
        ("m_s", "m/s"),
        ("m_s2", "m/s^2"),
        ("rad_s", "rad/s"),
        ("m", "m"),
        ("rad", "rad"),
        ("deg", "deg"),
        ("s", "s"),
        ("ms", "ms"),
        ("us", "us"),
        ("ns", "ns"),
        ("Pa", "Pa"),
        ("kPa", "kPa"),
        ("hPa", "hPa"),
        ("bar", "bar"),
        ("dbar", "dbar"),
        ("kgpm3", "kg/m^3"),
    ];
    for (suffix, unit) in same {
        assert_eq!(column_suffix(suffix), parse_unit(unit).ok(), "{suffix}");
    }
    for other in ["", "x", "time", "h_s", "ps", "_s", "m2", "é"] {
        assert_eq!(column_suffix(other), None, "{other}");
    }
}

#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Config {
    scale: Ratio,
    arm: Triple<Length>,
    noise: Sigma<Triple<AngularRateNoise>>,
    rate: Positive<Frequency>,
}

fn config(arm: &str, noise: &str, rate: &str) -> Result<Config, String> {
    toml::from_str(&format!("scale = 1\narm = {arm}\nnoise = {noise}\nrate = {rate}"))
        .map_err(|e: toml::de::Error| e.message().to_owned())
}

#[test]
fn one_value_is_for_all_axes_and_an_array_has_three() {
    let c = config("['-6 cm', '0 m', '0.21 m']", "'0.1 deg/h/sqrt(Hz)'", "'5 Hz'").unwrap();
    assert_eq!(c.arm.si().as_slice(), [-0.06, 0.0, 0.21]);
    assert_eq!(c.noise.si().x, c.noise.si().z);
    assert_eq!(c.rate.si(), 5.0);
    assert_eq!(toml::from_str::<Config>(&toml::to_string(&c).unwrap()).unwrap(), c);
    let two = config("['1 m', '2 m']", "'1 deg/sqrt(h)'", "'5 Hz'").unwrap_err();
    assert_eq!(
        two,
        "found an array of 2; one value for all three axes or an array of three is needed"
    );
    let bare = config("1", "'1 deg/sqrt(h)'", "'5 Hz'").unwrap_err();
    assert_eq!(bare, "a length needs a unit, e.g. \"0.2 m\"");
}

#[test]
fn a_sigma_is_not_negative_and_a_rate_is_positive() {
    let negative =
        config("'1 m'", "['1 deg/sqrt(h)', '1 deg/sqrt(h)', '-1 deg/sqrt(h)']", "'5 Hz'")
            .unwrap_err();
    assert!(negative.starts_with("a sigma cannot be negative: ["), "{negative}");
    assert!(config("'1 m'", "'0 deg/sqrt(h)'", "'5 Hz'").is_ok());
    let zero = config("'1 m'", "'0 deg/sqrt(h)'", "'0 Hz'").unwrap_err();
    assert_eq!(zero, "a value greater than zero is needed: 0 Hz");
}

#[test]
fn the_schema_names_the_dimension_and_gives_an_example_that_is_read() {
    let schema = schemars::schema_for!(Config).to_value();
    let properties = &schema["properties"];
    assert_eq!(properties["rate"]["title"], "frequency");
    assert_eq!(properties["rate"]["exclusiveMinimum"], 0);
    assert_eq!(properties["arm"]["title"], "length");
    assert_eq!(properties["arm"]["anyOf"][1]["minItems"], 3);
    assert_eq!(properties["scale"]["type"], serde_json::json!(["number", "string"]));
    let example = |key: &str| properties[key]["examples"][0].as_str().unwrap().to_owned();
    read::<Ratio>(&example("scale"));
    read::<Length>(&example("arm"));
    read::<AngularRateNoise>(&example("noise"));
    read::<Frequency>(&example("rate"));
}

/// SI values of the BIPM's brochure (9th edition), the international foot and nautical mile, and
/// g_n = 9.80665 m/s^2; a psi is a pound (0.45359237 kg) times g_n on a square inch.
#[test]
fn every_unit_has_its_value_in_si_and_its_dimension() {
    let tau = 2.0 * PI;
    let psi = 0.453_592_37 * 9.80665 / (0.0254 * 0.0254);
    close(read::<Ratio>("1 ppb").si(), 1e-9);
    for (text, si) in [("1 arcmin", tau / 21_600.0), ("1 rev", tau), ("3 turn", 3.0 * tau)] {
        close(read::<Angle>(text).si(), si);
    }
    close(read::<AngularRate>("1 rpm").si(), tau / 60.0);
    for (text, si) in [("1 ft", 0.3048), ("1 nmi", 1852.0), ("1 mm", 1e-3), ("1 um", 1e-6)] {
        close(read::<Length>(text).si(), si);
    }
    close(read::<Speed>("1 kt").si(), 1852.0 / 3600.0);
    close(read::<Acceleration>("1 g").si(), 9.80665);
    close(read::<Acceleration>("1 Gal").si(), 0.01);
    for (text, si) in [("1 day", 86_400.0), ("1 hr", 3600.0), ("1 ms", 1e-3), ("1 ns", 1e-9)] {
        close(read::<Duration>(text).si(), si);
    }
    for (text, si) in [("1 kHz", 1e3), ("1 MHz", 1e6), ("1 mHz", 1e-3)] {
        close(read::<Frequency>(text).si(), si);
    }
    for (text, si) in [("1 Pa", 1.0), ("1 hPa", 100.0), ("1 atm", 101_325.0), ("1 psi", psi)] {
        close(read::<Pressure>(text).si(), si);
    }
    for (text, si) in [("50 uT", 50e-6), ("3 nT", 3e-9), ("12 V", 12.0), ("20 mA", 0.02)] {
        let (number, unit) = text.split_once(' ').unwrap();
        close(parse_unit(unit).unwrap().to_si(number.parse().unwrap()), si);
    }
    let electric = [("V", "kg*m^2/s^3/A"), ("T", "V*s/m^2")];
    for (text, same) in electric.into_iter().chain([
        ("Hz", "1/s"),
        ("Pa", "kg/m/s^2"),
        ("kn", "m/s"),
        ("rpm", "rad/s"),
    ]) {
        let dimension = |text| parse_unit(text).unwrap().exponents();
        assert_eq!(dimension(text), dimension(same), "{text}");
    }
}

#[test]
fn the_si_unit_of_a_dimension_has_its_powers_and_reads_back() {
    let unit = |exponents| dimension::si_unit(exponents);
    let powers = ["sqrt(s)", "s", "sqrt(s^3)", "s^2", "sqrt(s^5)", "s^3"];
    for (halves, power) in (1..).zip(powers) {
        assert_eq!(unit([0, 0, halves, 0, 0, 0]), power);
        assert_eq!(unit([0, 0, -halves, 0, 0, 0]), format!("1/{power}"));
        assert_eq!(unit([4, 0, -halves, 2, 0, 0]), format!("m^2*rad/{power}"));
        for exponents in [[halves, 2, -halves, 0, 4, -2], [-halves, 0, 3, halves, -2, halves]] {
            assert_eq!(parse_unit(&unit(exponents)).unwrap().exponents(), exponents);
        }
    }
    assert_eq!(unit([0; 6]), "1");
}

#[test]
fn an_expression_has_64_bytes_at_most() {
    assert_eq!(parse_unit(&format!("{:64}", "m")), parse_unit("m"));
    let long = parse_unit(&format!("{:65}", "m")).unwrap_err().to_string();
    assert!(long.contains("too long"), "{long}");
}

/// The suffix of a column names the same unit as the notation, for every dimension that a channel
/// can have without a root.
#[test]
fn an_si_unit_is_one_by_its_notation_and_by_its_suffix() {
    for (symbol, suffix) in [
        ("m", "m"),
        ("m/s", "mps"),
        ("m/s^2", "mps2"),
        ("rad", "rad"),
        ("rad/s", "radps"),
        ("rad/s^2", "radps2"),
        ("kg/m^3", "kgpm3"),
        ("s", "s"),
        ("Hz", "Hz"),
        ("Pa", "Pa"),
        ("K", "K"),
    ] {
        let unit = Unit::si(symbol).unwrap();
        assert_eq!(Unit::si(suffix), Ok(unit));
        assert_eq!((&*unit.symbol(), &*unit.suffix()), (symbol, suffix));
    }
    let ratio = Unit::si("1").unwrap();
    assert_eq!((ratio, &*ratio.symbol(), &*ratio.suffix()), (Unit::ONE, "", "1"));
    let jerk = Unit::si("m/s^3").unwrap();
    assert_eq!((&*jerk.symbol(), &*jerk.suffix()), ("m/s^3", "mps3"));
    for (text, si) in [("deg", "rad"), ("dps", "radps"), ("km", "m"), ("%", "1"), ("dbar", "Pa")] {
        let error = UnitError::NotSi { unit: text.into(), si: si.into() };
        assert_eq!(Unit::si(text), Err(error));
    }
}

#[test]
fn angles_are_shown_in_degrees_and_other_units_as_they_are() {
    let shown = |unit: &str| Unit::si(unit).unwrap().shown();
    assert_eq!(shown("rad"), ("deg".into(), 1_f64.to_degrees()));
    assert_eq!(shown("radps"), ("deg/s".into(), 1_f64.to_degrees()));
    for unit in ["m", "m/s", "m/s^2", "s", "Pa", "m/s^3"] {
        assert_eq!(shown(unit), (unit.into(), 1.0));
    }
    assert_eq!(shown("1"), ("".into(), 1.0));
}
