//! Damage of files, as cables, disks and people cause it. A seed gives the same damage in each run.

/// Number of damaged files: that of the variable `NAVFUSE_MUTATIONS`, or else `usual`.
pub fn files(usual: u64) -> u64 {
    std::env::var("NAVFUSE_MUTATIONS").map_or(usual, |number| number.parse().unwrap())
}

/// Numbers that look random, the same in each run (SplitMix64).
#[derive(Debug)]
pub struct Random(pub u64);

impl Random {
    /// A number below a limit; zero for the limit zero.
    pub fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit.max(1) as u64) as usize
    }

    fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.below(256) as u8).collect()
    }
}

/// Numbers at the limits of lengths and counts.
const LIMITS: [u64; 6] = [0, u64::MAX, 1 << 26, 1 << 40, 0x7fff_ffff, 255];

/// Damages a file by one to six changes: a byte or a bit, a number at a limit, a cut, a gap, a part
/// that is repeated elsewhere, a part of another file, noise.
pub fn damaged(file: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = file.to_vec();
    for _ in 0..=random.below(6) {
        let (at, length) = (random.below(bytes.len()), random.below(80));
        let end = (at + length).min(bytes.len());
        match random.below(8) {
            0 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b = random.below(256) as u8),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << random.below(8)),
            2 => {
                let limit = LIMITS[random.below(LIMITS.len())].to_le_bytes();
                bytes.iter_mut().skip(at).zip(limit).for_each(|(b, l)| *b = l);
            }
            3 => bytes.truncate(at),
            4 => drop(bytes.drain(at..end)),
            5 => {
                let part = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, part);
            }
            6 => {
                let from = random.below(other.len());
                let part = other[from..(from + length).min(other.len())].to_vec();
                bytes.splice(at..at, part);
            }
            _ => drop(bytes.splice(at..at, random.bytes(length))),
        }
    }
    bytes
}
