//! Range along a beam to the bottom of a map.
//!
//! ```text
//! z = r + b,     0 = F(r) = h_t + r u_up - H(q_t [+] r u)
//! ```
//! with the transducer at the place `q_t` and the height `h_t`, the unit vector `u = C_b^n u_b` of the
//! beam, and the map `H`. `r` is implicit: it is found by bisection, and one Newton step with the
//! derivatives, `r - F(r) / F'(r)`, gives it the derivatives of the implicit function.

use crate::grid::{Grid, LONGEST};
use navfuse_core::model::sensor::limits::Limit;
use navfuse_core::model::sensor::mounting::{Beam, Reach};
use navfuse_core::prelude::*;
use navfuse_core::{Real, input, number};
use navfuse_ins::Navigation;
use std::path::PathBuf;
use std::sync::Arc;

/// Altimeter over a mapped bottom: the range along its beam, down or aslant. It finds the position
/// where the terrain has slopes.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Terrain {
    /// Map of the bottom, a GeoTIFF or a file in ESRI ASCII: heights above the ellipsoid, m, on a grid in
    /// degrees.
    pub map: PathBuf,
    /// 1-sigma noise of one range.
    pub noise: Sigma<Length>,
    /// 1-sigma error of the heights of the map from cell to cell. Default: zero.
    #[serde(default = "exact")]
    pub map_noise: Sigma<Length>,
    /// Place of the map from its true place, north, east, down: a datum, or a tide. Default: zero.
    #[serde(default)]
    pub shift: LeverArm,
    /// Direction of the beam in body axes [forward, right, down], of any length. Default: down.
    #[serde(default = "down")]
    pub beam: [Ratio; 3],
    /// Position of the transducer from the IMU, in body axes. Default: at the IMU.
    #[serde(default)]
    pub lever_arm: LeverArm,
    /// Longest range. Default: 500 m.
    #[serde(default = "reach")]
    pub reach: Positive<Length>,
    /// Process whose position is measured.
    #[serde(default = "navfuse_ins::default_name")]
    pub navigation: String,
}

fn exact() -> Sigma<Length> {
    Sigma::from_si(0.0)
}

fn down() -> [Ratio; 3] {
    [0.0, 0.0, 1.0].map(Ratio::from_si)
}

fn reach() -> Positive<Length> {
    Positive::from_si(500.0)
}

const SHIFT: Display = Display { components: &["north", "east", "down"], ..display::LEVER_ARM };

impl SensorType for Terrain {
    const TYPE: &'static str = "terrain";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("range", "m")]
    }

    fn limits(&self) -> Vec<Limit> {
        vec![Limit::range("range", 0.0, self.reach.value().si())]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let path = composer.file("map", &self.map)?;
        let named = |e: String| ComposeError::new("map", format!("{}: {e}", path.display()));
        let bytes = input::read_bytes(&path, LONGEST).map_err(|e| named(e.to_string()))?;
        let map = Arc::new(Grid::read(&bytes).map_err(named)?);
        let beam =
            Vector3::from(self.beam.map(Ratio::si)).try_normalize(0.0).filter(|u| u.norm() > 0.5);
        let beam = beam.ok_or_else(|| {
            ComposeError::new("beam", "it has no direction; give [forward, right, down]")
        })?;
        let lever_arm =
            self.lever_arm.block(composer, "lever_arm", &[0.0; 3], display::LEVER_ARM)?;
        let drawn = Beam { direction: beam.into(), channel: Some(0), reach: Reach::Range(0) };
        composer.mounted(Mounting::at(lever_arm).with_beams([drawn]));
        Ok(Role::measurement(TerrainModel {
            navigation: Navigation::find(composer, "navigation", &self.navigation)?,
            shift: self.shift.block(composer, "shift", &[0.0; 3], SHIFT)?,
            lever_arm,
            map,
            beam,
            variance: self.noise.value().si().powi(2) + self.map_noise.value().si().powi(2),
            reach: self.reach.value().si(),
        }))
    }
}

/// The measurement model of a [`Terrain`].
#[derive(Clone, Debug)]
struct TerrainModel {
    navigation: Navigation,
    shift: Handle<Vector<3>>,
    lever_arm: Handle<Vector<3>>,
    map: Arc<Grid>,
    /// Unit vector in body axes.
    beam: Vector3<f64>,
    /// Variance of a range, m^2.
    variance: f64,
    reach: f64,
}

impl TerrainModel {
    /// Height of the point at `range` along the beam above the bottom.
    fn clearance<T: Real>(&self, from: &Geodetic<T>, beam: &Vector3<T>, range: T) -> T {
        let point = from.displaced(&(beam * range));
        point.height - self.map.height(&point)
    }

    /// The range at which the beam meets the bottom, to a tenth of a micrometre; NaN where it does not.
    fn range(&self, from: &Geodetic, beam: &Vector3<f64>) -> f64 {
        let (mut above, mut below) = (0.0, self.reach);
        let clearance = |range| self.clearance(from, beam, range);
        if clearance(above).is_nan() || clearance(above) <= 0.0 {
            return f64::NAN;
        }
        // the bottom may lie before the end of the map, where there is none: the first step below it
        let steps = (1..=64).map(|k| self.reach * f64::from(k) / 64.0);
        for step in steps {
            below = step;
            match clearance(below) {
                c if c <= 0.0 => break,
                c if c > 0.0 => above = below,
                _ => return f64::NAN,
            }
        }
        if above >= below {
            return f64::NAN;
        }
        while below - above > 1e-7 {
            let middle = 0.5 * (above + below);
            let side = if clearance(middle) > 0.0 { &mut above } else { &mut below };
            *side = middle;
        }
        0.5 * (above + below)
    }
}

impl MeasurementModel<1> for TerrainModel {
    // ANCHOR: implicit
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        let transducer = self.navigation.position_at(x, &x.get(self.lever_arm));
        // a map shifted to the north is read at the south of the place
        let from = transducer.displaced(&-x.get(self.shift));
        let beam = x.get(self.navigation.attitude) * self.beam.map(convert::<f64, T>);
        let plain = Geodetic {
            latitude: number(from.latitude),
            longitude: number(from.longitude),
            height: number(from.height),
        };
        let range = self.range(&plain, &beam.map(number));
        let clearance = |range: f64| self.clearance(&from, &beam, convert(range));
        // F'(r), of the cell that the beam meets
        let slope = (number(clearance(range + 1e-3)) - number(clearance(range - 1e-3))) / 2e-3;
        SVector::from([convert::<f64, T>(range) - clearance(range) / convert(slope)])
    }
    // ANCHOR_END: implicit

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.variance)
    }

    /// Leaves the sample empty where the beam meets no bottom within its reach.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
        if sample.get(0).is_some_and(f64::is_nan) {
            sample.clear(0);
        }
    }
}
