//! Other languages, messages of several samples, numbers without headings, and axes that positions alone show.

use super::*;

/// Positions alone beside an IMU along other axes.
fn beside_places(recorded: &Recorded, folder: &Path, turn: fn(&[f64]) -> [f64; 6]) -> Written {
    let written = axes(recorded, folder, turn);
    let line = |(t, v): &Row| format!("{},{}", seconds(*t), position(v));
    let places = table("time,latitude,longitude,altitude", &recorded["gnss"], line);
    Written { given: vec![written.given[0].clone(), put(folder, "places.csv", &places)], offset: 0 }
}

/// The programs.
pub const PROGRAMS: [Program; 6] = [
    Program {
        name: "French headings, decimal commas and a mark of UTF-8, columns from z to x",
        write: |recorded, folder| {
            let commas = |text: String| "\u{feff}".to_owned() + &text.replace('.', ",");
            let headings = "Temps (s);Accélération Z (m/s²);Accélération Y (m/s²);Accélération X (m/s²);\
                            Vitesse angulaire Z (°/s);Vitesse angulaire Y (°/s);Vitesse angulaire X (°/s)";
            let imu = table(headings, &recorded["imu"], |(t, v)| {
                let cell = |k: usize| if k > 2 { v[k] } else { v[k].to_degrees() };
                let cells = [5, 4, 3, 2, 1, 0].map(|k| format!("{:.7}", cell(k))).join(";");
                format!("{};{cells}", seconds(*t))
            });
            let headings =
                "Temps (s);Latitude (°);Longitude (°);Altitude (m);Vitesse (km/h);Cap (°)";
            let fixes = table(headings, &recorded["gnss"], |(t, v)| {
                let [speed, course] = course(v);
                let place = position(v).replace(',', ";");
                format!("{};{place};{:.3};{course:.2}", seconds(*t), 3.6 * speed)
            });
            let files = [("centrale.csv", imu), ("gps.csv", fixes)];
            let given = files.map(|(name, text)| put(folder, name, &commas(text))).to_vec();
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "week, seconds, forces, rates and repeated fixes without headings",
        write: |recorded, folder| {
            let mut text = String::new();
            for (t, v) in &recorded["imu"] {
                let Some(fix) = recorded["gnss"].iter().rev().find(|(at, _)| at <= t) else {
                    continue;
                };
                let degrees = v[..3].iter().map(|w| w.to_degrees());
                let inertial = cells(v[3..6].iter().copied().chain(degrees)).replace(',', " ");
                let place = position(&fix.1).replace(',', " ");
                let seconds = seconds(213_000_000_000_000 + t);
                text += &format!("2356 {seconds} {inertial} {place}\n");
            }
            Written { given: vec![put(folder, "log.dat", &text)], offset: 213_000_000_000_000 }
        },
    },
    Program {
        name: "four samples of an IMU in each message, in us",
        write: |recorded, folder| {
            let rows = &recorded["imu"];
            let last = |k: usize| rows[(k / 4 * 4 + 3).min(rows.len() - 1)].0;
            let mut imu = "rx_time_us,gx,gy,gz,ax,ay,az\n".to_owned();
            for (k, (_, v)) in rows.iter().enumerate() {
                imu += &format!("{},{}\n", last(k) / 1000, cells(v.iter().copied()));
            }
            let line = |(t, v): &Row| format!("{},{}", t / 1000, position(v));
            let fixes = table("rx_time_us,lat,lon,alt", &recorded["gnss"], line);
            let given = vec![put(folder, "imu.csv", &imu), put(folder, "gps.csv", &fixes)];
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "milliseconds after a third colon, two hours east of UTC",
        write: |recorded, folder| {
            let zone = 7_200_000_000_000;
            let day = |nanos| {
                let c = date(nanos);
                format!("{:02}.{:02}.{}", c.day, c.month, c.year)
            };
            let headings = "Date,Time,Gyro_X,Gyro_Y,Gyro_Z,Accel_X,Accel_Y,Accel_Z";
            let imu = table(headings, &recorded["imu"], |(t, v)| {
                let local = t + DATE + zone;
                let clock = clock(local).replace('.', ":");
                format!("{},{clock},{}", day(local), cells(v.iter().copied()))
            });
            let fixes = table("Date (UTC),Time (UTC),Lat,Lon,Alt", &recorded["gnss"], |(t, v)| {
                let c = date(t + DATE);
                let clock = &clock(t + DATE)[..10];
                format!("{}/{:02}/{:02},{clock},{}", c.year, c.month, c.day, position(v))
            });
            let given = vec![put(folder, "imu.csv", &imu), put(folder, "gps.csv", &fixes)];
            Written { given, offset: DATE + zone }
        },
    },
    Program {
        name: "right, down, forward of a camera beside positions alone",
        write: |recorded, folder| {
            beside_places(recorded, folder, |v| [v[1], v[2], v[0], v[4], v[5], v[3]])
        },
    },
    Program {
        name: "backwards, right, up beside positions alone",
        write: |recorded, folder| {
            beside_places(recorded, folder, |v| [-v[0], v[1], -v[2], -v[3], v[4], -v[5]])
        },
    },
];
