//! Attitude from the rotation of gravity in inertial axes, at rest or in motion.
//!
//! With `b0` the body axes and `n0` the navigation axes of the beginning, both frozen in inertial
//! space, the navigation equation `dv/dt = C_b^n f - (2 w_ie + w_en) x v + g` integrates, for the
//! velocity `v^b` in body axes, to
//! ```text
//! C_b0^n0 b(t) = a(t)
//! b(t) = C_b(t)^b0 v^b(t) - v^b(0) + w_ie^b0 x int C_b^b0 v^b dt - int C_b^b0 f^b dt
//! a(t) = int C_n^n0 g^n dt
//! ```
//! (Li, Tang, Lu & Wu, *Optimization-based alignment for inertial navigation systems: theory and
//! algorithm*, Aerosp. Sci. Technol. 15, 2011, and *Optimization-based alignment for strapdown
//! inertial navigation system: comparison and extension*, IEEE Trans. Aerosp. Electron. Syst.
//! 49(3), 2013, which write the third term as `int C_b^b0 (w_ie^b x v^b) dt`; `w_ie` is constant in
//! inertial axes). `C_b^b0` is integrated from the gyros and `C_n^n0` from Earth and transport
//! rate. What remains is the constant `C_b0^n0`, which is fitted to many times `t`. Sway has little
//! effect: its rotation is in `C_b^b0`, and its velocity stays small compared with `a`, which grows
//! with time.

use super::config::CoarseMethod;
use super::optimisation::fit;
use crate::earth::LocalEarth;
use crate::mechanisation::{Increments, Mechanisation};
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::checkpoint::saved;

/// Rotation and specific force, integrated in inertial axes since the beginning.
#[derive(Clone, Copy, Debug, Default)]
pub struct Integral {
    /// `C_b(t)^b0`.
    pub c_b_b0: UnitQuaternion<f64>,
    /// `int C_b^b0 f^b dt`, m/s.
    pub dvel: Vector3<f64>,
    /// Integral of `dvel`, m.
    pub path: Vector3<f64>,
    mechanisation: Mechanisation,
}

saved!(Integral { c_b_b0, dvel, path, mechanisation });

impl Integral {
    /// Adds an inertial sample whose biases are removed.
    pub fn advance(&mut self, sample: &Increments) {
        let (rotation, dvel) = self.mechanisation.compensate(sample);
        // the velocity increment in the axes of the interval's beginning, `int C(t) f dt`, to third
        // order in the rotation (Groves section 5.5.4)
        let turned = rotation.cross(&dvel);
        let before = self.dvel;
        self.dvel += self.c_b_b0 * (dvel + turned * 0.5 + rotation.cross(&turned) / 6.0);
        self.path += (before + self.dvel) * (0.5 * sample.dt);
        self.c_b_b0 = UnitQuaternion::new_normalize(
            (self.c_b_b0 * UnitQuaternion::from_scaled_axis(rotation)).into_inner(),
        );
    }
}

/// Integrals and velocity at one time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instant {
    /// Time since the beginning, s.
    pub time: f64,
    /// `C_b(t)^b0`.
    pub c_b_b0: UnitQuaternion<f64>,
    /// `int C_b^b0 f^b dt`, m/s.
    pub dvel: Vector3<f64>,
    /// Velocity relative to the Earth in body axes, m/s: zero at rest.
    pub velocity: Vector3<f64>,
}

saved!(Instant { time, c_b_b0, dvel, velocity });

/// Attitude that fits the instants best.
#[derive(Clone, Debug)]
pub struct AttitudeFit {
    /// `C_b0^n0`.
    pub c_b_n: UnitQuaternion<f64>,
    /// Residual `|C b - a|` of every instant after the first, a velocity, m/s.
    pub residuals: Vec<f64>,
}

/// Number of iterations. The attitude needs Earth and transport rate, and these need the attitude.
/// Each iteration multiplies the error by `v t W / (g t)`, at most a hundredth.
const ROUNDS: usize = 8;

/// Computes the attitude at the beginning from instants in order of time, relative to the first of
/// them. `None` with fewer than three instants, or where gravity does not rotate: at a pole, or in
/// a span of zero length.
pub fn align(
    instants: &[Instant],
    earth: &LocalEarth,
    method: CoarseMethod,
) -> Option<AttitudeFit> {
    let mut c_b_n = None;
    for _ in 0..ROUNDS {
        let rotation = fit(&pairs(instants, earth, c_b_n), method)?;
        if c_b_n
            .replace(rotation)
            .is_some_and(|before: UnitQuaternion<f64>| before.angle_to(&rotation) < 1e-9)
        {
            break;
        }
    }
    let c_b_n = c_b_n?;
    let residuals =
        pairs(instants, earth, Some(c_b_n)).iter().map(|(a, b)| (c_b_n * b - a).norm()).collect();
    Some(AttitudeFit { c_b_n, residuals })
}

/// Computes `a` and `b` of every instant after the first; Earth and transport rate are resolved
/// with the attitude `c_b_n`, and are zero in `b` where it is not known yet.
fn pairs(
    instants: &[Instant],
    earth: &LocalEarth,
    c_b_n: Option<UnitQuaternion<f64>>,
) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let Some(first) = instants.first() else { return Vec::new() };
    let w_ie = earth.earth_rate();
    let w_ie_b0 = c_b_n.map_or_else(Vector3::zeros, |c| c.inverse() * w_ie);
    let gravity = Vector3::new(0.0, 0.0, earth.gravity);
    let velocity = |i: &Instant| i.c_b_b0 * i.velocity;
    let (mut a, mut c_n_n0, mut path) =
        (Vector3::zeros(), UnitQuaternion::identity(), Vector3::zeros());
    let mut out = Vec::with_capacity(instants.len());
    for (from, to) in instants.iter().zip(&instants[1..]) {
        let dt = to.time - from.time;
        let mean = (velocity(from) + velocity(to)) * 0.5;
        let v_n = c_b_n.map_or_else(Vector3::zeros, |c| c_n_n0.inverse() * (c * mean));
        let w_in = w_ie + earth.transport_rate(&v_n);
        a += c_n_n0 * (gravity * dt + w_in.cross(&gravity) * (0.5 * dt * dt));
        c_n_n0 *= UnitQuaternion::from_scaled_axis(w_in * dt);
        path += mean * dt;
        let b = velocity(to) - velocity(first) + w_ie_b0.cross(&path) - (to.dvel - first.dvel);
        out.push((a, b));
    }
    out
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::mechanisation::NavState;
    use crate::testing::Uniform;
    use navfuse_core::state::geodesy::Geodetic;

    /// Instants once a second along a motion that the mechanisation itself makes from increments,
    /// so that they fit it exactly.
    fn run(
        seed: u64,
        duration: usize,
        speed: f64,
        turn: f64,
        sway: f64,
    ) -> (Vec<Instant>, NavState, LocalEarth) {
        let mut random = Uniform::new(seed);
        let position = Geodetic { latitude: random.within(1.2), longitude: 0.0, height: 0.0 };
        let earth = LocalEarth::at(position.latitude, 0.0);
        let start = NavState {
            c_b_n: UnitQuaternion::from_euler_angles(
                random.within(0.3),
                random.within(0.3),
                random.within(3.1),
            ),
            velocity: random.vector(1.0) * speed,
            position,
        };
        let (mut nav, mut mechanisation, mut integral) =
            (start, Mechanisation::default(), Integral::default());
        let dt = 0.02;
        let instant = |time: f64, integral: &Integral, nav: &NavState| Instant {
            time,
            c_b_b0: integral.c_b_b0,
            dvel: integral.dvel,
            velocity: nav.c_b_n.inverse() * nav.velocity,
        };
        let mut instants = vec![instant(0.0, &integral, &nav)];
        for k in 1..=duration * 50 {
            let t = k as f64 * dt;
            let e = LocalEarth::at(nav.position.latitude, nav.position.height);
            let slow = Vector3::new(0.0, 0.0, turn)
                + Vector3::new(sway * (1.1 * t).cos(), sway * (0.8 * t).sin(), 0.0);
            let w = slow + nav.c_b_n.inverse() * (e.earth_rate() + e.transport_rate(&nav.velocity));
            // with this specific force the velocity stays constant in body axes while they turn
            let coriolis =
                (e.earth_rate() * 2.0 + e.transport_rate(&nav.velocity)).cross(&nav.velocity);
            let v_b = nav.c_b_n.inverse() * nav.velocity;
            let f = slow.cross(&v_b)
                + nav.c_b_n.inverse() * (coriolis - Vector3::new(0.0, 0.0, e.gravity));
            let increments = Increments { dtheta: w * dt, dvel: f * dt, dt };
            nav = mechanisation.step(&nav, &increments).unwrap().0;
            integral.advance(&increments);
            if k % 50 == 0 {
                instants.push(instant(t, &integral, &nav));
            }
        }
        (instants, start, earth)
    }

    /// The larger error of the two methods.
    fn error_deg(instants: &[Instant], start: &NavState, earth: &LocalEarth) -> f64 {
        let error = |method| align(instants, earth, method).unwrap().c_b_n.angle_to(&start.c_b_n);
        let (all, two) = (error(CoarseMethod::Optimisation), error(CoarseMethod::VelocityLoci));
        all.max(two).to_degrees()
    }

    #[test]
    fn at_rest_and_swaying_the_attitude_is_found() {
        for seed in 0..20 {
            let (instants, start, earth) =
                run(seed, 60, 0.0, 0.0, if seed % 2 == 0 { 0.0 } else { 0.05 });
            // uncompensated sculling of the sway is 1e-6 of g in 60 s, to be divided by an Earth
            // rate of 1e-4 to 7e-5
            let error = error_deg(&instants, &start, &earth);
            assert!(error < 0.01, "seed {seed}: {error} deg");
        }
    }

    #[test]
    fn in_motion_with_turns_the_attitude_is_found() {
        for seed in 20..40 {
            let (instants, start, earth) = run(seed, 120, 5.0, 0.03, 0.02);
            let error = error_deg(&instants, &start, &earth);
            // `align` keeps the initial latitude: 600 m to the north change the latitude by
            // 1e-4 rad, and the direction of `a` by 0.01 deg
            assert!(error < 0.02, "seed {seed}: {error} deg");
            // and from one instant in two seconds
            let sparse: Vec<_> = instants.into_iter().step_by(2).collect();
            let error = error_deg(&sparse, &start, &earth);
            assert!(error < 0.02, "seed {seed}: {error} deg");
        }
    }

    /// At a speed of 5 m/s, neglecting Earth rate and transport rate costs more than half a degree
    /// of heading.
    #[test]
    fn earth_and_transport_rate_matter() {
        let mut worst = 0.0_f64;
        for seed in 40..50 {
            let (instants, start, earth) = run(seed, 120, 5.0, 0.0, 0.0);
            let alone = fit(&pairs(&instants, &earth, None), CoarseMethod::Optimisation).unwrap();
            worst = worst.max(alone.angle_to(&start.c_b_n).to_degrees());
            assert!(error_deg(&instants, &start, &earth) < 0.02);
        }
        assert!(worst > 0.5, "{worst}");
    }

    #[test]
    fn a_motion_that_is_not_the_one_told_shows_in_the_residuals() {
        let (mut instants, _, earth) = run(60, 60, 5.0, 0.05, 0.0);
        let told = align(&instants, &earth, CoarseMethod::Optimisation).unwrap();
        // `align` keeps the initial gravity, but 300 m of height change gravity by 1e-3 m/s^2;
        // after a minute the velocity is 0.03 m/s off
        assert!(told.residuals.iter().all(|r| *r < 0.05), "{:?}", told.residuals);
        instants.iter_mut().for_each(|i| i.velocity = Vector3::zeros());
        let at_rest = align(&instants, &earth, CoarseMethod::Optimisation).unwrap();
        assert!(at_rest.residuals.iter().any(|r| *r > 0.5));
    }

    #[test]
    fn too_little_is_refused() {
        let earth = LocalEarth::at(0.5, 0.0);
        assert!(align(&[], &earth, CoarseMethod::Optimisation).is_none());
        let (instants, ..) = run(70, 2, 0.0, 0.0, 0.0);
        assert!(align(&instants[..1], &earth, CoarseMethod::Optimisation).is_none());
    }
}
