//! A log of DUNE, written from the public definitions of IMC.

/// Time of the first packet, s since 1970.
pub const FIRST: f64 = 1_700_000_000.25;
/// The vehicle, and another one whose packets it receives.
pub const VEHICLE: u16 = 0x0015;
pub const OTHER: u16 = 0x0016;

/// CRC-16-IBM, bit by bit.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0_u16, |crc, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte),
            |c, _| if c & 1 == 1 { (c >> 1) ^ 0xa001 } else { c >> 1 },
        )
    })
}

/// A packet of version 5.4.
pub fn packet(id: u16, time: f64, (system, entity): (u16, u8), fields: &[u8]) -> Vec<u8> {
    let mut packet = vec![0x54, 0xfe];
    packet.extend(id.to_le_bytes());
    packet.extend((fields.len() as u16).to_le_bytes());
    packet.extend(time.to_le_bytes());
    packet.extend(system.to_le_bytes());
    packet.push(entity);
    packet.extend([0xff, 0xff, 0xff]);
    packet.extend(fields);
    let sum = crc(&packet);
    packet.extend(sum.to_le_bytes());
    packet
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A fix, with what is valid of it.
pub fn fix(valid: u16, kind: u8) -> Vec<u8> {
    let mut fix = valid.to_le_bytes().to_vec();
    fix.push(kind);
    fix.extend(2023_u16.to_le_bytes());
    fix.extend([11, 14]);
    fix.extend(80_000.25_f32.to_le_bytes());
    fix.extend(doubles(&[0.7, -0.15]));
    fix.extend(52.5_f32.to_le_bytes());
    fix.push(11);
    // course east, speed; dilutions; accuracies
    fix.extend(super::floats(&[std::f32::consts::FRAC_PI_2, 1.5, 0.8, 1.2, 2.5, 4.0]));
    fix
}

/// Two inertial units at 50 Hz, a velocity log and a depth at 5 Hz, a receiver without a fix in the first half of a
/// second, the vehicle's own estimate, and that of another vehicle.
pub fn log(seconds: u32) -> Vec<u8> {
    let mut log = Vec::new();
    for k in 0..50 * seconds {
        let time = FIRST + 0.02 * f64::from(k);
        for entity in [30, 31] {
            let device = f64::from(k);
            let source = (VEHICLE, entity);
            log.extend(packet(256, time, source, &doubles(&[device, 0.001, -0.002, 0.1])));
            log.extend(packet(257, time, source, &doubles(&[device, 0.05, 0.5, -9.8])));
        }
        if k % 10 > 0 {
            continue;
        }
        let bottom = [&[if k == 10 { 3 } else { 7 }][..], &doubles(&[1.5, -0.1, 0.05])].concat();
        log.extend(packet(259, time, (VEHICLE, 40), &bottom));
        log.extend(packet(265, time, (VEHICLE, 41), &3.25_f32.to_le_bytes()));
        let valid = if k < 25 { 0x0003 } else { 0x007f };
        log.extend(packet(253, time, (VEHICLE, 42), &fix(valid, 1)));
        for (system, depth) in [(VEHICLE, 3.0), (OTHER, 9.0)] {
            let mut state = doubles(&[0.7, -0.15]);
            state.extend(super::floats(&[50.0, 100.0, -20.0, 3.0, 0.01, -0.02, 1.57]));
            state.extend(super::floats(&[
                1.5, 0.0, 0.0, 0.1, 1.4, 0.0, 0.001, -0.002, 0.1, depth, 8.0,
            ]));
            log.extend(packet(350, time, (system, 43), &state));
        }
    }
    log
}
