//! Recordings of which a sensor needs several files, and what lines above a table or the numbers alone say.

use super::apart::{FIX, IMU, each, fix, one};
use super::*;
use navfuse_core::state::geodesy::Geodetic;
use std::fmt::Write;

/// A file with a time and a value for each of the channels.
fn files(
    recorded: &Recorded,
    folder: &Path,
    file: impl Fn(&str) -> (String, String),
    row: impl Fn(i64, f64) -> String,
) -> Vec<PathBuf> {
    let channels = IMU.iter().chain(&FIX);
    let write = |wanted: &&str| {
        let (name, head) = file(wanted);
        let rows = each(recorded, |t, _, name, v| match name == *wanted {
            true => row(t, v),
            false => String::new(),
        });
        put(folder, &name, &(head + &rows))
    };
    channels.map(write).collect()
}

/// Three values with a time, as files of a phone have them, along right, forward and up.
fn axes_of_phone(recorded: &Recorded, of: impl Fn(&[f64; 6]) -> [f64; 3]) -> String {
    table("time,seconds_elapsed,z,y,x", &recorded["imu"], |(t, v)| {
        let [x, y, z] = of(&phone(v));
        format!("{},{},{}", t + DATE, seconds(*t), cells([z, y, x]))
    })
}

/// A variable of NetCDF and its values.
fn variable(name: &str, values: impl Iterator<Item = f64>) -> String {
    let values: Vec<String> = values.map(|v| format!("{v:.12}")).collect();
    let lines: Vec<String> = values.chunks(6).map(|line| line.join(", ")).collect();
    format!("\n {name} = {} ;\n", lines.join(", \n    "))
}

/// Metres east, north and up of a place.
fn from_place(v: &[f64], place: [f64; 3]) -> [f64; 3] {
    let of = |[latitude, longitude, height]: [f64; 3]| Geodetic { latitude, longitude, height };
    let step = of([v[0], v[1], v[2]]).earth_fixed() - of(place).earth_fixed();
    let [(slat, clat), (slon, clon)] = [place[0].sin_cos(), place[1].sin_cos()];
    [
        -slon * step.x + clon * step.y,
        -slat * (clon * step.x + slon * step.y) + clat * step.z,
        clat * (clon * step.x + slon * step.y) + slat * step.z,
    ]
}

/// The programs.
pub const PROGRAMS: [Program; 15] = [
    Program {
        name: "a file for each channel, which its name names",
        write: |recorded, folder| {
            let given = files(
                recorded,
                folder,
                |name| (format!("{name}.csv"), "time,value\n".to_owned()),
                |t, v| format!("{},{v:.9}\n", seconds(t)),
            );
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "a file for each channel of a database, with a date and a unit",
        write: |recorded, folder| {
            let unit = |name: &str| match name.split('_').next() {
                Some("gyro") => " [deg/s]",
                Some("accel") => " [g]",
                _ => "",
            };
            let size = |name: &str| match unit(name) {
                " [deg/s]" => 1_f64.to_radians(),
                " [g]" => GRAVITY,
                _ => 1.0,
            };
            for wanted in IMU.iter().chain(&FIX) {
                let rows = each(recorded, |t, _, name, v| match name == *wanted {
                    true => {
                        let t = t + DATE;
                        format!("\"{} {}\",{:.9}\n", day(t), clock(t), v / size(name))
                    }
                    false => String::new(),
                });
                let head = format!("\"Time\",\"van.{wanted}{}\"\n", unit(wanted));
                put(folder, &format!("{wanted}-data.csv"), &(head + &rows));
            }
            Written { given: vec![folder.to_owned()], offset: DATE }
        },
    },
    Program {
        name: "gravity in a file of its own, as phones have it",
        write: |recorded, folder| {
            let gravity = |_: &[f64; 6]| [0.1, -0.2, 9.8];
            let linear = |v: &[f64; 6]| [v[3] - 0.1, v[4] + 0.2, v[5] - 9.8];
            put(folder, "Gravity.csv", &axes_of_phone(recorded, gravity));
            put(folder, "Accelerometer.csv", &axes_of_phone(recorded, linear));
            put(folder, "Gyroscope.csv", &axes_of_phone(recorded, |v| [v[0], v[1], v[2]]));
            put(folder, "Location.csv", &plain_gnss(recorded, DATE));
            Written { given: vec![folder.to_owned()], offset: DATE }
        },
    },
    Program {
        name: "NetCDF as ncdump prints it",
        write: |recorded, folder| {
            let units = ["deg s-1", "m s-2", "degrees_north", "degrees_east", "m"];
            let mut text =
                "netcdf drive {\ndimensions:\n\ttime = 1 ;\n\tn = 1 ;\nvariables:\n".to_owned();
            for (dimension, name) in [("time", "time"), ("n", "t")] {
                let since = "seconds since 2023-11-14 22:13:20";
                let _ = writeln!(
                    text,
                    "\tdouble {name}({dimension}) ;\n\t\t{name}:units = \"{since}\" ;"
                );
            }
            for (k, name) in IMU.iter().chain(&FIX).enumerate() {
                let (unit, of) =
                    (units[[0, 0, 0, 1, 1, 1, 2, 3, 4][k]], if k < 6 { "time" } else { "n" });
                let _ = writeln!(text, "\tdouble {name}({of}) ;\n\t\t{name}:units = \"{unit}\" ;");
            }
            text += "data:\n";
            let (imu, fixes) = (&recorded["imu"], &recorded["gnss"]);
            text += &variable("time", imu.iter().map(|(t, _)| *t as f64 * 1e-9));
            for (k, name) in IMU.iter().enumerate() {
                let size = if k < 3 { 1_f64.to_radians() } else { 1.0 };
                text += &variable(name, imu.iter().map(|(_, v)| v[k] / size));
            }
            text += &variable("t", fixes.iter().map(|(t, _)| *t as f64 * 1e-9));
            for (k, name) in FIX.iter().enumerate() {
                text += &variable(name, fixes.iter().map(|(_, v)| fix(v)[k]));
            }
            one(folder, "drive.cdl", &(text + "}\n"), DATE)
        },
    },
    Program {
        name: "one value in each row, in German, with decimal commas",
        write: |recorded, folder| {
            let rows = each(recorded, |t, sensor, name, v| {
                let (t, v) = (t + DATE, format!("{v:.9}").replace('.', ","));
                format!("{} {};{sensor}_{name};{v};-\n", day(t), clock(t))
            });
            one(
                folder,
                "messung.csv",
                &("Zeitstempel;Kanal;Wert;Einheit\n".to_owned() + &rows),
                DATE,
            )
        },
    },
    Program {
        name: "JSON with an array of samples in each message",
        write: |recorded, folder| {
            let sample = |v: &[f64]| {
                format!("{{\"x\": {:.9}, \"y\": {:.9}, \"z\": {:.9}}}", v[0], v[1], v[2])
            };
            let list = |rows: &[Row], from: usize| {
                rows.iter().map(|(_, v)| sample(&v[from..])).collect::<Vec<_>>().join(", ")
            };
            let message = |rows: &[Row]| {
                let (gyro, acc) = (list(rows, 0), list(rows, 3));
                let ms = (rows[0].0 + DATE) / 1_000_000;
                format!("{{\"Timestamp\": {ms}, \"ArrayAcc\": [{acc}], \"ArrayGyro\": [{gyro}]}}\n")
            };
            let text: String = recorded["imu"].chunks_exact(4).map(message).collect();
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "Teleplot",
        write: |recorded, folder| {
            let line = |t: i64, _: &str, name: &str, v: f64| {
                format!(">{name}:{}:{v:.9}\n", (t + DATE) / 1_000_000)
            };
            one(folder, "teleplot.txt", &each(recorded, line), DATE)
        },
    },
    Program {
        name: "increments of angles and of velocities, each in two files",
        write: |recorded, folder| {
            let half = |heads: &str, from: usize| {
                table(heads, &recorded["imu"], |(t, v)| {
                    let [x, y, z] = [0, 1, 2].map(|k| 0.01 * v[from + k]);
                    format!("{},{x:.9},{y:.9},{z:.9}", seconds(*t))
                })
            };
            // each of them goes on in a second file
            let mut given = vec![put(folder, "g.csv", &plain_gnss(recorded, 0))];
            for (name, heads, from) in
                [("a", "time,d_theta_x,d_theta_y,d_theta_z", 0), ("b", "time,d_v_x,d_v_y,d_v_z", 3)]
            {
                let text = half(heads, from);
                let lines: Vec<&str> = text.split_inclusive('\n').collect();
                let (first, second) = lines.split_at(lines.len() / 2);
                given.push(put(folder, &format!("{name}_1.csv"), &first.concat()));
                let second = lines[0].to_owned() + &second.concat();
                given.push(put(folder, &format!("{name}_2.csv"), &second));
            }
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "headings in the first of three files alone",
        write: |recorded, folder| {
            let text = plain_imu(recorded, 0);
            let lines: Vec<&str> = text.split_inclusive('\n').collect();
            let parts = lines.chunks(lines.len().div_ceil(3)).enumerate();
            let parts = parts.map(|(k, part)| put(folder, &format!("log.{k:03}"), &part.concat()));
            let mut given: Vec<PathBuf> = parts.collect();
            given.push(put(folder, "g.csv", &plain_gnss(recorded, 0)));
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "metres from a point that a comment states",
        write: |recorded, folder| {
            let (_, first) = &recorded["gnss"][0];
            let place = [first[0], first[1], first[2]];
            let [lat, lon, height] = fix(&place);
            let heads = format!(
                "# origin: lat={lat:.9} lon={lon:.9} alt={height:.3}\n# t[s] east[m] north[m] up[m]"
            );
            let text = table(&heads, &recorded["gnss"], |(t, v)| {
                let [e, n, u] = from_place(v, place);
                format!("{} {e:.3} {n:.3} {u:.3}", seconds(*t))
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "readings of Android with headings, and Earth-fixed positions in rows of satellites",
        write: |recorded, folder| {
            let mut text = "MessageType,utcTimeMillis,elapsedRealtimeNanos,MeasurementX,MeasurementY,MeasurementZ,BiasX\n"
                .to_owned();
            for (t, v) in &recorded["imu"] {
                let v = phone(v);
                let ms = (t + DATE) / 1_000_000;
                for (kind, of) in
                    [("UncalAccel", [v[3], v[4], v[5]]), ("UncalGyro", [v[0], v[1], v[2]])]
                {
                    let _ =
                        writeln!(text, "{kind},{ms},{},{},0.0", t + 98_765_432_100_000, cells(of));
                }
                let _ =
                    writeln!(text, "UncalMag,{ms},{},20.1,-30.2,10.0,1.0", t + 98_765_432_100_000);
            }
            let heads = "MessageType,utcTimeMillis,Svid,WlsPositionXEcefMeters,WlsPositionYEcefMeters,WlsPositionZEcefMeters";
            let fixes = table(heads, &recorded["gnss"], |(t, v)| {
                let place =
                    Geodetic { latitude: v[0], longitude: v[1], height: v[2] }.earth_fixed();
                let row = |sv: u8| {
                    format!(
                        "Raw,{},{sv},{:.4},{:.4},{:.4}",
                        (t + DATE) / 1_000_000,
                        place.x,
                        place.y,
                        place.z
                    )
                };
                [row(3), row(12), row(19)].join("\n")
            });
            let given =
                vec![put(folder, "device_imu.csv", &text), put(folder, "device_gnss.csv", &fixes)];
            Written { given, offset: DATE }
        },
    },
    Program {
        name: "messages of u-blox as pyubx2 prints them: degrees beside mm and mm/s",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let (c, [lat, lon, height]) = (date(t + DATE), fix(v));
                format!(
                    "<UBX(NAV-PVT, iTOW={}, year={}, month={}, day={}, hour={}, min={}, second={}, nano={}, fixType=3, \
                     headVehValid=0, lon={lon:.7}, lat={lat:.7}, height={:.0}, hAcc=1500, velN={:.0}, velE={:.0}, \
                     velD={:.0}, sAcc=50)>\n",
                    clock(t + DATE),
                    c.year,
                    c.month,
                    c.day,
                    c.hour,
                    c.minute,
                    c.second,
                    c.nanos,
                    1e3 * height,
                    1e3 * v[3],
                    1e3 * v[4],
                    1e3 * v[5],
                )
            };
            let fixes: String = recorded["gnss"].iter().map(line).collect();
            fixes_of(recorded, folder, &fixes, DATE)
        },
    },
    Program {
        name: "counts of 262.4 in a deg/s",
        write: |recorded, folder| {
            let counts = 262.4_f64.to_degrees();
            let text =
                table("tow_ms,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z", &recorded["imu"], |(t, v)| {
                    let number =
                        |k: usize| if k < 3 { v[k] * counts } else { v[k] * 4096.0 / GRAVITY };
                    let numbers: Vec<String> =
                        (0..6).map(|k| format!("{:.0}", number(k))).collect();
                    format!("{},{}", t / 1_000_000, numbers.join(","))
                });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "accelerations in cm/s^2 without a unit",
        write: |recorded, folder| {
            let text = table("time,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                let values = (0..6).map(|k| if k < 3 { v[k] } else { 100.0 * v[k] });
                format!("{},{}", seconds(*t), cells(values))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "lines that begin with their kind and milliseconds, and seconds of an arc that are rounded to 60",
        write: |recorded, folder| {
            let imu = |(t, v): &Row| {
                let f = flu(v);
                let [x, y, z] = [3, 4, 5].map(|k| f[k] / GRAVITY);
                let [p, q, r] = [0, 1, 2].map(|k| f[k].to_degrees());
                format!("IMU {} A: {x:.5} {y:.5} {z:.5} G: {p:.4} {q:.4} {r:.4}\n", t / 1_000_000)
            };
            let imu: String = recorded["imu"].iter().map(imu).collect();
            let fixes = table("Time,Latitude,Longitude,Height [m]", &recorded["gnss"], |(t, v)| {
                let angle = |radians: f64, side: char| {
                    let (d, m, s) = sexagesimal(radians);
                    format!("{d}°{m:02}'{s:07.4}\"{side}")
                };
                let [mut lat, lon] = [angle(v[0], 'N'), angle(v[1], 'E')];
                // 2 mm
                if *t == 0 {
                    lat = "48°05'60.0000\"N".to_owned();
                }
                format!("{},{lat},{lon},{:.3}", seconds(*t), v[2])
            });
            let given = vec![put(folder, "serial.log", &imu), put(folder, "g.csv", &fixes)];
            Written { given, offset: 0 }
        },
    },
];
