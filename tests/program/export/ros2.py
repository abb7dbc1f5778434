"""Reads the bag of an export with `rosbags`, and compares it with the table in CSV.

Usage: ros2.py BAG TABLE
"""

import csv
import decimal
import pathlib
import sys

import numpy as np
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ORIGIN = 1_780_300_800 * 10**9  # 2026-06-01T08:00:00Z

bag = pathlib.Path(sys.argv[1])
with open(sys.argv[2]) as file:
    rows = list(csv.DictReader(file))
times = [int(decimal.Decimal(row["time_s"]) * 10**9) + ORIGIN for row in rows]

# the definitions in the bag, not those of the package
store = get_typestore(Stores.EMPTY)
messages = {"/odometry": [], "/fix": [], "/tf": []}
with Reader(bag) as reader:
    kinds = {c.topic: c.msgtype for c in reader.connections}
    assert kinds == {
        "/odometry": "nav_msgs/msg/Odometry",
        "/fix": "sensor_msgs/msg/NavSatFix",
        "/tf": "tf2_msgs/msg/TFMessage",
    }, kinds
    for connection in reader.connections:
        store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        assert connection.msgcount == len(rows), connection
    assert reader.message_count == 3 * len(rows)
    assert (reader.start_time, reader.end_time) == (times[0], times[-1] + 1)
    for connection, received, data in reader.messages():
        message = store.deserialize_cdr(data, connection.msgtype)
        messages[connection.topic].append((received, message))


def nanos(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


headers = {
    "/odometry": lambda m: m.header,
    "/fix": lambda m: m.header,
    "/tf": lambda m: m.transforms[0].header,
}
frames = {"/odometry": "map", "/fix": "base_link", "/tf": "map"}
for topic, found in messages.items():
    assert [received for received, _ in found] == times, topic
    assert [nanos(headers[topic](m)) for _, m in found] == times, topic
    assert {headers[topic](m).frame_id for _, m in found} == {frames[topic]}, topic
    messages[topic] = [m for _, m in found]
print("times: agrees")


def columns(*names):
    return np.array([[float(row[n]) for n in names] for row in rows])


def close(found, expected, tolerance, what):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape, f"{what}: {found.shape}, {expected.shape}"
    worst = np.abs(found - expected).max()
    assert worst <= tolerance, f"{what}: {worst}"


ENU = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
FLU = np.diag([1, -1, -1.0])
NAMES = [
    *(f"ins.attitude.{a}" for a in ("roll", "pitch", "yaw")),
    *(f"ins.velocity.{a}" for a in ("north", "east", "down")),
    *(f"ins.position.{a}" for a in ("north", "east", "down")),
]
UNITS = 3 * ["deg"] + 3 * ["mps"] + 3 * ["m"]
SCALE = np.array(3 * [np.pi / 180] + 6 * [1.0])


def covariance(row):
    """Covariance of attitude (rad), velocity and position from the upper triangle in the table."""
    p = np.empty((9, 9))
    for i in range(9):
        for j in range(9):
            pairs = [(i, j), (j, i)]
            keys = [f"{NAMES[a]}*{NAMES[b]}_cov_{UNITS[a]}*{UNITS[b]}" for a, b in pairs]
            p[i, j] = float(next(row[k] for k in keys if k in row)) * SCALE[i] * SCALE[j]
    return p


def matrix(roll, pitch, yaw):
    """C_b^n from roll, pitch and yaw, rad (Groves eq. 2.22)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array([
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ])


def rotation(q):
    """The matrix of a quaternion."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def xyz(v):
    return [v.x, v.y, v.z]


def derivative(f, x):
    """Jacobian by central differences; of order 1e-12 for functions of order one."""
    h = 1e-4
    steps = np.eye(len(x)) * h
    # of fourth order
    near = [(f(x + s) - f(x - s)) / (2 * h) for s in steps]
    far = [(f(x + 2 * s) - f(x - 2 * s)) / (4 * h) for s in steps]
    return np.column_stack([(4 * n - w) / 3 for n, w in zip(near, far)])


place = columns("ins.position.latitude_deg", "ins.position.longitude_deg", "ins.position.height_m")
velocity = columns("ins.velocity.north_mps", "ins.velocity.east_mps", "ins.velocity.down_mps")
angles = np.radians(columns("ins.attitude.roll_deg", "ins.attitude.pitch_deg", "ins.attitude.yaw_deg"))
c_b_n = np.array([matrix(*a) for a in angles])

fixes = messages["/fix"]
close([(f.latitude, f.longitude, f.altitude) for f in fixes], place, 1e-9, "fix")
assert {(f.status.status, f.position_covariance_type) for f in fixes} == {(0, 3)}
print("fix: agrees")

# in the tangent at the first position, with the radii of curvature there
latitude = np.radians(place[0, 0])
e2 = 6.69437999014e-3
w2 = 1 - e2 * np.sin(latitude) ** 2
north = 6378137 * (1 - e2) / w2**1.5 + place[0, 2]
east = (6378137 / np.sqrt(w2) + place[0, 2]) * np.cos(latitude)
moved = np.radians(place[:, :2] - place[0, :2])
enu = np.column_stack([moved[:, 1] * east, moved[:, 0] * north, place[:, 2] - place[0, 2]])
odometry = messages["/odometry"]
assert np.ptp(enu, axis=0).max() > 10, "the vehicle moves"
# the table has 1e-14 deg, which is 1e-9 m
close([xyz(o.pose.pose.position) for o in odometry], enu, 2e-9, "position")
close([rotation(o.pose.pose.orientation) for o in odometry], ENU @ c_b_n @ FLU, 1e-12, "attitude")
body = np.einsum("ij,kmj,km->ki", FLU, c_b_n, velocity)
close([xyz(o.twist.twist.linear) for o in odometry], body, 1e-12, "velocity")
assert {o.child_frame_id for o in odometry} == {"base_link"}
for k, (row, o, f) in enumerate(zip(rows, odometry, fixes)):
    p = covariance(row)
    fixed = c_b_n[k]

    def pose(x):
        turned = ENU @ matrix(*(angles[k] + x[:3])) @ fixed.T @ ENU.T
        vector = [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        return np.concatenate([ENU @ x[6:], np.array(vector) / 2])

    def twist(x):
        return FLU @ matrix(*(angles[k] + x[:3])).T @ (velocity[k] + x[3:6])

    for found, of in ((o.pose.covariance, pose), (o.twist.covariance, twist)):
        j = derivative(of, np.zeros(9))
        expected = j @ p @ j.T
        n = len(expected)
        found = found.reshape(6, 6)[:n, :n]
        sigma = np.sqrt(np.diag(expected))
        # correlations, by the rounding of the differences
        close(found / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), 1e-9, "correlation")
    expected = ENU @ p[6:, 6:] @ ENU.T
    close(f.position_covariance.reshape(3, 3), expected, 1e-9, "covariance of the fix")
    rest = np.zeros((6, 6))
    rest[:3, :3] = o.twist.covariance.reshape(6, 6)[:3, :3]
    rest[3, 3] = -1
    assert np.array_equal(o.twist.covariance.reshape(6, 6), rest), "no angular rate"
print("odometry: agrees")

for t, o in zip(messages["/tf"], odometry):
    [t] = t.transforms
    assert t.child_frame_id == "base_link"
    assert xyz(t.transform.translation) == xyz(o.pose.pose.position)
    assert rotation(t.transform.rotation).tolist() == rotation(o.pose.pose.orientation).tolist()
print("tf: agrees")
