//! Tests of the injection, its reset, and the error of an estimate.

#![allow(clippy::expect_used, reason = "a test fails by panicking")]
use super::*;
use crate::compose::Composer;
use crate::model::simulate::Random;
use crate::state::covariance::Update;
use crate::state::display;
use crate::state::manifold::{Position, Rotation, Vector};
use crate::state::{BlockSpec, Display, Dynamics, Mode};
use crate::units::time::Time;
use nalgebra::{DMatrix, Rotation3, Vector6};

/// Attitude, velocity and position; the velocity turns with the attitude or does not.
fn layout(turns: bool) -> Layout {
    let mut composer = Composer::default();
    composer.begin("ins");
    let spec = |display: Display| BlockSpec {
        mode: Mode::Estimate,
        initial: vec![0.0; 3],
        sigma: vec![1.0; 3],
        truth: None,
        dynamics: Dynamics::Constant,
        display,
    };
    let attitude = composer.block::<Rotation>("attitude", spec(display::ANGLES)).expect("a block");
    let velocity =
        composer.block::<Vector<3>>("velocity", spec(display::VELOCITY)).expect("a block");
    composer.block::<Position>("position", spec(display::POSITION)).expect("a block");
    if turns {
        composer.turns_with_heading(velocity, attitude);
    }
    composer.finish().0
}

fn displaced(layout: &Layout, state: &State, random: &mut Random, sizes: [f64; 3]) -> State {
    let mut moved = state.clone();
    moved.time = Time::default();
    for (block, size) in layout.blocks.iter().zip(sizes) {
        let delta: Vec<f64> = (0..3).map(|_| size * random.normal()).collect();
        (block.operations.retract)(&mut moved.values[block.range()], &delta);
    }
    moved
}

#[test]
fn injecting_the_error_of_an_estimate_gives_the_truth() {
    let layout = layout(true);
    let mut random = Random::new(1, "turning");
    for _ in 0..200 {
        let start = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        let mut estimate = displaced(&layout, &start, &mut random, [0.3, 5.0, 1e3]);
        let truth = displaced(&layout, &estimate, &mut random, [0.4, 3.0, 200.0]);
        let mut delta = [0.0; 9];
        layout.error(&truth, &estimate, &[true; 3], &mut delta);
        let mut covariance = Covariance::zero(9);
        (0..9).for_each(|i| covariance.set(i, i, 1.0));
        layout.inject(&mut estimate, &mut delta, &mut covariance);
        let mut left = [0.0; 9];
        layout.error(&truth, &estimate, &[true; 3], &mut left);
        // rounding of a position of 6e6 m in radians is 1e-9 m
        assert!(left.iter().all(|e| e.abs() < 1e-8), "{left:?}");
    }
}

/// A correction leaves a considered attitude, and with it the axes of the velocity's error.
#[test]
fn a_velocity_does_not_turn_with_a_considered_heading() {
    let mut layout = layout(true);
    layout.blocks[0].spec.mode = Mode::Consider;
    let mut random = Random::new(6, "turning");
    let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
    let mut covariance = Covariance::zero(9);
    (0..9).for_each(|i| (0..=i).for_each(|j| covariance.set(i, j, random.normal())));
    let (before, velocity) = (covariance.to_dense(), layout.blocks[1].range());
    let start = state.values[velocity.clone()].to_vec();
    let mut delta = [0.0; 9];
    delta[3..6].copy_from_slice(&[1.0, -2.0, 3.0]);
    layout.inject(&mut state, &mut delta, &mut covariance);
    let moved = state.values[velocity].iter().zip(start).map(|(after, before)| after - before);
    assert!(moved.zip([1.0, -2.0, 3.0]).all(|(moved, d)| (moved - d).abs() < 1e-14));
    let after = covariance.to_dense();
    assert_eq!(after.view((0, 0), (6, 6)), before.view((0, 0), (6, 6)));
}

#[test]
fn what_is_carried_beside_the_covariance_stays_its_factor() {
    let layout = layout(true);
    let mut random = Random::new(4, "turning");
    for _ in 0..50 {
        let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        // G G' = P, after a heading correction of some 10 degrees as before
        let mut g: Vec<f64> = (0..9 * 9).map(|_| random.normal()).collect();
        let product = |g: &[f64], i: usize, j: usize| {
            (0..9).map(|k| g[i * 9 + k] * g[j * 9 + k]).sum::<f64>()
        };
        let mut covariance = Covariance::zero(9);
        for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
            covariance.set(i, j, product(&g, i, j));
        }
        let mut delta: Vec<f64> = (0..9).map(|_| 0.2 * random.normal()).collect();
        layout.inject(&mut state, &mut delta, &mut covariance);
        layout.reset_rows(&delta, &mut g, 9);
        for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
            let (p, of_g) = (covariance.get(i, j), product(&g, i, j));
            // rounding of elements of some 100
            assert!((p - of_g).abs() < 1e-11, "{i} {j}: {p} {of_g}");
        }
    }
}

#[test]
fn a_displaced_state_is_the_injected_one_and_its_columns_are_reset_as_the_covariance_is() {
    let layout = layout(true);
    let mut random = Random::new(5, "turning");
    for _ in 0..50 {
        let state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        let mut delta: Vec<f64> = (0..9).map(|_| 0.3 * random.normal()).collect();
        let (mut injected, mut moved, mut by) = (state.clone(), state.clone(), delta.clone());
        layout.displace(&state, &mut by, &mut moved);
        layout.inject(&mut injected, &mut delta, &mut Covariance::zero(9));
        assert_eq!((&moved, &by), (&injected, &delta));
        // rows of the identity become rows of the reset G, in any order of the columns
        let identity: Vec<f64> = (0..81).map(|k| f64::from(k % 10 == 0)).collect();
        let (mut g, columns) = (identity.clone(), [3, 4, 5, 0, 1, 2, 6, 7, 8]);
        layout.reset_rows(&delta, &mut g, 9);
        let mut h: Vec<f64> = (0..81).map(|k| identity[k / 9 * 9 + columns[k % 9]]).collect();
        layout.reset_columns(&delta, &columns, &mut h);
        let apart = (0..81).map(|k| (h[k] - g[k / 9 * 9 + columns[k % 9]]).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-15);
    }
}

#[test]
fn a_small_error_is_that_of_each_block() {
    let (turning, plain) = (layout(true), layout(false));
    let mut random = Random::new(2, "turning");
    let estimate = displaced(&turning, &turning.initial_state(), &mut random, [1.0, 5.0, 1e3]);
    let truth = displaced(&turning, &estimate, &mut random, [1e-6, 1e-6, 1e-6]);
    let (mut a, mut b) = ([0.0; 9], [0.0; 9]);
    turning.error(&truth, &estimate, &[true; 3], &mut a);
    plain.error(&truth, &estimate, &[true; 3], &mut b);
    // they differ by half the squared angle times 5 m/s, or times 1 km
    let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 0.5 * 1e-11 * 3e3, "{worst}");
}

/// `D` of `xi = D delta` at an estimate: the derivative of (31a) by an additive error.
fn to_group(layout: &Layout, state: &State) -> DMatrix<f64> {
    let v = |state: &State| Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
    let xi = |j: usize, h: f64| {
        let (mut moved, mut step, psi) = (state.clone(), [0.0; 3], Vector3::z() * h);
        step[j % 3] = h;
        let block = &layout.blocks[j / 3];
        (block.operations.retract)(&mut moved.values[block.range()], &step);
        let psi = if j == 2 { psi } else { Vector3::zeros() };
        let (change, jacobian) = turn(&psi);
        jacobian.try_inverse().expect("a small turn") * (v(&moved) - v(state) - change * v(state))
    };
    let mut d = DMatrix::identity(9, 9);
    for j in 0..6 {
        let slope = (xi(j, 1e-4) - xi(j, -1e-4)) / 2e-4;
        d.view_mut((3, j), (3, 1)).copy_from(&slope);
    }
    d
}

#[test]
fn the_covariance_is_transformed_at_a_constant_error_in_the_group() {
    let layout = layout(true);
    let mut random = Random::new(7, "turning");
    for _ in 0..20 {
        let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 1e3]);
        let root = DMatrix::from_fn(9, 9, |_, _| random.normal());
        let mut covariance = Covariance::zero(9);
        let p = &root * root.transpose();
        (0..9).for_each(|i| (0..=i).for_each(|j| covariance.set(i, j, p[(i, j)])));
        let mut delta: Vec<f64> = (0..9).map(|_| 0.4 * random.normal()).collect();
        let phi = Vector3::from_column_slice(&delta[..3]);
        let before = to_group(&layout, &state);
        layout.inject(&mut state, &mut delta, &mut covariance);
        let after = to_group(&layout, &state).try_inverse().expect("D is unipotent");
        let mut g = DMatrix::identity(9, 9);
        g.view_mut((0, 0), (3, 3)).copy_from(&left_jacobian(&phi));
        g *= after * before;
        // xi is linear in both errors: rounding of some 10, over the step of 1e-4, in P of some 10
        let apart = (&g * p * g.transpose() - covariance.to_dense()).amax();
        assert!(apart < 1e-8, "{apart}");
    }
}

/// The heading's variance after many velocities in body axes, each of which moves the estimate,
/// relative to the prior.
fn after_body_velocities(turns: bool) -> f64 {
    let layout = layout(turns);
    let mut random = Random::new(3, "turning");
    let mut state = displaced(&layout, &layout.initial_state(), &mut random, [1.0, 5.0, 0.0]);
    let mut covariance = Covariance::zero(9);
    // psi and xi unrelated, so that delta = xi + psi x v; the tilt is known
    let v = Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
    let phi = Matrix3::from_diagonal(&Vector3::new(1e-12, 1e-12, 0.04));
    let turned = Vector3::z().cross(&v);
    let mut cross = Matrix3::zeros();
    cross.set_column(2, &(turned * 0.04));
    let velocity = Matrix3::from_diagonal_element(0.25) + turned * turned.transpose() * 0.04;
    for i in 0..3 {
        for j in 0..3 {
            covariance.set(i, j, phi[(i, j)]);
            covariance.set(3 + i, j, cross[(i, j)]);
            covariance.set(3 + i, 3 + j, velocity[(i, j)]);
        }
        covariance.set(6 + i, 6 + i, 1.0);
    }
    let mut update = Update::with_capacity(9, 3);
    for _ in 0..50 {
        let c = Rotation3::from_matrix_unchecked(*state.get(&layout, handle(&layout)).matrix());
        let v = Vector3::from_column_slice(&state.values[layout.blocks[1].range()]);
        let to_body = *c.inverse().matrix();
        let h = [to_body * v.cross_matrix(), to_body];
        update.m = 3;
        update.columns = (0..6).collect();
        update.h =
            (0..3).flat_map(|i| h.map(|h| [h[(i, 0)], h[(i, 1)], h[(i, 2)]]).concat()).collect();
        update.innovation = (0..3).map(|_| 0.5 * random.normal()).collect();
        update.r = DMatrix::from_diagonal_element(3, 3, 0.01).as_slice().to_vec();
        update.innovate(&covariance).expect("S is positive definite");
        update.apply(&mut covariance, &[false; 9]);
        layout.inject(&mut state, &mut update.delta, &mut covariance);
    }
    let sum: Vector6<f64> = Vector6::from_fn(|i, _| covariance.get(i, i));
    sum[2] / 0.04
}

fn handle(layout: &Layout) -> crate::state::Handle<Rotation> {
    assert_eq!(layout.blocks[0].name, "ins.attitude");
    crate::state::Handle { slot: 0, manifold: std::marker::PhantomData }
}

#[test]
fn a_velocity_in_body_axes_never_tells_the_heading() {
    let kept = after_body_velocities(true);
    // the effect of a tilt of 1e-6 rad is of second order
    assert!((kept - 1.0).abs() < 1e-6, "{kept}");
    // without the turning error the same updates make the filter overconfident
    let pretended = after_body_velocities(false);
    assert!(pretended < 0.5, "{pretended}");
}
