//! The mechanisation against the simulator: two programs that share nothing but the Earth.

use navfuse_ins::mechanisation::{Increments, Mechanisation, NavState};
use navfuse_simulation::{Trajectory, TrajectoryConfig};
use serde_json::json;

/// One hour of turning and diving: laps of a square with tilted turns, each with a dive and an
/// ascent.
fn hour() -> Trajectory {
    let mut segments = vec![json!({ "type": "surge", "duration": "60 s", "speed": "3 m/s" })];
    for lap in 0..6 {
        let direction = if lap % 2 == 0 { "starboard" } else { "port" };
        segments.extend([
            json!({ "type": "descend", "duration": "60 s", "rate": "1 m/s" }),
            json!({
                "type": "square", "duration": "400 s", "turn": "20 s", "bank": "15 deg",
                "pitch": "5 deg", "direction": direction
            }),
            json!({ "type": "pulse", "duration": "30 s", "speed_change": "-1 m/s" }),
            json!({ "type": "ascend", "duration": "60 s", "rate": "1 m/s" }),
            json!({
                "type": "turn", "duration": "40 s", "angle": "200 deg", "bank": "-10 deg",
                "pitch": "-3 deg"
            }),
        ]);
    }
    let start = json!({ "latitude": "30 deg", "heading": "10 deg", "roll": "3 deg" });
    let config: TrajectoryConfig =
        serde_json::from_value(json!({ "start": start, "segments": segments })).unwrap();
    Trajectory::new(&config).unwrap()
}

/// Largest velocity (m/s) and position error (m) of an hour at that rate (Hz).
fn worst_errors(rate: f64) -> (f64, f64) {
    let trajectory = hour();
    assert!(trajectory.duration() >= 3600.0);
    let mut cursor = trajectory.cursor();
    let start = cursor.at(0.0);
    let mut state =
        NavState { c_b_n: start.c_b_n, velocity: start.velocity, position: start.position };
    let mut mechanisation = Mechanisation::default();
    let (mut velocity, mut position) = (0.0_f64, 0.0_f64);
    for k in 0..(3600.0 * rate) as u64 {
        let (from, to) = (k as f64 / rate, (k + 1) as f64 / rate);
        let (dtheta, dvel) = cursor.increments(from, to);
        state = mechanisation.step(&state, &Increments { dtheta, dvel, dt: to - from }).unwrap().0;
        if k % 100 == 0 {
            let truth = cursor.at(to);
            velocity = velocity.max((state.velocity - truth.velocity).norm());
            position = position.max(state.position.ned_from(&truth.position).norm());
        }
    }
    (velocity, position)
}

/// Reached: 9.5e-7 m/s and 6.4e-4 m; the bounds leave a factor of ten for other processors'
/// rounding. What a navigation filter needs is a thousand times more.
#[test]
fn a_noise_free_imu_stays_within_a_hundredth_of_a_millimetre_per_second_for_an_hour() {
    let (velocity, position) = worst_errors(100.0);
    assert!(velocity < 1e-5, "{velocity:e} m/s");
    assert!(position < 6e-3, "{position:e} m");
}

/// Two-sample coning and sculling leave errors of third order: ten times the interval, a thousand
/// times the error (1.1e-3 m/s and 0.7 m at 10 Hz).
#[test]
fn the_error_falls_with_the_cube_of_the_interval() {
    let (coarse, fine) = (worst_errors(10.0), worst_errors(20.0));
    let ratios = [coarse.0 / fine.0, coarse.1 / fine.1];
    assert!(ratios.iter().all(|r| (6.0..10.0).contains(r)), "{ratios:?}: 8 is expected");
}
