//! The channels of the inertial units of SBG, VectorNav (binary) and MicroStrain.

use super::entries::{
    DEGREE, Entry, INCREMENTS, Known, OWN, attitude, entry, field, inertial, known, valid,
};
use crate::term::Term;

/// Standard gravity, m/s^2: forces and their increments of MicroStrain are in g.
const GRAVITY: f64 = 9.806_65;

/// Position and accuracy of a receiver of SBG, whose altitude is above the geoid.
const POSITION: &[Entry] = &[
    field("lat", "lat", DEGREE),
    field("lon", "lon", DEGREE),
    entry("height", Term::Sum("altitude", "undulation"), 1.0),
    entry("h_acc", Term::MeanSquare("lat_acc", "lon_acc"), 1.0),
    field("v_acc", "alt_acc", 1.0),
];
const VELOCITY: &[Entry] = &[
    field("vel_n", "vel_n", 1.0),
    field("vel_e", "vel_e", 1.0),
    field("vel_d", "vel_d", 1.0),
    entry("s_acc", Term::MeanSquare("acc_n", "acc_e"), 1.0),
];
const TRACK: &[Entry] =
    &[field("vel_x", "vel_x", 1.0), field("vel_y", "vel_y", 1.0), field("vel_z", "vel_z", 1.0)];

/// A receiver of VectorNav.
const RECEIVER: &[Entry] = &[
    field("lat", "lat", DEGREE),
    field("lon", "lon", DEGREE),
    field("height", "height", 1.0),
    field("vel_n", "vel_n", 1.0),
    field("vel_e", "vel_e", 1.0),
    field("vel_d", "vel_d", 1.0),
    entry("h_acc", Term::MeanSquare("n_acc", "e_acc"), 1.0),
    field("v_acc", "v_acc", 1.0),
    field("s_acc", "s_acc", 1.0),
];

const fn sound(message: &'static str, entries: &'static [Entry]) -> Known {
    valid("status", 1.0, known(message, entries))
}

/// The known messages.
pub const KNOWN: &[Known] = &[
    sound("IMU_SHORT", &inertial(OWN, 1.0, 1.0)),
    sound("IMU_DATA", &inertial(OWN, 1.0, 1.0)),
    sound("EKF_EULER", &attitude(["roll", "pitch", "yaw"], 1.0)),
    sound(
        "EKF_NAV",
        &[
            field("lat", "lat", DEGREE),
            field("lon", "lon", DEGREE),
            entry("height", Term::Sum("altitude", "undulation"), 1.0),
            field("vel_n", "vel_n", 1.0),
            field("vel_e", "vel_e", 1.0),
            field("vel_d", "vel_d", 1.0),
        ],
    ),
    sound("GPS1_POS", POSITION),
    sound("GPS2_POS", POSITION),
    sound("GPS1_VEL", VELOCITY),
    sound("GPS2_VEL", VELOCITY),
    sound("GPS1_HDT", &[field("heading", "heading", DEGREE)]),
    sound("DVL_BOTTOM_TRACK", TRACK),
    sound("DVL_WATER_TRACK", TRACK),
    sound("DEPTH", &[field("depth", "altitude", -1.0)]),
    sound("ODO_VEL", &[field("speed", "speed", 1.0)]),
    known("VN-DELTA", INCREMENTS),
    known("VN-IMU", &inertial(OWN, 1.0, 1.0)),
    valid("fix_type", 3.0, known("VN-GPS", RECEIVER)),
    valid("fix_type", 3.0, known("VN-GPS2", RECEIVER)),
    valid(
        "ins_status",
        2.0,
        known(
            "VN-INS",
            &[
                field("lat", "lat", DEGREE),
                field("lon", "lon", DEGREE),
                field("height", "height", 1.0),
                field("vel_n", "vel_n", 1.0),
                field("vel_e", "vel_e", 1.0),
                field("vel_d", "vel_d", 1.0),
                field("roll", "roll", DEGREE),
                field("pitch", "pitch", DEGREE),
                field("yaw", "yaw", DEGREE),
            ],
        ),
    ),
    known("VN-ATTITUDE", &attitude(["roll", "pitch", "yaw"], DEGREE)),
    known("MIP-IMU", &inertial(OWN, 1.0, GRAVITY)),
    known(
        "MIP-DELTA",
        &[
            field("dtheta_x", "dtheta_x", 1.0),
            field("dtheta_y", "dtheta_y", 1.0),
            field("dtheta_z", "dtheta_z", 1.0),
            field("dvel_x", "dvel_x", GRAVITY),
            field("dvel_y", "dvel_y", GRAVITY),
            field("dvel_z", "dvel_z", GRAVITY),
        ],
    ),
    sound(
        "MIP-GNSS",
        &[
            field("lat", "lat", DEGREE),
            field("lon", "lon", DEGREE),
            field("height", "height", 1.0),
            field("vel_n", "vel_n", 1.0),
            field("vel_e", "vel_e", 1.0),
            field("vel_d", "vel_d", 1.0),
            field("h_acc", "h_acc", 1.0),
            field("v_acc", "v_acc", 1.0),
            field("s_acc", "s_acc", 1.0),
        ],
    ),
    known(
        "MIP-FILTER",
        &[
            field("lat", "lat", DEGREE),
            field("lon", "lon", DEGREE),
            field("height", "height", 1.0),
            field("vel_n", "vel_n", 1.0),
            field("vel_e", "vel_e", 1.0),
            field("vel_d", "vel_d", 1.0),
            field("roll", "roll", 1.0),
            field("pitch", "pitch", 1.0),
            field("yaw", "yaw", 1.0),
            field("heading", "yaw", 1.0),
        ],
    ),
];
