//! The Cramer-Rao bound against analytic and dense solutions, for sensors written by an outsider.
#![allow(missing_docs, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod dense;
mod outsider;

use dense::{Dense, Measurement, Propagation};
use navfuse_campaign::{BoundRecord, Campaign, Columns, Extent, Options, Record, execute};
use navfuse_core::document::Document;
use navfuse_core::nalgebra::{DMatrix, dmatrix};
use navfuse_core::plugin::Registry;
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn registry() -> Registry {
    let mut registry = navfuse_testing::registry();
    registry.add(&outsider::Outsider);
    registry
}

fn bound(mut document: Document, settings: &[&str], every: f64) -> (Columns, BoundRecord) {
    let registry = registry();
    settings.iter().try_for_each(|s| document.set(s)).expect("the settings fit");
    let options = Options { every: Some(every), ..Options::default() };
    let plan = Campaign::new(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    let mut bound = None;
    let keep = |record| {
        if let Record::Bound(record) = record {
            bound = Some(record);
        }
        Ok(())
    };
    let stop = AtomicBool::new(false);
    execute(
        &plan,
        &registry,
        &document,
        Extent { threads: 1, ..Extent::default() },
        &stop,
        |_| {},
        keep,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    (plan.columns, bound.expect("a bound"))
}

fn toml(text: &str) -> Document {
    Document::parse("test.toml", text).expect("it is TOML")
}

fn close(found: f64, expected: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < 1e-9, "{what}: {found:.17} {expected:.17}");
}

/// A level that is a random walk with `Q = 0.04 m^2` per second, and a gauge that measures it every
/// second with `R = 0.09 m^2`.
const GAUGE: &str = r#"
[sensor.gauge]
noise = "0.3 m"
level = { sigma = "5 m", truth = "2 m", random_walk = "0.2 m/sqrt(s)" }
simulation = { rate = "1 Hz" }
[sensor.witness]
simulation = { rate = "2 Hz" }
[[source.simulation.segments]]
type = "static"
duration = "400 s"
"#;

const Q: f64 = 0.04;
const R: f64 = 0.09;

/// Returns the steady state of `P+ = P- R / (P- + R)`, `P- = P+ + Q`: before and after an update.
fn riccati(r: f64) -> [f64; 2] {
    let prior = Q / 2.0 + (Q * Q / 4.0 + Q * r).sqrt();
    [prior, prior * r / (prior + r)]
}

/// The witness provides the truth twice a second: after each update, and half-way to the next one,
/// when half of Q has been added.
#[test]
fn the_bound_of_a_level_that_walks_is_the_steady_state_of_the_riccati_equation() {
    let (columns, record) = bound(toml(GAUGE), &[], 0.5);
    assert_eq!((columns.components.len(), record.rows.len()), (1, 801));
    let [prior, posterior] = riccati(R);
    for (_, time, filtered, _) in record.rows.iter().filter(|row| row.1 >= 100.0) {
        let expected = if time.fract() == 0.0 { posterior } else { (prior + posterior) / 2.0 };
        close(filtered[0], expected.sqrt(), &format!("{time} s"));
    }
}

/// After an update, the forward filter has the covariance `P+` and the backward filter `P-`;
/// half-way between two updates both have `P+ + Q/2`. Their information adds.
#[test]
fn in_the_middle_of_a_long_run_the_smoothed_bound_is_that_of_the_two_filters() {
    let (_, record) = bound(toml(GAUGE), &[], 0.5);
    let [prior, posterior] = riccati(R);
    for (_, time, _, smoothed) in record.rows.iter().filter(|row| (100.0..=300.0).contains(&row.1))
    {
        let expected = if time.fract() == 0.0 {
            1.0 / (1.0 / posterior + 1.0 / prior)
        } else {
            (posterior + Q / 2.0) / 2.0
        };
        close(smoothed[0], expected.sqrt(), &format!("{time} s"));
    }
}

/// At the end there are no later samples, so both bounds agree.
#[test]
fn the_smoothed_bound_ends_where_the_filtered_one_does_and_is_nowhere_above_it() {
    let (_, gauge) = bound(toml(GAUGE), &[], 0.5);
    let (_, cart) = bound(toml(CART), &[], 0.5);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/pan-wu-3d.toml");
    let document = Document::from_file(&path).expect("the scenario is there");
    let (_, run) = bound(document, &["sensor.imu.simulation.rate=\"20 Hz\""], 5.0);
    for record in [gauge, cart, run] {
        for (_, time, filtered, smoothed) in &record.rows {
            for (filtered, smoothed) in filtered.iter().zip(smoothed) {
                // equal except for rounding where later samples hold no information
                assert!(
                    *smoothed <= filtered * (1.0 + 1e-9) && *smoothed > 0.0,
                    "{time} s: {smoothed} {filtered}"
                );
            }
        }
        let (_, _, filtered, smoothed) = record.rows.last().expect("rows");
        assert_eq!(filtered, smoothed);
    }
}

/// A cart at 3 m/s with white acceleration, and two sensors at rates without a common multiple in
/// the run. A log with two correlated channels measures `k v + b` and `p + b/2`, with a wrong
/// initial scale and a Gauss-Markov bias; a fix measures `p`.
const CART: &str = r#"
[estimator]
start = "0 s"
[process.cart]
[sensor.log]
scale = { initial = 0.8, sigma = 0.3, truth = 1.1 }
bias = { sigma = "0.5 m", truth = "0.1 m", correlation_time = "4 s" }
simulation = { rate = "2 Hz", offset = "0.1 s" }
[sensor.fix]
noise = "0.7 m"
simulation = { rate = "0.4 Hz", offset = "0.6 s" }
[sensor.witness]
simulation = { rate = "2 Hz" }
[source.simulation.start]
speed = "3 m/s"
[[source.simulation.segments]]
type = "cruise"
duration = "12 s"
"#;

/// Dense reference of [`CART`]: state p, v, k, b.
fn cart(noise: f64) -> Dense {
    let (speed, scale) = (3.0, 1.1);
    let log = dmatrix![0.0, scale, speed, 1.0; 1.0, 0.0, 0.0, 0.5];
    let r_log = DMatrix::from_row_slice(2, 2, &outsider::LOG_NOISE) * noise * noise;
    let fix = dmatrix![1.0, 0.0, 0.0, 0.0];
    let r_fix = dmatrix![0.49];
    let mut events: Vec<(u32, Option<Measurement>)> = Vec::new();
    // in tenths of a second; at equal times a sensor precedes the witness
    events.extend((1..=120).step_by(5).map(|t| (t, Some((log.clone(), r_log.clone())))));
    events.extend((6..=120).step_by(25).map(|t| (t, Some((fix.clone(), r_fix.clone())))));
    events.extend((5..=120).step_by(5).map(|t| (t, None)));
    events.sort_by_key(|e| (e.0, e.1.is_none()));
    let mut before = 0;
    let steps = events.into_iter().map(|(t, measurement)| {
        let dt = f64::from(t - before) / 10.0;
        before = t;
        let decay = (-dt / 4.0_f64).exp();
        let phi = dmatrix![
            1.0, dt, 0.0, 0.0;
            0.0, 1.0, 0.0, 0.0;
            0.0, 0.0, 1.0, 0.0;
            0.0, 0.0, 0.0, decay
        ];
        let mut q = DMatrix::zeros(4, 4);
        q.view_mut((0, 0), (2, 2)).copy_from(&outsider::white_acceleration(dt));
        q[(3, 3)] = 0.25 * (1.0 - decay * decay);
        Propagation { phi, q, measurement }
    });
    let prior = [outsider::PLACE_SIGMA, outsider::SPEED_SIGMA, 0.3, 0.5].map(|s: f64| s * s);
    Dense::new(DMatrix::from_diagonal(&prior.to_vec().into()), steps.collect())
}

#[test]
fn the_bound_of_several_coupled_states_is_that_of_dense_least_squares_filtered_and_smoothed() {
    let (columns, record) = bound(toml(CART), &[], 0.5);
    let names: Vec<String> =
        columns.components.iter().map(navfuse_campaign::Component::name).collect();
    assert_eq!(names, ["cart.place.x", "cart.speed.x", "log.scale.k", "log.bias.x"]);
    let expected = cart(1.0).sigmas();
    // the first epoch is the start; the reference begins after it
    assert_eq!(record.rows.len(), expected.len() + 1);
    for ((_, time, filtered, smoothed), expected) in record.rows[1..].iter().zip(&expected) {
        for k in 0..4 {
            close(filtered[k], expected.filtered[k], &format!("{time} s, filtered {}", names[k]));
            close(smoothed[k], expected.smoothed[k], &format!("{time} s, smoothed {}", names[k]));
        }
    }
}

#[test]
fn noise_that_is_simulated_twofold_is_the_noise_of_the_bound() {
    let (_, record) = bound(toml(CART), &["sensor.log.simulation.noise=2"], 0.5);
    for ((_, time, filtered, smoothed), expected) in
        record.rows[1..].iter().zip(&cart(2.0).sigmas())
    {
        for k in 0..4 {
            close(filtered[k], expected.filtered[k], &format!("{time} s, filtered {k}"));
            close(smoothed[k], expected.smoothed[k], &format!("{time} s, smoothed {k}"));
        }
    }
    // in the steady state of the gauge, the sensor's noise is doubled, the random walk is not
    let (_, record) = bound(toml(GAUGE), &["sensor.gauge.simulation.noise=2"], 0.5);
    let (_, _, filtered, _) = record.rows.last().expect("rows");
    close(filtered[0], riccati(4.0 * R)[1].sqrt(), "gauge");
}

/// Noise of a driving sensor is process noise.
#[test]
fn doubled_simulated_noise_of_imu_and_dvl_has_the_bound_of_doubled_stated_noise() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/pan-wu-3d.toml");
    let document = Document::from_file(&path).expect("the scenario is there");
    let with = |more: &[&str]| {
        let short = ["estimator.stop=\"740 s\"", "sensor.imu.simulation.rate=\"20 Hz\""];
        bound(document.clone(), &[&short[..], more].concat(), 5.0)
    };
    let (columns, simulated) =
        with(&["sensor.imu.simulation.noise=2", "sensor.dvl.simulation.noise=2"]);
    let (_, stated) = with(&[
        "sensor.imu.gyro_noise=\"0.2 deg/h/sqrt(Hz)\"",
        "sensor.imu.accel_noise=\"20 ug/sqrt(Hz)\"",
        "sensor.dvl.noise=\"4 cm/s\"",
    ]);
    let (_, once) = with(&[]);
    assert_eq!(simulated.rows.len(), stated.rows.len());
    for (a, b) in simulated.rows.iter().zip(&stated.rows) {
        for (k, component) in columns.components.iter().enumerate() {
            close(a.2[k], b.2[k], &format!("{} s, {}", a.1, component.name()));
            close(a.3[k], b.3[k], &format!("{} s, smoothed {}", a.1, component.name()));
        }
    }
    let k = columns.components.iter().position(|c| c.name() == "dvl.scale.k").expect("k");
    let last = |record: &BoundRecord| record.rows.last().expect("rows").2[k];
    assert!(last(&simulated) > 1.5 * last(&once), "{} {}", last(&simulated), last(&once));
}
