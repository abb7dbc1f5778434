//! The steps between two uses of the covariance, taken as one.
//!
//! Many steps `I + A_k` of `dt_k` seconds follow each other between two updates, `T` seconds together. With the
//! sum `S` of their changes and the first moment `M = sum t_k A_k / T`, `t_k` being the middle of a step since
//! the beginning, their product is, to the second order,
//! ```text
//! I + S + e S^2 + M S - S M,                e = sum dt_k a_k / T^2,   a_k the time after the step
//! ```
//! It has all terms of the second order for equal changes per second in steps of any lengths, and for steps of one
//! length of which one part varies, such as a specific force. Lengths differ, since a measurement between two
//! samples splits a step; where both differ, it lacks the covariance of `dt^2` with the change per second, in
//! half. The third order, `S^3 / 6`, is neglected: it bounds the number of steps. A state that decays by itself
//! has the product of its decays.
//!
//! The steps after it carry the noise `Q` of a step, the sum of all becomes
//! ```text
//! Q + e (S Q + Q S') + f S Q S',            f = sum dt_k a_k^2 / T^3
//! ```
//! The share `f` of the noise comes before the steps, which gives the last term, and the rest after them;
//! `(e - f)(S Q + Q S')` completes the one before it.

mod products;

use super::carried::Carried;
use super::lanes::Lane;
use super::{Covariance, Transition};
use crate::checkpoint::saved;
use crate::state::{Layout, magnitude};
use products::Products;
use pulp::{Arch, Simd, WithSimd};

/// Largest neglected change of an error in one pool, as a share of its sigma.
const NEGLECTED: f64 = 1e-6;
/// Largest growth of a pool over the ones before.
const GROWTH: f64 = 4.0;
/// Largest number of pools for which a plan holds.
const KEPT: u32 = 4;

/// Steps that the covariance has not taken.
#[derive(Clone)]
pub(crate) struct Pool {
    lengths: Lengths,
    /// Sums of `A_k` and of `t_k A_k`, and of the noise: that of the processes, and of the blocks' own dynamics.
    sum: Vec<f64>,
    moment: Vec<f64>,
    noise: Vec<f64>,
    decays: Vec<Decay>,
    /// Sum of `|A_k|` over all elements, and the one at which the pool is full.
    size: f64,
    room: f64,
    /// Number of pools since this was planned.
    since: u32,
    /// The share of the identity in each element, and whether each changed row has one: a row without its
    /// own element is no change of the identity that could add up.
    identity: Vec<f64>,
    complete: bool,
    products: Products,
    /// Products of which the elements of `S Q` consist.
    terms: Vec<Term>,
    /// All steps.
    part: Transition,
}

saved!(Pool { lengths, size, room, since } each { sum, moment, noise, decays } except {
    identity, complete, products, terms, part
});

/// Number of steps, their time `T`, and the sums of `dt b` and `dt b^2` with the time `b` from the beginning of
/// the first to the end of each, s.
#[derive(Clone, Copy, Debug, Default)]
struct Lengths {
    steps: u32,
    time: f64,
    ends: f64,
    squares: f64,
}

saved!(Lengths { steps, time, ends, squares });

impl Lengths {
    /// Adds a step, and returns its middle.
    fn add(&mut self, dt: f64) -> f64 {
        let middle = self.time + 0.5 * dt;
        self.steps += 1;
        self.time += dt;
        self.ends += dt * self.time;
        self.squares += dt * (self.time * self.time);
        middle
    }

    /// `e` and `f`.
    fn shares(&self) -> [f64; 2] {
        if self.steps < 2 {
            return [0.0; 2];
        }
        let t = self.time;
        let mean = self.ends / (t * t);
        [1.0 - mean, 1.0 - 2.0 * mean + self.squares / (t * t * t)]
    }
}

#[derive(Clone, Debug)]
struct Decay {
    at: usize,
    place: usize,
    /// Index of the noise of the block's own dynamics.
    own: Option<usize>,
    factor: f64,
    /// This noise as it is at the end.
    noise: f64,
}

saved!(Decay { factor, noise } except { at, place, own });

/// A product of an element of `S` and one of the noise, with the place in `S Q` to which it adds.
#[derive(Clone, Copy, Debug)]
struct Term {
    at: usize,
    element: usize,
    noise: usize,
}

impl Pool {
    /// An empty pool for steps with the places of this one.
    pub(crate) fn new(layout: &Layout, step: &Transition) -> Self {
        let mut part = products::squared(layout, step);
        let places = step.places();
        let alone = |row: usize| places.iter().filter(|place| place.0 == row).count() == 1;
        let decaying = |place: &(usize, usize)| place.0 == place.1 && alone(place.0);
        let products = Products::new(layout.tangent, step, &part, |row| {
            alone(row) && places.contains(&(row, row))
        });
        let decays = places.iter().enumerate().filter(|(_, place)| decaying(place));
        let decays = decays.filter_map(|(at, place)| {
            Some(Decay {
                at,
                place: part.places().iter().position(|own| own == place)?,
                own: step.own.iter().position(|own| own.row == place.0),
                factor: 1.0,
                noise: 0.0,
            })
        });
        let decays: Vec<Decay> = decays.collect();
        let (mut places, mut terms) = (Vec::new(), Vec::new());
        for (element, place) in step.places().iter().enumerate() {
            for (noise, (row, column)) in step.noise_places().enumerate() {
                // the own noise of a state that decays is exact, and a doubt needs no second order
                let exact = decaying(place) && noise >= step.q.len();
                if row == place.1 && !exact && !step.doubts(noise) {
                    let own = (place.0, column);
                    let known = places.iter().position(|place| *place == own);
                    let at = known.unwrap_or_else(|| {
                        places.push(own);
                        places.len() - 1
                    });
                    terms.push(Term { at, element, noise });
                }
            }
        }
        part.carried = Carried { early: 0.0, values: vec![0.0; places.len()], places };
        let identity = step.identity();
        let ones = identity.iter().filter(|one| **one != 0.0).count();
        Self {
            complete: ones == step.kernel.rows().len(),
            identity,
            lengths: Lengths::default(),
            sum: vec![0.0; step.phi.len()],
            moment: vec![0.0; step.phi.len()],
            noise: vec![0.0; step.q.len() + step.own.len()],
            decays,
            size: 0.0,
            room: 0.0,
            since: 0,
            products,
            terms,
            part,
        }
    }

    /// Adds a step of `dt` seconds. Returns `true` if the pool is full.
    pub(crate) fn add(&mut self, step: &Transition, dt: f64) -> bool {
        let middle = self.lengths.add(dt);
        let Self { sum, moment, identity, noise, .. } = self;
        let size = Arch::new().dispatch(Added { middle, phi: &step.phi, identity, sum, moment });
        self.size += size;
        for decay in &mut self.decays {
            let factor = step.phi[decay.at];
            decay.factor *= factor;
            let noise = decay.own.map_or(0.0, |own| step.own[own].q);
            decay.noise = factor * factor * decay.noise + noise;
        }
        let share = 1.0 + step.excess;
        let (models, own) = noise.split_at_mut(step.q.len());
        models.iter_mut().zip(&step.q).for_each(|(q, step)| *q += share * step);
        own.iter_mut().zip(&step.own).for_each(|(q, step)| *q += step.q);
        // the step after this one, if as large as this one, would be too much
        !self.complete || self.size + size > self.room
    }

    /// Returns `true` if there is no step.
    pub(crate) fn is_empty(&self) -> bool {
        self.lengths.steps == 0
    }

    /// Moves a covariance over the steps, and returns the transition of all of them, with their noise.
    pub(crate) fn take(&mut self, covariance: &mut Covariance) -> &mut Transition {
        self.fill();
        self.part.propagate(covariance);
        self.plan(covariance);
        self.clear();
        &mut self.part
    }

    fn clear(&mut self) {
        (self.lengths, self.size) = (Lengths::default(), 0.0);
        let Self { sum, moment, noise, .. } = self;
        [sum, moment, noise].into_iter().for_each(|sum| sum.fill(0.0));
        self.decays.iter_mut().for_each(|decay| (decay.factor, decay.noise) = (1.0, 0.0));
    }

    /// Fills the transition.
    fn fill(&mut self) {
        let Self { lengths, sum, moment, noise, decays, products, terms, part, .. } = self;
        let [e, f] = lengths.shares();
        products.take(sum);
        match lengths.steps {
            0 | 1 => products.write_sum(&mut part.phi),
            _ => products.write(&mut part.phi, sum, moment, e, 1.0 / lengths.time),
        }
        let own = part.q.len();
        for decay in decays {
            let factor = decay.factor;
            part.phi[decay.place] = factor;
            if let Some(index) = decay.own {
                // the variance of a state that decays by itself is exact
                noise[own + index] = decay.noise / (1.0 - f + f * factor * factor);
            }
        }
        part.q.copy_from_slice(&noise[..own]);
        part.own.iter_mut().zip(&noise[own..]).for_each(|(own, sum)| own.q = *sum);
        part.carried.early = f;
        part.carried.values.fill(0.0);
        for &Term { at, element, noise: q } in &*terms {
            part.carried.values[at] += (e - f) * sum[element] * noise[q];
        }
    }

    /// Plans the next pool: what this one neglects grows with the cube of the number of steps.
    fn plan(&mut self, covariance: &Covariance) {
        if !self.complete {
            return; // without room each step is a pool
        }
        // a pool of half the room neglects an eighth of what it may, and keeps the plan for some time
        self.since += 1;
        if 2.0 * self.size <= self.room && self.since < KEPT {
            return;
        }
        self.since = 0;
        let largest = self.products.neglected(covariance);
        let ratio = if largest > 0.0 { (NEGLECTED / largest).cbrt() } else { f64::INFINITY };
        // a short pool shows little of a long one, but takes no room that one before it had
        self.room = (self.size * ratio).min(self.room.max(GROWTH * self.size));
    }
}

/// Adds the changes of a step to the sums, and returns the sum of their magnitudes.
struct Added<'a> {
    middle: f64,
    phi: &'a [f64],
    identity: &'a [f64],
    sum: &'a mut [f64],
    moment: &'a mut [f64],
}

impl WithSimd for Added<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { middle, phi, identity, sum, moment } = self;
        let ((phi, rest), (identity, ones)) = (phi.as_chunks::<4>(), identity.as_chunks::<4>());
        let (sum, sums) = sum.as_chunks_mut::<4>();
        let (moment, moments) = moment.as_chunks_mut::<4>();
        let mut sizes: Lane = [0.0; 4];
        for (((phi, one), sum), moment) in rest.iter().zip(ones).zip(sums).zip(moments) {
            let change = phi - one;
            *sum += change;
            *moment += middle * change;
            sizes[0] += change.abs();
        }
        let middle = simd.splat_f64s(middle);
        let all = S::as_mut_simd_f64s(&mut sizes).0;
        for (((phi, one), sum), moment) in phi.iter().zip(identity).zip(sum).zip(moment) {
            let steps = S::as_simd_f64s(phi).0.iter().zip(S::as_simd_f64s(one).0);
            let sums = S::as_mut_simd_f64s(sum).0.iter_mut().zip(S::as_mut_simd_f64s(moment).0);
            for (((phi, one), (sum, moment)), size) in steps.zip(sums).zip(&mut *all) {
                let change = simd.sub_f64s(*phi, *one);
                *sum = simd.add_f64s(*sum, change);
                *moment = simd.add_f64s(*moment, simd.mul_f64s(middle, change));
                *size = simd.add_f64s(*size, magnitude(simd, change));
            }
        }
        sizes.iter().sum()
    }
}

#[cfg(test)]
mod tests;
