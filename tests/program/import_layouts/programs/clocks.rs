//! Clocks of other zeros and scales, and rows of several sensors with the same times.

use super::*;
use std::fmt::Write;

/// Nanoseconds of a day, and days from the zero of MATLAB to 1970.
const DAY: i64 = 86_400_000_000_000;
const MATLAB: i64 = 719_529;

/// Days since the zero of MATLAB, to 10 us.
fn days(nanos: i64) -> String {
    let (day, rest) = (nanos / DAY + MATLAB, nanos % DAY);
    format!("{day}.{:010}", rest / 8_640)
}

/// Positions alone, in a column of the time with this heading.
fn places(recorded: &Recorded, heading: &str, stamp: impl Fn(i64) -> String) -> String {
    let line = |(t, v): &Row| format!("{},{}", stamp(*t), position(v));
    table(&format!("{heading},lat,lon,alt"), &recorded["gnss"], line)
}

/// The programs.
pub const PROGRAMS: [Program; 5] = [
    Program {
        name: "days of MATLAB",
        write: |recorded, folder| {
            let line = |(t, v): &Row| format!("{},{}", days(t + DATE), cells(v.iter().copied()));
            let imu = table("Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ", &recorded["imu"], line);
            let fixes = places(recorded, "Time", |t| days(t + DATE));
            let given = vec![put(folder, "a.csv", &imu), put(folder, "b.csv", &fixes)];
            Written { given, offset: DATE }
        },
    },
    Program {
        name: "an IMU that counts from its start beside dated fixes",
        write: |recorded, folder| {
            let fixes = table("utc,lat,lon,alt,vn,ve,vd", &recorded["gnss"], |(t, v)| {
                let stamp = format!("{}T{}Z", day(t + DATE), clock(t + DATE));
                format!("{stamp},{},{}", position(v), cells(v[3..6].to_vec()))
            });
            let given = vec![
                put(folder, "imu.csv", &plain_imu(recorded, 0)),
                put(folder, "gps.csv", &fixes),
            ];
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "dates whose order only the other file shows",
        write: |recorded, folder| {
            // the fourth of March, not the third of April
            let begin = 1_709_510_400_000_000_000;
            let fixes = places(recorded, "Date,Time", |t| format!("04/03/2024,{}", clock(t)));
            let given = vec![
                put(folder, "imu.csv", &plain_imu(recorded, begin)),
                put(folder, "gps.csv", &fixes),
            ];
            Written { given, offset: begin }
        },
    },
    Program {
        name: "rows of two sensors with the same times and empty cells, and headings again",
        write: |recorded, folder| {
            let headings = "t,source,gx,gy,gz,ax,ay,az,lat,lon,alt\n";
            let mut rows: Vec<(i64, String)> = Vec::new();
            for (t, v) in &recorded["imu"] {
                rows.push((*t, format!("imu,{},,,", cells(v.iter().copied()))));
            }
            for (t, v) in &recorded["gnss"] {
                rows.push((*t, format!("gps,,,,,,,{}", position(v))));
            }
            rows.sort_by_key(|(t, _)| *t);
            let mut text = headings.to_owned();
            for (k, (t, row)) in rows.iter().enumerate() {
                let _ = writeln!(text, "{},{row}", seconds(*t));
                text += if k == rows.len() / 2 { headings } else { "" };
            }
            Written { given: vec![put(folder, "log.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "headings in Latin-1",
        write: |recorded, folder| {
            let headings = "Zeit [s],Drehrate X [°/s],Drehrate Y [°/s],Drehrate Z [°/s],\
                            Beschl. X [m/s²],Beschl. Y [m/s²],Beschl. Z [m/s²]";
            let text = table(headings, &recorded["imu"], |(t, v)| {
                let rates = v[..3].iter().map(|w| w.to_degrees());
                format!("{},{}", seconds(*t), cells(rates.chain(v[3..].iter().copied())))
            });
            let written = imu_of(recorded, folder, &text, 0);
            let bytes: Vec<u8> = text.chars().map(|c| c as u8).collect();
            std::fs::write(&written.given[0], bytes).expect("the test can write");
            written
        },
    },
];
