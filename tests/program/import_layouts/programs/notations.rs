//! Positions in notations that no heading names, several vectors of one meaning, and rates in rare units.

use super::*;

/// A recording whose IMU and fixes have forms of their own.
fn both(folder: &Path, imu: &str, fixes: &str, offset: i64) -> Written {
    Written { given: vec![put(folder, "imu.txt", imu), put(folder, "fixes.txt", fixes)], offset }
}

/// A latitude or longitude as ddmmss.s.
fn packed(radians: f64) -> String {
    let (d, m, s) = sexagesimal(radians);
    format!("{d}{m:02}{s:09.6}")
}

/// Longitude and latitude in degrees, and the height.
fn exchanged(v: &[f64]) -> String {
    format!("{:.9},{:.9},{:.3}", v[1].to_degrees(), v[0].to_degrees(), v[2])
}

/// Date and time with a zone and a decimal comma, as ISO 8601 permits it.
fn with_comma(nanos: i64) -> String {
    let local = nanos + 3_600_000_000_000;
    format!("{}T{}+01:00", day(local), clock(local).replace('.', ","))
}

/// The programs.
pub const PROGRAMS: [Program; 12] = [
    Program {
        name: "GrafNav, degrees, minutes and seconds under one heading",
        write: |recorded, folder| {
            let head = "Project: car\n\n GPSTime Latitude Longitude H-Ell Q VNorth VEast VUp\n  \
                        (sec) (+/-D M S) (+/-D M S) (m)  (m/s) (m/s) (m/s)";
            let fixes = table(head, &recorded["gnss"], |(t, v)| {
                let [(a, b, c), (d, e, f)] = [sexagesimal(v[0]), sexagesimal(v[1])];
                let place = format!("{a} {b:02} {c:08.5} {d} {e:02} {f:08.5} {:.3}", v[2]);
                let time = week(*t).1 as f64 * 1e-9;
                format!(" {time:.3} {place} 3 {:.3} {:.3} {:.3}", v[3], v[4], -v[5])
            });
            let offset = week(0).1;
            let imu = table("sow,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                format!("{},{}", seconds(t + offset), cells(v.iter().copied()))
            });
            both(folder, &imu, &fixes, offset)
        },
    },
    Program {
        name: "a solution of RTKLIB without titles",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let gps = t + DATE + LEAP;
                let stamp = format!("{} {}", day(gps).replace('-', "/"), clock(gps));
                format!("{stamp} {} {ACCURACY}\n", position(v).replace(',', " "))
            };
            let fixes: String = recorded["gnss"].iter().map(line).collect();
            let imu = plain_imu(recorded, DATE);
            both(folder, &imu, &fixes, DATE)
        },
    },
    Program {
        name: "latitude and longitude under each other's headings, beside the velocity",
        write: |recorded, folder| {
            let text = table("time,lat,lon,alt,vn,ve,vd", &recorded["gnss"], |(t, v)| {
                format!("{},{},{:.3},{:.3},{:.3}", seconds(*t), exchanged(v), v[3], v[4], v[5])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "minutes of an arc without a unit beside a speed",
        write: |recorded, folder| {
            let head = "time,latitude,longitude,height,velocity kmh,heading";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let ([speed, direction], time) = (course(v), seconds(*t));
                let [lat, lon] = [v[0], v[1]].map(|angle| angle.to_degrees() * 60.0);
                let place = format!("{lat:.7},{lon:.7},{:.3}", v[2]);
                format!("{time},{place},{:.3},{direction:.3}", 3.6 * speed)
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "ddmmss.s in one number, miles in an hour, and a heading that is a course",
        write: |recorded, folder| {
            let head = "time,lat,lon,alt (ft),Speed (mph),Heading";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let [speed, direction] = course(v);
                let place = format!("{},{},{:.3}", packed(v[0]), packed(v[1]), v[2] / 0.3048);
                format!("{},{place},{:.3},{direction:.3}", seconds(*t), speed / 0.44704)
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "dates with a decimal comma",
        write: |recorded, folder| {
            let imu = table("Zeit;gx;gy;gz;ax;ay;az", &recorded["imu"], |(t, v)| {
                format!("{};{}", with_comma(t + DATE), cells(v.iter().copied()).replace(',', ";"))
            });
            imu_of(recorded, folder, &imu, DATE)
        },
    },
    Program {
        name: "dates without headings",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let stamp = format!("{} {}", day(t + DATE), clock(t + DATE));
                format!("{stamp},{}\n", cells(v.iter().copied()))
            };
            let imu: String = recorded["imu"].iter().map(line).collect();
            imu_of(recorded, folder, &imu, DATE)
        },
    },
    Program {
        name: "rates in mrad/s beside forces in mg, without units",
        write: |recorded, folder| {
            let imu = table("time,gx,gy,gz,ax,ay,az", &recorded["imu"], |(t, v)| {
                let rates = cells(v[..3].iter().map(|w| 1e3 * w));
                let forces = cells(v[3..].iter().map(|f| 1e3 * f / GRAVITY));
                format!("{},{rates},{forces}", seconds(*t))
            });
            imu_of(recorded, folder, &imu, 0)
        },
    },
    Program {
        name: "accelerations without gravity beside gravity, as phones have them",
        write: |recorded, folder| {
            let head = "time,rotationRateX(rad/s),rotationRateY(rad/s),rotationRateZ(rad/s),\
                        userAccelerationX(G),userAccelerationY(G),userAccelerationZ(G),\
                        gravityX(G),gravityY(G),gravityZ(G)";
            let imu = table(head, &recorded["imu"], |(t, v)| {
                let w = phone(v);
                let gravity = [0.02, 0.01, -0.9997];
                let user = [0, 1, 2].map(|k| -w[3 + k] / GRAVITY - gravity[k]);
                format!(
                    "{},{},{},{}",
                    seconds(*t),
                    cells(w[..3].to_vec()),
                    cells(user),
                    cells(gravity)
                )
            });
            imu_of(recorded, folder, &imu, 0)
        },
    },
    Program {
        name: "accelerations without gravity beside load factors",
        write: |recorded, folder| {
            let head = "time,gFx,gFy,gFz,ax,ay,az,wx,wy,wz";
            let imu = table(head, &recorded["imu"], |(t, v)| {
                let w = phone(v);
                let loads = cells(w[3..].iter().map(|f| f / GRAVITY));
                let rest = cells([w[3], w[4], w[5] - GRAVITY]);
                format!("{},{loads},{rest},{}", seconds(*t), cells(w[..3].to_vec()))
            });
            imu_of(recorded, folder, &imu, 0)
        },
    },
    Program {
        name: "Chinese headings, and zeros behind the last row",
        write: |recorded, folder| {
            let head = "时间\t设备\t加速度X(g)\t加速度Y(g)\t加速度Z(g)\t角速度X(°/s)\t角速度Y(°/s)\t角速度Z(°/s)";
            let mut imu = table(head, &recorded["imu"], |(t, v)| {
                let loads = cells(v[3..].iter().map(|f| f / GRAVITY)).replace(',', "\t");
                let rates = cells(v[..3].iter().map(|w| w.to_degrees())).replace(',', "\t");
                format!("{} {}\tA1\t{loads}\t{rates}", day(t + DATE), clock(t + DATE))
            });
            imu.push_str(&"\0".repeat(4096));
            imu_of(recorded, folder, &imu, DATE)
        },
    },
    Program {
        name: "JSON with an array for each sensor",
        write: |recorded, folder| {
            let list = |rows: &[Row], text: &dyn Fn(&[f64]) -> String| {
                let each = |(t, v): &Row| format!("{{\"t\": {}, {}}}", seconds(*t), text(v));
                rows.iter().map(each).collect::<Vec<_>>().join(",\n")
            };
            let imu = list(&recorded["imu"], &|v| {
                let [rates, forces] = [&v[..3], &v[3..]].map(|part| cells(part.iter().copied()));
                format!("\"gyro\": [{rates}], \"accel\": [{forces}]")
            });
            let fixes = list(&recorded["gnss"], &|v| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                format!("\"lat\": {lat:.9}, \"lon\": {lon:.9}, \"alt\": {:.3}", v[2])
            });
            let text =
                format!("{{\"device\": \"a\", \"imu\": [\n{imu}], \"gnss\": [\n{fixes}]}}\n");
            Written { given: vec![put(folder, "log.json", &text)], offset: 0 }
        },
    },
];
