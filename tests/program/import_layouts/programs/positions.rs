//! Positions, axes, numbers without a measurement, and clocks.

use super::*;

/// The programs.
pub const PROGRAMS: [Program; 11] = [
    Program {
        name: "axes as headings beside rates (comma2k19)",
        write: |recorded, folder| {
            let text = table(
                "t,forward,right,down,gyro_forward,gyro_right,gyro_down",
                &recorded["imu"],
                |(t, v)| {
                    format!("{},{},{}", seconds(*t), cells(v[3..].to_vec()), cells(v[..3].to_vec()))
                },
            );
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "degrees, minutes and seconds as text",
        write: |recorded, folder| {
            let text = table("time,lat,lon,alt", &recorded["gnss"], |(t, v)| {
                let [(a, b, c), (d, e, f)] = [sexagesimal(v[0]), sexagesimal(v[1])];
                format!("{},{a}°{b:02}'{c:08.5}\"N,{d}°{e:02}'{f:08.5}\"E,{:.3}", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "feet, knots and course",
        write: |recorded, folder| {
            let text = table(
                "time,latitude,longitude,altitude_ft,speed_kn,course_deg",
                &recorded["gnss"],
                |(t, v)| {
                    let [speed, direction] = course(v);
                    let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                    format!(
                        "{},{lat:.9},{lon:.9},{:.3},{:.4},{direction:.4}",
                        seconds(*t),
                        v[2] / 0.3048,
                        speed * 3600.0 / 1852.0
                    )
                },
            );
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "Inertial Explorer, whose fixes count seconds of the week",
        write: |recorded, folder| {
            let head = "Project:     car\nProgram:     Inertial Explorer Version 8.90\n\n  GPSTime       Latitude      Longitude     H-Ell     VNorth   VEast     VUp\n    (sec)          (deg)          (deg)       (m)      (m/s)   (m/s)   (m/s)";
            let fixes = table(head, &recorded["gnss"], |(t, v)| {
                let (_, rest) = week(*t);
                format!(
                    "  {:.3} {} {:.3} {:.3} {:.3}",
                    rest as f64 * 1e-9,
                    position(v).replace(',', "  "),
                    v[3],
                    v[4],
                    -v[5]
                )
            });
            let offset = week(0).1;
            let imu = table("sow,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", seconds(t + offset), cells(v.iter().copied()))
            });
            Written {
                given: vec![put(folder, "ie.txt", &fixes), put(folder, "imu.csv", &imu)],
                offset,
            }
        },
    },
    Program {
        name: "axes right, forward, up",
        write: |recorded, folder| axes(recorded, folder, phone),
    },
    Program {
        name: "axes back, left, down",
        write: |recorded, folder| {
            axes(recorded, folder, |v| [-v[0], -v[1], v[2], -v[3], -v[4], v[5]])
        },
    },
    Program {
        name: "an instrument on its side",
        write: |recorded, folder| {
            axes(recorded, folder, |v| [-v[2], v[1], v[0], -v[5], v[4], v[3]])
        },
    },
    Program {
        name: "fixes at 0 N 0 E, beyond the poles, and with accuracies that none has",
        write: |recorded, folder| {
            let mut text = "time_s,lat_deg,lon_deg,height_m,h_acc_m,fix\n".to_owned();
            for (k, (t, v)) in recorded["gnss"].iter().enumerate() {
                let row = match k % 17 {
                    3 => "0,0,0,4294967.295,0".to_owned(),
                    9 => "-999,-999,-999,0,4".to_owned(),
                    12 => "48.3,11.9,100,1.5,0".to_owned(),
                    14 => "48.3,11.9,100,-1,4".to_owned(),
                    _ => format!("{},1.5,4", position(v)),
                };
                text += &format!("{},{row}\n", seconds(*t));
            }
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "stamps of zero",
        write: |recorded, folder| {
            let fixes: String = plain_gnss(recorded, DATE)
                .lines()
                .enumerate()
                .map(|(k, line)| {
                    let rest = line.split_once(',').map_or("", |(_, rest)| rest);
                    if [1, 2, 20].contains(&k) {
                        format!("0.0,{rest}\n")
                    } else {
                        format!("{line}\n")
                    }
                })
                .collect();
            fixes_of(recorded, folder, &fixes, DATE)
        },
    },
    Program {
        name: "a clock of TAI beside one of UTC",
        write: |recorded, folder| {
            let tai = DATE + 37_000_000_000;
            let given = vec![
                put(folder, "i.csv", &plain_imu(recorded, tai)),
                put(folder, "g.csv", &plain_gnss(recorded, DATE)),
            ];
            Written { given, offset: tai }
        },
    },
    Program {
        name: "a clock that was set by hand",
        write: |recorded, folder| {
            let given = vec![
                put(folder, "i.csv", &plain_imu(recorded, DATE)),
                put(folder, "g.csv", &plain_gnss(recorded, DATE + 11_300_000_000)),
            ];
            Written { given, offset: DATE }
        },
    },
];
