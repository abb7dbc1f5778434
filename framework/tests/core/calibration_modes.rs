//! Estimated, considered and fixed blocks, and blocks that move by themselves.

use navfuse_core::nalgebra::{DMatrix, DVector};
use navfuse_testing::lab::{self, Bench, DENSITY};

#[test]
fn a_fixed_block_has_no_error_state() {
    let b = Bench::new(&["sensor.fix.bias=\"30 cm\""]);
    assert_eq!(b.ekf.layout().tangent, 2);
    assert_eq!(b.ekf.layout().find("fix.bias").unwrap().tangent, None);
    assert!((b.value("fix.bias") - 0.3).abs() < 1e-15);
}

#[test]
fn a_considered_block_is_schmidts_the_optimal_filter_with_its_gain_zeroed() {
    let mut b = Bench::new(&[
        "sensor.fix.bias={ mode = \"consider\", initial = \"20 cm\", sigma = \"40 cm\" }",
    ]);
    b.give("speed", 0.0, &[1.0]);
    // the augmented filter written out densely: place, drift, bias
    let (mut x, mut p) = (
        DVector::from_vec(vec![0.0, 0.0, 0.2]),
        DMatrix::from_diagonal(&[1.0, 0.25, 0.16].to_vec().into()),
    );
    for k in 1..200 {
        let t = f64::from(k) * 0.5;
        let truth = 0.9 * t;
        let z = truth + 0.2 + 0.05 * (5.0 * t).sin();
        b.give("speed", t, &[1.0]).give("fix", t, &[z]);
        let mut phi = DMatrix::identity(3, 3);
        phi[(0, 1)] = -0.5;
        x[0] += (1.0 - x[1]) * 0.5;
        p = &phi * p * phi.transpose();
        p[(0, 0)] += DENSITY * 0.5;
        let h = DMatrix::from_row_slice(1, 3, &[1.0, 0.0, 1.0]);
        let s = (&h * &p * h.transpose())[(0, 0)] + 0.01;
        let mut gain = &p * h.transpose() / s;
        gain[(2, 0)] = 0.0;
        x += &gain * (z - x[0] - x[2]);
        let a = DMatrix::identity(3, 3) - &gain * &h;
        p = &a * p * a.transpose() + &gain * gain.transpose() * 0.01;
        // 10 times the rounding of 200 steps of 2^-53 with numbers of at most 100 (place) and 1
        // (covariance)
        assert!((b.value("cart.place") - x[0]).abs() < 2e-11);
        let found = b.ekf.covariance().to_dense();
        assert!((&found - &p).amax() < 1e-12, "{found}{p}");
        assert_eq!(b.value("fix.bias"), 0.2);
        assert_eq!(b.variance("fix.bias").to_bits(), (0.4_f64 * 0.4).to_bits());
    }
    // its uncertainty is carried: the place is never better known than the bias
    assert!(b.variance("cart.place") > 0.16);
}

#[test]
fn a_gauss_markov_block_returns_to_its_initial_value_and_its_variance_to_the_stationary_one() {
    let drift = "process.cart.drift={ initial = \"2 m/s\", sigma = \"0.5 m/s\", \
                 correlation_time = \"10 s\" }";
    let mut b = Bench::new(&[drift]);
    b.give("speed", 0.0, &[2.0]);
    assert!((b.variance("cart.drift") - 0.25).abs() < 1e-15);
    // a measurement pulls it away and makes it better known
    b.give("speed", 1.0, &[2.0]).give("fix", 1.0, &[1.5]);
    let (away, variance) = (b.value("cart.drift") - 2.0, b.variance("cart.drift"));
    assert!(away.abs() > 0.05 && variance < 0.24, "{away} {variance}");
    for k in 1..=300 {
        b.give("speed", 1.0 + f64::from(k) * 0.1, &[2.0]);
    }
    // over 30 s: x = mu + (x0 - mu) e^-3, P = sigma^2 + (P0 - sigma^2) e^-6 (Groves eq. 3.3),
    // within the rounding of 300 steps
    assert!((b.value("cart.drift") - 2.0 - away * (-3.0_f64).exp()).abs() < 1e-13);
    assert!((b.variance("cart.drift") - 0.25 - (variance - 0.25) * (-6.0_f64).exp()).abs() < 1e-13);
}

#[test]
fn the_steps_of_a_gauss_markov_block_add_up_whatever_their_length() {
    let drift = "process.cart.drift={ initial = \"2 m/s\", sigma = \"0.5 m/s\", \
                 correlation_time = \"10 s\" }";
    let run = |steps: u32| {
        let mut b = Bench::new(&[drift]);
        b.give("speed", 0.0, &[2.0]).give("fix", 0.0, &[0.3]);
        for k in 1..=steps {
            b.give("speed", 8.0 * f64::from(k) / f64::from(steps), &[2.0]);
        }
        (b.value("cart.drift"), b.variance("cart.drift"))
    };
    let (one, many) = (run(1), run(1000));
    assert!((one.0 - many.0).abs() < 1e-12 && (one.1 - many.1).abs() < 1e-12, "{one:?} {many:?}");
}

#[test]
fn a_random_walk_grows_by_its_density_times_the_time() {
    let mut b = Bench::new(&[
        "process.cart.drift={ sigma = \"0.5 m/s\", random_walk = \"0.1 m/s/sqrt(s)\" }",
    ]);
    b.give("speed", 0.0, &[1.0]);
    for k in 1..=100 {
        b.give("speed", f64::from(k) * 0.3, &[1.0]);
    }
    // 0.25 + 0.01 x 30, to 100 roundings
    assert!((b.variance("cart.drift") - 0.55).abs() < 1e-13, "{}", b.variance("cart.drift"));
}

#[test]
fn a_state_that_moves_without_a_sigma_or_though_it_is_fixed_is_refused() {
    let cases = [
        ("{ random_walk = \"0.1 m/s/sqrt(s)\" }", "drift.random_walk", "needs a sigma"),
        ("{ correlation_time = \"10 s\" }", "drift.correlation_time", "needs a sigma"),
        (
            "{ mode = \"fixed\", random_walk = \"0.1 m/s/sqrt(s)\" }",
            "drift.random_walk",
            "does not move",
        ),
        (
            "{ mode = \"fixed\", sigma = \"1 m/s\", correlation_time = \"9 s\" }",
            "drift.correlation_time",
            "does not",
        ),
    ];
    for (drift, key, text) in cases {
        let message = lab::refused(lab::SCENARIO, &[&format!("process.cart.drift={drift}")]);
        assert!(message.contains(key) && message.contains(text), "{message}");
    }
}

#[test]
fn a_time_that_no_clock_shows_and_a_driving_sensor_that_drives_nothing_are_refused() {
    // 2^61 ns are 73 years, 2.3e9 s
    for key in ["start", "stop"] {
        for time in ["3e9 s", "-3e9 s"] {
            let message = lab::refused(lab::SCENARIO, &[&format!("estimator.{key}=\"{time}\"")]);
            assert!(
                message.contains(&format!("estimator.{key}")) && message.contains("73 years"),
                "{message}"
            );
        }
    }
    let spare = format!("{}[sensor.spare]\ntype = \"speedometer\"\n", lab::SCENARIO);
    let message = lab::refused(&spare, &[]);
    assert!(
        message.contains("[sensor.spare] drives no process; remove it, or set enabled = false"),
        "{message}"
    );
    lab::compose(&spare, &["sensor.spare.enabled=false"]);
}
