//! The equation of a GNSS receiver against geometry in Earth-centred axes, and what a filter makes
//! of it.
#![allow(clippy::expect_used, clippy::panic, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::document::Document;
use navfuse_core::nalgebra::{Matrix3, Vector3};
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_core::state::covariance::{Covariance, Update};
use navfuse_core::state::geodesy::{ECCENTRICITY_SQUARED, EQUATORIAL_RADIUS, radii_of_curvature};
use navfuse_core::units::sample::Sample;
use navfuse_testing::ModelBench;
use std::sync::atomic::AtomicBool;

/// Eastwards at 70 deg north from 179.995 deg east: the antimeridian is 191 m away.
const SCENARIO: &str = r#"
    name = "antimeridian"
    seed = 1

    [estimator]
    draw = "all"

    [process.ins]
    attitude = { sigma = ["0.05 deg", "0.05 deg", "1 deg"] }
    velocity = { sigma = "5 cm/s" }
    position = { sigma = "5 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "100 ug" }

    [sensor.imu]
    gyro_noise = "0.2 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.gnss]
    horizontal_noise = "1 m"
    vertical_noise = "2 m"
    velocity_noise = ["3 cm/s", "3 cm/s", "5 cm/s"]
    bias = { sigma = ["1 m", "1 m", "2 m"], correlation_time = "100 s" }
    lever_arm = { initial = ["0.5 m", "0.2 m", "-1 m"], sigma = "5 cm" }
    simulation = { rate = "2 Hz" }

    [sensor.reference]
    simulation = { rate = "10 Hz" }

    [source.simulation]
    start = { latitude = "70 deg", longitude = "179.995 deg", heading = "90 deg" }
    segments = [
        { type = "surge", duration = "20 s", speed = "5 m/s" },
        { type = "turn", duration = "20 s", angle = "30 deg", bank = "10 deg" },
        { type = "turn", duration = "20 s", angle = "-60 deg", bank = "10 deg" },
        { type = "cruise", duration = "140 s" },
    ]
"#;

fn scenario<T>(settings: &[&str], f: impl FnOnce(&Scenario<'_>) -> T) -> T {
    navfuse_testing::scenario(SCENARIO, settings, f)
}

fn run(settings: &[&str]) -> Finished {
    let assembly = scenario(settings, |s| s.assemble(None).unwrap_or_else(|e| panic!("{e}")));
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    finished
}

/// The model in motion at a place.
fn bench(settings: &[&str], position: [f64; 3]) -> ModelBench {
    let blocks: [(&str, &[f64]); 3] = [
        ("ins.position", &position),
        ("ins.attitude", &[0.2, -0.1, 2.0]),
        ("ins.velocity", &[3.0, -2.0, 0.5]),
    ];
    let mut bench = ModelBench::new(SCENARIO, settings, "gnss", &blocks);
    bench.state.signals[..3].copy_from_slice(&[0.1, -0.2, 0.3]);
    bench
}

fn linearise(bench: &ModelBench, sample: &Sample) -> Update {
    let mut update = Update::with_capacity(bench.composition.layout.tangent, 16);
    bench.model.linearise(&bench.at(sample), &mut update);
    update
}

fn sample(values: &[f64]) -> Sample {
    ModelBench::sample(values)
}

fn to_ecef([latitude, longitude, height]: [f64; 3]) -> Vector3<f64> {
    let ((sl, cl), (so, co)) = (latitude.sin_cos(), longitude.sin_cos());
    let r_e = EQUATORIAL_RADIUS / (1.0 - ECCENTRICITY_SQUARED * sl * sl).sqrt();
    let across = (r_e + height) * cl;
    Vector3::new(across * co, across * so, (r_e * (1.0 - ECCENTRICITY_SQUARED) + height) * sl)
}

/// By fixed-point iteration, whose error falls by e^2 = 0.0067 a step.
fn from_ecef(p: &Vector3<f64>) -> [f64; 3] {
    let across = p.x.hypot(p.y);
    let mut latitude = p.z.atan2(across);
    let mut r_e = EQUATORIAL_RADIUS;
    for _ in 0..20 {
        r_e = EQUATORIAL_RADIUS / (1.0 - ECCENTRICITY_SQUARED * latitude.sin().powi(2)).sqrt();
        latitude = (p.z + ECCENTRICITY_SQUARED * r_e * latitude.sin()).atan2(across);
    }
    [latitude, p.y.atan2(p.x), across / latitude.cos() - r_e]
}

/// From north, east, down to the Earth's axes.
fn c_n_e(latitude: f64, longitude: f64) -> Matrix3<f64> {
    let ((sl, cl), (so, co)) = (latitude.sin_cos(), longitude.sin_cos());
    Matrix3::new(-sl * co, -so, -cl * co, -sl * so, co, -cl * so, cl, 0.0, -sl)
}

const FIXED: [&str; 2] = ["sensor.gnss.lever_arm={}", "sensor.gnss.bias={}"];

#[test]
fn the_innovation_is_the_way_from_estimate_to_fix_in_metres_at_70_degrees_and_across_the_antimeridian()
 {
    // 4 m east of the first two is beyond 180 deg; -4 m east of the third too
    for longitude in [179.999_99, 180.0, -179.999_99, 12.0_f64] {
        for way in [[3.0, 4.0, -2.0], [-3.0, -4.0, 2.0]].map(Vector3::from) {
            let position = [70_f64.to_radians(), longitude.to_radians(), 500.0];
            let bench = bench(&FIXED, position);
            let fix = from_ecef(&(to_ecef(position) + c_n_e(position[0], position[1]) * way));
            let mut update = linearise(&bench, &sample(&fix));
            let (r_n, r_e) = radii_of_curvature(position[0]);
            let y = &update.innovation;
            let metres =
                Vector3::new(y[0] * (r_n + 500.0), y[1] * (r_e + 500.0) * position[0].cos(), -y[2]);
            // The Earth falls away by way^2 tan(latitude) / R = 25 * 2.7 / 6.4e6 = 1.1e-5 m at the
            // most.
            assert!((metres - way).amax() < 1.2e-5, "{longitude}: {metres} {way}");
            // With a certain state S = R: (3 m / 1 m)^2 + (4 m / 1 m)^2 + (2 m / 2 m)^2, each to 2
            // * 1.2e-5 m / way.
            let nis = update
                .innovate(&Covariance::zero(bench.composition.layout.tangent))
                .expect("a noise");
            assert!((nis - 26.0).abs() < 26.0 * 2e-5, "{nis}");
        }
    }
}

/// Settings of a receiver that gives the position alone.
const FLAT: &str = "sensor.gnss={ horizontal_noise = '1 m', vertical_noise = '2 m' }";

/// Eastwards over the antimeridian it is 2e-6 rad: 5 m at 70 deg.
#[test]
fn a_receiver_without_velocity_goes_the_short_way_round_too() {
    let (r_n, r_e) = radii_of_curvature(70_f64.to_radians());
    let pi = std::f64::consts::PI;
    let bench = bench(&[FLAT], [70_f64.to_radians(), pi - 1e-6, 500.0]);
    let fix = sample(&[70_f64.to_radians(), 1e-6 - pi, 493.0]);
    let update = linearise(&bench, &fix);
    assert_eq!(update.m, 3);
    // a longitude near pi is rounded to 4e-16
    let off = (update.innovation[1] - 2e-6).abs().max(update.innovation[0].abs());
    assert!(off < 2e-15 && (update.innovation[2] + 7.0).abs() < 1e-9, "{:?}", update.innovation);
    let metres = [r_n + 500.0, (r_e + 500.0) * 70_f64.to_radians().cos(), 1.0];
    let found = bench.variances(&fix);
    for (k, sigma) in [1.0, 1.0, 2.0].into_iter().enumerate() {
        assert!((found[k].sqrt() * metres[k] / sigma - 1.0).abs() < 1e-12, "{found:?}");
    }
}

#[test]
fn a_simulated_fix_is_the_antenna_with_a_longitude_within_half_a_turn() {
    let pi = std::f64::consts::PI;
    for settings in [&FIXED[..], &[FLAT]] {
        for (longitude, expected) in [(pi + 0.01, 0.01 - pi), (-0.01 - pi, pi - 0.01), (3.0, 3.0)] {
            let bench = bench(settings, [0.7, longitude, 20.0]);
            let time = navfuse_core::units::time::Time::default();
            let fix = bench.simulate(time, time).array::<3>(0).expect("a position");
            let off = fix[1] - expected;
            assert!((fix[0] - 0.7).abs() < 1e-15 && off.abs() < 1e-14, "{longitude}: {fix:?}");
            assert!((fix[2] - 20.0).abs() < 1e-9, "{fix:?}");
        }
    }
}

#[test]
fn the_antenna_is_at_its_lever_arm_and_moves_with_the_rotation_of_the_body() {
    let position = [-0.5, 1.0, 30.0];
    let arm = "sensor.gnss.lever_arm=['0.5 m', '-0.3 m', '-2 m']";
    let bench = bench(&[arm, "sensor.gnss.bias={}"], position);
    let mut h = [0.0; 6];
    bench.model.predict(&bench.at(&sample(&[])), &mut h);
    let block = bench.composition.layout.find("ins.attitude").expect("an attitude");
    let c = navfuse_core::state::manifold::load_quaternion(&bench.state.values[block.range()])
        .to_rotation_matrix();
    let l = Vector3::new(0.5, -0.3, -2.0);
    let antenna = from_ecef(&(to_ecef(position) + c_n_e(position[0], position[1]) * (c * l)));
    // 2.1 m: the Earth falls away by 4.4 / 6.4e6 = 7e-7 m, 1.1e-13 rad
    assert!(
        (h[0] - antenna[0]).abs() < 2e-13
            && (h[1] - antenna[1]).abs() < 2e-13
            && (h[2] - antenna[2]).abs() < 1e-6
    );
    let earth =
        Vector3::new(position[0].cos(), 0.0, -position[0].sin()) * navfuse_ins::earth::EARTH_RATE;
    let rate = Vector3::new(0.1, -0.2, 0.3) - c.inverse() * earth; // gyro bias is zero
    let v = Vector3::new(3.0, -2.0, 0.5) + c * rate.cross(&l);
    assert!((Vector3::new(h[3], h[4], h[5]) - v).amax() < 1e-14, "{h:?} {v}");
}

#[test]
fn the_jacobian_is_the_derivative_at_high_latitude_too() {
    for position in [[1.22, 3.1, 0.0], [-1.5, 0.3, 8000.0], [0.0, -3.0, -20.0]] {
        let bench = bench(&[], position);
        let error = bench.jacobian_error();
        // steps of 1 km: (1 km / R)^2 tan^2(latitude) / 3, tan(1.5) = 14: 1.6e-6; the others 6e-8
        assert!(error < 2e-6, "{position:?}: {error}");
    }
}

#[test]
fn a_fix_without_height_or_velocity_is_used_for_what_it_has() {
    let bench = bench(&[], [0.7, 0.1, 0.0]);
    let all = linearise(&bench, &sample(&[0.7, 0.1, 0.0, 3.0, -2.0, 0.5]));
    let mut flat = sample(&[0.7, 0.1, 0.0, 3.0, -2.0, 0.5]);
    flat.clear(2);
    flat.clear(5);
    let update = linearise(&bench, &flat);
    assert_eq!((all.m, update.m), (6, 4));
    let without = |v: &[f64]| [v[0], v[1], v[3], v[4]].to_vec();
    assert_eq!(update.innovation, without(&all.innovation));
    let diagonal = |u: &Update| (0..u.m).map(|i| u.r[i * u.m + i]).collect::<Vec<_>>();
    assert_eq!(diagonal(&update), without(&diagonal(&all)));
}

#[test]
fn the_accuracy_that_the_receiver_reports_takes_the_place_of_the_noise() {
    let bench = bench(&["sensor.gnss.accuracy_factor=2"], [0.7, 0.1, 0.0]);
    let (r_n, r_e) = radii_of_curvature(0.7);
    let metres = [r_n, r_e * 0.7_f64.cos(), 1.0, 1.0, 1.0, 1.0];
    let sigma = |extra: [f64; 3]| {
        let mut fix = sample(&[0.7, 0.1, 0.0, 3.0, -2.0, 0.5]);
        (0..3).filter(|&k| !extra[k].is_nan()).for_each(|k| fix.set(6 + k, extra[k]));
        let update = linearise(&bench, &fix);
        let sigma: [f64; 6] = std::array::from_fn(|i| update.r[7 * i].sqrt() * metres[i]);
        sigma.map(|s| (s * 1e9).round() / 1e9)
    };
    assert_eq!(sigma([f64::NAN; 3]), [1.0, 1.0, 2.0, 0.03, 0.03, 0.05]);
    assert_eq!(sigma([4.0, 5.0, 0.2]), [8.0, 8.0, 10.0, 0.4, 0.4, 0.4]);
    // none of them means anything
    assert_eq!(sigma([0.0, -1.0, f64::NAN]), [1.0, 1.0, 2.0, 0.03, 0.03, 0.05]);
}

/// The factor comes first: 2 x 4 m and 2 x 0.2 m/s are above their floors, 2 x 5 m is below. Of a sample without
/// an accuracy the noise counts, which is below them.
#[test]
fn a_reported_accuracy_is_never_below_its_floor() {
    let floor = "sensor.gnss.accuracy_floor={ vertical = '11 m', horizontal = '3 m' }";
    let bench = bench(&["sensor.gnss.accuracy_factor=2", floor], [0.7, 0.1, 0.0]);
    let sigma = |accuracy: f64| {
        let mut fix = sample(&[0.7, 0.1, 0.0, 3.0, -2.0, 0.5]);
        [4.0, accuracy, 0.2].iter().enumerate().for_each(|(k, a)| fix.set(6 + k, *a));
        let update = linearise(&bench, &fix);
        [2, 3].map(|i| (update.r[7 * i].sqrt() * 1e9).round() / 1e9)
    };
    assert_eq!(sigma(5.0), [11.0, 0.4]);
    assert_eq!(sigma(6.0), [12.0, 0.4]);
    assert_eq!(sigma(-1.0), [2.0, 0.4]);
}

#[test]
fn without_a_velocity_noise_there_is_no_velocity() {
    let names = |settings: &[&str]| {
        let composition = scenario(settings, |s| s.compose().unwrap_or_else(|e| panic!("{e}")));
        let sensor = &composition.sensors[composition.sensor("gnss").expect("a receiver")];
        sensor.info.channels.iter().map(|c| c.column()).collect::<Vec<_>>().join(" ")
    };
    let without = names(&["sensor.gnss={ horizontal_noise = '1 m', vertical_noise = '2 m' }"]);
    assert_eq!(without, "lat_rad lon_rad height_m h_acc_m v_acc_m");
    let all = "lat_rad lon_rad height_m vel_n_mps vel_e_mps vel_d_mps h_acc_m v_acc_m s_acc_mps";
    assert_eq!(names(&[]), all);
}

#[test]
fn nis_and_position_are_right_across_the_antimeridian_at_70_degrees() {
    let (mut sum, mut count, mut squares) = (0.0, 0.0, 0.0);
    for seed in 1..=8 {
        let summary = run(&[&format!("seed={seed}")]).summary;
        let gnss = &summary.samples["gnss"];
        let n = gnss["accepted"].as_f64().expect("a count");
        sum += gnss["mean_nis"].as_f64().expect("a mean") * n;
        count += n;
        let position = summary.rows.iter().find(|r| r.name == "ins.position").expect("a position");
        let error = position.error.as_ref().expect("a reference");
        squares += (0..3).map(|k| (error[k] / position.sigma[k]).powi(2)).sum::<f64>();
        assert!(position.sigma[..2].iter().all(|s| *s < 1.2), "{:?}", position.sigma);
    }
    assert!(count > 8.0 * 395.0, "{count} of 8 x 400 samples are used");
    // Chi-square of 6: mean 6, variance 12. Four sigma.
    assert!((sum / count - 6.0).abs() < 4.0 * (12.0 / count).sqrt(), "mean NIS {}", sum / count);
    // 24 squares, those of one run correlated by little: chi-square of 24 is between 8 and 50 with
    // probability 0.998.
    assert!((8.0..50.0).contains(&squares), "{squares}");
}

#[test]
fn a_wrong_key_or_unit_is_told_with_its_place() {
    let mut registry = Registry::new();
    registry
        .add(&navfuse_ins::InsPlugin)
        .add(&navfuse_gnss::GnssPlugin)
        .add(&navfuse_simulation::SimulationPlugin);
    let told = |set: &str| {
        let document = Document::parse("antimeridian.toml", SCENARIO).expect("a scenario");
        let scenario = Scenario::new(&registry, document, &[set.to_owned()]);
        let error = scenario
            .map_err(|e| e.to_string())
            .and_then(|s| s.compose().map_err(|e| e.to_string()));
        error.err().unwrap_or_else(|| panic!("{set} passes"))
    };
    for (set, place) in [
        ("sensor.gnss.horizontal_noise=1 s", "horizontal_noise"),
        ("sensor.gnss.velocity_noise=-1 m/s", "velocity_noise"),
        ("sensor.gnss.accuracy_factor=0", "accuracy_factor"),
        ("sensor.gnss.accuracy_floor={ horizontal = '0 m' }", "horizontal"),
        ("sensor.gnss.navigation=imu", "navigation"),
        ("sensor.gnss.noise=1 m", "noise"),
    ] {
        let text = told(set);
        assert!(text.contains(place), "{set}: {text}");
    }
}

#[test]
fn a_fix_off_the_earth_is_refused() {
    let bench = bench(&[], [0.8, 0.1, 0.0]);
    let id = bench.composition.sensor("gnss").expect("the sensor is there");
    let sensor = &bench.composition.sensors[id];
    let limit = |name: &str| {
        let channels = &sensor.info.channels;
        let limits = sensor.limits.iter().map(|(channel, limit)| (&channels[*channel], limit));
        let found = limits.filter(|(channel, _)| &*channel.name == name).map(|(_, limit)| limit);
        found.map(|limit| (limit.low, limit.high)).next()
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    assert_eq!(limit("lat"), Some((-quarter, quarter)));
    // the longitude may count from -180 or from 0 deg
    assert!(limit("lon").is_some_and(|(low, high)| low <= -2.0 * quarter && high >= 4.0 * quarter));
    // from the deepest trench to the satellites
    assert!(limit("height").is_some_and(|(low, high)| low < -11e3 && high > 1e7 && high < 1e8));
}

/// Receivers output 0 N 0 E until their first fix, some with a valid status: 5 s of it from the start, or
/// in the middle of the run. Where the fault is simulated, the error is 8000 km.
#[test]
fn zero_north_zero_east_is_no_fix() {
    for span in ["from = \"0 s\", to = \"5 s\"", "from = \"100 s\", to = \"105 s\""] {
        let faults = format!(
            "sensor.gnss.simulation.faults=[{{ type = \"stuck\", size = 0, {span}, channels = [\"lat\", \"lon\"] }}]"
        );
        let summary = run(&[&faults]).summary;
        let gnss = &summary.samples["gnss"];
        let unset = gnss["rejected_for"]["zero in place of a measurement"].as_u64();
        assert!(unset.is_some_and(|count| (9..=11).contains(&count)), "{gnss}");
        assert!(gnss["gated"].as_u64().is_some_and(|gated| gated < 5), "{gnss}");
        let position = summary.rows.iter().find(|r| r.name == "ins.position").expect("a position");
        let error = position.error.as_ref().expect("a reference");
        let sizes = (0..3).map(|k| (error[k] / position.sigma[k]).abs());
        let most = sizes.fold(0.0, f64::max);
        assert!(most < 4.0, "{error:?} {:?}", position.sigma);
    }
}
