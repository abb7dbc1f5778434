//! Files that parameters of sensors and processes name.

use navfuse_core::document::Document;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::prelude::*;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::manifold::Scalar;
use std::path::{Path, PathBuf};

/// A sensor whose noise is in a file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Tabulated {
    /// File with the 1-sigma noise, m.
    table: PathBuf,
    /// Bias of the sensor.
    bias: LengthBias,
}

struct Model(Handle<Scalar>, f64);

impl SensorType for Tabulated {
    const TYPE: &'static str = "tabulated";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("length", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let path = composer.file("table", &self.table)?;
        let text = std::fs::read_to_string(&path)
            .map_err(|e| ComposeError::new("table", e.to_string()))?;
        let sigma = text.trim().parse().map_err(|_| ComposeError::new("table", "not a number"))?;
        let bias = self.bias.block(composer, "bias", &[0.0], display::LENGTH)?;
        Ok(Role::measurement(Model(bias, sigma)))
    }
}

impl MeasurementModel<1> for Model {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.0)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.1 * self.1)
    }
}

/// Composes a scenario that lies in a folder and names a file.
fn compose(folder: &Path, table: &str) -> Result<String, String> {
    let mut registry = Registry::new();
    registry.sensor::<Tabulated>();
    let text = format!("[sensor.tabulated]\ntable = {table:?}\nbias = {{ sigma = \"1 m\" }}\n");
    let document = Document::parse(folder.join("dive.toml").display().to_string(), text).unwrap();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    scenario.compose().map(|c| c.name).map_err(|e| e.to_string())
}

#[test]
fn a_relative_path_starts_at_the_folder_of_the_scenario() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("tables")).unwrap();
    let file = folder.path().join("tables/noise.txt");
    std::fs::write(&file, "0.5\n").unwrap();
    assert_eq!(compose(folder.path(), "tables/noise.txt"), Ok("dive".to_owned()));
    assert_eq!(compose(folder.path(), file.to_str().unwrap()), Ok("dive".to_owned()));
}

#[test]
fn a_missing_file_is_named_with_its_key_and_the_path_that_was_tried() {
    let folder = tempfile::tempdir().unwrap();
    let message = compose(folder.path(), "noise.txt").unwrap_err();
    let tried = folder.path().join("noise.txt").display().to_string();
    for part in ["dive.toml:2", "sensor.tabulated.table = \"noise.txt\"", &tried, "folder"] {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}
