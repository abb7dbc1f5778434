//! Rows that name their values, and headings that only their units or numbers explain.

use super::*;

/// The programs.
pub const PROGRAMS: [Program; 5] = [
    Program {
        name: "JSON, an object in each line, of several kinds",
        write: |recorded, folder| {
            let imu = recorded["imu"].iter().map(|(t, v)| {
                let (w, f) = (cells(v[..3].to_vec()), cells(v[3..].to_vec()));
                let time = seconds(*t);
                (
                    *t,
                    format!(
                        "{{\"topic\": \"imu\", \"t\": {time}, \"gyro\": [{w}], \"acc\": [{f}]}}\n"
                    ),
                )
            });
            let fixes = recorded["gnss"].iter().map(|(t, v)| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                let (time, height) = (seconds(*t), v[2]);
                let place = format!("\"lat\": {lat:.9}, \"lon\": {lon:.9}, \"alt\": {height:.3}");
                (*t, format!("{{\"topic\": \"gps\", \"t\": {time}, \"pos\": {{{place}}}}}\n"))
            });
            let mut lines: Vec<(i64, String)> = imu.chain(fixes).collect();
            lines.sort_by_key(|(t, _)| *t);
            let text: String = lines.into_iter().map(|(_, line)| line).collect();
            Written { given: vec![put(folder, "log.jsonl", &text)], offset: 0 }
        },
    },
    Program {
        name: "lines with names, as mavlogdump.py writes them",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let [a, b, c, d, e, f] = [0, 1, 2, 3, 4, 5].map(|k| v[k]);
                let stamp = clock(t + DATE);
                format!(
                    "2023-11-14 {stamp}: IMU {{TimeUS : {}, GyrX : {a}, GyrY : {b}, GyrZ : {c}, \
                     AccX : {d}, AccY : {e}, AccZ : {f}, T : 35.0}}\n",
                    t / 1000
                )
            };
            let text: String = recorded["imu"].iter().map(line).collect();
            imu_of(recorded, folder, &text, DATE)
        },
    },
    Program {
        name: "Xsens MT Manager, tabs with empty cells between them",
        write: |recorded, folder| {
            let mut text = "// Update Rate: 100.0Hz\nPacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tLatitude\tLongitude\tAltitude\tStatus\n".to_owned();
            for (k, (t, v)) in recorded["imu"].iter().enumerate() {
                let fix = new_fix(recorded, t - 10_000_000, *t);
                let fix = fix.map_or(",,".to_owned(), |(_, g)| position(g));
                let v = flu(v);
                let all = cells(v[3..].iter().chain(&v[..3]).copied());
                text += &format!("{k},{},{all},{fix},0001\n", t / 100_000).replace(',', "\t");
            }
            Written { given: vec![put(folder, "MT.txt", &text)], offset: 0 }
        },
    },
    Program {
        name: "axes without a quantity, as MATLAB numbers them",
        write: |recorded, folder| {
            let text = table("Timestamp,X,Y,Z,X_1,Y_1,Z_1", &recorded["imu"], |(t, v)| {
                let (w, f) = (cells(v[..3].to_vec()), cells(v[3..].to_vec()));
                format!("{},{f},{w}", seconds(*t))
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "degrees, minutes and seconds in three columns",
        write: |recorded, folder| {
            let head = "time,lat_d,lat_m,lat_s,lon_d,lon_m,lon_s,height";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let ((a, b, c), (d, e, f)) = (sexagesimal(v[0]), sexagesimal(v[1]));
                format!("{},{a},{b},{c:.5},{d},{e},{f:.5},{:.3}", seconds(*t), v[2])
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
];
