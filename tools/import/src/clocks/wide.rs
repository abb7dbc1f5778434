//! The search for an offset of any size.
//!
//! Where the recordings of two clocks overlap in part, the number of pairs differs from offset to
//! offset. The measure is therefore the share of both motions that their difference has: about one
//! where they are not related, and the share of the noise at the true offset.

use super::inertial::Inertial;
use super::measured::{LEAST, Measured, Pair};

/// Largest offset of recordings that have time in common, and the largest by which recordings that
/// have none may begin apart, s.
const LARGEST: f64 = 600.0;
const BETWEEN: f64 = 5000.0;
/// Step of the search, s.
const STEP: f64 = 0.2;
/// Number of comparisons of a pair, from which fewer samples are compared, and the numbers of samples.
const WORK: f64 = 4e6;
const SAMPLES: [usize; 2] = [400, 2000];
/// Share of the pairs inside the shorter recording that an offset must leave.
const OVERLAP: f64 = 0.4;
/// Largest share that is a match, and the ratio to the best share of another offset.
const MATCH: f64 = 0.4;
const CLEAR: f64 = 1.4;
/// Distance, s, within which two offsets are one.
const ONE: f64 = 2.0;

/// The variance of the differences over that of both changes.
fn share(
    imu: &Inertial,
    measured: &Measured,
    (pairs, least): (&[Pair], f64),
    tau: f64,
) -> Option<f64> {
    let levelled = measured.levelled(imu, tau);
    let (mut count, mut sums) = (0.0, [[0.0; 2]; 6]);
    for k in pairs {
        let Some([own, other]) = measured.changes(imu, &levelled, *k, tau) else { continue };
        let Some(residual) = measured.residual(imu, &levelled, *k, tau) else { continue };
        // a heading passes north; its own change is that of the IMU and the difference
        let own = match measured {
            Measured::Velocity(_) => own,
            _ => [other[0] + residual[0], 0.0],
        };
        count += 1.0;
        for (sum, x) in sums.iter_mut().zip([own, other, residual].concat()) {
            *sum = [sum[0] + x, sum[1] + x * x];
        }
    }
    let variance = |k: usize| sums[k][1] - sums[k][0] * sums[k][0] / count;
    let both = (0..4).map(variance).sum::<f64>();
    (count >= least && both > 0.0).then(|| (variance(4) + variance(5)) / both)
}

/// The offsets at which two recordings have time in common, by their begins and ends.
fn offsets([begin, end]: [f64; 2], [first, last]: [f64; 2]) -> impl Iterator<Item = f64> {
    let (least, most) = (first - end, last - begin);
    let shared = least < 0.0 && most > 0.0;
    let (centre, largest) = if shared { (0.0, LARGEST) } else { (first - begin, BETWEEN) };
    let steps =
        |limit: f64| ((limit - centre) / STEP).clamp(-largest / STEP, largest / STEP) as i32;
    (steps(least)..=steps(most)).map(move |k| centre + f64::from(k) * STEP)
}

/// The offset at which the motions match, if no other one does.
pub fn search(imu: &Inertial, measured: &Measured, apart: usize) -> Option<f64> {
    let times = measured.times();
    let (span, own) = (imu.span()?, [*times.first()?, *times.last()?]);
    let count = offsets(span, own).count().max(1);
    let measured = measured.thinned(((WORK / count as f64) as usize).clamp(SAMPLES[0], SAMPLES[1]));
    let some = measured.pairs(apart);
    let inside = ((span[1] - span[0]) / (own[1] - own[0])).min(1.0) * some.len() as f64;
    let least = (OVERLAP * inside).max(LEAST as f64);
    let share = |tau| Some((tau, share(imu, &measured, (&some, least), tau)?));
    let found: Vec<(f64, f64)> = offsets(span, own).filter_map(share).collect();
    let (tau, best) = *found.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let one = ONE * apart as f64;
    let others = found.iter().filter(|(other, _)| (other - tau).abs() > one);
    let next = others.map(|(_, share)| *share).fold(f64::INFINITY, f64::min);
    (best < MATCH && next.is_finite() && next > CLEAR * best).then_some(tau)
}
