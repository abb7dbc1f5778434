//! The track of the vehicle: places with their sigma, and poses over time.

use crate::bodies::Body;
use crate::columns::Thinned;
use crate::quantity::Here;
use crate::rig::Mount;
use navfuse_core::model::record::Epoch;
use navfuse_core::nalgebra::{Matrix3, Quaternion, Rotation3, SymmetricEigen, UnitQuaternion};
use navfuse_core::state::manifold::{Manifold, Position};
use navfuse_core::state::{Handle, Layout};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};

/// Greatest number of vertices of a track: more would make a software renderer slow.
const VERTICES: usize = 4000;
/// Greatest number of poses of a thinned recording.
const POSES: usize = 2000;
/// Time between two poses of a full recording: 50 poses a second look continuous.
const POSE_INTERVAL: Span = Span::from_nanos(20_000_000);

/// Angular rate above which the vehicle turns, rad/s: 1 deg/s.
const TURNING: f64 = 0.0175;

/// A place of the track.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// North and east from the first position, and down from height zero, m.
    pub ned: [f32; 3],
    /// Latitude and longitude, deg.
    pub geo: [f64; 2],
    /// Horizontal 1-sigma, m; zero for the truth.
    pub sigma: f64,
}

/// A pose at one time.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Time, ns.
    pub time: i64,
    /// Place.
    pub place: Place,
    /// Attitude: x, y, z, w.
    pub attitude: [f32; 4],
    /// Half axes of the ellipsoid of 3 sigma, m, and its orientation: x, y, z, w.
    pub ellipsoid: ([f32; 3], [f32; 4]),
}

/// The position and attitude of the vehicle over time, and its track so far.
pub struct Motion {
    position: usize,
    attitude: Option<usize>,
    origin: Option<Vec<f64>>,
    /// The estimated track.
    pub estimate: Thinned<Place>,
    /// The track of the filter in a run that is smoothed.
    pub filtered: Thinned<Place>,
    /// The true track.
    pub truth: Thinned<Place>,
    /// Poses over time.
    pub poses: Thinned<Pose>,
    /// The sensors on the vehicle.
    pub mounts: Vec<Mount>,
    /// The bodies beside the vehicle.
    pub bodies: Vec<Body>,
    /// The box around the tracks.
    pub extent: Extent,
    here: Here,
    /// The rotation from the body to north, east, down.
    turn: UnitQuaternion<f64>,
    /// The time of that rotation.
    turned: Option<Time>,
    /// Set while the vehicle turns.
    pub turning: bool,
    /// The name of the truth: a recorded one is a reference.
    pub compared: &'static str,
    last: Option<Time>,
}

/// The box around the estimated and the true track.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Least north, east, down, m.
    pub low: [f32; 3],
    /// Greatest north, east, down, m.
    pub high: [f32; 3],
    /// Least and greatest latitude and longitude, deg.
    pub geo: [[f64; 2]; 2],
}

impl Extent {
    /// The box around nothing.
    pub const NONE: Self = Self {
        low: [f32::INFINITY; 3],
        high: [f32::NEG_INFINITY; 3],
        geo: [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
    };

    /// Extends the box to a place.
    pub fn include(&mut self, place: &Place) {
        for (k, x) in place.geo.iter().enumerate() {
            self.geo[0][k] = self.geo[0][k].min(*x);
            self.geo[1][k] = self.geo[1][k].max(*x);
        }
        for (k, x) in place.ned.iter().enumerate() {
            self.low[k] = self.low[k].min(*x);
            self.high[k] = self.high[k].max(*x);
        }
    }

    /// The level of the grid, m down: height zero, or the nearest level of a track far from it.
    pub fn level(&self) -> f32 {
        0.0_f32.max(self.low[2]).min(self.high[2])
    }

    /// The factor by which depths are enlarged in the view of the whole track: a dive of 50 m is flat
    /// beside legs of kilometres. Its depths are at most a sixth of its longest side.
    pub fn exaggeration(&self) -> f32 {
        let Some((_, side)) = self.middle() else { return 1.0 };
        let depths = (self.high[2] - self.low[2]).max(1.0);
        let fits = |factor: &f32| *factor * depths <= side / 6.0;
        [10.0, 5.0, 2.0].into_iter().find(fits).unwrap_or(1.0)
    }

    /// The middle, m, and the longest side, at least 1 m; `None` before the first place.
    pub fn middle(&self) -> Option<([f32; 3], f32)> {
        let side = (0..3).map(|k| self.high[k] - self.low[k]).fold(f32::NEG_INFINITY, f32::max);
        (side >= 0.0)
            .then(|| (std::array::from_fn(|k| 0.5 * (self.low[k] + self.high[k])), side.max(1.0)))
    }

    /// The middle and the radius of a ball around the box, m, whose depths are enlarged by that factor.
    pub fn ball(&self, depth: f32) -> Option<([f32; 3], f32)> {
        let (mut middle, side) = self.middle()?;
        middle[2] *= depth;
        let length = |k: usize| self.high[k] - self.low[k];
        let sides = [length(0), length(1), depth * length(2)];
        let diagonal = sides.map(|side| side * side).iter().sum::<f32>().sqrt();
        Some((middle, 0.5 * diagonal.max(side)))
    }
}

impl Motion {
    /// The track of the vehicle; `None` without a position. A full one has all poses.
    pub fn new(layout: &Layout, full: bool) -> Option<Self> {
        let vehicle = layout.vehicle();
        Some(Self {
            position: vehicle.position?.slot(),
            attitude: vehicle.attitude.map(Handle::slot),
            origin: None,
            estimate: Thinned::new(VERTICES),
            filtered: Thinned::new(VERTICES),
            truth: Thinned::new(VERTICES),
            poses: Thinned::new(if full { usize::MAX } else { POSES }),
            mounts: Vec::new(),
            bodies: Vec::new(),
            turn: UnitQuaternion::identity(),
            turned: None,
            turning: false,
            compared: "truth",
            extent: Extent::NONE,
            here: Here::default(),
            last: None,
        })
    }

    /// The place at which an angle on the Earth becomes a distance.
    pub fn here(&self) -> Here {
        self.here
    }

    /// Adds the filter's own estimate in a run that is smoothed.
    pub fn filtered(&mut self, epoch: &Epoch<'_>) {
        let place = self.place(epoch, &epoch.state.values, 0.0);
        self.extent.include(&place);
        self.filtered.push(place);
        self.set_here(epoch);
        self.set_turn(epoch);
    }

    /// A position of an epoch from the place at height zero under the first one.
    fn place(&mut self, epoch: &Epoch<'_>, values: &[f64], sigma: f64) -> Place {
        let block = &epoch.layout.blocks[self.position];
        let value = &values[block.range()];
        let origin = self.origin.get_or_insert_with(|| value.to_vec());
        let (mut ned, mut geo) = ([0.0; 3], [0.0; 3]);
        (block.operations.local)(value, origin, &mut ned);
        (block.operations.coordinates)(value, &mut geo);
        ned[2] = -geo[2];
        let geo = [geo[0].to_degrees(), geo[1].to_degrees()];
        Place { ned: ned.map(|x| x as f32), geo, sigma }
    }

    fn set_turn(&mut self, epoch: &Epoch<'_>) {
        self.mounts.iter_mut().for_each(|mount| mount.epoch(epoch));
        let values = |slot: usize| &epoch.state.values[epoch.layout.blocks[slot].range()];
        let Some(&[w, x, y, z]) = self.attitude.map(values) else { return };
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let interval = self.turned.map_or(0.0, |before| epoch.state.time.since(before));
        if interval > 0.0 {
            self.turning = self.turn.angle_to(&turn) > TURNING * interval;
        }
        (self.turn, self.turned) = (turn, Some(epoch.state.time));
    }

    fn set_here(&mut self, epoch: &Epoch<'_>) {
        let block = &epoch.layout.blocks[self.position];
        let mut geo = [0.0; 3];
        (block.operations.coordinates)(&epoch.state.values[block.range()], &mut geo);
        self.here = Here { latitude: geo[0], height: geo[2] };
    }

    /// Takes the pose of a sample of that body's navigation, once the track has begun.
    pub fn body(&mut self, body: usize, sample: &Sample) {
        let Some(origin) = &self.origin else { return };
        let origin = <Position as Manifold>::load::<f64>(origin);
        if let Some((ned, geo)) = self.bodies[body].sample(sample, &origin) {
            self.extent.include(&Place { ned, geo, sigma: 0.0 });
        }
    }

    /// Takes the beams of a sample of that sensor on the vehicle.
    pub fn sample(&mut self, mount: usize, sample: &Sample) {
        self.mounts[mount].sample(sample, &self.turn);
    }

    /// Adds an estimate and, where it is known, the truth.
    pub fn epoch(&mut self, epoch: &Epoch<'_>) {
        let block = &epoch.layout.blocks[self.position];
        let covariance = block.tangent.map_or_else(Matrix3::zeros, |t| {
            Matrix3::from_fn(|i, j| epoch.covariance.get(t + i, t + j))
        });
        let sigma = (covariance[(0, 0)] + covariance[(1, 1)]).max(0.0).sqrt();
        let values = &epoch.state.values;
        self.set_here(epoch);
        let here = self.place(epoch, values, sigma);
        self.extent.include(&here);
        self.estimate.push(here);
        if let Some(truth) = epoch.truth.filter(|t| t.known[self.position]) {
            let there = self.place(epoch, &truth.state.values, 0.0);
            self.extent.include(&there);
            self.truth.push(there);
        }
        self.set_turn(epoch);
        let time = epoch.state.time;
        if self.last.is_none_or(|last| time - last >= POSE_INTERVAL) {
            self.last = Some(time);
            let of = |slot: usize| &values[epoch.layout.blocks[slot].range()];
            let attitude = self.attitude.map_or([0.0, 0.0, 0.0, 1.0], |slot| {
                let q = of(slot);
                [q[1], q[2], q[3], q[0]].map(|x| x as f32)
            });
            let ellipsoid = ellipsoid(&covariance);
            self.poses.push(Pose { time: time.nanos(), place: here, attitude, ellipsoid });
        }
    }
}

/// Half axes and orientation of the ellipsoid of 3 sigma: the eigenvalues and eigenvectors of the
/// covariance.
fn ellipsoid(covariance: &Matrix3<f64>) -> ([f32; 3], [f32; 4]) {
    let eigen = SymmetricEigen::new(*covariance);
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        // eigenvectors have no sign; a rotation has
        axes.column_mut(0).neg_mut();
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    let half = [0, 1, 2].map(|k| 3.0 * eigen.eigenvalues[k].max(0.0).sqrt() as f32);
    (half, [q.i, q.j, q.k, q.w].map(|x| x as f32))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use navfuse_core::nalgebra::Vector3;

    #[test]
    fn depths_are_enlarged_to_a_sixth_of_the_track_at_most() {
        let factor = |side: f32, depth: f32| {
            let geo = Extent::NONE.geo;
            Extent { low: [0.0; 3], high: [side, 10.0, depth], geo }.exaggeration()
        };
        assert_eq!(
            [factor(1900.0, 55.0), factor(500.0, 30.0), factor(100.0, 90.0)],
            [5.0, 2.0, 1.0]
        );
        // the heave of a ship is no dive
        assert_eq!([factor(40.0, 0.1), Extent::NONE.exaggeration()], [5.0, 1.0]);
    }

    #[test]
    fn the_ellipsoid_has_the_axes_of_the_covariance() {
        let turn = Rotation3::from_euler_angles(0.3, -0.2, 1.1);
        let variances = Vector3::new(4.0, 1.0, 0.25);
        let covariance =
            turn.matrix() * Matrix3::from_diagonal(&variances) * turn.matrix().transpose();
        let (half, [x, y, z, w]) = ellipsoid(&covariance);
        let axes = UnitQuaternion::from_quaternion(Quaternion::new(
            f64::from(w),
            f64::from(x),
            f64::from(y),
            f64::from(z),
        ));
        let squares = Vector3::from(half.map(|h| f64::from(h / 3.0).powi(2)));
        let again = axes.to_rotation_matrix();
        let again = again.matrix() * Matrix3::from_diagonal(&squares) * again.matrix().transpose();
        // single precision
        assert!((again - covariance).norm() < 1e-5, "{again} {covariance}");
    }
}
