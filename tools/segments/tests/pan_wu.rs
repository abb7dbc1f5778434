//! The runs of Pan & Wu: the segments and rates in their samples are those of Table 1.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test fails by panicking"
)]

use navfuse_core::document::Document;
use navfuse_core::run::scenario::Scenario;
use navfuse_segments::{
    Attitude, Directions, Increments, Kind, Positions, Recording, Segment, Settings, Sphere, find,
};
use navfuse_testing::registry;
use std::path::Path;

fn read(name: &str, settings: &[&str]) -> Recording {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios").join(name);
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let registry = registry();
    let document = Document::from_file(path).unwrap();
    Recording::read(&Scenario::new(&registry, document, &settings).unwrap())
        .unwrap_or_else(|e| panic!("{e}"))
}

fn found(recording: &Recording) -> (Settings, Vec<Segment>, Attitude) {
    let settings = Settings::of(recording);
    let (segments, attitude) = find(recording, &settings).unwrap_or_else(|e| panic!("{e}"));
    (settings, segments, attitude)
}

fn of(segments: &[Segment], kind: Kind) -> Vec<Segment> {
    segments.iter().copied().filter(|s| s.kind == kind).collect()
}

/// The profiles begin and end with zero slope: within 4 s the surge reaches 0.5 mm/s^3, ten times
/// the noise of a slope, and a turn of 90 deg in 30 s reaches 0.3 deg/s. The window of the slope is
/// 5 s.
#[test]
fn the_segments_are_those_of_table_1() {
    let recording = read("pan-wu-3d.toml", &[]);
    let (_, segments, _) = found(&recording);
    for s in &segments {
        println!("{} {} {}", s.kind, s.from, s.to);
    }
    let near = |a: f64, b: f64| (a - b).abs() <= 5.0;
    let rest = of(&segments, Kind::Static);
    assert_eq!(rest.len(), 1);
    assert!(near(rest[0].from, 0.0) && near(rest[0].to, 600.0), "{rest:?}");
    let one = of(&segments, Kind::TypeI);
    assert!(
        near(one[0].from, 600.0) && near(one.iter().rfind(|s| s.to < 800.0).unwrap().to, 750.0),
        "{one:?}"
    );
    assert!(
        one.iter().all(|s| s.to < 756.0 || s.from > 1964.0),
        "no Type I on the square: {one:?}"
    );
    let turns = of(&segments, Kind::TypeII);
    // four legs of 305 s: 275 s straight, then a turn of 30 s
    let ends = [1055.0, 1360.0, 1665.0, 1970.0];
    assert_eq!(turns.len(), 4, "{turns:?}");
    for (turn, end) in turns.iter().zip(ends) {
        assert!(near(turn.from, end - 30.0) && near(turn.to, end), "{turn:?}");
    }
}

#[test]
fn surge_and_dive_have_two_directions_and_the_level_run_one() {
    for (name, rank) in [("pan-wu-3d.toml", 2), ("pan-wu-2d.toml", 1)] {
        let recording = read(name, &[]);
        let (settings, segments, attitude) = found(&recording);
        let one = of(&segments, Kind::TypeI);
        let d = Directions::of(&recording, &settings, &attitude, &one);
        println!("{name}: {:.2e} noise {:.1e} axes {:.3}", d.singular_values, d.noise, d.axes);
        assert_eq!(d.rank, rank, "{name}: {d:?}");
        assert!(d.axes[(0, 0)].abs() > 0.99, "the thrust is forward: {}", d.axes);
    }
}

/// Gyros of 0.1 deg/h/sqrt(Hz) walk 0.1 deg/h sqrt(1460 s 1 s) = 0.0011 deg per axis from 600 to
/// 2060 s. Their mean at rest is accurate to 0.1/sqrt(600) = 0.004 deg/h, which is 0.0017 deg in
/// that time; in turns, the heading error leaves a part of the Earth's rate. Five sigma of both
/// over three axes: 0.017 deg.
#[test]
fn the_attitude_by_gyros_is_as_good_as_they_are() {
    let recording = read("pan-wu-3d.toml", &[]);
    let (_, _, attitude) = found(&recording);
    for t in [0.0, 300.0, 700.0, 1200.0, 2060.0] {
        let error = (recording.reference_attitude(t).unwrap().inverse() * attitude.at(t))
            .angle()
            .to_degrees();
        println!("{t} s: {error:.5} deg");
        assert!(error < 0.017, "{t} s: {error} deg");
    }
}

/// Without noise, bias and the Earth's rate, both sides of (18) are equal. The remaining difference
/// is the Coriolis acceleration that the equation leaves out, 2 w_ie x v, whose integral over the
/// surge is below 2 * 7.3e-5 rad/s * 200 m.
#[test]
fn the_two_sides_of_equation_18_differ_only_by_coriolis() {
    let quiet =
        ["sensor.imu.simulation.noise=0", "sensor.dvl.simulation.noise=0", "estimator.stop=720 s"];
    let recording = read("pan-wu-3d.toml", &quiet);
    let velocity = &recording.velocities[0];
    let truth = velocity.truth.unwrap();
    let segment = Segment { kind: Kind::TypeI, from: 600.0, to: 660.0 };
    let i = Increments::printed(&recording, velocity, &segment).unwrap();
    assert_eq!(i.time.len(), 301);
    let worst = (i.beta.iter().zip(&i.gamma))
        .map(|(b, g)| (b - truth.body(g)).norm())
        .fold(0.0_f64, f64::max);
    let largest = i.beta.iter().map(|b| b.norm()).fold(0.0_f64, f64::max);
    println!("largest beta {largest:.3} m/s, worst difference {worst:.4} m/s");
    assert!(largest > 4.9 && worst < 2.0 * 7.3e-5 * 200.0, "{worst}");
    assert!(worst > 1e-3, "Coriolis is present: {worst}");
}

/// All turns of the square are alike: roll and pitch change together, so that the points lie nearly
/// on a line, and Lemma 2's condition does not hold. It holds for turns that differ.
#[test]
fn turns_that_differ_have_a_sphere_and_its_centre_is_the_bias() {
    let bias =
        "process.ins.accel_bias={ sigma = \"5 mg\", truth = [\"5 mg\", \"-4 mg\", \"3 mg\"] }";
    let quiet = ["sensor.imu.simulation.noise=0", "sensor.dvl.simulation.noise=0", bias];
    let turn = |angle: i32, bank: i32, pitch: i32| {
        format!(
            "{{ type = \"turn\", duration = \"40 s\", angle = \"{angle} deg\", bank = \"{bank} deg\", \
             pitch = \"{pitch} deg\" }}"
        )
    };
    let rest = "{ type = \"static\", duration = \"620 s\" }, \
                { type = \"surge\", duration = \"60 s\", speed = \"3 m/s\" }";
    let turns =
        [turn(90, 20, 0), turn(-90, 20, 10), turn(120, -10, -15), turn(-60, 5, 20)].join(", ");
    let differ = format!("source.simulation.segments=[{rest}, {turns}]");
    let sphere = |settings: &[&str]| {
        let recording = read("pan-wu-3d.toml", settings);
        let (_, segments, attitude) = found(&recording);
        let velocity = &recording.velocities[0];
        let turns = of(&segments, Kind::TypeII);
        let sphere =
            Sphere::of(&recording, velocity, &velocity.truth.unwrap(), &attitude, &turns, 1.0);
        println!(
            "{} points {:.5}condition {:.0}",
            sphere.alpha.len(),
            sphere.singular_values,
            sphere.condition
        );
        (sphere, attitude.earth().gravity)
    };
    let (alike, _) = sphere(&quiet);
    assert!(alike.condition > 1e4, "{}", alike.condition);
    let (sphere, g) = sphere(&[&quiet[..], &[&differ]].concat());
    assert!(
        sphere.condition < 1e3 && sphere.singular_values[2] > 0.05,
        "{}",
        sphere.singular_values
    );
    // a window T averages the attitude of a turn at rate w: gravity shrinks by (w T)^2 / 24, 1e-5 g
    // at 1 deg/s
    let error = sphere.bias(g, 1e-2).unwrap() / 9.80665e-3 - nalgebra::Vector3::new(5.0, -4.0, 3.0);
    println!("error {:.4} mg", error);
    assert!(error.norm() < 0.1, "{error} mg");
}

#[test]
fn beams_give_the_velocity_that_the_axes_do() {
    let axes = read("pan-wu-3d.toml", &["estimator.stop=660 s", "sensor.dvl.simulation.noise=0"]);
    let beams = [
        "estimator.stop=660 s",
        "sensor.dvl={ type = \"dvl-beams\", noise = \"2 cm/s\", \
         scale = { initial = 0.8, sigma = 0.2, truth = 0.9998 }, misalignment = \
         { sigma = \"1 deg\", truth = [\"-0.1 deg\", \"-0.2 deg\", \"0.5 deg\"] }, \
         simulation = { rate = \"5 Hz\", noise = 0 } }",
    ];
    let beams = read("pan-wu-3d.toml", &beams);
    let (a, b) = (&axes.velocities[0], &beams.velocities[0]);
    assert_eq!(a.samples.time, b.samples.time);
    let worst = a
        .samples
        .value
        .iter()
        .zip(&b.samples.value)
        .map(|(a, b)| (a - b).norm())
        .fold(0.0_f64, f64::max);
    assert!(worst < 1e-9, "{worst}");
    // four beams at 30 deg: sigma^2 / (4 sin^2 / 2) across and sigma^2 / (4 cos^2) along
    let across = b.covariance[(0, 0)];
    assert!((across - 4e-4 / (2.0 * 0.25)).abs() < 1e-12, "{across}");
}

#[test]
fn gnss_and_depth_are_found_by_what_they_measure() {
    let recording = read("surface-dive.toml", &["estimator.stop=100 s"]);
    assert_eq!(
        (recording.velocities.len(), recording.depths.len(), recording.positions.len()),
        (1, 1, 1)
    );
    let Positions { fixes, lever_arm: lever, bias_walk } = &recording.positions[0];
    assert_eq!(fixes.name, "gnss");
    assert!((lever.x + 0.4).abs() < 1e-12);
    let fix = fixes.value[10];
    // noise of 1 m and 2 m, and a bias of the same size with a time constant of 10 minutes: 2
    // sigma^2 / 600 s
    let near = |a: f64, b: f64| (a - b).abs() < 0.01 * b;
    assert!(
        near(fix.sigma, 2_f64.sqrt())
            && near(fix.sigma_height, 8_f64.sqrt())
            && fix.velocity.is_some()
    );
    assert!(near(bias_walk.x, 2.0 / 600.0) && near(bias_walk.z, 8.0 / 600.0), "{bias_walk}");
    assert!(recording.depths[0].1 == 0.05 && recording.reference.is_some());
}
