//! Which of several vectors with the same meaning an inertial unit has: the one whose content it can be.

use super::columns::{ACCEL, GYRO, Table};
use super::units::{self, IMU_INTERVAL};
use super::vocabulary::{axis_of, words};

/// The columns of a vector.
type Triple = [usize; 3];

/// Word for the part of a specific force that gravity is, which some devices have in columns of its own.
const GRAVITY: [&str; 2] = ["gravity", "grav"];

impl Table<'_> {
    /// Leaves out vectors that cannot be what their headings mean, where another one of the same meaning can: forces
    /// without gravity, and rates that never change. Forces without gravity get it from the columns that have it.
    pub(super) fn choose_inertial(&mut self) {
        let interval = self.clock(IMU_INTERVAL).map_or(IMU_INTERVAL, |c| units::step(&c.seconds));
        let rows = |[x, y, z]: Triple| {
            let [x, y, z] = [x, y, z].map(|k| self.layout.column(k));
            units::rows([&x, &y, &z])
        };
        let changes = |triple: Triple| {
            let rows = rows(triple);
            let first = rows.iter().find(|v| v.iter().all(|x| x.is_finite())).copied();
            rows.iter().any(|v| v.iter().all(|x| x.is_finite()) && Some(*v) != first)
        };
        let forces = self.triples(ACCEL);
        let weighs = |triple: Triple| units::accel(&rows(triple), interval).is_ok();
        let fits = |triple: &&Triple| changes(**triple) && weighs(**triple);
        let force = forces.iter().find(fits).copied();
        if force.is_none()
            && let Some((own, beside)) = forces.iter().find_map(|own| {
                let beside = self.gravity_beside(*own)?;
                let sum = |(a, b): (&[f64; 3], &[f64; 3])| std::array::from_fn(|k| a[k] + b[k]);
                let sums: Vec<[f64; 3]> = rows(*own).iter().zip(&rows(beside)).map(sum).collect();
                units::accel(&sums, interval).is_ok().then_some((*own, beside))
            })
        {
            self.keep(ACCEL, own);
            self.gravity = Some(beside);
            return;
        }
        let rates = self.triples(GYRO);
        let near = force.or(forces.first().copied()).map_or(0, |force| force[0]);
        let moving = rates.iter().filter(|triple| changes(**triple));
        let own =
            rates.first().filter(|first| changes(**first) && force == forces.first().copied());
        let rate = own.or_else(|| moving.min_by_key(|triple| triple[0].abs_diff(near))).copied();
        if let Some(force) = force.filter(|_| forces.len() > 1) {
            self.keep(ACCEL, force);
        }
        if let Some(rate) = rate.filter(|_| rates.len() > 1) {
            self.keep(GYRO, rate);
        }
    }

    /// The vectors of a meaning, the best name first: axes beside each other, with the same rank.
    fn triples(&self, channels: [&str; 3]) -> Vec<Triple> {
        let mut named: Vec<_> =
            self.columns.iter().filter(|(_, m)| m.channel == channels[0]).collect();
        named.sort_by_key(|(k, m)| (!self.usual(*k, channels[0]), m.rank));
        let beside = |channel: &str, rank: usize, first: usize| {
            let other = self.columns.iter().filter(|(_, m)| m.channel == channel && m.rank == rank);
            other.map(|(k, _)| *k).min_by_key(|k| k.abs_diff(first))
        };
        let triple = |(first, meaning): &(usize, _)| {
            let meaning: &super::vocabulary::Meaning = meaning;
            let [y, z] = [1, 2].map(|k| beside(channels[k], meaning.rank, *first));
            Some([*first, y?, z?])
        };
        named.into_iter().filter_map(triple).collect()
    }

    /// The columns with the gravity along the axes of a vector.
    fn gravity_beside(&self, own: Triple) -> Option<Triple> {
        let along = |k: usize| {
            let axis = axis_of(self.heading(own[k]))?;
            let named = |heading: &String| {
                let gravity = words(heading).iter().any(|w| GRAVITY.contains(&w.as_str()));
                gravity && axis_of(heading) == Some(axis)
            };
            self.layout.headings.iter().position(named)
        };
        Some([along(0)?, along(1)?, along(2)?])
    }

    /// Leaves out the other columns of a vector.
    fn keep(&mut self, channels: [&str; 3], triple: Triple) {
        self.columns.retain(|(k, m)| !channels.contains(&m.channel) || triple.contains(k));
    }
}
