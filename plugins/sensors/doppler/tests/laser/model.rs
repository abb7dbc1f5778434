//! The equation against geometry, its Jacobian against differences, and what is refused or noted.

use crate::common::{compose, refused};
use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{At, jacobian_error};
use navfuse_core::state::State;

/// Four beams, no two alike.
const BEAMS: [&str; 4] = ["[1, 0, 1]", "[-1, 0.5, 2]", "[0, -3, 4]", "[0.1, 0.2, 1]"];

fn beams(n: usize) -> String {
    format!("sensor.laser.beams=[{}]", BEAMS[..n].join(", "))
}

/// The composition's initial state with blocks at other values.
fn state(composition: &Composition, blocks: &[(&str, &[f64])]) -> State {
    let mut state = composition.layout.initial_state();
    for (name, coordinates) in blocks {
        let block = composition.layout.find(name).expect("a block");
        (block.operations.from_coordinates)(coordinates, &mut state.values[block.range()]);
    }
    state
}

/// What the laser would read.
fn read(composition: &Composition, state: &State) -> Vec<f64> {
    let Role::Measurement(model) =
        &composition.sensors[composition.sensor("laser").expect("a laser")].role
    else {
        panic!("a laser measures");
    };
    let mut z = vec![0.0; model.channels()];
    model.predict(&At::state(&composition.layout, state), &mut z);
    z
}

/// A few roundings of numbers of some tens.
fn assert_close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    let close = found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-12);
    assert!(close, "found {found:?}, expected {expected:?}");
}

/// Level, heading east, 30 m/s east and 2 m/s down: 30 m/s forward and 2 m/s down.
#[test]
fn a_beam_reads_the_velocity_towards_its_ground_spot_as_positive() {
    let laser = compose(&["sensor.laser.beams=[[1, 0, 1], [-1, 0, 1], [0, 3, 4], [0, 0, 2]]"]);
    let moving = [
        ("ins.attitude", &[0.0, 0.0, 90_f64.to_radians()][..]),
        ("ins.velocity", &[0.0, 30.0, 2.0]),
    ];
    let half = 0.5_f64.sqrt();
    assert_close(
        &read(&laser, &state(&laser, &moving)),
        &[32.0 * half, -28.0 * half, 2.0 * 0.8, 2.0],
    );
}

/// Azimuth from forward to right, elevation up: `[cos e cos a, cos e sin a, -sin e]`.
#[test]
fn a_beam_is_given_as_a_vector_or_as_azimuth_and_elevation() {
    let angles = "sensor.laser.beams=[{ azimuth = \"90 deg\", elevation = \"-30 deg\" }, \
                  { azimuth = \"0 deg\", elevation = \"-90 deg\" }]";
    let (angles, vectors) = (
        compose(&[angles]),
        compose(&["sensor.laser.beams=[[0, 7.5e199, 4.330127018922193e199], [0, 0, 1e-200]]"]),
    );
    let moving = [("ins.velocity", &[3.0, 5.0, -7.0][..])];
    let z = read(&angles, &state(&angles, &moving));
    assert_close(&z, &[5.0 * 0.75_f64.sqrt() - 7.0 * 0.5, -7.0]);
    assert_close(&read(&vectors, &state(&vectors, &moving)), &z);
}

/// `k u · C_b^d v`. With `C_d^b = R_z(90 deg)` the body is turned by 90 deg to the right of the
/// instrument, as it would be of north with that heading: the instrument looks to the body's left,
/// and has the body's forward on its right.
#[test]
fn the_scale_multiplies_and_the_misalignment_turns_the_instrument() {
    let laser = compose(&["sensor.laser.beams=[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"]);
    let turned = [
        ("ins.velocity", &[10.0, 4.0, 1.0][..]),
        ("laser.scale", &[1.01]),
        ("laser.misalignment", &[0.0, 0.0, 90_f64.to_radians()]),
    ];
    assert_close(&read(&laser, &state(&laser, &turned)), &[-4.04, 10.1, 1.01]);
}

/// `u · (w x l)`: turning to starboard at 0.5 rad/s, a point 2 m ahead moves to the right at 1 m/s.
#[test]
fn the_lever_arm_adds_what_the_turning_moves_it() {
    let laser = compose(&[
        "sensor.laser.beams=[[0, 3, 4]]",
        "sensor.laser.lever_arm=[\"2 m\", \"0 m\", \"1 m\"]",
    ]);
    let resting = state(&laser, &[]);
    let mut turning = resting.clone();
    turning.signals[2] = 0.5; // the signals are the angular rate, x, y, z, and the earlier one
    assert_eq!(turning.signals.len(), 6);
    assert_close(&[read(&laser, &turning)[0] - read(&laser, &resting)[0]], &[0.6]);
}

#[test]
fn the_jacobian_is_that_of_central_differences_for_one_to_four_beams() {
    for n in 1..=4 {
        let laser = compose(&[&beams(n), "sensor.laser.lever_arm.sigma=1 m"]);
        let mut at = state(
            &laser,
            &[
                ("ins.attitude", &[0.3, -0.2, 2.0]),
                ("ins.velocity", &[40.0, -20.0, 3.0]),
                ("ins.position", &[0.8, 0.1, 500.0]),
                ("laser.scale", &[1.02]),
                ("laser.misalignment", &[0.1, -0.2, 0.3]),
                ("laser.lever_arm", &[1.0, -2.0, 0.5]),
            ],
        );
        at.signals = vec![0.1, -0.2, 0.3];
        let Role::Measurement(model) = &laser.sensors[laser.sensor("laser").expect("a laser")].role
        else {
            panic!("a laser measures");
        };
        let error = jacobian_error(model.as_ref(), &At::state(&laser.layout, &at));
        assert!(error < 1e-8, "{n} beams: {error:e}");
    }
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let cases: [(&[&str], &[&str]); 12] = [
        (&["sensor.laser.beams=[]"], &["beams", "0 beams; give one to four"]),
        (
            &["sensor.laser.beams=[[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1]]"],
            &["5 beams; give one to four"],
        ),
        (&["sensor.laser.beams=[[1, 0, 1], [0, 0, 0]]"], &["beams.1", "has no direction"]),
        (&["sensor.laser.beams=[[1, nan, 1]]"], &["has no direction"]),
        (&["sensor.laser.beams=[[1, 0]]"], &["found 2 numbers", "[forward, right, down]"]),
        (
            &["sensor.laser.beams=[[1, 0, 1], [0, 0, 1], [2, 0, 2]]"],
            &["beams 1 and 3 are on one line", "remove one"],
        ),
        (&["sensor.laser.beams=[[1, 0, 1], [-1, 0, -1]]"], &["beams 1 and 2 are on one line"]),
        (
            &[r#"sensor.laser.beams=[{ azimuth = "0 deg", elevation = "-91 deg" }]"#],
            &["elevation = -91 deg", "-90 to 90 deg"],
        ),
        (&[r#"sensor.laser.beams=[{ azimuth = "0 deg" }]"#], &["elevation"]),
        (
            &[&beams(2), r#"sensor.laser.noise=["1 cm/s", "1 cm/s", "1 cm/s"]"#],
            &["noise", "3 values for 2 beams"],
        ),
        (&["sensor.laser.beam_dropout=120 %"], &["beam_dropout", "at most 1"]),
        (
            &["sensor.laser.min_speed=2 m/s", "sensor.laser.max_speed=1 m/s"],
            &["max_speed", "not above min_speed"],
        ),
    ];
    for (settings, expected) in cases {
        let message = refused(settings);
        println!("{message}\n");
        assert!(
            expected.iter().all(|e| message.contains(e)),
            "{settings:?}: {message}\nwithout one of {expected:?}"
        );
    }
}

#[test]
fn a_beam_may_always_be_lost() {
    compose(&["sensor.laser.beam_dropout=100 %"]);
}

#[test]
fn one_beam_notes_what_no_motion_shows_and_only_where_it_is_uncertain() {
    let notes =
        |settings: &[&str]| compose(settings).notes.into_iter().map(|n| n.1).collect::<Vec<_>>();
    let one = notes(&[]);
    assert_eq!(one.len(), 1, "{one:?}");
    assert!(one[0].contains("rotation about itself: about [0.707, 0.000, 0.707]"), "{one:?}");
    assert_eq!(notes(&["sensor.laser.lever_arm.sigma=1 m"]).len(), 2);
    assert!(notes(&["sensor.laser.misalignment=0 deg"]).is_empty());
    assert!(notes(&[&beams(2)]).is_empty());
}
