//! Terminals, loggers of vehicles and phones, and tables whose rows share their stamps.

use super::*;

/// An IMU whose rows have these texts after a stamp.
fn lines_of(recorded: &Recorded, line: impl Fn(&Row) -> String) -> String {
    recorded["imu"].iter().map(|row| line(row) + "\n").collect()
}

/// Forward, left and up: forces in g and rates in deg/s.
fn in_degrees(v: &[f64]) -> [f64; 6] {
    let [x, y, z, forces @ ..] = flu(v);
    let [a, b, c] = forces.map(|f| f / GRAVITY);
    let [x, y, z] = [x, y, z].map(f64::to_degrees);
    [x, y, z, a, b, c]
}

/// The programs.
pub const PROGRAMS: [Program; 12] = [
    Program {
        name: "the serial monitor of the Arduino IDE with its stamps",
        write: |recorded, folder| {
            let text = lines_of(recorded, |(t, v)| {
                let [x, y, z, a, b, c] = in_degrees(v);
                format!("{} -> {}", clock(t + DATE), cells([a, b, c, x, y, z]))
            });
            let day = DATE.rem_euclid(86_400_000_000_000);
            imu_of(recorded, folder, &text, day)
        },
    },
    Program {
        name: "whole seconds, as MATLAB shows a datetime",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let whole = (t + DATE) / 1_000_000_000 * 1_000_000_000;
                let c = date(whole);
                let stamp = format!("{}-Nov-{} {}", c.day, c.year, &clock(whole)[..8]);
                format!("{stamp},{}", cells(v.iter().copied()))
            };
            let text = table("Time,GyroX,GyroY,GyroZ,AccelX,AccelY,AccelZ", &recorded["imu"], line);
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "whole seconds beside microseconds and a date without decimals",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let nanos = t + DATE;
                let [whole, micros] = [nanos / 1_000_000_000, nanos % 1_000_000_000 / 1000];
                let date = format!("{} {}", day(nanos), &clock(nanos)[..8]);
                format!("{date},{whole},{micros},{}", cells(v.iter().copied()))
            };
            let headings = "Human Timestamp,Unix Time,Microseconds,Gyroscope X (rad/s),Gyroscope Y (rad/s),\
                            Gyroscope Z (rad/s),Accelerometer X (m/s/s),Accelerometer Y (m/s/s),\
                            Accelerometer Z (m/s/s)";
            imu_of(recorded, folder, &table(headings, &recorded["imu"], line), DATE)
        },
    },
    Program {
        name: "OpenLog Artemis: a receiver with a slower clock in the rows of the IMU",
        write: |recorded, folder| {
            let us = |nanos: i64| {
                let c = date(nanos);
                format!("{:02}/{:02}/{},{}", c.month, c.day, c.year, clock(nanos))
            };
            let line = |(t, v): &Row| {
                let (at, fix) = recorded["gnss"]
                    .iter()
                    .rev()
                    .find(|(at, _)| at <= t)
                    .unwrap_or(&recorded["gnss"][0]);
                let [x, y, z, a, b, c] = in_degrees(v);
                let milli = [1e3 * a, 1e3 * b, 1e3 * c, x, y, z];
                let [speed, course] = course(fix);
                let place = [
                    fix[0].to_degrees() * 1e7,
                    fix[1].to_degrees() * 1e7,
                    fix[2] * 1e3,
                    1e3 * speed,
                ];
                let place = place.map(|x| format!("{x:.0}")).join(",");
                format!(
                    "{},{},{},{place},{:.0},",
                    us(t + DATE),
                    cells(milli),
                    us(at + DATE),
                    1e5 * course
                )
            };
            let headings = "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,gps_Date,gps_Time,gps_Lat,gps_Long,gps_Alt,\
                            gps_GroundSpeed,gps_Heading,";
            let text = table(headings, &recorded["imu"], line);
            Written { given: vec![put(folder, "dataLog00001.TXT", &text)], offset: DATE }
        },
    },
    Program {
        name: "messages of CAN, decoded by cantools on one line each",
        write: |recorded, folder| {
            let stamp = |t: i64| format!("({})  can0  1A0   [8]  80 4A 0F 00", seconds(t + DATE));
            let mut rows = Vec::new();
            for (t, v) in &recorded["imu"] {
                let [x, y, z] = [v[0], v[1], v[2]].map(f64::to_degrees);
                let rates = format!(
                    "IMU_Gyro(GyroX: {x:.5} deg/s, GyroY: {y:.5} deg/s, GyroZ: {z:.5} deg/s)"
                );
                let forces = format!(
                    "IMU_Acc(AccX: {:.5} m/s^2, AccY: {:.5} m/s^2, AccZ: {:.5} m/s^2)",
                    v[3], v[4], v[5]
                );
                rows.push((*t, format!("{} :: {rates}\n{} :: {forces}\n", stamp(*t), stamp(*t))));
            }
            for (t, v) in &recorded["gnss"] {
                let [latitude, longitude] = [v[0], v[1]].map(f64::to_degrees);
                let place = format!(
                    "GPS_Pos(Latitude: {latitude:.8} deg, Longitude: {longitude:.8} deg, Altitude: {:.2} m)",
                    v[2]
                );
                rows.push((*t, format!("{} :: {place}\n", stamp(*t))));
            }
            rows.sort_by_key(|(t, _)| *t);
            let text: String = rows.into_iter().map(|(_, row)| row).collect();
            Written { given: vec![put(folder, "decoded.txt", &text)], offset: DATE }
        },
    },
    Program {
        name: "a log of telemetry of Mission Planner: names and numbers by turns",
        write: |recorded, folder| {
            let head = |t: i64| format!("{} {},FE,1A,0,1,1", day(t + DATE), clock(t + DATE));
            let mut rows = Vec::new();
            for (t, v) in &recorded["imu"] {
                let names = ["xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc"];
                let scale = |k: usize| if k < 3 { 1e3 } else { 1e3 / GRAVITY };
                let cells = (0..6).map(|k| format!("{},{:.0}", names[k], scale(k) * v[k]));
                let cells: Vec<String> = cells.collect();
                rows.push((
                    *t,
                    format!(
                        "{},1B,mavlink_raw_imu_t,time_usec,{},{},Len,34\n",
                        head(*t),
                        t / 1000,
                        cells.join(",")
                    ),
                ));
            }
            for (t, v) in &recorded["gnss"] {
                let [latitude, longitude] = [v[0], v[1]].map(|x| 1e7 * x.to_degrees());
                rows.push((*t, format!(
                    "{},18,mavlink_gps_raw_int_t,time_usec,{},lat,{latitude:.0},lon,{longitude:.0},alt,{:.0},Len,38\n",
                    head(*t), t / 1000, 1e3 * v[2]
                )));
            }
            rows.sort_by_key(|(t, _)| *t);
            let text: String = rows.into_iter().map(|(_, row)| row).collect();
            Written { given: vec![put(folder, "telemetry.csv", &text)], offset: DATE }
        },
    },
    Program {
        name: "OwnTracks: objects of JSON behind a stamp",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let [latitude, longitude] = [v[0], v[1]].map(f64::to_degrees);
                let nanos = t + DATE;
                format!(
                    "{}T{}Z\t*    \t{{\"_type\":\"location\",\"alt\":{:.1},\"lat\":{latitude:.8},\"lon\":{longitude:.8},\
                     \"tst\":{}}}\n",
                    day(nanos),
                    clock(nanos),
                    v[2],
                    seconds(nanos)
                )
            };
            let text: String = recorded["gnss"].iter().map(line).collect();
            fixes_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "gyros and accelerometers without headings, named by their files",
        write: |recorded, folder| {
            let half = |from: usize| {
                lines_of(recorded, |(t, v)| {
                    let v = phone(v);
                    let millis = (t + DATE) / 1_000_000;
                    format!("{millis} {:.6} {:.6} {:.6}", v[from], v[from + 1], v[from + 2])
                })
            };
            let given = [
                ("ACC.csv", half(3)),
                ("GYRO.csv", half(0)),
                ("gnss.csv", plain_gnss(recorded, DATE)),
            ];
            Written {
                given: given.map(|(name, text)| put(folder, name, &text)).to_vec(),
                offset: DATE,
            }
        },
    },
    Program {
        name: "MetaBase: axes alone, with the unit of a rate and of a force",
        write: |recorded, folder| {
            let half = |from: usize, unit: &str| {
                let headings = format!(
                    "epoc (ms),elapsed (s),x-axis ({unit}),y-axis ({unit}),z-axis ({unit})"
                );
                table(&headings, &recorded["imu"], |(t, v)| {
                    let v = in_degrees(v);
                    let millis = (t + DATE) / 1_000_000;
                    format!("{millis},{},{}", seconds(*t), cells(v[from..from + 3].iter().copied()))
                })
            };
            let given = [
                ("A_Accelerometer_100.000Hz.csv", half(3, "g")),
                ("A_Gyroscope_100.000Hz.csv", half(0, "deg/s")),
                ("gnss.csv", plain_gnss(recorded, DATE)),
            ];
            Written {
                given: given.map(|(name, text)| put(folder, name, &text)).to_vec(),
                offset: DATE,
            }
        },
    },
    Program {
        name: "LabVIEW: lines before the headings that resemble rows",
        write: |recorded, folder| {
            let text = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\nChannels\t6\t\t\t\t\t\t\n\
                        Samples\t6000\t6000\t6000\t6000\t6000\t6000\t\nX0\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0\t\n\
                        Delta_X\t0.01\t0.01\t0.01\t0.01\t0.01\t0.01\t\n***End_of_Header***\t\t\t\t\t\t\t\n";
            let rows = table(
                "X_Value\tGyro_X\tGyro_Y\tGyro_Z\tAcc_X\tAcc_Y\tAcc_Z\tComment",
                &recorded["imu"],
                |(t, v)| {
                    format!("{}\t{}\t", seconds(*t), cells(v.iter().copied()).replace(',', "\t"))
                },
            );
            imu_of(recorded, folder, &(text.to_owned() + &rows), 0)
        },
    },
    Program {
        name: "AiM: accelerations of the receiver beside those of the vehicle, in three lines of headings",
        write: |recorded, folder| {
            let headings = "\"Time\",\"GPS LatAcc\",\"GPS LonAcc\",\"InlineAcc\",\"LateralAcc\",\"VerticalAcc\",\"RollRate\",\
                            \"PitchRate\",\"YawRate\"\n\"s\",\"g\",\"g\",\"g\",\"g\",\"g\",\"deg/s\",\"deg/s\",\"deg/s\"\n";
            let text = table(headings, &recorded["imu"], |(t, v)| {
                let [a, b, c] = [v[3], v[4], v[5]].map(|f| f / GRAVITY);
                let [x, y, z] = [v[0], v[1], v[2]].map(f64::to_degrees);
                let row = [0.01, 0.02, a, b, -c, x, y, z].map(|x| format!("\"{x:.5}\"")).join(",");
                format!("\"{}\",{row}", seconds(*t))
            });
            imu_of(
                recorded,
                folder,
                &format!("\"Format\",\"AiM CSV File\"\n\"Sample Rate\",\"100\"\n\n{text}"),
                0,
            )
        },
    },
    Program {
        name: "Dewesoft in German: rates of yaw, pitch and roll",
        write: |recorded, folder| {
            let headings = "Zeit (s)\tGierrate (deg/s)\tNickrate (deg/s)\tWankrate (deg/s)\tLängsbeschleunigung (m/s2)\t\
                            Querbeschleunigung (m/s2)\tVertikalbeschleunigung (m/s2)";
            let text = table(headings, &recorded["imu"], |(t, v)| {
                let [x, y, z] = [v[0], v[1], v[2]].map(f64::to_degrees);
                format!(
                    "{}\t{}",
                    seconds(*t),
                    cells([z, y, x, v[3], v[4], v[5]]).replace(',', "\t")
                )
                .replace('.', ",")
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
];
