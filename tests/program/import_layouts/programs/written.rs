//! Tables as small programs write them: rows from the newest to the oldest, columns that touch, printed objects, other
//! signs and separators within numbers, and rows of several kinds without headings.

use super::*;

fn imu_lines(recorded: &Recorded, line: impl Fn(i64, &[f64]) -> String) -> String {
    recorded["imu"].iter().map(|(t, v)| line(*t, v) + "\n").collect()
}

/// The sum of a sentence of NMEA 0183.
fn sentence(text: &str) -> String {
    format!("${text}*{:02X}", text.bytes().fold(0, |sum, b| sum ^ b))
}

/// The programs.
pub const PROGRAMS: [Program; 11] = [
    Program {
        name: "a receiver without an antenna beside another one",
        write: |recorded, folder| {
            let head = "time,gps1_lat,gps1_lon,gps1_alt,gps2_lat,gps2_lon,gps2_alt";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                format!("{},nan,nan,nan,{}", seconds(*t), position(v))
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "rows from the newest to the oldest",
        write: |recorded, folder| {
            let reversed = |text: String| {
                let mut lines = text.lines();
                let head = lines.next().unwrap_or_default().to_owned();
                lines.rev().fold(head, |text, line| text + "\n" + line) + "\n"
            };
            let files =
                [("imu.csv", plain_imu(recorded, DATE)), ("fixes.csv", plain_gnss(recorded, DATE))];
            let given = files.map(|(name, text)| put(folder, name, &reversed(text))).to_vec();
            Written { given, offset: DATE }
        },
    },
    Program {
        name: "columns of a fixed width that touch, without headings",
        write: |recorded, folder| {
            let text = imu_lines(recorded, |t, v| {
                let rates: String = v[..3].iter().map(|w| format!("{w:8.5}")).collect();
                let forces: String = v[3..].iter().map(|f| format!("{f:8.4}")).collect();
                format!("{:8.3}{rates}{forces}", t as f64 * 1e-9)
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "printed dictionaries of Python",
        write: |recorded, folder| {
            let text = imu_lines(recorded, |t, v| {
                let [rates, forces] =
                    [0, 3].map(|k| cells(v[k..k + 3].iter().copied()).replace(',', ", "));
                format!(
                    "{{'t': {}, 'gyro': [{rates}], 'accel': [{forces}], 'ok': True}}",
                    seconds(t)
                )
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "the minus sign of typography, and apostrophes between thousands",
        write: |recorded, folder| {
            let grouped = |t: i64| {
                let millis = t / 1_000_000 + 1_234_000;
                format!("{}'{:03}'{:03}", millis / 1_000_000, millis / 1000 % 1000, millis % 1000)
            };
            let text = imu_lines(recorded, |t, v| {
                format!(
                    "{};{}",
                    grouped(t),
                    cells(v.iter().copied()).replace(',', ";").replace('-', "\u{2212}")
                )
            });
            imu_of(
                recorded,
                folder,
                &format!("Zeit [ms];gx;gy;gz;ax;ay;az\n{text}"),
                1_234_000_000_000,
            )
        },
    },
    Program {
        name: "UTF-16 without a mark",
        write: |recorded, folder| {
            let text = plain_imu(recorded, 0).replace(',', "\t");
            let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            let imu = folder.join("imu.txt");
            std::fs::write(&imu, bytes).expect("the test can write");
            Written { given: vec![imu, put(folder, "g.csv", &plain_gnss(recorded, 0))], offset: 0 }
        },
    },
    Program {
        name: "minutes and seconds, as a spreadsheet shows them",
        write: |recorded, folder| {
            let stamp = |t: i64| {
                format!("{:02}:{:06.3}", t / 60_000_000_000, (t % 60_000_000_000) as f64 * 1e-9)
            };
            let imu = table("Zeit,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", stamp(*t), cells(v.iter().copied()))
            });
            let fixes = table("Zeit,lat,lon,alt", &recorded["gnss"], |(t, v)| {
                format!("{},{}", stamp(*t), position(v))
            });
            let given = [("imu.csv", imu), ("fixes.csv", fixes)];
            Written {
                given: given.map(|(name, text)| put(folder, name, &text)).to_vec(),
                offset: 0,
            }
        },
    },
    Program {
        name: "sentences of an own kind with their checksums",
        write: |recorded, folder| {
            let text = imu_lines(recorded, |t, v| {
                sentence(&format!("IMU,{},{}", seconds(t), cells(v.iter().copied())))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "nanoseconds since the start of a computer, which resemble a date in milliseconds",
        write: |recorded, folder| {
            let offset = 987_654_321_987;
            let text = table("timestamp_ns,gx,gy,gz,ax,ay,az,", &recorded["imu"], |(t, v)| {
                format!("{},{},", t + offset, cells(v.iter().copied()))
            });
            imu_of(recorded, folder, &text, offset)
        },
    },
    Program {
        name: "rows of two kinds, each a letter and a number that counts all rows",
        write: |recorded, folder| {
            let imu = recorded["imu"]
                .iter()
                .map(|(t, v)| (*t, format!("I,#,{},{}", t / 1000, cells(v.iter().copied()))));
            let fixes = recorded["gnss"]
                .iter()
                .map(|(t, v)| (*t, format!("G,#,{},{}", t / 1000, position(v))));
            let mut rows: Vec<(i64, String)> = imu.chain(fixes).collect();
            rows.sort_by_key(|(t, _)| *t);
            let numbered = rows
                .iter()
                .enumerate()
                .map(|(k, (_, row))| row.replace('#', &k.to_string()) + "\n");
            Written {
                given: vec![put(folder, "log.txt", &numbered.collect::<String>())],
                offset: 0,
            }
        },
    },
    Program {
        name: "JSON whose second array begins behind the part by which tables are recognised",
        write: |recorded, folder| {
            let about = "x".repeat(600);
            let imu: Vec<String> = recorded["imu"]
                .iter()
                .map(|(t, v)| {
                    format!(
                        "{{\"t\": {}, \"gyro\": [{}], \"accel\": [{}], \"about\": \"{about}\"}}",
                        seconds(*t),
                        cells(v[..3].iter().copied()),
                        cells(v[3..].iter().copied())
                    )
                })
                .collect();
            let fixes: Vec<String> = recorded["gnss"]
                .iter()
                .map(|(t, v)| {
                    format!(
                        "{{\"t\": {}, \"lat\": {}, \"lon\": {}, \"alt\": {}}}",
                        seconds(*t),
                        v[0].to_degrees(),
                        v[1].to_degrees(),
                        v[2]
                    )
                })
                .collect();
            let text =
                format!("{{\"imu\": [{}],\n\"gps\": [{}]}}\n", imu.join(",\n"), fixes.join(",\n"));
            Written { given: vec![put(folder, "log.json", &text)], offset: 0 }
        },
    },
];
