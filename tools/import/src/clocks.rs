//! Clocks of two sensors, compared by the motion that both measure.
//!
//! The IMU gives the integrals of its angular rate and of its acceleration, the specific force with
//! gravity removed. Between two samples of a velocity log at `t1` and `t2` on a clock that is `tau`
//! behind that of the IMU,
//!
//! ```text
//! v(t2) - v(t1) + [theta(t2 - tau) - theta(t1 - tau)] x v  =  A(t2 - tau) - A(t1 - tau) + noise
//! ```
//!
//! Levelling by the specific force takes slow accelerations for gravity. The same filter acts on
//! the accelerations of the log, so that both sides lack the same. Between two headings, `psi(t2) -
//! psi(t1) = Y(t2 - tau) - Y(t1 - tau) + noise`. The offset `tau` has the least sum of squares of
//! the noise. Blocks of the recording show the drift.

mod inertial;
mod measured;
mod wide;

pub use inertial::Inertial;
pub use measured::Measured;
use measured::{APART, LEAST, MEAN, Pair};

/// Largest offset that is searched, s.
const LARGEST: f64 = 5.0;
/// Distance, s, to which an offset that was found is searched again.
const AROUND: f64 = 2.0;
/// Largest 1-sigma, s, of an offset that noisy positions show.
const SHARP: f64 = 0.2;
/// Step of the search, s, which is less than the time over which a vehicle changes its motion.
const STEP: f64 = 0.1;
/// Share of the residuals at other offsets that the least ones must not exceed: otherwise the
/// motion does not show the clock.
const SHARE: f64 = 0.5;
/// Shortest block by which the drift is found, s, and the largest number of blocks.
const BLOCK: f64 = 100.0;
const BLOCKS: usize = 8;
/// Differences of time scales since 2015, s: GPS time and TAI from UTC, before and after the leap
/// second of 2016, and 27 s where a program had an old table.
const LEAPS: [f64; 5] = [17.0, 18.0, 27.0, 36.0, 37.0];
/// Differences of clocks that count from other midnights, weeks, years or zones are multiples of this, s:
/// the offset of Nepal is a quarter of an hour.
const ZONE: f64 = 900.0;

/// Factor from the scatter of an offset that velocities show to the 1-sigma of its state: in dives of five minutes at
/// 1 to 2 m/s the offset is up to 2.5 of them off.
const SLOW_ERRORS: f64 = 5.0;
/// Offset, s, that matters, and the number of sigmas from which a drift is one.
const MATTERS: f64 = 0.02;
const CERTAIN: f64 = 3.0;

/// The clock of a sensor, compared with that of the IMU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockOffset {
    /// Seconds by which its stamps are late, at the middle of the recording, and the 1-sigma.
    pub offset: [f64; 2],
    /// Seconds per second by which the offset grows, and the 1-sigma; `None` for a short recording.
    pub drift: Option<[f64; 2]>,
    /// The two quantities that are compared.
    pub means: &'static str,
}

/// The least sum of squares over some samples: the offset and its 1-sigma.
struct Fit {
    offset: f64,
    sigma: f64,
}

/// Finds the offset by the samples of some pairs, between two offsets.
fn fit(
    imu: &Inertial,
    measured: &Measured,
    levelled: &[[f64; 3]],
    pairs: &[Pair],
    range: [f64; 2],
) -> Option<Fit> {
    // the same pairs at every offset, those inside the recording of the IMU at all of them
    let inside =
        |k: &&Pair| range.iter().all(|tau| measured.residual(imu, levelled, **k, *tau).is_some());
    let pairs: Vec<Pair> = pairs.iter().filter(inside).copied().collect();
    if pairs.len() < LEAST {
        return None;
    }
    // the mean is that of a bias and of errors of levelling
    let cost = |tau: f64| {
        let mut sums = [[0.0; 2]; 2];
        for r in pairs.iter().filter_map(|k| measured.residual(imu, levelled, *k, tau)) {
            for (sum, r) in sums.iter_mut().zip(r) {
                *sum = [sum[0] + r, sum[1] + r * r];
            }
        }
        let n = pairs.len() as f64;
        sums.iter().map(|[mean, square]| square - mean * mean / n).sum::<f64>()
    };
    let steps = ((range[1] - range[0]) / STEP).floor() as usize;
    let costs: Vec<f64> = (0..=steps).map(|k| cost(range[0] + k as f64 * STEP)).collect();
    let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    let mut sorted = costs.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    // at the end of the range the true offset may lie beyond
    if best == 0 || best == steps || costs[best] > SHARE * usual {
        return None;
    }
    // the minimum of a parabola through three offsets, once more around the first one
    let mut offset = range[0] + best as f64 * STEP;
    let mut curvature = 0.0;
    for _ in 0..2 {
        let [before, at, after] = [-STEP, 0.0, STEP].map(|d| cost(offset + d));
        curvature = (before - 2.0 * at + after) / (STEP * STEP);
        if curvature <= 0.0 {
            return None;
        }
        offset -= ((after - before) / (2.0 * STEP * curvature)).clamp(-STEP, STEP);
    }
    let rows = match measured {
        Measured::Velocity(_) => 2 * pairs.len(),
        Measured::Heading(_) | Measured::Ground(_) => pairs.len(),
    };
    // the sum of squares S has the second derivative 2 / sigma^2 of the offset, times the variance
    let variance = cost(offset) / rows as f64;
    Some(Fit { offset, sigma: (2.0 * variance / curvature).sqrt() })
}

/// Compares the clock of a sensor with that of the IMU; `None` if the motion does not show it.
pub fn compare(imu: &Inertial, measured: &Measured) -> Option<ClockOffset> {
    let spaced = measured.spaced();
    let smoothed = || {
        // of the differences of two means each, this number share some samples
        let compared = compare_apart(imu, &spaced.smoothed()?, MEAN)?;
        let compared = compared.scattered((2.0 * MEAN as f64).sqrt());
        Some(compared).filter(|clock| clock.offset[1] < SHARP)
    };
    // of the changes over so many intervals, each shares all but one with the next
    let apart = || Some(compare_apart(imu, &spaced, APART)?.scattered((2.0 * APART as f64).sqrt()));
    let velocity = matches!(spaced, Measured::Velocity(_));
    let others = || if velocity { apart() } else { smoothed() };
    compare_apart(imu, &spaced, 1).or_else(others)
}

/// Compares the clocks by samples that are some places apart.
fn compare_apart(imu: &Inertial, measured: &Measured, apart: usize) -> Option<ClockOffset> {
    let times = measured.times();
    let pairs = measured.pairs(apart);
    let levelled = |start: f64| measured.levelled(imu, start);
    let near = fit(imu, measured, &levelled(0.0), &pairs, [-LARGEST, LARGEST]);
    let (start, widths) = match near {
        Some(near) => (near.offset, None),
        None => (wide::search(imu, measured, apart)?, Some([LARGEST, AROUND])),
    };
    let levelled = levelled(start);
    let within = |[from, to]: [f64; 2]| fit(imu, measured, &levelled, &pairs, [from, to]);
    let around = |width: f64| within([start - width, start + width]);
    let all = match widths {
        None => within([-LARGEST, LARGEST])?,
        Some(widths) => widths.into_iter().find_map(around)?,
    };
    let (first, last) = (*times.first()?, *times.last()?);
    let count = (((last - first) / BLOCK) as usize).min(BLOCKS);
    let length = (last - first) / count.max(1) as f64;
    let mut blocks = Vec::new();
    for block in 0..count {
        let from = first + block as f64 * length;
        let within = |[k, _]: &&Pair| (from..from + length).contains(&times[*k]);
        let some: Vec<Pair> = pairs.iter().filter(within).copied().collect();
        // a drift of a percent would move the offset by more than this
        let range = [all.offset - AROUND, all.offset + AROUND];
        if let Some(one) = fit(imu, measured, &levelled, &some, range) {
            blocks.push((from + 0.5 * (length - (last - first)) - first, one));
        }
    }
    let means = measured.means();
    let Some((line, scatter)) = line(&blocks) else {
        return Some(ClockOffset { offset: [all.offset, all.sigma], drift: None, means });
    };
    // blocks that scatter beyond their sigmas have correlated noise
    let [offset, sigma, drift, drift_sigma] = line;
    Some(ClockOffset {
        offset: [offset, sigma * scatter],
        drift: Some([drift, drift_sigma * scatter]),
        means,
    })
}

/// The line through offsets of blocks: offset at time zero with its sigma, slope with its sigma,
/// and the factor, at least one, by which the blocks scatter beyond their sigmas.
fn line(blocks: &[(f64, Fit)]) -> Option<([f64; 4], f64)> {
    if blocks.len() < 3 {
        return None;
    }
    let mut sums = [0.0; 5];
    for (t, f) in blocks {
        let w = f.sigma.powi(-2);
        for (sum, term) in sums.iter_mut().zip([1.0, *t, t * t, f.offset, t * f.offset]) {
            *sum += w * term;
        }
    }
    let [n, t, tt, y, ty] = sums;
    let det = n * tt - t * t;
    if !(det > 0.0 && det.is_finite()) {
        return None;
    }
    let (offset, slope) = ((tt * y - t * ty) / det, (n * ty - t * y) / det);
    let square = |(at, f): &(f64, Fit)| ((f.offset - offset - slope * at) / f.sigma).powi(2);
    let chi = blocks.iter().map(square).sum::<f64>() / (blocks.len() - 2) as f64;
    Some(([offset, (tt / det).sqrt(), slope, (n / det).sqrt()], chi.sqrt().max(1.0)))
}

impl ClockOffset {
    /// The same with larger sigmas.
    fn scattered(self, factor: f64) -> Self {
        let larger = |[value, sigma]: [f64; 2]| [value, factor * sigma];
        Self { offset: larger(self.offset), drift: self.drift.map(larger), ..self }
    }

    /// Returns `true` if the offset is more than five times its uncertainty, and more than 20 ms.
    pub fn matters(&self) -> bool {
        let [offset, sigma] = self.offset;
        offset.abs() > (5.0 * sigma).max(MATTERS)
    }

    /// The shift of the stamps that corrects the offset: the difference of two time scales or zones
    /// where it is one.
    pub fn correction(&self) -> f64 {
        let [offset, sigma] = self.offset;
        let whole = (offset / ZONE).round() * ZONE;
        let near = |step: &f64| (offset - step).abs() < (3.0 * sigma).max(0.1);
        let leaps = LEAPS.iter().flat_map(|leap| [whole + leap, whole - leap]);
        // a clock that is right has no zone
        let steps = (whole != 0.0).then_some(whole).into_iter().chain(leaps);
        -steps.into_iter().find(near).unwrap_or(offset)
    }

    /// The key of the calibration state that follows the rest of the offset over a recording of so many
    /// seconds, if its stamps were `shifted`, or if its drift matters. A drift `d` moves the offset by `d T / 2`
    /// from the middle of a recording of the length `T` to its ends, and by `d T` in all, as a random walk of
    /// `d sqrt(T)` does.
    pub fn state(&self, span: f64, shifted: bool) -> Option<String> {
        let drift = self.drift.filter(|[d, s]| d.abs() > CERTAIN * s).map_or(0.0, |[d, _]| d.abs());
        let end = 0.5 * drift * span;
        if !shifted && end < MATTERS {
            return None;
        }
        // the slow errors of levelling move the offset of a velocity by more than its scatter
        let factor = if self.means == measured::OF_VELOCITY { SLOW_ERRORS } else { 2.0 };
        let sigma = (factor * self.offset[1]).hypot(2.0 * end).max(0.005);
        Some(match end < MATTERS {
            true => format!("time_offset = {{ sigma = \"{sigma:.3} s\" }}"),
            false => format!(
                "time_offset = {{ sigma = \"{sigma:.3} s\", random_walk = \"{:.2} ms/sqrt(s)\" }}",
                1e3 * drift * span.sqrt()
            ),
        })
    }

    /// Describes the clock in words.
    pub fn describe(&self) -> String {
        let [offset, sigma] = self.offset;
        let side = if offset < 0.0 { "ahead of" } else { "behind" };
        let mut text = format!(
            "its clock is {:.3} s {side} the clock of the IMU, sigma {sigma:.3} s",
            offset.abs()
        );
        if let Some([drift, sigma]) = self.drift.filter(|[d, s]| d.abs() > CERTAIN * s) {
            let [drift, sigma] = [drift, sigma].map(|x| x * 1e6);
            text.push_str(&format!(", with a drift of {drift:.0} ppm, sigma {sigma:.0} ppm"));
        }
        text.push_str(&format!(" (found by comparing {})", self.means));
        text
    }
}

#[cfg(test)]
mod tests;
