//! Monitor of the IMU: faults that its samples contradict physics with.
//!
//! Seven rules, each in a file of its own: the specific force is about as large as gravity and points
//! up, the accelerations are those that another sensor measures, and at the same time, gravity turns as
//! the gyros turn, and so do the velocities of a sensor in body axes, white noise is as strong as stated,
//! and constant biases stay constant.

mod axes;
mod clock;
mod drift;
mod fault;
mod gravity;
mod senses;
mod turning;
mod whiteness;

use crate::imu::Imu;
use crate::navigation::Navigation;
use axes::Axes;
use clock::Clock;
use drift::Drift;
use fault::Fault;
use gravity::Gravity;
use nalgebra::Vector3;
use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::model::process::Input;
use navfuse_core::model::process::monitor::{MeasuredVelocity, Monitor};
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::units::time::Time;
use senses::Senses;
use turning::Turning;
use whiteness::Whiteness;

/// Monitor of one IMU.
#[derive(Clone)]
pub(crate) struct ImuMonitor {
    name: String,
    imu: Imu,
    navigation: Navigation,
    gravity: Gravity,
    axes: Axes,
    clock: Clock,
    turning: Turning,
    senses: Senses,
    whiteness: Whiteness,
    drift: Drift,
}

saved!(ImuMonitor {
    gravity, axes, clock, turning, senses, whiteness, drift,
} except {
    name, imu, navigation,
});

impl ImuMonitor {
    /// A monitor of the IMU of that name; `tilt` is the prior sigma of roll and pitch, where they
    /// are known without the IMU.
    pub(crate) fn new(name: &str, imu: &Imu, navigation: Navigation, tilt: Option<f64>) -> Self {
        Self {
            name: name.to_owned(),
            imu: imu.clone(),
            navigation,
            gravity: Gravity::new(tilt),
            axes: Axes::default(),
            clock: Clock::default(),
            turning: Turning::default(),
            senses: Senses::default(),
            whiteness: Whiteness::new(imu),
            drift: Drift::new(navigation),
        }
    }

    /// Finding about the IMU.
    fn finding(&self, time: Time, fault: Fault) -> Finding {
        fault.about(time, self.name.clone())
    }
}

impl Monitor for ImuMonitor {
    fn input(&mut self, filter: &FilterView<'_>, input: &Input<'_>) -> Option<Finding> {
        // a sample that the filter replaced is no evidence
        if input.spread.is_some() || input.usual <= 0.0 {
            return None;
        }
        let (w, f) = self.imu.rates(input.sample, input.usual)?;
        let (time, dt) = (input.sample.time, input.usual);
        if let Some(fault) = self.gravity.take(filter, &self.navigation, &f, dt) {
            self.axes.end();
            self.clock.end();
            self.senses.end();
            return Some(self.finding(time, fault));
        }
        if let Some((fault, other)) = self.axes.take(&f, dt) {
            self.clock.end();
            // one of the two is at fault
            let other = other.map(|other| format!(", {other}")).unwrap_or_default();
            return Some(fault.about(time, format!("{}{other}", self.name)));
        }
        if let Some((fault, sensor)) = self.clock.take(&w, &f, time, dt) {
            self.axes.end();
            return Some(fault.about(time, sensor.to_owned()));
        }
        if let Some((fault, sensor)) = self.senses.take(&w, &f, dt) {
            let about = sensor.unwrap_or(&self.name).to_owned();
            return Some(fault.about(time, about));
        }
        let turning = self.turning.take(&w, &f, dt);
        if turning.is_some() {
            self.senses.end();
        }
        let fault = turning
            .or_else(|| self.whiteness.take(&w, &f, dt))
            .or_else(|| self.drift.take(filter, time));
        fault.map(|fault| self.finding(time, fault))
    }

    fn corrected(&mut self, filter: &FilterView<'_>) {
        let n = &self.navigation;
        let c_b_n = filter.state.get(filter.layout, n.attitude);
        let v: Vector3<f64> = filter.state.get(filter.layout, n.velocity);
        self.turning.velocity = c_b_n.inverse() * v;
        self.gravity.corrected(&v);
    }

    fn measured(&mut self, filter: &FilterView<'_>, velocity: &MeasuredVelocity<'_>) {
        self.axes.measured(filter, &self.navigation, velocity);
        self.clock.measured(velocity);
        self.senses.measured(filter, &self.navigation, velocity);
    }

    fn widened(&mut self) {
        self.drift.widened();
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }

    fn boxed_clone(&self) -> Box<dyn Monitor> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests;
