//! A fixed place that the scenario gives, and its displacement, which may be a state.

use crate::line::line;
use navfuse_core::Real;
use navfuse_core::prelude::*;
use navfuse_core::units::{Latitude, Longitude};

/// A place on the Earth.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Geodetic latitude.
    pub latitude: Latitude,
    /// Longitude.
    pub longitude: Longitude,
    /// Height above the ellipsoid.
    pub height: Length,
}

const NED: Display = Display { components: &["north", "east", "down"], ..display::LEVER_ARM };

/// Cosine of a latitude beyond which the meridians over 3 km are not parallel: at 89.5 deg by 3 deg.
const NEAR_POLE: f64 = 0.0087;

/// A [`Place`] and the handle of its displacement.
#[derive(Clone, Debug)]
pub(crate) struct Displaced {
    place: Geodetic,
    /// Set if the meridians of vehicle and place differ by more than the displacement is known.
    near_pole: bool,
    displacement: Handle<Vector<3>>,
}

impl Displaced {
    pub(crate) fn new(
        composer: &mut Composer,
        place: &Place,
        displacement: LeverArm,
    ) -> Result<Self, ComposeError> {
        let latitude = place.latitude.angle().si();
        let longitude = place.longitude.angle().si();
        Ok(Self {
            place: Geodetic { latitude, longitude, height: place.height.si() },
            near_pole: latitude.cos() < NEAR_POLE,
            displacement: displacement.block(composer, "displacement", &[0.0; 3], NED)?,
        })
    }

    /// The straight line from a position to the place, m: north, east and down at the position.
    pub(crate) fn seen_from<T: Real>(&self, x: &View<'_, T>, position: &Geodetic<T>) -> Vector3<T> {
        // the displacement is added as a vector, which metres resolve better than radians
        let mut displacement = x.get(self.displacement);
        if self.near_pole {
            // north of the place is another direction than north of the vehicle
            let (sin, cos) = self.place.cast().turn_to(position).sin_cos();
            let [north, east] = [displacement.x, displacement.y];
            displacement.x = cos * north - sin * east;
            displacement.y = sin * north + cos * east;
        }
        line(position, &self.place.cast()) + displacement
    }
}
