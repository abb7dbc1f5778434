//! The bound against the runs of the paper: an independent filter, and this filter's own sigma.
//! sigma.

use super::*;

/// Final 1-sigma of an independent error-state EKF of 19 states on this scenario, quoted beside the
/// "Table of achievable limits". Its roll misalignment is 0.085 deg, for a dive of unstated course;
/// the test takes that of the table instead.
#[test]
fn the_bound_of_the_3d_run_is_the_sigma_of_an_independent_filter() {
    let mut check = Check::default();
    let bound = Bound::scenario("pan-wu-3d");
    let figures =
        [(HEADING, 0.0122), (K, 188e-6), (YAW, 0.011), (PITCH, 0.017), (NORTH, 1.1), (EAST, 1.1)];
    check.limits("3D", &bound, &figures);
    check.limits("3D", &bound, &[(GYRO[0], 0.0033), (GYRO[1], 0.0033), (GYRO[2], 0.0100)]);
    check.limits("3D", &bound, &[(ACCEL[0], 2.3), (ACCEL[1], 2.3), (ACCEL[2], 0.54)]);
    // 2.0 to 2.5 mm/s
    let velocity = ["north", "east", "down"].map(|axis| bound.end(&format!("ins.velocity.{axis}")));
    check.within("least velocity", velocity.into_iter().fold(f64::INFINITY, f64::min), 2.0e-3, 0.1);
    check.within("greatest velocity", velocity.into_iter().fold(0.0, f64::max), 2.5e-3, 0.1);
    // 0.0003 deg, a figure of one digit
    for tilt in ["ins.attitude.roll", "ins.attitude.pitch"].map(|name| bound.end(name)) {
        assert_eq!((tilt * 1e4).round(), 3.0, "{tilt} deg");
    }
    // 5 m/s, 5 Hz: 0.10 deg for W sin^2 with W = 1 m/s, whose mean square is 3/8 m^2/s^2; this dive
    // has 1024/3003 (1.1 m/s)^2. The banked turns alone give 0.40 deg, as in 2D; information adds.
    let dive = 0.10 * (3.0 / 8.0 / (1024.0 / 3003.0 * 1.1_f64.powi(2))).sqrt();
    let roll = (dive.powi(-2) + 0.40_f64.powi(-2)).powf(-0.5);
    check.limits("3D", &bound, &[(ROLL, roll)]);
}

/// Remark 3 of the paper: without a dive the roll misalignment does not converge, and the banked
/// turns hold little information (0.40 deg of a prior of 1 deg); "everything else is as good".
#[test]
fn in_the_2d_run_the_bound_of_the_roll_misalignment_stays_of_the_order_of_its_prior() {
    let (level, dive) = (Bound::scenario("pan-wu-2d"), Bound::scenario("pan-wu-3d"));
    let roll = level.end(ROLL);
    assert!((0.3..1.0).contains(&roll), "{roll} deg of a prior of 1 deg");
    for component in level.columns.components.iter().filter(|c| c.name() != ROLL) {
        let name = component.name();
        assert!(
            level.end(&name) < 1.2 * dive.end(&name),
            "{name}: {} {}",
            level.end(&name),
            dive.end(&name)
        );
    }
}

/// Compares twenty runs, each with its own start and noise, with their bound: from a time on, every
/// sigma is within 3 %, except for some components. The IMU runs at 20 Hz, which changes no sigma
/// by 0.1 % and saves four fifths of the time.
fn sigma_is_the_bound(settings: &[&str], from: f64, but: &[&str]) {
    let document = Document::from_file(scenario("pan-wu-3d")).expect("the scenario is there");
    let settings = [&["sensor.imu.simulation.rate=\"20 Hz\""], settings].concat();
    let (bound, runs) = Bound::of(document, &settings, 20);
    let mut check = Check::default();
    let mut compared = 0;
    for run in &runs {
        assert!(run.failure.is_none(), "{:?}", run.failure);
        for row in run.rows.iter().filter(|row| row.time >= from) {
            let limit = bound
                .record
                .rows
                .iter()
                .find(|b| b.0 == row.epoch)
                .expect("the bound has that epoch");
            let names = bound.columns.components.iter().map(Component::name).enumerate();
            for (k, name) in names.filter(|(_, name)| !but.contains(&name.as_str())) {
                let what = format!("run {}, {} s, {name}", run.run, row.time);
                check.within(&what, row.values[2 * k + 1], limit.2[k], 0.03);
                compared += 1;
            }
        }
    }
    // an epoch every 20 s until 2060 s
    let epochs = ((2060.0 - from) / 20.0) as usize + 1;
    assert_eq!(compared, 20 * epochs * (bound.columns.components.len() - but.len()));
}

/// A filter that starts 2 % off in scale factor instead of 20 % linearises near the truth. The
/// remaining difference is of second order: below 2 % for all runs and components.
#[test]
fn the_sigma_of_a_filter_that_starts_near_the_truth_is_the_bound_within_3_percent() {
    sigma_is_the_bound(&["sensor.dvl.scale={ sigma = \"2 %\", truth = 0.9998 }"], 700.0, &[]);
}

/// With the paper's start, 20 % off, the filter linearises its first samples in motion at a wrong
/// point, and gains too much or too little information from them. After the first turn this is
/// forgotten, except where a turn holds no information: the vertical sigma is up to 14 % off.
#[test]
fn the_papers_filter_reaches_the_bound_within_3_percent_after_the_first_turn_except_vertically() {
    sigma_is_the_bound(&[], 1100.0, &["ins.velocity.down", DOWN, ACCEL[2], PITCH]);
}
