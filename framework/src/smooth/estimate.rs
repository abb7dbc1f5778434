//! Estimates as rows of numbers, as the records and the temporary files have them.

use crate::model::record::{Epoch, Truth};
use crate::state::covariance::Covariance;
use crate::state::{Layout, State};
use crate::units::time::Time;

/// Places of the numbers of an estimate in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Lengths of the values and the signals, dimension of the error, number of blocks.
    values: usize,
    signals: usize,
    pub(super) n: usize,
    blocks: usize,
}

impl Row {
    pub(super) fn new(layout: &Layout) -> Self {
        let (values, signals) = (layout.ambient, layout.signals);
        Self { values, signals, n: layout.tangent, blocks: layout.blocks.len() }
    }

    /// Length of the lower triangle of the covariance.
    fn triangle(&self) -> usize {
        self.n * (self.n + 1) / 2
    }

    /// Length: time, values, signals, covariance, a mark for a truth, its values, and a mark for
    /// each known block.
    pub(super) fn width(&self) -> usize {
        1 + 2 * self.values + self.signals + self.triangle() + 1 + self.blocks
    }
}

/// Time of the estimate in a row.
pub(super) fn time_of(numbers: &[f64]) -> Option<Time> {
    numbers.first().map(|time| Time::from_nanos(time.to_bits().cast_signed()))
}

/// Adds an estimate to a row.
pub(super) fn write(epoch: &Epoch<'_>, out: &mut Vec<f64>) {
    let Epoch { layout, state, covariance, truth } = epoch;
    out.push(f64::from_bits(state.time.nanos().cast_unsigned()));
    out.extend_from_slice(&state.values);
    out.extend_from_slice(&state.signals);
    covariance.rows().enumerate().for_each(|(i, row)| out.extend_from_slice(&row[..=i]));
    match truth {
        None => {
            out.extend(std::iter::repeat_n(0.0, 1 + layout.ambient + layout.blocks.len()));
        }
        Some(truth) => {
            out.push(1.0);
            out.extend_from_slice(&truth.state.values);
            out.extend(truth.known.iter().map(|known| f64::from(u8::from(*known))));
        }
    }
}

/// An estimate with its truth, which a row fills.
pub(super) struct Estimate {
    pub(super) state: State,
    pub(super) covariance: Covariance,
    truth: State,
    known: Vec<bool>,
    compared: bool,
}

impl Estimate {
    pub(super) fn new(layout: &Layout) -> Self {
        Self {
            state: layout.initial_state(),
            covariance: Covariance::zero(layout.tangent),
            truth: layout.initial_state(),
            known: vec![false; layout.blocks.len()],
            compared: false,
        }
    }

    /// Takes the numbers of a row.
    pub(super) fn read(&mut self, row: &Row, numbers: &[f64]) {
        let Row { values, signals, .. } = *row;
        self.state.time = time_of(numbers).unwrap_or_default();
        self.truth.time = self.state.time;
        let (state, rest) = numbers[1..].split_at(values);
        let (given, rest) = rest.split_at(signals);
        let (triangle, truth) = rest.split_at(row.triangle());
        self.state.values.copy_from_slice(state);
        self.state.signals.copy_from_slice(given);
        self.covariance.set_lower(triangle);
        self.compared = truth[0] != 0.0;
        self.truth.values.copy_from_slice(&truth[1..=values]);
        self.known.iter_mut().zip(&truth[1 + values..]).for_each(|(k, v)| *k = *v != 0.0);
    }

    pub(super) fn epoch<'a>(&'a self, layout: &'a Layout) -> Epoch<'a> {
        let truth = Truth { state: &self.truth, known: &self.known };
        let truth = self.compared.then_some(truth);
        Epoch { layout, state: &self.state, covariance: &self.covariance, truth }
    }
}
