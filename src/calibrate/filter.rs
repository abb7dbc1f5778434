//! The scenario's filter as one of the methods.

use super::{Outcome, Result};
use navfuse_calibration::{CalibrationData, Estimate, IntermediateEstimate};
use navfuse_core::document::Document;
use navfuse_core::model::record::Epoch;
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::nalgebra::Matrix4;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::state::manifold::{Manifold, Rotation, Scalar};
use navfuse_core::units::time::Time;
use navfuse_segments::Mounting;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

/// The scenario's filter; and where it has other sensors than IMU and DVL, the filter without them too.
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
            others.iter().map(|o| format!("sensor.{o}.enabled=false")).collect();
        let alone = Scenario::new(registry, document.clone(), &settings)?;
        out.push(filter(alone.assemble(None)?, "ekf, IMU and DVL", list(&[]), data, progress)?);
    }
    Ok(out)
}

fn filter(
    mut assembly: Assembly,
    name: &str,
    sensors: String,
    data: &CalibrationData,
    progress: &dyn Fn(Progress),
) -> Result<Outcome> {
    let dvl = &data.velocity()?.samples.name;
    let kept = Arc::new(Mutex::new(Kept::default()));
    assembly.sinks.push((
        "calibrate".into(),
        Box::new(Listener { dvl: dvl.clone(), zero: data.recording.zero, kept: Arc::clone(&kept) }),
    ));
    let finished = runner::run(assembly, &AtomicBool::new(false), progress);
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    let history = std::mem::take(&mut kept.history);
    let result = match (&finished.error, history.first().zip(history.last())) {
        (Some(error), _) => Err(error.to_string()),
        (None, None) => Err(format!("the filter has no {dvl}.scale and {dvl}.misalignment")),
        (None, Some((first, last))) => {
            let (mounting, used) = (last.mounting, [first.time, last.time]);
            let determined = kept.told;
            Ok(Estimate {
                mounting,
                covariance: Some(kept.covariance),
                determined,
                history,
                used,
                notes: Vec::new(),
            })
        }
    };
    Ok(Outcome { name: name.into(), sensors, result })
}

/// What a filter's run tells of the DVL.
#[derive(Default)]
struct Kept {
    history: Vec<IntermediateEstimate>,
    covariance: Matrix4<f64>,
    told: [bool; 4],
}

struct Listener {
    dvl: String,
    /// Zero of the recording's clock.
    zero: Time,
    kept: Arc<Mutex<Kept>>,
}

impl Sink for Listener {
    fn start(&mut self, _: &RunInfo) -> std::result::Result<(), StreamError> {
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> std::result::Result<(), StreamError> {
        let block = |name: &str| epoch.layout.find(&format!("{}.{name}", self.dvl));
        let (Some(scale), Some(misalignment)) = (block("scale"), block("misalignment")) else {
            return Ok(());
        };
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let values = &epoch.state.values;
        let k = Scalar::load::<f64>(&values[scale.range()]);
        let mounting = Mounting { k, c_b_d: Rotation::load::<f64>(&values[misalignment.range()]) };
        kept.history
            .push(IntermediateEstimate { time: epoch.state.time.since(self.zero), mounting });
        // the error of a rotation is a rotation vector to its left, as an estimate's is
        let places: Vec<Option<usize>> = std::iter::once(scale.tangent)
            .chain((0..3).map(|i| misalignment.tangent.map(|t| t + i)))
            .collect();
        let at = |i: usize, j: usize| {
            places[i].zip(places[j]).map_or(0.0, |(a, b)| epoch.covariance.get(a, b))
        };
        kept.covariance = Matrix4::from_fn(at);
        // half of the prior says that the samples told something
        let prior =
            [scale.spec.sigma[0]].into_iter().chain(misalignment.spec.sigma.iter().copied());
        let told: Vec<bool> = prior.enumerate().map(|(i, s)| at(i, i).sqrt() < 0.5 * s).collect();
        kept.told = std::array::from_fn(|i| told.get(i).copied().unwrap_or(false));
        Ok(())
    }

    fn finish(&mut self) -> std::result::Result<Option<String>, StreamError> {
        Ok(None)
    }
}
