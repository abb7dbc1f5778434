//! The place and the axes of a sensor are what it declares, whatever its states are called: the
//! misalignment of a camera on land is none of the lamp's on the vehicle.

use navfuse_core::document::Document;
use navfuse_core::model::sensor::mounting::Mounting;
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;

#[derive(Deserialize, JsonSchema)]
struct Still {}

impl ProcessType for Still {
    const TYPE: &'static str = "still";
    fn build(self, _: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

#[derive(Deserialize, JsonSchema)]
struct Camera {
    #[serde(default)]
    lamp: bool,
    lever_arm: LeverArm,
    misalignment: Misalignment,
}

struct Model {
    lamp: Handle<Vector<3>>,
    camera: Handle<Rotation>,
}

impl SensorType for Camera {
    const TYPE: &'static str = "camera";
    fn channels(&self) -> Vec<Channel> {
        ["x", "y", "z"].map(|name| Channel::new(name, "m")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let lamp = self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        let camera =
            self.misalignment.block(composer, "misalignment", &[0.0; 3], display::ANGLES)?;
        if self.lamp {
            composer.mounted(Mounting::at(lamp));
        }
        Ok(Role::measurement(Model { lamp, camera }))
    }
}

impl MeasurementModel<3> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        x.get(self.camera) * x.get(self.lamp)
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity()
    }
}

#[test]
fn a_sensor_is_drawn_where_it_declares_and_at_the_origin_otherwise() {
    const TEXT: &str = "[process.still]\n[sensor.camera]\nlever_arm = { sigma = \"1 m\" }\n\
                        misalignment = { sigma = \"1 deg\" }\n";
    let mut registry = Registry::new();
    registry.process::<Still>().sensor::<Camera>();
    let mounting = |text: &str| {
        let document = Document::parse("camera.toml", text).unwrap();
        let scenario = Scenario::new(&registry, document, &[]).unwrap();
        let composition = scenario.compose().unwrap();
        let mounting = composition.sensors[0].info.mounting.clone();
        (mounting.is_placed(), mounting.is_turned())
    };
    assert_eq!(mounting(TEXT), (false, false));
    assert_eq!(mounting(&format!("{TEXT}lamp = true\n")), (true, false));
}
