//! The posterior Cramer-Rao bound of a scenario, filtered and smoothed.
//!
//! For Gaussian noise and a given trajectory, the filter's covariance recursion with every Jacobian
//! evaluated at the truth is the bound of the filtered estimate (Tichavsky, Muravchik & Nehorai,
//! IEEE Trans. Signal Process. 46, 1998). The filter itself computes this recursion: its samples
//! have no noise, so its estimate stays at the truth.
//!
//! The bound of the smoothed estimate follows from the backward recursion of Bryson and Frazier. It
//! accumulates the information `L` of all later samples:
//! ```text
//! P_s = P - P L P                                   smoothed covariance
//! L-  = H' S^-1 H + (I - K H)' L (I - K H)          across an update
//! L   = Phi' L- Phi                                 across a transition
//! L   = 0                                           at the end
//! ```
//! This form needs no inverse of a covariance, which would be ill-conditioned for states that the
//! measurements hardly observe.

use crate::CampaignError;
use crate::columns::{Columns, Places};
use crate::grid::Grid;
use crate::record::BoundRecord;
use crate::tape::Tape;
use nalgebra::DMatrix;
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{Sink, StreamError, StreamErrorKind};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Assembly;
use navfuse_core::state::Layout;
use navfuse_core::state::covariance::{Covariance, Transition, Update};
use navfuse_core::state::manifold::MAX_TANGENT;
use navfuse_core::units::time::Time;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Computes the bound of an assembly made by
/// [`navfuse_core::run::scenario::Scenario::assemble_at_truth`], with one row every `every` ns;
/// `None` if it was stopped.
///
/// # Errors
/// Returns an error if the run fails or the folder for temporary files cannot be written.
pub fn bound(
    mut assembly: Assembly,
    columns: &Columns,
    point: usize,
    every: i64,
    stop: &AtomicBool,
) -> Result<Option<BoundRecord>, CampaignError> {
    let layout = Arc::clone(&assembly.composition.layout);
    let sensors = assembly.composition.sensors.iter().map(|s| s.info.name.as_str());
    let places = columns.places(&layout, sensors);
    let forward = Forward::new(layout.tangent, every)?;
    assembly.sinks.push(("bound".into(), Box::new(forward)));
    let mut finished = runner::run(assembly, stop, |_| {});
    if finished.interrupted {
        return Ok(None);
    }
    if let Some(error) = finished.error {
        return Err(CampaignError::BoundRun(error));
    }
    if let Some(event) = finished.events.iter().find(|e| e.about == "bound") {
        return Err(CampaignError::Bound(event.text.clone()));
    }
    let forward = finished
        .take_sink::<Forward>()
        .ok_or_else(|| CampaignError::Bound("the run recorded nothing".into()))?;
    let rows = backward(forward.tape, &layout, &places, columns.components.len())
        .map_err(CampaignError::tape)?;
    if rows.is_empty() {
        return Err(CampaignError::Bound(
            "the truth was never known while the filter ran: simulate a reference, \
             [sensor.reference]"
                .into(),
        ));
    }
    Ok(Some(BoundRecord { point, rows }))
}

/// A record of the forward pass.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// `Phi` since the previous record, row-major with padded rows.
    Step,
    /// `H`, `S` and `K` of an update with that many components.
    Update(usize),
    /// Number and time of an epoch; the record holds the state's values and `P`.
    Epoch(i64, Time),
}

/// Sink that stores the forward pass.
struct Forward {
    n: usize,
    stride: usize,
    grid: Grid,
    tape: Tape<Kind>,
    /// `Phi` since the last record; `moved` is set if it is not the identity.
    phi: Vec<f64>,
    moved: bool,
    work: Vec<f64>,
    h: Vec<f64>,
    /// Last epoch with a truth, if it is off the grid and neither a transition nor an update
    /// followed.
    last: Option<(Time, Vec<f64>, Vec<f64>)>,
}

impl Forward {
    fn new(n: usize, every: i64) -> Result<Self, CampaignError> {
        let stride = n.next_multiple_of(4);
        let tape = Tape::new().map_err(CampaignError::tape)?;
        let mut forward = Self {
            n,
            stride,
            grid: Grid::new(every),
            tape,
            phi: vec![0.0; n * stride],
            moved: false,
            work: Vec::new(),
            h: Vec::new(),
            last: None,
        };
        forward.reset();
        Ok(forward)
    }

    fn reset(&mut self) {
        self.phi.fill(0.0);
        (0..self.n).for_each(|i| self.phi[i * self.stride + i] = 1.0);
        self.moved = false;
    }

    fn push(&mut self, kind: Kind, parts: &[&[f64]]) -> Result<(), StreamError> {
        self.tape.push(kind, parts.iter().copied()).map_err(|e| {
            let error = CampaignError::tape(e);
            StreamError::of(StreamErrorKind::Write, error.to_string()).with_source(error)
        })
    }

    /// Writes the transition since the previous record.
    fn step(&mut self) -> Result<(), StreamError> {
        if self.moved {
            let phi = std::mem::take(&mut self.phi);
            self.push(Kind::Step, &[&phi])?;
            self.phi = phi;
            self.reset();
        }
        Ok(())
    }
}

impl Sink for Forward {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS | Wants::TRANSITIONS | Wants::CORRECTIONS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Transition(transition) => self.transition(transition),
            Record::Correction(correction) => self.correction(correction),
            Record::Epoch(epoch) => self.epoch(epoch),
            _ => Ok(()),
        }
    }

    fn finish(&mut self) -> Result<Option<String>, StreamError> {
        if let Some((time, values, p)) = self.last.take() {
            self.step()?;
            self.push(Kind::Epoch(self.grid.end(), time), &[&values, &p])?;
        }
        Ok(None)
    }
}

impl Forward {
    fn transition(&mut self, transition: &Transition) -> Result<(), StreamError> {
        self.last = None;
        transition.carry(&mut self.phi, self.stride, &mut self.work);
        self.moved = true;
        Ok(())
    }

    fn correction(&mut self, update: &Update) -> Result<(), StreamError> {
        self.last = None;
        self.step()?;
        let (m, w) = (update.m, update.columns.len());
        let mut h = std::mem::take(&mut self.h);
        h.clear();
        h.resize(m * self.n, 0.0);
        for a in 0..m {
            for (k, &c) in update.columns.iter().enumerate() {
                h[a * self.n + c] = update.h[a * w + k];
            }
        }
        self.push(Kind::Update(m), &[&h, &update.s, update.gain()])?;
        self.h = h;
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        if epoch.truth.is_none() {
            return Ok(());
        }
        let p: Vec<f64> = epoch.covariance.to_dense().as_slice().to_vec();
        match self.grid.due(epoch.state.time) {
            Some(number) => {
                self.step()?;
                self.push(Kind::Epoch(number, epoch.state.time), &[&epoch.state.values, &p])?;
            }
            None => self.last = Some((epoch.state.time, epoch.state.values.clone(), p)),
        }
        Ok(())
    }
}

type Rows = Vec<(i64, f64, Vec<f64>, Vec<f64>)>;

/// Runs the backward recursion of Bryson and Frazier over the stored records.
fn backward(tape: Tape<Kind>, layout: &Layout, places: &Places, width: usize) -> io::Result<Rows> {
    let n = layout.tangent;
    let stride = n.next_multiple_of(4);
    let mut l = DMatrix::<f64>::zeros(n, n);
    let mut rows = Vec::new();
    tape.backward(|kind, values| match kind {
        Kind::Step => {
            let phi = DMatrix::from_fn(n, n, |i, j| values[i * stride + j]);
            // L = Phi' L- Phi
            l = symmetric(phi.tr_mul(&l) * &phi);
        }
        Kind::Update(m) => {
            let (h, rest) = values.split_at(m * n);
            let (s, k) = rest.split_at(m * m);
            let h = DMatrix::from_row_slice(m, n, h);
            let k = DMatrix::from_row_slice(n, m, k);
            let Some(s) = DMatrix::from_row_slice(m, m, s).cholesky() else { return };
            // L- = H' S^-1 H + (I - K H)' L (I - K H)
            let a = DMatrix::identity(n, n) - k * &h;
            l = symmetric(a.tr_mul(&l) * &a + h.tr_mul(&s.solve(&h)));
        }
        Kind::Epoch(number, time) => {
            let (state, p) = values.split_at(layout.ambient);
            let p = DMatrix::from_column_slice(n, n, p);
            // P_s = P - P L P
            let smoothed = symmetric(&p - &p * &l * &p);
            let shown = [&p, &smoothed].map(|p| sigmas(layout, places, width, state, p));
            let [filtered, smoothed] = shown;
            rows.push((number, time.seconds(), filtered, smoothed));
        }
    })?;
    rows.reverse();
    Ok(rows)
}

/// Returns the symmetric part of a matrix, which rounding would otherwise slowly destroy.
fn symmetric(m: DMatrix<f64>) -> DMatrix<f64> {
    let transposed = m.transpose();
    (m + transposed) * 0.5
}

/// Returns the 1-sigma of every component in its display unit.
fn sigmas(
    layout: &Layout,
    places: &Places,
    width: usize,
    values: &[f64],
    p: &DMatrix<f64>,
) -> Vec<f64> {
    let mut covariance = Covariance::zero(p.nrows());
    for i in 0..p.nrows() {
        (0..=i).for_each(|j| covariance.set(i, j, p[(i, j)]));
    }
    let mut out = vec![f64::NAN; width];
    for &(slot, _, first) in &places.blocks {
        let block = &layout.blocks[slot];
        let mut sigma = [0.0; MAX_TANGENT];
        block.show_sigma(values, &covariance, &mut sigma);
        let n = block.operations.tangent;
        out[first..first + n].copy_from_slice(&sigma[..n]);
    }
    out
}
