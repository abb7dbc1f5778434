//! Rule: over a while, the specific force is about as large as gravity and points up.

use super::fault::Fault;
use crate::earth::normal_gravity;
use crate::navigation::Navigation;
use nalgebra::Vector3;
use navfuse_core::checkpoint::saved;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Basis, Severity};

/// Time over which the first mean is taken, s: short, since wrong samples move the attitude with
/// which they are compared.
const FIRST: f64 = 1.0;
/// Time over which later means are taken, s.
const LATER: f64 = 10.0;
/// Plausible ratios of the mean specific force to gravity: a vehicle that keeps 2 g for ten seconds
/// is a fighter or a rocket, one that keeps half of it falls.
const PLAUSIBLE: std::ops::Range<f64> = 0.5..2.0;
/// Standard gravity, m/s^2, which is 1 g.
const STANDARD: f64 = 9.80665;
/// Largest prior sigma of roll and pitch for a comparison of directions, rad: 10 deg.
const TILT: f64 = 0.17;
/// Angle between the specific force and the vertical that is no motion, rad: 60 deg, as by a
/// horizontal acceleration of 17 m/s^2.
const ANGLE: f64 = 1.05;

/// Mean specific force.
#[derive(Clone)]
pub(super) struct Gravity {
    /// Up in body axes at the first sample, where roll and pitch are known.
    up: Option<Vector3<f64>>,
    tilt: Option<f64>,
    sum: Vector3<f64>,
    time: f64,
    first: bool,
    reported: bool,
}

saved!(Gravity { up, sum, time, first, reported } except { tilt });

impl Gravity {
    pub(super) fn new(tilt: Option<f64>) -> Self {
        let sum = Vector3::zeros();
        Self { up: None, tilt, sum, time: 0.0, first: true, reported: false }
    }

    #[inline]
    pub(super) fn take(
        &mut self,
        filter: &FilterView<'_>,
        navigation: &Navigation,
        f: &Vector3<f64>,
        dt: f64,
    ) -> Option<Fault> {
        if self.reported {
            return None;
        }
        if self.time == 0.0 && self.first && self.tilt.is_some_and(|tilt| tilt < TILT) {
            let c_b_n = filter.state.get(filter.layout, navigation.attitude);
            self.up = Some(c_b_n.inverse() * Vector3::new(0.0, 0.0, -1.0));
        }
        self.sum += f * dt;
        self.time += dt;
        if self.time < if self.first { FIRST } else { LATER } {
            return None;
        }
        let mean = self.sum / self.time;
        let up = self.up.take();
        (self.sum, self.time, self.first) = (Vector3::zeros(), 0.0, false);
        let p = filter.state.get(filter.layout, navigation.position);
        let fault = judge(&mean, up, normal_gravity(p.latitude, p.height));
        self.reported = fault.is_some();
        fault
    }
}

fn judge(mean: &Vector3<f64>, up: Option<Vector3<f64>>, gravity: f64) -> Option<Fault> {
    let (size, ratio) = (mean.norm(), mean.norm() / gravity);
    let (severity, basis) = (Severity::DoNotUse, Basis::Samples);
    let fault = |text, remedy| Some(Fault { severity, basis, text, remedy });
    if !PLAUSIBLE.contains(&ratio) {
        let text = format!(
            "the mean specific force is {size:.3} m/s^2, where gravity is {gravity:.3} m/s^2"
        );
        return if (0.8..1.25).contains(&(ratio * STANDARD)) {
            fault(
                text + ": the samples are in g",
                "convert the accelerometers to m/s^2, or name their columns with the unit, such \
                 as accel_x_g",
            )
        } else {
            fault(text, "check the unit and the scale of the accelerometers")
        };
    }
    let angle = up.map_or(0.0, |up| mean.angle(&up));
    if angle <= ANGLE {
        return None;
    }
    let text = format!(
        "the specific force is {:.0} deg off the vertical of the initial attitude",
        angle.to_degrees()
    );
    if angle > std::f64::consts::PI - ANGLE {
        fault(
            text + ": it points down",
            "change the sign of the accelerometers: at rest and level, accel_z reads -9.8 m/s^2; \
             check that the axes are forward, right, down",
        )
    } else {
        fault(
            text,
            "check that the axes of the IMU are forward, right, down, and the initial roll and pitch",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.81;

    fn text(mean: [f64; 3], up: Option<[f64; 3]>) -> String {
        judge(&mean.into(), up.map(Vector3::from), G).map_or_else(String::new, |fault| fault.text)
    }

    #[test]
    fn a_vehicle_that_manoeuvres_is_no_fault() {
        // 0.51 g and 1.99 g in any direction without a known attitude, and 59 deg off the vertical
        for size in [0.51 * G, G, 1.99 * G] {
            assert_eq!(text([size, 0.0, 0.0], None), "");
            assert_eq!(text([0.0, 0.0, -size], Some([0.0, 0.0, -1.0])), "");
        }
        let (sin, cos) = 59_f64.to_radians().sin_cos();
        assert_eq!(text([G * sin, 0.0, -G * cos], Some([0.0, 0.0, -1.0])), "");
    }

    #[test]
    fn a_specific_force_that_is_not_gravity_is_named_by_its_unit() {
        for size in [0.49 * G, 2.01 * G, 0.0, 96.2] {
            let text = text([0.0, size, 0.0], None);
            assert!(
                text.contains(&format!("{size:.3} m/s^2")) && !text.contains(" in g"),
                "{text}"
            );
        }
        // 0.82 to 1.2 g as a number; 0.98 g is 1 g of the place in units of 9.807 m/s^2
        for size in [0.82, 1.0, 1.2] {
            assert!(text([0.0, 0.0, -size], None).ends_with("the samples are in g"), "{size}");
        }
        assert!(!text([0.0, 0.0, -0.79], None).contains("in g"));
        assert!(!text([0.0, 0.0, -1.3], None).contains("in g"));
    }

    #[test]
    fn a_wrong_direction_is_named_by_its_angle_and_upside_down_as_such() {
        let off = |degrees: f64| {
            let (sin, cos) = degrees.to_radians().sin_cos();
            text([0.0, G * sin, -G * cos], Some([0.0, 0.0, -1.0]))
        };
        assert!(off(61.0).contains("61 deg off") && !off(61.0).contains("down"));
        assert!(off(90.0).contains("90 deg off") && !off(90.0).contains("down"));
        assert!(off(119.0).contains("119 deg off") && !off(119.0).contains("down"));
        assert!(off(121.0).contains("points down") && off(180.0).contains("points down"));
    }
}
