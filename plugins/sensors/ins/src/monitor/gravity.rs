//! Rule: over a while, the specific force is about as large as gravity and points up.
//!
//! A vehicle that accelerates has another specific force, `f = a - g`. So the mean is compared with
//! gravity and the acceleration that other sensors confirm: the change of the velocity between two
//! corrections that no sensor contradicts. Wrong samples confirm nothing, since they move the
//! velocity away from the other sensors.

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

/// Least share of the time of a mean that two corrections have to span.
const SPANNED: f64 = 0.5;

/// Velocity in navigation axes that a correction left, m/s, and its time, s, since the mean began.
type Confirmed = (f64, Vector3<f64>);

/// Mean specific force.
#[derive(Clone)]
pub(super) struct Gravity {
    /// Up in body axes at the first sample, where roll and pitch are known.
    up: Option<Vector3<f64>>,
    tilt: Option<f64>,
    /// First and last correction since the mean began.
    confirmed: Option<(Confirmed, Confirmed)>,
    sum: Vector3<f64>,
    time: f64,
    first: bool,
    reported: bool,
}

saved!(Gravity { up, confirmed, sum, time, first, reported } except { tilt });

impl Gravity {
    pub(super) fn new(tilt: Option<f64>) -> Self {
        let sum = Vector3::zeros();
        let confirmed = None;
        Self { up: None, tilt, confirmed, sum, time: 0.0, first: true, reported: false }
    }

    /// Takes the velocity after a correction that no sensor contradicts.
    pub(super) fn corrected(&mut self, velocity: &Vector3<f64>) {
        let now = (self.time, *velocity);
        self.confirmed = Some((self.confirmed.map_or(now, |(first, _)| first), now));
    }

    /// Acceleration in navigation axes that the corrections confirm since the mean began.
    fn acceleration(&self) -> Option<Vector3<f64>> {
        let ((from, before), (to, after)) = self.confirmed?;
        (to - from >= SPANNED * self.time).then(|| (after - before) / (to - from))
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
        let (up, acceleration) = (self.up.take(), self.acceleration());
        self.confirmed =
            self.confirmed.map(|(_, (_, velocity))| ((0.0, velocity), (0.0, velocity)));
        (self.sum, self.time, self.first) = (Vector3::zeros(), 0.0, false);
        let p = filter.state.get(filter.layout, navigation.position);
        let gravity = normal_gravity(p.latitude, p.height);
        if acceleration.is_some_and(|a| explains(&a, gravity, mean.norm())) {
            return None;
        }
        let fault = judge(&mean, up, gravity);
        self.reported = fault.is_some();
        fault
    }
}

/// Returns `true` if the acceleration leaves the range that is plausible at rest, and the size of
/// the mean specific force is that of `a - g`, to half of it or of gravity.
fn explains(acceleration: &Vector3<f64>, gravity: f64, size: f64) -> bool {
    let expected = (acceleration - Vector3::new(0.0, 0.0, gravity)).norm();
    let accelerates = acceleration.norm() > PLAUSIBLE.start * gravity;
    accelerates && (size - expected).abs() <= 0.5 * expected.max(gravity)
}

fn judge(mean: &Vector3<f64>, up: Option<Vector3<f64>>, gravity: f64) -> Option<Fault> {
    let (size, ratio) = (mean.norm(), mean.norm() / gravity);
    let (severity, basis) = (Severity::DoNotUse, Basis::Samples);
    let fault =
        |text, remedy: &str| Some(Fault { severity, basis, text, remedy: remedy.to_owned() });
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
            text + ": it points down, as that of an IMU upside down, turned by 180 deg about its x \
                    or y axis, or of accelerometers with the other sign",
            "check how the IMU is mounted: level and at rest, accel_z reads -9.8 m/s^2; \
             `navfuse diagnose` tries each turn and sign",
        )
    } else {
        fault(
            text + ", as that of an IMU whose axes are turned",
            "check that the axes of the IMU are forward, right, down, and the initial roll and \
             pitch; `navfuse diagnose` tries each turn",
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

    /// Means over a second at rest and then over ten seconds of that acceleration north and down, in
    /// m/s^2, of which the specific force has `scale` times; corrections at that interval confirm it,
    /// if any do.
    fn accelerated(acceleration: [f64; 2], scale: f64, interval: Option<f64>) -> bool {
        let bench = crate::testing::Bench::new(&[]);
        let (state, layout) = (bench.state(), &*bench.composition.layout);
        let covariance = navfuse_core::state::covariance::Covariance::zero(layout.tangent);
        let filter = FilterView { layout, state: &state, covariance: &covariance, gated: None };
        let mut rule = Gravity::new(None);
        let [north, down] = acceleration;
        let dt = 0.125;
        let mut next = 0.0;
        (0..88).any(|k| {
            let time = f64::from(k) * dt;
            let moving = time >= 1.0;
            let along = if moving { time - 1.0 } else { 0.0 };
            if let Some(interval) = interval
                && time >= next
            {
                rule.corrected(&Vector3::new(north * along, 0.0, down * along));
                next += interval;
            }
            let [x, z] = if moving { [north, down - G] } else { [0.0, -G] };
            let f = Vector3::new(x, 0.0, z) * if moving { scale } else { 1.0 };
            rule.take(&filter, &bench.navigation, &f, dt).is_some()
        })
    }

    /// Boosts forward and up, and free fall, as any aid from 5 Hz down to once in 4 s confirms them.
    #[test]
    fn an_acceleration_that_other_sensors_confirm_is_no_fault_of_the_unit() {
        for acceleration in [[98.0, 0.0], [300.0, 0.0], [0.0, -60.0], [0.0, G], [30.0, G]] {
            for interval in [0.2, 1.0, 4.0] {
                assert!(
                    !accelerated(acceleration, 1.0, Some(interval)),
                    "{acceleration:?} {interval}"
                );
            }
            assert!(accelerated(acceleration, 1.0, None), "{acceleration:?}: nothing confirms it");
        }
    }

    /// A vehicle at rest, and one that accelerates, with accelerometers that read too much or too
    /// little of it.
    #[test]
    fn an_acceleration_that_other_sensors_do_not_confirm_is_a_fault() {
        for scale in [0.4, 2.1, 9.8] {
            assert!(accelerated([0.0, 0.0], scale, Some(0.2)), "{scale}");
            assert!(accelerated([98.0, 0.0], scale, Some(0.2)), "{scale}");
        }
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
