//! Logs of inertial units in binary form, with their receivers.

use super::*;

/// A CRC-16 with the polynomial 0x1021, bit by bit from either end.
fn crc16(bytes: &[u8], reflected: bool) -> u16 {
    let forward = |c: u16| if c >> 15 == 1 { (c << 1) ^ 0x1021 } else { c << 1 };
    let backward = |c: u16| if c & 1 == 1 { (c >> 1) ^ 0x8408 } else { c >> 1 };
    bytes.iter().fold(0, |crc, byte| match reflected {
        true => (0..8).fold(crc ^ u16::from(*byte), |c, _| backward(c)),
        false => (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| forward(c)),
    })
}

fn sbg(id: u8, payload: &[u8]) -> Vec<u8> {
    let checked = [&[id, 0][..], &(payload.len() as u16).to_le_bytes(), payload].concat();
    [&[0xff, 0x5a][..], &checked, &crc16(&checked, true).to_le_bytes(), &[0x33]].concat()
}

fn vectornav(groups: u8, outputs: &[u16], values: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0xfa, groups];
    outputs.iter().for_each(|outputs| bytes.extend(outputs.to_le_bytes()));
    bytes.extend(values);
    let crc = crc16(&bytes[1..], false);
    bytes.extend(crc.to_be_bytes());
    bytes
}

fn mip(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let field = |(name, data): &(u8, Vec<u8>)| [&[data.len() as u8 + 2, *name][..], data].concat();
    let payload = fields.iter().flat_map(field).collect::<Vec<u8>>();
    let mut bytes = [&[0x75, 0x65, set, payload.len() as u8][..], &payload].concat();
    let (mut a, mut b) = (0_u8, 0_u8);
    for byte in &bytes {
        a = a.wrapping_add(*byte);
        b = b.wrapping_add(a);
    }
    bytes.extend([a, b]);
    bytes
}

fn little(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect()
}

fn big(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| (*v as f32).to_be_bytes()).collect()
}

/// Latitude and longitude in degrees, and the height.
fn place(v: &[f64]) -> [f64; 3] {
    [v[0].to_degrees(), v[1].to_degrees(), v[2]]
}

/// The messages of the IMU and of the receiver in the order of their times, in one file.
fn merged(
    recorded: &Recorded,
    folder: &Path,
    imu: impl Fn(&Row) -> Vec<u8>,
    fix: impl Fn(&Row) -> Vec<u8>,
) -> Vec<PathBuf> {
    let mut messages: Vec<(i64, Vec<u8>)> =
        recorded["imu"].iter().map(|row| (row.0, imu(row))).collect();
    messages.extend(recorded["gnss"].iter().map(|row| (row.0, fix(row))));
    messages.sort_by_key(|(time, _)| *time);
    let bytes = messages.into_iter().flat_map(|(_, bytes)| bytes).collect::<Vec<u8>>();
    let path = folder.join("unit.bin");
    std::fs::write(&path, bytes).expect("the test can write");
    vec![path]
}

/// Seconds of the week and the week of GPS.
fn gps(nanos: i64) -> (f64, u16) {
    let (week, rest) = week(nanos);
    (rest as f64 * 1e-9, week as u16)
}

/// The programs.
pub const PROGRAMS: [Program; 3] = [
    Program {
        name: "SBG ECom",
        write: |recorded, folder| {
            let micros = |t: &i64| ((t / 1000) as u32).to_le_bytes();
            let imu = |(t, v): &Row| {
                let counts = |v: &f64, unit: f64| ((v * unit).round() as i32).to_le_bytes();
                let forces = v[3..].iter().flat_map(|f| counts(f, 1_048_576.0));
                let rates = v[..3].iter().flat_map(|w| counts(w, 67_108_864.0));
                let head = [&micros(t)[..], &[0xff, 0x03]].concat();
                let payload: Vec<u8> =
                    head.into_iter().chain(forces).chain(rates).chain([0, 25]).collect();
                sbg(44, &payload)
            };
            let fix = |(t, v): &Row| {
                // a single solution of a position, and of a velocity by Doppler
                let head =
                    |kind: u32| [&micros(t)[..], &(kind << 6).to_le_bytes(), &[0; 4]].concat();
                let [lat, lon, height] = place(v);
                let mut position = head(2);
                [lat, lon, height - 48.25].iter().for_each(|v| position.extend(v.to_le_bytes()));
                position.extend(little(&[48.25, 1.5, 1.5, 2.5]));
                let velocity = [head(2), little(&[v[3], v[4], v[5], 0.1, 0.1, 0.1, 0.0, 0.0])];
                [sbg(14, &position), sbg(13, &velocity.concat())].concat()
            };
            Written { given: merged(recorded, folder, imu, fix), offset: 0 }
        },
    },
    Program {
        name: "VectorNav in binary form",
        write: |recorded, folder| {
            let started = |t: &i64| (*t as u64).to_le_bytes().to_vec();
            // the time since the start, and the IMU
            let imu = |(t, v): &Row| {
                let turned = [v[3], v[4], v[5], v[0], v[1], v[2]];
                vectornav(1, &[1 | 1 << 9], &[started(t), little(&turned)].concat())
            };
            let fix = |(t, v): &Row| {
                let mut values = [started(t), vec![3]].concat();
                place(v).iter().for_each(|v| values.extend(v.to_le_bytes()));
                values.extend(little(&[v[3], v[4], v[5], 1.5, 1.5, 2.5, 0.1]));
                // the type of the fix, position, velocity and their accuracies
                vectornav(9, &[1, 1 << 4 | 1 << 5 | 1 << 7 | 1 << 9 | 1 << 10], &values)
            };
            Written { given: merged(recorded, folder, imu, fix), offset: 0 }
        },
    },
    Program {
        name: "MicroStrain MIP",
        write: |recorded, folder| {
            let time = |t: &i64, name: u8, flags: u16| {
                let (seconds, week) = gps(*t);
                let data = [&seconds.to_be_bytes()[..], &week.to_be_bytes(), &flags.to_be_bytes()];
                (name, data.concat())
            };
            let imu = |(t, v): &Row| {
                let forces: Vec<f64> = v[3..].iter().map(|f| f / GRAVITY).collect();
                mip(0x80, &[(4, big(&forces)), (5, big(&v[..3])), time(t, 0x12, 7)])
            };
            let fix = |(t, v): &Row| {
                let mut position = Vec::new();
                place(v).iter().for_each(|v| position.extend(v.to_be_bytes()));
                position.extend(v[2].to_be_bytes());
                position.extend([big(&[1.5, 2.5]), vec![0, 0x1f]].concat());
                let velocity = [v[3], v[4], v[5], 0.0, 0.0, 0.0, 0.1, 0.0];
                let velocity = [big(&velocity), vec![0, 0x3f]].concat();
                mip(0x81, &[(3, position), (5, velocity), time(t, 9, 3)])
            };
            Written { given: merged(recorded, folder, imu, fix), offset: DATE }
        },
    },
];
