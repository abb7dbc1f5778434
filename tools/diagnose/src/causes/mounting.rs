//! A driving unit that is turned in the body by any angle.

use crate::patch::{Patch, Uncertain, about, path, widened};
use crate::scene::{Instrument, Scene};
use navfuse_core::plugin::Kind;
use navfuse_core::run::schema::parameters;

/// Key of the state.
const KEY: &str = "mounting";
const SIGMA: &str = "10 deg";
/// Yaws about the vertical that the forces show, deg: each reaches half-way to the next.
const YAWS: [i32; 12] = [-150, -120, -90, -60, -30, 0, 30, 60, 90, 120, 150, 180];
/// Largest angle, deg: the state is infinite at half a turn.
const LARGEST: f64 = 165.0;

/// The mean force of a vehicle points up: it gives the tilt of the unit, and no yaw.
pub(super) fn turned(scene: &Scene<'_>, sensor: &Instrument) -> Vec<Patch> {
    let name = sensor.info.name.as_str();
    let entry = scene.registry.get(Kind::Sensor, &sensor.info.kind);
    if !entry.is_some_and(|entry| parameters(entry).iter().any(|p| p.key == KEY)) {
        return Vec::new();
    }
    let Some(up) = mean_force(scene, sensor) else { return Vec::new() };
    let (path, sigma) = (path(Kind::Sensor, name, KEY), format!("\"{SIGMA}\""));
    let near = |yaw: &i32| {
        let vector = vector(up, f64::from(*yaw).to_radians())?;
        let [x, y, z] = vector.map(|v| format!("{:.1} deg", v.to_degrees()));
        let initial = format!("[\"{x}\", \"{y}\", \"{z}\"]");
        let settings = about(&widened(scene.document, &path, &sigma), &path, &initial, &sigma);
        Some(Patch {
            state: Some(Uncertain {
                name: format!("{name}.{KEY}"),
                path: path.clone(),
                sigma: SIGMA.to_owned(),
            }),
            parameters: 3,
            choices: (YAWS.len() as f64).ln(),
            ..Patch::new(format!("{name}: mounting near {x}, {y}, {z}"), settings)
        })
    };
    YAWS.iter().filter_map(near).collect()
}

/// Direction of the mean specific force in the axes of the unit.
fn mean_force(scene: &Scene<'_>, sensor: &Instrument) -> Option<[f64; 3]> {
    let at = |end: &str| {
        let of = |name: &str| name.starts_with("accel") || name.starts_with("dvel");
        (0..sensor.info.channels.len())
            .find(|k| of(sensor.info.channel(*k)) && sensor.info.channel(*k).ends_with(end))
    };
    let channels = [at("_x")?, at("_y")?, at("_z")?];
    let mut sum = [0.0; 3];
    for sample in scene.recording.of(&sensor.info.name) {
        for (sum, channel) in sum.iter_mut().zip(channels) {
            *sum += sample.get(channel).filter(|value| value.is_finite()).unwrap_or(0.0);
        }
    }
    let length = sum.iter().map(|s| s * s).sum::<f64>().sqrt();
    (length > 0.0).then(|| sum.map(|s| s / length))
}

/// The vector `2 tan(angle / 2) axis` of the rotation that turns `up` to the vertical of the body, and then by
/// a yaw; `None` near half a turn.
fn vector(up: [f64; 3], yaw: f64) -> Option<[f64; 3]> {
    // quaternion of the shortest turn of `up` to (0, 0, -1), then of the yaw: its vector over its scalar
    // is tan(angle / 2) times the axis
    let (w, x, y) = (1.0 - up[2], -up[1], up[0]);
    let (c, s) = ((0.5 * yaw).cos(), (0.5 * yaw).sin());
    let turned = [c * w, c * x - s * y, c * y + s * x, s * w];
    let length = turned.iter().map(|q| q * q).sum::<f64>().sqrt();
    let angle = 2.0 * (turned[0].abs() / length).acos();
    (angle.to_degrees() < LARGEST).then(|| [1, 2, 3].map(|k| 2.0 * turned[k] / turned[0]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    }

    /// C(m) v of the reference of the IMU.
    fn turned(m: [f64; 3], v: [f64; 3]) -> [f64; 3] {
        let p = m.map(|m| m / 2.0);
        let once = cross(p, v);
        let twice = cross(p, once);
        let square: f64 = p.iter().map(|p| p * p).sum();
        [0, 1, 2].map(|k| v[k] + 2.0 * (once[k] + twice[k]) / (1.0 + square))
    }

    #[test]
    fn the_mounting_turns_the_mean_force_up() {
        let up = [0.48, -0.64, -0.6];
        for yaw in [-2.0, 0.0, 0.7] {
            let m = vector(up, yaw).unwrap();
            let body = turned(m, up);
            let off = [body[0], body[1], body[2] + 1.0];
            assert!(off.iter().all(|off| off.abs() < 1e-12), "{yaw}: {body:?}");
        }
        assert!(vector([0.0, 0.0, 1.0], 0.0).is_none());
        assert_eq!(vector([0.0, 0.0, -1.0], 0.0), Some([0.0; 3]));
    }
}
