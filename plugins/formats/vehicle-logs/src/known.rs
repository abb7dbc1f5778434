//! The channels of sensors in known messages.

mod entries;
mod instruments;
mod units;

use crate::term::Term;
use entries::{
    DEGREE, E7, Entry, INCREMENTS, Known, MILLI_G, OWN, PASCAL, SEA_LEVEL, attitude, entry, field,
    inertial, known, unless, valid,
};

const Q: [&str; 4] = ["q[0]", "q[1]", "q[2]", "q[3]"];
const LOCAL: [&str; 4] = ["x", "y", "ref_lat", "ref_lon"];

/// Angular rate and specific force of SCALED_IMU: mrad/s and thousandths of gravity.
const SCALED: &[Entry] = &inertial(MAVLINK, 1e-3, MILLI_G);

/// A receiver of MAVLink. Course and speed are 65535 where they are unknown, the height above the
/// ellipsoid and the accuracies are zero where the message does not have them.
const GPS: &[Entry] = &[
    field("lat", "lat", E7),
    field("lon", "lon", E7),
    unless(field("height", "alt_ellipsoid", 1e-3), 0.0),
    field("height", "alt", 1e-3),
    unless(entry("vel_n", Term::Component(0, "vel", "cog", 0.01 * DEGREE), 0.01), 65_535.0),
    unless(entry("vel_e", Term::Component(1, "vel", "cog", 0.01 * DEGREE), 0.01), 65_535.0),
    unless(field("h_acc", "h_acc", 1e-3), 0.0),
    unless(field("v_acc", "v_acc", 1e-3), 0.0),
    unless(field("s_acc", "vel_acc", 1e-3), 0.0),
];

const WATER_PRESSURE: &[Entry] =
    &[Entry { offset: -SEA_LEVEL, ..field("depth", "press_abs", 100.0 * PASCAL) }];

/// The receivers of PX4, since release 1.14 and before.
const SENSOR_GPS: &[Entry] = &[
    field("lat", "latitude_deg", DEGREE),
    field("lon", "longitude_deg", DEGREE),
    field("height", "altitude_ellipsoid_m", 1.0),
    field("vel_n", "vel_n_m_s", 1.0),
    field("vel_e", "vel_e_m_s", 1.0),
    field("vel_d", "vel_d_m_s", 1.0),
    field("h_acc", "eph", 1.0),
    field("v_acc", "epv", 1.0),
    field("s_acc", "s_variance_m_s", 1.0),
];
const OLD_GPS: &[Entry] = &[
    field("lat", "lat", E7),
    field("lon", "lon", E7),
    field("height", "alt_ellipsoid", 1e-3),
    field("vel_n", "vel_n_m_s", 1.0),
    field("vel_e", "vel_e_m_s", 1.0),
    field("vel_d", "vel_d_m_s", 1.0),
    field("h_acc", "eph", 1.0),
    field("v_acc", "epv", 1.0),
    field("s_acc", "s_variance_m_s", 1.0),
];

const VECTORNAV: &[Entry] = &inertial(OWN, 1.0, 1.0);
/// Fields of MAVLink.
const MAVLINK: [&str; 6] = ["xgyro", "ygyro", "zgyro", "xacc", "yacc", "zacc"];

const INSPVA: &[Entry] = &[
    field("lat", "lat", DEGREE),
    field("lon", "lon", DEGREE),
    field("height", "height", 1.0),
    field("vel_n", "vel_n", 1.0),
    field("vel_e", "vel_e", 1.0),
    field("vel_d", "vel_u", -1.0),
    field("roll", "roll", DEGREE),
    field("pitch", "pitch", DEGREE),
    field("yaw", "azimuth", DEGREE),
    field("heading", "azimuth", DEGREE),
];

/// The known messages.
const KNOWN: &[Known] = &[
    known(
        "sensor_combined",
        &[
            field("gyro_x", "gyro_rad[0]", 1.0),
            field("gyro_y", "gyro_rad[1]", 1.0),
            field("gyro_z", "gyro_rad[2]", 1.0),
            field("accel_x", "accelerometer_m_s2[0]", 1.0),
            field("accel_y", "accelerometer_m_s2[1]", 1.0),
            field("accel_z", "accelerometer_m_s2[2]", 1.0),
        ],
    ),
    known(
        "vehicle_imu",
        &[
            entry("gyro_x", Term::Ratio("delta_angle[0]", "delta_angle_dt"), 1e6),
            entry("gyro_y", Term::Ratio("delta_angle[1]", "delta_angle_dt"), 1e6),
            entry("gyro_z", Term::Ratio("delta_angle[2]", "delta_angle_dt"), 1e6),
            entry("accel_x", Term::Ratio("delta_velocity[0]", "delta_velocity_dt"), 1e6),
            entry("accel_y", Term::Ratio("delta_velocity[1]", "delta_velocity_dt"), 1e6),
            entry("accel_z", Term::Ratio("delta_velocity[2]", "delta_velocity_dt"), 1e6),
            field("dtheta_x", "delta_angle[0]", 1.0),
            field("dtheta_y", "delta_angle[1]", 1.0),
            field("dtheta_z", "delta_angle[2]", 1.0),
            field("dvel_x", "delta_velocity[0]", 1.0),
            field("dvel_y", "delta_velocity[1]", 1.0),
            field("dvel_z", "delta_velocity[2]", 1.0),
        ],
    ),
    valid("fix_type", 3.0, known("sensor_gps", SENSOR_GPS)),
    valid("fix_type", 3.0, known("sensor_gps", OLD_GPS)),
    valid("fix_type", 3.0, known("vehicle_gps_position", SENSOR_GPS)),
    valid("fix_type", 3.0, known("vehicle_gps_position", OLD_GPS)),
    known("vehicle_air_data", &[field("depth", "baro_alt_meter", -1.0)]),
    known(
        "vehicle_attitude",
        &[
            entry("roll", Term::Euler(0, Q), 1.0),
            entry("pitch", Term::Euler(1, Q), 1.0),
            entry("yaw", Term::Euler(2, Q), 1.0),
            entry("heading", Term::Euler(2, Q), 1.0),
        ],
    ),
    valid(
        "xy_global",
        1.0,
        known(
            "vehicle_local_position",
            &[
                entry("lat", Term::Projected(0, LOCAL), 1.0),
                entry("lon", Term::Projected(1, LOCAL), 1.0),
                entry("height", Term::Minus("ref_alt", "z"), 1.0),
                field("vel_n", "vx", 1.0),
                field("vel_e", "vy", 1.0),
                field("vel_d", "vz", 1.0),
                field("yaw", "heading", 1.0),
            ],
        ),
    ),
    known(
        "vehicle_global_position",
        &[
            field("lat", "lat", DEGREE),
            field("lon", "lon", DEGREE),
            field("height", "alt_ellipsoid", 1.0),
            field("height", "alt", 1.0),
        ],
    ),
    known("HIGHRES_IMU", &inertial(MAVLINK, 1.0, 1.0)),
    known("SCALED_IMU", SCALED),
    known("SCALED_IMU2", SCALED),
    known("SCALED_IMU3", SCALED),
    // the message leaves the units to the vehicle; ArduPilot sends those of SCALED_IMU
    known("RAW_IMU", SCALED),
    valid("fix_type", 3.0, known("GPS_RAW_INT", GPS)),
    valid("fix_type", 3.0, known("GPS2_RAW", GPS)),
    // the second and the third sensor of a submarine vehicle measure the water
    known("SCALED_PRESSURE2", WATER_PRESSURE),
    known("SCALED_PRESSURE3", WATER_PRESSURE),
    known("ATTITUDE", &attitude(["roll", "pitch", "yaw"], 1.0)),
    known(
        "GLOBAL_POSITION_INT",
        &[
            field("lat", "lat", E7),
            field("lon", "lon", E7),
            field("height", "alt", 1e-3),
            field("vel_n", "vx", 0.01),
            field("vel_e", "vy", 0.01),
            field("vel_d", "vz", 0.01),
            unless(field("yaw", "hdg", 0.01 * DEGREE), 65_535.0),
        ],
    ),
    known(
        "VISION_POSITION_DELTA",
        &[
            entry("vel_x", Term::Ratio("position_delta[0]", "time_delta_usec"), 1e6),
            entry("vel_y", Term::Ratio("position_delta[1]", "time_delta_usec"), 1e6),
            entry("vel_z", Term::Ratio("position_delta[2]", "time_delta_usec"), 1e6),
        ],
    ),
    known(
        "ODOMETRY",
        &[field("vel_x", "vx", 1.0), field("vel_y", "vy", 1.0), field("vel_z", "vz", 1.0)],
    ),
    known(
        "VFR_HUD",
        &[
            field("depth", "alt", -1.0),
            field("heading", "heading", DEGREE),
            field("speed", "groundspeed", 1.0),
        ],
    ),
    known("RAWIMU", INCREMENTS),
    known("RAWIMUS", INCREMENTS),
    known("RAWIMUX", INCREMENTS),
    known("RAWIMUSX", INCREMENTS),
    known("INSPVA", INSPVA),
    known("INSPVAS", INSPVA),
    known("INSPVAX", INSPVA),
    valid(
        "computed",
        1.0,
        known(
            "BESTPOS",
            &[
                field("lat", "lat", DEGREE),
                field("lon", "lon", DEGREE),
                entry("height", Term::Sum("height", "undulation"), 1.0),
                entry("h_acc", Term::MeanSquare("sigma_n", "sigma_e"), 1.0),
                field("v_acc", "sigma_u", 1.0),
            ],
        ),
    ),
    valid(
        "computed",
        1.0,
        known(
            "BESTVEL",
            &[
                entry("vel_n", Term::Component(0, "speed", "course", DEGREE), 1.0),
                entry("vel_e", Term::Component(1, "speed", "course", DEGREE), 1.0),
                field("vel_d", "vel_u", -1.0),
            ],
        ),
    ),
    known("VNIMU", VECTORNAV),
    known("VNYMR", VECTORNAV),
    known(
        "VNYMR",
        &[
            field("yaw", "yaw", DEGREE),
            field("heading", "yaw", DEGREE),
            field("pitch", "pitch", DEGREE),
            field("roll", "roll", DEGREE),
        ],
    ),
    valid(
        "fix",
        2.0,
        known(
            "VNGPS",
            &[
                field("lat", "lat", DEGREE),
                field("lon", "lon", DEGREE),
                field("height", "alt", 1.0),
                field("vel_n", "vel_n", 1.0),
                field("vel_e", "vel_e", 1.0),
                field("vel_d", "vel_d", 1.0),
                entry("h_acc", Term::MeanSquare("n_acc", "e_acc"), 1.0),
                field("v_acc", "v_acc", 1.0),
                field("s_acc", "s_acc", 1.0),
            ],
        ),
    ),
    known(
        "VNINS",
        &[
            field("lat", "lat", DEGREE),
            field("lon", "lon", DEGREE),
            field("height", "alt", 1.0),
            field("vel_n", "vel_n", 1.0),
            field("vel_e", "vel_e", 1.0),
            field("vel_d", "vel_d", 1.0),
            field("roll", "roll", DEGREE),
            field("pitch", "pitch", DEGREE),
            field("yaw", "yaw", DEGREE),
        ],
    ),
    known("IMU", INCREMENTS),
    known(
        "SBET",
        &[
            field("lat", "lat", 1.0),
            field("lon", "lon", 1.0),
            field("height", "height", 1.0),
            entry("vel_n", Term::Unwandered(0, ["vel_x", "vel_y", "wander"]), 1.0),
            entry("vel_e", Term::Unwandered(1, ["vel_x", "vel_y", "wander"]), 1.0),
            field("vel_d", "vel_z", 1.0),
            field("roll", "roll", 1.0),
            field("pitch", "pitch", 1.0),
            entry("yaw", Term::AngleBetween("platform_heading", "wander"), 1.0),
        ],
    ),
];

/// The known forms of a message.
pub fn of(message: &str) -> impl Iterator<Item = &'static Known> + '_ {
    let all = KNOWN.iter().chain(instruments::KNOWN).chain(units::KNOWN);
    all.filter(move |known| known.message == message)
}
