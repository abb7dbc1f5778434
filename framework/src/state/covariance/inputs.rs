//! Effect of the driving samples on the error state, by which the states of input models reach
//! `Phi`.
//!
//! A process that propagates `x` with the corrected sample `z(y)` of an input model with states `y`
//! has, next to its own rows, the chain rule
//! ```text
//! dx' / dy = (dx' / dz) (dz / dy)
//! ```
//! The process gives `dx' / dz`, the framework differentiates the model for `dz / dy`.

use super::Transition;
use crate::checkpoint::saved;

/// Place of the derivative of `R` error states with respect to `C` channels of a driving sensor.
#[derive(Clone, Copy, Debug)]
pub struct InputSlot<const R: usize, const C: usize>(pub(crate) Option<usize>);

/// Declared places, and the elements of `Phi` that they contribute to.
#[derive(Clone, Debug, Default)]
pub(super) struct Inputs {
    /// Derivatives of all places, row-major.
    values: Vec<f64>,
    places: Vec<Place>,
    /// Elements of `Phi`, one entry for each driving sensor with input models.
    links: Vec<Link>,
}

saved!(Inputs {} each { values } except { places, links });

#[derive(Clone, Copy, Debug)]
struct Place {
    /// First value.
    at: usize,
    row: usize,
    rows: usize,
    first_channel: usize,
    channels: usize,
}

#[derive(Clone, Debug, Default)]
struct Link {
    places: Vec<usize>,
    /// Number of columns of the derivative of the input models.
    columns: usize,
    /// For each place, its rows and each column: the index in `Transition::phi`, and true if no
    /// process fills this element.
    targets: Vec<(usize, bool)>,
}

impl Transition {
    /// Declares the derivative of the error states from `row` on with respect to channels of a
    /// driving sensor.
    pub(crate) fn input<const R: usize, const C: usize>(
        &mut self,
        row: Option<usize>,
        first_channel: usize,
    ) -> InputSlot<R, C> {
        let inputs = &mut self.inputs;
        InputSlot(row.map(|row| {
            let at = inputs.values.len();
            inputs.values.resize(at + R * C, 0.0);
            inputs.places.push(Place { at, row, rows: R, first_channel, channels: C });
            inputs.places.len() - 1
        }))
    }

    /// Returns `true` if input models read the derivatives that [`Self::set_input`] writes.
    #[inline]
    pub fn has_inputs(&self) -> bool {
        !self.inputs.links.is_empty()
    }

    /// Writes the derivative of the error states with respect to the channels of the driving sample
    /// as the process receives it.
    #[inline]
    pub fn set_input<const R: usize, const C: usize>(
        &mut self,
        slot: InputSlot<R, C>,
        block: &nalgebra::SMatrix<f64, R, C>,
    ) {
        // without input models nobody reads it
        if let Some(place) = slot.0.filter(|_| self.has_inputs()) {
            let at = self.inputs.places[place].at;
            let out = &mut self.inputs.values[at..at + R * C];
            for i in 0..R {
                for j in 0..C {
                    out[i * C + j] = block[(i, j)];
                }
            }
        }
    }

    /// Connects places with the columns that the input models of their sensor depend on, and
    /// returns the number of the link.
    pub(crate) fn link_inputs(&mut self, places: &[usize], columns: &[usize]) -> usize {
        let mut targets = Vec::new();
        for &place in places {
            let Place { row, rows, .. } = self.inputs.places[place];
            for element in (row..row + rows).flat_map(|i| columns.iter().map(move |&j| (i, j))) {
                let known = self.places.iter().position(|place| *place == element);
                targets.push((known.unwrap_or(self.places.len()), known.is_none()));
                if known.is_none() {
                    self.places.push(element);
                    self.phi.push(0.0);
                }
            }
        }
        self.inputs.links.push(Link { places: places.to_vec(), columns: columns.len(), targets });
        self.inputs.links.len() - 1
    }

    /// Removes the effect of a link's states from `Phi`.
    pub(crate) fn clear_inputs(&mut self, link: usize) {
        for (target, _) in self.inputs.links[link].targets.iter().filter(|(_, own)| *own) {
            self.phi[*target] = 0.0;
        }
    }

    /// Adds the effect of a link's states to `Phi`: `derivative` is that of the sensor's channels,
    /// row-major. Call once a step, after the processes.
    pub(crate) fn add_inputs(&mut self, link: usize, derivative: &[f64]) {
        let Inputs { values, places, links } = &self.inputs;
        let Link { places: linked, columns, targets } = &links[link];
        let mut targets = targets.iter();
        for place in linked.iter().map(|place| &places[*place]) {
            for i in 0..place.rows {
                let row = &values[place.at + i * place.channels..][..place.channels];
                for (column, &(target, own)) in (0..*columns).zip(&mut targets) {
                    let channels = row.iter().zip(place.first_channel..);
                    let effect: f64 =
                        channels.map(|(b, k)| b * derivative[k * columns + column]).sum();
                    self.phi[target] = if own { effect } else { self.phi[target] + effect };
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2x3, SMatrix};

    /// Two rows of the state follow three channels from the second on; the input model has the
    /// states of columns 4 and 5. `Phi` gets the product of both derivatives.
    #[test]
    fn the_states_of_an_input_model_reach_phi_by_the_chain_rule() {
        let mut transition = Transition::default();
        let other = transition.phi::<1, 1>(Some(1), Some(4));
        let _unused = transition.input::<1, 1>(None, 0);
        let first = transition.input::<1, 2>(Some(0), 0);
        let slot = transition.input::<2, 3>(Some(1), 1);
        let link = transition.link_inputs(&[1], &[4, 5]);
        let (b, c) = (
            Matrix2x3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
            SMatrix::<f64, 4, 2>::from_fn(|i, j| 10.0 * i as f64 + j as f64),
        );
        let derivative: Vec<f64> = c.transpose().iter().copied().collect();
        for _ in 0..2 {
            transition.clear_inputs(link);
            transition.set(other, &SMatrix::<f64, 1, 1>::new(100.0));
            transition.set_input(first, &SMatrix::<f64, 1, 2>::new(-1.0, -1.0));
            transition.set_input(slot, &b);
            transition.add_inputs(link, &derivative);
        }
        let expected = b * c.fixed_rows::<3>(1);
        for (i, j) in (0..2).flat_map(|i| (0..2).map(move |j| (i, j))) {
            // the process fills one of the elements itself
            let own = if (i, j) == (0, 0) { 100.0 } else { 0.0 };
            let place = transition.places.iter().position(|p| *p == (1 + i, 4 + j));
            assert_eq!(place.map(|at| transition.phi[at]), Some(own + expected[(i, j)]));
        }
        transition.clear_inputs(link);
        assert_eq!(transition.phi[1..], [0.0; 3]);
    }
}
