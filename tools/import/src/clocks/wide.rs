//! The search for an offset of up to a minute.
//!
//! Where the recordings of two clocks overlap in part, the number of pairs differs from offset to
//! offset. The measure is therefore the share of both motions that their difference has: about one
//! where they are not related, and the share of the noise at the true offset.

use super::{Inertial, LEAST, Measured, pairs};

/// Largest offset, and the step of the search, s.
const LARGEST: f64 = 65.0;
const STEP: f64 = 0.2;
/// Largest number of samples that are compared.
const SAMPLES: usize = 2000;
/// Share of the pairs that an offset must leave.
const OVERLAP: f64 = 0.25;
/// Largest share that is a match, and the ratio to the best share of another offset.
const MATCH: f64 = 0.4;
const CLEAR: f64 = 1.4;
/// Distance, s, within which two offsets are one.
const ONE: f64 = 2.0;

/// The variance of the differences over that of both changes.
fn share(imu: &Inertial, measured: &Measured, pairs: &[usize], tau: f64) -> Option<f64> {
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
    let enough = count >= (OVERLAP * pairs.len() as f64).max(LEAST as f64);
    (enough && both > 0.0).then(|| (variance(4) + variance(5)) / both)
}

/// The offset at which the motions match, if no other one does.
pub fn search(imu: &Inertial, measured: &Measured) -> Option<f64> {
    let measured = measured.thinned(SAMPLES);
    let some = pairs(&measured.times());
    let steps = (LARGEST / STEP) as i32;
    let offsets = (-steps..=steps).map(|k| f64::from(k) * STEP);
    let found = offsets.filter_map(|tau| Some((tau, share(imu, &measured, &some, tau)?)));
    let found: Vec<(f64, f64)> = found.collect();
    let (tau, best) = *found.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let others = found.iter().filter(|(other, _)| (other - tau).abs() > ONE);
    let next = others.map(|(_, share)| *share).fold(f64::INFINITY, f64::min);
    (best < MATCH && next.is_finite() && next > CLEAR * best).then_some(tau)
}
