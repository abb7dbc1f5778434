//! Checksums of binary formats.

/// The table of a CRC-16 with the polynomial 0x1021: byte by byte, the upper bit first.
const FORWARD: [u16; 256] = {
    let (mut table, mut k) = ([0; 256], 0);
    while k < 256 {
        let (mut crc, mut bit) = ((k as u16) << 8, 0);
        while bit < 8 {
            crc = if crc & 0x8000 == 0 { crc << 1 } else { (crc << 1) ^ 0x1021 };
            bit += 1;
        }
        table[k] = crc;
        k += 1;
    }
    table
};

/// The same polynomial, and 0x8005, with the lower bit first.
const REFLECTED: [u16; 256] = reflected(0x8408);
const IBM: [u16; 256] = reflected(0xa001);

const fn reflected(polynomial: u16) -> [u16; 256] {
    let (mut table, mut k) = ([0; 256], 0);
    while k < 256 {
        let (mut crc, mut bit) = (k as u16, 0);
        while bit < 8 {
            crc = if crc & 1 == 0 { crc >> 1 } else { (crc >> 1) ^ polynomial };
            bit += 1;
        }
        table[k] = crc;
        k += 1;
    }
    table
}

/// The CRC-16 of Septentrio and VectorNav: start 0, not reflected.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, b| (crc << 8) ^ FORWARD[usize::from((crc >> 8) as u8 ^ b)])
}

/// The CRC-16 of SBG: start 0, reflected.
pub fn crc16_reflected(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, b| (crc >> 8) ^ REFLECTED[usize::from(crc as u8 ^ b)])
}

/// The CRC-16 of IBM, which IMC uses: start 0, reflected.
pub fn crc16_ibm(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, b| (crc >> 8) ^ IBM[usize::from(crc as u8 ^ b)])
}

/// The two sums of Fletcher, modulo 256, of u-blox and MicroStrain.
pub fn fletcher(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b]: [u8; 2], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksums_have_their_published_check_values() {
        // CRC-16/XMODEM, CRC-16/KERMIT and CRC-16/ARC of the catalogue of Greg Cook
        assert_eq!(crc16(b"123456789"), 0x31c3);
        assert_eq!(crc16_reflected(b"123456789"), 0x2189);
        assert_eq!(crc16_ibm(b"123456789"), 0xbb3d);
        // sums of 1, 2: 1 + 2 = 3, and 1 + 3 = 4
        assert_eq!(fletcher(&[1, 2]), [3, 4]);
    }
}
