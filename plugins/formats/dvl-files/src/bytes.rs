//! Little-endian numbers at an offset; `None` beyond the end.

fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// An unsigned byte.
pub fn u8_at(bytes: &[u8], at: usize) -> Option<u8> {
    bytes.get(at).copied()
}

/// An unsigned integer of two bytes.
pub fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    array(bytes, at).map(u16::from_le_bytes)
}

/// A signed integer of two bytes.
pub fn i16_at(bytes: &[u8], at: usize) -> Option<i16> {
    array(bytes, at).map(i16::from_le_bytes)
}

/// An unsigned integer of four bytes.
pub fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    array(bytes, at).map(u32::from_le_bytes)
}

/// A signed integer of four bytes.
pub fn i32_at(bytes: &[u8], at: usize) -> Option<i32> {
    array(bytes, at).map(i32::from_le_bytes)
}

/// A finite number of four bytes.
pub fn f32_at(bytes: &[u8], at: usize) -> Option<f64> {
    array(bytes, at).map(f32::from_le_bytes).filter(|x| x.is_finite()).map(f64::from)
}

/// The sum of all bytes modulo 65536, the checksum of Teledyne's binary formats.
pub fn sum(bytes: &[u8]) -> u16 {
    // chunks of 256 bytes cannot overflow 16 bits, so that the inner loop has no carry
    let chunk = |c: &[u8]| c.iter().fold(0_u16, |s, b| s.wrapping_add(u16::from(*b)));
    bytes.chunks(256).fold(0_u16, |s, c| s.wrapping_add(chunk(c)))
}
