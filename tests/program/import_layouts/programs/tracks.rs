//! Positions in one cell, tracks in XML and JSON, units in cells, and times in many columns.

use super::*;

/// A track with the date of each point.
fn track(
    recorded: &Recorded,
    folder: &Path,
    [name, head, between, end]: [&str; 4],
    point: fn(String, &[f64]) -> String,
) -> Written {
    let line = |(t, v): &Row| point(format!("{}T{}Z", day(t + DATE), clock(t + DATE)), v);
    let points: Vec<String> = recorded["gnss"].iter().map(line).collect();
    let text = format!("{head}{}{end}", points.join(between));
    let given = vec![put(folder, "i.csv", &plain_imu(recorded, DATE)), put(folder, name, &text)];
    Written { given, offset: DATE }
}

/// Fixes whose latitude and longitude stand in one cell.
fn in_one_cell(recorded: &Recorded, folder: &Path, cell: fn([f64; 2]) -> String) -> Written {
    let text = table("time_s,position,alt", &recorded["gnss"], |(t, v)| {
        let cell = cell([v[0], v[1]].map(f64::to_degrees));
        format!("{},\"{cell}\",{:.3}", seconds(*t), v[2])
    });
    fixes_of(recorded, folder, &text, 0)
}

/// Fixes with positions as integers, 2^31 of which are so many degrees, and with a velocity or without.
fn integers(recorded: &Recorded, folder: &Path, half: f64, velocity: bool) -> Written {
    let head = if velocity { "time_s,lat,lon,alt,vn,ve,vd" } else { "time_s,lat,lon,alt" };
    let text = table(head, &recorded["gnss"], |(t, v)| {
        let [lat, lon] = [v[0], v[1]].map(|a| (a.to_degrees() / half * 2_f64.powi(31)).round());
        let rest =
            if velocity { format!(",{}", cells(v[3..6].iter().copied())) } else { String::new() };
        format!("{},{lat},{lon},{:.3}{rest}", seconds(*t), v[2])
    });
    fixes_of(recorded, folder, &text, 0)
}

/// The programs.
pub const PROGRAMS: [Program; 16] = [
    Program {
        name: "latitude and longitude in one cell, with their sides",
        write: |recorded, folder| {
            in_one_cell(recorded, folder, |[lat, lon]| format!("{lat:.8} N {lon:.8} E"))
        },
    },
    Program {
        name: "latitude and longitude in one cell, in brackets",
        write: |recorded, folder| {
            in_one_cell(recorded, folder, |[lat, lon]| format!("({lat:.8}, {lon:.8})"))
        },
    },
    Program {
        name: "degrees and minutes in one cell",
        write: |recorded, folder| {
            in_one_cell(recorded, folder, |place| {
                let [a, b] = place.map(|a| format!("{:.0}°{:.6}'", a.trunc(), 60.0 * a.fract()));
                format!("{a}N, {b}E")
            })
        },
    },
    Program {
        name: "GPX",
        write: |recorded, folder| {
            let head = "<?xml version=\"1.0\"?>\n<gpx version=\"1.1\"><trk><trkseg>\n";
            track(recorded, folder, ["a.gpx", head, "\n", "</trkseg></trk></gpx>\n"], |at, v| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                format!(
                    "<trkpt lat=\"{lat:.8}\" lon=\"{lon:.8}\">\n<ele>{:.2}</ele><time>{at}</time></trkpt>",
                    v[2]
                )
            })
        },
    },
    Program {
        name: "KML, with a time before each place",
        write: |recorded, folder| {
            let head = "<?xml version=\"1.0\"?>\n<kml><gx:Track>\n";
            track(recorded, folder, ["a.kml", head, "\n", "</gx:Track></kml>\n"], |at, v| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                let place = format!("<gx:coord>{lon:.8} {lat:.8} {:.2}</gx:coord>", v[2]);
                format!("<when>{at}</when>\n{place}")
            })
        },
    },
    Program {
        name: "GeoJSON",
        write: |recorded, folder| {
            let head = "{\"type\": \"FeatureCollection\", \"features\": [\n";
            track(recorded, folder, ["a.json", head, ",\n", "\n]}\n"], |at, v| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                format!(
                    "{{\"type\": \"Feature\", \"properties\": {{\"time\": \"{at}\"}}, \"geometry\": \
                     {{\"type\": \"Point\", \"coordinates\": [{lon:.8}, {lat:.8}, {:.2}]}}}}",
                    v[2]
                )
            })
        },
    },
    Program {
        name: "units after the numbers",
        write: |recorded, folder| {
            let text =
                table("time,gyro x,gyro y,gyro z,acc x,acc y,acc z", &recorded["imu"], |(t, v)| {
                    let degrees: String =
                        v[..3].iter().map(|w| format!(",{:.5} deg/s", w.to_degrees())).collect();
                    let forces: String =
                        v[3..].iter().map(|f| format!(",{:.6}g", f / GRAVITY)).collect();
                    format!("{} sec{degrees}{forces}", seconds(*t))
                });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "vectors as lla[0] to lla[2]",
        write: |recorded, folder| {
            let text = table(
                "time_s,lla[0],lla[1],lla[2],v_ned[0],v_ned[1],v_ned[2]",
                &recorded["gnss"],
                |(t, v)| {
                    format!(
                        "{},{:.12},{:.12},{:.3},{}",
                        seconds(*t),
                        v[0],
                        v[1],
                        v[2],
                        cells(v[3..6].iter().copied())
                    )
                },
            );
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "Xsens, a date in columns beside nanoseconds",
        write: |recorded, folder| {
            let head = "PacketCounter,UTC_Nano,UTC_Year,UTC_Month,UTC_Day,UTC_Hour,UTC_Minute,UTC_Second,\
                        UTC_Valid,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let (c, [a, b, c1, d, e, f]) = (date(t + DATE), flu(v));
                format!(
                    "{},{},{},{},{},{},{},{},7,{}",
                    t / 10_000_000,
                    c.nanos,
                    c.year,
                    c.month,
                    c.day,
                    c.hour,
                    c.minute,
                    c.second,
                    cells([d, e, f, a, b, c1])
                )
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "a date in columns beside milliseconds",
        write: |recorded, folder| {
            let head = "year,month,day,hour,minute,second,millisecond,gx,gy,gz,ax,ay,az";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let c = date(t + DATE);
                format!(
                    "{},{},{},{},{},{},{},{}",
                    c.year,
                    c.month,
                    c.day,
                    c.hour,
                    c.minute,
                    c.second,
                    c.nanos / 1_000_000,
                    cells(v.iter().copied())
                )
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "whole seconds beside microseconds",
        write: |recorded, folder| {
            let head = "Unix Time,Microseconds,Accelerometer X,Accelerometer Y,Accelerometer Z,Gyroscope X,Gyroscope Y,\
                        Gyroscope Z";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let (seconds, rest) = ((t + DATE) / 1_000_000_000, (t + DATE) % 1_000_000_000);
                format!("{seconds},{},{}", rest / 1000, cells([v[3], v[4], v[5], v[0], v[1], v[2]]))
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "a line about the units, in words, below the headings",
        write: |recorded, folder| {
            let head = "TIME, LATITUDE, LONGITUDE, HEIGHT\n(time in s, angles in degrees, height in metres)";
            let text =
                table(head, &recorded["gnss"], |(t, v)| format!("{},{}", seconds(*t), position(v)));
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "Movella DOT, which counts microseconds",
        write: |recorded, folder| {
            let head = "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let (count, [a, b, c, d, e, f]) = (t / 10_000_000, flu(v));
                format!("{count},{},{}", t / 1000 + 1_000_000, cells([d, e, f, a, b, c]))
            });
            imu_of(recorded, folder, &text, 1_000_000_000)
        },
    },
    Program {
        name: "semicircles beside a velocity",
        write: |recorded, folder| integers(recorded, folder, 180.0, true),
    },
    Program {
        name: "positions in 1e-7 deg beside heights in metres",
        write: |recorded, folder| integers(recorded, folder, 214.748_364_8, false),
    },
    Program {
        name: "PlotJuggler, topics with stamps of their own",
        write: |recorded, folder| {
            let late =
                |rows: &[Row], by: i64, line: &dyn Fn(&Row) -> String| -> Vec<(i64, String)> {
                    rows.iter().map(|row| (row.0 + by, line(row))).collect()
                };
            let mut rows = late(&recorded["imu"], 4_000_000, &|(t, v)| {
                format!("{},{},,,,", seconds(t + DATE), cells(flu(v)))
            });
            rows.extend(late(&recorded["gnss"], 50_500_000, &|(t, v)| {
                format!(",,,,,,,{},{}", seconds(t + DATE), position(v))
            }));
            rows.sort();
            let mut text = "__time,/imu/header/stamp".to_owned();
            for vector in ["angular_velocity", "linear_acceleration"] {
                text += &["x", "y", "z"].map(|axis| format!(",/imu/{vector}/{axis}")).concat();
            }
            text += ",/fix/header/stamp,/fix/latitude,/fix/longitude,/fix/altitude\n";
            rows.iter().for_each(|(t, row)| text += &format!("{},{row}\n", seconds(t + DATE)));
            Written { given: vec![put(folder, "plot.csv", &text)], offset: DATE }
        },
    },
];
