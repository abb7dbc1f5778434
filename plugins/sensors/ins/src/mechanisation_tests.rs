#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::earth::{earth_rate_ned, normal_gravity, transport_rate_ned};
use crate::testing::Uniform;
use navfuse_core::state::geodesy::radii_of_curvature;

fn geodetic(latitude_deg: f64, longitude_deg: f64, height: f64) -> Geodetic {
    Geodetic { latitude: latitude_deg.to_radians(), longitude: longitude_deg.to_radians(), height }
}

/// Constant attitude and velocity in navigation axes at constant height and latitude: the exact
/// sensors.
fn steady(state: &NavState, dt: f64) -> Increments {
    let p = &state.position;
    let w_ie = earth_rate_ned(p.latitude);
    let w_in = w_ie + transport_rate_ned(p.latitude, p.height, &state.velocity);
    let gravity = Vector3::new(0.0, 0.0, normal_gravity(p.latitude, p.height));
    let force = (w_in + w_ie).cross(&state.velocity) - gravity;
    let body = state.c_b_n.inverse();
    Increments { dtheta: body * w_in * dt, dvel: body * force * dt, dt }
}

fn run(state: &NavState, sample: &Increments, steps: usize) -> NavState {
    let mut mechanisation = Mechanisation::default();
    (0..steps).fold(*state, |s, _| mechanisation.step(&s, sample).unwrap().0)
}

/// Attitude (rad), velocity (m/s) and position (m) between two states.
fn difference(a: &NavState, b: &NavState) -> [f64; 3] {
    let attitude = (a.c_b_n * b.c_b_n.inverse()).scaled_axis().norm();
    [attitude, (a.velocity - b.velocity).norm(), a.position.ned_from(&b.position).norm()]
}

fn assert_near(a: &NavState, b: &NavState, bounds: [f64; 3], what: &str) {
    let d = difference(a, b);
    assert!(
        d.iter().zip(&bounds).all(|(d, bound)| d <= bound),
        "{what}: {d:?} is not within {bounds:?}"
    );
}

#[test]
fn at_rest_on_the_rotating_earth_stays_at_rest() {
    // An hour at 100 Hz. The same sample at the same state rounds the same way every time, so at
    // worst the attitude drifts by 2 eps = 4.4e-16 rad a step (two products, of half angles):
    // 1.6e-10 rad, as a gyroscope of 4.4e-14 rad/s (9e-9 deg/h) would. Such a drift gives R *
    // 4.4e-14 = 2.8e-7 m/s and, times an hour, 1e-3 m. The quaternion's norm adds 2 eps g = 4e-15
    // m/s^2 down, which the vertical channel multiplies by R/2g cosh(3600 s / 570 s) = 9e7 s^2:
    // 4e-7 m.
    for (latitude, heading) in [(0.0, 0.0_f64), (59.3, 1.0), (-79.0, -2.5)] {
        let c_b_n = UnitQuaternion::from_euler_angles(0.05, -0.03, heading);
        let state = NavState {
            c_b_n,
            velocity: Vector3::zeros(),
            position: geodetic(latitude, 18.0, -30.0),
        };
        let end = run(&state, &steady(&state, 0.01), 360_000);
        assert_near(&end, &state, [1.6e-10, 2.8e-7, 1e-3], "at rest");
    }
}

#[test]
fn an_eastward_run_at_high_latitude_follows_its_parallel() {
    // 30 m/s for half an hour along 80 degrees north, across the antimeridian. Rounding as at rest,
    // for half the time; the longitude near 180 degrees rounds by 2.2e-16 rad * R cos(80 deg) a
    // step, 4e-5 m in all.
    for speed in [30.0, -30.0] {
        let longitude: f64 = if speed > 0.0 { 179.5 } else { -179.5 };
        let state = NavState {
            c_b_n: UnitQuaternion::from_euler_angles(0.0, 0.02, 1.5),
            velocity: Vector3::new(0.0, speed, 0.0),
            position: geodetic(80.0, longitude, -100.0),
        };
        let end = run(&state, &steady(&state, 0.01), 180_000);
        let p = state.position;
        let turn =
            speed * 1800.0 / ((radii_of_curvature(p.latitude).1 + p.height) * p.latitude.cos());
        let wrapped = p.longitude + turn - 2.0 * PI * speed.signum();
        let expected = NavState { position: Geodetic { longitude: wrapped, ..p }, ..state };
        assert!(end.position.longitude.abs() < PI);
        assert_near(&end, &expected, [8e-11, 2.8e-7, 5.4e-4], "eastward run");
    }
}

/// The error about x, rad per step, of integrating a coning motion of half angle `angle` at `x` rad
/// of phase per step.
fn coning_drift(angle: f64, x: f64, with_history: bool) -> f64 {
    // w = 2 q* q' of q = (cos a/2, 0, sin(a/2) cos Wt, sin(a/2) sin Wt).
    let sample = |k: f64| Increments {
        dtheta: Vector3::new(
            -2.0 * (angle / 2.0).sin().powi(2) * x,
            angle.sin() * ((x * (k + 1.0)).cos() - (x * k).cos()),
            angle.sin() * ((x * (k + 1.0)).sin() - (x * k).sin()),
        ),
        dvel: Vector3::zeros(),
        dt: 1.0,
    };
    let truth = |k: f64| {
        let axis = Vector3::new(0.0, (x * k).cos(), (x * k).sin());
        UnitQuaternion::from_scaled_axis(axis * angle)
    };
    let steps = 1_000;
    let mut q = truth(0.0);
    let mut mechanisation =
        Mechanisation { previous: Some(sample(-1.0)), ..Mechanisation::default() };
    for k in 0..steps {
        let inc = sample(k as f64);
        let phi = mechanisation.coning_sculling(&inc, inc.dt).0;
        q *= UnitQuaternion::from_scaled_axis(phi);
        if with_history {
            mechanisation.remember(&inc, inc.dt);
        } else {
            mechanisation.previous = None;
        }
    }
    (q * truth(steps as f64).inverse()).scaled_axis().x / steps as f64
}

#[test]
fn coning_drifts_as_the_two_sample_algorithm_must() {
    // Per step the true coning is a^2 (x - sin x) / 2 and the algorithm's a^2 sin^2(x/2) sin(x) /
    // 3, so that a^2 x^5 / 60 (1 + ...) remains, against a^2 x^3 / 12 without the correction.
    let (a, x) = (1e-3_f64, 0.3_f64);
    let remainder = a * a * ((x - x.sin()) / 2.0 - (x / 2.0).sin().powi(2) * x.sin() / 3.0);
    let drift = coning_drift(a, x, true);
    assert!((drift.abs() / remainder - 1.0).abs() < 1e-3, "{drift:e} {remainder:e}");
    let without = coning_drift(a, x, false);
    assert!((without.abs() / (a * a * (x - x.sin()) / 2.0) - 1.0).abs() < 1e-2, "{without:e}");
}

/// The mean error along y, m/s per step, of sculling `angle sin Wt` about x in phase with `sin Wt`
/// m/s^2 along z.
fn sculling_drift(angle: f64, x: f64, correct: bool) -> f64 {
    let sample = |k: f64| Increments {
        dtheta: Vector3::x() * angle * ((x * (k + 1.0)).sin() - (x * k).sin()),
        dvel: Vector3::z() * ((x * k).cos() - (x * (k + 1.0)).cos()) / x,
        dt: 1.0,
    };
    let steps = 1_000; // whole periods, by the choice of x
    let mut mechanisation =
        Mechanisation { previous: Some(sample(-1.0)), ..Mechanisation::default() };
    let node = LatitudeNode::near(0.0);
    let mut velocity = 0.0;
    for k in 0..steps {
        let inc = sample(k as f64);
        let dvel = if correct { mechanisation.coning_sculling(&inc, 1.0).1 } else { inc.dvel };
        mechanisation.remember(&inc, 1.0);
        let start = UnitQuaternion::from_scaled_axis(Vector3::x() * angle * (x * k as f64).sin());
        let still = NavState {
            c_b_n: start,
            velocity: Vector3::zeros(),
            position: geodetic(0.0, 0.0, 0.0),
        };
        // The specific force's part alone: `mean * dvel`.
        velocity += (advance::<false>(&still, &inc.dtheta, &dvel, 1.0, &node).1.c_b_n * dvel).y;
    }
    // - mean of sin(a sin Wt) sin Wt = -J1(a) = -a/2 (1 - a^2/8) to 1e-10 of itself for a = 0.01.
    velocity / steps as f64 + angle / 2.0 * (1.0 - angle * angle / 8.0)
}

#[test]
fn sculling_drifts_as_the_two_sample_algorithm_must() {
    // By the duality of coning and sculling (alpha, w -> nu, f) the remainder per step is a A x^4 /
    // 60 (1 + ...) of coning's a^2 x^5 / 60, against a A x^2 / 12 without the correction.
    let (a, x) = (1e-2, 2.0 * PI * 0.04);
    let remainder = a * ((x - x.sin()) / 2.0 - (x / 2.0_f64).sin().powi(2) * x.sin() / 3.0) / x;
    let drift = sculling_drift(a, x, true);
    assert!((drift.abs() / remainder - 1.0).abs() < 1e-2, "{drift:e} {remainder:e}");
    let without = sculling_drift(a, x, false);
    assert!((without.abs() / (a * (x - x.sin()) / (2.0 * x)) - 1.0).abs() < 1e-2, "{without:e}");
}

/// A manoeuvre as smooth functions of time: angular rate and specific force in the body.
fn manoeuvre(t: f64) -> (Vector3<f64>, Vector3<f64>) {
    let w = Vector3::new(0.5 * (1.3 * t).sin(), 0.3 * (0.9 * t).cos(), 0.2 + 0.4 * (0.7 * t).sin());
    let f =
        Vector3::new(0.8 * (0.8 * t).cos(), 0.6 * (1.1 * t).sin(), -9.8 + 0.5 * (1.7 * t).cos());
    (w, f)
}

/// The manoeuvre's increments by five-point Gauss-Legendre quadrature: the error is (1.7 dt)^10
/// 1e-12 of them.
fn manoeuvre_increments(start: f64, dt: f64) -> Increments {
    const NODES: [(f64, f64); 5] = [
        (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.0, 0.568_888_888_888_888_9),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let mut sum = Increments { dtheta: Vector3::zeros(), dvel: Vector3::zeros(), dt };
    for (x, weight) in NODES {
        let (w, f) = manoeuvre(start + 0.5 * dt * (1.0 + x));
        sum.dtheta += w * (0.5 * weight * dt);
        sum.dvel += f * (0.5 * weight * dt);
    }
    sum
}

/// The continuous equations (Groves eqs 5.39, 5.53, 5.56), written with matrices, apart from the
/// code under test.
fn derivative(
    t: f64,
    s: &(Matrix3<f64>, Vector3<f64>, Vector3<f64>),
) -> (Matrix3<f64>, Vector3<f64>, Vector3<f64>) {
    let (c, v, p) = s;
    let (w, f) = manoeuvre(t);
    let (r_n, r_e) = radii_of_curvature(p.x);
    let w_ie = earth_rate_ned(p.x);
    let w_en = Vector3::new(v.y / (r_e + p.z), -v.x / (r_n + p.z), -v.y * p.x.tan() / (r_e + p.z));
    let dc = c * w.cross_matrix() - (w_ie + w_en).cross_matrix() * c;
    let gravity = Vector3::new(0.0, 0.0, normal_gravity(p.x, p.z));
    let dv = c * f + gravity - (2.0 * w_ie + w_en).cross(v);
    (dc, dv, Vector3::new(v.x / (r_n + p.z), v.y / ((r_e + p.z) * p.x.cos()), -v.z))
}

fn runge_kutta(state: &NavState, duration: f64, steps: usize) -> NavState {
    let p = state.position;
    let h = duration / steps as f64;
    let mut s = (
        *state.c_b_n.to_rotation_matrix().matrix(),
        state.velocity,
        Vector3::new(p.latitude, p.longitude, p.height),
    );
    type S = (Matrix3<f64>, Vector3<f64>, Vector3<f64>);
    let add = |a: &S, b: &S, k: f64| (a.0 + b.0 * k, a.1 + b.1 * k, a.2 + b.2 * k);
    for i in 0..steps {
        let t = i as f64 * h;
        let k1 = derivative(t, &s);
        let k2 = derivative(t + h / 2.0, &add(&s, &k1, h / 2.0));
        let k3 = derivative(t + h / 2.0, &add(&s, &k2, h / 2.0));
        let k4 = derivative(t + h, &add(&s, &k3, h));
        s = add(&add(&add(&add(&s, &k1, h / 6.0), &k2, h / 3.0), &k3, h / 3.0), &k4, h / 6.0);
    }
    NavState {
        c_b_n: UnitQuaternion::from_matrix(&s.0),
        velocity: s.1,
        position: Geodetic { latitude: s.2.x, longitude: s.2.y, height: s.2.z },
    }
}

fn manoeuvre_start() -> NavState {
    NavState {
        c_b_n: UnitQuaternion::from_euler_angles(0.1, -0.05, 0.8),
        velocity: Vector3::new(12.0, -20.0, 1.0),
        position: geodetic(62.0, 5.0, -300.0),
    }
}

fn mechanised_manoeuvre(duration: f64, steps: usize) -> NavState {
    let dt = duration / steps as f64;
    let mut mechanisation = Mechanisation::default();
    mechanisation.remember(&manoeuvre_increments(-dt, dt), dt);
    (0..steps).fold(manoeuvre_start(), |s, i| {
        mechanisation.step(&s, &manoeuvre_increments(i as f64 * dt, dt)).unwrap().0
    })
}

#[test]
fn halving_the_interval_divides_the_error_by_eight() {
    // Runge and Kutta's error at 1 ms: (1.7 * 1e-3)^4 / 120 of a m/s or rad over a minute, 1e-12.
    let duration = 60.0;
    let reference = runge_kutta(&manoeuvre_start(), duration, 60_000);
    let errors: Vec<[f64; 3]> = [600, 1_200, 2_400, 4_800]
        .into_iter()
        .map(|steps| difference(&mechanised_manoeuvre(duration, steps), &reference))
        .collect();
    for pair in errors.windows(2) {
        for (coarse, fine) in pair[0].iter().zip(&pair[1]) {
            // The curvature of the rates, which two samples do not see, is of third order; the
            // second order of the slow terms is far below it. 7.5 leaves room for the orders above.
            assert!(coarse / fine > 7.5, "{errors:?}");
        }
    }
}

#[test]
fn unequal_intervals_keep_the_order_of_coning_and_sculling() {
    // Alternating 8 and 12 ms against 10 ms throughout: the error of third order grows by at most
    // (1.2^3 + 0.8^3)/2 = 1.12 per sample; with the factor 1/12 for all it would be of second
    // order, hundreds of times larger.
    let duration = 60.0;
    let reference = runge_kutta(&manoeuvre_start(), duration, 60_000);
    let mut mechanisation = Mechanisation::default();
    mechanisation.remember(&manoeuvre_increments(-0.012, 0.012), 0.012);
    let mut state = manoeuvre_start();
    for i in 0..6_000 {
        let (offset, dt) = if i % 2 == 0 { (0.0, 0.008) } else { (0.008, 0.012) };
        let inc = manoeuvre_increments((i / 2) as f64 * 0.02 + offset, dt);
        state = mechanisation.step(&state, &inc).unwrap().0;
    }
    let [attitude, velocity, position] =
        difference(&mechanised_manoeuvre(duration, 6_000), &reference);
    assert_near(
        &state,
        &reference,
        [attitude * 1.2, velocity * 1.2, position * 1.2],
        "unequal intervals",
    );
}

#[test]
fn a_sample_taken_in_parts_equals_the_whole() {
    // The body's integrals are exact at constant rates and Coriolis sees the mean velocity, so that
    // over one step only what is not linear in the velocity differs: v^2 tan(L)/R, (f dt)^2/12 *
    // 5.7/6.4e6 * dt = 2e-11 m/s at 20 m/s^2, and the height at which gravity is taken, 3.1e-6/s^2
    // * f dt^2/8 * dt = 8e-12 m/s. Attitude: rounding. Position: that of the longitude, 4.4e-16 * R
    // = 3e-9 m, twice.
    let mut u = Uniform::new(3);
    for _ in 0..1_000 {
        let dt = 0.01;
        let state = NavState {
            c_b_n: UnitQuaternion::from_scaled_axis(u.vector(2.0)),
            velocity: u.vector(17.0),
            position: geodetic(u.within(80.0), u.within(180.0), u.within(1_000.0)),
        };
        let mut sample = || {
            let dvel = u.vector(6.0) * dt - state.c_b_n.inverse() * Vector3::z() * (9.8 * dt);
            Increments { dtheta: u.vector(1.0) * dt, dvel, dt }
        };
        let (first, second, third) = (sample(), sample(), sample());
        let fraction = 0.5 + u.within(0.49);
        let mut whole = Mechanisation::default();
        whole.step(&state, &first).unwrap();
        let mut parts = whole;
        let a = whole.step(&state, &second).unwrap().0;
        let b = parts.step_part(&state, &second.part(fraction), dt).unwrap().0;
        let b = parts.step_part(&b, &second.part(1.0 - fraction), dt).unwrap().0;
        assert_near(&a, &b, [2e-15, 3e-11, 6e-9], "parts");
        // The history is the same too: of the next step nothing but rounding differs.
        let (c, d2) = (whole.step(&a, &third).unwrap().0, parts.step(&a, &third).unwrap().0);
        assert_near(&c, &d2, [1e-15, 1e-14, 6e-9], "after the parts");
    }
}

#[test]
fn a_fast_turn_is_integrated_in_closed_form() {
    // 20 rad/s over 0.1 s, where the series would not do: one step equals a thousand of the same
    // constant rates, but for the slow terms: the height at which gravity is taken is off by a
    // dt^2/8 = 1.5 cm, 3.1e-6 * 0.015 * 0.1 = 5e-9 m/s, and in the mean velocity the turn of the
    // axes within the body's, zeta phi dv / 24 = 1e-5 * 2 * 1.2 / 24 = 1e-6 m/s, for 0.1 s.
    let state = manoeuvre_start();
    let whole = Increments {
        dtheta: Vector3::new(1.0, -1.5, 0.8),
        dvel: Vector3::new(0.5, 0.3, -1.0),
        dt: 0.1,
    };
    let once = run(&state, &whole, 1);
    let often = run(&state, &whole.part(1e-3), 1_000);
    assert_near(&once, &often, [1e-12, 1e-8, 2e-7], "fast turn");
}

#[test]
fn the_series_meets_the_closed_form() {
    for x in [1e-4_f64, 0.0999, 0.099_999_9, 0.100_000_1, 0.3, 3.0] {
        let phi = Vector3::new(0.6, -0.64, 0.48) * x;
        let turn = Rotation::new(&phi);
        let exact = UnitQuaternion::from_scaled_axis(phi);
        assert!((turn.quaternion - exact.into_inner()).norm() < 2e-16, "{x}");
        assert!((turn.a - 2.0 * ((0.5 * x).sin() / x).powi(2)).abs() < 2e-16, "{x}");
        // b = sum (-x^2)^k / (2k + 3)! and c = sum (-x^2)^k / (2k + 4)!; the closed forms lose
        // 1e-16 / x^2 of 1 to cancellation, at most 1e-14 where they are used.
        let series = |n: f64, first: f64| {
            let terms = (0..20).map(|k| n + 2.0 * f64::from(k));
            terms
                .fold((0.0, first), |(sum, t), m| (sum + t, -t * x * x / ((m + 1.0) * (m + 2.0))))
                .0
        };
        assert!((turn.b - series(3.0, 1.0 / 6.0)).abs() < 3e-14, "{x}");
        assert!((turn.c - series(4.0, 1.0 / 24.0)).abs() < 3e-14, "{x}");
    }
}

#[test]
fn a_step_that_cannot_be_taken_says_why_and_changes_nothing() {
    let state = manoeuvre_start();
    let sample = manoeuvre_increments(0.0, 0.01);
    let mut mechanisation = Mechanisation::default();
    mechanisation.step(&state, &sample).unwrap();
    let before = mechanisation;
    let mut fails =
        |state: &NavState, sample: &Increments| mechanisation.step(state, sample).unwrap_err();

    for dt in [0.0, -0.01] {
        let error = fails(&state, &Increments { dt, ..sample });
        assert_eq!(error, MechanisationError::Interval { dt });
    }
    assert!(matches!(
        fails(&state, &Increments { dt: f64::NAN, ..sample }),
        MechanisationError::Interval { .. }
    ));
    let mut bad = sample;
    bad.dtheta.y = f64::NAN;
    assert_eq!(fails(&state, &bad), MechanisationError::NonFinite { what: "angular increment" });
    bad = sample;
    bad.dvel.x = f64::INFINITY;
    assert_eq!(fails(&state, &bad), MechanisationError::NonFinite { what: "velocity increment" });
    let lost = NavState { position: Geodetic { longitude: f64::NAN, ..state.position }, ..state };
    assert_eq!(fails(&lost, &sample), MechanisationError::NonFinite { what: "position" });
    for degrees in [89.91, -89.91] {
        let polar =
            NavState { position: geodetic(degrees, 0.0, 0.0), velocity: Vector3::zeros(), ..state };
        let error = fails(&polar, &sample);
        assert!(error.to_string().contains(&format!("{degrees:.2}")), "{error}");
    }
    assert_eq!(mechanisation, before);
}

#[test]
fn the_earth_of_a_step_is_that_at_half_the_way() {
    // 300 m/s for a second, without a force: half the way is 150 m, d = 2.4e-5 rad of latitude. It
    // is accurate to 3e-9 of d, 7e-14, by the slope of R_N. Gravity moves the vehicle down and not
    // to the north.
    for degrees in [-80.0, -45.0, 0.0, 30.0, 60.0, 85.0] {
        for north in [-300.0, 300.0] {
            let state = NavState {
                c_b_n: UnitQuaternion::identity(),
                velocity: Vector3::new(north, 0.0, -40.0),
                position: geodetic(degrees, 0.0, 500.0),
            };
            let sample = Increments { dtheta: Vector3::zeros(), dvel: Vector3::zeros(), dt: 1.0 };
            let earth = Mechanisation::default().step(&state, &sample).unwrap().1.earth;
            let (r_n, _) = radii_of_curvature(state.position.latitude);
            let half = state.position.latitude + 0.5 * north / (r_n + 500.0);
            let expected = LocalEarth::at(half, 520.0);
            let off = (earth.sin - expected.sin).abs().max((earth.cos - expected.cos).abs());
            assert!(off < 7e-14, "{degrees} deg: {off:e}");
            assert!((earth.gravity - expected.gravity).abs() < 1e-12, "{degrees} deg");
        }
    }
}

#[test]
fn a_part_and_its_sample_both_need_a_length() {
    let (state, part) = (manoeuvre_start(), manoeuvre_increments(0.0, 0.01).part(0.5));
    let mut mechanisation = Mechanisation::default();
    for (dt, sample_dt) in [(0.0, 0.01), (-0.005, 0.01), (0.005, 0.0), (0.005, -0.01)] {
        let error = mechanisation.step_part(&state, &Increments { dt, ..part }, sample_dt);
        let expected = MechanisationError::Interval { dt: dt.min(sample_dt) };
        assert_eq!(error.unwrap_err(), expected, "{dt} s of {sample_dt} s");
    }
    for (dt, sample_dt) in [(f64::NAN, 0.01), (0.005, f64::NAN)] {
        let error = mechanisation.step_part(&state, &Increments { dt, ..part }, sample_dt);
        assert!(matches!(error, Err(MechanisationError::Interval { .. })), "{error:?}");
    }
    assert_eq!(mechanisation, Mechanisation::default());
}

/// Within a microsecond of free fall neither latitude nor longitude changes: Coriolis moves the
/// vehicle by 1e-21 rad, a rounding is 2e-16 rad.
#[test]
fn the_limits_of_latitude_and_longitude_belong_to_the_range() {
    for sign in [1.0, -1.0] {
        let position = geodetic(sign * MAX_LATITUDE_DEG, sign * 180.0, 0.0);
        let state =
            NavState { c_b_n: UnitQuaternion::identity(), velocity: Vector3::zeros(), position };
        let fall = Increments { dtheta: Vector3::zeros(), dvel: Vector3::zeros(), dt: 1e-6 };
        let found = run(&state, &fall, 1).position;
        assert_eq!((found.latitude, found.longitude), (position.latitude, position.longitude));
    }
}

/// At the equator the sine of the latitude is that of the angle travelled, for which the radius is
/// exact: 300 m/s for half of 100 s, d = 2.4e-3 rad. Sine and cosine omit d^5/120 and d^4/24.
#[test]
fn the_earth_of_a_long_step_is_that_at_half_the_way() {
    for north in [-300.0, 300.0] {
        let velocity = Vector3::new(north, 0.0, 0.0);
        let position = geodetic(0.0, 0.0, 500.0);
        let state = NavState { c_b_n: UnitQuaternion::identity(), velocity, position };
        let sample = Increments { dtheta: Vector3::zeros(), dvel: Vector3::zeros(), dt: 100.0 };
        let earth = Mechanisation::default().step(&state, &sample).unwrap().1.earth;
        let d = north * 50.0 / (radii_of_curvature(0.0).0 + 500.0);
        assert!((earth.sin - d.sin()).abs() < 1e-15, "{:e}", earth.sin - d.sin());
        assert!((earth.cos - d.cos()).abs() < d.powi(4) / 20.0, "{:e}", earth.cos - d.cos());
    }
}

/// A body that does not turn in inertial space, for 100 s: the axes turn below it by zeta, 7 mrad,
/// from `exp(0)` to `exp(-zeta)`, and the force with them, in the mean by `int_0^1 exp(-zeta u) du`.
/// The quaternion omits `zeta^5 / 384`, 6e-14 rad; the force `zeta^3 / 24`, 1.6e-8 of itself.
#[test]
fn the_axes_turn_below_a_body_that_does_not_turn() {
    let (state, dt) = (manoeuvre_start(), 100.0);
    let (dtheta, dvel) = (Vector3::zeros(), Vector3::new(60.0, -300.0, 200.0));
    let mut mechanisation = Mechanisation::default();
    let (next, rates) = mechanisation.step(&state, &Increments { dtheta, dvel, dt }).unwrap();
    let zeta = (rates.earth_rate + rates.transport_rate) * dt;
    let axes = |u: f64| UnitQuaternion::from_scaled_axis(-zeta * u);
    let turned = next.c_b_n.angle_to(&(axes(1.0) * state.c_b_n));
    assert!(turned < 1e-13, "{turned:e} rad");
    // the midpoint rule with 1000 intervals is off by zeta^2 / 24e6 of the force, 2e-12
    let middle = |k: i32| axes((f64::from(k) + 0.5) / 1_000.0) * (state.c_b_n * dvel);
    let mean = (0..1_000).map(middle).sum::<Vector3<f64>>() / (1_000.0 * dt);
    let off = (rates.specific_force - mean).norm() / mean.norm();
    assert!(off < 1.7e-8, "{off:e}");
}

/// From rest, with `a` for a second, in one step and in a thousand. Coriolis moves a vehicle by
/// `-2 w x a t^3 / 6`, and the axes turn below the force by as much as `-w x f t^3 / 6`. The step
/// counts half of the velocity that it gains where Coriolis sees a third in the mean, so that it is
/// ahead by `-2 w x a t^3 / 12`. What remains is of second order: the transport rate grows with the
/// velocity, `a^2 t^4 / 6R` = 3e-6 m, and gravity changes with the height, 3e-6/s^2 of 5 m.
#[test]
fn coriolis_acts_on_the_velocity_that_a_step_gains() {
    let state = NavState { velocity: Vector3::zeros(), ..manoeuvre_start() };
    let force = Vector3::new(6.0, -8.0, -9.8);
    let whole = Increments { dtheta: Vector3::zeros(), dvel: force, dt: 1.0 };
    let (once, often) = (run(&state, &whole, 1), run(&state, &whole.part(1e-3), 1_000));
    let p = state.position;
    let acceleration = state.c_b_n * force + Vector3::z() * normal_gravity(p.latitude, p.height);
    let ahead = -earth_rate_ned(p.latitude).cross(&acceleration) / 6.0;
    let off = once.position.ned_from(&often.position) - ahead;
    assert!(off.norm() < 1e-5 && ahead.norm() > 1e-4, "{off:?} m of {ahead:?} m");
}
