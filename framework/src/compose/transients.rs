//! Pools of blocks that come and go.

use crate::compose::Composer;
use crate::model::error::ComposeError;
use crate::state::manifold::Manifold;
use crate::state::transient::Pool;
use crate::state::{BlockSpec, Dynamics, Mode, Transients};
use std::marker::PhantomData;

impl Composer {
    /// Adds a pool of blocks that come and go while the filter runs: the landmarks in view, the
    /// beacons that are heard, the bias of an instrument that is switched on. `count` is the
    /// largest number that is there at one time. The blocks are named `owner.name_1` and so on; all
    /// are absent at the start. `MeasurementModel::admit` adds and removes them, and
    /// [`View::transient`] reads them.
    ///
    /// `spec.sigma` is the prior of a block that [`Roster::add`] adds; leave it empty if every block
    /// is placed by a sample. `spec.initial` is the mean to which a Gauss-Markov block returns.
    ///
    /// [`View::transient`]: crate::state::View::transient
    /// [`Roster::add`]: crate::model::sensor::roster::Roster::add
    ///
    /// # Errors
    /// When the count is zero, the specification does not fit the manifold, or a name is taken.
    pub fn transients<M: Manifold>(
        &mut self,
        name: &str,
        count: usize,
        spec: BlockSpec,
    ) -> Result<Transients<M>, ComposeError> {
        if count == 0 {
            return Err(ComposeError::new(name, "a pool needs at least one block"));
        }
        if spec.mode != Mode::Estimate || spec.truth.is_some() {
            let message = "a block that comes and goes is estimated, and has its truth by label";
            return Err(ComposeError::new(name, message));
        }
        let has_prior = !spec.sigma.is_empty();
        if has_prior && spec.sigma.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return Err(ComposeError::new(name, "the prior sigma must be positive"));
        }
        let sigma = if has_prior { spec.sigma.clone() } else { vec![0.0; M::TANGENT] };
        let first = self.layout().labels;
        let mut slots = 0..0;
        for k in 0..count {
            let spec = BlockSpec { sigma: sigma.clone(), ..spec.clone() };
            let slot = self.block::<M>(&format!("{name}_{}", k + 1), spec)?.slot();
            slots = if k == 0 { slot..slot + 1 } else { slots.start..slot + 1 };
            self.layout_mut().blocks[slot].label = Some(first + k);
        }
        let layout = self.layout_mut();
        layout.labels += count;
        let pool = layout.pools.len();
        let name = name.to_owned();
        layout.pools.push(Pool { name, slots, first, has_prior, truths: Vec::new() });
        Ok(Transients { pool, manifold: PhantomData })
    }

    /// States the true value of a label, for simulated sensors and for comparison with the
    /// estimate. A pool whose blocks move has no truth.
    ///
    /// # Errors
    /// When the blocks of the pool have dynamics of their own.
    pub fn true_transient<M: Manifold>(
        &mut self,
        of: Transients<M>,
        label: u32,
        value: &M::Value<f64>,
    ) -> Result<(), ComposeError> {
        let layout = self.layout_mut();
        let pool = &mut layout.pools[of.pool];
        if layout.blocks[pool.slots.start].spec.dynamics != Dynamics::Constant {
            let message = "a block that comes, goes and moves has no true value; remove its \
                           dynamics, or its true value";
            return Err(ComposeError::new(pool.name.clone(), message));
        }
        let mut ambient = vec![0.0; M::AMBIENT];
        M::store(value, &mut ambient);
        pool.truths.retain(|(known, _)| *known != label);
        pool.truths.push((label, ambient));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::state::display;
    use crate::state::manifold::Scalar;

    #[test]
    fn a_label_has_the_true_value_that_was_stated_last() {
        let mut composer = Composer::default();
        composer.begin("sonar");
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: vec![1.0],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::LENGTH,
        };
        let posts = composer.transients::<Scalar>("post", 2, spec).unwrap();
        for (label, value) in [(7, 1.0), (8, 2.0), (7, 3.0)] {
            composer.true_transient(posts, label, &value).unwrap();
        }
        assert_eq!(composer.layout().pools[0].truths, [(8, vec![2.0]), (7, vec![3.0])]);
    }
}
