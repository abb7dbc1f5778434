//! Groups of channels that fail alone: of a GNSS receiver the horizontal position, the height and the
//! velocity. The channels of one unit form a group.
//!
//! A sample that the gate refuses, as it did with those before, is judged by groups. A group that passes
//! a gate of its own is used, so that a bad channel costs its group.

use crate::state::covariance::Update;
use crate::units::sample::{Channel, MAX_CHANNELS, channels};

/// The groups of the first channels of a sensor, one bit a channel.
pub(in crate::filter) fn groups(all: &[Channel], used: usize) -> Vec<u16> {
    let all = &all[..used.min(all.len())];
    let first = |k: &usize| !all[..*k].iter().any(|c| c.unit == all[*k].unit);
    let of = |k: usize| {
        let same = (0..all.len()).filter(|j| all[*j].unit == all[k].unit);
        same.fold(0, |mask, j| mask | 1 << j)
    };
    (0..all.len()).filter(first).map(of).collect()
}

/// NIS of some of the channels that are present; `None` where their covariance is singular.
fn nis(update: &Update, present: u16, of: u16) -> Option<f64> {
    let own =
        channels(present).enumerate().take(update.m).filter(|(_, channel)| of >> channel & 1 == 1);
    let (mut rows, mut k) = ([0; MAX_CHANNELS], 0);
    for (row, _) in own {
        rows[k] = row;
        k += 1;
    }
    let rows = &rows[..k];
    let (mut l, mut y) = ([[0.0; MAX_CHANNELS]; MAX_CHANNELS], [0.0; MAX_CHANNELS]);
    for (i, &a) in rows.iter().enumerate() {
        for (j, &b) in rows[..=i].iter().enumerate() {
            let done: f64 = (0..j).map(|n| l[i][n] * l[j][n]).sum();
            let rest = update.s[a * update.m + b] - done;
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
        let done: f64 = (0..i).map(|n| l[i][n] * y[n]).sum();
        y[i] = (update.innovation[a] - done) / l[i][i];
    }
    let nis = y.iter().map(|y| y * y).sum::<f64>();
    nis.is_finite().then_some(nis)
}

/// The groups of a sample that a gate of their own refuses, one bit a channel. Call after
/// [`Update::innovate`].
pub(in crate::filter) fn failing(
    groups: &[u16],
    thresholds: &[f64; MAX_CHANNELS + 1],
    update: &Update,
    present: u16,
) -> impl Iterator<Item = u16> {
    let fails = move |group: &u16| {
        let nis = nis(update, present, *group).unwrap_or(f64::INFINITY);
        nis > thresholds[group.count_ones() as usize]
    };
    groups.iter().map(move |group| group & present).filter(|group| *group != 0).filter(fails)
}

/// The groups that fail while others pass, beside those that are isolated, one bit a channel; `None` where
/// all fail, or none does alone. Call after [`Update::innovate`].
pub(in crate::filter) fn failing_alone(
    (groups, isolated): (&[u16], u16),
    thresholds: &[f64; MAX_CHANNELS + 1],
    update: &Update,
    present: u16,
) -> Option<u16> {
    let failing = failing(groups, thresholds, update, present);
    let bad = failing.fold(isolated & present, |bad, group| bad | group);
    (bad != 0 && bad != present).then_some(bad)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The failing groups of a position and a velocity with the innovations `y`, whose sigma is one.
    fn found(y: [f64; 2]) -> Option<u16> {
        let mut update = Update::with_capacity(2, 2);
        update.m = 2;
        update.s.extend([1.0, 0.0, 0.0, 1.0]);
        update.innovation.extend(y);
        failing_alone((&[0b01, 0b10], 0), &[15.1; MAX_CHANNELS + 1], &update, 0b11)
    }

    #[test]
    fn channels_of_one_unit_are_a_group() {
        let of = |name: &str, unit: &str| Channel::new(name, unit);
        let channels = [
            of("lat", "rad"),
            of("lon", "rad"),
            of("height", "m"),
            of("vel_n", "mps"),
            of("acc", "m"),
        ];
        assert_eq!(groups(&channels, 4), [0b0011, 0b0100, 0b1000]);
    }

    #[test]
    fn a_group_fails_where_its_own_gate_refuses_it_and_another_passes() {
        assert_eq!(found([9.0, 0.5]), Some(0b01));
        assert_eq!(found([0.5, 9.0]), Some(0b10));
        assert_eq!(found([9.0, 9.0]), None);
        assert_eq!(found([3.0, 3.0]), None);
    }

    /// Two channels with the variance 2, the covariance 1 and the innovations 1 and -1 have the NIS
    /// (2 + 2 + 2) / (4 - 1) = 2; a third one that fails takes no part.
    #[test]
    fn the_gate_of_a_group_knows_the_correlation_of_its_channels() {
        let mut update = Update::with_capacity(3, 3);
        update.m = 3;
        update.s.extend([2.0, 0.5, 1.0, 0.5, 1.0, 0.5, 1.0, 0.5, 2.0]);
        update.innovation.extend([1.0, 99.0, -1.0]);
        assert!((nis(&update, 0b1101, 0b1001).unwrap_or_default() - 2.0).abs() < 1e-12);
    }
}
