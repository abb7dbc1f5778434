//! The messages of MAVLink: checksums of all that the common and the vendors' dialects define, and
//! the fields of those with measurements.

use navfuse_frames::Number;
use std::collections::HashMap;

/// Identifiers of the messages, in order.
const IDS: [u32; 353] = [
    0, 1, 2, 4, 5, 6, 7, 11, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36,
    37, 38, 39, 40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 50, 51, 53, 54, 55, 61, 62, 63, 64, 65, 66,
    67, 69, 70, 73, 74, 75, 76, 77, 81, 82, 83, 84, 85, 86, 87, 89, 90, 91, 92, 93, 100, 101, 102,
    103, 104, 105, 106, 107, 108, 109, 110, 111, 112, 113, 114, 115, 116, 117, 118, 119, 120, 121,
    122, 123, 124, 125, 126, 127, 128, 129, 130, 131, 132, 133, 134, 135, 136, 137, 138, 139, 140,
    141, 142, 143, 144, 146, 147, 148, 149, 150, 151, 152, 153, 154, 155, 156, 157, 158, 160, 161,
    162, 163, 164, 165, 166, 167, 168, 169, 170, 171, 172, 173, 174, 175, 176, 177, 178, 179, 180,
    181, 182, 183, 184, 185, 186, 191, 192, 193, 194, 195, 200, 201, 214, 215, 216, 217, 218, 219,
    220, 221, 222, 223, 224, 225, 226, 230, 231, 232, 233, 234, 235, 241, 242, 243, 244, 245, 246,
    247, 248, 249, 250, 251, 252, 253, 254, 256, 257, 258, 259, 260, 261, 262, 263, 264, 265, 266,
    267, 268, 269, 270, 271, 275, 276, 277, 280, 281, 282, 283, 284, 285, 286, 287, 288, 295, 296,
    299, 301, 310, 311, 320, 321, 322, 323, 324, 330, 331, 332, 333, 335, 339, 340, 345, 350, 360,
    370, 373, 375, 376, 385, 386, 387, 388, 390, 420, 435, 436, 437, 441, 513, 8002, 8003, 8004,
    8005, 8006, 8007, 8008, 8009, 8010, 8011, 8012, 8013, 8014, 8015, 8016, 9000, 9005, 10001,
    10002, 10003, 10004, 10005, 10006, 10007, 10008, 10151, 11000, 11001, 11002, 11003, 11004,
    11005, 11010, 11011, 11020, 11030, 11031, 11032, 11033, 11034, 11035, 11036, 11037, 11038,
    11039, 11040, 11041, 11042, 11043, 11044, 11060, 12900, 12901, 12902, 12903, 12904, 12905,
    12915, 12918, 12919, 12920, 17000, 17150, 17151, 17153, 17154, 17155, 17156, 17157, 17158,
    42000, 42001, 50001, 50002, 50003, 50004, 50005, 52000, 52001, 60000, 60010, 60011, 60012,
    60013, 60014, 60020, 60040, 60041, 60045, 60046, 60047, 60050, 60051, 60052, 60053,
];
/// The seed of each message's checksum, which depends on the names and types of its fields.
const EXTRAS: [u8; 353] = [
    50, 124, 137, 237, 217, 104, 119, 89, 214, 159, 220, 168, 24, 23, 170, 144, 67, 115, 39, 246,
    185, 104, 237, 244, 222, 212, 9, 254, 230, 28, 28, 132, 221, 232, 11, 153, 41, 39, 78, 196, 3,
    15, 3, 167, 183, 119, 191, 118, 148, 21, 243, 124, 38, 20, 158, 152, 143, 106, 49, 22, 143,
    140, 5, 150, 231, 183, 63, 54, 47, 175, 102, 158, 208, 56, 93, 138, 108, 32, 185, 84, 34, 174,
    124, 237, 4, 76, 128, 56, 116, 134, 237, 203, 250, 87, 203, 220, 25, 226, 46, 29, 223, 85, 6,
    229, 203, 1, 195, 109, 168, 181, 47, 72, 131, 127, 103, 154, 178, 200, 134, 219, 208, 188, 84,
    22, 19, 21, 134, 78, 68, 189, 127, 154, 21, 21, 144, 1, 234, 73, 181, 22, 83, 167, 138, 234,
    240, 47, 189, 52, 174, 229, 85, 159, 186, 72, 92, 36, 71, 98, 120, 134, 205, 69, 101, 50, 202,
    17, 162, 34, 71, 15, 119, 102, 208, 207, 163, 105, 151, 35, 150, 179, 90, 104, 85, 95, 130,
    184, 81, 8, 204, 49, 170, 44, 83, 46, 71, 131, 187, 92, 146, 179, 12, 133, 49, 26, 193, 35, 14,
    109, 59, 22, 126, 18, 62, 70, 48, 123, 74, 99, 137, 210, 1, 20, 234, 158, 19, 243, 28, 95, 243,
    88, 243, 78, 132, 23, 91, 236, 231, 225, 199, 99, 209, 232, 11, 75, 117, 251, 199, 147, 132, 4,
    8, 156, 20, 134, 193, 30, 169, 99, 218, 231, 172, 251, 97, 64, 234, 144, 155, 20, 54, 222, 200,
    23, 149, 113, 117, 209, 186, 4, 133, 103, 193, 71, 240, 195, 134, 15, 234, 64, 11, 93, 46, 106,
    205, 144, 133, 85, 195, 79, 128, 177, 130, 47, 142, 132, 208, 201, 193, 189, 162, 114, 254,
    140, 249, 77, 49, 94, 139, 7, 20, 103, 26, 72, 19, 89, 27, 14, 187, 106, 227, 239, 246, 181,
    62, 240, 152, 13, 239, 4, 208, 183, 99, 129, 134, 202, 156, 191, 14, 171, 55, 220, 245, 101,
    45,
];

/// Identifier, name and fields of the messages that are decoded. The fields are in the order of the
/// wire, each with its type and the number of its elements: `Q` is an unsigned integer of eight
/// bytes, `I` and `i` are integers of four, `H` and `h` of two, `B` and `b` of one, `f` is a number
/// of four bytes.
const MESSAGES: [(u32, &str, &str); 20] = [
    (
        24,
        "GPS_RAW_INT",
        "time_usec:Q lat:i lon:i alt:i eph:H epv:H vel:H cog:H fix_type:B \
         satellites_visible:B alt_ellipsoid:i h_acc:I v_acc:I vel_acc:I hdg_acc:I yaw:H",
    ),
    (
        26,
        "SCALED_IMU",
        "time_boot_ms:I xacc:h yacc:h zacc:h xgyro:h ygyro:h zgyro:h xmag:h ymag:h zmag:h \
         temperature:h",
    ),
    (
        116,
        "SCALED_IMU2",
        "time_boot_ms:I xacc:h yacc:h zacc:h xgyro:h ygyro:h zgyro:h xmag:h ymag:h zmag:h \
         temperature:h",
    ),
    (
        129,
        "SCALED_IMU3",
        "time_boot_ms:I xacc:h yacc:h zacc:h xgyro:h ygyro:h zgyro:h xmag:h ymag:h zmag:h \
         temperature:h",
    ),
    (
        27,
        "RAW_IMU",
        "time_usec:Q xacc:h yacc:h zacc:h xgyro:h ygyro:h zgyro:h xmag:h ymag:h zmag:h \
         id:B temperature:h",
    ),
    (
        105,
        "HIGHRES_IMU",
        "time_usec:Q xacc:f yacc:f zacc:f xgyro:f ygyro:f zgyro:f xmag:f ymag:f zmag:f \
         abs_pressure:f diff_pressure:f pressure_alt:f temperature:f fields_updated:H \
         id:B",
    ),
    (
        29,
        "SCALED_PRESSURE",
        "time_boot_ms:I press_abs:f press_diff:f temperature:h temperature_press_diff:h",
    ),
    (
        137,
        "SCALED_PRESSURE2",
        "time_boot_ms:I press_abs:f press_diff:f temperature:h temperature_press_diff:h",
    ),
    (
        143,
        "SCALED_PRESSURE3",
        "time_boot_ms:I press_abs:f press_diff:f temperature:h temperature_press_diff:h",
    ),
    (30, "ATTITUDE", "time_boot_ms:I roll:f pitch:f yaw:f rollspeed:f pitchspeed:f yawspeed:f"),
    (
        31,
        "ATTITUDE_QUATERNION",
        "time_boot_ms:I q1:f q2:f q3:f q4:f rollspeed:f pitchspeed:f yawspeed:f \
         repr_offset_q:f4",
    ),
    (32, "LOCAL_POSITION_NED", "time_boot_ms:I x:f y:f z:f vx:f vy:f vz:f"),
    (
        33,
        "GLOBAL_POSITION_INT",
        "time_boot_ms:I lat:i lon:i alt:i relative_alt:i vx:h vy:h vz:h hdg:H",
    ),
    (
        11011,
        "VISION_POSITION_DELTA",
        "time_usec:Q time_delta_usec:Q angle_delta:f3 position_delta:f3 confidence:f",
    ),
    (
        331,
        "ODOMETRY",
        "time_usec:Q x:f y:f z:f q:f4 vx:f vy:f vz:f rollspeed:f pitchspeed:f yawspeed:f \
         pose_covariance:f21 velocity_covariance:f21 frame_id:B child_frame_id:B \
         reset_counter:B estimator_type:B quality:b",
    ),
    (173, "RANGEFINDER", "distance:f voltage:f"),
    (
        132,
        "DISTANCE_SENSOR",
        "time_boot_ms:I min_distance:H max_distance:H current_distance:H type:B id:B \
         orientation:B covariance:B horizontal_fov:f vertical_fov:f quaternion:f4 \
         signal_quality:B",
    ),
    (74, "VFR_HUD", "airspeed:f groundspeed:f alt:f climb:f heading:h throttle:H"),
    (2, "SYSTEM_TIME", "time_unix_usec:Q time_boot_ms:I"),
    (
        124,
        "GPS2_RAW",
        "time_usec:Q lat:i lon:i alt:i dgps_age:I eph:H epv:H vel:H cog:H fix_type:B \
         satellites_visible:B dgps_numch:B yaw:H alt_ellipsoid:i h_acc:I v_acc:I \
         vel_acc:I hdg_acc:I",
    ),
];

/// A message that is decoded.
#[derive(Clone, Debug)]
pub struct Message {
    pub name: &'static str,
    /// Name, offset and type of each number.
    pub fields: Vec<(String, usize, Number)>,
}

/// The messages by their identifier.
#[derive(Debug)]
pub struct Dialect {
    extras: HashMap<u32, u8>,
    messages: HashMap<u32, Message>,
}

impl Dialect {
    pub fn new() -> Self {
        let messages = MESSAGES.iter().map(|(id, name, fields)| (*id, message(name, fields)));
        Self { extras: IDS.into_iter().zip(EXTRAS).collect(), messages: messages.collect() }
    }

    /// The seed of a message's checksum; `None` for an unknown message.
    pub fn extra(&self, id: u32) -> Option<u8> {
        self.extras.get(&id).copied()
    }

    pub fn message(&self, id: u32) -> Option<&Message> {
        self.messages.get(&id)
    }
}

fn message(name: &'static str, text: &str) -> Message {
    let (mut fields, mut at) = (Vec::new(), 0);
    for field in text.split_ascii_whitespace() {
        let (field, kind) = field.split_once(':').unwrap_or((field, "B"));
        let (kind, count) = kind.split_at(1);
        let kind = match kind {
            "Q" => Number::U64,
            "I" => Number::U32,
            "i" => Number::I32,
            "H" => Number::U16,
            "h" => Number::I16,
            "b" => Number::I8,
            "f" => Number::F32,
            _ => Number::U8,
        };
        let count: Option<usize> = count.parse().ok();
        for k in 0..count.unwrap_or(1) {
            let name = count.map_or_else(|| field.to_owned(), |_| format!("{field}[{k}]"));
            fields.push((name, at, kind));
            at += kind.size();
        }
    }
    Message { name, fields }
}
