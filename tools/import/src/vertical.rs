//! The third velocity of a log against the rate of a depth.

use crate::axes;

/// Number of pairs of samples, and the correlation, from which a log sinks or rises as the depth does; with
/// more pairs, the number of deviations of its chance value.
const CORRELATED: f64 = 0.6;
const EVIDENT: f64 = 4.0;
const LEAST: usize = 15;

/// The correlation of the third velocity of a log with the rate of a depth, whose rows have time and depth: below
/// zero for a log whose third axis points up; `None` where it may be chance. That of `n` independent pairs
/// without a correlation has a deviation of `1 / sqrt(n)`.
pub fn sinks(log: &[[f64; 4]], depth: &[[f64; 2]]) -> Option<f64> {
    let (mut count, mut sums) = (0, [0.0; 3]);
    for [a, b] in axes::pairs(depth) {
        let from = log.partition_point(|row| row[0] < a[0]);
        let to = log.partition_point(|row| row[0] <= b[0]);
        let Some(rows) = log.get(from..to).filter(|rows| !rows.is_empty()) else { continue };
        let mean = rows.iter().map(|row| row[3]).sum::<f64>() / rows.len() as f64;
        let rate = (b[1] - a[1]) / (b[0] - a[0]);
        count += 1;
        sums = [sums[0] + mean * rate, sums[1] + mean * mean, sums[2] + rate * rate];
    }
    let [product, own, other] = sums;
    let found =
        (count >= LEAST && own > 0.0 && other > 0.0).then(|| product / (own * other).sqrt());
    found.filter(|c| c.abs() > CORRELATED || c.abs() * (count as f64).sqrt() > EVIDENT)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::sinks;

    #[test]
    fn a_log_whose_third_axis_points_up_sinks_against_the_depth() {
        let rate = |t: f64| 0.3 * (0.1 * t).sin();
        let log = |sign: f64| -> Vec<[f64; 4]> {
            let row = |k| 0.2 * f64::from(k);
            (0..500).map(|k| [row(k), 1.0, 0.0, sign * rate(row(k))]).collect()
        };
        let depth: Vec<[f64; 2]> =
            (0..90).map(f64::from).map(|t| [t, 20.0 - 3.0 * (0.1 * t).cos()]).collect();
        assert!(sinks(&log(1.0), &depth).unwrap() > 0.99);
        assert!(sinks(&log(-1.0), &depth).unwrap() < -0.99);
        assert_eq!(sinks(&log(1.0), &depth[..5]), None);
    }
}
