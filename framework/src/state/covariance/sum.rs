//! Sums of steps, for a tool that carries errors over many of them.

use super::Transition;

/// Most steps that are taken as one: a third of a second of an IMU of 100 Hz.
const MOST: u32 = 32;
/// Largest decay of a state over these: the terms that are neglected are then below 2e-4.
const DECAY: f64 = 0.1;

/// The steps `I + A_k` since they were carried last, as one.
///
/// Many steps follow each other between two updates, and each of them would carry every column of
/// a wide matrix. With the sum `S` of `n` changes `A_k`, their product is
/// ```text
/// I + S + (1 - 1/n) S^2 / 2
/// ```
/// The product of `n` equal steps has just these terms, and those of the third order, which are
/// neglected; so is the order of the steps among the `n`.
#[derive(Clone, Debug, Default)]
pub struct StepSum {
    /// The sum of the steps, which is `I + S` and `n - 1` times the identity; `None` before the first.
    whole: Option<Transition>,
    /// The share of the identity in its elements.
    identity: Vec<f64>,
    steps: u32,
    /// Set where no step fits any more.
    full: bool,
    /// Elements on the diagonal, and whether each changed row has one.
    own: Vec<usize>,
    complete: bool,
    /// Rows of the matrix before, and after the first of two products; work space of these.
    before: Vec<f64>,
    once: Vec<f64>,
    work: Vec<f64>,
}

impl StepSum {
    /// Adds a step, unless it does not fit: carry the steps so far, and add it then. Returns `false`
    /// for a step too many, with other places than those before, or after one that replaces a state
    /// or lets it decay.
    pub fn add(&mut self, step: &Transition) -> bool {
        match &mut self.whole {
            Some(whole) if whole.has_places_of(step) => match self.steps {
                0 => whole.phi.copy_from_slice(&step.phi),
                _ if self.full => return false,
                _ => step.add_to(&mut whole.phi),
            },
            Some(_) if self.steps > 0 => return false,
            whole => {
                self.identity = step.identity();
                let own = self.identity.iter().enumerate().filter(|(_, one)| **one != 0.0);
                self.own = own.map(|(at, _)| at).collect();
                // a row without its own element is no change of the identity that could add up
                self.complete = self.own.len() == step.kernel.rows().len();
                *whole = Some(step.clone());
            }
        }
        self.steps += 1;
        let (steps, phi) = (f64::from(self.steps), self.whole.as_ref().map_or(&[][..], |w| &w.phi));
        let decays = self.own.iter().any(|at| (phi[*at] - steps).abs() > DECAY);
        self.full = self.steps >= MOST || decays || !self.complete;
        true
    }

    /// Applies the steps, `G = (I + S + (1 - 1/n) S^2 / 2) G`, and forgets them. `G` is row-major
    /// with rows of `stride`, a multiple of four.
    pub fn carry(&mut self, g: &mut [f64], stride: usize) {
        let Self { whole, identity, before, once, work, .. } = self;
        let (steps, Some(whole)) = (std::mem::take(&mut self.steps), whole) else { return };
        if steps == 0 || stride == 0 {
            return;
        }
        let surplus = f64::from(steps - 1);
        whole.phi.iter_mut().zip(identity).for_each(|(phi, one)| *phi -= surplus * *one);
        let rows = std::sync::Arc::clone(whole.kernel.rows());
        let copy = |from: &[f64], to: &mut Vec<f64>| {
            to.clear();
            rows.iter().for_each(|row| to.extend_from_slice(&from[row * stride..][..stride]));
        };
        if steps == 1 {
            return whole.carry(g, stride, work);
        }
        copy(g, before);
        whole.carry(g, stride, work);
        copy(g, once);
        whole.carry(g, stride, work);
        // with c = (1 - 1/n) / 2: c (I + S)^2 + (I + S) / n + c I
        let share = 1.0 / f64::from(steps);
        let c = 0.5 * (1.0 - share);
        let rows = rows.iter().zip(before.chunks_exact(stride).zip(once.chunks_exact(stride)));
        for (row, (before, once)) in rows {
            for (g, (before, once)) in g[row * stride..].iter_mut().zip(before.iter().zip(once)) {
                *g = c * (*before + *g) + share * once;
            }
        }
    }
}
