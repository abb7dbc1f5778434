//! The channels of ArduPilot DataFlash, u-blox, Nortek Nucleus and PSINS.

use super::entries::{
    DEGREE, E7, Entry, INCREMENTS, Known, OWN, PASCAL, SEA_LEVEL, attitude, entry, field, inertial,
    known, unless, valid,
};
use crate::term::Term;

/// Degrees per second, and metres per second squared, of a count of `ESF-MEAS`.
const ESF_GYRO: f64 = DEGREE / 4096.0;
const ESF_ACCEL: f64 = 1.0 / 1024.0;
/// Accuracies of a receiver of Septentrio, cm: twice the root mean square of the horizontal distance,
/// 2 sqrt(2) times the sigma of an axis, and twice the vertical sigma; 65535 where it knows none.
const SBF_HORIZONTAL: f64 = 0.01 / (2.0 * std::f64::consts::SQRT_2);
const SBF_VERTICAL: f64 = 0.005;
const SBF_UNKNOWN: f64 = 65_535.0;
/// Accuracy of a receiver of u-blox that knows none, mm.
const UNKNOWN: f64 = 4_294_967_295.0;

/// The inertial units of DataFlash.
const RATES: &[Entry] = &inertial(["GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"], 1.0, 1.0);

const TRACK: &[Entry] = &[
    field("vel_x", "velocity_x", 1.0),
    field("vel_y", "velocity_y", 1.0),
    field("vel_z", "velocity_z", 1.0),
];

/// The estimate of DUNE: offsets from a place.
const PLACE: [&str; 4] = ["x", "y", "lat", "lon"];

/// The known messages.
pub const KNOWN: &[Known] = &[
    known(
        "AngularVelocity",
        &[field("gyro_x", "x", 1.0), field("gyro_y", "y", 1.0), field("gyro_z", "z", 1.0)],
    ),
    known(
        "Acceleration",
        &[field("accel_x", "x", 1.0), field("accel_y", "y", 1.0), field("accel_z", "z", 1.0)],
    ),
    known(
        "GroundVelocity",
        &[field("vel_x", "x", 1.0), field("vel_y", "y", 1.0), field("vel_z", "z", 1.0)],
    ),
    known(
        "WaterVelocity",
        &[field("vel_x", "x", 1.0), field("vel_y", "y", 1.0), field("vel_z", "z", 1.0)],
    ),
    known("Depth", &[field("depth", "value", 1.0)]),
    known("EulerAngles", &attitude(["phi", "theta", "psi"], 1.0)),
    valid(
        "valid",
        1.0,
        known(
            "GpsFix",
            &[
                field("lat", "lat", 1.0),
                field("lon", "lon", 1.0),
                field("height", "height", 1.0),
                entry("vel_n", Term::Component(0, "sog", "cog", 1.0), 1.0),
                entry("vel_e", Term::Component(1, "sog", "cog", 1.0), 1.0),
                field("h_acc", "hacc", 1.0),
                field("v_acc", "vacc", 1.0),
            ],
        ),
    ),
    known(
        "EstimatedState",
        &[
            entry("lat", Term::Projected(0, PLACE), 1.0),
            entry("lon", Term::Projected(1, PLACE), 1.0),
            entry("height", Term::Minus("height", "z"), 1.0),
            field("vel_n", "vx", 1.0),
            field("vel_e", "vy", 1.0),
            field("vel_d", "vz", 1.0),
            field("roll", "phi", 1.0),
            field("pitch", "theta", 1.0),
            field("yaw", "psi", 1.0),
        ],
    ),
    known("IMU", RATES),
    known("IMU2", RATES),
    known("IMU3", RATES),
    valid(
        "Status",
        3.0,
        known(
            "GPS",
            &[
                field("lat", "Lat", DEGREE),
                field("lon", "Lng", DEGREE),
                field("height", "Alt", 1.0),
                entry("vel_n", Term::Component(0, "Spd", "GCrs", DEGREE), 1.0),
                entry("vel_e", Term::Component(1, "Spd", "GCrs", DEGREE), 1.0),
                field("vel_d", "VZ", 1.0),
            ],
        ),
    ),
    known(
        "GPA",
        &[
            unless(field("h_acc", "HAcc", 1.0), 0.0),
            unless(field("v_acc", "VAcc", 1.0), 0.0),
            unless(field("s_acc", "SAcc", 1.0), 0.0),
        ],
    ),
    known("ATT", &attitude(["Roll", "Pitch", "Yaw"], DEGREE)),
    known(
        "POS",
        &[field("lat", "Lat", DEGREE), field("lon", "Lng", DEGREE), field("height", "Alt", 1.0)],
    ),
    known("BARO", &[Entry { offset: -SEA_LEVEL, ..field("depth", "Press", PASCAL) }]),
    known(
        "VISO",
        &[
            entry("vel_x", Term::Ratio("PosDX", "dt"), 1.0),
            entry("vel_y", Term::Ratio("PosDY", "dt"), 1.0),
            entry("vel_z", Term::Ratio("PosDZ", "dt"), 1.0),
        ],
    ),
    valid(
        "fixType",
        3.0,
        known(
            "NAV-PVT",
            &[
                field("lat", "lat", E7),
                field("lon", "lon", E7),
                field("height", "height", 1e-3),
                field("vel_n", "velN", 1e-3),
                field("vel_e", "velE", 1e-3),
                field("vel_d", "velD", 1e-3),
                unless(field("h_acc", "hAcc", 1e-3), UNKNOWN),
                unless(field("v_acc", "vAcc", 1e-3), UNKNOWN),
                unless(field("s_acc", "sAcc", 1e-3), UNKNOWN),
            ],
        ),
    ),
    known(
        "ESF-MEAS",
        &[
            field("gyro_x", "gyro_x", ESF_GYRO),
            field("gyro_y", "gyro_y", ESF_GYRO),
            field("gyro_z", "gyro_z", ESF_GYRO),
            field("accel_x", "accel_x", ESF_ACCEL),
            field("accel_y", "accel_y", ESF_ACCEL),
            field("accel_z", "accel_z", ESF_ACCEL),
            field("speed", "speed", 1e-3),
        ],
    ),
    known("NUCLEUS-IMU", &inertial(OWN, 1.0, 1.0)),
    known(
        "NUCLEUS-AHRS",
        &[
            field("roll", "roll", DEGREE),
            field("pitch", "pitch", DEGREE),
            field("yaw", "heading", DEGREE),
            field("heading", "heading", DEGREE),
            field("depth", "depth", 1.0),
        ],
    ),
    valid("status", 1.0, known("NUCLEUS-BOTTOM-TRACK", TRACK)),
    valid("status", 1.0, known("NUCLEUS-WATER-TRACK", TRACK)),
    valid(
        "status",
        1.0,
        known(
            "NUCLEUS-INS",
            &[
                field("lat", "latitude", DEGREE),
                field("lon", "longitude", DEGREE),
                field("height", "depth", -1.0),
                field("vel_n", "velocity_n", 1.0),
                field("vel_e", "velocity_e", 1.0),
                field("vel_d", "velocity_d", 1.0),
                field("roll", "roll", DEGREE),
                field("pitch", "pitch", DEGREE),
                field("yaw", "heading", DEGREE),
            ],
        ),
    ),
    valid(
        "Mode",
        1.0,
        known(
            "PVTGeodetic",
            &[
                field("lat", "Latitude", 1.0),
                field("lon", "Longitude", 1.0),
                field("height", "Height", 1.0),
                field("vel_n", "Vn", 1.0),
                field("vel_e", "Ve", 1.0),
                field("vel_d", "Vu", -1.0),
                unless(field("h_acc", "HAccuracy", SBF_HORIZONTAL), SBF_UNKNOWN),
                unless(field("v_acc", "VAccuracy", SBF_VERTICAL), SBF_UNKNOWN),
            ],
        ),
    ),
    known("AttEuler", &attitude(["Roll", "Pitch", "Heading"], DEGREE)),
    known("ExtSensorMeas", &inertial(OWN, DEGREE, 1.0)),
    known("PSINS", INCREMENTS),
];
