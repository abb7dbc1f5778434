//! Manifolds: retraction and its inverse, coordinates, the reset, and sigma as it is shown.

use navfuse_core::nalgebra::{DMatrix, Matrix3, Rotation3, UnitQuaternion, Vector3};
use navfuse_core::state::covariance::Covariance;
use navfuse_core::state::display;
use navfuse_core::state::geodesy::{Geodetic, radii_of_curvature};
use navfuse_core::state::manifold::{Manifold, Operations, Position, Rotation, Scalar, Vector};
use navfuse_core::state::{Block, BlockSpec, Display, Dynamics, Mode};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

fn values<M: Manifold>(coordinates: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; M::AMBIENT];
    (Operations::of::<M>().from_coordinates)(coordinates, &mut x);
    x
}

fn retract<M: Manifold>(x: &[f64], delta: &[f64]) -> Vec<f64> {
    let mut y = x.to_vec();
    (Operations::of::<M>().retract)(&mut y, delta);
    y
}

fn local<M: Manifold>(to: &[f64], from: &[f64]) -> Vec<f64> {
    let mut d = vec![0.0; M::TANGENT];
    (Operations::of::<M>().local)(to, from, &mut d);
    d
}

fn vector(bound: f64) -> impl Strategy<Value = [f64; 3]> {
    [-bound..bound, -bound..bound, -bound..bound]
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

fn rotation(angles: [f64; 3]) -> Vec<f64> {
    values::<Rotation>(&angles)
}

fn block<M: Manifold>(coordinates: &[f64], sigma: &[f64], display: Display) -> (Block, Vec<f64>) {
    let spec = BlockSpec {
        mode: Mode::Estimate,
        initial: coordinates.to_vec(),
        sigma: sigma.to_vec(),
        truth: None,
        dynamics: Dynamics::Constant,
        display,
    };
    let block = Block {
        name: "b".into(),
        spec,
        operations: Operations::of::<M>(),
        offset: 0,
        tangent: Some(0),
        wanders: false,
        label: None,
    };
    (block, values::<M>(coordinates))
}

fn covariance(p: &DMatrix<f64>) -> Covariance {
    let mut c = Covariance::zero(p.nrows());
    (0..p.nrows()).for_each(|i| (0..=i).for_each(|j| c.set(i, j, p[(i, j)])));
    c
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(1000)
    })]

    #[test]
    fn on_rotations_local_undoes_retract_and_retract_undoes_local(
        a in vector(3.2), axis in vector(1.0), angle in 0.0..PI, b in vector(3.2),
    ) {
        let norm = Vector3::from(axis).norm();
        prop_assume!(norm > 1e-3);
        let d = Vector3::from(axis) / norm * angle;
        let x = rotation(a);
        // a rotation matrix rounds at 2^-53; near pi its axis is the square root of a diagonal,
        // with an error of 1e-15 / sin
        let back = local::<Rotation>(&retract::<Rotation>(&x, d.as_slice()), &x);
        let near_pi = PI - angle < 1e-7; // there the opposite axis is the same rotation
        let opposite = if near_pi { distance(&back, (-d).as_slice()) } else { f64::MAX };
        let error = distance(&back, d.as_slice()).min(opposite);
        prop_assert!(error < 1e-13 + if near_pi { 4e-7 } else { 0.0 }, "{:e} at {}", error, angle);
        let y = rotation(b);
        let there = retract::<Rotation>(&x, &local::<Rotation>(&y, &x));
        prop_assert!(distance(&local::<Rotation>(&there, &y), &[0.0; 3]) < 1e-13);
    }

    #[test]
    fn on_rotations_retractions_compose_as_the_group_does(
        a in vector(3.2), d in vector(1.5), e in vector(1.5),
    ) {
        // (x [+] d) [+] e = exp(e) exp(d) x
        let x = rotation(a);
        let two = retract::<Rotation>(&retract::<Rotation>(&x, &d), &e);
        let exp = |v: [f64; 3]| UnitQuaternion::from_scaled_axis(Vector3::from(v));
        let expected = (exp(e) * exp(d)).scaled_axis();
        let one = retract::<Rotation>(&x, expected.as_slice());
        prop_assert!(distance(&local::<Rotation>(&two, &one), &[0.0; 3]) < 1e-13);
    }

    #[test]
    fn coordinates_round_trip_on_rotations_and_are_groves_angles(
        roll in -PI..PI, pitch in -FRAC_PI_2..FRAC_PI_2, yaw in -PI..PI,
    ) {
        let x = rotation([roll, pitch, yaw]);
        let mut c = [0.0; 3];
        (Operations::of::<Rotation>().coordinates)(&x, &mut c);
        // roll and yaw are read from terms of size cos(pitch), whose rounding is at
        // most ten of 2^-53 by way of the quaternion
        let bound = 3e-15 / pitch.cos();
        prop_assert!(distance(&c, &[roll, pitch, yaw]) < bound, "{c:?}, {:e}", bound);
        // Groves eq. 2.22, transposed: C_b^n
        let (sr, cr, sp, cp) = (roll.sin(), roll.cos(), pitch.sin(), pitch.cos());
        let (sy, cy) = (yaw.sin(), yaw.cos());
        let groves = Matrix3::new(
            cp * cy, -cr * sy + sr * sp * cy, sr * sy + cr * sp * cy,
            cp * sy, cr * cy + sr * sp * sy, -sr * cy + cr * sp * sy,
            -sp, sr * cp, cr * cp,
        );
        prop_assert!((Rotation::load::<f64>(&x).matrix() - groves).amax() < 1e-15);
    }

    #[test]
    fn the_jacobian_of_roll_pitch_and_yaw_is_their_slope(
        roll in -3.0..3.0_f64, pitch in -1.5..1.5_f64, yaw in -3.0..3.0_f64,
    ) {
        let x = rotation([roll, pitch, yaw]);
        let mut found = [0.0; 9];
        (Operations::of::<Rotation>().coordinate_jacobian)(&x, &mut found);
        let read = |d: Vector3<f64>| {
            let mut c = [0.0; 3];
            let turned = retract::<Rotation>(&x, d.as_slice());
            (Operations::of::<Rotation>().coordinates)(&turned, &mut c);
            c
        };
        // the third derivative grows as cos(pitch)^-3: with steps of 1e-5, 2e-11 / cos(pitch)^3 of
        // truncation, and of rounding the coordinates' 3e-15 / cos(pitch) over the step
        let bound = 1e-10 / pitch.cos().powi(3) + 6e-10 / pitch.cos();
        for k in 0..3 {
            let step = Vector3::ith(k, 1e-5);
            let (to, from) = (read(step), read(-step));
            for i in 0..3 {
                let slope = (to[i] - from[i]) / 2e-5;
                prop_assert!((found[3 * i + k] - slope).abs() < bound, "{} {}", found[3 * i + k], slope);
            }
        }
    }

    /// A manifold without a Jacobian of its own, as a plugin may define it.
    #[test]
    fn the_jacobian_of_coordinates_is_their_slope_where_a_manifold_gives_none(
        latitude in -1.4..1.4_f64, h in -11_000.0..9_000.0_f64,
    ) {
        let x = values::<Position>(&[latitude, 0.5, h]);
        let mut found = [f64::NAN; 9];
        (Operations::of::<Position>().coordinate_jacobian)(&x, &mut found);
        for k in 0..3 {
            let [to, from] = [10.0, -10.0].map(|step| retract::<Position>(&x, Vector3::ith(k, step).as_slice()));
            for i in 0..3 {
                // 20 m: the coordinates round at 1e-16 rad and 2e-12 m; the terms of the second order
                // of both steps cancel, and those of the third are below 100 (20 m / R)^2
                let slope = (to[i] - from[i]) / 20.0;
                let bound = 1e-9 * slope.abs() + if i == 2 { 1e-5 } else { 1e-16 };
                prop_assert!((found[3 * i + k] - slope).abs() < bound, "{} {}", found[3 * i + k], slope);
            }
        }
    }

    #[test]
    fn on_positions_local_undoes_retract_and_longitude_stays_within_half_a_turn(
        latitude in -1.5..1.5_f64, from_antimeridian in -1e-3..1e-3_f64, turn in prop::bool::ANY,
        h in -11_000.0..9_000.0_f64, d in vector(20_000.0),
    ) {
        let half_turn = if from_antimeridian > 0.0 { -PI } else { PI };
        let longitude = from_antimeridian + if turn { half_turn } else { 0.0 };
        let x = values::<Position>(&[latitude, longitude, h]);
        let y = retract::<Position>(&x, &d);
        prop_assert!(y[1].abs() <= PI, "{}", y[1]);
        // longitude and latitude of up to pi round at 4e-16, times the Earth's radius: 3e-9 m
        let back = local::<Position>(&y, &x);
        prop_assert!(distance(&back, &d) < 1e-8, "{:e}", distance(&back, &d));
    }

    #[test]
    fn vectors_add(x in vector(1e3), d in vector(1e3)) {
        let y = retract::<Vector<3>>(&x, &d);
        prop_assert!((0..3).all(|k| y[k] == x[k] + d[k]));
        prop_assert!(distance(&local::<Vector<3>>(&y, &x), &d) < 1e-12);
        prop_assert_eq!(retract::<Scalar>(&x[..1], &d[..1])[0], x[0] + d[0]);
    }

    #[test]
    fn the_reset_is_the_derivative_of_the_error_about_the_corrected_rotation(d in vector(1.6)) {
        // error' = log(exp(error) exp(-d)) at error = d (Sola 2017, section 6.3, for an error on
        // the left); central differences of 1e-5 leave 1e-10 of truncation and 1e-16/1e-5 of
        // rounding
        let mut found = [0.0; 9];
        prop_assert!((Operations::of::<Rotation>().reset)(&d, &mut found));
        let d = Vector3::from(d);
        let exp = |v: Vector3<f64>| UnitQuaternion::from_scaled_axis(v);
        let error = |e: Vector3<f64>| (exp(e) * exp(-d)).scaled_axis();
        for k in 0..3 {
            let step = Vector3::ith(k, 1e-5);
            let slope = (error(d + step) - error(d - step)) / 2e-5;
            for i in 0..3 {
                let (found, slope) = (found[3 * i + k], slope[i]);
                prop_assert!((found - slope).abs() < 1e-9, "{} {}", found, slope);
            }
        }
    }

    #[test]
    fn a_small_reset_keeps_its_digits(d in vector(1.0), scale in -9.0..-2.0_f64) {
        // the series: I + [d]/2 + [d]^2/6 + [d]^3/24, whose next term is d^4/120 < 1e-9 at 0.017
        let d = Vector3::from(d) * 10_f64.powf(scale);
        let mut found = [0.0; 9];
        (Operations::of::<Rotation>().reset)(d.as_slice(), &mut found);
        let k = d.cross_matrix();
        let series = Matrix3::identity() + k / 2.0 + k * k / 6.0 + k * k * k / 24.0;
        let error = (Matrix3::from_row_slice(&found) - series).amax();
        prop_assert!(error < 1e-15 + d.norm().powi(4) / 100.0, "{:e} at {:e}", error, d.norm());
    }
}

#[test]
fn nothing_becomes_nan_at_the_gimbal_at_half_a_turn_or_on_the_antimeridian() {
    for angles in [
        [0.3, FRAC_PI_2, 0.2],
        [0.0, -FRAC_PI_2, 1.0],
        [PI, 0.0, -PI],
        [-PI, FRAC_PI_2, PI],
        [0.0; 3],
    ] {
        let (block, x) = block::<Rotation>(&angles, &[0.1, 0.2, 0.3], display::ANGLES);
        let prior = block.prior(&x);
        assert!(prior.iter().all(|v| v.is_finite()), "{prior}");
        assert!(prior.clone().cholesky().is_some(), "{prior}");
        let (mut shown, mut sigma, mut error) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        block.show(&x, &mut shown);
        block.show_sigma(&x, &covariance(&prior), &mut sigma);
        block.show_error(&x, &rotation([-angles[0], angles[1], -angles[2]]), &mut error);
        for v in shown.iter().chain(&sigma).chain(&error) {
            assert!(v.is_finite(), "{shown:?} {sigma:?} {error:?}");
        }
        for d in [
            [PI, 0.0, 0.0],
            [0.0, -PI, 0.0],
            [0.0, 0.0, PI],
            [1e-300; 3],
            [0.0; 3],
            [1e3, -1e3, 7.0],
        ] {
            let y = retract::<Rotation>(&x, &d);
            let back = local::<Rotation>(&y, &x);
            assert!(y.iter().chain(&back).all(|v| v.is_finite()));
            let mut g = [f64::NAN; 9];
            (Operations::of::<Rotation>().reset)(&d, &mut g);
            assert!(g.iter().all(|v| v.is_finite()));
        }
    }
    for c in [[0.0, PI, 0.0], [1.2, -PI, 10.0], [-1.2, 3.0 * PI, -11e3]] {
        let (block, x) = block::<Position>(&c, &[1.0, 2.0, 3.0], display::POSITION);
        let mut shown = [0.0; 3];
        block.show(&x, &mut shown);
        assert!((shown[1] - c[1].to_degrees()).abs() < 1e-12);
        let y = retract::<Position>(&x, &[0.0, 1.0, 0.0]);
        let mut error = [0.0; 3];
        block.show_error(&y, &x, &mut error);
        // 1 m east, however the turn is counted: 4e-16 x 10 rad on the Earth's radius
        assert!((error[1] - 1.0).abs() < 3e-8 && error[0] == 0.0, "{error:?}");
    }
}

#[test]
fn half_a_turn_between_rotations_has_a_length_of_pi() {
    for axis in [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::new(0.6, 0.0, 0.8)] {
        let x = rotation([0.4, -0.3, 2.0]);
        let y = retract::<Rotation>(&x, (axis * PI).as_slice());
        let d = Vector3::from_row_slice(&local::<Rotation>(&y, &x));
        assert!((d.norm() - PI).abs() < 1e-7 && d.cross(&axis).norm() < 1e-7, "{d}");
    }
}

#[test]
fn a_rotation_stays_one_over_a_million_corrections() {
    let operations = Operations::of::<Rotation>();
    let mut x = rotation([0.1, 0.2, 0.3]);
    for k in 0..1_000_000 {
        let s = f64::from(k);
        (operations.retract)(&mut x, &[1e-3 * s.sin(), 1e-3 * s.cos(), 1e-4]);
    }
    let norm = x.iter().map(|q| q * q).sum::<f64>();
    assert!((norm - 1.0).abs() < 1e-15, "{:e}", norm - 1.0);
}

/// Standard normal numbers: Box and Muller on splitmix64.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }
    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            (-2.0 * self.uniform().ln()).sqrt() * (2.0 * PI * self.uniform()).cos()
        })
    }
}

#[test]
fn the_covariance_after_a_large_correction_is_that_of_the_sampled_errors() {
    // truth = exp(e) C with e ~ N(d, P), as after an update that found the correction d; about
    // exp(d) C the error is log(exp(e) exp(-d)) ~ N(0, G P G'). Sampled 200 000 times: an entry of
    // the covariance is known to sqrt(2/200000) = 0.3 % of the product of the sigmas, of which four
    // are allowed; the second order of P, 3e-4, is less
    let d = Vector3::new(0.9, -0.6, 1.1);
    let p = Matrix3::new(4.0, 1.0, -0.5, 1.0, 1.0, 0.2, -0.5, 0.2, 0.5) * 1e-4;
    let factor = p.cholesky().unwrap().l();
    let mut random = Normal(3);
    let (count, mut sum) = (200_000, Matrix3::zeros());
    for _ in 0..count {
        let e = d + factor * random.vector();
        let about =
            (Rotation3::from_scaled_axis(e) * Rotation3::from_scaled_axis(-d)).scaled_axis();
        sum += about * about.transpose();
    }
    let sampled = sum / f64::from(count);
    let mut g = [0.0; 9];
    (Operations::of::<Rotation>().reset)(d.as_slice(), &mut g);
    let mut c = covariance(&DMatrix::from_row_slice(3, 3, p.as_slice()));
    c.transform(0..3, &g);
    for i in 0..3 {
        for j in 0..3 {
            let scale = (sampled[(i, i)] * sampled[(j, j)]).sqrt();
            assert!(
                (c.get(i, j) - sampled[(i, j)]).abs() < 0.0126 * scale,
                "{} {}",
                c.get(i, j),
                sampled[(i, j)]
            );
        }
    }
    // without the reset it would be wrong by tens of per cent
    assert!((p - sampled).amax() > 0.2 * sampled.amax());
}

#[test]
fn the_shown_sigma_of_angles_is_that_of_sampled_angles() {
    // as above: four times 0.2 % of the sigma for 100 000 samples, and the bending of the angles,
    // (0.01 tan 1.2)^2
    let (block, x) = block::<Rotation>(&[0.4, 1.2, -2.0], &[0.01; 3], display::ANGLES);
    let p = Matrix3::new(4.0, 1.0, -0.5, 1.0, 1.0, 0.2, -0.5, 0.2, 0.5) * 1e-5;
    let factor = p.cholesky().unwrap().l();
    let mut shown = [0.0; 3];
    block.show_sigma(&x, &covariance(&DMatrix::from_row_slice(3, 3, p.as_slice())), &mut shown);
    let mut random = Normal(5);
    let (count, mut squares) = (100_000, [0.0; 3]);
    for _ in 0..count {
        let mut error = [0.0; 3];
        block.show_error(
            &retract::<Rotation>(&x, (factor * random.vector()).as_slice()),
            &x,
            &mut error,
        );
        squares.iter_mut().zip(&error).for_each(|(s, e)| *s += e * e);
    }
    for (shown, squares) in shown.iter().zip(squares) {
        let sampled = (squares / f64::from(count)).sqrt();
        assert!((shown / sampled - 1.0).abs() < 0.012, "{shown} {sampled}");
    }
}

#[test]
fn a_prior_given_in_angles_is_shown_as_it_was_given() {
    let (block, x) = block::<Rotation>(&[0.2, -0.7, 2.9], &[0.001, 0.002, 0.003], display::ANGLES);
    let mut sigma = [0.0; 3];
    block.show_sigma(&x, &covariance(&block.prior(&x)), &mut sigma);
    for (sigma, given) in sigma.iter().zip([0.001_f64, 0.002, 0.003]) {
        assert!((sigma - given.to_degrees()).abs() < 1e-14, "{sigma}");
    }
}

#[test]
fn a_quaternion_is_read_as_nalgebra_means_it() {
    let q = UnitQuaternion::from_euler_angles(0.1, -0.4, 2.0);
    let mut x = [0.0; 4];
    navfuse_core::state::manifold::store_quaternion(&q, &mut x);
    assert!((Rotation::load::<f64>(&x).matrix() - q.to_rotation_matrix().matrix()).amax() < 1e-15);
}

/// Longitudes lie above -180 deg and up to 180 deg, so that each has one value.
#[test]
fn a_position_on_the_meridian_of_180_degrees_stays_there() {
    let at = |longitude: f64| values::<Position>(&[0.5, longitude, -3.0]);
    assert_eq!(retract::<Position>(&at(PI), &[0.0; 3]), at(PI));
    for (from, east) in [(PI, 1.0), (1e-6 - PI, -100.0)] {
        let moved = retract::<Position>(&at(from), &[0.0, east, 0.0])[1];
        assert!(moved * from < 0.0 && moved.abs() <= PI, "{moved}");
    }
}

/// Across a pole a displacement leads to the meridian of the other side, and back: the rounding of an
/// angle of 1.57 is 1 nm. A direction that is carried along turns by `tan(L) / R` for each metre to the
/// east, to first order, and by half a turn across the pole.
#[test]
fn a_position_moves_across_a_pole_and_back() {
    for sign in [1.0, -1.0] {
        for from_pole in [1e-3, 1.0, 30.0, 2e4] {
            let (_, r_e) = radii_of_curvature(FRAC_PI_2);
            let latitude = sign * (FRAC_PI_2 - from_pole / r_e);
            let here = Geodetic { latitude, longitude: 0.7, height: -20.0 };
            for moved in [[2.0, 3.0], [-700.0, 20.0], [2.0 * from_pole * sign, 0.0], [0.0, 5.0]] {
                let moved = Vector3::new(moved[0], moved[1], 4.0);
                let there = here.displaced(&moved);
                let back = there.ned_from(&here);
                assert!((back - moved).norm() < 3e-8, "{from_pole}: {moved} {back}");
                // the chord is as long, but for the curvature over 40 km
                let chord = (there.earth_fixed() - here.earth_fixed()).norm();
                assert!((chord / moved.norm() - 1.0).abs() < 1e-5, "{from_pole}: {chord} {moved}");
            }
            let across = here.displaced(&Vector3::new(2.0 * from_pole * sign, 0.0, 0.0));
            let turned = [across.longitude - here.longitude, here.turn_to(&across)];
            assert!(turned.iter().all(|t| (t.abs() - PI).abs() < 1e-5), "{turned:?}");
            let east = here.displaced(&Vector3::new(0.0, 1e-4 * from_pole, 0.0));
            let turn = here.turn_to(&east) * r_e / (1e-4 * from_pole * latitude.tan());
            // rounding of the longitude of 1e-4 rad, and the second order
            assert!((turn - 1.0).abs() < 1e-5, "{from_pole}: {turn}");
        }
    }
}
