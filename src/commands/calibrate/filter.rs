//! The scenario's filter as one of the methods.

use super::outcome::Outcome;
use crate::error::{CommandError, Result};
use navfuse_calibration::{CalibrationData, Estimate, IntermediateEstimate};
use navfuse_core::document::{Document, key};
use navfuse_core::model::chi_square::sigmas;
use navfuse_core::model::record::Record;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::nalgebra::Matrix4;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::manifold::{Manifold, Rotation, Scalar};
use navfuse_core::units::time::Time;
use navfuse_segments::Mounting;
use std::sync::atomic::AtomicBool;

/// Runs the scenario's filter; where it has other sensors than IMU and DVL, also without them.
pub fn outcomes(
    registry: &Registry,
    document: &Document,
    data: &CalibrationData,
    progress: &dyn Fn(Progress),
) -> Result<Vec<Outcome>> {
    let name = &data.velocity()?.samples.name;
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let sensors = scenario.compose()?.sensors;
    let others: Vec<&String> = (sensors.iter())
        .filter(|s| s.info.purpose == Purpose::Measurement && s.info.name != *name)
        .map(|s| &s.info.name)
        .collect();
    let list = |names: &[&String]| {
        let names = names.iter().map(|n| n.as_str());
        ["IMU", "DVL"].into_iter().chain(names).collect::<Vec<_>>().join(", ")
    };
    let mut out = vec![filter(scenario.assemble(None)?, "ekf", list(&others), data, progress)?];
    if !others.is_empty() {
        let settings: Vec<String> =
            others.iter().map(|o| format!("sensor.{}.enabled=false", key(o))).collect();
        let alone = Scenario::new(registry, document.clone(), &settings)?;
        let mut alone =
            filter(alone.assemble(None)?, "ekf, IMU and DVL", list(&[]), data, progress)?;
        if let (Ok(all), Ok(alone)) = (&out[0].result, &mut alone.result) {
            alone.notes.extend(contradiction(all, alone));
        }
        out.push(alone);
    }
    Ok(out)
}

/// Probability that two consistent runs of the filter are said to contradict each other.
const FALSE_ALARM: f64 = 0.005;
/// Distance in sigmas from which neither estimate must be used, as in the verdict of a run.
const FAR: f64 = 6.0;

/// Compares the estimate from all sensors with the one from IMU and DVL alone.
///
/// The first uses all samples of the second. The difference of two such efficient estimates is
/// uncorrelated with the better one, so its variance is the difference of their variances
/// (Hausman 1978).
fn contradiction(all: &Estimate, alone: &Estimate) -> Option<String> {
    let (wide, narrow) = (alone.sigma()?, all.sigma()?);
    let difference = alone.error(&all.mounting);
    let distance = |i: usize| {
        let (wide, narrow) = (wide[i] * wide[i], narrow[i] * narrow[i]);
        // the two runs linearise at different points, which changes an estimate by up to some 0.1
        // sigma where the other sensors add nothing
        difference[i].abs() / (wide - narrow).max(1e-2 * wide).sqrt()
    };
    let both = (0..4).filter(|i| all.determined[*i] && alone.determined[*i]);
    let (i, apart) = both.map(|i| (i, distance(i))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    if apart.is_nan() || apart <= sigmas(0.5 * FALSE_ALARM / 4.0) {
        return None;
    }
    let severity = if apart >= FAR { Severity::DoNotUse } else { Severity::Doubtful };
    let (words, name) = (severity.words(), ["k", "roll", "pitch", "yaw"][i]);
    Some(format!(
        "{words}: ekf with all sensors differs from it by {apart:.1} sigma in {name}: a sensor that \
         this method leaves out pulls the calibration; check the bias, noise and lever arm of that sensor"
    ))
}

fn filter(
    mut assembly: Assembly,
    name: &str,
    sensors: String,
    data: &CalibrationData,
    progress: &dyn Fn(Progress),
) -> Result<Outcome> {
    let dvl = &data.velocity()?.samples.name;
    let record = MountingRecord::new(dvl, data.recording.zero);
    assembly.sinks.push(("calibrate".into(), Box::new(record)));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), progress);
    let record = finished.take_sink::<MountingRecord>();
    let record = record.unwrap_or_else(|| MountingRecord::new(dvl, data.recording.zero));
    let MountingRecord { history, covariance, determined, .. } = record;
    let verdict = &finished.summary.verdict;
    let doubted = verdict.level != VerdictLevel::Consistent;
    let doubts: Vec<String> = doubted.then(|| verdict.to_string()).into_iter().collect();
    let result = match (finished.error.take(), history.first().zip(history.last())) {
        (Some(error), _) => Err(error.into()),
        (None, None) => Err(CommandError::Request(format!(
            "the filter has no {dvl}.scale and {dvl}.misalignment"
        ))),
        (None, Some((first, last))) => {
            let (mounting, used) = (last.mounting, [first.time, last.time]);
            Ok(Estimate {
                mounting,
                covariance: Some(covariance),
                determined,
                history,
                used,
                notes: doubts,
            })
        }
    };
    Ok(Outcome { name: name.into(), sensors, result })
}

/// The estimates of a DVL's mounting over a run of the filter.
struct MountingRecord {
    dvl: String,
    /// Zero of the recording's clock.
    zero: Time,
    history: Vec<IntermediateEstimate>,
    /// Covariance of scale factor and misalignment at the last estimate.
    covariance: Matrix4<f64>,
    /// For scale factor, roll, pitch and yaw, true once the 1-sigma is less than half of the prior.
    determined: [bool; 4],
}

impl MountingRecord {
    fn new(dvl: &str, zero: Time) -> Self {
        Self {
            dvl: dvl.to_owned(),
            zero,
            history: Vec::new(),
            covariance: Matrix4::zeros(),
            determined: [false; 4],
        }
    }
}

impl Sink for MountingRecord {
    fn take(&mut self, record: &Record<'_>) -> std::result::Result<(), StreamError> {
        let Record::Epoch(epoch) = record else { return Ok(()) };
        let block = |name: &str| epoch.layout.find(&format!("{}.{name}", self.dvl));
        let (Some(scale), Some(misalignment)) = (block("scale"), block("misalignment")) else {
            return Ok(());
        };
        let values = &epoch.state.values;
        let k = Scalar::load::<f64>(&values[scale.range()]);
        let mounting = Mounting { k, c_b_d: Rotation::load::<f64>(&values[misalignment.range()]) };
        self.history
            .push(IntermediateEstimate { time: epoch.state.time.since(self.zero), mounting });
        // the error of a rotation is a rotation vector to its left, as an estimate's is
        let places: Vec<Option<usize>> = std::iter::once(scale.tangent)
            .chain((0..3).map(|i| misalignment.tangent.map(|t| t + i)))
            .collect();
        let at = |i: usize, j: usize| {
            places[i].zip(places[j]).map_or(0.0, |(a, b)| epoch.covariance.get(a, b))
        };
        self.covariance = Matrix4::from_fn(at);
        let prior =
            [scale.spec.sigma[0]].into_iter().chain(misalignment.spec.sigma.iter().copied());
        let less: Vec<bool> = prior.enumerate().map(|(i, s)| at(i, i).sqrt() < 0.5 * s).collect();
        self.determined = std::array::from_fn(|i| less.get(i).copied().unwrap_or(false));
        Ok(())
    }
}
