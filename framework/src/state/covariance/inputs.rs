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

    /// Writes the derivative of the error states with respect to the channels of the driving sample
    /// as the process receives it.
    #[inline]
    pub fn set_input<const R: usize, const C: usize>(
        &mut self,
        slot: InputSlot<R, C>,
        block: &nalgebra::SMatrix<f64, R, C>,
    ) {
        // without input models nobody reads it
        if let Some(place) = slot.0.filter(|_| !self.inputs.links.is_empty()) {
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
