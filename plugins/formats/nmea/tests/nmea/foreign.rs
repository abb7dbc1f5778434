//! The parser equals pynmea2, a reader written by others.
//!
//! The test installs pynmea2 from PyPI into the target folder, or uses the interpreter that
//! NAVFUSE_NMEA_PYTHON names. Without Python or PyPI it is skipped.

use crate::sentence;
use navfuse_core::units::calendar::DAY;
use navfuse_frames::{Frames, Sentences};
use navfuse_nmea::{Sentence, parse};
use navfuse_testing::python::Packages;
use std::path::{Path, PathBuf};
use std::process::Command;

fn python() -> Option<PathBuf> {
    Packages {
        names: "pynmea2",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("pynmea2"),
        variable: Some("NAVFUSE_NMEA_PYTHON"),
        check: "import pynmea2",
        install: &[&["pynmea2"]],
    }
    .python()
}

/// Sentences of every kind, with the decimals, hemispheres and empty fields that devices write.
fn sentences() -> Vec<String> {
    let mut contents: Vec<String> = [
        "GPGGA,134658.00,5106.9792,N,11402.3003,W,2,09,1.0,1048.47,M,-16.27,M,08,AAAA",
        "GNGGA,000000,0000.0000,S,00000.0000,E,1,12,,0,M,,M,,",
        "GPGGA,235959.999,8959.99999,S,17959.99999,W,5,30,0.5,-12.5,M,40,M,1.2,0001",
        "GPGGA,120000.5,,,,,0,00,99.9,,,,,,",
        "GNRMC,001031.00,A,4404.13993,N,12118.86023,W,0.146,,100117,,,A",
        "GPRMC,081836,A,3751.65,S,14507.36,E,000.0,360.0,130998,011.3,E",
        "GPRMC,225446,V,4916.45,N,12311.12,W,000.5,054.7,191194,020.3,E",
        "INRMC,083559.50,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,E",
        "GPVTG,054.7,T,034.4,M,005.5,N,010.2,K",
        "GPVTG,,T,,M,0.000,N,0.000,K,A",
        "GPVTG,354.07,T,355.13,M,8.9,N,16.5,K,D",
        "HEHDT,274.07,T",
        "HEHDT,0.00,T",
        "GPGST,172814.0,0.006,0.023,0.020,273.6,0.023,0.020,0.031",
        "GPZDA,201530.00,04,07,2002,00,00",
        "GPZDA,235960.00,31,12,2016,-03,30",
        "SDDPT,2.4,0.3",
        "SDDPT,76.1,-1.25,100",
        "SDDPT,12.0,",
        "PASHR,085335.000,224.19,T,-01.26,+00.83,+00.00,0.101,0.113,0.267,1,0",
        "PSXN,23,0.14,-0.55,37.5,0.02",
        "PSXN,20,0,1,2,0",
        "HCHDG,101.1,1.5,W,7.1,E",
        "HCHDG,359.25,0.75,E,12.5,W",
        "HCHDG,12.5,,,,",
        "HCHDM,274.07,M",
    ]
    .map(str::to_owned)
    .to_vec();
    for k in 0..200_u32 {
        let x = f64::from(k * 7919 % 1000) / 1000.0;
        let time = format!("{:02}{:02}{:02}.{:03}", k % 24, k * 7 % 60, k * 11 % 60, k * 37 % 1000);
        let place = format!(
            "{:02}{:09.6},{},{:03}{:09.6},{}",
            k * 13 % 90,
            60.0 * x * 0.999_99,
            ["N", "S"][k as usize % 2],
            k * 17 % 180,
            60.0 * (1.0 - x) * 0.999_99,
            ["W", "E"][k as usize / 2 % 2]
        );
        let (angle, speed) = (360.0 * x, 40.0 * x);
        contents.push(format!(
            "GPGGA,{time},{place},{},10,1.1,{:.3},M,{:.1},M,,",
            1 + k % 5,
            900.0 * x,
            50.0 - 80.0 * x
        ));
        contents.push(format!(
            "GPRMC,{time},A,{place},{speed:.4},{angle:.3},{:02}{:02}{:02},,,A",
            1 + k % 28,
            1 + k % 12,
            k % 60
        ));
        contents.push(format!("GPVTG,{angle:.2},T,,M,{speed:.3},N,{:.3},K,A", speed * 1.852));
        contents.push(format!(
            "PASHR,{time},{angle:.2},T,{:+.2},{:+.2},+0.1,0.1,0.1,0.2,1,0",
            10.0 - 20.0 * x,
            5.0 * x
        ));
    }
    contents.iter().map(|content| sentence(content)).collect()
}

/// The numbers of a sentence as pynmea2 has them: NaN where there is none.
fn numbers(s: &Sentence) -> Vec<f64> {
    const NONE: f64 = f64::NAN;
    let seconds = |t: Option<i64>| t.map_or(NONE, |t| t as f64 * 1e-9);
    let days = |d: Option<i64>| d.map_or(NONE, |d| (d / DAY) as f64);
    let two = |p: Option<[f64; 2]>| p.unwrap_or([NONE; 2]);
    let degrees = |p: Option<[f64; 2]>| two(p).map(f64::to_degrees);
    let motion = |v: Option<[f64; 2]>| [two(v)[0] * 3600.0 / 1852.0, two(v)[1].to_degrees()];
    match *s {
        Sentence::Fix { time, position, height, quality, .. } => {
            let [lat, lon] = degrees(position);
            vec![seconds(time), lat, lon, height.unwrap_or(NONE), f64::from(quality)]
        }
        Sentence::Minimum { time, date, position, velocity, valid, .. } => {
            let ([lat, lon], [speed, course]) = (degrees(position), motion(velocity));
            vec![seconds(time), days(date), lat, lon, speed, course, f64::from(u8::from(valid))]
        }
        Sentence::Velocity { velocity, .. } => motion(velocity).to_vec(),
        Sentence::Accuracy { time, sigma } => {
            [vec![seconds(time)], sigma.unwrap_or([NONE; 3]).to_vec()].concat()
        }
        Sentence::Date { time, date } => vec![seconds(time), days(date)],
        Sentence::Heading(heading) => vec![heading.to_degrees()],
        Sentence::Magnetic { heading, variation } => {
            vec![heading.to_degrees(), variation.map_or(NONE, f64::to_degrees)]
        }
        Sentence::Quality(usable) => usable.map(|u| f64::from(u8::from(u))).to_vec(),
        // pynmea2 does not know the sentences of transponders
        Sentence::Transponder { .. } | Sentence::Relative { .. } => Vec::new(),
        Sentence::Depth(depth) => vec![depth],
        Sentence::Attitude { time, angles } => {
            [vec![seconds(time)], angles.map(f64::to_degrees).to_vec()].concat()
        }
    }
}

#[test]
fn every_sentence_has_the_numbers_of_pynmea2() {
    let Some(python) = python() else { return };
    let sentences = sentences();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("nav.nmea");
    std::fs::write(&file, sentences.concat()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/nmea/pynmea2_rows.py");
    let output = Command::new(python).arg(script).arg(&file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let bytes = std::fs::read(&file).unwrap();
    let mut frames = Frames::new(&bytes[..], Sentences::NMEA);
    let mut count = 0;
    for row in text.lines() {
        let frame = frames.next().unwrap().unwrap();
        let line = String::from_utf8_lossy(frame.bytes).into_owned();
        let ours = numbers(&parse(Sentences::NMEA.content(frame.bytes)).unwrap());
        let theirs: Vec<f64> = row.split(' ').map(|n| n.parse().unwrap()).collect();
        assert_eq!(ours.len(), theirs.len(), "{line}");
        let nowhere = |k: usize| {
            // 0 N 0 E stands for no position
            let pair = |k: usize| {
                ours[k..k + 2].iter().all(|x| x.is_nan()) && theirs[k..k + 2] == [0.0; 2]
            };
            (k.saturating_sub(1)..=k).any(|k| k + 2 <= ours.len() && pair(k))
        };
        for (k, (a, b)) in ours.iter().zip(&theirs).enumerate() {
            // degrees from minutes, and back from radians: a few roundings of up to 360
            let same = (a - b).abs() <= 2e-13 * b.abs().max(1.0)
                || (a.is_nan() && (b.is_nan() || nowhere(k)));
            assert!(same, "{line}: {ours:?}, pynmea2 {theirs:?}");
        }
        count += 1;
    }
    assert_eq!((count, frames.next().unwrap().is_none()), (sentences.len(), true));
    assert_eq!(frames.damage().bytes(), 0);
}
