//! Properties of every trajectory, tested on that of the paper.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // A test fails by panicking.

use crate::cursor::Kinematics;
use crate::error::TrajectoryError;
use crate::trajectory::{Trajectory, TrajectoryConfig};
use nalgebra::{UnitQuaternion, Vector3};
use navfuse_core::state::geodesy::{ECCENTRICITY_SQUARED, radii_of_curvature};
use navfuse_ins::earth::{EARTH_RATE, normal_gravity};
use serde_json::{Value, json};

const START: &str =
    r#"{ "latitude": "30 deg", "longitude": "120 deg", "heading": "10 deg", "roll": "3 deg" }"#;

fn trajectory(start: Value, segments: Value) -> Result<Trajectory, TrajectoryError> {
    let config: TrajectoryConfig =
        serde_json::from_value(json!({ "start": start, "segments": segments })).unwrap();
    Trajectory::new(&config)
}

fn square(duration: &str, direction: &str) -> Value {
    json!({
        "type": "square", "duration": duration, "turn": "30 s", "bank": "8 deg", "pitch": "2 deg",
        "direction": direction
    })
}

/// The 3-D run of Pan & Wu 2016, Table 1.
fn paper() -> Trajectory {
    let segments = json!([
        { "type": "static", "duration": "600 s" },
        { "type": "surge", "duration": "60 s", "speed": "5 m/s" },
        { "type": "descend", "duration": "60 s", "rate": "1 m/s" },
        { "type": "pulse", "duration": "30 s", "speed_change": "0.5 m/s" },
        square("1220 s", "starboard"),
        { "type": "pulse", "duration": "30 s", "speed_change": "-0.5 m/s" },
        { "type": "ascend", "duration": "60 s", "rate": "1 m/s" },
    ]);
    trajectory(serde_json::from_str(START).unwrap(), segments).unwrap()
}

/// Instants in all phases: 0.7 s apart.
fn instants(trajectory: &Trajectory) -> impl Iterator<Item = f64> + use<> {
    let end = trajectory.duration() - 3.0;
    (0..).map(|i| 3.0 + 0.7 * f64::from(i)).take_while(move |t| *t < end)
}

#[test]
fn the_papers_runs_have_its_times() {
    let t = paper();
    assert_eq!(t.duration(), 2060.0);
    let rows: Vec<_> =
        t.segments().filter(|s| s.number != 5).map(|s| (s.label, s.start, s.end)).collect();
    let expected = [
        ("static", 0.0, 600.0),
        ("surge", 600.0, 660.0),
        ("descend", 660.0, 720.0),
        ("pulse", 720.0, 750.0),
        ("pulse", 1970.0, 2000.0),
        ("ascend", 2000.0, 2060.0),
    ];
    assert_eq!(rows, expected);
    let corner = t.segments().find(|s| s.label == "square turn 1").unwrap();
    assert_eq!((corner.number, corner.start, corner.end), (5, 1025.0, 1055.0));

    let flat = json!([
        { "type": "static", "duration": "600 s" },
        { "type": "surge", "duration": "200 s", "speed": "5 m/s" },
        square("1240 s", "starboard"),
    ]);
    assert_eq!(trajectory(json!({}), flat).unwrap().duration(), 2040.0);
}

#[test]
fn velocity_and_acceleration_are_derivatives() {
    let t = paper();
    let (mut a, mut b, mut c) = (t.cursor(), t.cursor(), t.cursor());
    let d = 0.01;
    for time in instants(&t) {
        let (before, here, after) = (a.at(time - d), b.at(time), c.at(time + d));
        let scale = 1.0 / (2.0 * d);
        let (r_n, r_e) = radii_of_curvature(here.position.latitude);
        let height = here.position.height;
        let rate = Vector3::new(
            (after.position.latitude - before.position.latitude) * (r_n + height),
            (after.position.longitude - before.position.longitude)
                * (r_e + height)
                * here.position.latitude.cos(),
            before.position.height - after.position.height,
        ) * scale;
        // Central difference: v'' d^2 / 6 with v'' < 5 m/s (pi/2 35/16 / T)^2 + ... < 0.1 m/s^3:
        // 1.7e-6; the longitude (2 rad) is rounded to 4.4e-16 rad: 2.8e-9 m / 2 d = 1.4e-7 m/s.
        assert!((rate - here.velocity).amax() < 2e-6, "{time}: {rate} {}", here.velocity);
        let acceleration = (after.velocity - before.velocity) * scale;
        // v''' < 5 m/s * pi/2 * 84 / T^3 = 0.024 m/s^4: 4e-7 m/s^2.
        assert!((acceleration - here.acceleration).amax() < 4e-7, "{time}");
        let way = (after.distance - before.distance) * scale;
        assert!((way - here.velocity.norm()).abs() < 2e-6, "{time}");
    }
}

#[test]
fn angular_rate_is_the_derivative_of_attitude() {
    let t = paper();
    let (mut a, mut b, mut c) = (t.cursor(), t.cursor(), t.cursor());
    let d = 1e-3;
    for time in instants(&t) {
        let (before, here, after) = (a.at(time - d), b.at(time), c.at(time + d));
        let rate = (before.c_b_n.inverse() * after.c_b_n).scaled_axis() / (2.0 * d);
        // w'' d^2 / 6 with w'' < 0.01 rad/s^3: 1.7e-9; rounding 2e-16 / 2 d.
        assert!((rate - here.w_nb_b).amax() < 2e-9, "{time}: {rate} {}", here.w_nb_b);
        let euler_rates = (after.euler - before.euler) / (2.0 * d);
        assert!((euler_rates - here.euler_rates).amax() < 2e-9, "{time}");
    }
}

#[test]
fn on_a_slope_the_velocity_is_along_the_body_and_its_derivative_is_the_acceleration() {
    let start = json!({ "heading": "40 deg", "speed": "20 m/s" });
    let t = trajectory(start, json!([{ "type": "slope", "duration": "60 s", "angle": "6 deg" }]))
        .unwrap();
    let (mut a, mut b, mut c) = (t.cursor(), t.cursor(), t.cursor());
    let d = 0.01;
    for time in (1..60).map(f64::from) {
        let (before, here, after) = (a.at(time - d), b.at(time), c.at(time + d));
        let along = here.c_b_n.inverse() * here.velocity;
        assert!(along.y.abs() < 1e-13 && along.z.abs() < 1e-13, "{time}: {along}");
        assert!((here.velocity.xy().norm() - 20.0).abs() < 1e-13, "the horizontal speed stays");
        // v''' d^2 / 6 with v''' < 20 m/s * 0.105 * 64 * 72 / T^3 = 0.045 m/s^4: 7.5e-7 m/s^2
        let acceleration = (after.velocity - before.velocity) / (2.0 * d);
        assert!((acceleration - here.acceleration).amax() < 8e-7, "{time}");
    }
    let (middle, end) = (t.cursor().at(30.0), c.at(60.0));
    assert!((middle.euler.y - 6_f64.to_radians()).abs() < 1e-15 && end.euler.y == 0.0);
    // the mean of tan(6 deg B(x)) is 0.10472 * 16/35, and of its cube / 3 less than 0.0004: 57.4 to
    // 57.9 m in 1200 m
    assert!((57.4..57.9).contains(&end.position.height), "{}", end.position.height);
}

#[test]
fn sideways_the_attitude_and_the_forward_speed_stay() {
    let start = json!({ "heading": "40 deg", "roll": "5 deg", "speed": "2 m/s" });
    let t = trajectory(start, json!([{ "type": "sway", "duration": "60 s", "speed": "-1 m/s" }]))
        .unwrap();
    let (mut a, mut b, mut c) = (t.cursor(), t.cursor(), t.cursor());
    let d = 0.01;
    let heading = UnitQuaternion::from_euler_angles(0.0, 0.0, 40_f64.to_radians());
    for time in (1..60).map(f64::from) {
        let (before, here, after) = (a.at(time - d), b.at(time), c.at(time + d));
        let along = heading.inverse() * here.velocity;
        assert!(
            (along.x - 2.0).abs() < 1e-14 && along.z == 0.0 && here.w_nb_b == Vector3::zeros(),
            "{time}: {along}"
        );
        // v''' d^2 / 6 with v''' < 64 * 72 / T^3 = 0.022 m/s^4: 3.6e-7 m/s^2
        let acceleration = (after.velocity - before.velocity) / (2.0 * d);
        assert!((acceleration - here.acceleration).amax() < 4e-7, "{time}");
    }
    let way = heading.inverse() * c.at(60.0).position.ned_from(&t.cursor().at(0.0).position);
    // 16/35 of 1 m/s in 60 s; the way is 120 m, on a sphere: 120^2 / 6.4e6 m = 2 mm
    assert!((way.y + 60.0 * 16.0 / 35.0).abs() < 5e-3, "{way}");
}

/// Position and attitude in inertial axes that coincided with those of the Earth at the start.
fn inertial(k: &Kinematics) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let p = k.position;
    let (_, r_e) = radii_of_curvature(p.latitude);
    let ((sl, cl), (so, co)) = (p.latitude.sin_cos(), p.longitude.sin_cos());
    let ecef = Vector3::new(
        (r_e + p.height) * cl * co,
        (r_e + p.height) * cl * so,
        ((1.0 - ECCENTRICITY_SQUARED) * r_e + p.height) * sl,
    );
    let c_e_i = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), EARTH_RATE * k.time);
    (c_e_i * ecef, c_e_i * c_n_e(k) * k.c_b_n)
}

fn c_n_e(k: &Kinematics) -> UnitQuaternion<f64> {
    let tilt = UnitQuaternion::from_axis_angle(
        &Vector3::y_axis(),
        -std::f64::consts::FRAC_PI_2 - k.position.latitude,
    );
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), k.position.longitude) * tilt
}

#[test]
fn rate_and_force_are_those_of_newton_in_inertial_axes() {
    let t = paper();
    let mut cursors: [_; 5] = std::array::from_fn(|_| t.cursor());
    let d = 0.25;
    let boundaries: Vec<f64> = t.segments().map(|s| s.start).collect();
    // The stencil wants six derivatives, which a boundary has not.
    let inside = |time: &f64| boundaries.iter().all(|b| (time - b).abs() > 2.0 * d);
    for time in instants(&t).filter(inside) {
        let k: [Kinematics; 5] =
            std::array::from_fn(|i| cursors[i].at(time + d * (i as f64 - 2.0)));
        let here = &k[2];
        let p = k.map(|k| inertial(&k));
        // Five points: r'''''' d^4 / 90 with 1e-4 m/s^6 at most is 4e-9; rounding (64/12 of 1e-9 m
        // for the equator's radius, and as much for the angles) / d^2 is 2e-7 m/s^2.
        let acceleration =
            (-p[0].0 + p[1].0 * 16.0 - p[2].0 * 30.0 + p[3].0 * 16.0 - p[4].0) / (12.0 * d * d);
        // Gravity is gravitation with the centrifugal acceleration: here the latter is taken out
        // again.
        let c_e_i = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), EARTH_RATE * time);
        let down = c_e_i * c_n_e(here) * Vector3::z();
        let centrifugal = Vector3::new(p[2].0.x, p[2].0.y, 0.0) * EARTH_RATE.powi(2);
        let gravitation =
            down * normal_gravity(here.position.latitude, here.position.height) - centrifugal;
        let force = p[2].1.inverse() * (acceleration - gravitation);
        let error = (force - here.specific_force).amax();
        assert!(error < 3e-7, "{time}: {error}");

        let between = |i: usize, j: usize| (p[i].1.inverse() * p[j].1).scaled_axis();
        let rate = (between(1, 3) * 8.0 - between(0, 4)) / (12.0 * d);
        // Five points: w'''' d^4 / 30, at the ends of a turn 10 080 pi/2 / T^5 = 6.5e-4 rad/s^5;
        // elsewhere rounding, 2e-16 * 9 / 6 d.
        let bound = if here.w_nb_b == Vector3::zeros() { 1e-13 } else { 9e-8 };
        let error = (rate - here.w_ib_b).amax();
        assert!(error < bound, "{time}: {error}");
    }
}

#[test]
fn specific_force_and_rate_have_a_continuous_derivative_at_every_boundary() {
    let t = paper();
    let boundaries: Vec<f64> = t.segments().skip(1).map(|s| s.start).collect();
    assert_eq!(boundaries.len(), 13);
    for boundary in boundaries {
        let second = |h: f64| {
            let mut c = t.cursor();
            let [a, b, c] = [-h, 0.0, h].map(|x| c.at(boundary + x));
            let force = a.specific_force - b.specific_force * 2.0 + c.specific_force;
            let rate = a.w_ib_b - b.w_ib_b * 2.0 + c.w_ib_b;
            (force.amax(), rate.amax())
        };
        // A jump J of the derivative would leave J h. A bump leaves 384 / T^3 times its peak,
        // one-sided, h^2 / 2: with a peak of 1 m/s in 60 s 9e-4 h^2, of 0.5 m/s in 30 s 3.6e-3 h^2;
        // 8 deg in 30 s 1e-3 h^2 and, in gravity, nothing.
        let h = 0.01;
        let (force, rate) = second(h);
        assert!(force < 0.01 * h * h, "{boundary}: {force}");
        assert!(rate < 2e-3 * h * h, "{boundary}: {rate}");
    }
}

#[test]
fn increments_are_the_integrals_at_any_rate() {
    let t = paper();
    // The increments use the Earth's parameters in the middle of an interval T (0.125 s at most,
    // then summed). The error is the curvature of the height, w' = 0.057 m/s^2 in the dive, times
    // the gradient of gravity, 3.1e-6 1/s^2, times T^3 / 24. It is 7.4e-15, 7.4e-12 and 1.2e-10
    // m/s, and rounding is 1e-14. The noise of a good accelerometer is 1e-6 m/s in 100 s of 100 Hz
    // increments.
    for (rate, bound) in [(100.0, 2e-14), (10.0, 8e-12), (1.0, 1.3e-10)] {
        let (mut cursor, mut truth) = (t.cursor(), t.cursor());
        let mut worst: f64 = 0.0;
        for i in 0..(1100.0 * rate) as u32 {
            let (from, to) = (f64::from(i) / rate, f64::from(i + 1) / rate);
            let (angle, velocity) = cursor.increments(from, to);
            if from < 598.0 || (760.0..1020.0).contains(&from) {
                continue;
            }
            // Simpson's rule over intervals of 5 ms at most.
            let n = 2 * (0.1 * (to - from) / 1e-3).ceil() as u32;
            let h = (to - from) / f64::from(n);
            let (mut angle_2, mut velocity_2) = (Vector3::zeros(), Vector3::zeros());
            for j in 0..=n {
                let weight =
                    h / 3.0 * if j == 0 || j == n { 1.0 } else { f64::from(2 + 2 * (j % 2)) };
                let k = truth.at(from + h * f64::from(j));
                angle_2 += k.w_ib_b * weight;
                velocity_2 += k.specific_force * weight;
            }
            worst = worst.max((angle - angle_2).amax()).max((velocity - velocity_2).amax());
        }
        assert!(worst < bound, "{rate} Hz: {worst}");
    }
}

#[test]
fn values_depend_on_the_time_alone() {
    let t = paper();
    let mut dense = t.cursor();
    for time in (0..20_600).map(|i| f64::from(i) / 10.0 + 0.003) {
        dense.increments(time - 0.003, time);
        let here = dense.at(time);
        if (time as u32).is_multiple_of(400) {
            assert_eq!(here, t.cursor().at(time));
            // one that shares no node of the path with the others
            assert_eq!(here, paper().cursor().at(time));
        }
    }
    let last = dense.at(2060.0);
    dense.at(5.0);
    assert_eq!(dense.at(2060.0), last);
    assert_eq!(dense.at(f64::INFINITY), last);
    assert_eq!(dense.at(f64::NAN).time, 0.0);
}

/// A cursor that has read the vehicle at rest before returns the same bits as one that begins there.
#[test]
fn readings_at_rest_depend_on_their_length_alone() {
    let t = paper();
    let mut cursor = t.cursor();
    for (from, to) in [(0.0, 0.01), (0.01, 0.03), (300.0, 300.125), (599.9, 599.95)] {
        assert_eq!(cursor.increments(from, to), t.cursor().increments(from, to), "{from} s");
    }
    // the motion begins within the interval
    let across = cursor.increments(599.99, 600.05);
    assert_eq!(across, paper().cursor().increments(599.99, 600.05));
    let moving = cursor.increments(630.0, 630.01);
    assert_eq!(moving, paper().cursor().increments(630.0, 630.01));
    assert_ne!(moving, t.cursor().increments(300.0, 300.01));
}

#[test]
fn a_square_comes_back_but_for_the_convergence_of_the_meridians() {
    for (direction, sign) in [("starboard", 1.0), ("port", -1.0)] {
        let start = json!({ "latitude": "30 deg", "heading": "0 deg", "speed": "5 m/s" });
        let t = trajectory(start, json!([square("1220 s", direction)])).unwrap();
        let mut cursor = t.cursor();
        let (first, last) = (cursor.at(0.0), cursor.at(1220.0));
        let gap = last.position.ned_from(&first.position);
        // The sides are those of a leg and both halves of its turns: the step's mean is 1/2 and, by
        // symmetry, each turn adds the same both ways. The eastward side at latitude L + side / R
        // runs through more longitude than the westward one: side^2 tan L / R in metres, east of
        // the start (west, for a square to port).
        let quarter = cursor_at(&t, 305.0).position.ned_from(&first.position);
        let side = quarter.x + quarter.y.abs();
        let (r_n, _) = radii_of_curvature(first.position.latitude);
        let expected = sign * side * side * first.position.latitude.tan() / r_n;
        assert!((expected - gap.y).abs() < 0.02 * expected.abs(), "{direction}: {gap} {expected}");
        // North and south are the same way but for R_N over 1.5 km: 3 e^2 sin L cos L * 2.4e-4 rad
        // * 1.5 km < 2e-3 m.
        assert!(gap.x.abs() < 2e-3 && gap.z.abs() < 1e-9, "{direction}: {gap}");
        assert!((last.distance - 6100.0).abs() < 1e-6, "{}", last.distance);
    }
}

fn cursor_at(t: &Trajectory, time: f64) -> Kinematics {
    t.cursor().at(time)
}

#[test]
fn turns_lean_to_their_side_and_a_dive_reaches_its_depth() {
    let t = paper();
    let middle = cursor_at(&t, 1040.0);
    assert!(
        (middle.euler.x.to_degrees() - 11.0).abs() < 1e-12
            && (middle.euler.y.to_degrees() - 2.0).abs() < 1e-12
    );
    assert!((middle.euler.z.to_degrees() - 55.0).abs() < 1e-12);
    // 16/35 of 1 m/s in 60 s; the integration's error is h^4 times the jumps of w''' (1.8e-3), each
    // at one node.
    assert!((cursor_at(&t, 720.0).position.height + 60.0 * 16.0 / 35.0).abs() < 1e-8);
    assert!(cursor_at(&t, 2060.0).position.height.abs() < 1e-8);

    let start = json!({ "speed": "3 m/s" });
    let turn = json!([{ "type": "turn", "duration": "20 s", "angle": "-40 deg", "bank": "6 deg" }]);
    let t = trajectory(start, turn).unwrap();
    assert!((cursor_at(&t, 10.0).euler.x.to_degrees() + 6.0).abs() < 1e-12);
    assert!((cursor_at(&t, 20.0).euler.z.to_degrees() + 40.0).abs() < 1e-12);
}

#[test]
fn errors_name_the_segment_the_key_the_value_and_the_remedy() {
    let of = |start: Value, segments: Value| trajectory(start, segments).unwrap_err().to_string();
    let moving = json!({ "speed": "2 m/s" });
    let cases = [
        (of(json!({}), json!([])), "table is empty"),
        (
            of(json!({ "latitude": "89.5 deg" }), json!([])),
            "start: latitude = \"89.5 deg\": give a value within 89 deg",
        ),
        (
            of(
                json!({}),
                json!([
                    { "type": "static", "duration": "60 s" },
                    { "type": "cruise", "duration": "0 s" }
                ]),
            ),
            "segment 2 (`cruise`): duration = \"0 s\": give a duration from 1 s",
        ),
        (
            of(json!({}), json!([{ "type": "turn", "duration": "-3 s", "angle": "10 deg" }])),
            "segment 1 (`turn`): duration = \"-3 s\"",
        ),
        (
            of(moving.clone(), json!([{ "type": "static", "duration": "60 s" }])),
            "segment 1 (`static`): speed = \"2 m/s\": put a `surge`",
        ),
        (
            of(moving.clone(), json!([{ "type": "square", "duration": "100 s", "turn": "30 s" }])),
            "segment 1 (`square`): turn = \"30 s\": four turns leave nothing of 100 s",
        ),
        (
            of(
                moving.clone(),
                json!([{ "type": "descend", "duration": "60 s", "rate": "-1 m/s" }]),
            ),
            "segment 1 (`descend`): rate = \"-1 m/s\": give a rate above zero",
        ),
        (
            of(moving, json!([{ "type": "cruise", "duration": "10000000 s" }])),
            "segment 1: the path so far may lead to a latitude of 214.8 deg, beyond 89 deg",
        ),
    ];
    for (message, expected) in cases {
        assert!(message.contains(expected), "{message}");
    }
}
