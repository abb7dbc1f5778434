//! Headings and what they mean.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
use super::*;

#[test]
fn headings_of_many_programs_mean_a_channel_and_a_unit() {
    for (heading, channel, unit, sign) in [
        ("w_RS_S_x [rad s^-1]", "gyro_x", Some("rad/s"), 1.0),
        ("a_RS_S_z [m s^-2]", "accel_z", Some("m/s^2"), 1.0),
        ("#timestamp [ns]", "time", Some("ns"), 1.0),
        ("omega_x", "gyro_x", None, 1.0),
        ("alpha_y", "accel_y", None, 1.0),
        ("%time", "time", None, 1.0),
        ("field.header.stamp", "time", None, 1.0),
        ("field.angular_velocity.x", "gyro_x", None, 1.0),
        ("field.linear_acceleration.z", "accel_z", None, 1.0),
        ("ACC X [m/s^2]", "accel_x", Some("m/s^2"), 1.0),
        ("Acc_X", "accel_x", None, 1.0),
        ("GyrZ", "gyro_z", None, 1.0),
        ("SampleTimeFine", "time", None, 1.0),
        ("Gyroscope x (rad/s)", "gyro_x", Some("rad/s"), 1.0),
        ("Linear Acceleration x (m/s^2)", "accel_x", Some("m/s^2"), 1.0),
        ("gyro_rad[0]", "gyro_x", Some("rad/s"), 1.0),
        ("accelerometer_m_s2[2]", "accel_z", Some("m/s^2"), 1.0),
        ("xgyro", "gyro_x", None, 1.0),
        ("zacc", "accel_z", None, 1.0),
        ("UncompAccX", "accel_x", None, 1.0),
        ("GX (deg/s)", "gyro_x", Some("deg/s"), 1.0),
        ("gy_dps", "gyro_y", Some("deg/s"), 1.0),
        ("ax_g", "accel_x", Some("g"), 1.0),
        ("AccUp (g)", "accel_z", Some("g"), -1.0),
        ("gyro_left_dps", "gyro_y", Some("deg/s"), -1.0),
        ("Latitude (°)", "lat", Some("deg"), 1.0),
        ("Height (m)", "height", Some("m"), 1.0),
        ("vel_n_m_s", "vel_n", Some("m/s"), 1.0),
        ("velUp [km/h]", "vel_d", Some("km/h"), -1.0),
        ("speed_mps", "speed", Some("m/s"), 1.0),
        ("seconds_elapsed", "time", None, 1.0),
        ("time_us", "time", Some("us"), 1.0),
        ("GPS Week", "week", None, 1.0),
        ("yaw rate [°/s]", "gyro_z", Some("deg/s"), 1.0),
        ("IMU::UncompAccel::Accel_X", "accel_x", None, 1.0),
        ("Inertial-3DM:scaledGyroZ", "gyro_z", None, 1.0),
        ("Shimmer_5_Accel_LN_Y_CAL", "accel_y", None, 1.0),
        ("AngleRateX (deg/s)", "gyro_x", Some("deg/s"), 1.0),
        ("GNSS::PosLla::Latitude", "lat", None, 1.0),
        ("H-Ell", "height", None, 1.0),
        ("GCrs", "course", None, 1.0),
        ("Velocity (m/s)", "speed", Some("m/s"), 1.0),
        ("UncalAccelXMps2", "accel_x", Some("m/s^2"), 1.0),
        ("φ [°]", "lat", Some("deg"), 1.0),
        ("λ [°]", "lon", Some("deg"), 1.0),
        ("bt_x_mms", "vel_x", Some("mm/s"), 1.0),
        ("v längs [cm/s]", "vel_x", Some("cm/s"), 1.0),
        ("P1 [mbar]", "pressure", Some("hPa"), 1.0),
        ("UncalGyroZRadPerSec", "gyro_z", Some("rad/s"), 1.0),
        ("gyro_x_mdps", "gyro_x", Some("deg/(1000*s)"), 1.0),
        ("pressure_kPa", "pressure", Some("kPa"), 1.0),
        ("velocity_x_mm", "vel_x", Some("mm/s"), 1.0),
        ("lat_e7", "lat", None, 1.0),
        ("alt_mm", "height", Some("mm"), 1.0),
        ("ms", "time", None, 1.0),
        ("x-ecef(m)", "x_ecef", Some("m"), 1.0),
        ("InlineAcc", "accel_x", None, 1.0),
        ("gyroRotationX(rad/s)", "gyro_x", Some("rad/s"), 1.0),
        ("lla[0]", "lat", None, 1.0),
        ("gps_lla[1]", "lon", None, 1.0),
        ("llh[2] [m]", "height", Some("m"), 1.0),
        ("geometry.coordinates.0", "lon", None, 1.0),
        ("v_ned[1]", "vel_e", None, 1.0),
        ("omega_x{deg/s}", "gyro_x", Some("deg/s"), 1.0),
        ("data.velocity_mm_s.x", "vel_x", Some("mm/s"), 1.0),
        ("accel_m_s2_z", "accel_z", Some("m/s^2"), 1.0),
        ("Gierrate (deg/s)", "gyro_z", Some("deg/s"), 1.0),
        ("Längsbeschleunigung (m/s2)", "accel_x", Some("m/s^2"), 1.0),
        ("axb", "accel_x", None, 1.0),
    ] {
        let m = meaning(heading).unwrap_or_else(|| panic!("{heading}"));
        let unit = unit.map(str::to_owned);
        assert_eq!((m.channel, m.unit, m.sign), (channel, unit, sign), "{heading}");
    }
}

#[test]
fn a_heading_that_resembles_a_channel_is_none() {
    for heading in [
        "field.angular_velocity_covariance0",
        "FreeAcc_E",
        "mag_x",
        "gyro_integral_dt",
        "accelerometer_timestamp_relative",
        "orientation.x",
        "temperature",
        "PacketCounter",
        "Mat[1][1]",
        "x",
        "cmd_vel_x",
        "target_latitude",
        "std_lat",
        "water_depth",
        "sound_speed",
        "coordinates_x",
        "q0",
        "",
    ] {
        assert_eq!(meaning(heading), None, "{heading}");
    }
}

#[test]
fn a_number_before_a_vector_is_no_axis() {
    assert_eq!(meaning("GPS(0):sAcc").map(|m| m.channel), None);
    assert_eq!(meaning("IMU_ATTI(0):accelX").map(|m| m.channel), Some("accel_x"));
}

#[test]
fn axes_from_one_before_a_unit_with_a_digit_count_from_zero() {
    let all = ["a1_cmps2", "a2_cmps2", "a3_cmps2"].map(str::to_owned);
    let channels = all.each_ref().map(|h| meaning(&from_zero(h, &all)).map(|m| m.channel));
    assert_eq!(channels, [Some("accel_x"), Some("accel_y"), Some("accel_z")]);
}
