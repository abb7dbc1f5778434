//! Magnetic headings, acoustic transponders, and the quality of Kongsberg's attitude.

use crate::{near, read, sentence};
use navfuse_nmea::{Beacon, Sentence, parse};
use std::f64::consts::PI;

/// Keys, and the sensors that receive magnetic headings and the positions of a transponder.
pub const KEYS: &str = r#"
magnetic = "magnetic"
usbl = "usbl"
beacon = "1"
[sensor.magnetic]
type = "magnetic-heading"
noise = "2 deg"
[sensor.usbl]
type = "gnss"
horizontal_noise = "3 m"
vertical_noise = "3 m"
"#;

/// A recording of this many seconds from 08:30:00 on 1 June 2022.
pub fn recording(seconds: u32) -> String {
    let mut text = String::new();
    for k in 0..seconds {
        let time = format!("0830{k:02}.00");
        let minutes = 4.0 + 0.001 * f64::from(k);
        let gaps = |beacon: u8, place: &str| {
            format!("PTSAG,#00001,{time},01,06,2022,{beacon},{place},1,9999.00")
        };
        for content in [
            format!("GPZDA,{time},01,06,2022,00,00"),
            format!("HCHDG,{}.0,1.5,W,4.5,E", 355 + k),
            // the ship, the vehicle and another transponder
            gaps(0, "3200.00000,N,03400.00000,E,F,0002.89"),
            gaps(1, &format!("32{minutes:08.5},N,03459.50000,W,7,0101.50")),
            gaps(2, "3200.00000,N,03400.00000,E,F,0050.00"),
        ] {
            text.push_str(&sentence(&content));
        }
    }
    text
}

#[test]
fn a_magnetic_heading_has_the_north_of_its_sensor() {
    let file = recording(10);
    // heading 355 deg + k, deviation 1.5 deg west, variation 4.5 deg east, declination 6 deg
    for (keys, turn) in [
        ("magnetic = \"compass\"", 3.0),
        ("magnetic = \"compass\"\ndeclination = \"6 deg\"", 4.5),
        (
            &format!("magnetic = \"magnetic\"\n{}", KEYS.split_once("beacon = \"1\"\n").unwrap().1),
            -1.5,
        ),
    ] {
        let read = read(file.as_bytes(), keys).unwrap();
        assert_eq!((read.samples[0].len(), &read.warnings[0]), (10, &None), "{keys}");
        for (k, sample) in read.samples[0].iter().enumerate() {
            let degrees = (355.0 + k as f64 + turn) % 360.0;
            let found = sample.get(0).unwrap();
            assert!((found - degrees.to_radians()).abs() < 1e-14 * PI, "{keys} {k}: {found}");
        }
    }
}

#[test]
fn a_magnetic_heading_without_a_variation_needs_a_declination() {
    let zda = |k: u8| sentence(&format!("GPZDA,08300{k}.00,01,06,2022,00,00"));
    let hdm = [zda(0), sentence("HCHDM,100.0,M")].concat();
    let error = read(hdm.as_bytes(), "magnetic = \"compass\"").err().unwrap();
    assert!(error.contains("no valid HDG with a variation"), "{error}");
    assert!(error.contains("set `declination`, or name a sensor of type"), "{error}");
    let found = read(hdm.as_bytes(), "magnetic = \"compass\"\ndeclination = \"-10 deg\"").unwrap();
    near(&found.samples[0][0], &[90_f64.to_radians()]);
    // one of several headings lacks it
    let file = [hdm, zda(1), sentence("HCHDG,100.0,,,4.5,E")].concat();
    let found = read(file.as_bytes(), "magnetic = \"compass\"").unwrap();
    assert_eq!(found.samples[0].len(), 1);
    let warning = found.warnings[0].clone().unwrap();
    assert!(warning.contains("1 magnetic heading without a variation, set"), "{warning}");
    let both = KEYS.replace("beacon", "declination = \"1 deg\"\nbeacon");
    let error = read(recording(2).as_bytes(), &both).err().unwrap();
    assert!(error.contains("[sensor.magnetic] has a declination of its own"), "{error}");
}

#[test]
fn the_positions_of_one_transponder_are_those_of_the_sensor() {
    let read = read(recording(5).as_bytes(), KEYS).unwrap();
    let samples = &read.samples[1];
    assert_eq!((samples.len(), &read.warnings[1]), (5, &None));
    let place = [(32.0 + 4.003 / 60.0_f64).to_radians(), -(34.0 + 59.5 / 60.0_f64).to_radians()];
    near(&samples[3], &[place[0], place[1], -101.5]);
}

#[test]
fn sentences_of_makers_are_read_as_their_manuals_have_them() {
    // the examples of the manual of GAPS, and of a log of Ranger 2
    let gaps =
        "PTSAG,#16068,124544.449,18,12,2017,1,4305.25355,N,00631.76852,E,F,1013.10,1,9999.00";
    let ranger =
        "PSONLLD,170004.53,ALVIN 914,A,28.8114807,-87.80925696,1951.156,13.96,13.96,0.00,2.62,,,,";
    for (content, name, seconds, day, [lat, lon, depth]) in [
        (gaps, "01", 45_944.449, Some(17_518), [43.087_559_166_666, 6.529_475_333_333, 1013.1]),
        (ranger, "ALVIN 914", 61_204.53, None, [28.811_480_7, -87.809_256_96, 1951.156]),
    ] {
        let Some(Sentence::Transponder { time, date, beacon, position, depth: found }) =
            parse(content.as_bytes())
        else {
            panic!("{content}");
        };
        assert_eq!(time, Some((seconds * 1e9_f64).round() as i64));
        assert_eq!(date, day.map(|day: i64| day * 86_400_000_000_000));
        assert_eq!((beacon, found), (Beacon::new(name).unwrap(), Some(depth)));
        for (a, b) in position.iter().zip([lat, lon]) {
            assert!((a - b.to_radians()).abs() < 1e-13, "{content}: {position:?}");
        }
    }
    // no hydrophone, and no depth
    assert_eq!(parse(gaps.replace(",F,", ",0,").as_bytes()), None);
    let without = parse(gaps.replace(".10,1,", ".10,0,").as_bytes());
    assert!(matches!(without, Some(Sentence::Transponder { depth: None, .. })), "{without:?}");
    assert_eq!(parse(ranger.replace(",A,", ",V,").as_bytes()), None);
}

#[test]
fn a_transponder_that_cannot_be_read_is_an_error_with_a_remedy() {
    let relative = sentence("PSIMSSB,085405.61,B42,A,,C,H,M,134.5,114.5,120.0,,,,");
    let good = recording(2);
    for (file, from, to, words) in [
        (&good, "beacon = \"1\"", "", ["the transponder of `usbl` is not given", "set `beacon`"]),
        (&good, "usbl = \"usbl\"", "", ["no sensor receives", "name it with `usbl`"]),
        (&good, "\"1\"", "\"7\"", ["PTSAG or PSONLLD of the transponder", "set `beacon` to a"]),
        (&good, "\"1\"", "\" \"", ["is no transponder", "1 to 16 bytes"]),
        (&relative, "magnetic = \"magnetic\"", "", ["it has PSIMSSB", "relative to the vessel"]),
    ] {
        let error = read(file.as_bytes(), &KEYS.replacen(from, to, 1)).err().unwrap();
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    }
}

#[test]
fn a_reference_leaves_out_what_psxn_20_declares_invalid() {
    let second = |k: u8, quality: &str| {
        [
            format!("GPGGA,08300{k}.00,3204.0,N,03459.5,E,1,9,1,5,M,0,M,,"),
            format!("PSXN,20,{quality}"),
            "PSXN,23,1.5,-2.5,351.0,0.1".to_owned(),
        ]
        .map(|content| sentence(&content))
        .concat()
    };
    let file = [(0, "0,0,0,0"), (1, "1,1,1,1"), (2, "2,0,0,0"), (3, "0,2,0,0"), (4, "0,0,2,0")];
    let file = file.map(|(k, quality)| second(k, quality)).concat();
    let read = read(file.as_bytes(), "reference = \"reference\"").unwrap();
    // latitude, height and yaw
    let found = |k: usize| [0, 2, 8].map(|channel| read.samples[0][k].get(channel).is_some());
    assert_eq!(
        [0, 1, 2, 3, 4].map(found),
        [
            [true, true, true],
            [true, true, true],
            [false, true, true],
            [true, false, true],
            [true, true, false],
        ]
    );
}
