//! How far runs are apart: the differences of the states from the first run, in sigma.

use super::{Run, between, estimated, look, title};
use crate::history::{BlockHistory, Row};
use crate::plots::{curve, over_time};
use navfuse_figures::{Axis, Band, Figure};
use serde::Serialize;

/// Times that belong to the same epoch differ by less, s.
pub(crate) const SAME: f64 = 1e-6;
/// Number of states in the figure.
const SHOWN: usize = 6;
/// Least upper end of the axis, sigma: a smaller difference hardly counts.
const LEAST: f64 = 0.5;

/// Largest difference of a component from the first run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LargestDifference {
    /// Block and component, such as `ins.attitude yaw`.
    pub state: String,
    /// Short name of the run that differs from the first one.
    pub run: String,
    /// The difference, in the sigma of two estimates with independent errors.
    pub sigmas: f64,
    /// Time of the difference, s.
    pub time_s: f64,
}

/// Differences of a component of a run from the first run.
struct Course {
    state: String,
    run: usize,
    /// Time, s, and difference over its sigma.
    points: Vec<[f64; 2]>,
    /// The point with the largest difference.
    largest: [f64; 2],
}

/// Lists the largest difference of every component of every run, the largest first.
pub(crate) fn largest(runs: &[Run]) -> Vec<LargestDifference> {
    let courses = courses(runs).into_iter();
    let largest = courses.map(|Course { state, run, largest: [time_s, sigmas], .. }| {
        LargestDifference { state, run: runs[run].letter.clone(), sigmas, time_s }
    });
    largest.collect()
}

/// Plots the states that differ most over time, all on one scale; `None` for runs without common
/// times.
pub fn figure(runs: &[Run]) -> Option<Figure> {
    let first = &runs.first()?.letter;
    let courses = courses(runs);
    let most = courses.first()?.largest[1].abs();
    let limit = (1.1 * most).max(LEAST);
    let mut states = super::union(courses.iter().map(|c| c.state.as_str()));
    states.truncate(SHOWN);
    let panel = |state: &str| {
        let mut of_state: Vec<&Course> = courses.iter().filter(|c| c.state == state).collect();
        of_state.sort_by_key(|c| c.run);
        let curves = of_state.iter().map(|c| {
            let name = format!("{} - {first}", runs[c.run].letter);
            curve(&name, look(c.run), c.points.iter().copied())
        });
        let ends =
            of_state.iter().flat_map(|c| c.points.first().into_iter().chain(c.points.last()));
        let band = Band {
            name: "±3 sigma, independent".into(),
            points: ends.map(|p| [p[0], -3.0, 3.0]).collect(),
        };
        let bands = if limit >= 3.0 { vec![band] } else { Vec::new() };
        let y = Axis::linear("difference [sigma]").within([-limit, limit]);
        over_time(state, y, curves.collect(), bands)
    };
    Some(Figure {
        name: "largest-differences".into(),
        title: "Largest differences".into(),
        columns: 3,
        panels: states.into_iter().map(panel).collect(),
    })
}

/// Differences of all components, the largest first.
fn courses(runs: &[Run]) -> Vec<Course> {
    let Some((first, others)) = runs.split_first() else { return Vec::new() };
    let mut courses = Vec::new();
    for name in estimated(runs) {
        let Some(from) = first.history.block(name).filter(|b| b.uncertain()) else { continue };
        for (k, run) in others.iter().enumerate() {
            let Some(block) = run.history.block(name).filter(|b| b.uncertain()) else { continue };
            let course =
                |c: usize| Course::new(k + 1, title(block, c), &difference(block, from, c));
            courses.extend((0..block.components.len()).filter_map(course));
        }
    }
    courses.sort_by(|a, b| b.largest[1].abs().total_cmp(&a.largest[1].abs()));
    courses
}

impl Course {
    fn new(run: usize, state: String, differences: &[[f64; 3]]) -> Option<Self> {
        let points =
            differences.iter().map(|[time, difference, sigma]| [*time, difference / sigma]);
        let points: Vec<[f64; 2]> = points.filter(|p| p[1].is_finite()).collect();
        let largest = points.iter().copied().max_by(|a, b| a[1].abs().total_cmp(&b[1].abs()))?;
        Some(Self { state, run, points, largest })
    }
}

/// Time, difference of a component, and the 1-sigma of the difference of independent estimates.
///
/// Errors and constants are interpolated to the times of the first run. The estimate of a state
/// that moves is compared at common times only, since it changes between them.
pub(crate) fn difference(block: &BlockHistory, first: &BlockHistory, k: usize) -> Vec<[f64; 3]> {
    let rows: Vec<&Row> = block.shown().collect();
    let errors = block.compared.is_some() && first.compared.is_some();
    let smooth = errors || (block.constant() && first.constant());
    let at = |row: &Row| -> Option<[f64; 3]> {
        let next = rows.partition_point(|r| r.time < row.time - SAME);
        let later = rows.get(next)?;
        let earlier = match (later.time - row.time).abs() < SAME {
            true => later,
            false if smooth && next > 0 => &rows[next - 1],
            false => return None,
        };
        let part = if later.time > earlier.time {
            (row.time - earlier.time) / (later.time - earlier.time)
        } else {
            0.0
        };
        let mean = |a: f64, b: f64| a + part * (b - a);
        let value = |r: &Row| {
            if errors {
                Some(r.error.get(k)? - row.error.get(k)?)
            } else {
                between(block, &r.estimate, &row.estimate, k)
            }
        };
        let sigma = mean(*earlier.sigma.get(k)?, *later.sigma.get(k)?).hypot(*row.sigma.get(k)?);
        Some([row.time, mean(value(earlier)?, value(later)?), sigma])
    };
    first.shown().filter_map(at).collect()
}
