//! Random numbers for the tests of this crate.

use nalgebra::Vector3;

/// A seeded stream of uniform numbers (splitmix64), so that a test sees the same cases everywhere.
pub(crate) struct Uniform(u64);

impl Uniform {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `-bound..bound`.
    pub(crate) fn within(&mut self, bound: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        bound * ((z >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    }

    /// A vector whose components are uniform in `-bound..bound`.
    pub(crate) fn vector(&mut self, bound: f64) -> Vector3<f64> {
        Vector3::new(self.within(bound), self.within(bound), self.within(bound))
    }
}
