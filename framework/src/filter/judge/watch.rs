//! The monitor of the driven process, and the detectors of pseudo-measurements.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::filter::estimate::Estimate;
use crate::model::process::Input;
use crate::model::process::monitor::{MeasuredVelocity, Monitor};
use crate::model::process::start::FilterView;
use crate::model::record::finding::Finding;
use crate::model::sensor::detector::Detector;
use crate::state::Layout;
use crate::units::sample::Sample;

/// What looks at the samples beside the filter.
#[derive(Clone)]
pub(in crate::filter) struct Watch {
    /// Monitor of the driven process.
    monitor: Option<Box<dyn Monitor>>,
    detectors: Vec<Detecting>,
}

/// A detector, and the index of its sensor.
#[derive(Clone)]
struct Detecting {
    sensor: usize,
    detector: Box<dyn Detector>,
}

saved!(Detecting { detector } except { sensor });

/// What a detector says of a sample.
pub(in crate::filter) struct Detection {
    /// Index of the sensor of the pseudo-measurement.
    pub(in crate::filter) sensor: usize,
    /// Set if the pseudo-measurement holds.
    pub(in crate::filter) holds: bool,
}

saved!(Watch {} each { monitor, detectors });

impl Watch {
    pub(in crate::filter) fn new(composition: &Composition) -> Self {
        let sensors = composition.sensors.iter().enumerate();
        Self {
            monitor: composition.processes.iter().find_map(|p| p.monitor.clone()),
            detectors: sensors
                .filter_map(|(sensor, s)| Some(Detecting { sensor, detector: s.detector.clone()? }))
                .collect(),
        }
    }

    /// Shows a corrected driving sample to the monitor.
    pub(in crate::filter) fn input(
        &mut self,
        layout: &Layout,
        estimate: &Estimate,
        input: &Input<'_>,
    ) -> Option<Finding> {
        self.monitor.as_mut()?.input(&estimate.view(layout, None), input)
    }

    /// Returns `true` if there is a monitor.
    pub(in crate::filter) fn monitors(&self) -> bool {
        self.monitor.is_some()
    }

    /// Shows the velocity that a sample measures to the monitor.
    pub(in crate::filter) fn measured(
        &mut self,
        filter: &FilterView<'_>,
        velocity: &MeasuredVelocity<'_>,
    ) {
        self.monitor.iter_mut().for_each(|monitor| monitor.measured(filter, velocity));
    }

    /// Shows a corrected estimate to the monitor.
    pub(in crate::filter) fn corrected(&mut self, filter: &FilterView<'_>) {
        self.monitor.iter_mut().for_each(|monitor| monitor.corrected(filter));
    }

    /// Notes that the covariance was widened.
    pub(in crate::filter) fn widened(&mut self) {
        self.monitor.iter_mut().for_each(|monitor| monitor.widened());
    }

    /// Number of detectors.
    pub(in crate::filter) fn detectors(&self) -> usize {
        self.detectors.len()
    }

    /// Shows a sample to a detector.
    pub(in crate::filter) fn detect(&mut self, k: usize, sample: &Sample) -> Detection {
        let Detecting { sensor, detector } = &mut self.detectors[k];
        Detection { sensor: *sensor, holds: detector.detects(sample) }
    }
}
