//! Rows that name their values, and headings that only their units or numbers explain.

use super::*;

/// The programs.
pub const PROGRAMS: [Program; 8] = [
    Program {
        name: "JSON, an object in each line, of several kinds",
        write: |recorded, folder| {
            let imu = recorded["imu"].iter().map(|(t, v)| {
                let (w, f) = (cells(v[..3].to_vec()), cells(v[3..].to_vec()));
                let time = seconds(*t);
                (
                    *t,
                    format!(
                        "{{\"topic\": \"imu\", \"t\": {time}, \"gyro\": [{w}], \"acc\": [{f}]}}\n"
                    ),
                )
            });
            let fixes = recorded["gnss"].iter().map(|(t, v)| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                let (time, height) = (seconds(*t), v[2]);
                let place = format!("\"lat\": {lat:.9}, \"lon\": {lon:.9}, \"alt\": {height:.3}");
                (*t, format!("{{\"topic\": \"gps\", \"t\": {time}, \"pos\": {{{place}}}}}\n"))
            });
            let mut lines: Vec<(i64, String)> = imu.chain(fixes).collect();
            lines.sort_by_key(|(t, _)| *t);
            let text: String = lines.into_iter().map(|(_, line)| line).collect();
            Written { given: vec![put(folder, "log.jsonl", &text)], offset: 0 }
        },
    },
    Program {
        name: "lines with names, as mavlogdump.py writes them",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map(|k| v[k]);
                let stamp = clock(t + DATE);
                format!(
                    "2023-11-14 {stamp}: IMU {{TimeUS : {}, GyrX : {a}, GyrY : {b}, GyrZ : {c}, \
                     AccX : {d}, AccY : {e}, AccZ : {f}, T : 35.0}}\n",
                    t / 1000
                )
            };
            let text: String = recorded["imu"].iter().map(line).collect();
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "Xsens MT Manager, tabs with empty cells between them",
        write: |recorded, folder| {
            let mut text = "// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tLatitude\tLongitude\tAltitude\tStatus\n".to_owned();
            for (k, (t, v)) in recorded["imu"].iter().enumerate() {
                let fix = new_fix(recorded, t - 10_000_000, *t);
                let fix = fix.map_or(",,".to_owned(), |(_, g)| position(g));
                let v = flu(v);
                let all = cells(v[3..].iter().chain(&v[..3]).copied());
                text += &format!("{k},{},{all},{fix},0001\n", t / 100_000).replace(',', "\t");
            }
            Written { given: vec![put(folder, "MT.txt", &text)], offset: 0 }
        },
    },
    Program {
        name: "axes without a quantity, as MATLAB numbers them",
        write: |recorded, folder| {
            let text = table("Timestamp,X,Y,Z,X_1,Y_1,Z_1", &recorded["imu"], |(t, v)| {
                let (w, f) = (cells(v[..3].to_vec()), cells(v[3..].to_vec()));
                format!("{},{f},{w}", seconds(*t))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "easting and northing of UTM",
        write: |recorded, folder| {
            let head = "time,easting,northing,height,zone";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let [east, north] = utm(v[0], v[1] - 9_f64.to_radians());
                format!("{},{east:.3},{north:.3},{:.3},32N", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "degrees, minutes and seconds in three columns",
        write: |recorded, folder| {
            let head = "time,lat_d,lat_m,lat_s,lon_d,lon_m,lon_s,height";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let ((a, b, c), (d, e, f)) = (sexagesimal(v[0]), sexagesimal(v[1]));
                format!("{},{a},{b},{c:.5},{d},{e},{f:.5},{:.3}", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "a list of YAML",
        write: |recorded, folder| {
            let record = |(t, v): &Row| {
                let [rate, force] = [&v[..3], &v[3..]].map(|v| cells(v.iter().copied()));
                format!("- time: {}\n  gyro: [{rate}]\n  accel: [{force}]\n", seconds(*t))
            };
            let text: String = recorded["imu"].iter().map(record).collect();
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "documents of YAML, as `ros2 topic echo` writes them",
        write: |recorded, folder| {
            let vector = |name: &str, v: &[f64]| {
                format!("{name}:\n  x: {:.7}\n  y: {:.7}\n  z: {:.7}\n", v[0], v[1], v[2])
            };
            let document = |(t, v): &Row| {
                let (v, t) = (flu(v), t + DATE);
                let stamp = [t / 1_000_000_000, t % 1_000_000_000];
                let header = format!(
                    "header:\n  stamp:\n    sec: {}\n    nanosec: {}\n  frame_id: imu\n",
                    stamp[0], stamp[1]
                );
                let turn = "orientation_covariance:\n- -1.0\n- 0.0\n".to_owned();
                header
                    + &turn
                    + &vector("angular_velocity", &v[..3])
                    + &vector("linear_acceleration", &v[3..])
                    + "---\n"
            };
            let text: String = recorded["imu"].iter().map(document).collect();
            imu_of(recorded, folder, &text, DATE)
        },
    },
];

/// Easting and northing, m, at a latitude and a longitude from the central meridian, rad, by the
/// series of Snyder, *Map projections: a working manual* (1987), equations 8-9 to 8-13 and 3-21.
fn utm(latitude: f64, longitude: f64) -> [f64; 2] {
    let (a, f) = (6_378_137.0, 1.0 / 298.257_223_563);
    let e2: f64 = f * (2.0 - f);
    let (sin, cos) = latitude.sin_cos();
    let second = e2 / (1.0 - e2);
    let (t, c, x) = ((sin / cos).powi(2), second * cos * cos, longitude * cos);
    let n = a / (1.0 - e2 * sin * sin).sqrt();
    let m = a
        * ((1.0 - e2 / 4.0 - 3.0 * e2.powi(2) / 64.0 - 5.0 * e2.powi(3) / 256.0) * latitude
            - (3.0 * e2 / 8.0 + 3.0 * e2.powi(2) / 32.0 + 45.0 * e2.powi(3) / 1024.0)
                * (2.0 * latitude).sin()
            + (15.0 * e2.powi(2) / 256.0 + 45.0 * e2.powi(3) / 1024.0) * (4.0 * latitude).sin()
            - 35.0 * e2.powi(3) / 3072.0 * (6.0 * latitude).sin());
    let third = (1.0 - t + c) * x.powi(3) / 6.0;
    let fifth = (5.0 - 18.0 * t + t * t + 72.0 * c - 58.0 * second) * x.powi(5) / 120.0;
    let fourth = (5.0 - t + 9.0 * c + 4.0 * c * c) * x.powi(4) / 24.0;
    let east = 500_000.0 + 0.9996 * n * (x + third + fifth);
    let north = 0.9996 * (m + n * (sin / cos) * (x * x / 2.0 + fourth));
    [east, north]
}
