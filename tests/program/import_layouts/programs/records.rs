//! Records of several sensors in one file, and columns that other programs name or count in their own way.

use super::*;

/// Lines of an IMU and of fixes by their times.
fn both(recorded: &Recorded, imu: impl Fn(&Row) -> String, fix: impl Fn(&Row) -> String) -> String {
    let imu = recorded["imu"].iter().map(|row| (row.0, imu(row)));
    let fix = recorded["gnss"].iter().map(|row| (row.0 + 1, fix(row)));
    let mut lines: Vec<(i64, String)> = imu.chain(fix).collect();
    lines.sort();
    lines.into_iter().map(|(_, line)| line).collect()
}

fn list(cells: impl Iterator<Item = String>) -> String {
    cells.collect::<Vec<_>>().join(", ")
}

/// The arrays of a sensor, with these keys behind the time.
fn arrays(rows: &[Row], keys: &[&str], cell: impl Fn(&[f64], usize) -> f64) -> String {
    let times = list(rows.iter().map(|(t, _)| seconds(*t)));
    let columns = keys.iter().enumerate().map(|(k, key)| {
        format!("\"{key}\": [{}]", list(rows.iter().map(|(_, v)| format!("{:.9}", cell(v, k)))))
    });
    format!("{{\"t\": [{times}], {}}}", list(columns))
}

fn place(v: &[f64], k: usize) -> f64 {
    if k < 2 { v[k].to_degrees() } else { v[k] }
}

/// A checksum of NMEA 0183.
fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn minutes(radians: f64) -> (i64, f64) {
    let (degrees, minutes, seconds) = sexagesimal(radians);
    (degrees, minutes as f64 + seconds / 60.0)
}

/// The programs.
pub const PROGRAMS: [Program; 9] = [
    Program {
        name: "JSON with arrays of other lengths for each sensor",
        write: |recorded, folder| {
            let imu = arrays(&recorded["imu"], &["gx", "gy", "gz", "ax", "ay", "az"], |v, k| v[k]);
            let gps = arrays(&recorded["gnss"], &["lat", "lon", "alt"], place);
            let text = format!("{{\"meta\": {{\"n\": [1, 2]}}, \"imu\": {imu}, \"gps\": {gps}}}");
            Written { given: vec![put(folder, "log.json", &text)], offset: 0 }
        },
    },
    Program {
        name: "Gazebo, messages of its topics as text",
        write: |recorded, folder| {
            let vector = |v: &[f64]| {
                format!("{{\n  x: {:.9}\n  y: {:.9}\n  z: {:.9}\n}}\n", v[0], v[1], v[2])
            };
            let stamp = |t: i64| {
                format!(
                    "header {{\n  stamp {{\n    sec: {}\n    nsec: {}\n  }}\n}}\n",
                    t / 1_000_000_000,
                    t % 1_000_000_000
                )
            };
            let imu = recorded["imu"].iter().map(|(t, v)| {
                let v = flu(v);
                let [rate, force] = [vector(&v[..3]), vector(&v[3..])];
                format!(
                    "{}entity_name: \"imu\"\nangular_velocity {rate}linear_acceleration {force}\n",
                    stamp(*t)
                )
            });
            let fix = recorded["gnss"].iter().map(|(t, v)| {
                format!(
                    "{}latitude_deg: {:.9}\nlongitude_deg: {:.9}\naltitude: {:.3}\n\n",
                    stamp(*t),
                    place(v, 0),
                    place(v, 1),
                    v[2]
                )
            });
            let given = vec![
                put(folder, "imu.txt", &imu.collect::<String>()),
                put(folder, "navsat.txt", &fix.collect::<String>()),
            ];
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "XML with elements of two sensors",
        write: |recorded, folder| {
            let imu = |(t, v): &Row| {
                format!(
                    "<Sample type=\"imu\"><Time>{}</Time><Gyro x=\"{:.7}\" y=\"{:.7}\" z=\"{:.7}\"/>\
                     <Accel x=\"{:.7}\" y=\"{:.7}\" z=\"{:.7}\"/></Sample>\n",
                    seconds(*t),
                    v[0],
                    v[1],
                    v[2],
                    v[3],
                    v[4],
                    v[5]
                )
            };
            let fix = |(t, v): &Row| {
                format!(
                    "<Fix>\n<Time>{}</Time><Latitude>{:.9}</Latitude><Longitude>{:.9}</Longitude>\
                     <Altitude>{:.3}</Altitude></Fix>\n",
                    seconds(*t),
                    place(v, 0),
                    place(v, 1),
                    v[2]
                )
            };
            let text = both(recorded, imu, fix);
            let text = format!("<?xml version=\"1.0\"?>\n<Recording>\n{text}</Recording>\n");
            Written { given: vec![put(folder, "log.xml", &text)], offset: 0 }
        },
    },
    Program {
        name: "lines with a kind and a colon before their names",
        write: |recorded, folder| {
            let imu = |(t, v): &Row| {
                format!(
                    "[{}] IMU: gyro=({:.7}, {:.7}, {:.7}) accel=({:.7}, {:.7}, {:.7})\n",
                    seconds(*t),
                    v[0],
                    v[1],
                    v[2],
                    v[3],
                    v[4],
                    v[5]
                )
            };
            let fix = |(t, v): &Row| {
                let [lat, lon] = [place(v, 0), place(v, 1)];
                format!("[{}] GPS: lat={lat:.9} lon={lon:.9} alt={:.3}\n", seconds(*t), v[2])
            };
            let text = both(recorded, imu, fix);
            Written { given: vec![put(folder, "log.txt", &text)], offset: 0 }
        },
    },
    Program {
        name: "NMEA with sentences of an IMU between those of the receiver",
        write: |recorded, folder| {
            let time = |t: i64| clock(t + DATE).replace(':', "");
            let imu =
                |(t, v): &Row| sentence(&format!("PIMU,{},{}", time(*t), cells(v.iter().copied())));
            let fix = |(t, v): &Row| {
                let ((lat, lat_minutes), (lon, lon_minutes)) = (minutes(v[0]), minutes(v[1]));
                let ([speed, course], at) = (course(v), time(*t));
                sentence(&format!(
                    "GPGGA,{at},{lat:02}{lat_minutes:010.7},N,{lon:03}{lon_minutes:010.7},E,1,12,0.8,{:.3},M,0.0,M,,",
                    v[2]
                )) + &sentence(&format!(
                    "GPRMC,{at},A,{lat:02}{lat_minutes:010.7},N,{lon:03}{lon_minutes:010.7},E,{:.3},{course:.3},141123,,,A",
                    speed * 3600.0 / 1852.0
                ))
            };
            let text = both(recorded, imu, fix);
            Written {
                given: vec![put(folder, "log.txt", &text)],
                offset: DATE.rem_euclid(86_400_000_000_000),
            }
        },
    },
    Program {
        name: "degrees and minutes in two columns, behind their sides",
        write: |recorded, folder| {
            let head = "time_s,lat_hemi,lat_deg,lat_min,lon_hemi,lon_deg,lon_min,alt";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let ((lat, lat_minutes), (lon, lon_minutes)) = (minutes(v[0]), minutes(v[1]));
                format!(
                    "{},N,{lat},{lat_minutes:.7},E,{lon},{lon_minutes:.7},{:.3}",
                    seconds(*t),
                    v[2]
                )
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "R, rows with numbers that have no heading, and dates between quotation marks",
        write: |recorded, folder| {
            let head = "\"time\" \"gyro.x\" \"gyro.y\" \"gyro.z\" \"acc.x\" \"acc.y\" \"acc.z\"\n";
            let row = |(k, (t, v)): (usize, &Row)| {
                let numbers = cells(v.iter().copied()).replace(',', " ");
                format!("\"{}\" \"{} {}\" {numbers}\n", k + 1, day(t + DATE), clock(t + DATE))
            };
            let rows: String = recorded["imu"].iter().enumerate().map(row).collect();
            imu_of(recorded, folder, &(head.to_owned() + &rows), DATE)
        },
    },
    Program {
        name: "two sensors side by side, each with its own time",
        write: |recorded, folder| {
            let (imu, fixes) = (&recorded["imu"], &recorded["gnss"]);
            let row = |(k, (t, v)): (usize, &Row)| {
                let fix = |(t, v): &Row| format!("{},{}", seconds(*t), position(v));
                let fix = fixes.get(k).map_or(",,,".to_owned(), fix);
                format!("{},{},{fix}\n", seconds(*t), cells(v.iter().copied()))
            };
            let rows: String = imu.iter().enumerate().map(row).collect();
            let text = "t_imu,wx,wy,wz,fx,fy,fz,t_gps,lat,lon,alt\n".to_owned() + &rows;
            Written { given: vec![put(folder, "sim.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "PX4, the topics of its sensors as tables",
        write: |recorded, folder| {
            let head = "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count,samples";
            let half = |name: &str, from: usize| {
                let text = table(head, &recorded["imu"], |(t, v)| {
                    let v = cells(v[from..from + 3].iter().copied());
                    format!("{0},{0},2621448,{v},31.2,0,1", t / 1000)
                });
                put(folder, name, &text)
            };
            let given = vec![
                half("log_sensor_gyro_0.csv", 0),
                half("log_sensor_accel_0.csv", 3),
                put(folder, "gps.csv", &plain_gnss(recorded, 0)),
            ];
            Written { given, offset: 0 }
        },
    },
];
