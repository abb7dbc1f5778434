//! The outer form of messages of MAVLink.

/// First byte of a message of version 2.
const MARK: u8 = 0xfd;

/// The CRC-16 of MAVLink over the bytes between mark and checksum, and over the seed of the message's
/// type: polynomial 0x1021, reflected, start 0xffff.
pub fn checksum(bytes: &[u8], seed: u8) -> u16 {
    bytes.iter().chain([&seed]).fold(0xffff, |crc, byte| {
        let mut t = byte ^ crc.to_le_bytes()[0];
        t ^= t << 4;
        let t = u16::from(t);
        (crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4)
    })
}

/// A type of message that a program sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// Its identifier, below 65536.
    pub id: u16,
    /// The seed of its checksum.
    pub seed: u8,
}

/// The sender of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender {
    /// System and component.
    pub address: [u8; 2],
    /// Number of messages so far, modulo 256.
    pub sequence: u8,
}

impl Sender {
    /// Appends a message of version 2, whose payload of at most 255 bytes has its fields in the order of
    /// the wire. Zeros at the end of the payload are left out, as the version has it.
    pub fn write(&mut self, out: &mut Vec<u8>, kind: Kind, payload: &[u8]) {
        let size = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
        let start = out.len();
        let [system, component] = self.address;
        let [low, high] = kind.id.to_le_bytes();
        out.extend([MARK, size.to_le_bytes()[0], 0, 0, self.sequence, system, component]);
        out.extend([low, high, 0]);
        out.extend_from_slice(payload.get(..size).unwrap_or_default());
        let sum = checksum(&out[start + 1..], kind.seed);
        out.extend(sum.to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
    }
}
