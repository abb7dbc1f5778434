//! Effect of each sensor on the states that no process moves: priors left far behind, and sensors
//! that contradict one another.
//!
//! A correction moves state `i` by `(K y)_i`, whose variance is `(K S K')_ii`. The innovations `y`
//! of a consistent filter are white, so the corrections of one sensor are uncorrelated with each
//! other and with those of another sensor, and their sum over the run is Gaussian with the sum of
//! the variances. For a constant state this sum is the final estimate minus the prior mean, and its
//! variance is the prior covariance minus the posterior. It holds for a random walk as well, and
//! after an inflation of the covariance.
//!
//! The covariance itself is accurate to a few per cent, as far as the models are linear. A sensor
//! that hardly corrects a state has a small difference of two large variances, and their errors
//! would decide. So the variance of every sum contains the share of the prior variance by which a
//! sigma may be wrong without a doubt.

use super::report::{Report, SLIGHT, reason};
use crate::checkpoint::saved;
use crate::model::chi_square::sigmas;
use crate::model::record::finding::Severity;
use crate::model::record::verdict::Criterion;
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Update;
use crate::state::{Block, Layout};

/// Distance in sigmas from which a result must not be used: a Gaussian error stays within 3 sigma,
/// so at 6 sigma the reported uncertainty is wrong by a factor of two.
const FAR: f64 = 6.0;

/// One component of a state.
#[derive(Clone, Debug)]
struct Row {
    /// Name of the block.
    block: String,
    /// Full name, such as `dvl.misalignment yaw`.
    name: String,
    /// Place in the error state.
    place: usize,
    /// Error of the variances that causes no doubt.
    slack: f64,
    /// Unit, and SI per unit.
    unit: (&'static str, f64),
}

/// Corrections of the rows by each sensor.
#[derive(Clone, Debug)]
pub(crate) struct StateStatistics {
    rows: Vec<Row>,
    /// Sum of the corrections and of their variances, of every row for each sensor in turn.
    pulls: Vec<[f64; 2]>,
}

saved!(StateStatistics {} each { pulls } except { rows });

/// Correction of one row by one sensor.
#[derive(Clone, Copy, Debug, Default)]
struct Pull {
    sum: f64,
    variance: f64,
    /// Error of the variance that causes no doubt.
    slack: f64,
}

impl Pull {
    /// Variance of the sum, with the error of the covariances.
    fn uncertain(self) -> f64 {
        self.variance + self.slack
    }

    /// Correction in units of its sigma; zero if the sensor does not see the state.
    fn sigmas(self) -> f64 {
        if self.variance > 0.0 { self.sum / self.uncertain().sqrt() } else { 0.0 }
    }
}

fn rows(block: &Block) -> impl Iterator<Item = Row> + '_ {
    let names = block.spec.display.components;
    block.tangent_range().enumerate().map(move |(k, place)| Row {
        block: block.name.clone(),
        name: match names.get(k).filter(|_| names.len() > 1) {
            Some(component) => format!("{} {component}", block.name),
            None => block.name.clone(),
        },
        place,
        slack: block.spec.sigma.get(k).map_or(0.0, |sigma| (SLIGHT * SLIGHT - 1.0) * sigma * sigma),
        unit: (block.spec.display.unit, block.spec.display.scale),
    })
}

impl StateStatistics {
    /// Follows the blocks that no process moves; `moved` has one entry per block. Follows none where
    /// a block is considered: the gain is then not optimal, and the corrections are correlated.
    pub(crate) fn new(layout: &Layout, moved: &[bool], white: bool, sensors: usize) -> Self {
        let blocks = layout.blocks.iter().zip(moved);
        let constant = blocks.filter(|(b, moved)| white && b.estimated() && !**moved);
        let rows: Vec<Row> = constant.flat_map(|(block, _)| rows(block)).collect();
        Self { pulls: vec![[0.0; 2]; rows.len() * sensors], rows }
    }

    /// Adds a correction by a sensor.
    pub(crate) fn correction(&mut self, sensor: usize, update: &Update) {
        let (m, gain) = (update.m, update.gain());
        let pulls = self.pulls[sensor * self.rows.len()..].iter_mut();
        for (row, pull) in self.rows.iter().zip(pulls) {
            let k = &gain[row.place * m..][..m];
            for (a, ka) in k.iter().enumerate() {
                pull[0] += ka * update.innovation[a];
                let s = &update.s[a * m..][..m];
                pull[1] += ka * k.iter().zip(s).map(|(kb, s)| kb * s).sum::<f64>();
            }
        }
    }

    fn pull(&self, sensor: usize, row: usize) -> Pull {
        let [sum, variance] = self.pulls[sensor * self.rows.len() + row];
        Pull { sum, variance, slack: self.rows[row].slack }
    }

    fn sensors(&self) -> usize {
        self.pulls.len().checked_div(self.rows.len()).unwrap_or(0)
    }

    /// Pairs of sensors that both correct a row.
    fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let sees = move |s: &usize| self.pull(*s, row).variance > 0.0;
        let sensors = move || (0..self.sensors()).filter(sees);
        sensors().flat_map(move |a| sensors().filter(move |b| *b > a).map(move |b| (a, b)))
    }

    /// Number of tests: the distance from the prior, and one for each pair of sensors.
    pub(crate) fn tests(&self) -> usize {
        (0..self.rows.len()).map(|row| 1 + self.pairs(row).count()).sum()
    }

    /// Reports the reasons against the run at `alpha`, the probability of a false alarm of one test.
    pub(crate) fn judge(&self, alpha: f64, sensors: &[SensorInfo], report: &mut Report) {
        self.judge_pairs(alpha, sensors, report);
        self.judge_priors(alpha, report);
    }

    /// Judges how far the estimates are from their prior means: of each block the component that
    /// is farthest.
    fn judge_priors(&self, alpha: f64, report: &mut Report) {
        let limit = sigmas(0.5 * alpha);
        for at in self.rows.chunk_by(|a, b| a.block == b.block).scan(0, |first, chunk| {
            let range = *first..*first + chunk.len();
            *first = range.end;
            Some(range)
        }) {
            let total = |row: usize| {
                (0..self.sensors()).map(|s| self.pull(s, row)).fold(Pull::default(), |a, b| Pull {
                    sum: a.sum + b.sum,
                    variance: a.variance + b.variance,
                    slack: b.slack,
                })
            };
            let farthest = at
                .map(|row| (row, total(row)))
                .max_by(|a, b| a.1.sigmas().abs().total_cmp(&b.1.sigmas().abs()));
            let Some((row, pull)) = farthest.filter(|(_, p)| p.sigmas().abs() > limit) else {
                continue;
            };
            let distance = pull.sigmas().abs();
            let severity = if distance >= FAR { Severity::DoNotUse } else { Severity::Doubtful };
            let Row { name, unit: (unit, scale), .. } = &self.rows[row];
            let moved = format!("{:.2e} {unit}", pull.sum / scale);
            report.reasons.push(reason(
                Criterion::Prior,
                severity,
                name,
                format!(
                    "the estimate moved {distance:.1} sigma from its prior ({}): the prior, or a \
                     sensor that corrects it, is wrong",
                    moved.trim_end()
                ),
                "look at its initial value and sigma, and at biases and units of the sensors",
            ));
        }
    }

    /// Judges each pair of sensors by the state on which they contradict each other most.
    ///
    /// Two sensors contradict each other if they pull a state in opposite directions, each by more
    /// than chance explains. Two independent Gaussian variables have opposite signs and are both
    /// beyond `t` with the probability `2 Q(t)^2`.
    fn judge_pairs(&self, alpha: f64, sensors: &[SensorInfo], report: &mut Report) {
        let limit = sigmas((0.5 * alpha).sqrt());
        /// The state on which two sensors are farthest apart.
        struct Worst {
            pair: (usize, usize),
            row: usize,
            apart: f64,
        }
        let mut worst: Vec<Worst> = Vec::new();
        for row in 0..self.rows.len() {
            for (a, b) in self.pairs(row) {
                let (pa, pb) = (self.pull(a, row), self.pull(b, row));
                let opposed = pa.sum * pb.sum < 0.0;
                if !opposed || pa.sigmas().abs().min(pb.sigmas().abs()) <= limit {
                    continue;
                }
                let apart = (pa.sum - pb.sum).abs() / (pa.uncertain() + pb.uncertain()).sqrt();
                let found = Worst { pair: (a, b), row, apart };
                match worst.iter_mut().find(|w| w.pair == found.pair) {
                    Some(w) if w.apart >= apart => {}
                    Some(w) => *w = found,
                    None => worst.push(found),
                }
            }
        }
        for Worst { pair: (a, b), row, apart } in worst {
            let severity = if apart >= FAR { Severity::DoNotUse } else { Severity::Doubtful };
            let [first, second] = [a, b].map(|s| sensors[s].name.as_str());
            report.reasons.push(reason(
                Criterion::Contradiction,
                severity,
                &format!("{first}, {second}"),
                format!(
                    "the sensors contradict each other: they pull {} in opposite directions, \
                     {apart:.1} sigma apart",
                    self.rows[row].name
                ),
                "run without one of them (enabled = false) to find which is wrong",
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]
    use super::*;
    use crate::compose::Composer;
    use crate::model::sensor::Purpose;
    use crate::model::sensor::mounting::Mounting;
    use crate::state::covariance::Covariance;
    use crate::state::manifold::{Scalar, Vector};
    use crate::state::{BlockSpec, Display, Dynamics, Mode};

    /// A sensor that reduces the variance of a state of sigma 1 by 4e-4 and moves it by 0.08, four
    /// sigma of that reduction, has moved it by less than its sigma may be wrong by. One that
    /// determines the state is judged as before, to 5 %.
    #[test]
    fn only_a_correction_beyond_the_error_of_the_covariance_is_evidence() {
        let slack = SLIGHT * SLIGHT - 1.0;
        let little = Pull { sum: 0.08, variance: 4e-4, slack };
        assert!(little.sigmas() < 0.3, "{}", little.sigmas());
        let much = Pull { sum: 4.0, variance: 1.0, slack };
        assert!((much.sigmas() * SLIGHT - 4.0).abs() < 1e-12, "{}", much.sigmas());
        let blind = Pull { slack, ..Pull::default() };
        assert_eq!(blind.sigmas(), 0.0, "the sensor does not see the state");
    }

    /// Sensors that correct a state with these variances.
    fn statistics(variances: &[f64]) -> StateStatistics {
        let (block, name) = ("dvl.scale".to_owned(), "dvl.scale".to_owned());
        let rows = vec![Row { block, name, place: 0, slack: 0.1, unit: ("", 1.0) }];
        StateStatistics { rows, pulls: variances.iter().map(|v| [0.0, *v]).collect() }
    }

    /// One test of the distance from the prior, and one for each pair.
    #[test]
    fn only_sensors_that_see_a_state_are_compared_in_it() {
        let pairs = |variances: &[f64]| {
            let statistics = statistics(variances);
            let pairs: Vec<_> = statistics.pairs(0).collect();
            assert_eq!(statistics.tests(), 1 + pairs.len());
            pairs
        };
        assert_eq!(pairs(&[1.0, 0.0, 1e-9]), [(0, 2)]);
        assert_eq!(pairs(&[1.0, 2.0, 3.0]), [(0, 1), (0, 2), (1, 2)]);
        assert_eq!(pairs(&[0.0, 1.0, 0.0]), []);
    }

    /// `K S K'` is what the correction takes off the variance: two states, of which two channels
    /// measure the second one and the sum.
    #[test]
    fn the_corrections_of_a_sensor_have_the_variance_that_the_prior_loses() {
        let mut statistics = statistics(&[0.0, 0.0]);
        statistics.rows[0].place = 1;
        let mut p = Covariance::zero(2);
        for (i, j, value) in [(0, 0, 2.0), (1, 1, 3.0), (1, 0, 0.5)] {
            p.set(i, j, value);
        }
        let mut update = Update::with_capacity(2, 2);
        update.m = 2;
        update.columns.extend([0, 1]);
        update.h.extend([0.0, 1.0, 1.0, 1.0]);
        update.r.extend([1.0, 0.0, 0.0, 4.0]);
        update.innovation.extend([0.7, -0.4]);
        assert!(update.innovate(&p).is_some());
        let before = p.get(1, 1);
        update.apply(&mut p, &[false; 2]);
        statistics.correction(1, &update);
        let [sum, variance] = statistics.pulls[1];
        assert!((sum - update.delta[1]).abs() < 1e-15, "{sum}");
        assert!((variance - (before - p.get(1, 1))).abs() < 1e-14, "{variance}");
        assert_eq!(statistics.pulls[0], [0.0; 2], "the other sensor");
    }

    fn sensors() -> [SensorInfo; 2] {
        ["dvl", "gnss"].map(|name| SensorInfo {
            name: name.to_owned(),
            kind: String::new(),
            channels: Vec::new(),
            purpose: Purpose::Measurement,
            mounting: Mounting::default(),
        })
    }

    /// Corrections of 10 and -8 with the variances 1.9, each of which may be wrong by 0.1, are 18
    /// apart with a variance of 4.
    #[test]
    fn sensors_that_pull_a_state_apart_contradict_each_other_by_the_sigma_of_the_difference() {
        let mut statistics = statistics(&[1.9, 1.9]);
        let names = sensors();
        let mut judge = |first: f64, second: f64| {
            (statistics.pulls[0][0], statistics.pulls[1][0]) = (first, second);
            let mut report = Report::default();
            statistics.judge_pairs(1e-3, &names, &mut report);
            report.reasons.pop().map(|reason| (reason.about, reason.text))
        };
        for signs in [1.0, -1.0] {
            let found = judge(10.0 * signs, -8.0 * signs);
            let (about, text) = found.unwrap_or_default();
            assert_eq!(about, "dvl, gnss");
            assert!(text.contains("pull dvl.scale in opposite directions, 9.0 sigma"), "{text}");
        }
        assert_eq!(judge(10.0, 8.0), None);
        assert_eq!(judge(10.0, -0.2), None, "no more than chance");
    }

    /// Three sensors moved a component by 1, 2 and 3 with the variances 0.2, 0.3 and 0.4, which may
    /// be wrong by 0.1 together: 6 sigma. The other component moved by less, that of the other
    /// block in the other direction.
    #[test]
    fn the_component_that_moved_farthest_from_its_prior_is_named_for_each_block() {
        let row = |block: &str, name: &str| {
            let (block, name) = (block.to_owned(), name.to_owned());
            Row { block, name, place: 0, slack: 0.1, unit: ("deg", 0.5) }
        };
        let pulls = |scale: f64| {
            let [a, b, c] = [[1.0, 0.2], [2.0, 0.3], [3.0, 0.4]].map(|[s, v]| [s * scale, v]);
            let little = [1.2, 0.3];
            vec![little, a, [-1.7, 0.3], little, b, [-1.7, 0.3], little, c, [-1.7, 0.3]]
        };
        let judged = |scale: f64| {
            let tilt = [row("tilt", "tilt roll"), row("tilt", "tilt pitch")];
            let rows = tilt.into_iter().chain([row("yaw", "yaw")]).collect();
            let (statistics, mut report) =
                (StateStatistics { rows, pulls: pulls(scale) }, Report::default());
            assert_eq!(statistics.sensors(), 3);
            statistics.judge_priors(1e-3, &mut report);
            report.reasons
        };
        let reasons = judged(1.001);
        let names: Vec<&str> = reasons.iter().map(|reason| reason.about.as_str()).collect();
        assert_eq!(names, ["tilt pitch", "yaw"]);
        assert_eq!(reasons[0].severity, Severity::DoNotUse);
        // 6.006 rad in half radians
        assert!(reasons[0].text.contains("moved 6.0 sigma"), "{}", reasons[0].text);
        assert!(reasons[0].text.contains("(1.20e1 deg)"), "{}", reasons[0].text);
        // -5.1, which is as many sigma
        assert_eq!(reasons[1].severity, Severity::Doubtful);
        assert!(reasons[1].text.contains("(-1.02e1 deg)"), "{}", reasons[1].text);
        assert_eq!(judged(0.999)[0].severity, Severity::Doubtful);
        // 3.6 of the component roll is now the farthest, beyond the 3.29 of the level
        assert_eq!(judged(0.5)[0].about, "tilt roll");
    }

    /// Corrections of 4 and -4 with the variance 1 are 8 / sqrt(2.2) = 5.4 apart, those of 5 and
    /// -5 6.7.
    #[test]
    fn two_sensors_are_named_once_with_the_state_that_they_pull_apart_farthest() {
        for (sums, name) in [([4.0, 5.0], "b"), ([5.0, 4.0], "a")] {
            let rows = ["a", "b"]
                .map(|name| Row { name: name.to_owned(), ..statistics(&[]).rows.remove(0) });
            let [a, b] = sums;
            let pulls = vec![[a, 1.0], [b, 1.0], [-a, 1.0], [-b, 1.0]];
            let mut report = Report::default();
            let statistics = StateStatistics { rows: rows.into(), pulls };
            statistics.judge_pairs(1e-3, &sensors(), &mut report);
            let [reason] = &report.reasons[..] else { panic!("{:?}", report.reasons) };
            let words = format!("pull {name} in opposite directions, 6.7 sigma");
            assert!(reason.text.contains(&words), "{}", reason.text);
        }
    }

    /// A sigma that is 5 % too small takes 1.05^2 - 1 of its square off the variance.
    #[test]
    fn a_state_is_named_with_its_component_where_it_has_several() {
        let mut composer = Composer::default();
        composer.begin("dvl");
        let spec = |sigma: &[f64], components| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0; sigma.len()],
            sigma: sigma.to_vec(),
            truth: None,
            dynamics: Dynamics::Constant,
            display: Display { unit: "deg", scale: 0.5, components },
        };
        let turn = spec(&[1.0, 2.0, 3.0], &["roll", "pitch", "yaw"]);
        composer.block::<Vector<3>>("turn", turn).expect("a block");
        composer.block::<Scalar>("scale", spec(&[4.0], &["x"])).expect("a block");
        let layout = composer.finish().0;
        let all: Vec<Row> = layout.blocks.iter().flat_map(rows).collect();
        let expected = [("roll", 1.0), ("pitch", 2.0), ("yaw", 3.0)]
            .map(|(component, sigma)| (format!("dvl.turn {component}"), sigma))
            .into_iter()
            .chain([("dvl.scale".to_owned(), 4.0)]);
        for (place, (row, (name, sigma))) in all.iter().zip(expected).enumerate() {
            assert_eq!((&row.name, row.place, row.unit), (&name, place, ("deg", 0.5)));
            assert!((row.slack - 0.1025 * sigma * sigma).abs() < 1e-12, "{}", row.slack);
        }
        assert_eq!(all.len(), 4);
    }
}
