//! Tables with more than rows, grouped digits, times of the day of twelve hours or in six digits, and units that the
//! positions alone show.

use super::*;

/// Both files with their times in a form of their own.
fn timed(
    recorded: &Recorded,
    folder: &Path,
    time: (&str, fn(i64) -> String),
    offset: i64,
) -> Written {
    let (name, of) = time;
    let imu = table(&format!("{name},gx,gy,gz,ax,ay,az"), &recorded["imu"], |(t, v)| {
        format!("{},{}", of(*t), cells(v.iter().copied()))
    });
    let fixes = table(&format!("{name},lat,lon,alt"), &recorded["gnss"], |(t, v)| {
        format!("{},{}", of(*t), position(v))
    });
    let given = [("imu.csv", imu), ("fixes.csv", fixes)];
    Written { given: given.map(|(name, text)| put(folder, name, &text)).to_vec(), offset }
}

/// The programs.
pub const PROGRAMS: [Program; 7] = [
    Program {
        name: "lines after the last row",
        write: |recorded, folder| {
            let text = plain_imu(recorded, 0) + "\nTotal samples;6000\nDuration: 60 s\nEOF\n";
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "quoted milliseconds in groups of three digits",
        write: |recorded, folder| {
            let grouped = |t: i64| {
                let millis = t / 1_000_000 + 1_234_000;
                let [a, b, c] = [millis / 1_000_000, millis / 1000 % 1000, millis % 1000];
                format!("\"{a},{b:03},{c:03}\"")
            };
            timed(recorded, folder, ("Time (ms)", grouped), 1_234_000_000_000)
        },
    },
    Program {
        name: "times of the day in six digits",
        write: |recorded, folder| {
            let day = DATE.rem_euclid(86_400_000_000_000);
            timed(recorded, folder, ("UTC", |t| clock(t + DATE).replace(':', "")), day)
        },
    },
    Program {
        name: "dates of twelve hours, month first",
        write: |recorded, folder| {
            let of = |t: i64| {
                let c = date(t + DATE);
                let (hour, half) = (c.hour % 12, if c.hour < 12 { "AM" } else { "PM" });
                let millis = c.nanos / 1_000_000;
                format!(
                    "{:02}/{:02}/{} {:02}:{:02}:{:02}.{millis:03} {half}",
                    c.month, c.day, c.year, hour, c.minute, c.second
                )
            };
            timed(recorded, folder, ("Timestamp", of), DATE)
        },
    },
    Program {
        name: "load factors in columns of a fixed width",
        write: |recorded, folder| {
            let [rates, loads] = [["P", "Q", "R"], ["NX", "NY", "NZ"]];
            let rates: String = rates.iter().map(|name| format!("{name:>14}")).collect();
            let loads: String = loads.iter().map(|name| format!("{name:>13}")).collect();
            let head = format!("{:>10}{rates}{loads}", "TIME");
            let text = table(&head, &recorded["imu"], |(t, v)| {
                let rates: String = v[..3].iter().map(|w| format!("{w:14.8}")).collect();
                let loads: String =
                    v[3..].iter().map(|f| format!("{:13.6}", f / GRAVITY)).collect();
                format!("{:10.3}{rates}{loads}", *t as f64 * 1e-9)
            });
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "positions in 1e-7 deg with velocities in mm/s, whose headings have no unit",
        write: |recorded, folder| {
            let text = table("time,lat,lon,alt,vn,ve,vd,eph", &recorded["gnss"], |(t, v)| {
                let place = [v[0].to_degrees() * 1e7, v[1].to_degrees() * 1e7, v[2] * 1e3];
                let rest = v[3..6].iter().map(|v| v * 1e3).chain([150.0]);
                let whole = place.into_iter().chain(rest).map(|x| format!("{x:.0}"));
                format!("{},{}", seconds(*t), whole.collect::<Vec<_>>().join(","))
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "coordinates and velocities of the Earth under X, Y and Z",
        write: |recorded, folder| {
            let text = table("time,X,Y,Z,VX,VY,VZ", &recorded["gnss"], |(t, v)| {
                let place = Geodetic { latitude: v[0], longitude: v[1], height: v[2] };
                let p = place.earth_fixed();
                let ([s, c], [sl, cl]) = ([v[0].sin(), v[0].cos()], [v[1].sin(), v[1].cos()]);
                let (north, east, down) = (v[3], v[4], v[5]);
                let out = -s * north - c * down;
                let velocity = [out * cl - east * sl, out * sl + east * cl, c * north - s * down];
                format!("{},{:.4},{:.4},{:.4},{}", seconds(*t), p.x, p.y, p.z, cells(velocity))
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
];
