//! Rule: the accelerometers see the accelerations that another sensor measures, in the same axes.
//!
//! Between two velocities `v` that a sensor measures, the specific force in body axes is
//! ```text
//! u = C_b_n' (dv/dt - g)        Q(M) = sum |u - M f|^2 = sum (|u|^2 + |f|^2) - 2 sum_ij M_ij B_ij
//! ```
//! with the mean `f` of the accelerometers, `B = sum u f'`, and the turn `M` of axes that are not those
//! of the vehicle. All 24 turns by quarters are compared (Wahba 1965, for these turns alone). Gravity
//! decides between most of them; only accelerations show a turn about the vertical.

use super::fault::Fault;
use crate::earth::normal_gravity;
use crate::navigation::Navigation;
use nalgebra::{Matrix3, Vector3};
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::monitor::MeasuredVelocity;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};

/// Least time over which an acceleration is taken, s.
const WINDOW: f64 = 1.0;
/// Number of accelerations before a decision.
const COUNT: u32 = 4;
/// Ratio of the residuals that is evidence, as for gyros that turn gravity in other axes.
const EVIDENCE: f64 = 9.0;
/// Least sum of squares that the turn has to explain, (m/s^2)^2.
const LEAST: f64 = 0.1;
/// Acceleration of a vehicle that hardly accelerates, m/s^2: an error of the tilt by 0.2 deg or a bias
/// of 3 mg gives as much, and a turn must explain more.
const QUIET: f64 = 0.03;
/// Largest sigma of the heading with which accelerations are compared, rad: 10 deg. Three of them are
/// nearer to the right axes than to axes turned by a quarter.
const HEADING: f64 = 0.17;

/// The six orders of three axes, each with the sign of its permutation.
const ORDERS: [([usize; 3], f64); 6] = [
    ([0, 1, 2], 1.0),
    ([1, 2, 0], 1.0),
    ([2, 0, 1], 1.0),
    ([0, 2, 1], -1.0),
    ([1, 0, 2], -1.0),
    ([2, 1, 0], -1.0),
];

/// A turn by quarters: the body axis along which each axis of the IMU points, and its sign.
type Turn = [(usize, f64); 3];

/// The 24 turns by quarters.
fn turns() -> impl Iterator<Item = Turn> {
    let signs = (0..4).map(|k| [[1.0, -1.0][k & 1], [1.0, -1.0][k >> 1]]);
    signs.flat_map(|[x, y]| ORDERS.map(|([a, b, c], parity)| [(a, x), (b, y), (c, parity * x * y)]))
}

/// Directions in which the axes of an IMU point that is turned.
fn words(turn: &Turn) -> String {
    let direction = |&(axis, sign): &(usize, f64)| {
        let ahead = sign > 0.0;
        [["back", "forward"], ["left", "right"], ["up", "down"]][axis][usize::from(ahead)]
    };
    turn.iter().map(direction).collect::<Vec<_>>().join(", ")
}

/// Velocity and direction of down in body axes at the begin of a window.
#[derive(Clone, Copy, Debug, Default)]
struct Begin {
    v: Vector3<f64>,
    down: Vector3<f64>,
}

saved!(Begin { v, down });

/// Comparison of the accelerometers with the sensor that measured the first velocity.
#[derive(Clone, Default)]
pub(super) struct Axes {
    sensor: Option<String>,
    /// Set if that sensor measures in axes of its own, which may be turned as well.
    own: bool,
    begin: Option<Begin>,
    f: Vector3<f64>,
    time: f64,
    b: Matrix3<f64>,
    squares: f64,
    count: u32,
    due: bool,
    reported: bool,
}

saved!(Axes { sensor, own, begin, f, time, b, squares, count, due, reported });

impl Axes {
    /// Ends the comparison: the samples show another fault.
    pub(super) fn end(&mut self) {
        self.reported = true;
    }

    /// Takes a velocity that a sensor measures.
    pub(super) fn measured(
        &mut self,
        filter: &FilterView<'_>,
        n: &Navigation,
        measured: &MeasuredVelocity<'_>,
    ) {
        let sensor = self.sensor.get_or_insert_with(|| measured.sensor.to_owned());
        if sensor != measured.sensor || self.reported {
            return;
        }
        self.own |= measured.own_axes;
        let heading = filter.layout.blocks[n.attitude.slot()].tangent.map(|at| at + 2);
        let known = heading.is_none_or(|at| filter.covariance.get(at, at) < HEADING * HEADING);
        let c_n_b = filter.state.get(filter.layout, n.attitude).inverse();
        let now = Begin { v: measured.velocity.into(), down: c_n_b * Vector3::z() };
        if self.begin.is_some() && known && self.time < WINDOW {
            return;
        }
        if let Some(begin) = self.begin.filter(|_| known && self.time < 2.0 * WINDOW) {
            let p = filter.state.get(filter.layout, n.position);
            let gravity = normal_gravity(p.latitude, p.height);
            let a = (now.v - begin.v) / self.time;
            self.add(&(c_n_b * a - (begin.down + now.down) * (0.5 * gravity)));
        }
        self.begin = known.then_some(now);
        (self.f, self.time) = (Vector3::zeros(), 0.0);
    }

    /// Adds the specific force of a window that the velocities give.
    fn add(&mut self, u: &Vector3<f64>) {
        let f = self.f / self.time;
        self.b += u * f.transpose();
        self.squares += u.norm_squared() + f.norm_squared();
        self.count += 1;
        self.due = true;
    }

    /// Adds a sample of the accelerometers, and decides after a window.
    #[inline]
    pub(super) fn take(&mut self, f: &Vector3<f64>, dt: f64) -> Option<(Fault, Option<&str>)> {
        self.f += f * dt;
        self.time += dt;
        if !std::mem::take(&mut self.due) || self.reported || self.count < COUNT {
            return None;
        }
        let residual = |turn: &Turn| {
            let parts = turn.iter().enumerate();
            self.squares - 2.0 * parts.map(|(k, (i, sign))| sign * self.b[(*i, k)]).sum::<f64>()
        };
        let best = turns().min_by(|a, b| residual(a).total_cmp(&residual(b)))?;
        let one = residual(&[(0, 1.0), (1, 1.0), (2, 1.0)]);
        // u and f differ by this much each where neither is known better
        let quiet = 2.0 * f64::from(self.count) * QUIET * QUIET;
        if one - residual(&best) < LEAST + quiet || one < EVIDENCE * residual(&best) {
            return None;
        }
        self.reported = true;
        let sensor = self.sensor.as_deref()?;
        let other = if self.own {
            format!("the axes of {sensor} are turned the other way")
        } else {
            "the initial heading is wrong by as much".to_owned()
        };
        let fault = Fault {
            severity: Severity::DoNotUse,
            basis: Basis::Samples,
            text: format!(
                "its axes are turned: the accelerations that {sensor} measures fit its own if its x, \
                 y and z axes point {}, or if {other}",
                words(&best)
            ),
            remedy: "check how the IMU is mounted, and the order and signs of its axes; `navfuse \
                     diagnose` tries each turn"
                .to_owned(),
        };
        Some((fault, self.own.then_some(sensor)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words for the axes of an IMU that is turned, from windows with these specific forces in body
    /// axes.
    fn found(turn: &Turn, windows: impl Iterator<Item = Vector3<f64>>) -> Option<String> {
        let mut rule = Axes { sensor: Some("gnss".to_owned()), ..Axes::default() };
        windows.into_iter().find_map(|u| {
            (rule.f, rule.time) = (Vector3::zeros(), 0.0);
            let read = Vector3::from_fn(|k, _| turn[k].1 * u[turn[k].0]);
            (0..9).for_each(|_| assert!(rule.take(&read, 0.125).is_none()));
            rule.add(&u);
            rule.take(&Vector3::zeros(), 0.0).map(|(fault, _)| fault.text)
        })
    }

    /// A vehicle that speeds up, turns and slows down, with a tilt of a degree.
    fn driven(a: f64) -> impl Iterator<Item = Vector3<f64>> {
        let parts = [[1.0, 0.0], [0.6, 0.8], [-0.4, 0.9], [-1.0, 0.0]];
        let windows = (0..40).map(move |k| parts[k / 10]);
        windows.map(move |[x, y]| Vector3::new(a * x + 0.17, a * y, -9.81))
    }

    #[test]
    fn each_turn_is_named_by_the_directions_of_its_axes_and_no_turn_is_no_fault() {
        let right = [(0, 1.0), (1, 1.0), (2, 1.0)];
        assert_eq!(turns().count(), 24);
        for turn in turns() {
            let text = found(&turn, driven(0.5));
            if turn == right {
                assert_eq!(text, None);
            } else {
                let expected = format!("point {}, or", words(&turn));
                assert!(text.is_some_and(|text| text.contains(&expected)), "{turn:?}");
            }
        }
    }

    /// Gravity does not show a turn about the vertical.
    #[test]
    fn a_vehicle_that_hardly_accelerates_is_not_judged() {
        let quarter = [(1, -1.0), (0, 1.0), (2, 1.0)];
        assert!(found(&quarter, driven(0.3)).is_some());
        let still = (0..100).map(|_| Vector3::new(0.0, 0.03, -9.81));
        assert_eq!(found(&quarter, still), None);
    }
}
