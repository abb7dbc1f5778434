//! The blocks of the state over time: estimate, truth, error and bounds of each component.

use crate::axis::{Scale, short};
use crate::columns::{BOUNDS, Series};
use crate::corner::Legend;
use crate::history::{History, Row};
use crate::plots::Plots;
use crate::recording::Recording;
use crate::style::{BOUND, FILTERED, MAGNITUDE, TRUTH, axis as colour, label, path};
use crate::tally::{Excursion, Tally};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::state::Block;
use navfuse_core::state::manifold::{MAX_TANGENT, Manifold, Position, Reading};
use navfuse_core::units::thin::ROWS;
use navfuse_core::units::time::Time;
use std::any::TypeId;

/// The name of the bounds of the estimate beside those of estimate and reference.
const OF_ESTIMATE: &str = "±3σ of estimate";
/// Time for which the size of an error is drawn without a new truth, ns.
const HELD: i64 = 10_000_000_000;

/// Number of rows of all series of the states, and least number of one: a recording stays small where a run has
/// many states, or each twice, filtered and smoothed.
const ALL_ROWS: usize = 32 * ROWS;
const LEAST_ROWS: usize = 384;

/// The column of sigma in the histories of a component.
const SIGMA: usize = 1;

/// One component of a block.
pub struct Component {
    /// Name: `roll`.
    pub name: String,
    /// Unit of the block.
    pub unit: &'static str,
    /// First and last values, and the largest error in sigma.
    pub tally: Tally,
    /// The plots; `None` until the series are written.
    pub plots: Option<Plots>,
    /// Estimate, sigma, truth and error; the latter two are NaN where no truth is known.
    history: History<4, 2>,
    /// Estimate and sigma of the filter itself, in a run that is smoothed.
    filtered: History<2>,
    /// What a viewer sees during the run: error or estimate, and bounds.
    live: Option<Series>,
}

/// The series of one block that has an uncertainty.
pub struct BlockSeries {
    slot: usize,
    /// The process or sensor that the block belongs to.
    pub owner: String,
    /// The name of the block below its owner.
    pub name: String,
    /// The components of the block.
    pub components: Vec<Component>,
    /// Set where the truth is a constant of the scenario.
    pub constant: bool,
    /// What the difference from the truth is called: an error, unless the truth is a recorded
    /// reference, which has errors of its own.
    pub compared: &'static str,
    truth: &'static str,
    half_turn: f64,
    /// The first estimate: a position is shown in metres from the place at height zero under it.
    origin: Option<Vec<f64>>,
    /// Set for the position of the vehicle.
    pub is_position: bool,
    /// 1-sigma of a recorded reference in the unit of the block; zero for a truth.
    own: f64,
    /// Set where there is a truth or a reference.
    compares: bool,
}

/// The blocks of a run, without the fixed ones: those neither change nor have an uncertainty.
/// A truth that is not simulated is a recorded reference with its own sigma.
pub fn blocks(run: &RunInfo, full: bool) -> Vec<BlockSeries> {
    let vehicle = run.layout.vehicle();
    let at = |handle: Option<usize>, slot: usize| handle == Some(slot);
    let position = vehicle.position.map(|handle| handle.slot());
    let velocity = vehicle.velocity.map(|handle| handle.slot());
    let attitude = vehicle.attitude.map(|handle| handle.slot());
    let accuracy = run.reference.filter(|_| !run.simulated).unwrap_or_default();
    let free = || run.layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
    let components: usize = free().map(|(_, block)| block.operations.tangent).sum();
    let each = ALL_ROWS / (components * if run.smoothed { 2 } else { 1 }).max(1);
    let rows = if full { usize::MAX } else { each.clamp(LEAST_ROWS, ROWS) };
    let series = |(slot, block): (usize, &Block)| {
        let mut series = BlockSeries::new(slot, block, run.simulated, rows);
        series.is_position = at(position, slot);
        let own = match slot {
            _ if at(position, slot) => accuracy.position,
            _ if at(velocity, slot) => accuracy.velocity,
            _ if at(attitude, slot) => accuracy.attitude,
            _ => 0.0,
        };
        series.own = own / block.spec.display.scale;
        series.compares |= own > 0.0;
        series.components.iter_mut().for_each(|c| c.tally.reference = series.own);
        series
    };
    free().map(series).collect()
}

impl BlockSeries {
    fn new(slot: usize, block: &Block, simulated: bool, rows: usize) -> Self {
        let (owner, name) = block.name.split_once('.').unwrap_or(("", &block.name));
        let unit = block.spec.display.unit;
        let half_turn = match block.operations.reading {
            Reading::Angles => std::f64::consts::PI / block.spec.display.scale,
            _ => f64::INFINITY,
        };
        let component = |k: usize| Component {
            name: block.component(k),
            unit,
            tally: Tally::default(),
            plots: None,
            history: History::with_rows([0, 3], rows),
            // half the rows: with one key instead of two they are as many stretches
            filtered: History::with_rows([0], rows / 2),
            live: None,
        };
        Self {
            slot,
            owner: owner.to_owned(),
            name: name.to_owned(),
            components: (0..block.operations.tangent).map(component).collect(),
            constant: block.spec.truth.is_some() && !block.wanders,
            compared: if simulated { "error" } else { "difference" },
            truth: if simulated { "true" } else { "reference" },
            half_turn,
            origin: None,
            is_position: false,
            own: 0.0,
            compares: simulated,
        }
    }

    /// The names of some components together: `gnss.bias east, north`, or the block alone where they
    /// are all.
    pub fn names(&self, parts: &[usize]) -> String {
        let block = self.block_name();
        if parts.len() == self.components.len() {
            return block;
        }
        let names: Vec<&str> = parts.iter().map(|k| self.components[*k].name.as_str()).collect();
        format!("{block} {}", names.join(", "))
    }

    /// The full name of the block: `ins.attitude`.
    pub fn block_name(&self) -> String {
        match self.owner.as_str() {
            "" => self.name.clone(),
            owner => format!("{owner}.{}", self.name),
        }
    }

    /// The full name of a component: `ins.attitude roll`, or `dvl.scale` where there is one.
    pub fn full_name(&self, k: usize) -> String {
        let block = self.block_name();
        match self.components.len() {
            1 => block,
            _ => format!("{block} {}", self.components[k].name),
        }
    }

    /// The entity of a component and a leaf below it.
    pub fn entity(&self, k: usize, leaf: &str) -> re_sdk::EntityPath {
        path(&["state", &self.owner, &self.name, &self.components[k].name, leaf])
    }

    /// Set for a component with the filter's own estimate beside the smoothed one.
    pub fn is_smoothed(&self, k: usize) -> bool {
        !self.components[k].filtered.is_empty()
    }

    /// The entity of a component that a viewer sees during the run.
    pub fn live_entity(&self, k: usize) -> re_sdk::EntityPath {
        path(&["live", "state", &self.owner, &self.name, &self.components[k].name])
    }

    /// Computes what is shown of a block: its reading, and of a position the metres from its origin.
    fn show(&mut self, block: &Block, values: &[f64], out: &mut [f64]) {
        let n = block.operations.tangent;
        let origin = self.origin.get_or_insert_with(|| values[block.range()].to_vec());
        match block.operations.reading {
            Reading::Tangent => {
                let value = &values[block.range()];
                (block.operations.local)(value, origin, &mut out[..n]);
                if block.operations.kind == TypeId::of::<Position>() {
                    out[2] = -Position::load::<f64>(value).height;
                }
                out[..n].iter_mut().for_each(|x| *x /= block.spec.display.scale);
            }
            _ => block.show(values, out),
        }
    }

    /// Adds the filter's own estimate in a run that is smoothed.
    pub fn filtered(&mut self, epoch: &Epoch<'_>) {
        let block = &epoch.layout.blocks[self.slot];
        let (mut shown, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        self.show(block, &epoch.state.values, &mut shown);
        block.show_sigma(&epoch.state.values, epoch.covariance, &mut sigma);
        for (k, c) in self.components.iter_mut().enumerate() {
            c.tally.begin(sigma[k]);
            c.filtered.push(epoch.state.time.nanos(), [shown[k], sigma[k]]);
        }
    }

    /// Adds an estimate and, where it is known, the truth; `left` takes the excursions of the
    /// error out of its bounds that ended.
    pub fn epoch(
        &mut self,
        recording: &Recording,
        epoch: &Epoch<'_>,
        left: &mut Vec<(String, Excursion)>,
    ) -> Result<(), StreamError> {
        let block = &epoch.layout.blocks[self.slot];
        let values = &epoch.state.values;
        let (mut shown, mut sigma) = ([0.0; MAX_TANGENT], [0.0; MAX_TANGENT]);
        let (mut truth, mut error) = ([f64::NAN; MAX_TANGENT], [f64::NAN; MAX_TANGENT]);
        self.show(block, values, &mut shown);
        block.show_sigma(values, epoch.covariance, &mut sigma);
        if let Some(known) = epoch.truth.filter(|t| t.known[self.slot]) {
            self.show(block, &known.state.values, &mut truth);
            known.show_error(epoch.layout, self.slot, epoch.state, &mut error);
        }
        let time = epoch.state.time;
        for k in 0..self.components.len() {
            let (x, s, e) = (shown[k], sigma[k], error[k]);
            let c = &mut self.components[k];
            c.history.push(time.nanos(), [x, s, truth[k], e]);
            if let Some(excursion) = c.tally.add(time, x, s, e) {
                left.push((self.full_name(k), excursion));
            }
            if recording.is_live() {
                let (known, bound) = (e.is_finite(), 3.0 * s);
                let entity = self.live_entity(k);
                let c = &mut self.components[k];
                let series = c.live.get_or_insert_with(|| {
                    let name = match known {
                        true => format!("{} {}", c.name, self.compared),
                        false => c.name.clone(),
                    };
                    Series::live(entity, &label(&name, c.unit), colour(k), 2.4)
                });
                let middle = if known { [e, bound, -bound] } else { [x, x + bound, x - bound] };
                series.push(recording, time, &middle)?;
            }
        }
        Ok(())
    }

    /// Sends what viewers see during the run.
    pub fn refresh(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let live = self.components.iter_mut().filter_map(|c| c.live.as_mut());
        live.into_iter().try_for_each(|series| series.flush(recording))
    }

    /// Writes the whole run, and chooses units and ranges from it. The components of a block have
    /// the same units, except those that a unit larger than the block's own would make small.
    pub fn write(&mut self, recording: &Recording) -> Result<(), StreamError> {
        let rows: Vec<_> = self.components.iter().map(|c| c.history.rows_under(SIGMA)).collect();
        let plots = self.components.iter().zip(&rows);
        let plots = plots.map(|(c, rows)| {
            Plots::new(rows, &c.filtered.rows_under(SIGMA), self.own, self.legends(c, rows))
        });
        let mut plots: Vec<Option<Plots>> = plots.collect();
        let sizes = plots.iter().flatten().map(Plots::sizes);
        let [value, error] =
            sizes.fold([0.0_f64; 2], |max, size| [max[0].max(size[0]), max[1].max(size[1])]);
        for (k, plots) in plots.iter_mut().enumerate() {
            let Some(plots) = plots.take() else { continue };
            let plots = plots.in_units(self.components[k].unit, value, error);
            self.write_component(recording, k, &rows[k], &plots)?;
            self.components[k].plots = Some(plots);
        }
        Ok(())
    }

    /// The sizes of the legends of a component: of estimate, error, sigma and error in sigma.
    fn legends(&self, component: &Component, rows: &[Row<4>]) -> [Legend; 4] {
        let known = usize::from(rows.iter().any(|row| row.1[3].is_finite()));
        let smoothed = usize::from(!component.filtered.is_empty());
        let errors = known == 1 && !self.constant;
        // calibrations share their tab
        let plots = if self.constant { 4 } else { self.components.len().max(3) };
        let columns = if errors { 4 } else { 3 };
        let of = |lines: usize, letters: usize| Legend { lines, letters, columns, rows: plots };
        let name = component.name.chars().count() + component.unit.chars().count() + 4;
        let [truth, filter] =
            [known * (self.truth.len() + 1), smoothed * 7].map(|more| name + more);
        [
            of(2 + known + 2 * smoothed, truth.max(filter)),
            of(if self.own > 0.0 { 3 } else { 2 }, name + self.compared.len() + 8),
            of(1 + known + smoothed, self.size().chars().count().max(smoothed * 12)),
            Legend { lines: 2, letters: self.ratio().chars().count(), columns: 4, rows: 3 },
        ]
    }

    /// The name of the magnitude of an error.
    fn size(&self) -> String {
        format!("|{}|", self.compared)
    }

    /// The name of the bounds by estimate and reference together, with their size at the end: they may be
    /// beyond the plot. `None` for a truth.
    fn both(&self, rows: &[Row<4>], unit: Scale<'_>) -> Option<String> {
        let (_, [_, sigma, ..]) = rows.last().filter(|_| self.own > 0.0)?;
        let size = short(3.0 * sigma.hypot(self.own) / unit.size);
        Some(format!("±3σ of both: ±{size} {}", unit.unit))
    }

    /// The title of the plot of a component while the run goes on.
    pub fn live_title(&self, name: &str, k: usize) -> String {
        let unit = self.components[k].unit;
        match self.compares {
            true => label(&format!("{name} {}", self.compared), unit),
            false => label(name, unit),
        }
    }

    /// The name of an error in sigma: of estimate and reference together where the reference is
    /// recorded.
    pub fn ratio(&self) -> String {
        let of = if self.own > 0.0 { "sigma of both" } else { "sigma" };
        format!("{} / {of}", self.compared)
    }

    /// Writes the error of a component in sigma.
    pub fn write_normalised(&self, recording: &Recording, k: usize) -> Result<(), StreamError> {
        let line = (self.ratio(), colour(k), 1.6);
        let mut series = Series::between(self.entity(k, "normalised"), line, ("±3", BOUND));
        for (time, [_, s, _, e]) in self.components[k].history.rows() {
            if e.is_finite() && s > 0.0 {
                let ratio = e / s.hypot(self.own);
                series.push(recording, Time::from_nanos(time), &[ratio, 3.0, -3.0])?;
            }
        }
        series.flush(recording)
    }

    fn write_component(
        &self,
        recording: &Recording,
        k: usize,
        rows: &[Row<4>],
        plots: &Plots,
    ) -> Result<(), StreamError> {
        let c = &self.components[k];
        let (v, e) = (plots.value, plots.error);
        let jump = self.half_turn / v.size;
        let name = label(&c.name, v.unit);
        let mut estimate =
            Series::bounded(self.entity(k, "estimate"), name.clone(), colour(k), 2.4)
                .broken_at(jump);
        let truth = (format!("{} {name}", self.truth), TRUTH, 1.6);
        let mut truth = Series::lines(self.entity(k, "truth"), &[truth]).broken_at(jump);
        let title = label(&format!("{} {}", c.name, self.compared), e.unit);
        let mut lines = vec![(title, colour(k), 1.8)];
        match self.both(rows, e) {
            None => lines.extend([BOUNDS; 2].map(|name| (name.to_owned(), BOUND, 1.2))),
            Some(both) => {
                lines.extend([OF_ESTIMATE; 2].map(|name| (name.to_owned(), BOUND, 1.2)));
                lines.extend([(both.clone(), MAGNITUDE, 1.6), (both, MAGNITUDE, 1.6)]);
            }
        }
        let mut error = Series::lines(self.entity(k, "error"), &lines);
        let powers = [(self.size(), MAGNITUDE, 0.8), ("sigma".to_owned(), colour(k), 2.4)];
        let powers = if plots.known { &powers[..] } else { &powers[1..] };
        let mut sigma = Series::lines(self.entity(k, "sigma"), powers);
        // a reference may be slower than the estimates
        let mut last = (i64::MIN, f64::NAN);
        let logarithm = |x: f64| if x > 0.0 { (x / e.size).log10() } else { f64::NAN };
        // an error near zero stays in the plot
        let size = |error: f64| match error.is_finite() {
            true => logarithm(error.abs().max(f64::MIN_POSITIVE)).max(plots.logarithms[0]),
            false => f64::NAN,
        };
        let filtered = c.filtered.rows_under(SIGMA);
        if !filtered.is_empty() {
            let name = format!("filter {name}");
            let ([line, bound], entity) = (FILTERED, self.entity(k, "filtered"));
            let mut series =
                Series::between(entity, (name, line, 1.2), ("filter ±3σ", bound)).broken_at(jump);
            let sigma = ("filter sigma".to_owned(), line, 1.2);
            let mut sigma = Series::lines(self.entity(k, "filtered_sigma"), &[sigma]);
            for (time, [x, s]) in filtered {
                let time = Time::from_nanos(time);
                sigma.push(recording, time, &[logarithm(s)])?;
                let [x, b] = [x / v.size, 3.0 * s / v.size];
                series.push(recording, time, &[x, x + b, x - b])?;
            }
            series.flush(recording)?;
            sigma.flush(recording)?;
        }
        for (time, [x, s, t, d]) in rows {
            let time = Time::from_nanos(*time);
            let [x, b] = [x / v.size, 3.0 * s / v.size];
            estimate.push(recording, time, &[x, x + b, x - b])?;
            if t.is_finite() {
                truth.push(recording, time, &[t / v.size])?;
            }
            if d.is_finite() && !self.constant {
                let [d, b, both] = [*d, 3.0 * s, 3.0 * s.hypot(self.own)].map(|x| x / e.size);
                error.push(recording, time, &[d, b, -b, both, -both][..lines.len()])?;
            }
            if d.is_finite() || time.nanos().saturating_sub(last.0) > HELD {
                last = (time.nanos(), *d);
            }
            let both = [size(last.1), logarithm(*s)];
            sigma.push(recording, time, &both[2 - powers.len()..])?;
        }
        [estimate, truth, error, sigma].iter_mut().try_for_each(|s| s.flush(recording))
    }
}
