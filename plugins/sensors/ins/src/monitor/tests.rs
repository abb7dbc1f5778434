//! The rules that look at the estimate, at both sides of their limits.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::testing::Bench;
use nalgebra::{Rotation3, Vector2, Vector3};
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
        let filter = FilterView { layout, state, covariance, gated: None, smoothed: false };
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

/// Samples at rest, with the bias known to 100 ug after one second, from 400 ug at the start. The
/// tilt, of which north and east have a share each, neglects `ratio` times these 100 ug of gravity.
fn levelled(ratio: f64, north: f64, first_ug: f64) -> Option<Finding> {
    let mut watch = Watch::new(&[]);
    // g e^2 / 2 = ratio * 100e-6 g
    let squared: f64 = 2e-4 * ratio;
    watch.sigma("ins.attitude", [(squared * north).sqrt(), (squared * (1.0 - north)).sqrt(), 1.0]);
    for (at, ug) in [(0.0, first_ug), (1.0, 100.0)] {
        watch.sigma("ins.accel_bias", [9.80665e-6 * ug; 3]);
        if let Some(found) = watch.take(at, 1.0, STILL) {
            assert!(at > 0.0, "nothing was taken for a bias yet");
            return Some(found);
        }
    }
    None
}

/// Gravity at 45 deg is that of the unit to 1e-5. The limits are half of the sigma of the bias and
/// three times that.
#[test]
fn a_tilt_too_large_for_the_accelerometers_is_found_about_either_axis() {
    for north in [0.0, 1.0, 0.3] {
        let severity = |ratio: f64| levelled(ratio, north, 400.0).map(|found| found.severity);
        assert_eq!(severity(0.49), None);
        assert_eq!(severity(0.51), Some(Severity::Doubtful));
        assert_eq!(severity(2.99), Some(Severity::Doubtful));
        assert_eq!(severity(3.01), Some(Severity::DoNotUse));
        let text = levelled(2.0, north, 400.0).unwrap().text;
        // 0.81 deg on each axis in the mean: the root of half of 4e-4 rad^2
        assert!(text.contains("2.0 times as large") && text.contains("0.81 deg"), "{text}");
    }
    // the samples have determined the bias from half of the sigma at the start on
    assert!(levelled(2.0, 0.5, 199.0).is_none());
    assert!(levelled(2.0, 0.5, 201.0).is_some());
}

/// An alignment at rest finds the tilt from the samples themselves, whatever the scenario gives.
#[test]
fn a_tilt_that_an_alignment_finds_is_not_compared() {
    let tilt = |settings: &[&str]| {
        let mut watch = Watch::new(settings);
        watch.sigma("ins.attitude", [0.02, 0.02, 1.0]);
        [(0.0, 400.0), (1.0, 100.0)].into_iter().find_map(|(at, ug)| {
            watch.sigma("ins.accel_bias", [9.80665e-6 * ug; 3]);
            watch.take(at, 1.0, STILL)
        })
    };
    assert!(tilt(&[]).is_some());
    assert!(tilt(&["process.ins.alignment=static"]).is_none());
}

/// Once a second the tilt is compared, once for each severity it is reported. A tilt that has grown
/// to more than twice its least variance comes from a bridge, and is not judged.
#[test]
fn a_tilt_is_reported_once_and_only_that_of_the_start() {
    let mut watch = Watch::new(&[]);
    let tilt = |watch: &mut Watch, ratio: f64| {
        let sigma = (1e-4 * ratio).sqrt();
        watch.sigma("ins.attitude", [sigma, sigma, 1.0]);
    };
    tilt(&mut watch, 2.0);
    watch.sigma("ins.accel_bias", [4e-4 * 9.80665; 3]);
    assert!(watch.take(0.0, 1.0, STILL).is_none());
    watch.sigma("ins.accel_bias", [1e-4 * 9.80665; 3]);
    tilt(&mut watch, 4.1);
    assert!(watch.take(1.0, 1.0, STILL).is_none(), "it has grown");
    tilt(&mut watch, 2.0);
    assert!(watch.take(1.5, 1.0, STILL).is_none(), "half a second later");
    let severity = |found: Option<Finding>| found.map(|finding| finding.severity);
    assert_eq!(severity(watch.take(2.0, 1.0, STILL)), Some(Severity::Doubtful));
    assert!(watch.take(3.0, 1.0, STILL).is_none(), "again");
    tilt(&mut watch, 3.9);
    assert_eq!(severity(watch.take(4.0, 1.0, STILL)), Some(Severity::DoNotUse));
    assert!(watch.take(5.0, 1.0, STILL).is_none(), "again");
}

/// Samples at rest, one a second, with a heading of 2 deg, a way in that direction, and 1 m along it,
/// whose ratio is `ratio(k)` at the sample `k`; returns the first two findings with their samples.
fn headed(direction: f64, ratio: impl Fn(u32) -> f64) -> Vec<(u32, Finding)> {
    let mut watch = Watch::new(&[]);
    let tangent = |name: &str| watch.bench.composition.layout.find(name).unwrap().tangent.unwrap();
    let (heading, position) = (tangent("ins.attitude") + 2, tangent("ins.position"));
    let squared = 2_f64.to_radians().powi(2);
    watch.covariance.set(heading, heading, squared);
    let (across, along) = (Vector2::new(-direction.sin(), direction.cos()), 1.0);
    let way = Vector2::new(direction.cos(), direction.sin());
    let mut found = Vec::new();
    for k in 0..40 {
        // r e^2 / 2 = ratio * 1 m
        let d = across * (2.0 * ratio(k) / squared);
        let p = d * d.transpose() * squared + way * way.transpose() * along;
        for i in 0..2 {
            watch.covariance.set(position + i, heading, d[i] * squared);
            (0..2).for_each(|j| watch.covariance.set(position + i, position + j, p[(i, j)]));
        }
        found.extend(watch.take(f64::from(k), 1.0, STILL).map(|finding| (k, finding)));
    }
    found
}

/// A way `r` north with a heading error of 2 deg is 2 deg of it east, and half of the square of that
/// back: the mean of it, at the limits of a half and three times the sigma of one metre.
#[test]
fn a_heading_too_wide_for_the_way_is_found_in_every_direction() {
    for direction in [0.0, 0.5, 2.0, 4.0] {
        let severities = |ratio: f64| -> Vec<Severity> {
            headed(direction, |_| ratio).iter().map(|(_, finding)| finding.severity).collect()
        };
        assert_eq!(severities(0.49), []);
        assert_eq!(severities(0.51), [Severity::Doubtful]);
        assert_eq!(severities(2.99), [Severity::Doubtful]);
        assert_eq!(severities(3.01), [Severity::DoNotUse]);
    }
    // 2 m / ((2 deg)^2 / 2) = 3283 m
    let text = &headed(1.0, |_| 2.0)[0].1.text;
    for part in ["2.0 deg", "3283 m", "1.00 m", "2.0 times"] {
        assert!(text.contains(part), "{text}");
    }
}

/// Ten comparisons in a row, one a second, once for each severity.
#[test]
fn a_heading_that_becomes_better_within_seconds_is_not_reported() {
    let at = |ratio: fn(u32) -> f64| -> Vec<(u32, Severity)> {
        headed(0.0, ratio).iter().map(|(k, finding)| (*k, finding.severity)).collect()
    };
    assert_eq!(at(|_| 1.0), [(9, Severity::Doubtful)]);
    assert_eq!(at(|k| if k % 10 == 9 { 0.1 } else { 9.0 }), []);
    assert_eq!(
        at(|k| if k < 20 { 1.0 } else { 4.0 }),
        [(9, Severity::Doubtful), (29, Severity::DoNotUse)]
    );
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
