//! The ideal observer IO-DVLC: Figures 2 to 5, and its comparison with the filter.

use crate::paper::runs::{dives, for_seeds, rms, with};
use navfuse_calibration::{AttitudeSource, CalibrationData, Estimate, Method};
use navfuse_segments::{Directions, Kind, Recording};
use std::sync::LazyLock;

const DEG: f64 = std::f64::consts::PI / 180.0;

/// A 3-D run until 720 s, with the result of the observer.
struct ObservedRun {
    data: CalibrationData,
    printed: Estimate,
}

fn observed_runs() -> &'static [ObservedRun] {
    static SEEN: LazyLock<Vec<ObservedRun>> = LazyLock::new(|| {
        for_seeds(|mut settings| {
            settings.push("estimator.stop=720 s".into());
            let recording =
                with("pan-wu-3d", &settings, Recording::read).unwrap_or_else(|e| panic!("{e}"));
            let data = CalibrationData::new(recording, AttitudeSource::Gyros)
                .unwrap_or_else(|e| panic!("{e}"));
            let printed = Method::IoDvlcPrinted.estimate(&data).unwrap_or_else(|e| panic!("{e}"));
            ObservedRun { data, printed }
        })
    });
    &SEEN
}

/// Returns the errors of k, roll, pitch and yaw (rad) of the estimate at a time.
fn errors(seen: &ObservedRun, time: f64) -> [f64; 4] {
    let truth = seen.data.recording.velocities[0].truth.expect("the scenario states it");
    let zero = seen.data.recording.clock(0.0);
    let step = seen
        .printed
        .history
        .iter()
        .rfind(|s| s.time + zero <= time)
        .expect("an estimate until then");
    let (m, t) = (step.mounting.angles(), truth.angles());
    [step.mounting.k - truth.k, m.x - t.x, m.y - t.y, m.z - t.z]
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = errors.fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0));
    (sum / count).sqrt()
}

#[test]
fn the_specific_force_rates_of_advance_and_dive_are_linearly_independent() {
    for ObservedRun { data, .. } in observed_runs() {
        let rank = |until: f64| {
            let zero = data.recording.clock(0.0);
            let segments = data.of(Kind::TypeI).filter(|s| s.to + zero <= until);
            Directions::of(&data.recording, &data.settings, &data.attitude, segments).rank
        };
        assert_eq!(
            rank(721.0),
            2,
            "forward and down: the condition of Theorem 1 for segments of Type I"
        );
    }
}

#[test]
fn the_scale_factor_is_computable_from_the_first_segment_on() {
    // as printed, at 5 m/s: sigma is 1.1 % over both segments; the bound is four sigma, also for
    // the first segment alone
    assert!(root_mean_square(observed_runs().iter().map(|s| errors(s, 659.0)[0])) < 0.05);
}

#[test]
fn the_roll_angle_cannot_converge_until_the_descent() {
    let roll = |time| root_mean_square(observed_runs().iter().map(|s| errors(s, time)[1] / DEG));
    // before the descent only noise rotates about the thrust, so that any angle may result
    assert!(roll(655.0) > 2.0 * roll(720.0), "{} before, {} after", roll(655.0), roll(720.0));
}

#[test]
fn the_filter_is_more_accurate_than_the_observer_whose_angles_are_too_inaccurate() {
    let observer: [f64; 4] = std::array::from_fn(|i| {
        root_mean_square(observed_runs().iter().map(|s| errors(s, 720.0)[i]))
    });
    let names =
        ["dvl.scale.k", "dvl.misalignment.roll", "dvl.misalignment.pitch", "dvl.misalignment.yaw"];
    for (i, name) in names.into_iter().enumerate() {
        let (filter, unit) = (rms(dives(), name, 720.0), if i == 0 { 1.0 } else { DEG });
        assert!(
            observer[i] / unit > 2.0 * filter,
            "{name}: observer {}, filter {filter}",
            observer[i] / unit
        );
    }
    assert!(
        observer[1] / DEG > 0.5,
        "the misalignment to be found is 0.1 deg in roll: {}",
        observer[1] / DEG
    );
}
