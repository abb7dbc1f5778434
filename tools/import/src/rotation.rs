//! Rotations of an instrument in its vehicle.

/// A rotation, row by row.
pub type Rotation = [[f64; 3]; 3];

pub fn product(a: &Rotation, b: &Rotation) -> Rotation {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The rotation of axes by their names, if they form a right-handed set.
pub fn of_axes(names: &[String; 3]) -> Option<Rotation> {
    let row = |name: &String| -> [f64; 3] {
        let sign = if name.starts_with('-') { -1.0 } else { 1.0 };
        ["x", "y", "z"].map(|axis| if name.ends_with(axis) { sign } else { 0.0 })
    };
    let [a, b, c] = names.each_ref().map(row);
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    (cross == c).then_some([a, b, c])
}

/// The turn about the vertical, positive from x to y.
pub fn about_down(angle: f64) -> Rotation {
    let (sin, cos) = angle.sin_cos();
    [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
}

/// The smallest rotation that makes the mean of the specific force point up, and its angle.
pub fn levelling(force: [f64; 3]) -> Option<(Rotation, f64)> {
    let norm = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    let [x, y, z] = force.map(|f| f / norm);
    // Rodrigues' formula for the axis u x (0, 0, -1), whose cosine is -z
    let (cos, axis) = (-z, [-y, x]);
    let (sin, k) = (axis[0].hypot(axis[1]), 1.0 / (1.0 + cos));
    let [a, b] = axis;
    let turn = [[cos + a * a * k, a * b * k, b], [a * b * k, cos + b * b * k, -a], [-b, a, cos]];
    (norm > 0.0 && cos > -0.99).then(|| (turn, sin.atan2(cos)))
}

/// Roll, pitch and yaw of a rotation, deg.
pub fn degrees(r: &Rotation) -> [f64; 3] {
    let (roll, pitch) = (r[2][1].atan2(r[2][2]), (-r[2][0]).clamp(-1.0, 1.0).asin());
    [roll, pitch, r[1][0].atan2(r[0][0])].map(f64::to_degrees)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    fn turned(r: &Rotation, v: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| (0..3).map(|k| r[i][k] * v[k]).sum())
    }

    #[test]
    fn a_levelled_force_points_up_and_the_turn_is_the_smallest() {
        for force in [[0.0, 0.0, -9.8], [4.9, 0.0, -8.5], [3.0, -4.0, -5.0], [0.0, 9.8, 0.5]] {
            let (rotation, angle) = levelling(force).unwrap();
            let norm = force.iter().map(|f| f * f).sum::<f64>().sqrt();
            let level = turned(&rotation, force);
            assert!(level[0].hypot(level[1]) < 1e-12 && (level[2] + norm).abs() < 1e-12);
            assert!((angle - (-force[2] / norm).acos()).abs() < 1e-12);
            // orthonormal
            let square = product(&rotation, &std::array::from_fn(|i| rotation.map(|row| row[i])));
            let identity = about_down(0.0);
            assert!(
                square
                    .iter()
                    .flatten()
                    .zip(identity.iter().flatten())
                    .all(|(a, b)| (a - b).abs() < 1e-12)
            );
        }
    }

    #[test]
    fn axes_and_angles_are_rotations() {
        let names = ["y", "x", "-z"].map(str::to_owned);
        assert_eq!(of_axes(&names).unwrap(), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        assert_eq!(of_axes(&["x", "-y", "z"].map(str::to_owned)), None);
        let angles = degrees(&about_down(0.5));
        assert!((angles[2] - 0.5_f64.to_degrees()).abs() < 1e-12 && angles[0] == 0.0);
    }
}
