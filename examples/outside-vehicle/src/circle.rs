//! A manifold: the directions of a plane, as an angle that wraps.

use navfuse_core::prelude::*;
use std::f64::consts::PI;

// ANCHOR: circle
/// An angle in (-pi, pi]; the error is the shorter arc of the circle.
pub struct Circle;

impl Manifold for Circle {
    const AMBIENT: usize = 1;
    const TANGENT: usize = 1;
    const READING: Reading = Reading::Angles;
    type Value<T: Real> = T;

    fn load<T: Real>(ambient: &[f64]) -> T {
        convert(ambient[0])
    }
    fn store(value: &f64, ambient: &mut [f64]) {
        ambient[0] = wrap(*value);
    }
    fn retract<T: Real>(x: &T, delta: &[T]) -> T {
        *x + delta[0]
    }
    fn local(to: &f64, from: &f64, delta: &mut [f64]) {
        delta[0] = wrap(to - from);
    }
    fn coordinates<T: Real>(x: &T, out: &mut [T]) {
        out[0] = *x;
    }
    fn from_coordinates(coordinates: &[f64]) -> f64 {
        wrap(coordinates[0])
    }
}

fn wrap(angle: f64) -> f64 {
    PI - (PI - angle).rem_euclid(2.0 * PI)
}
// ANCHOR_END: circle
