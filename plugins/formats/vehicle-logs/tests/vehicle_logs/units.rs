//! Logs of the inertial units of SBG, VectorNav and MicroStrain, written from the descriptions of their
//! makers.

use super::floats;
use navfuse_core::units::calendar::WEEK;

/// GPS week and second of the week at which the logs begin.
pub const WEEKS: u16 = 2212;
const SECONDS: f64 = 336_000.0;

/// A CRC-16, bit by bit: the polynomial 0x1021 from either end.
fn crc16(bytes: &[u8], reflected: bool) -> u16 {
    bytes.iter().fold(0_u16, |crc, byte| match reflected {
        true => {
            (0..8).fold(
                crc ^ u16::from(*byte),
                |c, _| {
                    if c & 1 == 1 { (c >> 1) ^ 0x8408 } else { c >> 1 }
                },
            )
        }
        false => (0..8).fold(crc ^ u16::from(*byte) << 8, |c, _| {
            if c >> 15 == 1 { (c << 1) ^ 0x1021 } else { c << 1 }
        }),
    })
}

/// A log of SBG.
pub fn sbg_log(id: u8, class: u8, payload: &[u8]) -> Vec<u8> {
    let mut checked = vec![id, class];
    checked.extend((payload.len() as u16).to_le_bytes());
    checked.extend(payload);
    let crc = crc16(&checked, true);
    [&[0xff, 0x5a][..], &checked, &crc.to_le_bytes(), &[0x33]].concat()
}

/// A unit of SBG with IMU_SHORT at 50 Hz; position and velocity of a receiver, velocity log, depth and
/// solution at 5 Hz. The 32 bits of the time begin anew after half a second, and the receiver has no
/// fix in the first second.
pub fn sbg(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..50 * seconds {
        let time = (u32::MAX - 500_000).wrapping_add(20_000 * k).to_le_bytes();
        // the large range of the gyros in every other log
        let (status, gyro) =
            if k % 2 == 0 { (0x3ff_u16, 67_108_864.0) } else { (0x7ff, 12_304_174.0) };
        let mut imu = time.to_vec();
        imu.extend(status.to_le_bytes());
        for value in [0.05, 0.5, -9.8].map(|a| a * 1_048_576.0) {
            imu.extend((value as i32).to_le_bytes());
        }
        for value in [0.001, -0.002, 0.1].map(|w| w * gyro) {
            imu.extend((value as i32).to_le_bytes());
        }
        imu.extend(6400_i16.to_le_bytes());
        log.extend(sbg_log(44, 0, &imu));
        if k % 10 > 0 {
            continue;
        }
        let status = if k < 50 { 1_u32 } else { 2 << 6 };
        let second = (336_000_000 + 20 * k).to_le_bytes();
        let mut position = [&time[..], &status.to_le_bytes(), &second].concat();
        position.extend(doubles(&[47.4 + 1e-6 * f64::from(k), 8.5, 402.25]));
        position.extend(floats(&[48.0, 0.8, 0.8, 1.2]));
        position.extend([12, 0xff, 0xff, 0xff, 0xff]);
        log.extend(sbg_log(14, 0, &position));
        let mut velocity = [&time[..], &status.to_le_bytes(), &second].concat();
        velocity.extend(floats(&[5.0, 0.5, -0.1, 0.3, 0.3, 0.5, 5.7, 1.0]));
        log.extend(sbg_log(13, 0, &velocity));
        let mut euler = time.to_vec();
        euler.extend(floats(&[0.02, -0.03, 1.5, 0.01, 0.01, 0.02]));
        euler.extend(0xf4_u32.to_le_bytes());
        log.extend(sbg_log(6, 0, &euler));
        let mut nav = time.to_vec();
        nav.extend(floats(&[5.0, 0.5, -0.1, 0.1, 0.1, 0.1]));
        nav.extend(doubles(&[47.4, 8.5, 402.0]));
        nav.extend(floats(&[48.25, 0.5, 0.5, 0.8]));
        nav.extend(0xf4_u32.to_le_bytes());
        log.extend(sbg_log(8, 0, &nav));
        let mut track = time.to_vec();
        track.extend(u16::from(k % 20 == 0).to_le_bytes());
        track.extend(floats(&[1.5, -0.1, 0.02, 0.01, 0.01, 0.01]));
        log.extend(sbg_log(29, 0, &track));
        let mut depth = time.to_vec();
        depth.extend(6_u16.to_le_bytes());
        depth.extend(floats(&[221_000.0, -12.5]));
        log.extend(sbg_log(47, 0, &depth));
        // a page of a long message, and a log of another class
        log.extend(sbg_log(55, 0x80, &[1, 0, 0, 2, 0, b'{', b'}']));
        log.extend(sbg_log(0, 1, &[0; 18]));
    }
    log
}

/// A binary message of VectorNav: groups with their outputs and values.
pub fn vectornav_message(groups: &[(u8, u16)], values: &[u8]) -> Vec<u8> {
    let mask = groups.iter().fold(0, |mask, (group, _)| mask | 1 << group);
    let mut bytes = vec![0xfa, mask];
    groups.iter().for_each(|(_, outputs)| bytes.extend(outputs.to_le_bytes()));
    bytes.extend(values);
    let crc = crc16(&bytes[1..], false);
    bytes.extend(crc.to_be_bytes());
    bytes
}

/// A unit of VectorNav with rates and forces at 100 Hz; a receiver and a solution in each tenth message,
/// of which the receiver measures in every second one. There is no fix in the first second.
pub fn vectornav_binary(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..100 * seconds {
        let started = 2_000_000_000 + 10_000_000 * u64::from(k);
        let gps = u64::from(WEEKS) * WEEK as u64 + 336_000_000_000_000 + 10_000_000 * u64::from(k);
        let mut times = started.to_le_bytes().to_vec();
        times.extend(gps.to_le_bytes());
        let mut imu = times.clone();
        imu.extend(floats(&[0.05, 0.5, -9.81, 0.001, -0.002, 0.1]));
        imu.extend(floats(&[0.2, 0.0, 0.4, 21.5, 101.3]));
        // common: both times, IMU, magnetic field and pressure
        log.extend(vectornav_message(&[(0, 1 | 2 | 1 << 9 | 1 << 10)], &imu));
        if k % 10 > 0 {
            continue;
        }
        // 30 ms before the message
        let fix =
            (336_000_000_000_000 + 10_000_000 * u64::from(k / 20 * 20)).wrapping_sub(30_000_000);
        let mut values = times.clone();
        values.extend(fix.to_le_bytes());
        values.extend(WEEKS.to_le_bytes());
        values.extend([12, if k < 100 { 0 } else { 3 }]);
        values.extend(doubles(&[47.4, 8.5, 450.25]));
        values.extend(floats(&[5.0, 0.5, -0.1, 0.8, 0.8, 1.2, 0.3]));
        // a list of two satellites
        values.extend([2, 0]);
        values.extend([7; 16]);
        let receiver = 0b110 | 1 << 3 | 1 << 4 | 1 << 5 | 1 << 7 | 1 << 9 | 1 << 10 | 1 << 14;
        log.extend(vectornav_message(&[(0, 3), (3, receiver)], &values));
        let mut values = times.clone();
        values.extend(floats(&[90.0, -2.5, 1.5]));
        values.extend(6_u16.to_le_bytes());
        values.extend(doubles(&[47.4, 8.5, 450.0]));
        values.extend(floats(&[5.0, 0.5, -0.1]));
        // attitude: yaw, pitch, roll; solution: status, position, velocity
        log.extend(vectornav_message(&[(0, 3), (4, 1 << 1), (5, 1 | 1 << 1 | 1 << 4)], &values));
    }
    log
}

/// A packet of MicroStrain: fields with their descriptors.
pub fn mip_packet(set: u8, fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut payload = Vec::new();
    for (descriptor, data) in fields {
        payload.extend([data.len() as u8 + 2, *descriptor]);
        payload.extend(data);
    }
    let mut bytes = vec![0x75, 0x65, set, payload.len() as u8];
    bytes.extend(payload);
    let (mut a, mut b) = (0_u8, 0_u8);
    for byte in &bytes {
        a = a.wrapping_add(*byte);
        b = b.wrapping_add(a);
    }
    bytes.extend([a, b]);
    bytes
}

/// Little-endian bytes of numbers of eight bytes.
fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Big-endian bytes of numbers.
fn big(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

fn big_doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_be_bytes()).collect()
}

/// The field of a GPS time, with flags.
fn gps_field(descriptor: u8, seconds: f64, flags: u16) -> (u8, Vec<u8>) {
    let mut data = big_doubles(&[seconds]);
    data.extend(WEEKS.to_be_bytes());
    data.extend(flags.to_be_bytes());
    (descriptor, data)
}

/// A unit of MicroStrain with rates and forces, or increments, at 50 Hz, and a receiver and its own
/// filter at 5 Hz; the time is valid from the second second on, as is the fix.
pub fn mip(seconds: u32, increments: bool) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..50 * seconds {
        let (time, valid) = (SECONDS + 0.02 * f64::from(k), u16::from(k >= 50));
        let inertial = match increments {
            false => [(0x04, big(&[0.01, 0.05, -1.0])), (0x05, big(&[0.001, -0.002, 0.1]))],
            true => [(0x07, big(&[2e-5, -4e-5, 2e-3])), (0x08, big(&[2e-4, 1e-3, -0.02]))],
        };
        let fields = [&inertial[..], &[gps_field(0x12, time, 7 * valid)]].concat();
        log.extend(mip_packet(0x80, &fields));
        if k % 10 > 0 {
            continue;
        }
        let mut position = big_doubles(&[47.4, 8.5, 450.25, 402.25]);
        position.extend(big(&[0.8, 1.2]));
        position.extend((0x1f * valid).to_be_bytes());
        let mut velocity = big(&[5.0, 0.5, -0.1, 5.03, 5.02, 5.7, 0.3, 1.0]);
        velocity.extend((0x3f * valid).to_be_bytes());
        let fix = vec![if k < 50 { 3 } else { 6 }, 12, 0, 0, 0, 7];
        let fields =
            [(0x03, position), (0x05, velocity), (0x0b, fix), gps_field(0x09, time, 3 * valid)];
        log.extend(mip_packet(0x91, &fields));
        let flagged = |mut data: Vec<u8>| {
            data.extend(valid.to_be_bytes());
            data
        };
        let fields = [
            (0x01, flagged(big_doubles(&[47.4, 8.5, 450.0]))),
            (0x02, flagged(big(&[5.0, 0.5, -0.1]))),
            (0x05, flagged(big(&[0.02, -0.03, 1.5]))),
            gps_field(0x11, time, valid),
        ];
        log.extend(mip_packet(0x82, &fields));
    }
    log
}

/// Fingerprints that `lcm-gen --python` writes for the types of [`lcm`].
pub const LCM_IMU: u64 = 0x1002_952a_f10a_2dae;
pub const LCM_DEPTH: u64 = 0xabd2_fe1a_b850_8f40;
/// Time of the first message of LCM, and the delay of its reception, us.
pub const LCM_FIRST: i64 = 1_700_000_000_000_000;
const LCM_DELAY: i64 = 2000;

/// An event of LCM.
pub fn lcm_event(number: i64, micros: i64, channel: &str, data: &[u8]) -> Vec<u8> {
    let mut event = vec![0xed, 0xa1, 0xda, 0x01];
    event.extend(number.to_be_bytes());
    event.extend(micros.to_be_bytes());
    event.extend((channel.len() as i32).to_be_bytes());
    event.extend((data.len() as i32).to_be_bytes());
    event.extend(channel.as_bytes());
    event.extend(data);
    event
}

/// An inertial unit at 50 Hz and a depth at 10 Hz.
pub fn lcm(count: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..count {
        let micros = LCM_FIRST + i64::from(k) * 20_000;
        let mut data = LCM_IMU.to_be_bytes().to_vec();
        data.extend(micros.to_be_bytes());
        data.extend([0.25_f32, -0.5, 0.125].iter().flat_map(|v| v.to_be_bytes()));
        data.extend([0.1_f64, -0.2, -9.8].iter().flat_map(|v| v.to_be_bytes()));
        let extra = k as usize % 3;
        data.push(extra as u8);
        data.extend(vec![7; extra]);
        log.extend(lcm_event(i64::from(k), micros + LCM_DELAY, "IMU", &data));
        if k.is_multiple_of(5) {
            let mut data = LCM_DEPTH.to_be_bytes().to_vec();
            data.extend(micros.to_be_bytes());
            data.extend((10.0 + k as f32).to_be_bytes());
            data.extend(2_i32.to_be_bytes());
            data.extend(b"m\0");
            log.extend(lcm_event(i64::from(k), micros + LCM_DELAY, "DEPTH", &data));
        }
    }
    log
}
