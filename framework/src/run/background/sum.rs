//! Sums of transitions: a sink that follows the error receives one for many steps.
//!
//! To first order the changes of the errors add up. Along a chain of errors, as from attitude to
//! velocity to position, a change arrives one sum later.

use super::batch::Batch;
use crate::state::covariance::Transition;

/// Largest change of an error by itself, or by another one and back, in a sum. A sum has an error
/// of half its square, so it is 5e-6 of the change at most.
const LARGEST: f64 = 3e-3;
/// Largest number of steps in a sum.
const STEPS: f64 = 64.0;

/// The transitions since the last record that is no sample.
#[derive(Default)]
pub(super) struct Sum {
    /// The sum, with places that the other thread knows.
    transition: Option<Transition>,
    /// The share of the identity in each element.
    identity: Vec<f64>,
    /// Pairs of elements `(i, j)` and `(j, i)`; one on the diagonal is its own pair.
    pairs: Vec<[usize; 2]>,
    /// Set if a row has no diagonal: its error is replaced.
    replaces: bool,
    elements: Vec<f64>,
    /// Set while the sum holds a step.
    begun: bool,
    /// Number of steps that it takes still.
    left: usize,
}

impl Sum {
    /// Adds a step, and passes the sum on to the batch once it is complete.
    pub(super) fn add(&mut self, step: &Transition, batch: &mut Batch) {
        if self.transition.as_ref().is_none_or(|sum| !sum.has_places_of(step)) {
            self.pass_to(batch);
            self.learn(step);
            batch.places(step);
        }
        if self.begun {
            if let Some(sum) = &mut self.transition {
                sum.add_step(step, &self.identity);
            }
            self.left -= 1;
        } else {
            self.left = self.steps(step) - 1;
            if let Some(sum) = &mut self.transition {
                sum.copy_step(step);
            }
            self.begun = true;
        }
        if self.left == 0 {
            self.pass_to(batch);
        }
    }

    /// Passes the sum on, if there is one.
    pub(super) fn pass_to(&mut self, batch: &mut Batch) {
        if let Some(sum) = self.transition.as_ref().filter(|_| self.begun) {
            batch.transition(sum);
        }
        self.begun = false;
    }

    /// Takes the places of a transition.
    fn learn(&mut self, step: &Transition) {
        let mut sum = step.clone();
        sum.scale_noise(1.0); // a step brings its noise with its scale
        let places = step.places();
        self.identity = step.identity();
        self.pairs.clear();
        for (k, (i, j)) in places.iter().enumerate() {
            let back = places.iter().enumerate().filter(|(_, place)| **place == (*j, *i));
            self.pairs.extend(back.filter(|(l, _)| *l >= k).map(|(l, _)| [k, l]));
        }
        self.replaces = places.iter().any(|(i, _)| !places.contains(&(*i, *i)));
        self.transition = Some(sum);
    }

    /// Number of steps like this one in a sum.
    fn steps(&mut self, step: &Transition) -> usize {
        if self.replaces {
            return 1;
        }
        self.elements.clear();
        self.elements.extend(step.elements().zip(&self.identity).map(|(e, one)| e.2 - one));
        let product = |[k, l]: &[usize; 2]| (self.elements[*k] * self.elements[*l]).abs();
        let largest = self.pairs.iter().map(product).fold(0.0, f64::max).sqrt();
        (LARGEST / largest).clamp(1.0, STEPS) as usize
    }
}
