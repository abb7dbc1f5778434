//! Tests of the case that a sensor is wrong.

use super::*;

/// The first channel of the sensor, and both.
const ONE: Measured = Measured { sensor: SENSOR, present: 1 };
const BOTH: Measured = Measured { sensor: SENSOR, present: 3 };

/// A place with the sigma 0.4 m at zero, a sensor whose samples jump to 10 m after a silence, and another
/// one.
struct Place {
    value: f64,
    covariance: Covariance,
    branch: Branch,
    time: i64,
}

const SENSOR: usize = 0;
const OTHER: usize = 1;
const LIMIT: f64 = 15.1;

/// A sample of the place.
fn sample(value: f64, innovation: f64, noise: f64) -> Update {
    let mut update = Update::with_capacity(1, 1);
    update.m = 1;
    update.columns.push(0);
    (update.h, update.r) = (vec![1.0], vec![noise * noise]);
    update.innovation = vec![innovation - value];
    update
}

impl Place {
    /// The filter has followed a sample at 10 m.
    fn new() -> Self {
        Self::after(10.0, 0.02, Some(100.0))
    }

    /// The filter has used a first sample, which the gate refused if the covariance was widened.
    fn after(first: f64, noise: f64, widened: Option<f64>) -> Self {
        let mut covariance = Covariance::zero(1);
        covariance.set(0, 0, 0.16);
        let mut update = sample(0.0, first, noise);
        update.innovate(&covariance);
        let since = Time::MIN;
        let branch = Branch::new(ONE, &[1], since, &update, 1).unwrap_or_default();
        let branch = if widened.is_some() { branch.refused() } else { branch };
        covariance.set(0, 0, widened.unwrap_or(0.16));
        let mut place = Self { value: 0.0, covariance, branch, time: 0 };
        place.apply(SENSOR, update, since);
        place
    }

    fn apply(&mut self, sensor: usize, mut update: Update, time: Time) {
        update.innovate(&self.covariance);
        update.apply(&mut self.covariance, &[false]);
        self.value += update.delta[0];
        self.branch.correct(Measured { sensor, present: 1 }, &update, time);
    }

    fn take(&mut self, sensor: usize, value: f64, noise: f64) -> &mut Self {
        self.time += 1;
        let mut update = sample(self.value, value, noise);
        let nis = update.innovate(&self.covariance).unwrap_or(f64::NAN);
        self.branch.weigh(Measured { sensor, present: 1 }, &update, LIMIT);
        if nis <= LIMIT {
            self.apply(sensor, update, Time::from_nanos(self.time));
        }
        self
    }
}

/// The offset of 10 m and its variance of 0.16 m^2 count half.
#[test]
fn the_mixture_contains_both_cases_while_only_the_sensor_itself_speaks() {
    let mut place = Place::new();
    for k in 0..1000 {
        place.take(SENSOR, 10.0 + 0.02 * f64::from(k % 3 - 1), 0.02);
    }
    assert!(place.branch.odds.abs() < 0.1, "{}", place.branch.odds);
    assert_eq!(place.branch.decided(), None);
    let mixed = place.branch.mixed(&place.covariance, place.branch.weight());
    assert!((mixed.get(0, 0) - 0.5 * 100.16).abs() < 0.5, "{}", mixed.get(0, 0));
}

#[test]
fn another_sensor_decides_for_either_case_and_not_by_one_sample() {
    for (value, wrong) in [(0.2, true), (10.2, false)] {
        let mut place = Place::new();
        assert_eq!(place.take(OTHER, value, 0.3).branch.decided(), None);
        assert_eq!(place.take(OTHER, value, 0.3).branch.decided(), Some(wrong), "{value}");
        assert!(!place.branch.ended);
    }
}

/// The filter without the sensor has used 0.3 m with a sigma of 0.3 m: 0.16 / 0.25 of it, and the variance
/// 0.16 * 0.09 / 0.25.
#[test]
fn the_case_has_the_estimate_of_a_filter_that_never_used_the_sensor() {
    let mut place = Place::after(1.0, 0.02, None);
    place.take(OTHER, 0.3, 0.3);
    let moved = place.branch.follow(&mut place.covariance);
    assert!((place.value + moved[0] - 0.192).abs() < 1e-12, "{} {moved:?}", place.value);
    assert!((place.covariance.get(0, 0) - 0.0576).abs() < 1e-12);
}

/// 1.6 m are four sigma: `L = exp(16 / 2 - 1 / 2) / 4`, and a thousandth of it 0.45. 0.4 m are one sigma.
#[test]
fn a_sample_that_the_gate_passes_is_doubted_by_its_innovation() {
    let odds = |value: f64| Place::after(value, 0.0, None).branch.odds.exp();
    assert!((odds(1.6) - 1e-3 * 7.5f64.exp() / 4.0).abs() < 1e-9, "{}", odds(1.6));
    assert!((odds(0.4) - 1e-3).abs() < 1e-9 && !Place::after(0.4, 0.0, None).branch.is_in_doubt());
    assert!(Place::after(1.6, 0.0, None).branch.is_in_doubt());
    assert!(Place::after(10.0, 0.02, Some(100.0)).branch.odds.abs() < 1e-9);
}

/// A position of 2 m and a velocity of zero, which an error of the filter would correlate by 0.9.
#[test]
fn the_offset_is_in_the_channels_that_contradict_the_others() {
    let mut update = Update::with_capacity(2, 2);
    update.m = 2;
    update.s.extend([1.0, 0.9, 0.9, 1.0]);
    update.innovation.extend([2.0, 0.0]);
    let branch = Branch::new(BOTH, &[1, 2], Time::MIN, &update, 2);
    let branch = branch.unwrap_or_default();
    assert_eq!((branch.offset_channels(), branch.offsets()), (1, &[2.0][..]));
    assert!((branch.variance[0] - 0.19).abs() < 1e-12);
}

#[test]
fn a_sensor_that_comes_back_was_wrong_and_one_that_jumps_elsewhere_decides_nothing() {
    let mut place = Place::new();
    place.take(SENSOR, 10.0, 0.02).take(SENSOR, 0.3, 0.02).take(SENSOR, 0.3, 0.02);
    assert_eq!((place.branch.decided(), place.branch.ended), (Some(true), true));
    let mut place = Place::new();
    place.take(SENSOR, 10.0, 0.02).take(SENSOR, -30.0, 0.02).take(SENSOR, -30.0, 0.02);
    assert_eq!((place.branch.decided(), place.branch.ended), (None, false));
}

/// A place with the sigma 3 m, and a first sample with 0.2 m, which the gate passes.
fn wide(first: f64) -> Place {
    let mut covariance = Covariance::zero(1);
    covariance.set(0, 0, 9.0);
    let mut update = sample(0.0, first, 0.2);
    update.innovate(&covariance);
    let branch = Branch::new(ONE, &[1], Time::MIN, &update, 1).map(Branch::once);
    let mut place = Place { value: 0.0, covariance, branch: branch.unwrap_or_default(), time: 0 };
    place.apply(SENSOR, update, Time::MIN);
    place
}

/// The first sample is off by 8 m. After three right ones the place is that of a filter that has used them
/// alone, and its sigma is not smaller.
#[test]
fn a_first_sample_that_those_after_it_contradict_was_wrong() {
    let mut place = wide(8.0);
    for (value, wrong) in [(0.1, None), (-0.1, None), (0.0, Some(true))] {
        let mut update = sample(place.value, value, 0.2);
        update.innovate(&place.covariance);
        place.branch.weigh(ONE, &update, LIMIT);
        place.branch.learn(ONE, &update, LIMIT);
        assert_eq!(place.branch.decided(), wrong, "{value}");
    }
    let moved = place.branch.follow(&mut place.covariance);
    let sigma = place.covariance.get(0, 0).sqrt();
    assert!((place.value + moved[0]).abs() < 0.1, "{} {moved:?}", place.value);
    assert!((0.2 / 3_f64.sqrt()..0.3).contains(&sigma), "{sigma}");
}

#[test]
fn right_samples_end_the_case_that_the_first_one_was_wrong() {
    let mut place = wide(1.0);
    assert!(!place.branch.is_in_doubt());
    place.take(SENSOR, 1.1, 0.2).take(OTHER, 0.9, 0.2).take(SENSOR, 1.0, 0.2);
    assert!(place.branch.odds < place.branch.began - 2.0, "{}", place.branch.odds);
}

/// The first sample was right, and three after it are off by 8 m: the filter follows them, until they return.
#[test]
fn a_first_sample_that_was_right_is_used_again() {
    let mut place = wide(0.1);
    for value in [8.0, 8.1, 7.9] {
        let mut update = sample(place.value, value, 0.2);
        update.innovate(&place.covariance);
        place.branch.weigh(ONE, &update, LIMIT);
        place.branch.learn(ONE, &update, LIMIT);
    }
    assert_eq!(place.branch.decided(), Some(true));
    place.value += place.branch.follow(&mut place.covariance)[0];
    place.branch = std::mem::take(&mut place.branch).reversed(Time::MIN);
    place.take(SENSOR, 8.0, 0.2).take(SENSOR, 8.1, 0.2);
    assert!((place.branch.weight() - 0.5).abs() < 0.1, "{}", place.branch.weight());
    let mixed = place.branch.mixed(&place.covariance, place.branch.weight());
    assert!((3.0..6.0).contains(&mixed.get(0, 0).sqrt()), "{}", mixed.get(0, 0));
    place.take(SENSOR, 0.0, 0.2).take(SENSOR, 0.1, 0.2);
    assert_eq!(place.branch.decided(), Some(true));
    let moved = place.branch.follow(&mut place.covariance);
    assert!((place.value + moved[0]).abs() < 0.4, "{} {moved:?}", place.value);
}
