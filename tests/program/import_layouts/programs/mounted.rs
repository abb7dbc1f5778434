//! Tables without headings, instruments at any angle, and a recording in several files.

use super::*;

/// The recording of an IMU with a roll and a yaw in its vehicle, deg.
pub fn at_an_angle(recorded: &Recorded, folder: &Path, angles: [f64; 2]) -> Vec<PathBuf> {
    let line = |(t, v): &Row| format!("{},{}", seconds(*t), cells(turned(v, angles)));
    let text = table("time,gx,gy,gz,ax,ay,az", &recorded["imu"], line);
    imu_of(recorded, folder, &text, 0).given
}

/// Two vectors along axes with a roll and a yaw in the vehicle, deg.
fn turned(v: &[f64], angles: [f64; 2]) -> [f64; 6] {
    let [(sr, cr), (sy, cy)] = angles.map(|angle| angle.to_radians().sin_cos());
    let turn = |[x, y, z]: [f64; 3]| {
        let [x, y] = [cy * x + sy * y, cy * y - sy * x];
        [x, cr * y + sr * z, cr * z - sr * y]
    };
    let ([a, b, c], [d, e, f]) = (turn([v[0], v[1], v[2]]), turn([v[3], v[4], v[5]]));
    [a, b, c, d, e, f]
}

/// Rows of the recording between two times, s.
fn between(rows: &[Row], [from, to]: [i64; 2]) -> Vec<Row> {
    let inside = |(t, _): &&Row| (from..to).contains(&(t / 1_000_000_000));
    rows.iter().filter(inside).cloned().collect()
}

/// The newest position in degrees at a time, longitude first.
fn longitude_first(v: &[f64]) -> String {
    format!("{:.9} {:.9} {:.3}", v[1].to_degrees(), v[0].to_degrees(), v[2])
}

/// The inertial unit without another file.
pub fn inertial_alone(recorded: &Recorded, folder: &Path) -> Vec<PathBuf> {
    vec![put(folder, "imu.csv", &plain_imu(recorded, 0))]
}

/// The recording with a table of positions alone.
pub fn positions_alone(recorded: &Recorded, folder: &Path) -> Vec<PathBuf> {
    let text = table("time,latitude,longitude,altitude", &recorded["gnss"], |(t, v)| {
        format!("{},{}", seconds(*t), position(v))
    });
    fixes_of(recorded, folder, &text, 0).given
}

/// The recording with a table of positions without headings, longitude first.
pub fn longitudes_first(recorded: &Recorded, folder: &Path) -> Vec<PathBuf> {
    let line = |(t, v): &Row| format!("{} {}\n", seconds(*t), longitude_first(v));
    fixes_of(recorded, folder, &recorded["gnss"].iter().map(line).collect::<String>(), 0).given
}

/// The recording with positions in metres east, north and up of a point, deg and m.
pub fn from_a_point(
    recorded: &Recorded,
    folder: &Path,
    point: [f64; 3],
    (vertical, sign): (&str, f64),
) -> Vec<PathBuf> {
    let [latitude, longitude] = [point[0], point[1]].map(f64::to_radians);
    let origin = Geodetic { latitude, longitude, height: point[2] };
    let (sin, cos) = latitude.sin_cos();
    let (s, c) = longitude.sin_cos();
    let head = format!("time,east [m],north [m],{vertical}");
    let text = table(&head, &recorded["gnss"], |(t, v)| {
        let place = Geodetic { latitude: v[0], longitude: v[1], height: v[2] };
        let d = place.earth_fixed() - origin.earth_fixed();
        let east = c * d.y - s * d.x;
        let out = c * d.x + s * d.y;
        let [north, up] = [cos * d.z - sin * out, sin * d.z + cos * out];
        format!("{},{east:.4},{north:.4},{:.4}", seconds(*t), sign * up)
    });
    fixes_of(recorded, folder, &text, 0).given
}

/// The programs.
pub const PROGRAMS: [Program; 7] = [
    Program {
        name: "no headings, longitude before latitude",
        write: |recorded, folder| Written { given: longitudes_first(recorded, folder), offset: 0 },
    },
    Program {
        name: "no headings, longitude before latitude, with the velocity",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                format!(
                    "{} {} {:.3} {:.3} {:.3}\n",
                    seconds(*t),
                    longitude_first(v),
                    v[3],
                    v[4],
                    v[5]
                )
            };
            let text: String = recorded["gnss"].iter().map(line).collect();
            fixes_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "no headings, a quaternion before rates and forces",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let half = 0.15 + 1e-10 * *t as f64;
                let q = [half.cos(), 0.01 * half.sin(), 0.0, half.sin()];
                format!("{},{},{}\n", seconds(*t), cells(q), cells(v.iter().copied()))
            };
            let text: String = recorded["imu"].iter().map(line).collect();
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "no headings, slow angles in radians before rates and forces",
        write: |recorded, folder| {
            let line = |(t, v): &Row| {
                let s = 1e-9 * *t as f64;
                let angles = [0.02 + 1e-4 * s, -0.01, 1.2 + 1e-3 * s];
                format!("{},{},{}\n", seconds(*t), cells(angles), cells(v.iter().copied()))
            };
            let text: String = recorded["imu"].iter().map(line).collect();
            imu_of(recorded, folder, &text, 0)
        },
    },
    Program {
        name: "the velocity of the receiver in a table of its own, upwards",
        write: |recorded, folder| {
            let place = table("time,latitude,longitude,altitude", &recorded["gnss"], |(t, v)| {
                format!("{},{}", seconds(*t), position(v))
            });
            let velocity = table("time,vel_east,vel_north,vel_up", &recorded["gnss"], |(t, v)| {
                format!("{},{:.3},{:.3},{:.3}", seconds(*t), v[4], v[3], -v[5])
            });
            let mut written = fixes_of(recorded, folder, &place, 0);
            written.given.push(put(folder, "velocity.csv", &velocity));
            written
        },
    },
    Program {
        name: "split by time into three files, in any order",
        write: |recorded, folder| {
            let mut given = Vec::new();
            for (name, span) in [("b", [20, 40]), ("a", [0, 20]), ("c", [40, 99])] {
                let parts = ["imu", "gnss"].map(|s| (s.to_owned(), between(&recorded[s], span)));
                let part: Recorded = parts.into_iter().collect();
                given.push(put(folder, &format!("imu_{name}.csv"), &plain_imu(&part, 0)));
                given.push(put(folder, &format!("gnss_{name}.csv"), &plain_gnss(&part, 0)));
            }
            Written { given, offset: 0 }
        },
    },
    Program {
        name: "heights above the geoid with its height",
        write: |recorded, folder| {
            let head = "time,lat,lon,alt_msl,geoid_separation,satellites";
            let text = table(head, &recorded["gnss"], |(t, v)| {
                let [lat, lon] = [v[0], v[1]].map(f64::to_degrees);
                format!("{},{lat:.9},{lon:.9},{:.3},48.25,12", seconds(*t), v[2] - 48.25)
            });
            fixes_of(recorded, folder, &text, 0)
        },
    },
];
