//! Senses of axes, rows of several kinds, and clocks that start again from zero.

use super::*;

/// A run of the clock's millisecond counter: 24 s before it starts again from zero.
const COUNTER: i64 = 1 << 16;
const STARTED: i64 = COUNTER - 24_000;

fn counter(nanos: i64) -> i64 {
    (nanos / 1_000_000 + STARTED) % COUNTER
}

/// The programs.
pub const PROGRAMS: [Program; 8] = [
    Program {
        name: "specific forces along gravity, as Apple's devices report them",
        write: |recorded, folder| {
            axes(recorded, folder, |v| {
                let [a, b, c, d, e, f] = phone(v);
                [a, b, c, -d, -e, -f]
            })
        },
    },
    Program {
        name: "rates of the left hand",
        write: |recorded, folder| {
            axes(recorded, folder, |v| [-v[0], -v[1], -v[2], v[3], v[4], v[5]])
        },
    },
    Program {
        name: "a left-handed set of axes",
        write: |recorded, folder| {
            axes(recorded, folder, |v| [v[0], v[1], -v[2], v[3], v[4], -v[5]])
        },
    },
    Program {
        name: "rows of one width, each with its kind",
        write: |recorded, folder| {
            let imu = recorded["imu"].iter();
            let imu = imu.map(|(t, v)| (*t, format!("IMU,{}", cells(v.iter().copied()))));
            let fix = |v: &[f64]| format!("GPS,{},{}", position(v), cells(v[3..6].to_vec()));
            let fixes = recorded["gnss"].iter().map(|(t, v)| (*t, fix(v)));
            let mut rows: Vec<(i64, String)> = imu.chain(fixes).collect();
            rows.sort();
            let stamped = |(t, row): &(i64, String)| {
                let (kind, values) = row.split_once(',').expect("a kind");
                format!("{kind},{},{values}\n", seconds(*t))
            };
            let text: String = rows.iter().map(stamped).collect();
            Written { given: vec![put(folder, "log.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "GnssLogger of Android",
        write: |recorded, folder| {
            let head = "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,elapsedRealtimeNanos\n# UncalAccel,utcTimeMillis,elapsedRealtimeNanos,UncalAccelXMps2,UncalAccelYMps2,UncalAccelZMps2,BiasXMps2,BiasYMps2,BiasZMps2\n# UncalGyro,utcTimeMillis,elapsedRealtimeNanos,UncalGyroXRadPerSec,UncalGyroYRadPerSec,UncalGyroZRadPerSec,DriftXRadPerSec,DriftYRadPerSec,DriftZRadPerSec\n";
            let mut rows = Vec::new();
            for (t, v) in &recorded["imu"] {
                let (v, stamp) = (phone(v), (t + DATE) / 1_000_000);
                rows.push((
                    *t,
                    format!("UncalAccel,{stamp},{t},{},0,0,0\n", cells(v[3..].to_vec())),
                ));
                rows.push((
                    *t,
                    format!("UncalGyro,{stamp},{t},{},0,0,0\n", cells(v[..3].to_vec())),
                ));
            }
            for (t, v) in &recorded["gnss"] {
                let [speed, course] = course(v);
                let stamp = (t + DATE) / 1_000_000;
                rows.push((
                    *t,
                    format!("Fix,GPS,{},{speed:.2},2.0,{course:.1},{stamp},{t}\n", position(v)),
                ));
            }
            rows.sort();
            let text: String = rows.into_iter().map(|(_, row)| row).collect();
            let given = vec![put(folder, "gnss_log.txt", &(head.to_owned() + &text))];
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "milliseconds of 16 bits",
        write: |recorded, folder| {
            let imu = table("millis,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", counter(*t), cells(v.iter().copied()))
            });
            let fixes = table("millis,lat,lon,alt", &recorded["gnss"], |(t, v)| {
                format!("{},{}", counter(*t), position(v))
            });
            let given = vec![put(folder, "imu.csv", &imu), put(folder, "gps.csv", &fixes)];
            Written { given, offset: STARTED * 1_000_000 }
        },
    },
    Program {
        name: "times of the day around midnight",
        write: |recorded, folder| {
            let day = 86_400_000_000_000;
            let begin = day - 20_000_000_000;
            let imu = table("UTC,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", clock(t + begin), cells(v.iter().copied()))
            });
            let fixes = table("UTC,lat,lon,alt", &recorded["gnss"], |(t, v)| {
                format!("{},{}", clock(t + begin), position(v))
            });
            let given = vec![put(folder, "imu.csv", &imu), put(folder, "gps.csv", &fixes)];
            Written { given, offset: begin }
        },
    },
    Program {
        name: "integers: milligravity, 1e-7 degrees and millimetres",
        write: |recorded, folder| {
            let head = "ms,gyro_x_mdps,gyro_y_mdps,gyro_z_mdps,acc_x_mg,acc_y_mg,acc_z_mg";
            let imu = table(head, &recorded["imu"], |(t, v)| {
                let rates = v[..3].iter().map(|w| w.to_degrees() * 1e3);
                let forces = v[3..].iter().map(|f| f / GRAVITY * 1e3);
                format!("{},{}", t / 1_000_000, cells(rates.chain(forces)))
            });
            let fixes = table("ms,lat_e7,lon_e7,alt_mm", &recorded["gnss"], |(t, v)| {
                let [lat, lon] = [0, 1].map(|k| v[k].to_degrees() * 1e7);
                format!("{},{lat:.0},{lon:.0},{:.0}", t / 1_000_000, v[2] * 1e3)
            });
            let given = vec![put(folder, "imu.csv", &imu), put(folder, "gps.csv", &fixes)];
            Written { given, offset: 0 }
        },
    },
];
