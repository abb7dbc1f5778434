//! A current profiler: the velocity through the water in cells below the vehicle, with the current in
//! layers of depth as states.

use crate::instrument::Instrument;
use crate::keys::doppler_sensor;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LeverArm, Misalignment, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector3, convert};
use navfuse_core::plugin::SensorType;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{Handle, View, display};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, Sigma, Speed, Triple};
use navfuse_core::{Real, number};
use schemars::JsonSchema;
use serde::Deserialize;

/// Largest number of cells of one time.
const MOST: usize = 128;
/// Channel of the distance of a cell.
const DISTANCE: usize = 3;

doppler_sensor! {
    /// Acoustic Doppler current profiler (ADCP): the velocity through the water along the
    /// instrument's own three axes, in cells of water below it. The current is a state in each layer
    /// of depth.
    pub struct WaterProfile {
        /// 1-sigma noise of one cell, one value or one per axis.
        pub noise: Sigma<Triple<Speed>>,
        /// Depths of the states, from the shallow to the deep one. The current is linear between them,
        /// and constant above the first and below the last.
        pub layers: Vec<Length>,
        /// Current of each layer, north, east, down, with the same prior: a Gauss-Markov process with
        /// a `correlation_time`, or a random walk where `random_walk` is given.
        pub current: crate::instrument::VelocityBias,
        /// Height of the sea surface above the ellipsoid, from which depths count. Default: zero.
        #[serde(default = "zero")]
        pub surface: Length,
        /// Keys that only a simulation needs.
        #[serde(default)]
        pub simulation: Cells,
    }
}

/// Cells of a simulated profiler.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cells {
    /// Number of cells, up to 128.
    pub cells: usize,
    /// Distance of the first cell from the instrument.
    pub first: Length,
    /// Distance from cell to cell.
    pub size: Length,
}

impl Default for Cells {
    fn default() -> Self {
        Self { cells: 10, first: Length::from_si(4.0), size: Length::from_si(4.0) }
    }
}

fn zero() -> Length {
    Length::from_si(0.0)
}

/// The measurement model of a [`WaterProfile`].
#[derive(Clone, Debug)]
pub struct ProfileModel {
    instrument: Instrument,
    /// 1-sigma, m/s.
    sigma: Vector3<f64>,
    /// Depth, m, and current of each layer.
    layers: Vec<(f64, Handle<Vector<3>>)>,
    /// Height of the surface, m.
    surface: f64,
    cells: Cells,
}

impl SensorType for WaterProfile {
    const TYPE: &'static str = "water-profile";

    fn channels(&self) -> Vec<Channel> {
        let axes = ["vel_x", "vel_y", "vel_z"].map(|name| Channel::new(name, "mps"));
        axes.into_iter().chain([Channel::new("distance", "m")]).collect()
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let wrong = |message: &str| Err(ComposeError::new("layers", message));
        if self.layers.is_empty() {
            return wrong("give at least one depth, such as [\"10 m\", \"40 m\"]");
        }
        if self.layers.windows(2).any(|pair| pair[0].si() >= pair[1].si()) {
            return wrong("the depths increase from the first to the last");
        }
        let instrument = self.instrument(composer)?;
        composer.mounted(instrument.mounting());
        let layer = |(k, depth): (usize, &Length)| {
            let name = format!("current_{}", k + 1);
            let current = self.current.block(composer, &name, &[0.0; 3], display::VELOCITY)?;
            Ok((depth.si(), current))
        };
        let layers = self.layers.iter().enumerate().map(layer).collect::<Result<_, _>>()?;
        Ok(Role::measurement(ProfileModel {
            instrument,
            sigma: self.noise.value().si(),
            layers,
            surface: self.surface.si(),
            cells: self.simulation,
        }))
    }
}

impl ProfileModel {
    /// Current at a depth, north, east, down.
    fn current<T: Real>(&self, x: &View<'_, T>, depth: T) -> Vector3<T> {
        let below = self.layers.partition_point(|(layer, _)| *layer <= number(depth));
        let layer = |k: usize| self.layers.get(k).copied();
        match (below.checked_sub(1).and_then(layer), layer(below)) {
            (Some((top, above)), Some((bottom, below))) => {
                let share = (depth - convert(top)) / convert(bottom - top);
                x.get(above) * (T::one() - share) + x.get(below) * share
            }
            (Some((_, only)), None) | (None, Some((_, only))) => x.get(only),
            (None, None) => Vector3::zeros(),
        }
    }
}

impl MeasurementModel<3> for ProfileModel {
    fn observations(&self) -> usize {
        MOST
    }

    /// `y = k C_b^d (C_n^b (v^n - c(D)) + w_eb^b x l) + b` with the depth `D` of the cell, which is at its
    /// distance along the down axis of the instrument.
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let Some(distance) = x.channel(DISTANCE) else {
            return SVector::repeat(convert(f64::NAN)); // the sample is rejected
        };
        let down = self.instrument.in_navigation(x, &Vector3::z());
        let height = self.instrument.place(x).height - down.z * convert(distance);
        let current = self.current(x, -height + convert(self.surface));
        self.instrument.through(x, Some(current))
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::from_diagonal(&self.sigma.map(|s| s * s))
    }

    /// Fills the sample of one cell.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        if scene.observation < self.cells.cells {
            let distance = self.cells.first.si() + scene.observation as f64 * self.cells.size.si();
            sample.set(DISTANCE, distance);
            scene.measure(self, sample);
        }
    }
}
