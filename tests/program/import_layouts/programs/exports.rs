//! Exports of programs: several numbers in one cell, an array for each column, sections, dates in other forms, and units
//! that the motion alone shows.

use super::*;

/// An IMU with its own times beside plain fixes from the date.
fn dated(recorded: &Recorded, folder: &Path, name: &str, stamp: impl Fn(i64) -> String) -> Written {
    let text = table(&format!("{name},gx,gy,gz,ax,ay,az"), &recorded["imu"], |(t, v)| {
        format!("{},{}", stamp(t + DATE), cells(v.iter().copied()))
    });
    imu_of(recorded, folder, &text, DATE)
}

/// Whole numbers between commas.
fn whole(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{v:.0}")).collect::<Vec<_>>().join(",")
}

/// Latitude and longitude, deg.
fn degrees(v: &[f64]) -> [f64; 2] {
    [v[0], v[1]].map(f64::to_degrees)
}

/// The newest fix at a time.
fn newest(recorded: &Recorded, time: i64) -> &[f64] {
    let fixes = &recorded["gnss"];
    let k = fixes.partition_point(|(at, _)| *at <= time);
    &fixes[k.saturating_sub(1)].1
}

/// The days of the months before November.
const BEFORE: u32 = 304;

/// The programs.
pub const PROGRAMS: [Program; 23] = [
    Program {
        name: "InfluxDB, lines of its protocol",
        write: |recorded, folder| {
            let imu = recorded["imu"].iter().map(|(t, v)| {
                let names = ["gx", "gy", "gz", "ax", "ay", "az"];
                let fields: Vec<String> =
                    names.iter().zip(v).map(|(name, v)| format!("{name}={v:.7}")).collect();
                (*t, format!("imu,device=a1 {} {}\n", fields.join(","), t + DATE))
            });
            let fix = recorded["gnss"].iter().map(|(t, v)| {
                let [lat, lon] = degrees(v);
                let fields = format!("lat={lat:.9},lon={lon:.9},alt={:.3},sats=12i", v[2]);
                (t + 1, format!("gps,device=a1 {fields} {}\n", t + DATE))
            });
            let mut lines: Vec<(i64, String)> = imu.chain(fix).collect();
            lines.sort();
            let text: String = lines.into_iter().map(|(_, line)| line).collect();
            Written { given: vec![put(folder, "log.lp", &text)], offset: DATE }
        },
    },
    Program {
        name: "CARLA, vectors in cells",
        write: |recorded, folder| {
            let vector =
                |v: &[f64]| format!("\"Vector3D(x={:.6}, y={:.6}, z={:.6})\"", v[0], v[1], v[2]);
            let text =
                table("frame,timestamp,accelerometer,gyroscope", &recorded["imu"], |(t, v)| {
                    format!(
                        "{},{},{},{}",
                        t / 10_000_000,
                        seconds(*t),
                        vector(&v[3..]),
                        vector(&v[..3])
                    )
                });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "CARLA, printed measurements",
        write: |recorded, folder| {
            let vector =
                |v: &[f64]| format!("Vector3D(x={:.6}, y={:.6}, z={:.6})", v[0], v[1], v[2]);
            let imu: String = recorded["imu"]
                .iter()
                .map(|(t, v)| {
                    let [force, rate] = [vector(&v[3..]), vector(&v[..3])];
                    format!(
                        "IMUMeasurement(frame={}, timestamp={}, accelerometer={force}, gyroscope={rate}, compass=1.2)\n",
                        t / 10_000_000,
                        seconds(*t)
                    )
                })
                .collect();
            imu_of(recorded, folder, &imu, 0)
        },
    },
    Program {
        name: "JSON with an array for each column",
        write: |recorded, folder| {
            let names = ["gx", "gy", "gz", "ax", "ay", "az"];
            let list = |cells: Vec<String>| cells.join(", ");
            let times = list(recorded["imu"].iter().map(|(t, _)| seconds(*t)).collect());
            let columns: Vec<String> = names
                .iter()
                .enumerate()
                .map(|(k, name)| {
                    let cells =
                        recorded["imu"].iter().map(|(_, v)| format!("{:.7}", v[k])).collect();
                    format!("\"{name}\": [{}]", list(cells))
                })
                .collect();
            imu_of(recorded, folder, &format!("{{\"time\": [{times}], {}}}", columns.join(", ")), 0)
        },
    },
    Program {
        name: "pandas, the headings beside the rows",
        write: |recorded, folder| {
            let rows: Vec<String> = recorded["imu"]
                .iter()
                .map(|(t, v)| format!("[{}, {}]", seconds(*t), cells(v.iter().copied())))
                .collect();
            let index: Vec<String> = (0..rows.len()).map(|k| k.to_string()).collect();
            let text = format!(
                "{{\"columns\": [\"time\", \"gx\", \"gy\", \"gz\", \"ax\", \"ay\", \"az\"], \"index\": [{}], \"data\": [{}]}}",
                index.join(","),
                rows.join(",")
            );
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "Strava, a stream for each quantity",
        write: |recorded, folder| {
            let list = |cell: &dyn Fn(&Row) -> String| {
                recorded["gnss"].iter().map(cell).collect::<Vec<_>>().join(", ")
            };
            let stream = |name: &str, data: String| {
                format!("{{\"type\": \"{name}\", \"data\": [{data}], \"series_type\": \"time\"}}")
            };
            let place = list(&|(_, v)| format!("[{:.9}, {:.9}]", degrees(v)[0], degrees(v)[1]));
            let text = [
                stream("latlng", place),
                stream("time", list(&|(t, _)| seconds(*t))),
                stream("altitude", list(&|(_, v)| format!("{:.2}", v[2]))),
            ];
            fixes_of(recorded, folder, &format!("[{}]", text.join(", ")), 0)
        },
    },
    Program {
        name: "VBOX, minutes to the west, and +1 g at rest",
        write: |recorded, folder| {
            let head = "File created on 14/11/2023 at 22:13:20\r\n\r\n[header]\r\nsatellites\r\ntime\r\nlatitude\r\n\
                        longitude\r\nvelocity kmh\r\nheading\r\nheight\r\nX_Accel\r\nY_Accel\r\nZ_Accel\r\nYawRate\r\n\
                        PitchRate\r\nRollRate\r\n\r\n[comments]\r\nLog Rate (Hz) : 100.00\r\n\r\n[column names]\r\n\
                        sats time lat long velocity heading height X_Accel Y_Accel Z_Accel YawRate PitchRate RollRate\
                        \r\n\r\n[data]";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let g = newest(recorded, *t);
                let ([lat, lon], [speed, heading]) = (degrees(g).map(|a| 60.0 * a), course(g));
                let inertial = [v[3] / GRAVITY, v[4] / GRAVITY, -v[5] / GRAVITY]
                    .into_iter()
                    .chain([v[2], v[1], v[0]].map(f64::to_degrees));
                let inertial: Vec<String> = inertial.map(|x| format!("{x:+.6E}")).collect();
                format!(
                    "012 {} {lat:+.6} {:+.6} {:.3} {heading:.2} {:+.2} {}\r",
                    clock(t + DATE).replace(':', ""),
                    -lon,
                    3.6 * speed,
                    g[2],
                    inertial.join(" ")
                )
            });
            let offset = DATE.rem_euclid(86_400_000_000_000);
            Written { given: vec![put(folder, "run.vbo", &text)], offset }
        },
    },
    Program {
        name: "exponents of Fortran",
        write: |recorded, folder| {
            let double = |v: f64| format!("{v:.9E}").replace('E', "D");
            let text = table("TIME WX WY WZ FX FY FZ", &recorded["imu"], |(t, v)| {
                let row = std::iter::once(*t as f64 * 1e-9).chain(v.iter().copied());
                row.map(double).collect::<Vec<_>>().join("  ")
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "points with a height in one cell",
        write: |recorded, folder| {
            let text = table("time_s,geom", &recorded["gnss"], |(t, v)| {
                let [lat, lon] = degrees(v);
                format!("{},POINT Z ({lon:.9} {lat:.9} {:.3})", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "months by their names",
        write: |recorded, folder| {
            dated(recorded, folder, "Time", |t| {
                format!("{:02}-Nov-{} {}", date(t).day, date(t).year, clock(t))
            })
        },
    },
    Program {
        name: "a day of the year in a text",
        write: |recorded, folder| {
            dated(recorded, folder, "time", |t| {
                format!("{}:{}:{}", date(t).year, BEFORE + u32::from(date(t).day), clock(t))
            })
        },
    },
    Program {
        name: "year, day of the year, and seconds of the day",
        write: |recorded, folder| {
            dated(recorded, folder, "Year,DOY,SOD", |t| {
                let day = BEFORE + u32::from(date(t).day);
                format!("{},{day},{}", date(t).year, seconds(t % 86_400_000_000_000))
            })
        },
    },
    Program {
        name: "ticks of .NET",
        write: |recorded, folder| {
            dated(recorded, folder, "Ticks", |t| (621_355_968_000_000_000 + t / 100).to_string())
        },
    },
    Program {
        name: "date and time in digits alone",
        write: |recorded, folder| {
            dated(recorded, folder, "date,time", |t| {
                format!("{},{}", day(t).replace('-', ""), clock(t).replace(':', ""))
            })
        },
    },
    Program {
        name: "minutes of an arc",
        write: |recorded, folder| {
            let head = "time_s,lat [arcmin],lon [arcmin],alt";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let [lat, lon] = degrees(v).map(|a| 60.0 * a);
                format!("{},{lat:.8},{lon:.8},{:.3}", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "degrees to the west",
        write: |recorded, folder| {
            let head = "time_s,Latitude (°N),Longitude (°W),Altitude";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let [lat, lon] = degrees(v);
                format!("{},{lat:.9},{:.9},{:.3}", seconds(*t), -lon, v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "sides before their columns, and minutes with a letter",
        write: |recorded, folder| {
            let text = table("time_s,NS,Latitude,Longitude,alt", &recorded["gnss"], |(t, v)| {
                let [lat, lon] =
                    degrees(v).map(|a| format!("{:010.5}", 100.0 * a.trunc() + 60.0 * a.fract()));
                format!("{},N,{lat},{lon}E,{:.3}", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "two tables in one file",
        write: |recorded, folder| {
            let imu = table("time,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", seconds(*t), cells(v.iter().copied()))
            });
            let fix = table("time,latitude,longitude,altitude", &recorded["gnss"], |(t, v)| {
                format!("{},{}", seconds(*t), position(v))
            });
            let text = format!("[IMU]\n{imu}\n[GPS]\n{fix}");
            Written { given: vec![put(folder, "log.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "rates in rad/s beside forces in g, which the course alone shows",
        write: |recorded, folder| {
            let text = table("time_s,wx,wy,wz,ax,ay,az", &recorded["imu"], |(t, v)| {
                let forces = v[3..].iter().map(|f| f / GRAVITY);
                format!("{},{}", seconds(*t), cells(v[..3].iter().copied().chain(forces)))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "counts of a MEMS",
        write: |recorded, folder| {
            let text = table("millis,ax,ay,az,gx,gy,gz", &recorded["imu"], |(t, v)| {
                let forces = v[3..].iter().map(|f| f / GRAVITY * 4096.0);
                let rates = v[..3].iter().map(|w| w.to_degrees() * 65.5);
                format!("{},{}", t / 1_000_000, whole(forces.chain(rates)))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "words for missing fixes",
        write: |recorded, folder| {
            let text = table("time,gx,gy,gz,ax,ay,az,lat,lon,alt", &recorded["imu"], |(t, v)| {
                let fix = recorded["gnss"].iter().find(|(at, _)| at == t);
                let words = ["-,-,-", "#N/A,#N/A,#N/A", "--,--,--"];
                let absent = words[(t / 10_000_000 % 3) as usize].to_owned();
                let fix = fix.map_or(absent, |(_, g)| position(g));
                format!("{},{},{fix}", seconds(*t), cells(v.iter().copied()))
            });
            Written { given: vec![put(folder, "log.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "rates per hour and forces in ug",
        write: |recorded, folder| {
            let text = table(
                "t,wx_degph,wy_degph,wz_degph,fx_ug,fy_ug,fz_ug",
                &recorded["imu"],
                |(t, v)| {
                    let rates = v[..3].iter().map(|w| w.to_degrees() * 3600.0);
                    let forces = v[3..].iter().map(|f| f / GRAVITY * 1e6);
                    format!("{},{}", seconds(*t), cells(rates.chain(forces)))
                },
            );
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "RaceChrono, lines of units and of devices below the headings",
        write: |recorded, folder| {
            let head = "This file is created using RaceChrono\nFormat,3\n\n\
                        timestamp,lap_number,elapsed_time,altitude,bearing,latitude,longitude,speed,x_acc,y_acc,z_acc,\
                        x_rate_of_rotation,y_rate_of_rotation,z_rate_of_rotation\n\
                        unix time,,s,m,deg,deg,deg,m/s,G,G,G,deg/s,deg/s,deg/s\n\
                        ,,,100: gps,100: gps,100: gps,100: gps,100: gps,101: acc,101: acc,101: acc,102: gyro,102: gyro,\
                        102: gyro";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let (g, v) = (newest(recorded, *t), phone(v));
                let ([lat, lon], [speed, bearing]) = (degrees(g), course(g));
                let inertial = v[3..].iter().map(|f| f / GRAVITY);
                let inertial = cells(inertial.chain(v[..3].iter().map(|w| w.to_degrees())));
                format!(
                    "{},,{},{:.2},{bearing:.2},{lat:.8},{lon:.8},{speed:.3},{inertial}",
                    seconds(t + DATE),
                    seconds(*t),
                    g[2]
                )
            });
            Written { given: vec![put(folder, "session.csv", &text)], offset: DATE }
        },
    },
];
