"""Writes the same messages into a bag of every kind, and the samples that they stand for.

Usage: bags.py FOLDER
"""

import json
import math
import pathlib
import random
import shutil
import sqlite3
import sys

import lz4.frame
import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

folder = pathlib.Path(sys.argv[1])
draw = random.Random(16)

DVL = """
uint8 DVL_MODE_BOTTOM=1
uint8 DVL_MODE_WATER=2
std_msgs/Header header
uint8 velocity_mode
uint8 dvl_type
geometry_msgs/Vector3 velocity
float64[9] velocity_covar
float64 altitude
float64 course_gnd
float64 speed_gnd
uint8 num_good_beams
float32 sound_speed
bool beam_ranges_valid
bool beam_velocities_valid
geometry_msgs/Vector3[4] beam_unit_vec
float64[4] range
float32[4] range_covar
float32[4] beam_quality
float32[4] beam_velocity
float32[4] beam_velocity_covar
"""
BEAM = "int64 id\nfloat64 velocity\nfloat64 distance\nfloat64 rssi\nfloat64 nsd\nbool valid\n"
WATER_LINKED = """
std_msgs/Header header
float64 time
geometry_msgs/Vector3 velocity
float64 fom
float64 altitude
DVLBeam[] beams
bool velocity_valid
int64 status
string form
"""
NORTEK = "\n".join(
    ["bool posix_time", "uint32 timestamp", "uint32 microseconds"]
    + [f"bool beam_{k}_{what}_valid" for what in ("velocity", "distance", "fom") for k in (1, 2, 3)]
    + [f"bool {axis}_{what}_valid" for what in ("velocity", "fom") for axis in "xyz"]
    + ["uint32 serial_number", "float32 sound_speed", "float32 temperature", "float32 pressure"]
    + [f"float32 {what}_beam_{k}" for what in ("velocity", "distance", "fom", "dt", "time_vel")
       for k in (1, 2, 3)]
    + [f"float32 {what}_{axis}" for what in ("velocity", "fom") for axis in "xyz"]
    + ["float32 dt_xyz", "float32 time_vel_xyz"]
)
WHEEL = """
string LABEL="left # wheel"
std_msgs/Header header
string<=20 label
int16[<=4] counts
uint8[3] flags
wheel_msgs/Part[] parts
"""
PART = "string name\nint32 ticks\nfloat32[] speeds\nbool ok\n"

store = get_typestore(Stores.ROS2_HUMBLE)
for text, name in [
    (DVL, "marine_acoustic_msgs/msg/Dvl"),
    (BEAM, "waterlinked_a50_ros_driver/msg/DVLBeam"),
    (WATER_LINKED, "waterlinked_a50_ros_driver/msg/DVL"),
    (NORTEK, "interfaces/msg/BottomTrack"),
    (PART, "wheel_msgs/msg/Part"),
    (WHEEL, "wheel_msgs/msg/Wheel"),
]:
    store.register(get_types_from_msg(text, name))
T = {name.replace("/msg/", "/"): kind for name, kind in store.types.items()}


def vector(values):
    return T["geometry_msgs/Vector3"](*values)


def number():
    return draw.uniform(-3.0, 3.0)


def three():
    return [number() for _ in range(3)]


def rotation():
    q = np.array([draw.gauss(0, 1) for _ in range(4)])
    return q / np.linalg.norm(q)


def matrix(q):
    """The rotation matrix of x, y, z, w."""
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


previous = {}


def motion(sensor, p, q, to_body):
    """The motion since the pose before, along the axes of the body then."""
    p, q = np.array(p), np.array(q)
    before, previous[sensor] = previous.get(sensor), (p, q)
    if before is None:
        return None
    # the product of the conjugate of the quaternion before with this one
    (v, w), (v_before, w_before) = (q[:3], q[3]), (before[1][:3], before[1][3])
    vector = w_before * v - w * v_before - np.cross(v_before, v)
    scalar = w_before * w + v_before @ v
    sine = np.linalg.norm(vector)
    turned = 2 * math.atan2(sine, abs(scalar)) / math.copysign(sine, scalar) * vector
    moved = matrix(before[1]).T @ (p - before[0])
    names = ["move_x", "move_y", "move_z", "turn_x", "turn_y", "turn_z"]
    return dict(zip(names, [*(to_body @ moved), *(to_body @ turned)]))


ENU_NED = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
FLU_FRD = np.diag([1.0, -1.0, -1.0])
# of a sensor whose forward is the right of the vehicle
RIGHT = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
SEMI_MAJOR, FLATTENING = 6378137.0, 1 / 298.257223563
DATUM = math.radians(54.0), math.radians(10.0), 5.0


def angles(c):
    return math.atan2(c[2, 1], c[2, 2]), -math.asin(c[2, 0]), math.atan2(c[1, 0], c[0, 0])


def position(north, east, down):
    e2 = FLATTENING * (2 - FLATTENING)
    s = 1 - e2 * math.sin(DATUM[0]) ** 2
    r_n, r_e = SEMI_MAJOR * (1 - e2) / s**1.5, SEMI_MAJOR / math.sqrt(s)
    return {
        "lat": DATUM[0] + north / (r_n + DATUM[2]),
        "lon": DATUM[1] + east / ((r_e + DATUM[2]) * math.cos(DATUM[0])),
        "height": DATUM[2] - down,
    }


START = 1_700_000_000_000_000_000
messages = []  # received, topic, type, content
expected = {}


def expect(sensor, time, values):
    if values:
        expected.setdefault(sensor, {}).setdefault(time, {}).update(values)


def add(sensor, topic, kind, stamp, latency, values, headless=False, frame=None, **fields):
    if not headless:
        header = T["std_msgs/Header"](
            T["builtin_interfaces/Time"](stamp // 10**9, stamp % 10**9), frame_id=frame or topic[1:]
        )
        fields = {"header": header, **fields}
    messages.append((stamp + latency, topic, kind, T[kind](**fields)))
    # a type without a header has the time at which it was received
    expect(sensor, stamp + latency if headless else stamp, values)


for k in range(200):
    t = START + k * 10_000_000
    ms = 1_000_000
    rates, force = three(), three()
    add("imu", "/imu", "sensor_msgs/Imu", t, draw.randrange(3 * ms),
        dict(zip(["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
                 [rates[0], -rates[1], -rates[2], force[0], -force[1], -force[2]])),
        orientation=T["geometry_msgs/Quaternion"](0.0, 0.0, 0.0, 0.0),
        orientation_covariance=np.array([-1.0] + 8 * [0.0]),
        angular_velocity=vector(rates), angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(force), linear_acceleration_covariance=np.zeros(9))
    if k % 10 == 0:
        lat, lon, height = 54 + number() / 100, 10 + number() / 100, number()
        v, variances = three(), [draw.uniform(1, 9) for _ in range(3)]
        covariance = np.diag(variances).flatten()
        valid = k % 40 != 0
        add("gnss", "/fix", "sensor_msgs/NavSatFix", t, 400 * ms,
            valid and {"lat": math.radians(lat), "lon": math.radians(lon), "height": height,
             "h_acc": math.sqrt((variances[0] + variances[1]) / 2), "v_acc": math.sqrt(variances[2])},
            status=T["sensor_msgs/NavSatStatus"](0 if valid else -1, 1), latitude=lat, longitude=lon,
            altitude=height, position_covariance=covariance, position_covariance_type=2)
        add("gnss", "/vel", "geometry_msgs/TwistStamped", t, 410 * ms,
            {"vel_n": v[1], "vel_e": v[0], "vel_d": -v[2]}, frame="fix",
            twist=T["geometry_msgs/Twist"](vector(v), vector(three())))
        v = three()
        add("dvl", "/dvl", "marine_acoustic_msgs/Dvl", t + 1, 30 * ms,
            k % 50 != 0 and dict(zip(["vel_x", "vel_y", "vel_z"], v)),
            velocity_mode=2 if k % 50 == 0 else 1, dvl_type=0, velocity=vector(v),
            velocity_covar=np.zeros(9), altitude=7.0, course_gnd=0.0, speed_gnd=0.0,
            num_good_beams=4, sound_speed=1500.0, beam_ranges_valid=True, beam_velocities_valid=True,
            beam_unit_vec=[vector(three()) for _ in range(4)], range=np.ones(4),
            range_covar=np.ones(4, np.float32), beam_quality=np.ones(4, np.float32),
            beam_velocity=np.ones(4, np.float32), beam_velocity_covar=np.ones(4, np.float32))
        v = three()
        beam = T["waterlinked_a50_ros_driver/DVLBeam"]
        add("a50", "/a50", "waterlinked_a50_ros_driver/DVL", t + 2, 30 * ms,
            k % 30 != 0 and dict(zip(["vel_x", "vel_y", "vel_z"], v)), time=1.0, velocity=vector(v),
            fom=0.1, altitude=5.0, beams=[beam(i, 0.1, 1.0, 2.0, 3.0, True) for i in range(k % 4)],
            velocity_valid=k % 30 != 0, status=0, form="json_v3")
        v = [np.float32(x) for x in three()]
        nortek = {line.split()[1]: 0 for line in NORTEK.splitlines()}
        for field in nortek:
            if "valid" in field:
                nortek[field] = True
        nortek.update(zip(["velocity_x", "velocity_y", "velocity_z"], v))
        add("nucleus", "/nucleus", "interfaces/BottomTrack", t + 3, 30 * ms,
            dict(zip(["vel_x", "vel_y", "vel_z"], [float(x) for x in v])), headless=True, **nortek)
        v = three()
        twist = T["geometry_msgs/TwistWithCovariance"](
            T["geometry_msgs/Twist"](vector(v), vector(three())), np.zeros(36))
        add("body", "/body", "geometry_msgs/TwistWithCovarianceStamped", t + 4, 30 * ms,
            {"vel_x": v[0], "vel_y": -v[1], "vel_z": -v[2]}, twist=twist)
        q, p, v = rotation(), [10 * x for x in three()], three()
        c = ENU_NED @ matrix(q) @ FLU_FRD
        ned = c @ FLU_FRD @ np.array(v)
        pose = T["geometry_msgs/Pose"](T["geometry_msgs/Point"](*p), T["geometry_msgs/Quaternion"](*q))
        cov = T["geometry_msgs/PoseWithCovariance"](pose, np.zeros(36))
        add("reference", "/odom", "nav_msgs/Odometry", t + 5, 5 * ms,
            {**position(p[1], p[0], -p[2]), **dict(zip(["vel_n", "vel_e", "vel_d"], ned)),
             **dict(zip(["roll", "pitch", "yaw"], angles(c)))},
            child_frame_id="base", pose=cov,
            twist=T["geometry_msgs/TwistWithCovariance"](
                T["geometry_msgs/Twist"](vector(v), vector(three())), np.zeros(36)))
        expect("motion", t + 5, motion("motion", p, q, FLU_FRD))
        q = rotation()
        c = ENU_NED @ matrix(q) @ FLU_FRD
        pose = T["geometry_msgs/Pose"](T["geometry_msgs/Point"](*p), T["geometry_msgs/Quaternion"](*q))
        add("pose", "/pose", "geometry_msgs/PoseWithCovarianceStamped", t + 6, 5 * ms,
            {**position(p[1], p[0], -p[2]), **dict(zip(["roll", "pitch", "yaw"], angles(c)))},
            pose=T["geometry_msgs/PoseWithCovariance"](pose, np.zeros(36)))
        expect("turned", t + 6, motion("turned", p, q, RIGHT @ FLU_FRD))
        pressure = 101325 + draw.uniform(0, 1e6)
        add("depth", "/pressure", "sensor_msgs/FluidPressure", t + 7, 5 * ms,
            {"depth": (pressure - 101325) / (1025 * 9.80665)}, fluid_pressure=pressure, variance=0.0)
        m = three()
        add("compass", "/mag", "sensor_msgs/MagneticField", t + 8, 5 * ms,
            {"heading": math.atan2(m[1], m[0]) % (2 * math.pi)}, magnetic_field=vector(m),
            magnetic_field_covariance=np.zeros(9))
        reach = float(np.float32(draw.uniform(1, 9)))
        add("echo", "/range", "sensor_msgs/Range", t + 9, 5 * ms, {"depth": reach},
            radiation_type=0, field_of_view=0.1, min_range=0.1, max_range=9.0, range=reach)
        part = T["wheel_msgs/Part"]
        parts = [part("p" * i, 3 * i + k, np.array([1.5, 2.5 + i], np.float32), True)
                 for i in range(3)]
        add("wheel", "/wheel", "wheel_msgs/Wheel", t + 10, 5 * ms,
            {"speed": -0.01 * (6 + k), "lateral": 3.5, "vertical": 7.0 + 1.0},
            label="wheel"[: k % 5], counts=np.array([1, 7], np.int16),
            flags=np.array([1, 2, 3], np.uint8), parts=parts)
# the frames of three sensors; the velocity log looks down
places = {
    "imu": ([0.1, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
    "dvl": ([1.0, 2.0, -3.0], [1.0, 0.0, 0.0, 0.0]),
    "base": ([0.3, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
    "fix": ([0.0, 0.5, 1.5], [0.0, 0.0, 0.0, 1.0]),
}
transforms = [
    T["geometry_msgs/TransformStamped"](
        T["std_msgs/Header"](T["builtin_interfaces/Time"](0, 0), frame_id="base_link"),
        child_frame_id=name,
        transform=T["geometry_msgs/Transform"](
            vector(p), T["geometry_msgs/Quaternion"](*q)),
    )
    for name, (p, q) in places.items()
]
messages.append((START, "/tf_static", "tf2_msgs/TFMessage", T["tf2_msgs/TFMessage"](transforms)))
messages.sort(key=lambda m: m[0])

KINDS = {
    "sqlite": (StoragePlugin.SQLITE3, CompressionMode.NONE),
    "sqlite-file": (StoragePlugin.SQLITE3, CompressionMode.FILE),
    "sqlite-message": (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "mcap-file": (StoragePlugin.MCAP, CompressionMode.FILE),
    "mcap-message": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "mcap-chunk": (StoragePlugin.MCAP, CompressionMode.STORAGE),
}


def write(path, version, storage, compression, content):
    writer = Writer(path, version=version, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for received, topic, kind, message in content:
            name = kind.replace("/", "/msg/")
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=store)
            writer.write(connections[topic], received, bytes(store.serialize_cdr(message, name)))


for name, (storage, compression) in KINDS.items():
    for version in (8, 9):
        write(folder / f"{name}-{version}", version, storage, compression, messages)
        print(f"{name}-{version}")

# split bags: the halves in one folder, without a description
for name, ending in (("sqlite", "db3"), ("mcap", "mcap")):
    split = folder / f"{name}-split"
    split.mkdir()
    for k, part in enumerate((messages[: len(messages) // 2], messages[len(messages) // 2 :])):
        half = folder / f"half-{name}-{k}"
        write(half, 9, KINDS[name][0], CompressionMode.NONE, part)
        (half / f"{half.name}.{ending}").rename(split / f"bag_{k}.{ending}")
    print(split.name)

# a bag of a version before Iron has no definitions; lz4 packs a file as older recorders did
plain = folder / "sqlite-plain"
shutil.copytree(folder / "sqlite-8", plain)
(plain / "sqlite-8.db3").rename(plain / "bag.db3")
database = sqlite3.connect(plain / "bag.db3")
database.execute("DROP TABLE IF EXISTS message_definitions")
database.commit()
database.execute("VACUUM")
database.close()
packed = folder / "mcap-lz4"
packed.mkdir()
raw = (folder / "mcap-9" / "mcap-9.mcap").read_bytes()
(packed / "bag_0.mcap.lz4").write_bytes(lz4.frame.compress(raw))
print(plain.name, packed.name)
samples = {sensor: sorted(rows.items()) for sensor, rows in expected.items()}
(folder / "expected.json").write_text(json.dumps(samples))
