//! Times, dates, units and headings.

use super::*;

/// The programs.
pub const PROGRAMS: [Program; 13] = [
    Program {
        name: "RTKLIB, weeks and seconds",
        write: |recorded, folder| {
            rtklib(
                recorded,
                folder,
                &format!("latitude(deg) longitude(deg) height(m) {ACCURACIES}"),
                |(t, v), _| {
                    let (week, rest) = week(*t);
                    format!(
                        "{week} {:.3} {} {ACCURACY}",
                        rest as f64 * 1e-9,
                        position(v).replace(',', " ")
                    )
                },
            )
        },
    },
    Program {
        name: "RTKLIB, degrees, minutes and seconds",
        write: |recorded, folder| {
            rtklib(
                recorded,
                folder,
                &format!("latitude(d'\") longitude(d'\") height(m) {ACCURACIES}"),
                |(_, v), at| {
                    let [(a, b, c), (d, e, f)] = [sexagesimal(v[0]), sexagesimal(v[1])];
                    format!("{at} {a} {b:02} {c:08.5} {d} {e:02} {f:08.5} {:.4} {ACCURACY}", v[2])
                },
            )
        },
    },
    Program {
        name: "RTKLIB, coordinates of Earth-fixed axes",
        write: |recorded, folder| {
            let accuracies = ACCURACIES.replace("sdn(m) sde(m) sdu(m)", "sdx(m) sdy(m) sdz(m)");
            rtklib(
                recorded,
                folder,
                &format!("x-ecef(m) y-ecef(m) z-ecef(m) {accuracies}"),
                |(_, v), at| {
                    let p =
                        Geodetic { latitude: v[0], longitude: v[1], height: v[2] }.earth_fixed();
                    format!("{at} {:.4} {:.4} {:.4} {ACCURACY}", p.x, p.y, p.z)
                },
            )
        },
    },
    Program {
        name: "RTKLIB, semicolons",
        write: |recorded, folder| {
            let titles =
                format!(";latitude(deg);longitude(deg);height(m);{}", ACCURACIES.replace(' ', ";"));
            rtklib(recorded, folder, &titles, |(_, v), at| {
                format!("{at};{};{}", position(v).replace(',', ";"), ACCURACY.replace(' ', ";"))
            })
        },
    },
    Program {
        name: "coordinates of Earth-fixed axes in a table",
        write: |recorded, folder| {
            let text = table("time,x_ecef,y_ecef,z_ecef", &recorded["gnss"], |(t, v)| {
                let p = Geodetic { latitude: v[0], longitude: v[1], height: v[2] }.earth_fixed();
                format!("{},{:.4},{:.4},{:.4}", seconds(*t), p.x, p.y, p.z)
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "German dates, decimal commas, degrees and g",
        write: |recorded, folder| {
            let text = table(
                "Zeit;Gyro X [°/s];Gyro Y [°/s];Gyro Z [°/s];Acc X [g];Acc Y [g];Acc Z [g]",
                &recorded["imu"],
                |(t, v)| {
                    let c = date(t + DATE);
                    let rates = v[..3].iter().map(|w| w.to_degrees());
                    let forces = v[3..].iter().map(|f| f / GRAVITY);
                    let row = cells(rates.chain(forces)).replace(',', ";");
                    format!("{:02}.{:02}.{:04} {};{row}", c.day, c.month, c.year, clock(t + DATE))
                        .replace('.', ",")
                        .replacen(',', ".", 2)
                },
            );
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "year, month, day, hour, minute and second in six columns",
        write: |recorded, folder| {
            let text = table(
                "Year,Month,Day,Hour,Minute,Second,GyroX,GyroY,GyroZ,AccX,AccY,AccZ",
                &recorded["imu"],
                |(t, v)| {
                    let c = date(t + DATE);
                    let second = f64::from(c.second) + f64::from(c.nanos) * 1e-9;
                    format!(
                        "{},{},{},{},{},{second:.3},{}",
                        c.year,
                        c.month,
                        c.day,
                        c.hour,
                        c.minute,
                        cells(v.iter().copied())
                    )
                },
            );
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "dates with a zone",
        write: |recorded, folder| {
            let text = table(
                "timestamp,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
                &recorded["imu"],
                |(t, v)| {
                    let east = t + DATE + 3_600_000_000_000;
                    let row = cells(v.iter().copied());
                    format!("{}T{}+01:00,{row}", day(east), clock(east))
                },
            );
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "American dates below lines about the session",
        write: |recorded, folder| {
            let head = "SESSION_INFO\nSession Name,Untitled\nTimestamp,11/14/2023 22:13:20\n\nDATA_START\nTime,Inertial-3DM:scaledAccelX,Inertial-3DM:scaledAccelY,Inertial-3DM:scaledAccelZ,Inertial-3DM:scaledGyroX,Inertial-3DM:scaledGyroY,Inertial-3DM:scaledGyroZ";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let c = date(t + DATE);
                let forces = cells(v[3..].iter().map(|f| f / GRAVITY));
                format!(
                    "{:02}/{:02}/{:04} {},{forces},{}",
                    c.month,
                    c.day,
                    c.year,
                    clock(t + DATE),
                    cells(v[..3].to_vec())
                )
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "times of the day without a date",
        write: |recorded, folder| {
            let day = DATE.rem_euclid(86_400_000_000_000);
            let text = table("Uhrzeit,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", clock(t + DATE), cells(v.iter().copied()))
            });
            imu_of(recorded, folder, &text, day)
        },
    },
    Program {
        name: "units in the second line",
        write: |recorded, folder| {
            let text = table(
                "Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ\ns,deg/s,deg/s,deg/s,mg,mg,mg",
                &recorded["imu"],
                |(t, v)| {
                    let rates = v[..3].iter().map(|w| w.to_degrees());
                    let forces = v[3..].iter().map(|f| f / GRAVITY * 1000.0);
                    format!("{},{}", seconds(*t), cells(rates.chain(forces)))
                },
            );
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "headings in two lines",
        write: |recorded, folder| {
            let text = table(
                "Time,Gyroscope,,,Accelerometer,,\n,X,Y,Z,X,Y,Z",
                &recorded["imu"],
                |(t, v)| format!("{},{}", seconds(*t), cells(v.iter().copied())),
            );
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "Shimmer, calibrated quantities with units below and a tab at the end",
        write: |recorded, folder| {
            let head = "sep=\t\nShimmer_5_Timestamp_Unix_CAL\tShimmer_5_Accel_LN_X_CAL\tShimmer_5_Accel_LN_Y_CAL\tShimmer_5_Accel_LN_Z_CAL\tShimmer_5_Gyro_X_CAL\tShimmer_5_Gyro_Y_CAL\tShimmer_5_Gyro_Z_CAL\t\nms\tm/(s^2)\tm/(s^2)\tm/(s^2)\tdeg/s\tdeg/s\tdeg/s\t";
            let text = table(head, &recorded["imu"], |(t, v)| {
                let v = flu(v);
                let all = v[3..].iter().copied().chain(v[..3].iter().map(|w| w.to_degrees()));
                format!("{:.3}\t{}\t", (t + DATE) as f64 * 1e-6, cells(all).replace(',', "\t"))
            });
            imu_of(recorded, folder, &text, DATE)
        },
    },
];
