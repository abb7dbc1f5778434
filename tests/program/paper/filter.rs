//! The extended Kalman filter: Figures 6 to 16. Times are those of Table 1; the first turn of the
//! square is from 1025 to 1055 s.

use crate::paper::runs::{Run, dives, flat, rms};

const HORIZONTAL: [&str; 2] = ["x", "y"];

fn each(runs: &[Run], check: impl Fn(&Run)) {
    runs.iter().for_each(check);
}

#[test]
fn the_scale_factor_converges_swiftly_from_0_8_to_the_truth_once_the_vehicle_moves() {
    each(dives(), |run| {
        assert!(run.sigma("dvl.scale.k", 600.0) > 0.19, "it is not observable at rest");
        // sigma of the velocity over the speed, with a few correlated samples: 0.02 m/s / 5 m/s is
        // a 50th of 0.2
        assert!(
            run.sigma("dvl.scale.k", 660.0) < 0.2 / 50.0,
            "{}",
            run.sigma("dvl.scale.k", 660.0)
        );
    });
    // from 20 % to below 0.5 % in the minute of the acceleration
    assert!(
        rms(dives(), "dvl.scale.k", 601.0) > 0.19 && rms(dives(), "dvl.scale.k", 660.0) < 0.005
    );
}

#[test]
fn misalignment_yaw_and_pitch_converge_as_swiftly() {
    for angle in ["yaw", "pitch"] {
        let name = format!("dvl.misalignment.{angle}");
        each(dives(), |run| {
            assert!(run.sigma(&name, 600.0) > 0.95, "it is not observable at rest");
            assert!(run.sigma(&name, 660.0) < 0.2, "{angle}: {}", run.sigma(&name, 660.0));
        });
    }
}

#[test]
fn the_roll_angle_approaches_its_true_value_when_the_descent_starts() {
    each(dives(), |run| {
        let sigma = |time| run.sigma("dvl.misalignment.roll", time);
        assert!(sigma(659.0) > 0.9, "it is not observable in level motion: {}", sigma(659.0));
        assert!(sigma(720.0) < 0.25, "{}", sigma(720.0));
    });
    assert!(rms(dives(), "dvl.misalignment.roll", 720.0) < 0.5);
}

#[test]
fn turning_on_the_square_drives_the_accelerometer_bias_to_convergence() {
    for axis in HORIZONTAL {
        let name = format!("ins.accel_bias.{axis}");
        each(dives(), |run| {
            // before the turn the bias is not separable from a tilt: it stays near the 50 ug of its
            // prior
            assert!(run.sigma(&name, 1020.0) > 35.0, "{axis} before: {}", run.sigma(&name, 1020.0));
            // a leg after the turn, the noise gives the tilt a sigma of 0.0003 deg, which is 5 ug,
            // over two headings
            assert!(run.sigma(&name, 1330.0) < 6.0, "{axis} after: {}", run.sigma(&name, 1330.0));
        });
        assert!(rms(dives(), &name, 1970.0) < 6.0);
    }
    // the vertical bias needs no turn: gravity and the descent determine it
    each(dives(), |run| assert!(run.sigma("ins.accel_bias.z", 750.0) < 10.0));
}

#[test]
fn the_gyroscope_bias_converges_slower_and_slowest_about_the_vertical() {
    each(dives(), |run| {
        for axis in HORIZONTAL {
            let (gyro, accel) = (format!("ins.gyro_bias.{axis}"), format!("ins.accel_bias.{axis}"));
            // the remaining share of the prior at the end: a third against a 20th
            assert!(run.normalised(&gyro, 2059.0) > 3.0 * run.normalised(&accel, 2059.0));
            assert!(run.normalised(&gyro, 2059.0) < 0.45, "{}", run.normalised(&gyro, 2059.0));
        }
        // the heading drifts by 0.01 deg/h x 0.4 h = 0.004 deg, below its own sigma of 0.012 deg
        assert!(run.normalised("ins.gyro_bias.z", 2059.0) > 0.95);
    });
}

#[test]
fn the_scale_factor_and_the_misalignment_in_yaw_and_pitch_have_the_strongest_observability() {
    let strong = ["dvl.scale.k", "dvl.misalignment.yaw", "dvl.misalignment.pitch"];
    each(dives(), |run| {
        let weakest = strong.iter().map(|s| run.normalised(s, 2059.0)).fold(0.0, f64::max);
        let others = ["ins.attitude.yaw", "dvl.misalignment.roll"].map(str::to_owned).into_iter();
        let biases = ["gyro_bias", "accel_bias"]
            .iter()
            .flat_map(|b| HORIZONTAL.map(|axis| format!("ins.{b}.{axis}")));
        for other in others.chain(biases) {
            assert!(
                run.normalised(&other, 2059.0) > weakest,
                "{other}: {}",
                run.normalised(&other, 2059.0)
            );
        }
    });
}

#[test]
fn the_dive_determines_the_yaw_angle_together_with_the_dvl_roll_angle() {
    // the dive improves the heading little, but more in its minute than the acceleration before it,
    // and it determines the roll
    each(dives(), |run| {
        let fall = |name: &str, from, to| run.sigma(name, from) / run.sigma(name, to);
        assert!(fall("dvl.misalignment.roll", 660.0, 720.0) > 3.0);
        assert!(fall("dvl.misalignment.roll", 605.0, 660.0) < 1.02);
        let (before, during) =
            (fall("ins.attitude.yaw", 605.0, 660.0), fall("ins.attitude.yaw", 660.0, 720.0));
        assert!(
            before < 1.02 && during > 1.04,
            "the heading: {before} before the dive, {during} in it"
        );
    });
}

#[test]
fn the_turn_determines_roll_and_pitch_together_with_the_accelerometer_bias() {
    // tilt and bias are one unknown until the heading turns one against the other
    each(dives(), |run| {
        for (angle, axis) in [("roll", "y"), ("pitch", "x")] {
            let (angle, bias) = (format!("ins.attitude.{angle}"), format!("ins.accel_bias.{axis}"));
            let ratio =
                |time| run.sigma(&angle, time).to_radians() / (run.sigma(&bias, time) * 1e-6);
            // before the turn, sigma of the tilt in rad is that of the bias in g, to 15 %
            assert!((ratio(1020.0) - 1.0).abs() < 0.15, "{angle}: {}", ratio(1020.0));
            for name in [&angle, &bias] {
                assert!(
                    run.sigma(name, 1020.0) > 3.0 * run.sigma(name, 1330.0),
                    "{name} in the first turn"
                );
            }
        }
    });
}

#[test]
fn the_position_is_unobservable_but_its_drift_is_mitigated() {
    each(dives(), |run| {
        let sigma = |time| {
            run.sigma("ins.position.latitude", time).max(run.sigma("ins.position.longitude", time))
        };
        assert!(sigma(2059.0) > 1.0, "it never gets better than the metre it began with");
        // with a scale factor known to 0.3 %, as before the square, a path of 7.2 km would end 20 m
        // off
        assert!(sigma(2059.0) < 3.0, "{}", sigma(2059.0));
    });
}

#[test]
fn in_the_2d_run_all_states_but_the_dvl_roll_angle_are_estimated_quite_well() {
    each(flat(), |run| {
        let roll = run.sigma("dvl.misalignment.roll", 2039.0);
        assert!(roll > 0.3, "of a prior of 1 deg; the banked turns tell a little: {roll}");
    });
    // the same bounds as in the 3-D run
    for (name, bound) in [
        ("dvl.scale.k", 300e-6),
        ("dvl.misalignment.pitch", 0.04),
        ("dvl.misalignment.yaw", 0.03),
        ("ins.attitude.yaw", 0.025),
        ("ins.attitude.roll", 0.0008),
        ("ins.attitude.pitch", 0.0008),
        ("ins.accel_bias.x", 6.0),
        ("ins.accel_bias.y", 6.0),
        ("ins.gyro_bias.x", 0.007),
        ("ins.gyro_bias.y", 0.007),
    ] {
        for (run, end) in [(flat(), 2039.0), (dives(), 2059.0)] {
            // twice the sigma of the optimal filter: the root mean square of 8 errors exceeds it
            // once in 10 000 times
            assert!(rms(run, name, end) < bound, "{name}: {}", rms(run, name, end));
        }
    }
}
