//! The rules that look at the estimate, at both sides of their limits.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::testing::Bench;
use nalgebra::{Rotation3, Vector3};
use navfuse_core::model::process::Input;
use navfuse_core::model::process::monitor::Monitor;
use navfuse_core::model::process::screening::Spread;
use navfuse_core::model::process::start::FilterView;
use navfuse_core::model::record::finding::{Finding, Severity};
use navfuse_core::state::State;
use navfuse_core::state::covariance::Covariance;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;

/// Level, at rest, heading north.
const STILL: [f64; 6] = [0.0, 0.0, 0.0, 0.0, 0.0, -9.81];

/// The monitor of an IMU beside an estimate of one's choice.
struct Watch {
    bench: Bench,
    state: State,
    covariance: Covariance,
}

impl Watch {
    fn new(settings: &[&str]) -> Self {
        let bench = Bench::new(settings);
        let (state, n) = (bench.state(), bench.composition.layout.tangent);
        Self { bench, state, covariance: Covariance::zero(n) }
    }

    /// Sets the variances of the block of a name.
    fn sigma(&mut self, name: &str, sigma: [f64; 3]) {
        let at = self.bench.composition.layout.find(name).unwrap().tangent.unwrap();
        (0..3).for_each(|k| self.covariance.set(at + k, at + k, sigma[k] * sigma[k]));
    }

    /// The sample at a time that covers `usual` seconds.
    fn take(&mut self, at: f64, usual: f64, channels: [f64; 6]) -> Option<Finding> {
        self.replaced(at, usual, channels, None)
    }

    /// As [`Self::take`], for a sample that the filter replaced by one with a spread.
    fn replaced(
        &mut self,
        at: f64,
        usual: f64,
        channels: [f64; 6],
        spread: Option<&Spread>,
    ) -> Option<Finding> {
        let sample = Sample::new(Time::from_seconds(at).unwrap(), SensorId(0), &channels);
        let Self { bench, state, covariance } = self;
        let layout = &*bench.composition.layout;
        let filter = FilterView { layout, state, covariance, gated: None };
        let input = Input { sample: &sample, duration: usual, usual, spread };
        bench.composition.processes[0].monitor.as_mut().unwrap().input(&filter, &input)
    }
}

/// The first mean of the specific force is that over one second.
#[test]
fn samples_in_g_are_found_after_one_second() {
    let mut watch = Watch::new(&[]);
    let interval = 1.0 / 64.0;
    let mut found = (1..=200).filter_map(|k| {
        watch.take(f64::from(k) * interval, interval, [0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
    });
    let finding = found.next().unwrap();
    assert!(finding.text.ends_with("the samples are in g"), "{}", finding.text);
    assert_eq!((finding.time.seconds(), found.next()), (1.0, None));
}

#[test]
fn a_sample_that_the_filter_replaced_is_no_evidence() {
    let mut watch = Watch::new(&[]);
    let spread = [0.0; MAX_CHANNELS];
    let taken = (1..=100).any(|k| {
        let channels = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
        watch.replaced(f64::from(k), 1.0, channels, Some(&spread)).is_some()
    });
    assert!(!taken);
}

/// The first mean is within the limits of half of gravity and twice it; the next one is over ten
/// seconds, half of them at 5 g.
#[test]
fn later_means_are_over_ten_seconds() {
    let mut watch = Watch::new(&[]);
    let found = (1..=100).find_map(|k| {
        let size = if k <= 16 { 9.81 } else { 5.0 * 9.81 };
        watch.take(f64::from(k), 1.0, [0.0, 0.0, 0.0, 0.0, 0.0, -size])
    });
    let finding = found.unwrap();
    // at 11 s the mean is gravity; at 21 s it is (5 + 25) / 10 of it
    assert_eq!(finding.time.seconds(), 21.0);
    assert!(finding.text.contains("is 29.430 m/s^2"), "{}", finding.text);
}

/// Turned over, with an attitude that is known to a few degrees; one that is not known says nothing.
/// The attitude counts that held before the samples moved it.
#[test]
fn the_first_mean_points_up_where_the_attitude_is_known() {
    let found = |sigma: &str| {
        let mut watch = Watch::new(&[&format!("process.ins.attitude.sigma={sigma}")]);
        let mut found = None;
        for k in 1..=8 {
            let (roll, n) = (0.4 * f64::from(k - 1), watch.bench.navigation);
            let attitude = Rotation3::from_euler_angles(roll, 0.0, 0.0);
            watch.state.set(&watch.bench.composition.layout, n.attitude, &attitude);
            let over = [0.0, 0.0, 0.0, 0.0, 0.0, 9.81];
            found = found.or(watch.take(f64::from(k) / 8.0, 0.125, over));
        }
        found.map_or_else(String::new, |finding| finding.text)
    };
    assert!(found("9 deg").contains("180 deg off the vertical"), "{}", found("9 deg"));
    assert_eq!(found("11 deg"), "");
}

/// 0.2 deg/h in rad/s and 0.1 mg in m/s^2, as powers of two: ratios of them are exact.
const UNITS: [(&str, f64); 2] = [("gyro", 9.536_743_164_062_5e-7), ("accelerometer", 9.765_625e-4)];

/// A constant, known to two units, is known to `sqrt(3)` units 20 s later and has moved by so many
/// units: the move has a sigma of one unit, for the variance has fallen from 4 to 3.
fn moved(sensor: usize, units: f64) -> Option<Finding> {
    moved_with(&[], sensor, units)
}

/// As [`moved`], with settings.
fn moved_with(settings: &[&str], sensor: usize, units: f64) -> Option<Finding> {
    moved_across(settings, (sensor, units), |_| {})
}

/// As [`moved_with`], with what the filter does meanwhile. The velocity is corrected by many times
/// its sigma.
fn moved_across(
    settings: &[&str],
    (sensor, units): (usize, f64),
    meanwhile: impl FnOnce(&mut dyn Monitor),
) -> Option<Finding> {
    let mut watch = Watch::new(settings);
    watch.sigma("ins.velocity", [1.0; 3]);
    let (name, unit) = (["ins.gyro_bias", "ins.accel_bias"][sensor], UNITS[sensor].1);
    watch.sigma(name, [2.0 * unit; 3]);
    assert!(watch.take(1.0, 1.0, STILL).is_none());
    meanwhile(watch.bench.composition.processes[0].monitor.as_deref_mut().unwrap());
    let layout = &watch.bench.composition.layout;
    let at = layout.find(name).unwrap().tangent.unwrap();
    (0..3).for_each(|k| watch.covariance.set(at + k, at + k, 3.0 * unit * unit));
    let (n, bias) = (watch.bench.navigation, Vector3::new(0.0, -units * unit, 0.0));
    watch.state.set(layout, [n.gyro_bias, n.accel_bias][sensor].unwrap(), &bias);
    watch.state.set(layout, n.velocity, &Vector3::new(30.0, 20.0, 10.0));
    watch.sigma("ins.velocity", [0.1; 3]);
    assert!(watch.take(20.0, 1.0, STILL).is_none(), "it compares every 20 s");
    let found = watch.take(21.0, 1.0, STILL);
    assert!(watch.take(41.0, 1.0, STILL).is_none(), "the same move again");
    found
}

/// A million moves of a constant have less than one beyond 5 sigma; beyond 5.5 the result is
/// useless.
#[test]
fn a_bias_that_moves_beyond_its_uncertainty_is_named() {
    for (sensor, (name, _)) in UNITS.into_iter().enumerate() {
        let severity = |units: f64| moved(sensor, units).map(|found| found.severity);
        assert_eq!(severity(0.0), None);
        assert_eq!(severity(5.0), None);
        assert_eq!(severity(5.0625), Some(Severity::Doubtful));
        assert_eq!(severity(5.5), Some(Severity::Doubtful));
        assert_eq!(severity(5.5625), Some(Severity::DoNotUse));
        let text = moved(sensor, 8.0).unwrap().text;
        assert!(text.contains(&format!("of the {name} bias has moved by 8.0 times")), "{text}");
    }
}

/// The variance may have grown and fallen again, so that its decrease is not that of the move.
#[test]
fn a_move_while_the_filter_widens_the_covariance_is_not_compared() {
    for sensor in [0, 1] {
        assert!(moved_across(&[], (sensor, 8.0), |_| {}).is_some());
        assert!(moved_across(&[], (sensor, 8.0), |monitor| monitor.widened()).is_none());
    }
}

/// Tilts of 20 mrad about both axes take 4 units off gravity in the mean, and 6 as a root mean square: a vertical bias that has
/// moved by 8 units may hold them. Along the level axes there is no such part, and 2 mrad take 0.04 units.
#[test]
fn what_a_tilt_takes_off_gravity_is_no_move_of_the_vertical_bias() {
    let severity = |tilt: f64, axis: usize| {
        let mut watch = Watch::new(&[]);
        watch.sigma("ins.attitude", [tilt, tilt, 0.1]);
        let unit = UNITS[1].1;
        watch.sigma("ins.accel_bias", [2.0 * unit; 3]);
        assert!(watch.take(1.0, 1.0, STILL).is_none());
        watch.sigma("ins.accel_bias", [3_f64.sqrt() * unit; 3]);
        let mut bias = Vector3::zeros();
        bias[axis] = 8.0 * unit;
        let n = watch.bench.navigation;
        watch.state.set(&watch.bench.composition.layout, n.accel_bias.unwrap(), &bias);
        watch.take(21.0, 1.0, STILL).map(|found| found.severity)
    };
    assert_eq!(severity(0.002, 2), Some(Severity::DoNotUse));
    assert_eq!(severity(0.02, 2), None);
    assert_eq!(severity(0.02, 0), Some(Severity::DoNotUse));
}

#[test]
fn a_bias_that_may_wander_is_not_compared() {
    for (sensor, walk) in [
        (0, "gyro_bias={ sigma = '1 deg/h', random_walk = '1 deg/h/sqrt(h)' }"),
        (1, "accel_bias={ sigma = '1 mg', random_walk = '1 mg/sqrt(h)' }"),
    ] {
        let setting = format!("process.ins.{walk}");
        assert!(moved_with(&[&setting], sensor, 8.0).is_none());
        assert!(moved_with(&[&setting], 1 - sensor, 8.0).is_some());
    }
}
