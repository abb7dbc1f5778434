//! Whitcomb, Yoerger & Singh (1999), *Advances in Doppler-based navigation of underwater robotic
//! vehicles*: Doppler dead reckoning, whose slow error a long baseline corrects.
//!
//! ```text
//! p^  = p_d + c          p_d: sum of C_b^n y dt of the DVL
//! dc/dt = (o - c) / tau  o: offset of p_d by which it fits the ranges to the transponders
//! ```
//! This is their complementary filter: the dead reckoning passes a high pass, the fixes of the long
//! baseline pass a low pass, with the same corner `1/tau`. The system takes the attitude of a compass
//! (here the true one), the depth, and the places of the transponders as exact.

use super::{Errors, filter, horizontal, over_runs, rms, samples, settings, settled};
use crate::common::parallel;
use navfuse_core::nalgebra::{Matrix2, UnitQuaternion, Vector2, Vector3};
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;

/// The survey with its DVL, three transponders and pressure, without the other aids.
const SURVEY: [&str; 12] = [
    "sensor.imu.simulation.rate=20 Hz",
    "process.ship.enabled=false",
    "sensor.ship-navigation.enabled=false",
    "sensor.usbl.enabled=false",
    "process.water.enabled=false",
    "sensor.speed-log.enabled=false",
    "sensor.magnetometer.enabled=false",
    "sensor.altimeter.enabled=false",
    "sensor.dvl.simulation.outages=[]",
    "estimator.stop=1500 s",
    "sensor.beacon-west={type=\"acoustic-range\",noise=\"20 cm\",transponder={latitude=\"43.0015 deg\",longitude=\"4.992 deg\",height=\"-110 m\"},displacement={sigma=\"1 m\"},lever_arm=[\"0.2 m\",\"0 m\",\"0.3 m\"],sound=\"sound\"}",
    "sensor.beacon-west.simulation={rate=\"0.2 Hz\",offset=\"2.41 s\",dropout=\"5 %\",reach=\"1.5 km\"}",
];

/// The transponders as the scenario gives them.
const BEACONS: [(&str, [f64; 3]); 3] = [
    ("beacon-north", [43.008, 4.996, -112.0]),
    ("beacon-east", [43.001, 5.009, -108.0]),
    ("beacon-west", [43.0015, 4.992, -110.0]),
];

/// Place of the transducer from the IMU, m.
const ARM: [f64; 3] = [0.2, 0.0, 0.3];

/// End of the runs, s.
const END: f64 = 1500.0;

/// Age beyond which a range is not used for a fix, s: three ranges come within 5 s.
const OLD: f64 = 8.0;

/// A range with the place of the transducer by dead reckoning at its time.
#[derive(Clone, Copy)]
struct Range {
    time: f64,
    from: Geodetic,
    length: f64,
}

/// Errors of the fixes alone, of the dead reckoning alone, and of the complementary filter.
struct Whitcomb {
    fixes: Errors,
    reckoned: Errors,
    combined: Errors,
}

/// The horizontal offset of the dead reckoning that fits the ranges, by Gauss and Newton from an
/// earlier one.
fn fit(ranges: &[Range], start: Vector2<f64>) -> Option<Vector2<f64>> {
    let mut offset = start;
    for _ in 0..10 {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (range, (_, [latitude, longitude, height])) in ranges.iter().zip(BEACONS) {
            let (latitude, longitude) = (latitude.to_radians(), longitude.to_radians());
            let beacon = Geodetic { latitude, longitude, height };
            let here = range.from.displaced(&Vector3::new(offset.x, offset.y, 0.0));
            let way: Vector3<f64> = here.ned_from(&beacon);
            let (toward, length) = (Vector2::new(way.x, way.y) / way.norm(), way.norm());
            normal += toward * toward.transpose();
            right += toward * (range.length - length);
        }
        offset += normal.try_inverse()? * right;
    }
    Some(offset)
}

fn whitcomb(samples: &[Sample], names: &[String], tau: f64) -> Whitcomb {
    let id = |name: &str| names.iter().position(|n| n == name).unwrap();
    let (reference, dvl) = (id("reference"), id("dvl"));
    let beacons = BEACONS.map(|(name, _)| id(name));
    let mut found = Whitcomb { fixes: vec![], reckoned: vec![], combined: vec![] };
    let mut place: Option<Geodetic> = None;
    let mut attitude = UnitQuaternion::identity();
    let mut ranges: [Option<Range>; 3] = [None; 3];
    let (mut offset, mut correction): (Option<Vector2<f64>>, Option<Vector2<f64>>) = (None, None);
    let mut last = (0.0, 0.0);
    for sample in samples.iter().take_while(|s| s.time.seconds() <= END) {
        let (time, sensor) = (sample.time.seconds(), sample.sensor.0);
        if sensor == reference {
            let [latitude, longitude, height] = sample.array(0).unwrap();
            let truth = Geodetic { latitude, longitude, height };
            let [roll, pitch, yaw] = sample.array(6).unwrap();
            attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            // the depth sensor gives the height
            let here = Geodetic { height, ..place.unwrap_or(truth) };
            place = Some(here);
            let moved = |by: &Vector2<f64>| here.displaced(&Vector3::new(by.x, by.y, 0.0));
            found.reckoned.push((time, horizontal(&here, &truth)));
            let of =
                |by: &Option<Vector2<f64>>| by.map(|by| (time, horizontal(&moved(&by), &truth)));
            found.combined.extend(of(&correction));
        } else if sensor == dvl
            && let (Some(y), Some(here)) = (sample.array::<3>(0), place)
        {
            let dt = (time - last.0).min(1.0);
            last.0 = time;
            place = Some(here.displaced(&(attitude * Vector3::from(y) * dt)));
        } else if let Some(k) = beacons.iter().position(|beacon| *beacon == sensor)
            && let (Some(length), Some(from)) = (sample.get(0), place)
        {
            let transducer = from.displaced(&(attitude * Vector3::from(ARM)));
            ranges[k] = Some(Range { time, from: transducer, length });
            let fresh: Vec<Range> =
                ranges.iter().flatten().copied().filter(|r| time - r.time < OLD).collect();
            if fresh.len() < ranges.len() {
                continue;
            }
            let Some(fixed) = fit(&fresh, offset.unwrap_or_default()) else { continue };
            offset = Some(fixed);
            let gain = 1.0 - (-(time - last.1) / tau).exp();
            last.1 = time;
            correction = Some(correction.map_or(fixed, |c| c + (fixed - c) * gain));
            let fix = from.displaced(&Vector3::new(fixed.x, fixed.y, 0.0));
            let true_one = samples.partition_point(|s| s.time < sample.time);
            let truth = samples[true_one..].iter().find(|s| s.sensor.0 == reference);
            if let Some([latitude, longitude, height]) = truth.and_then(|s| s.array(0)) {
                // the next sample of the reference is at most 0.5 s or 1 m away, along the way
                let truth = Geodetic { latitude, longitude, height };
                found.fixes.push((time, horizontal(&fix, &truth)));
            }
        }
    }
    found
}

/// Ten runs to 1500 s. The transponders are 1 m from their places in each axis, the speed of sound is 0.2 %
/// off, which is 2 m of 1 km, and the misalignment of the DVL has 0.5 deg. Dead reckoning drifts by a percent
/// of the way, and the fixes have transponders and sound as their limit. The filter knows that all of them
/// are uncertain.
#[test]
fn a_long_baseline_with_a_dvl_beside_the_filter() {
    let seeds: Vec<u64> = (1..=10).collect();
    let runs = parallel(&seeds, |seed| {
        let settings = settings(&SURVEY, seed);
        let (samples, names) = samples("survey", &settings);
        let whitcomb = [30.0, 300.0].map(|tau| whitcomb(&samples, &names, tau));
        (whitcomb, filter("survey", &settings))
    });
    println!("| system | needs | error | below 5 m after |");
    println!("|---|---|---|---|");
    let row = |name: &str, needs: &str, errors: Vec<&Errors>| {
        let error = over_runs(errors.iter().map(|e| rms(e, 600.0)));
        let mut times: Vec<f64> =
            errors.iter().map(|e| settled(e, 5.0).unwrap_or(f64::INFINITY)).collect();
        times.sort_by(f64::total_cmp);
        let time = times[times.len() / 2];
        let time = if time.is_finite() { format!("{time:.0} s") } else { "-".to_owned() };
        println!("| {name} | {needs} | {error:.2} m | {time} |");
        error
    };
    let attitude = "attitude, depth";
    let (reckoned, fixes) = (
        runs.iter().map(|r| &r.0[0].reckoned).collect(),
        runs.iter().map(|r| &r.0[0].fixes).collect(),
    );
    let reckoned = row("Doppler alone", &format!("DVL, start, {attitude}"), reckoned);
    let fixes =
        row("LBL alone", &format!("3 transponders, DVL between the ranges, {attitude}"), fixes);
    let needs = format!("3 transponders, DVL, {attitude}");
    let combined = [0, 1].map(|k| {
        let errors = runs.iter().map(|r| &r.0[k].combined).collect();
        row(&format!("Whitcomb 1999, tau = {} s", [30, 300][k]), &needs, errors)
    });
    let ours =
        row("filter", "IMU, DVL, transponders, pressure", runs.iter().map(|r| &r.1).collect());
    assert!(ours < combined[0].min(combined[1]), "{ours} {combined:?}");
    assert!(combined[0] < reckoned.min(fixes) && ours < fixes, "{combined:?} {reckoned} {fixes}");
}
