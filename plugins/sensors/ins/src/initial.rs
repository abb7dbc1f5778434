//! Priors and initial values of the navigation states, as a scenario gives them.

use crate::mechanisation::MAX_LATITUDE_DEG;
use nalgebra::Vector3;
use navfuse_core::compose::Composer;
use navfuse_core::model::error::ComposeError;
use navfuse_core::state::{BlockSpec, Display, Dynamics, Mode, display};
use navfuse_core::units::{Angle, Components, Latitude, Length, Longitude, Sigma, Triple};
use schemars::JsonSchema;
use serde::Deserialize;

/// Prior and initial value of a state.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound = "V: Components")]
pub struct InitialValue<V: Components> {
    /// Prior 1-sigma.
    pub sigma: Sigma<V>,
    /// Initial value; left out where a reference gives it.
    pub initial: Option<V>,
}

/// Prior and initial value of the position.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InitialPosition {
    /// Prior 1-sigma north, east, down.
    pub sigma: Sigma<Triple<Length>>,
    /// Geodetic latitude; left out where a reference gives it.
    pub latitude: Option<Latitude>,
    /// Longitude.
    pub longitude: Option<Longitude>,
    /// Height above the ellipsoid.
    pub height: Option<Length>,
}

/// Block of a navigation state with its prior sigma, and with its initial value where no reference
/// gives it.
///
/// # Errors
/// When a sigma is zero.
pub(crate) fn spec(
    composer: &mut Composer,
    name: &str,
    sigma: Vector3<f64>,
    initial: Option<[f64; 3]>,
    display: Display,
) -> Result<BlockSpec, ComposeError> {
    if sigma.iter().any(|s| *s <= 0.0) {
        return Err(ComposeError::new(
            format!("{name}.sigma"),
            "a prior sigma of zero makes the covariance singular: give a positive one on every axis",
        ));
    }
    if initial.is_none() {
        composer.needs_reference(name);
    }
    Ok(BlockSpec {
        mode: Mode::Estimate,
        initial: initial.unwrap_or_default().to_vec(),
        sigma: sigma.as_slice().to_vec(),
        truth: None,
        dynamics: Dynamics::Constant,
        display,
    })
}

/// As [`spec`], for a state that the scenario gives, or that the alignment finds with the prior
/// sigma `found`.
pub(crate) fn start<V: Components>(
    composer: &mut Composer,
    name: &str,
    given: Option<InitialValue<V>>,
    found: Option<Vector3<f64>>,
    display: Display,
) -> Result<BlockSpec, ComposeError> {
    match (given, found) {
        (Some(given), None) => {
            let three = |v: V| Vector3::from_iterator(v.components());
            let initial = given.initial.map(|v| three(v).into());
            spec(composer, name, three(given.sigma.value()), initial, display)
        }
        (None, None) => {
            let text = format!(
                "missing: give {name} = {{ sigma = ... }}, or let it be found: alignment = \"static\""
            );
            Err(ComposeError::new("", text))
        }
        (given, Some(sigma)) => {
            if given.is_some() {
                composer.note(format!(
                    "{name} is found by the alignment: its sigma and initial value are not used"
                ));
            }
            spec(composer, name, sigma, Some([0.0; 3]), display)
        }
    }
}

impl<V: Components> InitialValue<V> {
    /// Block of this prior, in the order of the components of `V`, of which there are three.
    ///
    /// # Errors
    /// When a sigma is zero.
    pub fn block(
        self,
        composer: &mut Composer,
        name: &str,
        display: Display,
    ) -> Result<BlockSpec, ComposeError> {
        start(composer, name, Some(self), None, display)
    }
}

impl InitialPosition {
    /// Latitude and longitude (rad) and height (m), where the scenario gives them.
    ///
    /// # Errors
    /// When some of them are missing, or an angle is out of range.
    pub(crate) fn initial(&self) -> Result<Option<[f64; 3]>, ComposeError> {
        self.initial_within(MAX_LATITUDE_DEG)
    }

    /// As [`Self::initial`], with a limit of the latitude, deg.
    pub(crate) fn initial_within(&self, most: f64) -> Result<Option<[f64; 3]>, ComposeError> {
        let angles = (self.latitude.map(Latitude::angle), self.longitude.map(Longitude::angle));
        match (angles.0, angles.1, self.height) {
            (Some(latitude), Some(longitude), Some(height)) => {
                within("position.latitude", latitude, most)?;
                within("position.longitude", longitude, 360.0)?;
                Ok(Some([latitude.si(), longitude.si(), height.si()]))
            }
            (None, None, None) => Ok(None),
            _ => {
                let text = "give latitude, longitude and height, or none of them";
                Err(ComposeError::new("position", text))
            }
        }
    }

    /// Block of this prior.
    ///
    /// # Errors
    /// When a sigma is zero, some of the coordinates are missing, or one is out of range.
    pub fn block(&self, composer: &mut Composer) -> Result<BlockSpec, ComposeError> {
        let initial = self.initial()?;
        spec(composer, "position", self.sigma.value().si(), initial, display::POSITION)
    }
}

/// Rejects an angle beyond a limit in degrees, north or south, east or west.
fn within(key: &str, angle: Angle, limit: f64) -> Result<(), ComposeError> {
    if angle.si().abs().to_degrees() <= limit {
        return Ok(());
    }
    Err(ComposeError::new(key, format!("found \"{angle}\"; give a value within {limit} deg")))
}
