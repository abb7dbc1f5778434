//! Sums over the samples of one channel: its mean, its noise, and its scatter from second to second.

/// Largest number of samples in a block by which the noise is measured, as a power of two.
const OCTAVES: usize = 6;
/// Least number of differences by which a length of blocks counts: their deviation is then known to
/// some 10 %.
const LEAST: f64 = 100.0;

/// Sums over one channel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    count: f64,
    pub mean: f64,
    last: Option<f64>,
    differences: f64,
    squares: f64,
    octaves: [Octave; OCTAVES],
    /// The block that is being summed: count and sum.
    block: [f64; 2],
    /// Welford sums of the means of the blocks: count, mean, squares.
    blocks: [f64; 3],
}

/// The means of blocks of one length, each from two of half of it.
#[derive(Clone, Copy, Debug, Default)]
struct Octave {
    /// The mean of the first half of a block.
    half: Option<f64>,
    /// The two means before, the older one first.
    before: [Option<f64>; 2],
    /// Number and sum of the squares of second differences.
    count: f64,
    squares: f64,
}

impl Octave {
    /// Takes the mean of a block, and returns that of two.
    fn take(&mut self, mean: f64) -> Option<f64> {
        if let [Some(a), Some(b)] = self.before {
            self.count += 1.0;
            self.squares += (a - 2.0 * b + mean).powi(2);
        }
        self.before = [self.before[1], Some(mean)];
        match self.half.take() {
            None => {
                self.half = Some(mean);
                None
            }
            Some(half) => Some(0.5 * (half + mean)),
        }
    }
}

impl Sums {
    pub fn is_empty(&self) -> bool {
        self.count == 0.0
    }

    pub fn add(&mut self, value: f64) {
        self.count += 1.0;
        self.mean += (value - self.mean) / self.count;
        if let Some(last) = self.last {
            self.differences += 1.0;
            self.squares += (value - last).powi(2);
        }
        self.last = Some(value);
        self.block[0] += 1.0;
        self.block[1] += value;
        let mut mean = Some(value);
        for octave in &mut self.octaves {
            mean = mean.and_then(|mean| octave.take(mean));
        }
    }

    pub fn end_block(&mut self) {
        let [count, sum] = std::mem::take(&mut self.block);
        if count > 0.0 {
            let (mean, [n, m, s]) = (sum / count, self.blocks);
            let (n, change) = (n + 1.0, mean - m);
            let m = m + change / n;
            self.blocks = [n, m, s + change * (mean - m)];
        }
    }

    /// The mean of the block that is being summed.
    pub fn block_mean(&self) -> Option<f64> {
        let [count, sum] = self.block;
        (count > 0.0).then(|| sum / count)
    }

    /// The standard deviation of differences of successive samples, divided by the square root of two.
    pub fn noise(&self) -> f64 {
        (0.5 * self.squares / self.differences.max(1.0)).sqrt()
    }

    /// The deviation of white noise that a sample may have at most. The mean of `m` samples of white
    /// noise `s` has the variance `s^2 / m`, and the second difference of three means six times as much
    /// (the Hadamard variance). The vibration of a vehicle adds to the short blocks, its motion to the
    /// long ones, so the least of all lengths is nearest to the noise.
    pub fn white(&self) -> f64 {
        let lengths = self.octaves.iter().enumerate();
        let sized = lengths.filter(|(k, octave)| *k == 0 || octave.count >= LEAST);
        let deviation = |(k, octave): (usize, &Octave)| {
            (octave.squares / octave.count / 6.0 * f64::from(1_u32 << k)).sqrt()
        };
        let least = sized.map(deviation).filter(|s| s.is_finite()).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { self.noise() }
    }

    /// The scatter of the means of the blocks.
    pub fn wander(&self) -> f64 {
        (self.blocks[2] / (self.blocks[0] - 1.0).max(1.0)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform noise of the deviation one, from a linear congruential generator.
    fn white() -> impl FnMut() -> f64 {
        let mut state = 7_u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12_f64.sqrt()
        }
    }

    fn of(samples: usize, mut value: impl FnMut(f64) -> f64) -> Sums {
        let mut sums = Sums::default();
        (0..samples).for_each(|k| sums.add(value(k as f64)));
        sums
    }

    /// The second differences of 20000 / 32 means have a deviation that is known to 1 in sqrt(2 * 625 / 3),
    /// about 5 %; the least of six lengths is below the true one by less than twice as much.
    #[test]
    fn white_noise_has_its_own_deviation() {
        let mut noise = white();
        let sums = of(20_000, |_| noise());
        assert!((0.9..1.02).contains(&sums.white()), "{}", sums.white());
    }

    /// A vibration at 0.37 of the rate of the samples, and a slow motion of a hundred times the noise, which
    /// changes by 0.04 in 32 samples twice over. The mean of `m` samples of the vibration is below `20 / m`, so
    /// that blocks of 32 have less than `2.5` of it, and `sqrt(32)` times that as a deviation of a sample.
    #[test]
    fn vibration_and_motion_add_little_to_the_noise() {
        let mut noise = white();
        let sums = of(100_000, |k| noise() + 20.0 * (2.325 * k).sin() + 100.0 * (1e-3 * k).sin());
        assert!(sums.noise() > 14.0, "{}", sums.noise());
        assert!((0.9..4.0).contains(&sums.white()), "{}", sums.white());
    }

    #[test]
    fn few_samples_have_the_noise_of_their_differences() {
        assert!((of(2, |k| k).white() - of(2, |k| k).noise()).abs() < 1e-15);
        assert!(of(1, |k| k).white().abs() < 1e-15);
    }
}
