//! The frame `wander-azimuth`: its transition against the mechanisation, and tracks through the pole.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::{Geodetic, radii_of_curvature};
use navfuse_ins::earth::LocalEarth;
use navfuse_ins::mechanisation::{Increments, Mechanisation, NavState};
use navfuse_ins::wander::transition;
use std::f64::consts::{FRAC_PI_2, PI};

type Errors = SVector<f64, 15>;

fn vector(within: &mut impl FnMut(f64) -> f64, most: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| within(most))
}

fn about_down(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

/// The state with an error put in, and the increments with the error of the biases taken out.
fn retract(state: &NavState, sample: &Increments, x: &Errors) -> (NavState, Increments) {
    let part = |i: usize| Vector3::new(x[i], x[i + 1], x[i + 2]);
    let position = state.position.displaced(&part(6));
    let carried = about_down(state.position.turn_to(&position));
    let perturbed = NavState {
        c_b_n: carried * UnitQuaternion::from_scaled_axis(part(0)) * state.c_b_n,
        velocity: carried * (state.velocity + part(3)),
        position,
    };
    let dt = sample.dt;
    let (dtheta, dvel) = (sample.dtheta - part(9) * dt, sample.dvel - part(12) * dt);
    (perturbed, Increments { dtheta, dvel, dt })
}

fn local(state: &NavState, origin: &NavState) -> SVector<f64, 9> {
    let back = about_down(state.position.turn_to(&origin.position));
    let mut x = SVector::<f64, 9>::zeros();
    let turned = back * state.c_b_n * origin.c_b_n.inverse();
    x.fixed_rows_mut::<3>(0).copy_from(&turned.scaled_axis());
    x.fixed_rows_mut::<3>(3).copy_from(&(back * state.velocity - origin.velocity));
    x.fixed_rows_mut::<3>(6).copy_from(&state.position.ned_from(&origin.position));
    x
}

/// The transition of the mechanisation itself, by central differences of fourth order.
fn numerical(state: &NavState, sample: &Increments) -> SMatrix<f64, 9, 15> {
    let steps = [1e-2, 10.0, 5_000.0, 1.0, 50.0];
    let run = |x: &Errors| {
        let (state, sample) = retract(state, sample, x);
        Mechanisation::wander_azimuth().step(&state, &sample).unwrap().0
    };
    let origin = run(&Errors::zeros());
    let mut phi = SMatrix::<f64, 9, 15>::zeros();
    for j in 0..15 {
        let step = steps[j / 3];
        let at = |k: f64| local(&run(&Errors::ith(j, k * step)), &origin);
        let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
        phi.set_column(j, &slope);
    }
    phi
}

/// Bounds as in the test of the error model in north-east-down: what `Phi = I + F dt` omits, 4e-6 of a
/// block, 1e-9 on the diagonal, and the blocks that are left out. The position moves by 5 km, so that
/// the curvature of the great circle, (1e4 / 6.4e6)^4, and the difference between the length of an
/// arc on the ellipsoid and on the sphere of the normals, e^2 / 2 of it, stay below.
#[test]
fn the_transition_is_the_derivative_of_the_mechanisation_up_to_the_pole() {
    let mut random = Random::new(3, "wander");
    let mut within = move |most: f64| most * (2.0 * random.uniform() - 1.0);
    for case in 0..300 {
        let dt = 0.01;
        // from 45 deg to 60 m from the pole, and on the other side of the Earth
        let colatitude = 10_f64.powf(-2.5 + within(2.5)).min(0.8);
        let latitude = (FRAC_PI_2 - colatitude) * within(1.0).signum();
        let state = NavState {
            c_b_n: UnitQuaternion::from_scaled_axis(vector(&mut within, 2.0)),
            velocity: vector(&mut within, 15.0),
            position: Geodetic { latitude, longitude: within(3.0), height: within(2_500.0) },
        };
        let dvel =
            state.c_b_n.inverse() * (Vector3::new(0.0, 0.0, -9.8) + vector(&mut within, 2.0)) * dt;
        let sample = Increments { dtheta: vector(&mut within, 1.0) * dt, dvel, dt };
        let (_, rates) = Mechanisation::wander_azimuth().step(&state, &sample).unwrap();
        let (exact, t) = (numerical(&state, &sample), transition(&rates));
        let relative = |m: &Matrix3<f64>| 4e-6 * m.amax();
        let blocks = [
            (0, 0, t.phi[0], 1e-9),
            (0, 1, t.phi[1], relative(&t.phi[1])),
            (0, 2, t.phi[2], 2e-5 * t.phi[2].amax()),
            (0, 3, t.bias, relative(&t.bias)),
            (1, 0, t.v[0], relative(&t.v[0])),
            (1, 1, t.v[1], 1e-9),
            (1, 2, t.v[2], 2e-5 * t.v[2].amax()),
            (1, 4, t.bias, relative(&t.bias)),
            (2, 0, Matrix3::zeros(), 7e-4),
            (2, 1, t.p[0], relative(&t.p[0])),
            (2, 2, t.p[1], 1e-8),
        ];
        for (i, j, block, bound) in blocks {
            let found: Matrix3<f64> = exact.fixed_view::<3, 3>(3 * i, 3 * j).into();
            let error = (found - block).amax();
            assert!(
                error < bound,
                "case {case}, {latitude}, {i} {j}: {error:e} of {bound:e}\n{found}{block}"
            );
        }
    }
}

/// Steps of a vehicle with these increments.
fn run(
    mut mechanisation: Mechanisation,
    start: NavState,
    of: impl Fn(usize, &NavState) -> Increments,
    steps: usize,
) -> NavState {
    let mut state = start;
    for k in 0..steps {
        state = mechanisation.step(&state, &of(k, &state)).unwrap().0;
    }
    state
}

/// At 45 deg both frames integrate the same motion, in which the vehicle turns and climbs. A step of
/// each is accurate to the second order in the turn of its axes: `(v tan L / R dt)^2`, 1e-16 rad.
#[test]
fn at_45_deg_both_frames_integrate_the_same_motion() {
    let start = NavState {
        c_b_n: UnitQuaternion::from_euler_angles(0.1, -0.05, 0.7),
        velocity: Vector3::new(20.0, 15.0, -1.0),
        position: Geodetic { latitude: 45_f64.to_radians(), longitude: 0.2, height: 100.0 },
    };
    let dt = 0.01;
    let of = |k: usize, _: &NavState| {
        let t = k as f64 * dt;
        let turn = Vector3::new(0.02 * (0.3 * t).sin(), 0.01, 0.05 * (0.1 * t).cos());
        let force = Vector3::new(0.3 * (0.2 * t).sin(), 0.1, -9.7);
        Increments { dtheta: turn * dt, dvel: force * dt, dt }
    };
    let ends = [Mechanisation::default(), Mechanisation::wander_azimuth()]
        .map(|mechanisation| run(mechanisation, start, of, 6_000));
    let [north, wander] = ends;
    let angle = north.c_b_n.angle_to(&wander.c_b_n);
    let speed = (north.velocity - wander.velocity).norm();
    let place = wander.position.ned_from(&north.position).norm();
    assert!(angle < 1e-9 && speed < 1e-7 && place < 1e-5, "{angle:e} {speed:e} {place:e}");
}

/// A vehicle without forces but gravity's reaction and Coriolis that keeps its velocity in carried axes
/// leads over the pole: 1 km before it, and 1 km beyond it after 200 s at 10 m/s, on the meridian of the
/// other side.
#[test]
fn a_track_leads_across_the_pole_and_on_along_the_other_meridian() {
    for sign in [1.0, -1.0] {
        let latitude = sign * (90.0 - 0.009_f64).to_radians();
        let start = NavState {
            c_b_n: UnitQuaternion::identity(),
            velocity: Vector3::new(10.0 * sign, 0.0, 0.0),
            position: Geodetic { latitude, longitude: 0.5, height: -50.0 },
        };
        let dt = 0.01;
        // body axes are those of the step: the rates and forces that keep both are those of the Earth
        let of = |_: usize, state: &NavState| {
            let earth = LocalEarth::at(state.position.latitude, state.position.height);
            let w_ie = earth.earth_rate();
            let v = state.velocity;
            let w_en = Vector3::new(v.y * earth.inv_e, -v.x * earth.inv_n, 0.0);
            let force = (w_ie * 2.0 + w_en).cross(&v) - Vector3::z() * earth.gravity;
            let to_body = state.c_b_n.inverse();
            Increments { dtheta: to_body * (w_ie + w_en) * dt, dvel: to_body * force * dt, dt }
        };
        let end = run(Mechanisation::wander_azimuth(), start, of, 20_100);
        let across = (end.position.longitude - start.position.longitude).abs();
        assert!((across - PI).abs() < 1e-4, "{across}");
        // 2010 m from a start 1005.16 m before the pole
        let before = start.position;
        let (r, _) = radii_of_curvature(before.latitude);
        let way =
            (2.0 * FRAC_PI_2 - before.latitude.abs() - end.position.latitude.abs()) * (r - 50.0);
        assert!((way - 2010.0).abs() < 1e-2, "{way}");
        // it moves away from the pole, and its axes are those of the start in space
        assert!((end.velocity + start.velocity).norm() < 1e-2, "{}", end.velocity);
        let yaw = end.c_b_n.euler_angles().2.abs();
        assert!((yaw - PI).abs() < 1e-4, "{yaw}");
    }
}
