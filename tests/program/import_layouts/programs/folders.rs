//! Folders, logs and exports with more than one instrument.

use super::*;

/// The programs.
pub const PROGRAMS: [Program; 11] = [
    Program {
        name: "phyphox, a folder with a file for each instrument",
        write: |recorded, folder| {
            let vector = |name: &str, unit: &str, first: usize, late: i64| {
                let headings = format!(
                    "\"Time (s)\",\"{name} x ({unit})\",\"{name} y ({unit})\",\"{name} z ({unit})\""
                );
                table(&headings, &recorded["imu"], |(t, v)| {
                    let v = phone(v);
                    let time = (t + late) as f64 * 1e-9;
                    format!("{time:.9E},{:.9E},{:.9E},{:.9E}", v[first], v[first + 1], v[first + 2])
                })
            };
            put(folder, "Accelerometer.csv", &vector("Acceleration", "m/s^2", 3, 0));
            put(folder, "Gyroscope.csv", &vector("Gyroscope", "rad/s", 0, 2_300_000));
            let headings = "\"Time (s)\",\"Latitude (°)\",\"Longitude (°)\",\"Height (m)\",\"Velocity (m/s)\",\"Direction (°)\",\"Horizontal Accuracy (m)\",\"Vertical Accuracy (m)\"";
            let fixes = table(headings, &recorded["gnss"], |(t, v)| {
                let [speed, direction] = course(v);
                format!(
                    "{:.9E},{},{speed:.6E},{direction:.6E},1.5E0,2.5E0",
                    *t as f64 * 1e-9,
                    position(v)
                )
            });
            put(folder, "Location.csv", &fixes);
            put(folder, "meta/device.csv", "\"property\",\"value\"\n\"version\",\"1.1.9\"\n");
            Written { given: vec![folder.to_owned()], offset: 0 }
        },
    },
    Program {
        name: "Sensor Logger, whose headings are axes and whose files name the instrument",
        write: |recorded, folder| {
            let vector = |first: usize| {
                table("time,seconds_elapsed,z,y,x", &recorded["imu"], |(t, v)| {
                    let v = phone(v);
                    format!(
                        "{},{},{:.9},{:.9},{:.9}",
                        t + DATE,
                        seconds(*t),
                        v[first + 2],
                        v[first + 1],
                        v[first]
                    )
                })
            };
            put(folder, "TotalAcceleration.csv", &vector(3));
            put(folder, "Gyroscope.csv", &vector(0));
            let headings = "time,seconds_elapsed,speed,bearing,altitude,longitude,latitude";
            let fixes = table(headings, &recorded["gnss"], |(t, v)| {
                let [speed, bearing] = course(v);
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                format!(
                    "{},{},{speed:.4},{bearing:.4},{:.3},{lon:.9},{lat:.9}",
                    t + DATE,
                    seconds(*t),
                    v[2]
                )
            });
            put(folder, "Location.csv", &fixes);
            Written { given: vec![folder.to_owned()], offset: DATE }
        },
    },
    Program {
        name: "KITTI, a folder with a file for each row",
        write: |recorded, folder| {
            let mut times = String::new();
            for (k, (t, v)) in recorded["imu"].iter().skip(9).step_by(10).enumerate() {
                let newest = recorded["gnss"].iter().rev().find(|(at, _)| at <= t);
                let g = &newest.unwrap_or(&recorded["gnss"][0]).1;
                let [wx, wy, wz, ax, ay, az] = flu(v);
                let row = format!(
                    "{:.9} {:.9} {:.3} 0 0 0.97 {:.3} {:.3} 0 0 0 {ax} {ay} {az} {ax} {ay} {az} {wx} {wy} {wz} {wx} {wy} {wz} 0.15 0.05 4 8 4 4 0\n",
                    g[0].to_degrees(),
                    g[1].to_degrees(),
                    g[2],
                    g[3],
                    g[4]
                );
                put(folder, &format!("oxts/data/{k:010}.txt"), &row);
                let c = date(t + DATE);
                times += &format!(
                    "{:04}-{:02}-{:02} {}000000\n",
                    c.year,
                    c.month,
                    c.day,
                    clock(t + DATE)
                );
            }
            put(folder, "oxts/timestamps.txt", &times);
            put(folder, "oxts/dataformat.txt", "lat:     latitude of the oxts-unit (deg)\n");
            Written { given: vec![folder.to_owned()], offset: DATE }
        },
    },
    Program {
        name: "EuRoC, folders within a folder",
        write: |recorded, folder| {
            let headings = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]";
            let imu = table(headings, &recorded["imu"], |(t, v)| {
                format!("{},{}", t + DATE, cells(flu(v)))
            });
            put(folder, "mav0/imu0/data.csv", &imu);
            put(folder, "mav0/imu0/sensor.yaml", "sensor_type: imu\nrate_hz: 100\n");
            let fixes = table(
                "#timestamp [ns],lat [deg],lon [deg],alt [m]",
                &recorded["gnss"],
                |(t, v)| format!("{},{}", t + DATE, position(v)),
            );
            put(folder, "mav0/gnss0/data.csv", &fixes);
            Written { given: vec![folder.join("mav0")], offset: DATE }
        },
    },
    Program {
        name: "ros2 topic echo --csv, without headings",
        write: |recorded, folder| {
            let zeros = "0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,0.0";
            let lines = recorded["imu"].iter().map(|(t, v)| {
                let (t, v) = (t + DATE, flu(v));
                let [rates, forces] = [cells(v[..3].to_vec()), cells(v[3..].to_vec())];
                format!(
                    "{},{},imu_link,0.0,0.0,0.0,1.0,{zeros},{rates},{zeros},{forces},{zeros}\n",
                    t / 1_000_000_000,
                    t % 1_000_000_000
                )
            });
            imu_of(recorded, folder, &lines.collect::<String>(), DATE)
        },
    },
    Program {
        name: "seconds and nanoseconds in two columns",
        write: |recorded, folder| {
            let headings = "header.stamp.secs,header.stamp.nsecs,header.frame_id,angular_velocity.x,angular_velocity.y,angular_velocity.z,linear_acceleration.x,linear_acceleration.y,linear_acceleration.z";
            let text = table(headings, &recorded["imu"], |(t, v)| {
                let t = t + DATE;
                format!("{},{},imu,{}", t / 1_000_000_000, t % 1_000_000_000, cells(flu(v)))
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "Xsens, IMU and fixes in one export with empty cells",
        write: |recorded, folder| {
            let headings = "// Start Time: Unknown\n// Sample rate: 100.0Hz\nsep=,\nPacketCounter,SampleTimeFine,Year,Month,Day,Second,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Latitude,Longitude,Altitude,Vel_E,Vel_N,Vel_U,";
            let mut before = -1;
            let mut text = headings.to_owned() + "\n";
            for (k, (t, v)) in recorded["imu"].iter().enumerate() {
                let v = flu(v);
                let fix = new_fix(recorded, before, *t).map_or(",,,,,".to_owned(), |(_, g)| {
                    format!("{},{:.3},{:.3},{:.3}", position(g), g[4], g[3], -g[5])
                });
                before = *t;
                let [rates, forces] = [cells(v[..3].to_vec()), cells(v[3..].to_vec())];
                text += &format!("{k},{},,,,,{forces},{rates},{fix},\n", t / 100_000);
            }
            Written { given: vec![put(folder, "MT.txt", &text)], offset: 0 }
        },
    },
    Program {
        name: "VectorNav, groups in the headings",
        write: |recorded, folder| {
            let headings = "TimeStartup (ns),IMU::UncompAccel::Accel_X,IMU::UncompAccel::Accel_Y,IMU::UncompAccel::Accel_Z,IMU::UncompGyro::Gyro_X,IMU::UncompGyro::Gyro_Y,IMU::UncompGyro::Gyro_Z,GNSS::PosLla::Latitude,GNSS::PosLla::Longitude,GNSS::PosLla::Altitude,GNSS::VelNed::VelN,GNSS::VelNed::VelE,GNSS::VelNed::VelD,GNSS::GnssFix";
            let text = table(headings, &recorded["imu"], |(t, v)| {
                let fix = recorded["gnss"].iter().rev().find(|(at, _)| at <= t);
                let fix = fix.map_or("0,0,0,0,0,0,0".to_owned(), |(_, g)| {
                    format!("{},{:.3},{:.3},{:.3},3", position(g), g[3], g[4], g[5])
                });
                format!("{t},{},{},{fix}", cells(v[3..].to_vec()), cells(v[..3].to_vec()))
            });
            Written { given: vec![put(folder, "vn.csv", &text)], offset: 0 }
        },
    },
    Program {
        name: "ArduPilot, a log as text",
        write: |recorded, folder| {
            let mut lines: Vec<(i64, String)> = Vec::new();
            for (t, v) in &recorded["imu"] {
                lines.push((
                    *t,
                    format!(
                        "IMU, {}, 0, {}, 0, 0",
                        t / 1000,
                        cells(v.iter().copied()).replace(',', ", ")
                    ),
                ));
                lines.push((*t, format!("IMU, {}, 1, 0.1, 0.1, 0.1, 0, 0, -5.0, 0, 0", t / 1000)));
            }
            for (t, v) in &recorded["gnss"] {
                let [speed, direction] = course(v);
                lines.push((
                    *t,
                    format!(
                        "GPS, {}, 0, 3, 12, {}, {speed:.4}, {direction:.4}, {:.3}",
                        t / 1000,
                        position(v).replace(',', ", "),
                        v[5]
                    ),
                ));
            }
            lines.sort();
            let head = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 140, 44, IMU, QBffffffII, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA\nFMT, 141, 50, GPS, QBBBLLefff, TimeUS,I,Status,NSats,Lat,Lng,Alt,Spd,GCrs,VZ\nPARM, 1, SYSID, 1\n";
            let rows: String = lines.into_iter().map(|(_, line)| line + "\n").collect();
            Written {
                given: vec![put(folder, "flight.log", &(head.to_owned() + &rows))],
                offset: 0,
            }
        },
    },
    Program {
        name: "rows of several kinds without headings",
        write: |recorded, folder| {
            let mut lines: Vec<(i64, String)> = Vec::new();
            lines.extend(
                recorded["imu"].iter().map(|(t, v)| {
                    (*t, format!("IMU,{},{}\n", seconds(*t), cells(v.iter().copied())))
                }),
            );
            lines.extend(
                recorded["gnss"]
                    .iter()
                    .map(|(t, v)| (*t, format!("GPS,{},{}\n", seconds(*t), position(v)))),
            );
            lines.sort();
            let text: String = lines.into_iter().map(|(_, line)| line).collect();
            Written { given: vec![put(folder, "log.txt", &text)], offset: 0 }
        },
    },
    Program {
        name: "KAIST complex urban, tables without headings whose stamps are nanoseconds",
        write: |recorded, folder| {
            let lines = |sensor: &str, line: &dyn Fn(&Row) -> String| {
                recorded[sensor].iter().map(|row| line(row) + "\n").collect::<String>()
            };
            let imu = lines("imu", &|(t, v)| {
                let s = 1e-9 * *t as f64;
                let (sin, cos) = (0.3 + 0.01 * s).sin_cos();
                let tilt = [0.01 * (2.3 * s).sin(), 0.02 * (1.7 * s).cos()];
                let attitude = [0.0, 0.0, sin, cos, tilt[0], tilt[1], 2.0 * sin.atan2(cos)];
                let magnet = [0.31 * cos + tilt[0], 0.29 * sin - tilt[1], -0.62];
                let parts = [&attitude[..], &flu(v), &magnet].concat();
                format!("{},{}", t + DATE, cells(parts))
            });
            put(folder, "sensor_data/xsens_imu.csv", &imu);
            let fixes = lines("gnss", &|(t, v)| {
                format!("{},{},2.25,0,0,0,2.25,0,0,0,6.25", t + DATE, position(v))
            });
            put(folder, "sensor_data/gps.csv", &fixes);
            let wheels = lines("imu", &|(t, _)| {
                let way = t / 4_000_000;
                format!("{},{},{}", t + DATE, 5_000 + way, 7_000 + way)
            });
            put(folder, "sensor_data/encoder.csv", &wheels);
            let fibre = lines("imu", &|(t, v)| {
                format!("{},{}", t + DATE, cells(v[..3].iter().map(|w| w * 0.01)))
            });
            put(folder, "sensor_data/fog.csv", &fibre);
            let air = lines("gnss", &|(t, v)| format!("{},{:.2}", t + DATE, v[2] - 3.0));
            put(folder, "sensor_data/altimeter.csv", &air);
            Written { given: vec![folder.to_owned()], offset: DATE }
        },
    },
];
