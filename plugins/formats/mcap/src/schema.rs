//! The message definitions of the log, each with the definitions it refers to, as ROS 2 writes
//! them.

/// A message type: its name, and its definition in `ros2msg` form.
#[derive(Clone, Copy, Debug)]
pub struct Schema {
    /// `package/msg/Type`.
    pub name: &'static str,
    /// The definition, followed by the definitions that it refers to.
    pub text: &'static str,
}

macro_rules! definition {
    ($package:literal, $name:literal) => {
        include_str!(concat!("../msg/", $package, "/", $name, ".msg"))
    };
}

macro_rules! schema {
    ($package:literal / $name:literal $(, $p:literal / $n:literal)*) => {
        Schema {
            name: concat!($package, "/msg/", $name),
            text: concat!(
                definition!($package, $name)
                $(, "========================================\
                     ========================================\n",
                    "MSG: ", $p, "/", $n, "\n", definition!($p, $n))*
            ),
        }
    };
}

/// Inertial measurement.
pub const IMU: Schema = schema!(
    "sensor_msgs" / "Imu",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "geometry_msgs" / "Quaternion",
    "geometry_msgs" / "Vector3"
);

/// A sample of any sensor.
pub const SAMPLE: Schema =
    schema!("navfuse_msgs" / "Sample", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// Pressure.
pub const PRESSURE: Schema =
    schema!("sensor_msgs" / "FluidPressure", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// Geodetic position.
pub const FIX: Schema = schema!(
    "sensor_msgs" / "NavSatFix",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "sensor_msgs" / "NavSatStatus"
);

/// Pose and velocity.
pub const ODOMETRY: Schema = schema!(
    "nav_msgs" / "Odometry",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "geometry_msgs" / "PoseWithCovariance",
    "geometry_msgs" / "Pose",
    "geometry_msgs" / "Point",
    "geometry_msgs" / "Quaternion",
    "geometry_msgs" / "TwistWithCovariance",
    "geometry_msgs" / "Twist",
    "geometry_msgs" / "Vector3"
);

/// Poses over time.
pub const PATH: Schema = schema!(
    "nav_msgs" / "Path",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "geometry_msgs" / "PoseStamped",
    "geometry_msgs" / "Pose",
    "geometry_msgs" / "Point",
    "geometry_msgs" / "Quaternion"
);

/// Bodies and lines in three dimensions.
pub const MARKERS: Schema = schema!(
    "visualization_msgs" / "MarkerArray",
    "visualization_msgs" / "Marker",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "geometry_msgs" / "Pose",
    "geometry_msgs" / "Point",
    "geometry_msgs" / "Quaternion",
    "geometry_msgs" / "Vector3",
    "std_msgs" / "ColorRGBA",
    "builtin_interfaces" / "Duration",
    "sensor_msgs" / "CompressedImage",
    "visualization_msgs" / "UVCoordinate",
    "visualization_msgs" / "MeshFile"
);

/// The verdict of a run.
pub const VERDICT: Schema =
    schema!("navfuse_msgs" / "Verdict", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// The health of a sensor.
pub const HEALTH: Schema =
    schema!("navfuse_msgs" / "Health", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// Frames.
pub const TRANSFORMS: Schema = schema!(
    "tf2_msgs" / "TFMessage",
    "geometry_msgs" / "TransformStamped",
    "std_msgs" / "Header",
    "builtin_interfaces" / "Time",
    "geometry_msgs" / "Transform",
    "geometry_msgs" / "Vector3",
    "geometry_msgs" / "Quaternion"
);

/// One block of the state.
pub const BLOCK: Schema =
    schema!("navfuse_msgs" / "BlockState", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// One use of a sample.
pub const INNOVATION: Schema =
    schema!("navfuse_msgs" / "Innovation", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// A fault that was found.
pub const FINDING: Schema =
    schema!("navfuse_msgs" / "Finding", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// A rejected sample of a driving sensor.
pub const REJECTION: Schema =
    schema!("navfuse_msgs" / "Rejection", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// A derived quantity.
pub const DERIVED: Schema =
    schema!("navfuse_msgs" / "Derived", "std_msgs" / "Header", "builtin_interfaces" / "Time");

/// An event.
pub const LOG: Schema = schema!("rcl_interfaces" / "Log", "builtin_interfaces" / "Time");
