//! The words of many programs for vectors and their axes.

/// Words for a vector: its three channels and their SI unit.
pub const VECTORS: [([&str; 3], &str, &[&str]); 8] = [
    (
        ["gyro_x", "gyro_y", "gyro_z"],
        "rad/s",
        &[
            "gyro",
            "gyr",
            "gyros",
            "gyroscope",
            "angularvelocity",
            "angularrate",
            "angvel",
            "angrate",
            "rotationrate",
            "gyrorotation",
            "gyrorotationrate",
            "turnrate",
            "anglerate",
            "bodyrate",
            "omega",
            "as",
            "angularspeed",
            "rate",
            "rates",
            "w",
            "g",
            "om",
        ],
    ),
    (
        ["accel_x", "accel_y", "accel_z"],
        "m/s^2",
        &[
            "accel",
            "acc",
            "acce",
            "accelerometer",
            "acceleration",
            "totalacceleration",
            "linearacceleration",
            "linearaccel",
            "linacc",
            "specificforce",
            "force",
            "a",
            "f",
            "alpha",
            "gf",
            "gforce",
            // load factors of an aircraft
            "n",
            "loadfactor",
        ],
    ),
    (
        ["dtheta_x", "dtheta_y", "dtheta_z"],
        "rad",
        &["dtheta", "deltatheta", "deltaangle", "dang", "dq", "oriinc"],
    ),
    (
        ["dvel_x", "dvel_y", "dvel_z"],
        "m/s",
        &["dvel", "deltavelocity", "deltavel", "deltav", "dv", "velinc"],
    ),
    (
        ["lat", "lon", "height"],
        "",
        &["lla", "llh", "latlonalt", "latlonheight", "positionlla", "positionllh", "geodetic"],
    ),
    // as GeoJSON orders them
    (["lon", "lat", "height"], "", &["coordinates", "geometrycoordinates"]),
    (["vel_n", "vel_e", "vel_d"], "m/s", &["velned", "velocityned", "vned"]),
    (
        ["vel_x", "vel_y", "vel_z"],
        "m/s",
        &[
            "vel",
            "velocity",
            "v",
            "bottomvelocity",
            "dvl",
            "dvlvel",
            "bottomv",
            "bottomtrack",
            "velbt",
            "btvel",
            "vbt",
            "bt",
            "speed",
            "linear",
            "dvlv",
            "dvlvelocity",
            "bottomvel",
            "doppler",
        ],
    ),
];

/// Words for the axes of a vector, with the sign towards forward, right, down.
pub const AXES: [(&str, usize, f64); 18] = [
    ("x", 0, 1.0),
    ("y", 1, 1.0),
    ("z", 2, 1.0),
    ("0", 0, 1.0),
    ("1", 1, 1.0),
    ("2", 2, 1.0),
    ("forward", 0, 1.0),
    ("fwd", 0, 1.0),
    ("front", 0, 1.0),
    ("right", 1, 1.0),
    ("rgt", 1, 1.0),
    ("left", 1, -1.0),
    ("starboard", 1, 1.0),
    ("stbd", 1, 1.0),
    ("port", 1, -1.0),
    ("down", 2, 1.0),
    ("dwn", 2, 1.0),
    ("up", 2, -1.0),
];

/// Words for the axes of one vector alone, by its first channel; after a word of more than two letters.
pub const OWN_AXES: [(&str, [&[&str]; 3]); 3] = [
    ("gyro_x", [&["p", "roll"], &["q", "pitch"], &["r", "yaw"]]),
    (
        "accel_x",
        [
            &["long", "longitudinal", "inline", "surge"],
            &["lat", "lateral", "transverse", "sway"],
            &["vert", "vertical", "normal", "heave"],
        ],
    ),
    (
        "vel_x",
        [
            &["u", "ahead", "longitudinal", "surge"],
            &["v", "lateral", "transverse", "athwart", "sway"],
            &["w", "vertical", "heave"],
        ],
    ),
];
