//! A DVL of single beams: its geometry, what it is to one that gives a velocity, lost beams, and
//! the speed of sound.

use crate::common::{Log, bound, compose, model, no_sample, predict, refused, run, set};
use navfuse_core::filter::Ekf;
use navfuse_core::model::sensor::measurement::{At, jacobian_error};
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{Matrix3x4, Matrix4x3, Vector3, Vector4};
use navfuse_core::units::sample::Sample;

/// The quickstart's IMU, all calibration states estimated, two minutes with a dive and a turn.
const SCENARIO: &str = r#"
[process.ins]
attitude = { sigma = "0.05 deg" }
velocity = { sigma = "1 cm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.1 deg/h" }
accel_bias = { sigma = "100 ug" }
[sensor.imu]
gyro_noise = "0.2 deg/h/sqrt(Hz)"
accel_noise = "20 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }
[sensor.dvl]
type = "dvl-beams"
noise = "1 cm/s"
gate = "off"
scale = { sigma = "1 %", truth = 1.004 }
misalignment = { sigma = "1 deg", truth = ["0.3 deg", "-0.4 deg", "0.8 deg"] }
lever_arm = { sigma = "10 cm", truth = ["-0.5 m", "0 m", "0.2 m"], initial = [
    "-0.5 m", "0 m", "0.2 m"] }
simulation = { rate = "5 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "2 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[estimator]
draw = "start"
output_rate = "1 Hz"
[source.simulation]
start = { latitude = "43 deg", heading = "30 deg" }
segments = [
    { type = "surge", duration = "30 s", speed = "2 m/s" },
    { type = "descend", duration = "30 s", rate = "0.8 m/s" },
    { type = "turn", duration = "20 s", angle = "90 deg", bank = "10 deg" },
    { type = "cruise", duration = "40 s" },
]
"#;

/// The beams by hand: an X of 30 deg, forward right, aft right, aft left, forward left.
fn janus() -> Matrix4x3<f64> {
    let (h, v) = (0.5 * 0.5_f64.sqrt(), 0.75_f64.sqrt());
    Matrix4x3::new(h, h, v, -h, h, v, -h, -h, v, h, -h, v)
}

#[test]
fn a_beam_reads_the_velocity_in_its_direction() {
    let composition =
        compose(SCENARIO, &["sensor.dvl.lever_arm=\"0 m\"", "sensor.dvl.misalignment=\"0 deg\""]);
    let mut state = composition.layout.initial_state();
    let roundings = 1e-15;
    // heading east at 2 m/s, 1 m/s down: forward 2, right 0, down 1
    set(&composition, &mut state, "ins.attitude", &[0.0, 0.0, 90_f64.to_radians()]);
    set(&composition, &mut state, "ins.velocity", &[0.0, 2.0, 1.0]);
    let z = Vector4::from_vec(predict(&composition, "dvl", &state, &no_sample()));
    let (forward, down) = (2.0 * 0.5 * 0.5_f64.sqrt(), 0.75_f64.sqrt());
    assert!(
        (z - Vector4::new(forward + down, down - forward, down - forward, forward + down)).amax()
            < roundings
    );
    // a plus of 20 deg: forward, right, aft, left
    let plus = [
        "sensor.dvl.slant=\"20 deg\"",
        "sensor.dvl.azimuth=[\"0 deg\",\"90 deg\",\"180 deg\",\"270 deg\"]",
    ];
    let composition = compose(
        SCENARIO,
        &[plus[0], plus[1], "sensor.dvl.lever_arm=\"0 m\"", "sensor.dvl.misalignment=\"0 deg\""],
    );
    let z = predict(&composition, "dvl", &state, &no_sample());
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    assert!((z[0] - (2.0 * sin + cos)).abs() < roundings && (z[1] - cos).abs() < roundings);
    assert!((z[2] - (cos - 2.0 * sin)).abs() < roundings && (z[3] - cos).abs() < roundings);
    // one by one, of any length
    let composition = compose(
        SCENARIO,
        &[
            "sensor.dvl.beams=[[0, 0, 7], [3, 0, 4]]",
            "sensor.dvl.lever_arm=\"0 m\"",
            "sensor.dvl.misalignment=\"0 deg\"",
        ],
    );
    let z = predict(&composition, "dvl", &state, &no_sample());
    assert_eq!(z.len(), 2);
    assert!((z[0] - 1.0).abs() < roundings && (z[1] - (0.6 * 2.0 + 0.8)).abs() < roundings);
}

/// A state with every block and signal at random: angles to half a turn, lever arms and velocities
/// of metres.
fn random_state(
    composition: &navfuse_core::compose::Composition,
    random: &mut Random,
) -> navfuse_core::state::State {
    let mut state = composition.layout.initial_state();
    for block in &composition.layout.blocks {
        let mut u = || 2.0 * random.uniform() - 1.0;
        let c: Vec<f64> = match block.name.as_str() {
            "ins.position" => vec![1.4 * u(), 3.0 * u(), 3000.0 * u()],
            "ins.attitude" | "dvl.misalignment" => vec![3.0 * u(), 1.5 * u(), 3.0 * u()],
            _ => (0..block.operations.tangent).map(|_| 3.0 * u()).collect(),
        };
        (block.operations.from_coordinates)(&c, &mut state.values[block.range()]);
    }
    state.signals.iter_mut().for_each(|s| *s = 2.0 * random.uniform() - 1.0);
    state
}

/// A bias that is a state.
const BIAS: &str = "sensor.dvl.bias={ sigma = \"1 cm/s\" }";

#[test]
fn the_jacobian_is_the_derivative() {
    let sound =
        ["sensor.dvl.sound_speed.set=\"1500 m/s\"", "sensor.dvl.sound_speed.array=\"phased\""];
    let water = "[process.water]\ntype = \"water-current\"\ncurrent = { sigma = \"1 m/s\" }\n";
    let tracks = ["sensor.dvl.track=\"water\"", "sensor.dvl.current=\"water\""];
    let composition =
        compose(&format!("{SCENARIO}{water}"), &[sound[0], sound[1], tracks[0], tracks[1], BIAS]);
    let mut random = Random::new(1, "states");
    let model = model(&composition, "dvl");
    for case in 0..200 {
        let state = random_state(&composition, &mut random);
        let mut sample = no_sample();
        sample.set(4, 1480.0);
        let at = At { layout: &composition.layout, state: &state, sample: &sample };
        // truncation (6e-6)^2 and rounding 1e-16/6e-6 of numbers up to 3 leave 1e-10
        let error = jacobian_error(model.as_ref(), &at);
        assert!(error < 1e-6, "case {case}: {error:e}");
        // dual numbers leave the rounding of some ten products
        let read = model.blocks(&at);
        let blocks = read.slots().map(|slot| &composition.layout.blocks[slot]);
        let columns: Vec<usize> = blocks.flat_map(|block| block.tangent_range()).collect();
        let mut h = [vec![0.0; 4 * columns.len()], vec![0.0; 4 * columns.len()]];
        assert!(model.analytic(&at, &columns, &mut h[0]));
        model.differentiate(&at, &columns, &read, &mut h[1]);
        let largest = h[1].iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let apart = h[0].iter().zip(&h[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-14 * largest, "case {case}: {apart:e} of {largest:e}");
    }
}

/// The least-squares velocity of four equally good beams, with its own covariance, is all that they
/// tell of the state: `B' R^-1 B` and `B' R^-1 z` are the same.
#[test]
fn four_beams_are_the_velocity_that_fits_them_best() {
    let b = janus();
    let covariance = (b.transpose() * b).try_inverse().unwrap() * 0.01_f64.powi(2);
    let solve: Matrix3x4<f64> = (b.transpose() * b).try_inverse().unwrap() * b.transpose();
    let axis = |i: usize| format!("\"{} m/s\"", covariance[(i, i)].sqrt());
    let noise = format!("sensor.dvl.noise=[{}, {}, {}]", axis(0), axis(1), axis(2));
    let samples = run(SCENARIO, &[]).samples;
    let mut beams = Ekf::new(compose(SCENARIO, &[]));
    let mut body = Ekf::new(compose(SCENARIO, &["sensor.dvl.type=\"dvl\"", &noise]));
    let dvl = beams.composition().sensor("dvl").unwrap();
    let mut used = 0;
    for sample in &samples {
        beams.process(sample, &mut ()).unwrap();
        let mut other = *sample;
        if sample.sensor.0 == dvl {
            let y = solve * Vector4::from(sample.array::<4>(0).unwrap());
            other = Sample::new(sample.time, sample.sensor, y.as_slice());
            used += 1;
        }
        body.process(&other, &mut ()).unwrap();
    }
    assert!(used > 590 && beams.running());
    let n = beams.covariance().dimension();
    let sigma = |i: usize| beams.covariance().get(i, i).sqrt();
    for i in 0..n {
        for j in 0..n {
            let difference = beams.covariance().get(i, j) - body.covariance().get(i, j);
            assert!(difference.abs() < 1e-9 * sigma(i) * sigma(j), "P({i}, {j}): {difference:e}");
        }
    }
    for block in &beams.layout().blocks {
        let (mut error, n) = ([0.0; 3], block.operations.tangent);
        (block.operations.local)(
            &beams.state().values[block.range()],
            &body.state().values[block.range()],
            &mut error[..n],
        );
        for (k, e) in error[..n].iter().enumerate().filter(|_| block.tangent.is_some()) {
            let sigma = sigma(block.tangent.unwrap() + k);
            assert!(e.abs() < 1e-9 * sigma, "{} {k}: {e:e} of {sigma:e}", block.name);
        }
    }
}

/// 1-sigma of the velocity along a beam at the end, where the vehicle heads 120 deg and is level.
fn along(log: &Log, azimuth: f64) -> f64 {
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    let heading = (120.0 + azimuth).to_radians();
    let beam = Vector3::new(sin * heading.cos(), sin * heading.sin(), cos);
    (beam.transpose() * log.at(120.0).velocity * beam)[(0, 0)].sqrt()
}

/// Bounds of a calibrated instrument: what a sample of 1 cm/s at 5 Hz tells of the velocity along a
/// beam, the accelerometers carry over some seconds, so that the sigma is below that of one sample.
/// With depth, two beams see all of the velocity.
#[test]
fn one_beam_and_two_beams_aid() {
    let calibrated =
        ["sensor.dvl.scale=1", "sensor.dvl.misalignment=\"0 deg\"", "sensor.dvl.lever_arm=\"0 m\""];
    let with =
        |setting: &str| bound(SCENARIO, &[calibrated[0], calibrated[1], calibrated[2], setting]);
    let none = with("sensor.dvl.enabled=false");
    let one = with("sensor.dvl.azimuth=[\"45 deg\"]");
    let two = with("sensor.dvl.azimuth=[\"45 deg\", \"135 deg\"]");
    let four = with("sensor.dvl.gate=\"off\"");
    let position = |log: &Log| log.at(120.0).sigma;
    println!(
        "position {} {} {} {}",
        position(&none),
        position(&one),
        position(&two),
        position(&four)
    );
    println!(
        "along {} {} {} {}",
        along(&none, 45.0),
        along(&one, 45.0),
        along(&two, 45.0),
        along(&four, 45.0)
    );
    assert!(along(&none, 45.0) > 0.02 && along(&one, 45.0) < 0.01 && along(&two, 45.0) < 0.01);
    assert!(along(&two, 135.0) < 0.01 && along(&one, 135.0) > 2.0 * along(&two, 135.0));
    assert!(position(&one) < position(&none) && position(&two) < 0.5 * position(&none));
    assert!(position(&two) < 1.2 * position(&four));
}

#[test]
fn lost_beams_are_left_out_and_those_that_remain_fit() {
    let lossy = run(SCENARIO, &["sensor.dvl.beam_dropout=0.5"]);
    let dvl = compose(SCENARIO, &[]).sensor("dvl").unwrap();
    let of = |m: u32| lossy.nis.iter().filter(|n| n.2 == dvl && n.1 == m).count();
    // of 600 samples, 4 choose m in 16: 150, 225, 150 and 37.5, each with a sigma of at most 12
    assert!((of(1) as f64 - 150.0).abs() < 48.0 && (of(2) as f64 - 225.0).abs() < 48.0);
    assert!((of(3) as f64 - 150.0).abs() < 48.0 && (of(4) as f64 - 37.5).abs() < 24.0);
    let (mean, tolerance) = lossy.mean_nis(dvl);
    assert!((mean - 1.0).abs() < tolerance, "{mean} +- {tolerance}");
    let last = lossy.at(120.0);
    assert!(last.error < 4.0 * last.sigma, "{last:?}");
}

/// Physics apart from the model: a phased array steers to `sin = sin(30 deg) c/c0`; the Doppler
/// shift is `2 f b.v/c` with the beam as it is, and the instrument makes a velocity of it with
/// `c0`.
#[test]
fn a_wrong_speed_of_sound_scales_a_piston_and_leaves_the_horizontal_of_a_phased_array() {
    let aligned =
        ["sensor.dvl.scale=1", "sensor.dvl.misalignment=\"0 deg\"", "sensor.dvl.lever_arm=\"0 m\""];
    let assumed = "sensor.dvl.sound_speed.set=\"1500 m/s\"";
    let of = |array: &str, c: Option<f64>| {
        let composition = compose(SCENARIO, &[aligned[0], aligned[1], aligned[2], assumed, array]);
        let mut state = composition.layout.initial_state();
        set(&composition, &mut state, "ins.attitude", &[0.0; 3]);
        set(&composition, &mut state, "ins.velocity", &[2.0, 0.5, -0.8]);
        let mut sample = no_sample();
        c.into_iter().for_each(|c| sample.set(4, c));
        Vector4::from_vec(predict(&composition, "dvl", &state, &sample))
    };
    let (b, v) = (janus(), Vector3::new(2.0, 0.5, -0.8));
    let solve: Matrix3x4<f64> = (b.transpose() * b).try_inverse().unwrap() * b.transpose();
    for c in [1440.0, 1500.0, 1560.0] {
        let piston = of("sensor.dvl.sound_speed.array=\"piston\"", Some(c));
        assert!((piston - b * v * (1500.0 / c)).amax() < 1e-14, "{c}");
        let (sin, phased) =
            (0.5 * c / 1500.0, of("sensor.dvl.sound_speed.array=\"phased\"", Some(c)));
        for (i, azimuth) in [45_f64, 135.0, 225.0, 315.0].into_iter().enumerate() {
            let (s, k) = azimuth.to_radians().sin_cos();
            let steered = Vector3::new(sin * k, sin * s, (1.0 - sin * sin).sqrt());
            assert!((phased[i] - steered.dot(&v) / c * 1500.0).abs() < 1e-14, "{c} {i}");
        }
        let horizontal = (solve * phased - v).xy();
        assert!(horizontal.amax() < 1e-14, "{c}: {horizontal}");
    }
    // Pathfinder DVL Guide (2018), page 127: sin(slant) is c / (2 x 1536 m/s); set to 1500 m/s in
    // water of 1450 m/s, the vertical velocity is to be multiplied by 0.9569
    let slant = format!("sensor.dvl.slant=\"{} rad\"", (1500.0_f64 / 3072.0).asin());
    let sound = [
        assumed,
        "sensor.dvl.sound_speed.array=\"phased\"",
        &slant,
        aligned[0],
        aligned[1],
        aligned[2],
    ];
    let composition = compose(SCENARIO, &sound);
    let mut state = composition.layout.initial_state();
    set(&composition, &mut state, "ins.velocity", &[0.0, 0.0, 1.0]);
    let mut sample = no_sample();
    let mut vertical = |c| {
        sample.set(4, c);
        predict(&composition, "dvl", &state, &sample)[0]
    };
    assert!((vertical(1500.0) / vertical(1450.0) - 0.9569).abs() < 0.00005);
    // a sample without the speed of sound is taken as it is
    assert!((of("sensor.dvl.sound_speed.array=\"piston\"", None) - b * v).amax() < 1e-14);
}

#[test]
fn a_measured_speed_of_sound_keeps_a_scale_error_out() {
    // 1 % between 1485 and 1500 m/s would be 10 sigma of a scale that is known to 0.1 %
    let sound = [
        "sensor.dvl.sound_speed.set=\"1500 m/s\"",
        "sensor.dvl.sound_speed.simulated=\"1485 m/s\"",
    ];
    let log = run(SCENARIO, &[sound[0], sound[1], "sensor.dvl.scale={ sigma = \"0.1 %\" }"]);
    let dvl = compose(SCENARIO, &[]).sensor("dvl").unwrap();
    let (mean, tolerance) = log.mean_nis(dvl);
    assert!((mean - 1.0).abs() < tolerance, "{mean} +- {tolerance}");
    assert!(log.samples.iter().filter(|s| s.sensor.0 == dvl).all(|s| s.get(4) == Some(1485.0)));
}

#[test]
fn what_does_not_fit_is_told() {
    let cases = [
        ("sensor.dvl.azimuth=[]", "0 beams"),
        ("sensor.dvl.beams=[[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]", "6 beams, 1 to 5"),
        ("sensor.dvl.beams=[[0,0,0]]", "no direction"),
        ("sensor.dvl.slant=\"90 deg\"", "below 90 deg"),
        ("sensor.dvl.slant=\"-5 deg\"", "at least 0"),
        ("sensor.dvl.sound_speed.array=\"phased\"", "set"),
        ("sensor.dvl.sound_speed={ set = \"1500 m/s\", water = {} }", "temperature"),
        ("sensor.dvl.track=\"water\"", "water-current"),
        ("sensor.dvl.current=\"water\"", "track = \"water\""),
        (
            "sensor.dvl={ type = \"dvl-beams\", noise = \"1 cm/s\", track = \"water\", \
             current = \"sea\" }",
            "sea.current",
        ),
        (
            "sensor.dvl={ type = \"dvl-beams\", noise = \"1 cm/s\", slant = \"20 deg\", \
             beams = [[0,0,1]] }",
            "slant",
        ),
    ];
    for (setting, expected) in cases {
        let message = refused(SCENARIO, &[setting]);
        assert!(message.contains(expected), "{setting}: {message}");
    }
}

/// The bottom is 50 m below the start and the instrument 0.2 m below the IMU, whose depth the depth
/// sensor gives with 5 cm: altitude and depth add up to 49.8 m on a level course, within 4 sigma.
#[test]
fn the_altitude_follows_the_dive_and_changes_no_estimate() {
    let keys = ["sensor.dvl.altitude=true", "sensor.dvl.simulated_bottom=\"-50 m\""];
    let (with, without) = (run(SCENARIO, &keys), run(SCENARIO, &[]));
    let channel = compose(SCENARIO, &keys).sensors[1].info.channels.len() - 1;
    assert_eq!(channel, 4);
    let values = |sensor: usize, channel: usize| -> Vec<f64> {
        let of = with.samples.iter().filter(|s| s.sensor.0 == sensor);
        of.filter_map(|s| s.get(channel)).collect()
    };
    let (altitudes, depths) = (values(1, channel), values(2, 0));
    assert!((altitudes[0] - 49.8).abs() < 0.01, "{}", altitudes[0]);
    let (altitude, depth) = (altitudes[altitudes.len() - 1], depths[depths.len() - 1]);
    assert!(depth > 5.0 && (altitude + depth - 49.8).abs() < 0.2, "{altitude} m and {depth} m");
    let errors = |log: &Log| log.epochs.iter().map(|e| e.error.to_bits()).collect::<Vec<_>>();
    assert_eq!(errors(&with), errors(&without));
    let error = refused(SCENARIO, &keys[1..]);
    assert!(error.contains("simulated_bottom") && error.contains("altitude = true"), "{error}");
}

/// A vehicle that rests 0.5 m above the bottom reads that, and none where it lies on it.
#[test]
fn on_the_bottom_there_is_no_altitude() {
    let altitudes = |bottom: &str| -> Vec<f64> {
        let bottom = format!("sensor.dvl.simulated_bottom=\"{bottom}\"");
        let keys = [
            "sensor.dvl.altitude=true",
            "sensor.dvl.lever_arm=\"0 m\"",
            "source.simulation.start={ latitude = \"0 deg\", height = \"-20 m\" }",
            "source.simulation.segments=[{ type = \"cruise\", duration = \"2 s\" }]",
            &bottom,
        ];
        let log = run(SCENARIO, &keys);
        let of = log.samples.iter().filter(|s| s.sensor.0 == 1 && s.get(0).is_some());
        of.filter_map(|s| s.get(4)).collect()
    };
    let above = altitudes("-20.5 m");
    assert!(above.len() == 11 && above.iter().all(|h| (h - 0.5).abs() < 1e-6), "{above:?}");
    assert_eq!(altitudes("-20 m"), [0.0; 0]);
    assert_eq!(altitudes("-19.5 m"), [0.0; 0]);
}
