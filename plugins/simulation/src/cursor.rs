//! The values of a trajectory, in the order of time.

use crate::carried::Place;
use crate::phase::{Motion, Phase, Piece};
use crate::trajectory::Trajectory;
use nalgebra::{UnitQuaternion, Vector3, Vector5};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_ins::earth::LocalEarth;
use std::sync::{Arc, Mutex, PoisonError};

/// Step of the grid on which the position is integrated, s. A power of two, so that its nodes are
/// exact.
const GRID: f64 = 0.125;
/// Longest interval of one quadrature of the inertial measurements, s.
const QUADRATURE: f64 = 0.125;
/// Nodes and weights of Gauss-Legendre quadrature with three points on [-1/2, 1/2].
const GAUSS: [(f64, f64); 3] = [
    (-0.387_298_334_620_741_7, 5.0 / 18.0),
    (0.0, 8.0 / 18.0),
    (0.387_298_334_620_741_7, 5.0 / 18.0),
];
/// Node and weight of the quadrature of a constant.
const CONSTANT: [(f64, f64); 1] = [(0.0, 1.0)];

/// True motion at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    /// Time since the start, s.
    pub time: f64,
    /// Geodetic position.
    pub position: Geodetic,
    /// Velocity relative to the Earth, NED, m/s.
    pub velocity: Vector3<f64>,
    /// Derivative of the velocity's components, m/s^2; on a trajectory that wanders of those in carried
    /// axes, turned to NED.
    pub acceleration: Vector3<f64>,
    /// Rotation from body to NED.
    pub c_b_n: UnitQuaternion<f64>,
    /// Roll, pitch and heading, rad; the heading counts whole turns.
    pub euler: Vector3<f64>,
    /// Derivatives of roll, pitch and heading, rad/s.
    pub euler_rates: Vector3<f64>,
    /// Angular rate of the body relative to NED, or to carried axes, in the body, rad/s.
    pub w_nb_b: Vector3<f64>,
    /// Angular rate of the body relative to inertial space, in the body, rad/s: the output of a
    /// perfect gyroscope.
    pub w_ib_b: Vector3<f64>,
    /// Specific force, in the body, m/s^2: the output of a perfect accelerometer.
    pub specific_force: Vector3<f64>,
    /// Distance travelled since the start, m.
    pub distance: f64,
}

/// Latitude (rad), longitude (rad), height (m), distance travelled (m) and zero; on a trajectory that
/// wanders the rotation vector of its axes (rad), distance and height.
type Path = Vector5<f64>;

/// The path and its derivative at one node of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    path: Path,
    rate: Path,
}

/// Number of nodes that cursors share: 8 s, since the sensors of a vehicle are read in the order of time.
const SHARED: usize = 64;

/// The last nodes that a cursor of the trajectory has computed, with their numbers: all cursors compute the
/// same, and one for each sensor follows the path.
#[derive(Clone, Debug)]
pub(crate) struct Nodes(Arc<Mutex<[Option<Numbered>; SHARED]>>);

type Numbered = (u64, Node);

impl Default for Nodes {
    fn default() -> Self {
        Self(Arc::new(Mutex::new([None; SHARED])))
    }
}

impl PartialEq for Nodes {
    /// The nodes of equal trajectories are equal.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Nodes {
    fn place(number: u64) -> usize {
        (number % SHARED as u64) as usize
    }

    fn get(&self, number: u64) -> Option<Node> {
        let nodes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        nodes[Self::place(number)].filter(|node| node.0 == number).map(|node| node.1)
    }

    fn put(&self, number: u64, node: Node) {
        let mut nodes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        nodes[Self::place(number)] = Some((number, node));
    }
}

/// The readings of a vehicle at rest: angular rate (rad/s) and specific force (m/s^2) in the body.
#[derive(Clone, Copy, Debug)]
struct Rest {
    piece: usize,
    rate: Vector3<f64>,
    force: Vector3<f64>,
}

/// Reads a trajectory forwards, in constant memory and without allocating.
///
/// Velocity, attitude and their derivatives are closed forms of time. The position is their
/// integral by the classical Runge-Kutta method on a fixed grid, with cubic Hermite interpolation
/// between the nodes. The position depends on the time alone, so all cursors agree to the bit. A
/// time before the present cell of the grid restarts the integration. Times before the start or
/// after the end are limited to the start or the end.
#[derive(Debug)]
pub struct Cursor<P: Piece = Phase> {
    trajectory: Trajectory<P>,
    piece: usize,
    /// Number of the present cell, which lies between this node of the grid and the next.
    cell: u64,
    from: Node,
    to: Node,
    /// Readings in the present piece, where the vehicle is at rest in it.
    rest: Option<Rest>,
}

impl<P: Piece> Clone for Cursor<P> {
    fn clone(&self) -> Self {
        Self { trajectory: self.trajectory.clone(), ..*self }
    }
}

impl<P: Piece> Cursor<P> {
    pub(crate) fn new(trajectory: Trajectory<P>) -> Self {
        let o = trajectory.origin;
        let path = if trajectory.wanders {
            Path::new(0.0, 0.0, 0.0, 0.0, o.height)
        } else {
            Path::new(o.latitude, o.longitude, o.height, 0.0, 0.0)
        };
        let node = Node { path, rate: Path::zeros() };
        let mut cursor = Self { trajectory, piece: 0, cell: 0, from: node, to: node, rest: None };
        cursor.from.rate = cursor.rate(0.0, &path);
        cursor.to = cursor.step();
        cursor
    }

    /// Trajectory that the cursor reads.
    pub fn trajectory(&self) -> &Trajectory<P> {
        &self.trajectory
    }

    /// True motion at a time, s.
    pub fn at(&mut self, time: f64) -> Kinematics {
        let time = self.clamp(time);
        let path = self.path(time);
        let phase = self.seek(time);
        let (euler, euler_rates) = phase.euler(time);
        let motion = phase.motion(time);
        let c_b_n = UnitQuaternion::from_euler_angles(euler.x, euler.y, euler.z);
        if self.trajectory.wanders {
            return self.at_place(time, &path, &motion, (c_b_n, euler, euler_rates));
        }
        let (rate, force) = inertial(&motion, &LocalEarth::at(path.x, path.z));
        Kinematics {
            time,
            position: Geodetic { latitude: path.x, longitude: path.y, height: path.z },
            velocity: motion.velocity,
            acceleration: motion.acceleration,
            c_b_n,
            euler,
            euler_rates,
            w_nb_b: motion.w_nb_b,
            w_ib_b: motion.w_nb_b + motion.c_b_n.tr_mul(&rate),
            specific_force: motion.c_b_n.tr_mul(&force),
            distance: path.w,
        }
    }

    /// Place of a path on a trajectory that wanders.
    fn place(&self, path: &Path) -> Place {
        Place::reached(&self.trajectory.origin, &path.fixed_rows::<3>(0).into(), path.a)
    }

    /// True motion on a trajectory that wanders, to the north.
    fn at_place(
        &self,
        time: f64,
        path: &Path,
        motion: &Motion,
        (c_b_w, euler, euler_rates): (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>),
    ) -> Kinematics {
        let place = self.place(path);
        let (rate, force) = place.inertial(motion);
        Kinematics {
            time,
            position: place.position,
            velocity: place.northern(&motion.velocity),
            acceleration: place.northern(&motion.acceleration),
            c_b_n: place.attitude(&c_b_w),
            euler: Vector3::new(euler.x, euler.y, place.heading(euler.z)),
            euler_rates,
            w_nb_b: motion.w_nb_b,
            w_ib_b: motion.w_nb_b + motion.c_b_n.tr_mul(&rate),
            specific_force: motion.c_b_n.tr_mul(&force),
            distance: path.w,
        }
    }

    /// Integrals from one time to another (s) of angular rate `w_ib^b` (rad) and specific force
    /// `f^b` (m/s): the output of a perfect integrating inertial sensor.
    pub fn increments(&mut self, from: f64, to: f64) -> (Vector3<f64>, Vector3<f64>) {
        let (mut t, to) = (self.clamp(from), self.clamp(to));
        let (mut angle, mut velocity) = (Vector3::zeros(), Vector3::zeros());
        while t < to {
            // Only a piece is smooth, so no quadrature crosses its end.
            let end = to.min(t + QUADRATURE).min(self.seek(t).span().1);
            let (length, middle) = (end - t, t + 0.5 * (end - t));
            if let Some(Rest { rate, force, .. }) = self.rest.filter(|r| r.piece == self.piece) {
                angle += rate * length;
                velocity += force * length;
                t = end;
                continue;
            }
            // Latitude and height change by at most 1e-7 rad and 1 m, so their effect is linear,
            // and its mean is the effect at the middle.
            let path = self.path(middle);
            let carried = self.trajectory.wanders.then(|| self.place(&path));
            let earth = LocalEarth::at(path.x, path.z);
            let phase = self.seek(t);
            let steady = phase.is_steady();
            let points = if steady { &CONSTANT[..] } else { &GAUSS[..] };
            let mut rest = None;
            for &(place, weight) in points {
                let motion = phase.motion(middle + place * length);
                let (rate, force) = match &carried {
                    Some(place) => place.inertial(&motion),
                    None => inertial(&motion, &earth),
                };
                let (rate, force) =
                    (motion.w_nb_b + motion.c_b_n.tr_mul(&rate), motion.c_b_n.tr_mul(&force));
                angle += rate * (weight * length);
                velocity += force * (weight * length);
                // a vehicle at rest stays where it is: nothing in these readings changes
                if steady && motion.velocity == Vector3::zeros() {
                    rest = Some((rate, force));
                }
            }
            self.rest = rest.map(|(rate, force)| Rest { piece: self.piece, rate, force });
            t = end;
        }
        (angle, velocity)
    }

    fn clamp(&self, time: f64) -> f64 {
        // Not `clamp`, which lets a NaN through.
        time.max(0.0).min(self.trajectory.duration())
    }

    /// Finds the piece of a time, starting from the present piece.
    #[inline]
    fn seek(&mut self, time: f64) -> &P {
        let pieces = &self.trajectory.pieces;
        while self.piece > 0 && time < pieces[self.piece].span().0 {
            self.piece -= 1;
        }
        while self.piece + 1 < pieces.len() && time >= pieces[self.piece].span().1 {
            self.piece += 1;
        }
        &pieces[self.piece]
    }

    /// Path at a time within the trajectory.
    #[inline]
    fn path(&mut self, time: f64) -> Path {
        let cell = (time / GRID) as u64;
        if cell < self.cell {
            *self = Self::new(self.trajectory.clone());
        }
        while self.cell < cell {
            self.cell += 1;
            self.from = self.to;
            self.to = self.next_node();
        }
        let x = time / GRID - cell as f64;
        let (a, b) = (self.from.rate * GRID, self.to.rate * GRID);
        let d = self.to.path - self.from.path;
        self.from.path + (a + ((d * 3.0 - a * 2.0 - b) + (a + b - d * 2.0) * x) * x) * x
    }

    /// The node after `from`, which another cursor may have computed.
    fn next_node(&mut self) -> Node {
        if let Some(node) = self.trajectory.nodes.get(self.cell + 1) {
            return node;
        }
        let node = self.step();
        self.trajectory.nodes.put(self.cell + 1, node);
        node
    }

    /// Integrates from `from` to the next node.
    fn step(&mut self) -> Node {
        let Node { path, rate: k1 } = self.from;
        let (t, h) = (self.cell as f64 * GRID, GRID);
        let k2 = self.rate(t + 0.5 * h, &(path + k1 * (0.5 * h)));
        let k3 = self.rate(t + 0.5 * h, &(path + k2 * (0.5 * h)));
        let k4 = self.rate(t + h, &(path + k3 * h));
        let path = path + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
        Node { path, rate: self.rate(t + h, &path) }
    }

    /// Derivative of the path (Groves eq. 2.111).
    fn rate(&mut self, time: f64, path: &Path) -> Path {
        let v = self.seek(time).velocity(time);
        if self.trajectory.wanders {
            let turned = self.place(path).slope(&path.fixed_rows::<3>(0).into(), &v);
            return Path::new(turned.x, turned.y, turned.z, v.norm(), -v.z);
        }
        let earth = LocalEarth::at(path.x, path.z);
        Path::new(v.x * earth.inv_n, v.y * earth.inv_e * earth.inv_cos, -v.z, v.norm(), 0.0)
    }
}

/// Angular rate of NED relative to inertial space and specific force, both in NED (Pan & Wu eqs 3
/// and 4).
#[inline]
fn inertial(motion: &Motion, earth: &LocalEarth) -> (Vector3<f64>, Vector3<f64>) {
    let (w_ie, w_en) = (earth.earth_rate(), earth.transport_rate(&motion.velocity));
    let coriolis = (w_ie * 2.0 + w_en).cross(&motion.velocity);
    (w_ie + w_en, motion.acceleration + coriolis - Vector3::new(0.0, 0.0, earth.gravity))
}
