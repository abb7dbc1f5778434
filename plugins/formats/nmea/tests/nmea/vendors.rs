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
        let Some(Sentence::Transponder { time, date, beacon, position, depth: found, sigma: None }) =
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

/// A vessel that sails north by 2 m/s on the meridian of 10 deg, heading 60 deg, and a transponder
/// that is measured at half seconds, 1 s before its sentence.
fn vessel(seconds: u32, measured: &str) -> String {
    let mut text = String::new();
    for k in 0..seconds {
        let minutes = 30.0 + METRES * 2.0 * f64::from(k);
        text +=
            &sentence(&format!("GPGGA,1000{k:02}.00,54{minutes:09.6},N,01000.0,E,1,9,1,5,M,0,M,,"));
        text += &sentence(&format!("GPZDA,1000{k:02}.00,01,06,2022,00,00"));
        text += &sentence("HEHDT,60.0,T");
        if k >= 2 {
            text += &sentence(&format!("PSIMSSB,1000{:02}.50,{measured}", k - 2));
        }
    }
    text
}

/// Minutes of latitude of one metre at 54.5 deg: the radius of curvature of the meridian there is
/// 6 377 839 m.
const METRES: f64 = 60.0 * 180.0 / PI / 6_377_839.0;

/// 100 m to starboard and 50 m forward of a vessel with the heading 60 deg are
/// 50 cos 60 - 100 sin 60 = -61.6 m north and 50 sin 60 + 100 cos 60 = 93.3 m east. The radius of the
/// normal is 6 392 334 m.
#[test]
fn a_transponder_from_the_vessel_has_the_position_of_the_vessel_at_its_time() {
    let keys = KEYS.replace("\"1\"", "\"B42\"").replace("magnetic = \"magnetic\"", "");
    let (north, east) = (-61.602_540_378, 93.301_270_189);
    let place = |north: f64, east: f64| {
        let latitude = 54.5_f64.to_radians();
        let longitude = 10_f64.to_radians() + east / (6_392_334.0 * latitude.cos());
        [latitude + north / 6_377_839.0, longitude]
    };
    for (measured, [n, e], sigma) in [
        ("B42,A,,C,H,M,100,50,120.5,1.5,N,,", [north, east], Some(1.5)),
        ("B42,A,,C,N,F,-30,40,120.5,0.0,N,,", [-30.0, 40.0], None),
        ("B42,A,,C,E,M,40,-30,120.5,,,,", [-30.0, 40.0], None),
    ] {
        let file = vessel(8, measured);
        let read = read(file.as_bytes(), &keys).unwrap();
        assert_eq!((read.samples[0].len(), &read.warnings[0]), (6, &None), "{measured}");
        for (k, sample) in read.samples[0].iter().enumerate() {
            // at half seconds the vessel has sailed one metre further
            let expected = place(n + 1.0 + 2.0 * k as f64, e);
            for (channel, expected) in expected.iter().enumerate() {
                // 2 cm: positions of the vessel are written to 1e-6 minutes, 2 mm
                let error = (sample.get(channel).unwrap() - expected).abs() * 6.38e6;
                assert!(error < 0.02, "{measured}: {channel}: {error} m");
            }
            assert_eq!((sample.get(2), sample.get(3)), (Some(-120.5), sigma), "{measured}");
        }
    }
    // without a heading, or before the first position
    let file = vessel(8, "B42,A,,C,H,M,100,50,120.5,1.5,N,,");
    let headless = file.lines().filter(|l| !l.contains("HEHDT")).collect::<Vec<_>>().join("\r\n");
    let error = read(headless.as_bytes(), &keys).err().unwrap();
    assert!(error.contains("6 acoustic positions left out, without a position"), "{error}");
    let early = sentence("PSIMSSB,095900.50,B42,A,,C,N,M,1,2,3,,,,");
    let late = read(format!("{early}{file}").as_bytes(), &keys).unwrap();
    let warning = late.warnings[0].clone().unwrap();
    assert!(warning.contains("1 acoustic position left out"), "{warning}");
    assert_eq!(late.samples[0].len(), 6);
}

#[test]
fn kongsberg_positions_in_radians_are_absolute_and_doubtful_ones_are_not_used() {
    let good = "PSIMSSB,085405.61,B42,A,,R,N,M,0.951204,0.174533,120.0,2.5,N,,";
    let found = parse(good.as_bytes());
    let Some(Sentence::Transponder { time, date: None, beacon, position, depth, sigma }) = found
    else {
        panic!("{found:?}");
    };
    assert_eq!((time, beacon), (Some(32_045_610_000_000), Beacon::new("B42").unwrap()));
    assert_eq!((position, depth, sigma), ([0.951_204, 0.174_533], Some(120.0), Some(2.5)));
    for (from, to) in [
        // status, an error code such as no reply, a prediction, polar, UTM, off the Earth, no number
        (",A,,", ",V,,"),
        (",A,,", ",A,NRy,"),
        (",M,", ",P,"),
        (",R,N", ",P,H"),
        (",R,N", ",U,N"),
        ("0.951204", "1.951204"),
        ("0.174533", ""),
    ] {
        assert_eq!(parse(good.replacen(from, to, 1).as_bytes()), None, "{to}");
    }
    let far = good.replace(",R,N", ",C,N").replace("0.951204", "200000");
    assert_eq!(parse(far.as_bytes()), None);
}

#[test]
fn a_transponder_that_cannot_be_read_is_an_error_with_a_remedy() {
    let alone = sentence("PSIMSSB,085405.61,B42,A,,C,H,M,134.5,114.5,120.0,,,,");
    let relative = KEYS.replace("\"1\"", "\"B42\"");
    let error =
        read(alone.as_bytes(), &relative.replace("magnetic = \"magnetic\"", "")).err().unwrap();
    for words in ["it has PSIMSSB", "1 acoustic position left out", "record its GGA or RMC"] {
        assert!(error.contains(words), "{error}");
    }
    let utm = alone.replace("C,H", "U,N");
    let content = utm.trim_start_matches('$').split('*').next().unwrap();
    let utm = sentence(content);
    let good = recording(2);
    for (file, from, to, words) in [
        (&good, "beacon = \"1\"", "", ["the transponder of `usbl` is not given", "set `beacon`"]),
        (&good, "usbl = \"usbl\"", "", ["no sensor receives", "name it with `usbl`"]),
        (&good, "\"1\"", "\"7\"", ["PSIMSSB of the transponder with", "set `beacon` to a"]),
        (&good, "\"1\"", "\" \"", ["is no transponder", "1 to 16 bytes"]),
        (&utm, "magnetic = \"magnetic\"", "", ["it has PSIMSSB", "in place of polar"]),
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

#[test]
fn ggk_of_trimble_has_a_date_and_the_height_above_the_ellipsoid() {
    let second = |k: u8, quality: u8| {
        sentence(&format!(
            "PTNL,GGK,08300{k}.00,060122,3204.0,N,03459.5,E,{quality},09,1.5,EHT25.5,M"
        ))
    };
    let file = [second(0, 3), second(1, 0), second(2, 1)].concat();
    let read = read(file.as_bytes(), "gnss = \"gnss\"").unwrap();
    let heights: Vec<_> = read.samples[0].iter().map(|sample| sample.get(2)).collect();
    assert_eq!(heights, [Some(25.5), Some(25.5)]);
    // 1 June 2022
    assert_eq!(read.samples[0][0].time.nanos(), 1_654_072_200_000_000_000);
    let qualities = [3, 2, 5].map(|quality| parse(&second(0, quality).as_bytes()[1..]));
    let of = |s: &Option<Sentence>| match s {
        Some(Sentence::Fix { quality, .. }) => *quality,
        _ => 0,
    };
    assert_eq!(qualities.each_ref().map(of), [4, 5, 2]);
}
