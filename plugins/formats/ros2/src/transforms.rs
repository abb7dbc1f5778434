//! The frames of `/tf_static`: where the sensors are on the vehicle.

use crate::axes::flip;
use crate::cdr::{Body, Cursor, body};
use crate::error::MessageError;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use navfuse_frames::Number;
use std::collections::BTreeMap;

/// Largest number of frames, and of frames above each other.
const MOST: usize = 4096;
const DEEPEST: usize = 64;

/// The frames of a bag, each with its pose in the frame above.
#[derive(Clone, Debug, Default)]
pub struct Transforms(BTreeMap<String, (String, Isometry3<f64>)>);

/// The place of a sensor on the vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mounting {
    /// Position from the origin of the vehicle's frame along forward, right, down, m.
    pub position: [f64; 3],
    /// Roll, pitch and yaw, rad, of the sensor's axes in those of the vehicle; both along forward,
    /// right, down.
    pub rotation: [f64; 3],
}

impl Transforms {
    /// Takes a message of type `tf2_msgs/TFMessage`.
    pub(crate) fn take(&mut self, message: &[u8]) -> Result<(), MessageError> {
        match body(message)? {
            Body::Little(body) => self.read(&mut Cursor::<true>::new(body)),
            Body::Big(body) => self.read(&mut Cursor::<false>::new(body)),
            Body::Packed(body) => self.read(&mut Cursor::<true>::packed(body)),
        }
    }

    fn read<const LITTLE: bool>(
        &mut self,
        at: &mut Cursor<'_, LITTLE>,
    ) -> Result<(), MessageError> {
        for _ in 0..at.count()? {
            at.stamp()?;
            let frame =
                |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_start_matches('/').to_owned();
            let (above, own) = (frame(at.text()?), frame(at.text()?));
            let mut numbers = [0.0; 7];
            for number in &mut numbers {
                *number = at.number(Number::F64)?;
            }
            let [x, y, z, i, j, k, w] = numbers;
            let q = Quaternion::new(w, i, j, k);
            let usable = (q.norm() - 1.0).abs() < 0.01 && numbers.iter().all(|n| n.is_finite());
            if usable && (self.0.len() < MOST || self.0.contains_key(&own)) {
                let rotation = UnitQuaternion::from_quaternion(q);
                let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
                self.0.insert(own, (above, pose));
            }
        }
        Ok(())
    }

    /// Tests whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Tests whether a frame is known, below or above others.
    pub fn has(&self, frame: &str) -> bool {
        self.0.contains_key(frame) || self.0.values().any(|(above, _)| above == frame)
    }

    /// The pose of a frame in the topmost one, with the name of that.
    fn in_top<'a>(&'a self, frame: &'a str) -> (&'a str, Isometry3<f64>) {
        let (mut name, mut pose) = (frame, Isometry3::identity());
        for _ in 0..DEEPEST {
            let Some((above, own)) = self.0.get(name) else { break };
            (name, pose) = (above, own * pose);
        }
        (name, pose)
    }

    /// The place of a frame on the vehicle, whose own frame is `base`; `None` if nothing connects
    /// them. With `marine`, the frame's axes are forward, right, down, otherwise forward, left, up.
    pub fn mounting(&self, base: &str, frame: &str, marine: bool) -> Option<Mounting> {
        let frame = frame.trim_start_matches('/');
        let ((top, base), (other, pose)) = (self.in_top(base), self.in_top(frame));
        if top != other {
            return None;
        }
        let pose = base.inverse() * pose;
        // with F from `flip`: C = F R of a frame forward, right, down, F R F of another one
        let turn =
            UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI);
        let c = if marine { turn * pose.rotation } else { turn * pose.rotation * turn };
        let (roll, pitch, yaw) = c.euler_angles();
        let position: [f64; 3] = pose.translation.vector.into();
        Some(Mounting { position: flip(position), rotation: [roll, pitch, yaw] })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    fn message(frames: &[(&str, &str, [f64; 7])]) -> Vec<u8> {
        let mut out = vec![0, 1, 0, 0];
        let align = |out: &mut Vec<u8>, to: usize| {
            let length = (out.len() - 4).next_multiple_of(to);
            out.resize(4 + length, 0);
        };
        out.extend((frames.len() as u32).to_le_bytes());
        for (above, own, numbers) in frames {
            align(&mut out, 4);
            out.extend([0; 8]);
            for name in [above, own] {
                align(&mut out, 4);
                out.extend((name.len() as u32 + 1).to_le_bytes());
                out.extend(name.as_bytes());
                out.push(0);
            }
            align(&mut out, 8);
            numbers.iter().for_each(|n| out.extend(n.to_le_bytes()));
        }
        out
    }

    #[test]
    fn frames_above_each_other_give_the_place_of_a_sensor() {
        let half = 0.5_f64.sqrt();
        let mut frames = Transforms::default();
        let bytes = message(&[
            ("base_link", "mast", [1.0, 2.0, 3.0, 0.0, 0.0, half, half]), // turned left by 90 deg
            ("mast", "antenna", [0.5, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]),
            ("base_link", "dvl", [0.0, 0.0, -0.4, 1.0, 0.0, 0.0, 0.0]), // looks down
            ("other", "alone", [0.0; 7]),
        ]);
        frames.take(&bytes).unwrap();
        let antenna = frames.mounting("base_link", "antenna", false).unwrap();
        for (found, expected) in antenna.position.iter().zip([1.0, -2.5, -3.1]) {
            assert!((found - expected).abs() < 1e-12, "{antenna:?}");
        }
        // to the left is -90 degrees about down
        assert!((antenna.rotation[2] + 90_f64.to_radians()).abs() < 1e-12, "{antenna:?}");
        let dvl = frames.mounting("base_link", "dvl", true).unwrap();
        assert!(dvl.rotation.iter().all(|angle| angle.abs() < 1e-12), "{dvl:?}");
        assert_eq!(dvl.position, [0.0, 0.0, 0.4]);
        assert_eq!(frames.mounting("base_link", "nothing", false), None);
        assert!(!frames.has("alone"), "a quaternion that is no rotation is left out");
        for end in 0..bytes.len() {
            assert!(Transforms::default().take(&bytes[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn frames_in_a_circle_have_an_end() {
        let mut frames = Transforms::default();
        let level = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        frames.take(&message(&[("a", "b", level), ("b", "a", level)])).unwrap();
        let _ = frames.mounting("a", "b", false);
    }
}
