//! `Phi` against central differences of `propagate`, and `Q`.
//!
//! The check compares the rates `(Phi - I) / dt`, extrapolated from a whole step and a half step to
//! zero, because a model may leave out terms of the second order in the step.

use crate::lab::{Lab, reach};
use crate::noise::fault;
use crate::{Failure, Report};
use navfuse_core::model::process::{Input, Interval};
use navfuse_core::nalgebra::DMatrix;
use navfuse_core::state::manifold::{MAX_TANGENT, Reading};
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;

/// Largest accepted error of an element of `Phi`, relative to the largest element of its block.
const BOUND: f64 = 0.02;
/// Negligible effect of an error on a state, relative to the largest effect of a prior sigma.
const NEGLIGIBLE: f64 = 1e-4;
/// Number of checked steps of the run.
const STEPS: usize = 12;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    for part in lab.processes() {
        let outcome = of_process(lab);
        report.add("transition", part.about, outcome);
    }
}

/// One step of the composition's process models, which share `Phi`.
struct Step<'a> {
    lab: &'a Lab<'a>,
    interval: Interval<'a>,
}

impl Step<'_> {
    /// The state after the step, `Phi` and `Q`.
    fn from(&self, state: &State) -> Result<(State, DMatrix<f64>, DMatrix<f64>), Failure> {
        let composition = &self.lab.composition;
        let mut transition = composition.transition.clone();
        transition.compile(&composition.layout);
        let mut state = state.clone();
        for process in &composition.processes {
            let mut model = process.model.boxed_clone();
            model.restart();
            (model.propagate(&composition.layout, &mut state, &self.interval, &mut transition))
                .map_err(|e| {
                    let (name, time) = (&process.name, self.interval.to);
                    let what = format!("propagate of {name} fails near the run, at {time}");
                    Failure::during(what, e)
                })?;
        }
        let n = composition.layout.tangent;
        Ok((state, transition.phi_dense(n), transition.noise_dense(n)))
    }

    /// `(Phi - I) / dt` as the model gives it, and by central differences.
    fn rates(&self, state: &State) -> Result<[DMatrix<f64>; 2], Failure> {
        let (layout, dt) = (&self.lab.composition.layout, self.interval.duration());
        let (after, phi, q) = self.from(state)?;
        if let Some(fault) = fault(&q) {
            return Err(Failure::new(format!(
                "Q over {dt} s is {fault}; set every declared block of Q in every step, for \
                 example to G S G' dt"
            )));
        }
        let identity = DMatrix::identity(layout.tangent, layout.tangent);
        Ok([(phi - &identity) / dt, (numeric(layout, self, state, &after)? - identity) / dt])
    }
}

fn of_process(lab: &Lab<'_>) -> Result<String, Failure> {
    let layout = &*lab.composition.layout;
    let driver = lab.composition.processes.iter().find_map(|p| p.input);
    let steps: Vec<(&State, &Sample)> = (lab.moments.windows(2))
        .filter(|w| {
            w[1].sample.time > w[0].state.time && driver.is_none_or(|d| w[1].sample.sensor.0 == d)
        })
        .map(|w| (&w[0].state, &w[1].sample))
        .collect();
    if steps.is_empty() {
        return Err(
            "the run has no step of it; lengthen the run, or set the rate of its driving sensor"
                .into(),
        );
    }
    let (mut worst, count) = (0.0_f64, STEPS.min(steps.len()));
    for k in 0..count {
        let (state, sample) = steps[k * steps.len() / count];
        let duration = sample.time.since(state.time);
        let half = Time::from_nanos(i64::midpoint(state.time.nanos(), sample.time.nanos()));
        let input = driver.map(|_| Input { sample, duration, usual: duration, spread: None });
        let rates = |to: Time| {
            let interval = Interval { from: state.time, to, input };
            Step { lab, interval }.rates(state)
        };
        let ([given, numeric], [given_half, numeric_half]) = (rates(sample.time)?, rates(half)?);
        let (given, numeric) = (given_half * 2.0 - given, numeric_half * 2.0 - numeric);
        worst = worst.max(compare(layout, &given, &numeric, duration)?);
    }
    Ok(format!(
        "Phi is within {worst:.1e} of central differences, Q is a covariance, in {count} steps"
    ))
}

/// `Phi` by central differences of the step.
fn numeric(
    layout: &Layout,
    step: &Step<'_>,
    state: &State,
    after: &State,
) -> Result<DMatrix<f64>, Failure> {
    let mut phi = DMatrix::zeros(layout.tangent, layout.tangent);
    for block in layout.blocks.iter().filter(|b| b.tangent.is_some()) {
        for (axis, column) in block.tangent_range().enumerate() {
            let mut size =
                block.spec.sigma[axis].max(1e-2 * reach(block, &state.values[block.range()], axis));
            if block.operations.reading == Reading::Angles {
                size = size.min(0.05); // a sine is linear up to there, to 0.05^2 / 6
            }
            for size in [size, -size] {
                let (mut moved, mut delta) = (state.clone(), [0.0; MAX_TANGENT]);
                delta[axis] = size;
                (block.operations.retract)(
                    &mut moved.values[block.range()],
                    &delta[..block.operations.tangent],
                );
                let (moved, _, _) = step.from(&moved)?;
                for row in layout.blocks.iter().filter(|b| b.tangent.is_some()) {
                    let mut local = [0.0; MAX_TANGENT];
                    let n = row.operations.tangent;
                    (row.operations.local)(
                        &moved.values[row.range()],
                        &after.values[row.range()],
                        &mut local[..n],
                    );
                    row.tangent_range()
                        .zip(local)
                        .for_each(|(i, l)| phi[(i, column)] += l / (2.0 * size));
                }
            }
        }
    }
    Ok(phi)
}

/// Largest error that is not negligible, relative to its block.
fn compare(
    layout: &Layout,
    given: &DMatrix<f64>,
    numeric: &DMatrix<f64>,
    dt: f64,
) -> Result<f64, Failure> {
    let n = layout.tangent;
    let estimated = || layout.blocks.iter().filter(|b| b.tangent.is_some());
    let sigma: Vec<f64> = estimated().flat_map(|b| b.spec.sigma.iter().copied()).collect();
    let mut worst = 0.0_f64;
    for row in estimated() {
        for i in row.tangent_range() {
            let effect = (0..n).map(|j| numeric[(i, j)].abs() * sigma[j]).fold(0.0, f64::max);
            for column in estimated() {
                let of_block =
                    |i: usize| column.tangent_range().map(move |j| numeric[(i, j)].abs());
                let largest =
                    row.tangent_range().flat_map(of_block).fold(f64::MIN_POSITIVE, f64::max);
                for (axis, j) in column.tangent_range().enumerate() {
                    let error = (given[(i, j)] - numeric[(i, j)]).abs();
                    // rounding of the differences of a row that does not change
                    let rounding = 1e-9 / dt * sigma[i] / sigma[j].max(f64::MIN_POSITIVE);
                    if error <= rounding || error * sigma[j] <= NEGLIGIBLE * effect {
                        continue;
                    }
                    let relative = error / largest;
                    if relative > BOUND || relative.is_nan() {
                        return Err(Failure::new(format!(
                            "the rate (Phi - I) / dt of {}, axis {}, with respect to {}, axis {}, \
                             is {:.6e}; central differences of propagate give {:.6e}; correct the \
                             term in `propagate`, and declare its place with Composer::transition \
                             if it has none; in a `Step`, compute with its T, and without functions \
                             that branch at zero, such as Rotation3::from_scaled_axis, whose \
                             derivative is lost there: Rotation::retract has it",
                            row.name,
                            i - row.tangent_range().start + 1,
                            column.name,
                            axis + 1,
                            given[(i, j)],
                            numeric[(i, j)]
                        )));
                    }
                    worst = worst.max(relative);
                }
            }
        }
    }
    Ok(worst)
}
