//! Tests of the known message types.

use super::*;
use crate::program::SLOTS;

fn convert(form: Form, config: &TopicConfig, slots: &[f64]) -> Result<Values, Unused> {
    Converter::new(form, config).values(&[slots, &[f64::NAN; SLOTS]].concat())
}

#[test]
fn the_axes_of_ros_become_those_of_navfuse() {
    let own = TopicConfig::default();
    let level = [0.0, 0.0, 0.0, 1.0];
    let imu = [[0.1, 0.2, 0.3].as_slice(), &[0.0, 0.0, 9.8], &level].concat();
    let v = convert(Form::Imu, &own, &imu).unwrap_or_default();
    assert_eq!(v[..6], [0.1, -0.2, -0.3, 0.0, 0.0, -9.8]);
    // level, forward to the east
    assert!((v[8] - 90_f64.to_radians()).abs() < 1e-12 && v[6].abs() < 1e-12);
    let twist = convert(Form::Twist, &own, &[1.0, 2.0, 3.0]).unwrap_or_default();
    assert_eq!(twist[..9], [1.0, -2.0, -3.0, 1.0, -2.0, -3.0, 2.0, 1.0, -3.0]);
    // forward to the east: a velocity to the left is one to the north
    let odometry = [[0.0; 3].as_slice(), &level, &[1.0, 2.0, 0.0]].concat();
    let v = convert(Form::Odometry, &own, &odometry).unwrap_or_default();
    assert!((v[6] - 2.0).abs() < 1e-12 && (v[7] - 1.0).abs() < 1e-12, "{v:?}");
    assert!(v[9].is_nan(), "a position without a datum is not used");
}

#[test]
fn what_a_message_declares_invalid_is_not_used() {
    let own = TopicConfig::default();
    let level = [0.0, 0.0, 0.0, 1.0];
    let imu = [[0.1; 6].as_slice(), &level, &[-1.0, 0.0, -1.0]].concat();
    let v = convert(Form::Imu, &own, &imu).unwrap_or_default();
    assert!(v[0].is_nan() && v[3] == 0.1 && v[8].is_nan());
    assert_eq!(convert(Form::Fix, &own, &[50.0, 8.0, 100.0, -1.0]), Err(Unused::NoFix));
    assert_eq!(convert(Form::WaterLinked, &own, &[1.0, 1.0, 1.0, 0.0]), Err(Unused::Invalid));
    assert_eq!(convert(Form::MarineDvl, &own, &[1.0, 1.0, 1.0, 1.0, 2.0]), Err(Unused::Invalid));
    assert_eq!(convert(Form::MarineDvl, &own, &[1.0, 1.0, 1.0, 2.0, 4.0]), Err(Unused::OtherTrack));
    let nortek = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
    assert_eq!(convert(Form::Nortek, &own, &nortek), Err(Unused::Invalid));
}

#[test]
fn variances_beams_and_places_that_stand_for_no_measurement_give_no_sample() {
    let own = TopicConfig::default();
    let v = [1.0, 2.0, 3.0];
    let dvl = |form, rest: &[f64]| convert(form, &own, &[&v, rest].concat());
    for refused in [-1.0, 1e9] {
        let [marine, wl, uuv] = [
            dvl(Form::MarineDvl, &[1.0, 4.0, 9.0, refused]),
            dvl(Form::WaterLinked, &[1.0, 9.0, refused]),
            dvl(Form::WaterLinked, &[f64::NAN, 9.0, f64::NAN, refused]),
        ];
        assert_eq!([marine, wl, uuv], [Err(Unused::Invalid); 3]);
        assert_eq!(dvl(Form::Twist, &[refused; 3]), Err(Unused::Invalid));
        let fix = [50.0, 8.0, 100.0, 0.0, refused, refused, 4.0, 2.0];
        assert_eq!(convert(Form::Fix, &own, &fix), Err(Unused::NoFix));
    }
    // of a velocity without its vertical, the others are used
    let flat = dvl(Form::Twist, &[0.01, 0.01, 1e9]).unwrap_or_default();
    assert!(flat[..2] == [1.0, -2.0] && flat[2].is_nan() && flat[8].is_nan());
    assert!(dvl(Form::MarineDvl, &[1.0, 4.0, 9.0, 0.0]).is_ok(), "of unknown accuracy");
    let fix = [50.0, 8.0, 100.0, 0.0, 0.0, 0.0, 0.0, 2.0];
    assert!(convert(Form::Fix, &own, &fix).is_ok_and(|v| v[3].is_nan() && v[4].is_nan()));
    for place in [[0.0, 0.0], [f64::NAN, f64::NAN], [-2e10, -2e10]] {
        let fix = [&place[..], &[100.0, 0.0]].concat();
        assert_eq!(convert(Form::Fix, &own, &fix), Err(Unused::NoFix));
    }
}

#[test]
fn no_good_beam_is_no_velocity_where_the_driver_counts_them() {
    let converter = Converter::new(Form::MarineDvl, &TopicConfig::default());
    let of = |v: [f64; 3], beams: f64| {
        converter.values(&[&v[..], &[1.0, beams], &[f64::NAN; SLOTS]].concat()).map(|_| ())
    };
    assert_eq!(of([0.0; 3], 0.0), Err(Unused::Invalid));
    assert_eq!(of([1.0; 3], 0.0), Ok(()), "a driver that leaves the count zero");
    assert_eq!(of([1.0; 3], 4.0), Ok(()));
    assert_eq!(of([1.0; 3], 0.0), Err(Unused::Invalid));
}

#[test]
fn ten_metres_of_sea_water_are_ten_metres_deep() {
    let pressure = 101_325.0 + 10.0 * 1025.0 * 9.806_65;
    let v = convert(Form::Pressure, &TopicConfig::default(), &[pressure]).unwrap_or_default();
    assert!((v[0] - 10.0).abs() < 1e-9);
}

#[test]
fn a_magnetometer_that_points_east_sees_north_to_its_left() {
    let v = convert(Form::Magnetic, &TopicConfig::default(), &[0.0, 2e-5, -4e-5]);
    assert!((v.unwrap_or_default()[0] - 90_f64.to_radians()).abs() < 1e-12);
}

#[test]
fn the_accuracy_of_a_fix_is_that_of_its_covariance() {
    let fix = [50.0, 8.0, 100.0, 0.0, 4.0, 16.0, 25.0, 2.0];
    let v = convert(Form::Fix, &TopicConfig::default(), &fix).unwrap_or_default();
    assert_eq!((v[0], v[2], v[4]), (50_f64.to_radians(), 100.0, 5.0));
    assert!((v[3] - 10_f64.sqrt()).abs() < 1e-12);
}
