//! The blocks of the state over time: estimate, truth, error and bounds of each component.

use crate::axis::{self, Scale};
use crate::columns::Series;
use crate::corner::quietest;
use crate::history::{History, Row};
use crate::recording::Recording;
use crate::style::{BOUND, FILTERED, MAGNITUDE, TRUTH, axis as colour, label, path};
use crate::tally::{Excursion, Tally};
use navfuse_core::model::record::Epoch;
use navfuse_core::model::stream::{RunInfo, StreamError};
use navfuse_core::state::Block;
use navfuse_core::state::manifold::{MAX_TANGENT, Manifold, Position, Reading};
use navfuse_core::units::time::Time;
use re_sdk::blueprint::components::Corner2D;
use std::any::TypeId;

/// Share of the run at its end that has plots of its own.
const END: f64 = 0.25;
/// Share of the run at its begin whose bounds do not count for a range: a wide prior would flatten
/// the rest of the plot.
const BEGIN: f64 = 0.1;
/// Size of an error before that, in errors and bounds after it, up to which it counts for a range.
const EARLY: f64 = 2.0;
/// Least range of the plot of a sigma, in powers of ten.
const DECADES: f64 = 1.0;

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

/// The plots of a component.
pub struct Plots {
    /// The unit of the estimate.
    pub value: Scale<'static>,
    /// The unit of error and sigma.
    pub error: Scale<'static>,
    /// Range of estimate and truth, over the run and at its end.
    pub values: [[f64; 2]; 2],
    /// Range of the error and its bounds, over the run and at its end; `None` without a truth.
    pub errors: Option<[[f64; 2]; 2]>,
    /// Range of the decimal logarithm of sigma and error.
    pub logarithms: [f64; 2],
    /// The corners of the legends.
    pub corners: Corners,
}

/// The corners of the legends of a component.
pub struct Corners {
    /// In the plot of the estimate.
    pub value: Corner2D,
    /// In the plot of the error.
    pub error: Corner2D,
    /// In the plot of sigma.
    pub sigma: Corner2D,
    /// In the plot of the error in sigma.
    pub normalised: Corner2D,
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
    let free = run.layout.blocks.iter().enumerate().filter(|(_, b)| b.tangent.is_some());
    let series = |(slot, block): (usize, &Block)| {
        let mut series = BlockSeries::new(slot, block, run.simulated, full);
        series.is_position = at(position, slot);
        let own = match slot {
            _ if at(position, slot) => accuracy.position,
            _ if at(velocity, slot) => accuracy.velocity,
            _ if at(attitude, slot) => accuracy.attitude,
            _ => 0.0,
        };
        series.own = own / block.spec.display.scale;
        series.components.iter_mut().for_each(|c| c.tally.reference = series.own);
        series
    };
    free.map(series).collect()
}

impl BlockSeries {
    fn new(slot: usize, block: &Block, simulated: bool, full: bool) -> Self {
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
            history: History::new([0, 3], full),
            filtered: History::new([0], full),
            live: None,
        };
        Self {
            slot,
            owner: owner.to_owned(),
            name: name.to_owned(),
            components: (0..block.operations.tangent).map(component).collect(),
            constant: block.spec.truth.is_some() && !block.wanders,
            compared: if simulated { "error" } else { "minus reference" },
            truth: if simulated { "true" } else { "reference" },
            half_turn,
            origin: None,
            is_position: false,
            own: 0.0,
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

    fn block_name(&self) -> String {
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
                    let name = if known { format!("{} error", c.name) } else { c.name.clone() };
                    Series::bounded(entity, label(&name, c.unit), colour(k), 2.4)
                        .for_viewers()
                        .broken_in_outages()
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
        let rows: Vec<_> = self.components.iter().map(|c| c.history.rows()).collect();
        let mut plots: Vec<Option<Plots>> =
            rows.iter().map(|rows| Plots::new(rows, self.own)).collect();
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

    /// The name of an error in sigma: of estimate and reference together where the reference is
    /// recorded.
    pub fn ratio(&self) -> String {
        let of = if self.own > 0.0 { "sigma of both" } else { "sigma" };
        format!("{} / {of}", self.compared)
    }

    /// Writes the error of a component in sigma.
    pub fn write_normalised(&self, recording: &Recording, k: usize) -> Result<(), StreamError> {
        let line = (self.ratio(), colour(k), 1.6);
        let bound = |name: &str| (name.to_owned(), BOUND, 1.2);
        let lines = [line, bound("+3"), bound("-3")];
        let mut series = Series::lines(self.entity(k, "normalised"), &lines);
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
        let mut error = Series::bounded(self.entity(k, "error"), title, colour(k), 1.8);
        let powers = [
            ("magnitude of the error".to_owned(), MAGNITUDE, 0.8),
            ("sigma".to_owned(), colour(k), 2.4),
        ];
        let known = rows.iter().any(|row| row.1[3].is_finite());
        let powers = if known { &powers[..] } else { &powers[1..] };
        let mut sigma = Series::lines(self.entity(k, "sigma"), powers);
        let logarithm = |x: f64| if x > 0.0 { (x / e.size).log10() } else { f64::NAN };
        let filtered = c.filtered.rows();
        if !filtered.is_empty() {
            let name = format!("filter {name}");
            let mut series =
                Series::bounded(self.entity(k, "filtered"), name, FILTERED, 1.2).broken_at(jump);
            for (time, [x, s]) in filtered {
                let [x, b] = [x / v.size, 3.0 * s / v.size];
                series.push(recording, Time::from_nanos(time), &[x, x + b, x - b])?;
            }
            series.flush(recording)?;
        }
        for (time, [x, s, t, d]) in rows {
            let time = Time::from_nanos(*time);
            let [x, b] = [x / v.size, 3.0 * s / v.size];
            estimate.push(recording, time, &[x, x + b, x - b])?;
            if t.is_finite() {
                truth.push(recording, time, &[t / v.size])?;
            }
            if d.is_finite() && !self.constant {
                let [d, b] = [d / e.size, 3.0 * s / e.size];
                error.push(recording, time, &[d, b, -b])?;
            }
            let both = [logarithm(d.abs()), logarithm(*s)];
            sigma.push(recording, time, &both[2 - powers.len()..])?;
        }
        [estimate, truth, error, sigma].iter_mut().try_for_each(|s| s.flush(recording))
    }
}

impl Plots {
    /// The ranges in the unit of the block.
    fn new(rows: &[Row<4>], own: f64) -> Option<Self> {
        let (first, last) = (rows.first()?.0, rows.last()?.0);
        let span = (last - first) as f64;
        let begin = first + (BEGIN * span) as i64;
        let end = end_of_run(first, last);
        let over = |from: i64, bounds_from: i64, values: &dyn Fn(&[f64; 4]) -> [f64; 4]| {
            let mut range = [f64::INFINITY, f64::NEG_INFINITY];
            for (time, row) in rows.iter().filter(|row| row.0 >= from) {
                let values = values(row);
                let count = if *time >= bounds_from { 4 } else { 2 };
                for v in values[..count].iter().filter(|v| v.is_finite()) {
                    range = [range[0].min(*v), range[1].max(*v)];
                }
            }
            range
        };
        let value = |r: &[f64; 4]| [r[0], r[2], r[0] + 3.0 * r[1], r[0] - 3.0 * r[1]];
        let error = |r: &[f64; 4]| match r[3].is_finite() {
            true => [r[3], -r[3], 3.0 * r[1], -3.0 * r[1]],
            false => [f64::NAN; 4],
        };
        let known = |r: &[f64; 2]| r[0] <= r[1];
        // the first errors are as large as a prior: the plot of sigma shows their size
        let (usual, all) = (over(begin, begin, &error), over(first, begin, &error));
        let whole = [all[0].max(EARLY * usual[0]), all[1].min(EARLY * usual[1])];
        let errors = [if known(&usual) { whole } else { all }, over(end, end, &error)];
        let sizes = |r: &[f64; 4]| match r[1] > 0.0 {
            true => [r[1], r[3].abs(), r[1], r[1]],
            false => [f64::NAN; 4],
        };
        let [low, high] = over(first, first, &sizes);
        let sigmas = rows.iter().map(|r| r.1[1]).filter(|s| *s > 0.0);
        let least = sigmas.fold(f64::INFINITY, f64::min);
        let scale = Scale { unit: "", size: 1.0 };
        let values = [over(first, begin, &value), over(end, end, &value)];
        // an error near zero has no lower bound on this axis
        let [low, high] = [(0.1 * least).max(low), high].map(f64::log10);
        // a sigma that hardly changes is a flat line, and no enlarged rounding
        let spare = (0.5 * (DECADES - (high - low))).max(0.0);
        let logarithms = [low - spare, high + spare];
        let ratio = |r: &[f64; 4]| [r[3] / r[1].hypot(own), 3.0, -3.0];
        let size = rows.iter().map(|row| ratio(&row.1)[0].abs()).fold(4.0, f64::max);
        let corners = Corners {
            value: quietest(rows, value, values[0]),
            error: quietest(rows, |r| [r[3], 3.0 * r[1], -3.0 * r[1]], errors[0]),
            sigma: quietest(rows, |r| [r[1], r[3].abs()].map(f64::log10), logarithms),
            normalised: quietest(rows, ratio, [-size, size]),
        };
        Some(Self {
            value: scale,
            error: scale,
            values,
            errors: errors.iter().all(known).then_some(errors),
            logarithms,
            corners,
        })
    }

    /// The sizes of value and error at the end of the run, which determine the units.
    fn sizes(&self) -> [f64; 2] {
        let end = self.errors.as_ref().map_or(&self.values[1], |errors| &errors[1]);
        [self.values[1][0].abs().max(self.values[1][1].abs()), 0.5 * (end[1] - end[0])]
    }

    /// The same in the units that fit those sizes.
    fn in_units(mut self, unit: &'static str, value: f64, error: f64) -> Self {
        // a ratio near one is read as a number
        let one = Scale { unit, size: 1.0 };
        let large = axis::scale(unit, value);
        // a depth of 45 m is not read in the kilometres of north and east
        let small = large.size > 1.0 && self.sizes()[0] < axis::LEAST * large.size;
        self.value = if unit.is_empty() || small { one } else { large };
        self.error = axis::scale(unit, error);
        let (v, e) = (self.value.size, self.error.size);
        self.values.iter_mut().flatten().for_each(|x| *x /= v);
        self.errors.iter_mut().flatten().flatten().for_each(|x| *x /= e);
        self.logarithms.iter_mut().for_each(|x| *x -= e.log10());
        self
    }
}

/// The time from which on the end of the run has plots of its own.
pub fn end_of_run(first: i64, last: i64) -> i64 {
    last - (END * (last - first) as f64) as i64
}
