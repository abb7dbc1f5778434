//! Consistency of innovations (NIS) and errors (NEES) with the filter's covariance, in simulation.

use crate::lab::{Lab, Types, assemble};
use crate::{Failure, Report};
use navfuse_core::document::key;
use navfuse_core::model::record::{Epoch, Outcome, Record, UpdateRecord, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::{Block, Dynamics, Layout};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Number of runs. Noise, initial errors and true parameters differ from run to run.
const RUNS: usize = 20;
/// Number of innovations of a sensor that count in a run, evenly spaced: enough to detect a sigma
/// that is 10 % wrong.
const INNOVATIONS: usize = 50;
/// Probability that a correct value lies outside its band: with some ten bands, about one test in
/// 10 000 fails by chance.
const ALPHA: f64 = 1e-5;

pub fn check(lab: &Lab<'_>, report: &mut Report) {
    let (sensors, processes) = (lab.sensors(), lab.processes());
    let names: Vec<&str> =
        (sensors.iter().map(|p| lab.composition.sensors[p.index].info.name.as_str()))
            .chain(processes.iter().map(|p| lab.composition.processes[p.index].name.as_str()))
            .collect();
    let parts: Vec<String> = sensors.iter().chain(&processes).map(|p| p.about.clone()).collect();
    let runs = match runs(lab) {
        Ok(runs) => runs,
        Err(message) => return report.add("consistency", parts.join(", "), Err(message)),
    };
    let assumes = lab.assumes();
    for (part, model) in lab.models() {
        report.add("nis", part.about, nis(&runs, part.index, model.channels(), assumes));
    }
    // a wrong derivative explains errors better than a wide prior does
    let derived = report.failures().all(|f| !matches!(f.check, "jacobian" | "transition"));
    report.next.extend(early(&runs, assumes).filter(|_| derived));
    let layout = &lab.composition.layout;
    for (name, about) in names.iter().zip(parts) {
        let own = |b: &&Block| b.name.split('.').next() == Some(name);
        let judged = |b: &&Block| b.tangent.is_some() && random(b) && lab.has_truth(b);
        let own: Vec<&Block> = layout.blocks.iter().filter(own).filter(judged).collect();
        if !own.is_empty() {
            report.add("nees", about, nees(&runs, &own, assumes));
        }
    }
}

/// Tests whether the true value of a block is as random as the filter assumes: a stated truth is
/// constant.
fn random(block: &Block) -> bool {
    block.spec.truth.is_none() || block.spec.dynamics == Dynamics::Constant
}

/// Innovations and final errors of one run.
#[derive(Clone, Debug, Default)]
struct Run {
    /// NIS of each sensor's innovations, with the number of channels.
    nis: Vec<Vec<(f64, usize)>>,
    gated: Vec<usize>,
    layout: Layout,
    /// Errors and covariance at the last epoch with a truth, and the blocks whose truth is known.
    last: Option<(Vec<f64>, Covariance, Vec<bool>)>,
    /// NEES of all states whose truth is known, at each epoch with a truth.
    course: Vec<Course>,
}

/// NEES at a time, s, with its degrees of freedom.
#[derive(Clone, Copy, Debug)]
struct Course {
    time: f64,
    nees: f64,
    freedom: usize,
}

/// Runs the scenario with every seed, on all cores; the results are in the order of the seeds.
fn runs(lab: &Lab<'_>) -> Result<Vec<Run>, Failure> {
    let mut settings = vec!["estimator.draw=all".to_owned()];
    for sensor in &lab.composition.sensors {
        let name = key(&sensor.info.name);
        // the constraint of a process has no table
        let table = !sensor.constraint || sensor.detector.is_some();
        if table && matches!(sensor.role, navfuse_core::model::sensor::Role::Measurement(_)) {
            settings.push(format!("sensor.{name}.gate=off"));
            if sensor.simulation.is_some() {
                settings.push(format!("sensor.{name}.simulation.outliers=0"));
            }
        }
        if sensor.simulation.is_some() {
            settings.push(format!("sensor.{name}.simulation.faults=[]"));
        }
        let reference = matches!(sensor.role, navfuse_core::model::sensor::Role::Reference(_));
        if sensor.simulation.is_some() && !reference {
            settings.push(format!("sensor.{name}.simulation.noise=1"));
        }
    }
    let (types, text) = (lab.types, lab.text);
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::from_iter((0..RUNS).map(|_| None))));
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(RUNS);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    if k >= RUNS {
                        break;
                    }
                    let settings: Vec<String> =
                        settings.iter().cloned().chain([format!("seed={}", k + 1)]).collect();
                    let run = run(types, text, &settings)
                        .map_err(|e| Failure::during(format_args!("with --set seed={}", k + 1), e));
                    found.lock().unwrap_or_else(PoisonError::into_inner)[k] = Some(run);
                }
            });
        }
    });
    found.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter().flatten().collect()
}

fn run(types: &Types, text: &str, settings: &[String]) -> Result<Run, Failure> {
    let mut assembly = assemble(types, text, settings)?;
    assembly.sinks.push(("conformance".into(), Box::new(Run::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    if let Some(error) = finished.error {
        return Err(Failure::new(format!("the run ends early: {error}")));
    }
    finished.take_sink().ok_or_else(|| Failure::new("the run did not give its sinks back"))
}

impl Sink for Run {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS | Wants::UPDATES
    }

    fn start(&mut self, info: &RunInfo) -> Result<(), StreamError> {
        let (nis, gated) = (vec![Vec::new(); info.sensors.len()], vec![0; info.sensors.len()]);
        *self = Self { nis, gated, layout: info.layout.clone(), ..Self::default() };
        Ok(())
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Update(update) => self.update(update),
            _ => Ok(()),
        }
    }
}

impl Run {
    fn epoch(&mut self, epoch: &Epoch<'_>) -> Result<(), StreamError> {
        if let Some(truth) = epoch.truth {
            let mut error = vec![0.0; epoch.layout.tangent];
            epoch.layout.error(truth.state, epoch.state, truth.known, &mut error);
            let judged = |slot: &usize| truth.known[*slot] && random(&epoch.layout.blocks[*slot]);
            let slots = (0..epoch.layout.blocks.len()).filter(judged);
            let columns: Vec<usize> =
                slots.flat_map(|slot| epoch.layout.blocks[slot].tangent_range()).collect();
            if let Some(nees) = epoch.covariance.nees(&error, &columns) {
                let (time, freedom) = (epoch.state.time.seconds(), columns.len());
                self.course.push(Course { time, nees, freedom });
            }
            self.last = Some((error, epoch.covariance.clone(), truth.known.to_vec()));
        }
        Ok(())
    }

    fn update(&mut self, update: &UpdateRecord<'_>) -> Result<(), StreamError> {
        match update.outcome {
            Outcome::Accepted => {
                self.nis[update.sensor.0].push((update.nis, update.innovation.len()));
            }
            Outcome::Gated => self.gated[update.sensor.0] += 1,
            Outcome::Rejected(_) | Outcome::Placed => {}
        }
        Ok(())
    }
}

/// Tests whether a sum of squares lies in the band of the chi-square distribution. Returns the
/// result, and the band of the mean per degree of freedom, which starts at zero if it
/// `may_be_less`.
fn judge(sum: f64, freedom: usize, may_be_less: bool) -> Option<(bool, [f64; 2])> {
    let chi = ChiSquared::new(freedom as f64).ok()?;
    let mut band = [0.5 * ALPHA, 1.0 - 0.5 * ALPHA].map(|p| chi.inverse_cdf(p) / freedom as f64);
    if may_be_less {
        band[0] = 0.0;
    }
    let mean = sum / freedom as f64;
    Some((mean.is_finite() && mean >= band[0] && mean <= band[1], band))
}

fn nis(runs: &[Run], sensor: usize, channels: usize, may_be_less: bool) -> Result<String, Failure> {
    let gated: usize = runs.iter().map(|r| r.gated[sensor]).sum();
    if gated > 0 {
        return Err(Failure::new(format!(
            "{gated} of its innovations are not finite; return finite values from predict wherever \
             the simulated vehicle goes"
        )));
    }
    let thin = |r: &Run| {
        let all = &r.nis[sensor];
        let count = INNOVATIONS.min(all.len());
        (0..count).map(|k| all[k * all.len() / count]).collect::<Vec<_>>()
    };
    let counted: Vec<(f64, usize)> = runs.iter().flat_map(thin).collect();
    let (sum, freedom) = counted.iter().fold((0.0, 0), |(s, f), (nis, m)| (s + nis, f + m));
    let Some((holds, [low, high])) = judge(sum, freedom, may_be_less) else {
        return Err("the filter uses none of its samples; simulate it while the filter runs".into());
    };
    let mean = sum / freedom as f64;
    let numbers = format!(
        "mean {mean:.3} per channel over {} innovations in {} runs, band {low:.3} to {high:.3}",
        counted.len(),
        runs.len()
    );
    if holds {
        return Ok(numbers);
    }
    Err(Failure::new(format!(
        "NIS {numbers}: {}; compare the noise that `simulate` adds with `noise` (sigma squared, \
         of {channels} channels), and the simulated values with `predict`; if both agree, start \
         the scenario closer to the truth",
        if mean > high {
            "innovations are larger than their covariance predicts"
        } else {
            "innovations are smaller than their covariance predicts"
        }
    )))
}

/// Tests the NEES of blocks at the end of all runs.
fn nees(runs: &[Run], blocks: &[&Block], may_be_less: bool) -> Result<String, Failure> {
    let (mut sum, mut freedom) = (0.0, 0);
    let mut alone: Vec<(String, f64, usize)> =
        blocks.iter().map(|b| (b.name.clone(), 0.0, 0)).collect();
    for run in runs {
        let Some((error, covariance, known)) = &run.last else {
            return Err(
                "its runs have no known truth; add [sensor.reference] with a simulation".into()
            );
        };
        let mut all = Vec::new();
        for (slot, block) in run.layout.blocks.iter().enumerate().filter(|(slot, _)| known[*slot]) {
            let Some(own) = alone.iter_mut().find(|(name, _, _)| *name == block.name) else {
                continue;
            };
            let columns: Vec<usize> = block.tangent_range().collect();
            own.1 += covariance
                .nees(error, &columns)
                .ok_or_else(|| singular(&run.layout.blocks[slot].name))?;
            own.2 += columns.len();
            all.extend(columns);
        }
        let squared = covariance.nees(error, &all);
        sum += squared.ok_or_else(|| singular("its states"))?;
        freedom += all.len();
    }
    let Some((holds, [low, high])) = judge(sum, freedom, may_be_less) else {
        return Err(
            "the true values of its states are unknown; add [sensor.reference] with a simulation"
                .into(),
        );
    };
    let numbers = format!(
        "mean {:.3} per axis at the end of {} runs, band {low:.3} to {high:.3}",
        sum / freedom as f64,
        runs.len()
    );
    let worst = alone.iter().find(|(_, sum, freedom)| {
        judge(*sum, *freedom, may_be_less).is_some_and(|(holds, _)| !holds)
    });
    if holds && worst.is_none() {
        return Ok(numbers);
    }
    let of = worst.map_or_else(String::new, |(name, sum, freedom)| {
        format!(" ({name}: {:.3} of {freedom})", sum / *freedom as f64)
    });
    Err(Failure::new(format!(
        "NEES {numbers}{of}: the errors of its states are not consistent with the filter's \
         covariance; check `predict` and `noise`, Phi and Q of a process, and that the simulator \
         applies the states as the model does"
    )))
}

/// Words about times at which the errors of the runs are above what their covariance allows, although
/// they may agree at the end: a wide prior within which a model is curved. `None` if there are none.
fn early(runs: &[Run], may_be_less: bool) -> Option<String> {
    let epochs = runs.iter().map(|run| run.course.len()).min()?;
    let mean = |k: usize| {
        let at = runs.iter().map(|run| run.course[k]);
        let (sum, freedom) = at.fold((0.0, 0), |(s, f), c| (s + c.nees, f + c.freedom));
        let (_, [_, high]) = judge(sum, freedom, may_be_less)?;
        Some((sum / freedom as f64, high))
    };
    // one epoch above its band may be chance
    let above: Vec<(usize, f64)> = (0..epochs)
        .filter_map(|k| mean(k).filter(|(mean, high)| mean > high).map(|(mean, _)| (k, mean)))
        .collect();
    let twice = above.windows(2).any(|pair| pair[1].0 == pair[0].0 + 1);
    let worst = above.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| twice)?;
    let time = |k: usize| runs[0].course[k].time;
    let (first, last) = (above.first()?.0, above.last()?.0);
    let freedom = runs[0].course[worst.0].freedom as f64;
    Some(format!(
        "overconfident from {:.1} s to {:.1} s, at worst at {:.1} s: mean NEES {:.1} of {freedom} in \
         {} runs. A model is curved within the prior: try update = \"iekf\" or \"ukf\" for the sensor, \
         or relinearise = \"{:.0} s\", or a narrower prior; where several places fit the samples, as \
         over a map, [estimator] type = \"point-mass\" begins with all of them",
        time(first),
        time(last),
        time(worst.0),
        worst.1 * freedom,
        runs.len(),
        (2.0 * (time(last) - time(0))).max(1.0),
    ))
}

fn singular(name: &str) -> String {
    format!(
        "the covariance of {name} is singular at the end; set its noise and its prior sigma above \
         zero"
    )
}
