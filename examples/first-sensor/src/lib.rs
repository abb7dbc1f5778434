//! Plugin of the tutorial: an altimeter in one file, with its tests.
//!
//! `z = (h - h_bottom) / (e_D . C_b^n e_z)`: the range along the body's down axis to a flat bottom.

// ANCHOR: parameters
use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LengthBias, LeverArm};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::plugin::{Plugin, Registry, SensorType};
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Scalar, Vector};
use navfuse_core::state::{Display, Handle, View};
use navfuse_core::units::sample::Channel;
use navfuse_core::units::{Length, Sigma};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;

/// Altimeter: one sonar beam along the body's down axis to a flat bottom.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Altimeter {
    /// 1-sigma noise of one range.
    pub noise: Sigma<Length>,
    /// Height of the bottom above the ellipsoid, negative below it.
    pub bottom: LengthBias,
    /// Position of the transducer relative to the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Process whose motion the altimeter measures.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}
// ANCHOR_END: parameters

// ANCHOR: sensor
const BOTTOM: Display = Display { unit: "m", scale: 1.0, components: &["height"] };

impl SensorType for Altimeter {
    const TYPE: &'static str = "altimeter";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m")]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        composer.mounted(Mounting::at(lever_arm)); // where viewers draw it
        Ok(Role::measurement(AltimeterModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            bottom: self.bottom.block(composer, "bottom", &[0.0], BOTTOM)?,
            lever_arm,
            sigma: self.noise.value().si(),
        }))
    }
}
// ANCHOR_END: sensor

// ANCHOR: model
/// The measurement model of an [`Altimeter`].
#[derive(Clone, Debug)]
pub struct AltimeterModel {
    navigation: Navigation,
    bottom: Handle<Scalar>,
    lever_arm: Handle<Vector<3>>,
    sigma: f64,
}

impl MeasurementModel<1> for AltimeterModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let transducer = self.navigation.position_at(x, &x.get(self.lever_arm));
        let c_b_n = x.get(self.navigation.attitude);
        let slope = c_b_n.matrix()[(2, 2)]; // cosine of the angle between the beam and the vertical
        SVector::from([(transducer.height - x.get(self.bottom)) / slope])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }
}
// ANCHOR_END: model

// ANCHOR: plugin
/// Registers the sensor type `altimeter`.
#[derive(Clone, Copy, Debug)]
pub struct AltimeterPlugin;

impl Plugin for AltimeterPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Altimeter>();
    }
}
// ANCHOR_END: plugin

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
    use super::*;
    use navfuse_core::document::Document;
    use navfuse_core::model::sensor::measurement::At;
    use navfuse_core::run::runner;
    use navfuse_core::run::scenario::Scenario;
    use navfuse_core::session::Finished;
    use std::sync::atomic::AtomicBool;

    // ANCHOR: scenario
    const SCENARIO: &str = r#"
        name = "altimeter"
        seed = 1

        [estimator]
        draw = "start"

        [process.ins]
        attitude = { sigma = ["0.01 deg", "0.01 deg", "0.1 deg"] }
        velocity = { sigma = "5 mm/s" }
        position = { sigma = ["1 m", "1 m", "0.1 m"] }

        [sensor.imu]
        gyro_noise = "0.1 deg/h/sqrt(Hz)"
        accel_noise = "10 ug/sqrt(Hz)"
        simulation = { rate = "100 Hz" }

        [sensor.dvl]
        noise = "2 cm/s"
        simulation = { rate = "5 Hz" }

        [sensor.altimeter]
        noise = "5 cm"
        bottom = { initial = "-80 m", sigma = "5 m", truth = "-83 m" }
        lever_arm = ["0.5 m", "0 m", "0.2 m"]
        simulation = { rate = "2 Hz" }

        [sensor.reference]
        simulation = { rate = "10 Hz" }

        [source.simulation]
        segments = [
            { type = "surge", duration = "60 s", speed = "2 m/s" },
            { type = "descend", duration = "60 s", rate = "1 m/s" },
            { type = "turn", duration = "30 s", angle = "90 deg", bank = "8 deg" },
            { type = "cruise", duration = "150 s" },
        ]
    "#;
    // ANCHOR_END: scenario

    // ANCHOR: test
    fn run(settings: &[&str]) -> Finished {
        let mut registry = Registry::new();
        registry
            .add(&navfuse_ins::InsPlugin)
            .add(&navfuse_doppler::DvlPlugin)
            .add(&navfuse_simulation::SimulationPlugin)
            .add(&AltimeterPlugin);
        let document = Document::parse("altimeter.toml", SCENARIO).unwrap();
        let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
        let scenario = Scenario::new(&registry, document, &settings).unwrap();
        let finished =
            runner::run(scenario.assemble(None).unwrap(), &AtomicBool::new(false), |_| {});
        assert!(finished.error.is_none(), "{:?}", finished.error);
        finished
    }

    #[test]
    fn its_innovations_are_consistent_with_their_covariance() {
        let summary = run(&[]).summary;
        let altimeter = &summary.samples["altimeter"];
        let n = altimeter["accepted"].as_f64().unwrap();
        assert!(n > 590.0, "{altimeter}"); // 300 s at 2 Hz
        // NIS of one channel: chi-square with one degree of freedom, so mean 1 and variance 2. The
        // bound is five sigma of the mean.
        let mean = altimeter["mean_nis"].as_f64().unwrap();
        assert!((mean - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "mean NIS {mean} of {n}");
    }

    #[test]
    fn the_error_of_the_bottom_height_is_consistent_with_its_sigma() {
        let mut squares = 0.0;
        for seed in 1..=20 {
            let summary = run(&[&format!("seed={seed}")]).summary;
            let bottom = summary.rows.iter().find(|r| r.name == "altimeter.bottom").unwrap();
            let (error, sigma) = (bottom.error.as_ref().unwrap()[0], bottom.sigma[0]);
            // Only the difference of height and bottom is observable: the uncertainty of the bottom
            // stays at that of the initial height, 0.1 m.
            assert!((0.1..0.11).contains(&sigma), "{sigma}");
            squares += (error / sigma).powi(2);
        }
        // Chi-square with 20 degrees of freedom lies between 7 and 40 with a probability of 0.99.
        assert!((7.0..40.0).contains(&squares), "{squares}");
    }

    #[test]
    fn the_range_is_the_height_above_the_bottom_along_the_beam() {
        let mut registry = Registry::new();
        registry.add(&navfuse_ins::InsPlugin).add(&AltimeterPlugin);
        let mut document = Document::parse("altimeter.toml", SCENARIO).unwrap();
        for change in [
            "source.simulation.enabled=false",
            "sensor.dvl.enabled=false",
            "sensor.altimeter.bottom=-83 m",
        ] {
            document.set(change).unwrap();
        }
        let composition = Scenario::new(&registry, document, &[]).unwrap().compose().unwrap();
        let layout = &composition.layout;
        let mut state = layout.initial_state(); // at height zero, level
        let attitude = layout.find("ins.attitude").unwrap();
        (attitude.operations.from_coordinates)(
            &[20_f64.to_radians(), 0.0, 0.0],
            &mut state.values[attitude.range()],
        );
        let Role::Measurement(model) =
            &composition.sensors[composition.sensor("altimeter").unwrap()].role
        else {
            panic!("an altimeter measures");
        };
        let mut range = [0.0];
        model.predict(&At::state(layout, &state), &mut range);
        // 83 m above the bottom, 20 deg from the vertical: 83 / cos(20 deg), minus the lever arm of
        // 0.2 m along the beam
        assert!((range[0] - (83.0 / 20_f64.to_radians().cos() - 0.2)).abs() < 1e-9, "{}", range[0]);
    }
    // ANCHOR_END: test
}
